"""Exact bounds and limit loads: references, certificates, symmetries, limit cases."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from packings import lattice, packed
from scipy import linalg, optimize

from granforce.bench.exact import read_reference
from granforce.experiment.informative import informative
from granforce.explore import intervals as module
from granforce.explore.intervals import intervals, limit_load_bounds, limit_loads
from granforce.forces.build import ensemble
from granforce.forces.contact_problem import make_system
from granforce.numerics import certified_values, linear_programs
from granforce.numerics import highs as programs
from granforce.packing.compaction import pack
from granforce.packing.importers import load_packing
from granforce.records import InputError
from granforce.study.kinds import slices
from granforce.tolerances import BALANCED, INTERVAL_GAP

TESTS = Path(__file__).parents[1]
REFERENCE = TESTS / "reference"
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
    assert np.abs(found.low - lower).max() <= tolerance * system.force_scale
    assert np.abs(found.high - upper).max() <= tolerance * system.force_scale


def test_what_frozen_surroundings_leave_open_is_certified():
    # Rounding of the frozen forces once kept these programs from ending in balance at all.
    packing = packed(400, 1.0, 2)
    S = ensemble(packing, frozen=slices.outside(packing, (0.2, 0.8, 0.2, 0.8)))
    found = intervals(S)
    assert found.converged
    assert found.counts["again"] == 0
    moved = np.abs(S.to_forces(linalg.null_space(S.A.toarray()).T)).max(axis=(0, 2))
    extent = (found.high - found.low).max(axis=1)
    assert S.dimension > 0
    assert np.array_equal(extent > 1e-6 * S.force_scale, moved > 1e-9)


def test_bounds_where_some_contacts_can_do_nothing_but_slide():
    packing = packed(50, 0.01, 3)
    S = ensemble(packing, frozen=slices.outside(packing, (0.2, 0.8, 0.2, 0.8)))
    system = make_system(S)
    assert not system.middle.converged
    found = intervals(S)
    assert found.converged
    assert found.counts["again"] == 0
    for c in range(len(S.index)):
        for side, value in enumerate((found.low, found.high)):
            program = module.bound_of(S, c, 0, side)
            alone = next(certified_values.from_scratch(system, 0, program))
            ((attained,), _) = certified_values.certify(system, [alone], [program])
            assert abs(value[c, 0] / S.force_scale - (1 - 2 * side) * attained) <= 2 * INTERVAL_GAP


def test_a_network_at_hand_that_is_hardly_balanced_costs_no_second_solver():
    """Its residual once passed for that of S: every program was solved again, in seconds each."""
    S = ensemble(packed(30, 0.3, 1))
    near = replace(S, computed=None)
    near.__dict__["reference"] = S.original * (1 + 1.6 * BALANCED)
    given = intervals(near)
    assert given.converged and given.counts["again"] == 0
    np.testing.assert_allclose(given.high, intervals(S).high, atol=2 * INTERVAL_GAP)


def test_values_below_their_bounds_are_solved_again():
    # Near isostaticity multipliers are so large that an unbalance within BALANCED is 2e-8 ⟨f_n⟩.
    S = ensemble(load_packing(TESTS / "attacks" / "n100_mu1_h3.npz"))
    S.__dict__["reference"] = S.member  # as beyond LARGEST_RANK rows
    found = intervals(S)
    assert found.converged
    assert found.counts["again"] > 0
    system, exactly = make_system(S), {"primal_feasibility_tolerance": 1e-10}
    tasks, points = [module.bound_of(S, c, 0, 1) for c in range(len(S.index))], {}
    values = certified_values.Solver(system).solve(range(len(tasks)), tasks, points)
    for c, task in enumerate(tasks):  # each value is that of its state
        assert abs(task.costs @ points[c][task.columns] - values[c][0]) < 1e-12
    for c in range(10):
        program = module.bound_of(S, c, 0, 1)
        cost = np.zeros(system.A.shape[1])
        cost[program.columns] = program.costs
        best = optimize.linprog(cost, A_eq=system.A, b_eq=system.b, options=exactly)
        assert abs(found.high[c, 0] / S.force_scale + best.fun) <= 3 * INTERVAL_GAP


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
    assert np.all(system.original >= found.low - slack)
    assert np.all(system.original <= found.high + slack)


def test_without_skipping_the_answers_are_the_same(first):
    system, found = first
    known = intervals(system, states=system.original[None])
    every = intervals(system, skip=False)
    assert every.counts["f_n = 0 seen in a known state"] == 0
    assert found.counts["f_n = 0 seen in a known state"] > 0
    assert every.counts["programs"] == 4 * len(system.index)
    for other in (known, every):
        agree(system, other, found.low, found.high, 2 * INTERVAL_GAP)


def test_threads_and_company_do_not_change_a_bit(first):
    system, found = first
    threaded = intervals(system, workers=3)
    np.testing.assert_array_equal(threaded.high, found.high)
    np.testing.assert_array_equal(threaded.low[:, 1], found.low[:, 1])
    few = intervals(system, system.index[[40, 3, 41]])
    np.testing.assert_array_equal(few.high, found.high[[40, 3, 41]])


@pytest.mark.parametrize("workers", [1, 2])
def test_bounds_are_told_as_they_are_found_the_widest_first_and_stay_the_same(first, workers):
    system, found = first
    widths, told = (found.high - found.low)[:, 0], []
    again = intervals(system, workers=workers, widths=widths, watch=told.append)
    for one, other in zip(found, again, strict=True):
        if isinstance(one, np.ndarray):
            np.testing.assert_array_equal(one, other)
    assert again.counts == found.counts and again.max_gap == found.max_gap
    sides = {0: again.low, 1: again.high}
    place = {int(c): k for k, c in enumerate(again.contacts)}
    last = {(bound.contact, bound.component, bound.side): bound.value for bound in told}
    assert len(last) == 4 * len(place)
    for (contact, component, side), value in last.items():
        assert value == sides[side][place[contact], component]
    for bound in told:  # what was told before differs by no more than what is certified
        said_last = last[bound.contact, bound.component, bound.side]
        assert abs(bound.value - said_last) <= INTERVAL_GAP * system.force_scale
    assert len(told) - len(last) <= again.counts["f_n = 0 seen in a known state"]
    # Programs side by side end within some places of their turn.
    upper = [k for k, bound in enumerate(told) if bound.component == 0 and bound.side == 1]
    assert upper[len(place) // 2] < len(place) and upper[-1] < 1.5 * len(place)
    rank = np.argsort(np.argsort(-widths, kind="stable"))
    first_told = [rank[place[told[k].contact]] for k in upper[: len(place) // 4]]
    assert max(first_told) < 0.6 * len(place)
    # Lower ones come with them: few wait until all tangential bounds are there.
    normal, tangential = (
        [k for k, bound in enumerate(told) if bound.component == component] for component in (0, 1)
    )
    early = [k for k in normal if k < np.median(tangential)]
    assert len(early) > 2 * len(place) - 1.5 * again.counts["f_n = 0 seen in a known state"]


def test_a_bound_left_short_of_its_certificate_is_refined_before_another_solver(first, monkeypatch):
    system, found = first
    run, refined = linear_programs.run, []

    def spoiling(problem, middle, programs, numbers, *, finished, **options):
        """Programs 3 and 40 end a little away from their optimum, where they are not refined."""

        def spoiled(outcomes):
            for k, outcome in enumerate(outcomes):
                if outcome.number in (3, 40) and not options["refined"]:
                    y = outcome.y + 1e-7 * (middle.y - outcome.y)
                    outcomes[k] = outcome._replace(y=y)
            finished(outcomes)

        if options["refined"]:
            refined.extend(numbers)
        run(problem, middle, programs, numbers, finished=spoiled, **options)

    monkeypatch.setattr(linear_programs, "run", spoiling)
    again = intervals(system)
    assert again.converged and again.counts["again"] == 0
    assert set(refined) == {3, 40} and again.counts["programs"] == found.counts["programs"]
    agree(system, again, found.low, found.high, 2 * INTERVAL_GAP)


def test_certificates_see_a_wrong_optimum(first):
    system, _ = first
    cones = make_system(system)
    task = module.bound_of(system, 0, 0, 1)
    outcome = next(certified_values.from_scratch(cones, 0, task))
    attained, bound = certified_values.certify(cones, [outcome], [task])
    assert abs(attained[0] - bound[0]) <= INTERVAL_GAP
    unbalanced = outcome._replace(y=outcome.y * (1 + 1e-6))
    assert certified_values.certify(cones, [unbalanced], [task])[0][0] == np.inf
    elsewhere = outcome._replace(y=cones.middle.y)
    attained, bound = certified_values.certify(cones, [elsewhere], [task])
    assert attained[0] - bound[0] > 1e-3
    loose = outcome._replace(multiplier=outcome.multiplier * (1 + 1e-4))
    attained, bound = certified_values.certify(cones, [loose], [task])
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
        for side, bound in ((1.0, found.low), (-1.0, found.high)):
            row = T.tocsr()[k].toarray().ravel()
            programs.set_cost(model, side * row)
            value = row @ programs.solve(model)[1] * system.force_scale
            assert abs(value - bound[k // 2, k % 2]) <= 1e-7 * system.force_scale


def test_a_square_lattice_without_friction_loads_one_line():
    """At μ = 0 the force on each line of contacts is constant; one line may carry everything."""
    side = 5
    system = ensemble(lattice(side, side, 0.0))
    found = intervals(system)
    assert found.converged
    line = 2 * side * side / side
    np.testing.assert_allclose(found.high[:, 0], line, rtol=1e-8)
    np.testing.assert_allclose(found.low, 0.0, atol=1e-7)
    np.testing.assert_array_equal(found.high[:, 1], 0.0)
    # F itself is part of the line's force: it may take all of it.
    np.testing.assert_allclose(limit_loads(system), line, rtol=1e-8)


def test_a_square_lattice_with_friction_is_certified():
    system = ensemble(lattice(6, 6, 0.3))
    found, loads = intervals(system), limit_load_bounds(system)
    assert found.converged and loads.converged
    # All contacts of a direction are alike.
    np.testing.assert_allclose(found.high[:, 0], found.high[0, 0], atol=1e-6)
    np.testing.assert_allclose(found.low[:, 1], -found.high[:, 1], atol=1e-6)


@pytest.mark.parametrize("mu", [1e-6, 1e-3])
def test_hexagonal_crystals_of_little_friction_are_certified(mu):
    """At μ = 10⁻⁶ the interior-point method leaves a few bounds open, which HiGHS closes."""
    crystal = ensemble(lattice(4, 4, mu, triangular=True))
    found = intervals(crystal)
    assert found.converged
    # Translations map the contacts of a direction onto each other: their bounds are alike.
    for bound in (found.low, found.high):
        alike = bound.reshape(3, 16, 2)
        np.testing.assert_allclose(alike, alike[:, :1].repeat(16, axis=1), atol=4 * INTERVAL_GAP)
    told = informative(crystal, 1, states=40, check=1)
    assert 0 < told.after[0] < told.before


def test_freezing_a_contact_holds_it_and_narrows_the_others(first):
    system, found = first
    strong = int(np.argmax(found.low[:, 0]))
    frozen = ensemble(system.packing, frozen=[system.index[strong]])
    narrowed = intervals(frozen)
    assert narrowed.converged
    assert len(narrowed.high) == len(system.index) - 1
    assert np.all(narrowed.low <= frozen.original + 1e-7 * frozen.force_scale)
    assert np.all(narrowed.high >= frozen.original - 1e-7 * frozen.force_scale)


def test_forces_without_bounds_are_reported(first):
    system, found = first
    weak = int(np.argmin(found.low[:, 0]))
    frozen = ensemble(system.packing, frozen=[system.index[weak]], prune=False)
    assert np.isposinf(intervals(frozen, frozen.index[:1]).high[:, 0])


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
    reached = ~np.isnan(cancelled.high)
    assert 0 < reached.sum() < reached.size
    np.testing.assert_array_equal(cancelled.high[reached], found.high[reached])


def test_contacts_outside_the_ensemble_are_refused(first):
    system, _ = first
    for beyond in (-1, len(system.packing.contacts.i)):
        with pytest.raises(InputError, match=f"contact {beyond} is not one of"):
            intervals(system, [beyond])
    with pytest.raises(InputError, match="twice"):
        limit_loads(system, [system.index[1], system.index[1]])


def test_contacts_are_named_by_their_number_in_the_packing(first):
    """Results for contacts that a frozen one displaces in the ensemble are those of the same."""
    system, _ = first
    frozen = ensemble(system.packing, frozen=[system.index[4]])
    whole, loads = intervals(frozen), limit_load_bounds(frozen)
    np.testing.assert_array_equal(whole.contacts, frozen.index)
    np.testing.assert_array_equal(loads.contacts, frozen.index)
    for contact in (system.index[3], system.index[9]):
        (k,) = np.flatnonzero(whole.contacts == contact)
        one, load = intervals(frozen, [contact]), limit_load_bounds(frozen, [contact])
        assert one.contacts == load.contacts == [contact]
        np.testing.assert_allclose(one.high[0], whole.high[k], atol=1e-7 * frozen.force_scale)
        assert load.load[0] == pytest.approx(loads.load[k], rel=1e-6)
    for result in (intervals, limit_loads):
        with pytest.raises(InputError, match=f"contact {system.index[4]} is not one of"):
            result(frozen, [system.index[4]])


def test_what_is_not_certified_is_not_handed_out():
    # At μ = 10⁷ rounding of the torques is larger than the unbalance that a state may have: more
    # than `ensemble` takes.
    S = replace(ensemble(packed(30, 10.0)), mu=1e7)
    found = intervals(S)
    limits = limit_load_bounds(S)
    assert not found.converged and not limits.converged
    unsure = ~(found.gap <= INTERVAL_GAP)
    assert unsure.any()
    assert np.array_equal(np.isnan(found.low), unsure[..., 0])
    assert np.array_equal(np.isnan(found.high), unsure[..., 1])
    assert np.array_equal(np.isnan(limits.load), ~(limits.gap <= INTERVAL_GAP))
    sure = np.isfinite(found.low) & np.isfinite(found.high)
    assert np.all(found.low[sure] <= found.high[sure] + 2e-8 * S.force_scale)


@pytest.mark.parametrize("n, seed", [(8, 1), (8, 3), (7, 74789), (16, 2), (14, 510889)])
def test_bounds_of_a_single_network_at_prescribed_stress_are_that_network(n, seed):
    """More equations than forces: multipliers may be so large that rounding counts."""
    S = ensemble(pack(n, 1.0, seed), prescribed="stress")
    assert S.dimension == 0
    bounds, loads = intervals(S), limit_load_bounds(S)
    assert bounds.converged and loads.converged
    assert max(bounds.max_gap, loads.max_gap) <= INTERVAL_GAP
    for end in (bounds.low, bounds.high):
        assert np.abs(end - S.original).max() < 1e-7 * S.force_scale
    # The load takes the place of f_n, up to what friction needs at μ = 1.
    spare = S.original[:, 0] - np.abs(S.original[:, 1])
    np.testing.assert_allclose(loads.load, spare, atol=1e-7 * S.force_scale)


def test_a_pair_that_agrees_replaces_a_bound_above_a_value():
    batch = certified_values._Batch([0], [], {}, None, 1e-8)
    assert batch.better((1.0, 1.0 + 1e-7), (1.0 + 1e-9, 1.0)) == (1.0 + 1e-9, 1.0)
    assert batch.better((1.0, 1.0 + 1e-7), (1.0 + 1e-6, 1.0)) == (1.0, 1.0 + 1e-7)
    assert batch.better((1.0, 0.5), (2.0, 1.0)) == (1.0, 1.0)
    assert batch.better((np.inf, -np.inf), (1.0, 0.9)) == (1.0, 0.9)
