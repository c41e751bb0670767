"""Linear programs by HiGHS: minimise c·y subject to A y = b, y ≥ 0 (S in cone coordinates)."""

import highspy
import numpy as np
from scipy import sparse

from granforce.tolerances import PROGRAM

OPTIMAL = highspy.HighsModelStatus.kOptimal
INFEASIBLE = highspy.HighsModelStatus.kInfeasible


def standard_form(A, b, *, upper=np.inf, solver="choose"):
    """A silent HiGHS model of {0 ≤ y ≤ upper, A y = b}, zero cost; A sparse (m, n), b (m,)."""
    columns = np.zeros(A.shape[1]), np.full(A.shape[1], upper)
    return bounded(A, (b, b), columns, np.zeros(A.shape[1]), solver=solver)


def bounded(A, rows, columns, cost, *, solver="choose"):
    """A silent HiGHS model: minimise cost·y with A y and y between bounds.

    A sparse (m, n); rows: lower and upper bounds (m,) of A y; columns: those (n,) of y; cost (n,).
    granforce's tolerances, one thread.
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
    for name, value in {
        "output_flag": False,
        "threads": 1,
        "solver": solver,
        "primal_feasibility_tolerance": PROGRAM,
        "dual_feasibility_tolerance": PROGRAM,
    }.items():
        model.setOptionValue(name, value)
    model.passModel(lp)
    return model


def set_cost(model, cost):
    """Replace the whole cost vector (n,) of a model, which keeps its basis."""
    columns = np.arange(len(cost), dtype=np.int32)
    model.changeColsCost(len(cost), columns, np.asarray(cost, dtype=np.float64))


def solve(model):
    """Run the model; its status and the point y reached (n,)."""
    model.run()
    return model.getModelStatus(), np.array(model.getSolution().col_value)


def basis(model):
    """Rows and columns (positions) of the square basis matrix of a solved model, None without.

    Rows whose own logical is basic are implied by the others and left out.
    """
    found = model.getBasis()
    basic = highspy.HighsBasisStatus.kBasic
    columns = np.flatnonzero([status == basic for status in found.col_status])
    rows = np.flatnonzero([status != basic for status in found.row_status])
    return (rows, columns) if found.valid and len(rows) == len(columns) else None
