"""The command line: `granforce COMMAND --help` tells each command with an example."""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Sequence
from typing import NoReturn, TypeAlias

# Only the standard library up here: --help must not wait for numba, xarray and HiGHS.

LONGEST = 600  # characters of a message

EXAMPLE = argparse.RawDescriptionHelpFormatter

# What subcommands are added to.
Commands: TypeAlias = "argparse._SubParsersAction[_Parser]"


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; the exit code: 0, 1 (some cells failed), 2 (bad input) or 130 (Ctrl-C)."""
    arguments = _parser().parse_args(argv)
    from granforce.records import Cancelled, InputError
    from granforce.system.terminal import one_line

    usual, warnings.formatwarning = warnings.formatwarning, one_line
    try:
        from granforce.cli import commands
        from granforce.system.compiled import tell_when_compiling

        tell_when_compiling(_say_compiling)
        return getattr(commands, arguments.run)(arguments) or 0
    except InputError as error:
        return _refused(str(error))
    except MemoryError as error:
        return _refused(f"not enough memory: {str(error) or 'ask for less'}")
    except (KeyboardInterrupt, Cancelled):
        print("granforce: interrupted; finished entries are kept", file=sys.stderr)
        return 130
    except BrokenPipeError:
        sys.stderr.close()  # the reader of our output (head, less) has gone; that is no error
        return 0
    finally:
        warnings.formatwarning = usual


def _say_compiling() -> None:
    # As a line of progress, which later ones may follow on the same row.
    print("\rgranforce: compiling, once per machine …", file=sys.stderr)


def _refused(reason: str) -> int:
    line = " ".join(str(reason).split())
    if len(line) > LONGEST:  # a name of thousands of characters, say
        line = f"{line[: LONGEST // 2]} … {line[-LONGEST // 2 :]}"
    print(f"granforce: {line}", file=sys.stderr)
    return 2


class _Parser(argparse.ArgumentParser):
    """A parser that tells what is wrong in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(_refused(f"{message}; see {self.prog} --help"))


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="granforce",
        description="Explore how undetermined the forces in a packing of rigid disks are.",
        epilog="Example:\n  granforce walk -n 400 --mu 0.1 --seed 1 --states 1000",
        formatter_class=EXAMPLE,
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    _add_pack(commands)
    _add_walk(commands)
    _add_uniform(commands)
    _add_volume(commands)
    _add_infer(commands)
    _add_measure(commands)
    _add_scan(commands)
    commands.choices["sweep"] = commands.choices["scan"]  # its name before
    _add_intervals(commands)
    _add_limit_loads(commands)
    _add_stress(commands)
    _add_perturb(commands)
    _add_study(commands)
    _add_app(commands)
    _add_import(commands)
    _add_bench(commands)
    _add_cache(commands)
    return parser


def _command(
    commands: Commands, name: str, run: str, summary: str, example: str, *, reports: bool = True
) -> argparse.ArgumentParser:
    command = commands.add_parser(
        name,
        help=summary,
        description=summary[0].upper() + summary[1:] + ".",
        epilog=f"Example:\n  {example}",
        formatter_class=EXAMPLE,
        allow_abbrev=False,
    )
    command.set_defaults(run=run)
    if reports:
        command.add_argument("--json", action="store_true", help="print the report as JSON")
    return command


def _add_store(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--cache",
        metavar="FOLDER",
        help="store of results (default: $GRANFORCE_CACHE, else the user's cache folder)",
    )


