"""Error bars by measuring again: coverage of networks that dynamics made."""

import numpy as np
import pytest
from packings import packed

from granforce.experiment.infer import infer
from granforce.experiment.remeasured import remeasured
from granforce.forces.build import ensemble
from granforce.forces.likeliest import fitted, fitted_many
from granforce.records import InputError


def measured(S, sigma, missing, rng):
    m = S.original + sigma * S.force_scale * rng.standard_normal(S.original.shape)
    m[rng.random(len(m)) < missing] = np.nan
    return m


@pytest.mark.parametrize("sigma, missing", [(0.1, 0.0), (0.3, 0.0), (0.2, 0.2)])
def test_two_thirds_of_a_packings_own_forces_lie_within_one_error(sigma, missing):
    """Its own network was made by dynamics: a flat prior covers 40 to 55 % here."""
    rng, covered, flat = np.random.default_rng(3), [], []
    for seed in range(1, 4):
        S = ensemble(packed(60, 0.1, seed))
        m = measured(S, sigma, missing, rng)
        for found, into in (
            (remeasured(S, m, sigma * S.force_scale, states=80, seed=seed), covered),
            (infer(S, m, sigma * S.force_scale, states=80, seed=seed), flat),
        ):
            off = np.abs(S.original - found.mean) / np.maximum(found.error, 1e-9 * S.force_scale)
            into.append(np.mean(off < 1))
    # Forces of one packing hang together: three packings leave 5 % of scatter.
    assert 0.55 < np.mean(covered) < 0.81
    assert np.mean(flat) < np.mean(covered)


def test_draws_are_admissible_and_the_same_for_any_number_of_workers():
    S = ensemble(packed(60, 0.3))
    m = measured(S, 0.2, 0.1, np.random.default_rng(0))
    one, two = (remeasured(S, m, 0.2 * S.force_scale, states=20, workers=w) for w in (1, 2))
    assert np.array_equal(one.draws.states, two.draws.states) and one.draws.reached
    assert one.draws.states.shape[:2] == (4, 5)
    assert S.residual(one.draws.flat).max() < 1e-9 and S.violation(one.draws.flat).max() < 1e-9
    other = remeasured(S, m, 0.2 * S.force_scale, states=20, seed=1)
    assert not np.array_equal(one.draws.states, other.draws.states)
    assert np.array_equal(one.forces, other.forces) and np.array_equal(one.mean, one.forces)


def test_lanes_tell_the_same_as_alone():
    S = ensemble(packed(60, 0.1))
    many = S.original + 0.3 * S.force_scale * np.random.default_rng(1).standard_normal(
        (5, *S.original.shape)
    )
    s = np.full(S.original.shape, 0.3 * S.force_scale)
    together = fitted_many(S, many, s)
    for one, alone in zip(together, many, strict=True):
        assert np.array_equal(one, fitted(S, alone, s))


def test_what_is_wrong_is_told():
    S = ensemble(packed(20, 0.3))
    for options in ({"states": 0}, {"unmeasured": 0.0}, {"chains": 0}):
        with pytest.raises(InputError):
            remeasured(S, S.original, 0.1, **options)
