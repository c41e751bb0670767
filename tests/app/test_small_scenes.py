"""What the page is told of small scenes: links, words, scenes built by hand, and what falls."""

import io

import numpy as np
import pytest

import granforce as gf
from app import scenes
from granforce.records import InputError
from granforce.study import hulls

PYRAMID = "1,1,1;3,1,1;2,2.732050807569,1|0,0,8,0"


@pytest.mark.parametrize(
    ("query", "scene", "mu", "step"),
    [
        ("", "groove", None, 0),
        ("?scene=box&mu=0.3", "box", 0.3, 0),
        ("?scene=groove&tour=2", "groove", None, 2),
        ("?scene=elsewhere", "groove", None, 0),
        ("?scene=many", "many", None, 0),
        ("?mu=0.1&n=30", "many", 0.1, 0),  # links from before there were scenes
        ("?tour=3", "many", None, 3),
        ("?scene=box&mu=steep", "box", None, 0),
    ],
)
def test_links_name_a_scene(query, scene, mu, step):
    asked = scenes.asked(query)
    assert (asked.scene, asked.mu, asked.step) == (scene, mu, step)
    assert "scene" not in asked.query


def test_every_scene_of_the_library_is_on_the_list():
    listed = [name for name, _ in scenes.titles()]
    assert listed[0] == scenes.FIRST and set(listed) >= {"many", "own", "column"}


@pytest.mark.parametrize("name", ["groove", "box", "pyramid", "leaning", "column", "solid"])
def test_forces_less_equations_is_free(name):
    drawn = scenes.drawn(name)
    count = len(drawn["i"])
    assert 2 * count - drawn["equations"] == drawn["h"] == gf.ensemble(gf.scene(name)).dimension
    assert len(drawn["names"]) == count


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
    built, made = scenes.own(PYRAMID, 0.4), gf.scene("pyramid", 0.4)
    assert len(built.contacts.i) == len(made.contacts.i)
    low, high = gf.body(gf.ensemble(built)).intervals
    expected = gf.body(gf.ensemble(made)).intervals
    np.testing.assert_allclose(low, expected[0], atol=1e-9)
    np.testing.assert_allclose(high, expected[1], atol=1e-9)


def test_a_built_scene_is_saved_and_opened_by_the_library():
    file = scenes.file_of(scenes.own(PYRAMID, 0.4))
    packing = gf.load_packing(io.BytesIO(file))
    assert gf.ensemble(packing).admits(packing.forces)
    # Where nothing balances, the disks are kept, and the library says why.
    empty = gf.load_packing(io.BytesIO(scenes.file_of(scenes.own(PYRAMID, 0.1))))
    with pytest.raises(gf.NotJammedError):
        gf.ensemble(empty)


def test_a_disk_in_the_air_falls_and_the_others_stay():
    motion = scenes.falling(scenes.own("1,1,1;3,1,1;2,5,1|0,0,8,0", 0.5)).reshape(-1, 3)
    assert motion[2, 1] < 0 and np.abs(motion[:2]).max() < 1e-9
    alone = scenes.falling(scenes.own("1,5,1|0,0,8,0", 0.5)).reshape(-1, 3)
    assert alone[0, 1] < 0


@pytest.mark.parametrize(
    "text", ["1,1", "a,b,c", ";".join(["1,1,0.1"] * 31), "0,0,1;1,0,1", "nan,0,1", "1,1,-1"]
)
def test_what_cannot_be_built_is_refused(text):
    with pytest.raises(InputError):
        scenes.own(text)
