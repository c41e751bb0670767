"""Results as xarray datasets and pandas tables, with labelled contacts and components."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from granforce.forces.ensemble import Ensemble
from granforce.forces.nearest import starting_network
from granforce.records import InputError, Packing, choice, with_article
from granforce.study.bounds import clusters_of
from granforce.study.schema import VARIABLES
from granforce.tolerances import AT_REST
from granforce.types import Floats, Integers, Mask

COMPONENTS = ["f_n", "f_t"]
_FOREIGN = "the result belongs to another ensemble"
# The word for a unit of force in the name of a column, and its name in attributes.
UNITS = {"packing": "force", "mean": "mean normal force"}
_COLUMN = re.compile(r"(?:(f_n|f_t)(?:_|(?= |$)))?(.*?)(?: \[([^]]*)\])?")
_SAMPLE = {
    "flat": "state contact component",
    "chain": "state",
}
# Results whose forces are on all contacts of the packing.
_ON_ALL = ("Rest", "LoadFactor", "CriticalLoad")
# Dimensions of the arrays of each kind of result, by the name of its type. Arrays over only the
# contacts of a result are labelled with their numbers.
_DIMENSIONS = {
    "Packing": {
        "forces": "contact component",
        "x": "grain axis",
        "r": "grain",
        "load": "grain load_component",
    },
    "Walk": {
        "states": "state contact component",
        **dict.fromkeys(("residual", "violation", "sweeps", "attempts"), "state"),
    },
    "UniformSample": _SAMPLE,
    "Draws": _SAMPLE,
    "Relaxation": {"forces": "contact component"},
    **{name: {"forces": "contact component"} for name in _ON_ALL},
    "Intervals": {
        "low": "contact component",
        "high": "contact component",
        "gap": "contact component side",
        "cluster": "contact",
    },
    "LimitLoads": {"load": "contact", "gap": "contact"},
    "CriticalForce": {"forces": "contact component"},
    "_CriticalForces": dict.fromkeys(
        ("low", "high", "limit_load", "residual", "violation", "converged"), "contact"
    ),
    "Volume": {
        "ladders": "ladder",
        **dict.fromkeys(("log_volume", "error", "dimension", "per_grain", "reached"), ""),
    },
    "Body": {
        "origin": "contact component",
        "axes": "direction contact component",
        "corners": "corner direction",
        "rays": "ray direction",
    },
    "Outline": {"corners": "corner direction"},
    "StressOutline": {"support": "angle"},
    "Pull": {
        "states": "value contact component",
        **dict.fromkeys(("residual", "violation"), "value"),
        **dict.fromkeys(("opened", "sliding"), "value contact"),
    },
    "Reach": {
        "states": "side contact component",
        "gap": "side",
        **dict.fromkeys(("opened", "sliding"), "side contact"),
    },
    "Inference": {"forces": "contact component", "deviation": "contact component"},
    "Remeasured": {"forces": "contact component", "deviation": "contact component"},
    "Carrying": {"least": "contact", "carries": "contact"},
    "Informative": dict.fromkeys(("expected", "reduction", "after"), "contact"),
    "Loaded": {
        "states": "load contact component",
        **dict.fromkeys(("residual", "violation"), "load"),
    },
    "Response": {
        "displacement": "grain axis",
        "rotation": "grain",
        **dict.fromkeys(("opening", "opened", "slid", "kept"), "contact"),
    },
}
# Names of variables, as in tables of the command line.
_RENAMED = {
    "Packing": {"x": "centre", "r": "radius"},
    "UniformSample": {"flat": "states"},
    "Draws": {"flat": "states"},
    "LimitLoads": {"load": "limit_load"},
    "StressOutline": {"support": "largest"},
    "_CriticalForces": {"low": "critical_low", "high": "critical_high"},
    "Carrying": {"least": "f_n_least"},
    "Informative": {
        "expected": "expected_reduction",
        "before": "mean_interval_before",
        "after": "mean_interval_after",
    },
}
# Units of variables and numbers, some of one kind of result only; forces are in the packing's unit.
_VARIABLE_UNITS: dict[str | tuple[str, str], str] = {
    **dict.fromkeys(("states", "forces", "low", "high", "load", "limit_load", "origin"), "force"),
    **dict.fromkeys(("mean", "error", "mean_interval_before", "mean_interval_after"), "force"),
    **dict.fromkeys(("f_n_least", "critical_low", "critical_high"), "force"),
    **{("Body", "corners"): "force", ("Response", "force"): "force", ("Volume", "error"): ""},
    **dict.fromkeys((("CriticalLoad", "low"), ("CriticalLoad", "high")), ""),
    **dict.fromkeys(("residual", "violation", "gap"), UNITS["mean"]),
    **dict.fromkeys(("centre", "radius"), "length"),
    "deviation": "sigma",
    "largest": "pressure",
}


def column_name(component: str | None, variable: str, unit: str | None = None) -> str:
    """The name of a column: f_n_low [packing], from "f_n", "low" and "packing"."""
    name = "_".join(part for part in (component, variable) if part)
    return f"{name} [{unit}]" if unit else name


def parts(column: str) -> tuple[str | None, str, str | None]:
    """Component, variable and unit in the name of a column; forces have no variable there."""
    match = _COLUMN.fullmatch(column)
    assert match  # any text does
    return match[1], match[2], match[3]


class _CriticalForces(NamedTuple):
    """Several critical forces as one result; arrays (k,), forces in the packing's unit."""

    contacts: Integers
    low: Floats
    high: Floats
    limit_load: Floats
    residual: Floats
    violation: Floats
    converged: Mask


