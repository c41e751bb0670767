"""Exact bounds: the least and largest f_n and f_t of every contact over S, and limit loads.

Each bound is a linear program in cone coordinates y ≥ 0. All are solved by an interior-point method
that carries 16 programs side by side (`program_batch`). What 400 disks at μ = 0.1 took (h = 232,
2628 programs, one thread of a shared machine):

    HiGHS, primal simplex, each program warm-started from the last        88 s, 384 pivots each
    dense tableau, exact steepest edge, the nearest program next          51 s, 158 pivots each
    product-form simplex from the best of 100 stored vertices             54 s, 430 pivots each
    interior point, 16 lanes                                               7 s,  16 steps each

Every bound carries a certificate that trusts no solver: a state that attains it, with its own
unbalance, and multipliers λ that bound it from the other side. For any λ and slack
s = c − Aᵀλ, c·y = b·λ + s·y ≥ b·λ − W max_k(−s_k/w_k)₊ for all y ≥ 0 in S, where w > 0 is a fixed
combination of the rows of A (the pressure row, if there is one) and W the value it prescribes.
"""

import threading
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from granforce import program_batch, programs
from granforce.program_batch import Outcome, Program
from granforce.records import InputError, NotJammedError
from granforce.tolerances import ADMISSIBLE, BALANCED, CARRYING, INTERVAL_GAP


class Intervals(NamedTuple):
    """Bounds over S of the forces on k contacts; column 0 is f_n, column 1 is f_t."""

    contacts: np.ndarray  # (k,) positions among the ensemble's contacts
    lower: np.ndarray  # (k, 2) least value, force; NaN where cancelled before
    upper: np.ndarray  # (k, 2) largest value, force
    gap: np.ndarray  # (k, 2, 2) duality gap of [component, lower or upper] in ⟨f_n⟩
    backbone: np.ndarray  # (k,) bool, largest f_n > 0
    max_gap: float  # largest gap among the bounds that were reached
    converged: bool  # every bound was reached with a gap ≤ INTERVAL_GAP
    counts: dict  # programs solved, skipped (by reason), solved again by HiGHS; iterations


class LimitLoads(NamedTuple):
    """Largest force pairs that S can carry on k contacts."""

    contacts: np.ndarray  # (k,) positions among the ensemble's contacts
    load: np.ndarray  # (k,) limit load F, force; NaN where cancelled before
    gap: np.ndarray  # (k,) duality gap in ⟨f_n⟩
    max_gap: float
    converged: bool  # every load was reached with a gap ≤ INTERVAL_GAP
    counts: dict  # programs, again, iterations


class _System(NamedTuple):
    """A y = b in cone coordinates and units of ⟨f_n⟩, and what bounds y."""

    A: sparse.csc_matrix
    b: np.ndarray
    T: sparse.csr_matrix  # unknowns x = T y
    loads: np.ndarray  # (rows, N_c) what F = 1 on each contact adds to A y
    weight: np.ndarray  # (n,) w > 0
    total: float  # W: w·y ≤ W for every y in S, under any load F ≥ 0
    batch: program_batch.Batch


