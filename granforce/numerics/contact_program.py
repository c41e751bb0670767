"""Contact programs: the function minimised over S, and the state of an iteration.

In cone coordinates y ≥ 0, two per contact, with f_n = (y₁ + y₂)/2 and f_t = μ (y₁ − y₂)/2, a
contact program is

    minimise  ½ Σ w f² + c·y − F   subject to   A f + a F = b,  E f + s = d,  y, s ≥ 0,  F ≥ 0.

Bounds and limit loads are programs with w = 0, nearest networks with w = 1 and c·y = −f·target; a,
the column of f_n of one contact, is present if a load F is maximised. E f ≤ d are bounds on single
components of f in addition to the cones ("sides", with slacks s), if there are any; a component
with a known value is fixed (PINNED). Forces are in units of order 1, and tangential forces are
stored as f_t/μ.

A `Problem` is the data that all programs over one set of networks share, an `Iterate` the current
point of one or of LANES of them, and `unbalance` is the measure that both solvers, `interior_point`
and `cone_projection`, use.
"""

from typing import NamedTuple

import numpy as np
from scipy import sparse

from granforce.numerics import contact_matrix
from granforce.numerics.blocks import NO_PIVOT
from granforce.numerics.contact_matrix import Factors, Network, push
from granforce.numerics.lanes import larger, load, pick, room, side_by_side, size, store, within
from granforce.system import cancelling
from granforce.types import Floats, Integers, Mask

# Rounding error of d − E f − s for forces of order 1.
_ROUNDING = 1e-13
# Stiffness of a fixed component: its conductance is below any pivot.
PINNED = 1e60


class Problem(NamedTuple):
    """What all programs over one set of networks share."""

    network: Network  # A, for forces (f_n, f_t/μ)
    b: Floats  # (rows,) in order of elimination
    b_border: Floats  # (m,)
    diagonal: Floats  # (rows,) added to that of A K Aᵀ: 1 for rows that are not there
    mu: Floats  # (N_c,) slopes of the cones
    place: Integers  # (rows of A,) where they are among the rows, then the border
    w: Floats  # (2 N_c,) weights of f_n, f_t/μ in ½ Σ w f²; PINNED for those that stay
    start: Floats  # (n,) first y; contains the values of pinned components
    side: Integers  # (sides,) component that each side bounds, in order of w
    sign: Floats  # (sides,) E: 1 for a bound from above, −1 from below
    limit: Floats  # (sides,) d


class Iterate(NamedTuple):
    """The points of W programs: y with n = 2 N_c + sides coordinates, then F. Arrays (…, W)."""

    y: Floats  # (n + 1, W) cone coordinates, slacks of the sides, F
    z: Floats  # (n + 1, W)
    c: Floats  # (n + 1, W)
    v: Floats  # (rows, W)
    v_border: Floats  # (m, W)
    loaded: Integers  # (W,) contact that carries F, or −1


class Workspace(NamedTuple):
    """Scratch arrays of W programs, and numbers (1, W) that measure their progress."""

    factors: Factors
    stop: Mask  # (1,) bool, set when the work is cancelled
    least: Floats  # (rows,) smaller pivots count as zero
    K: Floats  # (3 N_c, W) nn, nt, tt
    h: Floats  # (n + 1, W)
    dy: Floats  # (n + 1, W)
    turn: Floats  # (n + 1, W) δy δz of the predictor
    dz: Floats  # (n + 1, W)
    r: Floats  # (rows, W) b − A T y − a F
    r_border: Floats  # (m, W)
    dv: Floats  # (rows, W)
    dv_border: Floats  # (m, W)
    rest: Floats  # (sides, W) d − E f − s
    push: Floats  # (2 N_c, W) Eᵀ ζ
    k: Floats  # (2 N_c, W) stiffness of each component
    product: Floats  # Σ y z
    unbalance: Floats  # largest |b − A T y − a F| and |d − E f − s|
    slackness: Floats  # largest |Tᵀ w T y + c − Tᵀ Aᵀ v + Tᵀ Eᵀ ζ − z|
    primal: Floats  # length of the step of y
    dual: Floats  # of v and z
    target: Floats  # τ
    going: Floats  # 1, or 0 for programs that do not move


