"""Sparse quadratic programs by PIQP: least ½ xᵀP x + c·x with A x = b, G x ≥ h and x ≥ lower."""

import numpy as np
import piqp
from scipy import sparse

from granforce.records import Floats

# Variables from which a program takes so long that it is solved where it can be ended.
LONG = 2000


def solution(
    P: sparse.csc_matrix,
    c: Floats,
    A: sparse.csr_matrix,
    b: Floats,
    G: sparse.csc_matrix,
    h: Floats,
    lower: Floats,
) -> Floats:
    """x (n,), found to 10⁻¹⁴ where that can be; the last iterate where it cannot."""
    solver = piqp.SparseSolver()
    solver.settings.eps_abs = solver.settings.eps_rel = 1e-14
    solver.setup(P, c, A, b, G, h, np.full(len(h), np.inf), lower)
    solver.solve()
    return np.array(solver.result.x)
