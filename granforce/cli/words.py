"""The text of each command: its options, its summary and an example."""

from __future__ import annotations

import argparse

from granforce import __version__
from granforce.cli import report_lines
from granforce.cli.options import (
    EXAMPLE,
    Commands,
    add_any_packing,
    add_cell,
    add_columns,
    add_conditions,
    add_ensemble_mu,
    add_exact,
    add_flaws_and_walls,
    add_frame,
    add_known,
    add_made_packing,
    add_out,
    add_packing,
    add_packing_file,
    add_picture,
    add_reading,
    add_reverse,
    add_scheduler,
    add_series,
    add_source,
    add_states_out,
    add_store,
    add_unit,
    add_walk_options,
    add_wall_contacts,
    add_workers,
    import_format,
    subcommand,
    walls,
)
from granforce.cli.parsing import Edited, Input, Output, Parser, TableOrStore, Workplace


def add_pack(commands: Commands) -> None:
    command = subcommand(
        commands,
        "pack",
        "make a jammed packing, or load it from the store",
        "granforce pack -n 400 --mu 0.1 --seed 1 --out packing.npz\n"
        "  granforce pack --scene groove --mu 0.5\n"
        "  granforce pack --scene arch --out arch.npz\n"
        "  granforce pack --scene wall --scene-options courses=10,blocks=5 --out wall.npz",
        lines=report_lines.PACK,
    )
    command.add_argument(
        "--scene",
        type=str,
        metavar="NAME",
        help="make a small scene instead of a compressed packing: groove, box, pyramid, press, "
        "leaning, six, solid, column, thirteen or many; of blocks: slope, ladder, books, stones, "
        "arch or wall. Of the options for packings, only --mu applies",
    )
    command.add_argument(
        "--scene-options",
        type=str,
        listed=True,
        metavar="NAME=…,NAME=…",
        help="options of the scene, separated by commas: courses, blocks, width, height (wall); "
        "voussoirs, thickness, opening (arch); books, overhang (books); angle, width, height "
        "(slope); angle (ladder, groove, pyramid); disks, angle (column)",
    )
    add_packing(command, expert=True)
    add_store(command)
    command.add_argument(
        "--max-steps",
        type=int,
        default=100_000,
        help="maximum number of time steps (default 100000)",
    )
    command.add_argument(
        "--out", type=Output, suffixes=("npz",), help="also save the packing to this file"
    )
    names = command.options.keys() - {"scene", "scene_options", "mu", "out", "json"}
    command.leaves_out("without --scene", lambda given: given.scene is None, {"scene_options"})
    command.leaves_out("with --scene", lambda arguments: arguments.scene is not None, names)


def add_walk(commands: Commands) -> None:
    command = subcommand(
        commands,
        "walk",
        "random walk through the force networks of a packing",
        "granforce walk -n 400 --mu 0.1 --seed 1 --states 1000 --out states.zarr",
        lines=report_lines.WALK,
    )
    add_source(command)
    add_states_out(command)


def add_uniform(commands: Commands) -> None:
    command = subcommand(
        commands,
        "uniform",
        "draw force networks of a packing uniformly, with convergence diagnostics",
        "granforce uniform -n 400 --mu 0.1 --seed 1 --states 1000 --effective 500",
        lines=report_lines.UNIFORM,
    )
    add_any_packing(command)
    group = command.add_argument_group("the sample")
    group.add_argument(
        "--states", type=int, default=1000, help="minimum number of states (default 1000)"
    )
    group.add_argument("--sample-seed", type=int, default=0, help="seed of the draws (default 0)")
    add_ensemble_mu(group)
    group.add_argument("--chains", type=int, default=4, help="independent chains (default 4)")
    group.add_argument(
        "--effective", type=float, help="target effective sample size: continue until it is reached"
    )
    add_workers(group)
    add_conditions(command)
    add_store(command)
    add_states_out(command)


def add_volume(commands: Commands) -> None:
    command = subcommand(
        commands,
        "volume",
        "compute the volume of the force space of a packing, with its standard error",
        "granforce volume -n 400 --mu 0.1 --seed 1 --accuracy 0.1",
        lines=report_lines.VOLUME,
    )
    add_any_packing(command)
    group = command.add_argument_group("the volume")
    group.add_argument(
        "--accuracy",
        type=float,
        default=0.05,
        help="target standard error of ln V (default 0.05)",
    )
    group.add_argument("--volume-seed", type=int, default=0, help="seed of the draws (default 0)")
    add_ensemble_mu(group)
    add_workers(group)
    add_conditions(command)
    add_store(command)


