"""What the page is told of small scenes: links, words, scenes built by hand, and what falls."""

import io

import numpy as np
import pytest

import granforce as gf
from app.background.jobs import Task
from app.learn.model import small_scenes
from app.learn.workbench.workbench import Workbench
from app.state import scene_links
from granforce.live import hulls
from granforce.records import InputError

UNDER_PRESS = "1,1,1;3,1,1;2,2.732050807569,1|0,0,4,0;0.4,3.732050807569,3.6,3.732050807569|p1"
PYRAMID = "1,1,1;3,1,1;2,2.732050807569,1|0,0,8,0"


@pytest.mark.parametrize(
    ("query", "scene", "mu"),
    [
        ("", "many", None),
        ("?scene=box&mu=0.3", "box", 0.3),
        ("?scene=groove", "groove", None),
        ("?scene=elsewhere", "groove", None),
        ("?scene=many", "many", None),
        ("?scene=imported", "imported", None),
        ("?scene=ladder", "ladder", None),
        ("?mu=0.1&n=30", "many", 0.1),  # links from before there were scenes
        ("?scene=box&mu=steep", "box", None),
    ],
)
def test_links_name_a_scene(query, scene, mu):
    asked = scene_links.request_of(query)
    assert (asked.scene, asked.mu) == (scene, mu)
    assert "scene" not in asked.query
    assert ("tab=upload" in asked.query) == (scene == "imported")  # where its files are dropped


def test_every_scene_of_the_library_is_on_the_list():
    listed = [name for name, *_ in scene_links.titles()]
    assert listed[0] == scene_links.FIRST and set(listed) >= {"many", "own", "column"}
    for name, _, page in scene_links.titles():  # which the list says beforehand
        assert page == ("Explore" if name in scene_links.LARGE else "Learn")


@pytest.mark.parametrize("name", scene_links.SMALL)
def test_forces_less_equations_is_free(name):
    drawn = small_scenes.drawn(name)
    count = len(drawn["i"])
    assert 2 * count - drawn["equations"] == drawn["h"] == gf.ensemble(gf.scene(name)).dimension
    assert len(drawn["names"]) == count


def test_the_ladder_is_drawn_between_two_lines_and_stones_have_two_ends():
    ladder, stones = small_scenes.drawn("ladder"), small_scenes.drawn("stones")
    assert ladder["names"] == ["at the floor", "at the wall"] and ladder["h"] == 1
    assert len(ladder["walls"]) == 2 * 4 and len(ladder["outlines"]) == 1
    assert stones["names"][:2] == [
        f"between stones 1 and 2 ({end} end)" for end in ("lower", "upper")
    ]
    assert len(set(stones["names"])) == len(stones["i"]) and len(stones["x"]) == 2 * 3


def test_a_hull_holds_all_networks_and_nothing_else():
    packing = gf.scene("leaning")
    found = hulls.hull(packing)
    x = found.lift @ found.b
    u = np.random.default_rng(0).normal(size=len(found.axes))
    np.testing.assert_allclose(found.A @ (x + u @ found.axes), found.b, atol=1e-12)
    np.testing.assert_allclose(found.axes @ found.axes.T, np.eye(len(u)), atol=1e-12)
    own = packing.forces.ravel() - x
    np.testing.assert_allclose((own @ found.axes.T) @ found.axes, own, atol=1e-12)


def test_a_built_scene_is_that_of_the_library():
    built, made = small_scenes.built_packing(PYRAMID, 0.4), gf.scene("pyramid", 0.4)
    assert len(built.contacts.i) == len(made.contacts.i)
    low, high = gf.body(gf.ensemble(built)).intervals
    expected = gf.body(gf.ensemble(made)).intervals
    np.testing.assert_allclose(low, expected[0], atol=1e-9)
    np.testing.assert_allclose(high, expected[1], atol=1e-9)


def test_a_built_scene_is_saved_and_opened_by_the_library():
    file = small_scenes.file_of(small_scenes.built_packing(PYRAMID, 0.4))
    packing = gf.load_packing(io.BytesIO(file))
    assert gf.ensemble(packing).admits(packing.forces)
    # Where nothing balances, the disks are kept, and the library says why.
    empty = gf.load_packing(
        io.BytesIO(small_scenes.file_of(small_scenes.built_packing(PYRAMID, 0.1)))
    )
    with pytest.raises(gf.NotJammedError):
        gf.ensemble(empty)


