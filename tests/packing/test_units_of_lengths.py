"""Which bodies touch depends neither on the unit of length nor on the direction of the axes.

That S is the same in all units is tested in `forces/test_units.py`.
"""

import numpy as np
import pytest

import granforce as gf
from granforce.experiment.walls import fitted
from granforce.packing.scenes import BLOCKS, SCENES, assembled

UNITS = [1e-10, 1e-6, 1e-3, 1e3, 1e6, 1e10]
MU = 0.5


def turn(angle):
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def sketch(name):
    kind = SCENES[name]
    return kind.make(kind.mu), kind.mu


def of_disks(name, unit=1.0, angle=0.0, shift=(0.0, 0.0)):
    """A scene of disks in another unit of length, turned and moved."""
    (x, r, walls, load, pressing), mu = sketch(name)
    about = turn(angle)
    x, walls = unit * (x @ about + shift), unit * (walls.reshape(-1, 2) @ about + shift)
    load = np.column_stack([load[:, :2] @ about, unit * load[:, 2]])
    return assembled(x, unit * r, walls, load, mu, pressing=pressing)


def of_bodies(name, unit=1.0):
    """A scene of blocks in another unit of length, with weights of 1."""
    given = BLOCKS[name].make(BLOCKS[name].mu)
    held = np.isnan(given.load[:, 0])
    bodies = [unit * corners for corners in given.shapes.polygons()]
    return gf.blocks(bodies, given.mu, fixed=np.flatnonzero(held), weights=given.shapes.mass)


def assert_same_contacts(one, other):
    count = len(one.r)
    pairs = [sorted((c.i * count + c.j).tolist()) for c in (one.contacts, other.contacts)]
    assert pairs[0] == pairs[1]
    S, T = gf.ensemble(one), gf.ensemble(other)
    assert T.dimension == S.dimension and T.force_scale == pytest.approx(S.force_scale)


@pytest.mark.parametrize("name", [name for name, kind in SCENES.items() if not kind.packed][:-1])
def test_scenes_of_disks(name, rng):
    for unit in UNITS:
        turned = of_disks(name, unit, rng.uniform(0, 7), rng.uniform(-3, 3, 2))
        assert_same_contacts(of_disks(name), turned)


@pytest.mark.parametrize("name", [name for name in BLOCKS if name != "wall"])
def test_scenes_of_blocks(name):
    for unit in UNITS:
        assert_same_contacts(of_bodies(name), of_bodies(name, unit))


def from_ridge(unit, rng):
    """A disk balanced where two walls meet, and the ensemble of its contact."""
    a, b = rng.uniform(0.05, 1.5, 2)
    top = unit * rng.uniform(-5, 5, 2)
    slopes = [[-np.cos(a), -np.sin(a)], [np.cos(b), -np.sin(b)]]
    left, right = top + 3 * unit * np.array(slopes)
    walls = [[*left, *top], [*top, *right]]
    options = {"mu": MU, "walls": walls, "gravity": 1 / unit**2}
    return gf.ensemble(gf.from_disks([[top[0], top[1] + unit]], [unit], **options))


@pytest.mark.parametrize("unit", [1.0, *UNITS])
def test_a_disk_on_a_ridge_is_touched_once(unit, rng):
    for _ in range(20):
        S = from_ridge(unit, rng)
        assert S.dimension == 0 and len(S.index) == 1
        assert gf.intervals(S).high[0, 0] == pytest.approx(np.pi)


@pytest.mark.parametrize("unit", [1.0, *UNITS])
def test_walls_that_meet_are_touched_as_one(unit, rng):
    """A floor of overlapping parts, of parts that meet below the disk, and with a wall on it."""
    for offset in (0.0, 1e-12, 1e-7, -1e-7):
        for other in ([0.0, 0.0, 3.0, 0.0], [-1.0, 0.0, 3.0, 0.0], [0.0, 0.0, 0.5, -3.0]):
            walls = unit * np.array([[-3.0, 0.0, 0.0, 0.0], other])
            x = unit * np.array([[offset, 1.0]])
            S = gf.ensemble(gf.from_disks(x, [unit], MU, walls=walls, gravity=1 / unit**2))
            assert len(S.packing.contacts.i) == 1 and S.dimension == 0


@pytest.mark.parametrize("opening", [10.0, 90.0, 179.0, 179.9, 179.99])
def test_the_sides_of_a_groove_are_two_however_flat_it_is(opening):
    assert gf.ensemble(gf.scene("groove", MU, angle=opening)).dimension == 1


@pytest.mark.parametrize("unit", [1.0, *UNITS])
def test_outlines_of_frames_are_fitted(unit, rng):
    angle = np.linspace(0, 2 * np.pi, 41)[:-1]
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    x = np.concatenate([9 * ring, 3 * ring[::2]]) + [4, -2] + 0.05 * rng.standard_normal((60, 2))
    flag = np.repeat([1.0, -1.0], [40, 20])
    x, r = unit * x, np.full(60, 0.5 * unit)
    outline = fitted("annulus", x, r, flag != 0, flag)
    assert np.allclose(np.array(outline.numbers) / unit, [4, -2, 2.5, 9.5], atol=0.1)
