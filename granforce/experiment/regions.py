"""Stresses in parts of a frame."""

from typing import Any

import numpy as np

from granforce.packing.importers.geometry import vectors
from granforce.records import Contacts
from granforce.types import Floats, Integers

# Parts per side of the frame in which the stress is reported.
REGIONS = 3


def regional_stress(contacts: Contacts, x: Floats, grains: Any, forces: Floats) -> Floats:
    """Stresses (…, 9, 3) xx, yy, xy in 3 × 3 parts of the frame, of forces (…, N_c, 2).

    σ_ab = (1/A) Σ F_a ℓ_b over the contacts whose point is in a part of area A; for a contact with
    a wall, ℓ ends at the wall. The first `grains` of the centres x are grains.
    """
    arm = np.where(contacts.j < grains, contacts.length, contacts.arm_i)
    at = x[contacts.i] + contacts.arm_i[:, None] * contacts.normal
    cell, side = regions(at, x[:grains])
    force = vectors(forces, contacts.normal)
    branch = arm[:, None] * contacts.normal
    parts = np.stack([force[..., a] * branch[:, b] for a, b in ((0, 0), (1, 1), (0, 1))], axis=-1)
    total = np.zeros((*forces.shape[:-2], REGIONS**2, 3))
    for k in range(REGIONS**2):
        total[..., k, :] = parts[..., cell == k, :].sum(axis=-2)
    return total / np.prod(side)


def regions(at: Floats, x: Floats) -> tuple[Integers, Floats]:
    """Parts (k,) of the frame that contain points (k, 2), column by column, and a part's sides.

    x (N, 2): centres of the grains.
    """
    low, high = x.min(axis=0), x.max(axis=0)
    side = np.maximum((high - low) / REGIONS, 1e-300)
    return np.clip(((at - low) / side).astype(int), 0, REGIONS - 1) @ [REGIONS, 1], side
