"""What many perturbed contacts say: critical forces, mean |u|(r) and its decay exponent α.

|u|(r) is averaged over the grains of each shell, then over contacts, each field scaled to rms 1.
α is the slope of log⟨|u|⟩ against log r by least squares over the shells whose middle lies in the
fit range, FIT_INNER mean diameters to FIT_OUTER of the shorter box side; its interval comes from
contacts drawn anew, and exponents of all FIT_RANGES are kept beside it.
"""

import itertools
import json

import numpy as np
import xarray as xr

from granforce import perturb, statistics
from granforce.schema import labelled

FIT_INNER, FIT_OUTER = 1.5, 0.4
FIT_RANGES = tuple(itertools.product((1.0, 1.5, 2.0, 3.0), (0.3, 0.4, 0.5)))


def shells(packing):
    """Edges of shells half a mean diameter wide, out to half the shorter side of the box."""
    width = float(packing.r.mean())
    return width * np.arange(int(_side(packing) / 2 / width) + 1)


def _side(packing):
    extent = np.where(np.isfinite(packing.box), packing.box, np.ptp(packing.x, axis=0))
    return float(extent.min())


def contact_dataset(S, contact, limit_load, *, precision, cancel=None):
    """One perturbed contact (position in the packing) as a dataset, its limit load given."""
    critical = perturb.critical_force(
        S, contact, limit_load=limit_load, precision=precision, cancel=cancel
    )
    moved = perturb.response(S, contact, critical=critical, precision=precision)
    edges = shells(S.packing)
    position = np.searchsorted(S.index, contact)
    return labelled(
        {
            "backbone": [contact],
            "limit_load": [critical.limit_load],
            "critical_low": [critical.low],
            "critical_high": [critical.high],
            "load_residual": [critical.residual],
            "load_violation": [critical.violation],
            "motion_breach": [moved.breach],
            "pair_opening": [moved.opening[position]],
            "opened": [moved.opened.sum()],
            "slid": [moved.slid.sum()],
            "kept": [moved.kept.sum()],
            "displacement": moved.displacement[None],
            "shell_radius": (edges[1:] + edges[:-1]) / 2,
            "profile": perturb.profile(S.packing, moved.displacement, contact, edges)[None],
            **{name: [count] for name, count in critical.counts.items()},
            "contact_seconds": [critical.seconds],
        }
    )


def perturbation_dataset(S, parts):
    """The datasets of single contacts as one, with ⟨F_crit⟩, ⟨|u|⟩(r) and α."""
    whole = xr.concat(parts, "contact", data_vars="minimal", coords="minimal", compat="override")
    radius, profiles = whole["shell_radius"].values, whole["profile"].values
    diameter, side = 2 * float(S.packing.r.mean()), _side(S.packing)
    ranges = [(a * diameter, b * side) for a, b in FIT_RANGES]
    chosen = FIT_INNER * diameter, FIT_OUTER * side

    def exponent(*rows):
        return decay_exponent(radius, np.array(rows), *chosen)

    alpha, low, high = statistics.bootstrap(lambda rows: exponent(*rows), [profiles])
    scalars = labelled(
        {
            "critical_force": float(whole["critical_low"].mean()) / S.force_scale,
            "decay_exponent": alpha,
            "decay_low": low,
            "decay_high": high,
            "fit_inner": [a for a, _ in ranges],
            "fit_outer": [b for _, b in ranges],
            "fit_exponent": [decay_exponent(radius, profiles, *fit) for fit in ranges],
            "dimension": S.dimension,
            "force_scale": S.force_scale,
            **S.skipped,
            "seconds": float(whole["contact_seconds"].sum()),
        },
        {"fit_range": json.dumps(chosen)},
    )
    return whole.merge(scalars, combine_attrs="drop_conflicts")


def decay_exponent(radius, profiles, inner, outer):
    """α of ⟨|u|⟩ ~ r^−α over inner ≤ r ≤ outer; radius (shells,), profiles (contacts, shells).

    NaN where fewer than three shells hold grains.
    """
    profiles = np.asarray(profiles)
    known = np.isfinite(profiles).any(axis=0) & (radius >= inner) & (radius <= outer)
    if known.sum() < 3:
        return float("nan")
    mean = np.nanmean(profiles[:, known], axis=0)
    return float(-np.polyfit(np.log(radius[known]), np.log(mean), 1)[0])
