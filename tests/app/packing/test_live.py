"""What is computed is seen while it is computed: pictures of the compaction, states of the walk."""

import threading
import time

import numpy as np
import pytest
from small_store import DISKS
from visitor import wait_for

from app.background.jobs import Job
from app.browser.messages import fits
from app.explore.controls import Controls
from app.explore.tabs.force_space import force_space
from app.explore.tabs.intervals.intervals import View
from app.packing.player import Player
from app.results import planes, progress_feed
from app.results.selection import select
from app.state.page_tasks import Work


class Browser:
    """What a browser does with what it is sent: it paints each message and says so, if awake."""

    def __init__(self, state, awake=True):
        self.state, self.awake, self.got = state, awake, []
        self.player = Player(state)
        self.stream = self.player.stream
        self.player.tell = self._take
        self.player.hear({"drawn": True, "visible": awake})

    def _take(self, news):
        assert any(fits(news, shape) for shape in self.player.to_browser), sorted(news)
        self.got.append(news)
        if self.awake:
            self.player.hear({"painted": news["number"]})

    def look(self, awake):
        self.awake = awake
        self.player.hear({"visible": awake})

    def parts(self, name):
        return [news[name] for news in self.got if name in news]

    def run(self, until=lambda: False, seconds=120):
        """Tick and poll as a page does until nothing runs any more."""
        end = time.monotonic() + seconds
        while self.state.work.busy and not until() and time.monotonic() < end:
            time.sleep(0.005)
            self.stream.tick()
            self.state.work.poll()
        assert until() or not self.state.work.busy


def asked(mu, states=20, **others):
    return select(DISKS, mu, 1, states=states, relax="nearest_piqp", **others)


def test_compaction_and_walk_are_seen_as_they_go(state):
    browser, old = Browser(state), state.replay
    tab = View(state)
    state.ask(asked(0.23), at_once=True)
    assert (
        state.requested.startswith("requested: μ = 0.23")
        and browser.player.requested == state.requested
    )
    assert browser.player.live and state.shown is old
    browser.run(lambda: state.growing)
    pictures = browser.parts("picture")
    fractions = [picture["fraction"] for picture in pictures]
    # The gas has φ = 0.5. At least 33 pictures are kept, one for each shrinking by STRAIN; a page
    # that found them all at once would still be sent 21.
    assert len(pictures) > 18 and 0.5 - 1e-6 < fractions[0] < 0.55
    assert fractions[-1] > 0.75 and pictures[0]["box"][0] > 1.15 * pictures[-1]["box"][0]
    assert len(pictures[0]["centres"]) == 2 * DISKS and pictures[-1]["mu"] == 0.23
    assert state.growing and state.replay is old
    assert "as they are sampled" in state.source
    begun = browser.player.walk
    assert begun["room"] == 21 and len(begun["number"]) == 1 and begun["mu"] == 0.23
    assert len(tab.growth.growth.data["state"]) == 21
    browser.run()
    assert not state.growing and state.work.live is None and not state.requested
    assert not browser.player.live and browser.player.walk["room"] == 0
    states = browser.parts("states")
    normal = np.concatenate([part["normal"] for part in states]).reshape(-1, begun["contacts"])
    np.testing.assert_array_equal(normal, state.replay.normal[1 : len(normal) + 1])
    for name in ("eta1", "eta2", "eta3"):
        sent = np.concatenate([part[name] for part in states])
        np.testing.assert_allclose(sent, state.replay.growth[name][1 : len(sent) + 1], atol=1e-5)
    np.testing.assert_array_equal(begun["starts"], browser.player.walk["starts"])


def test_what_is_computed_at_once_is_never_offered_to_be_computed(state):
    """A button that came and went would have the whole page laid out twice."""
    controls, offered = Controls(state), []
    controls.go.param.watch(lambda event: offered.append(event.new), "visible")
    browser = Browser(state)
    state.ask(asked(0.38), at_once=True)
    assert state.missing and state.work.busy and not offered
    browser.run()
    assert not offered and state.replay.summary["mu"] == 0.38