def _add_packing(command: argparse.ArgumentParser, several: bool = False) -> None:
    group = command.add_argument_group("the packing")
    group.add_argument("-n", type=int, default=400, help="number of disks (default 400)")
    if not several:
        group.add_argument("--mu", type=float, help="friction coefficient μ")
        group.add_argument("--seed", type=int, default=1, help="random seed (default 1)")
    group.add_argument(
        "--radii",
        default="uniform:0.5,1",
        help="uniform:LOW,HIGH or bidisperse:SMALL,LARGE,FRACTION_LARGE, or a file with a radius "
        "per line (default uniform:0.5,1)",
    )
    group.add_argument("--pressure", type=float, default=1.0, help="pressure P0 (default 1)")
    group.add_argument("--dt", type=float, default=0.1, help="longest time step (default 0.1)")
    group.add_argument("--box-mass", type=float, default=100.0, help="box inertia (default 100)")
    group.add_argument("--sweeps", type=int, default=600, help="most sweeps per step (default 600)")
    group.add_argument(
        "--step-accuracy",
        type=float,
        default=0.01,
        help="breach of the contact laws that ends a step, relative to the fastest grain "
        "(default 0.01)",
    )
    group.add_argument(
        "--box",
        choices=("square", "isotropic"),
        default="square",
        help="square, or a cell whose sides and tilt follow until the stress is isotropic, so that "
        "the packing is jammed against shear too (default square)",
    )


def _add_any_packing(command: argparse.ArgumentParser) -> None:
    command.add_argument("--packing", metavar="FILE.npz", help="take this packing, make none")
    _add_packing(command)


def _add_conditions(command: argparse.ArgumentParser, known: bool = True) -> None:
    group = command.add_argument_group(
        "what the forces have to satisfy, beside balance and friction"
    )
    group.add_argument(
        "--prescribe",
        choices=["pressure", "stress", "none"],
        default="pressure",
        help="the pressure (default), the whole stress, or nothing (with --slice)",
    )
    group.add_argument(
        "--stress",
        metavar="XX,YY,XY",
        help="the stress that --prescribe stress asks for (default: that of the packing's forces)",
    )
    if known:
        _add_known(group)


def _add_known(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--known",
        metavar="FILE.csv",
        help="forces that are known: columns contact, and f_n, f_t (exactly) or f_n_min, f_n_max, "
        "f_t_min, f_t_max (bounds); empty fields say nothing",
    )


def _add_walk_options(command: argparse.ArgumentParser) -> None:
    group = command.add_argument_group("the random walk")
    group.add_argument("--states", type=int, default=1000, help="accepted states (default 1000)")
    group.add_argument("--walk-seed", type=int, default=0, help="seed of the walk (default 0)")
    group.add_argument("--ensemble-mu", type=float, help="friction of the cones, if not --mu")
    group.add_argument(
        "--relax",
        choices=["gauss_seidel", "gauss_seidel_only", "nearest", "accelerated"],
        default="accelerated",
        help="the nearest admissible network, by our own solver (default) or by PIQP, or the "
        "paper's contact dynamics with an exact finish or (slower, to 1e-6) without",
    )
    group.add_argument("--chains", type=int, default=1, help="independent chains (default 1)")
    group.add_argument("--workers", type=int, default=2, help="processors to use (default 2)")


def _add_pack(commands: Commands) -> None:
    command = _command(
        commands,
        "pack",
        "pack",
        "make a jammed packing, or find it in the store",
        "granforce pack -n 400 --mu 0.1 --seed 1 --out packing.npz\n"
        "  granforce pack --scene groove --mu 0.5",
    )
    command.add_argument(
        "--scene",
        metavar="NAME",
        help="a small scene in place of a packing made from a gas: groove, box, pyramid, press, "
        "leaning, column, six, solid or many; of the other options, it takes --mu alone",
    )
    _add_packing(command)
    _add_store(command)
    command.add_argument("--max-steps", type=int, default=100_000, help="step budget")
    command.add_argument("--out", metavar="FILE.npz", help="also save the packing to this file")


def _add_walk(commands: Commands) -> None:
    command = _command(
        commands,
        "walk",
        "walk",
        "walk at random through the force networks of a packing",
        "granforce walk -n 400 --mu 0.1 --seed 1 --states 1000",
    )
    _add_source(command)


def _add_source(command: argparse.ArgumentParser) -> None:
    _add_any_packing(command)
    _add_walk_options(command)
    _add_conditions(command)
    _add_store(command)


