"""What is prescribed and known: references, both judges, limit cases, contradictions with proof."""

import re
from pathlib import Path

import numpy as np
import pytest
from packings import REFERENCE, lattice, packed, reference, two_disks

import granforce as gf
from granforce.explore.intervals import intervals, limit_load_bounds
from granforce.forces.balance import stress_of
from granforce.forces.nearest_piqp import nearest_piqp
from granforce.tolerances import BALANCED, INTERVAL_GAP

NAME = "n100_mu0.1_s11"
LAMMPS = Path(__file__).parents[1] / "lammps"
ANY = np.inf


@pytest.fixture(scope="module")
def answers():
    return np.load(REFERENCE / f"{NAME}.known.npz")


def held(packing, contacts):
    """These contacts known to carry their own forces."""
    return gf.Known(contacts, packing.forces[contacts], packing.forces[contacts])


def normals(contacts, low, high):
    """Bounds on f_n alone."""
    nothing = np.full(len(contacts), ANY)
    return gf.Known(contacts, np.column_stack([low, -nothing]), np.column_stack([high, nothing]))


def within(S, bounds, states):
    slack = 1e-8 * S.force_scale
    return np.all((states >= bounds.low - slack) & (states <= bounds.high + slack))


def assert_bounds(S, expected):
    found = intervals(S)
    assert found.converged and found.max_gap <= INTERVAL_GAP
    off = np.stack([found.low, found.high], axis=-1) - expected[S.index]
    assert np.abs(off).max() < 1e-6 * S.force_scale
    return found


def test_bounds_at_prescribed_stress_agree_with_an_independent_program(answers):
    packing = reference(NAME)
    S = gf.ensemble(packing, prescribed="stress")
    assert stress_of(packing, packing.forces) == pytest.approx(answers["stress"], abs=1e-9)
    assert S.dimension == gf.ensemble(packing).dimension - 2
    assert_bounds(S, answers["stress_intervals"])


def test_bounds_given_some_normal_forces_agree_with_an_independent_program(answers):
    known = normals(answers["known"], answers["known_low"], answers["known_high"])
    S = gf.ensemble(reference(NAME), known=known)
    found = assert_bounds(S, answers["known_intervals"])
    drawn = gf.sample_uniform(S, 200, seed=1)
    assert drawn.reached and within(S, found, drawn.flat)
    walked = gf.walk(S, 5, 0)
    assert within(S, found, walked.states) and S.violation(walked.states).max() < 1e-15


def test_bounds_given_held_contacts_agree_with_an_independent_program(answers):
    S = gf.ensemble(reference(NAME), known=held(reference(NAME), answers["held"]))
    assert S.dimension == gf.ensemble(reference(NAME)).dimension - 10
    found = assert_bounds(S, answers["held_intervals"])
    drawn = gf.sample_uniform(S, 100, seed=1)
    assert within(S, found, drawn.flat)
    at = S.positions(answers["held"])
    own = reference(NAME).forces[answers["held"]]
    assert np.abs(drawn.flat[:, at] - own).max() < 1e-14