def add_infer(commands: Commands) -> None:
    command = subcommand(
        commands,
        "infer",
        "find the most likely admissible network given measured forces, with error bars",
        "granforce infer frame.npz --measured frame.csv\n"
        "  granforce infer folder --frames all --mu 0.5 --out series.zarr",
        lines=report_lines.INFER,
    )
    command.add_argument(
        "files",
        type=Input,
        nargs="*",
        help="a packing (FILE.npz); with --frames: a folder, *_solved.mat files, or a file of "
        "positions and one of contacts",
    )
    add_made_packing(command, lambda given: given.frames is None and len(given.files) == 1)
    group = command.add_argument_group("the inference")
    group.add_argument(
        "--measured",
        type=Input,
        suffixes=("csv",),
        help="columns contact, f_n, f_t, sigma_n, sigma_t, in the packing's units; empty or nan "
        "where not measured",
    )
    group.add_argument(
        "--unmeasured",
        type=float,
        help="treat unmeasured forces as measured to be 0 with this standard error, in units of "
        "⟨f_n⟩. Default: 1 if S is unbounded, as in frames between walls, and with --frames; "
        "otherwise 1000, which allows any force, or 2 with --again",
    )
    group.add_argument(
        "--again",
        action="store_true",
        help="compute error bars by repeated simulated measurements of the most likely network "
        "(default: assume that all networks are equally likely before the measurement)",
    )
    group.add_argument(
        "--states",
        type=int,
        help="number of samples for error bars (default 1000, or 200 with --frames; 0: no error "
        "bars)",
    )
    group.add_argument(
        "--certain",
        action="store_true",
        help="also find the unmeasured contacts that carry force in every network within 3 σ, by "
        "exact bounds",
    )
    group.add_argument("--sample-seed", type=int, default=0, help="seed of the draws (default 0)")
    add_ensemble_mu(group)
    group.add_argument("--chains", type=int, default=4, help="independent chains (default 4)")
    add_workers(group)
    add_out(group, "the result per contact", "; with --frames all frames, as one dataset (.zarr)")
    add_unit(group)
    add_conditions(command)
    add_store(command)
    single = command.options.keys() - {"files"}
    # Those of a single packing, shared by many frames, and those of many frames.
    shared = {
        "json",
        "mu",
        "cache",
        "workers",
        "unmeasured",
        "states",
        "sample_seed",
        "unit",
        "out",
    }
    series = command.add_argument_group("many photoelastic frames")
    series.add_argument(
        "--frames",
        type=str,
        listed=True,
        help="import these frames and infer their forces: all, or numbers separated by commas",
    )
    add_reading(series)
    add_flaws_and_walls(command, series)
    add_scheduler(command)
    many = command.options.keys() - single - {"frames", "files"}
    command.leaves_out(
        "without --frames (--frames all reads the two files of photoelastic frames)",
        lambda arguments: arguments.frames is None,
        many,
    )
    command.leaves_out(
        "with --frames", lambda arguments: arguments.frames is not None, single - shared
    )
    command.leaves_out(
        "with --states 0",
        lambda arguments: arguments.states == 0,
        {"sample_seed", "chains", "again"},
    )
    command.leaves_out(
        "with --states 0 and without --certain or --frames",
        lambda given: given.states == 0 and not given.certain and given.frames is None,
        {"workers"},
    )


def add_informative(commands: Commands) -> None:
    command = subcommand(
        commands,
        "informative",
        "rank contacts by how much measuring their normal force would shorten the intervals of all "
        "contacts, including their own",
        "granforce informative -n 400 --mu 0.1 --seed 1 --best 5 --known known.csv",
        lines=report_lines.INFORMATIVE,
    )
    add_any_packing(command)
    group = command.add_argument_group("the ranking")
    group.add_argument(
        "--best", type=int, default=10, help="number of contacts to list (default 10)"
    )
    group.add_argument(
        "--check",
        type=int,
        default=10,
        help="number of contacts to check with exact bounds (default 10)",
    )
    group.add_argument(
        "--states", type=int, default=400, help="number of uniform samples (default 400)"
    )
    group.add_argument("--sample-seed", type=int, default=0, help="seed of the draws (default 0)")
    add_ensemble_mu(group)
    add_workers(group)
    add_out(group, "the result per contact")
    add_unit(group)
    add_conditions(command)
    add_store(command)