def _add_uniform(commands: Commands) -> None:
    command = _command(
        commands,
        "uniform",
        "uniform",
        "draw force networks of a packing uniformly, and tell how well that went",
        "granforce uniform -n 400 --mu 0.1 --seed 1 --states 1000 --effective 500",
    )
    _add_any_packing(command)
    group = command.add_argument_group("the sample")
    group.add_argument("--states", type=int, default=1000, help="at least so many (default 1000)")
    group.add_argument("--sample-seed", type=int, default=0, help="seed of the draws (default 0)")
    group.add_argument("--ensemble-mu", type=float, help="friction of the cones, if not --mu")
    group.add_argument("--chains", type=int, default=4, help="independent chains (default 4)")
    group.add_argument(
        "--effective", type=float, help="draw on until worth so many independent states"
    )
    group.add_argument("--workers", type=int, default=2, help="processors to use (default 2)")
    _add_conditions(command)
    _add_store(command)


def _add_volume(commands: Commands) -> None:
    command = _command(
        commands,
        "volume",
        "volume",
        "measure the volume of all force networks of a packing, with its standard error",
        "granforce volume -n 400 --mu 0.1 --seed 1 --accuracy 0.1",
    )
    _add_any_packing(command)
    group = command.add_argument_group("the volume")
    group.add_argument(
        "--accuracy",
        type=float,
        default=0.05,
        help="standard error of ln V that is wanted (default 0.05)",
    )
    group.add_argument("--volume-seed", type=int, default=0, help="seed of the draws (default 0)")
    group.add_argument("--ensemble-mu", type=float, help="friction of the cones, if not --mu")
    group.add_argument("--workers", type=int, default=2, help="processors to use (default 2)")
    _add_conditions(command)
    _add_store(command)


def _add_infer(commands: Commands) -> None:
    command = _command(
        commands,
        "infer",
        "infer",
        "find the admissible network that measured forces speak for, with error bars",
        "granforce infer --packing frame.npz --measured frame.csv --unmeasured 1\n"
        "  granforce infer folder --frames all --mu 0.5 --out series.zarr",
    )
    command.add_argument(
        "files",
        nargs="*",
        help="with --frames: a folder, *_solved.mat files, or positions and adjacency",
    )
    _add_any_packing(command)
    group = command.add_argument_group("the inference")
    group.add_argument(
        "--measured",
        metavar="FILE.csv",
        help="columns contact, f_n, f_t, sigma_n, sigma_t; empty or nan where not measured",
    )
    group.add_argument(
        "--unmeasured",
        type=float,
        help="what was not measured counts as 0 with an error of so many ⟨f_n⟩ (default 1000: any "
        "force; with --again 2, with --frames 1: a frame without a pressure wants about 1)",
    )
    group.add_argument(
        "--again",
        action="store_true",
        help="error bars for forces that came about by dynamics: the likeliest network is measured "
        "again and again (without: all networks are alike before the measurement)",
    )
    group.add_argument(
        "--states",
        type=int,
        help="draws for error bars (default 1000, with --frames 200; 0: none)",
    )
    group.add_argument(
        "--certain",
        action="store_true",
        help="also find which unmeasured contacts carry in every network within 3 σ, exactly",
    )
    group.add_argument("--sample-seed", type=int, default=0, help="seed of the draws (default 0)")
    group.add_argument("--ensemble-mu", type=float, help="friction of the cones, if not --mu")
    group.add_argument("--chains", type=int, default=4, help="independent chains (default 4)")
    group.add_argument("--workers", type=int, default=2, help="processors to use (default 2)")
    group.add_argument("--csv", metavar="FILE.csv", help="write the result per contact")
    _add_conditions(command)
    _add_store(command)
    series = command.add_argument_group("many photoelastic frames")
    series.add_argument(
        "--frames", help="all, or numbers separated by commas: import and infer each of them"
    )
    series.add_argument("--out", metavar="FOLDER.zarr", help="write all frames as one dataset")
    _add_reading(series)
    _add_flaws_and_walls(series)
    _add_scheduler(command)


