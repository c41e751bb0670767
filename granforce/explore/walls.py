"""S by its walls: sampling moves only the slack of each wall, relative to that at a centre.

At the centre f° of S every slack is s = 1. Around the analytic centre (the largest Π y of the cone
coordinates y ≥ 0 and of the slacks of known bounds), S contains the ball |s − 1| ≤ 1 and is inside
one with a radius equal to the number of walls (Nesterov, Nemirovskii, Interior-point polynomial
algorithms, 1994): it is nearly round. Slacks move together by the matrix K of `wall_matrix`.
"""

import copy
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import sparse

from granforce.explore import thin
from granforce.explore.billiard import BLOCK
from granforce.explore.row_matrix import RowMatrix, with_rows
from granforce.explore.thin import ThinMatrix
from granforce.forces import hull
from granforce.forces.contact_problem import MOST_DENSE, independent_problem_of, unbalance
from granforce.forces.ensemble import Ensemble
from granforce.forces.grain_pressures import Rows, no_rows
from granforce.numerics import certificates, contact_program, wall_matrix
from granforce.numerics.contact_program import PINNED, Problem
from granforce.numerics.wall_matrix import DEPENDENT, POLISH, PROBES, WallMatrix
from granforce.records import UnboundedError, UndecidedError
from granforce.system import cancelling
from granforce.tolerances import BALANCED
from granforce.types import Floats, Integers, Mask

_MOST_NEWTON_STEPS = 200
# Newton's decrement at the centre, which only has to make S round.
_NEAR_CENTRE = 1e-3

Matrix = WallMatrix | RowMatrix | ThinMatrix


class Walls(NamedTuple):
    """y = centre; y[moving] *= s. Walls beyond `moving` are padding with s = 1."""

    centre: Floats  # (n,) y°, coordinates of `Ensemble.scaled_form`
    moving: Integers  # (w,) positions in y of coordinates that vary in S
    matrix: Matrix  # K of all `count` walls; thin if S is too thin for pivots
    dimension: int  # h of the affine hull of S
    pull: Floats  # (2 N_c,) Xᵀ W (m − X f°), the pull of measured sums X f; 0 without a measurement
    pulls: sparse.csr_matrix  # (2 N_c, 2 N_c + k) Xᵀ √W
    units: float  # ln of the volume of S in ⟨f_n⟩ over that in s

    @property
    def count(self) -> int:  # type: ignore[override]
        """Number of walls, including padding."""
        return self.matrix.count

    def rows(self, walls: Integers) -> Floats:
        """Rows (k, count) of K."""
        return self.matrix.rows(walls)

    def moved(self, g: Floats, pulls: Floats | None = None) -> Floats:
        """K g + B Q p, (k, count), of g (k, count) and forces p (k, 2 N_c)."""
        return self.matrix.moved(g, pulls)

    def on_hull(self, slacks: Floats) -> Floats:
        """Slacks (k, count) corrected to satisfy the balance, and the walls."""
        away = self.matrix.on_hull(slacks - 1.0)
        # Beyond a wall by rounding: to the point where the way from the centre meets it.
        return 1.0 - away / away.min(axis=1, initial=-1.0, keepdims=True)

    def points(self, slacks: Floats) -> Floats:
        """y (…, n) ≥ 0 of slacks (…, count)."""
        y = np.broadcast_to(self.centre, (*slacks.shape[:-1], len(self.centre))).copy()
        y[..., self.moving] *= np.maximum(slacks[..., : len(self.moving)], 0.0)
        return y


