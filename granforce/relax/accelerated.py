"""The admissible network nearest to given forces, by Newton's method on grain velocities.

The dual of the projection onto S has one unknown per balance equation: velocities v of the grains
and the dilation rate of the box. Contact forces follow from v contact by contact, and the change
of the unbalance with v is a weighted Laplacian of the contact graph, A K Aᵀ, with one 2×2
conductance K per contact. A barrier keeps forces inside their cones (so that K, between 0 and 1,
changes smoothly), and is lowered to nothing in some ten to twenty steps (Mehrotra's predictor and
corrector). Each step costs one sparse factorisation, whose plan (`dissection`) is made once per
ensemble.
"""

import threading
import time
import weakref
from typing import NamedTuple

import numpy as np
from numba import njit

from granforce.records import Relaxation
from granforce.relax import dissection
from granforce.relax.dissection import factor, solve
from granforce.tolerances import BALANCED

# Distance to the nearest network itself (in ⟨f_n⟩, over all components) that ends the steps.
NEAREST = 1e-7

# First forces and multipliers lie at least this far (in ⟨f_n⟩) inside their cones.
INSIDE = 0.3
# Part of the way to the nearest cone boundary that a step may go.
STEP = 0.995
# Added to the Laplacian, whose translations cost nothing; it slows no step, only bounds them.
SHIFT = 1e-11
# Steps shorter than this, so many in a row, mean that S is empty.
SHORT, SHORT_IN_A_ROW = 1e-3, 5


class Geometry(NamedTuple):
    """What depends on the ensemble only, in units of ⟨f_n⟩."""

    plan: dissection.Plan
    rows: np.ndarray  # (N_c, slots) balance rows each contact meets
    columns: np.ndarray  # (N_c, slots, 2) what unit f_n, f_t do to them
    b: np.ndarray  # (rows,)
    mu: float
    shift: np.ndarray  # (rows,)


def accelerated(ensemble, start, *, tolerance=BALANCED, max_iterations=100):
    """The point of S with the least Σ |F_c − F_start,c|², as by `nearest` but faster.

    start (N_c, 2), force. Ends when the residual (in ⟨f_n⟩) is below the tolerance and the
    distance to the optimum below NEAREST ⟨f_n⟩; ``converged`` is False where that was not reached
    (S is empty, or max_iterations were too few): forces are the last iterate, inside the cones.
    """
    begin = time.perf_counter()
    geometry = _geometry(ensemble)
    target = np.ascontiguousarray(start, dtype=np.float64) / ensemble.force_scale
    reached, iterations, ended = _interior(
        geometry,
        target,
        min(tolerance, BALANCED) / 4,
        NEAREST**2,
        max_iterations,
        *(np.empty(size) for size in dissection.memory(geometry.plan)),
    )
    forces = reached * ensemble.force_scale
    residual = ensemble.residual(forces)
    return Relaxation(
        forces,
        int(iterations),
        residual,
        ensemble.violation(forces),
        bool(ended and residual <= tolerance),
        time.perf_counter() - begin,
    )


_known = weakref.WeakKeyDictionary()
_lock = threading.Lock()


def _geometry(ensemble):
    """The Geometry of an ensemble, made on first use and kept as long as the ensemble."""
    with _lock:
        found = _known.get(ensemble)
        if found is None:
            found = _known[ensemble] = _make_geometry(ensemble)
    return found


def _make_geometry(ensemble):
    grains, contacts = ensemble.grains, ensemble.contacts
    row_of = np.full(len(ensemble.packing.r), -1)
    row_of[grains] = np.arange(len(grains))
    i, j = row_of[contacts.i], row_of[contacts.j]
    size, border = 1 + ensemble.per_contact, ensemble.has_pressure_row
    plan = dissection.make_plan(ensemble.packing.x[grains], i, j, size, border)
    rows = dissection.slots(i, j, size, border, len(grains))
    columns = np.zeros((*rows.shape, 2))
    A = ensemble.A.tocsc()
    for component in range(ensemble.per_contact):
        _gather(
            A.indptr.astype(np.int64),
            A.indices.astype(np.int64),
            A.data,
            rows,
            columns,
            component,
            ensemble.per_contact,
        )
    scale = np.zeros(A.shape[0])
    np.add.at(scale, rows, (columns**2).sum(axis=2))
    return Geometry(
        plan,
        rows,
        columns,
        ensemble.b / ensemble.force_scale,
        float(ensemble.mu),
        SHIFT * np.maximum(scale, scale.mean() if len(scale) else 0.0),
    )


