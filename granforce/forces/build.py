"""Making an Ensemble: the balance, Coulomb's law and known forces of the contacts that carry.

Contacts that carry nothing in any network are left out (see `backbone`), with grains that have no
other contacts; both are counted.
"""

from __future__ import annotations

import copy
import inspect
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce.forces import backbone, balance, knowledge
from granforce.forces.ensemble import Ensemble
from granforce.forces.hull import hull_of
from granforce.forces.knowledge import Known
from granforce.forces.nearest import nearest, starting_network
from granforce.records import InputError, NotJammedError, Packing, takes, with_friction
from granforce.tolerances import ADMISSIBLE, BALANCED
from granforce.types import Floats, Integers, Mask

# The prescribed quantity, by its number of values.
_NAMES = {1: "pressure", 3: "stress"}


@takes(Packing)
def ensemble(
    packing: Packing,
    mu: npt.ArrayLike | None = None,
    *,
    prescribed: str = "pressure",
    stress: npt.ArrayLike | None = None,
    known: Known | None = None,
    frozen: npt.ArrayLike | None = None,
    prune: bool = True,
) -> Ensemble:
    """The set S of admissible force networks of a packing.

    Parameters
    ----------
    packing : Packing
        Grains, contacts and loads. Grains whose load is NaN need not balance.
    mu : float or (N_c,) array, optional
        Friction coefficient of the cones, by default the packing's. One number for a packing with
        several: of the roughest, the others in proportion.
    prescribed : {"pressure", "stress", "none"}
        "stress" is the whole stress, "none" nothing but loads, or forces outside.
    stress : (3,) array, optional
        σ_xx, σ_yy and σ_xy, force per length, by default those of the packing's own network.
    known : Known, optional
        Bounds on single forces.
    frozen : array, optional
        Mask (N_c,) or positions of contacts held at their original forces, which drops the pressure
        row (PRL 94, 178001).
    prune : bool, default True
        Leave out rattlers and contacts that carry nothing in any state of S.

    Returns
    -------
    Ensemble
        A, b, the contacts that can carry force (`index`) and ⟨f_n⟩ (`force_scale`).

    Raises
    ------
    NotJammedError
        Where S is empty, naming the grains with the largest unbalanced load, or the known forces
        that conflict.
    InputError
        For conditions that exclude each other.
    """
    given = {"mu": mu, "prescribed": prescribed, "stress": stress, "known": known}
    given |= {"frozen": frozen, "prune": prune}
    S, conditions = _unproved(packing, mu, prescribed, stress, known, frozen, prune)
    if prune:
        S = _pruned(S, conditions)
        _check_idle_and_known(S, conditions.bounds)
    object.__setattr__(S, "conditions", copy.deepcopy(given))  # arrays may be changed
    return S


@takes(Packing)
def unproved(packing: Packing, **conditions: Any) -> Ensemble:
    """What `ensemble` returns if all contacts carry but those of grains without another.

    A network in which they all press proves that they do.
    """
    defaults = {
        name: parameter.default
        for name, parameter in inspect.signature(ensemble).parameters.items()
        if parameter.default is not parameter.empty
    }
    return _unproved(packing, **defaults | conditions)[0]


def _unproved(
    packing: Packing,
    mu: npt.ArrayLike | None,
    prescribed: str,
    stress: npt.ArrayLike | None,
    known: Known | None,
    frozen: npt.ArrayLike | None,
    prune: bool,
) -> tuple[Ensemble, _Conditions]:
    count = len(packing.contacts.i)
    contacts, mu = with_friction(packing.contacts, packing.mu if mu is None else mu)
    packing = packing._replace(contacts=contacts)
    held = np.zeros(count, dtype=bool)
    if frozen is not None:
        held[balance.frozen_positions(frozen, count)] = True
    loaded = np.nan_to_num(packing.load).any()
    if np.isnan(packing.pressure) and not packing.forces.any() and not loaded:
        raise InputError(
            "all forces are zero, and their scale is undetermined: give forces, a pressure, or "
            "loads on the grains"
        )
    bounds = None if known is None else knowledge.bounds_of(known, count)
    if known is not None:
        knowledge.refuse_others(known, contacts)
    conditions = _Conditions(
        mu, held, balance.prescribed_stress(packing, prescribed, stress, held), bounds
    )
    free = np.flatnonzero(~held)
    if prune:
        free = backbone.without_danglers(packing, free, held)
    S = _assemble(packing, conditions, free)
    _check_frozen_and_known(packing, held, bounds, S.force_scale)
    return S, conditions


def with_idle(S: Ensemble) -> Ensemble:
    """The ensemble with the contacts that carry nothing, which may carry under other loads.

    Raises InputError if a pressure or a stress is prescribed.
    """
    if S.has_pressure_row:
        raise InputError(
            "loads on grains need a packing without a prescribed pressure or stress; give it "
            "weights in an open box"
        )
    count = len(S.packing.contacts.i)
    held, bounds = np.zeros(count, dtype=bool), None
    held[S.frozen] = True
    if len(S.index) + len(S.frozen) == count:
        return S
    if S.known is not None:
        bounds = np.tile([-np.inf, np.inf], (count, 2, 1))
        bounds[S.index] = S.bounds
    conditions = _Conditions(S.mu, held, None, bounds)
    full = _assemble(S.packing, conditions, np.flatnonzero(~held))
    network = starting_network(S)
    return replace(full, computed=S.expand(network)[full.index], force_scale=S.force_scale)


