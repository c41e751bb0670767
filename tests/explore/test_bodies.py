"""S drawn whole: its corners against every meeting of sides, its sides, its ends and its falls."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from packings import reference

import granforce as gf
from granforce.explore import bodies
from granforce.packing.scenes import sketched
from granforce.records import InputError

TESTS = Path(__file__).parents[1]
BODIES = [
    ("groove", 0.5),
    ("pyramid", 0.4),
    ("box", 0.1),
    ("box", 0.3),
    ("six", 0.3),
    ("leaning", 0.3),
    ("leaning", 0.5),
    ("solid", 0.5),
    ("solid", 0.3),
]


def every_meeting(S, found):
    """Corners by brute force: each h walls of the cones meet in a point, and some lie in S."""
    h, slopes, rests = len(found.axes), [], []
    for sign in (1, -1):
        slopes.append(S.mu * found.axes[..., 0] + sign * found.axes[..., 1])
        rests.append(S.mu * found.origin[:, 0] + sign * found.origin[:, 1])
    slope, rest = np.concatenate(slopes, axis=1).T, np.concatenate(rests)
    corners = []
    for rows in combinations(range(len(slope)), h):
        part = slope[list(rows)]
        if abs(np.linalg.det(part)) > 1e-9:
            u = np.linalg.solve(part, -rest[list(rows)])
            if np.all(rest + slope @ u > -1e-9):
                corners.append(u)
    return np.unique(np.round(corners, 7), axis=0)


@pytest.fixture(scope="module", params=BODIES, ids=str)
def seen(request):
    S = gf.ensemble(gf.scene(*request.param))
    return S, gf.body(S)


def test_corners_are_those_of_every_meeting_of_sides(seen):
    S, found = seen
    expected = every_meeting(S, found)
    assert len(found.corners) == len(expected)
    apart = np.linalg.norm(found.corners[:, None] - expected[None], axis=-1)
    assert apart.min(axis=0).max() < 1e-6


def test_corners_are_networks_and_coordinates_are_orthonormal(seen):
    S, found = seen
    networks = found.forces(found.corners)
    assert S.residual(networks).max() < 1e-12 and S.violation(networks).max() < 1e-12
    flat = found.axes.reshape(len(found.axes), -1)
    np.testing.assert_allclose(flat @ flat.T, np.eye(len(flat)), atol=1e-12)


def test_its_shadows_are_the_exact_intervals(seen):
    S, found = seen
    exact = gf.intervals(S)
    low, high = found.intervals
    np.testing.assert_allclose(low, exact.low, atol=2e-8 * S.force_scale)
    np.testing.assert_allclose(high, exact.high, atol=2e-8 * S.force_scale)


def test_sides_are_named_by_what_stops_there(seen):
    S, found = seen
    h = len(found.axes)
    assert len({tuple(sorted(side.corners)) for side in found.sides}) == len(found.sides)
    for side in found.sides:
        networks = found.forces(found.corners[side.corners])
        assert len(side.corners) >= h and len(side.stops)
        for contact, what in side.stops:
            normal, tangential = networks[:, np.searchsorted(S.index, contact)].T
            if what == bodies.OPENS:
                np.testing.assert_allclose(normal, 0, atol=1e-10)
            np.testing.assert_allclose(tangential, what * S.mu * normal, atol=1e-10)
        reach = found.corners @ side.normal
        assert reach[side.corners].min() >= reach.max() - 1e-10
    if h == 3:  # Euler: each edge lies in two faces
        edges = sum(len(side.corners) for side in found.sides) / 2
        assert len(found.corners) - edges + len(found.sides) == 2


def test_uniform_states_fill_it(seen):
    S, found = seen
    states = gf.sample_uniform(S, 50).flat - found.origin
    u = np.tensordot(states, found.axes, ((1, 2), (1, 2)))
    np.testing.assert_allclose(np.tensordot(u, found.axes, 1), states, atol=1e-9 * S.force_scale)
    for side in found.sides:
        wall = (found.corners[side.corners] @ side.normal).max()
        assert (u @ side.normal).max() <= wall + 1e-9


def test_a_point_is_a_body_of_no_dimension():
    found = gf.body(gf.ensemble(gf.scene("groove", 0)))
    assert found.corners.shape == (1, 0) and found.bounded and not found.sides
    np.testing.assert_allclose(found.intervals[1], [[np.sqrt(0.5), 0]] * 2, atol=1e-12)


def test_what_has_no_end_goes_on_inside_all_cones():
    S = gf.ensemble(gf.scene("box", 0.6))
    found = gf.body(S)
    assert len(found.rays) == 1 and not found.bounded
    for ray in np.tensordot(found.rays, found.axes, 1):
        assert np.abs(S.A @ S.to_vector(ray)).max() < 1e-12
        assert np.all(np.abs(ray[:, 1]) <= S.mu * ray[:, 0] + 1e-12)
        far = found.forces(found.corners[0]) + 1e3 * ray
        assert S.residual(far) < 1e-9 and S.violation(far) < 1e-9
    assert np.isinf(found.intervals[1]).any() and np.all(np.isfinite(found.intervals[0][:, 0]))


def groove(angle, ratio):
    """The Body of a disk of weight 1 in a groove, and its exact least and largest f_n.

    With half the angle α, f_n sin α + f_t cos α = 1/2 upwards, |f_t| ≤ μ f_n: f_n is least where
    f_t = μ f_n, and largest where f_t = −μ f_n, without end from μ = tan α on. ratio: μ / tan α.
    """
    half = np.radians(angle) / 2
    S = gf.ensemble(gf.scene("groove", ratio * np.tan(half), angle=angle))
    least = 0.5 / (np.sin(half) + S.mu * np.cos(half))
    largest = 0.5 / (np.sin(half) - S.mu * np.cos(half)) if ratio < 1 else np.inf
    return gf.body(S), least, largest


@pytest.mark.parametrize("angle", [10, 12.5, 30, 45, 60, 77, 90, 120, 150, 179])
def test_a_groove_ends_where_the_closed_form_says(angle):
    for ratio in (0.01, 0.3, 0.9, 0.99, *1 - 10.0 ** -np.array([3, 4, 5, 6, 8, 10])):
        found, least, largest = groove(angle, ratio)
        ends = np.sort(found.forces(found.corners)[:, :, 0], axis=0)
        assert found.bounded and len(found.corners) == 2 and len(found.sides) == 2
        # 10° is 10⁻¹⁵ off in the scene; rounding of an angle changes the tangent of its half, where
        # the groove locks, by the rounding times angle/sin(angle).
        locks = np.finfo(float).eps * np.radians(angle) / np.sin(np.radians(angle))
        error = max(1e-9, 2 * max(1e-14, locks) / (1 - ratio))
        np.testing.assert_allclose(ends, [[least] * 2, [largest] * 2], rtol=error)


@pytest.mark.parametrize("angle", [10, 30, 45, 90, 120, 150, 179.9])
def test_a_groove_locks_from_the_tangent_of_half_its_angle_on(angle):
    for ratio in (1, 1 + 1e-12, 1 + 1e-9, 1 + 1e-6, 1.001, 2, 8):
        found, least, _ = groove(angle, ratio)
        assert not found.bounded and len(found.rays) == len(found.corners) == 1
        np.testing.assert_allclose(found.forces(found.corners)[0, :, 0], least, rtol=1e-9)
        low, high = found.intervals
        np.testing.assert_allclose(low[:, 0], least, rtol=1e-9)
        assert np.all(np.isinf(high[:, 0]))


def test_sides_in_one_place_have_no_corner_of_their_own():
    """Two contacts open together: the sides of both are one edge, cut at a random place before."""
    S = gf.ensemble(gf.load_packing(TESTS / "attacks" / "n40_mu1_coincident.npz"))
    found = gf.body(S)
    assert len(found.axes) == 2 and len(found.corners) == len(found.sides)
    assert [len(side.corners) for side in found.sides] == [2] * len(found.sides)
    u = found.corners - found.corners.mean(axis=0)
    u = u[np.argsort(np.arctan2(u[:, 1], u[:, 0]))]
    edges = np.roll(u, -1, axis=0) - u
    after = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0]
    sizes = np.linalg.norm(edges, axis=1) * np.linalg.norm(after, axis=1)
    assert (turns / sizes).min() > 1e-6


def test_more_dimensions_cannot_be_drawn():
    with pytest.raises(InputError, match="accepts at most"):
        gf.body(gf.ensemble(reference("n100_mu0.1_s11")))


def test_what_nothing_balances_falls_as_the_certificate_says():
    packing = sketched("pyramid", 0.2)
    motion = gf.fall(packing)
    # Loads do work, and no force in a cone takes any: v_n ≥ μ |v_t| at every contact.
    assert (np.nan_to_num(packing.load)[:, :2] * motion[:, :2]).sum() > 0
    c = packing.contacts
    apart = motion[c.j] - motion[c.i]
    n_x, n_y = c.normal.T
    normal = apart[:, 0] * n_x + apart[:, 1] * n_y
    spin = motion[c.i, 2] * c.arm_i / packing.r[c.i] + motion[c.j, 2] * c.arm_j / packing.r[c.j]
    tangential = -apart[:, 0] * n_y + apart[:, 1] * n_x - spin
    assert np.all(normal >= packing.mu * np.abs(tangential) - 1e-9)
    assert motion[2, 1] < 0 and motion[0, 0] < 0 < motion[1, 0]  # the top sinks between the others
    assert gf.fall(sketched("pyramid", 0.4)) is None
