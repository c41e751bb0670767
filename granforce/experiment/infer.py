"""Inference: the admissible network behind forces that were measured with errors.

A measurement gives components m of forces with standard errors σ. The network in S with the least

    χ² = Σ ((f − m)/σ)²

is the likeliest one, and all of S, weighted with exp(−χ²/2), is a normal distribution cut by the
walls of S: what is known of the forces once balance and Coulomb's law are. Draws from it give the
standard error of every force, of those that were not measured too.
"""

import time
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from granforce import notebook
from granforce.explore import billiard, uniform
from granforce.explore.mixing import Mixing, mixing
from granforce.explore.walls import Walls, walls
from granforce.forces.ensemble import Ensemble
from granforce.forces.likeliest import UNMEASURED, Likeliest, checked, likeliest
from granforce.records import random_seed, takes, whole, worker_count
from granforce.system import cancelling
from granforce.system.memory import check_memory
from granforce.types import Cancel, Floats, Integers, Progress

# Residuals beyond so many standard errors are told.
SUSPECT = 3.0
# A quarter of an oscillation: without walls the next state does not depend on the last.
_TIME = np.pi / 2
# Paths between states that are kept: 1000 states are then worth 300 to 900 independent ones.
_PATHS = 4
# Paths whose speeds are drawn side by side.
_AT_ONCE = 8
# States dropped at the start of each chain.
_DROPPED = 20


Kind = TypeVar("Kind", bound="Inference")


@notebook.brief
class Draws(NamedTuple):
    """States of S drawn with the weight exp(−χ²/2), by chain, and whether they can be trusted."""

    states: Floats  # (chains, k, N_c, 2) admissible networks, force
    residual: Floats  # (chains, k) in ⟨f_n⟩, by Ensemble.residual
    violation: Floats  # (chains, k) in ⟨f_n⟩, by Ensemble.violation
    mixing: Mixing  # R̂, bulk and tail effective sample size of each component
    reached: bool  # all in S, and R̂ ≤ MIXED
    counts: dict[str, Any]  # turns, refused paths, dropped states, held coordinates
    setup_seconds: float  # wall time of the walls
    sampling_seconds: float  # wall time of the draws, those dropped included

    effective = uniform.UniformSample.effective  # type: ignore[misc]
    flat = uniform.UniformSample.flat  # type: ignore[misc]
    chain = uniform.UniformSample.chain  # type: ignore[misc]


@notebook.brief
class Inference(NamedTuple):
    """The network that a measurement speaks for, and how sure it is."""

    forces: Floats  # (N_c, 2) the admissible network with the least χ², force
    chi_square: float  # its Σ ((f − m)/σ)²
    freedom: int  # degrees of freedom: what was measured less what the network could adapt to
    deviation: Floats  # (N_c, 2) its (f − m)/σ, NaN where nothing was measured
    suspects: Integers  # (s,) contacts, as numbers in the packing, beyond 3 σ, largest first
    residual: float  # in ⟨f_n⟩, by Ensemble.residual
    violation: float  # in ⟨f_n⟩, by Ensemble.violation
    draws: Draws | None  # None where none were asked for
    seconds: float  # wall time, draws included

    @property
    def drawn(self) -> Draws:
        """The draws; AttributeError where none were asked for."""
        if self.draws is None:
            raise AttributeError("no states were drawn: set `states`")
        return self.draws

    @property
    def mean(self) -> Floats:
        """(N_c, 2) mean of the draws, force."""
        return self.drawn.flat.mean(axis=0)

    @property
    def error(self) -> Floats:
        """(N_c, 2) standard error of every force: the standard deviation of the draws."""
        return self.drawn.flat.std(axis=0)

    def _repr_html_(self) -> str:
        """The inference as notebooks show it."""
        lines = {
            "measured components": int(np.isfinite(self.deviation).sum()),
            "χ²": self.chi_square,
            "degrees of freedom": self.freedom,
            "contacts beyond 3 σ": len(self.suspects),
        }
        if self.draws is not None:
            lines |= {"draws": len(self.draws.flat), "mean standard error": self.error.mean()}
            lines |= {"worst R̂": self.draws.mixing.worst_r_hat, "worth": self.draws.effective}
        return notebook.table("Inferred forces", lines)