def _add_measure(commands: Commands) -> None:
    command = _command(
        commands,
        "measure",
        "measure",
        "measure the indeterminacy of a walk, contact by contact if wanted",
        "granforce measure -n 400 --mu 0.1 --seed 1 --states 1000 --contacts contacts.csv",
    )
    _add_source(command)
    command.add_argument(
        "--contacts", metavar="FILE.csv", help="write f_n and its interval per contact"
    )


def _add_scan(commands: Commands) -> None:
    command = _command(
        commands,
        "scan",
        "scan",
        "packings and walks for many μ and seeds, over processes, resumable",
        "granforce scan --mu 0,0.01,0.1,1,10 --seeds 2 -n 400 --states 1000 --out scan.zarr",
    )
    command.add_argument("--mu", required=True, help="friction coefficients, separated by commas")
    command.add_argument("--seeds", type=int, default=1, help="packings per μ: seeds 1 … SEEDS")
    _add_packing(command, several=True)
    _add_walk_options(command)
    command.add_argument("--out", metavar="STORE", help="store for the results")
    _add_store(command)
    command.add_argument("--keep", type=int, help="store only so many states, evenly spaced")
    command.add_argument("--float32", action="store_true", help="store states in single precision")
    _add_scheduler(command)


def _add_study(commands: Commands) -> None:
    command = _command(
        commands,
        "study",
        "study_",
        "compute the paper's study, draw its figures and judge its claims, resumable",
        "granforce study --out study\n  granforce study --quick --out quick",
    )
    command.add_argument("--quick", action="store_true", help="a small version, in minutes")
    command.add_argument("--out", metavar="FOLDER", default="study", help="(default study)")
    command.add_argument(
        "--paper", action="store_true", help="compute what the paper did, with its own relaxation"
    )
    command.add_argument("--parts", help="compute only these parts, names separated by commas")
    command.add_argument(
        "--minutes",
        type=float,
        help="begin no cell after so many minutes; the same command goes on where it was",
    )
    command.add_argument(
        "--status",
        action="store_true",
        help="compute nothing: tell what of the parts is done, and about how long the rest takes",
    )
    command.add_argument(
        "--table",
        metavar="STORE",
        help="compute nothing: take this reduced study, as data/study.zarr",
    )
    command.add_argument(
        "--reduce",
        metavar="STORE",
        help="compute nothing: reduce the cells of this store, and take what it lacks from --table",
    )
    command.add_argument(
        "--documents",
        metavar="FILES",
        help="renew the tables in these files, between <!-- study: claims --> (or measures) and "
        "<!-- end -->; names separated by commas",
    )
    group = command.add_argument_group("size")
    group.add_argument("-n", type=int, help="number of disks (default 400)")
    group.add_argument("--mu", help="friction coefficients, separated by commas")
    group.add_argument("--packings", type=int, help="packings at each μ (default 10)")
    group.add_argument("--states", type=int, help="states of a walk (default 1000)")
    group.add_argument(
        "--many-packings", type=int, help="where η is largest, and at large μ (default 30)"
    )
    group.add_argument("--gauss-seidel-packings", type=int, help="walks as in the paper (10)")
    group.add_argument("--exact-packings", type=int, help="with exact intervals (default 3)")
    group.add_argument("--uniform-packings", type=int, help="with uniform states (default 10)")
    group.add_argument("--response-packings", type=int, help="pushed at contacts (default 10)")
    group.add_argument("--response-contacts", type=int, help="contacts pushed in each (default 20)")
    group.add_argument("--perturb-packings", type=int, help="pushed in larger steps (default 3)")
    group.add_argument("--perturb-contacts", type=int, help="contacts pushed in each (default 30)")
    group.add_argument("--sizes", help="other numbers of disks (default 100,200,800,1600)")
    command.add_argument("--workers", type=int, default=2, help="processes (default 2)")
    command.add_argument("--formats", default="html,png,svg", help="of the figures; empty: none")
    _add_scheduler(command)


def _add_scheduler(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="run on the workers of this dask scheduler, such as tcp://head:8786, which see the "
        "same store, in place of processes on this machine",
    )


