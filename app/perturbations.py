"""Local perturbations of the packing on screen, and what the stores know about those of others."""

from typing import NamedTuple

import numpy as np

from granforce import study

from .compute import found_or_made
from .distributions import alike, rows

# Fewer contacts than this say little about the mean over all.
ENOUGH_CONTACTS = 10


class Loads(NamedTuple):
    """Limit loads of all contacts, in ⟨f_n⟩."""

    load: np.ndarray  # (N_c,)
    gap: float  # largest duality gap, ⟨f_n⟩
    seconds: float


class Pushed(NamedTuple):
    """What a force pair does that pushes the grains of one contact apart. Forces in ⟨f_n⟩."""

    contact: int  # position in the backbone
    limit: float  # limit load
    low: float  # F_crit: largest load at rest
    high: float  # least load that was not carried
    opened: int  # contacts that the first motion opens,
    slid: int  # at which grains slide
    kept: int  # and which stick
    breach: float  # of Coulomb's law by the motion
    displacement: np.ndarray  # (N, 2) first motion, rms 1; 0 for rattlers
    distance: np.ndarray  # (k,) of the backbone's grains from the contact, length
    size: np.ndarray  # (k,) |u| of those grains
    radius: np.ndarray  # (shells,) length
    profile: np.ndarray  # (shells,) mean |u|
    exponent: float  # α of |u| ~ r^−α for this contact alone
    seconds: float


def limit_loads(library, cell):
    """Work, for jobs.Task, that finds or computes the limit loads of all contacts."""

    def work(job):
        params = study.exact_parameters(cell.selection.packing, mu=cell.selection.mu)
        found = found_or_made(
            library,
            job,
            "limit loads of all contacts",
            "limit_loads",
            params,
            study.LIMIT_LOADS_VERSION,
            study.get_limit_loads,
        )
        scale = found["force_scale"].item()
        numbers = (found[name].item() for name in ("max_gap", "seconds"))
        return Loads(found["limit_load"].values / scale, *numbers)

    return work


def push(library, cell, replay, contact):
    """Work that finds or computes what a growing force pair on one contact does."""

    def work(job):
        params = study.perturbation_parameters(
            cell.selection.packing,
            mu=cell.selection.mu,
            contacts=[int(replay.backbone[contact])],
        )
        found = found_or_made(
            library,
            job,
            "contact dynamics under a growing load",
            "perturbation",
            params,
            study.PERTURBATION_VERSION,
            study.get_perturbation,
        )
        return _pushed(found, library.packing(cell.selection.packing), contact)

    return work


def _pushed(found, packing, contact):
    scale = found["force_scale"].item()
    forces = (found[name].values[0] / scale for name in _FORCES)
    counts = (int(found[name].values[0]) for name in ("opened", "slid", "kept"))
    u = found["displacement"].values[0]
    moves = np.isfinite(u).all(axis=1)
    distance = _distances(packing, found["backbone"].values[0])
    return Pushed(
        contact,
        *forces,
        *counts,
        breach=float(found["motion_breach"].values[0]),
        displacement=np.where(moves[:, None], u, 0.0),
        distance=distance[moves],
        size=np.linalg.norm(u[moves], axis=1),
        radius=found["shell_radius"].values,
        profile=found["profile"].values[0],
        exponent=found["decay_exponent"].item(),
        seconds=found["contact_seconds"].values[0].item(),
    )


_FORCES = ("limit_load", "critical_low", "critical_high")


def _distances(packing, contact):
    """Distance (N,) of every grain from the point of contact, by the nearest image."""
    c = packing.contacts
    apart = packing.x - packing.x[c.i[contact]] - c.arm_i[contact] * c.normal[contact]
    periodic = np.isfinite(packing.box)
    side = np.where(periodic, packing.box, 1.0)
    apart -= np.where(periodic, side * np.round(apart / side), 0.0)
    return np.linalg.norm(apart, axis=1)


def over_store(library, cells, cell):
    """One dict for each packing perturbed at enough contacts: as `figures.perturbation` takes them.

    η2 is that of the packing's states among the cells; those of the same kind as `cell` come first.
    """
    measured = {}
    for other in [*cells, *alike(cells, cell)]:
        measured[_key(other.selection.packing, other.selection.mu)] = other
    found = []
    for store in library.stores:
        for entry in store.find(kind="perturbation"):
            states = measured.get(_key(entry.params["packing"], entry.params["mu"]))
            if entry.version != study.PERTURBATION_VERSION or states is None:
                continue
            dataset = store[entry.name]
            if dataset.sizes["contact"] < ENOUGH_CONTACTS:
                continue
            load = dataset["limit_load"].values.mean() / dataset["force_scale"].item()
            values = {k: dataset[k].item() for k in ("critical_force", "decay_exponent")}
            measure = {k: rows([states])[0][k] for k in ("mu", "eta2")}
            found.append(measure | values | {"limit_load": load, "entry": entry.name})
    return list({row["entry"]: row for row in found}.values())


def _key(packing, mu):
    return tuple(sorted((k, str(v)) for k, v in packing.items())), mu
