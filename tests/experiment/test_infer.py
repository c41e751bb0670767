"""Inference: normal distributions cut by bodies whose answer is known decide, as for uniform ones.

Thresholds as in test_uniform.
"""

import numpy as np
import pytest
from bodies import BodyWalls, box, distance_to_marginals, simplex, worth, z_scores
from packings import lattice, packed, reference, two_disks
from scipy import linalg, sparse, stats

from granforce.experiment import infer as inference
from granforce.experiment.infer import infer
from granforce.explore import uniform
from granforce.explore.uniform import sample_uniform
from granforce.forces.build import ensemble
from granforce.forces.knowledge import Known
from granforce.numerics import highs as programs
from granforce.records import Cancelled, InputError


def drawn(body, W, d, states, chains=4, seed=0):
    """Draws (chains, states, n) of y with the weight exp(−½ |W y − d|²), as infer makes them."""
    made = BodyWalls(body, W, d)
    ends, *_ = inference.step(made, uniform.start_chains(made, chains, seed), count=20)
    return made.points(inference.step(made, ends, count=states)[1])


@pytest.mark.parametrize("sigma", [1e-3, 0.1, 0.5, 3.0, 1e3])
def test_sides_of_a_box_are_cut_normals(sigma):
    """Means inside, on the wall, and up to three errors outside of [0, 1]; odd ones unmeasured."""
    body, d = box(12, skew=True), 12
    side = 2 * body.mean[:d]
    middle = np.linspace(-3 * min(sigma, 1.0), 1 + 3 * min(sigma, 1.0), d)
    even = np.arange(0, d, 2)
    W = sparse.csc_matrix((1 / (sigma * side[even]), (range(6), even)), shape=(6, 2 * d))
    y = drawn(body, W, middle[even] / sigma, 1000)[:, :, :d] / side
    ends = (0 - middle[even]) / sigma, (1 - middle[even]) / sigma
    cut = stats.truncnorm(*ends, loc=middle[even], scale=sigma)
    kurtosis = cut.stats("k") + 3 if sigma < 10 else np.full(6, 9 / 5)
    for scores in z_scores(y[:, :, even], cut.mean(), cut.var(), kurtosis):
        assert np.abs(scores).max() < 5
    marginal = [
        stats.truncnorm(low, high, loc=m, scale=sigma).cdf
        for low, high, m in zip(*ends, middle[even], strict=True)
    ]
    assert distance_to_marginals(y[:, :, even], marginal).max() < 2.3
    assert distance_to_marginals(y[:, :, even + 1], [stats.uniform.cdf] * 6).max() < 2.3


@pytest.mark.parametrize("sigma", [0.02, 0.2, 1.0])
def test_a_triangle_has_the_moments_of_quadrature(sigma):
    """A correlated measurement of two of the three coordinates, its mean outside of the body."""
    body = simplex(2)
    W = sparse.csc_matrix([[1.0, 0.5, 0.0], [0.0, -1.0, 2.0]]) / sigma
    d = np.array([0.9, 0.8]) / sigma
    nodes, weight = np.polynomial.legendre.leggauss(400)
    s, t = np.meshgrid((nodes + 1) / 2, (nodes + 1) / 2)
    grid = np.stack([s, (1 - s) * t, (1 - s) * (1 - t)], axis=-1)
    miss = grid @ W.toarray().T - d
    weight = np.outer(weight, weight) * (1 - s) * np.exp(-0.5 * np.sum(miss**2, axis=-1) + 20)
    weight /= weight.sum()
    mean = np.einsum("ij,ijk->k", weight, grid)
    variance = np.einsum("ij,ijk->k", weight, (grid - mean) ** 2)
    kurtosis = np.einsum("ij,ijk->k", weight, (grid - mean) ** 4) / variance**2
    y = drawn(body, W, d, 2000)
    for scores in z_scores(y, mean, variance, kurtosis):
        assert np.abs(scores).max() < 5


