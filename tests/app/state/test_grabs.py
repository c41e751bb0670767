"""Forces in the visitor's hand: rails, pulls that stay, undo, links."""

import numpy as np
import pytest
from visitor import wait_for

from app.browser.messages import fits
from app.explore.tabs.export.files import contacts
from app.packing.captions import network
from app.packing.player import Player
from app.results import planes
from app.state import pulls
from granforce.live import pulls as live_pulls


class Page:
    """A page's hand, and what its player is told."""

    def __init__(self, state):
        self.state, self.told = state, []
        self.player = Player(state)
        state.hand.tell = self._tell
        wait_for(self.state)
        self.hear(drawn=True, visible=True)

    def _tell(self, message):
        assert any(fits(message, shape) for shape in self.player.to_browser), message
        self.told.append(message)

    def hear(self, **message):
        assert any(fits(message, shape) for shape, _ in self.player._handlers), message
        self.player.hear(message)
        wait_for(self.state)
        return self.told[-1] if self.told else None


@pytest.fixture
def page(state):
    return Page(state)


def test_a_contact_that_is_taken_is_selected_and_gets_a_rail(page, state):
    rail = page.hear(grab=4)["rail"]
    contacts = len(state.replay.backbone)
    assert state.looks.contact == 4 and rail["contact"] == 4
    normal = rail["normal"].reshape(-1, contacts)
    np.testing.assert_allclose(normal[:, 4], rail["values"], atol=1e-6)
    low, high = state.replay.low[4, 0], state.replay.high[4, 0]
    assert rail["lower"] - 1e-5 <= low <= high <= rail["upper"] + 1e-5
    here = np.abs(rail["values"] - state.replay.normal[0, 4]).argmin()
    np.testing.assert_allclose(normal[here], state.replay.normal[0], atol=1e-5)
    assert rail["residual"].max() < 1e-9 and len(rail["opened"]) == 2 * contacts


def test_of_many_contacts_a_part_of_the_rail_comes_first(page, state, monkeypatch):
    monkeypatch.setattr(live_pulls, "MANY", 1)
    page.hear(grab=4)
    part, rail = (message["rail"] for message in page.told if "rail" in message)
    assert not part["whole"] and rail["whole"] and set(part["values"]) < set(rail["values"])


def middle(rail):
    return float((rail["lower"] + rail["upper"]) / 2)


def test_let_go_it_stays_and_the_next_pull_starts_there(page, state):
    value = middle(page.hear(grab=4)["rail"])
    held = page.hear(pull=[4, value])["held"]
    assert held["normal"][4] == pytest.approx(value) and held["residual"] < 1e-9
    rail = page.hear(grab=9)["rail"]
    here = np.abs(rail["values"] - held["normal"][9]).argmin()
    normal = rail["normal"].reshape(len(rail["values"]), -1)
    np.testing.assert_allclose(normal[here], held["normal"], atol=1e-5)


def test_undo_steps_back_to_the_state(page, state):
    first = middle(page.hear(grab=4)["rail"])
    one = page.hear(pull=[4, first])["held"]
    page.hear(pull=[9, middle(page.hear(grab=9)["rail"])])
    assert len(state.hand.pulls) == 2
    again = page.hear(undo=True)["held"]
    np.testing.assert_array_equal(again["normal"], one["normal"])
    assert page.hear(undo=True) == {"held": None} and not state.hand.pulls


def test_pulls_travel_with_the_link(page, state, visited):
    page.hear(pull=[4, middle(page.hear(grab=4)["rail"])])
    held = page.hear(pull=[9, middle(page.hear(grab=9)["rail"])])["held"]
    other = visited(state.link())
    assert len(other.hand.pulls) == 2
    again = Page(other)
    np.testing.assert_allclose(again.told[-1]["held"]["normal"], held["normal"], atol=1e-4)


@pytest.mark.parametrize(
    "text",
    ["x", "1", "1:2:3", "-1:2", "1:nan", "1:1e9", "~".join(["1:1"] * 40), "1:", "p:1", "q:1:2"],
)
def test_links_with_pulls_that_make_no_sense_pull_nothing(text):
    with pytest.raises(ValueError):
        pulls.read(text)


def test_what_was_pulled_is_gone_with_another_state_on_screen(page, state):
    page.hear(pull=[4, middle(page.hear(grab=4)["rail"])])
    state.looks.frame = 3
    assert not state.hand.pulls and page.told[-1] == {"held": None}


def test_what_was_pulled_stays_when_exact_intervals_come(page, state):
    page.hear(pull=[4, middle(page.hear(grab=4)["rail"])])
    state.compute_exact()
    wait_for(state)
    assert state.exact is not None and len(state.hand.pulls) == 1