def _add_exact(command: argparse.ArgumentParser) -> None:
    _add_any_packing(command)
    group = command.add_argument_group("the ensemble")
    group.add_argument("--ensemble-mu", type=float, help="friction of the cones, if not --mu")
    group.add_argument("--contacts", help="only these contacts, numbers separated by commas")
    group.add_argument(
        "--slice",
        metavar="X0,X1,Y0,Y1",
        help="freeze the forces on contacts outside this part of the box, such as 0.2,0.8,0,1",
    )
    group.add_argument("--workers", type=int, default=2, help="processors to use (default 2)")
    group.add_argument("--csv", metavar="FILE.csv", help="write the result per contact")
    _add_conditions(command)
    _add_store(command)


def _add_intervals(commands: Commands) -> None:
    command = _command(
        commands,
        "intervals",
        "intervals",
        "compute the exact interval of every contact force",
        "granforce intervals -n 400 --mu 0.1 --seed 1 --csv bounds.csv",
    )
    _add_exact(command)


def _add_limit_loads(commands: Commands) -> None:
    command = _command(
        commands,
        "limit-loads",
        "limit_loads",
        "compute the largest force pair each contact can be pushed apart with",
        "granforce limit-loads -n 400 --mu 0.1 --seed 1 --contacts 0,5,17",
    )
    _add_exact(command)


def _add_stress(commands: Commands) -> None:
    command = _command(
        commands,
        "stress",
        "stress",
        "compute which stresses the contacts can carry at their pressure, and the largest shear",
        "granforce stress -n 400 --mu 0.1 --seed 1 --csv outline.csv",
    )
    _add_any_packing(command)
    group = command.add_argument_group("the outline")
    group.add_argument("--ensemble-mu", type=float, help="friction of the cones, if not --mu")
    group.add_argument("--angles", type=int, default=64, help="directions told (default 64)")
    _add_known(group)
    group.add_argument("--workers", type=int, default=2, help="processors to use (default 2)")
    group.add_argument("--csv", metavar="FILE.csv", help="write the largest stress by direction")
    _add_store(command)


def _add_perturb(commands: Commands) -> None:
    command = _command(
        commands,
        "perturb",
        "perturb",
        "push the grains of single contacts apart until they set off: critical force and motion",
        "granforce perturb -n 400 --mu 0.1 --seed 1 --random 50",
    )
    _add_any_packing(command)
    group = command.add_argument_group("the perturbation")
    which = group.add_mutually_exclusive_group()
    which.add_argument("--random", type=int, default=50, help="so many contacts (default 50)")
    which.add_argument("--contacts", help="these contacts, numbers separated by commas")
    which.add_argument("--all", action="store_true", help="all contacts that carry")
    group.add_argument("--draw-seed", type=int, default=0, help="seed of --random (default 0)")
    group.add_argument("--ensemble-mu", type=float, help="friction of the contacts, if not --mu")
    group.add_argument(
        "--precision", type=float, default=0.01, help="of F_crit, in ⟨f_n⟩ (default 0.01)"
    )
    group.add_argument("--workers", type=int, default=2, help="processors to use (default 2)")
    group.add_argument("--csv", metavar="FILE.csv", help="write the result per contact")
    _add_conditions(command, known=False)
    _add_store(command)


def _add_app(commands: Commands) -> None:
    command = _command(
        commands,
        "app",
        "app",
        "open the page that shows packings and their force networks live, in a browser",
        "granforce app\n  granforce app --port 8080 --no-show",
        reports=False,
    )
    command.add_argument("--port", type=int, default=5006, help="(default 5006; 0: any free one)")
    command.add_argument(
        "--address", default="localhost", help="to listen at (default localhost: this machine only)"
    )
    command.add_argument(
        "--allow-websocket-origin",
        metavar="HOST[:PORT]",
        action="append",
        default=[],
        help="name under which other machines reach the page; may be given several times",
    )
    command.add_argument("--no-show", action="store_true", help="open no browser")
    command.add_argument("--warm", action="store_true", help="be ready before the first visitor")