# Overflows in steps from an invalid centre are detected by its sign.
@np.errstate(divide="ignore", over="ignore", invalid="ignore")
def walls(
    ensemble: Ensemble,
    weight: Floats | float = 0.0,
    measured: Floats | float = 0.0,
    rows: Rows | None = None,
) -> Walls:
    """The Walls of an ensemble.

    weight, measured (N_c, 2): W and m in ⟨f_n⟩ for the centre of exp(−½ Σ W (f − m)²) truncated by
    the walls, which has the largest Σ log y − ½ Σ W (f − m)², instead of the analytic centre; K
    then has W in its stiffness. rows: measured sums of forces, which count likewise.

    Raises NotJammedError if S is empty, UnboundedError if it is proved to be unbounded,
    UndecidedError if no solver could decide, or S is thinner than rounding.
    """
    y = ensemble.hull.inner
    setup = _setup(ensemble, weight, measured, rows or no_rows(ensemble))
    centre = _centred(setup, y, _matrix)
    # Without the lost rows no centre may be found, or a wrong one.
    matrix_at: _MatrixAt = _matrix
    if _is_thin(setup, y if centre is None else centre):
        matrix_at = _Thin(setup)
        centre = _centred(setup, y, matrix_at)
    if centre is None and setup.weight.any():
        raise UndecidedError(
            "no centre of the measurement was found: its errors are too small, or too different "
            "from each other; use larger errors"
        )
    if centre is None and not ensemble.bounded:
        raise UnboundedError(certificates.UNBOUNDED)
    if centre is None or not np.all(centre >= 0):
        raise UndecidedError(
            "these conditions leave too little freedom to resolve: use a larger friction "
            "coefficient, or prescribe less"
        )
    return _walls(setup, centre, matrix_at)


class _Setup(NamedTuple):
    """Constants of the search for the centre."""

    ensemble: Ensemble
    problem: Problem  # its balance, independent rows
    contact: Integers  # (n,) contact of each coordinate y
    normal: Floats  # (n, 2) change of each coordinate per unit f_n, f_t/μ
    held: Mask  # (n,) bool
    stiff: Floats  # (N_c, 2) W, of f_n and f_t/μ; PINNED for known forces
    levers: sparse.csr_matrix  # X (2 N_c + k, 2 N_c): the measured sums X f, single forces first
    weight: Floats  # (2 N_c + k,) W of each, 0 for known forces
    target: Floats  # (2 N_c + k,) m

    @property
    def cones(self) -> int:
        """Number of coordinates of the cones; those of known bounds come after."""
        return self.ensemble.per_contact * len(self.stiff)

    @property
    def known(self) -> Floats:
        """The stiffness (N_c, 2) without W."""
        return np.where(self.stiff < PINNED, 0.0, PINNED)

    def conductances(self, curvature: Floats, stiff: Floats) -> tuple[Floats, Floats, Integers]:
        """`hull.conductances` of a stiffness (n,) along the coordinates and W (N_c, 2)."""
        return hull.conductances(self.ensemble, self.held, curvature, stiff)

    def forces(self, y: Floats) -> Floats:
        """f_n, f_t/μ (N_c, 2) of y (n,)."""
        pairs = y[: self.cones].reshape(len(self.stiff), -1)
        if self.ensemble.mu == 0:
            return np.pad(pairs, ((0, 0), (0, 1)))
        return 0.5 * np.stack([pairs.sum(axis=1), pairs[:, 0] - pairs[:, 1]], axis=1)

    def pull(self, y: Floats) -> Floats:
        """Xᵀ W (m − X f) (2 N_c,)."""
        lacking = self.target - self.levers @ self.forces(y).ravel()
        return self.levers.T @ (self.weight * lacking)


def _setup(
    ensemble: Ensemble, weight: Floats | float, measured: Floats | float, rows: Rows
) -> _Setup:
    contacts, unit, scale = len(ensemble.index), ensemble.units, ensemble.force_scale
    stiff, target = np.empty((2, contacts, 2))
    stiff[:], target[:] = weight * unit**2, measured / unit
    stiff = np.maximum(stiff, hull.pinned_stiffness(ensemble))
    sums = sparse.diags(scale / rows.sigma) @ rows.matrix @ sparse.diags(unit.ravel())
    levers = sparse.vstack([sparse.identity(2 * contacts), sums], format="csr")
    single = np.where(stiff < PINNED, stiff, 0.0).ravel()
    problem, affine_hull = independent_problem_of(ensemble), ensemble.hull
    contact, normal = hull.normals(ensemble)
    setup = _Setup(
        ensemble=ensemble,
        problem=problem,
        contact=contact,
        normal=normal,
        held=affine_hull.held,
        stiff=stiff,
        levers=levers,
        weight=np.append(single, np.ones(len(rows.sigma))),
        target=np.append(target, rows.values / rows.sigma),
    )
    if affine_hull.held.any():
        C, _, _ = setup.conductances(_barrier(setup, affine_hull.inner), stiff)
        _, out = wall_matrix.factored(problem.network, C, problem.diagonal, DEPENDENT)
        without = contact_program.without_rows(problem, problem.diagonal, out)
        setup = setup._replace(problem=without)
    return setup


