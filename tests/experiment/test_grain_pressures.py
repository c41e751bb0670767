"""Pressures of grains as measurements: linear programs and weighted uniform states decide."""

import numpy as np
import pytest
from packings import reference
from scipy import sparse
from scipy.optimize import linprog

from granforce.experiment.carrying import carrying
from granforce.experiment.infer import infer
from granforce.experiment.informative import informative_grains
from granforce.experiment.remeasured import remeasured
from granforce.explore import walls
from granforce.explore.uniform import sample_uniform
from granforce.forces.build import ensemble
from granforce.forces.grain_pressures import GrainPressures, grain_pressures, no_rows, rows_of
from granforce.numerics import wall_matrix
from granforce.packing.assemblies import blocks
from granforce.records import InputError


@pytest.fixture(scope="module")
def S():
    return ensemble(reference("n100_mu0.1_s11"))


@pytest.fixture(scope="module")
def states(S):
    return sample_uniform(S, 4000, seed=5).flat


def measured(S, truth, relative, seed=0):
    """GrainPressures of a network, with normal errors relative to the mean pressure."""
    true = grain_pressures(S, truth)
    sigma = relative * true.mean()
    noise = sigma * np.random.default_rng(seed).standard_normal(len(true))
    return GrainPressures(np.arange(len(true)), true + noise, sigma)


def turned(packing, factor):
    """The packing turned by 90°, with all forces times a factor."""

    def turn(v):
        return np.column_stack([-v[:, 1], v[:, 0]])

    contacts = packing.contacts._replace(normal=turn(packing.contacts.normal))
    return packing._replace(
        x=turn(packing.x),
        box=packing.box[::-1],
        contacts=contacts,
        forces=factor * packing.forces,
        pressure=factor * packing.pressure,
    )


def test_areas_times_pressures_make_up_the_pressure_of_the_box(S, states):
    each = grain_pressures(S, states[:3])
    whole = each @ S.packing.areas / S.packing.volume
    assert each.shape == (3, len(S.packing.r)) and np.allclose(whole, S.packing.pressure)


def test_a_block_is_pressed_by_its_weight():
    """Half the trace of the stress of a square of side 2 and weight 4, standing on two corners."""
    S = ensemble(
        blocks(
            [[(0, 0), (2, 0), (2, 2), (0, 2)], [(-1, -1), (3, -1), (3, 0), (-1, 0)]],
            fixed=[1],
            mu=0.5,
        )
    )
    forces = np.column_stack([np.full(2, 2.0), np.zeros(2)])
    assert grain_pressures(S, forces)[0] == pytest.approx(2 * 2 * 1 / (2 * 4))


def test_the_likeliest_network_is_the_optimum_of_its_gradient(S, states):
    """No network of S has a smaller χ² to first order: one linear program by SciPy."""
    given = measured(S, states[7], 0.05)
    found = infer(S, pressures=given, unmeasured=1e3)
    rows = rows_of(S, given)
    prior = found.forces / (1e3 * S.force_scale) ** 2
    slope = rows.matrix.T @ (rows.deviation(found.forces) / rows.sigma) + prior.ravel()
    A, b, T = S.scaled_form
    cost = S.force_scale * (T.T @ slope)
    best = linprog(cost, A_eq=A, b_eq=b, bounds=(0, None), method="highs")
    assert best.status == 0
    assert cost @ S.coordinates(found.forces) - best.fun < 1e-6 * found.chi_square
    assert found.residual < 1e-10 and found.violation < 1e-9
    assert found.chi_square == pytest.approx(np.sum(found.pressure_deviation**2))
    assert 0 < found.freedom < len(S.packing.r)


def test_turned_and_in_other_units_it_is_the_same_network(S, states):
    given = measured(S, states[7], 0.05)
    other = ensemble(turned(S.packing, 7.0))
    scaled = given._replace(values=7 * given.values, sigma=7 * given.sigma)
    one, two = infer(S, pressures=given), infer(other, pressures=scaled)
    assert np.allclose(7 * one.forces, two.forces, atol=1e-5 * other.force_scale)
    assert two.chi_square == pytest.approx(one.chi_square, rel=1e-6)


def test_draws_have_the_moments_of_weighted_uniform_states(S, states):
    """Errors so large that uniform states, weighted with exp(−χ²/2), have the same moments."""
    given = measured(S, states[7], 0.5)._replace(sigma=np.array(0.5))
    rows = rows_of(S, given)
    chi = np.array([np.sum(rows.deviation(f) ** 2) for f in states])
    weight = np.exp(-0.5 * (chi - chi.min()))
    weight /= weight.sum()
    assert 1 / np.sum(weight**2) > 200
    drawn = infer(S, pressures=given, states=800, unmeasured=1e3)
    assert drawn.draws.reached
    mean = np.einsum("s,scp->cp", weight, states)
    spread = np.sqrt(np.einsum("s,scp->cp", weight, (states - mean) ** 2))
    error = spread * np.sqrt(np.sum(weight**2) + 1 / drawn.draws.effective)
    score = (drawn.mean - mean) / error
    assert np.abs(score).max() < 5 and np.sqrt(np.mean(score**2)) < 1.5
    assert np.median(drawn.error / spread) == pytest.approx(1.0, abs=0.1)


