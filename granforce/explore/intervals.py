"""Exact bounds: the least and largest f_n and f_t of every contact over S, and limit loads.

Each bound is a linear program in cone coordinates y ≥ 0. All are solved by an interior-point method
that carries eight programs side by side (`linear_programs`), and certified without trust in any
solver (`certified_values`). What 400 disks at μ = 0.1 took (h = 232, 2628 programs, one thread of a
shared machine):

    HiGHS, primal simplex, each program warm-started from the last        88 s, 384 pivots each
    dense tableau, exact steepest edge, the nearest program next          51 s, 158 pivots each
    product-form simplex from the best of 100 stored vertices             54 s, 430 pivots each
    interior point, eight lanes                                            4 s,  16 steps each
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce import measures, notebook
from granforce.forces.contact_problem import make_system
from granforce.forces.ensemble import Ensemble
from granforce.forces.nearest import starting_network
from granforce.numerics.certified_values import Solver, System
from granforce.numerics.linear_programs import Program
from granforce.records import Cancel, Floats, InputError, Integers, Mask, Progress, float_array
from granforce.system import cancelling
from granforce.tolerances import ADMISSIBLE, BALANCED, CARRYING, INTERVAL_GAP

Key = tuple[int, int, int]  # contact, component and side of a bound
Bounds = dict[Key, tuple[float, float]]  # value attained, and the value that bounds it


class Intervals(NamedTuple):
    """Bounds over S of the forces on k contacts; column 0 is f_n, column 1 is f_t."""

    contacts: Integers  # (k,) their numbers in the packing
    lower: Floats  # (k, 2) least value, force; NaN where cancelled before, or not certified
    upper: Floats  # (k, 2) largest value, force; NaN likewise
    gap: Floats  # (k, 2, 2) duality gap of [component, lower or upper] in ⟨f_n⟩
    backbone: Mask  # (k,) bool, largest f_n > 0
    max_gap: float  # largest gap among the bounds that were reached
    converged: bool  # every bound was reached with a gap ≤ INTERVAL_GAP
    counts: dict[str, int]  # programs solved, skipped by reason, solved again by HiGHS; iterations

    def _repr_html_(self) -> str:
        """The bounds as notebooks show them."""
        lines: dict[str, Any] = {
            "contacts": len(self.contacts),
            "all bounds certified": self.converged,
        }
        if self.converged and len(self.contacts):
            extent = measures.normal_extent(self.lower, self.upper)
            lines |= {"exact η3": measures.eta3(self.lower, self.upper), "mean ΔFₙ": extent.mean()}
            lines |= {"largest ΔFₙ": extent.max()}
        lines |= {"largest duality gap / ⟨fₙ⟩": self.max_gap, **self.counts}
        return notebook.table("Exact intervals over S", lines)


class Bound(NamedTuple):
    """One exact bound, as it is found."""

    contact: int  # its number in the packing
    component: int  # 0 for f_n, 1 for f_t
    side: int  # 0 for the least value, 1 for the largest
    value: float  # force


class LimitLoads(NamedTuple):
    """Largest force pairs that S can carry on k contacts."""

    contacts: Integers  # (k,) their numbers in the packing
    load: Floats  # (k,) limit load F, force; NaN where cancelled before, or not certified
    gap: Floats  # (k,) duality gap in ⟨f_n⟩
    max_gap: float
    converged: bool  # every load was reached with a gap ≤ INTERVAL_GAP
    counts: dict[str, int]  # programs, again, iterations


@cancelling.cancellable
def intervals(
    ensemble: Ensemble,
    contacts: npt.ArrayLike | None = None,
    *,
    workers: int = 1,
    states: Floats | None = None,
    skip: bool = True,
    widths: Floats | None = None,
    watch: Callable[[Bound], object] | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Intervals:
    """Least and largest f_n and f_t over S on contacts (numbers in the packing; default all of S).

    workers: threads; the result does not depend on their number. states (…, N_c, 2): known
    states of S. skip: a contact seen with f_n = 0 in one of them, or in the optimum of another
    program, needs no program for its least f_n. watch(Bound) is called with each bound as it is
    found, those of the largest widths (N_c,) first, which change nothing else: all upper bounds of
    f_n, then the lower ones, then those of f_t; at last, perhaps again, those where f_n = 0 was
    seen, which differ by INTERVAL_GAP at most. progress(done, total) is called as programs end.
    cancel() → True ends early: what is not reached yet is NaN and ``converged`` False.

    Raises InputError for a contact that carries nothing and where the forces in S are not bounded,
    NotJammedError where S is empty, Cancelled where that was asked for before the first program.
    """
    places = _positions(ensemble, contacts)
    frictionless = ensemble.mu == 0
    ordered = _widest_first(ensemble, places, widths)
    upper = [(int(c), 0, 1) for c in ordered]
    tangential = [] if frictionless else [(int(c), 1, side) for c in ordered for side in (0, 1)]
    lower = [(int(c), 0, 0) for c in ordered]
    total = len(upper) + len(tangential) + len(lower)
    known = _Seen(ensemble, states)
    report = _counting(progress, total)
    found = _watched(ensemble, watch)
    system = make_system(ensemble)

    def seen(key: Key, y: Floats) -> None:
        # What lower bounds attain counts as seen nowhere: the others alone tell which are needed.
        if key[1:] != (0, 0):
            known.add(y)

    solver = Solver(system, workers=workers, seen=seen, report=report, found=found)
    pinned = _pinned(ensemble, upper + tangential + lower)
    report(len(pinned))
    if needs_no_program(ensemble, system):
        keys = [key for key in upper + tangential + lower if key not in pinned]
        pinned |= determined(ensemble, keys)
        report(len(keys))
    for key, value in pinned.items():
        found(key, *value)

    def zero(key: Key) -> bool:
        """Whether f_n = 0 was seen there."""
        return skip and key not in pinned and known.least[key[0]] <= INTERVAL_GAP

    def solve(keys: Sequence[Key]) -> Bounds:
        keys = [key for key in keys if key not in pinned]
        return solver.solve(keys, [bound_of(ensemble, *key) for key in keys])

    bounds = pinned | solve(upper)
    # Lower bounds come early for those who watch. What is seen afterwards replaces them: the result
    # is as if they had come last, for a program or two in a hundred more.
    bounds |= solve([key for key in lower if not zero(key)] + tangential)
    seen_zero = [key for key in lower if zero(key)]
    for key in seen_zero:
        bounds[key] = (max(0.0, float(known.least[key[0]])), 0.0)
        found(key, *bounds[key])
    counts = solver.counts | {
        "f_n = 0 seen in a known state": len(seen_zero),
        "frictionless contact": 2 * len(places) if frictionless else 0,
    }
    if ensemble.known is not None:
        counts["known exactly"] = len(pinned)
    return _intervals(ensemble, places, bounds, counts)


def _widest_first(ensemble: Ensemble, places: Integers, widths: Floats | None) -> Integers:
    """The places (k,) by their width (N_c,), the largest first; as they are without one."""
    if widths is None:
        return places
    widths = float_array(widths, (len(ensemble.index),), "widths")
    return places[np.argsort(-widths[places], kind="stable")]


def _watched(
    ensemble: Ensemble, watch: Callable[[Bound], object] | None
) -> Callable[[Key, float, float], None]:
    """found(key, attained, bound) for a Solver, which calls watch with what is certified."""

    def found(key: Key, attained: float, bound: float) -> None:
        if watch and abs(attained - bound) <= INTERVAL_GAP:
            contact, component, side = key
            value = (-attained if side else attained) * ensemble.force_scale
            watch(Bound(int(ensemble.index[contact]), component, side, float(value)))

    return found


def _pinned(ensemble: Ensemble, keys: Sequence[Key]) -> Bounds:
    """{key: (value attained, value that bounds it)} of those whose component is known exactly."""
    if ensemble.known is None:
        return {}
    pinned, value = ensemble.known.pinned, ensemble.known.value
    found = {}
    for c, component, side in keys:
        if pinned[c, component]:
            attained = float(-value[c, component] if side else value[c, component])
            found[c, component, side] = attained, attained
    return found


def needs_no_program(ensemble: Ensemble, system: System) -> bool:
    """Whether all is `determined`; asked where S has no inside, or something is known, only."""
    asked = ensemble.known is not None or not system.middle.reached
    return asked and ensemble.is_determined


def determined(ensemble: Ensemble, keys: Sequence[Key]) -> Bounds:
    """{key: (value attained, value that bounds it)} where the equations leave no freedom.

    For each there are rows λ with Aᵀλ = 1 there and 0 elsewhere, hence x = b·λ, in all of S. What
    rounding leaves of Aᵀλ bounds the error.
    """
    held = np.zeros((len(ensemble.index), 2), bool)
    held = held if ensemble.known is None else ensemble.known.pinned
    free = np.flatnonzero(~ensemble.to_vector(held).astype(bool))
    x = ensemble.to_vector(starting_network(ensemble)) / ensemble.force_scale
    fixed = np.where(np.isin(np.arange(len(x)), free), 0.0, x)
    A = ensemble.A.tocsc()[:, free].toarray()
    b = ensemble.b / ensemble.force_scale - ensemble.A @ fixed
    rows = cancelling.apart(np.linalg.pinv, A)
    left = np.abs(np.eye(len(free)) - rows @ A).sum(axis=1) * np.abs(x).max(initial=0.0)
    follows = rows @ b
    place = {
        (k // ensemble.per_contact, k % ensemble.per_contact): n
        for n, k in enumerate(free.tolist())
    }
    found = _pinned(ensemble, keys)
    for c, component, side in (key for key in keys if key not in found):
        n = place[c, component]
        sign = -1.0 if side else 1.0
        found[c, component, side] = sign * x[free[n]], sign * follows[n] - left[n]
    return found


def _intervals(
    ensemble: Ensemble, places: Integers, bounds: Bounds, counts: dict[str, int]
) -> Intervals:
    value = np.full((len(places), 2, 2), np.nan)
    gap = np.full_like(value, np.nan)
    row = {int(c): k for k, c in enumerate(places)}
    for (place, component, side), (attained, bound) in bounds.items():
        value[row[place], component, side] = -attained if side else attained
        gap[row[place], component, side] = abs(attained - bound)
    if ensemble.mu == 0:
        value[:, 1], gap[:, 1] = 0.0, 0.0
    value[~(gap <= INTERVAL_GAP)] = np.nan
    value *= ensemble.force_scale
    max_gap, converged = _judged(gap)
    backbone = value[:, 0, 1] > CARRYING * ensemble.force_scale
    low, high, numbers = value[..., 0], value[..., 1], ensemble.index[places]
    return Intervals(numbers, low, high, gap, backbone, max_gap, converged, counts)


@cancelling.cancellable
def limit_loads(
    ensemble: Ensemble, contacts: npt.ArrayLike | None = None, **options: Any
) -> Floats:
    """Limit loads F (k,), force, of the given contacts; see `limit_load_bounds`."""
    return limit_load_bounds(ensemble, contacts, **options).load


@cancelling.cancellable
def limit_load_bounds(
    ensemble: Ensemble,
    contacts: npt.ArrayLike | None = None,
    *,
    workers: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> LimitLoads:
    """Largest F ≥ 0 of a pair +F n on grain j and −F n on grain i for which S is not empty.

    One program per contact (numbers in the packing; default all of S), for the static limit load of
    PRE 79, 052302. The pair adds F to the normal force on the contact, in the balance and in the
    pressure, but not in the contact's own cone. (Left out of the pressure, the limit would be
    F/(1 − F ℓ/2P0V).) Options and errors as in `intervals`.
    """
    keys = [int(place) for place in _positions(ensemble, contacts)]
    report = _counting(progress, len(keys))
    solver = Solver(make_system(ensemble), workers=workers, report=report)
    # Of each contact: maximise F, where f_n + F and f_t act on the grains.
    bounds = solver.solve(keys, [Program([], [], key) for key in keys])
    load, gap = np.full(len(keys), np.nan), np.full(len(keys), np.nan)
    for k, key in enumerate(keys):
        if key in bounds:
            attained, bound = bounds[key]
            load[k], gap[k] = -attained * ensemble.force_scale, abs(attained - bound)
    load[~(gap <= INTERVAL_GAP)] = np.nan
    return LimitLoads(ensemble.index[keys], load, gap, *_judged(gap), solver.counts)


def _judged(gap: Floats) -> tuple[float, bool]:
    """Largest gap reached, and whether all were reached and are small."""
    reached = gap[~np.isnan(gap)]
    return float(reached.max(initial=0.0)), bool(np.all(gap <= INTERVAL_GAP))


def _positions(ensemble: Ensemble, contacts: npt.ArrayLike | None) -> Integers:
    """Positions (k,) in the ensemble of contacts by their numbers in the packing, or of all."""
    if contacts is None:
        return np.arange(len(ensemble.index))
    contacts = np.asarray(contacts).ravel()
    if len(np.unique(contacts)) < len(contacts):
        raise InputError("a contact is named twice")
    return ensemble.positions(contacts)


def bound_of(ensemble: Ensemble, contact: int, component: int, side: int) -> Program:
    """The program of one bound: minimise f, or −f for the upper side."""
    half = -0.5 if side else 0.5
    columns, unit = [2 * contact, 2 * contact + 1], ensemble.mu if component else 1.0
    return Program(columns, [half * unit, (-half if component else half) * unit], -1)


class _Seen:
    """The smallest f_n (N_c,) of any known state of S, in ⟨f_n⟩."""

    def __init__(self, ensemble: Ensemble, states: Floats | None) -> None:
        self.least = np.full(len(ensemble.index), np.inf)
        if states is not None:
            states = np.asarray(states, dtype=np.float64).reshape(-1, len(self.least), 2)
            admitted = (ensemble.residual(states) <= BALANCED) & (
                ensemble.violation(states) <= ADMISSIBLE
            )
            normal = states[admitted, :, 0] / ensemble.force_scale
            self.least = np.minimum(self.least, normal.min(axis=0, initial=np.inf))

    def add(self, y: Floats) -> None:
        """Take note of one more state, in cone coordinates (2 N_c,)."""
        pairs = y[: 2 * len(self.least)].reshape(-1, 2)
        np.minimum(self.least, pairs.mean(axis=1), out=self.least)


def _counting(progress: Progress | None, total: int) -> Callable[[int], None]:
    """report(count) for a Solver, which calls progress(done, total)."""
    done = 0

    def report(count: int) -> None:
        nonlocal done
        done += count
        if progress:
            progress(done, total)

    return report
