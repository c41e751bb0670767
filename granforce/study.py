"""Cells of a study: one dataset each, found in the store or computed and kept.

A cell is named by plain parameters. Cells are independent and seeded, so that they may be computed
anywhere and in any order (see `granforce.sweep`).
"""

import hashlib
import json
import time
from concurrent.futures import ThreadPoolExecutor, as_completed

import numpy as np

from granforce import measures
from granforce.bounds import intervals, limit_load_bounds
from granforce.compaction import pack
from granforce.polytope import ensemble
from granforce.projection import outline
from granforce.random_walk import walk
from granforce.records import Cancelled, InputError, friction, positive
from granforce.relax.accelerated import accelerated
from granforce.relax.gauss_seidel import gauss_seidel
from granforce.relax.nearest import nearest
from granforce.responses import contact_dataset, perturbation_dataset
from granforce.samples import uniform_dataset, walk_dataset
from granforce.schema import dataset_packing, labelled, packing_dataset
from granforce.tolerances import EQUILIBRIUM
from granforce.uniform import sample_uniform

# Raised when an algorithm gives other numbers for the same parameters: older entries are not used.
PACKING_VERSION = 1
WALK_VERSION = 1
UNIFORM_VERSION = 1
INTERVALS_VERSION = 1
LIMIT_LOADS_VERSION = 1
OUTLINE_VERSION = 1
PERTURBATION_VERSION = 1

# Forces whose exact interval is longer than this, in ⟨f_n⟩, are undetermined.
UNDETERMINED = 1e-6

RELAXATIONS = {
    "gauss_seidel": {"relax": gauss_seidel},
    "gauss_seidel_only": {"relax": gauss_seidel, "rest": None, "tolerance": EQUILIBRIUM},
    "nearest": {"relax": nearest},
    "accelerated": {"relax": accelerated},
}


def packing_parameters(
    n, mu, seed, *, radii="uniform:0.5,1", pressure=1.0, dt=0.01, box_mass=100.0, sweeps=100
):
    """The parameters that name a packing in the store; as for `pack`."""
    named = {"n": int(n), "mu": friction(mu), "seed": int(seed), "radii": radii}
    return {**named, "pressure": pressure, "dt": dt, "box_mass": box_mass, "sweeps": sweeps}


def imported_parameters(packing):
    """The parameters that name a packing made elsewhere: a hash of its arrays."""
    digest = hashlib.sha256()
    arrays = (packing.x, packing.r, packing.box, packing.forces, packing.load, *packing.contacts)
    for array in (*arrays, np.array([packing.mu, packing.pressure])):
        digest.update(np.ascontiguousarray(array).tobytes())
    return {"imported": digest.hexdigest(), "mu": packing.mu}


def walk_parameters(packing, states, seed=0, *, mu=None, relax="accelerated", chains=1, keep=None):
    """The parameters that name a walk: those of its packing, and how it goes.

    mu: friction coefficient of the ensemble, by default the packing's. keep: number of evenly
    spaced states that are stored (measures always come from all).
    """
    if relax not in RELAXATIONS:
        raise InputError(f"unknown relaxation {relax!r}: take one of {', '.join(RELAXATIONS)}")
    if not 1 <= int(chains) <= int(states) or (keep is not None and keep < 1):
        raise InputError("states, keep and chains must be at least 1, and chains ≤ states")
    return {
        **_cones(packing, mu),
        "states": int(states),
        "seed": int(seed),
        "relax": relax,
        "chains": int(chains),
        "keep": None if keep is None or keep >= states else int(keep),
    }


def get_packing(store, parameters, *, max_steps=100_000, progress=None, cancel=None):
    """The packing of these parameters and whether it came from the store."""
    found = store.load("packing", parameters, version=PACKING_VERSION)
    if found is not None:
        return dataset_packing(found), True
    if "imported" in parameters:
        raise InputError("the imported packing is not in this store: import it again")
    packing = pack(**parameters, max_steps=max_steps, progress=progress, cancel=cancel)
    keep_packing(store, parameters, packing)
    return packing, False


def keep_packing(store, parameters, packing):
    """Save a packing under its parameters; returns the entry's name."""
    return store.save("packing", parameters, packing_dataset(packing), version=PACKING_VERSION)


def get_walk(store, parameters, *, workers=1, dtypes=None, progress=None, cancel=None):
    """The dataset of this walk with all its measures, and whether it came from the store.

    progress(done, total) counts states; dtypes as for Store.save.
    """

    def compute():
        S = _ensemble(store, parameters, cancel)
        begin = time.perf_counter()
        done = walk(
            S,
            parameters["states"],
            parameters["seed"],
            chains=parameters["chains"],
            workers=workers,
            **RELAXATIONS[parameters["relax"]],
            progress=progress,
            cancel=cancel,
        )
        seconds = time.perf_counter() - begin
        return walk_dataset(S, done, keep=parameters["keep"], seconds=seconds)

    return found_or_kept(store, "walk", parameters, compute, WALK_VERSION, dtypes)


