"""`gf.show` and `granforce app FILE`: a packing of one's own, opened on the page."""

import time
from types import SimpleNamespace
from urllib.parse import urlsplit

import numpy as np
import pytest
from packings import packed
from serving import PATIENCE, painted, scene

import granforce as gf
from app.results.library import Library
from granforce.cli import viewer


@pytest.fixture
def nobody(tmp_path, monkeypatch):
    """No server is started; what is shown is saved in a store of its own."""
    monkeypatch.setenv("GRANFORCE_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(
        viewer, "_server", lambda: ("http://nobody/app", tmp_path, SimpleNamespace())
    )


def test_what_is_shown_of_an_ensemble_is_not_computed_again(nobody, shipped, visited):
    packing = packed(30, 0.1, 5)
    S = gf.ensemble(packing, 0.3)
    bounds, done = gf.intervals(S), gf.walk(S, 7, seed=3)
    view = gf.show(S, bounds, done, seed=3, browser=False)
    state = visited(urlsplit(view.address).query, Library(shipped))
    assert not state.missing and state.work.live is None and state.looks.tab == "intervals"
    assert state.cell.mu == 0.3 and state.cell.selection.states == 7
    np.testing.assert_allclose(
        state.replay.normal[1:] * S.force_scale, done.states[..., 0], rtol=1e-6
    )
    np.testing.assert_array_equal(state.exact["high"], bounds.high)


def test_nothing_is_shown_that_is_no_result_of_its_ensemble(nobody):
    S, other = gf.ensemble(packed(30, 0.1, 5)), gf.ensemble(packed(30, 0.1, 4))
    bounds, done = gf.intervals(S), gf.walk(S, 3, seed=1)
    held = gf.ensemble(S.packing, known=gf.Known([S.index[0]], [[0.0, -np.inf]], [[np.inf] * 2]))
    for given, options, message in (
        ((bounds,), {}, r"as in show\(S, intervals\), not Intervals"),
        ((S.packing, bounds), {}, "not Packing and Intervals"),
        ((S, "bounds"), {}, "not Ensemble and str"),
        ((S,), {"seed": 1}, "a seed is that of a walk"),
        ((S, done), {}, "another seed"),
        ((S, gf.intervals(S, S.index[:3])), {}, "all contacts of this ensemble"),
        ((other, bounds), {}, "all contacts of this ensemble"),
        ((held, bounds), {}, "no conditions but the friction"),
    ):
        with pytest.raises(gf.InputError, match=message):
            gf.show(*given, browser=False, **options)


def test_a_packing_is_shown_and_its_held_forces_come_back(opening, tmp_path, monkeypatch):
    monkeypatch.setenv("GRANFORCE_CACHE", str(tmp_path / "cache"))
    packing = packed(30, 0.1, 5)
    view = gf.show(packing, browser=False)
    assert view.known is None
    assert viewer.wait_for_server(view.address)
    assert view.address in view._repr_html_().replace("&amp;", "&")
    contact = int(gf.ensemble(packing).index[0])
    force = packing.forces[contact, 0] / packing.forces[:, 0].mean()
    page = opening(f"&known={contact}:{force:.9g}", 1280, 900, at=view.address)
    painted(page)
    assert scene(page, "scene.geometry.mu") == pytest.approx(0.1)
    until = time.monotonic() + PATIENCE / 1000
    while view.known is None and time.monotonic() < until:
        page.wait_for_timeout(100)
    assert view.known.contacts.tolist() == [contact]
    exact = gf.intervals(gf.ensemble(packing, known=view.known))
    assert np.ptp([exact.low[0, 0], exact.high[0, 0]]) < 1e-6 * packing.forces[:, 0].mean()
    page.close()
    server = viewer._started[-1][0]
    server.terminate()
    server.wait(60)
    with pytest.warns(gf.InputWarning, match="server of this page has ended"):
        assert view.known.contacts.tolist() == [contact]
    assert "has ended" in view._repr_html_()
