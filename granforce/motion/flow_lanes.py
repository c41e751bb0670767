"""Searches that need one flow after another, run in lanes: a scheduler.

A search for a critical force is a chain: the flow it needs next depends on the result of the last.
Chains of different contacts are independent, so they share the lanes of a kernel (see `lanes`).
Each is a generator that yields a Push and is sent its Outcome. A thread fills its lanes with
waiting generators, advances all until one flow has ended, and resumes the generator of that lane or
starts the next one there: no lane waits for another. As lanes never mix, no outcome depends on the
others.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Sequence
from typing import Any

import numpy as np

from granforce.motion.flow import (
    Flows,
    Outcome,
    Push,
    make_flows,
    outcome_of,
    start,
    until_one_ends,
)
from granforce.motion.step import Step
from granforce.numerics.lanes import lanes_for
from granforce.system import cancelling
from granforce.tolerances import BALANCED

# A generator that yields one flow after another and is sent the outcome of each.
Search = Generator[Push, Outcome, Any]


def relax(step: Step, push: Push) -> Outcome:
    """The Outcome of the flow for a Push."""
    ends: list[Outcome] = []
    follow(step, [_one(push)], lambda _, end: ends.append(end))
    return ends[0]


def _one(push: Push) -> Generator[Push, Outcome, Outcome]:
    return (yield push)


def follow(
    step: Step, searches: Sequence[Search], finished: Callable[[int, Any], object], workers: int = 1
) -> None:
    """Run searches in lanes on threads: generators of Push that are sent the Outcome of each.

    A flow ends at rest (unbalance below BALANCED), in steady motion, or after max_steps.
    finished(number, value) is called, by one thread at a time, as a search returns its value; if it
    raises, it is still called for searches that other threads have finished by then. Outcomes are
    bit-identical for any number of threads and lanes.
    """
    waiting, turn, failed = deque(enumerate(searches)), threading.Lock(), threading.Event()

    def finish(number: int, value: Any) -> None:
        with turn:
            finished(number, value)

    def run() -> None:
        try:
            _run_thread(step, waiting, finish, failed)
        except BaseException:
            failed.set()  # stop the other threads
            raise

    cancelling.on_threads(run, workers)


def _run_thread(
    step: Step,
    waiting: deque[tuple[int, Search]],
    finished: Callable[[int, Any], object],
    failed: threading.Event,
) -> None:
    """One thread: fill lanes with searches and run each to its end."""
    if not waiting:
        return
    lanes = lanes_for(len(waiting))
    flows, stop = make_flows(step, len(lanes)), cancelling.flag()
    seconds = np.zeros(len(lanes))
    current: list[tuple[int, Search] | None] = [None] * len(lanes)
    while True:
        for lane in np.flatnonzero(~flows.going).tolist():
            sent = outcome_of(step, flows, lane, seconds[lane]) if current[lane] else None
            current[lane] = _start_next(step, flows, lane, current[lane], sent, waiting, finished)
            seconds[lane] = 0.0
        going = flows.going.copy()
        if failed.is_set() or not going.any():
            return
        begin = time.perf_counter()
        until_one_ends(step, flows, BALANCED / 10, stop, lanes)
        cancelling.check("perturbation")
        seconds[going] += (time.perf_counter() - begin) / going.sum()


def _start_next(
    step: Step,
    flows: Flows,
    lane: int,
    current: tuple[int, Search] | None,
    sent: Outcome | None,
    waiting: deque[tuple[int, Search]],
    finished: Callable[[int, Any], object],
) -> tuple[int, Search] | None:
    """Send a lane's search its outcome and start its next flow, or that of the next waiting search.

    current: number and search of the lane; None, as is `sent`, in an idle lane. Returns those
    of the flow that starts, or None.
    """
    while True:
        try:
            number, search = current or waiting.popleft()
        except IndexError:
            return None
        try:
            start(step, flows, lane, next(search) if sent is None else search.send(sent))
        except StopIteration as ended:
            finished(number, ended.value)
            current = sent = None
        else:
            return number, search