def _named(kind: str, field: str) -> str:
    """The name of a field of a result as a variable."""
    return _RENAMED.get(kind, {}).get(field, field)


def _unit(kind: str, variable: str) -> str:
    """The unit of a variable or number of a kind of result, empty if it has none."""
    return _VARIABLE_UNITS.get((kind, variable), _VARIABLE_UNITS.get(variable, ""))


def _in_packing_unit(result: Any, ensemble: Ensemble | None) -> Any:
    """The result with all its forces in this unit; the ensemble is checked later."""
    if type(result).__name__ != "Informative" or not isinstance(ensemble, Ensemble):
        return result
    scale = ensemble.force_scale
    return result._replace(before=result.before * scale, after=result.after * scale)


def _several(result: Any) -> Any:
    """A list of critical forces as one result; other results unchanged."""
    critical = isinstance(result, list) and result
    if not critical or any(type(one).__name__ != "CriticalForce" for one in result):
        return result
    columns = {name: [getattr(one, name) for one in result] for name in _CriticalForces._fields[1:]}
    contacts = np.array([one.contact for one in result])
    return _CriticalForces(contacts, **{name: np.array(v) for name, v in columns.items()})


def _arrays(result: Any, names: Sequence[str]) -> dict[str, Any]:
    """The arrays of a result; the inner and outer corners of an outline are joined."""
    if type(result).__name__ == "Outline":
        return {"corners": np.concatenate([result.inner, result.outer])}
    return {name: getattr(result, name, None) for name in names}


def to_dataset(
    result: Any, ensemble: Ensemble | None = None, *, unit: str = "packing"
) -> xr.Dataset:
    """A result as an xarray Dataset with labels: component="f_n", contact with i, j, x, y.

    result: a Packing, a record returned by `intervals`, `walk` and others, the list from
    `critical_forces`, networks (N_c, 2), (S, N_c, 2) or (chains, S, N_c, 2), or a number per
    contact (N_c,), such as limit loads of all of S. ensemble: of the result, not needed for a
    Packing, Volume, Outline or StressOutline. Coordinates: contact, its number in the packing; i
    and j, its grains; x and y, the point of contact, length; component, "f_n" or "f_t"; polygon,
    "inner" or "outer" for an outline's corners; angle, of a StressOutline. unit: of forces,
    "packing", or "mean" for the mean normal force ⟨f_n⟩ of the ensemble, as ``--unit`` of the
    command line; quantities relative to ⟨f_n⟩ by definition, such as residuals, are always in it.
    Numbers and texts of the record become attributes, forces among them in this unit, too.

    Raises InputError for anything else, for a unit without effect, and if the ensemble is missing
    or does not match.
    """
    choice(unit, UNITS, "unit")
    dataset = _dataset(result, ensemble)
    kind = type(result).__name__
    return dataset if unit == "packing" else _in_mean_forces(dataset, ensemble, kind)


