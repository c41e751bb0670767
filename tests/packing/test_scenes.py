"""Scenes against school mechanics: every answer here can be had with pencil and paper."""

import re

import numpy as np
import pytest
from scipy.optimize import linprog

import granforce as gf
from granforce.packing.assemblies import with_network
from granforce.packing.scenes import SCENES, assembled, sketched, weights
from granforce.records import InputError, NotJammedError

EXACT = 1e-10


def ends(S, cost):
    """Least and largest cost · f over S, cost (N_c, 2), by vertices of HiGHS; inf without end."""
    A, b, T = S.scaled_form
    gains = (S.to_vector(cost) @ T) * S.force_scale
    found = []
    for sign in (1, -1):
        answer = linprog(sign * gains, A_eq=A, b_eq=b, method="highs-ds")
        assert answer.status in (0, 3)  # an optimum, or no end
        found.append(sign * answer.fun if answer.status == 0 else -sign * np.inf)
    return found


def unit(S, contact, component):
    cost = np.zeros((len(S.index), 2))
    cost[contact, component] = 1
    return cost


@pytest.mark.parametrize(
    ("angle", "mu"),
    [(angle, mu) for angle in (40, 60, 90, 120, 150) for mu in (0, 0.1, 0.35)]
    + [(60, 0.5), (90, 0.5), (90, 0.9), (120, 1.5), (150, 3.5)],
)
def test_the_groove_has_both_ends_of_the_textbook(angle, mu):
    # Torque: f_t is the same at both walls; f_n too. Vertical: 2 (f_n sin α ± f_t cos α) = 1.
    half = np.radians(angle / 2)
    S = gf.ensemble(gf.scene("groove", mu, angle=angle))
    assert S.coordination == 2
    least = 0.5 / (np.sin(half) + mu * np.cos(half))
    largest = 0.5 / (np.sin(half) - mu * np.cos(half))
    for contact in (0, 1):
        low, high = ends(S, unit(S, contact, 0))
        assert (low, high) == pytest.approx((least, largest), abs=EXACT)
    low, high = gf.body(S).intervals
    np.testing.assert_allclose(low[:, 0], least, atol=EXACT)
    np.testing.assert_allclose(high[:, 0], largest, atol=EXACT)


@pytest.mark.parametrize("angle", [40, 90, 120])
def test_a_groove_locks_itself_where_friction_is_as_steep_as_its_walls(angle):
    locks = np.tan(np.radians(angle / 2))
    assert gf.body(gf.ensemble(gf.scene("groove", locks - 1e-6, angle=angle))).bounded
    S = gf.ensemble(gf.scene("groove", locks * (1 if angle == 90 else 1 + 1e-6), angle=angle))
    found = gf.body(S)
    assert not found.bounded
    # The certificate: along the ray no contact leaves its cone, and nothing else is balanced.
    ray = np.tensordot(found.rays[0], found.axes, 1)
    assert np.abs(S.A @ S.to_vector(ray)).max() < 1e-12
    assert np.all(ray[:, 0] > 0) and np.all(np.abs(ray[:, 1]) <= S.mu * ray[:, 0] + 1e-12)
    assert found.intervals[1][:, 0] == pytest.approx([np.inf, np.inf])
    exact = gf.intervals(S)
    np.testing.assert_allclose(exact.low, found.intervals[0], atol=1e-7)
    np.testing.assert_array_equal(exact.high[:, 0], np.inf)
    with pytest.raises(
        InputError, match=r"not bounded: .* Grain 0 .* is wedged .*contacts 0, 1"
    ) as raised:
        gf.sample_uniform(S)
    assert "Use a smaller friction coefficient" in str(raised.value)
    bounded = gf.Known([1], high=2 * S.force_scale)
    assert np.isfinite(gf.intervals(gf.ensemble(S.packing, known=bounded)).high).all()


@pytest.mark.parametrize("mu", [0, 0.3])
def test_all_wedged_rows_are_named_at_once(mu):
    x = np.array([(i + 0.5, j + 0.5) for j in range(3) for i in range(4)])
    packing = gf.from_disks(x, np.full(12, 0.5), mu, walls="box", gravity=1.0)
    with pytest.raises(InputError, match=r"Grains 0, 1, 2, 3, 4, 5, 6, 7 and 4 more") as raised:
        gf.sample_uniform(gf.ensemble(packing))
    message = str(raised.value)
    # A straight row between two walls needs no friction to be wedged.
    assert "smaller friction" not in message and "upper bound on f_n" in message
    if mu == 0:  # three rows, which share no direction: bounds on one contact of each are enough
        found = re.search(r"each of 3 groups, such as (\d+), (\d+), (\d+),", message)
        known = gf.Known(list(map(int, found.groups())), high=9.0)
        assert gf.intervals(gf.ensemble(packing, known=known)).converged


