"""What the app shows, as plain arrays: no widgets, no plots.

The only module of the app, with `jobs`, that knows stores and studies.
"""

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np

from granforce import study
from granforce.records import InputError
from granforce.store import open_store

# Environment variable naming a store of finished results to open instead of data/start.zarr.
SHIPPED_VARIABLE = "GRANFORCE_DATA"
SHIPPED = Path(__file__).resolve().parent.parent / "data" / "start.zarr"

# Names on screen of study.RELAXATIONS; the first is what a new walk takes unless told otherwise.
SOLVERS = {
    "nearest": "nearest admissible state",
    "gauss_seidel": "Gauss–Seidel, finished exactly",
    "gauss_seidel_only": "paper's plain Gauss–Seidel",
    "accelerated": "nearest admissible state, own solver",
}

# Width of the strip around the periodic box in which images are drawn, in largest radii.
MARGIN = 1.0


class Cell(NamedTuple):
    """One walk that a store holds: what it is called on screen, and how to get it."""

    series: str  # everything but μ, in words; cells of one series form one η(μ)
    mu: float  # friction coefficient of the ensemble
    params: dict  # walk parameters, as for study.get_walk
    store: object  # the store that holds it


class Disks(NamedTuple):
    """Disks and their periodic images that are seen, k rows."""

    x: np.ndarray  # (k,) length
    y: np.ndarray
    r: np.ndarray
    grain: np.ndarray  # (k,) number of the grain
    contacts: np.ndarray  # (k,) its number of force-bearing contacts
    image: np.ndarray  # (k,) bool, whether the centre lies outside the box


class Links(NamedTuple):
    """Contacts of the backbone and their periodic images as segments, k rows."""

    x0: np.ndarray  # (k,) centre of grain i, length
    y0: np.ndarray
    x1: np.ndarray  # (k,) that centre + ℓ n
    y1: np.ndarray
    contact: np.ndarray  # (k,) position among the backbone's contacts
    i: np.ndarray  # (k,) numbers of the two grains
    j: np.ndarray


class Replay(NamedTuple):
    """A walk to look at: geometry, frames and numbers. Forces are in ⟨f_n⟩."""

    disks: Disks
    links: Links
    box: np.ndarray  # (2,) sides; inf where open
    window: tuple  # x_low, x_high, y_low, y_high of the view, a square
    normal: np.ndarray  # (F, N_c) float32 f_n: the original network, then the states kept
    tangential: np.ndarray  # (F, N_c) float32 f_t
    number: np.ndarray  # (F,) number of the state, 0 for the original
    distance: np.ndarray  # (F,) from the centre of the states
    residual: np.ndarray  # (F,) NaN for the original
    order: np.ndarray  # (N_c,) contacts by original f_n, ascending
    summary: dict  # plain numbers of the walk, by their names in the schema


class Library:
    """The stores side by side: finished results, read-only, and the user's own cache."""

    def __init__(self, shipped=None, cache=None):
        """shipped, cache: folders; by default $GRANFORCE_DATA or data/start.zarr, and the cache."""
        self.notes = []  # one line for each store that cannot be used
        shipped = shipped or os.environ.get(SHIPPED_VARIABLE) or SHIPPED
        self.shipped = self._open(shipped, readonly=True)
        self.cache = self._open(cache, readonly=False)
        self._rows = {}

    def _open(self, path, readonly):
        try:
            return open_store(path, readonly=readonly)
        except InputError as error:
            self.notes.append(str(error))
            return None

    @property
    def stores(self):
        """The stores that could be opened; what both hold is taken from the first."""
        return [store for store in (self.shipped, self.cache) if store is not None]

    def cells(self):
        """All walks of the current algorithms, by series and μ."""
        found = {}
        for store in self.stores:
            for entry in store.find(kind="walk"):
                if entry.version == study.WALK_VERSION:
                    found.setdefault(entry.name, _cell(entry.params, store))
        return sorted(found.values(), key=lambda cell: (cell.series, cell.mu))

    def find(self, params):
        """The cell of these walk parameters, or None."""
        for store in self.stores:
            name = store.name("walk", params, version=study.WALK_VERSION)
            if name in store:
                return _cell(params, store)
        return None

    def replay(self, cell):
        """The Replay of one cell. InputError if its packing is not in the same store."""
        dataset, _ = study.get_walk(cell.store, cell.params)
        packing, _ = study.get_packing(cell.store, cell.params["packing"])
        return make_replay(packing, dataset, cell.mu)

    def table(self, cells):
        """One row of measures for each cell, as study.row; `cell` is its position."""
        rows = []
        for cell in cells:
            key = cell.store.name("walk", cell.params, version=study.WALK_VERSION)
            if key not in self._rows:
                dataset, _ = study.get_walk(cell.store, cell.params)
                self._rows[key] = study.row(cell.params, dataset, True) | {"mu": cell.mu}
            rows.append(self._rows[key])
        return rows

    def lend_packing(self, params):
        """Copy a packing that only the shipped store has to the cache: it need not be made anew."""
        if (
            self.shipped is None
            or self.shipped.name("packing", params, version=study.PACKING_VERSION)
            not in self.shipped
        ):
            return
        packing, _ = study.get_packing(self.shipped, params)
        study.keep_packing(self.cache, params, packing)

    def expected_steps(self, n, mu):
        """Compaction steps of the stored packing of n grains with the nearest μ, or None."""
        known = []
        for store in self.stores:
            for entry in store.find(kind="packing", n=n):
                if entry.version == study.PACKING_VERSION:
                    away = abs(np.log((entry.params["mu"] + 1e-3) / (mu + 1e-3)))
                    known.append((away, entry.name, store))
        if not known:
            return None
        _, name, store = min(known, key=lambda found: found[:2])
        return study.dataset_packing(store[name]).info.get("steps")