def add_measure(commands: Commands) -> None:
    command = subcommand(
        commands,
        "measure",
        "compute the indeterminacy η1, η2, η3 from a random walk, optionally for each contact",
        "granforce measure -n 400 --mu 0.1 --seed 1 --states 1000 --out contacts.csv",
        lines=report_lines.MEASURE,
    )
    add_source(command)
    add_out(command, "f_n and its interval per contact")
    add_unit(command)


def add_scan(commands: Commands) -> None:
    command = subcommand(
        commands,
        "scan",
        "generate packings and run random walks for many μ and seeds in parallel; interrupted runs "
        "resume",
        "granforce scan --mu 0,0.01,0.1,1,10 --seeds 2 -n 400 --states 1000 --out scan.zarr",
        lines=report_lines.SCAN,
    )
    command.add_argument(
        "--mu",
        type=str,
        listed=True,
        required=True,
        help="friction coefficients, separated by commas",
    )
    command.add_argument("--seeds", type=int, default=1, help="packings per μ: seeds 1 … SEEDS")
    add_packing(command, several=True, expert=True)
    add_walk_options(command)
    command.add_argument(
        "--out",
        type=TableOrStore,
        suffixes=("csv", "zarr"),
        help="write the table (.csv), or use this store of results instead of --cache (.zarr)",
    )
    add_store(command)
    command.add_argument("--keep", type=int, help="store only this many states, evenly spaced")
    command.add_argument("--float32", action="store_true", help="store states in single precision")
    add_scheduler(command)
    command.leaves_out("with --out FOLDER.zarr", _into_store, {"cache"})


def _into_store(arguments: argparse.Namespace) -> bool:
    return arguments.out is not None and not arguments.out.endswith(".csv")


def add_figures(commands: Commands) -> None:
    command = subcommand(
        commands,
        "figures",
        "draw Figure 1 of the paper from the store of a scan",
        "granforce figures scan.zarr --out figure1.pdf",
        reports=False,
    )
    command.add_argument(
        "scan",
        type=Input,
        nargs="?",
        metavar="STORE",
        help="store written by granforce scan (default: $GRANFORCE_CACHE, else the user's cache "
        "folder)",
    )
    add_picture(command)


def add_plot(commands: Commands) -> None:
    command = subcommand(
        commands,
        "plot",
        "draw a packing and its contact forces",
        "granforce plot packing.npz --out packing.png\n"
        "  granforce plot packing.npz --states states.zarr --colour spread --out spread.pdf",
        reports=False,
    )
    add_packing_file(command)
    add_picture(command)
    command.add_argument(
        "--states",
        type=Input,
        suffixes=("csv", "npz", "zarr"),
        help="draw the mean of these networks, written by walk, uniform or infer with --out "
        "(default: the packing's original network)",
    )
    command.add_argument(
        "--state", type=int, metavar="K", help="draw only network number K, counted from 0"
    )
    command.add_argument("--numbers", action="store_true", help="write its number at each contact")
    command.add_argument(
        "--colour",
        choices=["mobilisation", "force", "spread", "interval"],
        default="mobilisation",
        help="quantity shown as colour: mobilisation f_t/(μ f_n) (default); or, in ⟨f_n⟩: force "
        "f_n, spread (standard deviation of f_n over the networks) or interval (length of the "
        "exact interval of f_n)",
    )
    command.leaves_out("without --states", lambda arguments: arguments.states is None, {"state"})


