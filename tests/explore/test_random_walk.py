"""The random walk: states in S, seeds, chains, and honest counts."""

import numpy as np
import pytest
from packings import packed, two_disks

from granforce import measures
from granforce.explore.random_walk import WORTH_LANES, judge, walk
from granforce.forces.build import ensemble
from granforce.forces.nearest import nearest, starting_network
from granforce.forces.nearest_piqp import nearest_piqp
from granforce.motion.gauss_seidel import gauss_seidel
from granforce.records import Cancelled, InputError, NotJammedError, Relaxation


@pytest.fixture(scope="module")
def S():
    return ensemble(packed(40, 0.3))


def test_every_state_is_in_s(S):
    done = walk(S, 20, 3)
    assert done.states.shape == (20, len(S.index), 2)
    assert done.residual.max() < 1e-10
    assert done.residual == pytest.approx(S.residual(done.states))
    assert S.violation(done.states).max() < 1e-9
    assert done.counts["accepted"] == 20
    assert done.attempts.sum() <= sum(done.counts.values())
    assert np.all(done.sweeps > 0)


def test_a_walk_that_ended_when_it_was_enough_goes_on_as_if_it_had_not(S):
    whole = walk(S, 12, 3, relax=nearest)
    asked = iter(range(12))
    part = walk(S, 12, 3, relax=nearest, enough=lambda: next(asked) == 4)
    assert len(part.states) == 5 and part.counts["accepted"] == 5
    seen = []
    gone_on = walk(S, 12, 3, relax=nearest, begun=part, watch=lambda found: seen.append(found))
    assert [found.number for found in seen] == list(range(12))
    assert gone_on.counts == whole.counts
    for name in ("states", "residual", "violation", "sweeps", "attempts"):
        np.testing.assert_array_equal(getattr(gone_on, name), getattr(whole, name))
    with pytest.raises(InputError, match="require a single chain"):
        walk(S, 12, 3, chains=2, begun=part)
    with pytest.raises(InputError, match="more states"):
        walk(S, 3, 3, begun=part)


def test_the_walk_moves(S):
    done = walk(S, 10, 3)
    moved = np.linalg.norm(np.diff(done.states, axis=0), axis=(1, 2))
    assert np.all(moved > 1e-3 * S.force_scale)


@pytest.mark.parametrize("relax", [gauss_seidel, nearest_piqp, nearest])
def test_same_seed_same_states_for_any_number_of_workers(S, relax):
    options = {"relax": relax}
    one = walk(S, 9, 5, chains=3, workers=1, **options)
    two = walk(S, 9, 5, chains=3, workers=3, **options)
    other = walk(S, 9, 6, chains=3, workers=1, **options)
    assert np.array_equal(one.states, two.states)
    assert not np.array_equal(one.states, other.states)


@pytest.mark.parametrize("relax", [gauss_seidel, nearest])
def test_chains_in_lanes_are_those_that_go_alone(S, relax):
    """The same states, bit for bit, whether they step in lanes or one after the other."""
    options = {"rest": None, "tolerance": 1e-3} if relax is gauss_seidel else {}
    lanes = walk(S, 21, 5, chains=5, relax=relax, **options)
    assert WORTH_LANES <= 5  # on one thread; on five each has one
    alone = walk(S, 21, 5, chains=5, workers=5, relax=relax, **options)
    assert np.array_equal(lanes.states, alone.states)
    assert np.array_equal(lanes.sweeps, alone.sweeps)
    assert lanes.counts == alone.counts


