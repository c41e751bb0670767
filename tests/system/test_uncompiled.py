"""Without the compiler (NUMBA_DISABLE_JIT) everything runs slowly, with the same results."""

import io
import os
import subprocess
import sys

import numpy as np
import pytest

import granforce as gf


def results(box):
    """Arrays of a small packing and of what is computed of its S, in one lane and in eight."""
    mu, seed = (0.5, 4) if box == "isotropic" else (0.3, 2)
    packing = gf.pack(6, mu, seed, accuracy=0.1, box=box)
    S = gf.ensemble(packing)
    starts = S.original * np.linspace(0.8, 1.2, 4)[:, None, None]
    found = {
        "x": packing.x,
        "forces": packing.forces,
        "nearest": gf.nearest(S, starts[0]).forces,
        "many": np.stack([one.forces for one in gf.nearest_of_many(S, starts)]),
        "swept": gf.gauss_seidel(S, starts[0]).forces,
    }
    if box == "square":
        return found
    return found | {
        "limits": gf.limit_loads(S, S.index[:4]),
        "drawn": gf.sample_uniform(S, 2, chains=2).states,
        "critical": np.array([one.low for one in gf.critical_forces(S, S.index[:2])]),
        "response": gf.response(S, S.index[0]).displacement,
    }


def check(box):
    script = "import sys, numpy as np; sys.path[:0] = sys.argv[1:2]\n"
    script += "from test_uncompiled import results\n"
    script += "np.savez(sys.stdout.buffer, **results(sys.argv[2]))"
    found = subprocess.run(
        [sys.executable, "-W", "error", "-c", script, os.path.dirname(__file__), box],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        check=False,
    )
    assert found.returncode == 0, found.stderr.decode()
    with np.load(io.BytesIO(found.stdout)) as arrays:
        for name, values in results(box).items():
            assert np.allclose(arrays[name], values, rtol=1e-12, atol=1e-12, equal_nan=True), name


def test_the_same_without_the_compiler():
    check("square")


@pytest.mark.stress
def test_the_same_without_the_compiler_in_a_box_of_any_shape():
    check("isotropic")
