"""Data, state, links and tasks of the app, without a browser."""

import asyncio
import gc
import re
import shlex
import shutil
import sys
import threading
import time
from types import SimpleNamespace
from urllib.parse import urlencode

import numpy as np
import pytest
from packings import skewed
from small_store import DISKS, KEPT, STATES, cell_parameters
from visitor import wait_for

import granforce as gf
from app.background import jobs as app_jobs
from app.background import limits
from app.background.gc_pauses import settle
from app.background.jobs import Job, Pool, Task, Visitor
from app.background.limits import LIMITS, NAMES, Limits, read_limits
from app.explore.controls import Controls
from app.explore.page_address import Address
from app.explore.results_line import left_out
from app.explore.status_line import StatusLine, power
from app.explore.tabs.intervals.intervals import View
from app.explore.tabs.intervals.order import SOME, ordered
from app.packing.captions import caption
from app.packing.legend import COMING, exact_intervals
from app.packing.player import Player, frames
from app.page import learns
from app.results import compute, distributions, replays
from app.results.library import Library
from app.results.replays import make_replay
from app.results.selection import (
    OPTIONS,
    SOLVERS,
    Selection,
    command,
    differing,
    select,
    selected,
)
from app.state import app_state, page_session, page_tasks, scene_links
from app.state.app_state import AppState
from app.state.known import Knowledge, Statement
from app.state.links import Numbers, fitting, link, read_link, read_view, spelled
from app.state.page_session import waker
from app.state.pulls import Hand
from app.state.view_settings import SORTS, Looks
from granforce import measures
from granforce.cli import entry_point
from granforce.experiment.measurements import Measurement
from granforce.records import Cancelled, InputError
from granforce.study import cells as study
from granforce.study import kinds
from granforce.study.relaxations import STORED
from granforce.study.store import open_store
from granforce.system import cancelling


def cell_at(library, mu):
    return next(cell for cell in library.cells() if cell.mu == mu)


def replay_at(library, mu):
    return library.shown(cell_at(library, mu)).replay


def small(mu, states=8, **details):
    """A Selection of the small store's packings."""
    return select(DISKS, mu, 1, states=states, **details)


# Catalogue and replays


def test_catalogue_lists_the_shipped_walks_as_one_series(library):
    cells = library.cells()
    assert [cell.mu for cell in cells] == [0, 0.1, 1]
    assert {cell.series for cell in cells} == {
        f"N = {DISKS}, seed 1, {STATES} networks, nearest-network walk, by PIQP"
    }


def test_an_inference_in_the_cache_is_no_source_of_states(shipped, tmp_path):
    """As `granforce infer` leaves it: the page opens."""
    library = Library(shipped, tmp_path / "cache")
    before = library.cells()
    packing = before[1].params["packing"]
    measured = Measurement(np.array([3, 5]), np.ones((2, 2)), np.full((2, 2), 0.1))
    parameters = kinds.INFERENCE.parameters(packing, measured, 40)
    study.get(library.cache, kinds.INFERENCE, parameters, measured=measured)
    assert library.cache.find(kind="inference")
    assert library.cells() == before


def test_missing_stores_leave_a_note_not_an_error(tmp_path, visited):
    library = Library(tmp_path / "nowhere", tmp_path / "cache")
    assert "there is no store at" in library.notes[0]
    state = visited(library=library)
    assert state.replay is None and state.work.message == ""


@pytest.mark.parametrize("mu", [0, 0.1, 1])
def test_lines_join_centres_or_their_images(library, mu):
    """Both ends of every line are centres of the grains named, up to whole boxes."""
    replay = replay_at(library, mu)
    assert len(replay.centres) == DISKS and len(replay.starts) == replay.normal.shape[1]
    for grain, end in ((replay.i, replay.starts), (replay.j, replay.starts + replay.reach)):
        boxes = (end - replay.centres[grain]) / replay.box
        np.testing.assert_allclose(boxes, np.round(boxes), atol=1e-8)


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


def test_replayed_measures_are_those_of_the_states_kept(library):
    replay = replay_at(library, 0.1)
    kept = np.stack([replay.normal, replay.tangential], axis=2)[1:].astype(float)
    assert replay.growth["eta1"][-1] == pytest.approx(measures.eta1(kept))
    assert replay.growth["eta2"][-1] == pytest.approx(measures.eta2(kept))
    assert np.isnan(replay.growth["eta3"][0]) and np.all(
        np.diff(replay.growth["eta3"][1:]) >= -1e-6
    )
    assert replay.growth["eta3"][-1] <= replay.summary["eta3"] + 1e-6


def test_mu_zero_is_one_point_without_relaxation(library):
    summary = replay_at(library, 0).summary
    assert summary["dimension"] == 0 and summary["skipped"] == STATES


@pytest.mark.parametrize("basis", [((2, 1), (1, 1)), ((1, 1), (0, 1)), ((1, 3), (0, 1))])
def test_tilted_cells_are_in_their_window(library, basis):
    """The same disks and contacts as in the straight cell, up to whole cells."""
    cell = cell_at(library, 0.1)
    packing, dataset = library.packing(cell.params["packing"]), library.dataset(cell)
    tilted, turn = skewed(packing, basis)
    replay = make_replay(tilted, dataset, cell.mu)
    assert replay.tilt == tilted.tilt
    inside = tilted.cell.parts(replay.centres)
    assert inside.min() > -1e-12 and inside.max() < 1 + 1e-12
    ends = (replay.i, replay.starts), (replay.j, replay.starts + replay.reach)
    for grain, at in ((np.arange(DISKS), replay.centres), *ends):
        off = tilted.cell.parts(at - packing.x[grain] @ turn)
        np.testing.assert_allclose(off, np.round(off), atol=1e-6)
    x_low, x_high, y_low, y_high = replay.window
    assert x_high - x_low == pytest.approx(y_high - y_low)
    low, high = tilted.cell.bounding_box
    assert x_low < low[0] and y_low < low[1] and x_high > high[0] and y_high > high[1]


def test_frames_beyond_the_budget_are_left_out_and_counted(library):
    cell = cell_at(library, 0.1)
    packing, dataset = library.packing(cell.params["packing"]), library.dataset(cell)
    whole = replays.make_replay(packing, dataset, cell.mu)
    short = replays.make_replay(packing, dataset, cell.mu, 8 * 5 * whole.normal.shape[1])
    assert len(short.number) == 6 and short.summary["kept"] == 5
    assert "Played: 5 of the 30 networks" in left_out(short.summary)
    among = np.searchsorted(whole.number, short.number)
    np.testing.assert_array_equal(whole.normal[among], short.normal)


def test_the_last_cells_are_kept_in_memory_and_no_more(library, monkeypatch):
    monkeypatch.setattr("app.results.library.CELLS_IN_MEMORY", 2)
    cells = library.cells()
    for cell in cells:
        library.shown(cell)
    assert library.shown_in_memory(cells[0]) is None
    assert library.shown_in_memory(cells[2]).cell == cells[2]


def test_expected_steps_come_from_the_nearest_packing(library):
    steps = library.expected_steps(DISKS, 0.2)
    assert steps > 0
    # Of larger ones, too: a compaction of 5000 disks once had no time left.
    assert steps < library.expected_steps(10 * DISKS, 0.2) < 3 * steps


