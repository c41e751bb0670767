"""One entry of a store, a folder and Zarr group: description, writing, and full verification."""

import functools
import hashlib
import json
import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import xarray as xr
import zarr
from zarr.abc.buffer import Buffer, BufferPrototype
from zarr.abc.store import ByteRequest
from zarr.buffer import default_buffer_prototype
from zarr.codecs import ZstdCodec
from zarr.core.metadata import ArrayV3Metadata
from zarr.storage import LocalStore, MemoryStore

from granforce.records import InputError
from granforce.study import keys, schema
from granforce.system import interrupts

STATES_PER_CHUNK = 100  # frames are read one by one; 100 × 700 contacts are 1.1 MB

Variables = Mapping[Any, xr.Variable]  # of a dataset, by name
T = TypeVar("T")

_LIBRARIES = ("granforce", "numpy", "numba", "xarray", "zarr")
_IDENTITY = ("kind", "parameters", "seed", "algorithm_version", "schema_version")
_PROVENANCE = (
    *("created", "checksum", "metadata_checksum"),
    *(f"{library}_version" for library in _LIBRARIES),
)


def conforming(dataset: xr.Dataset, dtypes: Mapping[Any, str]) -> dict[Any, xr.Variable]:
    """The dataset's variables as they will be stored; ValueError if they violate VARIABLES."""
    stored: dict[Any, xr.Variable] = {}
    for name, variable in dataset.variables.items():
        row = schema.declared(str(name))
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
    """Attributes of an entry: the caller's, its identity, its origin and time, and its checksum."""
    attrs = {key: value for key, value in given.items() if key not in (*_IDENTITY, *_PROVENANCE)}
    attrs |= {"kind": kind, "parameters": keys.described(params)}
    if "seed" in params:
        attrs["seed"] = params["seed"]
    attrs |= {"algorithm_version": version, "schema_version": keys.SCHEMA_VERSION}
    attrs |= {"created": datetime.now(UTC).isoformat(timespec="seconds"), **_library_versions()}
    # The checksum must be computed from values as read back from JSON.
    attrs = json.loads(json.dumps(attrs, default=schema.to_builtin))
    return attrs | {"checksum": _checksum(variables, attrs)}


@functools.cache
def _library_versions() -> dict[str, str]:
    return {f"{library}_version": metadata.version(library) for library in _LIBRARIES}


def _checksum(variables: Variables, attrs: Mapping[str, Any]) -> str:
    """sha256 of arrays and attributes; equal for the same result computed elsewhere or later."""
    lasting = {key: value for key, value in attrs.items() if key not in _PROVENANCE}
    digest = hashlib.sha256(json.dumps(lasting, sort_keys=True).encode())
    for name in sorted(variables):
        variable = variables[name]
        header = [name, variable.dims, variable.dtype.str, variable.shape]
        digest.update(json.dumps(header).encode())
        digest.update(np.ascontiguousarray(variable.values).data)
    return digest.hexdigest()


def write(folder: Path, variables: Variables, attrs: Mapping[str, Any]) -> None:
    """Write an entry into a new folder.

    Zarr compresses into memory and the files are written here, one after the other: if one cannot
    be written, no thread of Zarr continues to write the others.
    """
    encoded: dict[str, Buffer] = {}
    memory = MemoryStore(encoded)
    arrays = {}
    for name, variable in variables.items():
        with interrupts.deferred():
            array = zarr.create_array(
                memory,
                name=name,
                shape=variable.shape,
                dtype=variable.dtype,
                chunks=_chunks(variable),
                compressors=(ZstdCodec(level=3),),
                dimension_names=[str(name) for name in variable.dims],
                attributes=schema.attributes(str(name)),
                config={"write_empty_chunks": True},  # otherwise Zarr 3.0 loses a chunk of −0.0
                zarr_format=3,
            )
        arrays[str(name)] = json.loads(encoded[f"{name}/zarr.json"].to_bytes())
        for rows in _by_chunks(variable):
            with interrupts.deferred():
                array[rows] = variable.values[rows]
            move(encoded, folder)
    seal(folder, arrays, attrs)