@njit(cache=True, nogil=True)
def _gather(start, index, value, rows, columns, component, per_contact):
    """Fill columns[:, :, component] from the compressed columns of A."""
    for c in range(rows.shape[0]):
        column = per_contact * c + component
        for k in range(start[column], start[column + 1]):
            for slot in range(rows.shape[1]):
                if rows[c, slot] == index[k]:
                    columns[c, slot, component] = value[k]


@njit(cache=True, nogil=True)
def project(normal, tangential, mu):
    """The point (f_n, f_t) of the cone |f_t| ≤ μ f_n nearest to (normal, tangential)."""
    size = abs(tangential)
    if size <= mu * normal:
        return normal, tangential
    if mu * size <= -normal:
        return 0.0, 0.0
    f_n = (normal + mu * size) / (1.0 + mu * mu)
    return f_n, np.copysign(mu * f_n, tangential)


@njit(cache=True, nogil=True, error_model="numpy")
def _interior(geometry, target, tolerance, gap, max_iterations, panels, stack, work):
    """Forces (N_c, 2), steps taken, and whether residual and y·z fell below their bounds.

    y = (f_n + f_t/μ, f_n − f_t/μ) ≥ 0 are cone coordinates, x = T y, and z ≥ 0 their multipliers:
    A x = b,  Tᵀ(x − target − Aᵀv) = z,  y z = 0.
    """
    mu = geometry.mu
    count, rows = target.shape[0], geometry.b.shape[0]
    fields = np.zeros((8, count, 2))
    y, z, q, step_y = fields[0], fields[1], fields[2], fields[3]
    step_z, both, x, slack = fields[4], fields[5], fields[6], fields[7]
    weight = np.empty((count, 3))
    v, rhs, unbalance = np.zeros(rows), np.empty(rows), np.empty(rows)
    _begin(target, mu, y, z)
    short = 0
    for iteration in range(max_iterations + 1):
        complementarity = 0.0
        for c in range(count):
            x[c, 0] = 0.5 * (y[c, 0] + y[c, 1])
            x[c, 1] = 0.5 * mu * (y[c, 0] - y[c, 1])
            complementarity += y[c, 0] * z[c, 0] + y[c, 1] * z[c, 1]
        _unbalance(geometry, x, unbalance)
        dual = _slack(geometry, x, target, v, z, slack)
        if np.abs(unbalance).max() <= tolerance and complementarity <= gap and dual <= 1e-8:
            return x, iteration, True
        if iteration == max_iterations or short >= SHORT_IN_A_ROW or not complementarity < 1e200:
            break
        for c in range(count):
            weight[c] = _conductance(z[c, 0] / y[c, 0], z[c, 1] / y[c, 1], mu)
        factor(geometry.plan, geometry.columns, weight, geometry.shift, panels, stack, work)
        both[:] = 0.0
        barrier = 0.0
        average = complementarity / (2 * count)
        for corrector in range(2):
            for c in range(count):
                for a in range(2):
                    q[c, a] = (barrier - both[c, a]) / y[c, a] - z[c, a] - slack[c, a]
            _newton(geometry, y, z, q, weight, unbalance, rhs, panels, work, step_y, step_z)
            for c in range(count):
                for a in range(2):
                    step_z[c, a] = (barrier - both[c, a] - z[c, a] * step_y[c, a]) / y[c, a] - z[
                        c, a
                    ]
            length = _room(y, z, step_y, step_z)
            if corrector == 0:
                left = 0.0
                for c in range(count):
                    for a in range(2):
                        left += (y[c, a] + length * step_y[c, a]) * (
                            z[c, a] + length * step_z[c, a]
                        )
                        both[c, a] = step_y[c, a] * step_z[c, a]
                barrier = average * (left / complementarity) ** 3
        length = min(1.0, STEP * length)
        short = short + 1 if length < SHORT else 0
        y += length * step_y
        z += length * step_z
        v += length * rhs
    return x, iteration, False


@njit(cache=True, nogil=True)
def _begin(target, mu, y, z):
    """y and z of each contact's own projection, moved inside."""
    for c in range(target.shape[0]):
        normal, tangential = project(target[c, 0], target[c, 1], mu)
        ratio = tangential / mu if mu > 0 else 0.0
        slope_n, slope_t = normal - target[c, 0], mu * (tangential - target[c, 1])
        y[c, 0] = max(normal + ratio, 0.0) + INSIDE
        y[c, 1] = max(normal - ratio, 0.0) + INSIDE
        z[c, 0] = max(0.5 * (slope_n + slope_t), 0.0) + INSIDE
        z[c, 1] = max(0.5 * (slope_n - slope_t), 0.0) + INSIDE


