"""Of jobs that need the same thing one computes it, as long as any of them needs it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol
from weakref import WeakSet, WeakValueDictionary

# Time that a job waits for its turn before it frees the thread, s.
_ASK = 0.2

_turns: WeakValueDictionary[str, Turn] = WeakValueDictionary()
_turns_lock = threading.Lock()


class Later(Exception):
    """Raised by work that cannot continue yet; its job goes to the end of the queue."""


class Waiting(Protocol):
    """An object that takes turns: a Job."""

    stage: str
    fraction: float | None  # done, 0 … 1
    seconds_left: float | None
    turns: list[Turn]  # its current turns

    def cancelled(self) -> bool:
        """Whether its end was requested."""
        ...

    @property
    def ended(self) -> bool:
        """Whether it has ended, for any reason."""
        ...


class Turn:
    """The turn among jobs that need the thing with one name, and the list of these jobs."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.job: Waiting | None = None
        self._wanting: WeakSet[Waiting] = WeakSet()
        self._guard = threading.Lock()

    def join(self, job: Waiting) -> None:
        """Add a job to those that need it."""
        with self._guard:
            self._wanting.add(job)

    def wanted(self, without: Waiting) -> bool:
        """Whether another job needs it that is neither cancelled nor ended."""
        with self._guard:
            others = [job for job in self._wanting if job is not without]
        return not all(job.cancelled() or job.ended for job in others)


def turn_of(named: Any) -> Turn:
    """The Turn of a name, which exists while it is referenced."""
    with _turns_lock:
        return _turns.setdefault(repr(named), Turn())


@contextmanager
def in_turn(job: Waiting, *named: Any) -> Iterator[None]:
    """Run one job at a time for each name: the next finds the result of the first in the cache.

    Raises Later while another job has the turn, so that a waiting job frees its thread.
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
    """Copy the progress of the other job, which works for both."""
    job.stage = "already under way"
    if other is not None:
        job.stage += f": {other.stage}"
        job.fraction, job.seconds_left = other.fraction, other.seconds_left
