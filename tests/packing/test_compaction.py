"""Compaction: packings that are jammed, balanced, free of overlap and reproducible."""

import numpy as np
import pytest
from packings import packed

from granforce.cell import Cell
from granforce.forces.balance import stress_of
from granforce.forces.build import ensemble
from granforce.motion import contact_dynamics as dynamics
from granforce.motion import flow, overdamped
from granforce.motion.rest import rest
from granforce.packing import settling
from granforce.packing.closing import _stretch, margin, strained
from granforce.packing.compaction import (
    WATCH_EVERY,
    _advance,
    _dilute_gas,
    default_steps,
    draw_radii,
    pack,
)
from granforce.packing.neighbours import find_pairs, separations
from granforce.packing.pair_list import _leant_back, cell_of, relisted
from granforce.records import Cancelled, InputError, NotJammedError, make_contacts, make_packing
from granforce.tolerances import CLOSED, LARGEST_FRICTION, MANY_DISKS, TOUCHING


def check(packing):
    """What every finished packing must show; returns its ensemble."""
    unit = packing.r.max()
    i, j, shift = find_pairs(packing.x, packing.r, packing.cell, 0.01 * unit)
    gap = separations(packing.x, packing.r, packing.cell, i, j, shift)[2]
    assert gap.min() > -1e-7 * unit
    assert np.abs(packing.contacts.gap).max() < 1e-6 * unit
    S = ensemble(packing)
    assert S.residual(S.original) < 1e-10
    assert S.violation(S.original) < 1e-9
    assert np.all(S.original[:, 0] > 0)
    # Rattlers carry nothing, the backbone does.
    outside = np.setdiff1d(np.arange(len(packing.r)), S.grains)
    assert S.skipped["rattlers"] == len(outside)
    off = np.setdiff1d(np.arange(len(packing.contacts.i)), S.index)
    assert np.abs(packing.forces[off]).max(initial=0) == 0
    return S


@pytest.mark.parametrize("mu", [0.001, 0.1, 1.0, 10.0])
def test_packings_are_jammed_at_every_friction(mu):
    S = check(packed(60, mu))
    # As many contacts as balance needs at the least: 2 N_c ≥ 3 M − 1.
    assert 3 - 1 / len(S.grains) <= S.coordination < 4.1


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_frictionless_packings_are_isostatic(seed):
    S = check(packed(60, 0.0, seed))
    assert len(S.index) == 2 * len(S.grains) - 1
    assert S.dimension == 0


@pytest.mark.parametrize("mu, seed", [(1e-5, 12), (1e-6, 13)])
def test_forces_on_their_cones_are_at_rest_at_once(mu, seed):
    """Most contacts slide there, to rounding, which steps of the test of rest never solved."""
    packing = pack(100, mu, seed, max_steps=1000)
    assert rest(packing).at_rest and packing.info["linear_programs"] < 20


@pytest.mark.parametrize("mu", [0.0, 0.01, 0.3, 3.0])
def test_contacts_of_the_backbone_are_closed_and_press(mu):
    S = ensemble(packed(60, mu))
    assert np.abs(S.contacts.gap).max() < 1e-10
    assert S.original[:, 0].min() > 1e-6 * S.force_scale


@pytest.mark.parametrize("mu", [0.01, 0.1, 1.0, 10.0])
def test_packings_are_at_rest_and_stay_there_with_noise(mu):
    packing = packed(60, mu)
    certificate = rest(packing, seed=1)
    assert certificate.at_rest and certificate.stayed.all() and certificate.distance < 1e-6
    assert packing.info["distance_to_rest"] < 1e-6


def test_large_packings_are_at_rest_in_more_draws_than_they_were_tested_with():
    packing = pack(MANY_DISKS + 1, 0.1, 2)
    check(packing)
    assert rest(packing).stayed.shape == (2, 2)
    certificate = rest(packing, draws=3, seed=1)
    assert certificate.at_rest and certificate.stayed.all() and certificate.distance < 1e-6


