"""Paths in S between its walls: straight for uniform states, and harmonic for normal ones.

A path is described by the slacks s of all walls and their speeds w. When a path meets wall k, it is
reflected: w ← w − 2 w_k/K_kk · (row k of K). A reflection costs one pass over the walls and a row
of K. If the row is missing in the `RowStore`, the path pauses until it is computed, with
bit-identical results.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from granforce.numerics import lanes
from granforce.numerics.lanes import MANY, allocating, compiled, inline, within
from granforce.system import cancelling
from granforce.system.memory import machine_memory
from granforce.types import Floats, Integers, Mask

# The search for the next wall skips blocks of this many: walls are padded to a multiple of it.
BLOCK = 64
# Memory for rows of K, all threads together: all those of 23,000 walls (7000 disks at μ = 0.1) fit.
# Only rows that are computed occupy it.
MEMORY = min(4 << 30, machine_memory() / 4)
# Reflections after which a path is rejected, per dimension; a typical path has less than one.
MOST_TURNS = 10
# Slacks stay above this: a point that rounding puts on a wall is reflected there at once.
_LEAST = 1e-300
# Indices of Flight.count: paths done, reflections of this one, total reflections and rejected
# paths; whether a path is in progress, and its next wall.
_PATH, _HITS, _TURNS, _REFUSED, _FLYING, _NEXT = range(6)


# Rows (k, walls) of K, for walls (k,).
RowsOf = Callable[[Integers], Floats]


class RowCache(NamedTuple):
    """Cached rows of K."""

    values: Floats  # (places, walls)
    place: Integers  # (walls,) place of each row, −1 if not cached
    owner: Integers  # (places,) wall of each place, −1 if it is free
    used: Mask  # (places,) bool, used since the clock hand last passed
    hand: Integers  # (1,) the next place that may be reused


class RowStore(NamedTuple):
    """Rows of K, computed on demand; threads may share them if there is room for all."""

    cache: RowCache
    making: threading.Lock  # held by the thread that computes rows

    @property
    def whole(self) -> bool:
        """Whether all rows fit, so that none is ever evicted."""
        return len(self.cache.owner) >= len(self.cache.place)


class Flight(NamedTuple):
    """Position of one chain."""

    s: Floats  # (walls,) slacks
    w: Floats  # (walls,) their speeds
    start: Floats  # (walls,) slacks where the path began
    left: Floats  # (2,) remaining time of the path, one over that to the next wall
    count: Integers  # type: ignore[assignment]  # (6,) path, its hits, turns, …, as named above


def room_for_rows(walls: int, part: float = 1.0) -> RowStore:
    """An empty cache of rows for this many walls, within a share of MEMORY."""
    count = max(1, walls)
    places = min(count, max(2 * lanes.LANES, int(part * MEMORY / (8 * count))))
    cache = RowCache(
        values=np.zeros((places, walls)),
        place=np.full(walls, -1),
        owner=np.full(places, -1),
        used=np.zeros(places, dtype=bool),
        hand=np.zeros(1, dtype=np.int64),
    )
    return RowStore(cache, threading.Lock())


def make_rows(rows_of: RowsOf, rows: RowCache, walls: Sequence[int]) -> None:
    """Compute rows for these walls in place of the least recently used; cached rows stay."""
    walls = [wall for wall in walls if rows.place[wall] < 0]
    if not walls:
        return
    for wall, row in zip(walls, rows_of(np.array(walls, dtype=int)), strict=True):
        while rows.used[rows.hand[0]]:
            rows.used[rows.hand[0]] = False
            rows.hand[0] = (rows.hand[0] + 1) % len(rows.owner)
        slot = rows.hand[0]
        if rows.owner[slot] >= 0:
            rows.place[rows.owner[slot]] = -1
        rows.values[slot], rows.owner[slot] = row, wall
        rows.place[wall] = slot  # last, because other threads look here
        rows.used[slot] = True
        rows.hand[0] = (slot + 1) % len(rows.owner)


def make_flight(slacks: Floats) -> Flight:
    """A Flight that begins at slacks (walls,)."""
    return Flight(
        s=slacks.copy(),
        w=np.empty_like(slacks),
        start=np.empty_like(slacks),
        left=np.zeros(2),
        count=np.zeros(6, dtype=np.int64),
    )


def follow(
    rows_of: RowsOf,
    dimension: int,
    rows: RowStore,
    starts: Sequence[Floats],
    drawn: Sequence[tuple[Floats, Floats, Floats]],
) -> tuple[Floats, Floats, Integers]:
    """Paths of some chains, as `fly` takes them, from slacks starts (walls,) each.

    rows_of: makes rows of K; dimension: h of S, which bounds the turns of a path.
    Returns the final slacks (chains, walls), those after each path (chains, paths, walls), and the
    numbers of reflections and rejected paths (chains, 2). Missing rows for the next walls of all
    chains are computed together.
    """
    flights, limit = [make_flight(s) for s in starts], MOST_TURNS * (dimension + 1)
    outs = np.ones((len(starts), len(drawn[0][0]), len(rows.cache.place)))
    cache, waiting = rows.cache, list(range(len(starts)))
    while waiting:
        stop = cancelling.flag()
        met = {k: fly(cache, *drawn[k], flights[k], limit, outs[k], stop) for k in waiting}
        cancelling.check("uniform sample")
        waiting = [k for k in waiting if met[k] >= 0]
        each = lanes.LANES // max(1, len(waiting))
        wanted = [met[k] for k in waiting]
        for k in waiting:
            rates = -flights[k].w / np.maximum(flights[k].s, _LEAST)
            soon = np.where(cache.place < 0, rates, -1.0)
            ahead = np.argpartition(-soon, each)[:each].tolist() if each else []
            wanted += [wall for wall in ahead if soon[wall] > 0]
        wanted = list(dict.fromkeys(wanted))[: max(lanes.LANES, len(waiting))]
        if wanted:
            with rows.making:
                make_rows(rows_of, cache, wanted)
    counts = [flight.count[[_TURNS, _REFUSED]] for flight in flights]
    return np.stack([flight.s for flight in flights]), outs, np.array(counts)


@allocating
def fly(rows, speeds, times, middles, flight, limit, out, stop):
    """Follow paths with speeds (paths, walls) and times (paths,), each from the end of the last.

    Without middles (0, walls) they are straight, and mirrored at walls: a billiard walk (Polyak,
    Gryazina, EJOR 238, 497 (2014)). For speeds in a random direction and times whose law does not
    depend on the place, its flow keeps volume and can be run backwards, so the uniform measure is
    stationary (their Theorem 1). With middles (paths, walls), or (1, walls) for all, they are
    middle + (s − middle) cos t + w sin t, for up to π/2, and leave the normal distribution of
    covariance K around the slacks `middle`, cut by the walls, as it is: energy is conserved and
    walls are met at times in closed form (Pakman, Paninski, arXiv:1208.4118).

    A path with more than `limit` reflections is rejected, which is as likely as for its reverse.
    out (paths, walls) gets the slacks after each. Returns −1, or the wall whose row is missing:
    called again with the same arguments and that row, it goes on from there. Ends early, with
    invalid states, once stop[0] is set.
    """
    s, w, count, harmonic = flight.s, flight.w, flight.count, len(middles) > 0
    while count[_PATH] < len(times):
        path = count[_PATH]
        middle = middles[min(path, len(middles) - 1)] if harmonic else s
        if not count[_FLYING]:
            flight.start[:], w[:], flight.left[0] = s, speeds[path], times[path]
            count[_HITS], count[_FLYING] = 0, 1
            # No motion, of any row: only the first wall is found.
            _onward(flight, middle, harmonic, rows.values[0], 0.0, 0.0)
        while count[_NEXT] >= 0 and count[_HITS] < limit and not stop[0]:
            wall, time = count[_NEXT], 1.0 / flight.left[1]
            place = rows.place[wall]
            if place < 0:
                return wall
            rows.used[place] = True
            row, speed = rows.values[place], w[wall]
            if harmonic:
                time = 2.0 * np.arctan(time)
                speed = np.cos(time) * speed - np.sin(time) * (s[wall] - middle[wall])
            count[_HITS] += 1
            _onward(flight, middle, harmonic, row, time, 2.0 * speed / row[wall])
        if count[_NEXT] < 0:
            _end(s, w, middle, harmonic, flight.left[0])
        else:
            s[:] = flight.start
            count[_REFUSED] += 1
        out[path] = s
        count[_TURNS] += count[_HITS]
        count[_PATH] += 1
        count[_FLYING] = 0
    return -1


@compiled
def chords(speeds, parts, s):
    """Hit-and-run (Smith, Oper. Res. 32, 1296 (1984)): a uniform point of each chord in turn.

    speeds (moves, walls) of random directions, parts (moves,) uniform in [0, 1]; s (walls,) is
    changed in place.
    """
    for move in range(len(parts)):
        w, nearest, behind = speeds[move], 0.0, 0.0
        for k in range(len(s)):
            rate = -w[k] / max(s[k], _LEAST)
            nearest, behind = max(nearest, rate), min(behind, rate)
        ahead, behind = 1.0 / nearest, -1.0 / behind
        _end(s, w, s, False, (ahead + behind) * parts[move] - behind)


@within
def _onward(flight, middle, harmonic, row, time, kick):
    """Move for a time, reflect (w −= kick · row), and find the next wall, −1 for none.

    Both in one pass, by lanes: s ← m + (s − m) cos + w sin, of which straight paths, m = s, are the
    case cos = 1, sin = t. A rate requires a division, or also a root, and is computed only if
    products show that a wall comes before the earlier candidates and before the end of the path.
    """
    s, w, left = flight.s, flight.w, flight.left
    left[0] -= time
    rest = max(left[0], _LEAST)
    soonest, next_wall = 1.0 / (np.tan(0.5 * rest) if harmonic else rest), -1
    cos, sin = (np.cos(time), np.sin(time)) if harmonic else (1.0, time)
    # Rounding must not move a harmonic path at its start.
    moves, lowest = kick != 0.0 or not harmonic, -np.inf if harmonic else _LEAST
    for first in range(0, len(s), BLOCK):
        if moves:
            _move(s, w, middle, row, cos, sin, kick, lowest, first)
        if _some_nearer(s, w, middle, harmonic, soonest, first):
            for k in range(first, first + BLOCK):
                rate = _rate(s[k], w[k], middle[k], harmonic)
                if rate > soonest:
                    soonest, next_wall = rate, k
    left[1], flight.count[_NEXT] = soonest, next_wall


@inline
def _move(s, w, middle, row, cos, sin, kick, lowest, first):
    """Motion and reflection of BLOCK walls."""
    for k in range(first // lanes.LANES, (first + BLOCK) // lanes.LANES):
        slack, speed, m = (
            lanes.load(s, k, MANY),
            lanes.load(w, k, MANY),
            lanes.load(middle, k, MANY),
        )
        away = slack - m
        lanes.store(s, k, MANY, lanes.larger(m + cos * away + sin * speed, lowest))
        lanes.store(w, k, MANY, cos * speed - sin * away - kick * lanes.load(row, k, MANY))


@inline
def _some_nearer(s, w, middle, harmonic, soonest, first):
    """Whether any of BLOCK walls has a larger rate than `soonest`, up to rounding."""
    nearer = lanes.same(MANY, 0.0)
    for k in range(first // lanes.LANES, (first + BLOCK) // lanes.LANES):
        slack, speed = lanes.larger(lanes.load(s, k, MANY), _LEAST), lanes.load(w, k, MANY)
        excess = soonest * slack + speed
        if harmonic:
            # The larger root of s q² + 2 w q + r (`_rate`) exceeds q if that is negative, or
            # decreasing while there are roots.
            rest = 2.0 * lanes.load(middle, k, MANY) - slack
            roots = lanes.pick(speed * speed, rest * slack, 1.0, 0.0)
            nearer = nearer + lanes.pick(
                0.0, soonest * (excess + speed) + rest, 1.0, lanes.pick(0.0, excess, roots, 0.0)
            )
        else:
            nearer = nearer + lanes.pick(0.0, excess, 1.0, 0.0)
    return not lanes.vanishes(nearer)


@inline
def _rate(slack, speed, middle, harmonic):
    """The inverse of the time t at which a slack first becomes 0; at most 0 if it never does.

    For a harmonic path, that of tan(t/2), t < π: middle + (s − middle) cos t + w sin t = 0 is, for
    the inverse q of tan(t/2), the quadratic equation s q² + 2 w q + 2 middle − s = 0; its larger
    root is computed in the form without cancellation.
    """
    slack = slack if slack > _LEAST else _LEAST
    if not harmonic:
        return -speed / slack
    rest = 2.0 * middle - slack
    square = speed * speed - rest * slack
    if not square > 0.0:
        return 0.0
    root = np.sqrt(square)
    return (root - speed) / slack if speed < 0.0 else -rest / (root + speed)


@within
def _end(s, w, middle, harmonic, time):
    """Motion without a reflection."""
    cos, sin = (np.cos(time), np.sin(time)) if harmonic else (1.0, time)
    for k in range(len(s)):
        s[k] = middle[k] + cos * (s[k] - middle[k]) + sin * w[k]