def _dataset(result: Any, ensemble: Ensemble | None) -> xr.Dataset:
    """A result as a dataset in the packing's unit."""
    result = _in_packing_unit(_several(result), ensemble)
    kind = type(result).__name__
    if isinstance(result, np.ndarray) and result.ndim == 1:
        dimensions, arrays = {"value": "contact"}, {"value": result}
    elif isinstance(result, np.ndarray) and result.ndim in (2, 3, 4):
        words = ["chain", "state", "contact", "component"][-result.ndim :]
        dimensions, arrays = {"states": " ".join(words)}, {"states": result}
    else:
        dimensions = _DIMENSIONS.get(kind, {})
        if getattr(result, "draws", None) is not None:  # of an Inference
            dimensions = dimensions | dict.fromkeys(("mean", "error"), "contact component")
        arrays = _arrays(result, list(dimensions))
    if not dimensions:
        known = ", ".join(name for name in _DIMENSIONS if not name.startswith("_"))
        raise InputError(
            f"{with_article(kind)} cannot be labelled; labels exist for: {known}, networks"
        )
    if kind == "Intervals" and isinstance(ensemble, Ensemble):
        arrays["cluster"] = clusters_of(ensemble, result)
    used = {word for words in dimensions.values() for word in words.split()}
    variables = {}
    for name, words in dimensions.items():
        variable = _named(kind, name)
        attributes = {"units": unit} if (unit := _unit(kind, variable)) else {}
        stored = "interval_gap" if variable == "gap" else variable  # `gap` is that of contacts
        if stored in VARIABLES:
            attributes["long_name"] = VARIABLES[stored].long_name
        variables[variable] = (words.split(), arrays[name], attributes)
    if used & {"contact", "grain"} and not isinstance(result, Packing):
        _check_ensemble(ensemble, result)
    try:
        labels = _labels(result)
        if used & {"contact", "grain"}:
            labels |= _contact_labels(*_contacts(result, ensemble))
        labels = {name: label for name, label in labels.items() if _dimension(label, name) in used}
        return xr.Dataset(variables, labels, _attributes(result))
    except ValueError as error:
        why = str(error).removeprefix(f"{_FOREIGN}: ")
        raise InputError(f"{_FOREIGN}: {why}") from None


def to_dataframe(
    result: Any, ensemble: Ensemble | None = None, *, unit: str = "packing"
) -> pd.DataFrame:
    """The same as a pandas table: a row for each contact, or for each contact in each state.

    Columns have the names of the tables of the command line: contact, i, j, x, y, then component,
    variable and unit, such as ``f_n [packing]`` for networks and ``f_n_low [packing]`` for bounds.
    `read_known` and ``--known`` read the file that the table's `to_csv` writes. Of intervals,
    ``cluster`` is the cluster of undetermined contacts, −1 where determined. A Volume has a row for
    each ladder, an Outline for each corner, a StressOutline for each angle, a Body for each contact
    along each direction. Arguments and errors as for `to_dataset`.
    """
    dataset = to_dataset(result, ensemble, unit=unit)
    if "contact" not in dataset.sizes:
        others = {"corner": _corners, "angle": _angles}
        table = next((table for name, table in others.items() if name in dataset.sizes), None)
        return dataset.to_dataframe() if table is None else table(dataset)
    words = {units: word for word, units in UNITS.items()} | {"sigma": "sigma"}
    columns = {}
    for name, values in dataset.data_vars.items():
        if "contact" not in values.dims or "side" in values.dims[1:]:
            continue
        word = words.get(values.attrs.get("units", ""))
        if "component" not in values.dims:
            columns[column_name(None, str(name), word)] = values
            continue
        variable = "" if name in ("states", "forces") else str(name)
        for part in COMPONENTS:
            one = values.sel(component=part, drop=True)
            columns[column_name(part, variable, word)] = one
    order = [
        name
        for name in ("chain", "state", "value", "load", "side", "direction")
        if name in dataset.sizes
    ]
    order = [name for name in order if any(name in values.dims for values in columns.values())]
    table = xr.Dataset(columns).to_dataframe([*order, "contact"]).reset_index()
    forces = {name: words.get(dataset[name].attrs.get("units", "")) for name in order}
    named = {name: column_name(None, name, word) for name, word in forces.items()}
    table = table.rename(columns=named)
    first = [*named.values(), "contact", "i", "j", "x", "y"]
    return table[[*first, *(name for name in columns if name not in first)]]


def _in_mean_forces(dataset: xr.Dataset, ensemble: Ensemble | None, kind: str) -> xr.Dataset:
    """The same with all forces divided by ⟨f_n⟩; InputError without an ensemble or forces."""
    if not isinstance(ensemble, Ensemble):
        raise InputError('unit="mean" needs S as the second argument: (result, S, unit="mean")')
    if UNITS["packing"] not in {v.attrs.get("units") for v in dataset.variables.values()}:
        raise InputError(
            'unit="mean" changes nothing here, as no variable is known to be a force; leave it '
            "out (a force divided by S.force_scale is in units of ⟨f_n⟩)"
        )
    scale = ensemble.force_scale
    units = {"units": UNITS["mean"]}
    divided = {
        name: (dataset[name] / scale).assign_attrs(units)
        for name, values in dataset.variables.items()
        if values.attrs.get("units") == UNITS["packing"]
    }
    labels = {name: divided.pop(name) for name in dataset.coords if name in divided}
    forces = [name for name in dataset.attrs if _unit(kind, name) == UNITS["packing"]]
    attributes = {name: dataset.attrs[name] / scale for name in forces}
    return dataset.assign(divided).assign_coords(labels).assign_attrs(attributes)


