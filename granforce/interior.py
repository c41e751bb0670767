"""Primal–dual interior-point steps for LANES linear programs over S side by side.

Each lane holds one program: minimise c·y subject to A y + a F = b, y ≥ 0, F ≥ 0, in cone
coordinates; a is the lane's own load column (zero where there is no load). Mehrotra's predictor
and corrector (SIAM J. Optim. 2, 575) on the normal equations A D Aᵀ Δλ = r, D = y/s; the dense
pressure row is a border, taken care of by a Schur complement.
"""

from typing import NamedTuple

import numba
import numpy as np

from granforce import block_cholesky
from granforce.block_cholesky import LANES

_BLOCK = 9 * LANES
# Weight of cone coordinates that are zero when the balance is restored (1: those of size ⟨f_n⟩).
_LIGHT = 1e-10


class Columns(NamedTuple):
    """The columns of A: each touches the rows of two grains and the pressure row."""

    high: np.ndarray  # (n,) place in the order of elimination of the later grain
    low: np.ndarray  # (n,) of the earlier one
    value: np.ndarray  # (n, 6) entries in the rows of the later, then of the earlier grain
    pressure: np.ndarray  # (n,) entry in the pressure row
    block: np.ndarray  # (n,) block that couples the two grains
    diagonal: np.ndarray  # (grains,) block of each grain
    pinned: np.ndarray  # (grains, 3) 1 for rows that are left out because others imply them


class Lanes(NamedTuple):
    """The programs under way, one per lane; the last row of y, s and c is the load F."""

    y: np.ndarray  # (n + 1, LANES)
    s: np.ndarray  # (n + 1, LANES) dual slack
    c: np.ndarray  # (n + 1, LANES) cost
    multiplier: np.ndarray  # (3 grains, LANES) λ of the balance rows
    border: np.ndarray  # (LANES,) λ of the pressure row
    loaded: np.ndarray  # (LANES,) column of A whose grains the load acts on
    load: np.ndarray  # (7, LANES) entries of the load column; the last is the pressure row's
    gap: np.ndarray  # (LANES,) y·s
    unbalance: np.ndarray  # (LANES,) largest |b − A y − a F| before the last step
    slackness: np.ndarray  # (LANES,) largest |c − Aᵀλ − s| before the last step


class Workspace(NamedTuple):
    """Scratch arrays of one thread."""

    L: np.ndarray  # (blocks · 9 · LANES,)
    D: np.ndarray  # (n + 1, LANES)
    dual: np.ndarray  # (n + 1, LANES) c − Aᵀλ − s
    dy: np.ndarray  # (n + 1, LANES)
    ds: np.ndarray  # (n + 1, LANES)
    v: np.ndarray  # (n + 1, LANES)
    primal: np.ndarray  # (3 grains, LANES) b − A y
    r: np.ndarray  # (3 grains, LANES)
    z: np.ndarray  # (3 grains, LANES)
    small: np.ndarray  # (8, LANES)


def make_lanes(columns):
    """Lanes without programs: trivial numbers that take any step."""
    n, rows = len(columns.high), columns.pinned.size
    ones, zeros = np.ones((n + 1, LANES)), np.zeros((n + 1, LANES))
    return Lanes(
        ones,
        ones.copy(),
        zeros,
        np.zeros((rows, LANES)),
        np.zeros(LANES),
        np.zeros(LANES, dtype=np.int64),
        np.zeros((7, LANES)),
        *(np.zeros(LANES) for _ in range(3)),
    )


