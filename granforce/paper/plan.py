"""Plan of the study: which cells it is made of, and how they are computed.

Parts: "packing" and "walk" (every packing), "gauss_seidel" (the paper's own relaxation, on some),
"exact" (intervals), "uniform" (uniform states of S), "perturb" (critical forces and responses of
some contacts), "frozen" (exact intervals of the inner part with all forces outside held), "opened"
and "opened_exact" (packings made without friction, cones opened to μ), "size" and "size_exact"
(other numbers of disks).
"""

from typing import NamedTuple

from granforce import study, sweep
from granforce.records import InputError
from granforce.store import open_store

# The smallest two lie where soft modes do not yet amplify friction beyond its linear effect.
FRICTIONS = (0, 0.00001, 0.0001, 0.001, 0.003, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1, 2, 5, 10)
# Below this it takes minutes to follow a first motion, and bounds within a frozen surrounding end
# uncertified: contacts are perturbed and forces frozen from here on.
LEAST_FOLLOWED = 0.001
SLICE = (0.2, 0.8, 0.2, 0.8)  # inner part whose surroundings are frozen, in parts of the box
KEPT_STATES = 100  # of each walk, evenly spaced: measures come from all


class Plan(NamedTuple):
    """Size of the study; packings are those of seeds 1, 2, …, so smaller numbers are subsets."""

    n: int = 400
    frictions: tuple = FRICTIONS
    packings: int = 10
    states: int = 1000
    gauss_seidel_packings: int = 2
    exact_packings: int = 3
    uniform_packings: int = 3
    perturb_packings: int = 3
    perturb_contacts: int = 30
    sizes: tuple = (100, 200, 800, 1600)
    size_frictions: tuple = (0.1, 1.0)
    largest_exact: int = 800  # exact intervals of other sizes up to here


QUICK = Plan(
    n=40,
    frictions=(0, 0.01, 0.1, 0.3, 1, 10),
    packings=3,
    states=60,
    gauss_seidel_packings=1,
    exact_packings=2,
    uniform_packings=2,
    perturb_packings=1,
    perturb_contacts=4,
    sizes=(20, 80),
    size_frictions=(0.1,),
    largest_exact=80,
)


class Task(NamedTuple):
    """One cell of the study and what it is for."""

    part: str
    cell: sweep.Cell
    n: int
    mu: float  # of the cones
    seed: int  # of the packing


def tasks(plan):
    """All cells but the packings, those of the first packings first."""
    found = []
    for seed in range(1, plan.packings + 1):
        for applies in _PARTS.values():
            found += [task for task in applies(plan, seed)]
    return found


def packings(wanted):
    """The packing cells that tasks need, each once."""
    unique = {}
    for task in wanted:
        named = task.cell.parameters["packing"]
        unique.setdefault(str(sorted(named.items())), sweep.Cell("packing", named))
    return list(unique.values())


def compute(path, wanted, *, progress=None, **options):
    """Compute tasks into the store at path, packings first; options as for `sweep.run`.

    progress(what) gives the progress callable of the packings and of the cells. Returns what failed
    as (cell, error message); cells of failed packings are not tried.
    """
    progress = progress or (lambda what: None)
    failed = sweep.run(path, packings(wanted), progress=progress("packings"), **options)
    lost = [cell.parameters for cell, _ in failed]
    cells = [task.cell for task in wanted if task.cell.parameters["packing"] not in lost]
    return failed + sweep.run(path, cells, progress=progress("cells"), **options)


def _walk(part, n, seed, mu, plan, *, packing_mu=None, relax="accelerated"):
    packing = study.packing_parameters(n, mu if packing_mu is None else packing_mu, seed)
    keep = min(KEPT_STATES, plan.states)
    named = study.walk_parameters(packing, plan.states, mu=mu, relax=relax, keep=keep)
    return Task(part, sweep.Cell("walk", named), n, mu, seed)


def _exact(part, n, seed, mu, *, packing_mu=None, slice_=None):
    packing = study.packing_parameters(n, mu if packing_mu is None else packing_mu, seed)
    named = study.exact_parameters(packing, mu=mu, slice_=slice_)
    return Task(part, sweep.Cell("intervals", named), n, mu, seed)


def _walks(plan, seed):
    return [_walk("walk", plan.n, seed, mu, plan) for mu in plan.frictions]


def _gauss_seidel(plan, seed):
    if seed > plan.gauss_seidel_packings:
        return []
    options = {"relax": "gauss_seidel"}
    return [_walk("gauss_seidel", plan.n, seed, mu, plan, **options) for mu in plan.frictions]


def _exacts(plan, seed):
    if seed > plan.exact_packings:
        return []
    return [_exact("exact", plan.n, seed, mu) for mu in plan.frictions]


def _uniform(plan, seed):
    if seed > plan.uniform_packings:
        return []
    found = []
    for mu in plan.frictions:
        # All states are kept: their mean is the centre that distances are measured from.
        named = study.uniform_parameters(study.packing_parameters(plan.n, mu, seed), plan.states)
        found.append(Task("uniform", sweep.Cell("uniform", named), plan.n, mu, seed))
    return found


def _perturb(plan, seed):
    if seed > plan.perturb_packings:
        return []
    found = []
    for mu in plan.frictions:
        if 0 < mu < LEAST_FOLLOWED:
            continue
        packing = study.packing_parameters(plan.n, mu, seed)
        named = study.perturbation_parameters(packing, random=plan.perturb_contacts)
        found.append(Task("perturb", sweep.Cell("perturbation", named), plan.n, mu, seed))
    return found


def _frozen(plan, seed):
    if seed > plan.exact_packings:
        return []
    frictions = [mu for mu in plan.frictions if mu >= LEAST_FOLLOWED]
    return [_exact("frozen", plan.n, seed, mu, slice_=SLICE) for mu in frictions]


def _opened(plan, seed):
    if seed > plan.exact_packings:
        return []
    frictions = [mu for mu in plan.frictions if mu > 0]
    walks = [_walk("opened", plan.n, seed, mu, plan, packing_mu=0) for mu in frictions]
    return walks + [_exact("opened_exact", plan.n, seed, mu, packing_mu=0) for mu in frictions]


def _sizes(plan, seed):
    found = []
    for n in plan.sizes:
        # Large packings average over more contacts: fewer of them are needed.
        if seed > max(1, min(plan.packings, plan.packings * plan.n // n)):
            continue
        found += [_walk("size", n, seed, mu, plan) for mu in plan.size_frictions]
        if n <= plan.largest_exact and seed <= plan.exact_packings:
            found += [_exact("size_exact", n, seed, mu) for mu in plan.size_frictions]
    return found


_PARTS = {
    "walk": _walks,
    "exact": _exacts,
    "uniform": _uniform,
    "gauss_seidel": _gauss_seidel,
    "frozen": _frozen,
    "perturb": _perturb,
    "opened": _opened,
    "size": _sizes,
}

PARTS = tuple(_PARTS)


def chosen(plan, parts=None):
    """The tasks of some parts (names out of PARTS), or all."""
    unknown = set(parts or ()) - set(PARTS)
    if unknown:
        raise InputError(f"unknown part {min(unknown)!r}: take some of {', '.join(PARTS)}")
    wanted = tasks(plan)
    return wanted if parts is None else [task for task in wanted if _family(task.part) in parts]


def _family(part):
    return part.removesuffix("_exact")


def finished(path, plan):
    """Yield (task, dataset) for the tasks of a plan that the store at path has."""
    store = open_store(path)
    for task in tasks(plan):
        dataset = sweep.load(store, task.cell)
        if dataset is not None:
            yield task, dataset
