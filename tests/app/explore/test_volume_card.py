"""Buttons among the results: the volume of S, measured in the background, and more networks."""

import pytest
from visitor import wait_for

from app.explore.results_line import Results


@pytest.fixture
def results(state):
    made = Results(state)
    wait_for(state)
    return made


def test_the_volume_is_measured_once_and_found_again(state, results):
    assert "measure</button>" in results.html
    results.hear({"measure": True})
    assert state.work.measuring.running and "measure</button>" not in results.html
    wait_for(state)
    assert "measure</button>" not in results.html and " ± " in results.html
    again = Results(state)
    wait_for(state)
    assert again.html == results.html


def test_it_is_that_of_the_packing_on_screen(state, results):
    results.hear({"measure": True})
    state.choose(mu=0)
    wait_for(state)
    # One network only: nothing to measure.
    assert "measure</button>" not in results.html and "h free dimensions" in results.html


def test_too_few_networks_offer_more_of_them(state, results):
    assert "take five times as many</button>" in results.html
    before = state.cell.selection.states
    results.hear({"more": True})
    wait_for(state)
    assert state.cell.selection.states == 5 * before