def test_walls_of_a_built_scene_press():
    built, made = small_scenes.built_packing(UNDER_PRESS, 0.4), gf.scene("press", 0.4)
    assert not built.load[:3].any() and built.load[3].tolist() == [0, -3.2, 0]  # as it is long
    expected = gf.body(gf.ensemble(made)).intervals
    for end, exact in zip(gf.body(gf.ensemble(built)).intervals, expected, strict=True):
        np.testing.assert_allclose(end, 3.2 * exact, atol=1e-9)
    drawn = small_scenes.drawn(scene_links.OWN, 0.4, UNDER_PRESS)
    assert (drawn["h"], drawn["equations"], len(drawn["i"])) == (1, 11, 6)
    assert drawn["names"][-1] == "disk 3 at the press"


def test_a_scene_under_a_press_is_saved_and_opened_by_the_library():
    packing = gf.load_packing(
        io.BytesIO(small_scenes.file_of(small_scenes.built_packing(UNDER_PRESS, 0.4)))
    )
    S = gf.ensemble(packing)
    assert S.admits(packing.forces) and S.dimension == 1
    assert packing.info["pressing"] == [1]


def test_blocks_are_built_as_the_library_places_them():
    angle = np.radians(20)
    x = [-0.5 * np.sin(angle), 0.5 * np.cos(angle)]
    text = f"{x[0]},{x[1]},1,1,20|{-np.cos(angle)},{-np.sin(angle)},1,{np.tan(angle)}"
    built, made = small_scenes.built_packing(text, 0.5), gf.scene("slope", 0.5)
    for end in range(2):
        bounds = [gf.intervals(gf.ensemble(packing))[end] for packing in (built, made)]
        np.testing.assert_allclose(*(np.sort(bound, axis=0) for bound in bounds), atol=1e-9)
    drawn = small_scenes.drawn(scene_links.OWN, 0.5, text)
    assert (drawn["one"], len(drawn["walls"]), len(drawn["outlines"])) == ("block", 4, 1)
    assert sorted(drawn["names"]) == ["at the floor (left end)", "at the floor (right end)"]
    again = gf.load_packing(io.BytesIO(small_scenes.file_of(built)))
    assert gf.ensemble(again).admits(again.forces) and again.shapes.sides.tolist() == [4, 2]


def test_a_wall_presses_a_block_and_a_disk():
    text = "1,0.5,2,1,0;2.5,0.5,0.5|0,0,4,0;0,1,4,1|p1"
    built, drawn = (
        small_scenes.built_packing(text, 0.5),
        small_scenes.drawn(scene_links.OWN, 0.5, text),
    )
    assert not built.load[:2].any() and built.load[2].tolist() == [0, -4, 0]
    assert drawn["one"] == "body" and drawn["names"][0] == "between bodies 1 and 2"
    forces = gf.load_packing(io.BytesIO(small_scenes.file_of(built))).forces
    above = np.array(["press" in name for name in drawn["names"]])
    np.testing.assert_allclose(forces[above].sum(axis=0), [4, 0], atol=1e-9)


def test_where_no_wall_presses_yet_nothing_is_said_of_forces():
    drawn = small_scenes.drawn(scene_links.OWN, 0.4, UNDER_PRESS[:-1])
    assert "b" not in drawn and drawn["idle"]
    alone = small_scenes.drawn(
        scene_links.OWN, 0.4, "1,5,1|0,0,8,0"
    )  # a weight that falls is no such scene
    assert (
        not alone["idle"]
        and small_scenes.falling(small_scenes.built_packing("1,5,1|0,0,8,0", 0.4))[1] < 0
    )


def test_a_press_that_is_not_borne_gives_way():
    motion = small_scenes.falling(small_scenes.built_packing(UNDER_PRESS, 0.2)).reshape(-1, 3)
    assert len(motion) == 4 and motion[3, 1] < 0


def test_a_column_has_an_exact_outline():
    packing, S = gf.scene("column"), gf.ensemble(gf.scene("column"))
    plane = [0, 2 * 9 + 1]  # f_n of the first contact, f_t of the tenth
    found = small_scenes.measured(packing, None, plane)
    axes = np.zeros((2, len(S.index), 2))
    axes.reshape(2, -1)[[0, 1], plane] = 1
    outline = gf.outline(S, axes, tolerance=1e-4)
    corners = np.reshape(found["outline"], (-1, 2))
    np.testing.assert_allclose(corners, outline.inner * S.force_scale)
    low, high = found["bounds"][0]
    assert (corners[:, 0].min(), corners[:, 0].max()) == pytest.approx((low, high), rel=1e-3)


