"""Intermediate results of a computation, for all pages that request the same one.

The computing thread adds to a Compaction or a Walking; each page reads them through its own
Following, which remembers its position and sends as much as its browser can paint.
"""

import threading
import time
from collections import deque
from collections.abc import Mapping
from typing import Any, TypeVar
from weakref import WeakValueDictionary

import numpy as np

from granforce import measures
from granforce.study.keys import Parameters
from granforce.types import Floats, Integers

from .replays import FRAME_BYTES, Replay, fitting, flat
from .selection import Selection

Message = dict[str, Any]  # to the player
Summary = Mapping[str, Any]  # of a Replay
Kind = TypeVar("Kind")

# A moving packing is recorded each time its box has shrunk by STRAIN, or after EVERY_S seconds:
# this shows the gas, which is compressed within a tenth of a second, as well as the slow end.
STRAIN, EVERY_S = 0.003, 0.04
PICTURE_BYTES = 16e6  # of the recorded pictures of one compaction
BEHIND = 12  # pictures; for each multiple of this that a page is behind, it skips one more
BATCH = 64  # states sent at a time
ENOUGH = 256  # states used to compute axes of force space during a walk

_shared: WeakValueDictionary[tuple[str, str], Any] = WeakValueDictionary()
_lock = threading.Lock()


def shared(kind: type[Kind], params: Parameters) -> Kind:
    """The shared Compaction or Walking of these parameters."""
    with _lock:
        key = kind.__name__, repr(params)
        feed = _shared.get(key)
        if feed is None:
            feed = _shared[key] = kind()
        return feed


class Compaction:
    """Pictures of a packing during compression; the last ones are kept."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.run = 0  # number of starts
        self.restart()

    def restart(self) -> None:
        """Start again: an earlier run was cancelled."""
        with self._lock:
            self.run += 1
            self._pictures: deque[Message] = deque()
            self.total = 0  # number of recorded pictures, including dropped ones
            self._side, self._at = np.inf, -np.inf

    def add(self, glimpse: Any) -> None:
        """Record a Glimpse if it differs enough from the last one."""
        now, side = time.perf_counter(), float(np.sqrt(np.prod(glimpse.box)))
        if side > (1 - STRAIN) * self._side and now < self._at + EVERY_S:
            return
        self._side, self._at = side, now
        picture = _picture(glimpse)
        size = sum(value.nbytes for value in picture.values() if isinstance(value, np.ndarray))
        with self._lock:
            self._pictures.append(picture)
            self.total += 1
            while len(self._pictures) * size > PICTURE_BYTES and len(self._pictures) > 1:
                self._pictures.popleft()

    def after(self, run: int, place: int) -> tuple[int, int, Message | None]:
        """(run, place, picture or None): the next picture for a page that has seen `place`."""
        with self._lock:
            if run != self.run:
                run, place = self.run, 0
            left = self.total - place
            if left <= 0:
                return run, place, None
            place = max(place + (left - 1) // BEHIND, self.total - len(self._pictures))
            return run, place + 1, self._pictures[place - self.total]


def _picture(glimpse: Any) -> Message:
    """A Glimpse for the page to draw; forces in units of its own ⟨f_n⟩."""
    forces = glimpse.forces.astype(np.float32)
    mean = float(forces[:, 0].mean()) if len(forces) else 1.0
    return {
        "box": [float(side) for side in glimpse.box],
        "tilt": float(glimpse.tilt),
        "centres": glimpse.x.astype(np.float32).ravel(),
        "radius": glimpse.r.astype(np.float32),
        "i": glimpse.i.astype(np.int32),
        "j": glimpse.j.astype(np.int32),
        "reach": glimpse.reach.astype(np.float32).ravel(),
        "normal": forces[:, 0] / mean,
        "tangential": forces[:, 1] / mean,
        "fraction": glimpse.packing_fraction,
        "unbalance": glimpse.unbalance if np.isfinite(glimpse.unbalance) else -1.0,
    }


class Walking:
    """The states of a walk in progress, and their Replay."""

    def __init__(self) -> None:
        self.run = 0
        self.replay: Replay | None = None
        self.parts: list[tuple[Any, tuple[float, ...]]] = []  # (state, NUMBERS)

    def restart(self, replay: Replay) -> None:
        """Start again, on the `first_replay` of the ensemble."""
        self.parts = []
        self._every = every(replay.summary)
        self._growth = measures.Growth()
        self._count = 0
        self.replay = replay
        self.run += 1

    def add(self, accepted: Any) -> None:
        """Record a WalkState, or only some if not all can be sent."""
        assert self.replay is not None  # set by `restart`
        state = accepted.forces / self.replay.force_scale
        grown = self._growth.add(state)
        self._count += 1
        if (self._count - 1) % self._every:
            return
        numbers = self._count, accepted.residual, *grown
        self.parts.append((state.astype(np.float32), numbers))


def every(summary: Summary) -> int:
    """The stride of states sent from a walk in progress: 1 if all fit in FRAME_BYTES."""
    return -(-summary["states"] // fitting(summary["contacts"], FRAME_BYTES))


def numbers(summary: Summary) -> Integers:
    """Numbers (F,) of the states sent from a walk in progress, 0 for the original."""
    return np.append(0, np.arange(1, summary["states"] + 1, every(summary)))


NUMBERS = ("number", "residual", "eta1", "eta2", "eta3")


def _batch(parts: list[tuple[Any, tuple[float, ...]]]) -> Message:
    """States for the player: flat arrays, one state after the other."""
    forces = np.stack([state for state, _ in parts])
    rows = np.array([numbers for _, numbers in parts], dtype=np.float32).T
    return flat(forces) | dict(zip(NUMBERS, rows, strict=True))


class Following:
    """One page's position in the computation of a Selection."""

    def __init__(self, selection: Selection) -> None:
        self.selection = selection
        self._compaction = shared(Compaction, selection.packing)
        self._walking = shared(Walking, selection.parameters())
        # A page that joins later begins with the newest picture.
        self._run, self._place = self._compaction.run, max(0, self._compaction.total - 1)
        self._walk_run = self._state = 0

    def rewind(self) -> None:
        """The page has dropped the states that it received."""
        self._state = 0

    @property
    def fourfold(self) -> int:
        """Number of fourfold increases of the states sent: 4 → 1, 16 → 2, …"""
        return max(0, self._state.bit_length() - 1) // 2

    def states(self) -> Floats | None:
        """The states (k, N_c, 2) sent, in ⟨f_n⟩, or ENOUGH evenly spaced ones of more; or None."""
        sent = self._walking.parts[: self._state]
        if not sent:
            return None
        return np.stack([state for state, _ in sent[:: -(-len(sent) // ENOUGH)]])

    def next(self) -> Message | None:
        """The next message, or None: {"picture": …}, {"replay": Replay} or {"states": …}."""
        self._run, self._place, picture = self._compaction.after(self._run, self._place)
        if picture is not None:
            return {"picture": picture | {"mu": self.selection.packing["mu"]}}
        walking = self._walking
        run, replay = walking.run, walking.replay
        if replay is None:
            return None
        if run != self._walk_run:
            self._walk_run, self._state = run, 0
            return {"replay": replay}
        parts = walking.parts[self._state : self._state + BATCH]
        if not parts:
            return None
        self._state += len(parts)
        return {"states": _batch(parts)}
