"""Cells computed by the workers of a dask scheduler, which see the same store."""

from __future__ import annotations

import logging
import time
import warnings
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from typing import Any

from granforce.records import InputError
from granforce.study.processes import Tasks, lost, run_cell

# Time between two queries of dask, and time without workers before a message and before an end, s.
LOOK, WORKERLESS, GIVEN_UP = 0.2, 5.0, 600.0


def over_dask(
    client: Any, tasks: Tasks, scheduler: str, finished: Callable[[int, Callable[[], bool]], object]
) -> None:
    """Run tasks on the workers of a dask scheduler, which restarts those of lost workers."""
    from dask.distributed import KilledWorker, as_completed

    unreachable = InputError(
        f"the dask scheduler at {scheduler} was lost; finished entries are saved"
    )
    waiting = {client.submit(run_cell, *task, pure=False): k for k, task in tasks.items()}
    completed, workers = as_completed(list(waiting)), _Workers(scheduler)
    try:
        while waiting:
            for future in completed.next_batch(block=False):
                if future.status == "cancelled":  # its fate is unknown
                    raise unreachable
                dead = isinstance(future.exception(), KilledWorker)
                finished(waiting.pop(future), lost if dead else future.result)
            try:
                present = client.nthreads()
            except OSError:
                raise unreachable from None
            workers.count(present)
            time.sleep(LOOK)
    except BaseException:
        client.cancel(list(waiting))
        raise


@contextmanager
def client_of(scheduler: str) -> Iterator[Any]:
    """A client of a dask scheduler; InputError if it cannot be reached."""
    try:
        from dask.distributed import Client
    except ImportError:
        raise InputError("a scheduler needs dask: pip install 'granforce[cluster]'") from None
    with _without_tracebacks():
        try:
            client = Client(scheduler, timeout=10)
        except Exception as error:  # another service at this address may answer anything
            words = " ".join(str(error).split())[:200] or type(error).__name__
            raise InputError(f"no dask scheduler at {scheduler}: {words}") from None
        with client:
            yield client


@contextmanager
def _without_tracebacks() -> Iterator[None]:
    """Within, dask does not log errors that are handled here."""
    logger = logging.getLogger("distributed.client")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)


class _Workers:
    """Reports, once each time, that a scheduler has no workers, and ends after GIVEN_UP."""

    def __init__(self, scheduler: str) -> None:
        self._scheduler = scheduler
        self._since, self._reported = time.monotonic(), False

    def count(self, workers: Collection[Any]) -> None:
        """Update with its present workers; InputError after GIVEN_UP without any."""
        if workers:
            self._since, self._reported = time.monotonic(), False
            return
        missed, minutes = time.monotonic() - self._since, f"{GIVEN_UP / 60:g} minutes"
        if missed >= GIVEN_UP:
            raise InputError(
                f"the dask scheduler {self._scheduler} had no worker for {minutes}: start one with "
                f"dask worker {self._scheduler}; finished entries are saved"
            )
        if missed >= WORKERLESS and not self._reported:
            self._reported = True
            warnings.warn(
                f"no worker at the dask scheduler {self._scheduler}: waiting up to {minutes} for "
                "one (Ctrl-C ends)",
                stacklevel=2,
            )
