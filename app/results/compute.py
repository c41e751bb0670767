"""Computations of the app on demand, as work for jobs.Task; all use study and the cache."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from granforce.live import hulls
from granforce.records import InputError, NotJammedError
from granforce.study import cells as study
from granforce.study import kinds
from granforce.study.cells import Kind
from granforce.study.keys import Parameters
from granforce.types import Floats

from ..background.jobs import Job, Work, in_turn
from . import durations, progress_feed
from .library import SOURCES, Cell, Library, Shown
from .replays import first_replay
from .selection import Selection

# What precedes the first states of each kind.
FIRST_STAGES = {
    "walk": "finding the contacts that carry force",
    "uniform": "finding the middle of S, where the samples start",
}
# The part of a compaction's expected steps, those of another packing, up to which their number can
# be relied on.
NEARLY = 0.95


def load_or_compute(
    library: Library, job: Job, stage: str, kind: Kind, params: Parameters, **options: Any
) -> xr.Dataset:
    """The dataset of a kind and parameters from a store, or computed in this stage.

    options: for the kind's compute.
    """
    result = library.stored(kind, params)
    if result is None:
        with in_turn(job, kind.name, params):
            library.lend_packing(params["packing"])
            with durations.expected(job, stage, kind.name, params):
                result, _ = study.get(
                    library.writable_cache, kind, params, **{"progress": job.tell} | options
                )
    return result


def states(library: Library, selection: Selection) -> Work:
    """Work that loads or computes the states of a Selection; returns their Shown."""

    kind, params = SOURCES[selection.kind], selection.parameters()

    def work(job: Job) -> Shown:
        with in_turn(job, selection.kind, params):
            cell = library.find(selection.kind, params)
            if cell is None:
                _make_packing(job, library, selection.packing)
                stage = FIRST_STAGES[selection.kind]
                with durations.expected(job, stage, kind.name, params), _naming_friction(selection):
                    dataset, _ = study.get(
                        library.writable_cache,
                        kind,
                        params,
                        progress=partial(_counted, job),
                        **_watched(job, selection, params),
                    )
                cell = library.find(selection.kind, kind.parameters_of(params, dataset))
            if cell is None:
                raise InputError("these networks were removed from the cache; compute them again")
        return library.shown(cell)

    return Work(work, wants=((selection.kind, params), ("packing", selection.packing)))


def all_states(library: Library, cell: Cell) -> Work:
    """Work that computes all states of a cell of which only some are stored; returns a Shown."""
    params = cell.selection.parameters()

    def work(job: Job) -> Shown:
        computed_anew(library, cell, params, job)
        whole = library.find(cell.kind, params)
        if whole is None:
            raise InputError("these networks were removed from the cache; compute them again")
        return library.shown(whole)

    return Work(work, wants=((cell.kind, params),))


def computed_anew(library: Library, cell: Cell, params: Parameters, job: Job) -> xr.Dataset:
    """Compute the states of a cell again and store more of them, as given by these parameters."""
    count = partial(_counted, job)
    return load_or_compute(
        library, job, "reading the packing", SOURCES[cell.kind], params, progress=count
    )


@contextmanager
def _naming_friction(selection: Selection) -> Iterator[None]:
    """If no forces balance, name a friction smaller than that of the packing as the cause."""
    try:
        yield
    except NotJammedError as error:
        packing_mu = selection.packing["mu"]
        if selection.mu >= packing_mu:
            raise
        raise InputError(
            f"no forces hold this packing at μ = {selection.mu:g}: it was made at μ = "
            f"{packing_mu:g}, and needs some of that friction; try a larger μ"
        ) from error


def _watched(job: Job, selection: Selection, params: Parameters) -> dict[str, Any]:
    """Options of the computation of states that let followers watch and stop it."""
    if selection.kind != "walk":
        return {}
    walking = progress_feed.shared(progress_feed.Walking, params)

    def begun(S: Any) -> None:
        job.begin("finding the first state")
        walking.restart(first_replay(S, params["states"]))

    def add(state: Any) -> None:
        job.keeps = True
        walking.add(state)

    return {"begun": begun, "watch": add, "enough": job.enough}


def exact(library: Library, shown: Shown) -> Work:
    """Work that computes the exact intervals for the states shown; returns a new Shown.

    Its partial result is {"low", "high": (N_c,)} of f_n in ⟨f_n⟩; NaN for bounds still to come.
    """
    params = shown.cell.selection.intervals

    def work(job: Job) -> Shown:
        replay = shown.replay
        found: dict[str, Floats] = {
            side: np.full(len(replay.backbone), np.nan) for side in ("low", "high")
        }

        def watch(bound: Any) -> None:
            job.so_far = found
            if bound.component == 0:
                place = np.searchsorted(replay.backbone, bound.contact)
                found["high" if bound.side else "low"][place] = bound.value / replay.force_scale

        dataset = load_or_compute(
            library, job, "exact intervals, widest first", kinds.INTERVALS, params, watch=watch,
            widths=replay.high[:, 0] - replay.low[:, 0],
        )  # fmt: skip
        result = Shown(shown.cell, shown.replay, dataset)
        library.keep_in_memory(result)
        return result

    return Work(work, wants=((kinds.INTERVALS.name, params),))


# Standard error of ln V in the app; the width of S is then known to 0.1 %.
VOLUME_ERROR = 0.1


def _volume_parameters(cell: Cell) -> Parameters:
    selection = cell.selection
    return kinds.VOLUME.parameters(selection.packing, VOLUME_ERROR, **selection.conditions)


def known_volume(library: Library, cell: Cell) -> Callable[[Job], tuple[Cell, xr.Dataset | None]]:
    """Work that looks up the volume of S of a cell's packing: (cell, dataset or None)."""
    return lambda job: (cell, library.stored(kinds.VOLUME, _volume_parameters(cell)))


