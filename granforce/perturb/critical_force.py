"""Local perturbation: a pair of forces ±F pushes the two grains of one contact apart.

Protocol. The geometry is fixed and grains are rigid. From the packing's own force network F is
raised step by step; each step starts from the last equilibrium and follows the flow of contact
dynamics (`flow`) until the grains are at rest, move steadily, or MOST_STEPS implicit steps have
found no equilibrium. As long as grains come to rest, each step is RISE of the way to the static
limit load, beyond which no equilibrium exists, until REACHED · `precision` are left of it. A motion
is final only after a step of at most LAST_STEP · `precision`: after a longer one the load returns
BACK steps and rises again in steps a quarter as long, and in full steps once it has passed the load
of that motion. Motion that is not yet steady is followed for STEADY_STEPS before it is final. The
critical force F_crit is the last load at rest, bracketed to `precision`. That is also its error for
most contacts: if load steps, precision and the steps of the flow are refined by four, 0, 1, 2 and 8
of 200 at μ = 0.01, 0.3, 1 and 10 (N = 100) change by more, up to 0.2 ⟨f_n⟩. In most of these, from
the same forces and under the same load, both steady motion and rest at other forces, up to 0.5
⟨f_n⟩ away, are solutions; the length of the first step of the flow decides, and no refinement does.
`converged` cannot tell such contacts, as one search does not know how another would have ended. The
pair counts in the balance of the grains and in the pressure like a force of the contact itself, but
not in its Coulomb cone, and the box may dilate at constant pressure.

F_crit ≤ limit load. They differ because sliding contacts do not dilate (the law is not associated):
grains may start to move although an equilibrium exists.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Sequence
from functools import partial
from typing import Annotated, Any, NamedTuple, TypeVar

import numpy as np

from granforce.explore.intervals import limit_load_bounds
from granforce.fields import record
from granforce.forces.build import ensemble_at
from granforce.forces.ensemble import Ensemble
from granforce.forces.nearest import starting_network
from granforce.motion import flow
from granforce.motion.flow import Outcome, Push
from granforce.motion.flow_lanes import follow, relax
from granforce.motion.inertia import grain_velocities, make_step
from granforce.motion.step import Step, relative_velocities
from granforce.quantities import FORCE, Field, of_one_contact
from granforce.records import (
    InputError,
    Packing,
    UndecidedError,
    brief_list,
    moderate,
    positive,
    real,
    real_array,
    refuse_options,
    takes,
    whole,
    worker_count,
)
from granforce.system import cancelling
from granforce.tolerances import INTERVAL_GAP, LARGEST_UNIT
from granforce.types import Cancel, Floats, Integers, Mask

# Load steps: the first, as a fraction of the way from the last load at rest to the limit load; how
# many the load returns after motion, and the factor of the next. A large step makes contacts slide
# that would not on the way, and they stay where they slid: without the return F_crit is up to
# 0.14 ⟨f_n⟩ smaller.
RISE = 0.04
BACK, SHORTER = 8, 1 / 4
# The longest step after which motion is final, and the distance at which the limit load counts as
# reached, as fractions of the precision.
LAST_STEP, REACHED = 1 / 16, 1 / 4
# Implicit steps after which the search for an equilibrium ends.
MOST_STEPS = 150
# Largest violation of Coulomb's law in steady motion, relative to the fastest contact, and the
# steps spent on it.
STEADY, STEADY_STEPS = 1e-3, 500

# Finest precision of F_crit, ⟨f_n⟩, to which limit loads are certified; and the coarsest, beyond
# which a bracket is meaningless.
LEAST_PRECISION, MOST_PRECISION = INTERVAL_GAP, 1.0

# Numbers of loads by outcome, implicit steps of the flow, and linear systems solved.
COUNTS = ("loads_at_rest", "loads_moving", "loads_undecided", "flow_steps", "linear_systems")


@record
class CriticalForce(NamedTuple):
    """Largest force pair on one contact under which grains rest, and the motion above it."""

    contact: Annotated[int, of_one_contact("backbone", label="")]
    mu: Annotated[float, "friction coefficient of the ensemble"]
    low: Annotated[float, of_one_contact("critical_low")]
    high: Annotated[float, of_one_contact("critical_high")]
    limit_load: Annotated[float, of_one_contact("limit_load")]
    forces: Annotated[Floats, Field("contact component", FORCE, "equilibrium under `low`")]
    residual: Annotated[float, of_one_contact("load_residual", label="residual")]
    violation: Annotated[float, of_one_contact("load_violation", label="violation")]
    moving: Annotated[Outcome | None, "the outcome under `high`; None if the limit load is reached"]
    converged: Annotated[
        bool,
        Field(
            "",
            "",
            "high − low ≤ precision, and steady motion or the limit load above",
            label="converged",
            each=True,
        ),
    ]
    counts: Annotated[dict[str, float], "COUNTS"]
    seconds: Annotated[float, of_one_contact("contact_seconds", label="")]

    @property
    def shortfall(self) -> str:
        """Why this is not the critical force as requested, and what to do; empty if it is."""
        return "" if self.converged else unsteady(f"contact {self.contact}")


def unsteady(what: str) -> str:
    """A message on a load under which no steady motion was found."""
    return (
        f"{what}: the motion under the smallest load not at rest is not steady, so that its "
        "critical value may be larger; allow more steps (max_steps)"
    )


@record
class Response(NamedTuple):
    """First motion above the critical force, scaled so that rms |u| of the backbone is 1."""

    contact: Annotated[int, "its number in the packing"]
    force: Annotated[float, Field("", FORCE, "the load")]
    displacement: Annotated[Floats, of_one_contact("displacement", "grain axis")]
    rotation: Annotated[Floats, Field("grain", "", "rotation times radius; NaN for rattlers")]
    dilation: Annotated[float, "of the box, ΔL/L per unit of u, 1/length"]
    opening: Annotated[Floats, Field("contact", "", "normal relative displacement")]
    opened: Annotated[Mask, Field("contact", "", "contacts without force")]
    slid: Annotated[Mask, Field("contact", "", "pressed contacts at |f_t| = μ f_n")]
    kept: Annotated[Mask, Field("contact", "", "sticking contacts")]
    breach: Annotated[float, of_one_contact("motion_breach", label="")]
    fastest: Annotated[float, "largest relative displacement at a contact"]
    converged: Annotated[bool, "breach ≤ 0.001"]


# A generator for `flow_lanes.follow`: yields flows, is sent their outcomes, and returns a result.
T = TypeVar("T")
Asking = Generator[Push, Outcome, T]


@record
class Protocol(NamedTuple):
    """How the load on a contact is raised."""

    precision: Annotated[float, "largest width of the bracket, ⟨f_n⟩"] = 0.01
    rise: Annotated[float, "first step, as a fraction of the way to the limit load"] = RISE
    max_steps: Annotated[int, "of the flow per load"] = MOST_STEPS


@cancelling.cancellable
def critical_force(
    packing: Packing | Ensemble,
    contact: int,
    *,
    mu: float | None = None,
    limit_load: float | None = None,
    cancel: Cancel | None = None,
    **protocol: Any,
) -> CriticalForce:
    """F_crit of one contact with its bracket.

    Parameters
    ----------
    packing : Packing or Ensemble
        The packing, or its ensemble.
    contact : int
        Number in the packing.
    mu : float, optional
        Friction coefficient for a Packing, by default its own.
    limit_load : float, optional
        Force, computed if not given.
    cancel : callable, optional
        Polled; returning True raises Cancelled.
    **protocol
        Fields of Protocol.

    Returns
    -------
    CriticalForce
        low, F_crit, and high, the smallest load not at rest, or the limit load; both force.

    Raises
    ------
    InputError
        For a contact without force in any state of S, for mu with an Ensemble, and if the search
        ends at a given limit load that is below the exact one.
    """
    refuse_options(critical_force, protocol, Protocol._fields)
    S = ensemble_at(packing, mu=mu)
    loads = None if limit_load is None else [limit_load]
    (found,) = critical_forces(S, [contact], limit_loads=loads, **protocol)
    return found


@takes(Ensemble)
@cancelling.cancellable
def critical_forces(
    ensemble: Ensemble,
    contacts: Sequence[int] | Integers,
    *,
    limit_loads: Sequence[float] | Floats | None = None,
    workers: int = 1,
    finished: Callable[[int, CriticalForce], object] | None = None,
    watch: Callable[[int, float], object] | None = None,
    cancel: Cancel | None = None,
    **protocol: Any,
) -> list[CriticalForce]:
    """F_crit of contacts, computed together.

    Parameters
    ----------
    ensemble : Ensemble
        S.
    contacts : (k,) sequence of int
        Numbers in the packing.
    limit_loads : (k,) array, optional
        Force, computed if not given.
    workers : int, default 1
        Threads. No result depends on their number, nor on the other contacts.
    finished : callable, optional
        finished(k, CriticalForce) is called from the threads as each ends.
    watch : callable, optional
        watch(k, force) is called from the threads with each load at rest, which may fall again.
    cancel : callable, optional
        Polled; returning True raises Cancelled.
    **protocol
        Fields of Protocol.

    Returns
    -------
    list of CriticalForce
        In the order of the contacts.

    Raises
    ------
    UndecidedError
        If a limit load cannot be certified, or is given as NaN.
    InputError
        As for `critical_force`.
    """
    refuse_options(critical_forces, protocol, Protocol._fields)
    S, protocol = ensemble, checked(Protocol(**protocol))
    precision = protocol.precision
    positions, workers = S.positions(contacts), worker_count(workers)
    contacts = S.index[positions]
    if limit_loads is not None:
        limit_loads = real_array(limit_loads, "limit loads")
        if limit_loads.shape != positions.shape or np.any(limit_loads < 0):
            raise InputError(f"give one limit load ≥ 0 for each of the {len(positions)} contacts")
        if np.any(np.isfinite(limit_loads) & (limit_loads > LARGEST_UNIT * S.force_scale)):
            raise InputError(f"a limit load is beyond {LARGEST_UNIT:g} times the mean normal force")
    given = limit_loads is not None
    if limit_loads is None:
        limit_loads = limit_load_bounds(S, contacts, workers=workers).load
        cancelling.check("critical force")  # cancelling leaves limit loads uncomputed
    stuck = np.asarray(contacts)[np.isposinf(limit_loads)]
    if len(stuck):
        of = f"contact {stuck[0]}" if len(stuck) == 1 else f"contacts {brief_list(stuck)}"
        raise InputError(
            f"no force pair moves the grains of {of}: other contacts can balance any, or the "
            "balance of neither grain is required; choose other contacts (--contacts, contacts=)"
        )
    if not np.isfinite(limit_loads).all():
        number = np.asarray(contacts)[~np.isfinite(limit_loads)][0]
        raise UndecidedError(f"the limit load of contact {number} could not be certified")
    step, start = make_step(S), starting_network(S) / S.force_scale
    searches = [
        _pushed(
            S, int(contact), position, float(limit) / S.force_scale, start, protocol,
            None if watch is None else partial(watch, k),
        )
        for k, (contact, position, limit) in enumerate(
            zip(contacts, positions, limit_loads, strict=True)
        )
    ]  # fmt: skip
    found = {}

    def ended(k: int, critical: CriticalForce) -> None:
        found[k] = critical
        if finished is not None:
            finished(k, critical)

    follow(step, searches, ended, workers)
    if given:
        _check_limits(S, list(found.values()), precision, workers)
    return [found[k] for k in range(len(searches))]


def checked(protocol: Protocol) -> Protocol:
    """The protocol with plain numbers; InputError for values out of range."""
    precision = positive(
        protocol.precision, "precision", least=LEAST_PRECISION, most=MOST_PRECISION
    )
    rise = positive(protocol.rise, "rise")
    if rise > 1:
        raise InputError(
            f"rise must be a fraction of the way to the limit load, at most 1, got {rise:g}"
        )
    return Protocol(precision, rise, whole(protocol.max_steps, "max_steps", 1))


def _check_limits(
    S: Ensemble, found: Sequence[CriticalForce], precision: float, workers: int
) -> None:
    """InputError if a search ended at a limit load that lies below the exact one."""
    ended = {one.contact: one for one in found if one.moving is None}
    exact = limit_load_bounds(S, list(ended), workers=workers)
    for number, load in zip(exact.contacts, exact.load, strict=True):
        one = ended[int(number)]
        if load - one.limit_load > precision * S.force_scale:
            raise InputError(
                f"the limit load of contact {number} is {load:.9g}, not {one.limit_load:.9g}; omit "
                "it to have it computed"
            )


def _pushed(
    S: Ensemble, contact: int, position: int, limit: float, start: Floats, protocol: Protocol,
    watch: Callable[[float], object] | None,
) -> Asking[CriticalForce]:  # fmt: skip
    """Generator for `flow_lanes.follow`: the CriticalForce of a contact."""

    def at_rest(load: float) -> None:
        if watch is not None:
            watch(load * S.force_scale)

    push = Push(start, position, 0.0, 0, 0.0)
    found = yield from raised(push, limit, protocol, at_rest)
    loaded = found.forces.copy()
    loaded[position, 0] += found.low
    return CriticalForce(
        contact=contact,
        mu=S.mu,
        low=found.low * S.force_scale,
        high=found.high * S.force_scale,
        limit_load=limit * S.force_scale,
        forces=found.forces * S.force_scale,
        residual=S.residual(loaded * S.force_scale),
        violation=S.violation(found.forces * S.force_scale),
        moving=found.moving,
        converged=bool(found.moving is None or found.moving.converged),
        counts=found.counts,
        seconds=found.counts.pop("seconds"),
    )


class Raised(NamedTuple):
    """Bracket of the largest load at rest, in ⟨f_n⟩."""

    low: float
    high: float
    forces: Floats  # (N_c, 2) at rest under `low`
    moving: Outcome | None  # under `high`; None if the limit load is reached
    counts: dict[str, float]  # COUNTS, and seconds


def raised(
    push: Push, limit: float, protocol: Protocol, at_rest: Callable[[float], object] | None = None
) -> Asking[Raised]:
    """Generator for `flow_lanes.follow`: raise the load of a Push from 0, and from its forces.

    at_rest(load) is called with each load at rest, which falls where the search steps back.
    """
    counts: dict[str, float] = dict.fromkeys((*COUNTS, "seconds"), 0)
    past = deque([(0.0, push.forces)], maxlen=2 * BACK)  # the last loads at rest, and their forces
    share, moved_at, max_steps = 1.0, 0.0, protocol.max_steps
    while True:
        low, forces = past[-1]
        if limit - low <= REACHED * protocol.precision:
            return Raised(low, limit, forces, None, counts)
        rise = share * protocol.rise * (limit - low)
        load, final = low + rise, rise <= LAST_STEP * protocol.precision
        tried = push._replace(forces=forces, load=load, max_steps=max_steps, steady=flow.STEADY)
        outcome = yield from _relaxed(tried, counts)
        if final and outcome.breach > STEADY:  # follow the apparent motion: it may come to rest
            max_steps = max(max_steps, STEADY_STEPS)
            longer = tried._replace(forces=outcome.forces, max_steps=max_steps, steady=STEADY)
            outcome = yield from _relaxed(longer, counts)
        if outcome.at_rest:
            past.append((load, outcome.forces))
            share = 1.0 if load >= moved_at else share
            if at_rest is not None:
                at_rest(load)
        elif final:
            return Raised(low, load, forces, outcome, counts)
        else:
            share, moved_at = share * SHORTER, max(moved_at, load)
            while len(past) > 1 and past[-1][0] > load - BACK * rise:
                past.pop()


def _relaxed(push: Push, counts: dict[str, float]) -> Asking[Outcome]:
    """The outcome of a flow, counted."""
    outcome = yield push
    counts["flow_steps"] += outcome.steps
    counts["linear_systems"] += outcome.iterations
    counts["seconds"] += outcome.seconds
    if outcome.at_rest:
        counts["loads_at_rest"] += 1
    else:
        counts["loads_moving" if outcome.converged else "loads_undecided"] += 1
    return outcome


@takes(critical=CriticalForce)
@cancelling.cancellable
def response(
    packing: Packing | Ensemble,
    contact: int,
    force: float | None = None,
    *,
    mu: float | None = None,
    critical: CriticalForce | None = None,
    precision: float | None = None,
    cancel: Cancel | None = None,
) -> Response:
    """The first motion under a force pair on one contact, beyond its critical force.

    The motion is that of one step of contact dynamics from rest, followed until the violation of
    Coulomb's law is at most 0.001 times the fastest relative velocity.

    Parameters
    ----------
    packing : Packing or Ensemble
        The packing, or its ensemble.
    contact : int
        Number in the packing.
    force : float, optional
        The load, by default the upper end of the critical force's bracket (`precision` ⟨f_n⟩, by
        default 0.01, above the limit load if the bracket ends there).
    mu : float, optional
        Friction coefficient for a Packing, by default its own.
    critical : CriticalForce, optional
        Computed to `precision` if not given.
    precision : float, optional
        Error of the critical force, in ⟨f_n⟩.
    cancel : callable, optional
        Polled; returning True raises Cancelled.

    Returns
    -------
    Response
        displacement and rotation of rattlers are NaN, as nothing moves them: use `S.grains` for the
        others, or numpy's nanmax and nanmean.

    Raises
    ------
    InputError
        If the grains come to rest under this load, and for an unused precision.
    """
    S = ensemble_at(packing, mu=mu)
    used = critical is None or (force is None and critical.moving is None)
    if precision is not None and not used:
        raise InputError("precision has no effect with this critical force: leave it out")
    precision = 0.01 if precision is None else precision
    precision = positive(precision, "precision", least=LEAST_PRECISION, most=MOST_PRECISION)
    position, scale = S.position(contact), S.force_scale
    if critical is None:
        critical = critical_force(S, contact, precision=precision)
    _check_its_own(S, critical, contact, position)
    step = make_step(S)
    moving = critical.moving
    load = critical.high / scale + (precision if moving is None else 0.0)
    if force is not None:
        load, moving = moderate(real(force, "force") / scale, "force in ⟨f_n⟩"), None
    if moving is None:
        start = critical.forces / scale
        moving = relax(step, Push(start, position, load, STEADY_STEPS, STEADY))
    if moving.at_rest:
        raise InputError(
            f"the grains stay at rest under a force of {load * scale:.6g} on contact {contact}: "
            "the critical force lies above"
        )
    return _response(S, step, int(contact), load * scale, moving)


def _check_its_own(S: Ensemble, critical: CriticalForce, contact: int, position: int) -> None:
    """InputError for a critical force of another contact, or of another ensemble."""
    if critical.contact != contact:
        raise InputError(
            f"the critical force is that of contact {critical.contact}, not of {contact}"
        )
    if critical.mu != S.mu:
        raise InputError(
            f"the critical force was computed at mu = {critical.mu:g}, this ensemble has {S.mu:g}"
        )
    loaded = S.networks(critical.forces, "the critical force").copy()
    loaded[position, 0] += critical.low
    S.refuse_foreign(loaded, critical.residual, "the critical force")


def motion_of(S: Ensemble, moving: Outcome) -> tuple[Floats, Floats, float]:
    """Displacement (N, 2) with rms |u| = 1, rotation times radius (N,), and the rms velocity.

    NaN for grains outside the backbone.
    """
    velocity = grain_velocities(S, moving.velocity)
    unit = np.sqrt(np.mean(np.sum(velocity[:, :2] ** 2, axis=1)))
    count = len(S.packing.r)
    displacement, rotation = np.full((count, 2), np.nan), np.full(count, np.nan)
    displacement[S.grains] = velocity[:, :2] / unit
    rotation[S.grains] = velocity[:, 2] / unit
    return displacement, rotation, float(unit)


def _response(S: Ensemble, step: Step, contact: int, load: float, moving: Outcome) -> Response:
    displacement, rotation, unit = motion_of(S, moving)
    relative = relative_velocities(step, moving.velocity) / unit
    box = moving.velocity[S.pressure_row] if S.has_pressure_row else 0.0
    normal, tangential = moving.forces.T
    opened = normal <= 0
    slid = ~opened & (np.abs(tangential) >= S.friction * normal)
    return Response(
        contact=contact,
        force=float(load),
        displacement=displacement,
        rotation=rotation,
        dilation=float(box / unit / S.contacts.length.sum()),
        opening=relative[:, 0],
        opened=opened,
        slid=slid,
        kept=~opened & ~slid,
        breach=moving.breach,
        fastest=float(np.abs(relative).max()),
        converged=bool(moving.breach <= STEADY),
    )