def add_study(commands: Commands) -> None:
    command = subcommand(
        commands,
        "study",
        "repeat the paper's study, draw its figures and judge its claims; interrupted runs resume",
        "granforce study --out study\n  granforce study --quick --out quick",
    )
    command.add_argument("--quick", action="store_true", help="run a small version, in minutes")
    command.add_argument(
        "--out",
        type=Workplace,
        metavar="FOLDER",
        default="study",
        help="folder for the results (default study)",
    )
    command.add_argument(
        "--paper",
        action="store_true",
        help="compute only what the paper computed, with the paper's relaxation",
    )
    command.add_argument(
        "--parts",
        type=str,
        listed=True,
        help="compute only the parts with these names, separated by commas",
    )
    command.add_argument(
        "--minutes",
        type=float,
        help="start no new computation after this many minutes; run the command again to resume",
    )
    command.add_argument(
        "--status",
        action="store_true",
        help="compute nothing: show which parts are done and how long the rest takes",
    )
    command.add_argument(
        "--table",
        type=Input,
        metavar="STORE",
        help="compute nothing: use this reduced study, such as data/study.zarr",
    )
    command.add_argument(
        "--reduce",
        type=Input,
        metavar="STORE",
        help="compute nothing: reduce the results in this store; missing ones come from --table",
    )
    command.add_argument(
        "--documents",
        type=Edited,
        metavar="FILES",
        help="update the text between <!-- study: NAME --> and <!-- end --> in these files "
        "(separated by commas)",
    )
    others = set(command.options)
    group = command.add_argument_group("size")
    group.add_argument("-n", type=int, help="number of disks (default 400)")
    group.add_argument(
        "--mu", type=str, listed=True, help="friction coefficients, separated by commas"
    )
    group.add_argument("--packings", type=int, help="packings at each μ (default 30)")
    group.add_argument("--states", type=int, help="states of a walk (default 1000)")
    group.add_argument(
        "--gauss-seidel-packings", type=int, help="packings with the paper's walk (default 10)"
    )
    group.add_argument(
        "--response-packings",
        type=int,
        help="number of packings in which contacts are pushed (default 10)",
    )
    group.add_argument(
        "--response-contacts",
        type=int,
        help="number of contacts pushed per packing (default 20)",
    )
    group.add_argument(
        "--perturb-packings",
        type=int,
        help="number of these packings that are also pushed with smaller load steps, and with more "
        "implicit steps (default 3)",
    )
    group.add_argument(
        "--sizes", type=str, listed=True, help="other numbers of disks (default 100,200,800,1600)"
    )
    sized = command.options.keys() - others
    command.add_argument("--workers", type=int, default=2, help="processes (default 2)")
    command.add_argument(
        "--formats",
        type=str,
        listed=True,
        default="html,png,svg",
        help="figure formats, separated by commas; an empty value draws none",
    )
    add_scheduler(command)
    computing = {"minutes", "workers", "scheduler"}
    drawing = {"table", "reduce", "documents", "formats"}
    command.leaves_out("with --status", lambda arguments: arguments.status, computing | drawing)
    reducing = computing | {"paper", "parts"}
    command.leaves_out("with --reduce", lambda arguments: arguments.reduce is not None, reducing)
    command.leaves_out(
        "with --table alone",
        lambda arguments: arguments.table is not None and arguments.reduce is None,
        reducing | sized | {"quick"},
    )


def add_intervals(commands: Commands) -> None:
    command = subcommand(
        commands,
        "intervals",
        "compute the exact interval of every contact force",
        "granforce intervals -n 400 --mu 0.1 --seed 1 --out bounds.csv",
        lines=report_lines.INTERVALS,
        columns=report_lines.BOUNDS,
    )
    add_exact(command)


def add_limit_loads(commands: Commands) -> None:
    command = subcommand(
        commands,
        "limit-loads",
        "for each contact, compute the largest force pair pushing its grains apart that the "
        "packing can carry",
        "granforce limit-loads -n 400 --mu 0.1 --seed 1 --contacts 0,5,17",
        lines=report_lines.LIMIT_LOADS,
        columns=report_lines.LOADS,
    )
    add_exact(command)


def add_load_factor(commands: Commands) -> None:
    command = subcommand(
        commands,
        "load-factor",
        "compute the largest multiple of a load on all bodies that contact forces can balance",
        "granforce pack --scene wall --out wall.npz\n"
        "  granforce load-factor wall.npz --load horizontal",
        lines=report_lines.LOAD_FACTOR,
    )
    add_packing_file(command)
    command.add_argument(
        "--load",
        choices=["horizontal"],
        required=True,
        help="horizontal: a force equal to the weight of every body, along +x; for other loads use "
        "gf.load_factor in Python",
    )
    command.add_argument(
        "--critical",
        action="store_true",
        help="also raise the load, starting from the packing's original forces, until bodies move",
    )
    command.add_argument(
        "--precision",
        type=float,
        default=1e-4,
        help="precision of the critical factor, as a fraction of the load factor (default 0.0001)",
    )
    command.leaves_out("without --critical", lambda given: not given.critical, {"precision"})


