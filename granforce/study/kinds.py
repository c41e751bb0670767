"""The kinds of results that are kept, one record each: what names one, and how it is computed.

A kind is added by one more record at the end of this file; stores, scans, the command line and the
page take it from `KINDS`.
"""

import hashlib
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import xarray as xr

from granforce.explore import remeasured
from granforce.explore.carrying import carrying
from granforce.explore.infer import infer
from granforce.explore.informative import informative
from granforce.explore.intervals import intervals, limit_load_bounds
from granforce.explore.outline import outline
from granforce.explore.random_walk import walk
from granforce.explore.stress_outline import stress_outline
from granforce.explore.uniform import sample_uniform
from granforce.explore.volume import volume
from granforce.forces.ensemble import Ensemble, ensemble
from granforce.forces.gauss_seidel import gauss_seidel
from granforce.forces.likeliest import UNMEASURED
from granforce.forces.nearest import nearest
from granforce.forces.nearest_piqp import nearest_piqp
from granforce.packing.compaction import Glimpse, check_box, draw_radii, pack
from granforce.perturb.critical_force import (
    MOST_STEPS,
    RISE,
    CriticalForce,
    critical_force,
    critical_forces,
)
from granforce.records import (
    Floats,
    InputError,
    Integers,
    Packing,
    Progress,
    check_memory,
    friction,
    positive,
    random_seed,
    whole,
)
from granforce.study import slices
from granforce.study.bounds import (
    informative_dataset,
    intervals_dataset,
    limit_loads_dataset,
    outline_dataset,
    stress_dataset,
    volume_dataset,
)
from granforce.study.cells import Kind, get, load, save
from granforce.study.conditions import conditions
from granforce.study.conditions import of as conditions_of
from granforce.study.keys import Parameters
from granforce.study.responses import contact_dataset, perturbation_dataset
from granforce.study.samples import inference_dataset, uniform_dataset, walk_dataset
from granforce.study.schema import dataset_packing, packing_dataset
from granforce.study.store import Store
from granforce.system import cancelling
from granforce.tolerances import EQUILIBRIUM

# Memory that is needed at the least: of a packing for each disk (the lists of pairs and one factor
# of its balance), and of a walk for each state and disk (f_n and f_t of one and a half contacts,
# as they are made and as they are handed over).
DISK_BYTES = 2000
STATE_BYTES = 48

# What names how loads on a contact are raised.
PROTOCOL = ("precision", "rise", "max_steps")

RELAXATIONS: dict[str, dict[str, Any]] = {
    "gauss_seidel": {"relax": gauss_seidel},
    "gauss_seidel_only": {"relax": gauss_seidel, "rest": None, "tolerance": EQUILIBRIUM},
    "nearest": {"relax": nearest_piqp},
    "accelerated": {"relax": nearest},
}


# Packings


def _packing_parameters(
    n: int,
    mu: Any,
    seed: int,
    *,
    radii: Any = "uniform:0.5,1",
    pressure: float = 1.0,
    dt: float = 0.1,
    box_mass: float = 100.0,
    sweeps: int = 600,
    accuracy: float = 0.01,
    box: str = "square",
) -> Parameters:
    """The parameters that name a packing in the store; as for `pack`.

    Raises InputError for what `pack` would refuse, and for more disks than fit into memory.
    """
    n = whole(n, "the number of disks", most=None)
    if n < 3:
        raise InputError(f"a packing needs at least 3 disks, got {n!s:.40}")
    check_memory(DISK_BYTES * n, f"a packing of {n!s:.40} disks")
    drawn = draw_radii(radii, n, np.random.default_rng(0))
    return {
        "n": n,
        "mu": friction(mu),
        "seed": random_seed(seed),
        "radii": radii if isinstance(radii, str) else drawn.tolist(),
        "pressure": positive(pressure, "pressure"),
        "dt": positive(dt, "dt"),
        "box_mass": positive(box_mass, "box_mass"),
        "sweeps": whole(sweeps, "sweeps", 1),
        "accuracy": positive(accuracy, "accuracy"),
        # Only where it is not square: keys of packings in square boxes stay what they were.
        **({} if check_box(box) == "square" else {"box": box}),
    }


