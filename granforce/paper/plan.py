"""Plan of the study: its cells, and the order in which they are computed.

Parts, the most valuable first: "exact" (intervals, with z, h and φ), "walk" (by nearest networks)
and "uniform" (uniform states of S), all three in the same packings; "response" (critical forces and
first motions of random contacts), "response_long" and "response_fine" (some of them with four times
the implicit steps, or with load steps a quarter as long); "sweeps_1e-3"
(walks by Gauss–Seidel sweeps alone, as in the paper, which end at that residual in ⟨f_n⟩);
"prepared_…" (walks and, with "…_exact", intervals of packings made with other options);
"resting_…" (intervals of small packings in which drag sets in earlier or later); "opened"
and "opened_exact" (frictionless packings, cones opened to μ) and "widest_exact" (packings made at
μ, cones opened to the largest μ); "stress" (outlines of the stresses that the contacts can carry)
and "stress_uniform" (uniform states, for their stresses); "frozen" and "frozen_large" (exact
intervals of the inner part with all forces outside fixed); "volume" (ln V of S) and "volume_size"
(the same for other numbers of disks); "sweeps_1e-4" and "sweeps_1e-6" (sweeps that end later);
"repeat_…" (repeated and longer walks); "size", "size_sweeps" and "size_exact" (other numbers of
disks).
"""

import itertools
from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import xarray as xr

from granforce.numerics.lanes import LANES
from granforce.packing.compaction import NEARLY_BALANCED, default_steps
from granforce.perturb.critical_force import MOST_STEPS, Protocol
from granforce.records import InputError
from granforce.study import kinds, scan
from granforce.study.cells import Kind, StudyCell, load
from granforce.study.keys import canonical
from granforce.study.store import open_store

# At the smallest two, soft modes do not yet amplify friction beyond its linear effect.
FRICTIONS = (
    *(0, 0.00001, 0.0001, 0.001, 0.003, 0.01, 0.02, 0.05, 0.07, 0.1, 0.14, 0.2, 0.3, 0.5),
    *(1, 2, 3, 5, 10),
)
# Below this a first motion takes minutes to follow, and bounds with frozen surroundings end
# uncertified (in small packings also above): contacts are perturbed and forces frozen from here on.
LEAST_FOLLOWED = 0.001
SLICE = (0.2, 0.8, 0.2, 0.8)  # inner part with frozen surroundings, in fractions of the box
KEPT_STATES = 100  # of each walk, evenly spaced; measures use all states
# The paper's walk. The paper does not state the final residual of its sweeps, so it is an option
# here. At large μ most attempts end without equilibrium: a walk stops after this many attempts per
# state and is stored with the states it has.
SWEEPS = {"sweeps_1e-3": 1e-3, "sweeps_1e-4": 1e-4, "sweeps_1e-6": 1e-6}
PAPERS = "sweeps_1e-3"  # taken as the paper's, as these converge at every μ
ATTEMPTS = 3
# All states of the first packing are stored at these, for Figures 3 and 5.
SHOWN_FRICTIONS = (0.01, 0.1, 1.0, 10.0)
SHOWN_PARTS = (PAPERS, "walk")
# Walks in lanes take a fifth of the time of one walk with as many states; a state is independent of
# its start after about ten others.
CHAINS = LANES
# The residual that most attempts do not reach at large μ: requested for fewer states.
HARDEST, HARDEST_STATES = "sweeps_1e-6", 200
LONGER_WALK = 4  # factor, to test whether η depends on the length
LONGER, FINER = 4, 4  # factors of the implicit steps of a load, and of the fineness of loads


def variations(mu: float) -> dict[str, dict[str, Any]]:
    """Variations of the preparation at this friction, by name: options of `pack`."""
    dt, sweeps = default_steps(mu, None, None)
    return {
        "half_steps": {"dt": dt / 2},
        "double_steps": {"dt": 2 * dt},
        "box_mass_30": {"box_mass": 30.0},
        "box_mass_300": {"box_mass": 300.0},
        "accuracy": {"accuracy": 0.001, "sweeps": 4 * sweeps},
        "sweeps": {"sweeps": 4 * sweeps},
        "late_drag": {"drag_below": NEARLY_BALANCED / 100},
    }


