"""Paths in S between its walls: straight ones, for uniform states, and harmonic ones, for normal.

A path is told by the slacks s of all walls and the speeds w at which they change. At a wall that is
met, its own speed is turned: w ← w − 2 w_k/K_kk · (row k of K). So a turn costs one pass over the
walls, and a row of K, which is kept (`Rows`) or asked for: a path then stops where it is, and goes
on, bit for bit as if the row had been there, once it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from granforce.numerics import lanes
from granforce.numerics.lanes import compiled, within
from granforce.records import Floats, Integers, Mask
from granforce.system import cancelling

if TYPE_CHECKING:  # it needs this file to run
    from granforce.explore.walls import Walls

# Walls are padded to a multiple of this, so that the search for the next one runs in lanes.
LANES = 64
# Memory for rows of K, all threads together: those of 11,500 walls (3500 disks at μ = 0.1) fit.
MEMORY = 1 << 30
# Slacks stay above this: a point that rounding put on a wall turns there at once.
_LEAST = 1e-300
# What Flight.count counts.
_PATH, _HITS, _TURNS, _REFUSED, _FLYING = range(5)


class Rows(NamedTuple):
    """Rows of K that are kept."""

    values: Floats  # (places, walls)
    place: Integers  # (walls,) where each row is, −1 where it is not
    owner: Integers  # (places,) wall of each place, −1 where it is free
    used: Mask  # (places,) bool, since the hand came by last
    hand: Integers  # (1,) the next place that may be given away


class Flight(NamedTuple):
    """Where one chain is."""

    s: Floats  # (walls,) slacks
    w: Floats  # (walls,) their speeds
    start: Floats  # (walls,) slacks where the path began
    rate: Floats  # (walls,) one over the time to each wall
    left: Floats  # (1,) time that is left of the path
    count: Integers  # type: ignore[assignment]  # (5,) path, its hits; turns and paths not taken in all; whether in flight


def all_rows(walls: Walls) -> Rows | None:
    """The Rows of all walls where they fit into MEMORY, None where not."""
    count = walls.count
    if 8 * count**2 > MEMORY:
        return None
    rows = _room(count, count)
    for first in range(0, len(walls.moving), lanes.LANES):
        cancelling.check("uniform sample")
        make_rows(walls, rows, range(first, min(first + lanes.LANES, len(walls.moving))))
    return rows


def some_rows(walls: Walls, part: float) -> Rows:
    """Rows with room in a part of MEMORY, none of them there yet."""
    return _room(walls.count, max(2 * lanes.LANES, int(part * MEMORY / (8 * max(1, walls.count)))))


def _room(count: int, places: int) -> Rows:
    places = min(max(1, places), max(1, count))
    return Rows(
        np.zeros((places, count)),
        np.full(count, -1),
        np.full(places, -1),
        np.zeros(places, dtype=bool),
        np.zeros(1, dtype=np.int64),
    )


def make_rows(walls: Walls, rows: Rows, wanted: Sequence[int] | Integers) -> None:
    """Put the rows of so many walls where others were not used for long."""
    new = walls.rows(np.asarray(wanted))
    for wall, row in zip(wanted, new, strict=True):
        while rows.used[rows.hand[0]]:
            rows.used[rows.hand[0]] = False
            rows.hand[0] = (rows.hand[0] + 1) % len(rows.owner)
        here = rows.hand[0]
        if rows.owner[here] >= 0:
            rows.place[rows.owner[here]] = -1
        rows.values[here], rows.place[wall], rows.owner[here] = row, here, wall
        rows.used[here] = True
        rows.hand[0] = (here + 1) % len(rows.owner)


def make_flight(slacks: Floats) -> Flight:
    """A Flight that begins at slacks (walls,)."""
    return Flight(
        s=slacks.copy(),
        w=np.empty_like(slacks),
        start=np.empty_like(slacks),
        rate=np.empty_like(slacks),
        left=np.zeros(1),
        count=np.zeros(5, dtype=np.int64),
    )


def counted(flight: Flight) -> tuple[int, int]:
    """Turns and paths not taken."""
    return flight.count[_TURNS], flight.count[_REFUSED]


def follow(
    walls: Walls, rows: Rows, flights: Sequence[Flight], on: Callable[[int, Flight], int]
) -> None:
    """Carry flights to the end of their paths; on(number, flight) → the wall that it waits at.

    Where rows are missing, those of the walls that are next for each flight are made side by side.
    """
    waiting = dict(enumerate(flights))
    while waiting:
        met = {number: on(number, flight) for number, flight in waiting.items()}
        cancelling.check("uniform sample")
        waiting = {number: waiting[number] for number, wall in met.items() if wall >= 0}
        each = lanes.LANES // max(1, len(waiting))
        wanted = [met[number] for number in waiting]
        for flight in waiting.values():
            soon = np.where(rows.place < 0, flight.rate, -1.0)
            ahead = np.argpartition(-soon, each)[:each].tolist() if each else []
            wanted += [wall for wall in ahead if soon[wall] > 0]
        wanted = list(dict.fromkeys(wanted))[: max(lanes.LANES, len(waiting))]
        if wanted:
            make_rows(walls, rows, wanted)


@compiled
def fly(rows, speeds, times, middles, flight, limit, out, stop):
    """Path after path of speeds (paths, walls) and times (paths,), from where the last one ended.

    Without middles (0, walls) they are straight, and mirrored at walls: a billiard walk (Polyak,
    Gryazina, EJOR 238, 497 (2014)). For speeds in a random direction and times whose law does not
    depend on the place, its flow keeps volume and can be run backwards, so the uniform measure is
    stationary (their Theorem 1). With middles (paths, walls), or (1, walls) for all, they are
    middle + (s − middle) cos t + w sin t, for up to π/2, and leave the normal distribution of
    covariance K around the slacks `middle`, cut by the walls, as it is: energy is conserved and
    walls are met at times in closed form (Pakman, Paninski, arXiv:1208.4118).

    A path with more than `limit` turns is not taken, which is as likely as for its reverse. out
    (paths, walls) gets the slacks after each. Returns −1, or the wall whose row is missing. Ends
    early, with states that mean nothing, once stop[0] is raised.
    """
    s, w, rate, left, count = flight.s, flight.w, flight.rate, flight.left, flight.count
    top, still, harmonic = np.empty(LANES), rows.values[0], len(middles) > 0
    while count[_PATH] < len(times):
        path = count[_PATH]
        middle = middles[min(path, len(middles) - 1)] if harmonic else s
        if not count[_FLYING]:
            _begin(flight, speeds[path], times[path])
        if harmonic:
            _meetings(s, w, middle, rate)
        else:
            _advance(s, w, rate, still, 0.0, 0.0)
        while True:
            wall, soonest = _next_wall(rate, top)
            if soonest * (np.tan(0.5 * left[0]) if harmonic else left[0]) <= 1.0:
                if harmonic:
                    _swing(s, w, middle, rate, still, np.cos(left[0]), np.sin(left[0]), 0.0)
                else:
                    _axpy(s, left[0], w)
                break
            if count[_HITS] == limit or stop[0]:
                s[:] = flight.start
                count[_REFUSED] += 1
                break
            place = rows.place[wall]
            if place < 0:
                return wall
            rows.used[place] = True
            row, time = rows.values[place], 1.0 / soonest
            if harmonic:
                time = 2.0 * np.arctan(time)
                cos, sin = np.cos(time), np.sin(time)
                kick = 2.0 * (cos * w[wall] - sin * (s[wall] - middle[wall])) / row[wall]
                _swing(s, w, middle, rate, row, cos, sin, kick)
            else:
                _advance(s, w, rate, row, time, 2.0 * w[wall] / row[wall])
            left[0] -= time
            count[_HITS] += 1
        out[path] = s
        count[_TURNS] += count[_HITS]
        count[_PATH] += 1
        count[_FLYING] = 0
    return -1


@compiled
def chords(speeds, parts, s, rate):
    """Hit-and-run (Smith, Oper. Res. 32, 1296 (1984)): a uniform point of each chord in turn.

    speeds (moves, walls) of random directions, parts (moves,) uniform in [0, 1]; s (walls,) is
    changed in place.
    """
    top = np.empty(LANES)
    for move in range(len(parts)):
        w = speeds[move]
        _advance(s, w, rate, w, 0.0, 0.0)
        ahead = 1.0 / _next_wall(rate, top)[1]
        for k in range(len(rate)):
            rate[k] = -rate[k]
        behind = 1.0 / _next_wall(rate, top)[1]
        _axpy(s, (ahead + behind) * parts[move] - behind, w)


@within
def _begin(flight, speeds, left):
    flight.start[:] = flight.s
    flight.w[:] = speeds
    flight.left[0] = left
    flight.count[_HITS] = 0
    flight.count[_FLYING] = 1


@within
def _axpy(x, factor, y):
    for i in range(len(x)):
        x[i] += factor * y[i]


@within
def _advance(s, w, rate, row, time, kick):
    """Go on for a time, turn (w −= kick · row), and note the inverse of each wall's own time."""
    for k in range(len(s)):
        slack = s[k] + time * w[k]
        slack = slack if slack > _LEAST else _LEAST
        speed = w[k] - kick * row[k]
        s[k] = slack
        w[k] = speed
        rate[k] = -speed / slack


