"""Uniform sampling: known bodies decide, since no diagnostic can see a wrong target.

Thresholds: |z| of k independent normals exceeds 5 with probability 6e-7 k, and √n D exceeds 2.3
with probability 5e-5 k, so a right sampler fails here with a new seed about once in a hundred.
"""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from bodies import (
    BodyWalls,
    box,
    cross_polytope,
    distance_to_marginals,
    known_by_triangulation,
    product,
    simplex,
    z_scores,
)
from packings import REFERENCE, lattice, packed, reference, two_disks
from scipy import linalg, sparse

from granforce import bench, measures
from granforce.cli.entry_point import main
from granforce.explore import billiard, uniform
from granforce.explore.mixing import mixing
from granforce.explore.random_walk import walk
from granforce.explore.uniform import LARGE, sample_uniform
from granforce.explore.walls import walls
from granforce.forces.build import ensemble
from granforce.forces.knowledge import Known
from granforce.numerics.inner_point import inner_point
from granforce.numerics.wall_matrix import WallMatrix
from granforce.packing.importers import read_lammps
from granforce.records import Cancelled, InputError, NotJammedError
from granforce.study import cells as study
from granforce.study import kinds, samples
from granforce.study.kinds import slices
from granforce.study.store import open_store

LAMMPS = Path(__file__).parents[1] / "lammps"
DUMPS = sorted(LAMMPS.glob("lammps_n400_mu0.3.*.dump"), reverse=True)

BODIES = {
    "segment": lambda: box(1),
    "thin box": lambda: box(5, skew=True),
    "cube of 40": lambda: box(40, skew=True),
    "triangle": lambda: simplex(2),
    "simplex of 30": lambda: simplex(30, skew=True),
    "simplex of 100": lambda: simplex(100),
    "cross-polytope of 3": lambda: cross_polytope(3, skew=True),
    "cross-polytope of 7": lambda: cross_polytope(7),
    "product": lambda: product([1, 2, 5, 40], skew=True),
}


def drawn(body, states, chains=4, seed=0, method="billiard"):
    """Draws (chains, states, n) of y, by the same steps as sample_uniform."""
    made = BodyWalls(body)
    stores = uniform.stores_for(made, chains, 1)
    ends, reach, _ = uniform.warm_up(made, chains, seed, stores, method=method)
    _, slacks, _ = uniform.step(made, ends, *stores, count=states, reach=reach, method=method)
    return made, made.points(slacks)


@pytest.mark.parametrize("name", BODIES)
def test_known_bodies(name):
    body = BODIES[name]()
    made, y = drawn(body, 500)
    assert made.dimension == body.dimension
    assert np.abs(body.A @ y.reshape(-1, y.shape[2]).T - body.b[:, None]).max() < 1e-9
    means, squares = z_scores(y, body.mean, body.variance, body.kurtosis)
    assert np.abs(means).max() < 5 and np.abs(squares).max() < 5
    if body.marginal:
        assert distance_to_marginals(y, body.marginal).max() < 2.3


def test_the_harness_sees_a_wrong_target():
    body = simplex(20)
    rng = np.random.default_rng(0)
    for weight, right in ((1.0, True), (1.15, False)):
        y = rng.dirichlet(np.full(21, weight), (4, 500))
        means, squares = z_scores(y, body.mean, body.variance, body.kurtosis)
        assert np.abs(means).max() < 5
        assert (np.sqrt(np.mean(squares**2)) < 1.5) == right
        assert (distance_to_marginals(y, body.marginal).max() < 2.3) or not right


@pytest.mark.parametrize("name", ["thin box", "simplex of 30", "cross-polytope of 3"])
def test_the_second_witness_knows_the_bodies_too(name):
    body = BODIES[name]()
    _, y = drawn(body, 500, method="hit_and_run")
    means, squares = z_scores(y, body.mean, body.variance, body.kurtosis)
    assert np.abs(means).max() < 5 and np.abs(squares).max() < 5


@pytest.mark.slow
@pytest.mark.parametrize("body", [simplex(300, skew=True), box(300), product([150] * 2)])
def test_large_bodies(body):
    _, y = drawn(body, 2000)
    means, squares = z_scores(y, body.mean, body.variance, body.kurtosis)
    assert np.abs(means).max() < 5 and np.abs(squares).max() < 5
    assert 0.7 < np.sqrt(np.mean(means**2)) < 1.3
    assert distance_to_marginals(y, body.marginal).max() < 2.3


