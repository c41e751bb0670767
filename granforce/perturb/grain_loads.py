"""Loads on grains, raised in proportion: the load factor over S, and the critical load of motion.

A load e (N, 3) of forces and torques, times λ, joins the weights: A f + λ e = b. The load factor is
the largest λ for which some network balances; with friction it overestimates the strength, because
it takes sliding contacts to dilate (Livesley, Int. J. Numer. Methods Eng. 12, 1853 (1978)). The
critical load is the largest λ at which bodies stay at rest as contact dynamics raises it from the
packing's own network, by the protocol of `critical_force`; it is never above the load factor.
Contacts that carry nothing without the load are included.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce.fields import record
from granforce.forces.build import with_idle
from granforce.forces.contact_problem import forces_of, make_system
from granforce.forces.ensemble import Ensemble
from granforce.forces.nearest import some_network, starting_network
from granforce.motion.flow import Outcome, Push
from granforce.motion.flow_lanes import follow, relax
from granforce.motion.inertia import make_step
from granforce.numerics.certified_values import most_under
from granforce.perturb.critical_force import (
    LEAST_PRECISION,
    STEADY,
    STEADY_STEPS,
    Protocol,
    Raised,
    checked,
    motion_of,
    raised,
    unsteady,
)
from granforce.quantities import ALL_CONTACTS, FORCE, Field, quantity
from granforce.records import (
    InputError,
    Packing,
    UndecidedError,
    brief,
    float_array,
    positive,
    refuse_options,
    takes,
)
from granforce.system import cancelling
from granforce.tolerances import INTERVAL_GAP, ROUNDING
from granforce.types import Cancel, Floats

# Precision of a critical load by default, and the coarsest, as fractions of the load factor.
LOAD_PRECISION, MOST_LOAD_PRECISION = 1e-4, 0.1
NO_LIMIT = "contact forces can balance every multiple of this load, so it has no critical factor"


@record
class LoadFactor(NamedTuple):
    """Largest multiple of a load that networks can balance, certified from both sides."""

    factor: Annotated[float, "λ, attained by `forces`; inf without a limit"]
    gap: Annotated[float, "in λ: the limit is proved to be at most factor + gap"]
    load: Annotated[Floats, "(N, 3) the load, force and torque"]
    forces: Annotated[Floats, Field(ALL_CONTACTS, FORCE, "a network at the limit")]


@record
class CriticalLoad(NamedTuple):
    """Largest multiple of a load at which bodies rest, and the motion above it."""

    low: Annotated[float, "largest λ that ended at rest"]
    high: Annotated[float, "smallest λ that did not, or the load factor if none was tried"]
    precision: Annotated[float, "of the bracket, high − low, as a fraction of the load factor"]
    load_factor: Annotated[float, "λ"]
    load: Annotated[Floats, "(N, 3) the load, force and torque"]
    forces: Annotated[Floats, Field(ALL_CONTACTS, FORCE, "equilibrium under `low`")]
    residual: Annotated[float, quantity("residual", "", note="with the load")]
    violation: Annotated[float, quantity("violation", "")]
    displacement: Annotated[Floats, "(N, 2) the first motion, rms |u| = 1; NaN for fixed bodies"]
    rotation: Annotated[Floats, "(N,) rotation times radius; NaN likewise"]
    breach: Annotated[float, "of Coulomb's law by that motion, relative to the fastest contact"]
    converged: Annotated[bool, "high − low ≤ precision · load_factor, and the motion is steady"]
    counts: Annotated[dict[str, float], "as in CriticalForce"]

    @property
    def shortfall(self) -> str:
        """Why this is not the critical load as requested, and what to do; empty if it is."""
        return "" if self.converged else unsteady("the load")


@takes(Ensemble)
@cancelling.cancellable
def load_factor(
    ensemble: Ensemble, load: npt.ArrayLike | str = "horizontal", *, cancel: Cancel | None = None
) -> LoadFactor:
    """The largest λ ≥ 0 for which S is not empty with λ times a load on the grains.

    One linear program, by HiGHS; the network and the multipliers that certify the limit are checked
    here.

    Parameters
    ----------
    ensemble : Ensemble
        S, without prescribed pressure.
    load : (N, 3) array or str, default "horizontal"
        Force and torque on each grain of the packing, or "horizontal": the weights turned to +x.
        Loads on grains whose balance is left open have no effect.
    cancel : callable, optional
        Polled; returning True raises Cancelled.

    Returns
    -------
    LoadFactor
        λ, inf without a limit, and a network at the limit.

    Raises
    ------
    InputError
        If a pressure is prescribed, and if the load acts on no grain.
    UndecidedError
        If the limit could not be certified.
    """
    return _limit(with_idle(ensemble), load)


def _limit(S: Ensemble, load: npt.ArrayLike | str) -> LoadFactor:
    load = _loads(S.packing, load)
    direction, unit = _direction(S, load)
    unit /= S.force_scale
    system = make_system(S, unbounded=True).under(direction)
    value, bound, y = most_under(system)
    if value == -np.inf:
        return LoadFactor(np.inf, 0.0, load, np.full((len(S.packing.contacts.i), 2), np.nan))
    if np.isfinite(value):
        forces = forces_of(S, y)
    elif np.isfinite(bound):  # the optimum was not balanced to rounding: project it
        value = bound + 0.5 * INTERVAL_GAP
        under = replace(S, b=S.b + value * S.force_scale * direction, computed=None)
        forces = some_network(under, starting_network(S))
        value = value if under.admits(forces) else np.inf
    if not abs(value - bound) <= system.accuracy:
        raise UndecidedError("the limit of this load could not be certified")
    # Differences of two rounded numbers; λ is 0 if nothing but the weights can be balanced.
    factor = 0.0 if -value <= ROUNDING else -value
    return LoadFactor(factor / unit, abs(value - bound) / unit, load, S.expand(forces))


@takes(Ensemble)
@cancelling.cancellable
def critical_load(
    ensemble: Ensemble,
    load: npt.ArrayLike | str = "horizontal",
    *,
    precision: float = LOAD_PRECISION,
    cancel: Cancel | None = None,
    **protocol: Any,
) -> CriticalLoad:
    """The largest λ at which bodies stay at rest as λ times a load is raised, and the motion.

    The start is the packing's own network: another one may give another critical load.

    Parameters
    ----------
    ensemble : Ensemble
        S, without prescribed pressure.
    load : (N, 3) array or str, default "horizontal"
        As for `load_factor`.
    precision : float, default 10⁻⁴
        Of the bracket, as a fraction of the load factor.
    cancel : callable, optional
        Polled; returning True raises Cancelled.
    **protocol
        The other fields of Protocol.

    Returns
    -------
    CriticalLoad
        low and high, the bracket of λ, and the motion above it.

    Raises
    ------
    InputError, UndecidedError, Cancelled
        As `load_factor`; InputError also if no load moves the bodies, and for a precision finer
        than that of the load factor.
    """
    refuse_options(critical_load, protocol, Protocol._fields[1:])
    S, settings = with_idle(ensemble), checked(Protocol(**protocol))
    precision = positive(precision, "precision", most=MOST_LOAD_PRECISION)
    limit = _limit(S, load)
    if not np.isfinite(limit.factor):
        raise InputError(NO_LIMIT)
    direction, unit = _direction(S, limit.load)
    unit /= S.force_scale
    settings = settings._replace(precision=_bracket(limit, precision, unit))
    step, start = make_step(S), starting_network(S) / S.force_scale
    push = Push(start, 0, 0.0, STEADY_STEPS, STEADY, direction)
    ends: list[Raised] = []
    work = raised(push, limit.factor * unit, settings)
    follow(step, [work], lambda _, end: ends.append(end))
    end, moving = ends[0], ends[0].moving
    if moving is None:
        beyond = end.high + settings.precision
        moving = relax(step, push._replace(forces=end.forces, load=beyond))
    forces = end.forces * S.force_scale
    balanced = replace(S, b=S.b - end.low * S.force_scale * direction)
    displacement, rotation = _motion(S, moving)
    return CriticalLoad(
        low=end.low / unit,
        high=end.high / unit,
        precision=precision,
        load_factor=limit.factor,
        load=limit.load,
        forces=S.expand(forces),
        residual=balanced.residual(forces),
        violation=S.violation(forces),
        displacement=displacement,
        rotation=rotation,
        breach=moving.breach,
        converged=bool(end.high - end.low <= settings.precision and moving.converged),
        counts={name: n for name, n in end.counts.items() if name != "seconds"},
    )


def _bracket(limit: LoadFactor, precision: float, unit: float) -> float:
    """Width of the bracket in ⟨f_n⟩, for a fraction of the load factor; unit: λ = 1 in ⟨f_n⟩."""
    if limit.factor == 0:  # the bracket has no width
        return LEAST_PRECISION
    if precision * limit.factor * unit < LEAST_PRECISION:
        raise InputError(
            f"the load factor {limit.factor:.6g} is known to {LEAST_PRECISION / unit:.1g} only: "
            f"precision must be at least {LEAST_PRECISION / unit / limit.factor:.1g}"
        )
    return precision * limit.factor * unit


def _motion(S: Ensemble, moving: Outcome) -> tuple[Floats, Floats]:
    if moving.at_rest:
        count = len(S.packing.r)
        return np.full((count, 2), np.nan), np.full(count, np.nan)
    return motion_of(S, moving)[:2]


def _loads(packing: Packing, load: npt.ArrayLike | str) -> Floats:
    if not isinstance(load, str):
        return float_array(load, (len(packing.r), 3), "the load")
    if load != "horizontal":
        raise InputError(f'load must be "horizontal" or an array (N, 3), got {brief(load)}')
    turned = np.zeros_like(packing.load)
    turned[:, 0] = -np.nan_to_num(packing.load[:, 1])
    return turned


def _direction(S: Ensemble, load: Floats) -> tuple[Floats, float]:
    """The load on the rows of A, its largest entry 1, and that entry in force."""
    rows = load[S.grains, : S.per_grain].copy()
    rows[:, 2:] /= S.packing.r[S.grains, None]
    unit = float(np.abs(rows).max(initial=0.0))
    if unit == 0:
        raise InputError("the load acts only on grains whose balance is not required")
    if S.per_grain == 2 and load[S.grains, 2].any():
        raise InputError("disks without friction carry no torque: leave it out of the load")
    return rows.ravel() / unit, unit