@njit(cache=True, nogil=True)
def _unbalance(geometry, x, unbalance):
    """b − A x."""
    unbalance[:] = geometry.b
    rows, columns = geometry.rows, geometry.columns
    for c in range(rows.shape[0]):
        for a in range(rows.shape[1]):
            unbalance[rows[c, a]] -= columns[c, a, 0] * x[c, 0] + columns[c, a, 1] * x[c, 1]


@njit(cache=True, nogil=True)
def _slack(geometry, x, target, v, z, slack):
    """Fill slack with Tᵀ(x − target − Aᵀv) − z; returns its largest size."""
    worst = 0.0
    for c in range(x.shape[0]):
        pull_n, pull_t = _pull(geometry, c, v)
        u_n = x[c, 0] - target[c, 0] - pull_n
        u_t = geometry.mu * (x[c, 1] - target[c, 1] - pull_t)
        slack[c, 0] = 0.5 * (u_n + u_t) - z[c, 0]
        slack[c, 1] = 0.5 * (u_n - u_t) - z[c, 1]
        worst = max(worst, abs(slack[c, 0]), abs(slack[c, 1]))
    return worst


@njit(cache=True, nogil=True)
def _pull(geometry, c, v):
    """Aᵀv of one contact."""
    pull_n = pull_t = 0.0
    for a in range(geometry.rows.shape[1]):
        value = v[geometry.rows[c, a]]
        pull_n += geometry.columns[c, a, 0] * value
        pull_t += geometry.columns[c, a, 1] * value
    return pull_n, pull_t


@njit(cache=True, nogil=True, error_model="numpy")
def _determinant(w, u, mu):
    # TᵀT + diag(w, u) without the difference of its large parts, which cancel at small μ.
    return 0.25 * mu * mu + 0.25 * (1.0 + mu * mu) * (w + u) + w * u


@njit(cache=True, nogil=True, error_model="numpy")
def _conductance(w, u, mu):
    """K = T (TᵀT + diag(w, u))⁻¹ Tᵀ as nn, nt, tt: the identity far inside the cone, 0 at its tip."""
    scale = 0.25 / _determinant(w, u, mu)
    return scale * (mu * mu + w + u), scale * mu * (u - w), scale * mu * mu * (1.0 + w + u)


@njit(cache=True, nogil=True, error_model="numpy")
def _newton(geometry, y, z, q, weight, unbalance, rhs, panels, work, step_y, step_z):
    """Step of v (left in rhs) and of y: (TᵀT + z/y) δy = Tᵀ Aᵀ δv + q, A T δy = unbalance."""
    mu = geometry.mu
    rows, columns = geometry.rows, geometry.columns
    rhs[:] = unbalance
    for c in range(rows.shape[0]):
        w, u = z[c, 0] / y[c, 0], z[c, 1] / y[c, 1]
        scale = 0.5 / _determinant(w, u, mu)
        half = 0.5 * mu * mu
        n = scale * ((half + u) * q[c, 0] + (half + w) * q[c, 1])
        t = scale * mu * ((0.5 + u) * q[c, 0] - (0.5 + w) * q[c, 1])
        for a in range(rows.shape[1]):
            rhs[rows[c, a]] -= columns[c, a, 0] * n + columns[c, a, 1] * t
    solve(geometry.plan, panels, rhs, work)
    for c in range(rows.shape[0]):
        w, u = z[c, 0] / y[c, 0], z[c, 1] / y[c, 1]
        pull_n, pull_t = _pull(geometry, c, rhs)
        p = 0.5 * (pull_n + mu * pull_t) + q[c, 0]
        r = 0.5 * (pull_n - mu * pull_t) + q[c, 1]
        scale = 1.0 / _determinant(w, u, mu)
        off = 0.25 * (1.0 - mu * mu)
        half = 0.5 * mu * mu
        step_y[c, 0] = scale * (off * (p - r) + (half + u) * p)
        step_y[c, 1] = scale * (off * (r - p) + (half + w) * r)


@njit(cache=True, nogil=True, error_model="numpy")
def _room(y, z, step_y, step_z):
    """Longest common step that keeps y and z ≥ 0."""
    length = np.inf
    for c in range(y.shape[0]):
        for a in range(2):
            if step_y[c, a] < 0.0:
                length = min(length, -y[c, a] / step_y[c, a])
            if step_z[c, a] < 0.0:
                length = min(length, -z[c, a] / step_z[c, a])
    return length
