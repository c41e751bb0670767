"""The commands: their summaries, examples and options, and which options exclude others."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import NamedTuple

from granforce.cli import report_lines
from granforce.cli.option_table import Option, attribute, options

Options = tuple[Option, ...]


class Group(NamedTuple):
    """Options under one heading of the help text."""

    title: str
    options: Options
    description: str | None = None
    one_of: Options = ()  # of which one may be given; they come first


class Rule(NamedTuple):
    """Options that have no effect in one form of a command."""

    words: str  # that form in words: "with --scene"
    holds: Callable[[argparse.Namespace], bool]  # whether a command line has that form
    options: Options

    @property
    def names(self) -> frozenset[str]:
        """The options as attributes."""
        return frozenset(option.attribute for option in self.options)


class Command(NamedTuple):
    name: str
    summary: str
    example: str
    parts: tuple[Options | Group, ...]  # in the order of the help text
    rules: tuple[Rule, ...] = ()
    lines: tuple[str, ...] = ()  # of its report, explained in the help text
    columns: tuple[str, ...] = ()  # of its list of contacts, explained likewise
    formats: tuple[Command, ...] = ()


def given(typed: str) -> Callable[[argparse.Namespace], bool]:
    """Whether an option has a value."""
    name = attribute(typed)
    return lambda arguments: getattr(arguments, name) not in (None, False)


def with_option(typed: str, useless: Options) -> Rule:
    return Rule(f"with {typed}", given(typed), useless)


def without(typed: str, useless: Options, also: str = "") -> Rule:
    has = given(typed)
    return Rule(f"without {typed}{also}", lambda arguments: not has(arguments), useless)


SHAPE = options("-n --radii --pressure --box")
COMPACTION = options("--dt --box-mass --sweeps --step-accuracy --drag-below")
EXPERT = Group("expert settings of the compaction", COMPACTION)
PACKING = Group("the packing", options("-n --mu --seed --radii --pressure --box"))
# A packing that is made unless a file is given.
MADE_PACKING = (PACKING, tuple(option.hidden for option in COMPACTION))
ANY_PACKING = (options("--json packing"), *MADE_PACKING)
FROM_FILE = "with the file of a packing"
MADE = PACKING.options + COMPACTION
NO_FILE = Rule(FROM_FILE, given("packing"), MADE)
WALK = Group(
    "the random walk", options("--states --walk-seed --ensemble-mu --relax --chains --workers")
)
CONDITIONS = Group(
    "conditions on the forces, in addition to equilibrium and friction",
    options("--prescribe --stress --known"),
)
NO_UNIT = without("--out", options("--unit"))
EXACT = (
    *ANY_PACKING,
    Group(
        "the ensemble", options("--ensemble-mu --contacts --slice --workers --out:contacts --unit")
    ),
    CONDITIONS._replace(options=options("--prescribe:exact --stress --known")),
    options("--cache"),
)
EXACT_RULES = (
    NO_FILE,
    Rule(
        "with --slice, where the frozen contacts determine the stress",
        lambda arguments: arguments.slice is not None and arguments.prescribe != "none",
        options("--prescribe:exact --stress"),
    ),
)
# Of photoelastic frames.
READING = options("--reach --scale --error --reverse --columns:frames")
REPAIR = options("--flag --repair --strict --walls:frames --wall-force")
STRICT = with_option("--strict", options("--repair"))
SNAPSHOTS = Group(
    "many snapshots",
    options("--frames:import --states:import --walk-seed --csv --workers --scheduler --cache"),
    "with --frames: write exact intervals of all snapshots to one dataset (--out FOLDER.zarr), "
    "and print one line per snapshot",
)
SNAPSHOT_RULES = (
    without("--frames", options("--states:import --walk-seed --csv --workers --scheduler --cache")),
    with_option("--frames", options("--frame:lammps --frame:mercury")),
    Rule(
        "without --states",
        lambda arguments: arguments.frames and not arguments.states,
        options("--walk-seed"),
    ),
)
STUDY_SIZE = Group(
    "size",
    options(
        "-n:study --mu:study --packings --states:study --gauss-seidel-packings --response-packings "
        "--response-contacts --perturb-packings --sizes"
    ),
)
RUN = options("--minutes --workers --scheduler")  # options of a study that computes


# One parser per format: it takes the options that its reader in `granforce.packing.importers`
# uses, named after the reader's arguments, and rejects all others.
FORMATS = (
    Command(
        "lammps",
        "import a particle dump and a contact dump from LAMMPS",
        "particles.dump contacts.dump",
        (
            options(
                "--json grains:lammps contacts:lammps --mu:import --out:snapshots --frame:lammps "
                "--columns:import --walls:simulation --reverse"
            ),
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
            options(
                "--json grains:yade contacts:yade --mu:import --out:import --box:import --tilt "
                "--columns:import --walls:simulation --reverse"
            ),
        ),
        (),
        report_lines.IMPORT,
    ),
    Command(
        "mercury",
        "import .data and .fstat files from MercuryDPM",
        "run.data run.fstat",
        (
            options(
                "--json grains:mercury contacts:mercury --mu:import --out:snapshots "
                "--frame:mercury --box:import --tilt --walls:simulation --reverse"
            ),
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
            options(
                "--json grains:table contacts:table --mu:import --out:import --box:import --tilt "
                "--columns:import --reverse --walls:table --gravity --tolerance:table --forces "
                "--pressure:table"
            ),
        ),
        (
            Rule(
                "with a table of contacts and no walls",
                lambda arguments: arguments.contacts is not None and arguments.walls is None,
                options("--tolerance:table"),
            ),
        ),
        report_lines.IMPORT,
    ),
    Command(
        "blocks",
        "import rigid bodies: convex polygons and disks",
        "bodies.csv",
        (options("--json grains:blocks --mu:import --out:import --density --tolerance:blocks"),),
        (),
        report_lines.IMPORT,
    ),
    Command(
        "pegs",
        "import a photoelastic frame from PeGS",
        "positions.txt adjacency.txt",
        (
            options("--json grains:pegs contacts:pegs --mu:import --out:import --frame:pegs"),
            READING + REPAIR + options("--measured:pegs"),
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
        (
            options("--json --scene --scene-options"),
            PACKING,
            EXPERT,
            options("--cache --max-steps --out:pack"),
        ),
        (
            without("--scene", options("--scene-options")),
            with_option("--scene", SHAPE + COMPACTION + options("--seed --cache --max-steps")),
        ),
        report_lines.PACK,
    ),
    Command(
        "walk",
        "random walk through the force networks of a packing",
        "granforce walk -n 400 --mu 0.1 --seed 1 --states 1000 --out states.zarr",
        (*ANY_PACKING, WALK, CONDITIONS, options("--cache --out:states --unit")),
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
                options(
                    "--states:uniform --sample-seed --ensemble-mu --chains:uniform --effective "
                    "--workers"
                ),
            ),
            CONDITIONS,
            options("--cache --out:states --unit"),
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
            Group("the volume", options("--accuracy --volume-seed --ensemble-mu --workers")),
            CONDITIONS,
            options("--cache"),
        ),
        (NO_FILE,),
        report_lines.VOLUME,
    ),
    Command(
        "infer",
        "find the most likely admissible network given measured forces of contacts or pressures of "
        "grains, with error bars",
        "granforce infer frame.npz --measured frame.csv\n"
        "  granforce infer folder --frames all --mu 0.5 --out series.zarr",
        (
            options("--json files"),
            *MADE_PACKING,
            Group(
                "the inference",
                options(
                    "--measured:infer --pressures --pressure-column --calibration "
                    "--unmeasured --again --states:infer --certain --sample-seed "
                    "--ensemble-mu --chains:uniform --workers --out:infer --unit"
                ),
            ),
            CONDITIONS,
            options("--cache"),
            Group("many photoelastic frames", options("--frames:infer") + READING + REPAIR),
            options("--scheduler"),
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
                READING + REPAIR + options("--scheduler"),
                " (--frames all reads the two files of photoelastic frames)",
            ),
            with_option(
                "--frames",
                SHAPE
                + COMPACTION
                + CONDITIONS.options
                + options(
                    "--seed --measured:infer --pressures --again --certain --chains:uniform "
                    "--ensemble-mu"
                ),
            ),
            Rule(
                "without --pressures or --frames",
                lambda arguments: arguments.pressures is None and arguments.frames is None,
                options("--pressure-column"),
            ),
            without("--pressure-column", options("--calibration")),
            Rule(
                "with --states 0",
                lambda arguments: arguments.states == 0,
                options("--sample-seed --chains:uniform --again"),
            ),
            Rule(
                "with --pressures alone, --states 0 and no --out",
                lambda arguments: (
                    arguments.pressures is not None
                    and arguments.measured is None
                    and arguments.states == 0
                    and arguments.out is None
                ),
                options("--unit"),
            ),
            Rule(
                "with --states 0 and without --certain or --frames",
                lambda arguments: (
                    arguments.states == 0 and not arguments.certain and arguments.frames is None
                ),
                options("--workers"),
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
                options(
                    "--best --check --states:informative --sample-seed --ensemble-mu --workers "
                    "--out:contacts --unit"
                ),
            ),
            CONDITIONS,
            options("--cache"),
        ),
        (NO_FILE,),
        report_lines.INFORMATIVE,
    ),
    Command(
        "measure",
        "compute the indeterminacy η1, η2, η3 from a random walk, optionally for each contact",
        "granforce measure -n 400 --mu 0.1 --seed 1 --states 1000 --out contacts.csv",
        (*ANY_PACKING, WALK, CONDITIONS, options("--cache --out:measure --unit")),
        (NO_FILE,),
        report_lines.MEASURE,
    ),
    Command(
        "scan",
        "generate packings and run random walks for many μ and seeds in parallel; interrupted runs "
        "resume",
        "granforce scan --mu 0,0.01,0.1,1,10 --seeds 2 -n 400 --states 1000 --out scan.zarr",
        (
            options("--json --mu:scan --seeds"),
            PACKING._replace(options=SHAPE),
            EXPERT,
            WALK,
            options("--out:scan --cache --keep --float32 --scheduler"),
        ),
        (
            Rule(
                "with --out FOLDER.zarr",
                lambda arguments: arguments.out is not None and not arguments.out.endswith(".csv"),
                options("--cache"),
            ),
        ),
        report_lines.SCAN,
    ),
    Command(
        "figures",
        "draw Figure 1 of the paper from the store of a scan",
        "granforce figures scan.zarr --out figure1.pdf",
        (options("scan --out:picture"),),
    ),
    Command(
        "plot",
        "draw a packing and its contact forces",
        "granforce plot packing.npz --out packing.png\n"
        "  granforce plot packing.npz --states states.zarr --colour spread --out spread.pdf",
        (options("packing:required --out:picture --states:plot --state --numbers --colour"),),
        (without("--states", options("--state")),),
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
        (options("--json packing:required --load --critical --precision:load-factor"),),
        (without("--critical", options("--precision:load-factor")),),
        report_lines.LOAD_FACTOR,
    ),
    Command(
        "rest",
        "test whether the grains of a packing stay at rest in contact dynamics, also with noise on "
        "the forces",
        "granforce rest packing.npz",
        (options("--json packing:required --ensemble-mu"),),
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
            Group("the outline", options("--ensemble-mu --angles --known --workers --out:stress")),
            options("--cache"),
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
                options(
                    "--draw-seed --ensemble-mu --precision:perturb --workers --out:contacts --unit"
                ),
                one_of=options("--random --contacts:perturb --all"),
            ),
            CONDITIONS._replace(options=options("--prescribe --stress")),
            options("--cache"),
        ),
        (
            NO_FILE,
            with_option("--all", options("--random --draw-seed")),
            with_option("--contacts", options("--random --draw-seed")),
        ),
        report_lines.PERTURB,
        report_lines.CRITICAL,
    ),
    Command(
        "study",
        "repeat the paper's study, draw its figures and judge its claims; interrupted runs resume",
        "granforce study --out study\n  granforce study --quick --out quick",
        (
            options(
                "--json --quick:study --out:study --paper --parts --minutes --status --table:study "
                "--reduce --documents:study"
            ),
            STUDY_SIZE,
            options("--workers:study --formats --scheduler"),
        ),
        (
            with_option(
                "--status", RUN + options("--table:study --reduce --documents:study --formats")
            ),
            with_option("--reduce", RUN + options("--paper --parts")),
            Rule(
                "with --table alone",
                lambda arguments: arguments.table is not None and arguments.reduce is None,
                RUN + STUDY_SIZE.options + options("--paper --parts --quick:study"),
            ),
        ),
    ),
    Command(
        "app",
        "open the app in a browser",
        "granforce app\n  granforce app packing.npz\n  granforce app --port 8080 --no-show",
        (
            options(
                "packing:app --port --address --allow-websocket-origin --use-xheaders --no-show "
                "--warm --basic-auth --cookie-secret"
            ),
        ),
        (without("--basic-auth", options("--cookie-secret")),),
    ),
    Command(
        "docs",
        "build the documentation and open it in a browser; stop with Ctrl-C",
        "granforce docs\n  granforce docs --out site",
        (options("--out:docs"),),
    ),
    Command(
        "completion",
        "print a script for shell completion of commands, options and files",
        "granforce completion bash > ~/.local/share/bash-completion/completions/granforce\n"
        "  granforce completion zsh > ~/.zfunc/_granforce\n"
        "  granforce completion fish > ~/.config/fish/completions/granforce.fish",
        (options("shell"),),
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
        (options("packing:required grains:export contacts:export"),),
    ),
    Command(
        "bench",
        "measure the run time and error of every solver on this machine",
        "granforce bench --quick --out bench",
        (options("--json --quick:bench --out:bench --documents:bench --table:bench"),),
        (
            Rule(
                "without --documents or --out",
                lambda arguments: not (arguments.documents or arguments.out),
                options("--table:bench"),
            ),
            with_option("--table", options("--quick:bench --json")),
        ),
    ),
    Command(
        "cache",
        "list, clear or verify the store of results, or print its size or its path; also for the "
        "built documentation and the compiled kernels",
        "granforce cache verify --cache scan.zarr",
        (options("--json action --kind --yes --cache"),),
        (
            Rule("with path", lambda arguments: arguments.action == "path", options("--kind")),
            Rule("without clear", lambda arguments: arguments.action != "clear", options("--yes")),
            Rule(
                "with documentation or kernels",
                lambda arguments: arguments.kind in ("documentation", "kernels"),
                options("--cache"),
            ),
        ),
    ),
)