# From this μ on, h depends on when drag replaces inertia: small packings, options of `pack`.
DRAG_MATTERS = 0.5
RESTING: dict[str, dict[str, Any]] = {
    "resting_default": {},
    **{f"resting_{k}": {"drag_below": NEARLY_BALANCED / k} for k in (100, 10_000)},
}


class Plan(NamedTuple):
    """Size of the study; packings have seeds 1, 2, …, so smaller numbers are subsets.

    Exact intervals, walks by nearest networks and uniform states use all `packings`; everything
    else uses the first of them.
    """

    n: int = 400
    frictions: tuple[float, ...] = FRICTIONS
    packings: int = 30
    states: int = 1000
    gauss_seidel_packings: int = 10
    residual_packings: int = 5  # of those, with sweeps to smaller residuals
    response_packings: int = 10
    response_contacts: int = 20
    perturb_packings: int = 3  # of those, with other steps
    prepared_packings: int = 20
    prepared_frictions: tuple[float, ...] = (0.1, 0.5, 1, 3, 10)
    opened_packings: int = 10
    repeat_packings: int = 5
    repeats: int = 2  # in addition to the first walk
    repeat_frictions: tuple[float, ...] = (0.01, 0.1, 1, 10)
    frozen_packings: int = 10
    frozen_from: float = LEAST_FOLLOWED  # smallest μ: bounds of a thinner S end uncertified
    frozen_large: int = 1600  # disks
    frozen_large_packings: int = 3
    frozen_large_frictions: tuple[float, ...] = (0.01, 0.1, 0.5, 1, 10)
    stress_packings: int = 10
    stress_states: int = 300
    volume_packings: int = 10
    # For ln V, which varies far more between packings; in proportion to N beyond n.
    volume_accuracy: float = 0.1
    sizes: tuple[int, ...] = (100, 200, 800, 1600)
    size_packings: int = 10
    size_frictions: tuple[float, ...] = (0.1, 1.0)
    largest_exact: int = 800  # largest size for exact intervals


QUICK = Plan(
    n=48,
    frictions=(0, 0.0001, 0.001, 0.01, 0.1, 0.3, 1, 10),
    packings=3,
    states=60,
    gauss_seidel_packings=3,
    response_contacts=4,
    perturb_packings=1,
    prepared_frictions=(1,),
    repeat_packings=1,
    frozen_from=0.01,
    frozen_large=80,
    frozen_large_packings=1,
    frozen_large_frictions=(0.1, 1),
    stress_states=50,
    volume_packings=2,
    volume_accuracy=0.3,
    sizes=(20, 80),
    size_frictions=(0.1,),
    largest_exact=80,
)


class Task(NamedTuple):
    """One cell of the study and its purpose."""

    part: str
    cell: StudyCell
    n: int
    mu: float  # of the cones
    seed: int  # of the packing

    @property
    def packing_mu(self) -> float:
        """Friction with which its packing was made."""
        return float(self.cell.parameters["packing"]["mu"])


def tasks(plan: Plan) -> list[Task]:
    """All cells except the packings, part by part, each with the first packings first."""
    by_part: dict[str, list[Task]] = {}
    for applies in _PARTS.values():
        for seed in range(1, plan.packings + 1):
            for task in applies(plan, seed):
                by_part.setdefault(task.part, []).append(task)
    return list(itertools.chain(*by_part.values()))


def packings(tasks_of_plan: Iterable[Task]) -> list[StudyCell]:
    """The packing cells that tasks need, each once."""
    unique: dict[Any, Any] = {}
    for task in tasks_of_plan:
        named = task.cell.parameters["packing"]
        unique.setdefault(canonical(named), StudyCell(kinds.PACKING, named))
    return list(unique.values())