def test_the_sparse_and_the_dense_matrix_of_walls_agree(S, states):
    rows = rows_of(S, measured(S, states[7], 0.05))
    setup = walls._setup(S, np.full((len(S.index), 2), 1e-6), 0.0, rows)
    y = walls._centred(setup, S.hull.inner, walls._matrix)
    sparse_one, _ = walls._matrix(setup, y)
    dense, _ = walls._Thin(setup)(setup, y)
    rng = np.random.default_rng(0)
    g = rng.standard_normal((3, dense.count))
    pulls = rng.standard_normal((3, 2 * len(S.index)))
    one = wall_matrix.restored(sparse_one).moved(g, pulls)
    assert np.abs(sparse_one.on_hull(one) - one).max() < 1e-8
    assert np.abs(one - dense.moved(g, pulls)).max() < 1e-8
    assert np.abs(sparse_one.rows(np.arange(3)) - dense.rows(np.arange(3))).max() < 1e-9
    assert not one[:, len(walls._matrix(setup, y)[1]) :].any()


def test_forces_and_pressures_together_know_more(S, states):
    truth, given = states[7], measured(S, states[7], 0.05)
    m = np.where(np.arange(len(truth))[:, None] % 3, np.nan, truth)
    sigma = 0.05 * S.force_scale
    alone, both = (infer(S, m, sigma, pressures=p, states=600) for p in (None, given))
    assert both.freedom > alone.freedom and both.error.mean() < 0.9 * alone.error.mean()
    again = remeasured(S, m, sigma, pressures=given, states=16, workers=2)
    assert again == remeasured(S, m, sigma, pressures=given, states=16)._replace(
        seconds=again.seconds, draws=again.draws
    )
    assert np.isfinite(again.error).all()
    assert np.isnan(alone.pressure_deviation).all() and not len(alone.suspect_grains)


def test_wrong_pressures_are_suspect(S, states):
    given = measured(S, states[7], 0.02)
    most = int(np.argmax(given.values))
    given.values[most] *= 0.3
    assert infer(S, pressures=given).suspect_grains[0] == most


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ([1.0], "pressures must be gf.GrainPressures"),
        (GrainPressures([0, 0], [1.0, 1.0], 0.1), "grain 0 has several pressures"),
        (GrainPressures([0], [1.0], 0.0), "errors must be above 0"),
        (GrainPressures([100], [1.0], 0.1), "grain 100 does not exist"),
        (GrainPressures([0, 1], [1.0], 0.1), "one shape"),
        (GrainPressures([0], [np.inf], 0.1), "must be finite"),
        (GrainPressures([0], [1e9], 0.1), "check the calibration"),
        (GrainPressures([0], [1.0], 1e-12), "check the unit"),
        (None, "nothing was measured"),
    ],
)
def test_what_cannot_be_a_measurement_is_refused(S, given, words):
    with pytest.raises(InputError, match=words):
        infer(S, pressures=given)


def test_grains_whose_balance_is_left_open_have_no_pressure(S):
    load = S.packing.load.copy()
    load[3] = np.nan
    open_one = ensemble(S.packing._replace(load=load))
    assert np.isnan(grain_pressures(open_one, open_one.original)[3])
    with pytest.raises(InputError, match="grain 3 need not balance"):
        infer(open_one, pressures=GrainPressures([3], [1.0], 0.1))


def test_frozen_contacts_count_at_their_forces(S):
    frozen = ensemble(S.packing, frozen=np.arange(20))
    whole = grain_pressures(S, S.original)
    assert np.allclose(grain_pressures(frozen, frozen.original), whole)
    given = GrainPressures(np.arange(100), whole, 0.1)
    assert np.abs(rows_of(frozen, given).deviation(frozen.original)).max() < 1e-9
    assert sparse.issparse(no_rows(S).matrix)


def test_least_forces_are_those_of_linear_programs(S, states):
    """f_n over all networks whose pressures are within 3 σ of the measured ones, by SciPy."""
    given = measured(S, states[7], 0.02)
    chosen = S.index[[5, 40, 77]]
    found = carrying(S, contacts=chosen, pressures=given)
    dev = infer(S, pressures=given).pressure_deviation
    rows = rows_of(S, given)
    width = np.maximum(3.0, 1.1 * np.abs(dev)) * rows.sigma
    A, b, T = S.scaled_form
    sums = rows.matrix @ T * S.force_scale
    sides = sparse.vstack([sums, -sums])
    limits = np.append(rows.values + width, width - rows.values)
    for place, least in zip([5, 40, 77], found.least, strict=True):
        cost = T.tocsr()[[2 * place]].toarray().ravel()
        best = linprog(cost, A_ub=sides, b_ub=limits, A_eq=A, b_eq=b, method="highs")
        assert least == pytest.approx(S.force_scale * best.fun, abs=1e-6)
    assert found.carries.any()


def test_the_best_grain_to_measure_next_reduces_the_errors_as_expected(S, states):
    given = measured(S, states[7], 0.1)
    some = given._replace(grains=given.grains[::2], values=given.values[::2])
    before = infer(S, pressures=some, states=1000, unmeasured=1e3)
    ranked = informative_grains(S, before.draws.flat, float(given.sigma), 20)
    assert np.all(np.diff(ranked.expected) <= 0)
    next_one = next(g for g in ranked.grains if g % 2)
    place = list(ranked.grains).index(next_one)
    grains = np.append(some.grains, next_one)
    both = GrainPressures(grains, given.values[grains], given.sigma)
    after = infer(S, pressures=both, states=1000, unmeasured=1e3)
    gain = 1 - after.error[:, 0].sum() / before.error[:, 0].sum()
    assert gain == pytest.approx(ranked.expected[place], abs=0.04)


def test_progress_true_draws_a_bar(S, states, capsys):
    given = measured(S, states[7], 0.1)
    one, two = (infer(S, pressures=given, states=8, progress=p) for p in (True, False))
    assert "infer" in capsys.readouterr().err
    assert np.array_equal(one.draws.states, two.draws.states)
    with pytest.raises(InputError, match="progress must be True, or a function"):
        infer(S, pressures=given, progress=3)
