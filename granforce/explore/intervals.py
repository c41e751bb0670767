"""Exact bounds: the least and largest f_n and f_t of every contact over S, and limit loads.

Each bound is a linear program in cone coordinates y ≥ 0. An interior-point method solves eight
programs at a time (`linear_programs`); certificates do not rely on the solver (`certified_values`).
Times for 400 disks at μ = 0.1 (h = 232, 2628 programs, one thread of a shared machine):

    HiGHS, primal simplex, each program warm-started from the last        88 s, 384 pivots each
    dense tableau, exact steepest edge, the nearest program next          51 s, 158 pivots each
    product-form simplex from the best of 100 stored vertices             54 s, 430 pivots each
    interior point, eight lanes                                            4 s,  16 steps each
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce import measures, notebook
from granforce.fields import record
from granforce.forces.contact_problem import make_system, wedged
from granforce.forces.ensemble import Ensemble
from granforce.forces.knowledge import ordered
from granforce.forces.nearest import starting_network
from granforce.numerics.certified_values import Solver, System
from granforce.numerics.linear_programs import Program
from granforce.quantities import quantity
from granforce.records import InputError, brief_list, float_array, takes
from granforce.system import cancelling
from granforce.system.wording import counted
from granforce.tolerances import CARRYING, FLAT, INTERVAL_GAP
from granforce.types import Cancel, Floats, Integers, Mask, Progress

Key = tuple[int, int, int]  # contact, component and side of a bound
Bounds = dict[Key, tuple[float, float]]  # value attained, and the value that bounds it


@record
class Intervals(NamedTuple):
    """Bounds over S of the forces on k contacts; column 0 is f_n, column 1 is f_t."""

    contacts: Annotated[Integers, quantity("backbone")]
    low: Annotated[
        Floats, quantity("low", note="−inf without a limit; NaN: cancelled, or not certified")
    ]
    high: Annotated[Floats, quantity("high", note="inf without a limit; NaN likewise")]
    gap: Annotated[Floats, quantity("interval_gap")]
    backbone: Annotated[Mask, "(k,) largest f_n > 0"]
    max_gap: Annotated[float, quantity("max_gap", note="among the certified bounds")]
    converged: Annotated[bool, "every bound was certified, with a gap ≤ 10⁻⁸ ⟨f_n⟩ in a bounded S"]
    counts: Annotated[
        dict[str, int], "programs solved, skipped by reason, solved again; iterations"
    ]
    wedged: Annotated[Integers, "grains of S that can press on each other without a load"]

    @property
    def bounded(self) -> Mask:
        """Mask (k,) of contacts whose f_n and f_t both have finite bounds."""
        finite = np.isfinite(self.low) & np.isfinite(self.high)
        return np.asarray(finite.all(axis=1))

    @property
    def shortfall(self) -> str:
        """Which values could not be certified, and what to do; empty if all were."""
        nan = (np.isnan(self.low) | np.isnan(self.high)).any(axis=1)
        return "" if self.converged else uncertified(self.contacts[nan])

    def _repr_html_(self) -> str:
        """HTML for notebooks."""
        lines: dict[str, Any] = {
            "contacts": len(self.contacts),
            "all bounds certified": self.converged,
        }
        bounded = self.bounded
        if self.converged and bounded.any():
            low, high = self.low[bounded], self.high[bounded]
            extent = measures.normal_extent(low, high)
            # In an unbounded S η3 would be ∞/∞.
            whole = {"exact η3": measures.eta3(low, high)}
            lines |= whole if bounded.all() else {"of bounded contacts": len(extent)}
            lines |= {"mean ΔFₙ": extent.mean(), "largest ΔFₙ": extent.max()}
        if len(self.wedged):
            lines["wedged grains"] = brief_list(self.wedged.tolist())
        lines |= {"largest duality gap / ⟨fₙ⟩": self.max_gap, **self.counts}
        return notebook.table("Exact intervals over S", lines)


@record
class Bound(NamedTuple):
    """One exact bound, as soon as it is computed."""

    contact: Annotated[int, "its number in the packing"]
    component: Annotated[int, "0 for f_n, 1 for f_t"]
    side: Annotated[int, "0 for the least value, 1 for the largest"]
    value: Annotated[float, "force"]


@record
class LimitLoads(NamedTuple):
    """Largest force pairs that S can carry on k contacts."""

    contacts: Annotated[Integers, quantity("backbone")]
    load: Annotated[
        Floats,
        quantity(
            "limit_load",
            label="limit_load",
            note="inf without a limit; NaN: cancelled, or not certified",
        ),
    ]
    gap: Annotated[Floats, quantity("load_gap")]
    max_gap: Annotated[float, quantity("max_gap")]
    converged: Annotated[bool, "every load was certified with a gap ≤ 10⁻⁸ ⟨f_n⟩"]
    counts: Annotated[dict[str, int], "programs, again, iterations"]

    @property
    def shortfall(self) -> str:
        """Which loads could not be certified, and what to do; empty if all were."""
        return "" if self.converged else uncertified(self.contacts[np.isnan(self.load)])


def uncertified(contacts: Integers) -> str:
    """A message on contacts without certified values, which are NaN; empty without any."""
    if not len(contacts):
        return ""
    return (
        f"{counted(len(contacts), 'contact has', 'contacts have')} values that could not be "
        f"certified (nan): {brief_list(contacts.tolist())}; only networks with other forces far "
        "above 10⁴ ⟨f_n⟩ attain them; try a slightly different friction coefficient"
    )


@takes(Ensemble)
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
    """Least and largest f_n and f_t over S on contacts, with certificates.

    In an unbounded S, bounds that a self-balanced change of forces moves without end are ±inf, and
    all others are certified as usual; rounding then allows a gap of up to 10⁻¹² of the largest sum
    of the bounded forces.

    Parameters
    ----------
    ensemble : Ensemble
        S.
    contacts : (k,) array of int, optional
        Numbers in the packing, by default all contacts of S.
    workers : int, default 1
        Threads. The result does not depend on their number.
    states : (…, N_c, 2) array, optional
        Known states of S, force.
    skip : bool, default True
        A contact with f_n = 0 in one of the states, or in the optimum of another program, needs no
        program for its least f_n.
    widths : (N_c,) array, optional
        Expected widths, which affect only the order in which bounds are computed.
    watch : callable, optional
        watch(Bound) is called with each bound as it is computed: all upper bounds of f_n, then the
        lower ones, then those of f_t, each in order of decreasing widths. Bounds with f_n = 0 may
        be sent again at the end, changed by 10⁻⁸ ⟨f_n⟩ at most.
    progress : callable, optional
        progress(done, total) is called as programs end.
    cancel : callable, optional
        Polled; returning True ends early: missing bounds are NaN and ``converged`` is False.

    Returns
    -------
    Intervals
        low and high (k, 2), force: column 0 is f_n, column 1 is f_t.

    Raises
    ------
    InputError
        For a contact that cannot carry force.
    NotJammedError
        If S is empty.
    UndecidedError, UnboundedError
        If it cannot be proved which forces are bounded.
    Cancelled
        If cancelled before the first program.
    """
    places = _positions(ensemble, contacts)
    frictionless = ensemble.mu == 0
    count = len(ensemble.index)
    widths = np.zeros(count) if widths is None else float_array(widths, (count,), "widths")
    widest = [int(c) for c in places[np.argsort(-widths[places], kind="stable")]]
    upper = [(c, 0, 1) for c in widest]
    tangential = [] if frictionless else [(c, 1, side) for c in widest for side in (0, 1)]
    lower = [(c, 0, 0) for c in widest]
    every = upper + tangential + lower
    known = SmallestForces(ensemble, states)
    system = make_system(ensemble, unbounded=True)

    def record_state(key: Key, y: Floats) -> None:
        # Networks that attain lower bounds are not used here: only the others decide which programs
        # are needed.
        if key[1:] != (0, 0):
            known.add(y)

    def report_bound(key: Key, attained: float, bound: float) -> None:
        if watch and (attained == bound or abs(attained - bound) <= system.accuracy):
            value = (-attained if key[2] else attained) * ensemble.force_scale
            watch(Bound(int(ensemble.index[key[0]]), *key[1:], float(value)))

    given = (determined if needs_no_program(ensemble, system) else _pinned)(ensemble, every)
    if system.grows is not None:
        given |= _without_limit(ensemble, system, [key for key in every if key not in given])
    if progress:
        progress(len(given), len(every))
    for key, value in given.items():
        report_bound(key, *value)
    report: dict[str, Any] = {"progress": progress, "total": len(every), "done": len(given)}
    solver = Solver(system, workers=workers, on_state=record_state, on_value=report_bound, **report)

    def zero(key: Key) -> bool:
        """Whether a state with f_n = 0 is known for this key."""
        return skip and key not in given and known.least[key[0]] <= INTERVAL_GAP

    def solve(keys: Sequence[Key]) -> Bounds:
        return solved(ensemble, solver, [key for key in keys if key not in given])

    bounds = given | solve(upper)
    # With watch, lower bounds are computed early and replaced afterwards if f_n = 0 is seen: the
    # result is the same, for one or two more programs in a hundred.
    needed = [key for key in lower if not zero(key)]
    solver.total -= len(lower) - len(needed)
    bounds |= solve(needed + tangential)
    zero_keys = [key for key in lower if zero(key)]
    for key in zero_keys:
        bounds[key] = (max(0.0, float(known.least[key[0]])), 0.0)
        report_bound(key, *bounds[key])
    counts = solver.counts | {
        "f_n = 0 seen in a known state": len(zero_keys),
        "frictionless contact": 2 * len(places) if frictionless else 0,
    }
    if ensemble.known is not None:
        counts["known exactly"] = sum(bool(np.isfinite(value)) for value, _ in given.values())
    if system.grows is not None:
        counts["without a limit"] = sum(bool(np.isinf(value)) for value, _ in given.values())
    return _intervals(ensemble, places, bounds, counts, system.accuracy)


def _pinned(ensemble: Ensemble, keys: Sequence[Key]) -> Bounds:
    """{key: (value attained, value that bounds it)} of components with known values."""
    if ensemble.known is None:
        return {}
    value = np.stack([ensemble.known.value, -ensemble.known.value], axis=-1)
    return {key: (float(value[key]),) * 2 for key in keys if ensemble.known.pinned[key[:2]]}


def _without_limit(ensemble: Ensemble, system: System, keys: Sequence[Key]) -> Bounds:
    """{key: (−∞, −∞)} of bounds that are infinite, as a ray of S proves."""
    falls = system.without_limit([bound_of(ensemble, *key) for key in keys])
    return {key: (-np.inf, -np.inf) for key, fall in zip(keys, falls, strict=True) if fall}


def needs_no_program(ensemble: Ensemble, system: System) -> bool:
    """Whether everything is `determined`; checked only if S has no interior or forces are known."""
    checked = ensemble.known is not None or not system.middle.converged
    return checked and ensemble.is_determined


def determined(ensemble: Ensemble, keys: Sequence[Key]) -> Bounds:
    """{key: (value attained, value that bounds it)} of components that the equations determine.

    For each there are rows λ with Aᵀλ = 1 there and 0 elsewhere, hence x = b·λ, in all of S. The
    rounding error of Aᵀλ bounds the error.
    """
    known, size = ensemble.known, ensemble.per_contact
    held = np.zeros((len(ensemble.index), 2)) if known is None else known.pinned
    free = ensemble.to_vector(held) == 0
    x = ensemble.to_vector(starting_network(ensemble)) / ensemble.force_scale
    A = ensemble.free_columns.toarray()
    b = ensemble.b / ensemble.force_scale - ensemble.A @ np.where(free, 0.0, x)
    rows = cancelling.apart(np.linalg.pinv, A)
    left = np.abs(np.eye(len(rows)) - rows @ A).sum(axis=1) * np.abs(x).max(initial=0.0)
    follows, row = rows @ b, np.cumsum(free) - 1
    bounds = _pinned(ensemble, keys)
    for c, component, side in (key for key in keys if key not in bounds):
        k, sign = size * c + component, -1.0 if side else 1.0
        bounds[c, component, side] = sign * x[k], sign * follows[row[k]] - left[row[k]]
    return bounds


def _intervals(
    ensemble: Ensemble, places: Integers, bounds: Bounds, counts: dict[str, int], accuracy: float
) -> Intervals:
    keys = itertools.product((int(c) for c in places), (0, 1), (0, 1))
    attained, gap = (one.reshape(-1, 2, 2) for one in values_and_gaps(bounds, list(keys)))
    value = attained * [1.0, -1.0]
    if ensemble.mu == 0:
        value[:, 1], gap[:, 1] = 0.0, 0.0
    value[~(gap <= accuracy)] = np.nan
    value *= ensemble.force_scale
    max_gap, converged = _largest_gap(gap, accuracy)
    backbone = value[:, 0, 1] > CARRYING * ensemble.force_scale
    low, high = ordered(value[..., 0], value[..., 1], FLAT)
    return Intervals(
        ensemble.index[places],
        low,
        high,
        gap,
        backbone,
        max_gap,
        converged,
        counts,
        wedged(ensemble),
    )


@takes(Ensemble)
@cancelling.cancellable
def limit_loads(
    ensemble: Ensemble, contacts: npt.ArrayLike | None = None, **options: Any
) -> Floats:
    """Limit loads F of contacts, without the certificates of `limit_load_bounds`.

    Parameters
    ----------
    ensemble : Ensemble
        S.
    contacts : (k,) array of int, optional
        Numbers in the packing, by default all contacts of S.
    **options
        Of `limit_load_bounds`, whose errors it raises.

    Returns
    -------
    (k,) array
        F, force.
    """
    return limit_load_bounds(ensemble, contacts, **options).load


@takes(Ensemble)
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

    One program per contact, for the static limit load of PRE 79, 052302. The pair adds F to the
    normal force on the contact, in the balance and in the pressure, but not in the contact's own
    cone. (Left out of the pressure, the limit would be F/(1 − F ℓ/2P0V).) Infinite if neither grain
    has to balance, as no equation then contains the load, and in an unbounded S where contact
    forces balance the pair alone.

    Parameters
    ----------
    ensemble : Ensemble
        S.
    contacts : (k,) array of int, optional
        Numbers in the packing, by default all contacts of S.
    workers : int, default 1
        Threads. The result does not depend on their number.
    progress : callable, optional
        progress(done, total) is called as programs end.
    cancel : callable, optional
        Polled, as by `intervals`, which raises the same errors.

    Returns
    -------
    LimitLoads
        load (k,), force, inf without a limit, with its duality gap.
    """
    places = [int(place) for place in _positions(ensemble, contacts)]
    met = np.diff(ensemble.A.tocsc().indptr)[:: ensemble.per_contact] > 0
    system = make_system(ensemble, unbounded=True)
    bounds: dict[Any, tuple[float, float]] = {
        place: (-np.inf, -np.inf) for place in places if not met[place] or system.carries_any(place)
    }
    keys = [place for place in places if place not in bounds]
    solver = Solver(system, workers=workers, progress=progress, total=len(keys))
    # For each contact: maximise F, with f_n + F and f_t acting on the grains.
    bounds |= solver.solve(keys, [Program([], [], key) for key in keys])
    attained, gap = values_and_gaps(bounds, places)
    load = np.where(gap <= system.accuracy, -attained * ensemble.force_scale, np.nan)
    judged = _largest_gap(gap, system.accuracy)
    return LimitLoads(ensemble.index[places], load, gap, *judged, solver.counts)


