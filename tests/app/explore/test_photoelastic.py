"""Photoelastic frames on the page: what the files are, measured beside inferred forces."""

import numpy as np
import pytest
from experiment.test_solved import mat
from frames import NEWTON, file, frame, solved
from visitor import drop, wait_for

import granforce as gf
from app.explore.tabs.your_packing import frame_picture
from app.explore.tabs.your_packing.upload import View
from app.packing.player import Player
from app.results import photoelastic_frames, uploads
from granforce.experiment.pegs import read_pegs
from granforce.forces.build import ensemble
from granforce.records import InputError
from granforce.study import series


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


HEADERS = (
    (b"", b"frame,i,j,ft,fn\n"),
    (b"frame,id,x,y,r,flag\n", b""),
    (b"frame,id,x,y,r,flag\n", b"frame,i,j,ft,fn\n"),
    (b"n,id,x,y,r,flag\n", b""),
)


@pytest.mark.parametrize("headers", HEADERS)
@pytest.mark.parametrize("order", [1, -1])
def test_a_header_line_does_not_turn_a_frame_into_a_table(headers, order):
    """Whichever file comes first: names such as x, y, r and i, j are also those of tables."""
    new, _ = files()
    named = [(name, head + content) for (name, content), head in zip(new, headers, strict=True)]
    given = {}
    for one in named[::order]:
        given = uploads.added(given, [one])
    assert set(given) == {"positions", "adjacency"} and not uploads.missing(given)


def test_what_is_still_to_be_dropped_says_as_what_the_others_were_read(state):
    view = dropped(state, files()[0][1:])
    assert view.waiting.title == (
        "adjacency.txt was read as the adjacency list with the forces. Now drop the positions of "
        "the disks."
    )


def dropped(state, new):
    view = View(state)
    drop(view.dropper, new)
    return view


def test_exact_measurements_are_taken_as_they_are(state):
    new, _ = files()
    view = dropped(state, new)
    assert view.task.running and view.reverse.visible and not view.pressure.visible
    wait_for(state, lambda: len(view.frame) > 0)
    player, *body = view.frame
    account, _, _, _, _, _, compared, stress, save = body
    assert not player.visible and "σₓₓ" in stress.object and save.files
    for words in ("60 disks", "at walls", "every inner disk is balanced", "not measured"):
        assert words in account.object
    for part in "nt":
        source = compared.object.select_one({"name": f"photoelastic_{part}"})
        np.testing.assert_allclose(source.data["x"], source.data["y"], atol=1e-3)


def test_missing_contacts_are_filled_in_and_told(state):
    new, truth = files(n=100, missing=0.1, noise=0.05)
    task, found = state.work.task(), []
    given = uploads.added({}, new)
    assert not uploads.missing(given)
    task.start(photoelastic_frames.infer(given, mu=0.3), found.append)
    wait_for(state)
    assert not task.message
    (one,) = found
    assert one.report["candidates"] == one.added.sum() > 0 and one.at_wall.any()
    assert one.left_open.sum() == one.report["unbalanced"]
    assert np.isnan(one.measured[one.added]).all()
    unmeasured = np.isnan(one.measured).any(axis=1) & ~one.added
    assert unmeasured.sum() <= one.report["negative_normal_forces"]
    assert np.all(one.inferred[:, 0] >= -1e-9)
    text = " ".join(photoelastic_frames.account(one.report))
    assert f"{one.report['candidates']} pairs" in text and "different forces" in text
    # Nearer to the truth than what was measured.
    unit = one.report["mean_measured_normal_force"]
    seen = np.isfinite(one.measured[:, 0])
    true = np.array([truth[tuple(pair)] for pair in one.ends[seen].tolist()]) / unit
    off = [np.abs(forces[seen] - true).mean() for forces in (one.inferred, one.measured)]
    assert off[0] < off[1] and unit == pytest.approx(NEWTON, rel=0.3)


