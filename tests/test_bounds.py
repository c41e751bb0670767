"""Exact bounds and limit loads: references, certificates, symmetries, limit cases."""

from pathlib import Path

import numpy as np
import pytest

from granforce import block_cholesky, programs
from granforce import bounds as module
from granforce.bench_intervals import read_reference
from granforce.bounds import intervals, limit_load_bounds, limit_loads
from granforce.polytope import ensemble
from granforce.records import InputError, make_contacts, make_packing
from granforce.tolerances import INTERVAL_GAP

REFERENCE = Path(__file__).parent / "reference"
SMALL = ["n100_mu0.1_s11", "n100_mu1_s12"]


@pytest.fixture(scope="module", params=SMALL)
def small(request):
    system, data = read_reference(REFERENCE / f"{request.param}.npz")
    return system, data, intervals(system)


@pytest.fixture(scope="module")
def first():
    system, _ = read_reference(REFERENCE / f"{SMALL[0]}.npz")
    return system, intervals(system)


def agree(system, found, lower, upper, tolerance=1e-6):
    assert np.abs(found.lower - lower).max() <= tolerance * system.force_scale
    assert np.abs(found.upper - upper).max() <= tolerance * system.force_scale


def square_lattice(side, mu):
    grid = np.arange(side)
    i, j, normal = [], [], []
    for a in grid:
        for b in grid:
            for step in ((1, 0), (0, 1)):
                i.append(a * side + b)
                j.append((a + step[0]) % side * side + (b + step[1]) % side)
                normal.append(step)
    x = np.stack(np.meshgrid(grid + 0.5, grid + 0.5, indexing="ij"), axis=-1).reshape(-1, 2)
    r = np.full(side * side, 0.5)
    contacts = make_contacts(i, j, np.array(normal, float), np.ones(len(i)), r)
    forces = np.zeros((len(i), 2))
    forces[:, 0] = 1.0
    return make_packing(x, r, [side, side], contacts, forces, mu, 1.0)