def values_and_gaps(
    bounds: dict[Any, tuple[float, float]], keys: Sequence[Any]
) -> tuple[Floats, Floats]:
    """Values attained and duality gaps (k,) of keys; NaN for unfinished programs."""
    none = np.nan, np.nan
    both = np.array([bounds.get(key, none) for key in keys]).reshape(-1, 2)
    with np.errstate(invalid="ignore"):  # ∞ − ∞
        apart = np.abs(both[:, 0] - both[:, 1])
    return both[:, 0], np.where(both[:, 0] == both[:, 1], 0.0, apart)


def _largest_gap(gap: Floats, accuracy: float) -> tuple[float, bool]:
    """Largest gap of the certified bounds, and whether all are certified."""
    certified = gap <= accuracy
    return float(gap[certified].max(initial=0.0)), bool(certified.all())


def _positions(ensemble: Ensemble, contacts: npt.ArrayLike | None) -> Integers:
    """Positions (k,) in the ensemble of contacts by their numbers in the packing, or of all."""
    if contacts is None:
        return np.arange(len(ensemble.index))
    places = ensemble.positions(contacts)
    if len(np.unique(places)) < len(places):
        raise InputError("a contact is named twice")
    return places


def bound_of(ensemble: Ensemble, contact: int, component: int, side: int) -> Program:
    """The program of one bound: minimise f, or −f for the upper side."""
    half = -0.5 if side else 0.5
    columns, unit = [2 * contact, 2 * contact + 1], ensemble.slopes[contact] if component else 1.0
    return Program(columns, [half * unit, (-half if component else half) * unit], -1)


def solved(
    ensemble: Ensemble, solver: Solver, keys: Sequence[Key], points: dict[Any, Floats] | None = None
) -> Bounds:
    """{key: (value attained, value that bounds it)} of finished programs.

    points: as for the Solver.
    """
    return solver.solve(keys, [bound_of(ensemble, *key) for key in keys], points)


class SmallestForces:
    """The smallest f_n (N_c,) of any known state of S, in ⟨f_n⟩."""

    def __init__(self, ensemble: Ensemble, states: Floats | None) -> None:
        """states (…, N_c, 2): those that are not admitted are ignored."""
        shape = (-1, len(ensemble.index), 2)
        states = np.empty((0, *shape[1:])) if states is None else states
        states = ensemble.networks(states, "states").reshape(shape)
        normal = states[ensemble.admits(states), :, 0] / ensemble.force_scale
        self.least = normal.min(axis=0, initial=np.inf)

    def add(self, y: Floats) -> None:
        """Include one more state, in cone coordinates (2 N_c,)."""
        pairs = y[: 2 * len(self.least)].reshape(-1, 2)
        np.minimum(self.least, pairs.mean(axis=1), out=self.least)
