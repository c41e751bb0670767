"""Linear programs by HiGHS: minimise c·y subject to A y = b, y ≥ 0 (S in cone coordinates).

Also quadratic programs by PIQP. A solver's own status proves nothing: see `certificates`.
"""

from collections.abc import Iterator
from contextlib import suppress

import highspy
import numpy as np
import piqp
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from granforce.system import cancelling
from granforce.tolerances import PROGRAM
from granforce.types import Floats, Integers

OPTIMAL = highspy.HighsModelStatus.kOptimal
_PRIMAL_SIMPLEX = 4  # number of this strategy in HiGHS

# Usually below 100; if {y ≥ 0 : A y = b} is empty, the iteration may never end.
MOST_INTERIOR_STEPS = 1000
# Settings to retry a program with if it ended without an optimum.
_OTHER_WAYS = (
    {"solver": "simplex"},
    {"solver": "simplex", "presolve": "off"},
    {"solver": "ipm", "run_crossover": "on", "presolve": "off"},
)


def standard_form(
    A: sparse.csr_matrix, b: Floats, *, upper: float = np.inf, solver: str = "choose"
) -> highspy.Highs:
    """A silent HiGHS model of {0 ≤ y ≤ upper, A y = b}, zero cost; A sparse (m, n), b (m,)."""
    columns = np.zeros(A.shape[1]), np.full(A.shape[1], upper)
    return bounded(A, (b, b), columns, np.zeros(A.shape[1]), solver=solver)


def going_on(A: sparse.csr_matrix, b: Floats) -> highspy.Highs:
    """A standard_form for the primal simplex method: a vertex stays feasible when costs change."""
    model = standard_form(A, b, solver="simplex")
    model.setOptionValue("simplex_strategy", _PRIMAL_SIMPLEX)
    return model


def bounded(
    A: sparse.csr_matrix,
    rows: tuple[Floats, Floats],
    columns: tuple[Floats, Floats],
    cost: Floats,
    *,
    solver: str = "choose",
) -> highspy.Highs:
    """A silent HiGHS model: minimise cost·y with A y and y between bounds.

    A sparse (m, n); rows: lower and upper bounds (m,) of A y; columns: bounds (n,) of y; cost (n,).
    Uses the tolerances of granforce and one thread.
    """
    A = sparse.csc_matrix(A)
    lp = highspy.HighsLp()
    lp.num_row_, lp.num_col_ = A.shape
    lp.col_cost_ = np.asarray(cost, dtype=np.float64)
    lp.col_lower_, lp.col_upper_ = columns
    lp.row_lower_, lp.row_upper_ = (np.asarray(bound, dtype=np.float64) for bound in rows)
    lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    lp.a_matrix_.start_ = A.indptr.astype(np.int32)
    lp.a_matrix_.index_ = A.indices.astype(np.int32)
    lp.a_matrix_.value_ = A.data
    model = highspy.Highs()
    options: dict[str, bool | int | float | str] = {
        "output_flag": False,
        "threads": 1,
        "solver": solver,
        "ipm_iteration_limit": MOST_INTERIOR_STEPS,
        "primal_feasibility_tolerance": PROGRAM,
        "dual_feasibility_tolerance": PROGRAM,
    }
    for name, value in options.items():
        model.setOptionValue(name, value)
    model.passModel(lp)
    return model


def set_cost(model: highspy.Highs, cost: Floats) -> None:
    """Replace the whole cost vector (n,) of a model; its basis is preserved."""
    columns = np.arange(len(cost), dtype=np.int32)
    model.changeColsCost(len(cost), columns, np.asarray(cost, dtype=np.float64))


def solve(model: highspy.Highs) -> tuple[highspy.HighsModelStatus, Floats]:
    """Run the model and return its status and the point y reached (n,)."""
    cancelling.apart(model.run, interrupt=lambda: _interrupt(model))
    return model.getModelStatus(), np.array(model.getSolution().col_value)


def solutions(model: highspy.Highs) -> Iterator[tuple[highspy.HighsModelStatus, Floats]]:
    """Yield status and point y (n,) of the model as set up, then of other methods in turn.

    The simplex method first continues from the vertex that an interior-point method reached.
    """
    yield solve(model)
    options_before = {
        name: model.getOptionValue(name)[1] for options in _OTHER_WAYS for name in options
    }
    try:
        if options_before["solver"] == "ipm":
            model.setOptionValue("solver", "simplex")
            yield solve(model)
        for options in _OTHER_WAYS:
            model.clearSolver()
            for name, value in (options_before | options).items():
                model.setOptionValue(name, value)
            yield solve(model)
    finally:
        for name, value in options_before.items():
            model.setOptionValue(name, value)


