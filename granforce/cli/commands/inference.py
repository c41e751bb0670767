"""Commands for measured forces."""

import argparse
import json

import numpy as np

from granforce.cli import frames
from granforce.cli.commands.packings import flaws_and_walls, named_columns
from granforce.cli.report_lines import MIXING
from granforce.cli.results import (
    conditions,
    sample_notes,
    stored_result,
    unit,
    without_work,
)
from granforce.cli.tables import columns, of_contacts, write_table
from granforce.experiment.carrying import Carrying
from granforce.experiment.infer import Inference
from granforce.experiment.informative import Informative
from granforce.experiment.measurements import read_measurement
from granforce.fields import fields
from granforce.labelled import from_store
from granforce.quantities import FORCE, whole
from granforce.records import InputError
from granforce.study import kinds
from granforce.system.terminal import print_notes, report_after
from granforce.tolerances import CARRYING

INFERENCE_LINES = (*MIXING, "held", "setup_seconds", "sampling_seconds")


def informative(arguments: argparse.Namespace) -> None:
    """Rank contacts worth measuring, or load the ranking, and report them."""
    entry, parameters, dataset, ends = stored_result(
        *(arguments, kinds.INFORMATIVE, arguments.out),
        k=arguments.best,
        check=arguments.check,
        states=arguments.states,
        seed=arguments.sample_seed,
        **conditions(arguments),
    )
    now, after = dataset["mean_before"].item(), dataset["mean_after"].values
    forces, scale = unit(arguments, dataset), dataset["force_scale"].item()
    twins = [[int(c) for c in others] for others in json.loads(dataset.attrs["twins"])]
    declared = from_store(Informative, dataset, "expected_reduction")
    of_one = fields(Informative)
    declared["reduction"] = of_one["reduction"], 1 - after / now
    declared["mean_interval_after"] = of_one["after"]._replace(unit=FORCE), scale * after
    count = np.array([len(others) for others in twins], dtype=int)
    declared["number_of_twins"] = whole("contact", "contacts that give the same"), count
    table = of_contacts(arguments, parameters, dataset, declared)
    lines = {"entry": entry, **forces.reported({"mean_interval_now": scale * now}), **ends}
    ranked = {name: values.tolist() for name, values in columns(table).items()}
    ranked["twins"] = twins
    del ranked["number_of_twins"]
    worded = [" ".join(map(str, others)) or "none" for others in twins]
    with report_after(lines, arguments.json, ranked, twins=worded):
        if arguments.out is not None:
            write_table(arguments.out, table)


def infer(arguments: argparse.Namespace) -> int | None:
    """Report the likeliest network of measured forces, with error bars on request."""
    if arguments.frames is not None:
        options = flaws_and_walls(arguments) | {"columns": named_columns(arguments)}
        return frames.infer_frames(arguments, options)
    if arguments.measured is None:
        raise InputError(
            "give --measured FILE.csv and a packing, or files of frames with --frames all"
        )
    if len(arguments.files) > 1:
        raise InputError("give one packing file, or add --frames all to read files of frames")
    arguments.packing = arguments.files[0] if arguments.files else None
    chosen, states = conditions(arguments), 1000 if arguments.states is None else arguments.states
    measured = read_measurement(arguments.measured)
    entry, parameters, dataset, ends = stored_result(
        *(arguments, kinds.INFERENCE, arguments.out),
        options={"measured": measured},
        measured=measured,
        states=states,
        seed=arguments.sample_seed,
        chains=arguments.chains,
        unmeasured=arguments.unmeasured,
        again=arguments.again,
        certain=arguments.certain,
        **chosen,
    )
    forces, scale = unit(arguments, dataset), dataset["force_scale"].item()
    given = measured.forces + measured.sigma
    change = np.abs(dataset["inferred"].values - dataset["measured"].values)
    lines = {
        "entry": entry,
        "contacts": len(change),
        "measured_components": int(np.isfinite(change).sum()),
        "measured_where_nothing_can_carry": int(
            np.isfinite(given).sum() - np.isfinite(change).sum()
        ),
        "chi_square": dataset["chi_square"].item(),
        "freedom": dataset["freedom"].item(),
        **forces.reported({"mean_change_of_f_n": float(np.nanmean(change[:, 0]))}),
        "suspects": dataset["suspect"].values.tolist(),
    }
    if "unmeasured" in dataset:  # entries of earlier versions lack it
        lines["unmeasured_spread"] = dataset["unmeasured"].item()
    if arguments.certain:
        least = dataset["least_normal"].values
        certain = np.flatnonzero(least > CARRYING * scale)
        order = certain[np.argsort(-least[certain], kind="stable")]
        lines |= {"unmeasured_contacts": int(np.isfinite(least).sum())}
        lines |= {"carry_for_certain": dataset["backbone"].values[order].tolist()}
    if states and "bounded" in dataset and not dataset["bounded"].item():
        note = (
            "S is unbounded: error bars of forces that the measurements do not bound depend on "
            f"--unmeasured, which is {lines['unmeasured_spread']:g} ⟨f_n⟩"
        )
        print_notes([note])
    if states:
        error = dataset["standard_error"].values
        lines |= {"states": dataset.sizes["state"]}
        lines |= forces.reported({"mean_standard_error": error.mean()})
        lines |= {name: dataset[name].item() for name in INFERENCE_LINES}
    with report_after(without_work(lines | ends, arguments), arguments.json):
        if arguments.out is not None:
            declared = from_store(Inference, dataset) | from_store(Carrying, dataset)
            write_table(arguments.out, of_contacts(arguments, parameters, dataset, declared))
    if states and not arguments.again:  # those draws are independent
        print_notes(sample_notes(dataset))
    return None
