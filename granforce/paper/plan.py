"""Plan of the study: which cells it is made of, and how they are computed.

Parts: "sweeps_1e-3", "sweeps_1e-4" and "sweeps_1e-6" (walks by Gauss–Seidel sweeps alone, as in the
paper, which end at that residual in ⟨f_n⟩), "walk" (by nearest networks), "exact" (intervals),
"uniform" (uniform states of S), "response" (critical forces and first motions of random contacts,
loads raised in tenths of the way), "response_long" (some of them with four times the implicit
steps) and "perturb" (loads raised by 0.4 of the way), "frozen" and "frozen_large" (exact intervals
of the inner part with all forces outside held), "prepared_…" (walks in packings made with another
time step or accuracy), "opened" and "opened_exact" (packings made without friction, cones opened
to μ), "size", "size_sweeps" and "size_exact" (other numbers of disks), "stress" (outlines of the
stresses that the contacts can carry), "stress_uniform" (uniform states, for their stresses),
"volume" (ln V of S), "volume_size" (that of other numbers of disks), "tails" and "tails_stress"
(uniform states of large packings, with the pressure and with the whole stress prescribed, for the
distribution of f_n).
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import xarray as xr

from granforce.numerics.lanes import LANES
from granforce.perturb.critical_force import MOST_STEPS
from granforce.records import InputError, Progress
from granforce.study import kinds, scan
from granforce.study.cells import Cell, Kind, load
from granforce.study.store import open_store

# The smallest two lie where soft modes do not yet amplify friction beyond its linear effect.
FRICTIONS = (0, 0.00001, 0.0001, 0.001, 0.003, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1, 2, 5, 10)
# Below this it takes minutes to follow a first motion, and bounds within frozen surroundings end
# uncertified (in small packings also above): contacts are perturbed and forces frozen from here on.
LEAST_FOLLOWED = 0.001
SLICE = (0.2, 0.8, 0.2, 0.8)  # inner part whose surroundings are frozen, in parts of the box
KEPT_STATES = 100  # of each walk, evenly spaced: measures come from all
# All states are kept of these, of the first packing: Figures 3 and 5 show them.
SHOWN_FRICTIONS = (0.01, 0.1, 1.0, 10.0)
SHOWN_PARTS = ("sweeps_1e-3", "walk")
# The paper's walk. It does not say where its sweeps end. Most attempts end in no equilibrium at
# large μ: a walk is kept with the states that it has after so many attempts for each.
SWEEPS = {"sweeps_1e-3": 1e-3, "sweeps_1e-4": 1e-4}
ATTEMPTS = 3
# Walks that go side by side take a fifth of the time of one as long as all of them; a state has
# forgotten where it came from after some ten others.
CHAINS = LANES
# The residual that most attempts do not reach at large μ: tried with fewer states.
HARDEST, HARDEST_STATES = ("sweeps_1e-6", 1e-6), 200
# Part of the way to the limit load by which the next load lies above the last at rest.
RISE, LONGER = 0.1, 4
# What else packings are made with.
PREPARED = {
    "prepared_dt_0.1": {"dt": 0.1, "sweeps": 600},
    "prepared_dt_0.01": {"dt": 0.01},
    "prepared_accuracy_0.003": {"accuracy": 0.003, "sweeps": 600},
}


class Plan(NamedTuple):
    """Size of the study; packings are those of seeds 1, 2, …, so smaller numbers are subsets."""

    n: int = 400
    frictions: tuple[float, ...] = FRICTIONS
    packings: int = 10
    states: int = 1000
    gauss_seidel_packings: int = 10
    hardest_packings: int = 10  # with sweeps down to the smallest residual
    # More packings where the maximum is, and where packings differ most.
    fine_frictions: tuple[float, ...] = (0.05, 0.07, 0.1, 0.14, 0.2, 0.3)
    large_frictions: tuple[float, ...] = (0.5, 1, 2, 5, 10)
    many_packings: int = 30
    exact_packings: int = 3
    uniform_packings: int = 10
    response_packings: int = 10
    response_contacts: int = 20
    perturb_packings: int = 3
    perturb_contacts: int = 30
    frozen_packings: int = 10
    frozen_from: float = LEAST_FOLLOWED  # smallest μ: bounds of thinner S end uncertified
    frozen_large: int = 1600  # disks
    frozen_large_frictions: tuple[float, ...] = (0.01, 0.1, 0.5, 1, 10)
    prepared_packings: int = 10
    prepared_frictions: tuple[float, ...] = (1, 10)
    sizes: tuple[int, ...] = (100, 200, 800, 1600)
    size_frictions: tuple[float, ...] = (0.1, 1.0)
    largest_exact: int = 800  # exact intervals of other sizes up to here
    stress_packings: int = 10
    stress_uniform_packings: int = 3
    stress_states: int = 300
    volume_packings: int = 10
    # Of ln V, which differs by far more from packing to packing; in proportion to N beyond n.
    volume_accuracy: float = 0.1
    tails_n: int = 1600
    tails_frictions: tuple[float, ...] = (0.01, 0.1, 1)
    # 9 million forces of each kind, ten in the bin of 1/8 ⟨f_n⟩ where P(f_n) is 10⁻⁵. Where S is
    # narrow the largest forces are those of few contacts: many packings count, not many states.
    tails_packings: int = 16
    tails_states: int = 200


QUICK = Plan(
    n=48,
    frictions=(0, 0.0001, 0.001, 0.01, 0.1, 0.3, 1, 10),
    packings=3,
    states=60,
    gauss_seidel_packings=3,
    hardest_packings=1,
    fine_frictions=(),
    large_frictions=(),
    many_packings=0,
    exact_packings=3,
    uniform_packings=3,
    response_packings=3,
    response_contacts=4,
    perturb_packings=1,
    perturb_contacts=4,
    frozen_packings=3,
    frozen_from=0.01,
    frozen_large=80,
    frozen_large_frictions=(0.1, 1),
    prepared_packings=3,
    prepared_frictions=(1,),
    sizes=(20, 80),
    size_frictions=(0.1,),
    largest_exact=80,
    stress_packings=3,
    stress_states=50,
    volume_packings=2,
    volume_accuracy=0.3,
    tails_n=80,
    tails_frictions=(0.1, 1),
    tails_packings=1,
    tails_states=40,
)


class Task(NamedTuple):
    """One cell of the study and what it is for."""

    part: str
    cell: Cell
    n: int
    mu: float  # of the cones
    seed: int  # of the packing


def tasks(plan: Plan) -> list[Task]:
    """All cells but the packings, those of the first packings first."""
    found = []
    for seed in range(1, max(plan.packings, plan.many_packings) + 1):
        for applies in _PARTS.values():
            found += [task for task in applies(plan, seed)]
    return found


def packings(wanted: Iterable[Task]) -> list[Cell]:
    """The packing cells that tasks need, each once."""
    unique: dict[Any, Any] = {}
    for task in wanted:
        named = task.cell.parameters["packing"]
        unique.setdefault(str(sorted(named.items())), Cell(kinds.PACKING, named))
    return list(unique.values())


def compute(
    path: str | Path,
    wanted: Sequence[Task],
    *,
    progress: Callable[[str], Progress | None] | None = None,
    **options: Any,
) -> list[tuple[Cell, str]]:
    """Compute tasks into the store at path, packings first; options as for `scan.run`.

    progress(what) gives the progress callable of the packings and of the cells. Returns what failed
    as (cell, error message); cells of failed packings are not tried.
    """
    progress = progress or (lambda what: None)
    failed = scan.run(path, packings(wanted), progress=progress("packings"), **options)
    lost = [cell.parameters for cell, _ in failed]
    cells = [task.cell for task in wanted if task.cell.parameters["packing"] not in lost]
    return failed + scan.run(path, cells, progress=progress("cells"), **options)


def _task(
    part: str,
    kind: Kind,
    n: int,
    seed: int,
    mu: float,
    *arguments: Any,
    packing_mu: float | None = None,
    made: dict[str, Any] | None = None,
    **how: Any,
) -> Task:
    """The Task of a kind; its arguments beside the packing, and what that was made with."""
    packed = kinds.PACKING.parameters(
        n, mu if packing_mu is None else packing_mu, seed, **made or {}
    )
    return Task(part, Cell(kind, kind.parameters(packed, *arguments, mu=mu, **how)), n, mu, seed)


def _walk(
    part: str, n: int, seed: int, mu: float, plan: Plan, *, states: int | None = None, **how: Any
) -> Task:
    states = plan.states if states is None else states
    shown = part in SHOWN_PARTS and seed == 1 and mu in SHOWN_FRICTIONS
    keep = states if shown else min(KEPT_STATES, states)
    return _task(part, kinds.WALK, n, seed, mu, states, keep=keep, **how)


def _exact(part: str, n: int, seed: int, mu: float, **how: Any) -> Task:
    return _task(part, kinds.INTERVALS, n, seed, mu, **how)


def _frictions(plan: Plan, seed: int, packings: int, more: Iterable[float] = ()) -> list[float]:
    """Those of the plan for the first packings, and some more for many."""
    wanted = set(plan.frictions) if seed <= min(packings, plan.packings) else set()
    return sorted(wanted | (set(more) if seed <= plan.many_packings else set()))


def _sweeps(plan: Plan, seed: int) -> list[Task]:
    found = []
    for mu in _frictions(plan, seed, plan.gauss_seidel_packings, plan.fine_frictions):
        for part, residual in SWEEPS.items():
            if seed <= plan.gauss_seidel_packings or residual == max(SWEEPS.values()):
                found.append(_swept(part, residual, seed, mu, plan))
    if seed <= min(plan.hardest_packings, plan.packings):
        part, residual = HARDEST
        states = min(HARDEST_STATES, plan.states)
        found += [_swept(part, residual, seed, mu, plan, states) for mu in plan.frictions]
    return found


def _swept(
    part: str,
    residual: float,
    seed: int,
    mu: float,
    plan: Plan,
    states: int | None = None,
    n: int | None = None,
) -> Task:
    how: dict[str, Any] = {"relax": "gauss_seidel_only", "residual": residual, "attempts": ATTEMPTS}
    how["chains"] = min(CHAINS, states or plan.states)
    # Where S is one point, sweeps end beside it: how far is measured, but not to where none ends.
    how["skip"] = mu > 0 or part == HARDEST[0]
    return _walk(part, n or plan.n, seed, mu, plan, states=states, **how)


def _walks(plan: Plan, seed: int) -> list[Task]:
    many = plan.fine_frictions + plan.large_frictions
    frictions = _frictions(plan, seed, plan.packings, many)
    return [_walk("walk", plan.n, seed, mu, plan, skip=mu > 0) for mu in frictions]


def _exacts(plan: Plan, seed: int) -> list[Task]:
    many = plan.fine_frictions + plan.large_frictions
    frictions = _frictions(plan, seed, plan.exact_packings, many)
    return [_exact("exact", plan.n, seed, mu) for mu in frictions]


def _uniform(plan: Plan, seed: int) -> list[Task]:
    if seed > min(plan.uniform_packings, plan.packings):
        return []
    # All states are kept: their mean is the centre that distances are measured from.
    frictions = sorted(set(plan.frictions) | set(plan.fine_frictions))
    return [_task("uniform", kinds.UNIFORM, plan.n, seed, mu, plan.states) for mu in frictions]


def _responses(plan: Plan, seed: int) -> list[Task]:
    longer = {"max_steps": LONGER * MOST_STEPS}
    found = []
    for part, packings, contacts, protocol in (
        ("response", plan.response_packings, plan.response_contacts, {"rise": RISE}),
        ("response_long", plan.perturb_packings, plan.response_contacts, {"rise": RISE, **longer}),
        ("perturb", plan.perturb_packings, plan.perturb_contacts, {}),
    ):
        for mu in plan.frictions if seed <= min(packings, plan.packings) else ():
            if 0 < mu < LEAST_FOLLOWED:
                continue
            how: dict[str, Any] = {"random": contacts, **protocol}
            found.append(_task(part, kinds.PERTURBATION, plan.n, seed, mu, **how))
    return found


def _frozen(plan: Plan, seed: int) -> list[Task]:
    if seed > min(plan.frozen_packings, plan.packings):
        return []
    frictions = [mu for mu in plan.frictions if mu >= plan.frozen_from]
    found = [_exact("frozen", plan.n, seed, mu, slice_=SLICE) for mu in frictions]
    if seed <= min(plan.exact_packings, plan.packings):
        n, frictions = plan.frozen_large, plan.frozen_large_frictions
        found += [_exact("frozen_large", n, seed, mu, slice_=SLICE) for mu in frictions]
    return found


def _prepared(plan: Plan, seed: int) -> list[Task]:
    if seed > min(plan.prepared_packings, plan.packings):
        return []
    return [
        _walk(part, plan.n, seed, mu, plan, made=made)
        for part, made in PREPARED.items()
        for mu in plan.prepared_frictions
    ]


def _opened(plan: Plan, seed: int) -> list[Task]:
    if seed > min(plan.exact_packings, plan.packings):
        return []
    frictions = [mu for mu in plan.frictions if mu > 0]
    walks = [_walk("opened", plan.n, seed, mu, plan, packing_mu=0) for mu in frictions]
    return walks + [_exact("opened_exact", plan.n, seed, mu, packing_mu=0) for mu in frictions]


def _sizes(plan: Plan, seed: int) -> list[Task]:
    found = []
    for n in plan.sizes:
        # Large packings average over more contacts: fewer of them are needed.
        if seed > max(1, min(plan.packings, plan.packings * plan.n // n)):
            continue
        found += [_walk("size", n, seed, mu, plan) for mu in plan.size_frictions]
        (residual,) = (SWEEPS[part] for part in SHOWN_PARTS if part in SWEEPS)
        found += [
            _swept("size_sweeps", residual, seed, mu, plan, n=n) for mu in plan.size_frictions
        ]
        few = max(plan.exact_packings, plan.exact_packings * plan.n // n)
        if n <= plan.largest_exact and seed <= few:
            found += [_exact("size_exact", n, seed, mu) for mu in plan.size_frictions]
    return found


def _stresses(plan: Plan, seed: int) -> list[Task]:
    found = []
    for mu in plan.frictions if seed <= min(plan.stress_packings, plan.packings) else ():
        if mu == 0:
            continue  # one network, one stress
        at = plan.n, seed, mu
        found.append(_task("stress", kinds.STRESS, *at))
        if seed <= plan.stress_uniform_packings:
            found.append(_task("stress_uniform", kinds.UNIFORM, *at, plan.stress_states))
    return found


def _volumes(plan: Plan, seed: int) -> list[Task]:
    if seed > min(plan.volume_packings, plan.packings):
        return []
    found = [_volume("volume", plan.n, seed, mu, plan) for mu in plan.frictions if mu > 0]
    for n in plan.sizes:
        # Large packings average over more contacts: fewer of them are needed.
        if seed <= max(1, min(plan.volume_packings, plan.volume_packings * plan.n // n)):
            found += [_volume("volume_size", n, seed, mu, plan) for mu in plan.size_frictions]
    return found


def _volume(part: str, n: int, seed: int, mu: float, plan: Plan) -> Task:
    accuracy = plan.volume_accuracy * max(1.0, n / plan.n)
    return _task(part, kinds.VOLUME, n, seed, mu, accuracy)


def _tails(plan: Plan, seed: int) -> list[Task]:
    if seed > min(plan.tails_packings, max(plan.packings, plan.many_packings)):
        return []
    n, states = plan.tails_n, plan.tails_states
    parts: dict[str, Any] = {"tails": {}, "tails_stress": {"prescribed": "stress"}}
    return [
        _task(part, kinds.UNIFORM, n, seed, mu, states, **asked)
        for mu in plan.tails_frictions
        for part, asked in parts.items()
    ]


# The parts by families, which are computed by name; those of the paper first.
_PARTS = {
    "sweeps": _sweeps,
    "response": _responses,
    "walk": _walks,
    "exact": _exacts,
    "uniform": _uniform,
    "frozen": _frozen,
    "prepared": _prepared,
    "opened": _opened,
    "size": _sizes,
    "stress": _stresses,
    "volume": _volumes,
    "tails": _tails,
}

PARTS = tuple(_PARTS)
# What the paper did: its walks, and its response to local forces.
PAPER = ("sweeps", "response")


def chosen(plan: Plan, parts: Collection[str] | None = None) -> list[Task]:
    """The tasks of some families of parts (names out of PARTS), or all."""
    unknown = set(parts or ()) - set(PARTS)
    if unknown:
        raise InputError(f"unknown part {min(unknown)!r}: take some of {', '.join(PARTS)}")
    wanted = tasks(plan)
    return wanted if parts is None else [task for task in wanted if _family(task.part) in parts]


def _family(part: str) -> str:
    return "response" if part == "perturb" else part.split("_")[0]


def remaining(path: str | Path, wanted: Sequence[Task]) -> list[dict[str, Any]]:
    """A row for each part of some tasks: cells, how many are done, and the minutes they took.

    To these, minutes that the others will take: as the mean of those done of the same part and
    size, at the same μ where there are any; NaN where nothing is known.
    """
    store = open_store(path)
    took: dict[Any, list[float]] = {}
    counts: dict[str, list[tuple[Task, bool]]] = {}
    for task in wanted:
        dataset = load(store, *task.cell)
        counts.setdefault(task.part, []).append((task, dataset is not None))
        if dataset is not None:
            for key in ((task.part, task.n, task.mu), (task.part, task.n)):
                took.setdefault(key, []).append(float(dataset["seconds"]) / 60)
    rows = []
    for part, tasks_of in counts.items():
        done = [task for task, there in tasks_of if there]
        left = [task for task, there in tasks_of if not there]
        known = [took.get((part, t.n, t.mu)) or took.get((part, t.n)) for t in left]
        spent = sum(sum(v) for key, v in took.items() if key[0] == part and len(key) == 3)
        ahead = sum(sum(v) / len(v) if v else float("nan") for v in known)
        rows.append(
            {"part": part, "cells": len(tasks_of), "done": len(done)}
            | {"minutes": round(spent, 1), "minutes left": round(float(ahead), 1)}
        )
    return rows


def finished(path: str | Path, plan: Plan) -> Iterator[tuple[Task, xr.Dataset]]:
    """Yield (task, dataset) for the tasks of a plan that the store at path has."""
    store = open_store(path)
    for task in tasks(plan):
        dataset = load(store, *task.cell)
        if dataset is not None:
            yield task, dataset