@pytest.mark.parametrize("mu", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("kind", ["stress", "sides", "pins", "mixed"])
def test_nearest_networks_agree_with_the_quadratic_program(mu, kind):
    packing = packed(40, 0.0)
    S = gf.ensemble(packing, mu)
    chosen, own = S.index[::6], packing.forces[S.index[::6]]
    wide = 0.2 * S.force_scale
    options = {
        "stress": {"prescribed": "stress"},
        "sides": {"known": gf.Known(chosen, own - wide, own + wide)},
        "pins": {"known": held(packing, chosen[:2])},
        "mixed": {
            "prescribed": "stress",
            "known": gf.Known(
                chosen[:4],
                [own[0], [own[1, 0], -ANY], [own[2, 0] - wide, own[2, 1]], [-ANY, own[3, 1]]],
                [own[0], [own[1, 0], ANY], [ANY, own[3, 1] + wide], [own[3, 0] + wide, own[3, 1]]],
            ),
        },
    }[kind]
    S = gf.ensemble(packing, mu, **options)
    rng = np.random.default_rng(2)
    for _ in range(3):
        start = S.original + S.force_scale * rng.uniform(-1, 1, S.original.shape)
        start[:, 1] *= mu > 0
        ours, theirs = gf.nearest(S, start), nearest_piqp(S, start)
        assert ours.converged and theirs.converged
        assert S.admits(ours.forces, BALANCED)
        assert np.abs(ours.forces - theirs.forces).max() < 1e-5 * S.force_scale


def test_lanes_do_not_know_their_company_where_forces_are_known():
    packing = packed(40, 0.3)
    own = packing.forces[[3, 8, 20]]
    S = gf.ensemble(packing, known=gf.Known([3, 8, 20], own - 0.2, own + 0.1))
    rng = np.random.default_rng(0)
    starts = S.original + S.force_scale * rng.uniform(-1, 1, (5, *S.original.shape))
    together = gf.nearest_of_many(S, list(starts))
    for start, found in zip(starts, together, strict=True):
        assert np.array_equal(gf.nearest(S, start).forces, found.forces)


@pytest.mark.parametrize("mu", [0.1, 0.5])
def test_bounds_agree_with_another_solver_and_shrink_as_more_is_known(mu):
    packing = packed(40, 0.0)
    S = gf.ensemble(packing, mu)
    before = intervals(S)
    chosen = S.index[[2, 11, 30]]
    wide = [0.05 * S.force_scale, ANY]
    own = packing.forces[chosen]
    K = gf.ensemble(packing, mu, known=gf.Known(chosen, own - wide, own + wide))
    after = intervals(K, K.index[::5])
    at = S.positions(after.contacts)
    slack = 1e-7 * S.force_scale
    assert np.all(after.low >= before.low[at] - slack)
    assert np.all(after.high <= before.high[at] + slack)
    from scipy.optimize import linprog

    A, b, T = K.scaled_form
    for k in range(0, len(after.contacts), 4):
        for part in (0, 1):
            cost = T.tocsr()[2 * K.positions(after.contacts[[k]])[0] + part].toarray().ravel()
            least = linprog(cost, A_eq=A, b_eq=b, bounds=(0, None)).fun
            assert after.low[k, part] / K.force_scale == pytest.approx(least, abs=1e-7)


def test_limit_loads_of_known_contacts_are_certified_and_no_larger():
    packing = packed(40, 0.3)
    S = gf.ensemble(packing)
    some, own = S.index[::9], packing.forces[S.index[::9]]
    pinned = held(packing, some[:2])
    K = gf.ensemble(packing, known=pinned)
    free, known = limit_load_bounds(S, some), limit_load_bounds(K, some)
    assert known.converged
    assert np.all(known.load <= free.load + 1e-7 * S.force_scale)
    K = gf.ensemble(packing, known=gf.Known(some, own - 0.1, own + 0.1))
    known = limit_load_bounds(K, some)
    assert known.converged
    assert np.all(known.load <= free.load + 1e-7 * S.force_scale)


def test_the_violation_of_what_is_known_is_judged():
    packing = packed(40, 0.1)
    S = gf.ensemble(packing, known=gf.Known([5], [0.5, -ANY], [ANY, ANY]))
    (at,) = S.positions([5])
    forces = S.original.copy()
    forces[at] = [0.3, 0.0]
    assert S.violation(forces) == pytest.approx(0.2 / S.force_scale)
    forces[at] = [0.6, 0.0]
    assert S.violation(forces) <= gf.ensemble(packing).violation(S.original)


def test_a_wrong_stress_is_an_unbalance():
    packing = packed(40, 0.3)
    plain, S = gf.ensemble(packing), gf.ensemble(packing, prescribed="stress")
    other = gf.sample_uniform(plain, 1, 1, seed=5).flat[0]
    assert plain.residual(other) <= BALANCED < S.residual(other)
    assert S.admits(S.original)
    drawn = gf.sample_uniform(S, 20, seed=1).flat
    spread = np.ptp(stress_of(packing, S.expand(drawn)), axis=0)
    assert np.abs(spread).max() < 1e-10


def test_any_stress_that_is_carried_may_be_prescribed():
    packing = packed(40, 0.3)
    other = gf.sample_uniform(gf.ensemble(packing), 1, 1, seed=5).flat[0]
    plain = gf.ensemble(packing)
    stress = stress_of(packing, plain.expand(other))
    S = gf.ensemble(packing, prescribed="stress", stress=stress)
    assert S.admits(other)
    assert S.prescribed == "stress" and S.has_pressure_row
    with pytest.raises(gf.NotJammedError, match="cannot carry this stress"):
        gf.ensemble(packing, prescribed="stress", stress=[1.0, 1.0, 0.9])


def test_a_network_by_another_simulator_lies_inside_s_at_its_own_stress():
    packing = gf.read_lammps(
        LAMMPS / "lammps_n400_mu0.3.particles.dump", LAMMPS / "lammps_n400_mu0.3.contacts.dump", 0.3
    )
    S = gf.ensemble(packing, prescribed="stress")
    assert S.residual(S.original) < 1e-8 and S.violation(S.original) < 1e-9
    assert S.dimension == gf.ensemble(packing).dimension - 2
    found = gf.nearest(S, S.original)
    assert found.converged
    assert np.abs(found.forces - S.original).max() < 1e-6 * S.force_scale
    some = S.index[::150]
    bounds = intervals(S, some)
    assert bounds.converged
    own, slack = packing.forces[some], 1e-6 * S.force_scale
    assert np.all((own >= bounds.low - slack) & (own <= bounds.high + slack))


def test_without_friction_the_stress_of_the_only_network_changes_nothing():
    packing = packed(40, 0.0)
    S = gf.ensemble(packing, prescribed="stress")
    assert S.dimension == 0
    assert gf.nearest(S, S.original).converged
    found = intervals(S, S.index[:4])
    assert found.high[:, 0] == pytest.approx(S.original[:4, 0], abs=1e-6)
    assert np.all(found.high[:, 1] == 0)
    K = gf.ensemble(packing, known=held(packing, S.index[:3]))
    assert K.admits(K.original) and K.dimension == 0
    with pytest.raises(gf.NotJammedError, match="these conflict: f_n ="):
        off = packing.forces[S.index[:1]] * 1.1
        gf.ensemble(packing, known=gf.Known(S.index[:1], off, off))


@pytest.mark.parametrize("triangular", [False, True])
def test_crystals_carry_any_stress_with_the_equal_network_inside(triangular):
    packing = lattice(6, 6, 0.4, triangular)
    S = gf.ensemble(packing, prescribed="stress", stress=[1.0, 1.0, 0.0])
    equal = np.zeros(S.original.shape)
    equal[:, 0] = 2 * packing.volume / len(equal)
    assert S.residual(equal) < 1e-12
    start = equal + np.random.default_rng(0).uniform(-1, 1, equal.shape)
    ours, theirs = gf.nearest(S, start), nearest_piqp(S, start)
    assert np.abs(ours.forces - theirs.forces).max() < 1e-6 * S.force_scale
    K = gf.ensemble(packing, known=gf.Known([0], [1.5, 0.1], [1.5, 0.1]))
    drawn = gf.sample_uniform(K, 8, seed=0)
    assert np.all(drawn.flat[:, 0] == [1.5, 0.1]) and drawn.residual.max() <= BALANCED


def test_a_stress_without_network_of_its_own_has_to_be_given():
    with pytest.raises(gf.InputError, match="give the stress"):
        gf.ensemble(lattice(6, 6, 0.4), prescribed="stress")


def test_frozen_surroundings_with_known_forces():
    packing = packed(40, 0.3)
    frozen = np.arange(0, len(packing.contacts.i), 3)
    S = gf.ensemble(packing, frozen=frozen)
    assert S.prescribed == "none"
    assert gf.ensemble(packing, frozen=frozen, prescribed="none").prescribed == "none"
    one = S.index[len(S.index) // 2]
    before = intervals(S, [one])
    middle = 0.5 * (before.low[0, 0] + before.high[0, 0])
    K = gf.ensemble(packing, frozen=frozen, known=normals([one], [middle], [ANY]))
    after = intervals(K, [one])
    assert after.low[0, 0] == pytest.approx(middle, abs=1e-7)
    assert after.high[0, 0] == pytest.approx(before.high[0, 0], abs=1e-7)
    with pytest.raises(gf.InputError, match="frozen at a force that contradicts"):
        gf.ensemble(packing, frozen=frozen, known=normals([3], [50.0], [60.0]))


def test_nothing_known_is_s_itself():
    packing = packed(40, 0.3)
    S = gf.ensemble(packing)
    nothing = [
        gf.Known([], np.zeros((0, 2)), np.zeros((0, 2))),
        gf.Known([3, 7], [-ANY, -ANY], ANY),
    ]
    for known in nothing:
        K = gf.ensemble(packing, known=known)
        assert K.known is None
        assert np.array_equal(intervals(K, [3]).high, intervals(S, [3]).high)
    # Bounds that say less than the cone: something is known, and nothing changes.
    K = gf.ensemble(packing, known=gf.Known([3, 7], -1.0, 1e3))
    assert intervals(K, [9]).high == pytest.approx(intervals(S, [9]).high, abs=1e-7)


@pytest.mark.parametrize("every", [1, 2])
def test_where_everything_is_known_or_follows_nothing_is_left_open(every):
    packing = reference(NAME)
    S = gf.ensemble(packing)
    K = gf.ensemble(packing, known=held(packing, S.index[::every]))
    assert K.dimension == 0
    found = intervals(K)
    assert found.converged and found.max_gap <= INTERVAL_GAP
    assert np.abs(found.high - packing.forces[K.index]).max() < 1e-8
    assert np.abs(found.low - packing.forces[K.index]).max() < 1e-8
    drawn = gf.sample_uniform(K, 4, 2)
    assert np.abs(drawn.flat - packing.forces[K.index]).max() < 1e-8
    assert gf.nearest(K, 1.5 * K.original).converged


def told(known, **options):
    with pytest.raises(gf.NotJammedError) as error:
        gf.ensemble(reference(NAME), known=known, **options)
    return str(error.value)


def test_a_force_beyond_its_bound_is_told_with_what_it_would_have_to_give():
    most = intervals(gf.ensemble(reference(NAME)), [10]).high[0, 0]
    for beyond in (1e-5, 0.3):
        message = told(normals([10], [most + beyond], [ANY]))
        assert "f_n ≥" in message and "on contact 10" in message
        given = float(re.search(r"must be relaxed by ([\d.e+-]+)\)", message)[1])
        assert given == pytest.approx(beyond, rel=0.02)


def test_statements_that_contradict_each_other_are_named_and_no_others():
    packing = reference(NAME)
    S = gf.ensemble(packing)
    most = intervals(S).high[:, 0]
    one = 10
    K = gf.ensemble(packing, known=normals([one], [0.9 * most[one]], [ANY]))
    other = int(np.argmax(np.where(S.index == one, 0, most - intervals(K).high[:, 0])))
    both = [one, S.index[other], S.index[100]]
    message = told(normals(both, [0.9 * most[one], 0.99 * most[other], 0.0], [ANY, ANY, 90.0]))
    named = {int(c) for c in re.findall(r"on contact (\d+)", message)}
    assert named == set(both[:2])
    # Each alone can hold, and together they do once one gives what it is told to.
    give = re.findall(r"contact (\d+) \(must be relaxed by ([\d.e+-]+)\)", message)
    low = dict(zip(both, [0.9 * most[one], 0.99 * most[other], 0.0], strict=True))
    for contact, amount in give:
        low[int(contact)] -= 1.01 * float(amount)
    gf.ensemble(packing, known=normals(both, list(low.values()), [ANY] * 3))


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        ([-2.0, -ANY], [-1.0, ANY], "contacts can only press; the bound must be relaxed by 1$"),
        ([0.5, 0.3], [1.0, ANY], "Coulomb's law at μ = 0.1; the bound .* must be relaxed by 2$"),
        ([0.5, -ANY], [1.0, -0.3], "f_t ≤ -0.3 contradict Coulomb's law"),
    ],
)
def test_what_coulombs_law_forbids_is_told(low, high, words):
    assert re.search(words, told(gf.Known([1], low, high)))