def test_the_harness_sees_a_wrong_error():
    body, sigma = simplex(2), 0.2
    W = sparse.csc_matrix([[1.0, 0.5, 0.0], [0.0, -1.0, 2.0]]) / sigma
    d = np.array([0.3, 0.2]) / sigma
    right, wrong = drawn(body, W, d, 2000), drawn(body, W / 1.2, d / 1.2, 2000)
    flat = right.reshape(-1, 3)
    kurtosis = stats.kurtosis(flat, fisher=False)
    scores = z_scores(wrong, flat.mean(axis=0), flat.var(axis=0), kurtosis)
    assert np.abs(scores[1]).max() > 5


def test_narrow_errors_give_the_normal_distribution_conditioned_on_balance():
    """Far from all walls: mean and covariance of a normal one with linear conditions."""
    body, n = simplex(20), 21
    rng = np.random.default_rng(1)
    sigma, m = 1e-4 * rng.uniform(0.5, 2, n), rng.dirichlet(np.full(n, 20.0))
    m = m + sigma * rng.standard_normal(n)
    y = drawn(body, sparse.diags(1 / sigma).tocsc(), m / sigma, 2000)
    a, D = np.ones(n), np.diag(sigma**2)
    gain = D @ a / (a @ D @ a)
    mean, covariance = m + gain * (1 - m.sum()), D - np.outer(gain, a @ D)
    for scores in z_scores(y, mean, np.diag(covariance), np.full(n, 3.0)):
        assert np.abs(scores).max() < 5
    found = np.cov(y.reshape(-1, n).T) / np.outer(sigma, sigma)
    assert np.abs(found - covariance / np.outer(sigma, sigma)).max() < 0.15


@pytest.fixture(scope="module")
def S():
    return ensemble(reference("n100_mu0.1_s11"))


@pytest.fixture(scope="module")
def uniform_states(S):
    return sample_uniform(S, 400, seed=5)


def measurement(S, truth, seed, errors=(0.2, 0.1), missing=0.1):
    """A synthetic measurement of a network: m, and σ (2,), force."""
    rng = np.random.default_rng(seed)
    sigma = np.array(errors) * S.force_scale
    m = truth + sigma * rng.standard_normal(truth.shape)
    m[rng.random(len(m)) < missing] = np.nan
    return m, sigma


def test_nothing_known_leaves_uniform_states(S, uniform_states):
    """Nothing measured, or with errors as large as the whole pressure: the same moments."""
    nothing = np.full((len(S.index), 2), np.nan)
    broad = 1e4 * S.force_scale
    for measured, sigma in ((nothing, 1.0), (S.original, broad)):
        found = infer(S, measured, sigma, states=600)
        assert found.draws.reached and found.draws.counts["refused"] == 0
        assert found.chi_square < 1e-2
        for power in (1, 2):
            one, two = found.draws.states**power, uniform_states.states**power
            flat = [v.reshape(*v.shape[:2], -1) / S.force_scale**power for v in (one, two)]
            error = sum(v.var(axis=(0, 1)) / worth(v) for v in flat)
            score = (flat[0].mean(axis=(0, 1)) - flat[1].mean(axis=(0, 1))) / np.sqrt(error)
            assert np.abs(score).max() < 5 and np.sqrt(np.mean(score**2)) < 1.5
    assert infer(S, nothing, 1.0).freedom == 0


def test_draws_are_admissible_and_mix(S, uniform_states):
    m, sigma = measurement(S, uniform_states.flat[7], 7)
    found = infer(S, m, sigma, states=400)
    draws = found.draws
    assert draws.states.shape == (4, 100, len(S.index), 2) and draws.reached
    assert draws.residual.max() < 1e-10 and draws.violation.max() < 1e-12
    assert draws.effective > 100 and draws.counts["refused"] == draws.counts["held"] == 0
    assert S.admits(found.forces)
    twice = infer(S, m, sigma, states=400, workers=3).draws
    assert np.array_equal(twice.states, draws.states)
    other = infer(S, m, sigma, states=400, seed=1).draws
    assert not np.array_equal(other.states, draws.states)


