"""Ctrl-C that cannot be lost.

Python turns the signal into a KeyboardInterrupt wherever the main thread happens to be. Within an
import, or a call of a library in C, that may swallow the exception, or make another one of it: the
command would go on, or end in a traceback. So it is noted besides, and work that is watched
(cancelling.py) asks for the note.

Only the standard library, and little of it: this is in force before anything else is imported.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_asked = threading.Event()


def interrupted() -> bool:
    """Whether Ctrl-C was pressed during the command that is running."""
    return _asked.is_set()


@contextmanager
def noted() -> Iterator[None]:
    """Within, Ctrl-C is noted before its KeyboardInterrupt is raised; main thread, else nothing."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:  # ignored, or somebody else's
        yield
        return
    signal.signal(signal.SIGINT, _note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        _asked.clear()


def check() -> None:
    """Raise the KeyboardInterrupt that was noted, if any."""
    if _asked.is_set():
        raise KeyboardInterrupt


def _note(number: int, frame: FrameType | None) -> None:
    _asked.set()
    raise KeyboardInterrupt
