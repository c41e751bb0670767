"""The schema: every array that granforce keeps, declared once, and packings as datasets."""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from granforce.records import Contacts, Packing


class Variable(NamedTuple):
    """One row of the schema: what an array of this name is, in every dataset."""

    dims: tuple[str, ...]
    dtype: str
    units: str
    long_name: str


_CONTACT_ARRAYS = ("contact_i", "contact_j", *Contacts._fields[2:])
_COMPONENT = "components f_n, f_t"

VARIABLES: dict[str, Variable] = {
    # the packing
    "x": Variable(("grain", "axis"), "float64", "length", "centres of the grains"),
    "r": Variable(("grain",), "float64", "length", "radii of the grains"),
    "box": Variable(("axis",), "float64", "length", "box sides, infinite where open"),
    "tilt": Variable((), "float64", "length", "tilt of the cell: x component of its upper side b"),
    "mu": Variable((), "float64", "1", "friction coefficient μ"),
    "pressure": Variable((), "float64", "force/length", "pressure P0, NaN where not prescribed"),
    "load": Variable(
        ("grain", "load_component"), "float64", "force; force*length", "load F_x, F_y; torque"
    ),
    "contact_i": Variable(("contact",), "int64", "1", "first grain i of the contact"),
    "contact_j": Variable(("contact",), "int64", "1", "second grain j of the contact"),
    "normal": Variable(("contact", "axis"), "float64", "1", "unit normal from i to j"),
    "length": Variable(("contact",), "float64", "length", "centre distance ℓ"),
    "gap": Variable(("contact",), "float64", "length", "gap ℓ − r_i − r_j"),
    "arm_i": Variable(("contact",), "float64", "length", "lever arm from i to the contact point"),
    "arm_j": Variable(("contact",), "float64", "length", "lever arm from j to the contact point"),
    "forces": Variable(
        ("contact", "component"), "float64", "force", f"original force network, {_COMPONENT}"
    ),
    # states of the ensemble: the contact dimension is that of the backbone
    "backbone": Variable(("contact",), "int64", "1", "position of the contact in the packing"),
    "states": Variable(
        ("state", "contact", "component"), "float64", "force", f"admissible networks, {_COMPONENT}"
    ),
    "residual": Variable(("state",), "float64", "mean normal force", "largest unbalance"),
    "violation": Variable(("state",), "float64", "mean normal force", "largest cone violation"),
    "sweeps": Variable(("state",), "int64", "1", "solver sweeps or iterations spent"),
    "attempts": Variable(("state",), "int64", "1", "attempts until the state was accepted"),
    "mean_sweeps": Variable((), "float64", "1", "solver sweeps per state, failures included"),
    "distance_to_centre": Variable(
        ("state",), "float64", "mean normal force", "distance from the centre of the ensemble"
    ),
    "chain": Variable(("state",), "int64", "1", "chain that the state belongs to"),
    # whether chains mixed: NaN where a component cannot vary
    "r_hat": Variable(("contact", "component"), "float64", "1", f"split R̂, {_COMPONENT}"),
    "bulk_size": Variable(
        ("contact", "component"), "float64", "1", f"bulk effective sample size, {_COMPONENT}"
    ),
    "tail_size": Variable(
        ("contact", "component"), "float64", "1", f"tail effective sample size, {_COMPONENT}"
    ),
    "worst_r_hat": Variable((), "float64", "1", "largest split R̂ of any component"),
    "least_bulk_size": Variable((), "float64", "1", "smallest bulk effective sample size"),
    "least_tail_size": Variable((), "float64", "1", "smallest tail effective sample size"),
    "reached": Variable((), "int64", "1", "1 where chains mixed to the effective size wanted"),
    "turns": Variable((), "int64", "1", "reflections of the billiard walk"),
    "refused": Variable((), "int64", "1", "paths with too many reflections, not taken"),
    "dropped": Variable((), "int64", "1", "states left out while chains warmed up"),
    "held": Variable((), "int64", "1", "cone coordinates that are zero in all of the ensemble"),
    "setup_seconds": Variable((), "float64", "s", "wall time until the first step"),
    "sampling_seconds": Variable((), "float64", "s", "wall time of the steps"),
    # a measurement, and what S makes of it
    "grain_id": Variable(("grain",), "float64", "1", "name in the files; below 0: a wall"),
    "regional_stress": Variable(
        ("region", "stress_component"), "float64", "force/length", "stress xx, yy, xy by region"
    ),
    "regional_stress_error": Variable(
        ("region", "stress_component"), "float64", "force/length", "its standard error"
    ),
    "added": Variable(("contact",), "int64", "1", "1 where the contact was not listed"),
    "measured": Variable(
        ("contact", "component"), "float64", "force", f"measured forces, {_COMPONENT}"
    ),
    "sigma": Variable(
        ("contact", "component"), "float64", "force", f"their standard errors, {_COMPONENT}"
    ),
    "inferred": Variable(
        ("contact", "component"), "float64", "force", f"likeliest admissible network, {_COMPONENT}"
    ),
    "deviation": Variable(
        ("contact", "component"), "float64", "1", f"(inferred − measured)/σ, {_COMPONENT}"
    ),
    "expected": Variable(
        ("contact", "component"), "float64", "force", f"mean of the draws, {_COMPONENT}"
    ),
    "standard_error": Variable(
        ("contact", "component"), "float64", "force", f"standard deviation of them, {_COMPONENT}"
    ),
    "least_normal": Variable(
        ("contact",), "float64", "force", "least f_n over all networks within 3 σ of the measured"
    ),
    "suspect": Variable(("beyond",), "int64", "1", "contacts in the packing beyond 3 σ"),
    "chi_square": Variable((), "float64", "1", "χ² of the likeliest network"),
    "freedom": Variable((), "int64", "1", "degrees of freedom of χ²"),
    # what a set of states says: bounds seen, measures, and what it took
    "original": Variable(
        ("contact", "component"), "float64", "force", f"the packing's own network, {_COMPONENT}"
    ),
    "low": Variable(("contact", "component"), "float64", "force", f"smallest value, {_COMPONENT}"),
    "high": Variable(("contact", "component"), "float64", "force", f"largest value, {_COMPONENT}"),
    "eta1": Variable((), "float64", "1", "indeterminacy η1 = ⟨δF⟩/⟨|G|⟩"),
    "eta2": Variable((), "float64", "1", "indeterminacy η2 from pairs of states"),
    "eta3": Variable((), "float64", "1", "indeterminacy η3 from intervals"),
    "correlation": Variable((), "float64", "1", "corr(f_n, ΔF_n) of the original network"),
    "correlation_low": Variable((), "float64", "1", "smallest corr(f_n, ΔF_n) of any state"),
    "correlation_high": Variable((), "float64", "1", "largest corr(f_n, ΔF_n) of any state"),
    "interval_gap": Variable(
        ("contact", "component", "side"),
        "float64",
        "mean normal force",
        "duality gap of the bounds",
    ),
    "cluster": Variable(
        ("contact",), "int64", "1", "cluster of undetermined contacts, −1 where determined"
    ),
    "position": Variable(
        ("contact",), "float64", "1", "place of the original f_n in its interval, 0 to 1"
    ),
    # which measurement would tell most
    "part_expected": Variable(
        ("contact",), "float64", "1", "part by which errors of f_n fall once this one is known"
    ),
    "mean_before": Variable((), "float64", "mean normal force", "mean interval of f_n"),
    "mean_after": Variable(
        ("contact",), "float64", "mean normal force", "the same once f_n of this one is known"
    ),
    "limit_load": Variable(("contact",), "float64", "force", "limit load of a normal force pair"),
    "load_gap": Variable(
        ("contact",), "float64", "mean normal force", "duality gap of the limit loads"
    ),
    # the answer to a force pair on one contact
    "critical_low": Variable(("contact",), "float64", "force", "F_crit: largest load at rest"),
    "critical_high": Variable(
        ("contact",), "float64", "force", "least load not at rest, or the limit load"
    ),
    "load_residual": Variable(
        ("contact",), "float64", "mean normal force", "unbalance under the largest load at rest"
    ),
    "load_violation": Variable(
        ("contact",), "float64", "mean normal force", "cone violation under that load"
    ),
    "motion_breach": Variable(
        ("contact",), "float64", "1", "breach of Coulomb's law by the first motion"
    ),
    "pair_opening": Variable(("contact",), "float64", "1", "opening of the contact, rms |u| = 1"),
    "opened": Variable(("contact",), "int64", "1", "contacts that the first motion opens"),
    "slid": Variable(("contact",), "int64", "1", "contacts that slide in the first motion"),
    "kept": Variable(("contact",), "int64", "1", "contacts that stick in the first motion"),
    "loads_at_rest": Variable(("contact",), "int64", "1", "loads that ended at rest"),
    "loads_moving": Variable(("contact",), "int64", "1", "loads that ended in steady motion"),
    "loads_undecided": Variable(
        ("contact",), "int64", "1", "loads that ended in motion not yet steady"
    ),
    "flow_steps": Variable(("contact",), "int64", "1", "implicit steps of the flow"),
    "linear_systems": Variable(("contact",), "int64", "1", "linear systems solved"),
    "contact_seconds": Variable(("contact",), "float64", "s", "wall time of the critical force"),
    "displacement": Variable(
        ("contact", "grain", "axis"), "float64", "1", "first motion u, rms 1; NaN for rattlers"
    ),
    "shell_radius": Variable(("shell",), "float64", "length", "middle of the shell"),
    "profile": Variable(("contact", "shell"), "float64", "1", "mean |u| of the shell's grains"),
    "critical_force": Variable((), "float64", "mean normal force", "mean of F_crit"),
    "decay_exponent": Variable((), "float64", "1", "α of mean |u| ~ r^−α"),
    "decay_low": Variable((), "float64", "1", "lower end of the 95 % interval of α"),
    "decay_high": Variable((), "float64", "1", "upper end of the 95 % interval of α"),
    "fit_inner": Variable(("fit",), "float64", "length", "smallest r of other fits"),
    "fit_outer": Variable(("fit",), "float64", "length", "largest r of other fits"),
    "fit_exponent": Variable(("fit",), "float64", "1", "α of other fits"),
    # how many networks there are: forces of every contact in ⟨f_n⟩
    "log_volume": Variable((), "float64", "1", "ln V, the h-dimensional volume of S"),
    "log_volume_error": Variable((), "float64", "1", "standard error of ln V"),
    "log_volume_ladders": Variable(("ladder",), "float64", "1", "ln V on the ways down and up"),
    "log_volume_per_grain": Variable((), "float64", "1", "ln V per grain of the backbone"),
    "extent": Variable(
        (), "float64", "mean normal force", "extent V^(1/h)/√(2πe) of S per free dimension"
    ),
    # the outline of S in a plane of force space
    "axes": Variable(
        ("plane_axis", "contact", "component"), "float64", "1", f"axes of the plane, {_COMPONENT}"
    ),
    "inner": Variable(
        ("inner_corner", "plane_axis"), "float64", "mean normal force", "polygon inside the outline"
    ),
    "outer": Variable(
        ("outer_corner", "plane_axis"), "float64", "mean normal force", "polygon around the outline"
    ),
    "outline_gap": Variable(
        (), "float64", "mean normal force", "largest distance of the polygons of the outline"
    ),
    # stresses that the contacts can carry, in the plane ((σ_xx − σ_yy)/2P, σ_xy/P)
    "stress_angle": Variable(("angle",), "float64", "1", "directions θ in the plane of stresses"),
    "stress_support": Variable(("angle",), "float64", "1", "largest stress along each direction"),
    "stress_gap": Variable(("angle",), "float64", "1", "duality gap of the largest stress"),
    "stress_inner": Variable(
        ("inner_corner", "plane_axis"), "float64", "1", "polygon inside the outline of stresses"
    ),
    "stress_outer": Variable(
        ("outer_corner", "plane_axis"), "float64", "1", "polygon around the outline of stresses"
    ),
    "stress_own": Variable(("plane_axis",), "float64", "1", "stress of the original network"),
    "friction": Variable((), "float64", "1", "largest shear stress over pressure"),
    "friction_bound": Variable((), "float64", "1", "what that certainly does not exceed"),
    "programs": Variable((), "int64", "1", "linear programs solved"),
    "max_gap": Variable((), "float64", "mean normal force", "largest duality gap"),
    "packing_fraction": Variable((), "float64", "1", "packing fraction φ, rattlers included"),
    "coordination": Variable((), "float64", "1", "mean coordination number z of the backbone"),
    "dimension": Variable((), "int64", "1", "dimension h of the ensemble"),
    "force_scale": Variable((), "float64", "force", "mean normal force ⟨f_n⟩"),
    "original_distance": Variable(
        (), "float64", "mean normal force", "distance of the original network from the centre"
    ),
    "acceptance": Variable((), "float64", "1", "accepted states per attempt"),
    "accepted": Variable((), "int64", "1", "attempts that gave a new state"),
    "rejected": Variable((), "int64", "1", "attempts that ended in no equilibrium"),
    "unconverged": Variable((), "int64", "1", "attempts that ran out of iterations"),
    "skipped": Variable((), "int64", "1", "states that needed no relaxation (h = 0)"),
    "rattlers": Variable((), "int64", "1", "grains outside the backbone"),
    "unloaded_contacts": Variable((), "int64", "1", "contacts that can carry nothing"),
    "tangential_unknowns": Variable((), "int64", "1", "tangential unknowns dropped at μ = 0"),
    "seconds": Variable((), "float64", "s", "wall time of the computation"),
}

