"""Data, state, links and tasks of the app, without a browser."""

import gc
import sys
import threading
import time

import numpy as np
import pytest
from small_store import DISKS, KEPT, STATES, cell_parameters

from granforce import measures, study
from granforce.records import Cancelled, InputError


def cell_at(library, mu):
    return next(cell for cell in library.cells() if cell.mu == mu)


def replay_at(library, mu):
    return library.shown(cell_at(library, mu)).replay


def small(mu, states=8, **details):
    """A Selection of the small store's packings."""
    from app.selection import select

    return select(DISKS, mu, 1, states=states, **details)


# Catalogue and replays


def test_catalogue_lists_the_shipped_walks_as_one_series(library):
    cells = library.cells()
    assert [cell.mu for cell in cells] == [0, 0.1, 1]
    assert {cell.series for cell in cells} == {
        f"N = {DISKS}, seed 1, {STATES} states, nearest admissible state, by PIQP"
    }


def test_missing_stores_leave_a_note_not_an_error(tmp_path, wait_for):
    from app.data import Library
    from app.state import AppState

    library = Library(tmp_path / "nowhere", tmp_path / "cache")
    assert "no store" in library.notes[0]
    state = AppState(library)
    wait_for(state)
    assert state.replay is None and state.message == ""


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
    assert np.all(replay.normal[1:] >= replay.low[:, 0] - 1e-6)
    assert np.all(replay.normal[1:] <= replay.high[:, 0] + 1e-6)


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
    packing = library.packing(cell.params["packing"])
    open_packing = packing._replace(box=np.full(2, np.inf))
    replay = make_replay(open_packing, library.dataset(cell), cell.mu)
    assert len(replay.disks.x) == DISKS and len(replay.links.contact) == replay.normal.shape[1]


def test_frames_beyond_the_budget_are_left_out_and_counted(library, monkeypatch):
    from app import data
    from app.views.summary import left_out

    cell = cell_at(library, 0.1)
    packing, dataset = library.packing(cell.params["packing"]), library.dataset(cell)
    whole = data.make_replay(packing, dataset, cell.mu)
    monkeypatch.setattr(data, "FRAME_BYTES", 8 * 5 * whole.normal.shape[1])
    short = data.make_replay(packing, dataset, cell.mu)
    assert len(short.number) == 6 and short.summary["kept"] == 5
    assert "Shown: 5 evenly spaced of 30" in left_out(short.summary)
    among = np.searchsorted(whole.number, short.number)
    np.testing.assert_array_equal(whole.normal[among], short.normal)


def test_table_has_a_row_for_each_mu(state):
    rows = state.library.table(state.cells())
    assert [row["mu"] for row in rows] == [0, 0.1, 1]
    assert rows[1]["eta1"] > rows[0]["eta1"]


def test_the_last_cells_are_kept_in_memory_and_no_more(library, monkeypatch):
    from app import data

    monkeypatch.setattr(data, "SHOWN_KEPT", 2)
    cells = library.cells()
    for cell in cells:
        library.shown(cell)
    assert library.shown_in_memory(cells[0]) is None
    assert library.shown_in_memory(cells[2]).cell == cells[2]


def test_expected_steps_come_from_the_nearest_packing(library):
    assert library.expected_steps(DISKS, 0.2) > 0
    assert library.expected_steps(999, 0.2) is None


# Links and commands


@pytest.mark.parametrize(
    "mu, packed, kind, extra",
    [(0.1, None, "walk", {}), (0.3, 0.0, "walk", {"radii": "uniform:0.9,1", "sweeps": 50})],
)
def test_links_reopen_what_they_were_made_from(mu, packed, kind, extra):
    from app.selection import link, read_link, select

    made = select(120, mu, 7, packed, kind=kind, relax="nearest", states=33, seed=4)
    made = made._replace(packing=made.packing | extra)
    read, view = read_link("?" + link(made, {"tab": "perturb"}))
    assert read == made and view == {"tab": "perturb"}


def test_links_to_imported_packings_name_their_hash():
    from app.selection import Selection, link, read_link

    made = Selection({"imported": "a1b2c3", "mu": 0.2}, 0.5, states=10)
    assert read_link(link(made, {}))[0] == made


@pytest.mark.parametrize(
    "query", ["?mu=x", "?mu=-1", "?mu=0.1&n=2", "?mu=0.1&source=oracle", "?mu=.1&radii=/etc/passwd"]
)
def test_wrong_links_are_told_in_one_line_and_open_the_usual_page(library, wait_for, query):
    from app.state import AppState

    state = AppState(library, query=query)
    wait_for(state)
    assert state.message and "\n" not in state.message
    assert state.cell.mu == 0.1