def test_the_block_factor_solves_what_dense_algebra_solves():
    rng = np.random.default_rng(1)
    grains, pairs = 12, rng.integers(0, 12, (20, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    lanes = block_cholesky.LANES
    layout = block_cholesky.pattern(grains, pairs)
    dense = np.zeros((lanes, 3 * grains, 3 * grains))
    dense[:] = np.eye(3 * grains)
    for a, b in layout.position[pairs]:
        rows = np.r_[3 * a : 3 * a + 3, 3 * b : 3 * b + 3]
        half = rng.normal(size=(lanes, 6, 6))
        dense[:, rows[:, None], rows] += half @ half.transpose(0, 2, 1)
    column = np.repeat(np.arange(grains), np.diff(layout.start))
    L = np.stack(
        [
            dense[:, 3 * r : 3 * r + 3, 3 * c : 3 * c + 3].reshape(lanes, 9).T
            for r, c in zip(layout.row, column, strict=True)
        ]
    ).ravel()
    right = rng.normal(size=(3 * grains, lanes))
    x = right.ravel().copy()
    block_cholesky.factor(L, layout.start, layout.target)
    block_cholesky.solve(L, layout.start, layout.row, x)
    expected = np.linalg.solve(dense, right.T[..., None])[..., 0].T
    np.testing.assert_allclose(x.reshape(-1, lanes), expected, rtol=1e-9, atol=1e-12)


def test_bounds_agree_with_the_reference(small):
    system, data, found = small
    agree(system, found, data["lo"][system.index], data["hi"][system.index])
    assert found.converged
    assert found.max_gap <= INTERVAL_GAP
    assert found.backbone.all()


def test_bounds_of_400_disks_agree_with_the_reference():
    system, data = read_reference(REFERENCE / "n400_mu0.1_s13.npz")
    found = intervals(system, workers=2)
    assert found.converged
    agree(system, found, data["lo"][system.index], data["hi"][system.index])


def test_limit_loads_agree_with_the_reference(small):
    system, data, _ = small
    found = limit_load_bounds(system)
    assert found.converged
    off = np.abs(found.load - data["fcrit"][system.index])
    assert off.max() <= 1e-6 * system.force_scale


def test_every_known_state_lies_inside_its_bounds(small):
    system, _, found = small
    slack = 1e-7 * system.force_scale
    assert np.all(system.original >= found.lower - slack)
    assert np.all(system.original <= found.upper + slack)


def test_without_skipping_the_answers_are_the_same(first):
    system, found = first
    known = intervals(system, states=system.original[None])
    every = intervals(system, skip=False)
    assert every.counts["f_n = 0 seen in a known state"] == 0
    assert found.counts["f_n = 0 seen in a known state"] > 0
    assert every.counts["programs"] == 4 * len(system.index)
    for other in (known, every):
        agree(system, other, found.lower, found.upper, 2 * INTERVAL_GAP)


def test_threads_and_company_do_not_change_a_bit(first):
    system, found = first
    threaded = intervals(system, workers=3)
    np.testing.assert_array_equal(threaded.upper, found.upper)
    np.testing.assert_array_equal(threaded.lower[:, 1], found.lower[:, 1])
    few = intervals(system, [40, 3, 41])
    np.testing.assert_array_equal(few.contacts, [40, 3, 41])
    np.testing.assert_array_equal(few.upper, found.upper[few.contacts])


def test_certificates_see_a_wrong_optimum(first):
    system, _ = first
    solver = module.Solver(system, 1, 1, None, None)
    task = module._bound(solver.system, 0, 0, 1)
    outcome = module.from_scratch(solver.system, 0, task)
    attained, bound = module.certify(solver.system, [outcome], [task])
    assert abs(attained[0] - bound[0]) <= INTERVAL_GAP
    unbalanced = outcome._replace(y=outcome.y * (1 + 1e-6))
    assert module.certify(solver.system, [unbalanced], [task])[0][0] == np.inf
    elsewhere = outcome._replace(y=solver.system.batch.y)
    attained, bound = module.certify(solver.system, [elsewhere], [task])
    assert attained[0] - bound[0] > 1e-3
    loose = outcome._replace(multiplier=outcome.multiplier * (1 + 1e-4))
    attained, bound = module.certify(solver.system, [loose], [task])
    assert bound[0] <= attained[0]
    assert attained[0] - bound[0] > INTERVAL_GAP


@pytest.mark.parametrize("mu", [0.5, 10.0])
def test_bounds_and_loads_agree_with_highs(mu):
    system, _ = read_reference(REFERENCE / f"{SMALL[0]}.npz")
    system = ensemble(system.packing, mu)
    found = intervals(system)
    assert found.converged
    A, T = system.cone_form
    model = programs.standard_form(A, system.b / system.force_scale)
    for k in range(0, A.shape[1], 17):
        for side, bound in ((1.0, found.lower), (-1.0, found.upper)):
            row = T.tocsr()[k].toarray().ravel()
            programs.set_cost(model, side * row)
            value = row @ programs.solve(model)[1] * system.force_scale
            assert abs(value - bound[k // 2, k % 2]) <= 1e-7 * system.force_scale


@pytest.mark.parametrize("factor", [1e-12, 1e12])
def test_forces_scale_with_the_pressure(first, factor):
    system, found = first
    packing = system.packing
    scaled = packing._replace(pressure=packing.pressure * factor, forces=packing.forces * factor)
    other = intervals(ensemble(scaled))
    np.testing.assert_allclose(other.upper / factor, found.upper, atol=1e-7 * system.force_scale)
    np.testing.assert_allclose(other.lower / factor, found.lower, atol=1e-7 * system.force_scale)


def test_a_square_lattice_without_friction_loads_one_line():
    """At μ = 0 the force on each line of contacts is constant; one line may carry everything."""
    side = 5
    system = ensemble(square_lattice(side, 0.0))
    found = intervals(system)
    assert found.converged
    line = 2 * side * side / side
    np.testing.assert_allclose(found.upper[:, 0], line, rtol=1e-8)
    np.testing.assert_allclose(found.lower, 0.0, atol=1e-7)
    np.testing.assert_array_equal(found.upper[:, 1], 0.0)
    # F itself is part of the line's force: it may take all of it.
    np.testing.assert_allclose(limit_loads(system), line, rtol=1e-8)


def test_a_square_lattice_with_friction_is_certified():
    system = ensemble(square_lattice(6, 0.3))
    found, loads = intervals(system), limit_load_bounds(system)
    assert found.converged and loads.converged
    # All contacts of a direction are alike.
    np.testing.assert_allclose(found.upper[:, 0], found.upper[0, 0], atol=1e-6)
    np.testing.assert_allclose(found.lower[:, 1], -found.upper[:, 1], atol=1e-6)


def test_freezing_a_contact_holds_it_and_narrows_the_others(first):
    system, found = first
    strong = int(np.argmax(found.lower[:, 0]))
    frozen = ensemble(system.packing, frozen=[system.index[strong]])
    narrowed = intervals(frozen)
    assert narrowed.converged
    assert len(narrowed.upper) == len(system.index) - 1
    assert np.all(narrowed.lower <= frozen.original + 1e-7 * frozen.force_scale)
    assert np.all(narrowed.upper >= frozen.original - 1e-7 * frozen.force_scale)


def test_forces_without_bounds_are_reported(first):
    system, found = first
    weak = int(np.argmin(found.lower[:, 0]))
    frozen = ensemble(system.packing, frozen=[system.index[weak]], prune=False)
    with pytest.raises(InputError, match="not bounded"):
        intervals(frozen, [0])


def test_progress_counts_up_and_cancelling_leaves_the_rest_open(first):
    system, found = first
    seen = []
    cancelled = intervals(
        system,
        progress=lambda done, total: seen.append((done, total)),
        cancel=lambda: bool(seen) and seen[-1][0] > 60,
    )
    done = [number for number, _ in seen]
    assert done == sorted(done) and seen[0][1] == 4 * len(system.index)
    assert not cancelled.converged
    reached = ~np.isnan(cancelled.upper)
    assert 0 < reached.sum() < reached.size
    np.testing.assert_array_equal(cancelled.upper[reached], found.upper[reached])


def test_contacts_outside_the_ensemble_are_refused(first):
    system, _ = first
    with pytest.raises(InputError, match="outside 0"):
        intervals(system, [len(system.index)])
    with pytest.raises(InputError, match="twice"):
        limit_loads(system, [1, 1])