def _add_import(commands: Commands) -> None:
    command = _command(
        commands,
        "import",
        "import_",
        "read a packing from elsewhere, check it and keep it",
        "granforce import lammps particles.dump contacts.dump --mu 0.3 --out packing.npz\n"
        "  granforce import table grains.csv contacts.csv --box 30 30 --mu 0.3 --out packing.npz\n"
        "  granforce import pegs positions.txt adjacency.txt --mu 0.5 --out frame.npz "
        "--measured frame.csv",
    )
    command.add_argument("format", choices=["lammps", "yade", "mercury", "table", "pegs"])
    command.add_argument(
        "grains",
        help="LAMMPS particle dump, bodies of YADE, .data of MercuryDPM, table with x, y, r, "
        "positions, or a *_solved.mat of PeGS 2",
    )
    command.add_argument(
        "contacts", nargs="?", help="LAMMPS contact dump, interactions, .fstat, table, or adjacency"
    )
    command.add_argument("--mu", type=float, required=True, help="friction coefficient μ")
    command.add_argument(
        "--box", type=float, nargs=2, metavar=("LX", "LY"), help="table, yade, mercury: box sides"
    )
    command.add_argument(
        "--columns", metavar="x=…,y=…", help="table: what columns are called in the files"
    )
    command.add_argument(
        "--tilt", type=float, default=0.0, help="table: tilt of the box, LAMMPS' xy (default 0)"
    )
    command.add_argument("--forces", action="store_true", help="table: fn, ft must be given")
    command.add_argument("--pressure", type=float, default=1.0, help="table without forces: P0")
    command.add_argument("--out", metavar="FILE.npz", help="save the packing to this file")
    group = command.add_argument_group("photoelastic frames (pegs)")
    group.add_argument("--frame", type=float, help="number of the frame (default: the last)")
    _add_reading(group)
    _add_flaws_and_walls(group)
    group.add_argument(
        "--measured", metavar="FILE.csv", help="write the measured forces, for granforce infer"
    )


def _add_reading(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--reach",
        type=float,
        default=0.5,
        help="largest gap of contacts that may have been missed, in mean radii (default 0.5; 0: "
        "none are added)",
    )
    group.add_argument("--scale", type=float, default=1.0, help="factor on the radii (default 1)")
    group.add_argument(
        "--error", type=float, help="standard error of a force (default: as the data suggest)"
    )
    group.add_argument(
        "--reverse", action="store_true", help="tangential forces have the other sign"
    )


def _add_flaws_and_walls(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--repair",
        type=float,
        metavar="PART",
        help="mend up to this part of the data (default 0.1); what was mended is told",
    )
    group.add_argument("--strict", action="store_true", help="mend nothing: the first flaw ends it")
    group.add_argument(
        "--walls",
        metavar="SHAPE",
        help="walls that count: box, annulus or circle, found from the grains at them or with "
        "numbers (box:x0,x1,y0,y1, annulus:x,y,inner,outer, circle:x,y,R); open: left open "
        "(default: where a *_solved.mat has the directions of their contacts)",
    )
    group.add_argument(
        "--wall-force",
        metavar="'WALL: FX FY SIGMA'",
        action="append",
        default=[],
        help="force of the grains on a wall of a box (left, right, bottom, top: by x and y), as a "
        "load cell measured it; may be given several times",
    )


def _add_bench(commands: Commands) -> None:
    command = _command(
        commands,
        "bench",
        "bench",
        "measure run time against error of every solver on this machine",
        "granforce bench --quick --out bench",
    )
    command.add_argument("--quick", action="store_true", help="small sizes, under 3 minutes")
    command.add_argument("--out", metavar="FOLDER", help="write the rows as JSON to this folder")


def _add_cache(commands: Commands) -> None:
    command = _command(
        commands,
        "cache",
        "cache",
        "list, size, clear or verify the store",
        "granforce cache verify --cache scan.zarr",
    )
    command.add_argument("action", choices=["list", "size", "clear", "verify"])
    command.add_argument("--kind", help="only entries of this kind (packing, walk, …)")
    _add_store(command)