def _cell(params, store):
    return Cell(series_name(params), float(params["mu"]), params, store)


def series_name(params):
    """Everything but μ that names a walk, in words."""
    packing = params["packing"]
    if "imported" in packing:
        words = [f"imported {packing['imported'][:8]}"]
    else:
        words = [f"N = {packing['n']}", f"seed {packing['seed']}"]
        usual = study.packing_parameters(packing["n"], packing["mu"], packing["seed"])
        more = {name: value for name, value in packing.items() if usual.get(name) != value}
        words += [f"{name} {value}" for name, value in sorted(more.items())]
    if params["mu"] != packing["mu"]:
        words.append(f"packed at μ = {packing['mu']:g}")
    words.append(f"{params['states']} states")
    if params["seed"] != 0:
        words.append(f"walk seed {params['seed']}")
    if params["chains"] > 1:
        words.append(f"{params['chains']} chains")
    words.append(SOLVERS.get(params["relax"], params["relax"]))
    return ", ".join(words)


def make_replay(packing, dataset, mu):
    """The Replay of a walk dataset on its packing; μ is that of the ensemble."""
    backbone = dataset["backbone"].values
    scale = float(dataset["force_scale"])
    frames = np.concatenate([dataset["original"].values[None], dataset["states"].values]) / scale
    frames = frames.astype(np.float32)
    x = _into_box(packing)
    window = _window(x, packing)
    summary = {name: array.item() for name, array in dataset.items() if array.ndim == 0}
    summary |= {"mu": mu, "n": len(packing.r), "contacts": len(backbone)}
    kept, states = dataset.sizes["state"], _states(summary)
    number = np.linspace(0, states - 1, kept).astype(int) + 1
    summary |= {"kept": kept, "states": states}
    return Replay(
        disks=_disks(packing, x, window, backbone),
        links=_links(packing, x, window, backbone),
        box=packing.box,
        window=window,
        normal=np.ascontiguousarray(frames[..., 0]),
        tangential=np.ascontiguousarray(frames[..., 1]),
        number=np.append(0, number),
        distance=np.append(summary["original_distance"], dataset["distance_to_centre"].values),
        residual=np.append(np.nan, dataset["residual"].values),
        order=np.argsort(frames[0, :, 0], kind="stable"),
        summary=summary,
    )


def _states(summary):
    """States that the walk accepted, or would have where S is one point."""
    return int(summary["accepted"] + summary["skipped"])


def _into_box(packing):
    """Centres moved into [0, L) along each periodic axis."""
    periodic = np.isfinite(packing.box)
    return np.where(periodic, packing.x % np.where(periodic, packing.box, 1.0), packing.x)


def _window(x, packing):
    """A square that holds the box (or, where open, the grains) and a margin."""
    margin = MARGIN * packing.r.max()
    periodic = np.isfinite(packing.box)
    low = np.where(periodic, 0.0, (x - packing.r[:, None]).min(axis=0))
    high = np.where(periodic, packing.box, (x + packing.r[:, None]).max(axis=0))
    middle, half = (low + high) / 2, (high - low).max() / 2 + margin
    corners = np.stack([middle - half, middle + half], axis=1)
    return tuple(float(value) for value in corners.ravel())


def _shifts(packing):
    """Shifts by −1, 0, 1 boxes along each periodic axis, (k, 2)."""
    steps = [(-1, 0, 1) if np.isfinite(side) else (0,) for side in packing.box]
    sides = np.where(np.isfinite(packing.box), packing.box, 0.0)
    return np.array([(a, b) for a in steps[0] for b in steps[1]]) * sides


def _seen(low, high, packing, window):
    """Rows whose extent (k, 2) reaches into the drawn strip around the box."""
    margin = MARGIN * packing.r.max()
    open_low, open_high = np.array(window[::2]), np.array(window[1::2])
    edge_low = np.where(np.isfinite(packing.box), -margin, open_low)
    edge_high = np.where(np.isfinite(packing.box), packing.box + margin, open_high)
    return np.all((high > edge_low) & (low < edge_high), axis=1)


def _disks(packing, x, window, backbone):
    i, j = packing.contacts.i[backbone], packing.contacts.j[backbone]
    number = np.bincount(i, minlength=len(x)) + np.bincount(j, minlength=len(x))
    parts = []
    for shift in _shifts(packing):
        r = packing.r[:, None]
        grain = np.flatnonzero(_seen(x + shift - r, x + shift + r, packing, window))
        at = x[grain] + shift
        image = np.full(len(grain), bool(np.any(shift)))
        parts.append((at[:, 0], at[:, 1], packing.r[grain], grain, number[grain], image))
    return Disks(*(np.concatenate(field) for field in zip(*parts, strict=True)))


def _links(packing, x, window, backbone):
    i, j = packing.contacts.i[backbone], packing.contacts.j[backbone]
    reach = packing.contacts.length[backbone, None] * packing.contacts.normal[backbone]
    parts = []
    # From a centre inside the box a contact may reach out of it, so its image may come in.
    for shift in _shifts(packing):
        begin = x[i] + shift
        end = begin + reach
        low, high = np.minimum(begin, end), np.maximum(begin, end)
        contact = np.flatnonzero(_seen(low, high, packing, window))
        ends = (*begin[contact].T, *end[contact].T)
        parts.append((*ends, contact, i[contact], j[contact]))
    return Links(*(np.concatenate(field) for field in zip(*parts, strict=True)))