def ensemble_at(packing: Packing | Ensemble, **conditions: Any) -> Ensemble:
    """The Ensemble itself, or that of a Packing under these conditions, as for `ensemble`.

    Raises InputError for conditions beside an Ensemble, which has its own.
    """
    if not isinstance(packing, Ensemble):
        return ensemble(packing, **conditions)
    given = [name for name, value in conditions.items() if value is not None]
    if given:
        raise InputError(f"an ensemble already has {given[0]}: leave it out, or give the packing")
    return packing


class _Conditions(NamedTuple):
    """The conditions on the networks of an ensemble."""

    mu: float
    held: Mask  # (contacts,) bool, frozen
    stress: Floats | None  # prescribed: (1,) pressure, (3,) xx, yy, xy, or None
    bounds: Floats | None  # (contacts, 2, 2) force, by knowledge.bounds_of


def _pruned(full: Ensemble, conditions: _Conditions) -> Ensemble:
    """The ensemble without contacts that carry nothing.

    Forces up to CARRYING count as nothing, but others may depend on them (if forces are frozen at
    such values): if no network balances without them, contacts that press in the known network
    stay.
    """
    carrying, network = backbone.carrying(full)
    S = _picked(full, conditions, carrying, network)
    if network is None or S.member is not None:
        return S
    near = nearest(S, S.original).forces
    if S.admits(near):
        return replace(S, computed=near)
    pressing = network[:, 0] > BALANCED / 10 * full.force_scale
    return _picked(full, conditions, carrying | pressing, network)


def _picked(
    full: Ensemble, conditions: _Conditions, chosen: Mask, network: Floats | None
) -> Ensemble:
    S = full if chosen.all() else _assemble(full.packing, conditions, full.index[chosen])
    return replace(S, computed=None if network is None else network[chosen])


def _check_frozen_and_known(
    packing: Packing, held: Mask, bounds: Floats | None, scale: float
) -> None:
    if bounds is None or not held.any():
        return
    outside = np.maximum(bounds[..., 0] - packing.forces, packing.forces - bounds[..., 1])
    wrong = np.flatnonzero(held & (outside.max(axis=1) > ADMISSIBLE * scale))
    if len(wrong):
        raise InputError(
            f"contact {wrong[0]} is frozen at a force that contradicts its known force: leave out "
            "one of the two"
        )


def _check_idle_and_known(S: Ensemble, bounds: Floats | None) -> None:
    """Refuse known forces on contacts that carry nothing."""
    if bounds is None:
        return
    out = np.setdiff1d(np.arange(len(bounds)), np.append(S.index, S.frozen))
    short = np.maximum(bounds[out, :, 0], -bounds[out, :, 1]).max(axis=1, initial=0.0)
    if np.any(short > ADMISSIBLE * S.force_scale):
        worst = int(np.argmax(short))
        raise NotJammedError(
            f"contact {out[worst]} carries no force in any network under these conditions; its "
            f"known bounds would have to be relaxed by {short[worst]:.3g}"
        )


def _assemble(packing: Packing, conditions: _Conditions, free: Integers) -> Ensemble:
    mu, held = conditions.mu, conditions.held
    if not len(free):
        if held.any():
            raise InputError(
                "no free contact can carry a force; freeze fewer contacts, or use a larger slice"
            )
        raise NotJammedError("the packing has no contact that could carry a load")
    contacts = packing.contacts.picked(free)
    loaded = np.any(packing.load != 0, axis=1)
    grains = np.union1d(np.union1d(contacts.i, contacts.j), np.flatnonzero(loaded))
    left_open = np.flatnonzero(balance.left_open_in(packing))
    grains = np.setdiff1d(grains, left_open)
    original = packing.forces[free]
    A, b, scale = balance.equations(packing, free, grains, held, mu, conditions.stress)
    bounds = None if conditions.bounds is None else conditions.bounds[free]
    friction = contacts.friction(mu)
    slopes = np.where(friction > 0, friction, mu)
    bounds = _without_friction(bounds, slopes > friction, free, scale)
    known = None if bounds is None else knowledge.polygons(bounds, slopes, scale, free)
    return Ensemble(
        packing=packing,
        mu=mu,
        index=free,
        contacts=contacts,
        grains=grains,
        A=A,
        b=b,
        force_scale=scale,
        original=original,
        frozen=np.flatnonzero(held),
        skipped={
            "rattlers": len(packing.r) - len(left_open) - len(grains),
            "unloaded_contacts": len(held) - len(free) - int(held.sum()),
            "tangential_unknowns": len(free) if mu == 0 else 0,
        },
        prescribed="none" if conditions.stress is None else _NAMES[len(conditions.stress)],
        known=known,
        find_hull=hull_of,
    )


def _without_friction(
    bounds: Floats | None, smooth: Mask, index: Integers, scale: float
) -> Floats | None:
    """The bounds (N_c, 2, 2) with f_t = 0 on smooth contacts among others that have friction.

    Raises NotJammedError where known bounds exclude 0 by more than ADMISSIBLE.
    """
    if not smooth.any():
        return bounds
    if bounds is None:
        bounds = np.tile([-np.inf, np.inf], (len(smooth), 2, 1))
    wrong = smooth & (np.maximum(bounds[:, 1, 0], -bounds[:, 1, 1]) > ADMISSIBLE * scale)
    for c in index[wrong][:1]:
        raise NotJammedError(f"contact {c} has no friction, so that its f_t is 0, not as known")
    bounds[smooth, 1] = 0.0
    return bounds
