"""The card with the volume of S: offered, measured in the background, found again."""

import pytest
from visitor import wait_for

from app.explore.volume import Volume


@pytest.fixture
def view(state):
    made = Volume(state)
    wait_for(state)
    return made


def test_the_volume_is_measured_once_and_found_again(state, view):
    assert view.measure.visible and not view.tiles.object
    view.measure.clicks += 1
    assert state.work.measuring.running and not view.measure.visible
    wait_for(state)
    assert not view.measure.visible and "ln V" in view.tiles.object
    assert 0 < view.found["log_volume_error"].item() <= 0.1
    again = Volume(state)
    wait_for(state)
    assert again.tiles.object == view.tiles.object


def test_it_is_that_of_the_packing_on_screen(state, view):
    view.measure.clicks += 1
    state.choose(mu=0)
    wait_for(state)
    # One network only: nothing to measure.
    assert not view.measure.visible and view.found is None and not view.tiles.object
