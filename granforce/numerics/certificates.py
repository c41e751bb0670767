"""Facts about S = {y ≥ 0 : A y = b} with proofs that do not rely on any solver.

    S is empty       λ with Aᵀλ ≤ 0 and b·λ > 0 (Farkas)
    S is unbounded   d ≥ 0, d ≠ 0 with A d = 0
    S is bounded     π with Aᵀπ > 0
    y_k grows        d as above with d_k > 0; the others do not if Aᵀπ ≥ 0, and > 0 for them
    g·y is small     λ with Aᵀλ ≥ g and b·λ small (duality)

 Solvers only propose; every proof is checked here against A and b. If one solver fails, others are
tried; if all fail, the question is reported as undecided.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import NamedTuple

import highspy
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import lsmr

from granforce.numerics import highs as programs
from granforce.numerics.linear_programs import Program
from granforce.records import InputError, NotJammedError, UnboundedError, UndecidedError
from granforce.system import cancelling
from granforce.tolerances import BALANCED, CARRYING
from granforce.types import Floats, Mask

# Mean of y (in ⟨f_n⟩) up to which a proof of emptiness excludes networks despite rounding.
_LARGEST_MEAN = 1e4
# Largest |A d| of a direction d with Σ d = 1, rows of A of order 1.
_BALANCED_DIRECTION = 1e-13
# Largest |Aᵀπ| at coordinates that grow, relative to π; number of corrections to reach it.
_LEVEL, _CORRECTIONS = 1e-13, 2
# Least change of a cost along a ray d with Σ d = 1, relative to the cost, beyond rounding.
_FALLS = 1e-9
# Mean of y (in ⟨f_n⟩) up to which a contact is proved to carry no force: the mean is 1 in S.
_USUAL_MEAN = 2.0
UNBOUNDED = (
    "the forces on these contacts are not bounded: some can press against each other without a "
    "load; prescribe a pressure or a load, use a smaller friction coefficient, or give bounds on "
    "single forces"
)


def why_unsolved(
    A: sparse.csr_matrix,
    b: Floats,
    empty: str = "no admissible force network exists on these contacts",
    *,
    slack: Floats | float = BALANCED,
) -> InputError:
    """The exception to raise if a program over S has no optimum, from what can be proved.

    A sparse (m, n), rows of order 1; b (m,). empty: the message for an empty S. slack: as in
    `proves_empty`.
    """
    if empty_ray(A, b, slack) is not None:
        return NotJammedError(empty)
    if recession(A) is not None:
        return UnboundedError(UNBOUNDED)
    return UndecidedError(
        "whether these contacts can balance is undecided: linear programs over their forces gave "
        "no result that could be checked; change a contact or the friction slightly"
    )


def empty_ray(A: sparse.csr_matrix, b: Floats, slack: Floats | float = BALANCED) -> Floats | None:
    """λ (m,) that proves S empty, or None if no proof was found.

    Candidates are the duals of the least Σ |A y − b| and the residual of the least |A y − b|².
    """
    cost = np.concatenate([np.zeros(A.shape[1]), np.ones(2 * len(b))])
    unit = sparse.identity(len(b))
    slackened = sparse.csc_matrix(sparse.hstack([A, unit, -unit]))
    for y, multiplier in _proposals(slackened, b, cost):
        if proves_empty(A, b, multiplier, slack):
            return multiplier
        if np.all(np.abs(A @ np.maximum(y[: A.shape[1]], 0.0) - b) <= slack):
            return None
    multiplier = -programs.least_unbalanced(A, b)[1]
    return multiplier if proves_empty(A, b, multiplier, slack) else None


def proves_empty(
    A: sparse.csr_matrix, b: Floats, multiplier: Floats, slack: Floats | float = BALANCED
) -> bool:
    """Whether Aᵀλ ≤ 0 < b·λ by more than rounding and the accepted slack could explain.

    slack (m,) or one number: |A y − b| accepted for given forces, larger where rows are scaled up.
    """
    if not np.all(np.isfinite(multiplier)):
        return False
    wrong = (A.T @ multiplier).max(initial=0.0) * _LARGEST_MEAN * A.shape[1]
    allowed = (slack * np.abs(multiplier)).sum()
    return bool(b @ multiplier > 2 * (wrong + allowed))


def recession(A: sparse.csr_matrix) -> Floats | None:
    """d ≥ 0 (n,) with A d = 0 and Σ d = 1, along which a nonempty S is unbounded, or None."""
    both, one = _with_sum(A)
    for d, _ in _proposals(both, one, np.zeros(A.shape[1])):
        d = np.maximum(d, 0.0)
        if abs(d.sum() - 1) < 0.5 and np.abs(A @ d).max(initial=0.0) <= _BALANCED_DIRECTION:
            return d
    return None


def widest_recession(A: sparse.csr_matrix) -> Floats | None:
    """A `recession` direction that is positive wherever any is; None if there is none."""
    for d, _ in widest(A):
        if _is_ray(A, d):
            return d / d.sum()
    return recession(A)


def widest(A: sparse.csr_matrix) -> Iterator[tuple[Floats, Floats]]:
    """Yield d ≥ 0 and multipliers π ≥ 0 of A (s + e) = 0, s ≤ 1, for the largest Σ s.

    By several methods, d = s + e; nothing is checked.
    """
    count = A.shape[1]
    zero, cost = np.zeros(A.shape[0]), np.concatenate([-np.ones(count), np.zeros(count)])
    limits = np.zeros(2 * count), np.concatenate([np.ones(count), np.full(count, np.inf)])
    model = programs.bounded(sparse.hstack([A, A]), (zero, zero), limits, cost)
    for _, y in programs.solutions(model):
        if len(y):
            yield np.maximum(y[:count] + y[count:], 0.0), -np.array(model.getSolution().row_dual)


def _is_ray(A: sparse.csr_matrix, d: Floats) -> bool:
    """Whether d ≥ 0 (n,), d ≠ 0, balances without a load, to rounding."""
    return bool(d.any() and np.abs(A @ d).max(initial=0.0) <= _BALANCED_DIRECTION * d.sum())


class Growing(NamedTuple):
    """The coordinates of S that grow, proved both ways."""

    mask: Mask  # (n,) bool
    rays: list[Floats]  # d (n,) with Σ d = 1; the first is positive all over the mask
    rows: Floats  # (m,) π with Aᵀπ = 0 in the mask, to rounding, and > 0 elsewhere


def growing(A: sparse.csr_matrix) -> Growing | None:
    """What grows in a nonempty S, rows of A of order 1; None if nothing grows, or not proved."""
    for d, rows in widest(A):
        # In an optimum of that program both d and Aᵀπ are 0 or at least 1.
        mask = d > 0.5
        if not mask.any():
            continue
        d = np.where(mask, d, 0.0)
        d[mask] = np.maximum(_in_kernel(A[:, mask], d[mask]), 0.0)
        rows = _in_kernel(sparse.csc_matrix(A[:, mask].T), rows)
        weight = A.T @ rows
        off = np.abs(weight[mask]).max() / np.abs(rows).max(initial=1.0)
        if _is_ray(A, d) and weight[~mask].min(initial=1.0) > 0.5 and off <= _LEVEL:
            return Growing(mask, [d / d.sum()], rows)
    return None


def _in_kernel(A: sparse.csc_matrix, x: Floats) -> Floats:
    """x (n,) with A x = 0 restored by the least change."""
    for _ in range(_CORRECTIONS):
        x = x - cancelling.apart(partial(lsmr, atol=0.0, btol=_LEVEL), A, A @ x)[0]
    return x


def without_limit(A: sparse.csr_matrix, grows: Growing, tasks: Sequence[Program]) -> Mask:
    """Whether a ray proves that the cost of each of the load-free tasks falls for ever, (k,) bool.

    Rays that were needed are added to those of `grows`.
    """
    inside = np.flatnonzero(grows.mask)
    both, one = _with_sum(A[:, inside])
    model = programs.going_on(both, one)
    falls = np.zeros(len(tasks), dtype=bool)
    for k, task in enumerate(tasks):
        cost = np.zeros(A.shape[1])
        cost[task.columns] = task.costs
        least = -_FALLS * np.abs(cost).max(initial=0.0)
        if not cost[inside].min() < 0:
            continue
        falls[k] = any(cost @ ray < least for ray in grows.rays)
        # A single coordinate, or one sign, is decided by the first ray.
        if falls[k] or cost[inside].max() <= 0:
            continue
        cancelling.check()
        programs.set_cost(model, cost[inside])
        ray = np.zeros(A.shape[1])
        ray[inside] = _corner(model, both, one, cost[inside])
        falls[k] = _is_ray(A, ray) and cost @ ray < least * ray.sum()
        if falls[k]:
            grows.rays.append(ray / ray.sum())
    return falls


def _corner(model: highspy.Highs, A: sparse.csc_matrix, b: Floats, cost: Floats) -> Floats:
    """The y ≥ 0 (n,) at which a solved model ends, to rounding if it has a basis."""
    y = programs.solve(model)[1]
    basis = programs.basis(model)
    if basis is not None:
        with suppress(RuntimeError):  # singular basis
            y = programs.vertex(A, b, cost, *basis)[0]
    return np.maximum(y, 0.0)


def balances(A: sparse.csr_matrix, b: Floats) -> bool:
    """Whether some y ≥ 0 has A y = b, to rounding; rows of A and b of order 1."""
    return any(
        np.abs(A @ y - b).max(initial=0.0) <= _BALANCED_DIRECTION * max(1.0, y.sum())
        for y in programs.points(A, b)
        if len(y) == A.shape[1]
    )


def bounding_rows(A: sparse.csr_matrix) -> Floats | None:
    """π (m,) with Aᵀπ > 0, so that Aᵀπ · y = b·π bounds every y in S; None if not found."""
    ray = empty_ray(*_with_sum(A))
    if ray is None:
        return None
    rows = -ray[:-1] / ray[-1]
    return rows if (A.T @ rows).min(initial=1.0) > 0 else None


def proves_small(A: sparse.csr_matrix, b: Floats, gains: Floats, multiplier: Floats) -> bool:
    """Whether gains · y ≤ CARRYING for every y in S of usual size, proved by λ with Aᵀλ ≥ gains."""
    short = (gains - A.T @ multiplier).max(initial=0.0)
    return bool(b @ multiplier + short * _USUAL_MEAN * A.shape[1] <= CARRYING)


def _with_sum(A: sparse.csr_matrix) -> tuple[sparse.csc_matrix, Floats]:
    """A with a row for Σ y, and (0, …, 0, 1)."""
    both = sparse.csc_matrix(sparse.vstack([A, np.ones((1, A.shape[1]))]))
    return both, np.append(np.zeros(A.shape[0]), 1.0)


def _proposals(A: sparse.csr_matrix, b: Floats, cost: Floats) -> Iterator[tuple[Floats, Floats]]:
    """Yield points and multipliers of a program over {y ≥ 0 : A y = b}, method after method."""
    model = programs.standard_form(A, b)
    programs.set_cost(model, cost)
    for _, y in programs.solutions(model):
        yield y, programs.multipliers(model, A, cost)
