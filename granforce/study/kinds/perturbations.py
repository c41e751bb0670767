"""Kinds of perturbations: of one contact, and of many as one result."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import xarray as xr

from granforce.explore.intervals import limit_load_bounds
from granforce.forces.ensemble import Ensemble
from granforce.perturb.critical_force import (
    MOST_STEPS,
    RISE,
    CriticalForce,
    Protocol,
    checked,
    critical_force,
    critical_forces,
)
from granforce.records import InputError, random_seed, whole
from granforce.study.cells import Kind, load, save
from granforce.study.keys import Parameters
from granforce.study.kinds.packings import check_complete, chosen_contacts, cones_of, ensemble_of
from granforce.study.responses import contact_dataset, perturbation_dataset
from granforce.study.store import Store
from granforce.types import Integers, Progress


def _perturbation_parameters(
    packing: Parameters,
    *,
    mu: Any = None,
    contacts: Iterable[int] | None = None,
    random: int | None = None,
    seed: int = 0,
    precision: float = 0.01,
    rise: float = RISE,
    max_steps: int = MOST_STEPS,
    **conditions: Any,
) -> Parameters:
    """The parameters of the local perturbation of contacts of one packing.

    mu: friction coefficient of the ensemble, by default the packing's. contacts: numbers in the
    packing's contact list, by default the whole backbone; or random: this many of the backbone, the
    first in an order drawn from seed. precision, rise, max_steps: as for `critical_force`.
    conditions: prescribed and stress.
    """
    if conditions.get("known") is not None:
        raise InputError(
            "moving grains change their forces, so known forces cannot hold: perturb the packing "
            "without them (limit loads accept known forces)"
        )
    if contacts is not None and random is not None:
        raise InputError("name the contacts to perturb, or how many at random, not both")
    return {
        **cones_of(packing, mu, **conditions),
        "contacts": chosen_contacts(contacts),
        "random": None if random is None else whole(random, "the number of random contacts", 1),
        "seed": None if random is None else random_seed(seed),
        **_protocol(precision, rise, max_steps),
    }


def _protocol(precision: Any, rise: Any, max_steps: Any) -> Parameters:
    """Parameters of how loads are raised; `rise` and `max_steps` only if not the default."""
    given, usual = checked(Protocol(precision, rise, max_steps))._asdict(), Protocol()._asdict()
    return {name: v for name, v in given.items() if name == "precision" or v != usual[name]}


def _perturbation(
    store: Store,
    parameters: Parameters,
    *,
    workers: int,
    progress: Progress | None,
    watch: Callable[[float, float], object] | None = None,
) -> xr.Dataset:
    """Dataset of critical forces, first motions and α; each contact is stored as it ends.

    watch(load, limit load) is called, in force, with each load at rest of a contact.
    """
    S = ensemble_of(store, parameters)
    chosen = S.index if parameters["contacts"] is None else np.array(parameters["contacts"])
    if parameters["random"] is not None:
        # The order is drawn among the positions of contacts in S.
        order = np.random.default_rng(parameters["seed"]).permutation(S.positions(chosen))
        chosen = S.index[np.sort(order[: parameters["random"]])]
    if not len(chosen):
        raise InputError("no contact to perturb")
    parts = _perturbed(store, S, chosen, parameters, workers, progress, watch)
    return perturbation_dataset(S, parts)


def _perturbed(
    store: Store,
    S: Ensemble,
    chosen: Integers,
    parameters: Parameters,
    workers: int,
    progress: Progress | None,
    watch: Callable[[float, float], object] | None,
) -> list[xr.Dataset]:
    """Datasets of the single contacts, in order, loaded from the store if possible."""
    shared = ("packing", "mu", *Protocol._fields, "prescribed", "stress")
    common = {name: parameters[name] for name in shared if name in parameters}
    named = {c: PERTURBED_CONTACT.parameters(contact=int(c), **common) for c in chosen}
    parts = {c: load(store, PERTURBED_CONTACT, named[c]) for c in chosen}
    parts = {c: dataset for c, dataset in parts.items() if dataset is not None}
    missing = [c for c in chosen if c not in parts]
    if not missing:
        return [parts[c] for c in chosen]
    loads = limit_load_bounds(S, missing, workers=workers)
    check_complete(S, loads, "limit loads")
    tell = progress or (lambda done, total: None)

    def ended(k: int, critical: CriticalForce) -> None:
        contact = missing[k]
        parts[contact] = contact_dataset(S, critical, parameters["precision"])
        save(store, PERTURBED_CONTACT, named[contact], parts[contact])
        tell(len(parts), len(chosen))

    critical_forces(
        S,
        missing,
        limit_loads=loads.load,
        workers=workers,
        finished=ended,
        watch=watch and (lambda k, load: watch(load, float(loads.load[k]))),
        **_named_protocol(parameters),
    )
    return [parts[c] for c in chosen]


def _named_protocol(parameters: Parameters) -> dict[str, Any]:
    return {name: parameters[name] for name in Protocol._fields if name in parameters}


def _perturbed_contact_parameters(
    packing: Parameters,
    contact: Any,
    *,
    mu: Any = None,
    precision: float = 0.01,
    rise: float = RISE,
    max_steps: int = MOST_STEPS,
    **conditions: Any,
) -> Parameters:
    """The parameters of one perturbed contact (its number in the packing)."""
    return {
        **cones_of(packing, mu, **conditions),
        "contact": whole(contact, "the number of a contact"),
        **_protocol(precision, rise, max_steps),
    }


def _perturbed_contact(
    store: Store, parameters: Parameters, *, workers: int, progress: Progress | None
) -> xr.Dataset:
    """Dataset of one perturbed contact."""
    S = ensemble_of(store, parameters)
    critical = critical_force(S, parameters["contact"], **_named_protocol(parameters))
    return contact_dataset(S, critical, parameters["precision"])


PERTURBATION = Kind(
    name="perturbation",
    version=3,
    title="local perturbation",
    unit="contact",
    parameters=_perturbation_parameters,
    compute=_perturbation,
)
PERTURBED_CONTACT = Kind(
    name="perturbed_contact",
    version=PERTURBATION.version,
    title="perturbed contact",
    unit="load",
    parameters=_perturbed_contact_parameters,
    compute=_perturbed_contact,
)