def test_a_state_that_fails_the_test_of_rest_again_and_again_ends_the_compaction(monkeypatch):
    """Nothing else stops it for minutes, as with `pack(11, 10, seed=100236)`."""
    tests = []

    def failing(packing, **conditions):
        tests.append(packing)
        return rest(packing, **conditions)._replace(at_rest=False, reason="grains move in a test")

    monkeypatch.setattr(settling, "rest", failing)
    with pytest.raises(NotJammedError, match=r"move in a test, and .* the same state"):
        pack(12, 1.0, 1)
    assert len(tests) == 3 * settling.ATTEMPTS
    assert settling.same_state(tests[-1], tests[-2])


def test_states_with_other_contacts_or_forces_are_not_the_same():
    packing = packed(60, 0.3)
    order = np.random.default_rng(0).permutation(len(packing.contacts.i))
    listed = packing._replace(contacts=packing.contacts.picked(order), forces=packing.forces[order])
    assert settling.same_state(packing, listed)
    assert settling.same_state(packing, packing._replace(forces=2 * packing.forces))
    changed = packing.forces.copy()
    changed[5] += 0.01
    fewer = packing._replace(
        contacts=packing.contacts.picked(order[1:]), forces=packing.forces[order[1:]]
    )
    for other in (packing._replace(forces=changed), fewer, pack(60, 0.3, 2)):
        assert not settling.same_state(packing, other)


@pytest.mark.parametrize("mu", [0.0, 0.1, 1.0])
def test_only_pairs_without_force_may_be_in_doubt(mu):
    for seed in range(1, 5):
        packing = packed(60, mu, seed)
        apart, gap = margin(packing), np.abs(packing.contacts.gap) / packing.r.max()
        assert gap[packing.forces[:, 0] > 0].max() < CLOSED
        assert apart.contact < TOUCHING <= apart.other
        assert apart.certain == (gap.max() < CLOSED)


def after(packing, steps):
    """The motion after further steps of the dynamics that a packing was made by, its last one."""
    unit, n = packing.r.max(), len(packing.r)
    mass = np.pi * (packing.r / unit) ** 2
    motion = _dilute_gas(packing.r / unit, np.random.default_rng(0), 1)
    c = packing.contacts
    d = packing.x[c.j] - packing.x[c.i]
    shift = np.round((c.normal * c.length[:, None] - d) / packing.box).astype(np.int64)
    motion = motion._replace(
        x=packing.x / unit,
        box=packing.box / unit,
        velocity=np.zeros((n, 3)),
        mass=mass,
        i=c.i,
        j=c.j,
        shift=shift,
        force=packing.forces / (unit * packing.pressure),
    )
    motion = relisted(motion)
    # Enough sweeps to solve every step: fewer shake a packing at rest. At small μ they never do.
    motion.pace[:] = 0.03, 1.0
    pace = dynamics.Pace(100.0, 0.003, 0.03, 0.02, 3000, 0, 0.01)
    counters, work = np.zeros(4, np.int64), {"list_rebuilds": 0}
    while counters[dynamics.STEPS] < steps:
        motion, _, _ = _advance(motion, packing.mu, pace, counters, work)
    return motion


@pytest.mark.parametrize("mu", [0.3, 1.0, 10.0])
def test_further_steps_of_the_dynamics_change_nothing(mu):
    packing = packed(60, mu)
    motion = after(packing, 800)
    S, unit = ensemble(packing), packing.r.max()
    assert np.abs(motion.x - packing.x / unit)[S.grains].max() < 1e-9
    assert np.abs(motion.box - packing.box / unit).max() < 1e-9
    pressing = motion.force[:, 0] > 1e-6 * S.force_scale
    backbone = np.isin(motion.i, S.grains) & np.isin(motion.j, S.grains)
    assert np.sum(pressing & backbone) == len(S.index)


def test_the_same_seed_gives_the_same_packing():
    one, two, other = pack(20, 0.3, 7), pack(20, 0.3, 7), pack(20, 0.3, 8)
    assert np.array_equal(one.x, two.x)
    assert np.array_equal(one.forces, two.forces)
    assert not np.array_equal(one.r, other.r)


def test_ten_disks_and_very_unequal_ones():
    check(pack(10, 0.5, 2))
    check(pack(60, 0.3, 2, radii="bidisperse:0.2,1,0.5"))


