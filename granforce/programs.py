"""Linear programs by HiGHS: minimise c·y subject to A y = b, y ≥ 0 (S in cone coordinates)."""

import highspy
import numpy as np
from scipy import sparse

from granforce.tolerances import PROGRAM

OPTIMAL = highspy.HighsModelStatus.kOptimal
INFEASIBLE = highspy.HighsModelStatus.kInfeasible


def standard_form(A, b, *, upper=np.inf, solver="choose", threads=1):
    """A silent HiGHS model of {0 ≤ y ≤ upper, A y = b}, zero cost; A sparse (m, n), b (m,)."""
    A = sparse.csc_matrix(A)
    rows, columns = A.shape
    lp = highspy.HighsLp()
    lp.num_col_, lp.num_row_ = columns, rows
    lp.col_cost_ = np.zeros(columns)
    lp.col_lower_ = np.zeros(columns)
    lp.col_upper_ = np.full(columns, upper)
    lp.row_lower_ = lp.row_upper_ = np.asarray(b, dtype=np.float64)
    lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    lp.a_matrix_.start_ = A.indptr.astype(np.int32)
    lp.a_matrix_.index_ = A.indices.astype(np.int32)
    lp.a_matrix_.value_ = A.data
    model = silent_model(solver=solver, threads=threads)
    model.passModel(lp)
    return model


def silent_model(*, solver="choose", threads=1):
    """An empty HiGHS model with granforce's tolerances and no output."""
    model = highspy.Highs()
    for name, value in {
        "output_flag": False,
        "threads": threads,
        "solver": solver,
        "primal_feasibility_tolerance": PROGRAM,
        "dual_feasibility_tolerance": PROGRAM,
    }.items():
        model.setOptionValue(name, value)
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