def test_force_space_has_axes_of_the_states_found_so_far(state):
    """New ones when the walk has grown fourfold; those of all states and an outline at its end."""
    state.looks.param.update(tab="plane", axes="principal")
    browser, tab = Browser(state), force_space.View(state)
    wait_for(state)
    state.ask(asked(0.36, 400), at_once=True)
    browser.run(lambda: state.growing)
    assert state.plane is None and not len(tab.drawing.path.data["x"])
    assert len(tab.drawing.outer.data["x"]) == 1  # no outline
    browser.run(lambda: state.plane is not None)
    first, states = state.plane, state.work.live.states().astype(float)
    assert len(states) >= 4 and len(tab.drawing.path.data["x"]) == 401
    x, y = (tab.drawing.path.data[name] for name in "xy")
    assert np.isfinite([x[0], y[0]]).all() and np.isnan(x[1:]).all()  # the player fills them in
    np.testing.assert_allclose(np.linalg.norm(first.axes, axis=(1, 2)), 1)
    assert not len(tab.drawing.outer.data["x"])
    browser.run(lambda: state.plane is not first)
    assert not state.growing or state.work.fourfold > 1
    browser.run()
    assert np.isfinite(tab.drawing.path.data["x"]).all() and len(tab.drawing.outer.data["x"])
    assert len(state.replay.normal) == len(tab.drawing.path.data["x"])
    same = (planes.principal(state.replay).axes * state.plane.axes).sum(axis=(1, 2))
    np.testing.assert_allclose(np.abs(same), 1, atol=1e-6)


def test_force_space_of_a_chosen_contact_needs_no_states_for_its_axes(state):
    state.looks.tab = "plane"
    browser, tab = Browser(state), force_space.View(state)
    wait_for(state)
    tab.planes.value = "contact"
    state.ask(asked(0.37, 20_000), at_once=True)
    browser.run(lambda: state.growing)
    kept = state.plane
    assert kept.components and len(tab.drawing.path.data["x"]) == len(
        progress_feed.numbers(state.shown.summary)
    )
    browser.run(lambda: state.work.fourfold > 1)
    assert state.plane is kept
    state.work.cancel()
    browser.run()
    browser.stream.tick()
    wait_for(state)
    assert np.isfinite(tab.drawing.path.data["x"]).all() and len(tab.drawing.outer.data["x"])


def test_a_page_that_comes_later_joins_and_both_end_with_the_same(visited):
    first, second = visited(), visited()
    one, two = Browser(first), Browser(second)
    first.ask(asked(0.24, 400), at_once=True)
    one.run(lambda: len(one.parts("states")) > 0)
    second.ask(asked(0.24, 400), at_once=True)
    assert second.work.live is not first.work.live
    two.run(lambda: second.growing)
    assert second.shown is first.shown  # not computed anew
    two.run(
        lambda: "already under way" in second.work.progress.get("words", "") or not second.work.busy
    )
    while first.work.busy or second.work.busy:
        one.run(lambda: True)
        two.run(lambda: True)
        for browser in (one, two):
            browser.stream.tick()
            browser.state.work.poll()
    assert second.replay.summary["states"] == 400
    np.testing.assert_array_equal(first.replay.normal, second.replay.normal)


@pytest.mark.parametrize(("leave", "mu"), [(Work.cancel, 0.33), (Work.close, 0.34)])
def test_who_leaves_does_not_end_what_others_wait_for(leave, mu, visited):
    first, second = visited(), visited()
    one, two = Browser(first), Browser(second)
    wanted = asked(mu, 20_000)
    first.ask(wanted, at_once=True)
    one.run(lambda: len(one.parts("states")) > 0)
    second.ask(wanted, at_once=True)
    two.run(lambda: second.growing)
    walk = progress_feed.shared(progress_feed.Walking, wanted.parameters())
    run, found = walk.run, len(walk.parts)
    leave(first.work)
    one.run()
    assert not first.work.busy and not second.work.computation.message
    two.run(lambda: len(walk.parts) > found + 20)
    assert walk.run == run and second.work.computation.running  # not begun anew
    job = second.work.computation.job
    second.work.cancel()
    two.run()
    assert not second.work.busy and job.wait(240)  # nobody wants it any more
    assert len(walk.parts) < 20_000