def encoded(dataset: xr.Dataset) -> dict[str, Buffer]:
    """The files, by key, of any dataset as a Zarr group with consolidated metadata."""
    files: dict[str, Buffer] = {}
    with warnings.catch_warnings():
        # Zarr warns that strings and consolidated metadata are not in its specification; xarray
        # reads both, and warns if metadata are not consolidated.
        warnings.simplefilter("ignore")
        dataset.to_zarr(MemoryStore(files), mode="w", zarr_format=3, consolidated=True)
    return files


def move(encoded: dict[str, Buffer], folder: Path) -> None:
    """Write the files encoded by Zarr, by their keys."""
    for key in list(encoded):
        path = folder / key
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(encoded.pop(key).to_bytes())


def seal(folder: Path, arrays: Mapping[str, Any], attrs: Mapping[str, Any]) -> None:
    """Write an entry's own metadata, with those of its arrays ("consolidated").

    xarray and Zarr look for these first, and warn if they are missing.
    """
    group = {
        "attributes": {**attrs, "metadata_checksum": _metadata_checksum(arrays, attrs)},
        "zarr_format": 3,
        "consolidated_metadata": _consolidated(arrays),
        "node_type": "group",
    }
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "zarr.json").write_text(json.dumps(group))


def _consolidated(arrays: Mapping[str, Any]) -> dict[str, Any]:
    return {"kind": "inline", "must_understand": False, "metadata": dict(arrays)}


def _metadata_checksum(arrays: Mapping[str, Any], attrs: Mapping[str, Any]) -> str:
    """sha256 of the attributes that `checksum` leaves out: units, names, origin and time."""
    covered = {key: value for key, value in attrs.items() if key != "metadata_checksum"}
    return hashlib.sha256(json.dumps([arrays, covered], sort_keys=True).encode()).hexdigest()


def _by_chunks(variable: xr.Variable) -> Iterator[Any]:
    """Indices of a variable's chunks, which divide at most its first dimension."""
    if not variable.ndim:
        yield ()
        return
    step = _chunks(variable)[0]
    for first in range(0, max(1, variable.shape[0]), step):
        yield slice(first, first + step)


def _chunks(variable: xr.Variable) -> tuple[int, ...]:
    """Whole arrays, except for states, in chunks of a hundred."""
    chunks = [max(1, size) for size in variable.shape]
    if variable.ndim > 1 and variable.dims[0] == "state":
        chunks[0] = min(chunks[0], STATES_PER_CHUNK)
    return tuple(chunks)


def read_attributes(folder: Path) -> dict[str, Any] | None:
    """An entry's attributes, or None if they are unreadable or belong to another name."""
    try:
        attrs = json.loads((folder / "zarr.json").read_bytes())["attributes"]
        params = keys.parameters(attrs["parameters"])
        versions = attrs["algorithm_version"], attrs["schema_version"]
        name_matches = folder.name == keys.entry_name(attrs["kind"], params, *versions)
        return attrs if name_matches and {"created", "checksum"} <= attrs.keys() else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


# The result of reading an entry: the value, or the reason for its absence.
Look = tuple[T | None, str]
UNREADABLE = "its metadata cannot be read"


def _read_in_place(folder: Path, look: Callable[[Path], Look[T]]) -> Look[T]:
    """look(folder), of the folder that has this name at the end; (None, "") if there is none.

    A folder that another process removed meanwhile is absent; if it was replaced, it is read again.
    """
    while True:
        before = _identity(folder)
        content, reason = (None, "") if before is None else look(folder)
        if not reason or _identity(folder) == before:
            return content, reason


def _identity(folder: Path) -> tuple[int, int, int] | None:
    """Identity of the folder that has this name at present, or None; it changes on renaming."""
    try:
        status = (
            folder.stat() if folder.exists() else folder.lstat()
        )  # a dangling link is not an entry
    except OSError:
        return None
    return status.st_dev, status.st_ino, status.st_ctime_ns


def described(folder: Path) -> Look[dict[str, Any]]:
    """(attributes, "") of an entry; errors as for `checked`."""
    return _read_in_place(folder, _described)


def _described(folder: Path) -> Look[dict[str, Any]]:
    attrs = read_attributes(folder)
    return attrs, UNREADABLE if attrs is None else ""


