"""How bodies of small scenes move past the ends of S, checked by their kinematics."""

import numpy as np
import pytest
from test_polytope import drawn

import granforce as gf

PAST = """({ givesWay, Body }, { scene, contact, sign }) => {
    const body = new Body(scene).cut(scene.mu)
    body.goToEnd(2 * contact, sign)
    return [givesWay(body, contact, sign), [...body.forces()]]
}"""
SLIDE = """({ slide, Body }, { scene, ends }) => slide(new Body(scene).cut(scene.mu), ends)"""


def at_contacts(packing, poses):
    """Velocities (N_c, 2) of the first body relative to the second, for small poses as motions."""
    contacts, points = packing.contacts, packing.contact_points
    motion = np.zeros((len(packing.x), 3))
    motion[: len(poses)] = poses
    speed = []
    for grain in (contacts.i, contacts.j):
        arm = points - packing.x[grain]
        turned = motion[grain, 2:] * np.column_stack([-arm[:, 1], arm[:, 0]])
        speed.append(motion[grain, :2] + turned)
    return speed[0] - speed[1]


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("name, contact", [("ladder", 1), ("groove", 0), ("box", 2)])
def test_past_an_end_only_contacts_at_their_limits_slip(run, name, contact, sign):
    scene, packing = drawn(name, None), gf.scene(name)
    poses, forces = run(
        "learn/model/give_way learn/model/polytope", PAST, scene=scene, contact=contact, sign=sign
    )
    speed, (f_n, f_t) = at_contacts(packing, poses), np.reshape(forces, (-1, 2)).T
    normal = packing.contacts.normal
    along = np.column_stack([-normal[:, 1], normal[:, 0]])
    apart, slip = -np.sum(speed * normal, axis=1), -np.sum(speed * along, axis=1)
    # The wall that drives the motion moves by 1, into the body or away from it.
    expected = np.where(np.arange(len(normal)) == contact, sign, 0)
    np.testing.assert_allclose(apart, expected, atol=1e-6)
    at_limit = packing.mu * f_n - np.abs(f_t) < 1e-6
    assert at_limit.any() and np.all(np.abs(slip[~at_limit]) < 1e-6)
    assert np.all(slip * f_t < 1e-6) and np.abs(slip).max() > 0.1  # friction resists
    # Virtual work: what the forces gain at the contacts, the weights lose.
    count = len(poses)
    gained = np.sum(f_n * apart + f_t * slip)
    lost = np.sum(packing.load[:count, :2] * np.array(poses)[:, :2])
    assert gained == pytest.approx(-lost, abs=1e-6)


def test_inside_s_nothing_gives_way(run):
    answer = run(
        "learn/model/give_way learn/model/polytope",
        """({ givesWay, Body }, { scene }) => {
            const body = new Body(scene).cut(scene.mu)
            body.u = [...body.middle]
            return givesWay(body, 0, 1)
        }""",
        scene=drawn("groove", 0.5),
    )
    assert answer is None


def test_a_ladder_slides_along_floor_and_wall_until_it_lies(run):
    scene, packing = drawn("ladder", 0.2), gf.scene("ladder")
    ends = [
        {"at": point.tolist(), "inward": (-normal).tolist()}
        for point, normal in zip(packing.contact_points, packing.contacts.normal, strict=True)
    ]
    poses = np.array(
        run("learn/model/give_way learn/model/polytope", SLIDE, scene=scene, ends=ends)
    )
    (x, y, turn), centre = poses[:, 0].T, packing.x[0]
    cos, sin = np.cos(turn), np.sin(turn)
    for end, normal, point in zip(
        range(2), packing.contacts.normal, packing.contact_points, strict=True
    ):
        a, b = point - centre
        moved = np.column_stack([cos * a - sin * b + x, sin * a + cos * b + y]) + centre
        assert np.abs((moved - point) @ normal).max() < 0.02, end  # of its length
    assert np.all(np.diff(y) < 0) and centre[1] + y[-1] < 0.1
