"""Networks under a force pair that pushes the two grains of one contact apart.

The pair ±F counts in the balance of the grains, and in the pressure, like a normal force of the
contact c itself, but not in its Coulomb cone: A (f + F e_c) = b. So the networks under F have the
same cones with b − F A e_c in place of b, and the nearest of them to a given network is computed as
in S (`forces.nearest`). The pairs (f, F) form a convex set: the straight line between two networks
under two loads is admissible under the loads in between.

Such a network exists up to the limit load. Grains may start to move earlier (`critical_force`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce.fields import record
from granforce.forces.ensemble import Ensemble
from granforce.forces.nearest import given_network, some_network
from granforce.quantities import FORCE, Field, quantity
from granforce.records import InputError, float_array, real_array, takes
from granforce.system import cancelling
from granforce.tolerances import BALANCED
from granforce.types import Cancel, Floats


@record
class Loaded(NamedTuple):
    """Networks under loads that push the grains of one contact apart."""

    contact: Annotated[int, "its number in the packing"]
    loads: Annotated[Floats, Field("load", FORCE, "loads that push its grains apart", label="load")]
    states: Annotated[Floats, Field("load contact component", FORCE, "networks, without the load")]
    residual: Annotated[Floats, quantity("residual", "load", note="with the load")]
    violation: Annotated[Floats, quantity("violation", "load")]


@takes(Ensemble)
@cancelling.cancellable
def loaded_networks(
    ensemble: Ensemble,
    contact: int,
    loads: npt.ArrayLike,
    state: Floats | None = None,
    *,
    cancel: Cancel | None = None,
) -> Loaded:
    """The networks nearest to `state` that balance force pairs on one contact.

    Nearest means the least Σ |F_c − F_state,c|².

    Parameters
    ----------
    ensemble : Ensemble
        S.
    contact : int
        Number in the packing.
    loads : (k,) array
        Force, positive if they push its grains apart.
    state : (N_c, 2) array, optional
        Force; by default the original network.
    cancel : callable, optional
        Polled; returning True raises Cancelled.

    Returns
    -------
    Loaded
        states (k, N_c, 2), force, without the load.

    Raises
    ------
    InputError
        For a contact that carries no force, and for a load without a network (there is none above
        the limit load).
    """
    position = ensemble.position(contact)
    loads = float_array(np.atleast_1d(real_array(loads, "loads")), (-1,), "loads")
    if not len(loads):
        raise InputError("give at least one load")
    state = given_network(ensemble, state)
    pair = np.zeros_like(state)
    pair[position, 0] = 1.0
    turned = ensemble.A @ ensemble.to_vector(pair)
    states = np.empty((len(loads), *state.shape))
    for k, load in enumerate(loads):
        cancelling.check()
        under = replace(ensemble, b=ensemble.b - load * turned, computed=None)
        # Beyond this, the rounding error of the load alone exceeds the tolerance of the balance.
        possible = abs(load) * np.finfo(float).eps <= BALANCED * ensemble.force_scale
        if possible:
            states[k] = some_network(under, state)
        if not (possible and under.admits(states[k])):
            raise InputError(
                f"no network was found that balances a pair of {load:.9g} on contact {contact}; "
                "above its limit load there is none"
            )
    residual = ensemble.residual(states + loads[:, None, None] * pair)
    return Loaded(int(contact), loads, states, residual, ensemble.violation(states))
