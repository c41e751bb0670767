"""Photoelastic frames on the page: what the files are, measured beside inferred forces."""

import numpy as np
import pytest
from frames import NEWTON, file, frame
from test_panels import opened, settled

from app import photoelastic, uploads
from app.views.upload import View
from granforce.records import InputError


def files(n=60, **options):
    """The two files of a synthetic frame as they are dropped, and its true forces."""
    grains, rows, truth = frame(n, **options)
    named = (("positions.txt", grains), ("adjacency.txt", rows))
    return [(name, file(lines).getvalue().encode()) for name, lines in named], truth


def test_files_are_known_by_their_numbers():
    (positions, adjacency), _ = files()
    assert uploads.role(*positions) == "positions" and uploads.role(*adjacency) == "adjacency"
    named = b"frame,id1,id2,ft,fn\n" + adjacency[1]
    assert uploads.role("a.txt", named) == "adjacency"
    assert uploads.role("p.txt", b"1,1,2575,5954.5,44\n1,2,5851.4,2872.4,44\n") == "positions"
    short = b"1,1,2575,5954,44,0"
    assert uploads.role("p.txt", short) == "positions"
    for content in (b"1,2,3\n4,5,6\n", b"", b"1,2,3,4,5\nx\n", b"\x00\xff" * 50):
        with pytest.raises(InputError, match="neither"):
            uploads.role("p.txt", content)


def dropped(state, new):
    view = View(state)
    view._dropped(new)
    return view


def test_exact_measurements_are_taken_as_they_are(state):
    opened(state)
    new, _ = files()
    view = dropped(state, new)
    assert view.task.running and view.reverse.visible and not view.pressure.visible
    settled(state, done=lambda: len(view.frame) > 0)
    player, body = view.frame
    account, _, _, _, compared, stress, save = body
    assert not player.visible and "σₓₓ" in stress.object and save.files
    for words in ("60 grains", "at walls", "every inner grain is balanced", "not measured"):
        assert words in account.object
    for part in "nt":
        source = compared.object.select_one({"name": f"photoelastic_{part}"})
        np.testing.assert_allclose(source.data["x"], source.data["y"], atol=1e-3)


def test_missing_contacts_are_filled_in_and_told(state, wait_for):
    opened(state)
    new, truth = files(n=100, missing=0.1, noise=0.05)
    task, found = state.task(), []
    given = uploads.added({}, new)
    assert not uploads.missing(given)
    task.start(photoelastic.infer(given, mu=0.3), found.append)
    wait_for(state)
    assert not task.message
    (one,) = found
    assert one.report["candidates"] == one.added.sum() > 0 and one.at_wall.any()
    assert one.left_open.sum() == one.report["unbalanced"]
    assert np.isnan(one.measured[one.added]).all()
    unmeasured = np.isnan(one.measured).any(axis=1) & ~one.added
    assert unmeasured.sum() <= one.report["negative_normal_forces"]
    assert np.all(one.inferred[:, 0] >= -1e-9)
    text = " ".join(photoelastic.account(one.report))
    assert f"{one.report['candidates']} pairs" in text and "different forces" in text
    # Nearer to the truth than what was measured.
    unit = one.report["mean_measured_normal_force"]
    seen = np.isfinite(one.measured[:, 0])
    true = np.array([truth[tuple(pair)] for pair in one.ends[seen].tolist()]) / unit
    off = [np.abs(forces[seen] - true).mean() for forces in (one.inferred, one.measured)]
    assert off[0] < off[1] and unit == pytest.approx(NEWTON, rel=0.3)


def test_what_does_not_fit_is_one_clear_line(state):
    opened(state)
    (positions, _), _ = files()
    other = ("adjacency.txt", b"2,3,13,0.001,0.01\n2,13,23,0.001,0.01\n")
    view = dropped(state, [positions, other])
    settled(state, done=lambda: view.error.visible)
    assert "no frame in common" in view.error.title and not len(view.frame)


def test_it_can_be_cancelled(state, wait_for):
    import time

    opened(state)
    new, _ = files(n=150, missing=0.1, noise=0.2)
    view = dropped(state, new)
    begin = time.monotonic()
    while view.task.stage == "waiting for a free processor" and time.monotonic() < begin + 60:
        state.poll()
    view.task.cancel()
    wait_for(state)
    assert not len(view.frame) and not view.error.visible


def test_the_picture_shows_measured_inferred_and_differences(state):
    opened(state)
    new, _ = files(n=80, missing=0.2, noise=0.2)
    view = dropped(state, new)
    settled(state, done=lambda: len(view.frame) > 0)
    _, body = view.frame
    choice, picture = body[1], body[2].object
    seen = {}
    for shown, words in (("measured", "measured"), ("deviation", "σ"), ("inferred", "pale")):
        choice.value = shown
        seen[shown] = tuple(one.visible for one in picture.renderers)
        assert words in picture.select_one({"name": "shown"}).text
    assert len(set(seen.values())) == 3
    labels = {item.label.value for item in picture.legend[0].items}
    assert {"listed contacts", "added contacts", "certain"} <= labels
    assert "carry for certain" in body[3].object


def test_all_contacts_are_one_table():
    from granforce.packing.importers import read_pegs
    from granforce.study import series

    new, _ = files(n=60, missing=0.2, noise=0.1)
    found = read_pegs(*(uploads.opened(*one) for one in new), mu=0.3)
    frame = photoelastic.frame_of(series.infer_frame(found, states=8), "files", (1,))
    lines = photoelastic.table(frame).decode().splitlines()
    assert lines[0].startswith("#") and lines[1].startswith("contact,id1,id2,measured_f_n")
    assert len(lines) == 2 + len(frame.ends)
    values = np.genfromtxt(lines[1:], delimiter=",", names=True)
    assert np.array_equal(values["added"], frame.added)
    assert np.allclose(values["inferred_f_n"], frame.inferred[:, 0], atol=1e-8)
    assert set(np.flatnonzero(values["suspect"])) == set(frame.suspects.tolist())
    # Error bars of the stress, and of the forces.
    assert frame.stress.shape == frame.stress_error.shape == (9, 3)
    assert frame.error.max() > 0 and frame.stress[:, :2].mean() == pytest.approx(1, rel=0.2)


def test_frames_of_a_series_are_turned(state):
    opened(state)
    both = [files(n=40, number=k, noise=0.05, seed=k)[0] for k in (3, 4)]
    joined = [(one[0], one[1] + b"\n" + two[1]) for one, two in zip(*both, strict=True)]
    view = dropped(state, joined)
    settled(state, done=lambda: len(view.frame) > 0)
    player, body = view.frame
    assert player.visible and player.options == [3, 4] and player.value == 4
    assert "frame 4" in body[0].object
    player.value = 3
    settled(state, done=lambda: "frame 3" in body[0].object)
    assert "frame 3" in body[0].object
    player.value = 4  # known by now
    assert "frame 4" in body[0].object


def test_a_frame_of_pegs_2_is_dropped_whole(state):
    from frames import solved
    from packing.test_solved import mat

    opened(state)
    view = dropped(state, [("Step-0012_solved.mat", mat(solved(40)[0]).getvalue())])
    assert view.mu.visible and view.reverse.visible
    settled(state, done=lambda: len(view.frame) > 0)
    account = view.frame[1][0].object
    assert "frame 12" in account and "directions of" in account
