"""The commands: their summaries, examples and options, and which options exclude others."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import NamedTuple

from granforce.cli import report_lines
from granforce.cli.option_table import attribute


class Group(NamedTuple):
    """Options under one heading of the help text."""

    title: str
    options: str  # keys of OPTIONS, separated by blanks, like all options below
    description: str | None = None
    one_of: str = ""  # options of which one may be given; they come first


class Hidden(str):
    """Options that the help text leaves out."""


class Rule(NamedTuple):
    """Options that have no effect in one form of a command."""

    words: str  # that form in words: "with --scene"
    holds: Callable[[argparse.Namespace], bool]  # whether a command line has that form
    options: str

    @property
    def names(self) -> frozenset[str]:
        """The options as attributes."""
        return frozenset(map(attribute, self.options.split()))


class Command(NamedTuple):
    name: str
    summary: str
    example: str
    parts: tuple[str | Hidden | Group, ...]  # in the order of the help text
    rules: tuple[Rule, ...] = ()
    lines: tuple[str, ...] = ()  # of its report, explained in the help text
    columns: tuple[str, ...] = ()  # of its list of contacts, explained likewise
    formats: tuple[Command, ...] = ()


def given(option: str) -> Callable[[argparse.Namespace], bool]:
    """Whether an option has a value."""
    name = attribute(option)
    return lambda arguments: getattr(arguments, name) not in (None, False)


def with_option(option: str, options: str) -> Rule:
    return Rule(f"with {option}", given(option), options)


def without(option: str, options: str, also: str = "") -> Rule:
    has = given(option)
    return Rule(f"without {option}{also}", lambda arguments: not has(arguments), options)


SHAPE = "-n --radii --pressure --box"
COMPACTION = "--dt --box-mass --sweeps --step-accuracy --drag-below"
EXPERT = Group("expert settings of the compaction", COMPACTION)
PACKING = Group("the packing", "-n --mu --seed --radii --pressure --box")
# A packing that is made unless a file is given.
MADE_PACKING = (PACKING, Hidden(COMPACTION))
ANY_PACKING = ("--json packing", *MADE_PACKING)
FROM_FILE = "with the file of a packing"
MADE = f"{PACKING.options} {COMPACTION}"
NO_FILE = Rule(FROM_FILE, given("packing"), MADE)
WALK = Group("the random walk", "--states --walk-seed --ensemble-mu --relax --chains --workers")
CONDITIONS = Group(
    "conditions on the forces, in addition to equilibrium and friction",
    "--prescribe --stress --known",
)
NO_UNIT = without("--out", "--unit")
EXACT = (
    *ANY_PACKING,
    Group("the ensemble", "--ensemble-mu --contacts --slice --workers --out:contacts --unit"),
    CONDITIONS._replace(options="--prescribe:exact --stress --known"),
    "--cache",
)
EXACT_RULES = (
    NO_FILE,
    Rule(
        "with --slice, where the frozen contacts determine the stress",
        lambda arguments: arguments.slice is not None and arguments.prescribe != "none",
        "--prescribe --stress",
    ),
)
# Of photoelastic frames.
READING = "--reach --scale --error --reverse --columns:frames"
REPAIR = "--flag --repair --strict --walls:frames --wall-force"
STRICT = with_option("--strict", "--repair")
SNAPSHOTS = Group(
    "many snapshots",
    "--frames:import --states:import --walk-seed --csv --workers --scheduler --cache",
    "with --frames: write exact intervals of all snapshots to one dataset (--out FOLDER.zarr), "
    "and print one line per snapshot",
)
SNAPSHOT_RULES = (
    without("--frames", "--states --walk-seed --csv --workers --scheduler --cache"),
    with_option("--frames", "--frame"),
    Rule(
        "without --states",
        lambda arguments: arguments.frames and not arguments.states,
        "--walk-seed",
    ),
)
STUDY_SIZE = Group(
    "size",
    "-n:study --mu:study --packings --states:study --gauss-seidel-packings --response-packings "
    "--response-contacts --perturb-packings --sizes",
)
RUN = "--minutes --workers --scheduler"  # options of a study that computes


# One parser per format: it takes the options that its reader in `granforce.packing.importers`
# uses, named after the reader's arguments, and rejects all others.
FORMATS = (
    Command(
        "lammps",
        "import a particle dump and a contact dump from LAMMPS",
        "particles.dump contacts.dump",
        (
            "--json grains:lammps contacts:lammps --mu:import --out:snapshots --frame:lammps "
            "--columns:import --reverse",
            SNAPSHOTS,
        ),
        SNAPSHOT_RULES,
        report_lines.IMPORT,
    ),
    Command(
        "yade",
        "import bodies and interactions from YADE",
        "bodies.txt interactions.txt",
        (
            "--json grains:yade contacts:yade --mu:import --out:import --box:import --tilt "
            "--columns:import --walls:simulation --reverse",
        ),
        (),
        report_lines.IMPORT,
    ),
    Command(
        "mercury",
        "import .data and .fstat files from MercuryDPM",
        "run.data run.fstat",
        (
            "--json grains:mercury contacts:mercury --mu:import --out:snapshots --frame:mercury "
            "--box:import --tilt --walls:simulation --reverse",
            SNAPSHOTS,
        ),
        SNAPSHOT_RULES,
        report_lines.IMPORT,
    ),
    Command(
        "table",
        "import a table of grains and, optionally, a table of contacts",
        "grains.csv contacts.csv",
        (
            "--json grains:table contacts:table --mu:import --out:import --box:import --tilt "
            "--columns:import --reverse --walls:table --gravity --tolerance:table --forces "
            "--pressure:table",
        ),
        (
            Rule(
                "with a table of contacts and no walls",
                lambda arguments: arguments.contacts is not None and arguments.walls is None,
                "--tolerance",
            ),
        ),
        report_lines.IMPORT,
    ),
    Command(
        "blocks",
        "import rigid bodies: convex polygons and disks",
        "bodies.csv",
        ("--json grains:blocks --mu:import --out:import --density --tolerance:blocks",),
        (),
        report_lines.IMPORT,
    ),
    Command(
        "pegs",
        "import a photoelastic frame from PeGS",
        "positions.txt adjacency.txt",
        (
            "--json grains:pegs contacts:pegs --mu:import --out:import --frame:pegs "
            f"{READING} {REPAIR} --measured:pegs",
        ),
        (STRICT,),
        report_lines.PEGS,
    ),
)

# In the order of the help text.
COMMANDS = (
    Command(
        "pack",
        "make a jammed packing, or load it from the store",
        "granforce pack -n 400 --mu 0.1 --seed 1 --out packing.npz\n"
        "  granforce pack --scene groove --mu 0.5\n"
        "  granforce pack --scene arch --out arch.npz\n"
        "  granforce pack --scene wall --scene-options courses=10,blocks=5 --out wall.npz",
        ("--json --scene --scene-options", PACKING, EXPERT, "--cache --max-steps --out:pack"),
        (
            without("--scene", "--scene-options"),
            with_option("--scene", f"{SHAPE} --seed {COMPACTION} --cache --max-steps"),
        ),
        report_lines.PACK,
    ),
    Command(
        "walk",
        "random walk through the force networks of a packing",
        "granforce walk -n 400 --mu 0.1 --seed 1 --states 1000 --out states.zarr",
        (*ANY_PACKING, WALK, CONDITIONS, "--cache --out:states --unit"),
        (NO_FILE, NO_UNIT),
        report_lines.WALK,
    ),
    Command(
        "uniform",
        "draw force networks of a packing uniformly, with convergence diagnostics",
        "granforce uniform -n 400 --mu 0.1 --seed 1 --states 1000 --effective 500",
        (
            *ANY_PACKING,
            Group(
                "the sample",
                "--states:uniform --sample-seed --ensemble-mu --chains:uniform --effective "
                "--workers",
            ),
            CONDITIONS,
            "--cache --out:states --unit",
        ),
        (NO_FILE, NO_UNIT),
        report_lines.UNIFORM,
    ),
    Command(
        "volume",
        "compute the volume of the force space of a packing, with its standard error",
        "granforce volume -n 400 --mu 0.1 --seed 1 --accuracy 0.1",
        (
            *ANY_PACKING,
            Group("the volume", "--accuracy --volume-seed --ensemble-mu --workers"),
            CONDITIONS,
            "--cache",
        ),
        (NO_FILE,),
        report_lines.VOLUME,
    ),
    Command(
        "infer",
        "find the most likely admissible network given measured forces, with error bars",
        "granforce infer frame.npz --measured frame.csv\n"
        "  granforce infer folder --frames all --mu 0.5 --out series.zarr",
        (
            "--json files",
            *MADE_PACKING,
            Group(
                "the inference",
                "--measured:infer --unmeasured --again --states:infer --certain --sample-seed "
                "--ensemble-mu --chains:uniform --workers --out:infer --unit",
            ),
            CONDITIONS,
            "--cache",
            Group("many photoelastic frames", f"--frames:infer {READING} {REPAIR}"),
            "--scheduler",
        ),
        (
            Rule(
                FROM_FILE,
                lambda arguments: arguments.frames is None and len(arguments.files) == 1,
                MADE,
            ),
            STRICT,
            without(
                "--frames",
                f"{READING} {REPAIR} --scheduler",
                " (--frames all reads the two files of photoelastic frames)",
            ),
            with_option(
                "--frames",
                f"{SHAPE} --seed {COMPACTION} --measured --again --certain --chains "
                f"--ensemble-mu {CONDITIONS.options}",
            ),
            Rule(
                "with --states 0",
                lambda arguments: arguments.states == 0,
                "--sample-seed --chains --again",
            ),
            Rule(
                "with --states 0 and without --certain or --frames",
                lambda arguments: (
                    arguments.states == 0 and not arguments.certain and arguments.frames is None
                ),
                "--workers",
            ),
        ),
        report_lines.INFER,
    ),
    Command(
        "informative",
        "rank contacts by how much measuring their normal force would shorten the intervals of all "
        "contacts, including their own",
        "granforce informative -n 400 --mu 0.1 --seed 1 --best 5 --known known.csv",
        (
            *ANY_PACKING,
            Group(
                "the ranking",
                "--best --check --states:informative --sample-seed --ensemble-mu --workers "
                "--out:contacts --unit",
            ),
            CONDITIONS,
            "--cache",
        ),
        (NO_FILE,),
        report_lines.INFORMATIVE,
    ),
    Command(
        "measure",
        "compute the indeterminacy η1, η2, η3 from a random walk, optionally for each contact",
        "granforce measure -n 400 --mu 0.1 --seed 1 --states 1000 --out contacts.csv",
        (*ANY_PACKING, WALK, CONDITIONS, "--cache --out:measure --unit"),
        (NO_FILE,),
        report_lines.MEASURE,
    ),
    Command(
        "scan",
        "generate packings and run random walks for many μ and seeds in parallel; interrupted runs "
        "resume",
        "granforce scan --mu 0,0.01,0.1,1,10 --seeds 2 -n 400 --states 1000 --out scan.zarr",
        (
            "--json --mu:scan --seeds",
            PACKING._replace(options=SHAPE),
            EXPERT,
            WALK,
            "--out:scan --cache --keep --float32 --scheduler",
        ),
        (
            Rule(
                "with --out FOLDER.zarr",
                lambda arguments: arguments.out is not None and not arguments.out.endswith(".csv"),
                "--cache",
            ),
        ),
        report_lines.SCAN,
    ),
    Command(
        "figures",
        "draw Figure 1 of the paper from the store of a scan",
        "granforce figures scan.zarr --out figure1.pdf",
        ("scan --out:picture",),
    ),
    Command(
        "plot",
        "draw a packing and its contact forces",
        "granforce plot packing.npz --out packing.png\n"
        "  granforce plot packing.npz --states states.zarr --colour spread --out spread.pdf",
        ("packing:required --out:picture --states:plot --state --numbers --colour",),
        (without("--states", "--state"),),
    ),
    Command(
        "intervals",
        "compute the exact interval of every contact force",
        "granforce intervals -n 400 --mu 0.1 --seed 1 --out bounds.csv",
        EXACT,
        EXACT_RULES,
        report_lines.INTERVALS,
        report_lines.BOUNDS,
    ),
    Command(
        "limit-loads",
        "for each contact, compute the largest force pair pushing its grains apart that the "
        "packing can carry",
        "granforce limit-loads -n 400 --mu 0.1 --seed 1 --contacts 0,5,17",
        EXACT,
        EXACT_RULES,
        report_lines.LIMIT_LOADS,
        report_lines.LOADS,
    ),
    Command(
        "load-factor",
        "compute the largest multiple of a load on all bodies that contact forces can balance",
        "granforce pack --scene wall --out wall.npz\n"
        "  granforce load-factor wall.npz --load horizontal",
        ("--json packing:required --load --critical --precision:load-factor",),
        (without("--critical", "--precision"),),
        report_lines.LOAD_FACTOR,
    ),
    Command(
        "rest",
        "test whether the grains of a packing stay at rest in contact dynamics, also with noise on "
        "the forces",
        "granforce rest packing.npz",
        ("--json packing:required --ensemble-mu",),
        (),
        report_lines.REST,
    ),
    Command(
        "stress",
        "compute all stresses that the contacts can carry at the packing's pressure, and the "
        "largest shear stress",
        "granforce stress -n 400 --mu 0.1 --seed 1 --out outline.csv",
        (
            *ANY_PACKING,
            Group("the outline", "--ensemble-mu --angles --known --workers --out:stress"),
            "--cache",
        ),
        (NO_FILE,),
        report_lines.STRESS,
    ),
    Command(
        "perturb",
        "push apart the grains of single contacts until the packing moves, and report the critical "
        "force and the first motion",
        "granforce perturb -n 400 --mu 0.1 --seed 1 --random 50",
        (
            *ANY_PACKING,
            Group(
                "the perturbation",
                "--draw-seed --ensemble-mu --precision:perturb --workers --out:contacts --unit",
                one_of="--random --contacts:perturb --all",
            ),
            CONDITIONS._replace(options="--prescribe --stress"),
            "--cache",
        ),
        (
            NO_FILE,
            with_option("--all", "--random --draw-seed"),
            with_option("--contacts", "--random --draw-seed"),
        ),
        report_lines.PERTURB,
        report_lines.CRITICAL,
    ),
    Command(
        "study",
        "repeat the paper's study, draw its figures and judge its claims; interrupted runs resume",
        "granforce study --out study\n  granforce study --quick --out quick",
        (
            "--json --quick:study --out:study --paper --parts --minutes --status --table:study "
            "--reduce --documents:study",
            STUDY_SIZE,
            "--workers:study --formats --scheduler",
        ),
        (
            with_option("--status", f"{RUN} --table --reduce --documents --formats"),
            with_option("--reduce", f"{RUN} --paper --parts"),
            Rule(
                "with --table alone",
                lambda arguments: arguments.table is not None and arguments.reduce is None,
                f"{RUN} --paper --parts {STUDY_SIZE.options} --quick",
            ),
        ),
    ),
    Command(
        "app",
        "open the app in a browser",
        "granforce app\n  granforce app packing.npz\n  granforce app --port 8080 --no-show",
        ("packing:app --port --address --allow-websocket-origin --use-xheaders --no-show --warm",),
    ),
    Command(
        "docs",
        "build the documentation and open it in a browser; stop with Ctrl-C",
        "granforce docs\n  granforce docs --out site",
        ("--out:docs",),
    ),
    Command(
        "completion",
        "print a script for shell completion of commands, options and files",
        "granforce completion bash > ~/.local/share/bash-completion/completions/granforce\n"
        "  granforce completion zsh > ~/.zfunc/_granforce\n"
        "  granforce completion fish > ~/.config/fish/completions/granforce.fish",
        ("shell",),
    ),
    Command(
        "import",
        "import a packing from another program, check it and save it",
        "granforce import lammps particles.dump contacts.dump --mu 0.3 --out packing.npz\n"
        "  granforce import lammps particles.dump contacts.dump --mu 0.3 --frames all "
        "--out series.zarr\n"
        "  granforce import table grains.csv contacts.csv --box 30 30 --mu 0.3 --out packing.npz\n"
        "  granforce import blocks bodies.csv --mu 0.6 --density 2 --out packing.npz\n"
        "  granforce import pegs positions.txt adjacency.txt --mu 0.5 --out frame.npz "
        "--measured frame.csv",
        (),
        formats=FORMATS,
    ),
    Command(
        "export",
        "export a packing and its force network to ParaView or LAMMPS",
        "granforce export packing.npz grains.vtp contacts.vtp\n"
        "  granforce export packing.npz particles.dump contacts.dump",
        ("packing:required grains:export contacts:export",),
    ),
    Command(
        "bench",
        "measure the run time and error of every solver on this machine",
        "granforce bench --quick --out bench",
        ("--json --quick:bench --out:bench --documents:bench --table:bench",),
        (
            Rule(
                "without --documents or --out",
                lambda arguments: not (arguments.documents or arguments.out),
                "--table",
            ),
            with_option("--table", "--quick --json"),
        ),
    ),
    Command(
        "cache",
        "list, clear or verify the store of results, or print its size or its path; also for the "
        "built documentation and the compiled kernels",
        "granforce cache verify --cache scan.zarr",
        ("--json action --kind --yes --cache",),
        (
            Rule("with path", lambda arguments: arguments.action == "path", "--kind"),
            Rule("without clear", lambda arguments: arguments.action != "clear", "--yes"),
            Rule(
                "with documentation or kernels",
                lambda arguments: arguments.kind in ("documentation", "kernels"),
                "--cache",
            ),
        ),
    ),
)
