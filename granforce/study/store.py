"""The store: a content-addressed cache of datasets in Zarr.

A store is a folder and a Zarr v3 group; each entry is a sub-group `<kind>-<key>` that zarr and
xarray can also open. The key is a hash of kind, parameters (including the seed), algorithm and
schema version, so an entry never changes: it is either complete or absent.
"""

from __future__ import annotations

import errno
import json
import os
import stat
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import platformdirs
import xarray as xr

from granforce.fields import record
from granforce.records import InputError
from granforce.study import entries, keys
from granforce.study.keys import Parameters
from granforce.system.files import ASIDE, expanded
from granforce.system.temporaries import folder_bytes, is_stale, remove, temporary_name

LOCATION_VARIABLE = "GRANFORCE_CACHE"  # environment variable naming the store's folder


class NotKeptError(InputError):
    """A result could not be written to the store, for example because the disk is full."""


@record
class Entry(NamedTuple):
    """Metadata of one entry, without its arrays."""

    name: Annotated[str, "folder in the store: <kind>-<key>"]
    kind: Annotated[str, "of result"]
    params: Annotated[Parameters, "as in the key: floats to 15 significant digits"]
    version: Annotated[int | str, "of the algorithm"]
    bytes: Annotated[int, "on disk"]
    created: Annotated[str, "UTC, ISO 8601"]


@record
class Verdict(NamedTuple):
    """Whether one entry is intact; if not, the reason in words."""

    name: Annotated[str, "of the entry"]
    ok: Annotated[bool, "whether it is intact"]
    reason: Annotated[str, "why not, in words"]


def default_path() -> Path:
    """$GRANFORCE_CACHE if set, else the user's cache folder for granforce."""
    location = os.environ.get(LOCATION_VARIABLE) or platformdirs.user_cache_dir("granforce")
    return Path(location)


def open_store(path: str | Path | None = None, *, readonly: bool = False) -> Store:
    """The Store in a folder, which is created with the first saved entry if it is missing.

    A folder without write permission can be opened; saving to it raises InputError.

    Parameters
    ----------
    path : path, optional
        By default $GRANFORCE_CACHE, otherwise the user's cache folder.
    readonly : bool, default False
        To read only, which refuses a missing store.

    Returns
    -------
    Store
        The store.

    Raises
    ------
    InputError
        For a file, for a folder with other contents, for one that cannot be created, for a store of
        a newer schema unless readonly, and, if readonly, for a missing store.
    """
    path = _located(path)
    store = Store(path, readonly=readonly)
    if not readonly:
        refuse_newer(path)
    if _schema(path) is None:
        _refuse_foreign(path)
        # Entries without a root are readable; the first save creates the root.
        if readonly and not store._names():
            raise InputError(f"{path} is empty, not a store; check the path")
    if not readonly:
        if not path.exists():
            store.refuse_unwritable()
        with suppress(InputError):  # a folder without write permission can still be read
            store.clean()
    return store


def _located(path: str | Path | None) -> Path:
    """The absolute path of a store; InputError for a file or an invalid path."""
    path = expanded(default_path() if path is None else path).absolute()
    try:
        is_file = not stat.S_ISDIR(path.stat().st_mode)
    except (FileNotFoundError, NotADirectoryError):
        return path
    except OSError as error:
        raise InputError(f"{path} cannot be a store: {error.strerror}") from None
    if is_file:
        raise InputError(f"{path} is a file, not a store; give a folder")
    return path


