"""Diagnostics of chains: the same numbers as ArviZ's, which takes one component after the other."""

import numpy as np
import pytest
from arviz_stats.base import array_stats

from granforce.explore.mixing import mixing


def chains(draws, seed=0):
    """(4, draws, 60): from antithetic to nearly stuck, with ties, atoms and chains apart."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((4, draws, 60))
    memory = np.linspace(-0.9, 0.99, 60)
    for k in range(1, draws):
        x[:, k] += memory * x[:, k - 1]
    x[..., 10:20] = np.round(x[..., 10:20])
    x[..., 20:30] = np.maximum(x[..., 20:30], 0.0)
    x[1, :, 30:35] += 3.0
    x[2, :, 35] = x[2, 0, 35]
    x[:, :, 36] = np.arange(4)[:, None]  # each chain stands still
    x[..., 37] = 0.0
    x[3, -1, 37] = 1.0
    return x


@pytest.mark.parametrize("draws", [4, 5, 6, 7, 8, 9, 12, 25, 100, 251])
def test_diagnostics_are_those_of_arviz(draws):
    x = chains(draws)
    moving = ~np.all(x == x[:, :1], axis=(0, 1))
    found, axes = mixing(x, np.ones(60, dtype=bool)), {"chain_axis": 0, "draw_axis": 1}
    with np.errstate(all="ignore"):
        wanted = [
            array_stats.rhat(x, **axes),
            array_stats.ess(x, method="bulk", **axes),
            array_stats.ess(x, method="tail", prob=(0.05, 0.95), **axes),
        ]
    for ours, theirs in zip(found, wanted, strict=True):
        assert np.allclose(ours[moving], theirs[moving], rtol=1e-10, atol=0, equal_nan=True)
    assert np.all(found.r_hat[~moving] == np.inf) and np.all(found.bulk[~moving] == 0)
