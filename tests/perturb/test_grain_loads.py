"""Loads on bodies: limit loads in closed form and from the literature, and critical loads."""

import numpy as np
import pytest
from packings import packed
from scipy.optimize import linprog

import granforce as gf
from granforce.packing.assemblies import with_network
from granforce.packing.masonry import rectangle

GROUND = rectangle(-5, -1, 5, 0)


def wall(courses, joints=True):
    packing = gf.scene("wall", 0.65, courses=courses)
    if joints:
        return gf.ensemble(packing)
    kept = np.abs(packing.contacts.normal[:, 1]) > 0.5
    contacts, forces = packing.contacts.picked(kept), 0 * packing.forces[kept]
    return gf.ensemble(with_network(packing._replace(contacts=contacts, forces=forces)))


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("mu, width", [(0.5, 1.0), (0.9, 0.6)])
def test_a_block_on_a_slope_slides_or_tips(mu, width, way):
    turn = np.radians(15)
    S = gf.ensemble(gf.scene("slope", mu, angle=15, width=width))
    load = np.zeros((2, 3))
    load[0, 0] = way * -S.packing.load[0, 1]
    expected = np.tan(np.arctan(min(mu, width)) + way * turn)
    found = gf.load_factor(S, load)
    assert found.factor == pytest.approx(expected, abs=1e-9) and found.gap <= 1e-7
    critical = gf.critical_load(S, load)
    assert critical.low <= found.factor * (1 + 1e-12)
    # One body alone moves where it slides or tips: friction of one pair is associated enough.
    assert critical.low >= 0.97 * expected


@pytest.mark.parametrize(
    "courses, joints, factor",
    [(6, True, 0.6429), (10, True, 0.58), (6, False, 0.64), (10, False, 0.563)],
)
def test_walls_bear_the_horizontal_loads_of_the_literature(courses, joints, factor):
    """5 blocks a course, μ = 0.65; Ferris and Tin-Loi (2001) have 0.643 and 0.564."""
    found = gf.load_factor(wall(courses, joints))
    assert found.factor == pytest.approx(factor, abs=6e-5) and found.gap <= 1e-8


def test_the_critical_load_of_a_wall_is_at_rest_and_below_its_limit():
    S = wall(10)
    found = gf.critical_load(S, precision=0.003)
    assert found.low <= found.high <= found.load_factor
    assert found.converged and found.residual <= 1e-10 and found.violation <= 1e-9
    # Sliding contacts do not dilate: motion sets in well below the limit.
    assert 0.55 < found.low < 0.57
    blocks = ~np.isnan(found.displacement[:, 0])
    assert blocks.sum() == 55 and found.displacement[blocks, 0].max() > 0.5
    assert found.high - found.low <= found.precision * found.load_factor * (1 + 1e-9)
    again = gf.critical_load(S, "horizontal", precision=0.003)
    assert (again.low, again.high) == (found.low, found.high)


@pytest.mark.parametrize("precision", [None, 0.02, 1e-6])
@pytest.mark.parametrize("thickness", [0.12, 0.3])
def test_the_precision_of_a_critical_load_is_relative_to_the_load_factor(thickness, precision):
    S = gf.ensemble(gf.scene("arch", 0.6, thickness=thickness))
    found = gf.critical_load(S, **({} if precision is None else {"precision": precision}))
    assert found.precision == (precision or 1e-4)
    assert found.converged and found.low > 0
    assert found.high - found.low <= found.precision * found.load_factor * (1 + 1e-9)


@pytest.mark.parametrize("precision", [0, -1, 0.5, np.nan, 1e-12])
def test_a_precision_that_cannot_be_reached_is_refused(precision):
    with pytest.raises(gf.InputError, match="precision must be"):
        gf.critical_load(gf.ensemble(gf.scene("slope")), precision=precision)


def test_a_push_between_two_blocks_is_a_load():
    """Both slide at μ W, one to either side."""
    packing = gf.blocks([rectangle(0, 0, 1, 1), rectangle(2, 0, 4, 1), GROUND], 0.3, fixed=[2])
    load = np.array([[-1, 0, 0], [1, 0, 0], [0, 0, 0]])
    assert gf.load_factor(gf.ensemble(packing), load).factor == pytest.approx(0.3)


@pytest.mark.parametrize("mu", [0.0, 0.4])
def test_a_load_may_press_on_contacts_that_carry_nothing_without_it(mu):
    stop = rectangle(1, 0, 2, 1)
    packing = gf.blocks([rectangle(0, 0, 1, 0.5), GROUND, stop], mu, fixed=[1, 2])
    S = gf.ensemble(packing)
    assert gf.load_factor(S).factor == np.inf
    back = np.zeros((3, 3))
    back[0, 0] = -1
    assert gf.load_factor(S, back).factor == pytest.approx(0.5 * mu, abs=1e-9)
    with pytest.raises(gf.InputError, match="every multiple of this load"):
        gf.critical_load(S)


def test_a_point_load_on_an_arch_agrees_with_linprog():
    packing = gf.scene("arch", 0.6, voussoirs=9, thickness=0.25)
    S = gf.ensemble(packing)
    load = np.zeros((11, 3))
    load[2] = 0.05, -1.0, 0.02
    found = gf.load_factor(S, load)
    c, count = packing.contacts, len(packing.contacts.i)
    A = np.zeros((27, 2 * count + 1))
    for body in range(9):
        A[3 * body : 3 * body + 3, -1] = load[body]
    cones = np.zeros((2 * count, 2 * count + 1))
    for k, point in enumerate(packing.contact_points):
        cones[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[-0.6, 1], [-0.6, -1]]
        for body, sign in ((c.i[k], -1), (c.j[k], 1)):
            if body >= 9:
                continue
            x, y = point - packing.x[body]
            for part, (f, g) in enumerate((c.normal[k], (-c.normal[k, 1], c.normal[k, 0]))):
                at = slice(3 * body, 3 * body + 3), 2 * k + part
                A[at] = sign * np.array([f, g, x * g - y * f])
    free = [(0, None), (None, None)] * count + [(0, None)]
    cost = np.append(np.zeros(2 * count), -1.0)
    theirs = linprog(cost, cones, np.zeros(2 * count), A, -packing.load[:9].ravel(), free)
    assert found.factor == pytest.approx(-theirs.fun, rel=1e-7)
    critical = gf.critical_load(S, load)
    assert 0 < critical.low <= found.factor


@pytest.mark.parametrize(
    "load, words",
    [
        ("vertical", 'load must be "horizontal"'),
        (np.zeros((2, 3)), "acts only on grains whose"),
        (np.ones((3, 3)), "the load must have shape"),
        ([[np.nan, 0, 0], [0, 0, 0]], "NaN"),
    ],
)
def test_what_cannot_be_a_load_is_refused(load, words):
    with pytest.raises(gf.InputError, match=words):
        gf.load_factor(gf.ensemble(gf.scene("slope")), load)


def test_a_prescribed_pressure_excludes_loads():
    with pytest.raises(gf.InputError, match="without a prescribed pressure"):
        gf.load_factor(gf.ensemble(packed(8, 0.3)))