def imported_parameters(packing: Packing) -> Parameters:
    """The parameters that name a packing made elsewhere: a hash of its arrays."""
    arrays = (packing.x, packing.r, packing.box, packing.forces, packing.load, *packing.contacts)
    # The tilt only where there is one: keys of packings in straight cells stay what they were.
    tilt = [packing.tilt] if packing.tilt else []
    digest = _digest(*arrays, np.array([packing.mu, packing.pressure, *tilt]))
    return {"imported": digest, "mu": packing.mu}


def _digest(*arrays: Any) -> str:
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
    told: dict[str, Any] = {"progress": progress, "watch": watch}
    return packing_dataset(pack(**parameters, max_steps=max_steps, **told))


def get_packing(store: Store, parameters: Parameters, **options: Any) -> tuple[Packing, bool]:
    """The Packing of these parameters, found or made, and whether it was found; as `cells.get`."""
    dataset, cached = get(store, PACKING, parameters, **options)
    return dataset_packing(dataset), cached


def keep_packing(store: Store, parameters: Parameters, packing: Packing) -> str:
    """Save a packing under its parameters; returns the entry's name."""
    return save(store, PACKING, parameters, packing_dataset(packing))


# Ensembles


def _cones(packing: Parameters, mu: Any, **asked: Any) -> Parameters:
    """What names an ensemble: its packing, friction coefficient (that of it, if none), conditions.

    asked: prescribed, stress and known, as for `conditions`.
    """
    cones = {"packing": packing, "mu": packing["mu"] if mu is None else friction(mu)}
    return cones | conditions(**asked)


def _ensemble(store: Store, parameters: Parameters) -> Ensemble:
    """The ensemble of a named packing and friction, with the forces outside a slice frozen."""
    packing, _ = get_packing(store, parameters["packing"])
    slice_ = parameters.get("slice")
    frozen = None if slice_ is None else slices.outside(packing, slice_)
    return ensemble(packing, parameters["mu"], frozen=frozen, **conditions_of(parameters))


# States


def _walk_parameters(
    packing: Parameters,
    states: Any,
    seed: int = 0,
    *,
    mu: Any = None,
    relax: str = "accelerated",
    chains: int = 1,
    keep: int | None = None,
    residual: float | None = None,
    attempts: int | None = None,
    skip: bool = True,
    **asked: Any,
) -> Parameters:
    """The parameters that name a walk: those of its packing, and how it goes.

    mu: friction coefficient of the ensemble, by default the packing's. keep: number of evenly
    spaced states that are stored (measures always come from all). residual: in ⟨f_n⟩, at which
    sweeps alone (relax="gauss_seidel_only") end, by default EQUILIBRIUM. attempts: after so many
    per state the walk is kept with the states it has; by default too few states are an error.
    skip: whether nothing is relaxed where S is one point. asked: the conditions.
    """
    if relax not in RELAXATIONS:
        raise InputError(f"unknown relaxation {relax!r}: take one of {', '.join(RELAXATIONS)}")
    size = _size(packing, states, seed, chains, keep)
    if size["chains"] > size["states"]:
        raise InputError("there must be at least as many states as chains")
    if keep is not None and keep >= size["states"]:
        size["keep"] = None
    cones = _cones(packing, mu, **asked)
    if relax.startswith("gauss_seidel") and {"prescribed", "known"} & cones.keys():
        raise InputError(
            "contact dynamics keeps the pressure and Coulomb's law only: with other conditions "
            "take the nearest network"
        )
    named = {**cones, **size, "relax": relax}
    if residual is not None:
        if relax != "gauss_seidel_only":
            raise InputError("only the sweeps of 'gauss_seidel_only' end at a residual of choice")
        named["residual"] = positive(residual, "residual")
    if attempts is not None:
        named["attempts"] = whole(attempts, "attempts per state", 1)
    if not skip:
        named["skip"] = False
    return named


