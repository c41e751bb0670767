"""Walls that count: outlines, directions, and forces measured on them."""

import numpy as np
import pytest
from frames import file

from granforce.experiment.infer import infer
from granforce.experiment.pegs import read_pegs
from granforce.experiment.walls import WallOutline, read_outline, read_wall_force
from granforce.forces.build import ensemble
from granforce.records import InputError

SIDE = 5


def in_a_box(*, press=(1.0, 2.0), leave=0.0, seed=0):
    """Equal disks in rows and columns between four walls; forces f_n = press along x and y."""
    rng = np.random.default_rng(seed)
    grains, rows = [], []
    for k in range(SIDE * SIDE):
        a, b = divmod(k, SIDE)
        edge = int(a in (0, SIDE - 1) or b in (0, SIDE - 1))
        grains.append([1, k + 1, 20.0 * a + 10, 20.0 * b + 10, 10.0, edge])
        for other, there, force in ((k + SIDE, a, press[0]), (k + 1, b, press[1])):
            if there < SIDE - 1 and rng.random() >= leave:
                rows.append([1, k + 1, other + 1, 0.0, force])
    return grains, rows


def read(grains, rows, **options):
    given = file(grains, "positions.txt"), file(rows, "adjacency.txt")
    return read_pegs(*given, **({"mu": 0.3, "reach": 0.1, "error": 0.1} | options))


@pytest.mark.parametrize("walls", ["box", "box:0,100,0,100"])
def test_forces_on_walls_are_inferred(walls):
    found = read(*in_a_box(), walls=walls)
    assert found.report["wall_contacts"] == 4 * SIDE and found.report["unbalanced"] == 0
    assert found.walls == ("left", "right", "bottom", "top")
    contacts, forces = found.packing.contacts, found.packing.forces
    for wall, (name, press) in enumerate(zip(found.walls, (1, 1, 2, 2), strict=True)):
        here = contacts.j == SIDE * SIDE + wall
        assert here.sum() == SIDE, name
        # A grain in a corner may lean on both its walls by friction: that is not determined.
        apart = np.flatnonzero(here)[1:-1]
        assert np.allclose(forces[apart], [press, 0.0], atol=1e-6), name
    assert np.isnan(found.packing.load).any(axis=1).sum() == 4
    assert found.added[-4 * SIDE :].all()


def test_a_load_cell_is_a_measurement_of_a_sum():
    """Half of the contacts are not known; the cells pull the sums to what they measured."""
    grains, rows = in_a_box()
    cells = {"right": (6.0, 0.0, 0.01), "top": (0.0, 11.0, 0.01)}
    plain = read(grains, rows, walls="box", error=1.0)
    found = read(grains, rows, walls="box", error=1.0, wall_forces=cells)
    assert found.walls[-2:] == ("cell of the right wall", "cell of the top wall")
    for wall, sum_of in ((1, [6.0, 0.0]), (3, [0.0, 11.0])):
        for one, near in ((found, 0.05), (plain, 2.0)):
            c = one.packing.contacts
            here = c.j == SIDE * SIDE + wall
            tangent = np.column_stack([-c.normal[:, 1], c.normal[:, 0]])
            force = one.packing.forces[:, :1] * c.normal + one.packing.forces[:, 1:] * tangent
            assert np.abs(force[here].sum(axis=0) - sum_of).max() < near
    held = found.packing.forces[-2:]
    assert np.allclose(held[:, 0], [6.0, 11.0], atol=0.05)
    S = ensemble(found.packing, prune=False)
    assert S.residual(found.packing.forces) < 1e-9
    # Error bars of the sum are those of the cell.
    S = ensemble(found.packing)
    drawn = infer(S, found.measured[S.index], found.sigma[S.index], states=400, unmeasured=1.0)
    assert drawn.error[-1, 0] == pytest.approx(0.01, rel=0.25)


def test_an_annulus_is_found_from_the_grains_at_its_walls(rng):
    turn = rng.uniform(0, 2 * np.pi, 80)
    r = rng.uniform(4, 6, 80)
    inner = np.arange(80) < 30
    away = np.where(inner, 50 + r, 200 - r)
    x = [300, 400] + away[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    from granforce.experiment import walls

    flag = np.where(inner, -1, 1)
    found = walls.fitted("annulus", x, r, np.ones(80, bool), flag)
    assert np.allclose(found.numbers, [300, 400, 50, 200], atol=1e-3)
    gap, ways = found.gaps(x, r)
    assert np.allclose(gap[np.arange(80), np.where(inner, 0, 1)], 0, atol=1e-3)
    assert np.allclose(np.hypot(*ways[:, 0].T), 1)
    circle = walls.fitted("circle", x[~inner], r[~inner], np.ones(50, bool), flag[~inner])
    assert np.allclose(circle.numbers, [300, 400, 200], atol=1e-3)


def test_words_for_walls():
    assert read_outline("box") == "box" and read_outline("open") == "open"
    assert read_outline("annulus:1,2,3,4") == WallOutline("annulus", (1, 2, 3, 4))
    assert read_wall_force("right: 1 2 0.1") == ("right", (1, 2, 0.1))
    wrong = ("square", "box:1,2", "box:2,1,0,1", "annulus:0,0,2,1", "circle:0,0,-1", "open:1")
    for text in (*wrong, "box:a,b,c,d", "box:nan,1,0,1"):
        with pytest.raises(InputError):
            read_outline(text)
    for text in ("right", "right: 1 2", "right: 1 2 0", "right: a b c"):
        with pytest.raises(InputError):
            read_wall_force(text)


@pytest.mark.parametrize(
    "options, words",
    [
        ({"wall_forces": {"right": (1, 0, 1)}}, "outline"),
        ({"walls": "box", "wall_forces": {"floor": (1, 0, 1)}}, "floor"),
        ({"walls": "annulus"}, "−1"),
    ],
)
def test_what_is_wrong_about_walls_is_told(options, words):
    with pytest.raises(InputError, match=words):
        read(*in_a_box(), **options)


def test_two_lines_of_a_grain_without_angles_are_contacts_with_two_sides():
    grains, rows = in_a_box()
    corner = [[1, 1, wall, 0.0, force] for wall, force in ((-1, 1.0), (-2, 2.0))]
    found = read(grains, rows + corner, walls="box")
    at_wall = (found.packing.contacts.i == 0) & (found.packing.contacts.j >= len(grains))
    assert found.measured[at_wall].tolist() == [[1.0, 0.0], [2.0, 0.0]]