def test_the_view_travels_with_the_link(state, library, wait_for):
    from app.state import AppState

    state.param.update(contact=3, frame=5, between=(2, 7), colour="extent", overlay=True, dark=True)
    again = AppState(library, query=state.link())
    wait_for(again)
    for name in ("contact", "frame", "between", "colour", "overlay", "dark", "selection"):
        assert getattr(again, name) == getattr(state, name), name


def test_views_that_make_no_sense_are_left_out(library, wait_for):
    from app.state import AppState

    query = "mu=1&n=30&states=30&relax=nearest&contact=100000&frame=-2&colour=plaid&between=5"
    state = AppState(library, query=query)
    wait_for(state)
    assert state.cell.mu == 1 and state.message == ""
    assert (state.contact, state.frame, state.colour, state.between) == (
        None,
        0,
        "mobilised",
        None,
    )


@pytest.mark.parametrize("packed", [None, 0.0])
def test_the_copied_command_makes_the_states_on_screen(packed, monkeypatch):
    """The command line reads the words back as the parameters of the cell."""
    from app.selection import command, select
    from granforce import cli, commands

    wanted = select(31, 0.25, 3, packed, relax="accelerated", states=9, seed=2)
    wanted = wanted._replace(packing=wanted.packing | {"sweeps": 60})
    found = []

    def note(store, parameters, **options):
        found.append(parameters)
        raise Cancelled

    monkeypatch.setattr(commands.study, "get_packing", lambda *given, **options: (None, True))
    monkeypatch.setattr(commands.study, "get_walk", note)
    assert cli.main(command(wanted).split()[1:]) == 130
    expected = wanted.parameters()
    assert found[0] | {"keep": None} == expected | {"keep": None}


# State


def test_state_opens_near_mu_0_1_and_follows_the_selection(state, wait_for):
    assert state.cell.mu == 0.1 and state.replay.summary["mu"] == 0.1
    state.choose(mu=1)
    wait_for(state)
    assert state.replay.summary["mu"] == 1 and "finished results" in state.source


def test_a_cell_in_memory_is_shown_at_once(state):
    state.library.shown(cell_at(state.library, 1))
    state.choose(mu=1)
    assert state.cell.mu == 1 and not state.busy


def test_the_nearest_mu_are_read_ahead_and_no_others(state, wait_for, monkeypatch):
    from app import state as module

    asked = []
    monkeypatch.setattr(module, "Job", lambda work, pool: asked.append(work(None).cell.mu))
    state.choose(mu=1)
    wait_for(state)
    assert asked == []  # 0.1 is in memory, and 0 is no neighbour
    state.choose(mu=0.1)
    assert asked == [0] and state.library.shown_in_memory(cell_at(state.library, 0)) is not None
    state.choose(mu=1)
    assert asked == [0]


def test_stored_states_are_found_whatever_was_kept_of_them(state, wait_for):
    state.ask(small(1, STATES, relax="nearest"))
    wait_for(state)
    assert state.cell.mu == 1 and not state.missing


def test_states_in_no_store_are_missing_until_computed(state, wait_for):
    before = state.replay
    state.ask(small(0.3))
    assert state.missing and state.replay is before and not state.busy
    state.compute()
    wait_for(state)
    assert state.message == "" and state.cell.mu == 0.3 and not state.missing
    assert "cache" in state.source and len(state.replay.number) == 9
    assert [cell.mu for cell in state.cells()] == [0.3]
    assert len(state.catalogue) == 4


def test_a_link_to_missing_states_computes_them(library, wait_for):
    from app.state import AppState

    state = AppState(library, query="mu=0.2&n=30&states=5")
    wait_for(state)
    assert state.cell.mu == 0.2 and len(state.replay.number) == 6


def test_a_shipped_packing_is_not_made_again(state, wait_for):
    state.ask(small(0.1, 5), at_once=True)
    wait_for(state)
    packing = study.packing_parameters(DISKS, 0.1, 1)
    copied, cached = study.get_packing(state.library.cache, packing)
    shipped, _ = study.get_packing(state.library.shipped, packing)
    assert cached and np.array_equal(copied.x, shipped.x)


def test_exact_intervals_hold_every_state_on_screen(state, wait_for):
    from app.views.packing import exact_intervals

    state.compute_exact()
    wait_for(state)
    exact = exact_intervals(state.exact, state.replay)
    assert np.all(state.replay.normal >= exact["low"] - 1e-5)
    assert np.all(state.replay.normal <= exact["high"] + 1e-5)
    assert state.library.exact(state.cell.selection) is not None


