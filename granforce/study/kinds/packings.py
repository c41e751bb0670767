"""Stored packings, and the ensembles of their forces."""

import hashlib
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import xarray as xr

from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.packing.compaction import (
    COARSEST,
    Glimpse,
    check_box,
    check_drag,
    default_steps,
    draw_radii,
    number_of_disks,
    pack,
)
from granforce.packing.scenes import scene
from granforce.records import InputError, Packing, friction, moderate, positive, random_seed, whole
from granforce.study.cells import Kind, get, load, packing_version, save
from granforce.study.conditions import conditions
from granforce.study.conditions import of as conditions_of
from granforce.study.keys import Parameters, canonical
from granforce.study.kinds import slices
from granforce.study.schema import dataset_packing, packing_dataset
from granforce.study.store import Store
from granforce.system import cancelling
from granforce.types import Progress


def _packing_parameters(
    n: int,
    mu: Any,
    seed: int,
    *,
    radii: Any = "uniform:0.5,1",
    pressure: float = 1.0,
    dt: float | None = None,
    box_mass: float = 100.0,
    sweeps: int | None = None,
    accuracy: float = 0.01,
    drag_below: float | None = None,
    box: str = "square",
) -> Parameters:
    """The parameters of a packing in the store; arguments as for `pack`.

    Raises InputError for arguments that `pack` would reject, or too many disks for the memory.
    """
    n = number_of_disks(n)
    drawn = draw_radii(radii, n, np.random.default_rng(0))
    mu = friction(mu)
    dt, sweeps = default_steps(mu, dt, sweeps)
    drag_below = check_drag(drag_below, mu)
    return {
        "n": n,
        "mu": mu,
        "seed": random_seed(seed),
        "radii": radii if isinstance(radii, str) else drawn.tolist(),
        "pressure": moderate(pressure, "pressure"),
        "dt": moderate(dt, "dt"),
        "box_mass": moderate(box_mass, "box_mass"),
        "sweeps": whole(sweeps, "sweeps", 1),
        "accuracy": positive(accuracy, "accuracy", most=COARSEST),
        "version": packing_version(mu, n),
        # Only if not the default, so that keys of other packings stay valid.
        **({} if check_box(box) == "square" else {"box": box}),
        **({} if drag_below is None else {"drag_below": drag_below}),
    }


def imported_parameters(packing: Packing) -> Parameters:
    """The parameters of an imported packing: a hash of its arrays."""
    arrays = (packing.x, packing.r, packing.box, packing.forces, packing.load, *packing.contacts)
    # Only if there are levers, shapes, or a tilt, so that keys of disks in straight cells stay
    # valid.
    given = [array for array in (*arrays, *(packing.shapes or ())) if array is not None]
    tilt = [packing.tilt] if packing.tilt else []
    digest = hash_of(*given, np.array([packing.mu, packing.pressure, *tilt]))
    return {"imported": digest, "mu": packing.mu}


def parameters_of(store: Store, packing: Packing) -> Parameters:
    """The parameters of a packing: those with which `pack` made it, else those of an imported one.

    The former only if the store has the same packing under them, bit for bit; only gaps, which
    files give by the radii, may differ by rounding.
    """
    made = _made(packing)
    stored = None if made is None else load(store, PACKING, made)
    if made is not None and stored is not None:
        own, contacts = dataset_packing(stored), packing.contacts
        same = own._replace(info=packing.info, contacts=own.contacts._replace(gap=contacts.gap))
        if same == packing:
            return made
    return imported_parameters(packing)


def _made(packing: Packing) -> Parameters | None:
    """The parameters that the info of a packing names, or None."""
    settings = ("seed", "radii", "dt", "box_mass", "sweeps", "accuracy", "drag_below", "box")
    given = {name: packing.info[name] for name in settings if name in packing.info}
    disks = packing.info.get("disks", len(packing.r))  # others are behind walls
    if not np.isnan(packing.pressure):  # not on a floor
        given["pressure"] = packing.pressure
    if given.get("radii") == "list":
        given["radii"] = packing.r[:disks].tolist()
    try:
        return _packing_parameters(disks, packing.mu, **given)
    except (TypeError, ValueError):  # of another program
        return None


