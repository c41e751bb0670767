"""Bodies {y ≥ 0 : A y = b} whose uniform distribution is known, and a harness that judges draws.

Every body is an affine image of the textbook one: rows of A are mixed at random and every
coordinate has a scale of its own, spread over four decades where `skew` is set.
"""

from typing import NamedTuple

import numpy as np
from scipy import linalg, sparse, spatial, stats

from granforce.diagnostics import mixing


class Body(NamedTuple):
    A: sparse.csc_matrix  # (rows, n)
    b: np.ndarray  # (rows,)
    dimension: int
    mean: np.ndarray  # (n,)
    variance: np.ndarray  # (n,) 0 for coordinates that are the same in all of the body
    marginal: list  # n distribution functions, or empty where they are not known


def _skewed(A, b, dimension, mean, variance, marginal, skew, seed=0):
    rng = np.random.default_rng(seed)
    n, rows = A.shape[1], A.shape[0]
    scale = 10 ** rng.uniform(-2, 2, n) if skew else np.ones(n)
    mix = rng.normal(size=(rows, rows)) + 2 * np.sqrt(rows) * np.eye(rows) if skew else np.eye(rows)
    marginal = [_stretched(cdf, c) for cdf, c in zip(marginal, scale, strict=bool(marginal))]
    mixed = sparse.csc_matrix(mix @ (A / scale))
    return Body(mixed, mix @ b, dimension, scale * mean, scale**2 * variance, marginal)


def _stretched(cdf, scale):
    return lambda y: cdf(y / scale)


def simplex(d, skew=False):
    """Σ y = 1 in d + 1 coordinates: each is Beta(1, d)."""
    one = stats.beta(1, d)
    n = d + 1
    moments = np.full(n, one.mean()), np.full(n, one.var())
    return _skewed(np.ones((1, n)), np.ones(1), d, *moments, [one.cdf] * n, skew)


def box(d, skew=False):
    """The unit cube with the slacks of its upper walls: all uniform in [0, 1]."""
    A = np.hstack([np.eye(d), np.eye(d)])
    moments = np.full(2 * d, 0.5), np.full(2 * d, 1 / 12)
    return _skewed(A, np.ones(d), d, *moments, [stats.uniform.cdf] * (2 * d), skew)


def product(sizes, skew=False):
    """Simplices side by side."""
    parts = [simplex(d) for d in sizes]
    A = linalg.block_diag(*[part.A.toarray() for part in parts])
    joined = [np.concatenate([part[k] for part in parts]) for k in (1, 3, 4)]
    marginal = [cdf for part in parts for cdf in part.marginal]
    return _skewed(A, joined[0], sum(sizes), joined[1], joined[2], marginal, skew)


def cross_polytope(d, skew=False):
    """Σ |x_i| ≤ 1 by its 2^d walls, y = 1 − s·x with signs s; Var x_i = 2/((d + 1)(d + 2))."""
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * d)).reshape(d, -1).T
    A = linalg.null_space(signs.T).T
    n = len(signs)
    variance = 2 * d / ((d + 1) * (d + 2))
    return _skewed(A, A @ np.ones(n), d, np.ones(n), np.full(n, variance), [], skew)


def known_by_triangulation(A, b, inside):
    """(mean, covariance) of {y ≥ 0 : A y = b} of low dimension, exactly; inside: a point y > 0."""
    null = linalg.null_space(A.toarray(), rcond=1e-9)
    walls = np.column_stack([-null, -inside])
    corners = spatial.HalfspaceIntersection(walls, np.zeros(null.shape[1])).intersections
    cells = corners[spatial.Delaunay(corners).simplices]  # (cells, h + 1, h)
    weight = np.abs(np.linalg.det(cells[:, 1:] - cells[:, :1]))
    weight /= weight.sum()
    h = null.shape[1]
    middle = cells.mean(axis=1)
    mean = weight @ middle
    # Second moments of a simplex: (Σ v vᵀ + (h + 1)² m mᵀ)/((h + 1)(h + 2)).
    outer = np.einsum("cvi,cvj->cij", cells, cells)
    outer += (h + 1) ** 2 * np.einsum("ci,cj->cij", middle, middle)
    second = np.einsum("c,cij->ij", weight, outer) / ((h + 1) * (h + 2))
    covariance = second - np.outer(mean, mean)
    return inside + null @ mean, null @ covariance @ null.T


def z_scores(draws, mean, variance):
    """z-scores (k,) of the means and of the second moments of draws (chains, states, k).

    Both against the known values, in standard errors from the draws' own effective sample size.
    """
    everything = np.ones(draws.shape[2], dtype=bool)
    scaled = (draws - mean) / np.sqrt(variance)
    scores = []
    for values, spread in ((scaled, 1.0), (scaled**2 - 1, None)):
        spread = values.std(axis=(0, 1)) if spread is None else spread
        effective = mixing(values, everything).bulk
        scores.append(values.mean(axis=(0, 1)) / spread * np.sqrt(effective))
    return scores


def distance_to_marginals(draws, marginal):
    """Kolmogorov's √n D of each coordinate, n its effective sample size."""
    effective = mixing(draws, np.ones(draws.shape[2], dtype=bool)).bulk
    flat = draws.reshape(-1, draws.shape[2])
    distance = [stats.kstest(flat[:, k], cdf).statistic for k, cdf in enumerate(marginal)]
    return np.sqrt(effective) * np.array(distance)