@takes(Ensemble)
@cancelling.cancellable
def infer(
    ensemble: Ensemble,
    measured: npt.ArrayLike,
    sigma: npt.ArrayLike,
    *,
    states: int = 0,
    seed: int = 0,
    unmeasured: float = UNMEASURED,
    chains: int = 4,
    workers: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Inference:
    """The admissible network with the least Σ ((f − m)/σ)², and draws around it; an Inference.

    measured, sigma: m and σ (N_c of S, 2), force; NaN where a component was not measured. σ may be
    one number, or two for f_n and f_t. states: at least so many draws from the normal distribution
    of the measurement cut by S, for error bars, by `chains` independent chains. workers: threads,
    which change nothing in the result. progress(done, total) counts draws.

    unmeasured: what was not measured counts as 0 with a standard error of so many ⟨f_n⟩. As it is,
    that only chooses the least of networks that fit equally well; where neither S nor the
    measurement bounds some forces (no pressure is prescribed), it is all that does.

    Raises InputError for shapes that do not fit and σ ≤ 0, NotJammedError where S is empty.
    """
    begin = time.perf_counter()
    numbers, seed = (states, chains, workers), random_seed(seed)
    m, s, best, numbers = asked(ensemble, measured, sigma, unmeasured, numbers)
    draws = None
    if numbers[0]:
        # In ⟨f_n⟩, so that χ² = Σ W (f − m)².
        m, s = m / ensemble.force_scale, s / ensemble.force_scale
        weight = np.where(np.isnan(m), unmeasured, s) ** -2.0
        draws = _draws(ensemble, weight, np.nan_to_num(m), numbers, seed, progress)
    return told(Inference, ensemble, best, draws, begin)


def asked(
    ensemble: Ensemble,
    measured: npt.ArrayLike,
    sigma: npt.ArrayLike,
    unmeasured: float,
    numbers: tuple[int, int, int],
    least: int = 0,
) -> tuple[Floats, Floats, Likeliest, tuple[int, int, int]]:
    """(m, σ, the likeliest network, numbers) of arguments; numbers: draws, chains, workers."""
    draws, chains = whole(numbers[0], "states", least), whole(numbers[1], "chains", 1)
    workers, most = worker_count(numbers[2]), max(draws, chains)
    check_memory(16 * most * len(ensemble.index), f"{most} states")
    m, s = checked(ensemble, measured, sigma)
    return m, s, likeliest(ensemble, m, s, unmeasured), (draws, chains, workers)


def told(
    kind: type[Kind], ensemble: Ensemble, best: Likeliest, draws: Draws | None, begin: float
) -> Kind:
    """The Inference, or one of its kind, of a likeliest network and draws, and what it took."""
    far = np.nan_to_num(np.abs(best.deviation)).max(axis=1, initial=0.0)
    beyond = np.flatnonzero(far > SUSPECT)
    return kind(
        *best,
        ensemble.index[beyond[np.argsort(-far[beyond], kind="stable")]],
        ensemble.residual(best.forces),
        ensemble.violation(best.forces),
        draws,
        time.perf_counter() - begin,
    )


def judged(
    ensemble: Ensemble,
    found: Floats,
    worth: Mixing,
    mixed: bool,
    counts: dict[str, Any],
    *seconds: float,
) -> Draws:
    """The Draws of states (chains, k, N_c, 2), by the judges of the ensemble and their mixing."""
    residual, violation = ensemble.residual(found), ensemble.violation(found)
    good = bool(uniform.inside(residual, violation) and mixed)
    return Draws(found, residual, violation, worth, good, counts, *seconds)


def _draws(
    ensemble: Ensemble,
    weight: Floats,
    m: Floats,
    numbers: tuple[int, int, int],
    seed: int,
    progress: Progress | None,
) -> Draws:
    begin, (states, chains, workers) = time.perf_counter(), numbers
    made = walls(ensemble, weight, m)
    stores, on = uniform.stores_for(made, chains, workers), partial(step, made)
    ready = time.perf_counter()
    ends = uniform.begun(made, chains, seed)
    ends, _, dropped = uniform.together(stores, ends, partial(on, count=_DROPPED))
    each = -(-states // chains)
    _, found, done = uniform.drawn(ensemble, made, stores, ends, on, 0, each, progress)
    cancelling.check("inference")
    drawn = time.perf_counter()
    worth = mixing(found, uniform.varying(ensemble, made))
    counts = uniform.counted({"turns": 0, "refused": 0}, dropped + done)
    counts |= {"dropped": _DROPPED * chains, "held": len(made.centre) - len(made.moving)}
    mixed = not made.dimension or worth.worst_r_hat <= uniform.MIXED
    return judged(ensemble, found, worth, mixed, counts, ready - begin, drawn - ready)


def step(
    made: Walls,
    ends: Sequence[uniform.ChainState],
    rows: billiard.RowStore | None = None,
    *,
    count: int,
) -> uniform.Flown:
    """The next `count` states of some chains, as `uniform.step` gives them.

    Two steps take turns (Gibbs). To every wall's 1 + B (f − f°) a normal error of variance 1 is
    added, its companion; given those, f has a normal distribution of precision Bᵀ B + W around a
    point that one solve gives, cut by the walls: a harmonic path for a quarter of an oscillation
    draws from it. Without a measurement that leaves uniform states.
    """
    rows, times = rows or billiard.room_for_rows(made.count), np.array([_TIME])
    pulls = np.tile(made.pull, (len(ends), 1))
    ahead: list[Any] = []

    def on(ends: list[uniform.ChainState], left: int) -> uniform.Flown:
        if not ahead:
            drawn = [_drawn(made, end.rng, min(_AT_ONCE, left)) for end in ends]
            ahead.extend(zip(*(zip(*one, strict=True) for one in drawn), strict=True))
        speeds, errors = zip(*ahead.pop(0), strict=True)
        shifts = [error + end.slacks for error, end in zip(errors, ends, strict=True)]
        middles = 1.0 + made.moved(np.stack(shifts) - 1.0, pulls)
        paths = [(w[None], times, m[None]) for w, m in zip(speeds, middles, strict=True)]
        return uniform.flown(made, rows, ends, paths)

    return uniform.walked(made, ends, count, _PATHS, on)


def _drawn(made: Walls, rng: np.random.Generator, count: int) -> tuple[Floats, Floats]:
    """Speeds (count, walls) of covariance K, and errors (count, walls) of companions."""
    push, error = (np.empty((count, made.count)) for _ in range(2))
    pull = np.empty((count, made.root.size))
    for path in range(count):
        push[path], error[path] = rng.standard_normal((2, made.count))
        pull[path] = made.root * rng.standard_normal(made.root.size)
    return made.moved(push, pull), error
