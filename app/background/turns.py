"""Of jobs that need the same, one works at a time, and goes on as long as any of them wants it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol
from weakref import WeakSet, WeakValueDictionary

# How long a job stays for its turn before it lets others have the thread, s.
_ASK = 0.2

_turns: WeakValueDictionary[str, Turn] = WeakValueDictionary()
_turns_lock = threading.Lock()


class Later(Exception):
    """Raised by work that cannot go on yet; its job stands at the end of the queue again."""


class Waiting(Protocol):
    """What takes turns: a Job."""

    stage: str
    fraction: float | None  # done, 0 … 1
    seconds_left: float | None
    turns: list[Turn]  # that it has just now

    def cancelled(self) -> bool:
        """Whether it was asked to end."""
        ...

    @property
    def ended(self) -> bool:
        """Whether it has ended, one way or another."""
        ...


class Turn:
    """Whose turn it is among jobs that need what has one name, and who they are."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.job: Waiting | None = None
        self._wanting: WeakSet[Waiting] = WeakSet()
        self._guard = threading.Lock()

    def join(self, job: Waiting) -> None:
        """Count a job among those that need it."""
        with self._guard:
            self._wanting.add(job)

    def wanted(self, without: Waiting) -> bool:
        """Whether a job other than this one needs it that is neither cancelled nor at its end."""
        with self._guard:
            others = [job for job in self._wanting if job is not without]
        return not all(job.cancelled() or job.ended for job in others)


def turn_of(named: Any) -> Turn:
    """The Turn of a name; it lasts while somebody refers to it."""
    with _turns_lock:
        return _turns.setdefault(repr(named), Turn())


@contextmanager
def in_turn(job: Waiting, *named: Any) -> Iterator[None]:
    """One job at a time of those named alike: the next finds in the cache what the first made.

    Raises Later while another one has its turn: who waits leaves the thread to those who need not.
    """
    turn = turn_of(named)
    turn.join(job)
    if not turn.lock.acquire(timeout=_ASK):
        _goes_as(job, turn.job)
        raise Later
    turn.job, job.stage = job, "starting"
    job.turns.append(turn)
    try:
        yield
    finally:
        job.turns.remove(turn)
        turn.job = None
        turn.lock.release()


def _goes_as(job: Waiting, other: Waiting | None) -> None:
    """The progress of the other one, which works for both."""
    job.stage = "already under way"
    if other is not None:
        job.stage += f": {other.stage}"
        job.fraction, job.seconds_left = other.fraction, other.seconds_left