@pytest.fixture(scope="module")
def S():
    return ensemble(packed(40, 0.3))


@pytest.fixture(scope="module")
def sample(S):
    return sample_uniform(S, 400)


def test_every_state_is_in_s(S, sample):
    assert sample.states.shape == (4, 100, len(S.index), 2)
    assert sample.residual.max() < 1e-10 and sample.violation.max() < 1e-12
    assert np.array_equal(sample.residual, S.residual(sample.states))
    assert np.array_equal(sample.violation, S.violation(sample.states))
    assert sample.walls.dimension == S.dimension


@pytest.mark.slow
def test_more_than_two_thousand_dimensions():
    S = ensemble(packed(2500, 0.01))
    sample = sample_uniform(S, 400)
    assert sample.walls.dimension == S.dimension > LARGE
    assert sample.residual.max() < 1e-10 and sample.violation.max() < 1e-12
    assert sample.counts["refused"] == 0 and sample.mixing.worst_r_hat < 1.1
    # The short warm-up of large S is long enough: the energy does not drift afterwards.
    energy = np.sum(sample.states**2, axis=(2, 3))
    first, rest = energy[:, :10], energy[:, 10:]
    error = rest.std() * np.sqrt(3 / first.size)  # autocorrelation of about three states
    assert abs(first.mean() - rest.mean()) < 3 * error


def test_chains_mix(sample):
    assert sample.reached and sample.mixing.worst_r_hat < 1.05
    assert sample.effective > 100
    assert sample.counts["refused"] == 0 and sample.counts["held"] == 0
    assert np.array_equal(np.unique(sample.chain), np.arange(4))


def test_unbalance_of_the_packing_is_not_taken_for_lost_rows():
    assert isinstance(walls(ensemble(packed(60, 0.3))).matrix, WallMatrix)


def test_moments_are_those_of_a_triangulated_s():
    S = ensemble(packed(40, 1.0, 2))
    A, b, T = S.scaled_form
    made = walls(S)
    assert 2 <= made.dimension <= 6
    mean, covariance = known_by_triangulation(A, b, made.centre)
    sample = sample_uniform(S, 4000)
    x = S.to_vector(sample.states) / S.force_scale
    mean, variance = T @ mean, np.diagonal(T @ covariance @ T.T.toarray())
    moving = variance > 1e-12
    x, mean, variance = x[:, :, moving], mean[moving], variance[moving]
    kurtosis = ((x - mean) ** 4).mean(axis=(0, 1)) / variance**2
    for scores in z_scores(x, mean, variance, kurtosis):
        assert np.abs(scores).max() < 5


def test_two_methods_agree(S, sample):
    """Both witnesses see the same means and second moments of every component."""
    other = sample_uniform(S, 400, seed=1, method="hit_and_run")
    assert other.reached
    for power in (1, 2):
        one, two = (s.states**power / S.force_scale**power for s in (sample, other))
        error = sum(v.var(axis=(0, 1)) / m.mixing.bulk for v, m in ((one, sample), (two, other)))
        score = (one.mean(axis=(0, 1)) - two.mean(axis=(0, 1))) / np.sqrt(error)
        assert np.abs(score).max() < 5
        assert np.sqrt(np.mean(score**2)) < 1.5


@pytest.mark.parametrize("name", ["n100_mu0.1_s11", "n100_mu1_s12"])
def test_exact_intervals_contain_every_state(name):
    packing, bounds = reference(name), np.load(REFERENCE / f"{name}.npz")
    S = ensemble(packing)
    states = sample_uniform(S, 200).flat
    slack = 1e-6 * S.force_scale
    assert np.all(states >= bounds["lo"][S.index] - slack)
    assert np.all(states <= bounds["hi"][S.index] + slack)
    extent = np.ptp(states, axis=0) / np.maximum(bounds["hi"] - bounds["lo"], slack)[S.index]
    assert extent.mean() > 0.3