def found_or_kept(store, kind, parameters, compute, version, dtypes=None):
    """The entry's dataset and True where the store has it, else what compute() gives and False.

    The result is saved before it is returned; dtypes as for Store.save.
    """
    found = store.load(kind, parameters, version=version)
    if found is not None:
        return found, True
    dataset = compute()
    store.save(kind, parameters, dataset, version=version, dtypes=dtypes)
    return dataset, False


def uniform_parameters(packing, states, seed=0, *, mu=None, chains=4, effective=None, keep=None):
    """The parameters that name a uniform sample: those of its packing, and how it is drawn.

    mu, keep: as for `walk_parameters`; states, chains, effective: as for `sample_uniform`.
    """
    if min(int(states), int(chains)) < 1 or (keep is not None and keep < 1):
        raise InputError("states, keep and chains must be at least 1")
    return {
        **_cones(packing, mu),
        "states": int(states),
        "seed": int(seed),
        "chains": int(chains),
        "effective": None if effective is None else positive(effective, "effective sample size"),
        "keep": None if keep is None else int(keep),
    }


def get_uniform(store, parameters, *, workers=2, dtypes=None, progress=None, cancel=None):
    """The dataset of this uniform sample with all its measures, and whether the store had it.

    progress(done, total) counts states; dtypes as for Store.save. A sample that did not reach the
    wanted effective size is kept too, and says so in `reached`.
    """

    def compute():
        S = _ensemble(store, parameters, cancel)
        begin = time.perf_counter()
        drawn = sample_uniform(
            S,
            parameters["states"],
            parameters["chains"],
            parameters["seed"],
            workers=workers,
            effective=parameters["effective"],
            progress=progress,
            cancel=cancel,
        )
        if cancel is not None and cancel():
            raise Cancelled("uniform sample cancelled")
        seconds = time.perf_counter() - begin
        return uniform_dataset(S, drawn, keep=parameters["keep"], seconds=seconds)

    return found_or_kept(store, "uniform", parameters, compute, UNIFORM_VERSION, dtypes)


def _ensemble(store, parameters, cancel, slice_=None):
    """The ensemble of a named packing and friction, with the forces outside a slice frozen."""
    packing, _ = get_packing(store, parameters["packing"], cancel=cancel)
    frozen = None if slice_ is None else outside_slice(packing, slice_)
    return ensemble(packing, parameters["mu"], frozen=frozen)


def _cones(packing, mu):
    """What names an ensemble: its packing, and its friction coefficient, by default that of it."""
    return {"packing": packing, "mu": packing["mu"] if mu is None else friction(mu)}


def exact_parameters(packing, *, mu=None, contacts=None, slice_=None):
    """The parameters that name exact bounds or limit loads of one packing.

    mu: friction coefficient of the ensemble, by default the packing's. contacts: positions in the
    packing's contact list, by default all that carry. slice_: (x0, x1, y0, y1) in parts of the
    box: contacts with a grain outside are frozen at their original forces.
    """
    chosen = None if contacts is None else sorted({int(c) for c in contacts})
    return {
        **_cones(packing, mu),
        "contacts": chosen,
        "slice": None if slice_ is None else [float(edge) for edge in slice_],
    }


def exact_ensemble(store, parameters, *, cancel=None):
    """The ensemble that exact_parameters name, and the asked contacts as positions in it."""
    S = _ensemble(store, parameters, cancel, parameters["slice"])
    if parameters["contacts"] is None:
        return S, np.arange(len(S.index))
    return S, S.positions(parameters["contacts"])


def get_intervals(store, parameters, *, workers=2, progress=None, cancel=None):
    """Dataset of exact bounds and η3, clusters of undetermined contacts; and if it was kept."""

    def compute():
        S, contacts = exact_ensemble(store, parameters, cancel=cancel)
        begin = time.perf_counter()
        bounds = intervals(S, contacts, workers=workers, progress=progress, cancel=cancel)
        seconds = time.perf_counter() - begin
        _complete(bounds, "exact bounds", cancel)
        return intervals_dataset(S, contacts, bounds, seconds=seconds)

    return found_or_kept(store, "intervals", parameters, compute, INTERVALS_VERSION)