def hash_of(*arrays: Any) -> str:
    """A hash of arrays."""
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _packing(
    store: Store,
    parameters: Parameters,
    *,
    workers: int,
    progress: Progress | None,
    max_steps: int = 100_000,
    watch: Callable[[Glimpse], object] | None = None,
) -> xr.Dataset:
    if "imported" in parameters:
        raise InputError("the imported packing is not in this store: import it again")
    if "scene" in parameters:
        return packing_dataset(scene(parameters["scene"], parameters["mu"]))
    callbacks: dict[str, Any] = {"progress": progress, "watch": watch}
    arguments = {name: value for name, value in parameters.items() if name != "version"}
    return packing_dataset(pack(**arguments, max_steps=max_steps, **callbacks))


def get_packing(store: Store, parameters: Parameters, **options: Any) -> tuple[Packing, bool]:
    """The Packing of these parameters, and whether it was loaded, not made; as `cells.get`."""
    dataset, cached = get(store, PACKING, parameters, **options)
    return dataset_packing(dataset), cached


def keep_packing(
    store: Store, parameters: Parameters, packing: Packing, *, in_memory: bool = False
) -> str:
    """Save a packing under its parameters; returns the entry's name.

    in_memory: as for Store.keep, for imported packings, which cannot be made again.
    """
    return save(store, PACKING, parameters, packing_dataset(packing), in_memory=in_memory)


def cones_of(packing: Parameters, mu: Any, **named: Any) -> Parameters:
    """The parameters of an ensemble: its packing, friction coefficient (default: its), conditions.

    named: prescribed, stress and known, as for `conditions`.
    """
    cones = {"packing": packing, "mu": packing["mu"] if mu is None else friction(mu)}
    return cones | conditions(**named)


# Parameters on which an ensemble depends, and the last ensemble, which the next results of the same
# packing share.
_OF_ENSEMBLE = "packing", "mu", "slice", "prescribed", "stress", "known"
_last: tuple[tuple[str, str], Ensemble] | None = None


def ensemble_of(store: Store, parameters: Parameters) -> Ensemble:
    """The ensemble of a stored packing and friction, with the forces outside a slice frozen."""
    global _last
    key, last = _key(store, parameters), _last
    if last is not None and last[0] == key:
        return last[1]
    last = _last = None  # its memory may be needed
    packing, _ = get_packing(store, parameters["packing"])
    slice_ = parameters.get("slice")
    frozen = None if slice_ is None else slices.outside(packing, slice_)
    S = ensemble(packing, parameters["mu"], frozen=frozen, **conditions_of(parameters))
    _last = key, S
    return S


def remember(store: Store, parameters: Parameters, S: Ensemble) -> None:
    """Let the next results use this ensemble, which must be that of the parameters."""
    global _last
    _last = _key(store, parameters), S


def _key(store: Store, parameters: Parameters) -> tuple[str, str]:
    named = {name: parameters[name] for name in _OF_ENSEMBLE if parameters.get(name) is not None}
    return str(store.path), canonical(named)


def chosen_contacts(contacts: Iterable[int] | None) -> list[int] | None:
    """Numbers of contacts, sorted and unique; None for all in the backbone."""
    if contacts is None:
        return None
    chosen = sorted({whole(c, "the number of a contact") for c in contacts})
    if not chosen:
        raise InputError("name at least one contact, or leave the contacts out for all")
    return chosen


def check_complete(S: Ensemble, result: Any, what: str) -> None:
    """Raise Cancelled or InputError for unfinished results, which are not stored.

    In an unbounded S single values may stay uncertified (NaN): see `certified_values`.
    """
    cancelling.check(what)
    if not result.converged and S.bounded:
        worst = np.nanmax(result.gap)
        raise InputError(f"{what} not certified: largest duality gap {worst:.1e} ⟨f_n⟩")


PACKING = Kind(
    name="packing",
    version=3,  # later versions are in the parameters: `packing_version`
    title="compaction",
    unit="step",
    parameters=_packing_parameters,
    compute=_packing,
)
