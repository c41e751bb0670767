"""Data and state of the app, without a browser."""

import time

import numpy as np
import pytest
from small_store import DISKS, KEPT, STATES, cell_parameters

from granforce import measures, study


def wait_for(state, seconds=60):
    """Poll as the page does until nothing is computed any more."""
    end = time.monotonic() + seconds
    while state.running and time.monotonic() < end:
        time.sleep(0.02)
        state.poll()
    assert not state.running


def replay_at(library, mu):
    cell = next(cell for cell in library.cells() if cell.mu == mu)
    return library.replay(cell)


def test_catalogue_lists_the_shipped_walks_as_one_series(library):
    cells = library.cells()
    assert [cell.mu for cell in cells] == [0, 0.1, 1]
    assert {cell.series for cell in cells} == {
        f"N = {DISKS}, seed 1, {STATES} states, nearest admissible state"
    }


def test_missing_stores_leave_a_note_not_an_error(tmp_path):
    from app.data import Library
    from app.state import AppState

    library = Library(tmp_path / "nowhere", tmp_path / "cache")
    assert "no store" in library.notes[0]
    assert AppState(library).replay is None


@pytest.mark.parametrize("mu", [0, 0.1, 1])
def test_segments_join_centres_or_their_images(library, mu):
    """Both ends of every segment are centres of the grains named, up to whole boxes."""
    replay = replay_at(library, mu)
    links, disks, box = replay.links, replay.disks, replay.box
    centre = np.full((DISKS, 2), np.nan)
    inside = ~disks.image
    centre[disks.grain[inside]] = np.stack([disks.x, disks.y], axis=1)[inside]
    for grain, x, y in ((links.i, links.x0, links.y0), (links.j, links.x1, links.y1)):
        boxes = (np.stack([x, y], axis=1) - centre[grain]) / box
        np.testing.assert_allclose(boxes, np.round(boxes), atol=1e-8)


def test_every_contact_and_grain_is_drawn(library):
    replay = replay_at(library, 0.1)
    assert set(replay.links.contact) == set(range(replay.normal.shape[1]))
    assert sorted(replay.disks.grain[~replay.disks.image]) == list(range(DISKS))


def test_chains_cross_every_edge_that_contacts_cross(library):
    """A contact through an edge is drawn twice at least: leaving here, coming in there."""
    replay = replay_at(library, 0.1)
    links, box = replay.links, replay.box
    ends = np.stack([[links.x0, links.y0], [links.x1, links.y1]])
    crosses = np.any((ends < 0) | (ends > box[:, None]), axis=(0, 1))
    drawn = np.bincount(links.contact)
    assert crosses.any() and np.all(drawn[links.contact[crosses]] >= 2)


def test_window_is_a_square_around_the_box(library):
    x_low, x_high, y_low, y_high = replay_at(library, 1).window
    assert x_high - x_low == pytest.approx(y_high - y_low)
    assert x_low < 0 < x_high


def test_frames_begin_with_the_original_and_balance(library):
    replay = replay_at(library, 0.1)
    assert replay.normal.shape[0] == KEPT + 1 and replay.normal.dtype == np.float32
    assert replay.number[0] == 0 and replay.number[-1] == STATES
    assert np.all(np.abs(replay.tangential) <= 0.1 * replay.normal + 1e-6)
    assert replay.normal[0].mean() == pytest.approx(1, rel=0.2)
    assert np.all(np.diff(replay.normal[0, replay.order]) >= 0)


def test_replayed_eta3_is_that_of_measures(library):
    """What the player accumulates, min and max of all kept states, gives η3 of the kept ones."""
    replay = replay_at(library, 0.1)
    kept = np.stack([replay.normal, replay.tangential], axis=2)[1:].astype(float)
    growing = measures.growing_eta3(kept)
    assert np.all(np.diff(growing) >= -1e-9)
    assert growing[-1] <= replay.summary["eta3"] + 1e-6


def test_mu_zero_is_one_point_without_relaxation(library):
    summary = replay_at(library, 0).summary
    assert summary["dimension"] == 0 and summary["skipped"] == STATES


