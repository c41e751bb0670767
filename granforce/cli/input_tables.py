"""Tables that commands write (.csv, .npz, .zarr), as input of other commands."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from granforce.forces.knowledge import Known
from granforce.labelled import COMPONENTS, UNITS, column_name
from granforce.packing import importers
from granforce.packing.importers.known import known_in
from granforce.packing.importers.npz import read_arrays
from granforce.packing.importers.text import PACKING, of_columns, read_csv
from granforce.records import InputError, Packing, are_whole, float_array
from granforce.system.files import expanded
from granforce.types import Floats, Integers

_Arrays = dict[str, Any]
_FORCES = [f"{component}{PACKING}" for component in COMPONENTS]


def read_known(path: str) -> Known:
    """Known forces from a table of any format; as `importers.read_known`."""
    if Path(path).suffix not in _READERS:
        return importers.read_known(path)
    arrays = _READERS[Path(path).suffix](path)
    columns = {name: values for name, values in arrays.items() if values.shape == (_rows(arrays),)}
    if not columns:
        raise InputError(f"{path}: not a table with a row for each contact")
    values = [column.tolist() for column in columns.values()]
    return known_in(of_columns(path, columns, values))


def _rows(arrays: _Arrays) -> int:
    return int(np.size(arrays.get("contact", ())))


def read_states(path: str, packing: Packing) -> tuple[Integers, Floats]:
    """Contacts (k,) of a packing and states (S, k, 2) on them.

    path: states of a walk or sample, or a table of one network, such as that of an inference.
    Raises InputError for files of another kind or unit, and for states of another packing.
    """
    suffix = Path(path).suffix
    if suffix != ".csv" and suffix not in _READERS:
        raise InputError(f"{path}: the name must end with .csv, .npz or .zarr")
    arrays = _states_of_table(path) if suffix == ".csv" else _READERS[suffix](path)
    states = _picked(path, arrays)
    contacts, contact = packing.contacts, arrays["contact"]
    count = len(contacts.i)
    numbered = contact.ndim == 1 and contact.size and are_whole(contact, count - 1).all()
    if not numbered or len(np.unique(contact)) < len(contact):
        raise InputError(
            f"{path}: contacts must be numbered 0 … {count - 1} as in the packing, each once"
        )
    contact = contact.astype(np.int64)
    if not all(np.array_equal(getattr(contacts, end)[contact], arrays[end]) for end in "ij"):
        raise InputError(
            f"{path}: its contacts join other grains; does it belong to another packing?"
        )
    return contact, float_array(states, (-1, len(contact), 2), f"{path}: states")


def _picked(path: str, arrays: _Arrays) -> Any:
    """States (…, k, 2) in the packing's unit among arrays that also have contact, i and j."""
    names = {name.partition(" [")[0] for name in arrays}
    if not ("states" in names or names.issuperset(COMPONENTS)) or not names.issuperset("ij"):
        raise InputError(
            f"{path}: contains no states; granforce walk, uniform and infer --out write them"
        )
    if f"states{PACKING}" in arrays:
        return arrays[f"states{PACKING}"]
    if not arrays.keys() >= {*_FORCES, "contact"}:
        raise InputError(f"{path}: no states in the packing's unit; write them with --unit packing")
    return np.stack([arrays[name] for name in _FORCES], axis=-1)[None]


def _states_of_table(path: str) -> _Arrays:
    """The arrays of a table with a row for each contact, or for each contact in each state."""
    table = read_csv(path).in_packing_unit(COMPONENTS)
    table.require("contact", "i", "j", *COMPONENTS)
    columns = {name: table.whole(name) for name in ("contact", "i", "j")}
    forces = np.column_stack([table.numbers(component) for component in COMPONENTS])
    if "state" not in table.header:
        return columns | dict(zip(_FORCES, forces.T, strict=True))
    state = table.whole("state")
    first = int(np.argmax(np.append(state != state[0], True)))
    numbers, whole = state[::first], len(state) % first == 0
    if (
        not whole
        or len(np.unique(numbers)) < len(numbers)
        or np.diff(state.reshape(-1, first)).any()
    ):
        raise InputError(f"{path}: not every state is complete, with its rows after each other")
    by_state = {name: values.reshape(-1, first) for name, values in columns.items()}
    if any((values != values[0]).any() for values in by_state.values()):
        raise InputError(f"{path}: every state must have the same contacts in the same order")
    states = {f"states{PACKING}": forces.reshape(-1, first, 2)}
    return {name: values[0] for name, values in by_state.items()} | states


def _arrays_of_dataset(path: str) -> _Arrays:
    """The variables of a dataset as arrays with the names of columns."""
    try:
        dataset = xr.open_zarr(expanded(path), consolidated=False).load()
    except Exception as error:  # of many kinds, by zarr and xarray
        raise InputError(f"{path}: not a Zarr dataset ({type(error).__name__})") from None
    words = {units: word for word, units in UNITS.items()}
    arrays: _Arrays = {}
    for name, variable in dataset.variables.items():
        word = words.get(variable.attrs.get("units", ""))
        if variable.dims[1:] == ("component",):
            quantity = "" if name == "forces" else str(name)
            for part, values in zip(COMPONENTS, variable.values.T, strict=True):
                arrays[column_name(part, quantity, word)] = values
        else:
            arrays[column_name(None, str(name), word)] = variable.values
    return arrays


_READERS: Mapping[str, Any] = {".npz": read_arrays, ".zarr": _arrays_of_dataset}
