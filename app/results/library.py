"""The results shown by the app, as plain arrays: no widgets, no plots.

The only module of the app, with those that compute for single tabs, that uses stores and studies.
"""

import json
import os
import threading
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from granforce.records import InputError, Packing
from granforce.study import cells as study
from granforce.study import kinds
from granforce.study.keys import Parameters
from granforce.study.schema import dataset_packing
from granforce.study.store import Store, open_store

from .entry_labels import names
from .replays import Replay, make_replay
from .selection import KINDS, Selection, selected, series

# Environment variable naming a store of precomputed results to use instead of data/start.zarr.
SHIPPED_VARIABLE = "GRANFORCE_DATA"
SHIPPED = Path(__file__).resolve().parents[2] / "data" / "start.zarr"

# Sources of states. An inference holds states, too, and is shown with its frame.
SOURCES = {name: kinds.KINDS[name] for name in KINDS}

OPENING_MU = 0.1  # where forces are least determined, and most interesting to see
CELLS_IN_MEMORY = 16  # cells in memory, for all visitors
STEPS_GROW = 0.3  # steps of a compaction ~ n to this power: 325 at 400 disks, 475 at 1600


class Cell(NamedTuple):
    """States in a store: their parameters, their name, and their location."""

    selection: Selection
    series: str  # everything except μ, in words; cells of one series form one η(μ)
    params: Parameters  # parameters of its kind
    store: Store  # the store that holds them
    name: str  # of the entry

    @property
    def mu(self) -> float:
        """Friction coefficient of the ensemble."""
        return self.selection.mu

    @property
    def stored(self) -> int:
        """Number of its stored states."""
        return int(self.params.get("keep") or self.selection.states)

    @property
    def kind(self) -> str:
        """Kind of the entry: walk or uniform."""
        return self.selection.kind


class Shown(NamedTuple):
    """All data of one cell for the page."""

    cell: Cell
    replay: Replay
    exact: xr.Dataset | None  # of exact intervals, or None if no store has them