def test_a_force_that_cannot_be_is_one_clear_line(page, state):
    value = middle(page.hear(grab=4)["rail"])
    page.hear(pull=[4, value])
    page.hear(pull=[4, 900.0])
    assert "outside its exact interval" in state.work.message
    assert state.hand.pulls == [(4, value)]


def test_messages_that_make_no_sense_are_ignored(page, state):
    for message in (
        {"grab": -1},
        {"grab": 10**9},
        {"grab": "a"},
        {"pull": [10**9, 1.0]},
        {"pull": 3},
        {"pull": [4, float("nan")]},
        {"hold": [10**9, 1.0, 0]},
        {"hold": [1]},
        {"release": "x"},
        {"x": 1},
    ):
        page.player.hear(message)
    assert not page.told and not state.hand.pulls and not state.work.busy
    assert not state.knowledge.known
    page.player.hear({"hold": [4, float("nan"), 0]})
    assert not state.knowledge.known and "must lie between" in state.work.message


def test_the_pulls_of_a_page_are_limited(page, state):
    value = middle(page.hear(grab=4)["rail"])
    for k in range(pulls.MOST_PULLS):
        page.hear(pull=[4, (1 - 0.001 * k) * value])
    assert len(state.hand.pulls) == pulls.MOST_PULLS and not state.work.message
    page.hear(pull=[4, 0.9 * value])
    assert len(state.hand.pulls) == pulls.MOST_PULLS and "undo" in state.work.message


@pytest.mark.parametrize("pair", [None, ((4, 0), (9, 0)), ((4, 0), (4, 1))])
def test_the_point_in_force_space_is_pulled_along_both_axes(page, state, pair):
    replay = state.replay
    plane = planes.principal(replay) if pair is None else planes.components(replay, *pair)
    state.plane = plane
    fan = page.hear(grab_point=True)["fan"]
    corners, contacts = np.column_stack([fan["x"], fan["y"]]), len(replay.backbone)
    assert fan["residual"].max() < 1e-9 and len(fan["normal"]) == len(corners) * contacts
    # The polygon holds all states, and a point inside it is reached exactly.
    edge = np.roll(corners, -1, axis=0) - corners
    away = plane.path[:, None] - corners
    assert np.min(edge[:, 0] * away[..., 1] - edge[:, 1] * away[..., 0]) > -0.05 * np.ptp(corners)
    point = 0.7 * corners[0] + 0.3 * corners.mean(axis=0)
    held = page.hear(pull_point=point.tolist())["held"]
    found = np.stack([held["normal"], held["tangential"]], axis=1)
    reached = np.tensordot(plane.axes, found, ((1, 2), (0, 1))) - plane.origin
    np.testing.assert_allclose(reached, point, atol=1e-5)
    assert held["residual"] < 1e-9 and held["normal"].min() > -1e-6
    assert np.all(np.abs(held["tangential"]) <= replay.summary["mu"] * held["normal"] + 1e-6)
    # outside it, the nearest point of its edge; then undo
    far = page.hear(pull_point=(3 * corners[0]).tolist())["held"]
    assert far["residual"] < 1e-9
    again = page.hear(undo=True)["held"]
    np.testing.assert_array_equal(again["normal"], held["normal"])


def test_a_pulled_point_travels_with_the_link(page, state, visited):
    state.plane = planes.components(state.replay, (4, 0), (9, 1))
    fan = page.hear(grab_point=True)["fan"]
    held = page.hear(pull_point=[float(fan["x"].mean()), float(fan["y"].mean())])["held"]
    other = visited(state.link())
    assert other.hand.pulls[0][0] == "4n-9t"
    np.testing.assert_allclose(Page(other).told[-1]["held"]["normal"], held["normal"], atol=1e-4)


def test_a_link_keeps_a_pull_to_the_end_of_an_interval():
    """Rounded to the next digit, it would be asked for beyond the end, and refused."""
    given = [(17, 2.545365301781461)]
    assert pulls.read(pulls.spelled(given)) == given


def test_the_table_of_contacts_holds_what_was_pulled(page, state):
    """A file with other numbers than the picture would be worse than none."""
    value = middle(page.hear(grab=4)["rail"])
    page.hear(pull=[4, value])
    replay = state.replay
    table = contacts(replay, None, state.looks.frame, state.hand.held)
    assert table["f_n [mean]"][4] == pytest.approx(value)
    assert network(state) == "Pulled by hand from the network as packed"
    state.looks.pulled = "push"  # as the page reports while it shows one
    assert network(state) == "Network as packed, under a push"
    state.looks.pulled = "pull"
    page.hear(undo=True)
    assert state.hand.held is None and network(state) == "Network as packed"