def test_cancel_ends_the_computation_and_shows_what_was_there(state, wait_for):
    from app.selection import select

    before = state.replay
    state.ask(select(200, 0.05, 3, states=100), at_once=True)
    state.computation.cancel()
    wait_for(state)
    assert state.replay is before and state.message == ""
    assert len(state.catalogue) == 3


def test_closing_the_page_ends_its_computation(state):
    from app.selection import select

    state.ask(select(200, 0.05, 3, states=100), at_once=True)
    job = state.computation._job
    while job.fraction is None:
        time.sleep(0.01)  # until it is under way
    state.close()
    assert job.wait(30) and job.result is None and job.error == ""


def test_progress_grows_and_estimates_the_rest(state, wait_for):
    from app.selection import select

    fractions = []
    state.computation.param.watch(lambda event: fractions.append(event.new), "fraction")
    state.ask(select(DISKS, 0.2, 2, states=100), at_once=True)
    wait_for(state)
    known = [value for value in fractions if value is not None]
    assert known == sorted(known) and all(0 <= value <= 1 for value in known)


def test_sizes_beyond_the_limits_are_refused(state, monkeypatch):
    from app import state as module
    from app.limits import Limits
    from app.selection import select

    monkeypatch.setattr(module, "LIMITS", Limits(n=50, states=10))
    for asked, word in ((small(0.2, 11), "states"), (select(51, 0.2, 1, states=5), "N must lie")):
        state.ask(asked, at_once=True)
        assert not state.busy and word in state.message and "\n" not in state.message


def test_limits_are_read_and_wrong_ones_refused():
    from app.limits import Limits, read_limits

    assert read_limits("") == Limits()
    assert read_limits("n=500, states=20,upload=3,computations=1") == Limits(500, 20, 3, 1)
    for text in ("n=0", "disks=4", "n=", "n=1e3"):
        with pytest.raises(InputError, match="GRANFORCE_LIMITS"):
            read_limits(text)
    with pytest.raises(InputError, match="N must lie between 1 and 500"):
        Limits(n=500).check(n=501)


# Tasks


def test_a_later_job_replaces_an_earlier_one(wait_for):
    from app.jobs import Task

    release, done = threading.Event(), []
    task = Task()
    task.start(lambda job: release.wait(10) and "first", done.append)
    task.start(lambda job: "second", done.append)
    release.set()
    while task.running:
        task.poll()
    assert done == ["second"]


def test_errors_of_a_job_are_told_not_raised():
    from app.jobs import Task

    def fail(job):
        raise ZeroDivisionError("no such thing")

    task, done = Task(), []
    task.start(fail, done.append)
    while task.running:
        task.poll()
    assert "ZeroDivisionError" in task.message and done == []


def test_a_job_that_waits_is_cancelled_at_once():
    from app.jobs import Job, Pool

    release, begun = threading.Event(), []
    pool = Pool(1, "test")
    first = Job(lambda job: release.wait(30), pool)
    second = Job(begun.append, pool)
    second.cancel()
    assert second.ended and not first.ended
    release.set()
    assert first.wait(10) and Job(lambda job: None, pool).wait(10) and begun == []


def test_what_two_pages_ask_for_is_computed_once(library, monkeypatch):
    from app import compute
    from app.jobs import Job, Pool
    from app.selection import selected

    made, walk, begin = [], study.walk, threading.Barrier(2)
    monkeypatch.setattr(study, "walk", lambda *a, **k: made.append(1) or walk(*a, **k))
    work = compute.states(library, selected("walk", cell_parameters(0.2)))
    pool = Pool(2, "test")
    jobs = [Job(lambda job: begin.wait(10) >= 0 and work(job), pool) for _ in range(2)]
    assert all(job.wait(60) and job.error == "" for job in jobs)
    assert [job.result.cell.mu for job in jobs] == [0.2, 0.2] and made == [1]


def test_a_packing_that_two_pages_need_is_made_once(library, monkeypatch):
    from app import compute
    from app.jobs import Job, Pool
    from app.selection import select

    made, pack, begin = [], study.pack, threading.Barrier(2)
    monkeypatch.setattr(study, "pack", lambda *a, **k: made.append(1) or pack(*a, **k))
    pool, jobs = Pool(2, "test"), []
    for states in (3, 4):
        work = compute.states(library, select(DISKS, 0.2, 7, states=states))
        jobs.append(Job(lambda job, work=work: begin.wait(10) >= 0 and work(job), pool))
    assert all(job.wait(60) and job.error == "" for job in jobs)
    assert [len(job.result.replay.number) for job in jobs] == [4, 5] and made == [1]


