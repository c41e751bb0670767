"""Local perturbations of the packing on screen, and stored ones of other packings."""

import json
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from granforce.records import InputError, Packing
from granforce.study import kinds
from granforce.study.cells import entries
from granforce.study.keys import Parameters
from granforce.study.responses import moved_grains
from granforce.types import Floats, Integers

from ..background.jobs import Job
from ..background.limits import LIMITS
from ..results import geometry
from ..results.compute import load_or_compute
from ..results.distributions import Row, alike, rows
from ..results.library import Cell, Library, readable
from ..results.replays import Replay, flat
from .pulls import puller_of

# With fewer contacts the mean is not meaningful.
ENOUGH_CONTACTS = 10
UNASKED = "this push takes long, and a link starts no long computation on this server: press Find"


class Loads(NamedTuple):
    """Limit loads of all contacts, in ⟨f_n⟩."""

    load: Floats  # (N_c,)
    gap: float  # largest duality gap, ⟨f_n⟩
    seconds: float


class Motion(NamedTuple):
    """A first motion to draw, still or animated."""

    field: Floats  # (N, 2) displacements
    contacts: Integers  # (N_c,) as those of Pushed
    animated: bool


class Pushed(NamedTuple):
    """The effect of a force pair that pushes the grains of one contact apart.

    Forces are in ⟨f_n⟩, lengths in `geometry.unit`.
    """

    limit: float  # limit load
    low: float  # F_crit: largest load at rest
    high: float  # least load that did not end at rest
    opened: int  # contacts that the first motion opens,
    slid: int  # contacts that slide
    kept: int  # contacts that stick
    path: dict[
        str, Any
    ]  # networks under loads from 0 to `low`, nearest to the original, for scripts
    displacement: Floats  # (N, 2) first motion, rms 1; 0 for rattlers
    contacts: Integers  # (N_c,) 0 holds, 1 slides, 2 opens; all 0 in results of earlier versions
    distance: Floats  # (k,) of the backbone's grains from the contact
    size: Floats  # (k,) |u| of those grains
    radius: Floats  # (shells,)
    profile: Floats  # (shells,) mean |u|
    exponent: float  # α of |u| ~ r^−α for this contact alone
    fit: tuple[float, ...]  # smallest and largest r of its fit
    spread: tuple[float, float]  # α of other ranges of r; NaN where no fit is possible


def limit_loads(library: Library, cell: Cell) -> Callable[[Job], Loads]:
    """Work for jobs.Task that loads or computes the limit load of every contact."""

    def work(job: Job) -> Loads:
        params = kinds.LIMIT_LOADS.parameters(cell.selection.packing, mu=cell.selection.mu)
        stage = "limit load of every contact"
        dataset = load_or_compute(library, job, stage, kinds.LIMIT_LOADS, params)
        scale = dataset["force_scale"].item()
        return Loads(
            load=dataset["limit_load"].values / scale,
            gap=dataset["max_gap"].item(),
            seconds=dataset["seconds"].item(),
        )

    return work


def push(
    library: Library, cell: Cell, replay: Replay, contact: int, *, linked: bool = False
) -> Callable[[Job], Pushed]:
    """Work that loads or computes the effect of a growing force pair on one contact.

    linked: requested by a link, which starts no long computation on a shared server.
    """

    def work(job: Job) -> Pushed:
        params = kinds.PERTURBATION.parameters(
            cell.selection.packing, mu=cell.selection.mu, contacts=[int(replay.backbone[contact])]
        )
        if linked and LIMITS.shared and library.stored(kinds.PERTURBATION, params) is None:
            raise InputError(UNASKED)
        stage = "limit load, then contact dynamics under a growing load"
        scale = replay.force_scale

        def watch(load: float, limit: float) -> None:
            job.stage = (
                f"at rest under {load / scale:.3f} ⟨fₙ⟩, limit load {limit / scale:.3f} ⟨fₙ⟩"
            )

        dataset = load_or_compute(
            library, job, stage, kinds.PERTURBATION, params, watch=watch,
            progress=lambda done, total: None,  # of contacts, of which there is one
        )  # fmt: skip
        low = dataset["critical_low"].values[0].item()
        job.begin("networks under smaller loads")
        under = puller_of(library, cell, []).loaded(int(replay.backbone[contact]), low)
        packing = library.packing(cell.selection.packing)
        return _pushed(dataset, packing, under)

    return work


def path(under: Any, scale: float) -> dict[str, Any]:
    """Networks under growing loads for a script: flat arrays, forces in ⟨f_n⟩."""
    networks = flat(under.states / scale)
    return {"values": under.loads / scale, **networks, "residual": under.residual}


def _pushed(dataset: xr.Dataset, packing: Packing, under: Any) -> Pushed:
    of, scale = dataset.isel(contact=0), dataset["force_scale"].item()
    distance, size = moved_grains(packing, dataset)
    length, none = geometry.unit(packing), np.zeros(under.states.shape[1], dtype=int)
    return Pushed(
        limit=of["limit_load"].item() / scale,
        low=of["critical_low"].item() / scale,
        high=of["critical_high"].item() / scale,
        opened=int(of["opened"]),
        slid=int(of["slid"]),
        kept=int(of["kept"]),
        path=path(under, scale),
        displacement=np.nan_to_num(of["displacement"].values),
        contacts=of["contact_motion"].values if "contact_motion" in of else none,
        distance=distance / length,
        size=size,
        radius=dataset["shell_radius"].values / length,
        profile=of["profile"].values,
        exponent=dataset["decay_exponent"].item(),
        fit=tuple(r / length for r in json.loads(dataset.attrs["fit_range"])),
        spread=_range(dataset["fit_exponent"].values),
    )


def _range(values: Floats) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if len(known) else (np.nan, np.nan)


def over_store(library: Library, cells: Iterable[Cell], cell: Cell) -> list[Row]:
    """A dict per packing perturbed at enough contacts, as for `figures.perturbation`.

    η2 is that of the packing's states among the cells, preferably of the same kind as `cell`.
    """
    measured = {}
    for other in [*cells, *alike(cells, cell)]:
        measured[_key(other.selection.packing, other.selection.mu)] = other
    collected = []
    for store in library.stores:
        for entry in entries(store, kinds.PERTURBATION):
            states = measured.get(_key(entry.params["packing"], entry.params["mu"]))
            if states is None:
                continue
            with readable(store, entry.name) as dataset:
                if dataset.sizes["contact"] < ENOUGH_CONTACTS:
                    continue
                load = dataset["limit_load"].values.mean() / dataset["force_scale"].item()
                values = {k: dataset[k].item() for k in ("critical_force", "decay_exponent")}
            measure = {k: rows([states])[0][k] for k in ("mu", "eta2")}
            collected.append(measure | values | {"limit_load": load, "entry": entry.name})
    return list({row["entry"]: row for row in collected}.values())


def _key(packing: Parameters, mu: float) -> tuple[Any, ...]:
    return tuple(sorted((k, str(v)) for k, v in packing.items())), mu
