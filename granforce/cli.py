"""The command line: `granforce COMMAND --help` tells each command with an example."""

import argparse
import sys

# Only the standard library up here: --help must not wait for numba, xarray and HiGHS.

EXAMPLE = argparse.RawDescriptionHelpFormatter


def main(argv=None):
    """Run one command; the exit code: 0, 1 (some cells failed), 2 (bad input) or 130 (Ctrl-C)."""
    arguments = _parser().parse_args(argv)
    from granforce.records import Cancelled, InputError

    try:
        from granforce import commands

        return getattr(commands, arguments.run)(arguments) or 0
    except InputError as error:
        print(f"granforce: {error}", file=sys.stderr)
        return 2
    except (KeyboardInterrupt, Cancelled):
        print("granforce: interrupted; finished entries are kept", file=sys.stderr)
        return 130
    except BrokenPipeError:
        sys.stderr.close()  # the reader of our output (head, less) has gone; that is no error
        return 0


def _parser():
    parser = argparse.ArgumentParser(
        prog="granforce",
        description="Explore how undetermined the forces in a packing of rigid disks are.",
        epilog="Example:\n  granforce walk -n 400 --mu 0.1 --seed 1 --states 1000",
        formatter_class=EXAMPLE,
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    _add_pack(commands)
    _add_walk(commands)
    _add_uniform(commands)
    _add_measure(commands)
    _add_sweep(commands)
    _add_intervals(commands)
    _add_limit_loads(commands)
    _add_perturb(commands)
    _add_study(commands)
    _add_import(commands)
    _add_bench(commands)
    _add_cache(commands)
    return parser


def _command(commands, name, run, summary, example):
    command = commands.add_parser(
        name,
        help=summary,
        description=summary[0].upper() + summary[1:] + ".",
        epilog=f"Example:\n  {example}",
        formatter_class=EXAMPLE,
        allow_abbrev=False,
    )
    command.set_defaults(run=run)
    command.add_argument("--json", action="store_true", help="print the report as JSON")
    return command


def _add_store(command):
    command.add_argument(
        "--cache",
        metavar="FOLDER",
        help="store of results (default: $GRANFORCE_CACHE, else the user's cache folder)",
    )


def _add_packing(command, several=False):
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
    group.add_argument("--dt", type=float, default=0.01, help="time step (default 0.01)")
    group.add_argument("--box-mass", type=float, default=100.0, help="box inertia (default 100)")
    group.add_argument("--sweeps", type=int, default=100, help="sweeps per step (default 100)")


def _add_any_packing(command):
    command.add_argument("--packing", metavar="FILE.npz", help="take this packing, make none")
    _add_packing(command)


def _add_walk_options(command):
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


def _add_pack(commands):
    command = _command(
        commands,
        "pack",
        "pack",
        "make a jammed packing, or find it in the store",
        "granforce pack -n 400 --mu 0.1 --seed 1 --out packing.npz",
    )
    _add_packing(command)
    _add_store(command)
    command.add_argument("--max-steps", type=int, default=100_000, help="step budget")
    command.add_argument("--out", metavar="FILE.npz", help="also save the packing to this file")


def _add_walk(commands):
    command = _command(
        commands,
        "walk",
        "walk",
        "walk at random through the force networks of a packing",
        "granforce walk -n 400 --mu 0.1 --seed 1 --states 1000",
    )
    _add_source(command)


def _add_source(command):
    _add_any_packing(command)
    _add_walk_options(command)
    _add_store(command)


def _add_uniform(commands):
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
    _add_store(command)


def _add_measure(commands):
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


def _add_sweep(commands):
    command = _command(
        commands,
        "sweep",
        "sweep",
        "packings and walks for many μ and seeds, over processes, resumable",
        "granforce sweep --mu 0,0.01,0.1,1,10 --seeds 2 -n 400 --states 1000 --out sweep.zarr",
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


def _add_study(commands):
    command = _command(
        commands,
        "study",
        "study_",
        "compute the paper's study, draw its figures and judge its claims, resumable",
        "granforce study --out study\n  granforce study --quick --out quick",
    )
    command.add_argument("--quick", action="store_true", help="a small version, in minutes")
    command.add_argument("--out", metavar="FOLDER", default="study", help="(default study)")
    command.add_argument("--parts", help="compute only these parts, names separated by commas")
    command.add_argument(
        "--table",
        metavar="STORE",
        help="compute nothing: take this reduced study, as data/study.zarr",
    )
    group = command.add_argument_group("size")
    group.add_argument("-n", type=int, help="number of disks (default 400)")
    group.add_argument("--mu", help="friction coefficients, separated by commas")
    group.add_argument("--packings", type=int, help="packings at each μ (default 10)")
    group.add_argument("--states", type=int, help="states of a walk (default 1000)")
    group.add_argument("--gauss-seidel-packings", type=int, help="walks as in the paper (2)")
    group.add_argument("--exact-packings", type=int, help="with exact intervals (default 3)")
    group.add_argument("--uniform-packings", type=int, help="with uniform states (default 3)")
    group.add_argument("--perturb-packings", type=int, help="pushed at contacts (default 3)")
    group.add_argument("--perturb-contacts", type=int, help="contacts pushed in each (default 30)")
    group.add_argument("--sizes", help="other numbers of disks (default 100,200,800,1600)")
    command.add_argument("--workers", type=int, default=2, help="processes (default 2)")
    command.add_argument("--formats", default="html,png,svg", help="of the figures; empty: none")
    _add_scheduler(command)


def _add_scheduler(command):
    command.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="run on the workers of this dask scheduler, such as tcp://head:8786, which see the "
        "same store, in place of processes on this machine",
    )


def _add_exact(command):
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
    _add_store(command)


def _add_intervals(commands):
    command = _command(
        commands,
        "intervals",
        "intervals",
        "compute the exact interval of every contact force",
        "granforce intervals -n 400 --mu 0.1 --seed 1 --csv bounds.csv",
    )
    _add_exact(command)


def _add_limit_loads(commands):
    command = _command(
        commands,
        "limit-loads",
        "limit_loads",
        "compute the largest force pair each contact can be pushed apart with",
        "granforce limit-loads -n 400 --mu 0.1 --seed 1 --contacts 0,5,17",
    )
    _add_exact(command)


def _add_perturb(commands):
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
    _add_store(command)


def _add_import(commands):
    command = _command(
        commands,
        "import",
        "import_",
        "read a packing from elsewhere, check it and keep it",
        "granforce import lammps particles.dump contacts.dump --mu 0.3 --out packing.npz\n"
        "  granforce import table grains.csv contacts.csv --box 30 30 --mu 0.3 --out packing.npz",
    )
    command.add_argument("format", choices=["lammps", "table"])
    command.add_argument("grains", help="LAMMPS particle dump, or table with x, y, r")
    command.add_argument("contacts", nargs="?", help="LAMMPS contact dump, or table with i, j")
    command.add_argument("--mu", type=float, required=True, help="friction coefficient μ")
    command.add_argument(
        "--box", type=float, nargs=2, metavar=("LX", "LY"), help="table: box sides"
    )
    command.add_argument("--forces", action="store_true", help="table: fn, ft must be given")
    command.add_argument("--pressure", type=float, default=1.0, help="table without forces: P0")
    command.add_argument("--out", metavar="FILE.npz", help="save the packing to this file")


def _add_bench(commands):
    command = _command(
        commands,
        "bench",
        "bench",
        "measure run time against error of every solver on this machine",
        "granforce bench --quick --out bench",
    )
    command.add_argument("--quick", action="store_true", help="small sizes, under 3 minutes")
    command.add_argument("--out", metavar="FOLDER", help="write the rows as JSON to this folder")


def _add_cache(commands):
    command = _command(
        commands,
        "cache",
        "cache",
        "list, size, clear or verify the store",
        "granforce cache verify --cache sweep.zarr",
    )
    command.add_argument("action", choices=["list", "size", "clear", "verify"])
    command.add_argument("--kind", help="only entries of this kind (packing, walk, …)")
    _add_store(command)


if __name__ == "__main__":
    sys.exit(main())