# The reduced study: one row per cell, with scalars of its dataset, and samples of its contacts.
ROW_SCALARS = (
    *("eta1", "eta2", "eta3", "correlation", "correlation_low", "correlation_high"),
    *("coordination", "dimension", "packing_fraction", "acceptance", "original_distance"),
    *("residual", "max_gap", "worst_r_hat", "least_bulk_size", "mean_sweeps", "seconds"),
    *("critical_force", "decay_exponent", "decay_low", "decay_high", "friction"),
    *("log_volume", "log_volume_error", "log_volume_per_grain", "extent"),
)
_FORCE = "mean normal force"

VARIABLES |= {
    **{
        f"row_{name}": Variable(
            ("row",), "float64", VARIABLES[name].units, VARIABLES[name].long_name
        )
        for name in ("mu", *ROW_SCALARS)
    },
    "row_part": Variable(("row",), "int64", "1", "part of the study, a position in attrs' parts"),
    "row_n": Variable(("row",), "int64", "1", "number of disks"),
    "row_seed": Variable(("row",), "int64", "1", "seed of the packing"),
    "row_contacts": Variable(("row",), "float64", "1", "number of contacts that carry"),
    "row_mean_extent": Variable(("row",), "float64", _FORCE, "⟨ΔF_n⟩ over contacts"),
    "row_mean_distance": Variable(
        ("row",), "float64", _FORCE, "mean distance of states from their centre"
    ),
    "row_reached_part": Variable(
        ("row",), "float64", "1", "states that the walk reached, of those wanted"
    ),
    "row_skipped_part": Variable(
        ("row",), "float64", "1", "states that are the one point that S is, of all"
    ),
    "row_pair_spread": Variable(
        ("row",), "float64", "1", "standard deviation over mean of distances between pairs"
    ),
    "row_undetermined": Variable(("row",), "float64", "1", "contacts without a unique force"),
    "row_undetermined_part": Variable(("row",), "float64", "1", "their part of all that carry"),
    "row_original_ratio": Variable(
        ("row",), "float64", "1", "distance of the original network over that of uniform states"
    ),
    "row_walk_ratio": Variable(
        ("row",), "float64", "1", "mean distance of walk states over that of uniform states"
    ),
    "row_limit_load": Variable(("row",), "float64", _FORCE, "mean limit load of the contacts"),
    "row_own_shear": Variable(
        ("row",), "float64", "1", "shear stress over pressure of the original network"
    ),
    "row_mean_shear": Variable(
        ("row",), "float64", "1", "mean shear stress over pressure of uniform states"
    ),
    "row_largest_shear": Variable(("row",), "float64", "1", "the largest of them"),
    "row_clusters": Variable(("row",), "float64", "1", "clusters of undetermined contacts"),
    "row_largest_cluster": Variable(("row",), "float64", "1", "contacts of the largest cluster"),
    "tail_row": Variable(("tail",), "int64", "1", "row that the forces belong to"),
    "tail_force": Variable(("tail_bin",), "float64", _FORCE, "upper edges of bins of f_n"),
    "tail_count": Variable(
        ("tail", "tail_bin"), "float64", "1", "forces f_n of uniform states in each bin"
    ),
    "sample_row": Variable(("sample",), "int64", "1", "row that the contact belongs to"),
    "sample_contact": Variable(("sample",), "int64", "1", "position of the contact in the packing"),
    "sample_normal": Variable(("sample",), "float64", _FORCE, "original f_n"),
    "sample_least": Variable(("sample",), "float64", _FORCE, "least f_n"),
    "sample_extent": Variable(("sample",), "float64", _FORCE, "ΔF_n"),
    "shown_row": Variable(("shown",), "int64", "1", "row that the shown contact belongs to"),
    "shown_normal": Variable(("shown_state", "shown"), "float64", _FORCE, "f_n in some states"),
    "shown_count": Variable(
        ("shown", "ratio"), "int64", "1", "states of the walk by f_n over its original value"
    ),
}