def make_workspace(layout, columns):
    """The Workspace for a pattern and its columns."""
    n, rows = len(columns.high), columns.pinned.size
    return Workspace(
        np.zeros(len(layout.row) * _BLOCK),
        *(np.zeros((n + 1, LANES)) for _ in range(5)),
        *(np.zeros((rows, LANES)) for _ in range(3)),
        np.zeros((8, LANES)),
    )


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _transposed(columns, lanes, x, border, out):
    """out ← Aᵀ x, with the border's entry of x apart."""
    n = len(columns.high)
    for k in range(n):
        a, p = columns.value[k], columns.pressure[k]
        i, j = 3 * columns.high[k], 3 * columns.low[k]
        i0, i1, i2, j0, j1, j2 = x[i], x[i + 1], x[i + 2], x[j], x[j + 1], x[j + 2]
        o = out[k]
        for s in range(LANES):
            o[s] = (
                a[0] * i0[s] + a[1] * i1[s] + a[2] * i2[s]
                + a[3] * j0[s] + a[4] * j1[s] + a[5] * j2[s] + p * border[s]
            )  # fmt: skip
    for s in range(LANES):
        i, j = 3 * columns.high[lanes.loaded[s]], 3 * columns.low[lanes.loaded[s]]
        total = lanes.load[6, s] * border[s]
        for a in range(3):
            total += lanes.load[a, s] * x[i + a, s] + lanes.load[3 + a, s] * x[j + a, s]
        out[n, s] = total


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _add_product(columns, lanes, v, out, border, sign):
    """out ← out + sign A v, and the border's row likewise."""
    n = len(columns.high)
    for k in range(n):
        a, p, w = columns.value[k], columns.pressure[k], v[k]
        i, j = 3 * columns.high[k], 3 * columns.low[k]
        i0, i1, i2, j0, j1, j2 = out[i], out[i + 1], out[i + 2], out[j], out[j + 1], out[j + 2]
        for s in range(LANES):
            u = sign * w[s]
            i0[s] += a[0] * u
            i1[s] += a[1] * u
            i2[s] += a[2] * u
            j0[s] += a[3] * u
            j1[s] += a[4] * u
            j2[s] += a[5] * u
            border[s] += p * u
    for s in range(LANES):
        i, j = 3 * columns.high[lanes.loaded[s]], 3 * columns.low[lanes.loaded[s]]
        for a in range(3):
            out[i + a, s] += sign * lanes.load[a, s] * v[n, s]
            out[j + a, s] += sign * lanes.load[3 + a, s] * v[n, s]
        border[s] += sign * lanes.load[6, s] * v[n, s]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _add_outer(block, a, b, d):
    """block ← block + d a bᵀ, per lane."""
    a0, a1, a2 = a[0], a[1], a[2]
    b0, b1, b2 = b[0], b[1], b[2]
    for s in range(LANES):
        e0, e1, e2 = a0 * d[s], a1 * d[s], a2 * d[s]
        block[s] += e0 * b0
        block[LANES + s] += e0 * b1
        block[2 * LANES + s] += e0 * b2
        block[3 * LANES + s] += e1 * b0
        block[4 * LANES + s] += e1 * b1
        block[5 * LANES + s] += e1 * b2
        block[6 * LANES + s] += e2 * b0
        block[7 * LANES + s] += e2 * b1
        block[8 * LANES + s] += e2 * b2


