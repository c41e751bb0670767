"""Two frictions side by side: what is kept beside the states on screen, and until when."""

import pytest
from small_store import DISKS, STATES
from visitor import wait_for

from app.packing.player import Player
from app.results.selection import select
from app.state.app_state import AppState


def asked(mu, **others):
    return select(DISKS, mu, 1, **{"states": STATES, "relax": "nearest_piqp"} | others)


def test_with_the_view_split_another_mu_leaves_the_first_beside_it(state):
    player = Player(state)
    state.ask(asked(1))
    wait_for(state)
    assert state.looks.beside is None and state.comparison.twin is None  # not split
    state.looks.split = True
    state.ask(asked(0.1))
    wait_for(state)
    assert (state.cell.mu, state.looks.beside, state.comparison.twin.cell.mu) == (0.1, 1, 1)
    assert player.twin["mu"] == 1 and player.walk["mu"] == 0.1
    assert player.twin["box"] != player.walk["box"]  # each its own packing
    state.choose(mu=0)
    wait_for(state)
    assert (state.cell.mu, state.comparison.twin.cell.mu) == (0, 1)
    player.beside = None  # pinned
    assert state.comparison.twin is None and not player.twin and state.looks.split
    state.choose(mu=1)
    wait_for(state)
    assert state.comparison.twin.cell.mu == 0
    state.looks.split = False
    assert state.looks.beside is None and state.comparison.twin is None


def test_other_disks_are_no_other_friction(state):
    state.looks.split = True
    state.ask(asked(0.1, states=5), at_once=True)
    wait_for(state)
    assert state.cell.selection.states == 5 and state.looks.beside is None


def test_a_link_holds_both(state, visited):
    state.looks.split = True
    state.choose(mu=1)
    wait_for(state)
    query = state.link()
    assert "split=1" in query and "beside=0.1" in query
    again = visited(f"?{query}")
    assert (again.cell.mu, again.looks.beside, again.comparison.twin.cell.mu) == (1, 0.1, 0.1)
    # back to a view with one of them
    again.open("?" + query.replace("&beside=0.1", "").replace("mu=1", "mu=0.1"))
    wait_for(again)
    assert (
        again.cell.mu == 0.1
        and again.looks.split
        and again.looks.beside is None
        and again.comparison.twin is None
    )


def test_a_link_has_the_other_computed_where_no_store_has_it(visited):
    again = visited(f"?mu=0.1&n={DISKS}&states=5&relax=nearest_piqp&split=1&beside=0.3")
    assert (again.cell.mu, again.comparison.twin.cell.mu) == (0.1, 0.3)
    assert again.comparison.twin.cell.selection == asked(0.3, states=5)


@pytest.mark.parametrize("mu", ["1e9", "-1", "nan", "many"])
def test_frictions_of_a_link_that_cannot_be_are_passed_over(library, mu):
    again = AppState(
        library, query=f"?mu=0.1&n={DISKS}&states=30&relax=nearest_piqp&split=1&beside={mu}"
    )
    wait_for(again)
    assert again.cell is not None and again.looks.beside is None and again.comparison.twin is None
