"""The step of contact dynamics that a perturbation solves: inertia, and what it makes of A and b.

With the geometry fixed, a step of implicit Euler from rest asks for contact forces f and
velocities U with

    M U = A f − b,    f = Π(f − D Aᵀ U)

where A f = b is the balance of S, M holds the masses of the grains and of the box, Aᵀ U are the
relative velocities at the contacts, and Π is Coulomb's law: f_n ← max(f_n, 0), then f_t clipped to
±μ f_n. Any D > 0 gives the same law; the effective masses of the contacts, 1/D = Aᵀ M⁻¹ A of one
contact alone, are what a Gauss–Seidel sweep uses.

It is not the projection onto the cone: a sliding contact does not dilate, so the problem is no
convex program, and several solutions may exist side by side: networks at rest (U = 0, any f in S),
and motion, which goes on with constant acceleration because the law is homogeneous in U. Which one
is reached depends on where one comes from (see `flow`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from granforce.forces.contact_problem import balance_of
from granforce.forces.gauss_seidel import BOX_MASS
from granforce.numerics.contact_matrix import Network, pull
from granforce.numerics.lanes import ONE, compiled
from granforce.records import InputError
from granforce.types import Floats, Integers

if TYPE_CHECKING:  # it needs this file to run
    from granforce.forces.ensemble import Ensemble


class Step(NamedTuple):
    """The step problem of one ensemble, in units of ⟨f_n⟩ and r_max; Δt = 1.

    Rows of grains are in order of elimination; those of the pressure (m = 1, or 0) come apart.
    """

    network: Network
    b: Floats  # (rows,)
    b_border: Floats  # (m,)
    mass: Floats  # (rows,) M
    mass_border: Floats  # (m,)
    stiffness: Floats  # (N_c, 2) D: effective masses of the contacts
    closing: Floats  # (N_c,) approach velocity that just closes a contact's gap
    mu: float
    place: Integers  # (rows of the ensemble,) where they are among rows and border


def make_step(ensemble: Ensemble) -> Step:
    """The step problem of an ensemble with the inertia of contact dynamics: m, I and box.

    Raises InputError where forces are known: contact dynamics does not hold to that.
    """
    if ensemble.known is not None:
        raise InputError(
            "grains that move change their forces, whatever is known of them: perturb the packing "
            "without known forces (its limit loads can be had with them)"
        )
    network, b, b_border, _, place = balance_of(ensemble)
    # Rows that nothing acts on (torques without friction) may have any mass.
    inertia = np.ones(len(b) + len(b_border))
    inertia[place] = _inertia(ensemble)
    mass, mass_border = inertia[: len(b)], inertia[len(b) :]
    stiffness = effective_masses(network, mass, mass_border)
    closing = np.zeros(len(stiffness))
    return Step(network, b, b_border, mass, mass_border, stiffness, closing, ensemble.mu, place)


def effective_masses(network: Network, mass: Floats, mass_border: Floats) -> Floats:
    """D (N_c, 2), 1/D = Aᵀ M⁻¹ A of each contact alone; 1 where nothing yields."""
    rows = 3 * np.stack([network.high, network.low], axis=1)[:, :, None] + np.arange(3)
    columns = network.columns.reshape(-1, 2, 2, 3)
    yielding = np.einsum("cpgk,cgk->cp", columns**2, 1 / mass[rows])
    yielding += network.border.reshape(len(rows), 2, len(mass_border)) ** 2 @ (1 / mass_border)
    return 1 / np.where(yielding > 0, yielding, 1.0)


def _inertia(ensemble: Ensemble) -> Floats:
    packing, size = ensemble.packing, 1 + ensemble.per_contact
    longest = float(packing.r.max())
    # The velocity that goes with a torque/r is r ω: its inertia is I/r² = m/2.
    grain = np.pi * (packing.r[ensemble.grains] / longest) ** 2
    mass = (grain[:, None] * np.array([1.0, 1.0, 0.5])[:size]).ravel()
    if not ensemble.has_pressure_row:
        return mass
    # The one that goes with the mean normal force Σ f_n ℓ / Σ ℓ is λ Σ ℓ; where the whole stress is
    # prescribed the box may shear as well, with the same inertia.
    box = 2 * packing.volume * BOX_MASS / ensemble.contacts.length.sum() ** 2
    return np.append(mass, np.full(ensemble.A.shape[0] - ensemble.pressure_row, box))


def grain_velocities(ensemble: Ensemble, velocity: Floats) -> Floats:
    """Velocities (M, 3) of the backbone grains: intrinsic v_x, v_y and r ω."""
    size = 1 + ensemble.per_contact
    grains = velocity[: size * len(ensemble.grains)].reshape(-1, size)
    return np.column_stack([grains, np.zeros((len(grains), 3 - size))])


def relative_velocities(step: Step, velocity: Floats) -> Floats:
    """Normal (opening > 0) and tangential relative velocity (N_c, 2) of the contacts, box included.

    They are the work conjugates of the forces: Aᵀ U. velocity (rows,) by the ensemble's rows.
    """
    rows = np.zeros(len(step.b) + len(step.b_border))
    rows[step.place] = velocity
    relative = np.empty_like(step.stiffness)
    _relative(step.network, rows[: len(step.b), None], rows[len(step.b) :, None], relative)
    return relative


@compiled
def _relative(network, velocity, border, relative):
    for c in range(len(relative)):
        pulled = pull(network, c, velocity, border, ONE)
        relative[c, 0], relative[c, 1] = pulled