def compute(
    path: str | Path, chosen_tasks: Sequence[Task], **options: Any
) -> list[tuple[StudyCell, str]]:
    """Compute tasks into the store at path, in their order; options as for `scan.run`.

    A packing is made when the first task needs it, so that the most important results exist
    whenever the computation ends. Returns failures as (cell, error message); cells of failed
    packings are not tried.
    """
    cells: dict[str, StudyCell] = {}
    for task in chosen_tasks:
        for cell in (*packings([task]), task.cell):
            cells.setdefault(f"{cell.kind.name} {canonical(cell.parameters)}", cell)
    return scan.run(path, list(cells.values()), **options)


def _task(
    part: str,
    kind: Kind,
    n: int,
    seed: int,
    mu: float,
    *arguments: Any,
    packing_mu: float | None = None,
    packing_options: dict[str, Any] | None = None,
    **how: Any,
) -> Task:
    """The Task of a kind with the kind's arguments after the packing, and the packing's options."""
    packed = kinds.PACKING.parameters(
        n, mu if packing_mu is None else packing_mu, seed, **packing_options or {}
    )
    return Task(
        part, StudyCell(kind, kind.parameters(packed, *arguments, mu=mu, **how)), n, mu, seed
    )


def _walk(
    part: str,
    n: int,
    seed: int,
    mu: float,
    plan: Plan,
    *,
    states: int | None = None,
    walk_seed: int = 0,
    **how: Any,
) -> Task:
    states = plan.states if states is None else states
    shown = part in SHOWN_PARTS and seed == 1 and mu in SHOWN_FRICTIONS
    keep = states if shown else min(KEPT_STATES, states)
    return _task(part, kinds.WALK, n, seed, mu, states, walk_seed, keep=keep, **how)


def _exact(part: str, n: int, seed: int, mu: float, **how: Any) -> Task:
    return _task(part, kinds.INTERVALS, n, seed, mu, **how)


def _exacts(plan: Plan, seed: int) -> list[Task]:
    return [_exact("exact", plan.n, seed, mu) for mu in plan.frictions]


def _walks(plan: Plan, seed: int) -> list[Task]:
    return [_nearest("walk", seed, mu, plan) for mu in plan.frictions]


def _nearest(part: str, seed: int, mu: float, plan: Plan, **how: Any) -> Task:
    return _walk(part, plan.n, seed, mu, plan, skip=mu > 0, **how)


def _uniform(plan: Plan, seed: int) -> list[Task]:
    # The mean of the kept states is the centre of distances: an error of a tenth of the scatter of
    # states changes a distance by half a per cent.
    return [
        _task("uniform", kinds.UNIFORM, plan.n, seed, mu, plan.states, keep=KEPT_STATES)
        for mu in plan.frictions
    ]


def _sweeps(plan: Plan, seed: int) -> list[Task]:
    frictions = plan.frictions if seed <= plan.gauss_seidel_packings else ()
    return [_swept(PAPERS, seed, mu, plan) for mu in frictions]


def _residuals(plan: Plan, seed: int) -> list[Task]:
    few = min(plan.residual_packings, plan.gauss_seidel_packings)
    frictions = plan.frictions if seed <= few else ()
    parts = [part for part in SWEEPS if part != PAPERS]
    return [_swept(part, seed, mu, plan, ends=part) for part in parts for mu in frictions]


def _swept(
    part: str,
    seed: int,
    mu: float,
    plan: Plan,
    *,
    ends: str = PAPERS,
    n: int | None = None,
    **how: Any,
) -> Task:
    """A walk by sweeps that end at the residual of the part `ends`."""
    states = how.pop("states", plan.states)
    states = min(HARDEST_STATES, states) if ends == HARDEST else states
    options: dict[str, Any] = {"relax": "gauss_seidel_only", "residual": SWEEPS[ends]}
    options |= {"attempts": ATTEMPTS, "chains": min(CHAINS, states)}
    # If S is one point, sweeps end near it: the distance is measured, unless no sweeps would end.
    options["skip"] = mu > 0 or ends == HARDEST
    return _walk(part, n or plan.n, seed, mu, plan, states=states, **options, **how)