def test_what_does_not_fit_is_one_clear_line(state):
    (positions, _), _ = files()
    other = ("adjacency.txt", b"2,3,13,0.001,0.01\n2,13,23,0.001,0.01\n")
    view = dropped(state, [positions, other])
    wait_for(state, lambda: view.error.visible)
    assert "no frame in common" in view.error.title and not len(view.frame)


def test_calibrated_pressures_of_a_frame_count_as_measurements(state, tmp_path):
    made = gf.synthetic_frame(gf.pack(40, 0.3, seed=2), noise=0.05)
    made.write(tmp_path / "p.csv", tmp_path / "a.csv", pressures=True)
    view = dropped(state, [(name, (tmp_path / name).read_bytes()) for name in ("p.csv", "a.csv")])
    wait_for(state, lambda: len(view.frame))
    assert view.calibration.visible and "pressures" not in view.frame[1].object
    view.calibration.value = "1, 0"
    view.read.clicks += 1
    assert "calibration a,b,sigma" in view.error.title and "--" not in view.error.title
    view.calibration.value = f"1, 0, {0.05 * np.mean(made.only.pressure)}"
    view.read.clicks += 1
    wait_for(state, lambda: len(view.frame) and "pressures of" in view.frame[1].object)
    assert not view.error.visible


def test_it_can_be_cancelled(state):
    import time

    new, _ = files(n=150, missing=0.1, noise=0.2)
    view = dropped(state, new)
    begin = time.monotonic()
    while "waiting for a free processor" in view.task.job.doing and time.monotonic() < begin + 60:
        state.work.poll()
    view.task.cancel()
    wait_for(state)
    assert not len(view.frame) and not view.error.visible


def test_the_picture_shows_measured_inferred_and_differences(state):
    new, _ = files(n=80, missing=0.2, noise=0.2)
    view = dropped(state, new)
    wait_for(state, lambda: len(view.frame) > 0)
    _, *body = view.frame
    choice, pictures = body[1], body[2]
    picture, seen = pictures[0].object, {}
    for shown, words in (
        ("measured", "measured"),
        ("deviation", "difference"),
        ("inferred", "pale"),
    ):
        choice.value = shown
        seen[shown] = tuple(one.visible for one in picture.renderers)
        assert words in picture.select_one({"name": "shown"}).text and len(pictures) == 1
    assert len(set(seen.values())) == 3
    choice.value = "beside"
    left, right = (one.object for one in pictures)
    assert left is picture and right.x_range is left.x_range
    words = [each.select_one({"name": "shown"}).text for each in (left, right)]
    assert words == ["inferred", "measured"]
    choice.value = "measured"
    assert tuple(one.visible for one in picture.renderers) == seen["measured"]
    labels = {item.label.value for item in picture.legend[0].items}
    assert {"listed", "added", "certain"} <= labels
    assert "certainly carry force" in body[5].object


def test_widths_have_a_scale():
    frame = made(60, missing=0.1, noise=0.05)
    picture, layers = frame_picture.network(frame)
    told = [text for one in picture.renderers for text in one.data_source.data.get("text", [])]
    assert len(told) == 4 and f"{frame.report['mean_measured_normal_force']:.3g}" in told[3]
    sample = picture.select_one({"name": "width_scale"}).data_source.data
    # Of one force the sample is as wide as the chain.
    chain = layers["inferred"][2].data_source.data
    force, width = (np.asarray(chain[name]) for name in ("f", "width"))
    thin = force < 1
    np.testing.assert_allclose(width[thin], sample["height"][1] * force[thin])
    assert sample["height"][0] == pytest.approx(sample["height"][1] / 2)
    # Pale: by one standard error more.
    pale = layers["inferred"][0].data_source.data
    both = np.isin(pale["contact"], chain["contact"])
    more = pale["width"][both] - width
    np.testing.assert_allclose(more, sample["height"][1] * pale["error"][both])