def test_what_has_no_end_has_no_bounds_and_is_drawn_up_to_a_force():
    found = small_scenes.measured(small_scenes.packing_of("column", 2.0), None, [0, 2])
    corners = np.reshape(found["outline"], (-1, 2))
    assert found.keys() == {"most", "outline"} and len(corners) > 2
    assert corners.max() == pytest.approx(found["most"], rel=1e-3)


@pytest.mark.parametrize("plane", [[0], [0, 40], [0, 0.5], ["a", 1], None])
def test_a_plane_that_is_not_there_is_refused(plane):
    with pytest.raises(InputError):
        small_scenes.measured(gf.scene("column"), None, plane)


def test_a_disk_in_the_air_falls_and_the_others_stay():
    motion = small_scenes.falling(
        small_scenes.built_packing("1,1,1;3,1,1;2,5,1|0,0,8,0", 0.5)
    ).reshape(-1, 3)
    assert motion[2, 1] < 0 and np.abs(motion[:2]).max() < 1e-9
    alone = small_scenes.falling(small_scenes.built_packing("1,5,1|0,0,8,0", 0.5)).reshape(-1, 3)
    assert alone[0, 1] < 0
    beside_a_wall = small_scenes.falling(small_scenes.built_packing("1,3,1|0,0,4,0;0,0,0,5", 0.5))
    for falls in (motion[2], alone[0], beside_a_wall):
        np.testing.assert_allclose(falls, [0, -1, 0], atol=1e-9)


@pytest.mark.parametrize(
    "text",
    [
        *("1,1", "a,b,c", ";".join(["1,1,0.1"] * 31), "0,0,1;1,0,1", "nan,0,1", "1,1,-1"),
        *("1,1,1|0,0,3,0|p1", "1,1,1|0,0,3,0|px", "1,1,1|0,0,3,0|0"),
        *("1,1,1,1", "1,1,1,1,0;1,1,1,1,0", "1,1,1,0,0", "1,1,1,1,0|0,1,0,1"),
    ],
)
def test_what_cannot_be_built_is_refused(text):
    with pytest.raises(InputError):
        small_scenes.built_packing(text)


def test_the_limit_of_a_push_is_where_nothing_balances_any_more():
    """Of many dimensions, of which the page draws only a shadow."""
    packing = small_scenes.packing_of("column", 0.3)
    loads = packing.load[:10].copy()
    loads[2, 0] += 0.5
    most = small_scenes.limit(packing, loads.ravel())
    for part, holds in ((0.999, True), (1.001, False)):
        loads[2, 0] = packing.load[2, 0] + 0.5 * most * part
        assert (not len(small_scenes.falling(packing, loads.ravel()))) == holds
    pressed = packing.load[:10].copy()
    pressed[:, 1] *= 2
    assert small_scenes.limit(packing, pressed.ravel()) is None


@pytest.fixture
def page():
    """The page of the column of disks, and the list of what it is told."""
    view = Workbench(scene_links.request_of("?scene=column"), Task(), Task(), Task())
    told = []
    view.tell = told.append
    _at_rest(view)
    return view, told


def _at_rest(view):
    for task in (view._task, view._saving, view._pushing):
        while task.running:
            task.job and task.job.wait(240)
            task.poll()


def _measure(scene):
    """What a page asks of a scene once friction has rested."""
    of = {"built": scene["built"], "mu": scene["mu"], "load": [*scene["load"]]}
    return {"find": "measured", "S": len(scene["i"]), "scene": scene["name"], "plane": [0, 2], **of}


def test_a_file_is_not_lost_to_a_later_request(page):
    view, told = page
    view.hear(_measure(view.scene) | {"find": "file"})
    view.hear(_measure(view.scene))
    _at_rest(view)
    assert {"file", "measured"} <= {name for news in told for name in news}


def test_what_is_asked_of_a_scene_does_not_end_the_making_of_the_next(page):
    view, told = page
    late = _measure(view.scene)
    view.hear({"scene": "solid"})  # is packed, which takes a while
    view.hear(late)
    _at_rest(view)
    assert view.scene["name"] == "solid" and not told


def test_what_is_found_of_a_scene_is_not_told_of_the_next(page):
    view, told = page
    late = _measure(view.scene)
    view.hear(late)
    view.hear({"scene": "box"})
    view.hear(late)
    _at_rest(view)
    assert view.scene["name"] == "box" and not told
    view.hear({"scene": "column"})
    view.hear(late)
    _at_rest(view)
    assert [message["S"] for message in told] == [len(view.scene["i"])]