@numba.njit(cache=True, nogil=True, error_model="numpy")
def assemble(columns, lanes, D, L):
    """L ← lower blocks of A D Aᵀ without the border."""
    n = len(columns.high)
    L[:] = 0.0
    for g in range(len(columns.diagonal)):
        for a in range(3):
            begin = columns.diagonal[g] * _BLOCK + 4 * a * LANES
            for s in range(LANES):
                L[begin + s] = columns.pinned[g, a]
    for k in range(n):
        high, low = columns.value[k, :3], columns.value[k, 3:]
        h = columns.diagonal[columns.high[k]] * _BLOCK
        g = columns.diagonal[columns.low[k]] * _BLOCK
        c = columns.block[k] * _BLOCK
        _add_outer(L[h : h + _BLOCK], high, high, D[k])
        _add_outer(L[g : g + _BLOCK], low, low, D[k])
        _add_outer(L[c : c + _BLOCK], high, low, D[k])
    for s in range(LANES):
        k = lanes.loaded[s]
        h = columns.diagonal[columns.high[k]] * _BLOCK + s
        g = columns.diagonal[columns.low[k]] * _BLOCK + s
        c = columns.block[k] * _BLOCK + s
        for a in range(3):
            for b in range(3):
                at = (3 * a + b) * LANES
                L[h + at] += D[n, s] * lanes.load[a, s] * lanes.load[b, s]
                L[g + at] += D[n, s] * lanes.load[3 + a, s] * lanes.load[3 + b, s]
                L[c + at] += D[n, s] * lanes.load[a, s] * lanes.load[3 + b, s]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def residuals(columns, lanes, work, b, b_border):
    """c − Aᵀλ − s, b − A y, D = y/s, and the numbers that tell how far each program has come."""
    y, slack, D, dual = lanes.y, lanes.s, work.D, work.dual
    _transposed(columns, lanes, lanes.multiplier, lanes.border, dual)
    lanes.gap[:] = 0.0
    lanes.slackness[:] = 0.0
    for k in range(len(y)):
        for s in range(LANES):
            dual[k, s] = lanes.c[k, s] - dual[k, s] - slack[k, s]
            D[k, s] = y[k, s] / slack[k, s]
            lanes.gap[s] += y[k, s] * slack[k, s]
            lanes.slackness[s] = max(lanes.slackness[s], abs(dual[k, s]))
    border = work.small[0]
    border[:] = b_border
    for i in range(len(b)):
        for s in range(LANES):
            work.primal[i, s] = b[i]
    _add_product(columns, lanes, y, work.primal, border, -1.0)
    for s in range(LANES):
        lanes.unbalance[s] = abs(border[s])
    for i in range(len(b)):
        for s in range(LANES):
            lanes.unbalance[s] = max(lanes.unbalance[s], abs(work.primal[i, s]))


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _factor(columns, lanes, work, start, row, target):
    """Factor A D Aᵀ; z = M⁻¹ m for the border's column m, and its Schur complement."""
    assemble(columns, lanes, work.D, work.L)
    block_cholesky.factor(work.L, start, target)
    n = len(columns.high)
    z, corner, schur = work.z, work.small[1], work.small[2]
    z[:] = 0.0
    corner[:] = 0.0
    for k in range(n):
        for s in range(LANES):
            work.v[k, s] = work.D[k, s] * columns.pressure[k]
    for s in range(LANES):
        work.v[n, s] = work.D[n, s] * lanes.load[6, s]
    _add_product(columns, lanes, work.v, z, corner, 1.0)
    work.r[:] = z
    block_cholesky.solve(work.L, start, row, z.reshape(z.size))
    schur[:] = corner
    for i in range(len(z)):
        for s in range(LANES):
            schur[s] -= z[i, s] * work.r[i, s]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _direction(columns, lanes, work, start, row):
    """Step (work.r, small[4]; dy; ds) for the complementarity target in work.v, which holds r_c/s.

    A D Aᵀ Δλ = r_p − A (r_c/s − D r_d), Δs = r_d − Aᵀ Δλ, Δy = r_c/s − D Δs.
    """
    n = len(columns.high)
    r, border, step = work.r, work.small[3], work.small[4]
    for k in range(n + 1):
        for s in range(LANES):
            work.dy[k, s] = work.v[k, s] - work.D[k, s] * work.dual[k, s]
    r[:] = work.primal
    border[:] = work.small[0]
    _add_product(columns, lanes, work.dy, r, border, -1.0)
    for i in range(len(r)):
        for s in range(LANES):
            border[s] -= work.z[i, s] * r[i, s]
    block_cholesky.solve(work.L, start, row, r.reshape(r.size))
    for s in range(LANES):
        schur, corner = work.small[2, s], work.small[1, s]
        step[s] = border[s] / schur if schur > 1e-14 * corner else 0.0
    for i in range(len(r)):
        for s in range(LANES):
            r[i, s] -= work.z[i, s] * step[s]
    _transposed(columns, lanes, r, step, work.ds)
    for k in range(n + 1):
        for s in range(LANES):
            work.ds[k, s] = work.dual[k, s] - work.ds[k, s]
            work.dy[k, s] = work.v[k, s] - work.D[k, s] * work.ds[k, s]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _reach(lanes, work, inside):
    """Longest primal and dual steps (small[5], small[6]) ≤ 1 that stay inside y, s > 0."""
    primal, dual = work.small[5], work.small[6]
    primal[:] = inside
    dual[:] = inside
    for k in range(len(lanes.y)):
        for s in range(LANES):
            primal[s] = max(primal[s], -work.dy[k, s] / lanes.y[k, s])
            dual[s] = max(dual[s], -work.ds[k, s] / lanes.s[k, s])
    for s in range(LANES):
        primal[s] = inside / primal[s]
        dual[s] = inside / dual[s]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _corrected(lanes, work):
    """work.v ← r_c/s of the corrector: σμ − y s − Δy Δs with Mehrotra's σ = (μ_aff/μ)³."""
    count = len(lanes.y)
    primal, dual, target = work.small[5], work.small[6], work.small[7]
    target[:] = 0.0
    for k in range(count):
        for s in range(LANES):
            target[s] += (lanes.y[k, s] + primal[s] * work.dy[k, s]) * (
                lanes.s[k, s] + dual[s] * work.ds[k, s]
            )
    for s in range(LANES):
        ratio = target[s] / lanes.gap[s]
        target[s] = ratio * ratio * ratio * lanes.gap[s] / count
    for k in range(count):
        for s in range(LANES):
            cross = target[s] - work.dy[k, s] * work.ds[k, s]
            work.v[k, s] = cross / lanes.s[k, s] - lanes.y[k, s]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _step(lanes, work, inside):
    """Take the step, up to the fraction ``inside`` of the way to the boundary."""
    _reach(lanes, work, inside)
    primal, dual = work.small[5], work.small[6]
    lanes.gap[:] = 0.0
    for k in range(len(lanes.y)):
        for s in range(LANES):
            lanes.y[k, s] += primal[s] * work.dy[k, s]
            lanes.s[k, s] += dual[s] * work.ds[k, s]
            lanes.gap[s] += lanes.y[k, s] * lanes.s[k, s]
    for i in range(len(work.r)):
        for s in range(LANES):
            lanes.multiplier[i, s] += dual[s] * work.r[i, s]
    for s in range(LANES):
        lanes.border[s] += dual[s] * work.small[4, s]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def advance(columns, lanes, work, b, b_border, start, row, target):
    """One predictor–corrector step of every lane; b (3 grains,), start, row, target: Pattern."""
    residuals(columns, lanes, work, b, b_border)
    _factor(columns, lanes, work, start, row, target)
    for k in range(len(lanes.y)):
        for s in range(LANES):
            work.v[k, s] = -lanes.y[k, s]
    _direction(columns, lanes, work, start, row)
    _reach(lanes, work, 1.0)
    _corrected(lanes, work)
    _direction(columns, lanes, work, start, row)
    _step(lanes, work, 0.9995)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def recentre(columns, lanes, work, b, b_border, start, row, target):
    """One Newton step of every lane towards y s = 1; at c = 0 that is the analytic centre of S."""
    residuals(columns, lanes, work, b, b_border)
    _factor(columns, lanes, work, start, row, target)
    for k in range(len(lanes.y)):
        for s in range(LANES):
            work.v[k, s] = 1.0 / lanes.s[k, s] - lanes.y[k, s]
    _direction(columns, lanes, work, start, row)
    _step(lanes, work, 0.95)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def rebalance(columns, lanes, work, b, b_border, start, row, target):
    """One Newton step of every lane on A y + a F = b alone, whatever the signs of y and F.

    The weight D = max(y, _LIGHT) leaves what is zero nearly alone, yet lets degenerate optima,
    where fewer y > 0 than there are rows, find their balance.
    """
    residuals(columns, lanes, work, b, b_border)
    for k in range(len(lanes.y)):
        for s in range(LANES):
            work.D[k, s] = max(lanes.y[k, s], _LIGHT)
    work.dual[:] = 0.0
    work.v[:] = 0.0
    _factor(columns, lanes, work, start, row, target)
    _direction(columns, lanes, work, start, row)
    lanes.y[:] += work.dy