class _Metadata(NamedTuple):
    """Metadata of an entry."""

    group: dict[str, Any]
    arrays: dict[str, Any]  # of each array, from its own file, not the consolidated metadata


def _metadata(folder: Path) -> Look[_Metadata]:
    try:
        group = json.loads((folder / "zarr.json").read_bytes())
        with os.scandir(folder) as items:
            names = sorted(item.name for item in items if item.is_dir())
    except (OSError, ValueError):
        return None, UNREADABLE
    metadata = _Metadata(group, {})
    for name in names:
        try:
            metadata.arrays[name] = json.loads((folder / name / "zarr.json").read_bytes())
            ArrayV3Metadata.from_dict(dict(metadata.arrays[name]))
        except Exception:  # the exception depends on zarr
            return None, f"the metadata of its array {name} cannot be read"
    return metadata, ""


def opened(folder: Path) -> Look[xr.Dataset]:
    """As `checked`, but arrays are read later; reading a lost array raises InputError."""
    return _read_in_place(folder, lambda folder: _lazily(folder, *_metadata(folder)))


def _lazily(folder: Path, metadata: _Metadata | None, reason: str) -> Look[xr.Dataset]:
    if metadata is None:
        return None, reason
    try:
        # Not decoded: only plain numbers are saved, and "units" must not turn them into times.
        store = _Whole(folder, metadata)
        with interrupts.deferred():
            return xr.open_zarr(store, consolidated=True, chunks=None, decode_cf=False), ""
    except Exception as error:  # the exception depends on codec, zarr and xarray
        return None, f"an array cannot be read: {type(error).__name__}"


class _Whole(LocalStore):
    """A folder whose metadata were read once, and in which every chunk must exist.

    Zarr replaces a missing chunk by zeros; of several missing metadata it reports one, and asyncio
    prints the tracebacks of the others.
    """

    def __init__(self, root: Path, metadata: _Metadata) -> None:
        super().__init__(root, read_only=True)
        whole = metadata.group | {"consolidated_metadata": _consolidated(metadata.arrays)}
        self._metadata = json.dumps(whole).encode()

    async def get(
        self,
        key: str,
        prototype: BufferPrototype | None = None,
        byte_range: ByteRequest | None = None,
    ) -> Buffer | None:
        """As in LocalStore; raises InputError for a missing chunk."""
        if key == "zarr.json":
            return (prototype or default_buffer_prototype()).buffer.from_bytes(self._metadata)
        found = await super().get(key, prototype, byte_range)
        if found is None and "c" in key.split("/")[1:]:
            raise InputError(
                f"entry {self.root.name} in {self.root.parent} lacks its part {key} since it was "
                "opened; it may have been removed"
            )
        return found


def checked(folder: Path) -> Look[xr.Dataset]:
    """(dataset in memory, "") if intact, (None, reason) if damaged, (None, "") if absent."""
    return _read_in_place(folder, _checked)


def _checked(folder: Path) -> Look[xr.Dataset]:
    if not folder.is_dir():
        return None, "it is a file, not a folder"
    if read_attributes(folder) is None:
        return None, UNREADABLE
    metadata, reason = _metadata(folder)
    dataset, reason = _lazily(folder, metadata, reason)
    if dataset is None or metadata is None:
        return None, reason
    try:
        with interrupts.deferred():
            dataset.load()
    except InputError:
        return None, "a part of an array is missing"
    except Exception as error:  # as above
        return None, f"an array cannot be read: {type(error).__name__}"
    if _checksum(dataset.variables, dataset.attrs) != dataset.attrs["checksum"]:
        return None, "its data do not match its checksum"
    if not _is_sealed(metadata):
        return None, "its names, units or dates do not match their checksum"
    return dataset, ""


def _is_sealed(metadata: _Metadata) -> bool:
    """Whether metadata are as written.

    Older entries have neither a checksum nor consolidated metadata: with the latter alone, an entry
    has lost its checksum.
    """
    (group, arrays), attrs = metadata, metadata.group["attributes"]
    if "metadata_checksum" not in attrs:
        return "consolidated_metadata" not in group
    written = attrs["metadata_checksum"] == _metadata_checksum(arrays, attrs)
    return written and group.get("consolidated_metadata") == _consolidated(arrays)