def _barrier(setup: _Setup, y: Floats) -> Floats:
    """The second derivatives of −Σ log y."""
    return np.where(setup.held, 1.0, y) ** -2.0


def _matrix(setup: _Setup, y: Floats) -> tuple[WallMatrix | RowMatrix, Integers]:
    """(K at y, positions of its walls in y)."""
    curvature = _barrier(setup, y)
    C, _, free = setup.conductances(curvature, setup.stiff)
    conductances, _, _ = setup.conductances(curvature, setup.known)
    moving = np.flatnonzero(~setup.held & (free[setup.contact] > 0))
    padding = -len(moving) % BLOCK
    contact = np.append(setup.contact[moving], np.zeros(padding, dtype=np.int64))
    normal = np.vstack([setup.normal[moving] / y[moving, None], np.zeros((padding, 2))])
    problem = setup.problem
    factors, _ = wall_matrix.factored(problem.network, C, problem.diagonal, 0.0)
    matrix = WallMatrix(problem.network, contact, normal, C, conductances, factors)
    rows = slice(2 * len(C), None)
    if not len(setup.weight[rows]):
        return matrix, moving
    return with_rows(matrix, problem.diagonal, setup.levers[rows], setup.weight[rows]), moving


def _rest(setup: _Setup, y: Floats) -> Floats:
    """Unbalance b − A f of y, in the rows of the problem and the global rows."""
    S, problem = setup.ensemble, setup.problem
    forces = setup.forces(y) * S.units
    rest = np.zeros(len(problem.b) + len(problem.b_border))
    rest[problem.place] = S.b / S.force_scale - S.A @ S.to_vector(forces)
    rest[: len(problem.b)] *= problem.diagonal == 0
    return rest


class _Thin:
    """K at y by singular values, and the positions of its walls in y, for any y."""

    def __init__(self, setup: _Setup) -> None:
        _, self.moving = _matrix(setup, setup.ensemble.hull.inner)
        balance = _balance(setup.ensemble, self.moving)
        self.basis = thin.basis(balance, setup.ensemble.hull.dimension)

    def __call__(self, setup: _Setup, y: Floats) -> tuple[ThinMatrix, Integers]:
        moving = self.moving
        count = len(moving) + -len(moving) % BLOCK
        forces = np.array([setup.forces(one).ravel() for one in np.diag(y)[moving]]).T
        stiff = setup.levers.T @ sparse.diags(setup.weight) @ setup.levers
        return thin.thin_matrix(self.basis, y[moving], forces, stiff, count), moving


def _balanced(setup: _Setup, y: Floats, matrix: Matrix, moving: Integers) -> Floats:
    """y, corrected to balance."""
    if isinstance(matrix, ThinMatrix):
        A, _, _ = setup.ensemble.scaled_form
        lacking = matrix.inverse @ (setup.ensemble.hull.b - A @ y)
    else:
        lacking = matrix.balancing(_rest(setup, y))[: len(moving)]
    return _shifted(y, moving, lacking)


_MatrixAt = Callable[[_Setup, Floats], tuple[Matrix, Integers]]


def _balance(ensemble: Ensemble, moving: Integers) -> Floats:
    """The balance (rows, w) of the moving coordinates."""
    return ensemble.scaled_form[0].tocsc()[:, moving].toarray()


def _is_thin(setup: _Setup, y: Floats) -> bool:
    """Whether the sparse factor lost rows of the balance at y, checked by dense matrices."""
    ensemble = setup.ensemble
    A, b = ensemble.scaled_form[0], ensemble.hull.b
    if A.shape[0] > MOST_DENSE:
        return False
    if ensemble.known is None:  # `_balanced` aims at this, not at the residual of a known network
        b = ensemble.scaled_balance[1]
    matrix, moving = _matrix(setup, y)
    if not len(moving):
        return False
    for _ in range(POLISH):
        y = _balanced(setup, y, matrix, moving)
    if not (unbalance(A, b, y) <= BALANCED / 10 and y[moving].min() > 0):
        return True
    g = np.random.default_rng(0).standard_normal((PROBES, matrix.count))
    change = matrix.moved(g, None, POLISH)[:, : len(moving)]
    balance = _balance(ensemble, moving)
    if not np.abs(change @ (balance * y[moving]).T).max(initial=0.0) <= BALANCED / 10:
        return True
    h, _ = _shape(setup, _barrier(setup, y), setup.known)
    return h != ensemble.hull.dimension