def test_two_disks_in_a_box_carry_their_weight():
    # The walls' friction F up on each side, the floor N: N + F_left + F_right = 2; and the torque
    # of both disks about the left wall's place balances.
    S = gf.ensemble(gf.scene("box", 0.3))
    contacts = S.contacts
    up = np.zeros((4, 2))
    to_wall = contacts.j >= 2
    up[to_wall, 0] = -contacts.normal[to_wall, 1]
    up[to_wall, 1] = -contacts.normal[to_wall, 0]
    assert ends(S, up) == pytest.approx([2, 2], abs=EXACT)
    # The upper disk rests on the line of centres at 45° and the right wall; without friction its
    # weight 1 needs f_n = √2 there, 1 at the walls, and 2 on the floor.
    smooth = gf.ensemble(gf.scene("box", 0))
    assert smooth.dimension == 0
    assert sorted(smooth.original[:, 0]) == pytest.approx([1, 1, np.sqrt(2), 2], abs=EXACT)
    # With friction: torque makes f_t the same on both its contacts (up at the wall, up along the
    # line): P/√2 + Q/√2 + Q = 1, |Q| ≤ μ P and μ N, N = (P − Q)/√2. Q < μ P is cut first by the
    # wall's cone, Q = μ (P − Q)/√2: P = 1/(1/√2 + (1/√2 + 1) q), q = μ/√2/(1 + μ/√2).
    pair = int(np.flatnonzero(contacts.j < 2)[0])
    q = 0.3 / np.sqrt(2) / (1 + 0.3 / np.sqrt(2))
    least = 1 / (np.sqrt(0.5) + (np.sqrt(0.5) + 1) * q)
    assert ends(S, unit(S, pair, 0))[0] == pytest.approx(least, abs=EXACT)
    assert gf.body(S).intervals[0][pair, 0] == pytest.approx(least, abs=EXACT)


@pytest.mark.parametrize("angle", [35, 45, 60])
def test_a_pyramid_stands_from_a_least_friction_on(angle):
    # Lower disks apart: torque on one of them makes f_t the same at the floor and at the top disk;
    # its horizontal forces give f_t/f_n = tan(θ/2) there, its top f_n = 1/2, the floor 3/2.
    half = np.tan(np.radians(angle / 2))
    S = gf.ensemble(gf.scene("pyramid", half + 1e-9, angle=angle))
    assert S.dimension == 0
    normal, tangential = S.original.T
    np.testing.assert_allclose(sorted(normal), [0.5, 0.5, 1.5, 1.5], atol=EXACT)
    np.testing.assert_allclose(np.abs(tangential), half / 2, atol=EXACT)
    with pytest.raises(NotJammedError):
        gf.scene("pyramid", half - 1e-6, angle=angle)


def test_the_close_pyramid_stands_on_the_same_friction():
    # Where the lower disks touch, they may press each other: S is a line, which begins where
    # they do not. There f_t/f_n = tan 15° = 2 − √3 on top, a third of it on the floor.
    S = gf.ensemble(gf.scene("pyramid", 0.4))
    low, _ = gf.body(S).intervals
    assert S.dimension == 1
    between = int(np.flatnonzero((S.contacts.i == 0) & (S.contacts.j == 1))[0])
    assert low[between, 0] == pytest.approx(0, abs=EXACT)
    opened = gf.body(S).forces(gf.body(S).corners)
    opened = opened[np.argmin(opened[:, between, 0])]
    ratio = np.abs(opened[:, 1]) / np.where(opened[:, 0] > 0.1, opened[:, 0], np.inf)
    assert ratio.max() == pytest.approx(2 - np.sqrt(3), abs=EXACT)
    assert sorted(ratio)[1] == pytest.approx((2 - np.sqrt(3)) / 3, abs=EXACT)
    gf.scene("pyramid", 2 - np.sqrt(3) + 1e-8)
    with pytest.raises(NotJammedError, match="no admissible force network"):
        gf.scene("pyramid", 2 - np.sqrt(3) - 1e-6)