def test_while_it_is_compressed_the_words_say_that_it_moves(state):
    browser = Browser(state)
    player = Player(state)
    assert "faint disks: no force" in player.legend
    state.ask(asked(0.35, 20_000), at_once=True)
    browser.run(lambda: state.work.moving)
    assert "the shrinking box" in player.legend
    browser.run(lambda: state.growing)
    assert "faint disks: no force" in player.legend
    state.work.cancel()
    browser.run()


def test_a_picture_on_screen_is_soon_that_which_is_computed():
    """Who paints a little faster than pictures come is not behind for long, whatever came first."""
    seen, run, place = progress_feed.Compaction(), 0, 0
    for k in range(100):
        seen.add(Glimpse(10 * 0.99**k))
    for k in range(100, 150):
        seen.add(Glimpse(10 * 0.99**k))
        run, place, _ = seen.after(run, place)
        run, place, _ = seen.after(run, place)
    assert seen.total - place < 5


def test_hidden_pages_are_sent_nothing(state):
    browser = Browser(state, awake=False)
    state.ask(asked(0.25), at_once=True)
    browser.run()
    assert not browser.got and state.replay.summary["mu"] == 0.25


def test_a_browser_that_stops_painting_is_sent_no_more(state):
    browser = Browser(state)
    browser.awake = False  # it says nothing any more
    state.ask(asked(0.26), at_once=True)
    browser.run()
    assert 1 <= len(browser.got) <= 2


def test_cancelled_the_old_picture_is_back_and_says_what_is_not_computed(state):
    browser, old = Browser(state), state.replay
    state.ask(asked(0.27, 20_000), at_once=True)
    browser.run(lambda: state.growing)
    state.work.cancel()
    browser.run()
    browser.stream.tick()
    assert state.shown is old and state.work.live is None and state.missing
    assert state.requested.startswith("of μ = 0.1; not computed: μ = 0.27")
    assert "precomputed" in state.source
    assert browser.player.walk["room"] == 0 and browser.player.walk["mu"] == 0.1


def test_another_question_takes_the_place_of_the_first(state):
    browser = Browser(state)
    state.ask(asked(0.28, 20_000), at_once=True)
    browser.run(lambda: bool(browser.got))
    state.ask(asked(0.29), at_once=True)
    browser.run()
    assert state.replay.summary["mu"] == 0.29 and not state.missing


def test_what_is_in_the_store_ends_what_is_computed(state):
    state.ask(asked(0.31, 20_000), at_once=True)
    state.choose(mu=1)
    wait_for(state)
    assert state.replay.summary["mu"] == 1 and not state.missing and state.work.live is None


def test_a_point_is_seen_to_be_compressed_and_needs_no_walk(state):
    browser = Browser(state)
    state.ask(select(20, 0, 5, states=5), at_once=True)
    browser.run()
    assert browser.parts("picture") and state.replay.summary["dimension"] == 0


def test_exact_bounds_are_seen_as_they_are_found(state, monkeypatch):
    told, seen, tell = threading.Event(), threading.Event(), Job.tell

    def half_way(job, done, total, **options):
        tell(job, done, total, **options)
        if total and done >= total / 8 and not told.is_set():
            told.set()
            assert seen.wait(240)

    monkeypatch.setattr(Job, "tell", half_way)
    state.compute_exact()
    assert state.work.arriving == {}
    assert told.wait(240)
    state.work.poll()
    found = state.work.arriving
    seen.set()
    wait_for(state)
    assert state.work.arriving is None
    there = np.isfinite(found["high"])
    assert there.any() and np.isnan(found["low"]).any()
    exact = state.exact["high"].values[:, 0] / state.replay.force_scale
    np.testing.assert_array_equal(found["high"][there], exact[there])