def _contacts(result: Any, ensemble: Ensemble | None) -> tuple[Packing, Integers]:
    """The packing of a result, and the numbers of its contacts."""
    if isinstance(result, Packing):
        return result, np.arange(len(result.contacts.i))
    assert ensemble is not None  # checked
    if type(result).__name__ in _ON_ALL:
        return ensemble.packing, np.arange(len(ensemble.packing.contacts.i))
    _refuse_foreign(result, ensemble)
    return ensemble.packing, np.asarray(getattr(result, "contacts", ensemble.index))


def _check_ensemble(ensemble: Any, result: Any) -> None:
    """InputError without an ensemble, or for an array for other than all of its contacts."""
    if not isinstance(ensemble, Ensemble):
        raise InputError(
            "contacts are labelled by the ensemble S of the result: give it too, as in "
            "gf.to_dataframe(result, S) or gf.to_dataset(result, S)"
        )
    if isinstance(result, np.ndarray):
        count = result.shape[0 if result.ndim == 1 else -2]
        if count != len(ensemble.index):
            raise InputError(
                f"an array of {count} contacts has no contact numbers, and S has "
                f"{len(ensemble.index)} contacts: give values for all of them, or the record that "
                "has the numbers, such as gf.limit_load_bounds(S, contacts)"
            )


def _refuse_foreign(result: Any, ensemble: Ensemble) -> None:
    """InputError for a result that cannot be this ensemble's."""
    kind = type(result).__name__
    if hasattr(result, "contacts"):
        ensemble.positions(result.contacts)
    if kind in ("Walk", "Pull", "UniformSample"):
        ensemble.refuse_foreign(result.states, result.residual, "the result")
    if kind == "Intervals":
        forces = starting_network(ensemble)[ensemble.positions(result.contacts)]
        outside = np.maximum(result.low - forces, forces - result.high)
        if np.nanmax(outside, initial=0.0) > AT_REST * ensemble.force_scale:
            raise InputError(f"{_FOREIGN}: its own forces are outside")


def _corners(dataset: xr.Dataset) -> pd.DataFrame:
    """A row for each corner of an outline: polygon, and its coordinates u1, u2."""
    u = dataset["corners"].values
    return pd.DataFrame({"polygon": dataset["polygon"].values, "u1": u[:, 0], "u2": u[:, 1]})


def _angles(dataset: xr.Dataset) -> pd.DataFrame:
    """A row for each angle of an outline of stresses."""
    table = dataset.to_dataframe().reset_index()
    return table.rename(columns=lambda name: column_name(None, name, dataset[name].attrs["units"]))


def _contact_labels(packing: Packing, contacts: Integers) -> dict[str, Any]:
    every, at = packing.contacts, packing.contact_points[contacts]
    return {
        "contact": contacts,
        "i": ("contact", every.i[contacts]),
        "j": ("contact", every.j[contacts]),
        "x": ("contact", at[:, 0], {"units": "length"}),
        "y": ("contact", at[:, 1], {"units": "length"}),
    }


def _labels(result: Any) -> dict[str, Any]:
    """Labels of all dimensions except contacts."""
    texts = {
        "component": COMPONENTS,
        "side": ["low", "high"],
        "axis": ["x", "y"],
        "load_component": ["x", "y", "torque"],
        "ladder": ["down", "up"],
    }
    # Text of fixed length is not in Zarr's specification: writing it warns.
    labels: dict[str, Any] = {name: np.array(text, dtype=object) for name, text in texts.items()}
    if type(result).__name__ == "Outline":
        polygons = ["inner"] * len(result.inner) + ["outer"] * len(result.outer)
        labels["polygon"] = ("corner", np.array(polygons, dtype=object))
    if type(result).__name__ == "StressOutline":
        labels["angle"] = ("angle", result.angles, {"units": "rad"})
    for dimension, name in (("value", "values"), ("load", "loads")):
        if isinstance(values := getattr(result, name, None), np.ndarray):
            labels[dimension] = (dimension, values, {"units": UNITS["packing"]})
    return labels


def _dimension(label: Any, name: str) -> str:
    return label[0] if isinstance(label, tuple) else name


def _attributes(result: Any) -> dict[str, Any]:
    fields = getattr(result, "_fields", ())
    every = {_named(type(result).__name__, name): getattr(result, name) for name in fields}
    return {
        name: int(value) if isinstance(value, bool) else value
        for name, value in every.items()
        if isinstance(value, (bool, int, float, str))
    }