def test_a_walk_that_is_watched_is_the_same_and_seen_whole(S):
    seen = []
    alone, watched = walk(S, 9, 5, chains=3), walk(S, 9, 5, chains=3, workers=3, watch=seen.append)
    assert np.array_equal(alone.states, watched.states)
    seen.sort(key=lambda found: (found.chain, found.number))
    assert [(found.chain, found.number) for found in seen] == [(k // 3, k % 3) for k in range(9)]
    assert np.array_equal([found.forces for found in seen], alone.states)
    assert np.array_equal([found.residual for found in seen], alone.residual)
    assert np.array_equal([found.attempts for found in seen], alone.attempts)


def test_chains_are_independent_walks(S):
    three = walk(S, 9, 5, chains=3).states.reshape(3, 3, -1)
    assert not np.allclose(three[0], three[1])


def test_a_single_point_needs_no_relaxation():
    for packing in (packed(40, 0.0), two_disks()):
        point = ensemble(packing)
        done = walk(point, 5, 0)
        assert done.counts == {"accepted": 0, "rejected": 0, "unconverged": 0, "skipped": 5}
        assert np.ptp(done.states, axis=0).max() == 0
        assert done.residual.max() < 1e-10
        # What was skipped would have led to the same point.
        again = walk(point, 1, 0, relax=nearest_piqp, skip=False)
        assert again.counts["accepted"] == 1
        assert np.abs(again.states - done.states).max() < 1e-7 * point.force_scale


def test_rejection_and_lack_of_convergence_are_told_apart():
    def reached(residual, violation, converged):
        return judge(Relaxation(None, 1, residual, violation, converged, 0.0))

    assert reached(1e-12, 0.0, True) == "accepted"
    assert reached(1e-2, 0.0, True) == "rejected"
    assert reached(1e-12, 1e-2, True) == "rejected"
    assert reached(1e-2, 0.0, False) == "unconverged"
    assert reached(np.nan, 0.0, False) == "unconverged"


def test_a_walk_that_gets_nowhere_says_so(S):
    with pytest.raises(NotJammedError, match="only 0 of 4 states after 6 attempts"):
        walk(S, 4, 0, max_attempts=6, max_iterations=2)


def test_a_walk_may_end_with_the_states_it_has(S):
    """Sweeps that end at 10⁻³ reach most attempts; after so many the walk ends, the same states."""
    options = {"relax": gauss_seidel, "rest": None, "tolerance": 1e-3}
    all_ten = walk(S, 10, 0, **options)
    some = walk(S, 10, 0, max_attempts=4, whole=False, **options)
    count = some.counts["accepted"]
    assert 0 < count < 10
    assert sum(some.counts.values()) == 4
    assert np.array_equal(some.states, all_ten.states[:count])
    assert some.residual.max() <= 1e-3
    assert some.residual.max() > 1e-6  # nothing but sweeps: no exact finish
    none = walk(S, 4, 0, max_attempts=6, whole=False, max_iterations=2)
    assert none.states.shape == (0, len(S.index), 2)
    assert none.acceptance == 0


def test_a_rejected_attempt_stays_where_it_was(S):
    starts = []

    def relax(S, start):
        starts.append(start)
        return nearest(S, start)._replace(converged=len(starts) > 1)

    done = walk(S, 1, 0, relax=relax)
    assert (done.counts["unconverged"], done.counts["accepted"]) == (1, 1)
    own = starting_network(S)
    for start in starts:
        assert np.abs(start - own).max() <= own[:, 0].mean()
    assert not np.array_equal(*starts)
    assert not np.array_equal(done.states[0], own)


def test_a_walk_can_be_cancelled(S):
    seen = []
    with pytest.raises(Cancelled):
        walk(S, 50, 0, progress=lambda *a: seen.append(a), cancel=lambda: len(seen) >= 3)
    assert seen == [(1, 50), (2, 50), (3, 50)]


def test_an_original_outside_the_cones_is_replaced_by_the_nearest():
    S = ensemble(packed(60, 0.3), mu=0.28)
    assert not S.admits(S.original)
    assert S.admits(starting_network(S))
    assert walk(S, 2, 0).violation.max() < 1e-9


@pytest.mark.parametrize("sizes", [{"states": 0}, {"states": 2, "chains": 3}])
def test_sizes_below_one_are_refused(S, sizes):
    with pytest.raises(InputError):
        walk(S, seed=0, **sizes)


def test_sweeps_at_a_single_point_end_beside_it():
    """Without the skip states are relaxed: as far from the one network as the residual allows."""
    S = ensemble(packed(30, 0.0))
    assert S.dimension == 0
    skipped = walk(S, 8, 0)
    assert skipped.counts["skipped"] == 8
    options = {"relax": gauss_seidel, "rest": None, "tolerance": 1e-3, "skip": False}
    swept = walk(S, 8, 0, **options)
    assert (swept.counts["skipped"], swept.counts["accepted"]) == (0, 8)
    assert swept.residual.max() <= 1e-3
    assert measures.eta2(swept.states) > 1e-5
    exact = walk(S, 8, 0, skip=False)
    assert exact.counts["accepted"] == 8
    np.testing.assert_allclose(exact.states, skipped.states, atol=1e-9 * S.force_scale)
