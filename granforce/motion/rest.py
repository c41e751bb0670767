"""Rest: whether contact dynamics leaves a packing at rest.

A network in S shows that balance and friction allow rest, not that the grains stay at rest: sliding
contacts do not dilate, so that the same contacts and loads may also allow motion, and the initial
forces decide between the two. A packing is at rest if the exact step of contact dynamics (`step`,
`flow`), with all velocities initially zero, ends without motion from the packing's own forces, and
again from the resulting network with noise on every force. From forces that are no network, grains
may also come to rest, but under other forces: then the packing is not at rest under its own.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np

from granforce.fields import record
from granforce.forces.build import ensemble_at, unproved
from granforce.forces.contact_problem import wedged
from granforce.forces.ensemble import Ensemble
from granforce.motion import flow
from granforce.motion.flow import Outcome, Push
from granforce.motion.flow_lanes import relax
from granforce.motion.inertia import make_step
from granforce.motion.step import Step
from granforce.quantities import ALL_CONTACTS, FORCE, Field
from granforce.records import InputError, Packing, float_array, random_seed, whole
from granforce.system import cancelling
from granforce.tolerances import MANY_DISKS, NO_EQUILIBRIUM, SEEN_CARRYING
from granforce.types import Cancel, Floats, Integers, Mask

# Standard deviations of the noise on each force (in ⟨f_n⟩), and draws for each of them: fewer for
# more than MANY_DISKS grains, as each draw puts noise on all forces.
NOISE, DRAWS = (1e-4, 1e-2), 3
# Implicit steps within which a network must come to rest.
MOST_STEPS = 500


@record
class Rest(NamedTuple):
    """The outcome of the test of rest of a packing; see `rest`."""

    at_rest: Annotated[
        bool, "its own forces are a network, and it rests under them and in all draws"
    ]
    distance: Annotated[
        float, "from its own forces to the network reached, ⟨f_n⟩; NaN without rest"
    ]
    noise: Annotated[tuple[float, ...], "standard deviations, ⟨f_n⟩"]
    stayed: Annotated[
        Mask, "(noise, draws) draws that came to rest; all False if its own forces move"
    ]
    forces: Annotated[
        Floats, Field(ALL_CONTACTS, FORCE, "the network reached; while moving if grains move")
    ]
    reason: Annotated[str, "why it is not at rest; empty if it is"]
    wedged: Annotated[
        Integers, "grains that can press on each other without a load: rest assumes this prestress"
    ]


@cancelling.cancellable
def rest(
    packing: Packing | Ensemble,
    *,
    noise: tuple[float, ...] = NOISE,
    draws: int | None = None,
    seed: int = 0,
    cancel: Cancel | None = None,
    **conditions: Any,
) -> Rest:
    """Whether contact dynamics leaves a packing at rest, under its own forces and with noise.

    Forces with a residual or violation above 0.05 ⟨f_n⟩ are no network: grains may come to rest
    elsewhere, at other forces, which is reported as not at rest. Smaller errors, of simulations or
    of rounded files, show only in `distance`.

    Parameters
    ----------
    packing : Packing or Ensemble
        A Packing with forces, of any origin, or its Ensemble.
    noise : tuple of float, default (0.0001, 0.01)
        Standard deviations of the normal noise on every component, in ⟨f_n⟩.
    draws : int, optional
        Number of draws for each of them. By default 3, and 3000/N (at least one) for more than 1000
        grains, as each draw puts noise on all forces.
    seed : int, default 0
        Seed of the noise.
    cancel : callable, optional
        Polled; returning True raises Cancelled.
    **conditions
        Of a Packing, as for `ensemble`.

    Returns
    -------
    Rest
        at_rest, the network reached, and the draws that came to rest.

    Raises
    ------
    NotJammedError
        If S is empty.
    InputError
        If the packing has no forces, and for conditions with an Ensemble.
    """
    if draws is not None:
        draws = whole(draws, "draws", least=1)
    noise = tuple(float(level) for level in float_array(noise, (-1,), "noise"))
    if min(noise, default=0.0) < 0:
        raise InputError("noise must be standard deviations ≥ 0")
    S, step, first = _from_its_own(packing, conditions)
    grains = len(S.packing.r)
    draws = max(1, DRAWS * min(MANY_DISKS, grains) // grains) if draws is None else draws
    forces = S.original / S.force_scale
    if not first.at_rest:
        none = np.zeros((len(noise), draws), dtype=bool)
        why = "grains move under its own forces"
        return Rest(False, np.nan, noise, none, _on_all(S, first.forces), why, wedged(S))
    rng = np.random.default_rng(random_seed(seed))
    starts = [
        _from(first.forces + level * rng.standard_normal(forces.shape))
        for level in noise
        for _ in range(draws)
    ]
    # One by one: some take ten times as many steps as others, which would wait in their lanes.
    outcomes = [relax(step, push) for push in starts]
    stayed = np.array([end.at_rest for end in outcomes]).reshape(len(noise), draws)
    moving = next((end.forces for end in outcomes if not end.at_rest), first.forces)
    distance = float(np.abs(first.forces - forces).max())
    why = _reason(noise, draws - stayed.sum(axis=1), draws)
    reasons = [reason for reason in (_elsewhere(S, distance), why) if reason]
    return Rest(
        not reasons, distance, noise, stayed, _on_all(S, moving), "; ".join(reasons), wedged(S)
    )


def _from_its_own(
    packing: Packing | Ensemble, conditions: dict[str, Any]
) -> tuple[Ensemble, Step, Outcome]:
    """The ensemble, its step problem and the flow from its own forces.

    Which contacts carry is left to the flow to prove: if it ends at rest with all of them pressing,
    they do. Otherwise the ensemble proves it.
    """
    if not isinstance(packing, Ensemble):
        S = unproved(packing, **conditions)
        step, first = _flow(S)
        if first.at_rest and first.forces[:, 0].min() > SEEN_CARRYING:
            return S, step, first
    S = ensemble_at(packing, **conditions)
    return S, *_flow(S)


def _flow(S: Ensemble) -> tuple[Step, Outcome]:
    if not S.original.any():
        raise InputError("the packing has no forces to check for rest")
    step = make_step(S)
    return step, relax(step, _from(S.original / S.force_scale))


def _elsewhere(S: Ensemble, distance: float) -> str:
    """Why the rest that was reached is not that of the packing's own forces; empty if it is."""
    residual, violation = S.residual(S.original), S.violation(S.original)
    size, what = max((residual, "unbalance"), (violation, "violation of Coulomb's law"))
    if size <= NO_EQUILIBRIUM:
        return ""
    return (
        f"its own forces are no network, with a largest {what} of {size:.2g} ⟨f_n⟩; grains come to "
        f"rest elsewhere, at forces up to {distance:.2g} ⟨f_n⟩ from these"
    )


def _reason(noise: tuple[float, ...], moved: Integers, draws: int) -> str:
    """Why grains that came to rest move with noise; moved: draws at each level that moved."""
    parts = [
        f"{count} of {draws} draws with noise of {level:g} ⟨f_n⟩"
        for level, count in zip(noise, moved, strict=True)
        if count
    ]
    return f"grains move in {' and '.join(parts)}" if parts else ""


def _from(forces: Floats) -> Push:
    return Push(forces, 0, 0.0, MOST_STEPS, flow.STEADY)


def _on_all(S: Ensemble, forces: Floats) -> Floats:
    return S.expand(forces * S.force_scale)
