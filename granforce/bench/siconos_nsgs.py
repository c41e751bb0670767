"""Siconos's 2-D nonsmooth Gauss–Seidel on a problem in a file, for a Python with Siconos.

python siconos_nsgs.py PROBLEM.npz RESULT.npz TOLERANCE; the problem is u = W r + q with W in csc
form, its friction coefficient and first guess r.
"""

import sys
import time

import numpy as np
import siconos.numerics as sn
from scipy import sparse


def main(problem: str, result: str, tolerance: str) -> None:
    with np.load(problem) as given:
        W = sparse.csc_matrix((given["data"], given["indices"], given["indptr"]))
        r, mu = given["start"].copy(), np.full(W.shape[0] // 2, float(given["mu"]))
    stated = sn.FrictionContactProblem(2, W, np.zeros(W.shape[0]), mu)
    # Its 2-D solver takes dense or block matrices; blocks are faster.
    stated.M.matrix1, stated.M.storageType = sn.SBM_from_csparse(2, W)[1], sn.NM_SPARSE_BLOCK
    options = sn.SolverOptions(sn.SICONOS_FRICTION_2D_NSGS)
    options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = 100_000
    options.dparam[sn.SICONOS_DPARAM_TOL] = float(tolerance)
    u = W @ r
    begin = time.perf_counter()
    sn.fc2d_driver(stated, r, u, options)
    seconds = time.perf_counter() - begin
    sweeps = options.iparam[sn.SICONOS_IPARAM_ITER_DONE]
    np.savez(result, forces=r.reshape(-1, 2), sweeps=sweeps, seconds=seconds)


if __name__ == "__main__":
    main(*sys.argv[1:])
