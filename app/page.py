"""The two entry pages: the instrument at `/app`, the lesson and small scenes at `/app?learn`."""

from typing import Any
from urllib.parse import parse_qs

import panel as pn

from .browser.panel_patches import (
    answer_with_lock,
    leave_links_alone,
    mend_late_views,
    search_for_present_links_only,
)
from .explore.explore_page import explore_page
from .learn.learn_page import learn_page
from .state import scene_links


def page() -> Any:
    """One visitor's page, chosen by its address."""
    pn.extension()
    document = pn.state.curdoc
    assert document is not None  # a page always has a document
    mend_late_views(document)
    answer_with_lock()
    leave_links_alone()
    search_for_present_links_only()
    query = (pn.state.location.search if pn.state.location else "") or ""
    request = scene_links.request_of(query)
    if learns(query) or request.scene not in scene_links.LARGE:
        return learn_page(document, query)
    return explore_page(document, request.query)


def learns(query: str) -> bool:
    """Whether an address belongs to Learn: `?learn`, `?learn=groove`."""
    return "learn" in parse_qs(query.lstrip("?"), keep_blank_values=True)