# Links and commands


@pytest.mark.parametrize(
    "mu, packed, kind, extra",
    [
        (0.1, None, "walk", {}),
        (0.3, 0.0, "walk", {"radii": "uniform:0.9,1", "sweeps": 50}),
        (0.3, 0.0, "walk", {"box": "isotropic", "accuracy": 0.02}),
    ],
)
def test_links_reopen_what_they_were_made_from(mu, packed, kind, extra):
    made = select(120, mu, 7, packed, kind=kind, relax="nearest_piqp", states=33, seed=4)
    made = made._replace(packing=made.packing | extra)
    read, view = read_link("?" + link(made, {"tab": "perturb"}))
    assert read == made and view == {"tab": "perturb"}
    read.check(limits.Limits())
    words = shlex.split(command(made))[2:]  # what the command line takes is the same packing
    options = dict(zip(words[::2], words[1::2], strict=True))
    for name, value in extra.items():
        word = "step-accuracy" if name == "accuracy" else name
        assert options[f"--{word}"] == str(value)


def test_a_button_names_all_that_is_to_be_computed_anew():
    shown = select(30, 0.1, 1, states=30)
    assert differing(select(30, 0.4, 1, states=30), shown) == "μ = 0.4"
    assert differing(select(40, 0.1, 2, states=31), shown) == "N = 40, seed 2, 31 networks"
    assert (
        differing(select(30, 0.1, 1, states=30, kind="uniform"), shown) == "networks uniform in S"
    )
    assert differing(select(30, 0.1, 1, 0.3, states=30), shown) == "packed at μ = 0.3"
    assert differing(shown, None) == "μ = 0.1"


def test_links_to_imported_packings_name_their_hash():
    made = Selection({"imported": "a1b2c3", "mu": 0.2}, 0.5, states=10)
    assert read_link(link(made, {}))[0] == made


def test_the_view_travels_with_the_link(state, visited):
    """With what single tabs show, and with its panels; a view that rests, rests again."""
    seen = {"contact": 3, "frame": 5, "colour": "extent", "stretch": 2.0}
    seen |= {"paused": True, "opened": ["made", "check"], "sort": "extent", "pushing": "all"}
    seen |= {"axes": "stress", "zoom": (3.5, 4.25, 2.0)}
    state.looks.param.update(**seen)
    again = visited(f"?{state.link()}")
    assert again.selection == state.selection and again.view == state.view
    assert seen.items() <= again.view.items()
    older = "mu=0.1&n=30&states=30&relax=nearest_piqp"
    assert visited(f"{older}&frame=4").looks.paused  # as it was meant
    assert not visited(older).looks.paused


def test_no_address_of_a_pushed_network_names_the_network_that_comes_back_after_it(state):
    state.looks.param.update(tab="perturb", frame=5, paused=True)
    address, number = Address(state), f"network={state.replay.number[5]}"
    assert number in address.query
    state.looks.pulled = "push"
    assert not any("network=" in given for given in (address.query, caption(state)["lines"][-1]))
    state.looks.pulled = ""
    assert number in address.query


def test_a_view_that_is_gone_back_to_is_settled_once_it_is_there_or_refused(state):
    address = Address(state)
    first = address.query
    address.hear({"query": f"{first}&tab=export".replace("mu=0.1", "mu=1")})
    wait_for(state)
    assert address.settled == 1 and "mu=1&" in address.query and state.looks.tab == "export"
    address.hear({"query": "?mu=none"})
    wait_for(state)
    assert address.settled == 2 and address.first == first


def test_a_link_names_contacts_and_networks_by_their_own_numbers():
    pulled, held = [(2, 0.5), ("1n-3t", 0.1, 0.2)], [Statement(3, 0.25)]
    view = {"contact": 1, "pair": (0, 2), "frame": 2}
    view |= {"pulls": pulled, "known": held}
    here = SimpleNamespace(
        backbone=np.array([2, 3, 5, 9]), number=np.array([0, 1, 21]), normal=np.zeros((3, 4))
    )
    given = spelled(view, Numbers(here.backbone, here.number))
    assert given == {
        "select": 3, "span": "2-5", "network": 21,
        "pull": "5:0.5~3n-9t:0.1:0.2", "hold": "9:0.25",
    }  # fmt: skip
    parameters = {
        name: part.param[name] for name in view for part in (Looks, Knowledge, Hand)
        if name in part.param
    }  # fmt: skip
    texts = {name: str(text) for name, text in given.items()}
    found, invalid = read_view(texts, parameters)
    assert fitting(found, here) == view and not invalid


def test_older_links_name_contacts_and_networks_by_their_places(visited):
    state = visited(
        "mu=0.1&n=30&states=30&relax=nearest_piqp&contact=9&frame=5&pulls=4:0.5&pair=3-7"
    )
    looks = state.looks
    assert (looks.contact, looks.frame, looks.pair) == (9, 5, (3, 7))
    assert state.hand.pulls == [(4, 0.5)]


def test_all_networks_of_a_walk_can_be_kept_and_the_view_stays(state):
    """A store holds some of them; the others are computed, and take no second place in η(μ).

    The one that was asked for is then shown.
    """
    before, number, cells = state.replay.normal[5], state.replay.number, len(state.cells())
    state.looks.param.update(frame=7, contact=9)
    assert state.keepable and len(number) == KEPT + 1
    state.keep_all(int(number[7]))
    state.looks.frame = 5
    state.keep_all(int(number[5]) + 1)  # meanwhile, another one
    wait_for(state)
    looks, replay = state.looks, state.replay
    assert list(replay.number) == list(range(STATES + 1)) and not state.keepable
    assert (looks.frame, looks.contact) == (number[5] + 1, 9)
    np.testing.assert_allclose(replay.normal[number[5]], before, atol=1e-6)
    assert len(state.cells()) == cells and state.work.message == ""


def test_a_link_to_a_network_that_was_not_kept_opens_the_nearest(visited):
    query = "mu=0.1&n=30&states=30&relax=nearest_piqp"
    numbers = visited(query).replay.number
    state = visited(f"{query}&network={numbers[5] + 1}")
    assert state.looks.frame == 5 and numbers[6] > numbers[5] + 2


def pairs(replay):
    """{contact: its two disks}."""
    return dict(enumerate(map(frozenset, zip(replay.i.tolist(), replay.j.tolist(), strict=True))))


@pytest.mark.parametrize("paused", [True, False])
def test_other_networks_keep_the_number_the_contact_and_whether_it_plays(state, paused):
    """The contact as long as the same two disks touch, also while the networks are computed."""
    looks, here = state.looks, pairs(state.replay)
    (other,) = (cell for cell in state.cells() if cell.mu == 1)
    there = pairs(state.library.shown(other).replay)
    both = next(contact for contact, pair in here.items() if pair in there.values())
    gone = next(contact for contact, pair in here.items() if pair not in there.values())
    first = state.cell
    for contact in (both, gone):
        state.show(first)
        wait_for(state)
        looks.param.update(contact=contact, frame=5, paused=paused)
        number = state.replay.number[5]
        state.show(other)
        wait_for(state)
        assert state.replay.number[looks.frame] == number and looks.paused == paused
        assert looks.contact is None if contact is gone else there[looks.contact] == here[both]
        looks.contact = both
        computed = other.selection._replace(seed=contact + 1)
        state.ask(computed, at_once=True)
        looks.paused = not paused  # as the player does during the computation
        wait_for(state)
        assert state.cell.selection.seed == contact + 1 and looks.paused == paused
        assert abs(state.replay.number[looks.frame] - number) <= 1 and looks.contact == both
    state.ask(computed._replace(states=2), at_once=True)
    wait_for(state)
    assert looks.frame == 0  # there is no such number


