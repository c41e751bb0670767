"""The admissible network nearest to given forces by PIQP: an independent witness of `nearest`."""

import time

import numpy as np
import piqp
from scipy import sparse

from granforce.numerics import highs as programs
from granforce.records import Relaxation
from granforce.tolerances import BALANCED


def nearest_piqp(ensemble, start, *, tolerance=BALANCED, max_iterations=200):
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
    solver = programs.quadratic_solver(max_iterations)
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