def add_rest(commands: Commands) -> None:
    command = subcommand(
        commands,
        "rest",
        "test whether the grains of a packing stay at rest in contact dynamics, also with noise on "
        "the forces",
        "granforce rest packing.npz",
        lines=report_lines.REST,
    )
    add_packing_file(command)
    add_ensemble_mu(command)


def add_stress(commands: Commands) -> None:
    command = subcommand(
        commands,
        "stress",
        "compute all stresses that the contacts can carry at the packing's pressure, and the "
        "largest shear stress",
        "granforce stress -n 400 --mu 0.1 --seed 1 --out outline.csv",
        lines=report_lines.STRESS,
    )
    add_any_packing(command)
    group = command.add_argument_group("the outline")
    add_ensemble_mu(group)
    group.add_argument(
        "--angles", type=int, default=64, help="number of directions in the table (default 64)"
    )
    add_known(group)
    add_workers(group)
    add_out(group, "the largest stress for each direction")
    add_store(command)


def add_perturb(commands: Commands) -> None:
    command = subcommand(
        commands,
        "perturb",
        "push apart the grains of single contacts until the packing moves, and report the critical "
        "force and the first motion",
        "granforce perturb -n 400 --mu 0.1 --seed 1 --random 50",
        lines=report_lines.PERTURB,
        columns=report_lines.CRITICAL,
    )
    add_any_packing(command)
    group = command.add_argument_group("the perturbation")
    which = group.add_mutually_exclusive_group()
    which.add_argument(
        "--random", type=int, default=50, help="number of randomly chosen contacts (default 50)"
    )
    which.add_argument(
        "--contacts", type=str, listed=True, help="numbers of contacts, separated by commas"
    )
    which.add_argument("--all", action="store_true", help="all contacts that carry force")
    group.add_argument(
        "--draw-seed",
        type=int,
        default=0,
        help="seed for the random choice of contacts (default 0)",
    )
    add_ensemble_mu(group)
    group.add_argument(
        "--precision",
        type=float,
        default=0.01,
        help="precision of F_crit, in units of ⟨f_n⟩ (default 0.01)",
    )
    add_workers(group)
    add_out(group, "the result per contact")
    add_unit(group)
    add_conditions(command, known=False)
    add_store(command)
    drawn = {"random", "draw_seed"}
    command.leaves_out("with --all", lambda arguments: arguments.all, drawn)
    command.leaves_out("with --contacts", lambda arguments: arguments.contacts is not None, drawn)


def add_app(commands: Commands) -> None:
    command = subcommand(
        commands,
        "app",
        "open the app in a browser",
        "granforce app\n  granforce app --port 8080 --no-show",
        reports=False,
    )
    command.add_argument(
        "--port", type=int, default=5006, help="port (default 5006; 0: any free port)"
    )
    command.add_argument(
        "--address",
        type=str,
        default="localhost",
        help="address to listen on (default localhost: this machine only)",
    )
    command.add_argument(
        "--allow-websocket-origin",
        type=str,
        metavar="HOST[:PORT]",
        action="append",
        default=[],
        help="host name by which other machines reach the app; can be repeated",
    )
    command.add_argument(
        "--use-xheaders",
        action="store_true",
        help="behind a proxy: read the addresses of visitors from its headers",
    )
    command.add_argument("--no-show", action="store_true", help="do not open a browser")
    command.add_argument(
        "--warm",
        action="store_true",
        help="compile and load everything before the first visitor arrives",
    )


def add_docs(commands: Commands) -> None:
    command = subcommand(
        commands,
        "docs",
        "build the documentation and open it in a browser; stop with Ctrl-C",
        "granforce docs\n  granforce docs --out site",
        reports=False,
    )
    command.add_argument(
        "--out", type=Output, metavar="FOLDER", help="only build it, in this folder"
    )


def add_completion(commands: Commands) -> None:
    command = subcommand(
        commands,
        "completion",
        "print a script for shell completion of commands, options and files",
        "granforce completion bash > ~/.local/share/bash-completion/completions/granforce\n"
        "  granforce completion zsh > ~/.zfunc/_granforce\n"
        "  granforce completion fish > ~/.config/fish/completions/granforce.fish",
        reports=False,
    )
    command.add_argument("shell", choices=["bash", "zsh", "fish", "tcsh"])