def _size(
    packing: Parameters, states: Any, seed: Any, chains: Any, keep: int | None, least: float = 1
) -> Parameters:
    """What walks and samples have in common; InputError where `least` states are too many."""
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
) -> xr.Dataset:
    """Dataset of a walk with all its measures; begun(S) is called before its first step."""
    S = _ensemble(store, parameters)
    options: dict[str, Any] = dict(RELAXATIONS[parameters["relax"]])
    if "residual" in parameters:
        options["tolerance"] = parameters["residual"]
    if "attempts" in parameters:
        share = -(-parameters["states"] // parameters["chains"])
        options |= {"max_attempts": parameters["attempts"] * share, "whole": False}
    options["skip"] = parameters.get("skip", True)
    if begun is not None:
        begun(S)
    begin = time.perf_counter()
    done = walk(
        S,
        parameters["states"],
        parameters["seed"],
        chains=parameters["chains"],
        workers=workers,
        progress=progress,
        watch=watch,
        **options,
    )
    seconds = time.perf_counter() - begin
    return walk_dataset(S, done, keep=parameters["keep"], seconds=seconds)


def _uniform_parameters(
    packing: Parameters,
    states: Any,
    seed: int = 0,
    *,
    mu: Any = None,
    chains: int = 4,
    effective: float | None = None,
    keep: int | None = None,
    **asked: Any,
) -> Parameters:
    """The parameters that name a uniform sample: those of its packing, and how it is drawn.

    mu, keep, asked: as of a walk; states, chains, effective: as for `sample_uniform`.
    """
    if effective is not None:
        effective = positive(effective, "effective sample size")
    size = _size(packing, states, seed, chains, keep, effective or 1)
    return {**_cones(packing, mu, **asked), **size, "effective": effective}


def _uniform(
    store: Store, parameters: Parameters, *, workers: int, progress: Progress | None
) -> xr.Dataset:
    """Dataset of a uniform sample with all its measures.

    A sample that did not reach the wanted effective size is kept too, and says so in `reached`.
    """
    S = _ensemble(store, parameters)
    begin = time.perf_counter()
    drawn = sample_uniform(
        S,
        parameters["states"],
        parameters["chains"],
        parameters["seed"],
        workers=workers,
        effective=parameters["effective"],
        progress=progress,
    )
    cancelling.check("uniform sample")
    seconds = time.perf_counter() - begin
    return uniform_dataset(S, drawn, keep=parameters["keep"], seconds=seconds)


def _volume_parameters(
    packing: Parameters, accuracy: float = 0.05, seed: int = 0, *, mu: Any = None, **asked: Any
) -> Parameters:
    """The parameters that name a volume of S.

    accuracy, seed: as for `volume`. mu: friction coefficient of the ensemble, by default the
    packing's. asked: the conditions.
    """
    named = {"accuracy": positive(accuracy, "accuracy"), "seed": random_seed(seed)}
    return {**_cones(packing, mu, **asked), **named}


def _volume(
    store: Store, parameters: Parameters, *, workers: int, progress: Progress | None
) -> xr.Dataset:
    """Dataset of the volume of S; one whose error is larger than wanted says so in `reached`."""
    S = _ensemble(store, parameters)
    options = {name: parameters[name] for name in ("accuracy", "seed")}
    found = volume(S, **options, workers=workers, progress=progress)
    return volume_dataset(S, found)


def _inference_parameters(
    packing: Parameters,
    measured: Any,
    states: Any = 0,
    seed: int = 0,
    *,
    unmeasured: float | None = None,
    again: bool = False,
    certain: bool = False,
    mu: Any = None,
    chains: int = 4,
    keep: int | None = None,
    **asked: Any,
) -> Parameters:
    """The parameters that name an inference: its packing, its measurement, and its draws.

    measured: a Measurement, which is named by a hash of its arrays; mu, keep: as of a walk; states,
    chains, unmeasured: as for `infer`. again: draws are those of `remeasured`, for networks made by
    dynamics. certain: whether contacts that were not measured are tried
    for carrying in every network. asked: the conditions.
    """
    size = _size(packing, max(1, states), seed, chains, keep) | {"states": whole(states, "states")}
    if unmeasured is None:
        unmeasured = remeasured.UNMEASURED if again else UNMEASURED
    named = {"measured": _digest(*measured), "unmeasured": positive(unmeasured, "unmeasured")}
    named |= {"again": True} if again else {}
    return {**_cones(packing, mu, **asked), **size, **named, "certain": bool(certain)}


def _inference(
    store: Store,
    parameters: Parameters,
    *,
    workers: int,
    progress: Progress | None,
    measured: Any = None,
) -> xr.Dataset:
    """Dataset of the likeliest network of a measurement, and of draws around it.

    measured: the Measurement that the parameters name.
    """
    if measured is None:
        raise InputError("the measurement is not in this store: infer again")
    begin = time.perf_counter()
    S = _ensemble(store, parameters)
    forces, sigma = (values[S.index] for values in measured.on(len(S.packing.contacts.i)))
    again = parameters.get("again") and parameters["states"]
    found = (remeasured.remeasured if again else infer)(
        *(S, forces, sigma),
        states=parameters["states"],
        seed=parameters["seed"],
        chains=parameters["chains"],
        unmeasured=parameters["unmeasured"],
        workers=workers,
        progress=progress,
    )
    sure = None
    if parameters["certain"]:
        options = {"unmeasured": parameters["unmeasured"], "workers": workers}
        sure = carrying(S, forces, sigma, progress=progress, **options)
        cancelling.check("inference")
    options = {"keep": parameters["keep"], "seconds": time.perf_counter() - begin}
    return inference_dataset(S, found, forces, sigma, sure, **options)


# Bounds


def _exact_parameters(
    packing: Parameters,
    *,
    mu: Any = None,
    contacts: Iterable[int] | None = None,
    slice_: Sequence[float] | None = None,
    **asked: Any,
) -> Parameters:
    """The parameters that name exact bounds or limit loads of one packing.

    mu: friction coefficient of the ensemble, by default the packing's. contacts: numbers in the
    packing's contact list, by default all that carry. slice_: (x0, x1, y0, y1) in parts of the
    box: contacts with a grain outside are frozen at their original forces. asked: the conditions.
    """
    if slice_ is not None and asked.get("prescribed") == "stress":
        raise InputError("the forces around a slice decide its stress: prescribe none with a slice")
    return {
        **_cones(packing, mu, **asked),
        "contacts": _chosen(contacts),
        "slice": None if slice_ is None else slices.edges(slice_),
    }


def _chosen(contacts: Iterable[int] | None) -> list[int] | None:
    """Numbers of contacts, sorted, each once; None for all that carry."""
    if contacts is None:
        return None
    chosen = sorted({whole(c, "the number of a contact") for c in contacts})
    if not chosen:
        raise InputError("name at least one contact, or leave the contacts out for all")
    return chosen


def _intervals(
    store: Store,
    parameters: Parameters,
    *,
    workers: int,
    progress: Progress | None,
    begun: Callable[[Ensemble], object] | None = None,
    **options: Any,
) -> xr.Dataset:
    """Dataset of exact bounds and η3, and of clusters of undetermined contacts.

    begun(S) is called before the first program. options: widths and watch, as for `intervals`.
    """
    S = _ensemble(store, parameters)
    if begun:
        begun(S)
    begin = time.perf_counter()
    bounds = intervals(S, parameters["contacts"], workers=workers, progress=progress, **options)
    seconds = time.perf_counter() - begin
    _complete(bounds, "exact bounds")
    return intervals_dataset(S, bounds, seconds=seconds)


def _limit_loads(
    store: Store, parameters: Parameters, *, workers: int, progress: Progress | None
) -> xr.Dataset:
    """Dataset of the limit loads of contacts."""
    S = _ensemble(store, parameters)
    begin = time.perf_counter()
    loads = limit_load_bounds(S, parameters["contacts"], workers=workers, progress=progress)
    seconds = time.perf_counter() - begin
    _complete(loads, "limit loads")
    return limit_loads_dataset(S, loads, seconds=seconds)


def _complete(result: Any, what: str) -> None:
    """Only finished results are kept: Cancelled or InputError for others."""
    cancelling.check(what)
    if not result.converged:
        raise InputError(f"{what} not certified: largest duality gap {result.max_gap:.1e} ⟨f_n⟩")


def _outline_parameters(
    packing: Parameters,
    *,
    mu: Any = None,
    components: Any = None,
    states: Any = None,
    tolerance: float = 1e-3,
    **asked: Any,
) -> Parameters:
    """The parameters that name the outline of S in a plane.

    mu: friction coefficient of the ensemble, by default the packing's. components: two pairs
    (contact as its number in the packing, 0 for f_n or 1 for f_t); or states: parameters of the
    walk or sample whose principal axes span the plane. tolerance as for `outline`. asked: the
    conditions.
    """
    if (components is None) == (states is None):
        raise InputError("the plane of an outline is given by two components, or by states")
    chosen = None if components is None else _components(components)
    named = _cones(packing, mu, **asked) | {"tolerance": positive(tolerance, "tolerance")}
    return named | {"components": chosen, "states": states}


def _components(components: Any) -> list[list[int]]:
    """Two pairs [contact, 0 or 1] as ints."""
    try:
        pairs = [(contact, part) for contact, part in components]
    except (TypeError, ValueError):
        pairs = []
    if len(pairs) != 2:
        raise InputError("a plane is given by two pairs: a contact, and 0 for f_n or 1 for f_t")
    return [
        [whole(c, "the number of a contact"), whole(part, "f_n or f_t", 0, 1)] for c, part in pairs
    ]


def _outline(
    store: Store,
    parameters: Parameters,
    *,
    workers: int,
    progress: Progress | None,
    axes: Floats | None = None,
) -> xr.Dataset:
    """Dataset of the outline of S in a plane.

    axes (2, N_c, 2): principal axes of the states that the parameters name; not used for
    components.
    """
    S = _ensemble(store, parameters)
    plane = _component_axes(S, parameters["components"]) if axes is None else axes
    begin = time.perf_counter()
    found = outline(S, plane, tolerance=parameters["tolerance"], workers=workers, progress=progress)
    seconds = time.perf_counter() - begin
    cancelling.check("outline")
    if not found.converged:
        raise InputError(f"outline not closed: a gap of {found.gap:.1e} ⟨f_n⟩ is left")
    return outline_dataset(S, plane, found, seconds=seconds)


def _component_axes(S: Ensemble, components: Sequence[Sequence[int]]) -> Floats:
    """Axes (2, N_c, 2) along two components (contact in the packing, 0 or 1)."""
    axes = np.zeros((2, len(S.index), 2))
    for k, (contact, part) in enumerate(components or ()):
        axes[k, S.positions([contact]), part] = 1.0
    return axes


def _stress_parameters(
    packing: Parameters, *, mu: Any = None, angles: int = 64, known: Any = None
) -> Parameters:
    """The parameters that name the outline of the stresses that a packing can carry.

    mu: friction coefficient of the ensemble, by default the packing's. angles: how many directions.
    known: as for `conditions`.
    """
    cones = _cones(packing, mu, known=known)
    return cones | {"angles": whole(angles, "the number of angles", 1, 4096)}


def _stress(
    store: Store, parameters: Parameters, *, workers: int, progress: Progress | None
) -> xr.Dataset:
    """Dataset of the outline of stresses."""
    S = _ensemble(store, parameters)
    begin = time.perf_counter()
    found = stress_outline(S, parameters["angles"], workers=workers, progress=progress)
    seconds = time.perf_counter() - begin
    cancelling.check("outline of stresses")
    if not found.converged:
        raise InputError("the outline of stresses did not close")
    return stress_dataset(S, found, seconds=seconds)


def _informative_parameters(
    packing: Parameters,
    k: int = 10,
    check: int = 10,
    states: int = 400,
    seed: int = 0,
    *,
    mu: Any = None,
    **asked: Any,
) -> Parameters:
    """The parameters that name a ranking of contacts by what measuring them would tell.

    mu: friction coefficient of the ensemble, by default the packing's. k, check, states, seed: as
    for `informative`. asked: the conditions.
    """
    size = _size(packing, states, seed, 1, None)
    counts = {"k": whole(k, "k", 1), "check": whole(check, "check")}
    drawn = {name: size[name] for name in ("states", "seed")}
    return {**_cones(packing, mu, **asked), **counts, **drawn}


def _informative(
    store: Store,
    parameters: Parameters,
    *,
    workers: int,
    progress: Progress | None,
    watch: Any = None,
) -> xr.Dataset:
    """Dataset of the most informative contacts; watch as for `informative`."""
    S = _ensemble(store, parameters)
    begin = time.perf_counter()
    options = {name: parameters[name] for name in ("k", "check", "states", "seed")}
    found = informative(S, **options, workers=workers, watch=watch, progress=progress)
    cancelling.check("which measurement next")
    return informative_dataset(S, found, seconds=time.perf_counter() - begin)


# Perturbations


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
    **asked: Any,
) -> Parameters:
    """The parameters that name the local perturbation of contacts of one packing.

    mu: friction coefficient of the ensemble, by default the packing's. contacts: numbers in the
    packing's contact list, by default all that carry; or random: so many of those that carry, the
    first in an order drawn from seed. precision, rise, max_steps: as for `critical_force`. asked:
    prescribed and stress.
    """
    if asked.get("known") is not None:
        raise InputError(
            "grains that move change their forces, whatever is known of them: perturb the packing "
            "without known forces (its limit loads can be had with them)"
        )
    if contacts is not None and random is not None:
        raise InputError("name the contacts to perturb, or how many at random, not both")
    return {
        **_cones(packing, mu, **asked),
        "contacts": _chosen(contacts),
        "random": None if random is None else whole(random, "the number of random contacts", 1),
        "seed": None if random is None else random_seed(seed),
        **_protocol(precision, rise, max_steps),
    }


