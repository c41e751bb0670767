"""How the motion under a force pair decays with distance: |u|(r) and its exponent α.

|u|(r) is averaged over the grains of each shell, then over contacts, with each field scaled to rms
1. α is the least-squares slope of −log⟨|u|⟩ against log r over the shells whose centre is in the
fit range, FIT_INNER mean diameters to FIT_OUTER of the shorter box side (in a tilted cell, of the
distance between images). Its interval comes from resampled contacts, and the exponents of all
FIT_RANGES are reported too.
"""

import itertools
from typing import NamedTuple

import numpy as np

from granforce.measures import statistics
from granforce.records import Packing
from granforce.types import Floats

FIT_INNER, FIT_OUTER = 1.5, 0.4
FIT_RANGES = tuple(itertools.product((1.0, 1.5, 2.0, 3.0), (0.3, 0.4, 0.5)))


class Decay(NamedTuple):
    """The exponent of ⟨|u|⟩ ~ r^−α and its uncertainty."""

    exponent: float  # α
    low: float  # 95 % interval of α, from resampled contacts
    high: float
    fit: tuple[float, float]  # smallest and largest r of the fit, length
    ranges: Floats  # (fits, 2) r ranges of the other fits
    exponents: Floats  # (fits,) their α


def distances(packing: Packing, contact: int) -> Floats:
    """Distance (N,) of every grain from the contact point, by the nearest periodic image."""
    c = packing.contacts
    centre = packing.x[c.i[contact]] + c.arm_i[contact] * c.normal[contact]
    return np.linalg.norm(packing.cell.nearest(packing.x - centre), axis=1)


def shells(packing: Packing) -> Floats:
    """Edges of shells half a mean diameter wide, up to half the distance between images."""
    width = float(packing.r.mean())
    return width * np.arange(int(_side(packing) / 2 / width) + 1, dtype=np.float64)


def _side(packing: Packing) -> float:
    """The shorter side of the box; in a tilted cell the distance between nearest images."""
    if packing.tilt:
        return packing.cell.shortest
    extent = np.where(np.isfinite(packing.box), packing.box, np.ptp(packing.x, axis=0))
    return float(extent.min())


def profile(packing: Packing, displacement: Floats, contact: int, edges: Floats) -> Floats:
    """Mean |u| of the grains in shells around a contact, (shells,); NaN in empty shells.

    displacement (N, 2), NaN for grains to ignore; edges (shells + 1,) in terms of `distances`.
    """
    size = np.linalg.norm(displacement, axis=1)
    known = np.isfinite(size)
    shell = np.searchsorted(edges, distances(packing, contact), side="right") - 1
    known &= (shell >= 0) & (shell < len(edges) - 1)
    total = np.bincount(shell[known], size[known], len(edges) - 1)
    grains = np.bincount(shell[known], minlength=len(edges) - 1)
    return np.where(grains > 0, total / np.maximum(grains, 1), np.nan)


def decay(packing: Packing, radius: Floats, profiles: Floats) -> Decay:
    """The Decay of profiles (contacts, shells) at radii (shells,), the centres of their shells."""
    diameter, side = 2 * float(packing.r.mean()), _side(packing)
    ranges = np.array([(a * diameter, b * side) for a, b in FIT_RANGES])
    fit = FIT_INNER * diameter, FIT_OUTER * side

    def exponent(*rows: Floats) -> float:
        return decay_exponent(radius, np.array(rows), *fit)

    alpha, low, high = statistics.bootstrap(lambda rows: exponent(*rows), [profiles])
    others = np.array([decay_exponent(radius, profiles, *other) for other in ranges])
    return Decay(exponent=alpha, low=low, high=high, fit=fit, ranges=ranges, exponents=others)


def decay_exponent(radius: Floats, profiles: Floats, inner: float, outer: float) -> float:
    """α of ⟨|u|⟩ ~ r^−α over inner ≤ r ≤ outer; radius (shells,), profiles (contacts, shells).

    NaN if fewer than three shells contain grains.
    """
    profiles = np.asarray(profiles)
    known = np.isfinite(profiles).any(axis=0) & (radius >= inner) & (radius <= outer)
    if known.sum() < 3:
        return float("nan")
    mean = np.nanmean(profiles[:, known], axis=0)
    return float(-np.polyfit(np.log(radius[known]), np.log(mean), 1)[0])
