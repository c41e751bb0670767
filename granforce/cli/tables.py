"""Files of results: a table (.csv), arrays (.npz) or an xarray dataset (.zarr), by their suffix."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from granforce.cli.results import contact_labels, unit
from granforce.labelled import COMPONENTS, UNITS, column_name, parts
from granforce.study.keys import Parameters
from granforce.study.schema import VARIABLES
from granforce.study.series import save_series
from granforce.system.files import written

# Coordinates of contacts: their grains, and the point of contact.
_LABELS: dict[str, dict[str, str]] = {
    "i": {"long_name": "first grain"},
    "j": {"long_name": "second grain"},
    "x": {"units": "length", "long_name": "point of contact"},
    "y": {"units": "length", "long_name": "point of contact"},
}


def write_columns(path: str, columns: Mapping[str, Any], *more: xr.Dataset) -> None:
    """Write columns {name: array} in the format given by the suffix; more: added to .zarr only."""
    if path.endswith(".zarr"):
        save_series(xr.merge([_dataset(columns), *more], combine_attrs="no_conflicts"), path)
    elif path.endswith(".npz"):
        _write_arrays(path, columns)
    else:
        write_csv(path, columns)


def _dataset(columns: Mapping[str, Any]) -> xr.Dataset:
    """Columns as variables of `to_dataset`: f_n_low and f_t_low are low, f_n and f_t are forces."""
    first, *others = columns
    _, rows, word = parts(first)
    coordinates: dict[str, Any] = {rows: (rows, columns[first], {"units": word} if word else {})}
    variables: dict[str, Any] = {}
    for name in others:
        if name in _LABELS:
            coordinates[name] = rows, columns[name], _LABELS[name]
            continue
        component, variable, word = parts(name)
        both = [column_name(one, variable, word) for one in COMPONENTS]
        if component is None or not columns.keys() >= set(both):
            variable = column_name(component, variable)
            variables[variable] = rows, columns[name], _attributes(variable, word)
        elif component == COMPONENTS[0]:
            variable = variable or "forces"
            values = np.stack([columns[one] for one in both], axis=-1)
            variables[variable] = (rows, "component"), values, _attributes(variable, word)
            coordinates["component"] = COMPONENTS
    return xr.Dataset(variables, coordinates)


def _attributes(variable: str, word: str | None) -> dict[str, str]:
    """Unit and meaning of a variable; word: the unit in the name of its column."""
    stored = VARIABLES.get(variable)
    units = UNITS.get(word, word) if word else stored.units if stored else "1"
    return {"units": units} | ({"long_name": stored.long_name} if stored else {})


def _write_arrays(path: str, arrays: Mapping[str, Any]) -> None:
    with written(path) as file:
        np.savez(file, **arrays)


def write_csv(path: str | Path, columns: Mapping[str, Any], *, digits: int = 17) -> None:
    """Write columns {name: array} as a table; integers stay integers, 17 digits are exact."""
    with written(path) as file:
        np.savetxt(
            file,
            np.column_stack(list(columns.values())),
            fmt=["%d" if v.dtype.kind == "i" else f"%.{digits}g" for v in columns.values()],
            delimiter=",",
            header=",".join(columns),
            comments="",
        )


def write_states(
    arguments: argparse.Namespace, parameters: Parameters, dataset: xr.Dataset
) -> None:
    """Write the states of a walk or sample with their contacts to the file of --out."""
    path = arguments.out
    if path is None:
        return
    labels, forces = contact_labels(arguments, parameters, dataset), unit(arguments, dataset)
    states = dataset["states"].values.astype(np.float64) / forces.scale
    if path.endswith(".npz"):
        _write_arrays(path, {column_name(None, "states", forces.word): states, **labels})
    elif path.endswith(".zarr"):
        coordinates: dict[str, Any] = {
            name: ("contact", column, _LABELS.get(name)) for name, column in labels.items()
        }
        coordinates["component"] = COMPONENTS
        dims, attributes = ("state", "contact", "component"), _attributes("states", forces.word)
        save_series(xr.Dataset({"states": (dims, states, attributes)}, coordinates), path)
    else:
        count = len(states)
        columns = {"state": np.repeat(np.arange(count), dataset.sizes["contact"])}
        columns |= {label: np.tile(column, count) for label, column in labels.items()}
        pair = {
            column_name(component, "", forces.word): states[..., k].ravel()
            for k, component in enumerate(COMPONENTS)
        }
        write_csv(path, columns | pair)