@pytest.mark.parametrize(
    "names",
    ["contact=100000&frame=-2", "select=100000&network=-2&span=3-3", "swing=2-5&beside=0.2",
     "pull=100000:1&hold=100000:1&network=31", "pull=1n-2t:3&hold=x&select=x", "push=x",
     "push=100000"],
)  # fmt: skip
def test_views_that_make_no_sense_are_left_out_and_named_in_one_line(names, visited):
    state = visited(f"mu=1&n=30&states=30&relax=nearest_piqp&colour=plaid&{names}")
    told = state.work.message.partition("no such value here: ")[2].split(", ")
    given = {part.partition("=")[0] for part in names.split("&")}
    now = {"contact": "select", "frame": "network"}  # of older links
    assert state.cell.mu == 1 and "colour" in told
    assert all(name in told or now[name] in told for name in given)
    looks = state.looks
    assert (looks.contact, looks.frame, looks.colour) == (None, 0, "change")
    assert (state.hand.pulls, state.knowledge.known, looks.pair) == ([], [], None)


def test_the_theme_is_the_visitors_own_and_only_otherwise_that_of_a_link(state, monkeypatch):
    state.looks.dark = True
    assert "dark" not in state.link()
    for chosen, given, dark in [(None, "0", False), (None, "1", True), ("1", "0", True)]:
        cookies = {"dark": chosen} if chosen else {}
        monkeypatch.setattr(type(page_session.pn.state), "cookies", cookies)
        assert page_session.dark(f"?mu=0.1&dark={given}") == dark


@pytest.mark.parametrize("packed", [None, 0.0])
def test_the_copied_command_makes_the_states_on_screen(packed, monkeypatch):
    """The command line reads the words back as the parameters of the cell."""
    wanted = select(31, 0.25, 3, packed, relax="nearest", states=9, seed=2)
    wanted = wanted._replace(packing=wanted.packing | {"sweeps": 60})
    found = []

    def note(store, kind, parameters, **options):
        found.append(parameters)
        raise Cancelled

    monkeypatch.setattr(kinds, "get_packing", lambda *given, **options: (None, True))
    monkeypatch.setattr(study, "get", note)
    assert entry_point.main(command(wanted).split()[1:]) == 130
    expected = wanted.parameters()
    assert found[0] | {"keep": None} == expected | {"keep": None}


# State


def test_state_opens_near_mu_0_1_and_follows_the_selection(state):
    assert state.cell.mu == 0.1 and state.replay.summary["mu"] == 0.1
    state.choose(mu=1)
    wait_for(state)
    assert state.replay.summary["mu"] == 1 and "precomputed" in state.source


def test_the_nearest_mu_are_read_ahead_and_no_others(state, monkeypatch):
    asked = []

    class Done:
        def __init__(self, work, pool):
            asked.append(work(None).cell.mu)

        def cancel(self):
            pass

    monkeypatch.setattr(page_tasks, "Job", Done)
    state.choose(mu=1)
    wait_for(state)
    assert asked == []  # 0.1 is in memory, and 0 is no neighbour
    state.choose(mu=0.1)
    assert asked == [0] and state.library.shown_in_memory(cell_at(state.library, 0)) is not None
    state.choose(mu=1)
    assert asked == [0]


def test_stored_states_are_found_whatever_was_kept_of_them(state):
    state.ask(small(1, STATES, relax="nearest_piqp"))
    wait_for(state)
    assert state.cell.mu == 1 and not state.missing


def test_a_link_without_a_number_of_states_opens_those_that_a_store_has(library, visited):
    """Whether the catalogue was read before or is read only now; a number that is named is kept."""
    link = f"?mu=1&n={DISKS}&relax=nearest_piqp"
    for _ in range(2):
        state = visited(link)
        assert state.cell.mu == 1 and len(state.replay.number) == KEPT + 1 and not state.missing
        assert not state.work.computation.running and state.selection.states == STATES
    state = AppState(library, query=f"{link}&states=9")
    while state.selection is None or state.work.reader.running:
        state.work.poll()
    assert state.missing and state.selection.states == 9
    state.work.close()


@pytest.mark.parametrize("done", ["another mu", "a force known", "a pull undone", "a look", "Back"])
def test_a_refusal_is_told_until_something_succeeds(state, done):
    if done == "a pull undone":
        state.hand.pulls = [(3, float(state.replay.normal[0, 3]))]
        wait_for(state)
    state.ask(small(0.2, 10**9), at_once=True)
    state.looks.zoom = (1.0, 1.0, 2.0)  # which is looked at
    assert "networks" in state.work.message
    if done == "another mu":
        state.choose(mu=1)
    elif done == "a force known":
        state.knowledge.hold(3, float(state.replay.normal[0, 3]))
    elif done == "a pull undone":
        state.hand.undo()
    elif done == "a look":
        state.looks.colour = "extent"
    else:
        state.open("?scene=many")
    wait_for(state)
    assert state.work.message == ""


def test_what_was_wrong_with_a_link_is_told_on_the_page_that_opens(visited):
    state = visited("?mu=-1&tab=export")
    assert state.cell is not None and "friction" in state.work.message
    too_many = f"?mu=1&n={DISKS}&states={10**9}&tab=export&colour=extent"
    state = visited(too_many)
    assert state.cell is not None and state.looks.colour == "extent"
    assert "networks" in state.work.message


def test_states_in_no_store_are_missing_until_computed(state):
    before = state.replay
    state.ask(small(0.3))
    assert state.missing and state.replay is before and not state.work.busy
    state.compute()
    wait_for(state)
    assert state.work.message == "" and state.cell.mu == 0.3 and not state.missing
    assert "computed on this server" in state.source and len(state.replay.number) == 9
    assert [cell.mu for cell in state.cells()] == [0.3]
    assert len(state.catalogue) == 4


def test_a_series_without_states_at_a_friction_asks_for_them(state):
    """What is shown at a μ is of that μ: another series or another μ is not put in its place."""
    before = state.replay
    state.choose(mu=0.3)
    assert state.missing and state.replay is before and state.selection.mu == 0.3
    assert state.selection == state.cell.selection.at(0.3) and not state.work.busy
    state.choose(mu=1)
    wait_for(state)
    assert not state.missing and state.cell.mu == 1


def test_exact_intervals_are_offered_only_while_none_are_under_way(state):
    view = View(state)
    assert view.exact.visible
    state.compute_exact()
    assert not view.exact.visible
    state.work.cancel()
    wait_for(state)
    assert view.exact.visible
    state.knowledge.hold(3, float(state.replay.normal[0, 3]))  # which needs them
    assert state.knowledge.task.running and not view.exact.visible
    wait_for(state)
    assert state.exact is not None and not view.exact.visible