def labelled(arrays: Mapping[str, Any], attrs: Mapping[str, Any] | None = None) -> xr.Dataset:
    """A dataset from {name: array-like}, with dims, dtype, units and long_name from VARIABLES.

    Raises ValueError for an undeclared name or a wrong number of dimensions.
    """
    variables = {}
    for name, values in arrays.items():
        row = declared(name)
        described = {"units": row.units, "long_name": row.long_name}
        array = np.asarray(values, dtype=row.dtype)
        if array.ndim != len(row.dims):
            raise ValueError(f"{name!r} must have dims {row.dims}, got shape {array.shape}")
        variables[name] = xr.Variable(row.dims, array, described)
    return xr.Dataset(variables, attrs=attrs)


def declared(name: str) -> Variable:
    """The schema's row for this name; ValueError where there is none."""
    if name not in VARIABLES:
        raise ValueError(f"{name!r} is not declared: add a row to granforce.study.schema.VARIABLES")
    return VARIABLES[name]


def packing_dataset(packing: Packing) -> xr.Dataset:
    """A Packing as a dataset with dims grain, contact, axis, component; info as JSON in attrs."""
    arrays = packing._asdict()
    info, contacts = arrays.pop("info"), arrays.pop("contacts")
    arrays |= zip(_CONTACT_ARRAYS, contacts, strict=True)
    return labelled(arrays, {"info": json.dumps(info, default=to_builtin)})


def dataset_packing(dataset: xr.Dataset) -> Packing:
    """The Packing that packing_dataset made this dataset from, to the last bit.

    Tuples in info come back as lists.
    """
    arrays = {name: dataset[name].values for name in ("x", "r", "box", "forces", "load")}
    return Packing(
        contacts=Contacts(*(dataset[name].values for name in _CONTACT_ARRAYS)),
        mu=float(dataset["mu"]),
        pressure=float(dataset["pressure"]),
        info=json.loads(dataset.attrs["info"]),
        tilt=float(dataset.get("tilt", 0.0)),
        **arrays,
    )


def to_builtin(value: Any) -> Any:
    """Numpy values as plain ones, for json.dumps(default=…)."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"attributes must be plain values, got {type(value).__name__}")
