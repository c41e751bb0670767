"""Commands that make, import and export packings."""

import argparse
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from granforce.cli import frames
from granforce.cli.results import (
    PACKING_UNIT,
    check_outputs,
    get_packing,
    packing_parameters,
    required_mu,
    store_of,
    with_units,
)
from granforce.cli.tables import write_csv
from granforce.experiment.measurements import COLUMNS as MEASURED_COLUMNS
from granforce.experiment.pegs import read_pegs
from granforce.experiment.walls import read_wall_force
from granforce.packing import exporters, importers, scenes
from granforce.packing.importers.network import refuse_idle_reverse
from granforce.packing.importers.snapshots import Snapshots
from granforce.records import InputError, InputWarning, Packing, whole
from granforce.system.compiled import compile_ahead
from granforce.system.terminal import print_notes, print_report
from granforce.system.wording import number


def pack(arguments: argparse.Namespace) -> None:
    """Make or load a packing or a scene, and report it."""
    if arguments.scene is not None:
        return _scene(arguments)
    parameters = packing_parameters(arguments, required_mu(arguments), arguments.seed)
    max_steps = whole(arguments.max_steps, "--max-steps", 1)
    check_outputs(arguments.out)
    store = store_of(arguments)
    # Beside this process, which needs other kernels first.
    compile_ahead(
        "from granforce.packing import settling; settling.compile_kernels()", "flow.until_one_ends"
    )
    packing, cached = get_packing(store, parameters, max_steps=max_steps)
    reported = "steps", "sweeps_done", "largest_contact_gap", "least_other_gap", "distance_to_rest"
    work = {name: packing.info[name] for name in reported}
    lines = {
        **importers.report(packing),
        **work,
        "at_rest": bool(np.isfinite(work["distance_to_rest"])),
        "cached": cached,
    }
    _report(lines, packing, arguments)


def _report(
    lines: Mapping[str, Any],
    packing: Packing,
    arguments: argparse.Namespace,
    notes: Sequence[str] = (),
) -> None:
    """Save a packing if requested, then report it, even if it could not be saved; notes last."""
    try:
        if arguments.out is not None:
            importers.save_packing(packing, arguments.out)
    finally:
        print_report(with_units(lines), arguments.json)
        print_notes(notes)


def _scene(arguments: argparse.Namespace) -> None:
    check_outputs(arguments.out)
    options = scene_options(arguments.scene_options)
    packing = scenes.scene(arguments.scene, arguments.mu, **options)
    _report({"scene": arguments.scene, **importers.report(packing)}, packing, arguments)


def scene_options(text: str | None) -> dict[str, float]:
    """The numbers of 'name=number,…'; InputError for anything else."""
    if text is None:
        return {}
    pairs = importers.read_columns(text, "--scene-options")
    try:
        return {name: number(value) for name, value in pairs.items()}
    except ValueError:
        raise InputError(
            f"--scene-options {text[:40]!r}: give NAME=NUMBER,NAME=NUMBER, such as width=0.5"
        ) from None


# Reader of each format; that of pegs returns more than a packing.
READERS: dict[str, Callable[..., Packing]] = {
    "lammps": importers.read_lammps,
    "yade": importers.read_yade,
    "mercury": importers.read_mercury,
    "table": importers.read_table,
    "blocks": importers.read_blocks,
}
# Functions that open formats with many snapshots.
OPENERS: dict[str, Callable[..., Snapshots]] = {
    "lammps": importers.open_lammps,
    "mercury": importers.open_mercury,
}
# Arguments that are not options of a reader.
_NO_OPTIONS = ("command", "format", "run", "json", "grains", "contacts", "out")
_NO_OPTIONS += ("frames", "states", "walk_seed", "csv", "workers", "scheduler", "cache")


@contextmanager
def _notes_last() -> Iterator[None]:
    """Without the warnings of importers, whose notes are printed after the report."""
    with warnings.catch_warnings(action="ignore", category=InputWarning):
        yield


@_notes_last()
def import_(arguments: argparse.Namespace) -> int | None:
    """Import one packing or many, report and save. Returns 1 if one of many failed."""
    if getattr(arguments, "frames", None) is None:
        check_outputs(arguments.out)
    if arguments.format == "pegs":
        _import_pegs(arguments)
        return None
    options = {k: v for k, v in vars(arguments).items() if k not in _NO_OPTIONS and v is not None}
    if "columns" in options:
        options["columns"] = named_columns(arguments)
    if getattr(arguments, "frames", None) is not None:
        opened = OPENERS[arguments.format](arguments.grains, arguments.contacts, **options)
        return frames.import_frames(arguments, opened)
    files = [getattr(arguments, name) for name in ("grains", "contacts") if name in arguments]
    packing = READERS[arguments.format](*files, **options)
    named = ("timestep", "time", "contacts_skipped", "walls")
    info = {name: packing.info[name] for name in named if name in packing.info}
    lines = importers.report(packing) | info
    if "disks" in packing.info:  # behind each contact with a wall is a grain of its own
        lines |= {"contacts_with_walls": len(packing.r) - packing.info["disks"]}
    if arguments.json and "nearly_touching" in packing.info:
        lines |= {"nearly_touching": packing.info["nearly_touching"]}
    _report(lines, packing, arguments, packing.info.get("notes", []))
    return None


def _import_pegs(arguments: argparse.Namespace) -> None:
    """Import a photoelastic frame; report and save it with its measured forces."""
    check_outputs(arguments.measured)
    found = read_pegs(
        *(arguments.grains, arguments.contacts),
        mu=arguments.mu,
        frame=arguments.frame,
        columns=named_columns(arguments),
        **flaws_and_walls(arguments),
    )
    refuse_idle_reverse(found.measured, arguments.reverse)
    _report(found.report, found.packing, arguments, found.report.get("notes", []))
    if arguments.measured is not None:
        values = np.concatenate([found.measured, found.sigma], axis=1).T
        columns = {"contact": np.arange(len(found.measured))}
        columns |= PACKING_UNIT.named(dict(zip(MEASURED_COLUMNS, values, strict=True)))
        write_csv(arguments.measured, columns)


def named_columns(arguments: argparse.Namespace) -> dict[str, str] | None:
    """The names of columns in the files, from the options."""
    return None if arguments.columns is None else importers.read_columns(arguments.columns)


def export(arguments: argparse.Namespace) -> None:
    """Write a packing in a format of other programs."""
    check_outputs(arguments.grains, arguments.contacts)
    packing = importers.load_packing(arguments.packing)
    exporters.export(packing, arguments.grains, arguments.contacts)


def flaws_and_walls(arguments: argparse.Namespace) -> dict[str, Any]:
    """The options on repair and walls, as arguments of `read_pegs`."""
    repair = True if arguments.repair is None else arguments.repair
    forces = dict(read_wall_force(text) for text in arguments.wall_force)
    return {
        **{name: getattr(arguments, name) for name in ("reach", "scale", "error", "reverse")},
        "repair": False if arguments.strict else repair,
        "flag": arguments.flag,
        "walls": arguments.walls,
        "wall_forces": forces,
    }
