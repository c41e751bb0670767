"""A request for states, in words on screen and as a command line; state/links.py has its links."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from granforce.packing.scenes import BLOCKS
from granforce.records import InputError, friction
from granforce.study import kinds
from granforce.study.keys import Parameters
from granforce.system.wording import number

from ..background.limits import Limits

# Names on screen of `walk`'s relaxations; the first is the default of a new walk.
SOLVERS = {
    "nearest": "nearest-network walk",
    "nearest_piqp": "nearest-network walk, by PIQP",
    "gauss_seidel": "walk by sweeps, finished exactly",
    "gauss_seidel_only": "the paper's walk, by sweeps alone",
}
KINDS = {"walk": "random walk", "uniform": "uniform in S"}
# Command-line options of a packing, apart from N, μ and seed.
OPTIONS = ("radii", "pressure", "dt", "box_mass", "sweeps", "accuracy", "drag_below", "box")
WORDS = {"accuracy": "step-accuracy"}  # those with other names on the command line
# Approximate limit for stored states; measures always use all states.
KEPT_BYTES = 64e6
# The least and the largest f_n of a held force, after the contact's number in the packing; force.
Bound = tuple[int, float, float]
# Disks times (disks, for the packing, and states) up to which states appear quickly, and the
# relative cost of a state of each kind.
EASY = 500_000
_WEIGHTS = {"nearest": 1, "uniform": 2, "nearest_piqp": 3, "gauss_seidel": 10}
_WEIGHTS["gauss_seidel_only"] = 10
KNOWN_FILE = "known.csv"
NO_BOUNDS = [None, None]  # of f_t


class Selection(NamedTuple):
    """Requested states: packing, friction and source."""

    packing: Parameters  # parameters of kinds.PACKING
    mu: float  # friction coefficient of the ensemble
    kind: str = "walk"  # one of KINDS
    relax: str = "nearest"  # of the walk
    states: int = 200
    seed: int = 0  # of the walk or sample
    held: tuple[Bound, ...] = ()  # forces that all states have, by contact

    @property
    def imported(self) -> bool:
        """Whether the packing was imported, or is a scene: it has no options of a compaction."""
        return "n" not in self.packing

    @property
    def name(self) -> str:
        """A short name of such a packing."""
        return str(self.packing.get("scene") or self.packing["imported"][:8])

    @property
    def same_mu(self) -> bool:
        """Whether packing and ensemble have the same friction."""
        return self.packing["mu"] == self.mu

    def at(self, mu: Any) -> Selection:
        """The same at another μ; the packing's friction also changes if it was the same.

        Held forces belong to one packing and μ, and are left out.
        """
        mu = friction(mu)
        if self.imported or not self.same_mu:
            return self._replace(mu=mu, held=())
        packing = kinds.PACKING.parameters(
            self.packing["n"], mu, self.packing["seed"], **unusual(self.packing)
        )
        return self._replace(mu=mu, packing=packing, held=())

    def holding(self, held: tuple[Bound, ...]) -> Selection:
        """The same with other held forces, in a walk that can have them."""
        sweeps = held and self.relax.startswith("gauss_seidel")
        return self._replace(held=held, relax="nearest" if sweeps else self.relax)

    def shares_packing(self, other: Selection) -> bool:
        """Whether other is of the same packing and μ: all its contacts and exact bounds."""
        return (self.packing, self.mu) == (other.packing, other.mu)

    def is_comparable(self, other: Selection) -> bool:
        """Whether other is of the same packing, or both are of packings made here by compaction."""
        return self.packing == other.packing or not (self.imported or other.imported)

    @property
    def conditions(self) -> Parameters:
        """Parameters of the S of its states, besides the packing."""
        return {"mu": self.mu, "known": rows(self.held) or None}

    @property
    def stored(self) -> int:
        """Number of states to store."""
        return min(self.states, int(KEPT_BYTES / (16 * 2 * self.packing.get("n", 400))))

    def parameters(self) -> Parameters:
        """Parameters of the walk or sample, for its kind."""
        keep = None if self.states == self.stored else self.stored
        common = self.conditions | {"keep": keep}
        if self.kind == "uniform":
            return kinds.UNIFORM.parameters(self.packing, self.states, self.seed, **common)
        return kinds.WALK.parameters(
            self.packing, self.states, self.seed, relax=self.relax, **common
        )

    @property
    def intervals(self) -> Parameters:
        """Parameters of the exact intervals of its packing at its μ."""
        return kinds.INTERVALS.parameters(self.packing, mu=self.mu)

    def check(self, limits: Limits) -> None:
        """InputError if it exceeds these Limits."""
        limits.check(states=self.states, mu=self.mu, seed=self.seed)
        if not self.imported:
            # The version of the algorithm is a parameter too, but nobody requests it.
            limits.check(**{name: self.packing[name] for name in self.packing if name != "version"})

    @property
    def dear(self) -> bool:
        """Whether it takes more than about ten seconds, or an unknown time."""
        n = self.packing.get("n", 400)
        weight = _WEIGHTS[self.relax if self.kind == "walk" else self.kind]
        odd = set() if self.imported else set(unusual(self.packing)) - {"radii", "box"}
        return bool(odd) or n * (n + weight * self.states) > EASY

    def names(self, other: Selection) -> bool:
        """Whether other is the same, apart from options without effect for this kind of states."""
        return _plain(self) == _plain(other)


def differing(requested: Selection, shown: Selection | None) -> str:
    """The differences of a Selection from another one (None: everything), in words."""
    at_mu = f"{'the packing at ' * requested.imported}μ = {requested.mu:g}"
    if shown is None or not requested.is_comparable(shown):
        return at_mu
    new, old, walks = requested.packing, shown.packing, requested.kind == "walk"
    parts = {
        at_mu: requested.mu != shown.mu,
        f"N = {new.get('n')}": new.get("n") != old.get("n"),
        f"seed {new.get('seed')}": new.get("seed") != old.get("seed"),
        f"packed at μ = {new['mu']:g}": not requested.same_mu and new["mu"] != old["mu"],
        "a random walk" if walks else f"networks {KINDS['uniform']}": requested.kind != shown.kind,
        f"{requested.states} networks": requested.states != shown.states,
        held_words(requested.held): requested.held != shown.held,
        SOLVERS[requested.relax]: walks and shown.kind == "walk" and requested.relax != shown.relax,
    }
    return ", ".join(words for words, differs in parts.items() if differs) or next(iter(parts))


def _plain(selection: Selection) -> Selection:
    return selection if selection.kind == "walk" else selection._replace(relax="")


def selected(kind: str, parameters: Parameters) -> Selection | None:
    """The Selection of a walk or sample; None if more is prescribed than normal forces."""
    packing, mu = parameters["packing"], float(parameters["mu"])
    relax, known = parameters.get("relax", "nearest"), parameters.get("known", [])
    if "prescribed" in parameters or any(None in row[:3] or row[3:] != NO_BOUNDS for row in known):
        return None
    held = tuple((contact, low, high) for contact, low, high, *_ in known)
    return Selection(packing, mu, kind, relax, parameters["states"], parameters["seed"], held)


def rows(held: Iterable[Bound]) -> list[list[Any]]:
    """Held forces as an argument of `conditions`."""
    return [[*bound, *NO_BOUNDS] for bound in held]


def held_words(held: Sequence[Bound]) -> str:
    """The number of held forces, in words."""
    return f"{len(held) or 'no'} force{'s' * (len(held) != 1)} held"


def select(
    n: int = 400,
    mu: Any = 0.1,
    packing_seed: int = 1,
    packed_mu: float | None = None,
    box: str = "square",
    **others: Any,
) -> Selection:
    """A Selection of a packing made here; InputError for invalid parameters.

    packed_mu: friction during compaction, by default that of the ensemble. box: as for `pack`.
    others: fields of Selection.
    """
    mu = friction(mu)
    packed = mu if packed_mu is None else packed_mu
    packing = kinds.PACKING.parameters(n, packed, packing_seed, box=box)
    if packing["n"] < 3:
        raise InputError(f"a packing needs at least 3 disks, got {n}")
    return Selection(packing, mu, **others)


def unusual(packing: Parameters) -> Parameters:
    """Options of a packing that differ from the defaults at its μ."""
    usual = kinds.PACKING.parameters(packing["n"], packing["mu"], packing["seed"])
    return {name: packing[name] for name in OPTIONS if packing.get(name) != usual.get(name)}


def series(
    selection: Selection, parameters: Parameters | None = None, called: str | None = None
) -> str:
    """Everything except μ, in words: selections of one series form one η(μ).

    parameters: those of the entry, if there is one; called: the files of an imported packing.
    """
    packing = selection.packing
    if selection.imported:
        scene = BLOCKS.get(packing.get("scene", ""))
        words = [scene.title if scene else f"{called or 'imported'} {selection.name}"]
    else:
        words = [f"N = {packing['n']}", f"seed {packing['seed']}"]
        words += [f"{name} {value}" for name, value in unusual(packing).items()]
        if not selection.same_mu:
            words.append(f"packed at μ = {packing['mu']:g}")
    words.append(f"{selection.states} networks")
    if selection.seed != 0:
        words.append(f"seed {selection.seed} of the networks")
    if selection.held:
        words.append(held_words(selection.held))
    usual = {"walk": 1, "uniform": 4}[selection.kind]
    chains = (parameters or {}).get("chains", usual)
    if chains != usual:
        words.append(f"{chains} chain{'s' if chains > 1 else ''}")
    words.append(SOLVERS[selection.relax] if selection.kind == "walk" else KINDS[selection.kind])
    return ", ".join(words)


def brief(selection: Selection, series: str) -> str:
    """A short form of a series for display over its picture; unchanged for an import."""
    if selection.imported:
        return series
    held = f", {held_words(selection.held)}" if selection.held else ""
    return f"{selection.packing['n']} disks, {selection.states} networks{held}"


def known_file(held: Iterable[Bound]) -> str:
    """The command that writes the file of held forces for `--known`."""
    lines = [f"{contact},{low:.12g},{high:.12g}" for contact, low, high in held]
    return f"printf '%s\\n' {shlex.join(['contact,f_n_low,f_n_high', *lines])} > {KNOWN_FILE}"


def command(selection: Selection) -> str:
    """The command that computes the same states in a terminal, after `known_file`."""
    words = ["granforce", selection.kind, *of_packing(selection), "--states", selection.states]
    if selection.kind == "walk":
        words += ["--walk-seed", selection.seed, "--relax", selection.relax]
    elif selection.seed:
        words += ["--sample-seed", selection.seed]
    words += ["--known", KNOWN_FILE] if selection.held else []
    return shlex.join(str(word) for word in words)


def of_packing(selection: Selection) -> list[Any]:
    """Words of a command that select a packing and μ."""
    packing = selection.packing
    if selection.imported:
        words = [f"{packing.get('scene', 'PACKING')}.npz"]
    else:
        words = ["-n", packing["n"], "--mu", f"{packing['mu']:.9g}", "--seed", packing["seed"]]
        for name, value in unusual(packing).items():
            words += [f"--{WORDS.get(name, name.replace('_', '-'))}", value]
    if not selection.same_mu:
        words += ["--ensemble-mu", f"{selection.mu:.9g}"]
    return words


def typed(text: str) -> Any:
    """The number in a text; another text as it is, for a check that refuses it by name."""
    try:
        return number(text)
    except ValueError:
        return text
