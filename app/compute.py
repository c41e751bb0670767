"""What the page computes on demand, as work for jobs.Task; all goes through study and the cache."""

import threading
from contextlib import contextmanager
from weakref import WeakValueDictionary

from granforce import study
from granforce.records import Cancelled

from .data import SOURCES, Shown

# A compaction's part of the bar; it never seems to be at its end.
PACKING_SHARE, NEARLY = 0.5, 0.95
# How often a job that waits for another one asks whether it was cancelled, s.
_ASK = 0.2

_turns, _turns_lock = WeakValueDictionary(), threading.Lock()


@contextmanager
def in_turn(job, *named):
    """One job at a time of those named alike: the next finds in the cache what the first made.

    Raises Cancelled where the job is cancelled while it waits.
    """
    with _turns_lock:
        turn = _turns.setdefault(repr(named), threading.Lock())
    stage = job.stage
    while not turn.acquire(timeout=_ASK):
        job.stage = "being computed for another page"
        if job.cancelled():
            raise Cancelled
    job.stage = stage
    try:
        yield
    finally:
        turn.release()


def found_or_made(library, job, stage, kind, params, version, get):
    """The dataset of these parameters from a store, or from get(cache, params) in this stage."""
    found = library.stored(kind, params, version)
    if found is None:
        with in_turn(job, kind, params):
            library.lend_packing(params["packing"])
            job.begin(stage)
            found, _ = get(library.cache, params, progress=job.tell, cancel=job.cancelled)
    return found


def states(library, selection):
    """Work that finds or computes the states of a Selection; results in their Shown."""

    def work(job):
        params = selection.parameters()
        with in_turn(job, selection.kind, params):
            cell = library.find(selection.kind, params)
            if cell is None:
                _make_packing(job, library, selection.packing)
                job.begin("states")
                SOURCES[selection.kind][1](
                    library.cache,
                    params,
                    progress=lambda done, total: _tell_states(job, done, total),
                    cancel=job.cancelled,
                )
                cell = library.find(selection.kind, params)
        return library.shown(cell)

    return work


def exact(library, shown):
    """Work that computes the exact intervals beside what is shown; results in a new Shown."""

    def work(job):
        selection = shown.cell.selection
        params = study.exact_parameters(selection.packing, mu=selection.mu)
        dataset = found_or_made(
            library,
            job,
            "exact intervals",
            "intervals",
            params,
            study.INTERVALS_VERSION,
            study.get_intervals,
        )
        found = Shown(shown.cell, shown.replay, dataset)
        library.keep_in_memory(found)
        return found

    return work


def _make_packing(job, library, packing):
    library.lend_packing(packing)
    if "imported" in packing:
        return
    with in_turn(job, "packing", packing):
        _compact(job, library, packing)


def _compact(job, library, packing):
    steps = library.expected_steps(packing["n"], packing["mu"])

    def tell(step, message):
        job.stage = f"compaction, step {step}: {message}"
        if steps:
            job.tell(min(step, NEARLY * steps), steps, part=(0, PACKING_SHARE))

    job.begin("compaction")
    study.get_packing(library.cache, packing, progress=tell, cancel=job.cancelled)


def _tell_states(job, done, total):
    job.stage = f"{done} of {total} states"
    job.tell(done, total, part=(PACKING_SHARE, 1))