def test_friction_that_is_not_there_is_told():
    message = told(gf.Known([1], [0.0, 0.2], [1.0, ANY]), mu=0.0)
    assert message.endswith(
        "f_t ≥ 0.2, but f_t is 0 where μ is 0; the bound must be relaxed by 0.2"
    )


@pytest.mark.parametrize("mu", [1e-3, 0.3, 10.0, "mixed"])
def test_a_network_that_s_admits_may_be_known(mu):
    """Admissible forces exceed their cones by up to 10⁻⁹ ⟨f_n⟩, also where μ is 0."""
    packing = gf.scene("books", 0.8) if mu == "mixed" else packed(30, mu)
    friction = np.full(len(packing.contacts.i), 0.8 if mu == "mixed" else mu)
    if mu == "mixed":
        friction[::3] = 0.0
    S = gf.ensemble(packing, friction)
    states = gf.walk(S, 5, seed=1).states
    middle, state = states.mean(axis=0), states[-1]
    step = 1e-10
    while S.violation(state + step * (state - middle)) < 0.4e-9:
        step *= 1.5
    beyond = state + step * (state - middle)
    beyond[S.friction == 0, 1] = 0.4e-9 * S.force_scale * (S.residual(beyond) < 0.5e-10)
    for network in (*states, beyond):
        if not S.admits(network):
            continue
        K = gf.ensemble(packing, friction, known=gf.Known(S.index, network, network))
        bounds = intervals(K)
        assert K.dimension == 0 and bounds.converged
        given = S.expand(network)[bounds.contacts]
        assert max(np.abs(end - given).max() for end in bounds[1:3]) < 1e-8 * S.force_scale


