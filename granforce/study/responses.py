"""Perturbed contacts as datasets: critical forces, first motions, |u|(r) and α."""

import json
from collections.abc import Sequence

import numpy as np
import xarray as xr

from granforce.forces.ensemble import Ensemble
from granforce.perturb import critical_force as perturb
from granforce.perturb import decay
from granforce.perturb.critical_force import CriticalForce
from granforce.records import Packing, brief_list
from granforce.study.schema import extension, labelled, stored
from granforce.types import Floats


def contact_dataset(S: Ensemble, critical: CriticalForce, precision: float) -> xr.Dataset:
    """One perturbed contact as a dataset: its CriticalForce, with its `precision`, and response."""
    contact = critical.contact
    above = precision if critical.moving is None else None
    moved = perturb.response(S, contact, critical=critical, precision=above)
    edges = decay.shells(S.packing)
    (position,) = S.positions([contact])
    return labelled(
        {
            **stored(critical),
            **stored(moved),
            "pair_opening": [moved.opening[position]],
            "opened": [moved.opened.sum()],
            "slid": [moved.slid.sum()],
            "kept": [moved.kept.sum()],
            "contact_motion": [moved.slid + 2 * moved.opened],
            "shell_radius": (edges[1:] + edges[:-1]) / 2,
            "profile": decay.profile(S.packing, moved.displacement, contact, edges)[None],
            **{name: [count] for name, count in critical.counts.items()},
        }
    )


def perturbation_dataset(S: Ensemble, parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """The datasets of single contacts as one, with ⟨F_crit⟩, ⟨|u|⟩(r) and α."""
    whole = xr.concat(parts, "contact", data_vars="minimal", coords="minimal", compat="override")
    fit = decay.decay(S.packing, whole["shell_radius"].values, whole["profile"].values)
    scalars = labelled(
        {
            "critical_force": float(whole["critical_low"].mean()) / S.force_scale,
            "decay_exponent": fit.exponent,
            "decay_low": fit.low,
            "decay_high": fit.high,
            "fit_inner": fit.ranges[:, 0],
            "fit_outer": fit.ranges[:, 1],
            "fit_exponent": fit.exponents,
            **extension(S),
            "force_scale": S.force_scale,
            **S.skipped,
            "seconds": float(whole["contact_seconds"].sum()),
        },
        {"fit_range": json.dumps(fit.fit)},
    )
    return whole.merge(scalars, combine_attrs="drop_conflicts")


def unsteady(dataset: xr.Dataset) -> str:
    """A message on contacts without steady motion above their critical force; empty without any."""
    limited = dataset["critical_high"].values >= dataset["limit_load"].values
    steady = dataset["motion_breach"].values <= perturb.STEADY
    contacts = dataset["backbone"].values[~(steady | limited)].tolist()
    return perturb.unsteady(f"contact {brief_list(contacts)}") if contacts else ""


def moved_grains(packing: Packing, dataset: xr.Dataset) -> tuple[Floats, Floats]:
    """Distance (k,) from the first contact's point, and |u| (k,), of the grains that moved."""
    u = dataset["displacement"].values[0]
    counts = np.isfinite(u).all(axis=1)
    distance = decay.distances(packing, dataset["backbone"].values[0])
    return distance[counts], np.linalg.norm(u[counts], axis=1)