def test_too_little_friction_for_a_packing_is_called_that(state):
    """ "Not jammed, or contacts are missing" is no help to who has only moved a slider."""
    before = state.cell
    state.ask(small(0.0, packed_mu=1.0), at_once=True)
    wait_for(state)
    assert "made at μ = 1" in state.work.message and "larger μ" in state.work.message
    assert state.cell == before


def test_a_shipped_packing_is_not_made_again(state):
    state.ask(small(0.1, 5), at_once=True)
    wait_for(state)
    packing = kinds.PACKING.parameters(DISKS, 0.1, 1)
    copied, cached = kinds.get_packing(state.library.cache, packing)
    shipped, _ = kinds.get_packing(state.library.shipped, packing)
    assert cached and np.array_equal(copied.x, shipped.x)


def test_exact_intervals_hold_every_state_on_screen(state):
    state.compute_exact()
    wait_for(state)
    exact = exact_intervals(state.exact, state.replay)
    assert np.all(state.replay.normal >= exact["low"] - 1e-5)
    assert np.all(state.replay.normal <= exact["high"] + 1e-5)
    assert state.library.exact(state.cell.selection) is not None


def test_cancel_ends_the_computation_and_shows_what_was_there(state):
    before = state.replay
    state.ask(select(200, 0.05, 3, states=100), at_once=True)
    state.work.computation.dismiss()
    wait_for(state)
    assert state.replay is before and state.work.message == ""
    assert state.selection == state.cell.selection and not state.missing
    assert len(state.catalogue) == 3


def test_cancel_goes_back_to_what_a_visitor_saw_before_a_link_to_other_states(state):
    """Forward, say, to a walk that was never finished."""
    state.show(cell_at(state.library, 1))
    wait_for(state, lambda: state.cell.mu == 1)
    shown = state.replay
    state.open("?mu=0.47&n=30&states=30&relax=nearest_piqp")
    while state.work.reader.running:
        state.work.poll()
    assert state.work.computation.running and state.missing and state.replay is shown
    state.work.computation.dismiss()
    wait_for(state)
    assert not state.missing and state.shown is state.replay is shown
    assert "mu=1&" in state.link() and state.source.startswith("μ = 1,")


def test_a_walk_stopped_is_kept_and_goes_on_when_more_states_are_asked_for(state):
    task = state.work.computation
    state.ask(select(20, 0.05, 3, states=9), at_once=True)
    task.job.stop()  # before there is a state: it ends with the first one
    wait_for(state)
    assert state.selection.states == 1 and len(state.replay.normal) == 2
    assert state.cell.params["states"] == 1 and not state.missing
    first = state.replay.normal[1]
    state.ask(select(20, 0.05, 3, states=4), at_once=True)
    wait_for(state)
    assert state.selection.states == 4
    np.testing.assert_array_equal(state.replay.normal[1], first)


def test_a_walk_stopped_shortens_no_other_walk(state):
    """Released, the stored free walk is shown at once; another sampler or μ is asked in full."""
    free, task = state.cell, state.work.computation
    contact = int(np.argmax(np.ptp(state.replay.normal, axis=0)))
    state.knowledge.hold(contact, float(state.replay.normal[1:, contact].mean()))
    wait_for(state)
    state.sample_held()
    task.job.stop()
    wait_for(state)
    assert state.cell.stored == state.selection.states == 1 and state.selection.held
    controls = Controls(state)
    assert controls.states.value == 1
    controls.mu.mu = 0.23
    assert state.selection.states == free.selection.states
    task.dismiss()
    assert state.selection.states == 1
    state.knowledge.release(contact)
    assert state.cell == free and not task.running and not state.missing


def test_what_is_pale_says_of_which_friction_it_is(state):
    line = StatusLine(state)
    assert "nearest-network walk" in line.facts[-1] and "Still showing" not in line.facts[0]
    state.param.update(missing=True)
    assert f"Still showing μ = {state.cell.mu:g}" in line.facts[0]


def test_the_status_line_says_what_is_certified_and_what_failed(state):
    line = StatusLine(state)
    assert "not computed" in line.facts[0]
    state.compute_exact()
    wait_for(state)
    count = 4 * state.replay.summary["contacts"]  # both ends of both components
    most = power(float(state.exact["max_gap"]))  # in ⟨fₙ⟩, as stored
    words = re.sub("<[^>]*>", "", line.facts[0])
    assert f"{count} bounds certified, gap ≤ {most} ⟨fₙ⟩" in words
    state.work.message = "nothing balances"
    assert line.failed == "nothing balances"
    line.hear({"read": True})
    assert line.failed == state.work.message == ""
    assert power(5.2e-9) == "5·10⁻⁹" and power(0.0) == "0"


def test_learn_has_a_door_of_its_own():
    assert learns("?learn") and learns("?learn=groove&dark=1")
    assert not learns("") and not learns("?scene=groove") and not learns("?mu=0.1")


def test_the_sentence_of_the_intervals_says_what_is_drawn(state):
    state.choose(mu=1)
    wait_for(state)
    view = View(state)
    assert (
        "pale" not in view.lead.object and f"in {STATES} networks of the walk" in view.lead.object
    )
    state.compute_exact()
    assert "pale: exact, as bounds are found" in view.lead.object
    wait_for(state)
    assert "every network at this pressure" in view.lead.object
    state.choose(mu=0)
    wait_for(state)
    assert "Not at all" in view.lead.object and "dark" not in view.lead.object


def test_the_axis_holds_every_bar_and_names_the_order_that_there_is(state):
    state.looks.sort = "exact"
    view = View(state)
    label = view.drawing.figure.xaxis[0].axis_label
    assert "sorted by force as packed: no interval ΔFₙ, exact yet; widest: contact " in label
    state.compute_exact()
    label = view.drawing.figure.xaxis[0].axis_label
    assert "sorted by force as packed: exact bounds are being computed" in label
    wait_for(state)
    data, every = view.drawing.bars.data, len(state.replay.order)
    label = view.drawing.figure.xaxis[0].axis_label
    widest, extent = data["contact"][-1], data["exact_high"][-1] - data["exact_low"][-1]
    assert label == (
        f"{every} contacts, sorted by interval ΔFₙ, exact; "
        f"widest: contact {widest}, ΔFₙ {extent:.3f} (exact)"
    )
    assert np.all(np.diff(data["exact_high"] - data["exact_low"]) > -1e-6)
    assert view.drawing.figure.y_range.end > np.nanmax(data["exact_high"])
    for sort in SORTS:  # all of them in any order
        state.looks.sort = sort
        assert sorted(view.drawing.bars.data["at"]) == list(range(every))


def test_another_friction_is_packed_as_is_usual_there(state):
    controls, usual = Controls(state), kinds.PACKING.parameters(DISKS, 2.0, 1)
    first = state.cell.selection
    assert usual["dt"] != first.packing["dt"] and first.at(2.0).packing == usual
    controls.mu.mu = 2.0  # which no store has
    assert state.selection.packing == usual
    state.work.cancel()