def intervals(
    ensemble, contacts=None, *, workers=1, states=None, skip=True, progress=None, cancel=None
):
    """Least and largest f_n and f_t over S on the given contacts (positions; default all).

    workers: threads; the result does not depend on their number. states (…, N_c, 2): known
    states of S. skip: a contact seen with f_n = 0 in one of them, or in the optimum of another
    program, needs no program for its least f_n. progress(done, total) is called as programs
    end. cancel() → True ends early: what is not reached yet is NaN and ``converged`` False.

    Raises InputError where the forces in S are not bounded, NotJammedError where S is empty.
    """
    contacts = _positions(ensemble, contacts)
    frictionless = ensemble.mu == 0
    upper = [(int(c), 0, 1) for c in contacts]
    tangential = [] if frictionless else [(int(c), 1, side) for c in contacts for side in (0, 1)]
    lower = [(int(c), 0, 0) for c in contacts]
    total = len(upper) + len(tangential) + len(lower)
    solver = Solver(ensemble, workers, total, progress, cancel)
    solver.see(states)
    bounds = solver.solve(
        upper + tangential, [_bound(solver.system, *key) for key in upper + tangential]
    )
    seen = solver.least[contacts] <= INTERVAL_GAP if skip else np.zeros(len(contacts), dtype=bool)
    for key in (key for key, known in zip(lower, seen, strict=True) if known):
        bounds[key] = (max(0.0, float(solver.least[key[0]])), 0.0)
    rest = [key for key, known in zip(lower, seen, strict=True) if not known]
    bounds |= solver.solve(rest, [_bound(solver.system, *key) for key in rest])
    counts = solver.counts | {
        "f_n = 0 seen in a known state": int(seen.sum()),
        "frictionless contact": 2 * len(contacts) if frictionless else 0,
    }
    return _intervals(ensemble, contacts, bounds, counts)


def _intervals(ensemble, contacts, bounds, counts):
    value = np.full((len(contacts), 2, 2), np.nan)
    gap = np.full_like(value, np.nan)
    place = {int(c): k for k, c in enumerate(contacts)}
    for (contact, component, side), (attained, bound) in bounds.items():
        value[place[contact], component, side] = -attained if side else attained
        gap[place[contact], component, side] = abs(attained - bound)
    if ensemble.mu == 0:
        value[:, 1], gap[:, 1] = 0.0, 0.0
    value *= ensemble.force_scale
    max_gap, converged = _judged(gap)
    backbone = value[:, 0, 1] > CARRYING * ensemble.force_scale
    return Intervals(
        contacts, value[..., 0], value[..., 1], gap, backbone, max_gap, converged, counts
    )


def limit_loads(ensemble, contacts=None, **options):
    """Limit loads F (k,), force, of the given contacts; see `limit_load_bounds`."""
    return limit_load_bounds(ensemble, contacts, **options).load


def limit_load_bounds(ensemble, contacts=None, *, workers=1, progress=None, cancel=None):
    """Largest F ≥ 0 of a pair +F n on grain j and −F n on grain i for which S is not empty.

    One program per contact (positions; default all), for the static limit load of PRE 79, 052302.
    The pair adds F to the normal force on the contact, in the balance and in the pressure, but not
    in the contact's own cone. (Left out of the pressure, the limit would be F/(1 − F ℓ/2P0V).)
    Options and errors as in `intervals`.
    """
    contacts = _positions(ensemble, contacts)
    solver = Solver(ensemble, workers, len(contacts), progress, cancel)
    keys = [int(c) for c in contacts]
    bounds = solver.solve(keys, [Program([], [], key) for key in keys])
    load, gap = np.full(len(keys), np.nan), np.full(len(keys), np.nan)
    for k, key in enumerate(keys):
        if key in bounds:
            attained, bound = bounds[key]
            load[k], gap[k] = -attained * ensemble.force_scale, abs(attained - bound)
    return LimitLoads(contacts, load, gap, *_judged(gap), solver.counts)


def _judged(gap):
    """Largest gap reached, and whether all were reached and are small."""
    reached = gap[~np.isnan(gap)]
    return float(reached.max(initial=0.0)), bool(np.all(gap <= INTERVAL_GAP))


def _positions(ensemble, contacts):
    count = len(ensemble.index)
    if contacts is None:
        return np.arange(count)
    contacts = np.asarray(contacts, dtype=np.int64).ravel()
    if len(np.unique(contacts)) < len(contacts):
        raise InputError("a contact is named twice")
    if contacts.size and (contacts.min() < 0 or contacts.max() >= count):
        raise InputError(f"a contact lies outside 0 … {count - 1}")
    return contacts


