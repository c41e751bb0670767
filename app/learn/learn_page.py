"""The page of Learn: small scenes under the header of both doors."""

from typing import Any

from bokeh.document import Document

from ..background.jobs import Task, computing
from ..state import visit
from ..widgets.header import Header
from ..widgets.page_frame import framed
from .model import small_scenes
from .small_scene import FIRST_STEPS, Small


def learn_page(document: Document, query: str) -> Any:
    """What an address shows of Learn; it asks no store."""
    asked = small_scenes.asked(query)
    if asked.scene == small_scenes.MANY:
        asked = asked._replace(scene=small_scenes.FIRST)
    task = Task(computing, visit.turns(document), visit.visitor(document))
    header = Header(door="learn", dark=asked.dark)
    view = Small(asked, task, len(FIRST_STEPS), step=asked.step, dark=asked.dark)
    header.link(view, dark="dark")
    visit.at_end(task.close)
    return framed(header, [view], dark=asked.dark)