def test_the_legend_says_what_colours_mean_in_the_hand(state):
    player = Player(state)
    assert "change since packed</option>" in player.legend
    for by in ("pull", "push"):
        player.pulled = by
        assert f'value="change" selected>change by the {by}</option>' in player.legend
    path = {"values": np.arange(2), "normal": np.repeat([1.0, 1.032], 50)}
    state.pushed = SimpleNamespace(path=path)
    assert player.most_change == 0.03 and "≥ +0.03 ⟨fₙ⟩" in player.legend
    state.looks.colour = "extent"
    assert '<option value="extent" selected' in player.legend  # and can still be chosen
    assert 'class="scale"' in player.legend
    state.looks.colour = "load"
    assert COMING in player.legend and 'class="scale"' not in player.legend
    state.work.cancel()


def test_what_is_refused_does_not_stay_in_its_box(state):
    controls = Controls(state)
    controls.mu.hear({"typed": "1e9"})
    assert "friction" in state.work.message.lower() and controls.mu.mu == state.cell.mu
    controls.mu.hear({"typed": "0,01"})
    assert state.selection.mu == 0.01 and not state.work.message
    state.work.cancel()


def test_closing_the_page_ends_its_computation(state):
    state.ask(select(200, 0.05, 3, states=100), at_once=True)
    job = state.work.computation.job
    while job.fraction is None:
        time.sleep(0.01)  # until it is under way
    state.work.close()
    assert job.wait(240) and job.result is None and job.error == ""


def test_progress_grows_within_each_stage(state):
    fractions = {}  # by stage, the first part of the words without its numbers

    def note(event):
        if event.new is not None:
            stage = re.sub(r"\d+", "", state.work.computation.words.split(" — ")[0])
            fractions.setdefault(stage, []).append(event.new)

    state.work.computation.param.watch(note, "fraction")
    state.ask(select(DISKS, 0.2, 2, states=100), at_once=True)
    wait_for(state)
    assert fractions
    for stage, known in fractions.items():
        assert known == sorted(known) and 0 <= known[0] and known[-1] <= 1, stage


def test_sizes_beyond_the_limits_are_refused(state):
    large = select(LIMITS.n + 1, 0.2, 1, states=5)
    for asked, word in ((small(0.2, LIMITS.states + 1), "networks"), (large, "N must lie")):
        state.ask(asked, at_once=True)
        assert not state.work.busy and word in state.work.message and "\n" not in state.work.message


BEYOND = {
    "n": ("2", "20001", "1e9", "9" * 4000, "9" * 5000, "-" + "9" * 4000),
    "states": ("20001", "0", "-1", "9" * 4000),
    "walkseed": ("-1", "9" * 4000),
    "seed": ("-1", str(2**53), "9" * 4000),
    "mu": ("1001", "1e308", "1e999", "nan", "x" * 9000),
    "packed": ("1001", "1e308", "-inf", "nan"),
    "sweeps": ("0", "10001", "1000000000", "9" * 4000),
    "accuracy": ("0", "1e-7", "1.5", "inf", "nan", "-0.01"),
    "dt": ("0", "2", "1e-4", "1e308", "inf", "nan", "-0.01"),
    "box_mass": ("5", "1e5", "1e308", "nan"),
    "drag_below": ("0", "-1", "1.1", "1e-7", "nan"),
    "pressure": ("0", "1e-300", "1e300", "inf", "nan"),
    "radii": (
        "/etc/passwd", "uniform:1e-9,1", "uniform:1e308,1e308", "uniform:nan,1",
        "uniform:1,2,3,", "uniform:1_0,9", "uniform:",
        "bidisperse:1,30,0.5", "bidisperse:-1,1,0.5", "x:" + "1," * 9000,
    ),
    "source": ("oracle", "x" * 9000),
    "relax": ("9" * 4000,),
}  # fmt: skip


@pytest.mark.parametrize("name", BEYOND)
def test_links_beyond_the_limits_compute_nothing_and_say_so(state, name):
    """Whatever a link asks for: one line, at most 300 characters, and what was there stays."""
    before, selection = state.replay, state.selection
    for value in BEYOND[name]:
        given = {"mu": "0.2", "n": "30", "states": "5"} | {name: value}
        try:
            wanted, _ = read_link("&".join(f"{key}={text}" for key, text in given.items()))
        except InputError as error:
            line = str(error)
        else:
            state.ask(wanted, at_once=True)
            line = state.work.message
        assert line and "\n" not in line and len(line) <= 300, value[:20]
        assert not state.work.busy and state.replay is before and state.selection is selection


# No number, for any of the keys that take one; and digits of other scripts, which count as digits.
NO_NUMBER = (
    "9" * 5000 + "x",
    "1_5",
    "²",
    "0x10",
    "True",
    "[1]",
    "1\n2",
    "💥",
    "\0",
    "1~" * 9000,
    " ",
)


@pytest.mark.parametrize("key", ["n", "seed", "states", "walkseed", "sweeps", "mu", "dt", "packed"])
def test_a_link_with_what_is_no_number_names_the_key_in_one_line(key):
    whole = ["1.5", "nan", "1e5", "9" * 5000] if key in ("n", "seed", "states") else []
    for text in (*NO_NUMBER, *whole):
        with pytest.raises(InputError) as refused:
            read_link(urlencode({"mu": "0.2"} | {key: text}))
        line = str(refused.value)
        words = "friction coefficient" if key in ("mu", "packed") else key
        assert line.startswith(f"this link cannot be read: {words} must be a ")
        assert "\n" not in line and len(line) < 120


def test_a_link_with_impossible_held_forces_is_refused_in_one_line():
    for text in ("3:1", "3:nan:1", "3:2:1", "3:0:inf", "x:1:1", "~".join(["3:1:1:1"] * 99)):
        with pytest.raises(InputError, match=r"this link cannot be read: .{,80}$"):
            read_link(urlencode({"mu": "0.2", "given": text}))


def test_a_link_with_a_key_twice_is_refused(state):
    for query in ("mu=0.2&mu=0.3", "mu=0.2&tab=push&tab=friction", "n=20&n=20&n=20"):
        with pytest.raises(InputError, match=r"it contains '(mu|tab|n)' \d times"):
            read_link(query)
    asked = scene_links.request_of("?scene=many&mu=0.2&mu=0.3")
    assert asked.scene == scene_links.MANY and asked.query == "?mu=0.2&mu=0.3"
    state.open(asked.query)
    assert "contains 'mu' 2 times" in state.work.message and not state.work.computation.running


def test_keys_that_others_add_to_a_link_are_ignored():
    wanted, view = read_link("mu=0.2&n=20&utm_source=%F0%9F%92%A5&fbclid=" + "x" * 9000)
    assert wanted.packing["n"] == 20 and set(view) == {"utm_source", "fbclid"}


def test_all_that_a_link_may_name_is_limited():
    """A new option of a packing needs a limit, too."""
    named = {*kinds.PACKING.parameters(3, 0, 0), *OPTIONS}
    assert named <= {*NAMES, "radii", "box", "version"}  # which no link names


