"""Kinds of states of S: walks, uniform samples, the volume, and inferred forces."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr

from granforce.experiment import remeasured
from granforce.experiment.carrying import carrying
from granforce.experiment.infer import infer
from granforce.experiment.informative import informative
from granforce.explore.random_walk import RELAXATIONS, Walk, walk
from granforce.explore.uniform import sample_uniform
from granforce.explore.volume import LEAST_ACCURACY, volume
from granforce.forces.ensemble import Ensemble
from granforce.forces.likeliest import UNMEASURED, spread_of
from granforce.records import InputError, choice, positive, random_seed, whole
from granforce.study.bounds import informative_dataset, volume_dataset
from granforce.study.cells import Kind, entries, load
from granforce.study.keys import Parameters
from granforce.study.kinds.packings import cones_of, ensemble_of, hash_of
from granforce.study.samples import inference_dataset, uniform_dataset, walk_dataset, walk_of
from granforce.study.store import Store
from granforce.system import cancelling
from granforce.system.clock import timed
from granforce.system.memory import check_memory
from granforce.types import Progress

# Least memory of a walk per state and disk: f_n and f_t of 1.5 contacts, twice (during the walk and
# in the result).
STATE_BYTES = 48


def _walk_parameters(
    packing: Parameters,
    states: Any,
    seed: int = 0,
    *,
    mu: Any = None,
    relax: str = "nearest",
    chains: int = 1,
    keep: int | None = None,
    residual: float | None = None,
    attempts: int | None = None,
    skip: bool = True,
    **conditions: Any,
) -> Parameters:
    """The parameters of a walk: those of its packing, and its own options.

    mu: friction coefficient of the ensemble, by default the packing's. keep: number of evenly
    spaced states to store (measures always come from all). residual: in ⟨f_n⟩, at which sweeps
    alone (relax="gauss_seidel_only") end, by default EQUILIBRIUM. attempts: after this many per
    state the walk is stored with the states it has; by default too few states are an error. skip:
    whether to skip relaxation if S is one point. conditions: on the forces.
    """
    choice(relax, RELAXATIONS, "relax")
    size = _size(packing, states, seed, chains, keep)
    if size["chains"] > size["states"]:
        raise InputError("there must be at least as many states as chains")
    if keep is not None and keep >= size["states"]:
        size["keep"] = None
    cones = cones_of(packing, mu, **conditions)
    if relax.startswith("gauss_seidel") and {"prescribed", "known"} & cones.keys():
        raise InputError(
            "contact dynamics supports only the pressure and Coulomb's law: with other conditions "
            "use the nearest network"
        )
    named = {**cones, **size, "relax": relax}
    if residual is not None:
        if relax != "gauss_seidel_only":
            raise InputError("only 'gauss_seidel_only' takes a residual")
        named["residual"] = positive(residual, "residual")
    if attempts is not None:
        named["attempts"] = whole(attempts, "attempts per state", 1)
    if not skip:
        named["skip"] = False
    return named


def _size(
    packing: Parameters, states: Any, seed: Any, chains: Any, keep: int | None, least: float = 1
) -> Parameters:
    """Parameters shared by walks and samples; InputError if `least` states are too many."""
    states = whole(states, "the number of states", 1, most=None)
    chains = whole(chains, "the number of chains", 1)
    most = max(states, chains, least)
    check_memory(STATE_BYTES * most * packing.get("n", 1), f"{most!s:.40} states")
    return {
        "states": states,
        "seed": random_seed(seed),
        "chains": chains,
        "keep": None if keep is None else whole(keep, "the number of states kept", 1),
    }


def _walk(
    store: Store,
    parameters: Parameters,
    *,
    workers: int,
    progress: Progress | None,
    watch: Any = None,
    begun: Callable[[Ensemble], object] | None = None,
    enough: Callable[[], bool] | None = None,
) -> xr.Dataset:
    """Dataset of a walk with all its measures; begun(S) is called before its first step.

    A shorter, otherwise identical walk in the store is resumed. enough: as for `walk`.
    """
    S = ensemble_of(store, parameters)
    options: dict[str, Any] = dict(RELAXATIONS[parameters["relax"]])
    if "residual" in parameters:
        options["tolerance"] = parameters["residual"]
    if "attempts" in parameters:
        share = -(-parameters["states"] // parameters["chains"])
        options |= {"max_attempts": parameters["attempts"] * share, "whole": False}
    options["skip"] = parameters.get("skip", True)
    if begun is not None:
        begun(S)
    seconds, done = timed(
        walk,
        S,
        parameters["states"],
        parameters["seed"],
        chains=parameters["chains"],
        workers=workers,
        progress=progress,
        watch=watch,
        begun=_longest_begun(store, parameters),
        enough=enough,
        **options,
    )
    return walk_dataset(S, done, keep=parameters["keep"], seconds=seconds)


def _longest_begun(store: Store, parameters: Parameters) -> Walk | None:
    """The longest stored walk with all its states that this walk would begin with, or None.

    The states of a single chain do not depend on the number requested.
    """
    if parameters["chains"] > 1 or "attempts" in parameters:
        return None
    same = {name: value for name, value in parameters.items() if name not in ("states", "keep")}
    shorter = [
        entry
        for entry in entries(store, WALK, keep=None, **same)
        if entry.params["states"] < parameters["states"] and len(entry.params) == len(parameters)
    ]
    shorter.sort(key=lambda entry: entry.params["states"], reverse=True)
    for entry in shorter:
        stored = load(store, WALK, entry.params)
        # Walks with rounded states cannot be resumed exactly.
        if (
            stored is not None
            and stored["states"].dtype == np.float64
            and stored["accepted"].item()
        ):
            return walk_of(stored)
    return None


def _parameters_of(parameters: Parameters, dataset: xr.Dataset) -> Parameters:
    """The parameters of a walk that ended early: those of a walk of the reached length."""
    if "attempts" in parameters:
        return parameters
    states = int(dataset["accepted"].item() + dataset["skipped"].item())
    keep = parameters["keep"]
    return parameters | {"states": states, "keep": keep if keep and keep < states else None}


def _uniform_parameters(
    packing: Parameters,
    states: Any,
    seed: int = 0,
    *,
    mu: Any = None,
    chains: int = 4,
    effective: float | None = None,
    keep: int | None = None,
    **conditions: Any,
) -> Parameters:
    """The parameters of a uniform sample: those of its packing, and its own options.

    mu, keep, conditions: as for a walk; states, chains, effective: as for `sample_uniform`.
    """
    if effective is not None:
        effective = positive(effective, "effective sample size")
    size = _size(packing, states, seed, chains, keep, effective or 1)
    return {**cones_of(packing, mu, **conditions), **size, "effective": effective}


def _uniform(
    store: Store, parameters: Parameters, *, workers: int, progress: Progress | None
) -> xr.Dataset:
    """Dataset of a uniform sample with all its measures.

    A sample that did not reach the requested effective size is stored too, marked in `reached`.
    """
    S = ensemble_of(store, parameters)
    seconds, drawn = timed(
        sample_uniform,
        S,
        parameters["states"],
        parameters["chains"],
        parameters["seed"],
        workers=workers,
        effective=parameters["effective"],
        progress=progress,
    )
    cancelling.check("uniform sample")
    return uniform_dataset(S, drawn, keep=parameters["keep"], seconds=seconds)


def _volume_parameters(
    packing: Parameters, accuracy: float = 0.05, seed: int = 0, *, mu: Any = None, **conditions: Any
) -> Parameters:
    """The parameters of a volume of S.

    accuracy, seed: as for `volume`. mu: friction coefficient of the ensemble, by default the
    packing's. conditions: on the forces.
    """
    accuracy = positive(accuracy, "accuracy", least=LEAST_ACCURACY)
    named = {"accuracy": accuracy, "seed": random_seed(seed)}
    return {**cones_of(packing, mu, **conditions), **named}


def _volume(
    store: Store, parameters: Parameters, *, workers: int, progress: Progress | None
) -> xr.Dataset:
    """Dataset of the volume of S; an error above the requested one is marked in `reached`."""
    S = ensemble_of(store, parameters)
    options = {name: parameters[name] for name in ("accuracy", "seed")}
    result = volume(S, **options, workers=workers, progress=progress)
    return volume_dataset(S, result)


def _inference_parameters(
    packing: Parameters,
    measured: Any = None,
    states: Any = 0,
    seed: int = 0,
    *,
    pressures: Any = None,
    unmeasured: float | None = None,
    again: bool = False,
    certain: bool = False,
    mu: Any = None,
    chains: int = 4,
    keep: int | None = None,
    **conditions: Any,
) -> Parameters:
    """The parameters of an inference: its packing, its measurement, and its draws.

    measured, pressures: a Measurement and GrainPressures, identified by hashes of their arrays; mu,
    keep: as for a walk; states, chains, unmeasured: as for `infer`. again: draws are those of
    `remeasured`, for networks created by dynamics. certain: whether to test which unmeasured
    contacts carry force in every network. conditions: on the forces.
    """
    size = _size(packing, max(1, states), seed, chains, keep) | {"states": whole(states, "states")}
    spread = None if unmeasured is None else positive(unmeasured, "unmeasured")
    named = {"measured": hash_of(*(measured or ())), "unmeasured": spread}
    named |= {} if pressures is None else {"pressures": hash_of(*pressures)}
    named |= {"again": True} if again else {}
    return {**cones_of(packing, mu, **conditions), **size, **named, "certain": bool(certain)}


def _inference(
    store: Store,
    parameters: Parameters,
    *,
    workers: int,
    progress: Progress | None,
    measured: Any = None,
    pressures: Any = None,
) -> xr.Dataset:
    """Dataset of the likeliest network of a measurement, and of draws around it.

    measured, pressures: the Measurement and the GrainPressures of the parameters.
    """
    if measured is None and pressures is None:
        raise InputError("the measurement is not in this store: infer again")
    begin = time.perf_counter()
    S = ensemble_of(store, parameters)
    forces, sigma = np.full((2, len(S.index), 2), np.nan)
    if measured is not None:
        forces, sigma = (values[S.index] for values in measured.on(len(S.packing.contacts.i)))
    again = parameters.get("again") and parameters["states"]
    usual = remeasured.UNMEASURED if again else UNMEASURED
    unmeasured = spread_of(S, parameters["unmeasured"], usual)
    given = (S, forces, sigma) if measured is not None else (S,)
    result = (remeasured.remeasured if again else infer)(
        *given,
        pressures=pressures,
        states=parameters["states"],
        seed=parameters["seed"],
        chains=parameters["chains"],
        unmeasured=unmeasured,
        workers=workers,
        progress=progress,
    )
    certain = None
    if parameters["certain"]:
        certain = carrying(
            *given,
            pressures=pressures,
            unmeasured=unmeasured,
            workers=workers,
            progress=progress,
        )
        cancelling.check("inference")
    return inference_dataset(
        *(S, result, forces, sigma, pressures, certain),
        unmeasured=unmeasured,
        keep=parameters["keep"],
        seconds=time.perf_counter() - begin,
    )


def _informative_parameters(
    packing: Parameters,
    k: int = 10,
    check: int = 10,
    states: int = 400,
    seed: int = 0,
    *,
    mu: Any = None,
    **conditions: Any,
) -> Parameters:
    """The parameters of a ranking of contacts by the information from measuring them.

    mu: friction coefficient of the ensemble, by default the packing's. k, check, states, seed: as
    for `informative`. conditions: on the forces.
    """
    size = _size(packing, states, seed, 1, None)
    counts = {"k": whole(k, "k", 1), "check": whole(check, "check")}
    drawn = {name: size[name] for name in ("states", "seed")}
    return {**cones_of(packing, mu, **conditions), **counts, **drawn}


def _informative(
    store: Store,
    parameters: Parameters,
    *,
    workers: int,
    progress: Progress | None,
    watch: Any = None,
) -> xr.Dataset:
    """Dataset of the most informative contacts; watch as for `informative`."""
    S = ensemble_of(store, parameters)
    options = {name: parameters[name] for name in ("k", "check", "states", "seed")}
    options |= {"workers": workers, "watch": watch, "progress": progress}
    seconds, ranking = timed(informative, S, **options)
    cancelling.check("which measurement next")
    return informative_dataset(S, ranking, seconds=seconds)


WALK = Kind(
    name="walk",
    version=1,
    title="random walk",
    unit="state",
    parameters=_walk_parameters,
    compute=_walk,
    holds_states=True,
    parameters_of=_parameters_of,
)
UNIFORM = Kind(
    name="uniform",
    version=4,
    title="uniform sample",
    unit="state",
    parameters=_uniform_parameters,
    compute=_uniform,
    holds_states=True,
)
INFERENCE = Kind(
    name="inference",
    version=3,
    title="inference",
    unit="draw",
    parameters=_inference_parameters,
    compute=_inference,
    holds_states=True,
)
VOLUME = Kind(
    name="volume",
    version=3,
    title="volume of S",
    unit="path",
    parameters=_volume_parameters,
    compute=_volume,
)
INFORMATIVE = Kind(
    name="informative",
    version=4,
    title="which measurement next",
    unit="contact",
    parameters=_informative_parameters,
    compute=_informative,
)