def intervals_dataset(S, contacts, bounds, *, seconds=0.0):
    """Exact bounds of contacts (positions in S) with their measures and clusters as a dataset."""
    low, high = bounds.lower, bounds.upper
    original = S.original[contacts]
    i, j = S.contacts.i[contacts], S.contacts.j[contacts]
    tolerance = UNDETERMINED * S.force_scale
    cluster, _ = measures.undetermined_clusters(i, j, high - low, tolerance)
    extent = measures.normal_extent(low, high)
    return labelled(
        {
            "backbone": S.index[contacts],
            "original": original,
            "low": low,
            "high": high,
            "interval_gap": bounds.gap,
            "max_gap": bounds.max_gap,
            "position": measures.position_in_interval(original[:, 0], low, high),
            "cluster": cluster,
            "eta3": measures.eta3(low, high),
            "correlation": measures.correlation(original[:, 0], extent),
            "dimension": S.dimension,
            "coordination": S.coordination,
            "force_scale": S.force_scale,
            **S.skipped,
            "seconds": seconds,
        },
        {"counts": json.dumps(bounds.counts)},
    )


def get_limit_loads(store, parameters, *, workers=2, progress=None, cancel=None):
    """Dataset of the limit loads of contacts, and whether it came from the store."""

    def compute():
        S, contacts = exact_ensemble(store, parameters, cancel=cancel)
        begin = time.perf_counter()
        loads = limit_load_bounds(S, contacts, workers=workers, progress=progress, cancel=cancel)
        seconds = time.perf_counter() - begin
        _complete(loads, "limit loads", cancel)
        return labelled(
            {
                "backbone": S.index[contacts],
                "original": S.original[contacts],
                "limit_load": loads.load,
                "load_gap": loads.gap,
                "max_gap": loads.max_gap,
                "force_scale": S.force_scale,
                "seconds": seconds,
            },
            {"counts": json.dumps(loads.counts)},
        )

    return found_or_kept(store, "limit_loads", parameters, compute, LIMIT_LOADS_VERSION)


def outline_parameters(packing, *, mu=None, components=None, states=None, tolerance=1e-3):
    """The parameters that name the outline of S in a plane.

    mu: friction coefficient of the ensemble, by default the packing's. components: two pairs
    (contact as a position in the packing's list, 0 for f_n or 1 for f_t); or states: parameters of
    the walk or sample whose principal axes span the plane. tolerance as for `outline`.
    """
    if (components is None) == (states is None):
        raise InputError("the plane of an outline is given by two components, or by states")
    chosen = None if components is None else [[int(c), int(part)] for c, part in components]
    named = _cones(packing, mu) | {"tolerance": float(tolerance)}
    return named | {"components": chosen, "states": states}


def get_outline(store, parameters, axes=None, *, workers=2, progress=None, cancel=None):
    """Dataset of the outline of S in a plane, and whether it came from the store.

    axes (2, N_c, 2): principal axes of the states that the parameters name; not used for
    components.
    """

    def compute():
        S = _ensemble(store, parameters, cancel)
        plane = _component_axes(S, parameters["components"]) if axes is None else axes
        begin = time.perf_counter()
        found = outline(
            S,
            plane,
            tolerance=parameters["tolerance"],
            workers=workers,
            progress=progress,
            cancel=cancel,
        )
        if cancel is not None and cancel():
            raise Cancelled("outline cancelled")
        if not found.converged:
            raise InputError(f"outline not closed: a gap of {found.gap:.1e} ⟨f_n⟩ is left")
        return labelled(
            {
                "backbone": S.index,
                "axes": plane,
                "inner": found.inner,
                "outer": found.outer,
                "outline_gap": found.gap,
                "programs": found.counts["programs"],
                "force_scale": S.force_scale,
                "seconds": time.perf_counter() - begin,
            },
            {"counts": json.dumps(found.counts)},
        )

    return found_or_kept(store, "outline", parameters, compute, OUTLINE_VERSION)


def _component_axes(S, components):
    """Axes (2, N_c, 2) along two components (contact in the packing, 0 or 1)."""
    axes = np.zeros((2, len(S.index), 2))
    for k, (contact, part) in enumerate(components or ()):
        place = np.searchsorted(S.index, contact)
        if place == len(S.index) or S.index[place] != contact or part not in (0, 1):
            raise InputError(f"contact {contact} carries no load in this packing")
        axes[k, place, part] = 1.0
    return axes


def perturbation_parameters(
    packing, *, mu=None, contacts=None, random=None, seed=0, precision=0.01
):
    """The parameters that name the local perturbation of contacts of one packing.

    mu: friction coefficient of the ensemble, by default the packing's. contacts: positions in the
    packing's contact list, by default all that carry; or random: so many of those that carry, the
    first in an order drawn from seed. precision: of F_crit, ⟨f_n⟩.
    """
    if contacts is not None and random is not None:
        raise InputError("name the contacts to perturb, or how many at random, not both")
    if random is not None and random < 1:
        raise InputError("at least one contact must be perturbed")
    return {
        **_cones(packing, mu),
        "contacts": None if contacts is None else sorted({int(c) for c in contacts}),
        "random": None if random is None else int(random),
        "seed": None if random is None else int(seed),
        "precision": positive(precision, "precision"),
    }


