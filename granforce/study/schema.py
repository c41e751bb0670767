"""The schema: every array in the store, as declared in quantities.py, and packings as datasets."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
import xarray as xr

from granforce.fields import fields
from granforce.quantities import MEAN, QUANTITIES, Field, whole
from granforce.records import Contacts, Packing, Shapes

if TYPE_CHECKING:  # no kernels needed to read a store
    from granforce.forces.ensemble import Ensemble

T = TypeVar("T")


class Variable(NamedTuple):
    """One row of the schema: the meaning of an array of this name, in every dataset."""

    dims: tuple[str, ...]
    dtype: str
    units: str
    long_name: str


# The reduced study: one row per cell, with scalars of its dataset, and samples of its contacts.
ROW_SCALARS = (
    *("eta1", "eta2", "eta3", "correlation", "correlation_low", "correlation_high"),
    *("coordination", "dimension", "packing_fraction", "acceptance", "original_distance"),
    *("residual", "max_gap", "worst_r_hat", "least_bulk_size", "mean_sweeps", "seconds"),
    *("critical_force", "decay_exponent", "decay_low", "decay_high", "friction"),
    *("log_volume", "log_volume_error", "log_volume_per_grain", "extent"),
)

_TABLES = {
    **{
        f"row_{name}": QUANTITIES[name]._replace(dims="row", dtype="float64")
        for name in ("mu", *ROW_SCALARS)
    },
    "row_part": whole("row", "part of the study, a position in attrs' parts"),
    "row_n": whole("row", "number of disks"),
    "row_seed": whole("row", "seed of the packing"),
    "row_version": Field("row", "", "version of the kind of result"),
    "row_packing_version": Field("row", "", "version of the algorithm that made the packing"),
    "row_packing_mu": Field("row", "", "friction with which the packing was made, if not μ"),
    "row_contacts": Field("row", "", "number of contacts that carry force"),
    "row_mean_extent": Field("row", MEAN, "⟨ΔF_n⟩ over contacts"),
    "row_mean_length": Field("row", MEAN, "mean length of the intervals of all components"),
    "row_excess": Field("row", MEAN, "mean length of seen intervals outside the exact ones"),
    "row_mean_distance": Field("row", MEAN, "mean distance of states from their centre"),
    "row_reached_part": Field("row", "", "fraction of the requested states that the walk reached"),
    "row_skipped_part": Field("row", "", "fraction of states not relaxed because S is one point"),
    "row_pair_spread": Field("row", "", "standard deviation over mean of distances between pairs"),
    "row_undetermined": Field("row", "", "contacts without a unique force"),
    "row_undetermined_part": Field(
        "row", "", "fraction of carrying contacts without a unique force"
    ),
    "row_original_ratio": Field(
        "row", "", "distance of the original network over that of uniform states"
    ),
    "row_walk_ratio": Field("row", "", "mean distance of walk states over that of uniform states"),
    "row_limit_load": Field("row", MEAN, "mean limit load of the contacts"),
    "row_own_shear": Field("row", "", "shear stress over pressure of the original network"),
    "row_mean_shear": Field("row", "", "mean shear stress over pressure of uniform states"),
    "row_largest_shear": Field("row", "", "largest shear stress over pressure of uniform states"),
    "row_clusters": Field("row", "", "clusters of undetermined contacts"),
    "row_largest_cluster": Field("row", "", "contacts of the largest cluster"),
    "decay_row": whole("decay", "row that the shell belongs to"),
    "decay_radius": Field("decay", "", "middle of the shell, in mean diameters"),
    "decay_size": Field("decay", "", "mean |u| of the shell over contacts"),
    "sample_row": whole("sample", "row that the contact belongs to"),
    "sample_contact": whole("sample", "position of the contact in the packing"),
    "sample_normal": Field("sample", MEAN, "original f_n"),
    "sample_least": Field("sample", MEAN, "least f_n"),
    "sample_extent": Field("sample", MEAN, "ΔF_n"),
    "shown_row": whole("shown", "row that the shown contact belongs to"),
    "shown_count": whole("shown ratio", "states of the walk by f_n over its original value"),
}

VARIABLES = {
    name: Variable(tuple(field.dims.split()), field.dtype, field.unit or "1", field.long_name)
    for name, field in (QUANTITIES | _TABLES).items()
}


def stored(record: Any) -> dict[str, Any]:
    """The fields of a record that are stored, by their names in the store.

    A record of one contact gives arrays of length 1; fields without a value are left out.
    """
    arrays = {}
    for name, field in fields(type(record)).items():
        value = getattr(record, name, None) if field.stored else None
        if value is not None:
            arrays[field.stored] = [value] if field.each else value
    return arrays


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
        array = np.asarray(values, dtype=row.dtype)
        if array.ndim != len(row.dims):
            raise ValueError(f"{name!r} must have dims {row.dims}, got shape {array.shape}")
        variables[name] = xr.Variable(row.dims, array, attributes(name))
    return xr.Dataset(variables, attrs=attrs)


def declared(name: str) -> Variable:
    """The schema's row for this name; ValueError if there is none."""
    if name not in VARIABLES:
        raise ValueError(f"{name!r} is not declared: add it to granforce.quantities.QUANTITIES")
    return VARIABLES[name]


def attributes(name: str) -> dict[str, Any]:
    """The unit and the meaning of a quantity, as attributes of an array."""
    return {"units": VARIABLES[name].units, "long_name": VARIABLES[name].long_name}


def packing_dataset(packing: Packing) -> xr.Dataset:
    """A Packing as a dataset with dims grain, contact, axis, component; info as JSON in attrs."""
    arrays = stored(packing) | stored(packing.contacts)
    arrays |= stored(packing.shapes) if packing.shapes is not None else {}
    return labelled(arrays, {"info": json.dumps(packing.info, default=to_builtin)})


def dataset_packing(dataset: xr.Dataset) -> Packing:
    """The Packing from which packing_dataset made this dataset, bit by bit.

    Tuples in info are returned as lists.
    """
    arrays = {name: dataset[name].values for name in ("x", "r", "box", "forces", "load")}
    return Packing(
        contacts=loaded(Contacts, dataset),
        shapes=loaded(Shapes, dataset) if "mass" in dataset else None,
        mu=float(dataset["mu"]),
        pressure=float(dataset["pressure"]),
        info=json.loads(dataset.attrs["info"]),
        tilt=float(dataset.get("tilt", 0.0)),
        **arrays,
    )


def loaded(kind: Callable[..., T], dataset: xr.Dataset, **others: Any) -> T:
    """A record of stored arrays and numbers, and of others; None for those that are in neither."""
    declared = fields(kind)
    found = {}
    for name in getattr(kind, "_fields", ()):
        stored = declared[name].stored
        values = dataset[stored].values if stored in dataset else None
        found[name] = values if values is None or values.ndim else values.item()
    return kind(**found | others)


def to_builtin(value: Any) -> Any:
    """Numpy values as plain ones, for json.dumps(default=…)."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"attributes must be plain values, got {type(value).__name__}")
