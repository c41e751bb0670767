"""Ctrl-C that is never lost.

Python turns the signal into a KeyboardInterrupt wherever the main thread happens to be. An import,
or a call of a C library, may swallow the exception or replace it: the command would then continue,
or end in a traceback. So the signal is also recorded, and work inside `scope` (cancelling.py)
checks the record.

Standard library only: this runs before anything else is imported.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_pressed = threading.Event()
_deferring = 0  # open deferred() of the main thread


def interrupted() -> bool:
    """Whether Ctrl-C was pressed during the running command."""
    return _pressed.is_set()


@contextmanager
def record_interrupts() -> Iterator[None]:
    """Within, record Ctrl-C before its KeyboardInterrupt is raised; only in the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:  # ignored, or handled by other code
        yield
        return
    signal.signal(signal.SIGINT, _note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        _pressed.clear()


def check() -> None:
    """Raise the recorded KeyboardInterrupt, if any."""
    if _pressed.is_set():
        raise KeyboardInterrupt


@contextmanager
def deferred() -> Iterator[None]:
    """Within, Ctrl-C is recorded, and its KeyboardInterrupt raised at the end.

    For short calls of libraries that print messages if they are interrupted, as Zarr's event loop.
    """
    global _deferring
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _deferring += 1
    try:
        yield
    finally:
        _deferring -= 1
    if not _deferring:
        check()


def _note(number: int, frame: FrameType | None) -> None:
    _pressed.set()
    if not _deferring:
        raise KeyboardInterrupt