def _repeated(plan: Plan, seed: int) -> list[Task]:
    """Walks with other seeds, numbered in the name of their part, and longer ones."""
    family = []
    for mu in plan.repeat_frictions if seed <= plan.repeat_packings else ():
        for part, walk in (("repeat_sweeps", _swept), ("repeat_walk", _nearest)):
            for k in range(1, plan.repeats + 1):
                family.append(walk(f"{part}_{k}", seed, mu, plan, walk_seed=k))
            longer = LONGER_WALK * plan.states
            family.append(walk(f"{part}_long", seed, mu, plan, states=longer))
    return family


def _responses(plan: Plan, seed: int) -> list[Task]:
    family = []
    precision, rise, _ = Protocol()
    for part, packings, protocol in (
        ("response", plan.response_packings, {}),
        ("response_long", plan.perturb_packings, {"max_steps": LONGER * MOST_STEPS}),
        (
            "response_fine",
            plan.perturb_packings,
            {"rise": rise / FINER, "precision": precision / FINER},
        ),
    ):
        for mu in plan.frictions if seed <= packings else ():
            if 0 < mu < LEAST_FOLLOWED:
                continue
            how: dict[str, Any] = {"random": plan.response_contacts, **protocol}
            family.append(_task(part, kinds.PERTURBATION, plan.n, seed, mu, **how))
    return family


def _frozen(plan: Plan, seed: int) -> list[Task]:
    family = []
    if seed <= plan.frozen_packings:
        frictions = [mu for mu in plan.frictions if mu >= plan.frozen_from]
        family += [_exact("frozen", plan.n, seed, mu, slice_=SLICE) for mu in frictions]
    if seed <= plan.frozen_large_packings:
        n, large = plan.frozen_large, plan.frozen_large_frictions
        family += [_exact("frozen_large", n, seed, mu, slice_=SLICE) for mu in large]
    return family


def _prepared(plan: Plan, seed: int) -> list[Task]:
    if seed > plan.prepared_packings:
        return []
    family = []
    for mu in plan.prepared_frictions:
        for name, options in variations(mu).items():
            family.append(_nearest(f"prepared_{name}", seed, mu, plan, packing_options=options))
            family.append(
                _exact(f"prepared_{name}_exact", plan.n, seed, mu, packing_options=options)
            )
    return family


def _resting(plan: Plan, seed: int) -> list[Task]:
    frictions = plan.prepared_frictions if seed <= plan.prepared_packings else ()
    return [
        _exact(part, n, seed, mu, packing_options=options)
        for n in plan.sizes[:1]
        for part, options in RESTING.items()
        for mu in frictions
        if mu >= DRAG_MATTERS
    ]


def _opened(plan: Plan, seed: int) -> list[Task]:
    if seed > plan.opened_packings:
        return []
    n, widest = plan.n, max(plan.frictions)
    frictions = [mu for mu in plan.frictions if mu > 0]
    family = [_walk("opened", n, seed, mu, plan, packing_mu=0) for mu in frictions]
    family += [_exact("opened_exact", n, seed, mu, packing_mu=0) for mu in frictions]
    # Frictionless packings, and those with the largest friction, exist already.
    between = [mu for mu in frictions if mu < widest]
    return family + [_exact("widest_exact", n, seed, widest, packing_mu=mu) for mu in between]


def _sizes(plan: Plan, seed: int) -> list[Task]:
    family = []
    for n in plan.sizes:
        # Large packings average over more contacts, so fewer are needed.
        if seed > _of_size(plan.size_packings, n, plan):
            continue
        for mu in plan.size_frictions:
            family.append(_walk("size", n, seed, mu, plan))
            family.append(_swept("size_sweeps", seed, mu, plan, n=n))
            if n <= plan.largest_exact:
                family.append(_exact("size_exact", n, seed, mu))
    return family


