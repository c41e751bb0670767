"""Commands for measured forces."""

import argparse
import json
from typing import Any

import numpy as np

from granforce.cli import frames
from granforce.cli.commands.packings import flaws_and_walls, named_columns
from granforce.cli.report_lines import INFER, INFORMATIVE
from granforce.cli.results import conditions, numbers, sample_notes, stored_result
from granforce.cli.tables import columns, of_contacts, write_table
from granforce.experiment.carrying import Carrying
from granforce.experiment.infer import Inference
from granforce.experiment.informative import Informative
from granforce.experiment.measurements import checked_calibration, read_measurement, read_pressures
from granforce.fields import fields
from granforce.labelled import from_store
from granforce.quantities import FORCE, whole
from granforce.records import InputError
from granforce.study import kinds
from granforce.system.terminal import print_notes, report_after
from granforce.tolerances import CARRYING


def informative(arguments: argparse.Namespace) -> None:
    """Rank contacts worth measuring, or load the ranking, and report them."""
    result = stored_result(
        *(arguments, kinds.INFORMATIVE, arguments.out),
        k=arguments.best,
        check=arguments.check,
        states=arguments.states,
        seed=arguments.sample_seed,
        **conditions(arguments),
    )
    dataset, scale = result.dataset, result.dataset["force_scale"].item()
    now, after = dataset["mean_before"].item(), dataset["mean_after"].values
    twins = [[int(c) for c in others] for others in json.loads(dataset.attrs["twins"])]
    declared = from_store(Informative, dataset, "expected_reduction")
    of_one = fields(Informative)
    declared["reduction"] = of_one["reduction"], 1 - after / now
    declared["mean_interval_after"] = of_one["after"]._replace(unit=FORCE), scale * after
    count = np.array([len(others) for others in twins], dtype=int)
    declared["number_of_twins"] = whole("contact", "contacts that give the same"), count
    table = of_contacts(arguments, result, declared)
    lines = result.report(INFORMATIVE, arguments, mean_interval_now=scale * now)
    ranked = {name: values.tolist() for name, values in columns(table).items()}
    ranked["twins"] = twins
    del ranked["number_of_twins"]
    worded = [" ".join(map(str, others)) or "none" for others in twins]
    with report_after(lines, arguments.json, ranked, twins=worded):
        if arguments.out is not None:
            write_table(arguments.out, table)


def calibrated_column(arguments: argparse.Namespace) -> tuple[str | None, list[float] | None]:
    """The column of --pressure-column and its --calibration, both or none."""
    text = arguments.calibration
    values = None if text is None else numbers("--calibration", text, float)
    if arguments.pressure_column is not None:
        checked_calibration(values)
    return arguments.pressure_column, values


def infer(arguments: argparse.Namespace) -> int | None:
    """Report the likeliest network of measured forces, with error bars on request."""
    if arguments.frames is not None:
        options = flaws_and_walls(arguments) | {"columns": named_columns(arguments)}
        column, calibration = calibrated_column(arguments)
        if column is not None:
            options["columns"] = (options["columns"] or {}) | {"pressure": column}
            options["calibration"] = calibration
        return frames.infer_frames(arguments, options)
    if arguments.measured is None and arguments.pressures is None:
        raise InputError(
            "give a packing and --measured FILE.csv or --pressures FILE.csv, or files of frames "
            "with --frames all"
        )
    if len(arguments.files) > 1:
        raise InputError("give one packing file, or add --frames all to read files of frames")
    arguments.packing = arguments.files[0] if arguments.files else None
    chosen, states = conditions(arguments), 1000 if arguments.states is None else arguments.states
    measured = None if arguments.measured is None else read_measurement(arguments.measured)
    pressures = None
    if arguments.pressures is not None:
        pressures = read_pressures(arguments.pressures, *calibrated_column(arguments))
    result = stored_result(
        *(arguments, kinds.INFERENCE, arguments.out),
        options={"measured": measured, "pressures": pressures},
        measured=measured,
        pressures=pressures,
        states=states,
        seed=arguments.sample_seed,
        chains=arguments.chains,
        unmeasured=arguments.unmeasured,
        again=arguments.again,
        certain=arguments.certain,
        **chosen,
    )
    dataset, scale = result.dataset, result.dataset["force_scale"].item()
    change = np.abs(dataset["inferred"].values - dataset["measured"].values)
    given: dict[str, Any] = {"contacts": len(change)}
    if measured is not None:
        used = int(np.isfinite(change).sum())
        listed = int(np.isfinite(measured.forces + measured.sigma).sum())
        given |= {
            "measured_components": used,
            "measured_where_nothing_can_carry": listed - used,
            "mean_change_of_f_n": float(np.nanmean(change[:, 0])),
            "suspects": dataset["suspect"].values.tolist(),
        }
    if pressures is not None:
        given["measured_pressures"] = int(np.isfinite(dataset["pressure_deviation"].values).sum())
        given["suspect_grains"] = dataset["suspect_grain"].values.tolist()
    if arguments.certain:
        least = dataset["least_normal"].values
        certain = np.flatnonzero(least > CARRYING * scale)
        order = certain[np.argsort(-least[certain], kind="stable")]
        given |= {"unmeasured_contacts": int(np.isfinite(least).sum())}
        given |= {"carry_for_certain": dataset["backbone"].values[order].tolist()}
    if states:
        given |= {"states": dataset.sizes["state"]}
        if "bounded" in dataset and not dataset["bounded"].item():
            note = (
                "S is unbounded: error bars of forces that the measurements do not bound depend on "
                f"--unmeasured, which is {dataset['unmeasured'].item():g} ⟨f_n⟩"
            )
            print_notes([note])
    with report_after(result.report(INFER, arguments, **given), arguments.json):
        if arguments.out is not None:
            declared = from_store(Inference, dataset) | from_store(Carrying, dataset)
            write_table(arguments.out, of_contacts(arguments, result, declared))
    if states and not arguments.again:  # those draws are independent
        print_notes(sample_notes(dataset))
    return None
