"""One entry of a store, a folder and Zarr group: described, written, and checked in full."""

import functools
import hashlib
import json
import os
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import zarr
from zarr.codecs import ZstdCodec
from zarr.core.metadata import ArrayV3Metadata

from granforce.records import InputError
from granforce.study import keys
from granforce.study.schema import VARIABLES, declared, to_builtin

STATES_PER_CHUNK = 100  # frames are read one by one; 100 × 700 contacts are 1.1 MB

Variables = Mapping[Any, xr.Variable]  # of a dataset, by name

_LIBRARIES = ("granforce", "numpy", "numba", "xarray", "zarr")
_IDENTITY = ("kind", "parameters", "seed", "algorithm_version", "schema_version")
_PROVENANCE = ("created", "checksum", *(f"{library}_version" for library in _LIBRARIES))


def conforming(dataset: xr.Dataset, dtypes: Mapping[Any, str]) -> dict[Any, xr.Variable]:
    """The dataset's variables as they will be stored; ValueError where VARIABLES says otherwise."""
    stored: dict[Any, xr.Variable] = {}
    for name, variable in dataset.variables.items():
        row = declared(str(name))
        dtype = np.dtype(dtypes.get(name, row.dtype))
        if variable.dims != row.dims:
            raise ValueError(f"{name!r} must have dims {row.dims}, got {variable.dims}")
        if dtype != row.dtype and (dtype.kind, np.dtype(row.dtype).kind) != ("f", "f"):
            raise ValueError(f"{name!r} is {row.dtype} and cannot be stored as {dtype}")
        if variable.dtype not in (dtype, np.dtype(row.dtype)):
            raise ValueError(f"{name!r} must be {row.dtype}, got {variable.dtype}")
        stored[name] = xr.Variable(variable.dims, np.asarray(variable.values, dtype, order="C"))
    return stored


def attributes(
    kind: str,
    params: Mapping[str, Any],
    version: int | str,
    given: Mapping[str, Any],
    variables: Variables,
) -> dict[str, Any]:
    """Attributes of an entry: the caller's own, what it is, what made it when, its checksum."""
    attrs = {key: value for key, value in given.items() if key not in (*_IDENTITY, *_PROVENANCE)}
    attrs |= {"kind": kind, "parameters": keys.canonical(params)}
    if "seed" in params:
        attrs["seed"] = params["seed"]
    attrs |= {"algorithm_version": version, "schema_version": keys.SCHEMA_VERSION}
    attrs |= {"created": datetime.now(UTC).isoformat(timespec="seconds"), **_library_versions()}
    # What comes back from JSON is what the checksum must see.
    attrs = json.loads(json.dumps(attrs, default=to_builtin))
    return attrs | {"checksum": _checksum(variables, attrs)}


@functools.cache
def _library_versions() -> dict[str, str]:
    return {f"{library}_version": metadata.version(library) for library in _LIBRARIES}


def _checksum(variables: Variables, attrs: Mapping[str, Any]) -> str:
    """sha256 over arrays and attributes; the same for the same result made elsewhere or later."""
    lasting = {key: value for key, value in attrs.items() if key not in _PROVENANCE}
    digest = hashlib.sha256(json.dumps(lasting, sort_keys=True).encode())
    for name in sorted(variables):
        variable = variables[name]
        header = [name, variable.dims, variable.dtype.str, variable.shape]
        digest.update(json.dumps(header).encode())
        digest.update(np.ascontiguousarray(variable.values).data)
    return digest.hexdigest()


def write(folder: Path, variables: Variables, attrs: Mapping[str, Any]) -> None:
    """Write an entry into a new folder."""
    group = zarr.create_group(folder, zarr_format=3, attributes=dict(attrs))
    for name, variable in variables.items():
        array = group.create_array(
            name,
            shape=variable.shape,
            dtype=variable.dtype,
            chunks=_chunks(variable),
            compressors=(ZstdCodec(level=3),),
            dimension_names=[str(name) for name in variable.dims],
            attributes={"units": VARIABLES[name].units, "long_name": VARIABLES[name].long_name},
            config={"write_empty_chunks": True},  # else Zarr 3.0 loses a chunk of −0.0
        )
        array[...] = variable.values


def _chunks(variable: xr.Variable) -> tuple[int, ...]:
    """Whole arrays, but a hundred states at a time."""
    chunks = [max(1, size) for size in variable.shape]
    if variable.ndim > 1 and variable.dims[0] == "state":
        chunks[0] = min(chunks[0], STATES_PER_CHUNK)
    return tuple(chunks)


def read_attributes(folder: Path) -> dict[str, Any] | None:
    """An entry's attributes, or None where they are unreadable or belong to another name."""
    try:
        attrs = json.loads((folder / "zarr.json").read_bytes())["attributes"]
        params = json.loads(attrs["parameters"])
        versions = attrs["algorithm_version"], attrs["schema_version"]
        ours = folder.name == keys.entry_name(attrs["kind"], params, *versions)
        return attrs if ours and {"created", "checksum"} <= attrs.keys() else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def opened(folder: Path) -> xr.Dataset:
    """The dataset of an entry, its arrays not read yet; InputError where it is damaged."""
    damaged = _damaged_array(folder)
    if damaged:
        raise InputError(f"entry {folder.name} in {folder.parent} is damaged ({damaged})")
    return _lazily(folder)


def _lazily(folder: Path) -> xr.Dataset:
    # Not decoded: what was saved are plain numbers, and "units" must not turn them into times.
    return xr.open_zarr(folder, consolidated=False, chunks=None, decode_cf=False)


def checked(folder: Path) -> tuple[xr.Dataset | None, str]:
    """(dataset in memory, "") if the entry is whole, else (None, reason)."""
    if read_attributes(folder) is None:
        return None, "its metadata cannot be read"
    damaged = _damaged_array(folder)
    if damaged:
        return None, damaged
    try:
        dataset = _lazily(folder).load()
    except Exception as error:  # what damage raises depends on codec, zarr and xarray
        return None, f"an array cannot be read: {type(error).__name__}"
    if _checksum(dataset.variables, dataset.attrs) != dataset.attrs["checksum"]:
        return None, "its data do not match its checksum"
    return dataset, ""


def _damaged_array(folder: Path) -> str:
    """Which array's metadata is damaged, in words, or "" if none is seen to be.

    Asked before zarr reads them all at once: of several that fail it tells one, and asyncio prints
    the tracebacks of the others.
    """
    with os.scandir(folder) as items:
        names = sorted(item.name for item in items if item.is_dir())
    for name in names:
        try:
            ArrayV3Metadata.from_dict(json.loads((folder / name / "zarr.json").read_bytes()))
        except Exception:  # what damage raises depends on zarr
            return f"the metadata of its array {name} cannot be read"
    return ""