def test_limits_are_read_and_wrong_ones_refused():
    assert read_limits("") == Limits(seconds=limits.LONGEST) and not Limits().shared
    own = read_limits("n=500, states=20,upload=3,computations=1,seconds=7")
    assert own == Limits(500, 20, 3, 1, 7) and own.shared
    wrong = "n=0", "disks=4", "n=", "n=1e3", "n=²", f"n={'9' * 5000}", "computations=65", "9" * 5000
    for text in wrong:
        with pytest.raises(InputError, match="GRANFORCE_LIMITS"):
            read_limits(text)
    with pytest.raises(InputError, match=r"between 0 and 1000, got 1e\+09$"):  # no row of zeros
        Limits().check(mu=1e9)
    with pytest.raises(InputError, match="N must lie between 1 and 500"):
        Limits(n=500).check(n=501)


# What makes a computation longer, and nothing else, further than a shared server has it.
COSTS = {"sweeps": 10_000, "accuracy": 1e-6, "dt": 0.01, "box_mass": 10_000, "drag_below": 1e-6}


@pytest.mark.parametrize("name", COSTS)
def test_on_a_shared_server_costs_have_narrower_bounds(name):
    asked = select(500, 0.3, 777, states=500)
    asked = asked._replace(packing=asked.packing | {name: COSTS[name]})
    asked.check(Limits())
    with pytest.raises(InputError, match="must lie between"):
        asked.check(Limits(seconds=60))
    select(500, 0.3, 777, states=500).check(Limits(seconds=60))


@pytest.mark.parametrize(
    "query, dear",
    [
        ("n=20&states=5", False),
        ("n=400&states=200", False),
        ("n=400&states=5000", True),
        ("n=60&states=20000&relax=gauss_seidel_only", True),
        ("n=1000&states=5", True),
        ("n=30&states=5&box_mass=200", True),
        ("n=30&states=5&radii=uniform:0.9,1&box=isotropic", False),
    ],
)
def test_a_link_alone_starts_nothing_dear_on_a_shared_server(
    library, monkeypatch, shared, query, dear
):
    begun = []
    monkeypatch.setattr(page_tasks.Work, "compute", lambda *asked: begun.append(asked[2]))
    state = AppState(library, query=f"mu=0.2&seed=9&{query}")
    wait_for(state, lambda: state.missing)
    assert [one.dear for one in begun] == ([] if dear else [False])
    assert ("press Compute" in state.work.message) == dear
    if dear:
        controls = Controls(state)
        assert controls.go.visible and controls.n.value == state.selection.packing["n"]
        state.compute()  # as the button does
        assert begun == [state.selection]


@pytest.fixture
def shared(monkeypatch):
    """A server for others than its owner."""
    monkeypatch.setattr(app_state, "LIMITS", Limits(seconds=60))


# Tasks


def once_both_are_there(begin, work):
    """The work, begun for the first time when others have reached the barrier, too."""
    met = []

    def run(job):
        if not met:
            met.append(begin.wait(240))
        return work(job)

    return run


def test_a_later_job_replaces_an_earlier_one():
    release, done = threading.Event(), []
    task = Task()
    task.start(lambda job: release.wait(240) and "first", done.append)
    task.start(lambda job: "second", done.append)
    release.set()
    while task.running:
        task.poll()
    assert done == ["second"]


def test_errors_of_a_job_are_told_not_raised():
    def fail(job):
        raise ZeroDivisionError("no such thing")

    task, done = Task(), []
    task.start(fail, done.append)
    while task.running:
        task.poll()
    assert "ZeroDivisionError" in task.message and done == []


def test_a_job_that_waits_is_cancelled_at_once():
    release, begun = threading.Event(), []
    pool = Pool(1, "test")
    first = Job(lambda job: release.wait(240), pool)
    second = Job(begun.append, pool)
    second.cancel()
    assert second.ended and not first.ended
    release.set()
    assert first.wait(240) and Job(lambda job: None, pool).wait(240) and begun == []


class Gate:
    """Works that say when they have begun, and end when they are let go."""

    def __init__(self, pool):
        self.pool, self.begun, self.doors = pool, [], {}

    def job(self, name, visitor):
        """A job of this name for a visitor."""
        door = self.doors[name] = threading.Event()

        def work(job):
            self.begun.append(name)
            door.wait(240)

        return Job(work, self.pool, visitor=visitor)

    def until(self, *names):
        """Wait until exactly these have begun."""
        end = time.monotonic() + 240
        while len(self.begun) < len(names) and time.monotonic() < end:
            time.sleep(0.005)
        assert sorted(self.begun) == sorted(names)  # two threads may begin at once


HOSTILE = [Visitor("there", page) for page in "abcd"]
OTHER = Visitor("elsewhere", "x")


def test_a_second_computation_waits_behind_the_first_of_others():
    gate = Gate(Pool(1, "test"))
    jobs = [gate.job(name, HOSTILE[0]) for name in ("first", "second", "third")]
    gate.until("first")
    jobs += [gate.job("of another page", HOSTILE[1]), gate.job("of another", OTHER)]
    gate.doors["first"].set()
    gate.until("first", "second")  # nobody has one under way: in the order they came
    jobs.append(gate.job("of one more", OTHER))
    two = Gate(Pool(2, "test"))
    jobs += [two.job(name, HOSTILE[0]) for name in ("one", "two", "three")]
    two.until("one", "two")
    jobs += [two.job("of another page", HOSTILE[1]), two.job("of another", OTHER)]
    two.doors["one"].set()
    two.until("one", "two", "of another")
    two.doors["of another"].set()
    two.until("one", "two", "of another", "of another page")
    for door in (*gate.doors.values(), *two.doors.values()):
        door.set()
    assert all(job.wait(240) for job in jobs)


def test_who_has_nothing_under_way_does_not_wait_for_long_jobs_of_others(monkeypatch):
    """However many pages of one address hold the threads; but no visitor has two more."""
    monkeypatch.setattr(app_jobs, "LONG", 0.0)
    gate = Gate(Pool(2, "test", extra=2))
    jobs = [gate.job(f"hostile {k}", HOSTILE[k % 2]) for k in range(4)]
    gate.until("hostile 0", "hostile 1")
    jobs += [gate.job(f"hostile {k}", HOSTILE[k % 4]) for k in range(4, 8)]
    gate.until("hostile 0", "hostile 1", "hostile 6")  # of a third page
    jobs.append(gate.job("of another", OTHER))
    gate.until("hostile 0", "hostile 1", "hostile 6", "of another")
    for door in gate.doors.values():
        door.set()
    assert all(job.wait(240) for job in jobs)


def test_short_jobs_are_waited_for(monkeypatch):
    monkeypatch.setattr(app_jobs, "LONG", 1e9)
    gate = Gate(Pool(1, "test", extra=1))
    jobs = [gate.job("one", HOSTILE[0]), gate.job("two", OTHER)]
    gate.until("one")
    gate.doors["one"].set()
    gate.until("one", "two")
    gate.doors["two"].set()
    assert all(job.wait(240) for job in jobs)


