"""The interior-point method for contact programs: steps of one program, or of LANES in parallel.

With f = T y, multipliers v of the balance, z of y ≥ 0 and ζ of s ≥ 0, a contact program (see
`contact_program`) is at its optimum where τ = 0 in

    A T y + a F = b,   Tᵀ w T y + c − Tᵀ Aᵀ v + Tᵀ Eᵀ ζ = z,   y z = τ,   s ζ = τ.

Newton's method gives steps δy = M (Tᵀ Aᵀ δv + h); substituted into the balance,

    A K Aᵀ δv = b − A T y − A T M h,   M = (Tᵀ k T + z/y)⁻¹,   K = T M Tᵀ,

with one symmetric 2×2 conductance K per contact, so that `cholesky` does the main work. k = w + Σ
ζ/s is the stiffness of each component: sides add stiffness, and a component with a known value has
infinite stiffness (PINNED) and keeps its value. Mehrotra's predictor and corrector (SIAM J. Optim.
2, 575 (1992)) choose τ.

`look` measures the progress of each program and `advance` takes one step; the caller decides when
to stop. Other kinds of step use the same matrix: towards the centre, towards the balance alone, and
Newton's step on v alone after `cone_projection.project`.
"""

from typing import Any

from granforce.numerics import cholesky, contact_matrix
from granforce.numerics.contact_matrix import clear, copy, pull, push
from granforce.numerics.contact_program import (
    PINNED,
    Problem,
    diagonal_of,
    less_pushed,
    linear,
    make_iterate,
    make_workspace,
    pull_one,
    push_one,
    unbalance,
    worst_of,
)
from granforce.numerics.lanes import (
    ONE,
    allocating_part,
    compiled,
    fma,
    larger,
    load,
    root,
    same,
    size,
    store,
    within,
)
from granforce.system import cancelling
from granforce.types import Floats, Mask

# Fraction of the way to the nearest wall that a step may take, and a step towards the centre.
_INSIDE, _CENTRING = 0.9995, 0.95
# A row with a smaller pivot, relative to its diagonal, follows from rows eliminated before.
_DEPENDENT = 1e-11
# How often a step is refined for rounding.
_REFINEMENTS = 3
# Weight of zero y when the balance is restored (1: those of size ⟨f_n⟩).
_LIGHT = 1e-10

# Steps of `advance`: towards the optimum; towards y z = 1; towards A T y + a F = b alone; Newton's
# step on v alone, after `project`; towards the optimum with iterative refinement of the unbalance.
OPTIMUM, CENTRE, BALANCE, PROJECTED, REFINED = range(5)


def dependent_rows(problem: Problem, idle: Floats, lanes: Any = ONE) -> Mask:
    """Mask (rows,) of rows of the balance that follow from others: those without a pivot.

    lanes: ONE, or MANY with the same bits where only kernels for these are needed otherwise.
    """
    network, problem = problem.network, linear(problem, idle)
    # With y = 1 the matrix is A Aᵀ/2.
    at, work = make_iterate(problem, len(lanes)), make_workspace(problem, len(lanes))
    work.least[:] = 0.5 * _DEPENDENT * diagonal_of(network)
    look(problem, True, at, work, lanes)
    advance(problem, True, BALANCE, at, work, lanes)
    cancelling.check()
    return cholesky.left_out(network, work.factors) & (idle == 0)


