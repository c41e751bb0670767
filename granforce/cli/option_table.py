"""The options and arguments of all commands."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any, NamedTuple

from granforce.cli.path_roles import (
    Edited,
    Input,
    Output,
    Series,
    StorePath,
    TableOrStore,
    Workplace,
)
from granforce.study.relaxations import STORED
from granforce.system.wording import number

TABLES = ("csv", "npz", "zarr")  # suffixes of files that hold a value per contact or per state


class Option(NamedTuple):
    """An option, or an argument by position."""

    help: str
    type: Callable[[str], Any] = str  # a role of `path_roles` for a path; bool: without a value
    default: Any = None
    choices: tuple[str, ...] = ()
    metavar: str | tuple[str, ...] | None = None
    nargs: int | str | None = None
    required: bool = False
    suffixes: tuple[str, ...] = ()  # of a file, of which one selects the format
    listed: bool = False  # several values, separated by commas
    repeated: bool = False  # can be given several times
    default_shown: bool = True  # in the help, if it is a number that the text does not mention
    key: str = ""  # in `OPTIONS`

    @property
    def typed(self) -> str:
        """The option as typed in a command line."""
        return self.key.partition(":")[0]

    @property
    def attribute(self) -> str:
        """The attribute of parsed arguments that holds it."""
        return attribute(self.typed)

    @property
    def hidden(self) -> Option:
        """This option, left out of the help text."""
        return self._replace(help=argparse.SUPPRESS, default_shown=False)

    @property
    def keywords(self) -> dict[str, Any]:
        """The keyword arguments of `argparse.ArgumentParser.add_argument`."""
        words: dict[str, Any] = {"help": self._described() or None}
        if self.type is bool:
            return words | {"action": "store_true", "default": self.default}
        if self.repeated:
            words |= {"action": "append", "default": []}
        elif self.default is not None:  # argparse distinguishes None from no default
            words["default"] = self.default
        if not self.choices:
            words["type"] = self.type
        for name in ("choices", "metavar", "nargs", "required", "suffixes", "listed"):
            if value := getattr(self, name):
                words[name] = value
        return words

    def _described(self) -> str:
        if type(self.default) not in (int, float) or "default" in self.help:
            return self.help
        return f"{self.help} (default {self.default:g})" if self.default_shown else self.help


def attribute(typed: str) -> str:
    """The attribute of parsed arguments that holds an option as typed."""
    return typed.lstrip("-").replace("-", "_")


def options(keys: str) -> tuple[Option, ...]:
    """Options by their keys in `OPTIONS`, separated by blanks."""
    return tuple(OPTIONS[key]._replace(key=key) for key in keys.split())


def spec_or_file(word: str) -> str:
    """Radii as typed: a distribution with its numbers, or a file."""
    return word if ":" in word else Input(word)


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


def _switch(meaning: str) -> Option:
    """An option without a value."""
    return Option(meaning, bool, False)


def _results(what: str, also: str = "") -> Option:
    """A file of results, with words on it that hold in one command."""
    kinds = "a table (.csv), arrays (.npz) or an xarray dataset (.zarr)"
    return Option(f"write {what}: {kinds}{also}", Output, suffixes=TABLES)


# Each under its name; where commands differ, followed by a colon and the command or the subject.
OPTIONS = {
    "action": Option("", choices=("list", "size", "clear", "verify", "path")),
    "contacts:lammps": Option(
        "dump local of the contacts: two ids, distance, normal force x y, tangential force x y, "
        "in this order or under the names atom1 atom2 distance fx fy px py (without px py, fx fy "
        "are the total force)",
        Input,
    ),
    "contacts:yade": Option(
        "one line per interaction: id1 id2, phys.normalForce x y z, phys.shearForce x y z", Input
    ),
    "contacts:mercury": Option(
        "contacts: NAME.fstat, also if its files are NAME.fstat.0000, NAME.fstat.0001, …", Series
    ),
    "contacts:table": Option(
        "columns i, j (ids, or row numbers from 0); optionally nx, ny, length (otherwise the "
        "nearest images touch), and f_n, f_t, or fx, fy (total force on j)",
        Input,
        nargs="?",
    ),
    "contacts:pegs": Option("adjacency", Input, nargs="?"),
    "contacts:export": Option("file of the same type for contacts and forces", Output),
    "files": Option(
        "a packing (FILE.npz); with --frames: a folder, *_solved.mat files, or a file of "
        "positions and one of contacts",
        Input,
        nargs="*",
    ),
    "grains:lammps": Option(
        "dump custom of the particles: id, x y (or xu yu, xs ys, xsu ysu), radius or diameter; "
        "dumps may be compressed (.gz, .bz2, .xz, .zst)",
        Input,
    ),
    "grains:yade": Option(
        "bodies from export.textExt: x y z r, and id (format x_y_z_r_attrs) if there are walls",
        Input,
    ),
    "grains:mercury": Option(
        "particles: NAME.data, also if its files are NAME.data.0000, NAME.data.0001, …", Series
    ),
    "grains:table": Option(
        "columns x, y, r; optionally id, fx, fy, torque (external load, without --box), open "
        "(1: balance not required, 0) and body (label of the rigid body of disks on a floor)",
        Input,
    ),
    "grains:blocks": Option(
        "CSV with one row per corner: columns body, x, y, and optionally r (of disks), density "
        'and fixed (0 or 1); or JSON: {"bodies": [{"corners": [[x, y], …], "fixed": true}, '
        '{"disk": [x, y, r], "density": 2, "material": "wood"}, …], "friction": [["stone", '
        '"wood", 0.4], …]}, with μ of pairs of materials, where it is not --mu',
        Input,
    ),
    "grains:pegs": Option("positions, or a *_solved.mat of PeGS 2", Input),
    "grains:export": Option("FILE.vtp for ParaView, FILE.dump for LAMMPS", Output),
    "packing": Option(
        "use this packing instead of making one", Input, nargs="?", suffixes=("npz",)
    ),
    "packing:app": Option("open this packing", Input, nargs="?", suffixes=("npz",)),
    "packing:required": Option("file of the packing", Input, suffixes=("npz",)),
    "scan": Option(
        "store written by granforce scan (default: $GRANFORCE_CACHE, else the user's cache folder)",
        Input,
        metavar="STORE",
        nargs="?",
    ),
    "shell": Option("", choices=("bash", "zsh", "fish", "tcsh")),
    "--accuracy": Option("target standard error of ln V", float, 0.05),
    "--address": Option(
        "address to listen on (default localhost: this machine only)", default="localhost"
    ),
    "--again": _switch(
        "compute error bars by repeated simulated measurements of the most likely network "
        "(default: assume that all networks are equally likely before the measurement)"
    ),
    "--all": _switch("all contacts that carry force"),
    "--allow-websocket-origin": Option(
        "host name by which other machines reach the app; can be repeated",
        metavar="HOST[:PORT]",
        repeated=True,
    ),
    "--angles": Option("number of directions in the table", int, 64),
    "--basic-auth": Option(
        'ask for a name and a password: a JSON file {"name": "password", …}', Input
    ),
    "--best": Option("number of contacts to list", int, 10),
    "--box": Option(
        "square (default), or a cell whose sides and tilt adapt until the stress is isotropic, "
        "so that the packing is also jammed against shear, or a layer that rests on a floor under "
        "gravity, periodic in x only",
        default="square",
        choices=("square", "isotropic", "floor", "smooth floor"),
    ),
    "--box:import": Option(
        "sides of the periodic box (default: open)", float, metavar=("LX", "LY"), nargs=2
    ),
    "--box-mass": Option("inertia of the box", float, 100.0),
    "--cache": Option(
        "store of results (default: $GRANFORCE_CACHE, else the user's cache folder)",
        StorePath,
        metavar="FOLDER",
    ),
    "--calibration": Option(
        "calibration of --pressure-column: the pressure is a times its value plus b, with standard "
        "error sigma (1,0,sigma for a column of pressures)",
        metavar="A,B,SIGMA",
    ),
    "--certain": _switch(
        "also find the unmeasured contacts that carry force in every network within 3 σ, by "
        "exact bounds"
    ),
    "--chains": Option("independent chains", int, 1),
    "--chains:uniform": Option("independent chains", int, 4),
    "--check": Option("number of contacts to check with exact bounds", int, 10),
    "--colour": Option(
        "quantity shown as colour: mobilisation f_t/(μ f_n) (default); or, in ⟨f_n⟩: force f_n, "
        "spread (standard deviation of f_n over the networks) or interval (length of the exact "
        "interval of f_n)",
        default="mobilisation",
        choices=("mobilisation", "force", "spread", "interval"),
    ),
    "--columns:frames": Option(
        "names or numbers (from 1) of the columns frame, id, x, y, r, flag, i, j, f_t, f_n",
        metavar="x=…,y=…",
        listed=True,
    ),
    "--columns:import": Option("names of the columns in the files", metavar="x=…,y=…", listed=True),
    "--contacts": Option("only the contacts with these numbers, separated by commas", listed=True),
    "--contacts:perturb": Option("numbers of contacts, separated by commas", listed=True),
    "--critical": _switch(
        "also raise the load, starting from the packing's original forces, until bodies move"
    ),
    "--csv": Option("write these lines as a table", Output, suffixes=("csv",)),
    "--density": Option("mass per area of bodies without a density in the file (default 1)", float),
    "--documents:study": Option(
        "update the text between <!-- study: NAME --> and <!-- end --> in these files (separated "
        "by commas)",
        Edited,
        metavar="FILES",
    ),
    "--documents:bench": Option(
        "update the text between <!-- bench: PART --> and <!-- end --> in these files, names "
        "separated by commas",
        Edited,
        metavar="FILES",
    ),
    "--drag-below": Option(
        "drag replaces inertia once no grain's momentum changes by more than this in a step, in "
        "⟨f_n⟩ (default 0.02, less above 2000 disks; not used for μ ≤ 10⁻⁴)",
        float,
    ),
    "--draw-seed": Option("seed for the random choice of contacts", int, 0),
    "--cookie-secret": Option(
        "secret that signs the cookies of --basic-auth (default: $PANEL_COOKIE_SECRET)"
    ),
    "--dt": Option("maximum time step (default 0.1; 0.03 for μ ≥ 0.2)", float),
    "--effective": Option("target effective sample size: continue until it is reached", float),
    "--ensemble-mu": Option(
        "friction coefficient of the Coulomb cones, if different from the packing's", float
    ),
    "--error": Option("standard error of a force (default: estimated from the data)", float),
    "--flag": Option(
        "ignore the flags of the grains and treat grains at the boundary of the frame as grains "
        "at walls (default: the flagged grains are treated as grains at walls, unless nearly all "
        "are flagged)",
        choices=("ignore",),
    ),
    "--float32": _switch("store states in single precision"),
    "--forces": Option("require f_n and f_t", bool),
    "--formats": Option(
        "figure formats, separated by commas; an empty value draws none",
        default="html,png,svg",
        listed=True,
    ),
    "--frame:lammps": Option("timestep (default: the last complete one)", int),
    "--frame:mercury": Option(
        "number of the time step in the files, from 0 (default: the last complete one)", int
    ),
    "--frame:pegs": Option("number of the frame (default: the last)", float),
    "--frames:infer": Option(
        "import these frames and infer their forces: all, or numbers separated by commas",
        listed=True,
    ),
    "--frames:import": Option("snapshots: all, or numbers separated by commas", listed=True),
    "--gauss-seidel-packings": Option("packings with the paper's walk (default 10)", int),
    "--gravity": Option(
        "gravitational acceleration times mass density: a disk of radius r weighs π r² times "
        "this, downwards",
        float,
    ),
    "--json": _switch("print the report as JSON"),
    "--keep": Option("store only this many states, evenly spaced", int),
    "--kind": Option(
        "only entries of this kind (packing, walk, …); for size and clear also documentation "
        "(built by granforce docs) or kernels (compiled on first use)"
    ),
    "--known": Option(
        "known forces, in the packing's units: columns contact, and f_n, f_t (exact) or f_n_low, "
        "f_n_high, f_t_low, f_t_high (bounds), as written by intervals with --out; empty fields, "
        "nan and infinite bounds are ignored",
        Input,
        suffixes=TABLES,
    ),
    "--load": Option(
        "horizontal: a force equal to the weight of every body, along +x; for other loads use "
        "gf.load_factor in Python",
        choices=("horizontal",),
        required=True,
    ),
    "--max-steps": Option("maximum number of time steps", int, 100_000),
    "--measured:infer": Option(
        "columns contact, f_n, f_t, sigma_n, sigma_t, in the packing's units; empty or nan where "
        "not measured",
        Input,
        suffixes=("csv",),
    ),
    "--measured:pegs": Option(
        "write the measured forces, for granforce infer", Output, suffixes=("csv",)
    ),
    "--minutes": Option(
        "start no new computation after this many minutes; run the command again to resume", float
    ),
    "--mu": Option("friction coefficient μ", float),
    "--mu:scan": Option("friction coefficients, separated by commas", required=True, listed=True),
    "--mu:study": Option("friction coefficients, separated by commas", listed=True),
    "--mu:import": Option("friction coefficient μ", float, required=True),
    "-n": Option("number of disks", int, 400),
    "-n:study": Option("number of disks (default 400)", int),
    "--no-show": _switch("do not open a browser"),
    "--numbers": _switch("write its number at each contact"),
    "--out:pack": Option("also save the packing to this file", Output, suffixes=("npz",)),
    "--out:states": _results("the states"),
    "--out:infer": _results(
        "the result per contact", "; with --frames all frames, as one dataset (.zarr)"
    ),
    "--out:contacts": _results("the result per contact"),
    "--out:measure": _results("f_n and its interval per contact"),
    "--out:scan": Option(
        "write the table (.csv), or use this store of results instead of --cache (.zarr)",
        TableOrStore,
        suffixes=("csv", "zarr"),
    ),
    "--out:picture": Option(
        "write a picture, or a page that can be zoomed (.html)",
        Output,
        required=True,
        suffixes=("png", "svg", "pdf", "html"),
    ),
    "--out:stress": _results("the largest stress for each direction"),
    "--out:study": Option(
        "folder for the results (default study)", Workplace, "study", metavar="FOLDER"
    ),
    "--out:docs": Option("only build it, in this folder", Output, metavar="FOLDER"),
    "--out:snapshots": Option("save the packing to this file", Output, suffixes=("npz", "zarr")),
    "--out:import": Option("save the packing to this file", Output, suffixes=("npz",)),
    "--out:bench": Option(
        "write the rows (bench.json) and figures (bench.png, bench.html) to this folder",
        Workplace,
        metavar="FOLDER",
    ),
    "--packings": Option("packings at each μ (default 30)", int),
    "--paper": _switch("compute only what the paper computed, with the paper's relaxation"),
    "--parts": Option("compute only the parts with these names, separated by commas", listed=True),
    "--perturb-packings": Option(
        "number of these packings that are also pushed with smaller load steps, and with more "
        "implicit steps (default 3)",
        int,
    ),
    "--port": Option("port (default 5006; 0: any free port)", int, 5006),
    "--precision:load-factor": Option(
        "precision of the critical factor, as a fraction of the load factor", float, 1e-4
    ),
    "--precision:perturb": Option("precision of F_crit, in units of ⟨f_n⟩", float, 0.01),
    "--prescribe": Option(
        "prescribe the pressure (default in a periodic box), the whole stress (periodic box "
        "only), or nothing (default in an open box)",
        choices=("pressure", "stress", "none"),
    ),
    "--prescribe:exact": Option(
        "prescribe the pressure (default in a periodic box), the whole stress (periodic box "
        "only), or nothing (default in an open box, and with --slice)",
        choices=("pressure", "stress", "none"),
    ),
    "--pressure": Option("pressure P0", float, 1.0),
    "--pressure:table": Option("pressure P0 of a table without forces (default 1)", float),
    "--quick:study": _switch("run a small version, in minutes"),
    "--quick:bench": _switch("small sizes, under 3 minutes"),
    "--pressure-column": Option(
        "column of the mean squared gradient G², or of pressures of grains, in the table of "
        "--pressures or the files of positions of --frames; needs --calibration",
        metavar="NAME",
    ),
    "--pressures": Option(
        "columns grain, pressure, sigma, in the packing's units (or see --pressure-column); empty "
        "or nan where not measured",
        Input,
        suffixes=("csv",),
    ),
    "--radii": Option(
        "uniform:LOW,HIGH, bidisperse:SMALL,LARGE,FRACTION_LARGE, or a file with one radius per "
        "line (default uniform:0.5,1)",
        spec_or_file,
        "uniform:0.5,1",
    ),
    "--random": Option("number of randomly chosen contacts", int, 50),
    "--reach": Option(
        "largest gap of candidate contacts, in mean radii (default 0.5; 0: no candidates)",
        float,
        0.5,
    ),
    "--reduce": Option(
        "compute nothing: reduce the results in this store; missing ones come from --table",
        Input,
        metavar="STORE",
    ),
    "--relax": Option(
        "relaxation of a state: nearest (default: the nearest-network walk) and nearest_piqp (a "
        "check by PIQP) move to the nearest network; gauss_seidel_only is the paper's walk, by "
        "Gauss–Seidel sweeps to a residual of 1e-6; gauss_seidel sweeps to 1e-3 and finishes "
        "with the nearest network",
        default="nearest",
        choices=tuple(STORED),
    ),
    "--repair": Option(
        "repair up to this fraction of the data (default 0.1); the report lists every repair",
        float,
        metavar="PART",
    ),
    "--response-contacts": Option("number of contacts pushed per packing (default 20)", int),
    "--response-packings": Option(
        "number of packings in which contacts are pushed (default 10)", int
    ),
    "--reverse": _switch("reverse the sign of tangential forces"),
    "--sample-seed": Option("seed of the draws", int, 0),
    "--scale": Option("factor that multiplies the radii", float, 1.0),
    "--scene": Option(
        "make a small scene instead of a compressed packing: groove, box, pyramid, press, "
        "leaning, six, solid, column, thirteen or many; of blocks: slope, ladder, books, stones, "
        "arch or wall. Of the options for packings, only --mu applies",
        metavar="NAME",
    ),
    "--scene-options": Option(
        "options of the scene, separated by commas: courses, blocks, width, height (wall); "
        "voussoirs, thickness, opening (arch); books, overhang (books); angle, width, height "
        "(slope); angle (ladder, groove, pyramid); disks, angle (column)",
        metavar="NAME=…,NAME=…",
        listed=True,
    ),
    "--scheduler": Option(
        "run on the workers of this dask scheduler, such as tcp://head:8786, instead of local "
        "processes. Workers must see the same store. Without workers, the run ends after 10 "
        "minutes",
        metavar="ADDRESS",
    ),
    "--seed": Option("random seed", int, 1),
    "--seeds": Option("packings per μ: seeds 1 … SEEDS", int, 1, default_shown=False),
    "--sizes": Option("other numbers of disks (default 100,200,800,1600)", listed=True),
    "--slice": Option(
        "freeze the forces on contacts outside this part of the box, given as fractions of its "
        "sides, such as 0.2,0.8,0,1",
        metavar="X0,X1,Y0,Y1",
    ),
    "--state": Option("draw only network number K, counted from 0", int, metavar="K"),
    "--states": Option("number of accepted states", int, 1000),
    "--states:uniform": Option("minimum number of states", int, 1000),
    "--states:infer": Option(
        "number of samples for error bars (default 1000, or 200 with --frames; 0: no error bars)",
        int,
    ),
    "--states:informative": Option("number of uniform samples", int, 400),
    "--states:plot": Option(
        "draw the mean of these networks, written by walk, uniform or infer with --out (default: "
        "the packing's original network)",
        Input,
        suffixes=TABLES,
    ),
    "--states:study": Option("states of a walk (default 1000)", int),
    "--states:import": Option("states of a random walk, for η1 and η2", int, 0),
    "--status": _switch("compute nothing: show which parts are done and how long the rest takes"),
    "--step-accuracy": Option(
        "largest violation of the contact laws at the end of a step, relative to the speed of "
        "the fastest grain",
        float,
        0.01,
    ),
    "--stress": Option(
        "stress for --prescribe stress (default: that of the packing's original forces)",
        metavar="XX,YY,XY",
    ),
    "--strict": _switch("repair nothing; stop at the first error"),
    "--sweeps": Option("maximum number of sweeps per step (default 600; 150 for μ ≥ 0.2)", int),
    "--table:study": Option(
        "compute nothing: use this reduced study, such as data/study.zarr", Input, metavar="STORE"
    ),
    "--table:bench": Option(
        "measure nothing: draw the figures and update the documents from these rows, such as "
        "data/bench.json",
        Input,
        suffixes=("json",),
    ),
    "--tilt": Option("tilt of the box, xy in LAMMPS", float, 0.0),
    "--tolerance:table": Option(
        "largest gap at which disks count as touching, in units of the largest radius (default "
        "1e-6)",
        float,
    ),
    "--tolerance:blocks": Option(
        "largest gap or overlap of surfaces that touch, in the unit of the file (default 1e-9 of "
        "the largest body)",
        float,
    ),
    "--unit": Option(
        "units of forces in reports and tables: those of the packing (default), or the mean "
        "normal force ⟨f_n⟩; column names include the unit",
        default="packing",
        choices=("packing", "mean"),
    ),
    "--unmeasured": Option(
        "treat unmeasured forces as measured to be 0 with this standard error, in units of "
        "⟨f_n⟩. Default: 1 if S is unbounded, as in frames between walls, and with --frames; "
        "otherwise 1000, which allows any force, or 2 with --again",
        float,
    ),
    "--use-xheaders": _switch("behind a proxy: read the addresses of visitors from its headers"),
    "--volume-seed": Option("seed of the draws", int, 0),
    "--walk-seed": Option("seed of the walk", int, 0),
    "--wall-force": Option(
        "measured force of the grains on a wall of a box (left, right, bottom, top), for example "
        "from a load cell; can be repeated",
        metavar="'WALL: FX FY SIGMA'",
        repeated=True,
    ),
    "--walls:frames": Option(
        "walls of the frame: box, annulus, circle or auto (the best fit), detected from the "
        "grains at the boundary or specified (box:x0,x1,y0,y1, annulus:x,y,inner,outer, "
        "circle:x,y,R); open: no walls (default for a *_solved.mat with the directions of wall "
        "contacts)",
        metavar="SHAPE",
    ),
    "--walls:simulation": Option(
        "treat walls as grains: held (able to exert any force) or pressing (exerting the force "
        "recorded in the simulation); default: forces from walls are loads on grains",
        choices=("held", "pressing"),
    ),
    "--walls:table": Option(
        "fixed walls around the disks: a floor, a box open at the top, or segments X,Y,X,Y "
        "separated by blanks",
        walls,
        metavar="floor|box|X,Y,X,Y",
    ),
    "--warm": _switch("compile and load everything before the first visitor arrives"),
    "--workers": Option("processors to use", int, 2),
    "--workers:study": Option("processes", int, 2),
    "--yes": _switch("clear without asking, for scripts"),
}