def test_a_measurement_comes_closer_to_the_truth_with_right_error_bars(S, uniform_states):
    """Coverage is defined over truths drawn from what is known before measuring: uniform on S."""
    closer, inside, square = [], [], []
    for k in range(12):
        truth = uniform_states.flat[33 * k]
        m, sigma = measurement(S, truth, k)
        found = infer(S, m, sigma, states=400)
        seen = ~np.isnan(m)
        before = np.abs(m - truth)[seen].mean()
        closer.append(before / np.abs(found.mean - truth)[seen].mean())
        low, high = np.quantile(found.draws.flat, [0.16, 0.84], axis=0)
        inside.append(np.mean((low < truth) & (truth < high)))
        square.append(np.mean(((truth - found.mean) / found.error) ** 2))
    assert min(closer) > 4
    assert 0.63 < np.mean(inside) < 0.73
    assert 0.9 < np.sqrt(np.mean(square)) < 1.1


def test_no_network_fits_better(S, uniform_states):
    """The least χ²: no way towards any other state of S lowers it (S is convex)."""
    m, sigma = measurement(S, uniform_states.flat[5], 5)
    found = infer(S, m, sigma)
    slope = np.nan_to_num(found.deviation) / sigma
    ways = (np.sum(slope * (other - found.forces)) for other in uniform_states.flat)
    assert min(ways) > -1e-6 * found.chi_square
    assert found.chi_square == pytest.approx(np.nansum(((found.forces - m) / sigma) ** 2))


def test_chi_square_is_that_of_its_degrees_of_freedom(S, uniform_states):
    ratios, scores = [], []
    for k in range(30):
        m, sigma = measurement(S, uniform_states.flat[13 * k], 100 + k)
        found = infer(S, m, sigma)
        ratios.append(found.chi_square / found.freedom)
        scores.append((found.chi_square - found.freedom) / np.sqrt(2 * found.freedom))
    assert abs(np.mean(ratios) - 1) < 0.05
    assert abs(np.mean(scores)) < 5 / np.sqrt(30)


def by_piqp(S, m, sigma):
    """The likeliest network by another solver, where every force was measured."""
    A, b, T = S.scaled_form
    weights = sparse.diags(np.tile(np.min(sigma) / sigma, len(m)) ** 2)
    solver = programs.quadratic_solver(400)
    target = S.to_vector(m) / S.force_scale
    quadratic = sparse.csc_matrix(T.T @ weights @ T)
    solver.setup(quadratic, -(T.T @ weights @ target), A, b, x_l=np.zeros(A.shape[1]))
    solver.solve()
    return S.to_forces(T @ np.maximum(solver.result.x, 0.0)) * S.force_scale


@pytest.mark.parametrize("errors", [(0.2, 0.1), (1e-3, 1e-2), (5.0, 1.0)])
def test_another_solver_finds_the_same_network(S, uniform_states, errors):
    """By PIQP, everything measured, so that the network is unique."""
    m, sigma = measurement(S, uniform_states.flat[9], 9, errors, missing=0)
    other = by_piqp(S, m, sigma)
    assert np.abs(infer(S, m, sigma).forces - other).max() < 1e-6 * S.force_scale


def test_wrong_contacts_are_named_largest_first(S):
    m = S.original.copy()
    m[40, 0] += 3 * S.force_scale
    m[90, 1] -= 2 * S.force_scale
    found = infer(S, m, 0.05 * S.force_scale)
    assert found.suspects[:2].tolist() == S.index[[40, 90]].tolist()
    assert np.abs(found.deviation[40, 0]) > np.abs(found.deviation[90, 1]) > 3


def test_exact_measurements_are_given_back(S):
    found = infer(S, S.original, 0.1 * S.force_scale)
    assert found.chi_square < 1e-12 and not len(found.suspects)
    assert np.abs(found.forces - S.original).max() < 1e-9 * S.force_scale


def test_no_friction_and_no_freedom(S):
    """One admissible network: whatever is measured, it is the answer, without error."""
    for packing in (packed(40, 0.0), two_disks()):
        point = ensemble(packing)
        m = point.original + 0.3 * point.force_scale
        found = infer(point, m, 0.1 * point.force_scale, states=10)
        assert point.admits(found.forces) and found.freedom == m.size
        assert np.abs(found.draws.flat - found.forces).max() < 1e-8 * point.force_scale
        assert np.abs(found.error).max() < 1e-8 * point.force_scale


