"""How long computations take on this machine: at first a guess, then as the last one of a kind."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager

from granforce.study.keys import Parameters

from ..background.jobs import Job

USUAL_DISKS, USUAL_STATES = 400, 200
# Seconds for USUAL_DISKS, with USUAL_STATES where states are drawn; replaced by those measured.
# Other kinds are estimated by their progress alone.
_seconds = {
    "walk": 1.3, "uniform": 2.5, "intervals": 4.0, "perturbation": 90.0,
    "limit_loads": 4.0, "volume": 60.0, "outline": 2.0, "stress": 2.0,
}  # fmt: skip
LEAST_WORK = 0.2  # relative to the usual work; less lasts as long as compiling, and tells nothing
# Kinds whose duration varies by factors between contacts (11 to 84 s): the longest so far counts.
_VARYING = ("perturbation",)


def seconds(kind: str, params: Parameters) -> float:
    """The expected duration of a computation, s."""
    return _seconds.get(kind, math.inf) * _work(kind, params)


@contextmanager
def expected(job: Job, stage: str, kind: str, params: Parameters) -> Iterator[None]:
    """Begin a stage of a job with its expected duration, and learn how long it really takes."""
    begun, varies = time.perf_counter(), kind in _VARYING
    job.begin(stage, seconds(kind, params), longest=varies)
    yield
    work = _work(kind, params)
    took = (time.perf_counter() - begun) / work
    if kind in _seconds and work > LEAST_WORK:
        _seconds[kind] = max(took, _seconds[kind]) if varies else took


def _work(kind: str, params: Parameters) -> float:
    """The work of a computation, relative to that with USUAL_DISKS and USUAL_STATES.

    It grows like the square of the number of disks for programs over all contacts, and in
    proportion to it for a state.
    """
    disks = params["packing"].get("n", USUAL_DISKS) / USUAL_DISKS
    if kind not in ("walk", "uniform"):
        return float(disks**2)
    return float(disks * (disks + params["states"] / USUAL_STATES) / 2)