def _schema(path: Path) -> int | None:
    """The schema version of the store in a folder, or None if the folder has no root of a store."""
    try:
        version = json.loads((path / "zarr.json").read_bytes())["attributes"]["granforce_store"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    return version if isinstance(version, int) else None


def is_store(path: Path) -> bool:
    """Whether a folder is a store."""
    return _schema(path) is not None


def refuse_newer(path: Path) -> None:
    """Raise InputError for a store of a newer schema, whose contents are unknown here."""
    schema = _schema(path)
    if schema is not None and schema > keys.SCHEMA_VERSION:
        raise InputError(
            f"the store {path} was made by a newer granforce (schema {schema}, here "
            f"{keys.SCHEMA_VERSION}): update granforce, or give another folder"
        )


def _refuse_foreign(path: Path) -> None:
    """Raise InputError if the folder contains anything that is neither hidden nor an entry.

    A damaged zarr.json among only entries belongs to the store.
    """
    if not path.is_dir():
        return
    try:
        visible = [item.name for item in path.iterdir() if not item.name.startswith(".")]
    except OSError as error:
        raise InputError(f"the folder {path} cannot be read: {error.strerror}") from None
    entry_names = {name for name in visible if keys.ENTRY.fullmatch(name)}
    # Another process may have created the root since its schema was read.
    root = {"zarr.json"} if entry_names or is_store(path) else set()
    others = set(visible) - entry_names - root
    if others:
        raise InputError(
            f"{path} is not a store: it contains {min(others)!r}; give the folder of a scan, or an "
            "empty or a new folder (results written by --out are read by xarray)"
        )


def _create_root(path: Path) -> None:
    path.mkdir(parents=True, exist_ok=True)
    root = {
        "zarr_format": 3,
        "node_type": "group",
        "attributes": {"granforce_store": keys.SCHEMA_VERSION},
    }
    temporary = path / temporary_name()
    temporary.write_text(json.dumps(root, indent=2))
    os.replace(temporary, path / "zarr.json")


class Store(Mapping[str, xr.Dataset]):
    """A folder of entries as a mapping from entry name to lazily opened xr.Dataset.

    Created by `open_store`. Entries with unreadable metadata are left out. Reading entries of a
    missing folder, such as a mistyped one, raises InputError.
    """

    def __init__(self, path: Path, *, readonly: bool = False) -> None:
        self.path = path
        self.readonly = readonly
        self._in_memory: dict[str, xr.Dataset] = {}  # by name, too
        self._incomplete = False

    def __repr__(self) -> str:
        missing = "" if self.exists else ", not there yet"
        return f"Store({str(self.path)!r}, readonly={self.readonly}{missing})"

    @property
    def exists(self) -> bool:
        """Whether the folder exists; saving creates it, and reading entries requires it."""
        return self.path.is_dir()

    def __iter__(self) -> Iterator[str]:
        return (name for name in self._names() if self._attrs(name) is not None)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        self._refuse_missing()
        return isinstance(name, str) and self._attrs(name) is not None

    def __getitem__(self, name: str) -> xr.Dataset:
        if name not in self:
            raise KeyError(name)
        dataset, reason = entries.opened(self.path / name)
        if reason:
            raise InputError(f"entry {name} in {self.path} is damaged ({reason})")
        if dataset is None:  # removed meanwhile
            raise KeyError(name)
        return dataset

    def name(self, kind: str, params: Mapping[str, Any], *, version: int | str) -> str:
        """Name of the entry for these parameters: <kind>-<20 hexadecimal digits>.

        Raises TypeError for parameters that have no canonical form (see `keys.canonical`).
        """
        return keys.entry_name(kind, params, version, keys.SCHEMA_VERSION)

    def load(
        self, kind: str, params: Mapping[str, Any], *, version: int | str
    ) -> xr.Dataset | None:
        """The entry's dataset, read and verified in full.

        Parameters
        ----------
        kind, params, version
            As for `save`.

        Returns
        -------
        xr.Dataset or None
            Arrays have the dtype with which they were stored. None without an entry, or if it is
            damaged, with a warning; saving replaces it.

        Raises
        ------
        InputError
            If a file is in the place of the entry.
        """
        name = self.name(kind, params, version=version)
        self.refuse_file(name)
        dataset, reason = entries.checked(self.path / name)
        if reason:
            self._warn(name, reason)
        return self._in_memory.get(name) if dataset is None else dataset

    def save(
        self,
        kind: str,
        params: Mapping[str, Any],
        dataset: xr.Dataset,
        *,
        version: int | str,
        dtypes: Mapping[str, str] | None = None,
    ) -> str:
        """Store a dataset under its parameters; an intact entry of that name is not changed.

        Parameters
        ----------
        kind : str
            Of result, such as "packing" or "walk".
        params : mapping
            Plain values that identify it.
        dataset : xr.Dataset
            With variables of the schema.
        version : int or str
            Of the algorithm.
        dtypes : mapping, optional
            {variable: dtype} to store floats with fewer bits.

        Returns
        -------
        str
            Name of the entry.

        Raises
        ------
        ValueError
            If the dataset violates the schema.
        TypeError
            For parameters or attributes that are not plain values.
        InputError
            If the store cannot be written.
        """
        name = self.name(kind, params, version=version)
        variables = entries.conforming(dataset, dtypes or {})
        attrs = entries.attributes(kind, params, version, dataset.attrs, variables)
        self.make()
        with self._writing():
            self.refuse_file(name)
            if entries.checked(self.path / name)[0] is None:
                self._publish(name, variables, attrs)
        return name

    def keep(
        self,
        kind: str,
        params: Mapping[str, Any],
        dataset: xr.Dataset,
        *,
        in_memory: bool = False,
        **options: Any,
    ) -> str:
        """As `save`, but a dataset that cannot be written is kept in memory, with a warning.

        This object loads it as if it were stored, and is `incomplete`. in_memory: keep it there
        although it was written, because another process may remove the entry.
        """
        name = self.name(kind, params, version=options["version"])
        try:
            self.save(kind, params, dataset, **options)
        except NotKeptError as error:
            warnings.warn(f"{error}; results are returned, but not saved", stacklevel=3)
            in_memory = self._incomplete = True
        if in_memory:
            self._in_memory[name] = dataset
        return name

    @property
    def incomplete(self) -> bool:
        """Whether a result could not be written."""
        return self._incomplete

    def refuse_unwritable(self) -> None:
        """Raise InputError if nothing can be saved, before a long computation."""
        with self._writing():
            effective = os.access in os.supports_effective_ids
            existing = next(path for path in (self.path, *self.path.parents) if path.exists())
            if not existing.is_dir():
                raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
            if not os.access(existing, os.W_OK | os.X_OK, effective_ids=effective):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    def make(self) -> None:
        """Create the folder if it is missing, for other processes; InputError as for `save`."""
        with self._writing():
            if _schema(self.path) is None:
                _create_root(self.path)

    def refuse_file(self, name: str) -> None:
        """Raise InputError if a file is in the place of an entry: it may be the user's."""
        path = self.path / name
        with suppress(OSError):
            mode = path.lstat().st_mode
            if not (stat.S_ISDIR(mode) or (stat.S_ISLNK(mode) and path.is_dir())):
                raise InputError(f"{path} is a file where an entry of the store belongs: remove it")

    def entry(self, name: str) -> Entry | None:
        """The `Entry` of this name, or None if there is none that can be read; reads no arrays."""
        attrs = self._attrs(name)
        return None if attrs is None else self._entry(name, attrs)

    def _entry(self, name: str, attrs: Mapping[str, Any]) -> Entry:
        params = keys.parameters(attrs["parameters"])
        size = folder_bytes(self.path / name)
        return Entry(
            name=name,
            kind=attrs["kind"],
            params=params,
            version=attrs["algorithm_version"],
            bytes=size,
            created=attrs["created"],
        )

    def entries(self) -> list[Entry]:
        """A list of `Entry`, one for each readable entry; arrays are not read."""
        return self._read(self._names())

    def _read(self, names: list[str]) -> list[Entry]:
        entries_read = []
        for name in names:
            attrs, reason = entries.described(self.path / name)
            if reason:
                self._warn(name, reason)
            elif attrs is not None:
                entries_read.append(self._entry(name, attrs))
        return entries_read

    def find(self, kind: str | None = None, **params: Any) -> list[Entry]:
        """Entries whose parameters include the given ones.

        Parameters
        ----------
        kind : str, optional
            By default all kinds.
        **params
            Compared as in keys.

        Returns
        -------
        list of Entry
            Arrays are not read.
        """
        parameters = {key: keys.canonical(value) for key, value in params.items()}

        def fits(name: str) -> bool:
            attrs = self._attrs(name)
            if attrs is None:
                return True  # to be warned about
            known = keys.parameters(attrs["parameters"])
            return all(
                key in known and keys.canonical(known[key]) == value
                for key, value in parameters.items()
            )

        return self._read([name for name in self._names(kind) if fits(name)])

    def size(self) -> int:
        """Bytes on disk, including temporaries of running writers."""
        return folder_bytes(self.path)

    def clear(self, kind: str | None = None) -> int:
        """Remove all entries, or those of one kind, and return their number.

        Raises InputError if the store cannot be written.
        """
        names = self._names(kind) if self.exists else []
        self.remove(*names)
        return len(names)

    def remove(self, *names: str) -> None:
        """Remove the entries of these names, if they exist.

        Raises InputError if the store cannot be written.
        """
        with self._writing():
            for name in names:
                self._retire(name)

    def clean(self) -> int:
        """Remove temporaries that killed writers left behind, and return their number.

        Raises InputError if the store cannot be written.
        """
        with self._writing():
            aside = (*self.path.glob(".tmp-*"), *self.path.glob(ASIDE.format("*")))
            stale = [item for item in aside if is_stale(item)]
            for item in stale:
                remove(item)
        return len(stale)

    def verify(self, kind: str | None = None) -> list[Verdict]:
        """A list of `Verdict`: entries, or those of a kind, compared in full with checksums."""
        verdicts = []
        for name in self._names(kind):
            dataset, reason = entries.checked(self.path / name)
            if dataset is not None or reason:  # otherwise it was removed meanwhile
                verdicts.append(Verdict(name, not reason, reason))
        return verdicts

    def _names(self, kind: str | None = None) -> list[str]:
        """Names of all entries, or those of one kind, readable or not, sorted."""
        self._refuse_missing()
        names = sorted(name for name in os.listdir(self.path) if keys.ENTRY.fullmatch(name))
        return [name for name in names if kind in (None, name.rpartition("-")[0])]

    def _refuse_missing(self) -> None:
        if not self.exists:
            raise InputError(f"there is no store at {self.path}; check the path")

    def _attrs(self, name: str) -> dict[str, Any] | None:
        return entries.read_attributes(self.path / name) if keys.ENTRY.fullmatch(name) else None

    def _warn(self, name: str, reason: str) -> None:
        message = f"entry {name} in {self.path} is damaged ({reason}) and counts as missing"
        warnings.warn(message, stacklevel=3)

    def _publish(
        self, name: str, variables: Mapping[str, xr.Variable], attrs: Mapping[str, Any]
    ) -> None:
        """Write under a temporary name, then rename, so that no partial entry is ever visible."""
        temporary = self.path / temporary_name()
        try:
            entries.write(temporary, variables, attrs)
            while True:
                try:
                    os.rename(temporary, self.path / name)
                    return
                except OSError as error:
                    if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                        raise
                # Another process was faster. An intact copy is used; a damaged one is replaced.
                dataset, reason = entries.checked(self.path / name)
                if dataset is not None:
                    return
                if reason:
                    self._retire(name)
        finally:
            remove(temporary)

    def _retire(self, name: str) -> None:
        """Remove an entry: renamed first, so that it disappears at once."""
        temporary = self.path / temporary_name()
        try:
            os.rename(self.path / name, temporary)
        except FileNotFoundError:
            return  # removed by another process
        remove(temporary)

    @contextmanager
    def _writing(self) -> Iterator[None]:
        if self.readonly:
            raise InputError(f"the store {self.path} was opened read-only")
        refuse_newer(self.path)
        try:
            yield
        except OSError as error:
            reason = error.strerror or error
            raise NotKeptError(
                f"cannot write to the store {self.path}: {reason}; "
                f"give another folder or set {LOCATION_VARIABLE}"
            ) from error