def _bound(system, contact, component, side):
    """The program of one bound: minimise f, or −f for the upper side."""
    unknown = system.T[contact * system.batch.per_contact + component]
    sign = -1.0 if side else 1.0
    return Program(unknown.indices.tolist(), (sign * unknown.data).tolist(), -1)


class Solver:
    """Solves and certifies programs over one S; keeps count of what it did."""

    def __init__(self, ensemble, workers, total, progress, cancel, *, points=None):
        """points: a dict to fill with the y (n,) at which each key's value is attained."""
        self.ensemble, self.workers = ensemble, workers
        self.total, self.done = total, 0
        self.progress, self.cancel = progress, cancel or (lambda: False)
        self.system = _system(ensemble)
        self.least = np.full(len(ensemble.index), np.inf)  # smallest f_n seen, ⟨f_n⟩
        self.points = points
        self.counts = {"programs": 0, "again": 0, "iterations": 0}
        self.lock = threading.Lock()

    def see(self, states):
        """Take note of the zeros of known states, if they are states of S."""
        if states is None:
            return
        states = np.asarray(states, dtype=np.float64).reshape(-1, len(self.least), 2)
        ensemble = self.ensemble
        admitted = (ensemble.residual(states) <= BALANCED) & (
            ensemble.violation(states) <= ADMISSIBLE
        )
        normal = states[admitted, :, 0] / ensemble.force_scale
        self.least = np.minimum(self.least, normal.min(axis=0, initial=np.inf))

    def solve(self, keys, tasks):
        """{key: (value attained in S, value that bounds it from below)} of those reached."""
        bounds = {}

        def finished(outcomes):
            attained, bound = certify(self.system, outcomes, tasks)
            with self.lock:
                for k, outcome in enumerate(outcomes):
                    bounds[keys[outcome.number]] = (attained[k], bound[k])
                    if self.points is not None:
                        self.points[keys[outcome.number]] = outcome.y
                    self.counts["iterations"] += outcome.steps
                    if outcome.loaded < 0 and np.isfinite(attained[k]):
                        normal = outcome.y.reshape(len(self.least), -1).mean(axis=1)
                        np.minimum(self.least, normal, out=self.least)
                self.counts["programs"] += len(outcomes)
                self._report(len(outcomes))

        batch = self.system.batch
        if batch.centred and len(tasks):
            program_batch.run(
                batch, tasks, workers=self.workers, finished=finished, stop=self.cancel
            )
        for number, key in enumerate(keys):
            if self.cancel():
                break
            attained, bound = bounds.get(key, (np.inf, -np.inf))
            if not attained - bound <= INTERVAL_GAP:
                if key not in bounds:
                    self.counts["programs"] += 1
                    self._report(1)
                bounds[key] = self._again(key, number, tasks, attained, bound)
        return bounds

    def _again(self, key, number, tasks, attained, bound):
        """Solve one program from scratch by HiGHS; keep the better of either side."""
        outcome = from_scratch(self.system, number, tasks[number])
        again = certify(self.system, [outcome], tasks)
        self.counts["again"] += 1
        if self.points is not None and again[0][0] < attained:
            self.points[key] = outcome.y
        return min(attained, again[0][0]), max(bound, again[1][0])

    def _report(self, count):
        self.done += count
        if self.progress:
            self.progress(self.done, self.total)


