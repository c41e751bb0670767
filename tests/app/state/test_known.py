"""What is taken for known: intervals shrink, contradictions are refused, links keep it."""

import subprocess

import numpy as np
import pytest
from visitor import wait_for

from app.background.jobs import Job
from app.explore.results_line import results
from app.explore.status_line import bounds
from app.explore.tabs.intervals.intervals import View
from app.explore.tabs.intervals.known_forces import Known, meaning, words
from app.explore.tabs.intervals.order import ordered
from app.packing.captions import PACKED, network
from app.packing.legend import legend
from app.packing.player import Player
from app.results import planes
from app.state import known
from app.state.known import Statement
from granforce.packing.importers import read_known


def held(state, *contacts, error=0.0):
    """Contacts held at their original force, one after the other."""
    for contact in contacts:
        state.knowledge.hold(contact, float(state.replay.normal[0, contact]), error)
        wait_for(state)


def test_a_held_force_narrows_the_others(state):
    held(state, 4)
    found = state.knowledge.narrowed
    assert not state.work.message and found.known == tuple(state.knowledge.known)
    (h, fewer), (mean, less) = found.dimension, found.mean
    assert fewer == h - 1 and less < mean
    assert np.all(found.extents[1] <= found.extents[0] + 1e-6)
    assert found.extents[1][4] < 1e-6 and found.shortened[4] == 0 < found.shortened.max()
    assert state.possible is found.after
    order = ordered(state.replay, {}, "shortened", found).contacts
    assert order[0] == 4 and np.all(np.diff(found.shortened[order[1:]]) <= 0)
    held(state, 9)
    assert (
        state.knowledge.narrowed.dimension == (h, h - 2) and state.knowledge.narrowed.mean[1] < less
    )


def test_a_force_in_single_precision_is_held_as_it_is_read(state):
    """A force on screen is a float32: 3.7 arrives as 3.7000000477, but links say 3.7."""
    state.knowledge.hold(4, float(np.float32(3.7)), float(np.float32(0.1)))
    assert known.spelled(state.knowledge.known) == "4:3.7:0.1"
    state.knowledge.hold(4, 3.70000001, 0.1)
    assert known.spelled(state.knowledge.known) == "4:3.70000001:0.1"


def test_colour_and_width_show_what_measuring_took_away(state):
    player = Player(state)
    assert player.reduction is None
    state.looks.colour = "known"
    state.knowledge.hold(4, float(state.replay.normal[0, 4]))
    state.knowledge.hold(9, float(state.replay.normal[0, 9]), 0.02)
    wait_for(state)
    before, after = state.knowledge.narrowed.extents
    assert player.reduction == pytest.approx(np.maximum(before - after, 0), abs=1e-5)
    assert player.reduction[4] == pytest.approx(before[4], abs=1e-4)  # held: all of it
    assert player.reduction[9] > before[9] - 0.04 - 1e-4  # at most the error bar is left
    others = np.delete(before - after, [4, 9])
    assert f"{others.max():.2f} ⟨fₙ⟩ (the largest of the others)" in player.legend
    state.knowledge.release(4)
    state.knowledge.release(9)
    wait_for(state)
    assert player.reduction is None and state.looks.colour == "change"


def test_what_carries_for_certain_is_counted_by_certified_bounds(state):
    state.knowledge.hold(4, float(state.replay.normal[0, 4]))
    wait_for(state)
    low = state.knowledge.narrowed.after["low"].values[:, 0] / state.replay.force_scale
    assert 0 < state.knowledge.narrowed.carrying <= np.sum(low > 1e-9) < len(low)
    told = words(state.knowledge, state.replay.backbone)
    assert f"{state.knowledge.narrowed.carrying} of {len(low)} contacts" in told


