"""The page of Learn: the lesson, or the workbench of a small scene."""

from functools import partial
from typing import Any
from urllib.parse import parse_qs

import panel as pn
from bokeh.document import Document

from ..background.jobs import Task, computing
from ..state import page_session, scene_links
from ..widgets.header import Header
from ..widgets.page_frame import framed
from .lesson import Lesson
from .model.lesson_data import Packings
from .workbench.workbench import Workbench

KEYS = [["arrows", "move the marker, or the dot"], ["Tab", "move from the plot to the buttons"]]


def learn_page(document: Document, query: str) -> Any:
    """The page for an address of Learn: chapters, or with `scene` the workbench."""
    request = scene_links.request_of(query)
    wake, visitor = page_session.waker(document), page_session.visitor(document)
    given = parse_qs(query.lstrip("?"), keep_blank_values=True)
    alone, dark = given.get("embed") == ["1"], page_session.dark(query)
    header = None if alone else Header(door="learn", dark=dark, keys=KEYS)
    if "learn" in given:
        packings = pn.state.as_cached(
            "packings of the lesson", partial(Packings, page_session.library())
        )
        view: Any = Lesson(packings, wake, visitor, dark=dark, alone=alone)
        page_session.at_end(view.close)
    else:
        tasks = [Task(computing, wake, visitor) for _ in range(3)]
        view = Workbench(request, *tasks, dark=dark)
        page_session.at_end(*(task.close for task in tasks))
    if header is not None:
        header.link(view, dark="dark")
    return framed(header, [view], dark=dark)
