"""Options that several commands share."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any, TypeAlias

from granforce.cli.parsing import Input, Output, Parser, StorePath
from granforce.cli.report_lines import FEW, IMPORT, PEGS, explained
from granforce.glossary import RELAXATIONS
from granforce.system.wording import number

EXAMPLE = argparse.RawDescriptionHelpFormatter
# Commands whose names are reserved in Python or used by a package: their functions end in "_".
_TAKEN = ("import", "study")
# The object to which subcommands are added.
Commands: TypeAlias = "argparse._SubParsersAction[Parser]"


def subcommand(
    commands: Commands,
    name: str,
    summary: str,
    example: str,
    *,
    reports: bool = True,
    lines: tuple[str, ...] = (),
    columns: tuple[str, ...] = (),
) -> Parser:
    """Add a command, which runs the function of its name in `granforce.cli.commands`.

    lines: those of its report that the help explains; columns: those of its list of contacts.
    """
    report = f"Lines of the report:\n{explained(lines)}\n\n" if lines else ""
    if columns:
        report += f"At most {FEW} contacts are listed, with columns\n{explained(columns)}\n\n"
    command = commands.add_parser(
        name,
        help=summary,
        description=summary[0].upper() + summary[1:] + ".",
        epilog=f"{report}Example:\n  {example}",
        formatter_class=EXAMPLE,
        allow_abbrev=False,
    )
    function = name.replace("-", "_")
    command.set_defaults(run=f"{function}_" if name in _TAKEN else function)
    if reports:
        command.add_argument("--json", action="store_true", help="print the report as JSON")
    return command


def import_format(
    formats: Commands,
    name: str,
    summary: str,
    example: str,
    grains: str,
    contacts: str | None,
    *,
    contacts_needed: bool = True,
    series: bool = False,
) -> Parser:
    """Add a format of `granforce import`, with the options common to all formats.

    series: whether many snapshots can be written, to a folder.

    Options are named after the arguments of the format's reader in `granforce.packing.importers`.
    """
    command = subcommand(
        *(formats, name, summary),
        f"granforce import {name} {example} --mu 0.3 --out packing.npz",
        lines=PEGS if name == "pegs" else IMPORT,
    )
    command.set_defaults(run="import_")
    command.add_argument("grains", type=Input, help=grains)
    if contacts is not None:
        command.add_argument(
            "contacts", type=Input, nargs=None if contacts_needed else "?", help=contacts
        )
    command.add_argument("--mu", type=float, required=True, help="friction coefficient μ")
    command.add_argument(
        "--out",
        type=Output,
        suffixes=("npz", "zarr") if series else ("npz",),
        help="save the packing to this file",
    )
    return command


def add_cell(command: Parser) -> None:
    command.add_argument(
        "--box",
        type=float,
        nargs=2,
        metavar=("LX", "LY"),
        help="sides of the periodic box (default: open)",
    )
    command.add_argument(
        "--tilt", type=float, default=0.0, help="tilt of the box, xy in LAMMPS (default 0)"
    )


def add_frame(command: Parser, number: str) -> None:
    command.add_argument("--frame", type=int, help=f"{number} (default: the last complete one)")


def add_series(command: Parser) -> None:
    """Add the options for one dataset of many snapshots; call `add_frame` first."""
    others = command.options.keys()
    group = command.add_argument_group(
        "many snapshots",
        "with --frames: write exact intervals of all snapshots to one dataset (--out FOLDER.zarr), "
        "and print one line per snapshot",
    )
    group.add_argument(
        "--frames", type=str, listed=True, help="snapshots: all, or numbers separated by commas"
    )
    group.add_argument(
        "--states", type=int, default=0, help="states of a random walk, for η1 and η2 (default 0)"
    )
    group.add_argument("--walk-seed", type=int, default=0, help="seed of the walk (default 0)")
    group.add_argument("--csv", type=Output, suffixes=("csv",), help="write these lines as a table")
    add_workers(group)
    add_scheduler(group)
    add_store(group)
    series = command.options.keys() - others - {"frames"}
    command.leaves_out("without --frames", lambda arguments: arguments.frames is None, series)
    command.leaves_out("with --frames", lambda arguments: arguments.frames is not None, {"frame"})
    command.leaves_out(
        "without --states",
        lambda arguments: arguments.frames and not arguments.states,
        {"walk_seed"},
    )


def add_columns(
    command: argparse._ActionsContainer, what: str = "names of the columns in the files"
) -> None:
    command.add_argument("--columns", type=str, listed=True, metavar="x=…,y=…", help=what)


def add_reverse(command: argparse._ActionsContainer) -> None:
    command.add_argument(
        "--reverse", action="store_true", help="reverse the sign of tangential forces"
    )


def add_wall_contacts(command: Parser) -> None:
    command.add_argument(
        "--walls",
        choices=("held", "pressing"),
        help="treat walls as grains: held (able to exert any force) or pressing (exerting the "
        "force recorded in the simulation); default: forces from walls are loads on grains",
    )


def add_store(command: argparse._ActionsContainer) -> None:
    command.add_argument(
        "--cache",
        type=StorePath,
        metavar="FOLDER",
        help="store of results (default: $GRANFORCE_CACHE, else the user's cache folder)",
    )


def spec_or_file(word: str) -> str:
    """Radii as typed: a distribution with its numbers, or a file."""
    return word if ":" in word else Input(word)


def add_packing(command: Parser, several: bool = False, expert: bool = False) -> None:
    group = command.add_argument_group("the packing")
    group.add_argument("-n", type=int, default=400, help="number of disks (default 400)")
    if not several:
        group.add_argument("--mu", type=float, help="friction coefficient μ")
        group.add_argument("--seed", type=int, default=1, help="random seed (default 1)")
    group.add_argument(
        "--radii",
        type=spec_or_file,
        default="uniform:0.5,1",
        help="uniform:LOW,HIGH, bidisperse:SMALL,LARGE,FRACTION_LARGE, or a file with one radius "
        "per line (default uniform:0.5,1)",
    )
    group.add_argument("--pressure", type=float, default=1.0, help="pressure P0 (default 1)")
    group.add_argument(
        "--box",
        choices=("square", "isotropic"),
        default="square",
        help="square (default), or a cell whose sides and tilt adapt until the stress is "
        "isotropic, so that the packing is also jammed against shear",
    )
    _add_compaction(command, shown=expert)


def _add_compaction(command: Parser, shown: bool) -> None:
    """Add the settings of the compaction, which only commands that are about packings explain."""
    settings: tuple[tuple[str, type, Any, str], ...] = (
        ("--dt", float, None, "maximum time step (default 0.1; 0.03 for μ ≥ 0.2)"),
        ("--box-mass", float, 100.0, "inertia of the box (default 100)"),
        ("--sweeps", int, None, "maximum number of sweeps per step (default 600; 150 for μ ≥ 0.2)"),
        (
            *("--step-accuracy", float, 0.01),
            "largest violation of the contact laws at the end of a step, relative to the speed of "
            "the fastest grain (default 0.01)",
        ),
        (
            *("--drag-below", float, None),
            "drag replaces inertia once no grain's momentum changes by more than this in a step, "
            "in ⟨f_n⟩ (default 0.02, less above 2000 disks; not used for μ ≤ 10⁻⁴)",
        ),
    )
    group = command.add_argument_group("expert settings of the compaction") if shown else command
    for name, kind, usual, words in settings:
        group.add_argument(
            name, type=kind, default=usual, help=words if shown else argparse.SUPPRESS
        )


def add_packing_file(command: Parser, needed: bool = True) -> None:
    command.add_argument(
        "packing",
        type=Input,
        nargs=None if needed else "?",
        suffixes=("npz",),
        help="file of the packing" if needed else "use this packing instead of making one",
    )


def add_any_packing(command: Parser) -> None:
    add_packing_file(command, needed=False)
    add_made_packing(command, lambda arguments: arguments.packing is not None)


def add_made_packing(command: Parser, given: Callable[[argparse.Namespace], bool]) -> None:
    """Add the options of a packing to be made, refused where a file has been given."""
    others = set(command.options)
    add_packing(command)
    names = command.options.keys() - others
    command.leaves_out("with the file of a packing", given, names)


def add_conditions(command: Parser, known: bool = True, also: str = "") -> None:
    """Add the conditions on S; also: words on --prescribe in this command."""
    group = command.add_argument_group(
        "conditions on the forces, in addition to equilibrium and friction"
    )
    group.add_argument(
        "--prescribe",
        choices=["pressure", "stress", "none"],
        help="prescribe the pressure (default in a periodic box), the whole stress (periodic box "
        f"only), or nothing (default in an open box{also})",
    )
    group.add_argument(
        "--stress",
        type=str,
        metavar="XX,YY,XY",
        help="stress for --prescribe stress (default: that of the packing's original forces)",
    )
    if known:
        add_known(group)


def add_known(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--known",
        type=Input,
        suffixes=("csv", "npz", "zarr"),
        help="known forces, in the packing's units: columns contact, and f_n, f_t (exact) or "
        "f_n_low, f_n_high, f_t_low, f_t_high (bounds), as written by intervals with --out; empty "
        "fields, nan and infinite bounds are ignored",
    )


def add_ensemble_mu(group: argparse._ActionsContainer) -> None:
    group.add_argument(
        "--ensemble-mu",
        type=float,
        help="friction coefficient of the Coulomb cones, if different from the packing's",
    )


def add_walk_options(command: Parser) -> None:
    group = command.add_argument_group("the random walk")
    group.add_argument(
        "--states", type=int, default=1000, help="number of accepted states (default 1000)"
    )
    group.add_argument("--walk-seed", type=int, default=0, help="seed of the walk (default 0)")
    add_ensemble_mu(group)
    group.add_argument(
        "--relax",
        choices=list(RELAXATIONS),
        default="nearest",
        help="relaxation of a state: nearest (default: the nearest-network walk) and nearest_piqp "
        "(a check by PIQP) move to the nearest network; gauss_seidel_only is the paper's walk, by "
        "Gauss–Seidel sweeps to a residual of 1e-6; gauss_seidel sweeps to 1e-3 and finishes with "
        "the nearest network",
    )
    group.add_argument("--chains", type=int, default=1, help="independent chains (default 1)")
    add_workers(group)


def add_source(command: Parser) -> None:
    add_any_packing(command)
    add_walk_options(command)
    add_conditions(command)
    add_store(command)


def add_unit(command: argparse._ActionsContainer) -> None:
    command.add_argument(
        "--unit",
        choices=["packing", "mean"],
        default="packing",
        help="units of forces in reports and tables: those of the packing (default), or the mean "
        "normal force ⟨f_n⟩; column names include the unit",
    )


def walls(word: str) -> str | list[list[float]]:
    """Walls as typed: a name, or segments X,Y,X,Y separated by blanks."""
    if "," not in word:
        return word
    try:
        segments = [[number(part) for part in segment.split(",")] for segment in word.split()]
    except ValueError:
        segments = []
    if any(len(segment) != 4 for segment in segments) or not segments:
        raise argparse.ArgumentTypeError(f"{word[:40]!r}: give segments X,Y,X,Y")
    return segments


def add_out(command: argparse._ActionsContainer, what: str, also: str = "") -> None:
    command.add_argument(
        "--out",
        type=Output,
        suffixes=("csv", "npz", "zarr"),
        help=f"write {what}: a table (.csv), arrays (.npz) or an xarray dataset (.zarr){also}",
    )


def add_picture(command: Parser) -> None:
    command.add_argument(
        "--out",
        type=Output,
        required=True,
        suffixes=("png", "svg", "pdf", "html"),
        help="write a picture, or a page that can be zoomed (.html)",
    )


def add_states_out(command: Parser) -> None:
    add_out(command, "the states")
    add_unit(command)
    command.leaves_out("without --out", lambda arguments: arguments.out is None, {"unit"})


def add_workers(command: argparse._ActionsContainer) -> None:
    command.add_argument("--workers", type=int, default=2, help="processors to use (default 2)")


def add_scheduler(command: argparse._ActionsContainer) -> None:
    command.add_argument(
        "--scheduler",
        type=str,
        metavar="ADDRESS",
        help="run on the workers of this dask scheduler, such as tcp://head:8786, instead of "
        "local processes. Workers must see the same store. Without workers, the run ends after 10 "
        "minutes",
    )


def add_exact(command: Parser) -> None:
    """Add the options of exact results."""
    add_any_packing(command)
    group = command.add_argument_group("the ensemble")
    add_ensemble_mu(group)
    group.add_argument(
        "--contacts",
        type=str,
        listed=True,
        help="only the contacts with these numbers, separated by commas",
    )
    group.add_argument(
        "--slice",
        type=str,
        metavar="X0,X1,Y0,Y1",
        help="freeze the forces on contacts outside this part of the box, given as fractions of "
        "its sides, such as 0.2,0.8,0,1",
    )
    add_workers(group)
    add_out(group, "the result per contact")
    add_unit(group)
    add_conditions(command, also=", and with --slice")
    add_store(command)
    command.leaves_out(
        "with --slice, where the frozen contacts determine the stress",
        lambda given: given.slice is not None and given.prescribe != "none",
        {"prescribe", "stress"},
    )


def add_reading(group: argparse._ActionsContainer) -> None:
    group.add_argument(
        "--reach",
        type=float,
        default=0.5,
        help="largest gap of candidate contacts, in mean radii (default 0.5; 0: no candidates)",
    )
    group.add_argument(
        "--scale", type=float, default=1.0, help="factor that multiplies the radii (default 1)"
    )
    group.add_argument(
        "--error", type=float, help="standard error of a force (default: estimated from the data)"
    )
    add_reverse(group)
    add_columns(
        group, "names or numbers (from 1) of the columns frame, id, x, y, r, flag, i, j, f_t, f_n"
    )


def add_flaws_and_walls(command: Parser, group: argparse._ActionsContainer) -> None:
    """Add the options on the repair and the walls of a frame to a group of a command."""
    group.add_argument(
        "--flag",
        choices=["ignore"],
        help="ignore the flags of the grains and treat grains at the boundary of the frame as "
        "grains at walls (default: the flagged grains are treated as grains at walls, unless "
        "nearly all are flagged)",
    )
    group.add_argument(
        "--repair",
        type=float,
        metavar="PART",
        help="repair up to this fraction of the data (default 0.1); the report lists every repair",
    )
    group.add_argument(
        "--strict", action="store_true", help="repair nothing; stop at the first error"
    )
    group.add_argument(
        "--walls",
        type=str,
        metavar="SHAPE",
        help="walls of the frame: box, annulus, circle or auto (the best fit), detected from the "
        "grains at the boundary or specified (box:x0,x1,y0,y1, annulus:x,y,inner,outer, "
        "circle:x,y,R); open: no walls (default for a *_solved.mat with the directions of wall "
        "contacts)",
    )
    group.add_argument(
        "--wall-force",
        type=str,
        metavar="'WALL: FX FY SIGMA'",
        action="append",
        default=[],
        help="measured force of the grains on a wall of a box (left, right, bottom, top), for "
        "example from a load cell; can be repeated",
    )
    command.leaves_out("with --strict", lambda arguments: arguments.strict, {"repair"})
