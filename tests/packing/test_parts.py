"""Bodies of several convex parts, and corners on corners with a given normal."""

import io
import itertools
import json
import warnings

import numpy as np
import pytest
from scipy.optimize import linprog

import granforce as gf
from granforce.cli.entry_point import main
from granforce.packing.masonry import rectangle
from granforce.study.kinds.packings import imported_parameters
from granforce.study.schema import dataset_packing, packing_dataset

GROUND = rectangle(-3, -1, 5, 0)
FOOT, ARM = rectangle(0, 0, 1, 3), rectangle(1, 2, 2, 3)


def bounds(packing, mu=None):
    """Places, normals and intervals of the contacts, in the order of their places."""
    exact = gf.intervals(gf.ensemble(packing, mu))
    rows = [packing.contact_points[exact.contacts], exact.low, exact.high]
    rows = np.round(np.hstack([rows[0], packing.contacts.normal[exact.contacts], *rows[1:]]), 7)
    return rows[np.lexsort(rows.T)] + 0.0


def test_an_l_stands_on_its_foot_however_it_is_divided_and_turned():
    divided = [rectangle(0, 0, 0.5, 2), rectangle(0.5, 0, 1, 2), rectangle(0, 2, 2, 3)]
    for parts in [*itertools.permutations([FOOT, ARM]), divided, [*divided[::-1]]]:
        packing = gf.blocks([parts, GROUND], 0.6, fixed=[1])
        assert packing.x[0] == pytest.approx([0.75, 1.75]) and packing.shapes.mass[0] == 4
        assert packing.contact_points == pytest.approx(np.array([[0, 0], [1, 0]]))
        assert packing.forces[:, 0] == pytest.approx([1, 3])
        # ∫ r² over both rectangles, about the centre of mass
        inertia = 3 * (10 / 12 + 0.25**2 + 0.25**2) + 2 / 12 + 0.75**2 + 0.75**2
        assert packing.shapes.inertia[0] == pytest.approx(inertia)
        assert gf.rest(packing).at_rest
    turned = [np.array(part)[:, ::-1] * [1, -1] for part in (FOOT, ARM, GROUND)]
    load = gf.blocks([turned[:2], turned[2]], 0.6, fixed=[1], balanced=False)
    aside = load._replace(load=load.load[:, [1, 0, 2]])
    assert gf.ensemble(aside).admits(
        np.array([[1.0, 0], [3.0, 0]])[np.argsort(-load.contact_points[:, 1])]
    )


def test_a_divided_wall_has_the_bounds_of_the_whole_one():
    stones = [rectangle(x, y, x + 2, y + 1) for y in range(3) for x in np.arange(3) * 2 + y % 2]
    ground = rectangle(-1, -1, 8, 0)
    halves = [
        [rectangle(*s[0], s[0, 0] + 1, s[2, 1]), rectangle(s[0, 0] + 1, *s[0, 1:], *s[2])]
        for s in stones
    ]
    whole = bounds(gf.blocks([*stones, ground], 0.5, fixed=[9]))
    np.testing.assert_allclose(
        bounds(gf.blocks([*halves, ground], 0.5, fixed=[9])), whole, atol=1e-6
    )
    # A corner that points at the joint of two parts touches their common surface.
    tip = [[1, 0], [2, -2], [0, -2]]
    packing = gf.blocks([halves[0], tip], 0.5, fixed=[1])
    assert packing.contact_points.tolist() == [[1, 0]] and packing.contacts.normal.tolist() == [
        [0, -1]
    ]


def test_parts_that_overlap_are_named():
    with pytest.warns(gf.InputWarning, match="parts of bodies 1 overlap: their common area"):
        overlapping = [rectangle(2, 0, 3, 1), rectangle(2.5, 0, 4, 1)]
        gf.blocks([[FOOT, ARM], overlapping, GROUND], 0.6, fixed=[2])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gf.blocks([[FOOT, ARM], GROUND], 0.6, fixed=[1])