def test_same_seed_same_states_for_any_number_of_workers(S):
    one, two = (sample_uniform(S, 30, chains=3, seed=5, workers=w) for w in (1, 3))
    other = sample_uniform(S, 30, chains=3, seed=6)
    assert np.array_equal(one.states, two.states)
    assert not np.array_equal(one.states, other.states)
    assert not np.allclose(one.states[0], one.states[1])


def test_a_sample_has_its_walls_for_itself():
    one, two = (ensemble(packed(20, 0.3, 1)) for _ in range(2))
    for array in _arrays(sample_uniform(one, 4).walls):
        array[...] = 0
    found, wanted = sample_uniform(one, 4), sample_uniform(two, 4)
    np.testing.assert_array_equal(found.flat, wanted.flat)


def _arrays(part):
    """All arrays of nested tuples."""
    if isinstance(part, np.ndarray):
        yield part
    elif isinstance(part, tuple):
        for inner in part:
            yield from _arrays(inner)


def test_a_sample_goes_on_as_if_it_had_never_ended(S):
    whole = sample_uniform(S, 80, seed=3)
    part = sample_uniform(S, 52, seed=3)
    again = sample_uniform(S, 80, seed=3, previous=part)
    assert np.array_equal(again.states, whole.states)
    assert np.array_equal(again.residual, whole.residual)
    assert again.counts == whole.counts
    assert np.array_equal(sample_uniform(S, 80, seed=3, previous=part).states, whole.states)


def test_a_cancelled_sample_keeps_what_it_has(S):
    seen = []
    options = {"progress": lambda *a: seen.append(a), "cancel": lambda: len(seen) >= 2}
    part = sample_uniform(S, 400, **options)
    assert seen == [(80, 400), (160, 400)]
    assert part.states.shape[:2] == (4, 40) and not part.reached
    assert np.isnan(part.effective)  # not worth the time that was wanted back
    with pytest.raises(Cancelled):
        sample_uniform(S, 400, cancel=lambda: True)


def test_draws_go_on_until_the_wanted_effective_size(S):
    sample = sample_uniform(S, 100, effective=250)
    assert sample.reached and sample.effective >= 250
    assert 250 < len(sample.flat) < 1000


def test_what_is_not_reached_is_told(S, monkeypatch):
    monkeypatch.setattr(uniform, "MOST_STATES", 1)
    sample = sample_uniform(S, 40, effective=100)
    assert not sample.reached and sample.effective < 100
    assert len(sample.flat) == 100


def test_stuck_chains_are_recognised(S, sample):
    """Paths so long that they meet more walls than a path may."""
    begun = sample._replace(
        states=sample.states[:, :0],
        residual=sample.residual[:, :0],
        violation=sample.violation[:, :0],
        reach=1e9,
        ends=uniform.start_chains(sample.walls, 4, 0),
    )
    stuck = sample_uniform(S, 40, previous=begun)
    refused = stuck.counts["refused"] - sample.counts["refused"]
    assert refused > 0.9 * uniform.PATHS_PER_STATE * 40
    assert not stuck.reached and stuck.mixing.worst_r_hat > 2


def test_one_stuck_chain_or_component_is_recognised():
    rng = np.random.default_rng(0)
    draws = rng.normal(size=(4, 100, 3))
    draws[2, :, 0] = draws[2, 0, 0]
    draws[:, :, 1] = 1.0
    found = mixing(draws, np.array([True, True, True]))
    assert found.r_hat[0] > 1.05 and found.bulk[0] < 50
    assert found.r_hat[1] == np.inf and found.bulk[1] == found.tail[1] == 0
    assert found.r_hat[2] < 1.05 and found.worst_r_hat == np.inf and found.least_bulk == 0
    fixed = mixing(draws, np.array([False, False, True]))
    assert np.isnan(fixed.r_hat[:2]).all() and fixed.worst_r_hat < 1.05
    assert np.isnan(mixing(draws[:, :3], np.array([True] * 3)).least_tail)