def test_a_frame_is_opened_as_a_packing(state):
    """Chains are the inferred ones, and what walls do is held: S is bounded."""
    frame = made(60, missing=0.1, noise=0.05)
    view = View(state)
    view.open(frame)
    wait_for(state, lambda: state.replay is not None and state.selection.imported)
    S = ensemble(frame.packing)
    assert frame.packing.r.max() == 1  # as chains of the page are drawn for
    assert S.dimension == state.replay.summary["dimension"] > 0
    inner = np.all(frame.ends < len(frame.r), axis=1)
    forces = frame.inferred[inner] * frame.report["mean_measured_normal_force"]
    shown = state.replay.normal[0] * state.replay.force_scale
    np.testing.assert_allclose(shown, forces[S.index, 0], rtol=1e-5, atol=1e-7 * S.force_scale)
    # Chains can show what was measured, and how far off it is, as in the frame's own pictures.
    player = Player(state)
    assert '<option value="deviation"' in player.legend
    assert '<option value="measured"' in player.legend
    own = player.measured["normal"] * state.replay.force_scale
    unit = frame.report["mean_measured_normal_force"]
    np.testing.assert_allclose(own, unit * frame.measured[inner][S.index, 0], rtol=1e-5)
    np.testing.assert_allclose(player.measured["off"], frame.deviation[inner][S.index, 0], 1e-5)
    assert np.isnan(own).any() and np.isfinite(own).any()
    exact = gf.intervals(S)
    assert np.isfinite(exact.high).all() and exact.max_gap < 1e-6


def made(n, **options):
    """A Frame as it comes of files."""
    new, _ = files(n=n, **options)
    found = read_pegs(*(uploads.opened(*one) for one in new), mu=0.3)
    return photoelastic_frames.frame_of(series.infer_frame(found, states=8), "files", (1,))


def test_all_that_was_found_is_one_table():
    frame = made(60, missing=0.2, noise=0.1)
    lines = photoelastic_frames.table(frame).decode().splitlines()
    head = [line for line in lines if line.startswith("#")]
    rows = lines[len(head) :]
    assert sum("region" in line and "±" in line and "xx" in line for line in head) == 9
    assert rows[0].startswith("contact,id1,id2,x,y,f_n_measured")
    assert len(rows) == 1 + len(frame.ends)
    values = np.genfromtxt(rows, delimiter=",", names=True, deletechars="", replace_space=" ")
    assert set(values["region"]) == set(range(9))
    assert np.array_equal(values["added"], frame.added)
    assert np.allclose(values["f_n_inferred [mean measured]"], frame.inferred[:, 0], atol=1e-8)
    assert set(np.flatnonzero(values["suspect"])) == set(frame.suspects.tolist())
    # Error bars of the stress, and of the forces.
    assert frame.stress.shape == frame.stress_error.shape == (9, 3)
    assert frame.error.max() > 0 and frame.stress[:, :2].mean() == pytest.approx(1, rel=0.2)


def test_frames_of_a_series_are_turned(state):
    both = [files(n=40, number=k, noise=0.05, seed=k)[0] for k in (3, 4)]
    joined = [(one[0], one[1] + b"\n" + two[1]) for one, two in zip(*both, strict=True)]
    view = dropped(state, joined)
    wait_for(state, lambda: len(view.frame) > 0)
    player, *body = view.frame
    assert player.visible and player.options == [3, 4] and player.value == 4
    assert "frame 4" in body[0].object
    player.value = 3
    wait_for(state, lambda: "frame 3" in body[0].object)
    assert "frame 3" in body[0].object
    player.value = 4  # known by now
    assert "frame 4" in body[0].object


def test_a_frame_of_pegs_2_is_dropped_whole(state):
    view = dropped(state, [("Step-0012_solved.mat", mat(solved(40)[0]).getvalue())])
    assert view.mu.visible and view.reverse.visible
    wait_for(state, lambda: len(view.frame) > 0)
    account = view.frame[1][0].object
    assert "frame 12" in account and "directions of" in account
