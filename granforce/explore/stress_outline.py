"""The stresses that a packing's contacts can carry at its pressure: an exact outline in a plane.

A stress of given pressure P is a point ((σ_xx − σ_yy)/2P, σ_xy/P); its distance from the origin is
the ratio of the largest shear stress to the pressure, whatever the directions of the box. Both are
linear in the forces, so that the stresses of S fill a convex polygon.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce import notebook
from granforce.explore.outline import outline, supports
from granforce.fields import record
from granforce.forces.balance import stress_of, stress_rows
from granforce.forces.ensemble import Ensemble
from granforce.quantities import quantity
from granforce.records import InputError, float_array, takes, whole
from granforce.system import cancelling
from granforce.types import Cancel, Floats, Progress

# Largest gap between the polygons, relative to the extent of the outline.
TOLERANCE = 1e-4


@record
class StressOutline(NamedTuple):
    """The stresses of all networks in S, as points ((σ_xx − σ_yy)/2P, σ_xy/P)."""

    angles: Annotated[Floats, quantity("stress_angle", label="angle", unit="rad")]
    support: Annotated[Floats, quantity("stress_support", label="largest", unit="pressure")]
    gap: Annotated[Floats, quantity("stress_gap", label="")]
    inner: Annotated[Floats, quantity("stress_inner", label="", note="stresses of networks in S")]
    outer: Annotated[Floats, quantity("stress_outer", label="", note="of certified half planes")]
    friction: Annotated[float, quantity("friction")]
    friction_bound: Annotated[float, quantity("friction_bound")]
    original: Annotated[Floats, quantity("stress_own", label="")]
    converged: Annotated[bool, "the polygons agree within the tolerance"]
    counts: Annotated[dict[str, int], "as in `Outline`"]

    def _repr_html_(self) -> str:
        """HTML for notebooks."""
        lines = {
            "largest shear stress / pressure": self.friction,
            "of the packing's own network": float(np.hypot(*self.original)),
            "certified upper bound": self.friction_bound,
            **self.counts,
        }
        return notebook.table("Stresses that the contacts can carry", lines)


@takes(Ensemble)
@cancelling.cancellable
def stress_outline(
    ensemble: Ensemble,
    angles: int | npt.ArrayLike = 64,
    *,
    workers: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> StressOutline:
    """The exact outline of the stresses that S can carry at its pressure.

    `stress_plane` gives the points of any networks.

    Parameters
    ----------
    ensemble : Ensemble
        S, at a prescribed pressure.
    angles : int or (k,) array, default 64
        How many, evenly spaced from 0 on, or the angles themselves.
    workers, progress, cancel
        As for `outline`.

    Returns
    -------
    StressOutline
        The largest stress at each angle, and polygons inside and around the outline.

    Raises
    ------
    InputError
        If the pressure is not prescribed, or if the whole stress is.
    """
    if not isinstance(angles, (list, tuple, np.ndarray)):
        count = whole(angles, "the number of angles", 1, 4096)
        angles = 2 * np.pi * np.arange(count) / count
    axes = stress_axes(ensemble)
    angles = float_array(angles, (-1,), "angles")
    if not len(angles):
        raise InputError("give at least one angle")
    support, gap = supports(ensemble, axes, angles, workers=workers)
    polygons = outline(ensemble, axes, tolerance=TOLERANCE, workers=workers, progress=progress)
    friction = np.hypot(*polygons.inner.T).max(initial=0.0)
    bound = np.hypot(*polygons.outer.T).max(initial=0.0) if len(polygons.outer) else np.inf
    original = stress_plane(ensemble, ensemble.original)
    return StressOutline(
        angles,
        support,
        gap,
        polygons.inner,
        polygons.outer,
        float(friction),
        float(bound),
        original,
        polygons.converged,
        polygons.counts,
    )


@takes(Ensemble)
def stress_plane(ensemble: Ensemble, states: Floats) -> Floats:
    """Points of the stresses of networks in the plane ((σ_xx − σ_yy)/2P, σ_xy/P).

    Parameters
    ----------
    ensemble : Ensemble
        S.
    states : (…, N_c, 2) array
        Networks, force.

    Returns
    -------
    (…, 2) array
        NaN without forces.
    """
    return plane_of(stress_of(ensemble.packing, ensemble.expand(states)))


@takes(Ensemble)
@cancelling.cancellable
def admissible_stress(
    ensemble: Ensemble,
    *,
    workers: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Floats:
    """A stress that the contacts can carry at the packing's pressure, well inside the outline.

    Parameters
    ----------
    ensemble : Ensemble
        S.
    workers, progress
        As for `outline`.
    cancel : callable, optional
        Polled; returning True raises Cancelled.

    Returns
    -------
    (3,) array
        σ_xx, σ_yy and σ_xy, force per length, as ``ensemble(packing, prescribed="stress",
        stress=…)`` takes them.

    Raises
    ------
    InputError
        As `stress_outline`.
    """
    axes = stress_axes(ensemble)
    polygons = outline(ensemble, axes, tolerance=TOLERANCE, workers=workers, progress=progress)
    cancelling.check("outline of stresses")
    return stress_inside(polygons.inner, ensemble.packing.pressure)


def stress_inside(corners: Floats, pressure: float) -> Floats:
    """σ_xx, σ_yy and σ_xy (3,) at the mean of corners (n, 2) of an outline of stresses."""
    difference, shear = corners.mean(axis=0)
    return pressure * np.array([1 + difference, 1 - difference, shear])


def plane_of(stresses: Floats) -> Floats:
    """Points (…, 2) of stresses (…, 3), σ_xx, σ_yy and σ_xy; NaN if nothing presses."""
    xx, yy, xy = np.moveaxis(stresses, -1, 0)
    twice = np.where(xx + yy > 0, xx + yy, np.nan)
    return np.stack([xx - yy, 2 * xy], axis=-1) / twice[..., None]


def stress_axes(ensemble: Ensemble) -> Floats:
    """Axes (2, N_c, 2) of the plane of stresses, for forces in ⟨f_n⟩.

    Raises InputError if the pressure is not prescribed, or if the whole stress is.
    """
    if not ensemble.has_pressure_row:
        raise InputError(
            "stresses are outlined at a prescribed pressure, in a periodic box only"
            + ("" if np.isfinite(ensemble.packing.volume) else "; this box is open")
        )
    if ensemble.prescribed == "stress":
        raise InputError("the whole stress is prescribed: prescribe the pressure for an outline")
    packing = ensemble.packing
    xx, yy, xy = stress_rows(ensemble.contacts)
    scale = ensemble.force_scale / (packing.pressure * packing.volume)
    return scale * np.stack([0.5 * (xx - yy), xy])
