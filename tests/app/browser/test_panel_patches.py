"""What is changed in Panel."""

import pytest
from panel.links import Callback

from app.browser.panel_patches import search_for_present_links_only


class Searched:
    """A view, and its model, that cannot be searched."""

    def __init__(self):
        self.ref = {"id": "p1"}

    def select(self, kind):
        raise LookupError


def test_a_page_without_links_is_not_searched_for_them(monkeypatch):
    monkeypatch.setattr(Callback, "_process_callbacks", Callback._process_callbacks)  # put back
    search_for_present_links_only()
    search_for_present_links_only()  # by the next page
    monkeypatch.setattr(Callback, "registry", {"tabs": []})
    Callback._process_callbacks(Searched(), Searched())
    Callback.registry["tabs"].append("link")
    with pytest.raises(LookupError):
        Callback._process_callbacks(Searched(), Searched())
