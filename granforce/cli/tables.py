"""Files of results: a table (.csv), arrays (.npz) or an xarray dataset (.zarr), by their suffix."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from granforce.cli.results import StoredResult, get_packing
from granforce.labelled import (
    CONTACT_LABELS,
    Declared,
    column_name,
    in_mean_forces,
    labelled_dataset,
    table,
)
from granforce.quantities import quantity
from granforce.study.series import save_series
from granforce.system.files import written


def of_contacts(
    arguments: argparse.Namespace, result: StoredResult, declared: Declared
) -> xr.Dataset:
    """Variables of a stored result with labels of its contacts, in the unit of --unit."""
    packing, _ = get_packing(arguments.store, result.parameters["packing"])
    if arguments.unit == "mean":
        declared = in_mean_forces(declared, result.dataset["force_scale"].item())
    return labelled_dataset(declared, packing, result.dataset["backbone"].values)


def columns(dataset: xr.Dataset) -> dict[str, Any]:
    """The columns of the table of a dataset."""
    frame = table(dataset)
    return {name: frame[name].to_numpy() for name in frame}


def write_table(path: str, dataset: xr.Dataset) -> None:
    """Write a dataset in the format given by the suffix."""
    if path.endswith(".zarr"):
        _save(dataset, path)
    elif path.endswith(".npz"):
        _write_arrays(path, columns(dataset))
    else:
        write_csv(path, columns(dataset))


def _save(dataset: xr.Dataset, path: str) -> None:
    for values in dataset.data_vars.values():
        values.attrs.setdefault("units", "1")
    save_series(dataset, path)


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


def write_states(arguments: argparse.Namespace, result: StoredResult) -> None:
    """Write the states of a walk or sample with their contacts to the file of --out."""
    path = arguments.out
    if path is None:
        return
    states = result.dataset["states"].values.astype(np.float64)
    dataset = of_contacts(arguments, result, {"states": (quantity("states"), states)})
    if path.endswith(".npz"):
        names = {name: dataset[name].values for name in ("contact", *CONTACT_LABELS)}
        name = column_name(None, "states", arguments.unit)
        _write_arrays(path, {name: dataset["states"].values, **names})
    else:
        write_table(path, dataset)