def test_the_command_holds_what_is_known(state, tmp_path):
    """Run in a shell, it writes a file that says the same."""
    assert "known" not in state.command
    value = float(state.replay.normal[0, 4])
    state.knowledge.hold(4, value, 0.1)
    wait_for(state)
    file, walk, intervals = state.command.splitlines()
    assert walk.startswith("granforce walk ") and intervals.endswith("--known known.csv")
    assert intervals.startswith("granforce intervals -n 30 --mu 0.1 --seed 1")
    subprocess.run(["sh", "-c", file], cwd=tmp_path, check=True)
    found = read_known(tmp_path / "known.csv")
    assert found.contacts.tolist() == [state.replay.backbone[4]]
    bounds = np.array([found.low[0, 0], found.high[0, 0]]) / state.replay.force_scale
    assert bounds == pytest.approx([value - 0.1, value + 0.1], abs=1e-6)


def test_numbers_and_bars_say_that_they_obey_what_is_held(state):
    """Networks of all of S exceed bounds given held forces: they are not drawn within them."""
    intervals = View(state)
    held(state, 4)
    (h, fewer), shown = state.knowledge.narrowed.dimension, results(state)
    assert f"{h} → {fewer} given the held forces" in shown
    assert "exact given the held forces" in shown and "older than the held forces" in shown
    bars, lead = intervals.drawing.bars.data, intervals.lead
    assert np.all(np.isnan(bars["high"])) and np.all(np.isfinite(bars["exact_high"]))
    assert "given the held forces" in lead.object and "in a network of all of S" in lead.object
    state.hand.pulls = [(9, float(state.replay.normal[0, 9]))]  # which keeps the held force
    assert "in a network of all of S" not in lead.object
    state.knowledge.release(4)
    wait_for(state)
    assert np.all(np.isfinite(intervals.drawing.bars.data["high"]))
    assert f"{h} = " in results(state) and "given" not in lead.object


def test_networks_are_sampled_with_what_is_held(state, visited):
    """A walk and a uniform sample of the smaller S; released, the networks of all of S return."""
    held(state, 4)
    all_of_S, (h, fewer) = state.cell, state.knowledge.narrowed.dimension
    narrowed, player = state.knowledge.narrowed, Player(state)
    assert not state.obeying and player.ignoring
    assert "Sample networks" in Known(state).words
    state.sample_held()
    assert state.possible is narrowed.after and not state.requested  # of the same packing
    wait_for(state)
    value, replay = state.knowledge.known[0].value, state.replay
    assert replay.normal[1:, 4] == pytest.approx(value, abs=1e-6) and len(replay.normal) == 31
    assert state.obeying and not player.ignoring and replay.summary["dimension"] == fewer == h - 1
    shown = Known(state).words
    assert f"{fewer} of {h}" in shown and "played have it" in shown
    seen = "seen given the held forces (30 networks)"
    assert seen in results(state) and "ignores" not in results(state)
    state.looks.tab = "perturb"
    assert f"{seen}, which a push ignores" in results(state)
    state.looks.tab = "intervals"
    assert state.knowledge.narrowed is narrowed  # not computed again
    assert np.all(np.isfinite(View(state).drawing.bars.data["high"]))
    assert state.looks.frame == 1 and planes.other_states(state.catalogue, state.cell) is None
    plane = planes.components(replay, (4, 0), (9, 0))
    outlined = planes.outline(state.library, state.cell, replay, plane)(Job(lambda job: None))
    assert np.ptp(outlined.outer[:, 0]) < 1e-3 < np.ptp(outlined.outer[:, 1])  # of the smaller S
    state.looks.frame = 0
    assert network(state) == PACKED.capitalize() + ", which ignores the held forces"
    state.looks.frame = 3
    assert network(state) == "Network 3 of 30"
    assert state.command.splitlines()[1].endswith("--relax nearest_piqp --known known.csv")
    other = visited(state.link())
    wait_for(other)
    assert other.obeying and other.cell == state.cell and other.knowledge.known
    state.ask(state.cell.selection._replace(kind="uniform"), at_once=True)
    wait_for(state)
    assert state.obeying and state.replay.normal[1:, 4] == pytest.approx(value, abs=1e-6)
    held(state, 9)  # the networks follow
    assert len(state.cell.selection.held) == 2 and state.cell.kind == "uniform" and state.obeying
    state.knowledge.known = []
    wait_for(state)
    assert not state.cell.selection.held and state.cell.kind == "uniform"
    state.show(all_of_S)
    wait_for(state)
    assert state.cell == all_of_S and state.obeying