def get_perturbation(store, parameters, *, workers=2, progress=None, cancel=None):
    """Dataset of critical forces, first motions and α, and whether it came from the store.

    Each contact is kept as it ends. progress(done, total) counts contacts; workers: threads.
    """

    def compute():
        named = {"packing": parameters["packing"], "mu": parameters["mu"], "slice": None}
        S, chosen = exact_ensemble(
            store, named | {"contacts": parameters["contacts"]}, cancel=cancel
        )
        if parameters["random"] is not None:
            order = np.random.default_rng(parameters["seed"]).permutation(chosen)
            chosen = np.sort(order[: parameters["random"]])
        if not len(chosen):
            raise InputError("no contact to perturb")
        parts = _perturbed(store, S, chosen, parameters, workers, progress, cancel)
        return perturbation_dataset(S, parts)

    return found_or_kept(store, "perturbation", parameters, compute, PERTURBATION_VERSION)


def _perturbed(store, S, chosen, parameters, workers, progress, cancel):
    """Datasets of the single contacts (positions in S), in order; those of the store are found."""
    loads = limit_load_bounds(S, chosen, workers=workers, cancel=cancel)
    _complete(loads, "limit loads", cancel)
    tell = progress or (lambda done, total: None)
    stopped = False

    def one(k):
        contact = int(S.index[chosen[k]])
        named = {name: parameters[name] for name in ("packing", "mu", "precision")}
        return found_or_kept(
            store,
            "perturbed_contact",
            named | {"contact": contact},
            lambda: contact_dataset(
                S,
                contact,
                loads.load[k],
                precision=parameters["precision"],
                cancel=lambda: stopped or (cancel is not None and cancel()),
            ),
            PERTURBATION_VERSION,
        )[0]

    with ThreadPoolExecutor(workers) as pool:
        waiting = [pool.submit(one, k) for k in range(len(chosen))]
        try:
            for done, future in enumerate(as_completed(waiting), 1):
                future.result()
                tell(done, len(chosen))
        except BaseException:
            stopped = True  # what is under way ends at its next load
            pool.shutdown(cancel_futures=True)
            raise
    return [future.result() for future in waiting]


def _complete(result, what, cancel):
    """Only finished results are kept: Cancelled or InputError for others."""
    if cancel is not None and cancel():
        raise Cancelled(f"{what} cancelled")
    if not result.converged:
        raise InputError(f"{what} not certified: largest duality gap {result.max_gap:.1e} ⟨f_n⟩")


def outside_slice(packing, edges):
    """Mask (N_c,) of contacts with a grain centre outside x0 … x1, y0 … y1 (parts of the box).

    Raises InputError unless 0 ≤ x0 < x1 ≤ 1 and 0 ≤ y0 < y1 ≤ 1.
    """
    if len(edges) != 4:
        raise InputError("a slice is given by four numbers x0,x1,y0,y1")
    x0, x1, y0, y1 = edges
    if not (0 <= x0 < x1 <= 1 and 0 <= y0 < y1 <= 1):
        raise InputError(f"slice {edges} must satisfy 0 ≤ x0 < x1 ≤ 1 and 0 ≤ y0 < y1 ≤ 1")
    place = np.mod(packing.x, packing.box) / packing.box
    inside = np.all((place >= (x0, y0)) & (place <= (x1, y1)), axis=1)
    contacts = packing.contacts
    # A contact that reaches across the box's edge leaves the slice even if both grains are in it.
    step = (
        packing.x[contacts.j] - packing.x[contacts.i] - contacts.normal * contacts.length[:, None]
    )
    crossing = np.any(np.abs(step) > 0.5 * packing.box, axis=1)
    return ~(inside[contacts.i] & inside[contacts.j]) | crossing


ROW = ("packing_fraction", "coordination", "dimension", "eta1", "eta2", "eta3", "acceptance")
ROW_COUNTS = ("accepted", "rejected", "unconverged", "skipped", "rattlers", "unloaded_contacts")


def row(parameters, dataset, cached):
    """One line of a sweep's table: plain numbers of one cell."""
    packing = parameters["packing"]
    return {
        "mu": packing["mu"],
        "seed": packing.get("seed"),
        **{name: dataset[name].item() for name in (*ROW, *ROW_COUNTS)},
        "residual": float(dataset["residual"].max()),
        "cached": cached,
    }