def test_a_corner_in_a_notch_touches_both_sides():
    diamond = np.array([[1, 2], [1.3, 1.2], [1.8, 1.2], [1.8, 1.7]])
    packing = gf.blocks([[FOOT, ARM], diamond], 0.5, fixed=[0], balanced=False)
    assert sorted(np.round(packing.contacts.normal, 9).tolist()) == [[0, -1], [1, 0]]
    assert packing.info["corner_on_corner"] == []


def test_a_hook_holds_by_the_friction_of_its_bracket():
    """Torque about the edge: N = W/8 at the bottom; N ≤ μ (W + μ N) on top."""
    hook, wall = [rectangle(0, 0, 1, 1), rectangle(1, -2, 2, 1)], rectangle(-1, -3, 1, 0)
    packing = gf.blocks([hook, wall], 0.5, fixed=[1])
    least = 4 * (np.sqrt(17 / 16) - 1)
    assert gf.ensemble(packing, least + 1e-6).dimension >= 0
    with pytest.raises(gf.NotJammedError):
        gf.ensemble(packing, least - 1e-6)
    # Hooks in each other: both centres are beyond the contact, so that both arms are below 0.
    upper = [rectangle(0, 0, 1, 0.5), rectangle(-1, 0, 0, 4), rectangle(-1, 4, 4, 5)]
    lower = [rectangle(0.25, 0.5, 2, 1), rectangle(1.5, -3, 2, 0.5), rectangle(-4, -4, 2, -3)]
    hung = gf.blocks([lower, upper], 0.5, fixed=[1], balanced=False)
    assert (hung.contacts.length < 0).all() and hung.contacts.normal[:, 1] == pytest.approx(-1)


def test_a_table_on_three_legs_has_the_bounds_of_the_textbook():
    legs = [[[x - 0.2, 1], [x, 0], [x + 0.2, 1]] for x in (-1, 0, 1)]
    table = gf.blocks(
        [[rectangle(-1.2, 1, 1.2, 1.5), *legs], rectangle(-2, -1, 2, 0)], 0.0, fixed=[1]
    )
    exact, weight = gf.intervals(gf.ensemble(table)), table.shapes.mass[0]
    assert exact.high[:, 0] / weight == pytest.approx([0.5, 1, 0.5])
    assert exact.low[:, 0] / weight == pytest.approx([0, 0, 0], abs=1e-9)


def l_stones(rows, columns):
    """A wall of L-stones: one layer lies on its long sides, the next is the same turned around."""
    bodies = []
    for row, column in itertools.product(range(rows), range(columns)):
        x, y = 2.0 * column, 3.0 * row
        bodies.append([rectangle(x, y, x + 1, y + 2), rectangle(x + 1, y, x + 2, y + 1)])
        bodies.append([rectangle(x, y + 2, x + 1, y + 3), rectangle(x + 1, y + 1, x + 2, y + 3)])
    return [*bodies, rectangle(-2, -1, 2 * columns + 2, 0)]


def test_a_wall_of_l_stones_agrees_with_linprog_on_points_written_down():
    """Two interlocked L on the ground, in a frame of their own: torques about the origin."""
    mu, weight = 0.4, 3.0
    packing = gf.blocks(l_stones(1, 1), mu, fixed=[2])
    points = {  # (bodies, normal): ends of the shared edge; the first body is pushed back
        ((0, 1), (0, 1), (0, 2), (1, 2)), ((0, 1), (1, 0), (1, 1), (1, 2)),
        ((0, 1), (0, 1), (1, 1), (2, 1)), ((0, 2), (0, -1), (0, 0), (2, 0)),
    }  # fmt: skip
    columns, key = [], []
    for (i, j), normal, *ends in points:
        for at in ends:
            for direction in (np.array(normal), np.array([-normal[1], normal[0]])):
                column = np.zeros(6)
                for body, force in ((i, -direction), (j, direction)):
                    if body < 2:
                        column[3 * body : 3 * body + 3] = (
                            *force,
                            at[0] * force[1] - at[1] * force[0],
                        )
                columns.append(column)
            key.append((*at, *normal))
    centres = [(0.5 * 2 + 1.5) / 3, (0.5 + 1.5 * 2) / 3]
    load = np.concatenate([[0, weight, weight * x] for x in centres])
    cones = np.kron(np.eye(len(key)), [[-mu, 1], [-mu, -1]])
    mine = bounds(packing)
    order = np.lexsort(np.round(mine[:, :4], 6).T)
    for row in mine[order]:
        c = next(c for c, k in enumerate(key) if np.allclose(k, row[:4]))
        cost = np.zeros(len(columns))
        cost[2 * c] = 1.0
        for sign, value in ((1, row[4]), (-1, row[6])):
            found = linprog(
                sign * cost,
                cones,
                np.zeros(len(cones)),
                np.array(columns).T,
                load,
                bounds=(None, None),
            )
            assert value == pytest.approx(
                sign * found.fun if found.status == 0 else np.inf, abs=1e-6
            )
    assert len(mine) == len(key)


