"""The snapshots of a simulation: exact intervals and walks of each, in one dataset over time."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from granforce.forces.balance import left_open_in
from granforce.packing.importers.network import accuracy_of
from granforce.packing.importers.snapshots import Snapshot, Snapshots
from granforce.records import InputError, Packing, takes
from granforce.study import kinds
from granforce.study.cells import StudyCell, get
from granforce.study.scan import run
from granforce.study.schema import attributes
from granforce.study.series import ends_of, over_frames, pair_names
from granforce.study.store import open_store
from granforce.system import cancelling
from granforce.types import Progress

# Attributes of the numbers of a snapshot.
SCALARS = {
    "time": {"units": "", "long_name": "timestep, or time"},
    "grains": {"units": "1", "long_name": "number of grains whose balance is required"},
    "contacts": {"units": "1", "long_name": "number of contacts that carry force"},
    **{name: attributes(name) for name in ("rattlers", "packing_fraction", "pressure")},
    "mean_normal_force": {
        **attributes("force_scale"),
        "long_name": "mean normal force of the backbone",
    },
    **{name: attributes(name) for name in ("coordination", "dimension", "eta1", "eta2", "eta3")},
    "residual": {
        **attributes("residual"),
        "long_name": "largest unbalance of the simulation's own forces",
    },
}
_FORCES = {"forces": "of the simulation", "low": "least in S", "high": "largest in S"}


@takes(snapshots=Snapshots)
@cancelling.shown
def evolution(
    path: str | Path,
    snapshots: Snapshots,
    numbers: Sequence[int] | None = None,
    *,
    states: int = 0,
    seed: int = 0,
    workers: int = 2,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> tuple[xr.Dataset | None, list[tuple[int, str]]]:
    """Exact intervals of all snapshots, computed into the store at path or loaded from it.

    Parameters
    ----------
    path : path
        Folder of the store.
    snapshots : Snapshots
        From `open_lammps` or `open_mercury`.
    numbers : sequence of int, optional
        Of the snapshots, by default all.
    states : int, default 0
        Of a random walk from each, for η1 and η2; 0: none.
    seed : int, default 0
        Seed of the walks.
    workers, scheduler, progress
        As for `scan`.

    Returns
    -------
    dataset : xr.Dataset or None
        (frame, contact, component) with f_n and f_t of each contact (forces, low, high; a contact
        is a pair of ids, NaN in snapshots without it) and SCALARS by frame (NaN if undefined: η1
        and η2 without a walk, φ and P in an open box); its attribute notes lists notes on each
        snapshot. None if no snapshot could be used.
    failed : list of tuple
        (number, message) of the snapshots that failed.

    Raises
    ------
    InputError
        If the store cannot be written.
    """
    store = open_store(path)
    failed: list[tuple[int, str]] = []
    read: list[tuple[int, Snapshot, list[StudyCell]]] = []
    for number in snapshots.numbers if numbers is None else numbers:
        try:
            snapshot = snapshots.chosen(number)
        except InputError as error:
            failed.append((number, str(error)))
            continue
        named = kinds.imported_parameters(snapshot.packing)
        store.make()  # processes load the packing from there
        kinds.keep_packing(store, named, snapshot.packing, in_memory=True)
        cells = [StudyCell(kinds.INTERVALS, kinds.INTERVALS.parameters(named))]
        if states:
            cells.append(StudyCell(kinds.WALK, kinds.WALK.parameters(named, states, seed)))
        read.append((number, snapshot, cells))
    work = [cell for *_, cells in read for cell in cells]
    refused = run(path, work, workers=workers, scheduler=scheduler, progress=progress)
    lost = {id(cell): message for cell, message in refused}
    done = []
    for number, snapshot, cells in read:
        messages = [lost[id(cell)] for cell in cells if id(cell) in lost]
        failed += [(number, message) for message in messages[:1]]
        if not messages:
            results = [get(store, *cell, workers=workers)[0] for cell in cells]
            done.append((number, snapshot, results))
    return (_combined(done) if done else None), sorted(failed)


def _combined(done: Sequence[tuple[int, Snapshot, list[xr.Dataset]]]) -> xr.Dataset:
    """One dataset of [(number, its snapshot, intervals and perhaps a walk), …]."""
    names = []
    for _, snapshot, _ in done:
        contacts = snapshot.packing.contacts
        names.append(pair_names(snapshot.ids, contacts.i, contacts.j))
    pairs, places = over_frames(names)
    arrays = {name: np.full((len(done), len(pairs), 2), np.nan) for name in _FORCES}
    for k, ((_, snapshot, (bounds, *_)), (source, into)) in enumerate(
        zip(done, places, strict=True)
    ):
        arrays["forces"][k, into] = snapshot.packing.forces[source]
        for name in ("low", "high"):
            # Contacts outside the backbone carry no force in any network.
            forces = np.zeros_like(snapshot.packing.forces)
            forces[bounds["backbone"].values] = bounds[name].values
            arrays[name][k, into] = forces[source]
    rows = [_scalars(number, snapshot.packing, *results) for number, snapshot, results in done]
    variables: dict[str, Any] = {}
    for name, meaning in _FORCES.items():
        described = {**attributes(name), "long_name": meaning}
        variables[name] = (("frame", "contact", "component"), arrays[name], described)
    for name, described in SCALARS.items():
        variables[name] = (("frame",), [row[name] for row in rows], described)
    coordinates = {"frame": [number for number, *_ in done], "component": ["f_n", "f_t"]}
    notes = {str(number): snapshot.packing.info.get("notes", []) for number, snapshot, _ in done}
    return xr.Dataset(variables, coordinates | ends_of(pairs), {"notes": json.dumps(notes)})


def _scalars(
    number: int, packing: Packing, bounds: xr.Dataset, walk: xr.Dataset | None = None
) -> dict[str, float]:
    """The SCALARS of one snapshot."""
    closed, balanced = bool(np.isfinite(packing.volume)), ~left_open_in(packing)
    carrying = packing.contacts.picked(bounds["backbone"].values)
    rattlers = balanced.copy()
    rattlers[np.union1d(carrying.i, carrying.j)] = False
    return {
        "time": float(packing.info.get("time", number)),
        "grains": int(balanced.sum()),
        "contacts": len(packing.contacts.i),
        "packing_fraction": float(packing.packing_fraction) if closed else np.nan,
        "pressure": float(packing.pressure),
        "mean_normal_force": bounds["force_scale"].item(),
        **{name: bounds[name].item() for name in ("coordination", "dimension", "eta3")},
        **{name: np.nan if walk is None else walk[name].item() for name in ("eta1", "eta2")},
        "rattlers": int(rattlers.sum()),
        "residual": accuracy_of(packing)["residual"],
    }
