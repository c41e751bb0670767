"""Links to data that are computed, not computed, in no store, or damaged: nothing else is shown."""

from itertools import product
from types import SimpleNamespace

import pytest
from small_store import DISKS
from visitor import wait_for

import granforce as gf
from app.explore.controls import Controls
from app.explore.status_line import StatusLine
from app.explore.tabs.export import export
from app.packing.legend import measured
from app.results import uploads
from app.results.library import Library
from app.results.selection import Selection
from app.state.app_state import AppState
from app.state.links import read_link
from granforce.study import cells as study
from granforce.study import kinds

STATES = 5
GONE = "0" * 64  # the hash of a packing that nobody imported
VIEWS = "tab=export&colour=extent", "hold=2:1", "zoom=0:0:2&select=3&network=2"


@pytest.fixture(scope="module")
def imported():
    return gf.pack(DISKS, 0.3, seed=4)


@pytest.fixture
def library(shipped, tmp_path, imported):
    """With a packing that a visitor imported, not walked yet."""
    library = Library(shipped, tmp_path / "cache.zarr")
    uploads.keep(library, imported, "table: mine.csv")(SimpleNamespace(begin=print))
    return library


def saved(state):
    """The file of each kind that Export hands over now; empty if it refuses."""
    view, files = export.View(state), []
    view.buttons.hand_over = files.append
    view.buttons.hand_over_picture = lambda name, caption: files.append(name)
    for key in ("csv", "json", "png"):
        view._asked(key)
        wait_for(state)
    return files


def coherent(state, wanted):
    """All on screen is of one selection, that of the link; or nothing is, and nothing is saved."""
    shown = state.replay is not None
    assert shown == (not state.missing)
    if shown:
        assert state.selection == state.cell.selection and state.selection.names(wanted)
        assert state.replay.summary["mu"] == wanted.mu
        assert len(saved(state)) == 3
    else:
        assert state.selection.names(wanted) and state.work.message
        assert "Nothing is shown" in StatusLine(state).facts[0]
        assert saved(state) == [] and not Controls(state).go.visible
    return shown


def damage(library, kind):
    """Damage every entry of a kind in the cache."""
    for entry in study.entries(library.cache, kind):
        for part in (library.cache.path / entry.name).rglob("c/**/*"):
            if part.is_file():
                part.write_bytes(b"damaged")


@pytest.mark.filterwarnings("ignore:entry walk")
def test_a_link_shows_what_it_names_or_nothing(library, imported):
    """Each link opens a new page, on data as they come to be: not computed, computed, damaged."""
    mine = kinds.imported_parameters(imported)["imported"]
    links = {
        f"packing={mine}&mu=0.3": True,
        f"packing={mine}&mu=0.35": True,  # at which it was not made
        f"packing={mine}&mu=0": False,  # which does not hold it
        f"packing={GONE}&mu=0.3": False,
        f"packing={GONE}&mu=0.3&packed=0.2": False,
        f"n={DISKS}&mu=0.1": True,
        f"n={DISKS}&mu=0.22": True,
        "scene=arch&mu=0.6": True,
        "scene=arch&mu=0": False,
    }
    turns = product(("new", "again", "damaged"), links.items())
    for k, (turn, (query, possible)) in enumerate(turns):
        view = VIEWS[(k + k // len(links)) % len(VIEWS)]  # another one in each turn
        if turn == "damaged":
            damage(library, kinds.WALK)
            library = Library(library.shipped.path, library.cache.path)
        query = f"?{query}&relax=nearest_piqp&states={STATES}&{view}"
        state = AppState(library, query=query)
        wait_for(state)
        wanted = library.as_imported(read_link(query)[0])
        assert coherent(state, wanted) == possible, (turn, query, state.work.message)
        if possible and view.startswith("hold") and mine in query:
            assert "hold=2%3A1" in state.link(), (turn, query)
        state.work.close()


def test_a_failed_request_gives_the_controls_back_to_what_is_on_screen(library, imported):
    state = AppState(library, query=f"?n={DISKS}&mu=0.1")
    wait_for(state)
    widgets, before = Controls(state), state.replay
    asked = state.selection
    state.ask(Selection(kinds.imported_parameters(imported), 0.0, states=STATES), at_once=True)
    view = export.View(state)
    view._asked("csv")
    assert state.missing and not view.task.running
    assert "not what was requested" in state.work.message
    wait_for(state)
    assert "no forces hold this packing" in state.work.message
    assert not state.missing and state.selection == asked and state.replay is before
    assert widgets.scene.shown == "many" and widgets.mu.mu == 0.1
    state.work.close()


def test_while_other_states_are_computed_the_controls_count_those(library, imported):
    state = AppState(library, query=f"?n={DISKS}&mu=0.1")
    wait_for(state)
    widgets = Controls(state)
    state.ask(Selection(kinds.PACKING.parameters(40, 0.1, 1), 0.1, states=STATES), at_once=True)
    assert widgets.opens.line.startswith("40 disks")
    state.ask(Selection(kinds.imported_parameters(imported), 0.3, states=STATES), at_once=True)
    assert "disks" not in widgets.opens.line
    state.work.close()


def test_measured_forces_are_drawn_on_their_own_packing_only(library, imported):
    state = AppState(library, query=f"?n={DISKS}&mu=0.1")
    wait_for(state)
    params = kinds.imported_parameters(imported)
    state.measured = SimpleNamespace(packing=params, force=[], off=[])
    state.ask(Selection(params, 0.3, states=STATES))
    assert state.missing and measured(state, state.replay) == {}
    state.work.close()
