"""`infer --frames` and `import … --frames`: many frames, over processes, in one dataset."""

import argparse
import json
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from granforce.cli.results import PACKING_UNIT, Unit, check_outputs, distinct, with_units
from granforce.cli.tables import write_csv
from granforce.experiment.frames import frames_of
from granforce.experiment.repair import KINDS
from granforce.packing.importers.network import refuse_idle_reverse
from granforce.packing.importers.snapshots import Snapshots
from granforce.records import InputError, brief_list, whole, worker_count
from granforce.study import series
from granforce.study.evolution import SCALARS, evolution
from granforce.study.store import open_store
from granforce.system.terminal import Bar, print_list, print_notes
from granforce.system.wording import number as read_number

Number = TypeVar("Number", int, float)


def infer_frames(arguments: argparse.Namespace, options: dict[str, Any]) -> int:
    """Import and infer the requested frames; print a row for each. Returns 1 if one failed."""
    if arguments.mu is None:
        raise InputError("give the friction coefficient: --mu 0.5")
    if not arguments.files:
        raise InputError("--frames needs a folder, *_solved.mat files, or positions and adjacency")
    worker_count(arguments.workers, "--workers")
    frames = frames_of(*arguments.files, columns=options["columns"])
    numbers = _chosen([frame.number for frame in frames], arguments.frames)
    frames = [frame for frame in frames if frame.number in numbers]
    _check_out(arguments.out)
    store = open_store(arguments.cache)
    with Bar("frames", "frame") as progress:
        dataset, failed = series.infer_series(
            store.path,
            frames,
            mu=arguments.mu,
            states=series.STATES if arguments.states is None else arguments.states,
            seed=arguments.sample_seed,
            unmeasured=series.UNMEASURED if arguments.unmeasured is None else arguments.unmeasured,
            workers=arguments.workers,
            scheduler=arguments.scheduler,
            progress=progress,
            **options,
        )
    print_notes(f"frame {frame.number:g}: {message}" for frame, message in failed)
    if dataset is not None:
        print_notes(dataset.attrs["notes"])
        rows = _rows(dataset, arguments.unit)
        print_list(rows, tuple(rows[0]), arguments.json)
        if arguments.out is not None:
            series.save_series(dataset, arguments.out)
    return 1 if failed else 0


def import_frames(arguments: argparse.Namespace, snapshots: Snapshots) -> int:
    """Analyse the requested snapshots; print a row for each. Returns 1 if one failed."""
    states = whole(arguments.states, "--states", 0)
    worker_count(arguments.workers, "--workers")
    numbers = _chosen(snapshots.numbers, arguments.frames, snapshots.refusal)
    _check_out(arguments.out)
    check_outputs(arguments.csv)
    store = open_store(arguments.cache)
    print_notes(snapshots.notes)
    with Bar("snapshots", "cell") as progress:
        dataset, failed = evolution(
            store.path,
            snapshots,
            numbers,
            states=states,
            seed=arguments.walk_seed,
            workers=arguments.workers,
            scheduler=arguments.scheduler,
            progress=progress,
        )
    print_notes(f"{snapshots.word} {number}: {message}" for number, message in failed)
    if dataset is not None:
        refuse_idle_reverse(dataset["forces"].values, arguments.reverse)
        where: dict[str, list[str]] = {}
        for number, notes in json.loads(dataset.attrs["notes"]).items():
            for note in notes:
                where.setdefault(note, []).append(number)
        print_notes(f"{snapshots.word} {brief_list(some)}: {note}" for note, some in where.items())
        columns = with_units({name: dataset[name].values for name in ("frame", *SCALARS)})
        lists = {name: values.tolist() for name, values in columns.items()}
        rows = [dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=True)]
        print_list(rows, tuple(columns), arguments.json)
        if arguments.out is not None:
            series.save_series(dataset, arguments.out)
        if arguments.csv is not None:
            write_csv(arguments.csv, columns)
    return 1 if failed else 0


def _check_out(path: str | None) -> None:
    """InputError if many frames cannot be written to --out."""
    if path is not None and not path.endswith(".zarr"):
        raise InputError(f"--out {path}: with --frames the name must end with .zarr")
    check_outputs(path)


def _chosen(
    available: Sequence[Number], text: str, refusal: Callable[[float], InputError] | None = None
) -> list[Number]:
    """The numbers of the requested frames; refusal(number): the error of one that is not there."""
    if text == "all":
        return list(available)
    numbers = set(distinct("--frames", text, read_number, "all, or ") or [])
    for number in sorted(numbers - set(available)):
        if refusal is not None:
            raise refusal(number)
        raise InputError(
            f"no frame {number:g}; the frames are {min(available):g} … {max(available):g}"
        )
    return [number for number in available if number in numbers]


def _rows(dataset: xr.Dataset, word: str) -> list[dict[str, Any]]:
    """A row for each frame; word: packing, or mean for its mean measured normal force."""
    rows = []
    for k, number in enumerate(dataset["frame"].values.tolist()):
        one = dataset.isel(frame=k)
        mean = Unit("mean measured", float(dataset["unit"][k]))
        unit = mean if word == "mean" else PACKING_UNIT
        account = dict(zip(dataset["kind"].values, one["account"].values, strict=True))
        mended = sum(int(account[kind]) for kind in KINDS if KINDS[kind].repaired)
        rows.append(
            {
                "frame": number,
                "grains": int(account["grains"]),
                "contacts": int(account["contacts_listed"]),
                "mended": mended,
                "unbalanced": int(account["unbalanced"]),
                "chi_square": float(one["chi_square"]),
                "freedom": int(one["freedom"]),
            }
        )
        if "standard_error" in one:
            moved = np.abs(one["change"].values) > 3 * one["change_error"].values
            error = float(np.nanmean(one["standard_error"].values))
            rows[-1] |= unit.reported({"mean_standard_error": error})
            rows[-1]["changed"] = int(moved.any(axis=1).sum())
    return rows
