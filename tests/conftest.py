"""Fixtures of all tests, and the examples that properties are tried on."""

import os

import numpy as np
import pytest
from hypothesis import settings

# The same examples in every run, as all other random numbers here; HYPOTHESIS_PROFILE=default
# looks for new ones.
settings.register_profile("same", derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))


@pytest.fixture
def rng():
    return np.random.default_rng(20090501)


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