@compiled
def look(problem, loads, at, work, lanes):
    """Measure unbalance and progress of each program, and set h for the predictor.

    loads: whether F is one of the unknowns.
    """
    unbalance(problem, at, work, lanes)
    _push_sides(problem, at, work, lanes)
    last = len(at.y) - 1
    product = slackness = same(lanes, 0.0)
    for k in range(0, len(problem.w), 2):
        normal, tangential = pull(problem.network, k // 2, at.v, at.v_border, lanes)
        # Pinned components are held by forces without cost.
        w_n = problem.w[k] if problem.w[k] < PINNED else 0.0
        w_t = problem.w[k + 1] if problem.w[k + 1] < PINNED else 0.0
        stiff, cross = 0.25 * (w_n + w_t), 0.25 * (w_n - w_t)
        y0, y1 = load(at.y, k, lanes), load(at.y, k + 1, lanes)
        z0, z1 = load(at.z, k, lanes), load(at.z, k + 1, lanes)
        h0 = fma(0.5, normal + tangential, -load(at.c, k, lanes))
        h1 = fma(0.5, normal - tangential, -load(at.c, k + 1, lanes))
        h0 = fma(-stiff, y0, fma(-cross, y1, h0))
        h1 = fma(-stiff, y1, fma(-cross, y0, h1))
        store(work.h, k, lanes, h0)
        store(work.h, k + 1, lanes, h1)
        product = fma(y0, z0, fma(y1, z1, product))
        push_n, push_t = load(work.push, k, lanes), load(work.push, k + 1, lanes)
        off0 = h0 + z0 - 0.5 * (push_n + push_t)
        off1 = h1 + z1 - 0.5 * (push_n - push_t)
        if problem.w[k] >= PINNED:
            off0, off1 = 0.5 * (off0 - off1), 0.5 * (off1 - off0)
        if problem.w[k + 1] >= PINNED:
            off0 = off1 = 0.5 * (off0 + off1)
        slackness = larger(size(off0), larger(size(off1), slackness))
    for a in range(len(problem.side)):
        s, zeta = load(at.y, len(problem.w) + a, lanes), load(at.z, len(problem.w) + a, lanes)
        product = fma(s, zeta, product)
        _add_side(problem, a, zeta / s * load(work.rest, a, lanes), work.h, lanes)
    if loads:
        product = fma(load(at.y, last, lanes), load(at.z, last, lanes), product)
    store(work.product, 0, lanes, product)
    store(work.slackness, 0, lanes, slackness)
    worst = worst_of(work.r_border, worst_of(work.r, same(lanes, 0.0), lanes), lanes)
    store(work.unbalance, 0, lanes, worst_of(work.rest, worst, lanes))
    for lane in range(len(at.loaded)):
        work.h[last, lane] = pull_one(problem.network, at.v, at.v_border, at.loaded[lane], lane)
        work.h[last, lane] -= at.c[last, lane]


@compiled
def advance(problem, loads, mode, at, work, lanes):
    """One step of the programs that are `going`, after `look`; modes as listed above."""
    count = len(at.y) if loads else len(at.y) - 1
    _stiffen(problem, mode, at, work, lanes)
    if mode == BALANCE:
        clear(work.h, lanes)
    if mode == CENTRE:
        clear(work.turn, lanes)
        store(work.target, 0, lanes, 1.0)
        _aim(problem, count, at, work, lanes)
    _factor(problem, mode, at, work, lanes)
    optimum = mode == OPTIMUM or mode == REFINED
    for attempt in range(2 if optimum else 1):
        if attempt == 1:
            _predict(count, at, work, lanes)
            _aim(problem, count, at, work, lanes)
        _towards(problem, mode, at, work, lanes)
    if mode == REFINED:
        _refine(problem, at, work, lanes)
    primal = dual = load(work.going, 0, lanes)
    if optimum or mode == CENTRE:
        _measure(count, _INSIDE if optimum else _CENTRING, at, work, lanes)
        primal, dual = load(work.primal, 0, lanes), load(work.dual, 0, lanes)
        _move(at.z, work.dz, dual, count, lanes)
    if mode != PROJECTED:
        _move(at.y, work.dy, primal, count, lanes)
    if mode != BALANCE:
        _move(at.v, work.dv, dual, len(at.v), lanes)
        _move(at.v_border, work.dv_border, dual, len(at.v_border), lanes)


@within
def _add_side(problem, a, force, h, lanes):
    """h ← h + Tᵀ Eᵀ for a force along side a."""
    component = problem.side[a]
    first = component - component % 2
    part = 0.5 * problem.sign[a] * force
    store(h, first, lanes, load(h, first, lanes) + part)
    part = -part if component % 2 else part
    store(h, first + 1, lanes, load(h, first + 1, lanes) + part)


@within
def _push_sides(problem, at, work, lanes):
    """Eᵀ ζ."""
    for a in range(len(problem.side)):
        store(work.push, problem.side[a], lanes, 0.0)
    for a in range(len(problem.side)):
        k, zeta = problem.side[a], load(at.z, len(problem.w) + a, lanes)
        store(work.push, k, lanes, fma(problem.sign[a], zeta, load(work.push, k, lanes)))


@within
def _stiffen(problem, mode, at, work, lanes):
    """k ← w + Σ ζ/s."""
    for a in range(len(problem.side)):
        store(work.k, problem.side[a], lanes, problem.w[problem.side[a]])
    for a in range(len(problem.side)):
        k = problem.side[a]
        stiffer = _stiffness(len(problem.w) + a, at.y, at.z, mode, lanes)
        store(work.k, k, lanes, load(work.k, k, lanes) + stiffer)


@within
def _stiffness(k, y, z, mode, lanes):
    """z/y of one cone coordinate; when the balance is restored, a stiffness that holds zero y."""
    if mode == BALANCE:
        # Softer than 1/y for large y: coordinates near zero must not be driven below it.
        heavy = larger(load(y, k, lanes), _LIGHT)
        return 1.0 / (heavy * root(heavy))
    return load(z, k, lanes) / load(y, k, lanes)


@within
def _load_stiffness(at, mode, lane):
    """The stiffness of the load F, the last coordinate."""
    last = len(at.y) - 1
    if mode == BALANCE:
        return max(at.y[last, lane], _LIGHT) ** -1.5
    return at.z[last, lane] / at.y[last, lane]


@within
def _determinant(d0, d1, k_n, k_t):
    # Tᵀ k T + diag(d) without the difference of large terms, which cancel at small μ.
    return fma(0.25 * (k_n + k_t), d0 + d1, fma(d0, d1, 0.25 * k_n * k_t))


@within
def _factor(problem, mode, at, work, lanes):
    """Factor A K Aᵀ + shift, K = T (Tᵀ k T + diag(z/y))⁻¹ Tᵀ."""
    network = problem.network
    contact_matrix.begin(network, problem.diagonal, work.factors, lanes)
    for k in range(0, len(problem.w), 2):
        c = 3 * (k // 2)
        if mode == PROJECTED:
            nn, nt = load(work.K, c, lanes), load(work.K, c + 1, lanes)
            tt = load(work.K, c + 2, lanes)
        else:
            d0 = _stiffness(k, at.y, at.z, mode, lanes)
            d1 = _stiffness(k + 1, at.y, at.z, mode, lanes)
            k_n, k_t = load(work.k, k, lanes), load(work.k, k + 1, lanes)
            scale = 0.25 / _determinant(d0, d1, k_n, k_t)
            nn = scale * (d0 + d1 + k_t)
            nt, tt = scale * (d1 - d0), scale * (d0 + d1 + k_n)
        contact_matrix.add(network, k // 2, nn, nt, tt, work.factors, lanes)
    for lane in range(len(at.loaded)):
        if at.loaded[lane] >= 0:
            K = 1.0 / _load_stiffness(at, mode, lane)
            contact_matrix.add_one(network, at.loaded[lane], K, work.factors, lane)
    cholesky.factor(network, work.least, work.factors, work.stop, lanes)


@within
def _answer(p0, p1, d0, d1, k_n, k_t):
    """(Tᵀ k T + diag(d))⁻¹ p, each component to its own relative precision."""
    scale = 1.0 / _determinant(d0, d1, k_n, k_t)
    off, half = 0.25 * (k_n - k_t), 0.5 * k_t
    return scale * fma(off, p0 - p1, (half + d1) * p0), scale * fma(off, p1 - p0, (half + d0) * p1)


@within
def _towards(problem, mode, at, work, lanes):
    """δv and δy of the step given by h; after `project`, δv alone."""
    network, n, last = problem.network, len(problem.w), len(at.y) - 1
    pairs = 0 if mode == PROJECTED else n
    for k in range(len(work.r)):
        store(work.dv, k, lanes, load(work.r, k, lanes))
    for a in range(len(work.r_border)):
        store(work.dv_border, a, lanes, load(work.r_border, a, lanes))
    for k in range(0, pairs, 2):
        d0 = _stiffness(k, at.y, at.z, mode, lanes)
        d1 = _stiffness(k + 1, at.y, at.z, mode, lanes)
        h0, h1 = load(work.h, k, lanes), load(work.h, k + 1, lanes)
        k_n, k_t = load(work.k, k, lanes), load(work.k, k + 1, lanes)
        y0, y1 = _answer(h0, h1, d0, d1, k_n, k_t)
        normal, tangential = -0.5 * (y0 + y1), -0.5 * (y0 - y1)
        push(network, k // 2, normal, tangential, work.dv, work.dv_border, lanes)
    for lane in range(len(at.loaded)):
        force = -work.h[last, lane] / _load_stiffness(at, mode, lane)
        push_one(network, force, work.dv, work.dv_border, at.loaded[lane], lane)
    cholesky.solve(network, work.factors, work.dv, work.dv_border, lanes)
    for k in range(0, pairs, 2):
        d0 = _stiffness(k, at.y, at.z, mode, lanes)
        d1 = _stiffness(k + 1, at.y, at.z, mode, lanes)
        normal, tangential = pull(network, k // 2, work.dv, work.dv_border, lanes)
        p0 = fma(0.5, normal + tangential, load(work.h, k, lanes))
        p1 = fma(0.5, normal - tangential, load(work.h, k + 1, lanes))
        k_n, k_t = load(work.k, k, lanes), load(work.k, k + 1, lanes)
        y0, y1 = _answer(p0, p1, d0, d1, k_n, k_t)
        store(work.dy, k, lanes, y0)
        store(work.dy, k + 1, lanes, y1)
    for a in range(0 if mode == PROJECTED else len(problem.side)):
        change = load(work.rest, a, lanes) - _step_beside(problem, a, mode, at, work, lanes)
        store(work.dy, n + a, lanes, change)
    for lane in range(len(at.loaded)):
        pulled = pull_one(network, work.dv, work.dv_border, at.loaded[lane], lane)
        work.dy[last, lane] = (pulled + work.h[last, lane]) / _load_stiffness(at, mode, lane)


@allocating_part
def _refine(problem, at, work, lanes):
    """Add to δy and δv the steps that remove the remaining unbalance.

    Near a vertex y/z differ so much in size that one step may add more unbalance than it removes.
    """
    dy, dv, dv_border = work.dy.copy(), work.dv.copy(), work.dv_border.copy()
    clear(work.h, lanes)
    clear(work.rest, lanes)
    for _ in range(_REFINEMENTS):
        less_pushed(problem, at, work.dy, work, lanes)
        _towards(problem, REFINED, at, work, lanes)
        _move(dy, work.dy, 1.0, len(dy), lanes)
        _move(dv, work.dv, 1.0, len(dv), lanes)
        _move(dv_border, work.dv_border, 1.0, len(dv_border), lanes)
    copy(work.dy, dy, lanes)
    copy(work.dv, dv, lanes)
    copy(work.dv_border, dv_border, lanes)


@within
def _step_beside(problem, a, mode, at, work, lanes):
    """E δf of side a, to its own relative precision, which a difference of δy would lose."""
    k = problem.side[a] - problem.side[a] % 2
    d0 = _stiffness(k, at.y, at.z, mode, lanes)
    d1 = _stiffness(k + 1, at.y, at.z, mode, lanes)
    k_n, k_t = load(work.k, k, lanes), load(work.k, k + 1, lanes)
    scale = 0.25 / _determinant(d0, d1, k_n, k_t)
    normal, tangential = pull(problem.network, k // 2, work.dv, work.dv_border, lanes)
    h0, h1 = load(work.h, k, lanes), load(work.h, k + 1, lanes)
    normal, tangential = normal + (h0 + h1), tangential + (h0 - h1)
    if problem.side[a] % 2:
        change = (d0 + d1 + k_n) * tangential + (d1 - d0) * normal
    else:
        change = (d0 + d1 + k_t) * normal + (d1 - d0) * tangential
    return problem.sign[a] * scale * change


@within
def _predict(count, at, work, lanes):
    """Longest step towards τ = 0, the τ that follows from it, and δy δz."""
    primal = dual = same(lanes, 1.0)
    z_dy = y_dz = both = same(lanes, 0.0)
    for k in range(count):
        y, z, dy = load(at.y, k, lanes), load(at.z, k, lanes), load(work.dy, k, lanes)
        ratio = dy / y
        dz = fma(-z, ratio, -z)
        primal = larger(-ratio, primal)
        dual = larger(1.0 + ratio, dual)  # −δz/z
        turn = dy * dz
        z_dy, y_dz, both = fma(z, dy, z_dy), fma(y, dz, y_dz), both + turn
        store(work.turn, k, lanes, turn)
    product = load(work.product, 0, lanes)
    left = product + z_dy / primal + (y_dz + both / primal) / dual
    ratio = left / product
    # The further the predictor gets, the smaller the next τ.
    target = ratio * ratio * ratio * product / (1.0 * count)
    store(work.target, 0, lanes, target)


@within
def _aim(problem, count, at, work, lanes):
    """h ← h + (τ − turn)/y − Tᵀ Eᵀ (τ − turn)/s: the corrector."""
    target = load(work.target, 0, lanes)
    for k in range(count):
        extra = (target - load(work.turn, k, lanes)) / load(at.y, k, lanes)
        store(work.h, k, lanes, load(work.h, k, lanes) + extra)
    for a in range(len(problem.side)):
        k = len(problem.w) + a
        extra = (target - load(work.turn, k, lanes)) / load(at.y, k, lanes)
        _add_side(problem, a, -extra, work.h, lanes)


@within
def _measure(count, inside, at, work, lanes):
    """Step lengths, at most the fraction `inside` of the way to the nearest wall, and δz."""
    primal = dual = same(lanes, inside)
    target = load(work.target, 0, lanes)
    for k in range(count):
        y, z, dy = load(at.y, k, lanes), load(at.z, k, lanes), load(work.dy, k, lanes)
        ratio = dy / y
        dz = fma(-z, ratio, (target - load(work.turn, k, lanes)) / y - z)
        primal = larger(-ratio, primal)
        dual = larger(-dz / z, dual)
        store(work.dz, k, lanes, dz)
    going = load(work.going, 0, lanes) * inside
    store(work.primal, 0, lanes, going / primal)
    store(work.dual, 0, lanes, going / dual)


@within
def _move(values, step, length, count, lanes):
    for k in range(count):
        store(values, k, lanes, fma(length, load(step, k, lanes), load(values, k, lanes)))