def volume(library: Library, cell: Cell) -> Work:
    """Work that computes the volume of S of a cell's packing; returns (cell, dataset)."""
    params = _volume_parameters(cell)

    def work(job: Job) -> tuple[Cell, xr.Dataset]:
        def tell(done: float, total: float | None) -> None:
            job.stage = "volume of S"
            job.tell(done, total)

        stage = "volume of S: finding its walls"
        return cell, load_or_compute(library, job, stage, kinds.VOLUME, params, progress=tell)

    return Work(work, wants=((kinds.VOLUME.name, params),))


def thrust(library: Library, cell: Cell) -> Callable[[Job], dict[str, Any]]:
    """Work that bounds where the resultant at every joint of a cell's bodies can pass."""

    def work(job: Job) -> dict[str, Any]:
        packing = library.packing(cell.selection.packing)
        (a, b), low, high = hulls.thrust(packing, cell.mu)
        return {"a": a.tolist(), "b": b.tolist(), "low": low, "high": high}

    return work


def _make_packing(job: Job, library: Library, packing: Parameters) -> None:
    library.lend_packing(packing)
    if "imported" in packing:
        if library.stored(kinds.PACKING, packing) is None:
            raise InputError(
                "this packing is not on this server: drop its files under Your packing, or choose "
                "another scene"
            )
        return
    with in_turn(job, "packing", packing):
        if "scene" in packing:
            study.get(library.writable_cache, kinds.PACKING, packing)
        else:
            _compact(job, library, packing)


def _compact(job: Job, library: Library, packing: Parameters) -> None:
    steps = library.expected_steps(packing["n"], packing["mu"])

    def tell(step: float, _: float | None) -> None:
        guessed = steps if steps and step < NEARLY * steps else None
        job.tell(step, guessed)

    job.begin("compressing")
    feed = progress_feed.shared(progress_feed.Compaction, packing)
    feed.restart()

    def look(glimpse: Any) -> None:
        job.stage = f"compressing, step {glimpse.step}"  # other numbers are next to the picture
        feed.add(glimpse)

    study.get(library.writable_cache, kinds.PACKING, packing, progress=tell, watch=look)


def _counted(job: Job, done: float, total: float | None) -> None:
    job.stage = f"{done} of {total} networks"
    job.tell(done, total)