@within
def _swing(s, w, middle, rate, row, cos, sin, kick):
    """As `_advance` on harmonic paths, by the cosine and sine of a time, in one pass."""
    for k in range(len(s)):
        away, speed = s[k] - middle[k], w[k]
        slack = middle[k] + cos * away + sin * speed
        speed = cos * speed - sin * away - kick * row[k]
        s[k] = slack
        w[k] = speed
        rate[k] = _meeting(slack, speed, middle[k])


@within
def _meetings(s, w, middle, rate):
    """The rate of each wall where a harmonic path begins."""
    for k in range(len(s)):
        rate[k] = _meeting(s[k], w[k], middle[k])


@within
def _meeting(slack, speed, middle):
    """The inverse of tan(t/2) for the time t < π at which a slack is 0 first; 0 if it never is.

    middle + (s − middle) cos t + w sin t = 0 is, for the inverse q of tan(t/2), the quadratic
    equation s q² + 2 w q + 2 middle − s = 0; of the two forms of its larger root the one is taken
    in which nothing cancels.
    """
    slack = slack if slack > _LEAST else _LEAST
    rest = 2.0 * middle - slack
    square = speed * speed - rest * slack
    reaches = square > 0.0
    root = np.sqrt(square if reaches else 0.0)
    above = root - speed if speed < 0.0 else -rest
    below = slack if speed < 0.0 else root + speed
    return above / below if reaches else 0.0


@within
def _next_wall(rate, top):
    """The wall with the largest rate, and that rate; by lanes, as that is what vectorises."""
    top[:] = 0.0
    for first in range(0, len(rate), LANES):
        part = rate[first : first + LANES]
        for lane in range(LANES):
            top[lane] = part[lane] if part[lane] > top[lane] else top[lane]
    lane = 0
    for other in range(LANES):
        if top[other] > top[lane]:
            lane = other
    fastest = top[lane]
    if fastest == 0.0:
        return lane, fastest
    wall = lane
    while rate[wall] != fastest:
        wall += LANES
    return wall, fastest