def test_what_was_imported_is_spared_by_collections_once():
    from app.garbage import settle

    settle()
    kept = [[] for _ in range(1000)]
    before = gc.get_freeze_count()
    settle()
    assert gc.get_freeze_count() <= before
    sys.modules["granforce_nothing"] = sys
    try:
        settle()
    finally:
        del sys.modules["granforce_nothing"]
    assert gc.get_freeze_count() >= before + len(kept)


def test_a_job_that_waits_for_another_page_can_be_cancelled():
    from app import compute
    from app.jobs import Job, Pool

    inside, release = threading.Event(), threading.Event()

    def work(job):
        with compute.in_turn(job, "walk", {"mu": 1}):
            inside.set()
            release.wait(30)

    pool = Pool(2, "test")
    first = Job(work, pool)
    assert inside.wait(10)
    second = Job(work, pool)
    while "another page" not in second.stage:
        time.sleep(0.01)
    second.cancel()
    assert second.wait(10) and not first.ended
    release.set()
    assert first.wait(10) and first.error == second.error == ""


def test_progress_tells_how_far_a_task_is_and_cancels_it(state, wait_for):
    from app.views.progress import Progress

    task = state.task()
    progress, told = Progress(task), threading.Event()
    assert not progress.running

    def work(job):
        job.begin("counting")
        job.tell(1, 4)
        told.set()
        while not job.cancelled():
            time.sleep(0.01)

    task.start(work)
    assert told.wait(10)
    state.poll()
    assert progress.running and progress.fraction == 0.25
    assert progress.words.startswith("counting — about ")
    progress._handle_msg({"cancel": True})
    wait_for(state)
    assert not progress.running


def test_a_job_wakes_the_page_when_it_ends():
    from app.jobs import Task

    woken = threading.Event()
    task = Task(wake=lambda function: woken.set())
    task.start(lambda job: None)
    assert woken.wait(10)


# Views


def test_player_gets_flat_frames(library):
    from app.views.player import frames

    shipped = frames(replay_at(library, 1))
    assert shipped["normal"].size == (KEPT + 1) * shipped["contacts"]
    assert shipped["normal"].dtype == np.float32
    assert shipped["kind"].max() == 3 or not np.any(shipped["touching"] == 0)


@pytest.mark.parametrize("by", ["original", "extent", "exact", "position"])
def test_contacts_are_sorted_by_what_is_named(state, wait_for, by):
    from app.views.intervals import sorted_contacts
    from app.views.packing import exact_intervals

    state.compute_exact()
    wait_for(state)
    replay, exact = state.replay, exact_intervals(state.exact, state.replay)
    extent = exact["high"] - exact["low"]
    value = {
        "original": replay.normal[0],
        "extent": replay.high[:, 0] - replay.low[:, 0],
        "exact": extent,
        "position": (replay.normal[0] - exact["low"]) / extent,
    }[by]
    order = sorted_contacts(replay, exact, by)
    assert sorted(order) == list(range(len(value)))
    assert np.all(np.diff(value[order]) >= 0)


def test_intervals_take_nothing_over_while_hidden(state, wait_for):
    from app.views.intervals import View

    state.tab = "statistics"
    view = View(state)
    state.choose(mu=1)
    wait_for(state)
    assert len(view.bars.data["rank"]) == 0
    state.tab = "intervals"
    assert len(view.bars.data["rank"]) == state.replay.normal.shape[1]


def test_many_contacts_are_drawn_in_part_and_that_is_told(state, monkeypatch):
    from app.views import intervals

    monkeypatch.setattr(intervals, "MOST_BARS", 20)
    view = intervals.View(state)
    assert 10 <= len(view.bars.data["rank"]) <= 20
    assert "th of" in view.left_out.object


def test_a_tap_on_a_bar_selects_its_contact(state):
    from app.views.intervals import View

    view = View(state)
    view.bars.selected.indices = [4]
    assert state.contact == state.replay.order[4]
    assert view.chosen.data["rank"] == [5.0]


def test_left_out_work_is_counted(library):
    from app.views.summary import left_out

    text = left_out(replay_at(library, 0).summary)
    assert "tangential unknowns" in text and f"{STATES} states without relaxation" in text
    assert f"Shown: {KEPT}" in text


def test_every_relaxation_has_a_name_on_screen():
    from app.selection import SOLVERS

    assert set(SOLVERS) == set(study.RELAXATIONS)


def test_a_walk_in_the_store_is_found_not_computed(library):
    from app import compute
    from app.jobs import Job
    from app.selection import selected

    chosen = selected("walk", cell_parameters(1))
    stored = library.find("walk", cell_parameters(1))
    job = Job(compute.states(library, chosen))
    assert job.wait(60) and job.error == "" and job.result.cell.mu == 1
    assert stored.store is library.shipped