def test_a_press_holds_disks_without_weight():
    # The wall's total friction is 0, and it has one contact: f_t = 0 there. Then each side of the
    # top disk bears as under a weight of 1: f_n = 1/2 with f_t/f_n = tan 15° where the lower two do
    # not press each other, and on the floor the same: no weight is added below.
    S = gf.ensemble(gf.scene("press", 0.4))
    lid = int(np.flatnonzero(S.contacts.j == 3)[0])
    assert S.dimension == 1 and len(S.packing.r) == 6
    assert ends(S, unit(S, lid, 0)) == pytest.approx([1, 1], abs=EXACT)
    assert ends(S, unit(S, lid, 1)) == pytest.approx([0, 0], abs=EXACT)
    between = int(np.flatnonzero((S.contacts.i == 0) & (S.contacts.j == 1))[0])
    corners = gf.body(S).forces(gf.body(S).corners)
    opened = corners[np.argmin(corners[:, between, 0])]
    carrying = opened[:, 0] > 0.1
    np.testing.assert_allclose(sorted(opened[carrying, 0]), [0.5] * 4 + [1], atol=EXACT)
    ratio = np.abs(opened[carrying, 1] / opened[carrying, 0])
    np.testing.assert_allclose(sorted(ratio), [0] + [2 - np.sqrt(3)] * 4, atol=EXACT)
    gf.scene("press", 2 - np.sqrt(3) + 1e-8)
    with pytest.raises(NotJammedError, match="no admissible force network"):
        gf.scene("press", 2 - np.sqrt(3) - 1e-6)


@pytest.mark.parametrize("mu", [0, 0.3])
def test_a_wall_that_presses_shares_its_force_among_its_disks(mu):
    # Two disks side by side on a floor, which do not touch: each carries any part of the force.
    walls = [[0, 0, 8, 0], [0, 2, 8, 2]]
    packing = assembled(
        [[2, 1], [6, 1]], [1, 1], walls, np.zeros((2, 3)), mu, pressing=np.array([0, 3.0])
    )
    S = gf.ensemble(with_network(packing))
    lid = S.contacts.j == 2
    assert ends(S, unit(S, int(np.flatnonzero(lid)[0]), 0)) == pytest.approx([0, 3], abs=EXACT)
    total = np.zeros((len(S.index), 2))
    total[lid, 0] = 1
    assert ends(S, total) == pytest.approx([3, 3], abs=EXACT)
    assert ends(S, np.roll(total, 1, axis=1)) == pytest.approx([0, 0], abs=EXACT)  # it may slide


@pytest.mark.parametrize("mu", [0.05, 0.2, 0.4])
def test_the_walls_of_a_column_carry_what_janssen_allows(mu):
    """What the floor bears of n disks between rough walls, by going down from disk to disk.

    Pair k (below disk k) carries P along the line of centres, at the angle θ from the vertical, and
    Q across. The torque on disk k makes the wall's friction F = Q_k − Q_{k−1}, so that its weight
    gives cos θ P + (1 + sin θ) Q = k: one unknown Q_k a pair, and H = P sin θ − Q cos θ presses on
    the wall. Cones: |Q| ≤ μ P, and |Q_k − Q_{k−1}| ≤ μ (H_k + H_{k−1}) at the wall. Both grow
    with Q_{k−1} as long as μ (1 + sin θ) < cos θ: the largest Q above lets it be largest below.
    On the floor B + G = n, with |G| ≤ μ B and |G − Q| ≤ μ (H − G) at the last wall, which some G
    obeys where Q ≤ H.
    """
    n, s, c = 10, 0.5, np.sqrt(0.75)

    def pressing(k):
        return (s / c) * k, -(1 + s) / c  # H = h0 + h1 Q

    q = {"least": 0.0, "largest": 0.0}
    above = 0.0, 0.0
    for k in range(1, n):
        h0, h1 = pressing(k)
        cone = mu * k / (c + mu * (1 + s)), -mu * k / (c - mu * (1 + s))
        up, down = q["largest"], q["least"]
        wall_up = (up + mu * (h0 + above[0] + above[1] * up)) / (1 - mu * h1)
        wall_down = (down - mu * (h0 + above[0] + above[1] * down)) / (1 + mu * h1)
        q = {"largest": min(cone[0], wall_up), "least": max(cone[1], wall_down)}
        above = h0, h1
    q["largest"] = min(q["largest"], above[0] / (1 - above[1]))
    wall_up = (q["largest"] + mu * (above[0] + above[1] * q["largest"])) / (1 + mu)
    wall_down = (q["least"] - mu * (above[0] + above[1] * q["least"])) / (1 - mu)
    friction = max(-mu * n / (1 - mu), wall_down), min(mu * n / (1 + mu), wall_up)
    S = gf.ensemble(gf.scene("column", mu))
    floor = int(np.flatnonzero((S.contacts.j >= 10) & (S.contacts.normal[:, 1] < -0.5))[0])
    assert ends(S, unit(S, floor, 0)) == pytest.approx(
        (n - friction[1], n - friction[0]), abs=EXACT
    )
    assert S.dimension == 10


