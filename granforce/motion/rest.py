"""Rest: whether contact dynamics leaves a packing where it is.

A network in S shows that balance and friction allow rest. It does not show that grains stay:
sliding contacts do not dilate, so that the same contacts and loads may allow motion as well, and
which of the two happens depends on the forces from which one starts. A packing is at rest where the
exact step of contact dynamics (`step`, `flow`), all velocities zero before it, ends without motion
from the packing's own forces, and again from the network that it ended in, with noise on every
force.
"""

from collections.abc import Generator
from typing import Any, NamedTuple

import numpy as np

from granforce import notebook
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.motion import flow
from granforce.motion.flow import Outcome, Push
from granforce.motion.inertia import make_step
from granforce.motion.works import follow, relax
from granforce.numerics.lanes import ONE
from granforce.records import InputError, Packing, random_seed, whole
from granforce.system import cancelling
from granforce.types import Cancel, Floats, Mask

# Standard deviation of the noise on each force (in ⟨f_n⟩), and draws of each.
NOISE, DRAWS = (1e-4, 1e-2), 3
# Implicit steps in which a network comes to rest or is said not to.
MOST_STEPS = 500


@notebook.brief
class Rest(NamedTuple):
    """The certificate of rest of a packing; see `rest`."""

    at_rest: bool  # from the packing's own forces, and with noise in every draw
    distance: float  # ⟨f_n⟩, of its own forces from the network they end in; NaN without rest
    noise: tuple[float, ...]  # ⟨f_n⟩, standard deviations
    stayed: Mask  # (len(noise), draws) bool, which draws came to rest; none without rest before
    # (contacts, 2) the network that its own forces end in; if something sets off, the forces with
    # which it moves
    forces: Floats


@cancelling.cancellable
def rest(
    packing: Packing | Ensemble,
    *,
    noise: tuple[float, ...] = NOISE,
    draws: int = DRAWS,
    seed: int = 0,
    cancel: Cancel | None = None,
    **conditions: Any,
) -> Rest:
    """Whether contact dynamics leaves a packing at rest, from its own forces and with noise.

    packing: a Packing with forces, of any origin, or its Ensemble. noise: standard deviations of
    the normal noise on every component, in ⟨f_n⟩; draws of each, by seed. conditions: as for
    `ensemble`. cancel() returning True raises Cancelled.

    Raises NotJammedError where S is empty, InputError for a packing without forces of its own.
    """
    S = packing if isinstance(packing, Ensemble) else ensemble(packing, **conditions)
    draws = whole(draws, "draws", least=1)
    if not S.original.any():
        raise InputError("the packing has no forces to check for rest")
    step, own = make_step(S), S.original / S.force_scale
    first = relax(step, _from(own))
    if not first.at_rest:
        none = np.zeros((len(noise), draws), dtype=bool)
        return Rest(False, np.nan, noise, none, _on_all(S, first.forces))
    rng = np.random.default_rng(random_seed(seed))
    starts = [
        first.forces + level * rng.standard_normal(own.shape)
        for level in noise
        for _ in range(draws)
    ]
    ends: dict[int, Outcome] = {}
    # Side by side these few flows gain little, and a first packing would wait for more kernels.
    follow(step, [_one(_from(start)) for start in starts], ends.__setitem__, lanes=ONE)
    outcomes = [ends[k] for k in range(len(starts))]
    stayed = np.array([end.at_rest for end in outcomes]).reshape(len(noise), draws)
    moving = next((end.forces for end in outcomes if not end.at_rest), first.forces)
    distance = float(np.abs(first.forces - own).max())
    return Rest(bool(stayed.all()), distance, noise, stayed, _on_all(S, moving))


def _from(forces: Floats) -> Push:
    return Push(forces, 0, 0.0, MOST_STEPS, flow.STEADY)


def _one(asked: Push) -> Generator[Push, Outcome, Outcome]:
    return (yield asked)


def _on_all(S: Ensemble, forces: Floats) -> Floats:
    return S.expand(forces * S.force_scale)
