"""Disks poured on a floor, one after the other, in a box that is periodic in x.

Each disk falls where it is dropped, rolls down the disks that it meets, and stops in the first
hollow: between two disks, or at the floor (Visscher and Bolsterli, Nature 239, 504 (1972)). Every
disk then rests on two places, but its weight alone, not those above it, is balanced there: the
`settling` follows.
"""

import numpy as np

from granforce.motion.contact_dynamics import Motion
from granforce.packing.pair_list import motionless
from granforce.system import cancelling
from granforce.types import Floats

# Radius of the grain behind a touched place, relative to the disk's; of a pressing wall, relative
# to the largest disk's.
STUD = 0.25
# Packing fraction for which the layer is about as deep as wide, and its least width: twice the
# distance of two disks that a third one touches, so that only the nearest images matter.
_FRACTION, _NARROWEST = 0.8, 8.0
# Depth in which grains behind the floor wait for their disks, far apart from each other.
_FAR = 10.0
# Distance of a disk from the floor, in largest radii, below which the grain behind waits there.
_NEAR_FLOOR = 0.1


def poured(r: Floats, rng: np.random.Generator) -> Motion:
    """A motion at rest of disks with radii r (N,) on a floor at y = 0, and a grain behind it each.

    Grain N + k is behind the floor where disk k touches it. The unit of force is the weight of all
    disks per side of the box, times the largest radius.
    """
    side = max(_NARROWEST, np.sqrt(np.pi * np.sum(r**2) / _FRACTION))
    x = np.zeros((2 * len(r), 2))
    for k in range(len(r)):
        cancelling.check("compaction")
        x[k] = _hollow(x[:k], r[:k] + r[k], r[k], side, rng)
    both = np.append(r, STUD * r)
    return motionless(behind_floor(x, both), both, np.array([side, np.inf]), np.zeros((1, 0)))


def weights(motion: Motion) -> Floats:
    """The weights (2N,) of the disks, 0 behind the floor, which add up to the side of the box."""
    disks = len(motion.r) // 2
    weight = np.append(motion.mass[:disks], np.zeros(disks))
    return weight * (motion.box[0] / weight.sum())


def behind_floor(x: Floats, r: Floats) -> Floats:
    """The centres (2N, 2): grains behind the floor lie below their disks, or out of the way."""
    count = len(r) // 2
    away = x[:count, 1] - r[:count] > _NEAR_FLOOR
    depth = r[count:] + np.where(away, _FAR * (1 + np.arange(count)), 0.0)
    return np.concatenate([x[:count], np.column_stack([x[:count, 0], -depth])])


def _hollow(
    x: Floats, reach: Floats, r: float, side: float, rng: np.random.Generator
) -> tuple[float, float]:
    """Where a disk of radius r stops that is dropped on others at x (k, 2), r + r_k = reach."""
    at, below, on = rng.random() * side, np.inf, -1
    while True:
        along = (x[:, 0] - at + 0.5 * side) % side - 0.5 * side
        under = (np.abs(along) < reach) & (np.arange(len(x)) != on)
        top = x[:, 1] + np.sqrt(np.where(under, reach**2 - along**2, 0.0))
        under &= top <= below
        if not under.any():
            return at, r
        on = int(np.argmax(np.where(under, top, -np.inf)))
        height, way, before = top[on], 1.0 if along[on] < 0 else -1.0, -1
        while True:  # roll down disk `on`, angles from the vertical
            along = way * ((x[:, 0] - x[on, 0] + 0.5 * side) % side - 0.5 * side)
            up = x[:, 1] - x[on, 1]
            start = np.arctan2(
                way * ((at - x[on, 0] + 0.5 * side) % side - 0.5 * side), height - x[on, 1]
            )
            far = np.hypot(along, up)
            with np.errstate(divide="ignore", invalid="ignore"):
                cosine = (far**2 + reach[on] ** 2 - reach**2) / (2 * far * reach[on])
                hit = np.arctan2(along, up) - np.arccos(cosine)
            met = (np.abs(cosine) <= 1) & (hit >= start - 1e-9)
            met[[on, before] if before >= 0 else [on]] = False
            hit = np.where(met, hit, np.inf)
            floor = np.arccos(np.clip((r - x[on, 1]) / reach[on], -1.0, 1.0))
            end = min(float(hit.min()), float(floor), 0.5 * np.pi)
            at = (x[on, 0] + way * reach[on] * np.sin(end)) % side
            height = x[on, 1] + reach[on] * np.cos(end)
            if end == floor:
                return at, r
            if end == 0.5 * np.pi:
                below = height
                break
            other = int(np.argmin(hit))
            if along[other] > reach[on] * np.sin(end):
                return at, height
            on, before = other, on
