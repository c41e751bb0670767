"""The plane of stresses in force space: outline, own network, states."""

import numpy as np
import pytest
from visitor import wait_for

import granforce as gf
from app.explore.tabs.force_space.force_space import View
from app.results import planes


def test_states_lie_in_the_plane_where_their_stress_says(state):
    replay = state.replay
    packing = state.library.packing(state.cell.params["packing"])
    S = gf.ensemble(packing, state.cell.mu)
    plane = planes.stress(state.library, state.cell.selection, replay)
    frames = np.stack([replay.normal, replay.tangential], axis=2) * replay.force_scale
    np.testing.assert_allclose(plane.path, gf.stress_plane(S, frames), atol=1e-5)
    assert planes.name(plane) == "s" and planes.read("s") == ()
    again = planes.named(state.library, state.cell, replay, "s")
    np.testing.assert_array_equal(again.axes, plane.axes)


def test_the_outline_of_stresses_holds_all_and_is_kept(state):
    view = View(state)
    view.planes.value = "stress"
    state.looks.tab = view.name
    wait_for(state, lambda: "shear" in view.details.object)
    corners = np.stack([view.drawing.outer.data["x"], view.drawing.outer.data["y"]], axis=1)
    path = np.stack([view.drawing.path.data["x"], view.drawing.path.data["y"]], axis=1)
    merged = np.concatenate([corners, path])
    assert planes.area(merged) == pytest.approx(planes.area(corners), rel=1e-6)
    (entry,) = state.library.cache.find("stress")
    friction = state.library.cache[entry.name]["friction"].item()
    assert f"{friction:.3f}" in view.details.object
    assert "σ" in view.drawing.figure.xaxis.axis_label and view.drawing.figure.match_aspect
    state.looks.contact = 4  # the same plane
    assert not view.task.running and len(view.drawing.outer.data["x"])


def test_the_point_is_pulled_among_stresses_and_keeps_what_is_held(state):
    view, told = View(state), []
    hand, state.hand.tell = state.hand, told.append
    view.planes.value = "stress"
    state.looks.tab = view.name
    wait_for(state, lambda: "shear" in view.details.object)
    value = float(state.replay.normal[0, 4])
    state.knowledge.hold(4, value)
    wait_for(state)
    hand.grab_point()
    wait_for(state)
    fan = told[-1]["fan"]
    here = state.plane.path[0]
    there = (0.5 * (here[0] + fan["x"].mean()), 0.5 * (here[1] + fan["y"].mean()))
    hand.pull_point(float(there[0]), float(there[1]))
    wait_for(state)
    held = told[-1]["held"]
    network = np.stack([held["normal"], held["tangential"]], axis=1)
    np.testing.assert_allclose(
        np.tensordot(state.plane.axes, network, ((1, 2), (0, 1))), there, atol=1e-5
    )
    assert held["normal"][4] == pytest.approx(value, abs=1e-3) and held["residual"] < 1e-9
    assert "s:" in state.link() or "s%3A" in state.link()
