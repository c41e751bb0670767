"""The step of contact dynamics that a perturbation solves: A and b with inertia.

With the geometry fixed, an implicit Euler step from rest determines contact forces f and velocities
U from

    M U = A f − b,    f = Π(f − D Aᵀ U)

where A f = b is the balance of S, M holds the masses of the grains and of the box, Aᵀ U are the
relative velocities at the contacts, and Π is Coulomb's law: f_n ← max(f_n, 0), then f_t clipped to
±μ f_n. Any D > 0 gives the same law; D is chosen as the effective masses of single contacts, 1/D =
Aᵀ M⁻¹ A, as in a Gauss–Seidel sweep.

Π is not the projection onto the cone: a sliding contact does not dilate, so the problem is not a
convex program and may have several solutions: networks at rest (U = 0, any f in S), and motion with
constant acceleration, as the law is homogeneous in U. Which one is reached depends on the initial
forces (see `flow`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from granforce.numerics.contact_matrix import Network, pull
from granforce.numerics.lanes import ONE, compiled
from granforce.types import Floats, Integers


class Step(NamedTuple):
    """The step problem of one ensemble, in units of ⟨f_n⟩ and r_max; Δt = 1.

    Rows of grains are in order of elimination; those of the pressure (m = 1 or 0) are separate.
    """

    network: Network
    b: Floats  # (rows,)
    b_border: Floats  # (m,)
    mass: Floats  # (rows,) M
    mass_border: Floats  # (m,)
    stiffness: Floats  # (N_c, 2) D: effective masses of the contacts
    closing: Floats  # (N_c,) approach velocity that just closes the gap
    mu: Floats  # (N_c,)
    place: Integers  # (rows of the ensemble,) their place among rows and border


def effective_masses(network: Network, mass: Floats, mass_border: Floats) -> Floats:
    """D (N_c, 2), 1/D = Aᵀ M⁻¹ A of each contact alone; 1 if nothing can move."""
    rows = 3 * np.stack([network.high, network.low], axis=1)[:, :, None] + np.arange(3)
    columns = network.columns.reshape(-1, 2, 2, 3)
    yielding = np.einsum("cpgk,cgk->cp", columns**2, 1 / mass[rows])
    yielding += network.border.reshape(len(rows), 2, len(mass_border)) ** 2 @ (1 / mass_border)
    return 1 / np.where(yielding > 0, yielding, 1.0)


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
