"""Walks with uniform stationary measure in a polytope {u : 1 + G u ≥ 0} that is nearly round.

Both carry the slacks s = 1 + G u along, so that a move costs as many operations as there are walls.
With orthonormal columns in G, the matrix K = G Gᵀ holds what a turn at one wall does to the speed
at which every other wall is approached.
"""

import numpy as np
from numba import njit

# Rows are padded to a multiple of this, so that the search for the next wall runs in vector lanes.
LANES = 64
# Slacks stay above this: a point that rounding put on a wall turns there at once.
_LEAST = 1e-300


@njit(cache=True, nogil=True, error_model="numpy")
def billiard(G, columns, K, turn, u, rng, length, limit, paths, out):
    """Billiard walk (Polyak, Gryazina, EJOR 238, 497 (2014)): straight paths, mirrored at walls.

    Each path starts in a random direction and has a length uniform in (½, 3/2) · length, whatever
    the place: the flow of the billiard keeps volume and can be run backwards, so the uniform
    measure is stationary (their Theorem 1; any such law of lengths will do). A path with more than
    `limit` turns is not taken, which is as likely as for its reverse.

    G (rows, h) and its transpose columns (h, rows); K = G Gᵀ; turn = 2/diag K (rows,); u (h,) the
    place, changed in place; rng a numpy Generator; out (states, rows) gets the slacks after every
    `paths` paths. Returns the numbers of turns and of paths not taken.
    """
    rows, h = G.shape
    s, w, rate = np.empty(rows), np.empty(rows), np.empty(rows)
    v, start = np.empty(h), np.empty(h)
    top = np.empty(LANES)
    turns, refused = 0, 0
    for state in range(len(out)):
        for _ in range(paths):
            start[:] = u
            _direction(v, rng)
            left = length * (0.5 + rng.random())
            _refresh(columns, u, v, s, w)
            _advance(s, w, rate, K[0], 0.0, 0.0)
            hits = 0
            while True:
                wall, fastest = _next_wall(rate, top)
                if fastest * left <= 1.0:
                    _axpy(u, left, v)
                    break
                if hits == limit:
                    u[:] = start
                    refused += 1
                    break
                time = 1.0 / fastest
                left -= time
                kick = w[wall] * turn[wall]
                _axpy(u, time, v)
                _axpy(v, -kick, G[wall])
                _advance(s, w, rate, K[wall], time, kick)
                hits += 1
            turns += hits
        _refresh(columns, u, v, s, w)
        out[state] = s
    return turns, refused


@njit(cache=True, nogil=True, error_model="numpy")
def hit_and_run(columns, u, rng, moves, out):
    """Coordinate hit-and-run (Turchin, 1971): a uniform point of the chord along a random axis.

    Arguments as in `billiard`; out (states, rows) gets the slacks after every `moves` moves.
    """
    h, rows = columns.shape
    s, w, rate = np.empty(rows), np.empty(rows), np.empty(rows)
    v = np.zeros(h)
    top = np.empty(LANES)
    for state in range(len(out)):
        _refresh(columns, u, v, s, w)
        for _ in range(moves):
            axis = int(h * rng.random())
            w[:] = columns[axis]
            _advance(s, w, rate, w, 0.0, 0.0)
            ahead = 1.0 / _next_wall(rate, top)[1]
            for k in range(rows):
                rate[k] = -rate[k]
            behind = 1.0 / _next_wall(rate, top)[1]
            move = (ahead + behind) * rng.random() - behind
            u[axis] += move
            _axpy(s, move, w)
        _refresh(columns, u, v, s, w)
        out[state] = s


@njit(cache=True, nogil=True, error_model="numpy")
def _direction(v, rng):
    square = 0.0
    for i in range(len(v)):
        v[i] = rng.standard_normal()
        square += v[i] * v[i]
    for i in range(len(v)):
        v[i] /= np.sqrt(square)


@njit(cache=True, nogil=True, error_model="numpy")
def _axpy(x, factor, y):
    for i in range(len(x)):
        x[i] += factor * y[i]


@njit(cache=True, nogil=True, error_model="numpy")
def _refresh(columns, u, v, s, w):
    """s = 1 + G u and w = G v from scratch, so that rounding does not grow from path to path."""
    s[:] = 1.0
    w[:] = 0.0
    for i in range(len(u)):
        column, place, speed = columns[i], u[i], v[i]
        for k in range(len(s)):
            s[k] += place * column[k]
            w[k] += speed * column[k]


@njit(cache=True, nogil=True, error_model="numpy")
def _advance(s, w, rate, row, time, kick):
    """Go on for a time, turn (w −= kick · row), and note the inverse of each wall's own time."""
    for k in range(len(s)):
        slack = s[k] + time * w[k]
        slack = slack if slack > _LEAST else _LEAST
        speed = w[k] - kick * row[k]
        s[k] = slack
        w[k] = speed
        rate[k] = -speed / slack


@njit(cache=True, nogil=True, error_model="numpy")
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
