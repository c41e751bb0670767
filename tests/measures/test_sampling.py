"""Sampling: errors of η against the scatter over many chains, effective size against theory."""

import numpy as np
import pytest

from granforce import measures


def chain(rng, states, memory, contacts=30):
    """Forces (S, N_c, 2) around fixed means that remember each state before by this part."""
    x = rng.standard_normal((states, contacts, 2))
    for k in range(1, states):
        x[k] = memory * x[k - 1] + np.sqrt(1 - memory**2) * x[k]
    return np.linspace(1, 3, contacts)[:, None] * (1 + 0.1 * x)


@pytest.mark.parametrize("memory", [0.0, 0.6])
def test_errors_are_the_scatter_of_eta_over_chains(memory):
    rng = np.random.default_rng(1)
    chains = [chain(rng, 200, memory) for _ in range(60)]
    found = [measures.sampling(states) for states in chains]
    for name, eta in (("eta1_error", measures.eta1), ("eta2_error", measures.eta2)):
        scatter = np.std([eta(states) for states in chains], ddof=1)
        error = np.sqrt(np.mean([getattr(one, name) ** 2 for one in found]))
        assert 0.7 * scatter < error < 1.4 * scatter


def test_effective_size_is_that_of_an_autoregressive_chain():
    rng = np.random.default_rng(2)
    for memory in (0.0, 0.5, 0.8):
        found = measures.sampling(chain(rng, 2000, memory))
        assert found.effective == pytest.approx(2000 * (1 - memory) / (1 + memory), rel=0.15)
        assert found.mixed and found.r_hat == pytest.approx(1, abs=0.02)


def test_independent_states_are_mixed_even_if_they_are_few():
    rng = np.random.default_rng(3)
    assert all(measures.sampling(chain(rng, 50, 0.0)).mixed for _ in range(20))


def test_a_chain_of_two_populations_or_under_way_has_not_mixed():
    rng = np.random.default_rng(4)
    jumped = chain(rng, 100, 0.0)
    jumped[50:] += 0.5
    drifting = np.cumsum(rng.standard_normal((100, 30, 2)), axis=0) + 100
    for states in (jumped, drifting):
        found = measures.sampling(states)
        assert found.r_hat > 1.1 and not found.mixed


def test_too_few_states_or_a_single_point_have_no_error():
    few = measures.sampling(chain(np.random.default_rng(5), 19, 0.0))
    assert few.states == 19 and np.isnan(few[:4]).all() and not few.mixed
    point = measures.sampling(np.ones((40, 3, 2)))
    assert point.eta1_error == 0 and np.isnan(point.r_hat) and not point.mixed