@pytest.mark.parametrize("angle", [45, 60, 75])
def test_a_house_of_two_cards_needs_its_friction(angle):
    """Cards without thickness: N = W cot θ / 2 at the top, held by μ W at each foot."""
    slope, thin = np.radians(angle), 1e-7
    top, across = (
        np.array([np.cos(slope), np.sin(slope)]),
        thin * np.array([-np.sin(slope), np.cos(slope)]),
    )
    left = np.array([0 * top, top / 2 - across, top, top / 2 + across])
    right = left * [-1, 1] + [2 * top[0], 0]
    house = gf.blocks(
        [left, right, GROUND], 1.0, fixed=[2], normals={(1, 0): 180}, weights=[1, 1, 1]
    )
    least = 0.5 / np.tan(slope)
    assert gf.ensemble(house, least + 1e-6).dimension >= 0
    with pytest.raises(gf.NotJammedError):
        gf.ensemble(house, least - 1e-6)
    with pytest.raises(gf.NotJammedError, match=r"corner on corner, .*\(normals="):
        gf.blocks([left, right, GROUND], 1.0, fixed=[2])


BODIES = {
    "bodies": [
        {"corners": GROUND.tolist(), "fixed": True},
        {"parts": [{"corners": FOOT.tolist()}, {"corners": ARM.tolist()}], "density": 2},
        {"parts": [{"disk": [0.5, 3.5, 0.5]}, {"disk": [1.5, 3.5, 0.5]}]},
    ]
}
ROWS = "body,part,x,y,r,density,fixed\n" + "".join(
    f"{body},{part},{x},{y},0,{density},{int(body == 'ground')}\n"
    for body, part, density, corners in (
        ("ground", "", 1, GROUND), ("l", "a", 2, FOOT), ("l", "b", 2, ARM)
    )
    for x, y in corners.tolist()
) + "clump,1,0.5,3.5,0.5,1,0\nclump,2,1.5,3.5,0.5,1,0\n"  # fmt: skip


def test_bodies_of_parts_are_read_written_and_drawn_as_from_arrays(tmp_path):
    clump = [[0.5, 3.5, 0.5], [1.5, 3.5, 0.5]]
    own = gf.blocks([GROUND, [FOOT, ARM], clump], 0.6, fixed=[0], weights=[1, 8, np.pi / 2])
    for text in (json.dumps(BODIES), ROWS):
        read = gf.read_blocks(io.StringIO(text), mu=0.6)
        assert read.forces == pytest.approx(own.forces) and read.x == pytest.approx(own.x)
    gf.save_packing(own, tmp_path / "parts.npz")
    for again in (gf.load_packing(tmp_path / "parts.npz"), dataset_packing(packing_dataset(own))):
        assert imported_parameters(again) == imported_parameters(own)
        assert again.shapes.part_corners()[1].tolist() == FOOT.tolist()
    assert own._repr_svg_().count("<polygon") == 3
    path = own.shapes.polygons()[1]
    ahead = np.roll(path, -1, axis=0)
    assert np.sum(path[:, 0] * ahead[:, 1] - path[:, 1] * ahead[:, 0]) == pytest.approx(8)
    assert gf.plot(own, backend="matplotlib") is not None
    assert np.isfinite(gf.load_factor(gf.ensemble(own)).factor)
    assert gf.critical_load(gf.ensemble(own), precision=1e-2).low >= 0