def _of_size(packings: int, n: int, plan: Plan) -> int:
    """Number of packings of n disks that corresponds to this number at the usual size."""
    return max(1, min(packings, packings * plan.n // n))


def _stresses(plan: Plan, seed: int) -> list[Task]:
    # Without friction there is one network, with one stress.
    frictions = [mu for mu in plan.frictions if mu > 0] if seed <= plan.stress_packings else []
    family = [_task("stress", kinds.STRESS, plan.n, seed, mu) for mu in frictions]
    drawn = ("stress_uniform", kinds.UNIFORM, plan.n, seed)
    return family + [_task(*drawn, mu, plan.stress_states) for mu in frictions]


def _volumes(plan: Plan, seed: int) -> list[Task]:
    if seed > plan.volume_packings:
        return []
    family = [_volume("volume", plan.n, seed, mu, plan) for mu in plan.frictions if mu > 0]
    for n in plan.sizes:
        if seed <= _of_size(plan.volume_packings, n, plan):
            family += [_volume("volume_size", n, seed, mu, plan) for mu in plan.size_frictions]
    return family


def _volume(part: str, n: int, seed: int, mu: float, plan: Plan) -> Task:
    accuracy = plan.volume_accuracy * max(1.0, n / plan.n)
    return _task(part, kinds.VOLUME, n, seed, mu, accuracy)


# The families of parts, which are computed by name, in this order.
_PARTS = {
    "exact": _exacts,
    "walk": _walks,
    "uniform": _uniform,
    "response": _responses,
    "sweeps": _sweeps,
    "prepared": _prepared,
    "resting": _resting,
    "opened": _opened,
    "stress": _stresses,
    "frozen": _frozen,
    "volume": _volumes,
    "residuals": _residuals,
    "repeat": _repeated,
    "size": _sizes,
}

PARTS = tuple(_PARTS)
# Parts that the paper has: its walks, and its response to local forces.
PAPER = ("response", "sweeps", "residuals")


def chosen(plan: Plan, parts: Collection[str] | None = None) -> list[Task]:
    """The tasks of some families of parts (names from PARTS), or all."""
    unknown = set(parts or ()) - set(PARTS)
    if unknown:
        raise InputError(f"unknown part {min(unknown)!r}; choose from {', '.join(PARTS)}")
    every = tasks(plan)
    return every if parts is None else [task for task in every if _family(task.part) in parts]


def _family(part: str) -> str:
    if part in SWEEPS and part != PAPERS:
        return "residuals"
    word = part.split("_")[0]
    return "opened" if word == "widest" else word


def _like(task: Task) -> tuple[str, int, str, str]:
    """The properties of a task that determine its duration."""
    return task.cell.kind.name, task.n, str(task.cell.parameters.get("relax")), "alike"


def remaining(path: str | Path, wanted: Sequence[Task]) -> list[dict[str, Any]]:
    """A row for each part of some tasks: cells, how many are done, and the minutes they took.

    Includes an estimate of the remaining minutes: the mean of finished cells of the same part and
    size, at the same μ if there are any, otherwise of the same kind; NaN if unknown.
    """
    store = open_store(path)
    took: dict[Any, list[float]] = {}
    counts: dict[str, list[tuple[Task, bool]]] = {}
    for task in wanted:
        dataset = load(store, *task.cell)
        counts.setdefault(task.part, []).append((task, dataset is not None))
        if dataset is not None:
            for key in ((task.part, task.n, task.mu), (task.part, task.n), _like(task)):
                took.setdefault(key, []).append(float(dataset["seconds"]) / 60)
    rows = []
    for part, tasks_of in counts.items():
        done = [task for task, finished in tasks_of if finished]
        left = [task for task, finished in tasks_of if not finished]
        known = [
            took.get((part, t.n, t.mu)) or took.get((part, t.n)) or took.get(_like(t)) for t in left
        ]
        spent = sum(sum(v) for key, v in took.items() if key[0] == part and len(key) == 3)
        ahead = sum(sum(v) / len(v) if v else float("nan") for v in known)
        rows.append(
            {"part": part, "cells": len(tasks_of), "done": len(done)}
            | {"minutes": round(spent, 1), "minutes left": round(float(ahead), 1)}
        )
    return rows


def finished_tasks(path: str | Path, plan: Plan) -> Iterator[tuple[Task, xr.Dataset]]:
    """Yield (task, dataset) for the tasks of a plan that are in the store at path."""
    store = open_store(path)
    for task in tasks(plan):
        dataset = load(store, *task.cell)
        if dataset is not None:
            yield task, dataset