def test_what_takes_too_long_is_ended_with_a_line():
    def work(job):
        while True:
            cancelling.check("work")

    job = Job(work, Pool(1, "test", seconds=0.01))
    assert job.wait(240) and not job.cancelled()
    assert "longer than the 0.01 s allowed per computation on this server" in job.error


def test_a_job_of_a_server_that_ends_is_ended_without_a_line(monkeypatch):
    monkeypatch.setattr(cancelling, "_ending", threading.Event())

    def work(job):
        cancelling.end_everything()
        cancelling.check("work")

    job = Job(work, Pool(1, "test"))  # without a time limit
    assert job.wait(240) and job.result is None and job.error == ""


def test_work_that_was_told_nothing_of_cancelling_is_cancelled():
    begun = threading.Event()

    def work(job):
        begun.set()
        return gf.pack(20_000, mu=0.5, seed=1)  # for minutes

    job = Job(work)
    assert begun.wait(240) and not job.wait(0.3)
    job.cancel()
    assert job.wait(240) and job.result is None and job.error == ""


def test_what_two_pages_ask_for_is_computed_once(library, monkeypatch):
    made, walk, begin = [], kinds.states.walk, threading.Barrier(2)
    monkeypatch.setattr(kinds.states, "walk", lambda *a, **k: made.append(1) or walk(*a, **k))
    work = compute.states(library, selected("walk", cell_parameters(0.2)))
    pool = Pool(2, "test")
    jobs = [Job(once_both_are_there(begin, work), pool) for _ in range(2)]
    assert all(job.wait(240) and job.error == "" for job in jobs)
    assert [job.result.cell.mu for job in jobs] == [0.2, 0.2] and made == [1]


def test_a_packing_that_two_pages_need_is_made_once(library, monkeypatch):
    made, pack, begin = [], kinds.packings.pack, threading.Barrier(2)
    monkeypatch.setattr(kinds.packings, "pack", lambda *a, **k: made.append(1) or pack(*a, **k))
    pool, jobs = Pool(2, "test"), []
    for states in (3, 4):
        work = compute.states(library, select(DISKS, 0.2, 7, states=states))
        jobs.append(Job(once_both_are_there(begin, work), pool))
    assert all(job.wait(240) and job.error == "" for job in jobs)
    assert [len(job.result.replay.number) for job in jobs] == [4, 5] and made == [1]


def test_what_was_imported_is_spared_by_collections_once():
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
    inside, release = threading.Event(), threading.Event()

    def work(job):
        with compute.in_turn(job, "walk", {"mu": 1}):
            inside.set()
            release.wait(240)

    pool = Pool(2, "test")
    first = Job(work, pool)
    assert inside.wait(240)
    second = Job(work, pool)
    late = time.monotonic() + 240
    while "already under way" not in second.stage and time.monotonic() < late:
        time.sleep(0.01)
    assert "already under way" in second.stage
    second.cancel()
    assert second.wait(240) and not first.ended
    release.set()
    assert first.wait(240) and first.error == second.error == ""


def test_progress_tells_how_far_a_task_is_and_cancels_it(state):
    task = state.work.task()
    line, told = StatusLine(state), threading.Event()
    assert not line.progress

    def work(job):
        job.begin("counting", 60)
        assert job.seconds_left == pytest.approx(60, abs=1)  # before there is progress
        job.begin("counting")
        job.tell(0, 100)
        job._counted = job._counted[0] - 400, 0
        job.tell(4, 100)
        assert job.seconds_left is None  # too little to say
        job.tell(25, 100)
        assert job.seconds_left == pytest.approx(1200, rel=0.01)
        job.tell(25, 200)
        assert job.fraction == 0.25  # not back
        job.tell(30, None)
        assert job.fraction == 0.25 and job.seconds_left is None
        job.tell(25, 100)
        told.set()
        while not job.cancelled():
            time.sleep(0.01)

    task.start(work)
    assert told.wait(240)
    state.work.poll()
    assert line.progress["fraction"] == 0.25
    assert line.progress["words"] == "counting — about 20 min more"
    job, task.job.keeps = task.job, True
    line.hear({"stop": True})
    assert job.enough() and not job.cancelled()
    line.hear({"cancel": True})
    wait_for(state)
    assert job.cancelled() and not line.progress


def test_a_job_wakes_the_page_when_it_ends():
    woken = threading.Event()
    task = Task(wake=lambda function: woken.set())
    task.start(lambda job: None)
    assert woken.wait(240)


# Damaged stores


def garble(store, name, array):
    """Metadata of one array, or of all, that no longer are what they were."""
    for metadata in (store.path / name).glob(f"{array}/zarr.json"):
        metadata.write_text(metadata.read_text().replace('"codecs"', '"codices"'))


@pytest.mark.parametrize("array", ["states", "*"])
def test_a_damaged_entry_is_one_line_and_the_next_best_is_shown(shipped, tmp_path, array, caplog):
    shutil.copytree(shipped, tmp_path / "shipped")
    library = Library(tmp_path / "shipped", tmp_path / "cache")
    best = cell_at(library, 0.1)
    garble(library.shipped, best.name, array)
    state = AppState(library)
    with pytest.warns(UserWarning, match="damaged"):
        wait_for(state)
    assert f"{best.name} in" in state.work.message and "\n" not in state.work.message
    assert state.cell is not None and state.cell.mu != 0.1
    assert [cell.mu for cell in state.catalogue] == [0, 1]
    if array == "*":
        with pytest.raises(InputError, match=r"damaged; compute it again"):
            distributions.rows([best])
    gc.collect()
    assert not [told for told in caplog.records if told.name == "asyncio"]


@pytest.mark.filterwarnings("ignore:entry walk")
def test_a_damaged_entry_is_computed_anew(shipped, tmp_path, visited):
    for where in ("shipped", "cache"):
        stores = {k: tmp_path / where / k for k in ("shipped", "cache")}
        shutil.copytree(shipped, stores[where])
        library = Library(**stores)
        garble(getattr(library, where), cell_at(library, 1).name, "*")
        state = visited(f"mu=1&n={DISKS}&states={STATES}&relax=nearest_piqp", library)
        assert state.cell.mu == 1 and state.cell.store is library.cache, where
        assert [cell.mu for cell in state.catalogue] == [0, 0.1, 1]


@pytest.mark.filterwarnings("ignore:entry packing")
def test_a_damaged_packing_is_made_anew_and_only_where_it_may_be(shipped, tmp_path, visited):
    shutil.copytree(shipped, tmp_path / "shipped")
    library = Library(tmp_path / "shipped", tmp_path / "cache")
    for entry in library.shipped.find(kind="packing"):
        garble(library.shipped, entry.name, "*")
    assert library.expected_steps(DISKS, 0.1) is None
    state = visited(library=library)
    assert "not in any open store" in state.work.message and state.cell is None
    state.ask(small(1, 4), at_once=True)
    wait_for(state)
    assert state.cell.mu == 1 and state.cell.store is library.cache and state.work.message == ""


# Survival


def next_on(pool):
    """Whether the pool still runs what it is given."""
    job = Job(lambda job: "done", pool)
    return job.wait(240) and job.result == "done"


def raising(error):
    def fail(*anything):
        raise error

    return fail


class Panic(BaseException):
    """As compiled libraries raise it: no Exception."""


