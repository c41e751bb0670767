"""The step problem of an ensemble: its balance, with the masses of the grains and of the box."""

import numpy as np

from granforce.forces.contact_problem import balance_of
from granforce.forces.ensemble import Ensemble
from granforce.motion.box_motion import BOX_MASS
from granforce.motion.step import Step, effective_masses
from granforce.records import InputError
from granforce.types import Floats


def make_step(ensemble: Ensemble) -> Step:
    """The step problem of an ensemble with the inertia of contact dynamics: m, I and box.

    Raises InputError if forces are known, because contact dynamics cannot keep them.
    """
    if ensemble.informed.any():
        raise InputError(
            "moving grains change their forces, so known forces cannot hold: perturb the packing "
            "without them (limit loads accept known forces)"
        )
    network, b, b_border, _, place = balance_of(ensemble)
    # Rows without forces (torques without friction) may have any mass.
    inertia = np.ones(len(b) + len(b_border))
    inertia[place] = _inertia(ensemble)
    mass, mass_border = inertia[: len(b)], inertia[len(b) :]
    stiffness = effective_masses(network, mass, mass_border)
    closing = np.zeros(len(stiffness))
    return Step(
        network, b, b_border, mass, mass_border, stiffness, closing, ensemble.friction, place
    )


def _inertia(ensemble: Ensemble) -> Floats:
    packing, size = ensemble.packing, ensemble.per_grain
    # The velocity conjugate to a torque/r is r ω, with inertia I/r²: m/2 for a disk.
    if packing.shapes is None:
        longest = float(packing.r.max())
        grain = np.pi * (packing.r[ensemble.grains] / longest) ** 2
        mass = (grain[:, None] * np.array([1.0, 1.0, 0.5])[:size]).ravel()
    else:
        heaviest = packing.shapes.mass[ensemble.grains].max()
        grain = packing.shapes.mass[ensemble.grains] / heaviest
        turning = packing.shapes.inertia[ensemble.grains] / heaviest
        turning /= packing.r[ensemble.grains] ** 2
        mass = np.column_stack([grain, grain, turning])[:, :size].ravel()
    if not ensemble.has_pressure_row:
        return mass
    # That conjugate to the mean normal force Σ f_n ℓ / Σ ℓ is λ Σ ℓ; with the whole stress
    # prescribed the box may also shear, with the same inertia.
    box = 2 * packing.volume * BOX_MASS / ensemble.contacts.length.sum() ** 2
    return np.append(mass, np.full(ensemble.A.shape[0] - ensemble.pressure_row, box))


def grain_velocities(ensemble: Ensemble, velocity: Floats) -> Floats:
    """Velocities (M, 3) of the backbone grains: intrinsic v_x, v_y and r ω."""
    size = ensemble.per_grain
    grains = velocity[: size * len(ensemble.grains)].reshape(-1, size)
    return np.column_stack([grains, np.zeros((len(grains), 3 - size))])
