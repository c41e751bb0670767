"""S as a contact program: converts an ensemble's balance and cones to the form used by
`numerics`."""

from __future__ import annotations

import threading
import weakref
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import linalg, sparse

from granforce.forces import knowledge
from granforce.forces.balance import left_open_in
from granforce.forces.ensemble import Ensemble
from granforce.forces.knowledge import Polygons
from granforce.numerics import (
    certificates,
    certified_values,
    contact_matrix,
    contact_program,
    inner_point,
    interior_point,
    linear_programs,
)
from granforce.numerics.contact_matrix import Network
from granforce.numerics.contact_program import Problem
from granforce.numerics.lanes import MANY, ONE
from granforce.numerics.linear_programs import Centre
from granforce.records import UnboundedError, UndecidedError, brief_list
from granforce.system import cancelling
from granforce.system.wording import counted
from granforce.tolerances import BALANCED, ROUNDING
from granforce.types import Floats, Integers, Mask

# Added to A K Aᵀ at w = 1, relative to the diagonal of A Aᵀ, because translations cost nothing. It
# bounds steps without slowing them.
SHIFT = 1e-11
# Rows whose pivot is below this, relative to the largest, depend on others. Dense matrices are used
# up to this number of rows.
DEPENDENT, MOST_DENSE = 1e-10, 3000
# Number of corrections in `restored_balance`: each changes the weights of the next.
_CORRECTIONS = 3


def balance_of(
    ensemble: Ensemble, unit: npt.ArrayLike = 1.0
) -> tuple[Network, Floats, Floats, Floats, Integers]:
    """(Network, b, b of the global rows, idle, place) of an ensemble, forces in ⟨f_n⟩.

    unit (N_c,): of the tangential forces. place: where the ensemble's rows are among those of the
    network and the global ones; idle (rows,): 1 for rows that the ensemble lacks: torques at μ = 0,
    and all rows of grains that need not balance.
    """
    contacts, size = ensemble.contacts, ensemble.per_grain
    unit = np.broadcast_to(unit, len(contacts.i))
    grains = np.union1d(ensemble.grains, np.union1d(contacts.i, contacts.j))
    i, j = (np.searchsorted(grains, which) for which in (contacts.i, contacts.j))
    balanced = np.searchsorted(grains, ensemble.grains)
    A, last = ensemble.A.tocsc(), size * len(balanced)
    dense = np.zeros((2, len(i), 3, 2))
    border = np.zeros((len(i), A.shape[0] - last, 2))
    for part in range(ensemble.per_contact):
        columns = A[:, part :: ensemble.per_contact].tocoo()
        value = columns.data * (unit[columns.col] if part else 1.0)
        whole = columns.row >= last
        border[columns.col[whole], columns.row[whole] - last, part] = value[whole]
        grain, row = np.divmod(columns.row, size)
        for side, ends in enumerate((i, j)):
            entries = ~whole
            entries[entries] = balanced[grain[entries]] == ends[columns.col[entries]]
            dense[side, columns.col[entries], row[entries], part] = value[entries]
    network = contact_matrix.make_network(
        ensemble.packing.x[grains], i, j, dense[0], dense[1], border
    )
    rows = 3 * len(grains)
    place = (3 * network.layout.position[balanced, None] + np.arange(size)).ravel()
    place = np.concatenate([place, rows + np.arange(border.shape[1])])
    b, idle = np.zeros(rows + border.shape[1]), np.ones(rows)
    b[place] = ensemble.b / ensemble.force_scale
    idle[place[:last]] = 0.0
    return network, b[:rows], b[rows:], idle, place


def make_problem(ensemble: Ensemble) -> tuple[Problem, Floats]:
    """The Problem of an ensemble, tangential forces in μ ⟨f_n⟩, and its idle rows (rows,)."""
    network, b, b_border, idle, place = balance_of(ensemble, ensemble.slopes)
    problem = contact_program.make_problem(
        network, b, b_border, idle, place, ensemble.slopes, SHIFT
    )
    if ensemble.known is not None:
        problem = _with_known(problem, ensemble, ensemble.known)
    return problem, idle


def _with_known(problem: Problem, ensemble: Ensemble, known: Polygons) -> Problem:
    """The Problem with known forces; fully known contacts stay at y = (1, 1) in it."""
    first = knowledge.first_forces(known, ensemble.slopes)
    rows = np.zeros(len(problem.b) + len(problem.b_border))
    rows[problem.place] = _instead(ensemble, known)
    sides = known.contact, known.component, known.sign
    slack = known.limit / ensemble.units[known.contact, known.component]
    rest = slack - known.sign * first[known.contact, known.component]
    pairs = np.stack([first.sum(axis=1), first[:, 0] - first[:, 1]], axis=1)
    return problem._replace(
        b=problem.b + rows[: len(problem.b)],
        b_border=problem.b_border + rows[len(problem.b) :],
        w=np.where(known.pinned.ravel(), contact_program.PINNED, problem.w),
        start=np.append(pairs.ravel(), np.maximum(rest, 0.1)),
        side=2 * sides[0] + sides[1],
        sign=sides[2],
        limit=slack,
    )