def add_import(commands: Commands) -> None:
    command = subcommand(
        commands,
        "import",
        "import a packing from another program, check it and save it",
        "granforce import lammps particles.dump contacts.dump --mu 0.3 --out packing.npz\n"
        "  granforce import lammps particles.dump contacts.dump --mu 0.3 --frames all "
        "--out series.zarr\n"
        "  granforce import table grains.csv contacts.csv --box 30 30 --mu 0.3 --out packing.npz\n"
        "  granforce import blocks bodies.csv --mu 0.6 --density 2 --out packing.npz\n"
        "  granforce import pegs positions.txt adjacency.txt --mu 0.5 --out frame.npz "
        "--measured frame.csv",
        reports=False,
    )
    # One parser per format: it takes the options that its reader uses, and rejects all others.
    formats = command.add_subparsers(dest="format", metavar="FORMAT", required=True)
    lammps = import_format(
        *(formats, "lammps", "import a particle dump and a contact dump from LAMMPS"),
        "particles.dump contacts.dump",
        "dump custom of the particles: id, x y (or xu yu, xs ys, xsu ysu), radius or diameter; "
        "dumps may be compressed (.gz, .bz2, .xz, .zst)",
        "dump local of the contacts: two ids, distance, normal force x y, tangential force x y, in "
        "this order or under the names atom1 atom2 distance fx fy px py",
        series=True,
    )
    add_frame(lammps, "timestep")
    add_columns(lammps)
    add_reverse(lammps)
    add_series(lammps)
    yade = import_format(
        *(formats, "yade", "import bodies and interactions from YADE"),
        "bodies.txt interactions.txt",
        "bodies from export.textExt: x y z r, and id (format x_y_z_r_attrs) if there are walls",
        "one line per interaction: id1 id2, phys.normalForce x y z, phys.shearForce x y z",
    )
    add_cell(yade)
    add_columns(yade)
    add_wall_contacts(yade)
    add_reverse(yade)
    mercury = import_format(
        *(formats, "mercury", "import .data and .fstat files from MercuryDPM"),
        *("run.data run.fstat", "particles: NAME.data", "contacts: NAME.fstat"),
        series=True,
    )
    add_frame(mercury, "number of the time step in the files, from 0")
    add_cell(mercury)
    add_wall_contacts(mercury)
    add_reverse(mercury)
    add_series(mercury)
    table = import_format(
        *(formats, "table", "import a table of grains and, optionally, a table of contacts"),
        *(
            "grains.csv contacts.csv",
            "columns x, y, r; optionally id, fx, fy, torque "
            "(external load, without --box) and open (1: balance not required, 0)",
            "columns i, j (ids, or row numbers from 0); optionally nx, ny, length (otherwise the "
            "nearest images touch), and f_n, f_t",
        ),
        contacts_needed=False,
    )
    add_cell(table)
    add_columns(table)
    add_reverse(table)
    table.add_argument(
        "--walls",
        type=walls,
        metavar="floor|box|X,Y,X,Y",
        help="fixed walls around the disks: a floor, a box open at the top, or segments X,Y,X,Y "
        "separated by blanks",
    )
    table.add_argument(
        "--gravity",
        type=float,
        help="gravitational acceleration times mass density: a disk of radius r weighs π r² times "
        "this, downwards",
    )
    table.add_argument(
        "--tolerance",
        type=float,
        help="largest gap at which disks count as touching, in units of the largest radius "
        "(default 1e-6)",
    )
    table.add_argument("--forces", action="store_true", default=None, help="require f_n and f_t")
    table.add_argument(
        "--pressure", type=float, help="pressure P0 of a table without forces (default 1)"
    )
    table.leaves_out(
        "with a table of contacts and no walls",
        lambda arguments: arguments.contacts is not None and arguments.walls is None,
        {"tolerance"},
    )
    blocks = import_format(
        *(formats, "blocks", "import rigid bodies: convex polygons and disks"),
        "bodies.csv",
        "CSV with one row per corner: columns body, x, y, and optionally r (of disks), density and "
        'fixed (0 or 1); or JSON: {"bodies": [{"corners": [[x, y], …], "fixed": true}, {"disk": '
        '[x, y, r], "density": 2, "material": "wood"}, …], "friction": [["stone", "wood", '
        "0.4], …]}, with μ of pairs of materials, where it is not --mu",
        None,
    )
    blocks.add_argument(
        "--density",
        type=float,
        help="mass per area of bodies without a density in the file (default 1)",
    )
    blocks.add_argument(
        "--tolerance",
        type=float,
        help="largest gap or overlap of surfaces that touch, in the unit of the file (default 1e-9 "
        "of the largest body)",
    )
    pegs = import_format(
        *(formats, "pegs", "import a photoelastic frame from PeGS"),
        *("positions.txt adjacency.txt", "positions, or a *_solved.mat of PeGS 2", "adjacency"),
        contacts_needed=False,
    )
    pegs.add_argument("--frame", type=float, help="number of the frame (default: the last)")
    add_reading(pegs)
    add_flaws_and_walls(pegs, pegs)
    pegs.add_argument(
        "--measured",
        type=Output,
        suffixes=("csv",),
        help="write the measured forces, for granforce infer",
    )


