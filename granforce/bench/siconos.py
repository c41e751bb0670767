"""granforce's Gauss–Seidel sweep against that of Siconos, sweep by sweep on one problem."""

import functools
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from granforce.bench.runner import note
from granforce.forces.ensemble import Ensemble
from granforce.motion.contact_dynamics import add_forces, set_stiffness, sweep
from granforce.motion.gauss_seidel import from_rest
from granforce.numerics.lanes import ONE
from granforce.types import Floats

# Environment variable naming a Python that can import Siconos, which is not on PyPI.
INTERPRETER = "GRANFORCE_SICONOS_PYTHON"
PROGRAM = Path(__file__).with_name("siconos_nsgs.py")
ABSENT = f"absent (Debian: python3-siconos, python3-scipy; or name a Python in ${INTERPRETER})"
# Siconos's own error at which it stops.
TOLERANCES = (1e-4, 1e-6)
REPEATS = 3


@functools.cache
def interpreter() -> str | None:
    """The first Python that can import Siconos, or None."""
    for python in (os.environ.get(INTERPRETER), sys.executable, "/usr/bin/python3"):
        if python and _imports(python):
            return python
    return None


def _imports(python: str) -> bool:
    test = [python, "-I", "-c", "import siconos.numerics, scipy.sparse"]
    try:
        return subprocess.run(test, capture_output=True, timeout=60).returncode == 0
    except (OSError, subprocess.TimeoutExpired):
        return False


def against_siconos(S: Ensemble, start: Floats, tolerance: float) -> dict[str, Any] | None:
    """Time per contact update of both on a box of fixed size, and the difference of their forces.

    Siconos sweeps from the given forces until its error is below the tolerance; granforce then does
    as many sweeps. Medians over REPEATS. None without Siconos.
    """
    python = interpreter()
    if python is None:
        return None
    note(f"Siconos to {tolerance:g}")
    start = start / S.force_scale
    siconos_runs = [_siconos(python, S, start, tolerance) for _ in range(REPEATS)]
    sweeps = int(siconos_runs[0]["sweeps"])
    runs = [_ours(S, start, sweeps) for _ in range(REPEATS)]
    updates = sweeps * len(S.index)
    seconds = [float(np.median([float(one["seconds"]) for one in siconos_runs]))]
    seconds.append(float(np.median([one[1] for one in runs])))
    return {
        "sweeps": sweeps,
        "siconos_ns": 1e9 * seconds[0] / updates,
        "ns": 1e9 * seconds[1] / updates,
        "ratio": seconds[0] / seconds[1],
        "difference": float(np.abs(siconos_runs[0]["forces"] - runs[0][0]).max()),
    }


def _siconos(python: str, S: Ensemble, start: Floats, tolerance: float) -> dict[str, Any]:
    r = S.packing.r[S.grains]
    mass = np.pi * r**2
    # Rows of A are forces and torque/r of a grain: the change of velocity per unit time.
    inverse = np.column_stack([1 / mass, 1 / mass, 2 / mass]).ravel()
    H = S.A[: len(inverse)]
    W = sparse.csc_matrix(H.T @ sparse.diags(inverse) @ H)
    with tempfile.TemporaryDirectory() as folder:
        problem, result = Path(folder) / "problem.npz", Path(folder) / "result.npz"
        indices, indptr = W.indices.astype(np.int64), W.indptr.astype(np.int64)
        arrays = {"data": W.data, "indices": indices, "indptr": indptr, "start": start.ravel()}
        np.savez(problem, mu=S.mu, **arrays)
        # Isolated: this folder must not shadow the modules that the program imports.
        command = [python, "-I", str(PROGRAM), str(problem), str(result), str(tolerance)]
        subprocess.run(command, check=True, capture_output=True)
        with np.load(result) as stored:
            return dict(stored)


def _ours(S: Ensemble, start: Floats, sweeps: int) -> tuple[Floats, float]:
    problem, velocity, _, _ = from_rest(S)
    problem = problem._replace(box_compliance=0.0)
    velocity[:] = 0.0
    force = start.copy()
    order = np.arange(len(force))
    begin = time.perf_counter()
    set_stiffness(problem)
    add_forces(problem, force, velocity, 0.0)
    for _ in range(sweeps):
        sweep(problem, order, S.mu, force, velocity, 0.0, ONE)
    return force, time.perf_counter() - begin
