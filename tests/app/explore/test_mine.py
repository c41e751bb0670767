"""My computations: what is in the visitor's own cache, by name; and what deleting leaves."""

import pytest
from small_store import DISKS
from visitor import wait_for

from app.explore.tabs.your_packing.my_computations import Mine
from app.results import entry_labels, my_results, uploads
from app.results.selection import select
from granforce.records import InputError


@pytest.fixture
def computed(state):
    """A page with two computations of one packing in its cache."""
    for states in (3, 4):
        state.ask(select(DISKS, 0.3, 2, states=states), at_once=True)
        wait_for(state)
    return state


def test_computations_are_listed_named_opened_and_deleted(computed):
    state, view = computed, Mine(computed)
    wait_for(state)
    newest, older = sorted(view.rows, key=lambda row: "3 networks" in row["what"])
    assert newest["shown"] and not older["shown"] and newest["when"] >= older["when"]
    assert (
        "3 networks" in older["what"] and older["what"].startswith("μ = 0.3") and not older["name"]
    )
    assert older["megabytes"] > 0
    view.hear({"entry": older["entry"], "name": "  the  short\none "})
    wait_for(state)
    called = {row["entry"]: row["name"] for row in view.rows}
    assert called == {newest["entry"]: "", older["entry"]: "the short one"}
    view.hear({"open": older["entry"]})
    wait_for(state)
    assert state.selection.states == 3
    for row in (older, newest):
        assert state.library.cache.find("packing", n=DISKS, seed=2)  # as long as states need it
        view.hear({"delete": row["entry"]})
        wait_for(state)
    assert not view.rows and not list(state.library.cache)  # nothing of it is left
    assert entry_labels.names(state.library.cache) == {}
    assert state.replay is not None and state.work.message == ""  # what is on screen stays there


def test_what_is_not_in_the_list_is_left_alone(computed):
    state, view = computed, Mine(computed)
    wait_for(state)
    before = sorted(state.library.cache)
    packing = next(name for name in before if name.startswith("packing"))
    for entry in (packing, "../elsewhere", state.library.shipped.name("walk", {}, version=1)):
        view.hear({"delete": entry})
        view.hear({"entry": entry, "name": "mine"})
        wait_for(state)
    assert sorted(state.library.cache) == before and entry_labels.names(state.library.cache) == {}
    with pytest.raises(InputError, match="no longer"):
        my_results.delete(state.library, packing)


def test_an_upload_is_called_by_its_files(state):
    packing = state.library.packing(state.cell.params["packing"])
    brought = uploads.keep(state.library, packing, "NPZ archive: heap.npz")
    task = state.work.task()
    found = []
    task.start(brought, found.append)
    wait_for(state)
    state.ask(select(DISKS, 1, 1, states=3)._replace(packing=found[0].params, mu=1.0), at_once=True)
    assert "heap.npz" in state.requested
    wait_for(state)
    assert state.cell.series.startswith("heap.npz ") and "heap.npz" in state.source
