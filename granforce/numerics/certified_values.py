"""Values of linear programs over S with certificates that do not rely on any solver.

A certificate is a state that attains the value, with its own unbalance, and multipliers λ that
bound the value from the other side. For any λ and slack s = c − Aᵀλ,

    c·y = b·λ + s·y ≥ b·λ − W max_k(−s_k/w_k)₊   for all y ≥ 0 in S,

where w > 0 is a fixed combination of the rows of A (the pressure row, if there is one) and W its
prescribed value. In an unbounded S no such w exists, but one that is positive where y cannot grow
(`certificates.growing`), and 0 elsewhere: there s ≥ 0 is required up to rounding, which is counted
for y up to _FAR. Programs that the interior-point method does not finish are solved from scratch by
HiGHS.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple

import highspy
import numpy as np
from scipy import sparse

from granforce.numerics import certificates, highs, linear_programs
from granforce.numerics.certificates import Growing
from granforce.numerics.contact_program import Problem
from granforce.numerics.linear_programs import Centre, Program, ProgramOutcome
from granforce.records import Cancelled, UnboundedError, worker_count
from granforce.system import cancelling
from granforce.tolerances import BALANCED, INTERVAL_GAP
from granforce.types import Floats, Mask, Progress

# HiGHS accepts a vertex as the optimum if no slack is below −10⁻¹⁰ of its costs; summed over all
# forces this can exceed INTERVAL_GAP.
_DEARER = 1e3
# Largest y, in ⟨f_n⟩, of coordinates that grow, up to which bounds hold in spite of rounding.
_FAR = 1e4
# Rounding of bounds in an unbounded S, relative to W: near the friction at which more contacts
# could grow, bounds may be thousands of ⟨f_n⟩.
_ROUNDED = 1e-12


class System(NamedTuple):
    """A y = b in cone coordinates and units of ⟨f_n⟩, with a bound on y."""

    problem: Problem
    middle: Centre
    A: sparse.csc_matrix  # (rows, n)
    b: Floats
    loads: sparse.csc_matrix  # (rows, N_c) added to A y by F = 1 on each contact
    weight: Floats  # (n,) w > 0; inf at coordinates that grow, which it does not bound
    total: float  # W ≥ w·y for every y in S; a load F on contact c adds F gains[c]
    gains: Floats  # (N_c,)
    combination: Floats  # (rows,) w = Aᵀ combination
    grows: Growing | None  # None if S is bounded
    accuracy: float  # largest gap of a certified value: INTERVAL_GAP, or the rounding if larger

    def under(self, load: Floats) -> System:
        """The system with a load on the balance, A y + F load = b, instead of pairs on contacts."""
        rows = np.zeros(len(self.b))
        rows[: len(load)] = load
        gain = np.array([-(rows @ self.combination)])
        return self._replace(loads=sparse.csc_matrix(rows[:, None]), gains=gain)

    def without_limit(self, tasks: Sequence[Program]) -> Mask:
        """(k,) bool: whether the minimum of each load-free task is −∞, proved by a ray."""
        assert self.grows is not None  # nothing falls for ever in a bounded S
        return certificates.without_limit(_with_unit_rows(self.A), self.grows, tasks)

    def carries_any(self, contact: int) -> bool:
        """Whether the load F on this contact has no limit, as forces balance it alone."""
        if self.grows is None:
            return False
        scale = _row_scale(self.A)
        load = scale * self.loads[:, [contact]].toarray().ravel()
        return certificates.balances(_with_unit_rows(self.A), -load)


def make_system(
    problem: Problem,
    middle: Centre,
    A: sparse.csr_matrix,
    b: Floats,
    loads: sparse.csc_matrix,
    bounding: int | None,
) -> System:
    """The System of a Problem and its centre.

    bounding: the row of A that bounds y > 0, or None. The rows of A are the Problem's balance, then
    its sides and pinned components.

    Raises NotJammedError if S is empty, UnboundedError if it is unbounded and what grows cannot be
    proved, UndecidedError if neither can be proved.
    """
    grows = None
    if bounding is not None:
        combination = np.zeros(len(b))
        combination[bounding] = 1.0
        weight, total = A[bounding].toarray().ravel(), float(b[bounding])
    else:
        balance = np.concatenate([middle.v, middle.v_border])[problem.place]
        no_cost = np.zeros(A.shape[1])
        combination = -linear_programs.multipliers(problem, A, no_cost, balance, middle.z)
        weight = A.T @ combination
        if not middle.converged or weight.min(initial=1.0) <= 0:
            combination, grows = _bounding_rows(A, b)
            weight = A.T @ combination
        total = float(b @ combination)
    accuracy = INTERVAL_GAP
    if grows is not None:
        middle = middle._replace(converged=False)
        total += _FAR * np.maximum(-weight[grows.mask], 0.0).sum()
        weight = np.where(grows.mask, np.inf, weight)
        accuracy = max(accuracy, _ROUNDED * total)
    return System(
        problem=problem,
        middle=middle,
        A=A.tocsc(),
        b=b,
        loads=loads,
        weight=weight,
        total=total,
        gains=-(loads.T @ combination),
        combination=combination,
        grows=grows,
        accuracy=accuracy,
    )


def _bounding_rows(A: sparse.csr_matrix, b: Floats) -> tuple[Floats, Growing | None]:
    """π with Aᵀπ > 0, where nothing grows: the duals of max Σ y, if S is bounded and not empty."""
    model = highs.standard_form(A, b)
    highs.set_cost(model, -np.ones(A.shape[1]))
    for status, _ in highs.solutions(model):
        rows = -np.array(model.getSolution().row_dual)
        if status == highs.OPTIMAL and (A.T @ rows).min(initial=1.0) > 0:
            return rows, None
    rows = certificates.bounding_rows(A)
    if rows is not None:
        return rows, None
    why = certificates.why_unsolved(A, b)
    grows = certificates.growing(_with_unit_rows(A)) if isinstance(why, UnboundedError) else None
    if grows is None:
        raise why
    return _row_scale(A) * grows.rows, grows


class _Batch(NamedTuple):
    """Programs that are solved together, with their results so far."""

    keys: Sequence[Any]
    tasks: Sequence[Program]
    bounds: dict[Any, tuple[float, float]]  # {key: (value attained in S, value that bounds it)}
    points: dict[Any, Floats] | None  # {key: y (n,) at which the value is attained}
    accuracy: float

    def open(self, numbers: Iterable[int]) -> list[int]:
        """The numbers whose value and bound are not yet within the accuracy."""
        none = np.inf, -np.inf
        return [k for k in numbers if not self._agree(*self.bounds.get(self.keys[k], none))]

    def better(self, before: tuple[float, float], new: tuple[float, float]) -> tuple[float, float]:
        """The better value and the better bound of two pairs.

        The better of two values is the smaller, or the one nearer the bound if below it. A bound
        above a value is not one: its multipliers are so large that the rounding of b counts. Then
        a new pair that agrees replaces both.
        """
        bound = max(before[1], new[1])
        value = min(before[0], new[0], key=lambda value: (abs(value - bound), value))
        return (value, bound) if self._agree(value, bound) or not self._agree(*new) else new

    def _agree(self, value: float, bound: float) -> bool:
        # A value below its bound comes from a state whose unbalance, though small, costs too much.
        return abs(value - bound) <= self.accuracy


class Solver:
    """Solves and certifies programs over one System, and counts them."""

    def __init__(
        self,
        system: System,
        *,
        workers: int = 1,
        on_state: Callable[[Any, Floats], object] | None = None,
        progress: Progress | None = None,
        total: int = 0,
        done: int = 0,
        on_value: Callable[[Any, float, float], object] | None = None,
    ) -> None:
        """on_state(key, y): called with each load-free y (n,) of S at which a value is attained.

        on_value(key, attained, bound) is called as each program ends, progress(done, total) counts
        from `done`. All are called from one thread at a time.
        """
        self.system, self.workers = system, worker_count(workers)
        self.on_state, self.progress, self.total, self.done = on_state, progress, total, done
        self.on_value = on_value or (lambda key, attained, bound: None)
        self.counts = {"programs": 0, "again": 0, "iterations": 0}
        self.lock = threading.Lock()

    def solve(
        self, keys: Sequence[Any], tasks: Sequence[Program], points: dict[Any, Floats] | None = None
    ) -> dict[Any, tuple[float, float]]:
        """{key: (value attained in S, value that bounds it from below)} of the finished programs.

        points: a dict to fill with the y (n,) at which each key's value is attained. After
        cancelling, the programs finished so far are returned.
        """
        batch = _Batch(keys, tasks, {}, points, self.system.accuracy)
        with suppress(Cancelled):
            self._solve(batch, range(len(keys)))
        return batch.bounds

    def _solve(self, batch: _Batch, every: Sequence[int]) -> None:
        if self.system.middle.converged:
            self._carry(batch, every, refined=False)
            # Among thousands of contacts, rounding may leave the bound of one or two too loose.
            self._carry(batch, batch.open(every), refined=True)
        else:
            for outcome in one_after_another(self.system, batch.tasks):
                self._take(batch, [outcome])
        for number in batch.open(every):
            cancelling.check()
            self.counts["again"] += 1
            for outcome in from_scratch(self.system, number, batch.tasks[number]):
                self._take(batch, [outcome])
                if not batch.open([number]):
                    break

    def _carry(self, batch: _Batch, numbers: Sequence[int], refined: bool) -> None:
        """Solve the programs of these numbers by the interior-point method."""
        if len(numbers):
            linear_programs.run(
                *(self.system.problem, self.system.middle, batch.tasks, numbers),
                refined=refined,
                workers=self.workers,
                finished=partial(self._take, batch),
            )

    def _take(self, batch: _Batch, outcomes: Sequence[ProgramOutcome]) -> None:
        """Certify outcomes, keeping the better value and the better bound of each key."""
        bounds, points = batch.bounds, batch.points
        attained, bound = certify(self.system, outcomes, batch.tasks)
        with self.lock:
            for k, outcome in enumerate(outcomes):
                key = batch.keys[outcome.number]
                if key not in bounds:
                    self.counts["programs"] += 1
                    self.done += 1
                    if self.progress:
                        self.progress(self.done, self.total)
                before = bounds.get(key, (np.inf, -np.inf))
                bounds[key] = batch.better(before, (float(attained[k]), float(bound[k])))
                self.on_value(key, *bounds[key])
                if points is not None and (key not in points or bounds[key][0] != before[0]):
                    points[key] = outcome.y
                self.counts["iterations"] += outcome.steps
                if self.on_state and outcome.loaded < 0 and np.isfinite(attained[k]):
                    self.on_state(key, outcome.y)


def certify(
    system: System, outcomes: Sequence[ProgramOutcome], tasks: Sequence[Program]
) -> tuple[Floats, Floats]:
    """Value attained by each outcome, and a bound on the minimum from A, b and c alone (⟨f_n⟩).

    The value is inf if the state is not in S to BALANCED; the bound is −inf if the multipliers give
    no bound.
    """
    with np.errstate(invalid="ignore", over="ignore"):  # outcomes that are not numbers
        return _certify(system, outcomes, tasks)


def _certify(
    system: System, outcomes: Sequence[ProgramOutcome], tasks: Sequence[Program]
) -> tuple[Floats, Floats]:
    y = np.stack([outcome.y for outcome in outcomes], axis=1)
    cost, gain = np.zeros_like(y), np.zeros(len(outcomes))
    multiplier = np.zeros((len(system.b), len(outcomes)))
    value, unbalance = np.zeros(len(outcomes)), system.A @ y - system.b[:, None]
    for k, outcome in enumerate(outcomes):
        task = tasks[outcome.number]
        cost[task.columns, k] = task.costs
        multiplier[:, k] = linear_programs.multipliers(
            system.problem, system.A, cost[:, k], outcome.multiplier, outcome.z
        )
        value[k] = np.dot(task.costs, outcome.y[task.columns]) - outcome.load
        if task.loaded >= 0:
            load = system.loads[:, [task.loaded]].toarray().ravel()
            unbalance[:, k] += outcome.load * load
            # Scaled so that the slack of F is exactly zero: −F = b·λ + s·y then bounds F alone.
            pull = -(load @ multiplier[:, k])
            multiplier[:, k] *= 1 / pull if pull > 0 else np.nan
            gain[k] = max(0.0, system.gains[task.loaded])
    slack = cost - system.A.T @ multiplier
    far = np.zeros(len(outcomes))
    if system.grows is not None:
        far = _FAR * np.maximum(-slack[system.grows.mask], 0.0).sum(axis=0)
    short = np.maximum(np.max(-slack / system.weight[:, None], axis=0), 0.0)
    # One by one: the rounding of a matrix product would depend on the other programs.
    bound = np.array([system.b @ one for one in multiplier.T.copy()]) - system.total * short - far
    # w·y may grow with the load: −F ≥ bound − short · gain · F.
    bound = np.where(short * gain < 1, bound / (1 - short * gain), -np.inf)
    admitted = (np.abs(unbalance).max(axis=0, initial=0.0) <= BALANCED) & (y.min(axis=0) >= 0)
    return np.where(admitted, value, np.inf), np.where(np.isfinite(bound), bound, -np.inf)


def one_after_another(system: System, tasks: Sequence[Program]) -> Iterator[ProgramOutcome]:
    """Yield the outcomes of the load-free programs by HiGHS's simplex method.

    Each starts from the vertex of the previous one, which takes a tenth of the time. For S without
    an interior, where some contacts can only slide or open.
    """
    scale = _row_scale(system.A)
    model = highs.going_on(sparse.diags(scale) @ system.A, scale * system.b)
    for number, task in enumerate(tasks):
        if task.loaded < 0:
            cancelling.check()
            cost = _cost_of(system, task)
            highs.set_cost(model, _DEARER * cost)
            yield _outcome(
                system, model, highs.solve(model)[1], system.A, scale, cost, number, task
            )


def most_under(system: System) -> tuple[float, float, Floats]:
    """(−F, bound of −F, y) of the largest load F in a System `under` one load.

    −F is inf if no state was found, and −inf if F has no limit; the bound is −inf if unproved.
    """
    task, best, bound = Program([], [], 0), np.inf, -np.inf
    y = np.empty(0)
    # One column meets every row: the simplex method takes five times as long for 400 blocks.
    for outcome in from_scratch(system, 0, task, solver="ipm"):
        value, below = (float(one[0]) for one in certify(system, [outcome], [task]))
        bound = max(bound, below)
        if value < best:
            best, y = value, outcome.y
        if best - bound <= system.accuracy:
            return best, bound, y
    # F has no limit if forces balance the load alone.
    load = system.loads.toarray().ravel()
    for _, balancing in highs.solutions(highs.standard_form(system.A, -load)):
        forces = np.maximum(balancing, 0.0)
        if len(forces) and np.abs(system.A @ forces + load).max() <= BALANCED * np.abs(load).max():
            return -np.inf, -np.inf, y
    return best, bound, y


def from_scratch(
    system: System, number: int, task: Program, solver: str = "choose"
) -> Iterator[ProgramOutcome]:
    """Yield the outcomes of one program by HiGHS's methods in turn, each without a start.

    The first, `solver`, uses presolve and the tightest tolerances.
    """
    A, cost = system.A, _cost_of(system, task)
    if task.loaded >= 0:
        A = sparse.hstack([A, system.loads[:, [task.loaded]]], format="csc")
        cost = np.append(cost, -1.0)
    scale = _row_scale(A)
    model = highs.standard_form(sparse.diags(scale) @ A, scale * system.b, solver=solver)
    highs.set_cost(model, _DEARER * cost)
    for _, y in highs.solutions(model):
        cancelling.check()
        if len(y) == len(cost):
            yield _outcome(system, model, y, A, scale, cost, number, task)


def _row_scale(A: sparse.csr_matrix) -> Floats:
    """Factors that scale the largest entry of each row to 1, the row size of the tolerances."""
    largest = abs(A).max(axis=1).toarray().ravel()
    return 1 / np.where(largest > 0, largest, 1.0)


def _with_unit_rows(A: sparse.csr_matrix) -> sparse.csr_matrix:
    """A with the largest entry of each row scaled to 1."""
    return sparse.csr_matrix(sparse.diags(_row_scale(A)) @ A)


def _cost_of(system: System, task: Program) -> Floats:
    cost = np.zeros(system.A.shape[1])
    cost[task.columns] = task.costs
    return cost


def _outcome(
    system: System,
    model: highspy.Highs,
    y: Floats,
    A: sparse.csr_matrix,
    scale: Floats,
    cost: Floats,
    number: int,
    task: Program,
) -> ProgramOutcome:
    """The outcome of a program solved by HiGHS with scaled rows, to rounding if it has a basis."""
    multiplier = scale * np.array(model.getSolution().row_dual) / _DEARER
    basis = highs.basis(model)
    if basis is not None:
        with suppress(RuntimeError):  # singular basis
            y, multiplier = highs.vertex(A, system.b, cost, *basis)
    y = np.maximum(y, 0.0)
    load = float(y[-1]) if task.loaded >= 0 else 0.0
    outcome = ProgramOutcome(
        number=number,
        loaded=task.loaded,
        y=y[: len(system.weight)],
        load=load,
        multiplier=multiplier,
        z=None,
        steps=0,
    )
    if np.abs(A @ y - system.b).max(initial=0.0) <= BALANCED:
        return outcome
    return linear_programs.balanced(system.problem, system.middle, [outcome])[0]