class Library:
    """The stores together: precomputed results, read-only, and the user's own cache.

    Shared by all visitors; its methods may be called from any thread.
    """

    def __init__(self, shipped: str | Path | None = None, cache: str | Path | None = None) -> None:
        """shipped, cache: folders; by default $GRANFORCE_DATA or data/start.zarr, and the cache."""
        self.notes: list[str] = []  # one line for each store that cannot be used
        shipped = shipped or os.environ.get(SHIPPED_VARIABLE) or SHIPPED
        self.shipped = self._open(shipped, readonly=True)
        self.cache = self._open(cache, readonly=False)
        self.catalogue: list[Cell] = []  # as last read
        self._known: dict[tuple[Path, str], Cell | None] = {}  # of entries, which never change
        self._damaged: set[tuple[Path, str]] = set()  # entries that could not be read
        self._shown: OrderedDict[str, Shown] = OrderedDict()
        self._lock = threading.Lock()

    def _open(self, path: str | Path | None, readonly: bool) -> Store | None:
        try:
            return open_store(path, readonly=readonly)
        except InputError as error:
            self.notes.append(str(error))
            return None

    @property
    def stores(self) -> list[Store]:
        """The stores that exist; entries in both are read from the first."""
        return [store for store in (self.shipped, self.cache) if store is not None and store.exists]

    @property
    def writable_cache(self) -> Store:
        """The cache, where computed results are stored; InputError without one."""
        if self.cache is None:
            raise InputError("no cache folder can be written, so nothing can be computed")
        return self.cache

    def cells(self) -> list[Cell]:
        """All states of the current algorithms, by series and μ; also stored in `catalogue`.

        If a store has the same states twice, the entry with most stored states.
        """
        cells: dict[tuple[str, ...], Cell] = {}
        for store in self.stores:
            for name in store:
                key = store.path, name
                if key not in self._known:
                    self._known[key] = self._cell(store, name)
                cell = self._known[key]
                if cell is None or key in self._damaged:
                    continue
                same = cell.series, repr(cell.selection)
                if same not in cells or cells[same].stored < cell.stored:
                    cells[same] = cell
        self.catalogue = sorted(cells.values(), key=lambda cell: (cell.series, cell.mu))
        return self.catalogue

    def find(self, kind: str, params: Parameters) -> Cell | None:
        """The cell of these parameters, or None."""
        for store in self.stores:
            name = study.entry_name(store, SOURCES[kind], params)
            if (store.path, name) in self._damaged:
                if study.load(store, SOURCES[kind], params) is None:
                    continue
                self._damaged.discard((store.path, name))  # it was computed again
            if name in store:
                return self._cell(store, name)
        return None

    def series(self, selection: Selection, parameters: Parameters | None = None) -> str:
        """Everything except μ, in words; an upload is named by its files."""
        known = names(self.cache) if selection.imported and self.cache is not None else {}
        return series(selection, parameters, known.get(selection.packing.get("imported", "")))

    def _cell(self, store: Store, name: str) -> Cell | None:
        """The Cell of an entry; None if it has no states of the current algorithms."""
        entry = store.entry(name) if name.rpartition("-")[0] in SOURCES else None
        if entry is None or not study.is_current(SOURCES[entry.kind], entry):
            return None
        selection = selected(entry.kind, entry.params)
        if selection is None:
            return None
        called = self.series(selection, entry.params)
        return Cell(selection, called, entry.params, store, name)

    def dataset(self, cell: Cell) -> xr.Dataset:
        """The dataset of one cell; if it is damaged, InputError, and it is no longer listed."""
        dataset = study.load(cell.store, SOURCES[cell.kind], cell.params)
        if dataset is None:
            self._damaged.add((cell.store.path, cell.name))
            raise _damage(cell.store, cell.name)
        return dataset

    def shown(self, cell: Cell) -> Shown:
        """Shown of one cell; the last few are cached. InputError if its packing is in no store."""
        shown = self.shown_in_memory(cell)
        if shown is None:
            packing = self.packing(cell.params["packing"])
            replay = make_replay(packing, self.dataset(cell), cell.mu)
            shown = Shown(cell, replay, self.exact(cell.selection))
            self.keep_in_memory(shown)
        return shown

    def shown_in_memory(self, cell: Cell) -> Shown | None:
        """Shown of one cell if it is cached, otherwise None; returns at once."""
        with self._lock:
            if cell.name in self._shown:
                self._shown.move_to_end(cell.name)
            return self._shown.get(cell.name)

    def keep_in_memory(self, shown: Shown) -> None:
        """Make this the newest in the cache."""
        with self._lock:
            self._shown[shown.cell.name] = shown
            while len(self._shown) > CELLS_IN_MEMORY:
                self._shown.popitem(last=False)

    def packing(self, params: Parameters) -> Packing:
        """The packing of these parameters from the first store that has it. InputError if none."""
        dataset = self.stored(kinds.PACKING, params)
        if dataset is not None:
            return dataset_packing(dataset)
        raise InputError("the packing of these networks is not in any open store")

    def exact(self, selection: Selection) -> xr.Dataset | None:
        """The exact intervals of a selection's packing at its μ as a dataset, or None."""
        return self.stored(kinds.INTERVALS, selection.intervals)

    def stored(self, kind: study.Kind, params: Parameters) -> xr.Dataset | None:
        """The dataset of this kind and parameters from the first store that has it, or None."""
        for store in self.stores:
            dataset = study.load(store, kind, params)
            if dataset is not None:
                return dataset
        return None

    def lend_packing(self, params: Parameters) -> None:
        """Copy a packing from the shipped store to the cache, so that it is not made again."""
        cache = self.writable_cache
        if self.shipped is not None:
            dataset = study.load(self.shipped, kinds.PACKING, params)
            if dataset is not None:
                kinds.keep_packing(cache, params, dataset_packing(dataset))

    def as_imported(self, selection: Selection) -> Selection:
        """A Selection with the friction with which its imported packing was stored."""
        imported = selection.packing.get("imported")
        for store in self.stores if imported else ():
            for entry in study.entries(store, kinds.PACKING):
                if entry.params.get("imported") == imported:
                    return selection._replace(packing=entry.params)
        return selection

    def expected_steps(self, n: int, mu: float) -> float | None:
        """Compaction steps of n grains, from the stored packing nearest in n, then μ; or None."""
        known = []
        for store in self.stores:
            for entry in study.entries(store, kinds.PACKING):
                if "n" not in entry.params:
                    continue  # imported
                larger = n / entry.params["n"]
                away = abs(np.log((entry.params["mu"] + 1e-3) / (mu + 1e-3)))
                known.append((abs(np.log(larger)), away, entry.name, store, larger))
        if not known:
            return None
        *_, name, store, larger = min(known, key=lambda one: one[:3])
        with suppress(InputError), readable(store, name) as packing:
            steps = json.loads(packing.attrs["info"]).get("steps")
            return steps and steps * larger**STEPS_GROW
        return None


@contextmanager
def readable(store: Store, name: str) -> Iterator[xr.Dataset]:
    """The dataset of an entry, read on demand; InputError if it turns out to be damaged."""
    try:
        yield store[name]
    except Exception as error:  # the exception depends on codec, zarr and xarray
        raise _damage(store, name) from error


def _damage(store: Store, name: str) -> InputError:
    if not (store.path / name).exists():
        return InputError(f"entry {name} in {store.path} has been removed; compute it again")
    return InputError(f"entry {name} in {store.path} is damaged; compute it again, or remove it")


def nearest_cell(cells: Sequence[Cell], mu: float) -> Cell:
    """The cell with the nearest μ, on the logarithmic scale of the slider."""
    return min(cells, key=lambda cell: abs(place(cell.mu) - place(mu)))


def cell_of(cells: Sequence[Cell], selection: Selection | None) -> Cell | None:
    """The cell of the Selection, or None."""
    return next((c for c in cells if selection is not None and c.selection.names(selection)), None)


def best_cell(cells: Sequence[Cell]) -> Cell | None:
    """The best cell to open; None without cells."""
    if not cells:
        return None
    names = [cell.series for cell in cells]
    fullest = max(dict.fromkeys(names), key=names.count)
    return nearest_cell([cell for cell in cells if cell.series == fullest], OPENING_MU)


def with_states(cells: Sequence[Cell], requested: Selection) -> Selection:
    """The requested Selection with the largest number of states in a cell, or unchanged."""
    candidates = [
        c.selection for c in cells if c.selection._replace(states=requested.states).names(requested)
    ]
    return max(candidates, key=lambda selection: selection.states, default=requested)


LEAST_PLACE = -3.5  # represents μ = 0


def place(mu: float) -> float:
    """log10 μ, and LEAST_PLACE for smaller values."""
    return max(LEAST_PLACE, np.log10(mu)) if mu > 0 else LEAST_PLACE