def test_a_contact_that_carries_nothing_cannot_be_known_to_carry():
    S = gf.ensemble(reference(NAME))
    idle = np.setdiff1d(np.arange(len(S.packing.contacts.i)), S.index)
    for contact in idle:
        assert f"contact {contact}" in told(normals([contact], [0.2], [ANY]))
    K = gf.ensemble(reference(NAME), known=normals(idle, np.zeros(len(idle)), np.zeros(len(idle))))
    assert np.array_equal(K.index, S.index)


def test_a_side_left_out_is_open():
    packing, contact = gf.scene("groove", 0.3), 0
    for given, both in (
        ({"high": [[0.6, np.inf]]}, ([[-np.inf] * 2], [[0.6, np.inf]])),
        ({"low": [[0.6, -np.inf]]}, ([[0.6, -np.inf]], [[np.inf] * 2])),
    ):
        one = gf.intervals(gf.ensemble(packing, known=gf.Known([contact], **given)))
        two = gf.intervals(gf.ensemble(packing, known=gf.Known([contact], *both)))
        assert np.array_equal(one.low, two.low) and np.array_equal(one.high, two.high)
        free = gf.intervals(gf.ensemble(packing))
        assert not np.array_equal(one.low, free.low) or not np.array_equal(one.high, free.high)


