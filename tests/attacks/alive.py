"""Setup script of a watched server, which writes how many pages it holds into an empty file.

`panel serve app --setup alive.py` with ALIVE naming the file.
"""

import gc
import os
from pathlib import Path
from weakref import WeakSet

from bokeh.server.session import ServerSession
from tornado.ioloop import IOLoop

_documents, _begin = WeakSet(), ServerSession.__init__


def begin(session, session_id, document, *rest, **options):
    """Remember the document of a session as long as anything else does."""
    _documents.add(document)
    _begin(session, session_id, document, *rest, **options)


def tell():
    """Count those that no collection can free, wherever somebody asks."""
    asked = Path(os.environ["ALIVE"])
    if asked.exists() and not asked.stat().st_size:
        gc.collect()
        asked.write_text(f"{len(_documents)}")
    IOLoop.current().call_later(0.5, tell)


ServerSession.__init__ = begin
IOLoop.current().call_later(0.5, tell)