def test_a_push_shows_no_held_forces(state):
    player = Player(state)
    state.looks.colour = "extent"
    state.compute_exact()
    wait_for(state)
    most = player.most
    held(state, 4)
    given = player.exact["high"]
    assert player.most == most and "(scale of the free forces)" in legend(state)
    assert "without the held" not in bounds(state)
    state.looks.tab = "perturb"
    assert "(exact, this packing)" in legend(state)
    assert player.reduction is None and np.all(player.exact["high"] >= given - 1e-6)
    assert np.any(player.exact["high"] > given + 1e-3)
    state.looks.tab = "intervals"
    np.testing.assert_array_equal(player.exact["high"], given)


def test_an_error_bar_narrows_less_and_leaves_the_dimension(state):
    held(state, 4, error=0.05)
    h, same = state.knowledge.narrowed.dimension
    wide = state.knowledge.narrowed.mean[1]
    assert h == same and wide < state.knowledge.narrowed.mean[0]
    held(state, 4)  # says it anew
    assert len(state.knowledge.known) == 1 and state.knowledge.narrowed.mean[1] < wide


def test_let_go_all_is_as_before(state):
    held(state, 4, 9)
    state.knowledge.release(9)
    wait_for(state)
    assert [one.contact for one in state.knowledge.narrowed.known] == [4]
    state.knowledge.release(4)
    wait_for(state)
    assert state.knowledge.narrowed is None and state.possible is state.exact


def test_it_travels_with_the_link(state, visited):
    held(state, 4, 9)
    held(state, 20, error=0.1)
    other = visited(state.link())
    assert (
        other.knowledge.known == state.knowledge.known
        and other.knowledge.narrowed.mean == state.knowledge.narrowed.mean
    )


@pytest.mark.parametrize(
    "text", ["x", "1", "1:2:3:4", "-1:2", "1:nan", "1:1e9", "1:2:-1", "1:1~1:2", ""]
)
def test_links_that_make_no_sense_state_nothing(text):
    with pytest.raises(ValueError):
        known.read(text)


def test_a_link_cannot_state_more_than_a_page(state):
    with pytest.raises(ValueError):
        known.read("~".join(f"{c}:1" for c in range(known.MOST_KNOWN + 1)))
    for contact in range(known.MOST_KNOWN):
        state.knowledge.known = [*state.knowledge.known, Statement(contact, 1.0, 5.0)]
    state.knowledge.hold(40, 1.0)
    assert "release some" in state.work.message and len(state.knowledge.known) == known.MOST_KNOWN
    state.work.cancel()


def test_contradictions_are_one_clear_line_and_taken_back(state, visited):
    held(state, 4)
    before = state.knowledge.known
    state.knowledge.known = [*before, Statement(9, 30.0)]
    wait_for(state)
    assert "satisfies all known forces" in state.work.message and "\n" not in state.work.message
    assert state.knowledge.known == before and state.knowledge.narrowed.known == tuple(before)
    other = visited(state.link().split("&hold")[0] + "&hold=9:30")
    assert "satisfies all known forces" in other.work.message and not other.knowledge.known


def test_what_is_left_no_room_for_is_refused_at_once(state):
    held(state, 4)
    low, high = (
        state.knowledge.narrowed.after["low"].values[:, 0],
        state.knowledge.narrowed.after["high"].values[:, 0],
    )
    scale = state.replay.force_scale
    state.knowledge.hold(9, float(high[9] / scale + 0.2))
    assert "allow" in state.work.message and len(state.knowledge.known) == 1 and not state.work.busy
    fixed = [c for c in np.flatnonzero(high - low < 1e-9) if c != 4]
    for contact in fixed[:1]:
        state.knowledge.hold(int(contact), float(low[contact] / scale))
        assert "no information" in state.work.message and len(state.knowledge.known) == 1


