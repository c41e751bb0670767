"""The schema: every array that granforce stores, declared once, and packings as datasets."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from granforce.records import Contacts, Packing, Shapes

if TYPE_CHECKING:  # no kernels needed to read a store
    from granforce.forces.ensemble import Ensemble


class Variable(NamedTuple):
    """One row of the schema: the meaning of an array of this name, in every dataset."""

    dims: tuple[str, ...]
    dtype: str
    units: str
    long_name: str


def _real(dims: str, units: str, long_name: str) -> Variable:
    """A row of real numbers; dims: names separated by blanks."""
    return Variable(tuple(dims.split()), "float64", units, long_name)


def _whole(dims: str, long_name: str) -> Variable:
    """A row of whole numbers: counts, positions and flags."""
    return Variable(tuple(dims.split()), "int64", "1", long_name)


_CONTACT_ARRAYS = ("contact_i", "contact_j", *Contacts._fields[2:])
_SHAPE_ARRAYS = ("corners", "sides", "mass", "inertia")
_COMPONENT, _SCALE = "components f_n, f_t", "mean normal force"

VARIABLES: dict[str, Variable] = {
    # the packing
    "x": _real("grain axis", "length", "centres of the grains"),
    "r": _real("grain", "length", "radii of the grains"),
    "box": _real("axis", "length", "box sides, infinite where open"),
    "tilt": _real("", "length", "tilt of the cell: x component of its upper side b"),
    "mu": _real("", "1", "friction coefficient μ"),
    "pressure": _real("", "force/length", "pressure P0, NaN where not prescribed"),
    "load": _real("grain load_component", "force; force*length", "load F_x, F_y; torque"),
    "contact_i": _whole("contact", "first grain i of the contact"),
    "contact_j": _whole("contact", "second grain j of the contact"),
    "normal": _real("contact axis", "1", "unit normal from i to j"),
    "length": _real("contact", "length", "centre distance ℓ"),
    "gap": _real("contact", "length", "gap ℓ − r_i − r_j"),
    "arm_i": _real("contact", "length", "lever arm from i to the contact point"),
    "arm_j": _real("contact", "length", "lever arm from j to the contact point"),
    "levers": _real("contact end", "length", "offset along t of the contact point, from i and j"),
    "friction_ratio": _real("contact", "1", "friction coefficient over μ"),
    "forces": _real("contact component", "force", f"original force network, {_COMPONENT}"),
    "corners": _real("corner axis", "length", "corners of all polygons, body by body"),
    "sides": _whole("grain", "number of corners of the body, 0 for a disk"),
    "mass": _real("grain", "mass", "masses of the bodies"),
    "inertia": _real("grain", "mass*length**2", "moments of inertia of the bodies"),
    # states of the ensemble: the contact dimension is that of the backbone
    "backbone": _whole("contact", "position of the contact in the packing"),
    "states": _real("state contact component", "force", f"admissible networks, {_COMPONENT}"),
    "residual": _real("state", _SCALE, "largest unbalance"),
    "violation": _real("state", _SCALE, "largest cone violation"),
    "sweeps": _whole("state", "solver sweeps or iterations spent"),
    "attempts": _whole("state", "attempts until the state was accepted"),
    "mean_sweeps": _real("", "1", "solver sweeps per state, failures included"),
    "distance_to_centre": _real("state", _SCALE, "distance from the centre of the ensemble"),
    "chain": _whole("state", "chain that the state belongs to"),
    # whether chains mixed: NaN for components that cannot vary
    "r_hat": _real("contact component", "1", f"split R̂, {_COMPONENT}"),
    "bulk_size": _real("contact component", "1", f"bulk effective sample size, {_COMPONENT}"),
    "tail_size": _real("contact component", "1", f"tail effective sample size, {_COMPONENT}"),
    "worst_r_hat": _real("", "1", "largest split R̂ of any component"),
    "least_bulk_size": _real("", "1", "smallest bulk effective sample size"),
    "least_tail_size": _real("", "1", "smallest tail effective sample size"),
    "reached": _whole("", "1 if the chains mixed and reached the requested effective size"),
    "turns": _whole("", "reflections of the billiard walk"),
    "refused": _whole("", "paths discarded because of too many reflections"),
    "dropped": _whole("", "states discarded while the chains warmed up"),
    "held": _whole("", "coordinates f_n ± f_t/μ that are zero in all of S"),
    "setup_seconds": _real("", "s", "wall time before the first step"),
    "sampling_seconds": _real("", "s", "wall time of the steps"),
    # a measurement, and the inferred forces
    "grain_id": _real("grain", "1", "name in the files; below 0: a wall"),
    "regional_stress": _real(
        "region stress_component", "force/length", "stress xx, yy, xy by region"
    ),
    "regional_stress_error": _real("region stress_component", "force/length", "its standard error"),
    "added": _whole("contact", "1 if the contact is not listed in the files"),
    "measured": _real("contact component", "force", f"measured forces, {_COMPONENT}"),
    "sigma": _real(
        "contact component", "force", f"standard errors of measured forces, {_COMPONENT}"
    ),
    "inferred": _real("contact component", "force", f"likeliest admissible network, {_COMPONENT}"),
    "deviation": _real("contact component", "1", f"(inferred − measured)/σ, {_COMPONENT}"),
    "expected": _real("contact component", "force", f"mean of the draws, {_COMPONENT}"),
    "standard_error": _real(
        "contact component", "force", f"standard deviation of the draws, {_COMPONENT}"
    ),
    "least_normal": _real(
        "contact", "force", "least f_n over all networks within 3 σ of the measured"
    ),
    "suspect": _whole("beyond", "contacts in the packing beyond 3 σ"),
    "chi_square": _real("", "1", "χ² of the likeliest network"),
    "freedom": _whole("", "degrees of freedom of χ²"),
    "unmeasured": _real("", _SCALE, "standard error with which unmeasured forces count as 0"),
    "bounded": _whole("", "1 if S is bounded, 0 if only `unmeasured` limits some forces"),
    # results from a set of states: bounds seen, measures, cost
    "original": _real("contact component", "force", f"the packing's own network, {_COMPONENT}"),
    "low": _real("contact component", "force", f"smallest value, {_COMPONENT}"),
    "high": _real("contact component", "force", f"largest value, {_COMPONENT}"),
    "eta1": _real("", "1", "indeterminacy η1 = ⟨δF⟩/⟨|G|⟩"),
    "eta2": _real("", "1", "indeterminacy η2 from pairs of states"),
    "eta3": _real("", "1", "indeterminacy η3 from intervals"),
    "correlation": _real("", "1", "corr(f_n, ΔF_n) of the original network"),
    "correlation_low": _real("", "1", "smallest corr(f_n, ΔF_n) of any state"),
    "correlation_high": _real("", "1", "largest corr(f_n, ΔF_n) of any state"),
    "interval_gap": _real("contact component side", _SCALE, "duality gap of the bounds"),
    "cluster": _whole("contact", "cluster of undetermined contacts, −1 where determined"),
    "position": _real("contact", "1", "place of the original f_n in its interval, 0 to 1"),
    # which measurement is most informative
    "part_expected": _real(
        "contact", "1", "expected fraction by which errors of f_n fall once this f_n is known"
    ),
    "mean_before": _real("", _SCALE, "mean interval of f_n"),
    "mean_after": _real(
        "contact", _SCALE, "mean interval of f_n once f_n of this contact is known"
    ),
    "limit_load": _real("contact", "force", "limit load of a normal force pair"),
    "load_gap": _real("contact", _SCALE, "duality gap of the limit loads"),
    # the response to a force pair on one contact
    "critical_low": _real("contact", "force", "F_crit: largest load at rest"),
    "critical_high": _real("contact", "force", "smallest load not at rest, or the limit load"),
    "load_residual": _real("contact", _SCALE, "unbalance under the largest load at rest"),
    "load_violation": _real("contact", _SCALE, "cone violation under the largest load at rest"),
    "motion_breach": _real("contact", "1", "violation of Coulomb's law by the first motion"),
    "pair_opening": _real("contact", "1", "opening of the contact, rms |u| = 1"),
    "opened": _whole("contact", "contacts that the first motion opens"),
    "slid": _whole("contact", "contacts that slide in the first motion"),
    "kept": _whole("contact", "contacts that stick in the first motion"),
    "loads_at_rest": _whole("contact", "loads that ended at rest"),
    "loads_moving": _whole("contact", "loads that ended in steady motion"),
    "loads_undecided": _whole("contact", "loads that ended in unsteady motion"),
    "flow_steps": _whole("contact", "implicit steps of the flow"),
    "linear_systems": _whole("contact", "linear systems solved"),
    "contact_seconds": _real("contact", "s", "wall time of the critical force"),
    "displacement": _real("contact grain axis", "1", "first motion u, rms 1; NaN for rattlers"),
    "shell_radius": _real("shell", "length", "middle of the shell"),
    "profile": _real("contact shell", "1", "mean |u| of the shell's grains"),
    "critical_force": _real("", _SCALE, "mean of F_crit"),
    "decay_exponent": _real("", "1", "exponent α of the mean displacement |u| ~ r^−α"),
    "decay_low": _real("", "1", "lower end of the 95 % interval of α"),
    "decay_high": _real("", "1", "upper end of the 95 % interval of α"),
    "fit_inner": _real("fit", "length", "smallest r of other fits"),
    "fit_outer": _real("fit", "length", "largest r of other fits"),
    "fit_exponent": _real("fit", "1", "α of other fits"),
    # the number of networks: forces of every contact in ⟨f_n⟩
    "log_volume": _real("", "1", "ln V, the h-dimensional volume of S"),
    "log_volume_error": _real("", "1", "standard error of ln V"),
    "log_volume_ladders": _real("ladder", "1", "ln V from the ladder down and the ladder up"),
    "log_volume_per_grain": _real("", "1", "ln V per grain of the backbone"),
    "extent": _real("", _SCALE, "extent V^(1/h)/√(2πe) of S per free dimension"),
    # the outline of S in a plane of force space
    "axes": _real("plane_axis contact component", "1", f"axes of the plane, {_COMPONENT}"),
    "inner": _real("inner_corner plane_axis", _SCALE, "polygon inside the outline"),
    "outer": _real("outer_corner plane_axis", _SCALE, "polygon around the outline"),
    "outline_gap": _real("", _SCALE, "largest distance of the polygons of the outline"),
    # stresses that the contacts can carry, in the plane ((σ_xx − σ_yy)/2P, σ_xy/P)
    "stress_angle": _real("angle", "1", "directions θ in the plane of stresses"),
    "stress_support": _real("angle", "1", "largest stress along each direction"),
    "stress_gap": _real("angle", "1", "duality gap of the largest stress"),
    "stress_inner": _real("inner_corner plane_axis", "1", "polygon inside the outline of stresses"),
    "stress_outer": _real("outer_corner plane_axis", "1", "polygon around the outline of stresses"),
    "stress_own": _real("plane_axis", "1", "stress of the original network"),
    "friction": _real("", "1", "largest shear stress over pressure"),
    "friction_bound": _real(
        "", "1", "certified upper bound on the largest shear stress over pressure"
    ),
    "programs": _whole("", "linear programs solved"),
    "max_gap": _real("", _SCALE, "largest duality gap"),
    "packing_fraction": _real("", "1", "packing fraction φ, rattlers included"),
    "coordination": _real("", "1", "mean coordination number z of the backbone"),
    "dimension": _whole("", "dimension h of the ensemble"),
    "flat_directions": _whole("", "directions too narrow to be resolved, taken as pinned"),
    "resolution": _real("", _SCALE, "width up to which directions are taken as pinned"),
    "force_scale": _real("", "force", "mean normal force ⟨f_n⟩"),
    "original_distance": _real("", _SCALE, "distance of the original network from the centre"),
    "acceptance": _real("", "1", "fraction of attempts that were accepted"),
    "accepted": _whole("", "number of accepted attempts"),
    "rejected": _whole("", "attempts that found no equilibrium"),
    "unconverged": _whole("", "attempts that ran out of iterations"),
    "skipped": _whole("", "states that needed no relaxation (h = 0)"),
    "rattlers": _whole("", "grains outside the backbone"),
    "unloaded_contacts": _whole("", "contacts that cannot carry force"),
    "tangential_unknowns": _whole("", "tangential unknowns dropped at μ = 0"),
    "seconds": _real("", "s", "wall time of the computation"),
}

# The reduced study: one row per cell, with scalars of its dataset, and samples of its contacts.
ROW_SCALARS = (
    *("eta1", "eta2", "eta3", "correlation", "correlation_low", "correlation_high"),
    *("coordination", "dimension", "packing_fraction", "acceptance", "original_distance"),
    *("residual", "max_gap", "worst_r_hat", "least_bulk_size", "mean_sweeps", "seconds"),
    *("critical_force", "decay_exponent", "decay_low", "decay_high", "friction"),
    *("log_volume", "log_volume_error", "log_volume_per_grain", "extent"),
)

VARIABLES |= {
    **{
        f"row_{name}": _real("row", VARIABLES[name].units, VARIABLES[name].long_name)
        for name in ("mu", *ROW_SCALARS)
    },
    "row_part": _whole("row", "part of the study, a position in attrs' parts"),
    "row_n": _whole("row", "number of disks"),
    "row_seed": _whole("row", "seed of the packing"),
    "row_version": _real("row", "1", "version of the kind of result"),
    "row_packing_version": _real("row", "1", "version of the algorithm that made the packing"),
    "row_packing_mu": _real("row", "1", "friction with which the packing was made, if not μ"),
    "row_contacts": _real("row", "1", "number of contacts that carry force"),
    "row_mean_extent": _real("row", _SCALE, "⟨ΔF_n⟩ over contacts"),
    "row_mean_length": _real("row", _SCALE, "mean length of the intervals of all components"),
    "row_excess": _real("row", _SCALE, "mean length of seen intervals outside the exact ones"),
    "row_mean_distance": _real("row", _SCALE, "mean distance of states from their centre"),
    "row_reached_part": _real("row", "1", "fraction of the requested states that the walk reached"),
    "row_skipped_part": _real("row", "1", "fraction of states not relaxed because S is one point"),
    "row_pair_spread": _real("row", "1", "standard deviation over mean of distances between pairs"),
    "row_undetermined": _real("row", "1", "contacts without a unique force"),
    "row_undetermined_part": _real(
        "row", "1", "fraction of carrying contacts without a unique force"
    ),
    "row_original_ratio": _real(
        "row", "1", "distance of the original network over that of uniform states"
    ),
    "row_walk_ratio": _real("row", "1", "mean distance of walk states over that of uniform states"),
    "row_limit_load": _real("row", _SCALE, "mean limit load of the contacts"),
    "row_own_shear": _real("row", "1", "shear stress over pressure of the original network"),
    "row_mean_shear": _real("row", "1", "mean shear stress over pressure of uniform states"),
    "row_largest_shear": _real("row", "1", "largest shear stress over pressure of uniform states"),
    "row_clusters": _real("row", "1", "clusters of undetermined contacts"),
    "row_largest_cluster": _real("row", "1", "contacts of the largest cluster"),
    "decay_row": _whole("decay", "row that the shell belongs to"),
    "decay_radius": _real("decay", "1", "middle of the shell, in mean diameters"),
    "decay_size": _real("decay", "1", "mean |u| of the shell over contacts"),
    "tail_row": _whole("tail", "row that the forces belong to"),
    "tail_force": _real("tail_bin", _SCALE, "upper edges of bins of f_n"),
    "tail_count": _real("tail tail_bin", "1", "forces f_n of uniform states in each bin"),
    "sample_row": _whole("sample", "row that the contact belongs to"),
    "sample_contact": _whole("sample", "position of the contact in the packing"),
    "sample_normal": _real("sample", _SCALE, "original f_n"),
    "sample_least": _real("sample", _SCALE, "least f_n"),
    "sample_extent": _real("sample", _SCALE, "ΔF_n"),
    "shown_row": _whole("shown", "row that the shown contact belongs to"),
    "shown_normal": _real("shown_state shown", _SCALE, "f_n in some states"),
    "shown_count": _whole("shown ratio", "states of the walk by f_n over its original value"),
}


def extension(S: Ensemble) -> dict[str, Any]:
    """The dimension of S, and the number of directions too narrow to count."""
    return {
        "dimension": S.dimension,
        "flat_directions": S.flat_directions,
        "resolution": S.hull.resolution,
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
    """The schema's row for this name; ValueError if there is none."""
    if name not in VARIABLES:
        raise ValueError(f"{name!r} is not declared: add a row to granforce.study.schema.VARIABLES")
    return VARIABLES[name]


def packing_dataset(packing: Packing) -> xr.Dataset:
    """A Packing as a dataset with dims grain, contact, axis, component; info as JSON in attrs."""
    arrays = packing._asdict()
    info, contacts = arrays.pop("info"), arrays.pop("contacts")
    arrays |= zip(_CONTACT_ARRAYS, contacts, strict=True)
    arrays |= zip(_SHAPE_ARRAYS, arrays.pop("shapes") or (), strict=False)
    given = {name: values for name, values in arrays.items() if values is not None}
    return labelled(given, {"info": json.dumps(info, default=to_builtin)})


def dataset_packing(dataset: xr.Dataset) -> Packing:
    """The Packing from which packing_dataset made this dataset, bit by bit.

    Tuples in info are returned as lists.
    """
    arrays = {name: dataset[name].values for name in ("x", "r", "box", "forces", "load")}
    values = {name: dataset[name].values if name in dataset else None for name in _CONTACT_ARRAYS}
    shaped = "mass" in dataset
    return Packing(
        contacts=Contacts._make(values[name] for name in _CONTACT_ARRAYS),
        shapes=Shapes(*(dataset[name].values for name in _SHAPE_ARRAYS)) if shaped else None,
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
