"""The admissible network nearest to given forces, as a quadratic program (PIQP)."""

import time

import numpy as np
import piqp
from scipy import sparse

from granforce.records import NotJammedError, Relaxation
from granforce.tolerances import BALANCED


def nearest(ensemble, start, *, tolerance=BALANCED, max_iterations=200):
    """The point of S with the least Σ |F_c − F_start,c|².

    start (N_c, 2). Solved in cone coordinates y ≥ 0 (p = f_n + f_t/μ, q = f_n − f_t/μ), in units
    of ⟨f_n⟩. Returns a Relaxation; ``converged`` is False where S is empty.

    Every call sets up its own solver: one kept for the ensemble and updated with each start would
    save a tenth to a fifth of the time, but carries rounding over (1e-9 ⟨f_n⟩) from what it
    solved before, and the same start would no longer give the same forces.
    """
    begin = time.perf_counter()
    A, b, T = ensemble.scaled_form
    target = ensemble.to_vector(start) / ensemble.force_scale
    solver = _solver(max_iterations)
    solver.setup(
        sparse.csc_matrix(T.T @ T),
        -(T.T @ target),
        A,
        b,
        x_l=np.zeros(A.shape[1]),
    )
    status = solver.solve()
    # The interior-point iterate may be negative by its tolerance: y ≥ 0 is set exactly, so that
    # only the residual has to be judged.
    y = np.maximum(solver.result.x, 0.0)
    forces = ensemble.to_forces(T @ y * ensemble.force_scale)
    residual = ensemble.residual(forces)
    return Relaxation(
        forces,
        int(solver.result.info.iter),
        residual,
        ensemble.violation(forces),
        bool(status == piqp.PIQP_SOLVED and residual <= tolerance),
        time.perf_counter() - begin,
    )


def starting_network(ensemble):
    """The packing's own network (N_c, 2), or the nearest admissible one if that left S.

    Raises NotJammedError where S is empty.
    """
    if ensemble.admits(ensemble.original):
        return ensemble.original
    found = nearest(ensemble, ensemble.original)
    if not found.converged:
        raise NotJammedError(
            f"no admissible network found to start from (residual {found.residual:.1e} ⟨f_n⟩)"
        )
    return found.forces


def least_unbalanced(A, b):
    """y ≥ 0 with the least |A y − b|², and that residual vector, shapes (n,) and (m,)."""
    rows, columns = A.shape
    solver = _solver(200)
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


def _solver(max_iterations):
    solver = piqp.SparseSolver()
    solver.settings.verbose = False
    solver.settings.max_iter = max_iterations
    solver.settings.eps_abs = 1e-12
    solver.settings.eps_rel = 1e-13
    # At small μ, far starts and dependent rows the regularised systems alone, or those with the
    # default's regularisation, end short of their target.
    solver.settings.reg_lower_limit = 1e-14
    solver.settings.iterative_refinement_always_enabled = True
    return solver
