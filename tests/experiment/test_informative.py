"""Which measurement next, and which contacts certainly carry force."""

from pathlib import Path

import numpy as np
import pytest
from packings import packed, reference, two_disks

from granforce.experiment.carrying import carrying
from granforce.experiment.informative import informative
from granforce.explore.intervals import intervals
from granforce.explore.uniform import sample_uniform
from granforce.forces.build import ensemble
from granforce.forces.knowledge import Known
from granforce.packing.importers import load_packing
from granforce.records import Cancelled, InputError
from granforce.tolerances import INTERVAL_GAP

# Contacts that leave the others of that packing one direction.
FROZEN = [
    *(2, 7, 9, 10, 12, 13, 14, 15, 17, 18, 23, 24, 25, 26),
    *(27, 28, 32, 33, 37, 38, 44, 46, 47, 48, 49, 50, 51, 55),
]


@pytest.fixture(scope="module")
def S():
    return ensemble(packed(40, 0.3, 2))


def extent(body):
    found = intervals(body)
    return np.mean(found.high[:, 0] - found.low[:, 0]) / body.force_scale


def test_the_best_measurement_shortens_the_exact_intervals_most(S):
    """Against each contact held at its mean in turn: what is proposed is among the best tenth."""
    found = informative(S, 5, check=5)
    assert len(found.contacts) == 5 and np.all(np.diff(found.after) >= 0)
    assert found.before == pytest.approx(extent(S)) and found.after[0] < found.before
    mean = sample_uniform(S, 400, seed=1).flat.mean(axis=0)[:, 0]
    after = []
    for c, value in zip(S.index[::3], mean[::3], strict=True):
        low, high = [[value, -np.inf]], [[value, np.inf]]
        after.append(extent(ensemble(S.packing, known=Known([c], low, high))))
    assert np.mean(np.array(after) < found.after[0]) < 0.1


def test_the_interval_of_the_measured_contact_counts(S):
    """It vanishes: the gain is at least its own part of the sum."""
    found, now = informative(S, 5, check=5), intervals(S)
    own = (now.high - now.low)[S.positions(found.contacts), 0]
    assert np.all(found.reduction >= own / (now.high - now.low)[:, 0].sum() - 1e-9)


def test_a_shorter_list_is_the_head_of_a_longer_one(S):
    """Candidates are compared by exact bounds before the list is cut."""
    told = []
    longer = informative(S, 10, progress=lambda done, total: told.append(done / total))
    assert np.array_equal(informative(S, 2).contacts, longer.contacts[:2])
    assert told == sorted(told) and told[-1] == 1 and len(told) > 11
    assert len(informative(S, 10, check=3).contacts) == 10


def test_expectation_alone_takes_no_program(S):
    found = informative(S, 8, check=0)
    assert np.isnan(found.before) and np.isnan(found.after).all()
    assert np.all(np.diff(found.expected) <= 0)
    assert np.all((0 < found.expected) & (found.expected < 1))
    twice = informative(S, 8, check=0, workers=2)
    assert np.array_equal(twice.contacts, found.contacts)


def test_of_contacts_that_determine_each_other_one_is_listed():
    """A disk with two contacts passes its force on: both have the same normal force."""
    S = ensemble(packed(30, 0.3))
    passing = [np.flatnonzero((S.contacts.i == g) | (S.contacts.j == g)) for g in S.grains]
    pairs = [set(S.index[c].tolist()) for c in passing if len(c) == 2]
    found = informative(S, len(S.index), check=0)
    groups = [{int(c), *others} for c, others in zip(found.contacts, found.twins, strict=True)]
    assert pairs and all(any(pair <= group for group in groups) for pair in pairs)
    assert sum(map(len, groups)) == len(set().union(*groups)) <= len(S.index)
    normal = sample_uniform(S, 40, seed=5).flat[..., 0]
    for group in groups:
        one, *others = S.positions(np.array(sorted(group)))
        for other in others:
            assert abs(np.corrcoef(normal[:, one], normal[:, other])[0, 1]) > 1 - 1e-8


def test_nothing_is_left_to_measure_where_all_is_determined():
    with pytest.raises(InputError, match="nothing to measure"):
        informative(ensemble(two_disks()))


def test_states_that_keep_an_unbalance_empty_nothing():
    """S is 10⁻⁸ ⟨f_n⟩ wide there, and f_n held at a mean that is off by more lies beside it."""
    packing = load_packing(Path(__file__).parents[1] / "attacks" / "n30_mu2e-6.npz")
    K = ensemble(packing, frozen=FROZEN)
    sample = sample_uniform(K, 40)
    off = 1 + 1e-6 * np.random.default_rng(0).normal(size=sample.states.shape[2:])
    found = informative(K, 1, check=1, sample=sample._replace(states=sample.states * off))
    assert K.dimension == 1 and 0 < found.before < 1e-6
    assert 0 <= found.after[0] < found.before + INTERVAL_GAP


def test_bad_questions_are_told(S):
    for options in ({"k": 0}, {"check": -1}, {"states": 0}):
        with pytest.raises(InputError):
            informative(S, **options)
    with pytest.raises(Cancelled):
        informative(S, cancel=lambda: True)


def test_a_sample_cut_short_is_not_ranked(S, monkeypatch):
    drawn = []

    def sample_of(*arguments, **options):
        drawn.append(sample_uniform(*arguments, **options))
        return drawn[0]

    monkeypatch.setattr("granforce.experiment.informative.sample_uniform", sample_of)
    with pytest.raises(Cancelled):
        informative(S, check=0, states=20, cancel=lambda: bool(drawn))


def test_what_carries_for_certain_is_what_exact_bounds_say():
    """Of contacts not measured: the lower bound over all networks within 3 σ of the others."""
    S = ensemble(reference("n100_mu0.1_s11"))
    m, sigma = S.original.copy(), np.array([0.2, 0.1]) * S.force_scale
    m[::5] = np.nan
    found = carrying(S, m, sigma)
    assert found.contacts.tolist() == S.index[::5].tolist() and found.widened == 0
    seen = ~np.isnan(m)
    low, high = np.full((2, *m.shape), np.nan)
    low[:], high[:] = -np.inf, np.inf
    low[seen], high[seen] = (m - 3 * sigma)[seen], (m + 3 * sigma)[seen]
    exact = intervals(ensemble(S.packing, known=Known(S.index, low, high)), found.contacts)
    assert np.abs(found.least - exact.low[:, 0]).max() < 1e-6 * S.force_scale
    assert np.array_equal(found.carries, found.least > 1e-7 * S.force_scale)
    assert 0 < found.carries.sum() < len(found.carries)
    assert np.all(found.least <= S.original[::5, 0] + 1e-9)


def test_bounds_give_way_where_no_network_agrees():
    S = ensemble(reference("n100_mu0.1_s11"))
    m, sigma = S.original.copy(), 0.05 * S.force_scale
    m[40, 0] += 3 * S.force_scale
    m[1] = np.nan
    found = carrying(S, m, sigma)
    assert found.widened > 0 and np.isfinite(found.least).all()