def _instead(ensemble: Ensemble, known: Polygons) -> Floats:
    """A (f° − f) for fully known contacts: f their force, f° = (1, 0) its stand-in."""
    wholly = known.wholly[:, None]
    instead = np.where(wholly, np.array([1.0, 0.0]) - known.value, 0.0)
    return ensemble.A @ ensemble.to_vector(instead)


def forces_of(ensemble: Ensemble, y: Floats) -> Floats:
    """Forces (…, N_c, 2) of cone coordinates (…, n)."""
    pairs = y[..., : 2 * len(ensemble.index)].reshape(*y.shape[:-1], -1, 2)
    normal, tangential = pairs.sum(axis=-1), ensemble.slopes * (pairs[..., 0] - pairs[..., 1])
    forces = 0.5 * ensemble.force_scale * np.stack([normal, tangential], axis=-1)
    return ensemble.pin(forces)


@dataclass
class _Shared:
    """Data shared by the programs of one ensemble; None until first use."""

    problem: Problem
    idle: Floats  # (rows,) 1 for rows that the ensemble does not have
    independent: Problem | None = None
    centre: Centre | None = None
    system: certified_values.System | None = None


# Lives as long as the ensembles; a field of theirs would be sent to other processes with them.
_shared: weakref.WeakKeyDictionary[Ensemble, _Shared] = weakref.WeakKeyDictionary()
_lock = threading.Lock()


def _shared_of(ensemble: Ensemble) -> _Shared:
    with _lock:
        if ensemble not in _shared:
            problem, idle = make_problem(ensemble)
            _shared[ensemble] = _Shared(problem, idle)
        return _shared[ensemble]


def problem_of(ensemble: Ensemble) -> Problem:
    """The Problem for nearest networks: all rows, with redundant rows shifted."""
    return _shared_of(ensemble).problem


def independent_problem_of(ensemble: Ensemble, lanes: Any = ONE) -> Problem:
    """The Problem for linear programs: independent rows, exactly; lanes as for `centre_of`."""
    shared = _shared_of(ensemble)
    if shared.independent is None:
        problem, idle = shared.problem, shared.idle
        if len(ensemble.frozen) and ensemble.A.shape[0] <= MOST_DENSE:
            out = np.zeros(len(idle), bool)
            out[problem.place] = _dependent_rows(ensemble)
        else:
            out = interior_point.dependent_rows(problem, idle, lanes)
        shared.independent = contact_program.without_rows(problem, idle, out)
    return shared.independent


def _dependent_rows(ensemble: Ensemble) -> Mask:
    """Mask of rows of A that depend on others, with moderate factors.

    Frozen surroundings determine most forces: rows without a pivot may be others times 2·10⁵, and
    rounding may look like a pivot. QR with pivoting (Golub, Numer. Math. 7, 206 (1965))
    distinguishes them.
    """
    decompose = partial(linalg.qr, mode="r", pivoting=True)
    R, order = cancelling.apart(decompose, ensemble.free_columns.toarray().T)
    pivots = np.abs(np.diag(R))
    out = np.ones(len(order), bool)
    out[order[: np.sum(pivots > DEPENDENT * pivots.max(initial=0.0))]] = False
    return out


def centre_of(ensemble: Ensemble, lanes: Any = ONE) -> Centre:
    """The analytic centre of an ensemble's independent Problem, found on first use.

    lanes: those of the computations that follow, so that kernels compile for one width.
    """
    shared = _shared_of(ensemble)
    if shared.centre is None:
        shared.centre = linear_programs.centre(independent_problem_of(ensemble, lanes), lanes)
    return shared.centre


def make_system(ensemble: Ensemble, *, unbounded: bool = False) -> certified_values.System:
    """The certified_values.System of an ensemble, in the cone coordinates of its Problem.

    It is built on first use and cached with the ensemble. unbounded: S may be unbounded. Raises
    Cancelled on request, and the errors of `certified_values.make_system`.
    """
    cancelling.check()
    shared = _shared_of(ensemble)
    if shared.system is None:
        shared.system = _new_system(ensemble)
    if shared.system.grows is not None and not unbounded:
        raise UnboundedError(certificates.UNBOUNDED)
    return shared.system


def wedged(ensemble: Ensemble) -> Integers:
    """Grains that can press against each other without a load: wedged, if S is proved unbounded."""
    if ensemble.has_pressure_row:
        return np.zeros(0, dtype=np.int64)
    try:
        grows = make_system(ensemble, unbounded=True).grows
    except (UndecidedError, UnboundedError):
        grows = None
    if grows is None:
        return np.zeros(0, dtype=np.int64)
    pairs = grows.mask[: 2 * len(ensemble.index)].reshape(-1, 2)
    c = ensemble.contacts.picked(np.flatnonzero(pairs.any(axis=1)))
    return np.setdiff1d(np.append(c.i, c.j), np.flatnonzero(left_open_in(ensemble.packing)))