def test_bounds_of_determined_forces_are_in_order_and_are_read_back(tmp_path):
    packing = gf.scene("box", 0)
    exact = gf.intervals(gf.ensemble(packing))
    assert np.array_equal(exact.low, exact.high)
    # As written by earlier versions, with rounding errors in either direction.
    table = tmp_path / "bounds.csv"
    rows = [f"{c},{f + 4e-16!r},{f!r}" for c, f in enumerate(exact.low[:, 0].tolist())]
    table.write_text("\n".join(["contact,f_n_low,f_n_high", *rows]))
    again = gf.intervals(gf.ensemble(packing, known=gf.read_known(table)))
    np.testing.assert_allclose(again.low, exact.low, rtol=1e-12)


@pytest.mark.parametrize(
    ("known", "words"),
    [
        (gf.Known([1], [1.001, 0], [1.0, 1]), "are contradictory"),
        (gf.Known([1, 1], [[2.0, -1], [0, -1]], [[9.0, 1], [1, 1]]), "are contradictory"),
        (gf.Known([1], [np.nan, 0], [1, 1]), "a bound is NaN"),
        (gf.Known([164], [0, 0], [1, 1]), "does not exist; the packing's contacts are 0 … 163"),
        (gf.Known([0.5], [0, 0], [1, 1]), "does not exist"),
        (gf.Known([1, 2], [[0, 1, 2]] * 2, [1, 1]), "bounds .k, 2."),
        (gf.Known(["a"], [0, 1], [1, 1]), "known must be"),
        (3, "known must be"),
    ],
)
def test_knowledge_that_makes_no_sense_is_refused(known, words):
    with pytest.raises(gf.InputError, match=words):
        gf.ensemble(reference(NAME), known=known)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"prescribed": "none"}, "scale of the forces is undetermined"),
        ({"prescribed": "strain"}, "pressure, stress or none"),
        ({"stress": [1, 1, 0]}, "not prescribed"),
        ({"prescribed": "stress", "stress": [1, 1]}, "shape"),
        ({"prescribed": "stress", "stress": [-1, 0.5, 0]}, "must be compressive"),
        ({"prescribed": "stress", "frozen": [1]}, "frozen"),
    ],
)
def test_conditions_that_make_no_sense_are_refused(options, words):
    with pytest.raises(gf.InputError, match=words):
        gf.ensemble(packed(40, 0.3), **options)