def certify(system, outcomes, tasks):
    """Value attained by each outcome, and a bound on the minimum from A, b and c alone (⟨f_n⟩).

    The value is inf where the state is not one of S to BALANCED; the bound is −inf where the
    multipliers bound nothing.
    """
    y = np.stack([outcome.y for outcome in outcomes], axis=1)
    multiplier = np.stack([outcome.multiplier for outcome in outcomes], axis=1)
    cost = np.zeros_like(y)
    value, unbalance = np.zeros(len(outcomes)), system.A @ y - system.b[:, None]
    for k, outcome in enumerate(outcomes):
        task = tasks[outcome.number]
        cost[task.columns, k] = task.costs
        value[k] = np.dot(task.costs, outcome.y[task.columns]) - outcome.load
        if task.loaded >= 0:
            load = system.loads[:, task.loaded]
            unbalance[:, k] += outcome.load * load
            # Scaled so that the slack of F is exactly zero: −F = b·λ + s·y then bounds F alone.
            pull = -(load @ multiplier[:, k])
            multiplier[:, k] *= 1 / pull if pull > 0 else np.nan
    slack = cost - system.A.T @ multiplier
    short = np.maximum(np.max(-slack / system.weight[:, None], axis=0), 0.0)
    bound = system.b @ multiplier - system.total * short
    admitted = (np.abs(unbalance).max(axis=0) <= BALANCED) & (y.min(axis=0) >= 0)
    return np.where(admitted, value, np.inf), np.where(np.isfinite(bound), bound, -np.inf)


def from_scratch(system, number, task):
    """The outcome of one program by HiGHS: presolve, no start, tightest tolerances."""
    A, cost = system.A, np.zeros(system.A.shape[1])
    cost[task.columns] = task.costs
    if task.loaded >= 0:
        A = sparse.hstack([A, system.loads[:, [task.loaded]]], format="csc")
        cost = np.append(cost, -1.0)
    model = programs.standard_form(A, system.b)
    programs.set_cost(model, cost)
    _, y = programs.solve(model)
    multiplier = np.array(model.getSolution().row_dual)
    basis = programs.basis(model)
    if basis is not None:
        y, multiplier = _vertex(A, system.b, cost, *basis)
    load = float(y[-1]) if task.loaded >= 0 else 0.0
    y = y[: len(system.weight)]
    return program_batch.balanced(
        system.batch, [Outcome(number, task.loaded, y, load, multiplier, 0)]
    )[0]


def _vertex(A, b, cost, rows, columns):
    """y and λ of a basis by its own LU factors: rounding error in place of tolerances."""
    factors = splu(sparse.csc_matrix(A.tocsr()[rows][:, columns]))
    y, multiplier = np.zeros(A.shape[1]), np.zeros(A.shape[0])
    for _ in range(2):
        y[columns] += factors.solve((b - A @ y)[rows])
        rest = cost - A.T @ multiplier
        multiplier[rows] += factors.solve(rest[columns], trans="T")
    return y, multiplier


def _system(ensemble):
    A, T = ensemble.cone_form
    A, T = sparse.csc_matrix(A), sparse.csr_matrix(T)
    b = ensemble.b / ensemble.force_scale
    loads = ensemble.A.tocsc()[:, :: ensemble.per_contact].toarray()
    batch = program_batch.make_batch(ensemble)
    weight, total = _weight(ensemble, A, b, batch)
    return _System(A, b, T, loads, weight, total, batch)


def _weight(ensemble, A, b, batch):
    """w > 0 and W with w·y ≤ W: the pressure row, or the combination −λ° of the centre."""
    if ensemble.has_pressure_row:
        return A[-1].toarray().ravel(), float(b[-1])
    combination = -np.append(batch.multiplier, batch.border)[batch.row]
    weight = A.T @ combination
    if not batch.centred or weight.min(initial=1.0) <= 0:
        combination = _bounding_rows(A, b)
        weight = A.T @ combination
    return weight, float(b @ combination)


def _bounding_rows(A, b):
    """π with Aᵀπ ≥ 1: the duals of max Σ y, which exist where S is bounded and not empty."""
    model = programs.standard_form(A, b)
    programs.set_cost(model, -np.ones(A.shape[1]))
    status, _ = programs.solve(model)
    if status == programs.INFEASIBLE:
        raise NotJammedError("no admissible force network exists on these contacts")
    if status != programs.OPTIMAL:
        raise InputError(
            "the forces on these contacts are not bounded: prescribe the pressure, or freeze "
            "contacts all around them"
        )
    return -np.array(model.getSolution().row_dual)
