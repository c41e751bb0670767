"""`gf.show` and `granforce app FILE`: a packing of one's own, opened on the page."""

import time

import numpy as np
import pytest
from packings import packed
from serving import PATIENCE, painted, scene

import granforce as gf
from granforce.cli import viewer

pytestmark = pytest.mark.browser


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