@pytest.mark.parametrize("packing", [packed(40, 0.0), two_disks()])
def test_a_single_point_is_drawn_without_a_step(packing):
    point = ensemble(packing)
    second = sample_uniform(point, 10, chains=3, method="hit_and_run")
    sample = sample_uniform(point, 10, chains=3, effective=50)
    assert sample.states.shape[:2] == (3, 4) and sample.reached
    assert np.array_equal(sample.states, second.states[:, :4])
    assert np.ptp(sample.flat, axis=0).max() == 0 and sample.residual.max() < 1e-10
    assert sample.counts["skipped"] == 12 and sample.counts["turns"] == 0
    assert np.isnan(sample.mixing.least_bulk)


@pytest.mark.parametrize("held", [0, 1])
def test_a_known_force_that_fixes_the_pressure_leaves_a_point(held):
    packing = two_disks()._replace(mu=0.0)
    state = ensemble(packing).member
    S = ensemble(packing, known=Known([held], state[[held]], state[[held]]))
    sample = sample_uniform(S, 8)
    assert sample.walls.dimension == S.dimension == 0
    assert sample.residual.max() < 1e-12 and np.ptp(sample.flat, axis=0).max() == 0


def test_a_known_force_against_the_pressure_is_told():
    """HiGHS's interior points go on for ever in the program that is empty."""
    packing = two_disks()._replace(mu=0.0)
    with pytest.raises(NotJammedError, match=r"f_n = 0 on contact 0 \(must be relaxed by 6\)"):
        ensemble(packing, known=Known([0], [[0.0, 0.0]], [[0.0, 0.0]]))


def inner_part():
    packing = packed(60, 0.1)
    S = ensemble(packing, frozen=slices.outside(packing, (0.1, 0.9, 0.0, 1.0)))
    assert not S.has_pressure_row
    return S


ENSEMBLES = {
    "frozen boundaries": inner_part,
    "another simulator": lambda: ensemble(read_lammps(*DUMPS, 0.3)),
    "square crystal": lambda: ensemble(lattice(4, 4, 0.5)),
    "triangular crystal": lambda: ensemble(lattice(4, 4, 0.2, triangular=True)),
    "little friction": lambda: ensemble(packed(40, 1e-3)),
    "much friction": lambda: ensemble(packed(40, 0.3), mu=1e2),
}


@pytest.mark.parametrize("name", ENSEMBLES)
def test_states_of_other_ensembles_are_in_s(name):
    S = ENSEMBLES[name]()
    sample = sample_uniform(S, 100)
    assert sample.walls.dimension == S.dimension > 0
    assert sample.residual.max() < 1e-10 and sample.violation.max() < 1e-12


def test_contacts_that_carry_nothing_are_held():
    packing = packed(60, 0.3, 7)
    S, full = ensemble(packing), ensemble(packing, prune=False)
    idle = np.setdiff1d(np.arange(len(full.index)), S.index)
    assert len(idle)
    sample = sample_uniform(full, 200)
    assert sample.counts["held"] >= 2 * len(idle)
    assert sample.walls.dimension == S.dimension
    assert np.abs(sample.flat[:, idle]).max() < 1e-7 * full.force_scale
    assert sample.residual.max() < 1e-10 and sample.violation.max() < 1e-12


def test_flat_bodies_are_sampled_in_their_hull():
    """A segment in 5 coordinates: y0 + y1 = 1 and y2 + y3 + y4 = 0."""
    A = sparse.csc_matrix([[1.0, 1, 0, 0, 0], [0, 0, 1, 1, 1]])
    b = np.array([1.0, 0.0])
    y, held, _ = inner_point(A, b)
    assert held.tolist() == [False, False, True, True, True] and y[:2].min() > 1e-3


def test_what_cannot_be_sampled_is_told(S):
    for sizes in ({"states": 0}, {"chains": 0}, {"workers": 0}, {"effective": 0}):
        with pytest.raises(InputError):
            sample_uniform(S, **sizes)
    with pytest.raises(InputError, match="method"):
        sample_uniform(S, method="walk")
    with pytest.raises(NotJammedError):
        inner_point(sparse.csc_matrix([[1.0, 1.0]]), np.array([-1.0]))
    loose = ensemble(S.packing._replace(pressure=np.nan), prune=False)
    with pytest.raises(InputError, match="not bounded"):
        sample_uniform(loose, 8)


