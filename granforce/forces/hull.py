"""The affine hull of S: the directions in which S extends, decided once for all callers.

Each wall of S is a coordinate y ≥ 0 of `Ensemble.scaled_form`: the distance from a side of a
Coulomb cone, or from a known bound. A wall whose distance stays below FLAT in all of S is *held*:
doubles cannot resolve the space between it and the opposite wall. S counts as flat across held
walls, and its dimension is that of the networks that balance and keep the held walls.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import norm

from granforce.forces.balance import LARGEST_RANK, left_free
from granforce.forces.contact_problem import (
    centre_of,
    independent_problem_of,
    restored_balance,
    unbalance,
)
from granforce.forces.ensemble import Ensemble, Hull
from granforce.numerics import wall_matrix
from granforce.numerics.contact_program import PINNED
from granforce.numerics.inner_point import away_from_walls, inner_point
from granforce.records import NotJammedError, UndecidedError
from granforce.tolerances import BALANCED, FLAT
from granforce.types import Floats, Integers, Mask

# Least distance from a wall to a reliable analytic centre, in ⟨f_n⟩.
_WELL_INSIDE = 1e-5
# `unbalance` of a centre above which its balance is restored.
_UNBALANCED = 1e-9


def hull_of(ensemble: Ensemble) -> Hull:
    """The Hull of an ensemble.

    Raises NotJammedError if S is empty, UndecidedError if no solver could decide.
    """
    A, b, _ = ensemble.scaled_form
    if ensemble.member is not None and ensemble.is_determined:
        y = ensemble.coordinates(ensemble.member)
        y, held = np.where(y > 0.1 * BALANCED, y, 0.0), np.ones(len(y), dtype=bool)
        return Hull(y, held, 0, b, FLAT)
    y = _centre(ensemble)
    if y is not None:
        held = np.zeros(len(y), dtype=bool)
        return Hull(y, held, _dimension(ensemble, held), b, FLAT)
    try:
        b = _with_own_limits(ensemble)
        y, held, resolution = inner_point(A, b)
    except (NotJammedError, UndecidedError):
        # Bounds may contradict each other within the tolerances of residual and violation.
        b = ensemble.scaled_form[1]
        y, held, resolution = inner_point(A, b)
    held = _with_opposite(ensemble, held)
    return Hull(y, held, _dimension(ensemble, held), b, resolution)


def dimension_of(ensemble: Ensemble) -> int:
    """`Ensemble.dimension`, from a linear program if that finds a network away from all walls.

    Where nothing else needs the centre, this saves compiling the kernels that find it.
    """
    A, b, _ = ensemble.scaled_form
    if A.shape[0] > LARGEST_RANK or ensemble.is_determined:
        return ensemble.dimension
    y = away_from_walls(A, b)
    if y is None or not y.min(initial=1.0) > _WELL_INSIDE:
        return ensemble.dimension
    return _dimension(ensemble, np.zeros(len(y), dtype=bool))


def _with_own_limits(ensemble: Ensemble) -> Floats:
    """b (rows,) with the known bounds, even if the known network exceeds them."""
    known, b = ensemble.known, ensemble.scaled_form[1]
    if known is None:
        return b
    b, first = b.copy(), ensemble.A.shape[0]
    limit = known.limit / ensemble.units[known.contact, known.component]
    b[first : first + len(limit)] = limit
    return b


def _with_opposite(ensemble: Ensemble, held: Mask) -> Mask:
    """The held walls, and with each known bound the other bound of its component."""
    if ensemble.known is None:
        return held
    held, first = held.copy(), ensemble.per_contact * len(ensemble.index)
    component = 2 * ensemble.known.contact + ensemble.known.component
    held[first:] = np.isin(component, component[held[first:]])
    return held


def _centre(ensemble: Ensemble) -> Floats | None:
    """The analytic centre y (n,) of S, None where S has none, or is thin.

    S has none if some contact's force is fixed at the wall of its cone. Scaled or nearly redundant
    rows magnify the residual of the centre, so that is removed first.
    """
    middle = centre_of(ensemble)
    y = middle.y[: 2 * len(ensemble.index)].reshape(-1, 2)
    if not middle.converged or not middle.y.min(initial=1.0) > _WELL_INSIDE:
        return None
    if ensemble.known is not None:
        normal, tangential = (ensemble.known.value / ensemble.units).T
        known = np.stack([normal + tangential, normal - tangential], axis=1)
        y = np.where(ensemble.known.wholly[:, None], np.maximum(known, 0.0), y)
    inner = (y if ensemble.mu > 0 else y.mean(axis=1)).ravel()
    inner = np.append(inner, middle.y[y.size :])
    A, b, _ = ensemble.scaled_form
    if unbalance(A, b, inner) <= _UNBALANCED:
        return inner
    inner = restored_balance(A, b, inner)
    return inner if inner.min(initial=1.0) > 0 else None


def normals(ensemble: Ensemble) -> tuple[Integers, Floats]:
    """(contact (n,), normal (n, 2)) of each wall: the change of its distance per unit f_n,
    f_t/μ."""
    contacts, known = len(ensemble.index), ensemble.known
    contact = np.repeat(np.arange(contacts), ensemble.per_contact)
    normal = np.tile([[1.0, 1.0], [1.0, -1.0]] if ensemble.mu > 0 else [[1.0, 0.0]], (contacts, 1))
    if known is None:
        return contact, normal
    sides = -known.sign[:, None] * np.eye(2)[known.component]
    return np.append(contact, known.contact), np.vstack([normal, sides])


def conductances(
    ensemble: Ensemble, held: Mask, curvature: Floats, stiff: Floats
) -> tuple[Floats, Floats, Integers]:
    """`wall_matrix.conductances` of a curvature (n,) along the walls and a stiffness (N_c, 2).

    held (n,): walls that are held.
    """
    contact, normal = normals(ensemble)
    cones = ensemble.per_contact * len(ensemble.index)
    # Half of it still counts as pinned.
    d = np.where(held, 4 * PINNED, curvature)
    k = stiff.copy()
    np.add.at(k, (contact[cones:], (normal[cones:, 1] != 0).astype(int)), d[cones:])
    if ensemble.mu > 0:
        return wall_matrix.conductances(d[:cones].reshape(-1, 2), k)
    return wall_matrix.conductances(np.repeat(d[:cones, None] / 2, 2, axis=1), k)


def pinned_stiffness(ensemble: Ensemble) -> Floats:
    """(N_c, 2) PINNED for components of which one value is known, and f_t at μ = 0; else 0."""
    stiff = np.zeros((len(ensemble.index), 2))
    if ensemble.mu == 0:
        stiff[:, 1] = PINNED
    return stiff if ensemble.known is None else np.where(ensemble.known.pinned, PINNED, stiff)


def _dimension(ensemble: Ensemble, held: Mask) -> int:
    """Unknowns less independent rows, of the balance and of the held walls."""
    if not held.any() and ensemble.A.shape[0] <= LARGEST_RANK:
        return ensemble.freedom
    if ensemble.A.shape[0] > LARGEST_RANK:
        C, _, free = conductances(ensemble, held, np.ones(len(held)), pinned_stiffness(ensemble))
        problem = independent_problem_of(ensemble)
        least = wall_matrix.DEPENDENT if held.any() else 0.0
        factors, out = wall_matrix.factored(problem.network, C, problem.diagonal, least)
        rows = int(np.sum((problem.diagonal == 0) & ~out))
        return int(free.sum()) - rows - wall_matrix.global_rows(problem.network, factors)
    return left_free(constraints(ensemble, held))


def constraints(ensemble: Ensemble, held: Mask) -> sparse.csr_matrix:
    """(k, free unknowns) rows that vanish along S: the balance, and held walls at the length 1."""
    walls = distances(ensemble)[held][:, ensemble.free]
    length = norm(walls, axis=1)
    length[length == 0] = 1.0
    return sparse.vstack([ensemble.free_columns, sparse.diags(1 / length) @ walls]).tocsr()


def distances(ensemble: Ensemble) -> sparse.csr_matrix:
    """(n, unknowns) the contribution of each unknown to the distance y of each wall."""
    contact, normal = normals(ensemble)
    size = ensemble.per_contact
    rows, columns = np.arange(len(contact))[:, None], size * contact[:, None] + np.arange(size)
    rows = np.broadcast_to(rows, columns.shape)
    values = (normal[:, :size] / ensemble.units[contact, :size]).ravel()
    shape = len(contact), size * len(ensemble.index)
    return sparse.csr_matrix((values, (rows.ravel(), columns.ravel())), shape=shape)