def add_export(commands: Commands) -> None:
    command = subcommand(
        commands,
        "export",
        "export a packing and its force network to ParaView or LAMMPS",
        "granforce export packing.npz grains.vtp contacts.vtp\n"
        "  granforce export packing.npz particles.dump contacts.dump",
        reports=False,
    )
    add_packing_file(command)
    command.add_argument("grains", type=Output, help="FILE.vtp for ParaView, FILE.dump for LAMMPS")
    command.add_argument(
        "contacts", type=Output, help="file of the same type for contacts and forces"
    )


def add_bench(commands: Commands) -> None:
    command = subcommand(
        commands,
        "bench",
        "measure the run time and error of every solver on this machine",
        "granforce bench --quick --out bench",
    )
    command.add_argument("--quick", action="store_true", help="small sizes, under 3 minutes")
    command.add_argument(
        "--out",
        type=Workplace,
        metavar="FOLDER",
        help="write the rows (bench.json) and figures (bench.png, bench.html) to this folder",
    )
    command.add_argument(
        "--documents",
        type=Edited,
        metavar="FILES",
        help="update the text between <!-- bench: PART --> and <!-- end --> in these files, names "
        "separated by commas",
    )
    command.add_argument(
        "--table",
        type=Input,
        suffixes=("json",),
        help="measure nothing: draw the figures and update the documents from these rows, such as "
        "data/bench.json",
    )
    command.leaves_out(
        "without --documents or --out", lambda given: not (given.documents or given.out), {"table"}
    )
    command.leaves_out("with --table", lambda given: given.table is not None, {"quick", "json"})


def add_cache(commands: Commands) -> None:
    command = subcommand(
        commands,
        "cache",
        "list, clear or verify the store of results, or print its size or its path; also for the "
        "built documentation and the compiled kernels",
        "granforce cache verify --cache scan.zarr",
    )
    command.add_argument("action", choices=["list", "size", "clear", "verify", "path"])
    command.add_argument(
        "--kind",
        type=str,
        help="only entries of this kind (packing, walk, …); for size and clear also documentation "
        "(built by granforce docs) or kernels (compiled on first use)",
    )
    command.add_argument("--yes", action="store_true", help="clear without asking, for scripts")
    add_store(command)
    command.leaves_out("with path", lambda arguments: arguments.action == "path", {"kind"})
    command.leaves_out("without clear", lambda arguments: arguments.action != "clear", {"yes"})
    command.leaves_out(
        "with documentation or kernels",
        lambda arguments: arguments.kind in ("documentation", "kernels"),
        {"cache"},
    )


# In the order of the help text.
COMMANDS = (
    add_pack,
    add_walk,
    add_uniform,
    add_volume,
    add_infer,
    add_informative,
    add_measure,
    add_scan,
    add_figures,
    add_plot,
    add_intervals,
    add_limit_loads,
    add_load_factor,
    add_rest,
    add_stress,
    add_perturb,
    add_study,
    add_app,
    add_docs,
    add_completion,
    add_import,
    add_export,
    add_bench,
    add_cache,
)


def make_parser() -> Parser:
    """The parser of the whole command line."""
    parser = Parser(
        prog="granforce",
        description="Quantify how undetermined the contact forces in packings of rigid disks are.",
        epilog="Example:\n  granforce walk -n 400 --mu 0.1 --seed 1 --states 1000",
        formatter_class=EXAMPLE,
    )
    parser.add_argument("--version", action="version", version=f"granforce {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for add in COMMANDS:
        add(commands)
    return parser