@pytest.mark.parametrize(
    "bodies, options, words",
    [
        ([[]], {}, "body 0 has no parts"),
        ([[[], FOOT]], {}, "part 0 of body 0"),
        ([3.0], {}, "body 0 has no parts"),
        ([[FOOT, [[0, 0], [2, 0], [1, 0.5], [1, 2]]]], {}, "part 1 of body 0 is not convex"),
        ([[FOOT, [0, 0, -1]]], {}, "part 1 of body 0 is a disk of radius -1"),
        ([[FOOT, "disk"]], {}, "part 1 of body 0"),
        ([[FOOT, [[0, 0], [1, 0]]]], {}, "only a fixed body can be a thin wall"),
        ([[FOOT, ARM], rectangle(1, 0, 3, 2.5)], {}, "bodies 0 and 1 overlap by 0.5"),
        ([FOOT, GROUND], {"normals": {(0, 1): 90}}, "do not meet corner on corner"),
        ([FOOT, GROUND], {"normals": {(0, 2): 90}}, "normals are of pairs of bodies 0 … 1"),
        ([FOOT, GROUND], {"normals": [0, 1, 90]}, "normals must be"),
        ([FOOT, GROUND], {"normals": {(0, 1): 90, (1, 0): -90}}, "is given twice"),
        ([FOOT, rectangle(1, 3, 2, 4)], {"normals": {(0, 1): np.nan}}, "contains NaN"),
        ([FOOT, rectangle(1, 3, 2, 4)], {"normals": {(0, 1): -90}}, "does not point from one"),
    ],
)  # fmt: skip
def test_what_are_no_bodies_of_parts_is_one_line(bodies, options, words):
    with pytest.raises(gf.InputError, match=words) as refused:
        gf.blocks(bodies, 0.5, **options)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "change, words",
    [
        (("parts", "part"), 'body 1 must have either "corners", "disk" or "parts"'),
        (('"disk": [0.5, ', '"density": 1, "disk": [0.5, '), "part 0 has 'density'"),
        (('{"parts": [{"disk"', '{"parts": []}, {"parts": [{"disk"'), '"parts" is a list'),
        (('{"bodies"', '{"normals": [[0, 1]], "bodies"'), r'"normals" is \[\[0, 1, 90\], …\]'),
        (('{"bodies"', '{"normals": [[0, 1, 90]], "bodies"'), "do not meet corner on corner"),
    ],
)  # fmt: skip
def test_what_are_no_parts_in_a_file_is_one_line(change, words):
    text = json.dumps(BODIES)
    assert change[0] in text
    with pytest.raises(gf.InputError, match=words) as refused:
        gf.read_blocks(io.StringIO(text.replace(*change)), mu=0.5)
    assert "\n" not in str(refused.value)


def test_wedged_bodies_are_named_everywhere(tmp_path, capsys):
    """Two stones between fixed walls, beside one that stands free."""
    stones = [rectangle(0, 0, 1, 1), rectangle(1, 0, 2, 1), [[5, 0], [6, 0], [5.5, 1]]]
    fixed = [rectangle(-1, -1, 0, 2), rectangle(2, -1, 3, 2), rectangle(4, -1, 7, 0)]
    packing = gf.blocks([*stones, *fixed], 0.6, fixed=[3, 4, 5])
    assert packing.info["wedged"] == [0, 1]
    S = gf.ensemble(packing)
    exact = gf.intervals(S, [int(S.index[-1])])
    assert exact.wedged.tolist() == gf.rest(S).wedged.tolist() == [0, 1]
    assert gf.intervals(gf.ensemble(gf.scene("groove", 0.9))).wedged.size == 0
    gf.save_packing(packing, tmp_path / "wedged.npz")
    words = "2 grains are wedged (0, 1, counted from 0)"
    for command in ("intervals", "rest"):
        store = ["--cache", str(tmp_path / "store")] if command == "intervals" else []
        assert main([command, str(tmp_path / "wedged.npz"), *store]) == 0
        assert words in capsys.readouterr().err
    bodies = [
        {"corners": np.array(body).tolist(), "fixed": k > 2}
        for k, body in enumerate([*stones, *fixed])
    ]
    read = gf.read_blocks(io.StringIO(json.dumps({"bodies": bodies})), mu=0.6)
    assert words in read.info["notes"][0]