def optimal(model: highspy.Highs) -> Floats | None:
    """The first point (n,) that some method reports as optimal, or None."""
    return next((y for status, y in solutions(model) if status == OPTIMAL), None)


def points(A: sparse.csr_matrix, b: Floats) -> Iterator[Floats]:
    """Yield points y (n,) ≥ 0 that solve A y = b up to rounding, as proposed by several methods."""
    model = standard_form(A, b, solver="simplex")
    for _, y in solutions(model):
        yield np.maximum(y, 0.0)
        optimal = basis(model)
        if optimal is not None:
            with suppress(RuntimeError):  # singular basis
                yield np.maximum(vertex(A, b, np.zeros(A.shape[1]), *optimal)[0], 0.0)


def multipliers(model: highspy.Highs, A: sparse.csr_matrix, cost: Floats) -> Floats:
    """Multipliers λ (m,) of the rows of a solved model, to rounding if it has a basis."""
    optimal = basis(model)
    if optimal is not None:
        try:
            return vertex(A, np.zeros(A.shape[0]), cost, *optimal)[1]
        except RuntimeError:  # singular basis
            pass
    return np.array(model.getSolution().row_dual)


def vertex(
    A: sparse.csr_matrix, b: Floats, cost: Floats, rows: Integers, columns: Integers
) -> tuple[Floats, Floats]:
    """y and λ of a basis from its own LU factors: rounding error instead of tolerances."""
    return cancelling.apart(_vertex, A, b, cost, rows, columns)


def _vertex(
    A: sparse.csr_matrix, b: Floats, cost: Floats, rows: Integers, columns: Integers
) -> tuple[Floats, Floats]:
    factors = splu(sparse.csc_matrix(A.tocsr()[rows][:, columns]))
    y, multiplier = np.zeros(A.shape[1]), np.zeros(A.shape[0])
    for _ in range(2):
        y[columns] += factors.solve((b - A @ y)[rows])
        rest = cost - A.T @ multiplier
        multiplier[rows] += factors.solve(rest[columns], trans="T")
    return y, multiplier


def _interrupt(model: highspy.Highs) -> None:
    """Make a running model stop at its next step; called from another thread.

    The callback is set only now: called at every step, it would wait for Python each time.
    """
    for event in (model.cbSimplexInterrupt, model.cbIpmInterrupt):
        event.subscribe(lambda step: step.interrupt())


def symmetric_factor(square: sparse.csr_matrix) -> SuperLU:
    """The sparse factor of a symmetric positive matrix."""
    options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0}
    return splu(sparse.csc_matrix(square), **options, options={"SymmetricMode": True})


def basis(model: highspy.Highs) -> tuple[Integers, Integers] | None:
    """Rows and columns (positions) of the square basis matrix of a solved model, or None.

    Rows whose logical variable is basic are implied by the others and left out.
    """
    optimal = model.getBasis()
    basic = highspy.HighsBasisStatus.kBasic
    columns = np.flatnonzero([status == basic for status in optimal.col_status])
    rows = np.flatnonzero([status != basic for status in optimal.row_status])
    return (rows, columns) if optimal.valid and len(rows) == len(columns) else None


def least_unbalanced(A: sparse.csr_matrix, b: Floats) -> tuple[Floats, Floats]:
    """y ≥ 0 (n,) that minimises |A y − b|², and the residual vector (m,)."""
    rows, columns = A.shape
    solver = quadratic_solver(200)
    quadratic = sparse.block_diag([1e-10 * sparse.eye(columns), sparse.eye(rows)], format="csc")
    lower = np.concatenate([np.zeros(columns), np.full(rows, -np.inf)])
    solver.setup(
        quadratic,
        np.zeros(columns + rows),
        sparse.hstack([A, sparse.eye(rows)], format="csc"),
        b,
        x_l=lower,
    )
    solver.solve()
    y = np.maximum(solver.result.x[:columns], 0.0)
    return y, A @ y - b


def quadratic_solver(max_iterations: int) -> piqp.SparseSolver:
    """A silent PIQP solver with the tolerances of granforce."""
    solver = piqp.SparseSolver()
    solver.settings.verbose = False
    solver.settings.max_iter = max_iterations
    solver.settings.eps_abs = 1e-12
    solver.settings.eps_rel = 1e-13
    # At small μ, with distant starts or dependent rows, the systems without regularisation or with
    # the default one stop short of their target.
    solver.settings.reg_lower_limit = 1e-14
    solver.settings.iterative_refinement_always_enabled = True
    return solver