def _protocol(precision: Any, rise: Any, max_steps: Any) -> Parameters:
    """What names how loads are raised; `rise` and `max_steps` only where they are not the usual."""
    named = {"precision": positive(precision, "precision")}
    if rise != RISE:
        named["rise"] = positive(rise, "rise")
        if named["rise"] >= 1:
            raise InputError(f"rise must be below 1, got {rise:g}")
    if max_steps != MOST_STEPS:
        named["max_steps"] = whole(max_steps, "max_steps", 1)
    return named


def _perturbation(
    store: Store, parameters: Parameters, *, workers: int, progress: Progress | None
) -> xr.Dataset:
    """Dataset of critical forces, first motions and α; each contact is kept as it ends."""
    S = _ensemble(store, parameters)
    chosen = S.index if parameters["contacts"] is None else np.array(parameters["contacts"])
    if parameters["random"] is not None:
        # The order is drawn among the positions of contacts in S.
        order = np.random.default_rng(parameters["seed"]).permutation(S.positions(chosen))
        chosen = S.index[np.sort(order[: parameters["random"]])]
    if not len(chosen):
        raise InputError("no contact to perturb")
    parts = _perturbed(store, S, chosen, parameters, workers, progress)
    return perturbation_dataset(S, parts)


def _perturbed(
    store: Store,
    S: Ensemble,
    chosen: Integers,
    parameters: Parameters,
    workers: int,
    progress: Progress | None,
) -> list[xr.Dataset]:
    """Datasets of the single contacts, in order; those of the store are found."""
    shared = ("packing", "mu", *PROTOCOL, "prescribed", "stress")
    common = {name: parameters[name] for name in shared if name in parameters}
    named = {c: PERTURBED_CONTACT.parameters(contact=int(c), **common) for c in chosen}
    parts = {c: load(store, PERTURBED_CONTACT, named[c]) for c in chosen}
    parts = {c: dataset for c, dataset in parts.items() if dataset is not None}
    missing = [c for c in chosen if c not in parts]
    if not missing:
        return [parts[c] for c in chosen]
    loads = limit_load_bounds(S, missing, workers=workers)
    _complete(loads, "limit loads")
    tell = progress or (lambda done, total: None)

    def ended(k: int, critical: CriticalForce) -> None:
        contact = missing[k]
        parts[contact] = contact_dataset(S, critical, parameters["precision"])
        save(store, PERTURBED_CONTACT, named[contact], parts[contact])
        tell(len(parts), len(chosen))

    options = {"limit_loads": loads.load, "workers": workers, "finished": ended}
    critical_forces(S, missing, **options, **_named_protocol(parameters))
    return [parts[c] for c in chosen]


