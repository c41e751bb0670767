"""Pull a contact: the networks nearest to a given one with other values of its f_n.

The contact's f_n is pinned and its f_t is free: a contact program whose polygon at this contact is
a segment. Values are solved together (`numerics.contact_program`).
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce.explore.intervals import determined, needs_no_program, solved, values_and_gaps
from granforce.fields import record
from granforce.forces.contact_problem import (
    forces_of,
    independent_problem_of,
    make_system,
    problem_of,
)
from granforce.forces.ensemble import Ensemble
from granforce.forces.nearest import Search, given_network, some_network, starting_network
from granforce.forces.nearest_piqp import restored
from granforce.numerics.certified_values import Solver
from granforce.numerics.contact_program import PINNED
from granforce.numerics.lanes import LANES
from granforce.quantities import FORCE, Field, quantity
from granforce.records import InputError, UndecidedError, float_array, real_array, takes
from granforce.system import cancelling
from granforce.tolerances import BALANCED, INTERVAL_GAP
from granforce.types import Cancel, Floats, Integers, Mask

# A force of zero is approached to within this (in ⟨f_n⟩), so that its polygon has an interior.
_LEAST = 1e-13
_MOST_STEPS = 100
# Fractions of the width by which values at the ends of the interval are moved inwards; the first
# that converges is used.
_INWARD = 1e-6, 1e-5, 1e-4
# Beyond this many contacts each value is solved alone: eight factors at once exceed the cache
# (16,500 contacts: 0.12 s for a step of eight, 0.03 s for one), and each ends as soon as it
# converges.
_ALONE = 5000
# Tolerance with which a contact counts as open or sliding (in ⟨f_n⟩).
_AT_WALL = 1e-6


@record
class Pull(NamedTuple):
    """Networks with given f_n on one contact."""

    contact: Annotated[int, "its number in the packing"]
    values: Annotated[
        Floats, Field("value", FORCE, "f_n of the contact in the states", label="value")
    ]
    states: Annotated[Floats, quantity("states", "value contact component")]
    residual: Annotated[Floats, quantity("residual", "value")]
    violation: Annotated[Floats, quantity("violation", "value")]
    opened: Annotated[Mask, Field("value contact", "", "contacts without force")]
    sliding: Annotated[
        Integers, Field("value contact", "", "sign of f_t if |f_t| = μ f_n > 0, else 0")
    ]


@record
class Reach(NamedTuple):
    """The range of f_n of one contact, and the contacts that limit it."""

    contact: Annotated[int, "its number in the packing"]
    low: Annotated[float, Field("", FORCE, "exact least f_n over S")]
    high: Annotated[float, Field("", FORCE, "exact largest f_n over S")]
    gap: Annotated[Floats, quantity("interval_gap", "side")]
    states: Annotated[Floats, Field("side contact component", FORCE, "a network at either end")]
    opened: Annotated[
        Mask, Field("side contact", "", "contacts without force in all networks there")
    ]
    sliding: Annotated[
        Integers, Field("side contact", "", "sign of f_t if all there have |f_t| = μ f_n")
    ]


@takes(Ensemble)
@cancelling.cancellable
def pull(
    ensemble: Ensemble,
    contact: int,
    values: npt.ArrayLike,
    state: Floats | None = None,
    *,
    workers: int = 1,
    cancel: Cancel | None = None,
) -> Pull:
    """The points of S nearest to `state` with f_n of one contact at the given values.

    Nearest: the least Σ |F_c − F_state,c|² over all contacts. At the very ends of the interval f_n
    differs from the value by 10⁻⁶ of its width (rarely more, at most 10⁻⁴).

    Parameters
    ----------
    ensemble : Ensemble
        S.
    contact : int
        Number in the packing.
    values : (k,) array
        f_n, force, within the exact interval.
    state : (N_c, 2) array, optional
        Force; by default the original network.
    workers : int, default 1
        Threads. No result depends on their number.
    cancel : callable, optional
        Polled; returning True raises Cancelled.

    Returns
    -------
    Pull
        states (k, N_c, 2), force, and the contacts that are open or slide.

    Raises
    ------
    InputError
        For a contact that carries no force, and for values outside the exact interval, which the
        message gives.
    NotJammedError
        If S is empty.
    """
    position = ensemble.position(contact)
    values = float_array(np.atleast_1d(real_array(values, "values")), (-1,), "values")
    if not len(values):
        raise InputError("give at least one value for the contact's force")
    state = given_network(ensemble, state)
    states = _pulled_all(ensemble, position, values, state, workers)
    missed = ~ensemble.admits(states)
    if missed.any():
        states[missed] = _near_ends(ensemble, contact, values[missed], state)
    residual, violation = ensemble.residual(states), ensemble.violation(states)
    opened, sliding = _at_walls(ensemble, states)
    return Pull(int(contact), states[:, position, 0], states, residual, violation, opened, sliding)


def _pulled_all(
    ensemble: Ensemble, position: int, values: Floats, state: Floats, workers: int = 1
) -> Floats:
    """The networks (k, N_c, 2) for values (k,); the closest iterate if S has none."""
    width = 1 if len(state) > _ALONE else LANES
    groups = [values[first : first + width] for first in range(0, len(values), width)]
    with cancelling.threads(workers) as pool:
        pulls = pool.map(lambda some: _pulled(ensemble, position, some, state), groups)
        return np.concatenate(list(pulls))


def _pulled(ensemble: Ensemble, position: int, values: Floats, state: Floats) -> Floats:
    """Networks (k, N_c, 2) with k ≤ LANES values of f_n at one contact."""
    count, scale = len(values), ensemble.force_scale
    width = 1 if count == 1 else LANES
    problem = problem_of(ensemble)
    w = problem.w.copy()
    w[2 * position] = PINNED
    start = np.repeat(problem.start[: len(w), None], width, axis=1)  # known forces stay
    force = np.maximum(np.resize(values, width) / scale, _LEAST)
    start[2 * position : 2 * position + 2] = force
    targets = np.repeat(state[..., None] / scale, width, axis=2)
    # Near the ends of the interval multipliers are so large that shifted rows would be visible.
    search = Search(independent_problem_of(ensemble)._replace(w=w), targets, start)
    search.run(BALANCED / 4, _MOST_STEPS, count)
    states = ensemble.pin(search.forces()[:count] * scale)
    limit = ensemble.friction[position] * np.maximum(values, 0.0)
    states[:, position, 0] = values
    states[:, position, 1] = np.clip(states[:, position, 1], -limit, limit)
    return states


def _near_ends(ensemble: Ensemble, contact: int, values: Floats, state: Floats) -> Floats:
    """The networks for values that did not converge: outside the interval, or at its ends.

    Multipliers diverge at an end, so its network is computed slightly inside.
    """
    ends = reach(ensemble, contact)
    beyond = INTERVAL_GAP * ensemble.force_scale
    for value in values[(values < ends.low - beyond) | (values > ends.high + beyond)]:
        raise InputError(
            f"a normal force of {value:.9g} on contact {contact} is outside its exact interval, "
            f"{ends.low:.9g} to {ends.high:.9g}: no admissible network has it"
        )
    width = ends.high - ends.low
    if width <= _AT_WALL * ensemble.force_scale:  # every network has this f_n
        states = np.stack([some_network(ensemble, state)] * len(values))
        if np.all(ensemble.admits(states)):
            return states
        raise UndecidedError(
            f"the nearest network was not found; the normal force of contact {contact} is the same "
            "in all of them"
        )
    position = ensemble.position(contact)
    for part in _INWARD:
        inside = ends.low + part * width, ends.high - part * width
        states = _pulled_all(ensemble, position, np.clip(values, *inside), state)
        if np.all(admitted := ensemble.admits(states)):
            return states
    between = np.clip((values - ends.low) / width, 0.0, 1.0)[:, None, None]
    # The segment between both ends contains a network with each value, so S with that value known
    # is not empty.
    on_the_line = (1 - between) * ends.states[0] + between * ends.states[1]
    for k in np.flatnonzero(~admitted):
        states[k] = some_network(ensemble.with_normal(position, on_the_line[k]), state)
    if np.all(admitted := ensemble.admits(states)):
        return states
    raise UndecidedError(
        f"the network with a normal force of {values[np.argmin(admitted)]:.9g} on contact "
        f"{contact} was not found; choose a value further from the ends of its interval, "
        f"{ends.low:.9g} to {ends.high:.9g}"
    )


@takes(Ensemble)
@cancelling.cancellable
def reach(
    ensemble: Ensemble, contact: int, *, workers: int = 1, cancel: Cancel | None = None
) -> Reach:
    """Exact least and largest f_n of one contact.

    Contacts that are open or slide at an end are those that limit f_n there.

    Parameters
    ----------
    ensemble : Ensemble
        S.
    contact : int
        Number in the packing.
    workers : int, default 1
        Threads. No result depends on their number.
    cancel : callable, optional
        Polled; returning True raises Cancelled.

    Returns
    -------
    Reach
        low and high, force, and the contacts that limit f_n there.

    Raises
    ------
    InputError
        For a contact that carries no force.
    UndecidedError
        If the interval could not be certified.
    NotJammedError
        If S is empty.
    """
    position = ensemble.position(contact)
    keys = [(position, 0, side) for side in (0, 1)]
    points: dict[Any, Floats] = {}
    system = make_system(ensemble)
    if needs_no_program(ensemble, system):
        bounds = determined(ensemble, keys)
        states = np.stack([starting_network(ensemble)] * 2)
    else:
        bounds = solved(ensemble, Solver(system, workers=workers), keys, points)
        cancelling.check("exact interval")
        states = np.stack([_balanced(ensemble, points[key]) for key in keys])
    attained, gap = values_and_gaps(bounds, keys)
    if not np.all(gap <= INTERVAL_GAP):
        raise UndecidedError(f"the interval of contact {contact} could not be certified")
    if not np.all(ensemble.admits(states)):
        raise UndecidedError(
            f"no balanced network was found at the ends of the interval of contact {contact}"
        )
    lower, upper = attained * [1.0, -1.0] * ensemble.force_scale
    return Reach(int(contact), lower, upper, gap, states, *_at_walls(ensemble, states))


def _balanced(ensemble: Ensemble, y: Floats) -> Floats:
    """The network (N_c, 2) of a vertex, balanced to rounding if its residual exceeds BALANCED."""
    forces = forces_of(ensemble, y)
    if ensemble.residual(forces) <= BALANCED:
        return forces
    return restored(ensemble, ensemble.coordinates(forces))


def _at_walls(ensemble: Ensemble, states: Floats) -> tuple[Mask, Integers]:
    """Which contacts are open, and which slide, in states (k, N_c, 2)."""
    normal, tangential = states[..., 0], states[..., 1]
    least = _AT_WALL * ensemble.force_scale
    opened = normal <= least
    limit = ensemble.friction * (normal - least)
    slides = ~opened & (np.abs(tangential) >= limit) & (ensemble.friction > 0)
    return opened, np.where(slides, np.sign(tangential), 0).astype(np.int64)