def test_radii_are_drawn_as_asked(rng):
    r = draw_radii("bidisperse:1,1.4,0.25", 40, rng)
    assert sorted(set(r)) == [1.0, 1.4]
    assert np.sum(r == 1.4) == 10
    r = draw_radii("uniform:0.5,1", 4000, rng)
    assert 0.5 <= r.min() < 0.51
    assert 0.99 < r.max() <= 1
    given = np.linspace(1, 2, 9)
    assert np.array_equal(draw_radii(given, 9, rng), given)


@pytest.mark.parametrize(
    "options, what",
    [
        ({"n": 2}, "at least 3 disks"),
        ({"mu": -0.1}, "friction coefficient"),
        ({"mu": np.nan}, "friction coefficient"),
        ({"mu": "much"}, "friction coefficient"),
        ({"radii": "uniform:1,0.5"}, "radii"),
        ({"radii": "gaussian:1,0.5"}, "radii"),
        ({"radii": [1.0, -1.0] * 10}, "radii"),
        ({"radii": [1.0] * 3}, "radii"),
        ({"pressure": 0}, "pressure"),
        ({"pressure": 1e300}, "pressure"),
        ({"pressure": 1e-300}, "pressure"),
        ({"radii": [1e200] * 20}, "radii"),
        ({"mu": 1e6}, "use at most 10000"),
        ({"dt": -1}, "dt"),
        ({"sweeps": 0}, "sweeps"),
        ({"accuracy": 1e300}, "accuracy"),
    ],
)
def test_bad_input_is_told_in_one_line(options, what):
    with pytest.raises(InputError, match=what) as caught:
        pack(**{"n": 20, "mu": 0.3, "seed": 0} | options)
    assert "\n" not in str(caught.value)


def test_a_budget_too_small_tells_the_state_reached():
    with pytest.raises(NotJammedError, match=r"not jammed after 75 steps: φ = 0\.\d+"):
        pack(40, 0.3, 0, max_steps=75)


def test_compaction_reports_and_can_be_cancelled():
    seen = []
    with pytest.raises(Cancelled):
        pack(40, 0.3, 0, progress=lambda *a: seen.append(a), cancel=lambda: len(seen) == 2)
    assert seen == [(25, None), (50, None)]


@pytest.mark.slow
@pytest.mark.parametrize("mu", [0, 0.001, 0.01, 0.03, 0.1, 0.3, 1, 3, 10])
@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5])
def test_four_hundred_disks_at_every_friction(mu, seed):
    S = check(pack(400, mu, seed))
    if mu == 0:
        assert len(S.index) == 2 * len(S.grains) - 1


@pytest.mark.slow
def test_ten_thousand_disks():
    check(pack(10_000, 0.1, 1))


@pytest.mark.parametrize("pressure, unit", [(-190, 190), (190, 190), (0, -190)])
def test_units_may_be_extreme(pressure, unit):
    pressure, unit = 2.0**pressure, 2.0**unit  # powers of two change no rounding
    radii = np.linspace(0.5, 1.0, 20)
    ours = pack(20, 0.3, 0, radii=radii)
    theirs = pack(20, 0.3, 0, radii=radii * unit, pressure=pressure)
    np.testing.assert_allclose(theirs.forces, ours.forces * pressure * unit, rtol=1e-6, atol=0)
    check(theirs)