def test_contact_dynamics_is_refused_what_it_cannot_keep():
    packing = packed(40, 0.3)
    stress = gf.ensemble(packing, prescribed="stress")
    known = gf.ensemble(packing, known=gf.Known([1], [0, -ANY], [50.0, ANY]))
    for S in (stress, known):
        with pytest.raises(gf.InputError, match="use the nearest network"):
            gf.gauss_seidel(S, S.original)
    with pytest.raises(gf.InputError, match="without them"):
        gf.critical_force(known, S.index[3])


def test_at_prescribed_stress_a_packing_yields_below_its_limit_load():
    S = gf.ensemble(packed(40, 0.3), prescribed="stress")
    found = gf.critical_force(S, S.index[5])
    assert found.converged and found.low <= found.limit_load * (1 + 1e-9)
    assert found.residual <= 1e-9
    plain = gf.critical_force(gf.ensemble(S.packing), S.index[5])
    assert found.limit_load <= plain.limit_load * (1 + 1e-9)


def test_scales_with_the_pressure():
    packing = packed(40, 0.3)
    scaled = packing._replace(pressure=1e6, forces=1e6 * packing.forces)
    low, high = packing.forces[[4, 9]] - 0.2, packing.forces[[4, 9]] + 0.1
    S = gf.ensemble(packing, known=gf.Known([4, 9], low, high), prescribed="stress")
    T = gf.ensemble(scaled, known=gf.Known([4, 9], 1e6 * low, 1e6 * high), prescribed="stress")
    one, two = intervals(S, [12]), intervals(T, [12])
    assert two.high / 1e6 == pytest.approx(one.high, abs=1e-7)


def test_two_disks_between_their_images_know_each_others_force():
    packing = two_disks(pressure=3.0, height=4.0)
    S = gf.ensemble(packing, known=gf.Known([0], [20.0, -ANY], [30.0, ANY]))
    assert intervals(S).high[:, 0] == pytest.approx([24.0, 24.0], abs=1e-5)
    with pytest.raises(gf.NotJammedError, match="on contact 0"):
        gf.ensemble(packing, known=gf.Known([0], [25.0, -ANY], [30.0, ANY]))


@pytest.mark.parametrize(
    "known",
    [
        gf.Known(["3"], [2.0], [2.5]),
        gf.Known([3], ["2"], [2.5]),
        gf.Known([3, 4], [2.0], [2.5]),
        gf.Known([3, 4], [[2.0, 0.0]], 2.5),
    ],
)
def test_known_forces_are_numbers_one_for_each_contact(known):
    with pytest.raises(gf.InputError, match="contact numbers"):
        gf.ensemble(packed(20, 0.3), known=known)
