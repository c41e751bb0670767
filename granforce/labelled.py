"""Results as xarray datasets and pandas tables, with labelled contacts and components."""

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from granforce.forces.ensemble import Ensemble
from granforce.records import InputError, Packing
from granforce.types import Integers

COMPONENTS = ["f_n", "f_t"]
_SAMPLE = {
    "flat": "state contact component",
    "chain": "state",
}
# Dimensions of the arrays of each kind of result, by the name of its type. What a result holds for
# its contacts only is labelled with their numbers.
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
    "Intervals": {
        "low": "contact component",
        "high": "contact component",
        "gap": "contact component side",
        "backbone": "contact",
    },
    "LimitLoads": {"load": "contact", "gap": "contact"},
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
    "Informative": {"expected": "contact", "after": "contact"},
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
_RENAMED = {"flat": "states", "x": "centre", "r": "radius"}
# In the packing's unit of force; residuals, violations and duality gaps are in ⟨f_n⟩.
_FORCES = ("states", "forces", "low", "high", "load", "least")
_RELATIVE = ("residual", "violation", "gap")


def to_dataset(result: Any, ensemble: Ensemble | None = None) -> xr.Dataset:
    """A result as an xarray Dataset with labels: component="f_n", contact with i, j, x, y.

    result: a Packing, a record that `intervals`, `walk` and others return, or networks (N_c, 2) or
    (S, N_c, 2). ensemble: of the result, not needed for a Packing. Coordinates: contact, its number
    in the packing; i and j, its grains; x and y, the point of contact, length; component, "f_n" or
    "f_t". Forces are in the packing's unit. Numbers and texts of the record become attributes.

    Raises InputError for anything else, and where the ensemble is missing or another one's.
    """
    if isinstance(result, np.ndarray) and result.ndim in (2, 3):
        words = ["state", "contact", "component"][-result.ndim :]
        dimensions, arrays = {"states": " ".join(words)}, {"states": result}
    else:
        dimensions = _DIMENSIONS.get(type(result).__name__, {})
        arrays = {name: getattr(result, name) for name in dimensions}
    if not dimensions:
        known = ", ".join(_DIMENSIONS)
        raise InputError(f"a {type(result).__name__} has no labels; those have: {known}, networks")
    packing, contacts = _contacts(result, ensemble)
    variables = {}
    for name, words in dimensions.items():
        variable = _RENAMED.get(name, name)
        unit = "force" if variable in _FORCES else "mean normal force"
        attrs = {"units": unit} if variable in (*_FORCES, *_RELATIVE) else {}
        variables[variable] = (words.split(), arrays[name], attrs)
    try:
        labels = _labels(result, packing, contacts)
        used = {word for words in dimensions.values() for word in words.split()}
        labels = {name: label for name, label in labels.items() if _dimension(label, name) in used}
        return xr.Dataset(variables, labels, _attributes(result))
    except ValueError as error:
        raise InputError(f"the result is of another ensemble: {error}") from None


def to_dataframe(result: Any, ensemble: Ensemble | None = None) -> pd.DataFrame:
    """The same as a pandas table: a row for each contact, or for each contact in each state.

    Columns: contact, i, j, x, y, then f_n and f_t of networks, and of others with their name:
    low_f_n, high_f_t; forces in the packing's unit. Arguments and errors as for `to_dataset`.
    """
    dataset = to_dataset(result, ensemble)
    columns = {}
    for name, values in dataset.data_vars.items():
        if "contact" not in values.dims or "side" in values.dims[1:]:
            continue
        if "component" not in values.dims:
            columns[name] = values
            continue
        for part in COMPONENTS:
            label = part if name in ("states", "forces") else f"{name}_{part}"
            columns[label] = values.sel(component=part, drop=True)
    order = [name for name in ("state", "value", "load", "side") if name in dataset.sizes]
    order = [name for name in order if any(name in values.dims for values in columns.values())]
    table = xr.Dataset(columns).to_dataframe([*order, "contact"]).reset_index()
    first = [*order, "contact", "i", "j", "x", "y"]
    return table[[*first, *(name for name in columns if name not in first)]]


def _contacts(result: Any, ensemble: Ensemble | None) -> tuple[Packing, Integers]:
    """The packing of a result, and the numbers of its contacts."""
    if isinstance(result, Packing):
        return result, np.arange(len(result.contacts.i))
    if not isinstance(ensemble, Ensemble):
        raise InputError("labels need the ensemble of the result: gf.to_dataset(result, S)")
    return ensemble.packing, np.asarray(getattr(result, "contacts", ensemble.index))


def _labels(result: Any, packing: Packing, contacts: Integers) -> dict[str, Any]:
    every, at = packing.contacts, packing.contact_points[contacts]
    labels: dict[str, Any] = {
        "contact": contacts,
        "i": ("contact", every.i[contacts]),
        "j": ("contact", every.j[contacts]),
        "x": ("contact", at[:, 0], {"units": "length"}),
        "y": ("contact", at[:, 1], {"units": "length"}),
        "component": COMPONENTS,
        "side": ["low", "high"],
        "axis": ["x", "y"],
        "load_component": ["x", "y", "torque"],
    }
    for dimension, name in (("value", "values"), ("load", "loads")):
        if isinstance(values := getattr(result, name, None), np.ndarray):
            labels[dimension] = values
    return labels


def _dimension(label: Any, name: str) -> str:
    return label[0] if isinstance(label, tuple) else name


def _attributes(result: Any) -> dict[str, Any]:
    fields = getattr(result, "_fields", ())
    every = {name: getattr(result, name) for name in fields}
    return {
        name: int(value) if isinstance(value, bool) else value
        for name, value in every.items()
        if isinstance(value, (bool, int, float, str))
    }