def _centred(setup: _Setup, y: Floats, matrix_at: _MatrixAt) -> Floats | None:
    """The y with the largest Σ log y − ½ Σ W (f − m)², from y by damped Newton steps.

    None if they do not converge: it may be at infinity.
    """
    for _ in range(_MOST_NEWTON_STEPS):
        cancelling.check("uniform sample")
        matrix, moving = matrix_at(setup, y)
        if not len(moving):
            return y
        y = _balanced(setup, y, matrix, moving)
        pull = setup.pull(y)
        # Newton's step to the centre.
        relative = matrix.moved(np.ones((1, matrix.count)), pull)[0, : len(moving)]
        change = setup.forces(_shifted(y, moving, relative)) - setup.forces(y)
        # The decrement squared: the growth of the sum along the step, to first order.
        gain = float(relative.sum() + pull @ change.ravel())
        if gain < _NEAR_CENTRE**2:
            for _ in range(POLISH):
                y = _balanced(setup, y, matrix, moving)
            return y
        slope = float(pull @ change.ravel())
        curve = float(setup.weight @ (setup.levers @ change.ravel()) ** 2)
        step = min(1.0, 0.95 / max(-relative.min(), 1e-300))
        while _rise(step, relative, slope, curve) < 0.1 * step * gain:
            step /= 2
        y = _shifted(y, moving, step * relative)
    return None


def _rise(step: float, relative: Floats, slope: float, curve: float) -> float:
    """Growth of Σ log y − ½ Σ W (f − m)² along a step."""
    return np.log1p(step * relative).sum() + step * (slope - 0.5 * step * curve)


def _shifted(y: Floats, moving: Integers, relative: Floats) -> Floats:
    y = y.copy()
    y[moving] *= 1 + relative
    return y


def _walls(setup: _Setup, y: Floats, matrix_at: _MatrixAt) -> Walls:
    """The Walls around y."""
    ensemble = setup.ensemble
    matrix: Matrix
    if isinstance(matrix_at, _Thin):
        matrix, moving = matrix_at(setup, y)
        h = matrix.null.shape[1]
        forces = ensemble.scaled_form[2].tocsc()[:, moving] @ (y[moving, None] * matrix.null)
        units = 0.5 * float(np.linalg.slogdet(forces.T @ forces)[1])
    else:
        known = setup.known
        h, shape = _shape(setup, _barrier(setup, y), known)
        # f_t is in units of μ: its own length is μ times that.
        plain = np.maximum(known, ensemble.units**2)
        units = _shape(setup, np.zeros_like(y), plain)[1] - shape
        matrix, moving = _matrix(setup, y)
        if isinstance(matrix, WallMatrix):
            # A copy, or changes to a sample's matrix would change the ensemble's.
            matrix = matrix._replace(network=copy.deepcopy(matrix.network))
        matrix = wall_matrix.restored(matrix)
    pulls = sparse.csr_matrix(setup.levers.T @ sparse.diags(np.sqrt(setup.weight)))
    return Walls(y, moving, matrix, h, setup.pull(y), pulls, units)


def _shape(setup: _Setup, curvature: Floats, stiff: Floats) -> tuple[int, float]:
    """Dimension h of the balanced changes, and ½ ln det of the stiffness M there.

    For N a basis of the null space of A, det NᵀMN is det M det A M⁻¹Aᵀ up to a factor that depends
    only on A.
    """
    network, diagonal = setup.problem.network, setup.problem.diagonal
    C, logs, free = setup.conductances(curvature, stiff)
    factors, out = wall_matrix.factored(network, C, diagonal, 0.0)
    rows = int(np.sum((diagonal == 0) & ~out)) + wall_matrix.global_rows(network, factors)
    log_rows = wall_matrix.log_determinant(network, factors)
    return int(free.sum()) - rows, 0.5 * float(logs.sum() + log_rows)