def test_another_packing_has_its_own(state):
    held(state, 4)
    state.choose(mu=1)
    wait_for(state)
    assert not state.knowledge.known and state.knowledge.narrowed is None


def test_pulls_keep_what_is_held(state):
    told = []
    hand, state.hand.tell = state.hand, told.append
    held(state, 4)
    hand.grab(9)
    wait_for(state)
    rail = told[-1]["rail"]
    normal = rail["normal"].reshape(len(rail["values"]), -1)
    np.testing.assert_allclose(normal[:, 4], state.knowledge.known[0].value, atol=1e-6)
    assert np.ptp(normal[:, 9]) > 0
    hand.grab(4)
    assert told[-1] == {"rail": None} and "release it" in state.work.message


def test_what_was_pulled_can_be_held(state):
    told = []
    hand, state.hand.tell = state.hand, told.append
    hand.grab(9)
    wait_for(state)
    rail = told[-1]["rail"]
    hand.pull(9, (rail["lower"] + 3 * rail["upper"]) / 4)
    wait_for(state)
    pulled = told[-1]["held"]["normal"]
    state.knowledge.hold(9, float(pulled[9]))
    wait_for(state)
    assert len(state.hand.pulls) == 1 and not state.work.message
    np.testing.assert_allclose(told[-1]["held"]["normal"], pulled, atol=1e-4)


def test_a_force_held_at_nothing_leaves_the_same_contacts(state):
    state.compute_exact()
    wait_for(state)
    low = state.exact["low"].values[:, 0]
    contact = int(np.flatnonzero(low < 1e-9)[0])
    state.knowledge.hold(contact, 0.0)
    wait_for(state)
    assert (
        not state.work.message
        and state.knowledge.narrowed.mean[1] < state.knowledge.narrowed.mean[0]
    )
    np.testing.assert_array_equal(state.knowledge.narrowed.after["backbone"], state.replay.backbone)


def test_bounds_arrive_the_held_contact_first(state, monkeypatch):
    statements = (Statement(4, float(state.replay.normal[0, 4])),)
    shown, told = state.library.shown(state.cell), []

    def add(arriving, bound, whole=known.Underway.add):
        if not told:
            told.append(arriving.narrowed)
        whole(arriving, bound)
        told.append(arriving.narrowed)

    monkeypatch.setattr(known.Underway, "add", add)
    found = []
    state.work.task().start(known.narrowing(state.library, shown, statements), found.append)
    wait_for(state)
    lefts = [one.left for one in told]
    assert lefts == sorted(lefts, reverse=True) and lefts[0] == 1 and len(lefts) > 50
    np.testing.assert_array_equal(told[0].after["high"], told[0].before["high"])
    first = told[2].after["high"].values[:, 0] != told[0].after["high"].values[:, 0]
    assert first[4]
    for side in ("low", "high"):
        np.testing.assert_allclose(told[-1].after[side], found[0].after[side], atol=1e-9)


def test_which_to_measure_next_is_in_order_and_worth_it(state):
    held(state, 4)
    known = Known(state)
    state.knowledge.rank()
    assert known.meaning.startswith("In progress: ") and known.asking
    wait_for(state)
    best = state.knowledge.ranked
    assert known.meaning == meaning(best, "") and not known.asking
    assert best.known == tuple(state.knowledge.known) and 4 not in best.contacts
    assert meaning(best, "").startswith("Exact: mean interval")
    assert "with this force held at its mean" in meaning(best, "")
    some = best._replace(after=np.where(np.arange(len(best.after)) < 3, best.after, np.nan))
    assert "best 3" in meaning(some, "") and "standard deviation" in meaning(some, "")
    assert np.all(np.diff(best.after) >= 0) and best.after[0] < best.before
    assert best.before == pytest.approx(state.knowledge.narrowed.mean[1], abs=1e-6)
    held(state, int(best.contacts[0]))
    assert state.knowledge.ranked is None  # of what was known before
    assert state.knowledge.narrowed.mean[1] < best.before