def _named_protocol(parameters: Parameters) -> dict[str, Any]:
    return {name: parameters[name] for name in PROTOCOL if name in parameters}


def _perturbed_contact_parameters(
    packing: Parameters,
    contact: Any,
    *,
    mu: Any = None,
    precision: float = 0.01,
    rise: float = RISE,
    max_steps: int = MOST_STEPS,
    **asked: Any,
) -> Parameters:
    """The parameters that name one perturbed contact (its number in the packing)."""
    return {
        **_cones(packing, mu, **asked),
        "contact": whole(contact, "the number of a contact"),
        **_protocol(precision, rise, max_steps),
    }


def _perturbed_contact(
    store: Store, parameters: Parameters, *, workers: int, progress: Progress | None
) -> xr.Dataset:
    """Dataset of one perturbed contact."""
    S = _ensemble(store, parameters)
    critical = critical_force(S, parameters["contact"], **_named_protocol(parameters))
    return contact_dataset(S, critical, parameters["precision"])


# The records

PACKING = Kind("packing", 2, "compaction", "step", _packing_parameters, _packing)
WALK = Kind("walk", 1, "random walk", "state", _walk_parameters, _walk, holds_states=True)
UNIFORM = Kind(
    "uniform", 3, "uniform sample", "state", _uniform_parameters, _uniform, holds_states=True
)
INFERENCE = Kind(
    *("inference", 2, "inference", "draw", _inference_parameters, _inference), holds_states=True
)
VOLUME = Kind("volume", 1, "volume of S", "path", _volume_parameters, _volume)
INTERVALS = Kind("intervals", 1, "exact bounds", "bound", _exact_parameters, _intervals)
LIMIT_LOADS = Kind("limit_loads", 1, "limit loads", "contact", _exact_parameters, _limit_loads)
OUTLINE = Kind("outline", 1, "outline of S", "program", _outline_parameters, _outline)
INFORMATIVE = Kind(
    *("informative", 2, "which measurement next", "contact"), _informative_parameters, _informative
)
STRESS = Kind("stress", 1, "outline of stresses", "program", _stress_parameters, _stress)
PERTURBATION = Kind(
    *("perturbation", 1, "local perturbation", "contact"), _perturbation_parameters, _perturbation
)
PERTURBED_CONTACT = Kind(
    *("perturbed_contact", PERTURBATION.version, "perturbed contact", "load"),
    *(_perturbed_contact_parameters, _perturbed_contact),
)

KINDS = {
    kind.name: kind
    for kind in (
        *(PACKING, WALK, UNIFORM, INFERENCE, INTERVALS, LIMIT_LOADS, OUTLINE, STRESS),
        *(PERTURBATION, PERTURBED_CONTACT, INFORMATIVE, VOLUME),
    )
}