def test_crystals_and_frozen_boundaries_and_idle_contacts():
    packing = packed(60, 0.1)
    inner = packing.x[:, 0] < 0.5 * packing.box[0]
    outside = ~(inner[packing.contacts.i] & inner[packing.contacts.j])
    crystal = lattice(4, 4, 0.2, triangular=True)
    for body in (
        ensemble(packing, frozen=outside),
        ensemble(crystal),
        ensemble(packed(40, 0.3), prune=False),
    ):
        target = np.zeros((len(body.index), 2))
        target[:, 0] = body.force_scale
        m, sigma = measurement(body, target, 0)
        found = infer(body, m, sigma, states=80)
        assert body.admits(found.forces)
        assert found.draws.residual.max() < 1e-10 and found.draws.violation.max() < 1e-12


def test_what_cannot_be_inferred_is_told(S):
    for measured, sigma in (
        (S.original[:3], 1.0),
        (S.original, 0.0),
        (S.original, np.ones(5)),
        (np.full_like(S.original, np.inf), 1.0),
        ("forces", 1.0),
    ):
        with pytest.raises(InputError):
            infer(S, measured, sigma)
    for sizes in ({"states": -1}, {"chains": 0}, {"workers": 0}):
        with pytest.raises(InputError):
            infer(S, S.original, 1.0, **sizes)
    with pytest.raises(Cancelled):
        infer(S, S.original, 1.0, states=400, cancel=lambda: True)


def test_degrees_of_freedom_count_what_the_face_leaves():
    """By singular values: the rank of what is measured on the null space of the balance."""
    packing = packed(40, 0.3)
    for body in (ensemble(packing), ensemble(packing, prune=False), ensemble(lattice(4, 4, 0.5))):
        target = np.zeros((len(body.index), 2))
        target[:, 0] = body.force_scale
        m, sigma = measurement(body, target, 4, missing=0.4)
        found = infer(body, m, sigma)
        A, _, T = body.scaled_form
        normal, tangential = (found.forces / body.force_scale).T
        y = np.column_stack([normal + tangential / body.mu, normal - tangential / body.mu]).ravel()
        null = linalg.null_space(A.toarray()[:, y > 1e-6], rcond=1e-9)
        seen = ~np.isnan(m).ravel()
        adapted = np.linalg.matrix_rank(T.toarray()[seen][:, y > 1e-6] @ null, tol=1e-9)
        assert found.freedom == seen.sum() - adapted


@pytest.mark.parametrize(
    "conditions",
    [
        {"prescribed": "stress"},
        {"known": Known([3, 77], [[0.2, -np.inf], [0.1, 0.0]], [[0.8, np.inf], [np.inf, 0.05]])},
    ],
)
def test_what_is_prescribed_or_known_holds_in_every_draw(conditions):
    """Draws keep the stress and the bounds; those of the likeliest network are PIQP's."""
    body = ensemble(reference("n100_mu0.1_s11"), **conditions)
    m, sigma = measurement(body, body.original, 2, missing=0)
    found = infer(body, m, sigma, states=80)
    assert body.admits(found.forces, violation=1e-6)
    assert found.draws.residual.max() < 1e-10 and found.draws.violation.max() < 1e-9
    assert np.abs(found.forces - by_piqp(body, m, sigma)).max() < 1e-4 * body.force_scale


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "factor, sigma, unmeasured, words",
    [
        (1e300, 0.1, 1e3, "f_n measured on contact .* check the unit"),
        (1, 1e300, 1e3, "the error of f_n on contact .* check the unit"),
        (1, 1e-300, 1e3, "the error of f_n on contact .* check the unit"),
        (1, 0.1, 1e300, "unmeasured must be from 1e-09 to 1e.09"),
        (0, 1e-6, 1e3, "its errors are too small"),
    ],
)
def test_what_cannot_be_resolved_is_refused_in_a_line(factor, sigma, unmeasured, words):
    S = ensemble(reference("n100_mu0.1_s11"))
    with pytest.raises(InputError, match=words):
        infer(S, factor * S.original, sigma * S.force_scale, states=4, unmeasured=unmeasured)