def test_exact_bounds_are_drawn_as_they_come(state):
    """Of a bar that has one bound only, the other end is what was seen."""
    tab, low = View(state), np.full(len(state.replay.backbone), np.nan)
    high = low.copy()
    high[0], high[1], low[1] = 7, 8, 0.25
    state.work.arriving = {"low": low, "high": high}
    bars = tab.drawing.bars.data
    first, second = (int(np.flatnonzero(bars["at"] == contact)[0]) for contact in (0, 1))
    assert bars["exact_high"][first] == 7 and bars["exact_low"][first] == state.replay.low[0, 0]
    assert (bars["exact_low"][second], bars["exact_high"][second]) == (0.25, 8)
    assert np.isfinite(bars["exact_high"]).sum() == 2


class Glimpse:
    """A packing as `gf.pack` shows it, of so many grains in a box of this side."""

    def __init__(self, side, grains=1):
        self.box = np.full(2, side)
        self.x, self.r = np.zeros((grains, 2)), np.ones(grains)
        self.i = self.j = np.zeros(0, np.int64)
        self.reach = self.forces = np.zeros((0, 2))
        self.step, self.packing_fraction, self.unbalance, self.tilt = 0, 0.5, np.inf, 0.0


def test_pictures_are_kept_as_the_box_shrinks_and_as_time_goes(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(progress_feed.time, "perf_counter", lambda: clock[0])
    seen = progress_feed.Compaction()
    for side in (10, 9.99, 9.9, 9.9, 9.9):
        seen.add(Glimpse(side))
    assert seen.total == 2
    clock[0] += 2 * progress_feed.EVERY_S
    seen.add(Glimpse(9.9))
    assert seen.total == 3


def test_who_is_far_behind_leaves_pictures_out_and_misses_none_of_the_newest():
    seen = progress_feed.Compaction()
    for k in range(200):
        seen.add(Glimpse(10 * 0.99**k))
    run, place, sides = 0, 0, []
    while True:
        run, place, picture = seen.after(run, place)
        if picture is None:
            break
        sides.append(picture["box"][0])
    assert 30 < len(sides) < 60 and sides == sorted(sides, reverse=True)
    assert sides[-1] == pytest.approx(10 * 0.99**199)
    seen.restart()
    seen.add(Glimpse(7))
    assert seen.after(run, place)[2]["box"][0] == 7


def test_old_pictures_are_dropped_beyond_a_limit():
    grains = int(progress_feed.PICTURE_BYTES / 8 / 12)  # of which eight pictures fit
    seen = progress_feed.Compaction()
    for k in range(50):
        seen.add(Glimpse(10 * 0.99**k, grains))
    _, place, picture = seen.after(0, 0)
    assert place > 40 and picture is not None


def test_of_many_states_as_many_are_sent_as_a_page_can_hold():
    ten = int(progress_feed.FRAME_BYTES / 8 / 10)  # contacts, of which ten states fit
    numbers = progress_feed.numbers({"states": 95, "contacts": ten})
    assert numbers[0] == 0 and numbers[1] == 1 and np.ptp(np.diff(numbers[1:])) == 0
    assert len(numbers) <= 11 and numbers[-1] <= 95


def test_readers_may_come_from_any_thread():
    seen, stop = progress_feed.Compaction(), threading.Event()

    def read():
        run = place = 0
        while not stop.is_set():
            run, place, _ = seen.after(run, place)

    readers = [threading.Thread(target=read) for _ in range(3)]
    for reader in readers:
        reader.start()
    for k in range(300):
        seen.add(Glimpse(10 * 0.99**k, 50))
    stop.set()
    for reader in readers:
        reader.join(10)
        assert not reader.is_alive()
    assert seen.total == 300