@pytest.mark.parametrize(
    "error", [NameError("partial"), SystemExit(3), KeyboardInterrupt(), Panic("two\nlines")]
)
def test_a_pool_survives_what_its_jobs_raise(error):
    pool = Pool(1, "test")
    job = Job(raising(error), pool)
    assert job.wait(240) and type(error).__name__ in job.error and "\n" not in job.error
    assert next_on(pool)


def test_a_pool_survives_jobs_whose_end_fails():
    pool = Pool(1, "test")
    for _ in range(3):
        job = Job(lambda job: "done", pool, raising(NameError("partial")))
        assert job.wait(240) and job.result == "done"
    release = threading.Event()
    Job(lambda job: release.wait(240), pool)
    waiting = Job(lambda job: None, pool, raising(NameError("partial")))
    waiting.cancel()  # by the thread of the page, which goes on as well
    release.set()
    assert waiting.ended and next_on(pool)


def test_a_pool_survives_what_is_no_job():
    pool = Pool(1, "test")
    with pytest.raises(AttributeError):
        pool.submit(None)
    assert next_on(pool)


def test_a_pool_survives_pages_that_are_gone(library):
    """All work of a page whose thread cannot be reached any more is ended, one after the other."""
    pool, state = Pool(1, "test"), AppState(library, raising(RuntimeError("page destroyed")))
    begun, tasks = threading.Event(), [state.work.task(pool) for _ in range(3)]

    def work(job):
        begun.set()
        while not job.cancelled():
            time.sleep(0.01)

    for task in tasks:
        task.start(work)
    jobs = [task.job for task in tasks]
    assert begun.wait(240)
    state.work.close()
    assert all(job.wait(240) for job in jobs) and next_on(pool)


def test_nothing_begins_for_a_page_that_was_closed(state):
    begun = []
    state.work.close()
    task = state.work.task()
    task.start(begun.append)
    state.work.reader.start(begun.append)
    assert not task.running and not state.work.reader.running and begun == []


def test_a_result_that_cannot_be_shown_is_told_in_one_line():
    task = Task()
    task.start(lambda job: 5, raising(KeyError("states\nand more")))
    while task.running:
        task.poll()
    assert "KeyError" in task.message and "\n" not in task.message


def test_who_waits_for_another_page_leaves_the_thread_to_others():
    release, inside = threading.Event(), threading.Event()

    def work(job):
        with compute.in_turn(job, "walk", {"mu": 2}):
            inside.set()
            return release.wait(240)

    pool = Pool(2, "test")
    first = Job(work, pool)
    assert inside.wait(240)
    others = [Job(work, pool) for _ in range(3)]
    assert next_on(pool) and not any(job.ended for job in (first, *others))
    release.set()
    assert all(job.wait(240) and job.result for job in (first, *others))


# Views


def test_player_gets_flat_frames(library):
    shipped = frames(replay_at(library, 1))
    assert shipped["normal"].size == (KEPT + 1) * shipped["contacts"]
    assert shipped["normal"].dtype == np.float32


def test_contacts_are_sorted_by_what_is_named(state):
    state.compute_exact()
    wait_for(state)
    replay, exact = state.replay, exact_intervals(state.exact, state.replay)
    extent = exact["high"] - exact["low"]
    sorts = {
        "original": replay.normal[0],
        "extent": replay.high[:, 0] - replay.low[:, 0],
        "exact": extent,
        "position": (replay.normal[0] - exact["low"]) / extent,
    }
    for by, value in sorts.items():
        order = ordered(replay, exact, by).contacts
        assert sorted(order) == list(range(len(value)))
        assert np.all(np.diff(value[order]) >= 0), by


def test_intervals_take_nothing_over_while_hidden(state):
    state.looks.tab = "statistics"
    view = View(state)
    state.choose(mu=1)
    wait_for(state)
    assert len(view.drawing.bars.data["rank"]) == 0
    state.looks.tab = "intervals"
    assert len(view.drawing.bars.data["rank"]) == state.replay.normal.shape[1]


def test_few_bars_are_drawn_evenly_and_the_selected_one_among_them(state):
    state.looks.drawn = "some"
    drawing, all_of_them = View(state).drawing, len(state.replay.order)
    shown = drawing.bars.data["at"]
    assert SOME / 2 <= len(shown) <= SOME < all_of_them
    assert drawing.figure.xaxis.axis_label.startswith(f"{len(shown)} of {all_of_them} contacts")
    state.looks.contact = int(np.setdiff1d(state.replay.order, shown)[0])
    assert np.array_equal(np.sort(drawing.bars.data["at"]), np.sort([*shown, state.looks.contact]))
    assert np.all(np.diff(drawing.bars.data["original"]) >= 0)
    state.looks.drawn = "all"
    assert np.array_equal(drawing.bars.data["at"], state.replay.order)


def test_a_tap_on_a_bar_selects_its_contact(state):
    view = View(state)
    state.looks.drawn = "all"
    view.drawing.bars.selected.indices = [4]
    assert state.looks.contact == state.replay.order[4]
    assert view.drawing.chosen.data["rank"] == [5.0]


def test_left_out_work_is_counted(library):
    text = left_out(replay_at(library, 0).summary)
    assert "forces along contacts" in text and f"{STATES} <span" in text
    assert 'data-term="no_friction"' in text and 'data-term="determined"' in text
    assert "Played" not in text  # the only network has no error


def test_every_relaxation_has_a_name_on_screen():
    assert set(SOLVERS) == STORED.keys()


def test_a_walk_in_the_store_is_found_not_computed(library):
    chosen = selected("walk", cell_parameters(1))
    stored = library.find("walk", cell_parameters(1))
    job = Job(compute.states(library, chosen))
    assert job.wait(240) and job.error == "" and job.result.cell.mu == 1
    assert stored.store is library.shipped


def test_states_of_older_packings_in_a_cache_are_not_offered(tmp_path):
    """Packings of version 1 named neither accuracy nor version; a page once failed over them."""
    shipped = Library(cache=tmp_path / "none")
    cell = next(cell for cell in shipped.cells() if cell.kind == "walk")
    older = dict(cell.params["packing"])
    del older["accuracy"], older["version"]
    cache = open_store(tmp_path / "cache")
    named, dtypes = cell.params | {"packing": older}, {"states": "float32"}
    study.save(cache, kinds.WALK, named, shipped.dataset(cell), dtypes=dtypes)
    library = Library(cache=tmp_path / "cache")
    assert len(cache.entries()) == 1
    assert [one.params for one in library.cells()] == [one.params for one in shipped.cells()]


def test_a_page_is_only_called_within_the_loop_and_while_it_is_there():
    """Jobs end in other threads; asked there, a page could end between question and call."""
    called = []

    class Page:
        session_context = object()

        def add_next_tick_callback(self, function):
            called.append(threading.current_thread())

    async def visit():
        page = Page()
        wake = waker(page)
        await asyncio.to_thread(wake, print)
        await asyncio.sleep(0)
        page.session_context = None
        await asyncio.to_thread(wake, print)
        await asyncio.sleep(0)

    asyncio.run(visit())
    assert called == [threading.main_thread()]