def test_open_boxes_have_no_images(library):
    """Imported packings may be open; then nothing is drawn twice."""
    from app.data import make_replay

    cell = library.cells()[1]
    dataset, _ = study.get_walk(cell.store, cell.params)
    packing, _ = study.get_packing(cell.store, cell.params["packing"])
    replay = make_replay(packing._replace(box=np.full(2, np.inf)), dataset, cell.mu)
    assert len(replay.disks.x) == DISKS and len(replay.links.contact) == replay.normal.shape[1]


def test_table_has_a_row_for_each_mu(state):
    rows = state.library.table(state.cells())
    assert [row["mu"] for row in rows] == [0, 0.1, 1]
    assert rows[1]["eta1"] > rows[0]["eta1"]


def test_state_opens_near_mu_0_1_and_follows_the_selection(state):
    assert state.mu == 0.1 and state.replay.summary["mu"] == 0.1
    state.choose(mu=1)
    assert state.replay.summary["mu"] == 1 and "finished results" in state.source


def test_wrong_mu_is_told_in_one_line(state):
    for mu in ("-1", "much", "nan", ""):
        state.compute(n=DISKS, mu=mu, seed=1, states=5, relax="nearest")
        assert "friction coefficient" in state.message and "\n" not in state.message
        assert not state.running
    state.compute(n=None, mu="0.1", seed=1, states=5, relax="nearest")
    assert state.message and not state.running


def test_new_mu_is_computed_cached_and_shown(state):
    state.compute(n=DISKS, mu="0.3", seed=1, states=8, relax="nearest")
    assert state.running
    wait_for(state)
    assert state.message == "" and state.mu == 0.3
    assert "cache" in state.source and len(state.replay.number) == 9
    assert [cell.mu for cell in state.cells()] == [0.3]
    assert len(state.catalogue) == 4


def test_a_walk_in_the_store_is_found_not_computed(state):
    from app.jobs import Job

    job = Job(state.library, cell_parameters(1))
    job.wait(20)
    assert job.cell.store is state.library.shipped


def test_a_shipped_packing_is_not_made_again(state):
    state.compute(n=DISKS, mu=0.1, seed=1, states=5, relax="nearest")
    wait_for(state)
    packing = study.packing_parameters(DISKS, 0.1, 1)
    copied, cached = study.get_packing(state.library.cache, packing)
    shipped, _ = study.get_packing(state.library.shipped, packing)
    assert cached and np.array_equal(copied.x, shipped.x)


def test_cancel_ends_the_computation_and_shows_what_was_there(state):
    before = state.replay
    state.compute(n=200, mu=0.05, seed=3, states=100, relax="nearest")
    state.cancel()
    wait_for(state)
    assert state.replay is before and state.message == ""
    assert len(state.catalogue) == 3


def test_progress_grows_and_estimates_the_rest(state):
    fractions = []
    state.param.watch(lambda event: fractions.append(event.new), "fraction")
    state.compute(n=DISKS, mu=0.2, seed=2, states=100, relax="nearest")
    wait_for(state)
    known = [value for value in fractions if value is not None]
    assert known == sorted(known) and all(0 <= value <= 1 for value in known)


def test_expected_steps_come_from_the_nearest_packing(library):
    assert library.expected_steps(DISKS, 0.2) > 0
    assert library.expected_steps(999, 0.2) is None


def test_player_gets_flat_frames(library):
    from app.views.player import frames

    shipped = frames(replay_at(library, 1))
    assert shipped["normal"].size == (KEPT + 1) * shipped["contacts"]
    assert shipped["normal"].dtype == np.float32


def test_left_out_work_is_counted(library):
    from app.views.summary import left_out

    text = left_out(replay_at(library, 0).summary)
    assert "rattlers" in text and f"{STATES} states without relaxation" in text
    assert f"Shown: {KEPT}" in text


def test_every_relaxation_has_a_name_on_screen():
    from app.data import SOLVERS

    assert set(SOLVERS) == set(study.RELAXATIONS)