def test_a_cell_of_uniform_states_is_kept_with_its_measures(tmp_path):
    store = open_store(tmp_path / "s")
    parameters = kinds.UNIFORM.parameters(kinds.PACKING.parameters(40, 0.3, 1), 60, keep=12)
    seen = []
    dataset, cached = study.get(
        store, kinds.UNIFORM, parameters, progress=lambda *a: seen.append(a)
    )
    again, cached_again = study.get(store, kinds.UNIFORM, parameters)
    assert (cached, cached_again) == (False, True) and seen[-1] == (60, 60)
    assert np.array_equal(dataset["states"], again["states"])
    whole = sample_uniform(ensemble(packed(40, 0.3)), 60)
    kept = np.linspace(0, 59, 12).astype(int)
    assert np.array_equal(dataset["states"], whole.flat[kept])
    assert np.array_equal(dataset["chain"], whole.chain[kept])
    assert dataset["eta2"].item() == measures.eta2(whole.flat)
    assert dataset["least_bulk_size"].item() == whole.mixing.least_bulk
    S = ensemble(packed(40, 0.3))
    of_relaxation = {"sweeps", "mean_sweeps", "attempts", "acceptance"}
    of_relaxation |= {"accepted", "rejected", "unconverged"}
    assert set(samples.walk_dataset(S, walk(S, 4, 0))) - of_relaxation <= set(dataset)
    with pytest.raises(Cancelled):
        other = kinds.UNIFORM.parameters(kinds.PACKING.parameters(40, 0.3, 1), 61)
        study.get(store, kinds.UNIFORM, other, cancel=lambda: True)
    assert len(store.find("uniform")) == 1
    with pytest.raises(InputError):
        kinds.UNIFORM.parameters(parameters["packing"], 0)


def test_the_command_draws_reports_and_finds(tmp_path, capsys):
    words = ["uniform", "-n", "40", "--mu", "0.3", "--states", "60", "--cache", str(tmp_path / "s")]
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["states"] == 60 and not told["cached"] and told["largest_residual"] < 1e-10
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["cached"]
    assert main([*words, "--chains", "0"]) == 2
    assert main([*words, "--workers", "0"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 2


def test_the_benchmark_compares_walks_by_cost_and_by_moments():
    rows = bench.uniform(n=30, frictions=(0.3,), rounded=0)
    ours, other, *elsewhere = rows
    assert [ours["method"], other["method"]] == ["billiard", "coordinate hit-and-run"]
    assert ours["ratio"] == 1 and ours["setup_seconds"] > 0
    cost = ours["seconds"] / ours["effective"]
    assert ours["seconds_per_state"] == pytest.approx(cost)
    assert other["ratio"] == pytest.approx(other["seconds_per_state"] / cost)
    assert other["z_mean"] < 2 and other["z_square"] < 2
    assert elsewhere and all("hopsy" in row["method"] for row in elsewhere)


def test_rows_made_on_demand_change_no_bit(sample):
    """Room for as few rows as there can be: each is made again and again."""
    made, few = sample.walls, billiard.room_for_rows(sample.walls.count, 0.0)
    whole = billiard.room_for_rows(made.count)
    assert whole.whole and not few.whole
    on = partial(uniform.step, made, count=10, reach=sample.reach)
    kept_ends, *kept = on(sample.ends, whole)
    apart = [billiard.room_for_rows(made.count, 0.0) for _ in range(3)]
    for stores in ([few], apart, [billiard.room_for_rows(made.count)] * 3):
        ends, *moved = uniform.advance_all(stores, sample.ends, on)
        for one, other in zip(ends, kept_ends, strict=True):
            assert np.array_equal(one.slacks, other.slacks)
        for one, other in zip(moved, kept, strict=True):
            assert np.array_equal(one, other)


def test_slacks_move_as_the_null_space_lets_them(S):
    """K against a dense projection, and h against its trace."""
    for body in (S, ensemble(packed(40, 0.3), prune=False), ensemble(lattice(4, 4, 0.5))):
        made = walls(body)
        count = len(made.moving)
        A = body.scaled_form[0].toarray()[:, made.moving] * made.centre[made.moving]
        null = linalg.null_space(A, rcond=1e-9)
        K = made.rows(np.arange(count))[:, :count]
        assert np.abs(K - null @ null.T).max() < 1e-8
        assert made.dimension == null.shape[1] == round(np.trace(K))
