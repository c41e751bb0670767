"""Walks in a polytope {u : 1 + G u ≥ 0} that is nearly round: uniform, or normal cut by its walls.

All carry the slacks s = 1 + G u along, so that a move costs as many operations as there are walls.
With orthonormal columns in G, the matrix K = G Gᵀ holds what a turn at one wall does to the speed
at which every other wall is approached.
"""

import numpy as np

from granforce.numerics.lanes import compiled, within

# Rows are padded to a multiple of this, so that the search for the next wall runs in vector lanes.
LANES = 64
# Slacks stay above this: a point that rounding put on a wall turns there at once.
_LEAST = 1e-300


@compiled
def billiard(G, columns, K, turn, u, rng, length, limit, paths, out, stop):
    """Billiard walk (Polyak, Gryazina, EJOR 238, 497 (2014)): straight paths, mirrored at walls.

    Each path starts in a random direction and has a length uniform in (½, 3/2) · length, whatever
    the place: the flow of the billiard keeps volume and can be run backwards, so the uniform
    measure is stationary (their Theorem 1; any such law of lengths will do). A path with more than
    `limit` turns is not taken, which is as likely as for its reverse.

    G (rows, h) and its transpose columns (h, rows); K = G Gᵀ; turn = 2/diag K (rows,); u (h,) the
    place, changed in place; rng a numpy Generator; out (states, rows) gets the slacks after every
    `paths` paths. Returns the numbers of turns and of paths not taken. Ends early, with states that
    mean nothing, once stop[0] is raised.
    """
    rows, h = G.shape
    s, w, rate = np.empty(rows), np.empty(rows), np.empty(rows)
    v, start = np.empty(h), np.empty(h)
    top = np.empty(LANES)
    turns, refused = 0, 0
    for state in range(len(out)):
        if stop[0]:
            break
        for _ in range(paths):
            if stop[0]:
                break
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
                if hits == limit or stop[0]:
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


@compiled
def harmonic(G, columns, K, turn, shift, follow, u, rng, time, limit, paths, out, stop):
    """Draws from the density exp(−½ Σ (1 − θ) u² + shift · u) between walls, 0 ≤ θ ≤ 1.

    Two steps in turn (Gibbs). A companion w of u is drawn from the normal distribution of variance
    1/θ around it; the density of u given w is a normal one of variance 1 around
    c = shift + θ w, cut by the walls. On that a path c + (u − c) cos t + v sin t, mirrored at
    walls, is followed for a `time` (≤ π/2): its energy is conserved and walls are met at times in
    closed form (Pakman, Paninski, arXiv:1208.4118). Where θ = 0 no companion is needed; where
    θ = 1 the density is flat.

    follow (h,): θ; shift (h,); other arguments as in `billiard`.
    """
    rows, h = G.shape
    s, w, middle, rate = np.empty(rows), np.empty(rows), np.empty(rows), np.empty(rows)
    v, start, centre, away = np.empty(h), np.empty(h), np.empty(h), np.empty(h)
    top = np.empty(LANES)
    turns, refused = 0, 0
    for state in range(len(out)):
        if stop[0]:
            break
        for _ in range(paths):
            if stop[0]:
                break
            start[:] = u
            for i in range(h):
                companion = np.sqrt(follow[i]) * rng.standard_normal()
                centre[i] = shift[i] + follow[i] * u[i] + companion
                v[i] = rng.standard_normal()
            _refresh(columns, centre, v, middle, w)
            _refresh(columns, u, v, s, w)
            left, hits = time, 0
            while True:
                _meetings(s, w, middle, rate)
                wall, soonest = _next_wall(rate, top)
                last = soonest * np.tan(0.5 * left) <= 1.0
                if hits == limit or stop[0]:
                    u[:] = start
                    refused += 1
                    break
                step = left if last else 2.0 * np.arctan(1.0 / soonest)
                left -= step
                cos, sin = np.cos(step), np.sin(step)
                for i in range(h):
                    away[i] = u[i] - centre[i]
                    u[i] = centre[i] + cos * away[i] + sin * v[i]
                    v[i] = cos * v[i] - sin * away[i]
                if last:
                    break
                _swing(s, w, middle, cos, sin)
                kick = w[wall] * turn[wall]
                _axpy(v, -kick, G[wall])
                _axpy(w, -kick, K[wall])
                hits += 1
            turns += hits
        _refresh(columns, u, v, s, w)
        out[state] = s
    return turns, refused


@compiled
def hit_and_run(columns, u, rng, moves, out, stop):
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
            if stop[0]:
                break
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


@within
def _direction(v, rng):
    square = 0.0
    for i in range(len(v)):
        v[i] = rng.standard_normal()
        square += v[i] * v[i]
    for i in range(len(v)):
        v[i] /= np.sqrt(square)


@within
def _axpy(x, factor, y):
    for i in range(len(x)):
        x[i] += factor * y[i]


@within
def _refresh(columns, u, v, s, w):
    """s = 1 + G u and w = G v from scratch, so that rounding does not grow from path to path."""
    s[:] = 1.0
    w[:] = 0.0
    for i in range(len(u)):
        column, place, speed = columns[i], u[i], v[i]
        for k in range(len(s)):
            s[k] += place * column[k]
            w[k] += speed * column[k]


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
def _meetings(s, w, middle, rate):
    """The inverse of tan(t/2) for the time t < π at which each slack is 0 first; 0 if it never is.

    middle + (s − middle) cos t + w sin t = 0 is, for the inverse q of tan(t/2), the quadratic
    equation s q² + 2 w q + 2 middle − s = 0; of the two forms of its larger root the one is taken
    in which nothing cancels.
    """
    for k in range(len(s)):
        slack, speed = s[k], w[k]
        slack = slack if slack > _LEAST else _LEAST
        rest = 2.0 * middle[k] - slack
        square = speed * speed - rest * slack
        reaches = square > 0.0
        root = np.sqrt(square if reaches else 0.0)
        above = root - speed if speed < 0.0 else -rest
        below = slack if speed < 0.0 else root + speed
        rate[k] = above / below if reaches else 0.0


@within
def _swing(s, w, middle, cos, sin):
    """Slacks and their speeds after a time whose cosine and sine are given."""
    for k in range(len(s)):
        away, speed = s[k] - middle[k], w[k]
        s[k] = middle[k] + cos * away + sin * speed
        w[k] = cos * speed - sin * away


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