def prestress(grains: Integers) -> str:
    """Words on wedged grains; empty without any."""
    if not len(grains):
        return ""
    listed, some = brief_list(grains.tolist()), counted(len(grains), "grain is", "grains are")
    return (
        f"{some} wedged ({listed}, counted from 0): forces there can grow without a load, so that "
        "rest assumes a prestress"
    )


def _new_system(ensemble: Ensemble) -> certified_values.System:
    count, known, T = len(ensemble.index), ensemble.known, ensemble.from_cones
    A, b = (ensemble.A @ T).tocsr(), ensemble.b / ensemble.force_scale
    loads = ensemble.A.tocsc()[:, :: ensemble.per_contact]
    sides = slice(len(b), len(b) + (0 if known is None else len(known.contact)))
    bounding = ensemble.pressure_row if ensemble.has_pressure_row else None
    if known is not None:
        value = np.where(known.wholly[:, None], [1.0, 0.0], known.value)
        A, b, _ = knowledge.extended(
            A, b + _instead(ensemble, known), T, known, ensemble.slopes, value
        )
        loads = sparse.vstack([loads, sparse.csc_matrix((len(b) - loads.shape[0], count))])
        bounding = None
    problem = independent_problem_of(ensemble, MANY)
    middle = centre_of(ensemble, MANY)
    states = [middle.y] if middle.converged else []
    if ensemble.reference is not None:
        states.append(_coordinates(ensemble, ensemble.reference))
    if states:
        # Multipliers of redundant rows may be large: a state's residual, up to BALANCED, would
        # give a false bound there. The state with the smallest residual is used.
        offs = np.abs(np.stack([A @ y for y in states]) - b)
        offs[:, sides] = 0.0
        least = int(np.argmin(offs.max(axis=1, initial=0.0)))
        if offs[least].max(initial=0.0) <= 2 * BALANCED:
            b = np.where(offs[least] > 10 * ROUNDING, A @ states[least], b)
    return certified_values.make_system(problem, middle, A.tocsr(), b, loads.tocsc(), bounding)


def _coordinates(ensemble: Ensemble, forces: Floats) -> Floats:
    """y (n,) ≥ 0 of a Problem nearest to forces (N_c, 2)."""
    y = ensemble.coordinates(forces)
    parts = ensemble.per_contact * len(ensemble.index)
    pairs = y[:parts].reshape(-1, ensemble.per_contact).repeat(2 // ensemble.per_contact, axis=1)
    if ensemble.known is not None:
        pairs = np.where(ensemble.known.wholly[:, None], 1.0, pairs)
    return np.append(pairs, y[parts:])


def cone_costs(ensemble: Ensemble, forces: Floats) -> Floats:
    """Costs (…, 2 N_c) of y for costs (…, N_c, 2) of the unknown forces f_n, f_t."""
    if ensemble.known is not None:
        forces = np.where(ensemble.known.wholly[:, None], 0.0, forces)
    normal, tangential = forces[..., 0], ensemble.slopes * forces[..., 1]
    pairs = np.stack([0.5 * (normal + tangential), 0.5 * (normal - tangential)], axis=-1)
    return pairs.reshape(*forces.shape[:-2], -1)


def known_part(ensemble: Ensemble, axes: Floats) -> Floats:
    """The contribution of fully known contacts to the projections (…,) of forces on axes (…, N_c,
    2)."""
    if ensemble.known is None:
        return np.zeros(axes.shape[:-2])
    value = np.where(ensemble.known.wholly[:, None], ensemble.known.value, 0.0)
    return (axes * value).sum(axis=(-2, -1))


def restored_balance(A: sparse.csr_matrix, b: Floats, y: Floats, floor: float = 0.0) -> Floats:
    """y (n,), corrected to A y = b by the least change relative to |y| + floor.

    A positive floor lets zeros change.
    """
    for _ in range(_CORRECTIONS):
        size = np.abs(y) + floor
        size /= size.max(initial=1e-300)
        scaled, zeros = sparse.csc_matrix(A @ sparse.diags(size)), np.zeros(len(y))
        change, _ = cancelling.apart(inner_point.balanced, scaled, b - A @ y, zeros)
        y = y + size * change
    return y


def unbalance(A: sparse.csr_matrix, b: Floats, y: Floats) -> float:
    """Largest |A y − b|, relative to b in rows where that exceeds 1.

    Global rows add up forces of all contacts, and so do their rounding errors.
    """
    return float(np.max(np.abs(A @ y - b) / np.maximum(1.0, np.abs(b)), initial=0.0))
