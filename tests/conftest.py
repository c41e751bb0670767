"""Fixtures of all tests, and the examples that properties are tried on."""

import os
import subprocess
import sys

# Several workers share the cores: BLAS threads of each would wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest
from hypothesis import settings

from granforce.system.compiled import are_cached

# The same examples in every run, as all other random numbers here, however long a busy machine
# takes; HYPOTHESIS_PROFILE=default looks for new ones.
settings.register_profile("same", derandomize=True, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))

# What makes and pushes packings, and all else: each takes half of the time to compile.
KERNELS = (
    "import granforce as gf\nwarm_up({kinds.PERTURBATION})\ngf.pack(1001, 0.1, 2)",
    "import granforce as gf\n"
    "warm_up(set(kinds.KINDS.values()) - {kinds.PERTURBATION}, reference('n100_mu0.1_s11'))\n"
    "round = gf.pack(12, 0.3, box='isotropic')\n"
    "gf.walk(gf.ensemble(round), 2, relax='gauss_seidel_only')",
)


def pytest_configure(config):
    """Kernels are compiled once, before several workers would compile all of them each."""
    is_worker, count = hasattr(config, "workerinput"), config.getoption("numprocesses", 0)
    if is_worker or not count or config.option.collectonly or are_cached("flow.until_one_ends"):
        return
    begin = "from packings import reference\nfrom granforce.study.scan import kinds, warm_up\n"
    paths = os.pathsep.join(str(config.rootpath / folder) for folder in (".", "tests/shared"))
    both = [
        subprocess.Popen(
            [sys.executable, "-c", begin + half], env=os.environ | {"PYTHONPATH": paths}
        )
        for half in KERNELS
    ]
    for process in both:
        process.wait()


@pytest.fixture
def rng():
    return np.random.default_rng(20090501)


@pytest.fixture
def away(tmp_path, monkeypatch):
    """The folder of a test, which works in there, with a store of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GRANFORCE_CACHE", str(tmp_path / "cache"))
    return tmp_path


@pytest.fixture
def nobody():
    """Rights of an ordinary user, for whom mode bits hold, also where the tests run as root."""
    if os.geteuid() != 0:
        yield
        return
    try:
        os.seteuid(65534)
    except OSError:
        pytest.skip("cannot give up root's rights here")
    yield
    os.seteuid(0)