def test_the_largest_friction_that_is_taken_works():
    check(pack(30, LARGEST_FRICTION, 1))


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_a_compaction_that_is_watched_gives_the_same_bits(mu):
    """From the gas on, grains inside a box that shrinks, contacts where disks touch."""
    seen = []
    alone, watched = pack(20, mu, 7), pack(20, mu, 7, watch=seen.append)
    assert np.array_equal(alone.x, watched.x) and np.array_equal(alone.forces, watched.forces)
    assert alone.info == watched.info
    first, last = seen[0], seen[-1]
    assert first.step == 0 and last.step == watched.info["steps"]
    assert set(np.diff([one.step for one in seen])) <= set(range(WATCH_EVERY + 1))
    assert np.all(last.box < first.box) and last.packing_fraction > first.packing_fraction + 0.2
    assert mu == 0 or last.unbalance < 1e-2 * seen[len(seen) // 4].unbalance
    for one in seen:
        assert np.all((one.x >= 0) & (one.x <= one.box))
        apart = one.x[one.j] - one.x[one.i] - one.reach  # a whole number of boxes
        assert np.allclose(apart / one.box, np.round(apart / one.box), atol=1e-9)
        assert np.all(one.forces[:, 0] > 0)
    touching = np.linalg.norm(last.reach, axis=1) - last.r[last.i] - last.r[last.j]
    assert np.abs(touching).max() < 1e-2


def test_what_is_watched_has_the_users_units():
    one, two = [], []
    pack(20, 0.3, 7, watch=one.append)
    pack(20, 0.3, 7, pressure=2.0**20, radii=f"uniform:{2.0**-11},{2.0**-10}", watch=two.append)
    assert np.array_equal(two[40].x, 2.0**-10 * one[40].x)
    assert np.array_equal(two[-1].forces, 2.0**10 * one[-1].forces)


@pytest.mark.parametrize("mu", [0.01, 0.3, 3.0])
def test_contacts_are_told_from_other_pairs_by_a_gap_in_the_gaps(mu):
    """Whether they carried or not: every pair that touches is a contact, and no other is near."""
    packing = packed(60, mu)
    apart = margin(packing)
    assert apart.certain and apart.contact < CLOSED and apart.other > TOUCHING
    assert (
        packing.info["largest_contact_gap"] * packing.r.max() == np.abs(packing.contacts.gap).max()
    )
    touching = find_pairs(packing.x, packing.r, packing.cell, TOUCHING)[0]
    assert len(touching) == len(packing.contacts.i)
    # Without one of its contacts that pair is another one, and it touches.
    c = packing.contacts
    less = packing._replace(contacts=c.picked(np.arange(1, len(c.i))))
    assert margin(less).other < CLOSED and not margin(less).certain


def test_no_grains_have_a_margin():
    none = np.zeros((0, 2))
    empty = make_packing(none, [], [3, 3], make_contacts([], [], none, [], np.zeros(0)), none, 0.3)
    assert margin(empty).contact == 0 < margin(empty).other


def test_a_margin_does_not_depend_on_units():
    one, unit = pack(20, 0.3, 7), 2.0**-10  # a power of two, so that nothing is rounded
    contacts = one.contacts._replace(gap=one.contacts.gap * unit)
    lengths = {"x": one.x * unit, "r": one.r * unit, "box": one.box * unit}
    assert margin(one._replace(contacts=contacts, **lengths)) == margin(one)


def test_steps_are_as_accurate_as_asked():
    """Each looks at its largest breach of the contact laws, and says where sweeps did not do."""
    few, many = pack(60, 0.1, 1, sweeps=40), pack(60, 0.1, 1, sweeps=5000)
    assert few.info["unfinished_steps"] > 5 * many.info["unfinished_steps"]


@pytest.mark.parametrize("n", [3, 4])
def test_too_few_disks_for_a_periodic_box_are_told(n):
    with pytest.raises(NotJammedError, match="too few"):
        pack(n, 0.3, 1)


@pytest.mark.parametrize("mu", [0.0, 0.01, 0.3, 10.0])
def test_isotropic_boxes_end_with_one_pressure_and_no_shear(mu):
    packing = pack(60, mu, 1, box="isotropic", pressure=3.0, radii="uniform:1,2")
    S = check(packing)
    np.testing.assert_allclose(stress_of(packing, packing.forces), [3, 3, 0], rtol=0, atol=3e-9)
    # The certificate against shear: its own network, judged with the stress prescribed.
    held = ensemble(packing, prescribed="stress", stress=(3, 3, 0))
    assert held.residual(packing.forces[held.index]) < 1e-10
    assert held.violation(packing.forces[held.index]) < 1e-9
    assert packing.tilt != 0
    assert packing.box[0] != packing.box[1]
    if mu == 0:
        # One more contact for each way in which the cell may strain besides the volume.
        assert len(S.index) == 2 * len(S.grains) + 1
        assert held.dimension == 0


def test_square_boxes_hold_a_shear_stress_that_isotropic_ones_do_not():
    with pytest.raises(NotJammedError):
        ensemble(packed(60, 0.3), prescribed="stress", stress=(1, 1, 0))
    with pytest.raises(
        InputError, match="box must be square, isotropic, floor or smooth floor, got 'round'"
    ):
        pack(20, 0.3, 0, box="round")


def test_rates_of_a_free_box_change_lengths_as_the_box_strains(rng):
    x, box, tilt = rng.uniform(0, 9, (30, 2)), np.array([9.0, 8.0]), 1.5
    cell, strain = Cell(box, tilt), 1e-6 * np.array([1.0, -2.0, 3.0])
    pairs = find_pairs(x, np.full(30, 0.5), cell, 1.0)
    normal, before, _ = separations(x, np.full(30, 0.5), cell, *pairs)
    after = separations(*_moved(x, cell, strain), *pairs)[1]
    expected = _stretch(normal, before, 3) @ strain
    np.testing.assert_allclose(after - before, expected, rtol=0, atol=1e-10)


def _moved(x, cell, strain):
    x, cell = strained(x, cell, strain)
    return x, np.full(len(x), 0.5), cell


def test_a_cell_that_leans_back_keeps_its_lattice(rng):
    motion = _dilute_gas(np.full(12, 1.0), rng, 3)
    motion.tilt[0] = 1.3 * motion.box[0]
    shift = np.array([[0, 1], [2, -1]])
    motion = motion._replace(shift=shift)
    back = _leant_back(motion)
    assert abs(back.tilt[0]) <= back.box[0] / 2
    np.testing.assert_allclose(
        back.shift @ cell_of(back).vectors, shift @ cell_of(motion).vectors, atol=1e-12
    )


@pytest.mark.parametrize("seed", [4, 5])
def test_overlaps_of_pairs_that_do_not_press_are_closed_in_one_round(monkeypatch, seed):
    """Halved in each round, they would keep a compaction from rest for eight rounds."""
    overlaps, gaps = [], settling._gaps

    def watched(motion):
        gap, pressing = gaps(motion)
        overlaps.append(-gap[~pressing].min())
        return gap, pressing

    monkeypatch.setattr(settling, "_gaps", watched)
    check(pack(400, 0.1, 700 + seed))
    assert len(overlaps) <= 4 and max(overlaps) < CLOSED


def unfinished(settled):
    """How many of 600 steps at μ = 1 end before they are accurate."""
    rng = np.random.default_rng(1)
    r = rng.uniform(0.5, 1.0, 100)
    motion = _dilute_gas(r / r.max(), rng, 1)
    motion.pace[:] = 0.003, dynamics.MOST_RELAXATION
    pace = dynamics.Pace(100.0, 0.003, 0.03, 0.02, 150, settled, 0.01)
    counters, work = np.zeros(4, np.int64), {"list_rebuilds": 0}
    for _ in range(24):
        motion, _, _ = _advance(motion, 1.0, pace, counters, work)
    assert counters[dynamics.STEPS] == 600
    return counters[dynamics.UNFINISHED]


def test_steps_that_settle_end_accurate_far_more_often():
    assert unfinished(0) > 5 * unfinished(30) > 0


def test_steps_by_friction_unless_something_else_is_asked_for():
    assert default_steps(0.19, None, None) == (0.1, 600)
    assert default_steps(0.2, None, None) == (0.03, 150)
    assert default_steps(10.0, 0.1, 600) == (0.1, 600)
    made, asked = pack(30, 1.0, 1), pack(30, 1.0, 1, dt=0.03, sweeps=150)
    assert np.array_equal(made.forces, asked.forces) and made.info["dt"] == 0.03


def test_drag_can_begin_later():
    """At the default nothing changes; later, there are more time steps, and the packing rests."""
    usual, same = pack(60, 3, 5), pack(60, 3, 5, drag_below=0.02)
    assert np.array_equal(usual.x, same.x) and np.array_equal(usual.forces, same.forces)
    late = pack(60, 3, 5, drag_below=2e-4)
    assert late.info["steps"] > usual.info["steps"] and rest(late).at_rest
    assert late.info["drag_below"] == 2e-4 and "drag_below" not in usual.info
    with pytest.raises(InputError, match=r"drag_below is not used at μ ≤ 0.0001"):
        pack(60, 1e-4, 5, drag_below=0.02)


def test_kernels_compiled_ahead_are_those_of_every_packing():
    def compiled():
        return [kernel.signatures for kernel in (overdamped.move, flow.until_one_ends)]

    pack(12, 0.5, 3)
    before = compiled()
    settling.compile_kernels()
    assert compiled() == before and all(before)