def make_iterate(problem: Problem, width: int) -> Iterate:
    """An Iterate of trivial programs, for which any step is valid."""
    n, rows, m = len(problem.start), len(problem.b), len(problem.b_border)
    return Iterate(
        y=side_by_side(np.append(problem.start, 1.0), width),
        z=room(n + 1, width, value=1.0),
        c=room(n + 1, width),
        v=room(rows, width),
        v_border=room(m, width),
        loaded=np.full(width, -1),
    )


def make_workspace(problem: Problem, width: int) -> Workspace:
    """The Workspace for `width` programs side by side."""
    n, rows, m = len(problem.start), len(problem.b), len(problem.b_border)
    forces, sides = len(problem.w), len(problem.side)
    return Workspace(
        factors=contact_matrix.make_factors(problem.network, width),
        stop=cancelling.flag(),
        least=np.full(rows, NO_PIVOT),
        K=room(3 * forces // 2, width),
        h=room(n + 1, width),
        dy=room(n + 1, width),
        turn=room(n + 1, width),
        dz=room(n + 1, width),
        r=room(rows, width),
        r_border=room(m, width),
        dv=room(rows, width),
        dv_border=room(m, width),
        rest=room(sides, width),
        push=room(forces, width),
        k=side_by_side(problem.w, width),
        product=room(1, width),
        unbalance=room(1, width),
        slackness=room(1, width),
        primal=room(1, width),
        dual=room(1, width),
        target=room(1, width),
        going=room(1, width, value=1.0),
    )


def make_problem(
    network: Network,
    b: Floats,
    b_border: Floats,
    idle: Floats,
    place: Integers,
    mu: Floats,
    shift: float,
) -> Problem:
    """The Problem with `shift`, relative to the diagonal of A Aᵀ, added to that of A K Aᵀ.

    idle (rows,): 1 for rows without a contact. All weights are 1, and there are no sides.
    """
    diagonal = diagonal_of(network)
    typical = diagonal[idle == 0].mean() if (idle == 0).any() else 0.0
    diagonal = np.where(idle > 0, 1.0, shift * np.maximum(diagonal, typical))
    count, none = len(network.high), np.zeros(0)
    w = np.column_stack([np.ones(count), mu * mu]).ravel()
    start, side = np.ones(2 * count), np.zeros(0, dtype=np.int64)
    return Problem(
        network=network,
        b=b,
        b_border=b_border,
        diagonal=diagonal,
        mu=mu,
        place=place,
        w=w,
        start=start,
        side=side,
        sign=none,
        limit=none,
    )


def without_rows(problem: Problem, idle: Floats, out: Mask) -> Problem:
    """The linear problem without shift and without the rows (rows,) in the mask `out`."""
    network = problem.network
    columns = np.where(out[_rows(network)], 0.0, network.columns.reshape(-1, 2, 2, 3))
    return linear(problem, idle)._replace(
        network=network._replace(columns=columns.reshape(-1, 12)),
        b=np.where(out, 0.0, problem.b),
        diagonal=np.where(out, 1.0, idle),
    )


def linear(problem: Problem, idle: Floats) -> Problem:
    return problem._replace(diagonal=idle, w=np.where(problem.w < PINNED, 0.0, PINNED))


def _rows(network: Network) -> Integers:
    """Rows (N_c, 2, 2, 3) of the entries of `columns`, by component and grain."""
    first = 3 * np.stack([network.high, network.low], axis=1)
    return (first[:, None, :, None] + np.arange(3)).repeat(2, axis=1)


def balance_matrix(network: Network) -> sparse.csr_matrix:
    """A (rows and global rows, 2 N_c) of a network."""
    count, m = len(network.high), network.border.shape[1] // 2
    rows = 3 * len(network.layout.position)
    below = np.broadcast_to(rows + np.arange(m), (count, 2, m))
    row = np.concatenate([_rows(network).reshape(count, 2, 6), below], axis=2)
    values = [network.columns.reshape(count, 2, 6), network.border.reshape(count, 2, m)]
    force = np.repeat(np.arange(2 * count), 6 + m)
    entries = np.concatenate(values, axis=2).ravel(), (row.ravel(), force)
    return sparse.csr_matrix(entries, shape=(rows + m, 2 * count))


def diagonal_of(network: Network) -> Floats:
    """The diagonal of A Aᵀ, (rows,)."""
    diagonal = np.zeros(3 * len(network.layout.position))
    np.add.at(diagonal, _rows(network).ravel(), network.columns.ravel() ** 2)
    return diagonal


@within
def worst_of(values, worst, lanes):
    """The larger of `worst` and the largest |value|."""
    for k in range(len(values)):
        worst = larger(size(load(values, k, lanes)), worst)
    return worst


@within
def unbalance(problem, at, work, lanes):
    """r ← b − A T y − a F, rest ← d − E f − s."""
    for k in range(len(problem.b)):
        store(work.r, k, lanes, problem.b[k])
    for k in range(len(problem.b_border)):
        store(work.r_border, k, lanes, problem.b_border[k])
    less_pushed(problem, at, at.y, work, lanes)
    for a in range(len(problem.side)):
        limit, beside = problem.limit[a], load(at.y, len(problem.w) + a, lanes)
        rest = limit - beside - side_force(problem, a, at.y, lanes)
        # Not relative to s, which may be much smaller than the rounding error of f.
        least = _ROUNDING * (1.0 + abs(limit))
        store(work.rest, a, lanes, pick(size(rest), least, rest, 0.0))


@within
def less_pushed(problem, at, y, work, lanes):
    """r ← r − A T y − a F."""
    last = len(y) - 1
    for k in range(0, len(problem.w), 2):
        y0, y1 = load(y, k, lanes), load(y, k + 1, lanes)
        normal, tangential = -0.5 * (y0 + y1), -0.5 * (y0 - y1)
        push(problem.network, k // 2, normal, tangential, work.r, work.r_border, lanes)
    for lane in range(len(at.loaded)):
        push_one(problem.network, -y[last, lane], work.r, work.r_border, at.loaded[lane], lane)


@within
def side_force(problem, a, y, lanes):
    """E f of side a."""
    component = problem.side[a]
    first = component - component % 2
    y0, y1 = load(y, first, lanes), load(y, first + 1, lanes)
    y1 = -y1 if component % 2 else y1
    return 0.5 * problem.sign[a] * (y0 + y1)


@within
def pull_one(network, x, x_border, c, lane):
    """(Aᵀ x)_n of one contact in one lane; 0 without a contact."""
    value = 0.0
    if c >= 0:
        e, g = network.columns[c], network.border[c]
        high, low = 3 * network.high[c], 3 * network.low[c]
        for a in range(3):
            value += e[a] * x[high + a, lane] + e[3 + a] * x[low + a, lane]
        for a in range(len(g) // 2):
            value += g[a] * x_border[a, lane]
    return value


@within
def push_one(network, force, x, x_border, c, lane):
    """x ← x + A f for a normal force on one contact in one lane."""
    if c >= 0:
        e, g = network.columns[c], network.border[c]
        high, low = 3 * network.high[c], 3 * network.low[c]
        for a in range(3):
            x[high + a, lane] += e[a] * force
            x[low + a, lane] += e[3 + a] * force
        for a in range(len(g) // 2):
            x_border[a, lane] += g[a] * force
