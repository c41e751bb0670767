"""Cells of a study: one dataset each, loaded from the store or computed and stored.

A cell is one result of one kind (`granforce.study.kinds`), identified by plain parameters. Cells
are independent and seeded: they may be computed anywhere and in any order (`granforce.study.scan`).
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import xarray as xr

from granforce.packing.compaction import NEARLY_FRICTIONLESS
from granforce.records import InputError
from granforce.study.keys import Parameters, canonical
from granforce.study.store import Entry, Store
from granforce.system import cancelling
from granforce.tolerances import MANY_DISKS
from granforce.types import Cancel, Progress

# Versions of the algorithms that make packings certified to be at rest: of dynamics alone, of small
# friction, where linear programs finish them, and of more than MANY_DISKS disks.
PACKING_VERSION, FINISHED_VERSION, LARGE_VERSION = 7, 8, 10


def packing_version(mu: float, disks: int) -> int:
    """The version of `pack` at this friction, for this number of disks.

    It is among the parameters of a packing, so that it enters the key of everything that depends on
    the packing.
    """
    if disks > MANY_DISKS:
        return LARGE_VERSION
    return FINISHED_VERSION if 0 < mu <= NEARLY_FRICTIONLESS else PACKING_VERSION


def _unchanged(parameters: Parameters, dataset: xr.Dataset) -> Parameters:
    return parameters


class Kind(NamedTuple):
    """One kind of result: its name, its parameters, and how it is computed."""

    name: str  # in the store: entries are named <name>-<key>
    version: int  # raised when the algorithm gives other numbers; older entries are then ignored
    title: str  # in words
    unit: str  # what progress counts: progress(done, total)
    # (…) → the plain parameters that identify one; InputError if they are invalid
    parameters: Callable[..., Parameters]
    compute: Callable[..., xr.Dataset]  # (store, parameters, *, workers, progress, …) → its dataset
    holds_states: bool = False
    # (parameters, dataset) → the parameters of the dataset, which may have ended early
    parameters_of: Callable[[Parameters, xr.Dataset], Parameters] = _unchanged


class StudyCell(NamedTuple):
    """One dataset of a study."""

    kind: Kind
    parameters: Parameters  # its key in the store


@cancelling.cancellable
def get(
    store: Store,
    kind: Kind,
    parameters: Parameters,
    *,
    workers: int = 2,
    dtypes: Mapping[str, str] | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
    **options: Any,
) -> tuple[xr.Dataset, bool]:
    """The dataset of a kind and parameters, and whether it was in the store; if not, it is saved.

    If it cannot be written, for example because the disk is full, it is returned with a warning.

    workers: threads, which do not change the result. dtypes: as for Store.save, for states.
    options: further arguments of the kind's compute; if they end it early, the result is stored
    under its `parameters_of`. Raises the errors of compute.
    """
    stored = load(store, kind, parameters)
    if stored is not None:
        return stored, True
    store.refuse_unwritable()
    dataset = kind.compute(store, parameters, workers=workers, progress=progress, **options)
    named = kind.parameters_of(parameters, dataset)
    save(store, kind, named, dataset, dtypes=dtypes if kind.holds_states else None)
    return dataset, False


def load(store: Store, kind: Kind, parameters: Parameters) -> xr.Dataset | None:
    """The dataset of a kind and parameters, or None if it is not in the store."""
    return store.load(kind.name, parameters, version=kind.version)


def save(
    store: Store,
    kind: Kind,
    parameters: Parameters,
    dataset: xr.Dataset,
    *,
    dtypes: Mapping[str, str] | None = None,
    in_memory: bool = False,
) -> str:
    """Save a dataset under its kind and parameters, as Store.keep; returns the entry's name."""
    options: dict[str, Any] = {"version": kind.version, "dtypes": dtypes, "in_memory": in_memory}
    return store.keep(kind.name, parameters, dataset, **options)


def entry_name(store: Store, kind: Kind, parameters: Parameters) -> str:
    """Name of the entry of a kind and parameters, which need not be in the store."""
    return store.name(kind.name, parameters, version=kind.version)


def entries(store: Store, kind: Kind, **parameters: Any) -> list[Entry]:
    """Entries of a kind with these parameters, of its current version; none if it is missing."""
    matching = store.find(kind.name, **parameters) if store.exists else []
    return [entry for entry in matching if is_current(kind, entry)]


def is_current(kind: Kind, entry: Entry) -> bool:
    """Whether an entry has the current version of its kind and of its packing's algorithm."""
    packing = entry.params.get("packing")
    if entry.version != kind.version:
        return False
    if not isinstance(packing, dict) or "n" not in packing:  # imported: named by its contents
        return True
    return bool(packing.get("version") == packing_version(packing["mu"], packing["n"]))


ROW = ("packing_fraction", "coordination", "dimension", "eta1", "eta2", "eta3", "acceptance")
ROW_COUNTS = ("accepted", "rejected", "unconverged", "skipped", "rattlers", "unloaded_contacts")


def row(parameters: Parameters, dataset: xr.Dataset, cached: bool) -> dict[str, Any]:
    """One row of a table of walks: plain numbers of one cell."""
    packing = parameters["packing"]
    return {
        "mu": packing["mu"],
        "seed": packing.get("seed"),
        **{name: dataset[name].item() for name in (*ROW, *ROW_COUNTS)},
        "residual": float(dataset["residual"].max()),
        "cached": cached,
    }


def scan_rows(store: Store) -> list[dict[str, Any]]:
    """The rows of a scan, by μ and seed, for every walk in a store.

    Raises InputError for a missing store, for one without walks, and for one whose walks differ in
    more than μ and seed, because means over them would be meaningless.
    """
    entries = store.find("walk")
    if not entries:
        raise InputError(f"no walks in {store.path}; granforce scan --out STORE makes some")
    settings = [_settings(entry.params) for entry in entries]
    differing = sorted(
        name
        for name in set().union(*settings)
        if len({canonical(each.get(name)) for each in settings}) > 1
    )
    own = all(entry.params["mu"] == entry.params["packing"]["mu"] for entry in entries)
    if not own and len({entry.params["mu"] for entry in entries}) > 1:
        differing.append("the friction of the cones")
    if differing:
        raise InputError(
            f"the walks in {store.path} differ in {', '.join(differing)}; give a store that "
            "contains one scan (granforce scan --out STORE)"
        )
    rows = [row(entry.params, store[entry.name], True) for entry in entries]
    return sorted(rows, key=lambda line: (line["mu"], line["seed"] or 0))


# Parameters that may differ among the walks of a scan: Δt and sweeps of a compaction depend on μ.
_SCANNED = ("mu", "seed", "dt", "sweeps")


def _settings(parameters: Parameters) -> dict[str, Any]:
    """Parameters of a walk and its packing, except those that a scan varies."""
    packing = {k: v for k, v in parameters["packing"].items() if k not in _SCANNED}
    return packing | {k: v for k, v in parameters.items() if k not in ("packing", "mu")}