def test_disks_under_pressure_have_as_many_dimensions_as_is_said():
    for name, disks, h in (("six", 6, 2), ("solid", 6, 3), ("thirteen", 13, 8)):
        packing = gf.scene(name)
        S = gf.ensemble(packing)
        assert (len(packing.r), S.dimension) == (disks, h)
        assert h > 3 or len(gf.body(S).axes) == h
        assert S.admits(S.original) and SCENES[name].packed
        assert gf.scene(name, 0.4).x.tolist() == packing.x.tolist()  # μ moves no disk


def test_scenes_are_listed_in_order_of_their_size():
    disks = [gf.scene(name).info.get("disks", len(gf.scene(name).r)) for name in SCENES]
    assert disks == sorted(disks)


@pytest.mark.parametrize("name", [name for name in SCENES if name != "many"])
def test_a_scene_is_kept_in_a_file(name, tmp_path):
    packing = gf.scene(name)
    S = gf.ensemble(packing)
    assert S.admits(S.original)
    gf.save_packing(packing, tmp_path / "scene.npz")
    again = gf.load_packing(tmp_path / "scene.npz")
    assert np.array_equal(again.forces, packing.forces) and again.info == packing.info
    assert np.array_equal(again.load, packing.load, equal_nan=True)


def test_a_disk_in_a_corner_is_touched_once_by_walls_that_meet():
    disk = assembled([[0, 1]], [1.0], [[-2, 0, 0, 0], [0, 0, 2, 0]], weights([1.0]), 0.3)
    assert len(disk.contacts.i) == 1


def pressed(x, wall):
    r = np.ones(len(x))
    r[1:] = 1.2
    return assembled(x, r, [wall], np.zeros((len(x), 3)), 0.3, pressing=[1.0])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: gf.scene("grove"), "choose one of groove, box"),
        (lambda: gf.scene("box", disks=3), "no option 'disks'"),
        (lambda: gf.scene("six", disks=5), "it has no options"),
        (lambda: gf.scene("groove", angle=200), "angle must lie between 10 and 180"),
        (lambda: gf.scene("groove", -1), "friction"),
        (lambda: assembled([[0, 0], [0, 1]], [1, 1], [], np.zeros((2, 3)), 0), "two disks overlap"),
        (lambda: assembled([[0, 0.5]], [1], [[-1, 0, 1, 0]], [[0, 0, 0]], 0), "a wall overlap"),
        (lambda: assembled([[0, 1]], [1], [[0, 0, 0, 0]], [[0, 0, 0]], 0), "no length"),
        (lambda: pressed([[0, 1], [0, -1.2]], [-3, 0, 3, 0]), "both sides"),
        (lambda: pressed([[-0.6, 0.8]], [0, 0, 3, 0]), "touches the end"),
        (lambda: assembled(np.empty((0, 2)), [], [], np.empty((0, 3)), 0), "no disks"),
    ],
)
def test_what_cannot_be_a_scene_is_refused(call, words):
    with pytest.raises(InputError, match=words):
        call()


@pytest.mark.parametrize("unit", [1e-9, 1e12])
def test_without_forces_the_loads_give_their_unit(unit):
    """A sketch in newtons has the bounds of one in the weight of a disk."""
    packing = sketched("pyramid")
    exact = gf.intervals(gf.ensemble(packing))
    other = gf.intervals(gf.ensemble(packing._replace(load=unit * packing.load)))
    assert exact.converged and other.converged
    np.testing.assert_allclose(other.high / unit, exact.high, atol=1e-7)


def test_an_unbalanced_sketch_is_there_to_be_looked_at():
    assert not sketched("pyramid", 0.1).forces.any()
