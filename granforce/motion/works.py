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
Work = Generator[Push, Outcome, Any]


def relax(step: Step, push: Push) -> Outcome:
    """The Outcome of the flow for a Push."""
    return relax_all(step, [push])[0]


def relax_all(step: Step, pushes: Sequence[Push]) -> list[Outcome]:
    """The Outcome of the flow for each Push, in their order."""
    ends: dict[int, Outcome] = {}
    follow(step, [_one(push) for push in pushes], ends.__setitem__)
    return [ends[k] for k in range(len(pushes))]


def _one(push: Push) -> Generator[Push, Outcome, Outcome]:
    return (yield push)


def follow(
    step: Step,
    works: Sequence[Work],
    finished: Callable[[int, Any], object],
    workers: int = 1,
) -> None:
    """Run works in lanes on threads: generators of Push that are sent the Outcome of each.

    A flow ends at rest (unbalance below BALANCED), in steady motion, or after max_steps.
    finished(number, value) is called, by one thread at a time, as a work returns its value; if it
    raises, it is still called for works that other threads have finished by then. Outcomes are
    bit-identical for any number of threads and lanes.
    """
    waiting, turn, failed = deque(enumerate(works)), threading.Lock(), threading.Event()

    def finish(number: int, value: Any) -> None:
        with turn:
            finished(number, value)

    def carry() -> None:
        try:
            _carry(step, waiting, finish, failed)
        except BaseException:
            failed.set()  # stop the other threads
            raise

    cancelling.on_threads(carry, workers)


def _carry(
    step: Step,
    waiting: deque[tuple[int, Work]],
    finished: Callable[[int, Any], object],
    failed: threading.Event,
) -> None:
    """One thread: fill lanes with works and run each to its end."""
    if not waiting:
        return
    lanes = lanes_for(len(waiting))
    flows, stop = make_flows(step, len(lanes)), cancelling.flag()
    seconds = np.zeros(len(lanes))
    carried: list[tuple[int, Work] | None] = [None] * len(lanes)
    while True:
        for lane in np.flatnonzero(~flows.going).tolist():
            sent = outcome_of(step, flows, lane, seconds[lane]) if carried[lane] else None
            carried[lane] = _go_on(step, flows, lane, carried[lane], sent, waiting, finished)
            seconds[lane] = 0.0
        going = flows.going.copy()
        if failed.is_set() or not going.any():
            return
        begin = time.perf_counter()
        until_one_ends(step, flows, BALANCED / 10, stop, lanes)
        cancelling.check("perturbation")
        seconds[going] += (time.perf_counter() - begin) / going.sum()


def _go_on(
    step: Step,
    flows: Flows,
    lane: int,
    carried: tuple[int, Work] | None,
    sent: Outcome | None,
    waiting: deque[tuple[int, Work]],
    finished: Callable[[int, Any], object],
) -> tuple[int, Work] | None:
    """Send a lane's work its outcome and start its next flow, or else the next waiting work.

    carried: number and work of the lane; None, as is `sent`, in an idle lane. Returns the same.
    """
    while True:
        try:
            number, work = carried or waiting.popleft()
        except IndexError:
            return None
        try:
            start(step, flows, lane, next(work) if sent is None else work.send(sent))
        except StopIteration as ended:
            finished(number, ended.value)
            carried = sent = None
        else:
            return number, work
