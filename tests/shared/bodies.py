"""Bodies {y ≥ 0 : A y = b} whose uniform distribution is known, and a harness that judges draws.

Every body is an affine image of the textbook one: rows of A are mixed at random and every
coordinate has a scale of its own, spread over four decades where `skew` is set.
"""

from typing import NamedTuple

import numpy as np
from arviz_stats.base import array_stats
from scipy import linalg, sparse, spatial, stats

from granforce.explore.billiard import BLOCK


class Body(NamedTuple):
    A: sparse.csc_matrix  # (rows, n)
    b: np.ndarray  # (rows,)
    dimension: int
    mean: np.ndarray  # (n,)
    variance: np.ndarray  # (n,)
    kurtosis: np.ndarray  # (n,) fourth central moment over the square of the variance
    marginal: list  # n distribution functions, or empty where they are not known


def _skewed(A, b, dimension, mean, variance, kurtosis, marginal, skew, seed=0):
    rng = np.random.default_rng(seed)
    n, rows = A.shape[1], A.shape[0]
    scale = 10 ** rng.uniform(-2, 2, n) if skew else np.ones(n)
    mix = rng.normal(size=(rows, rows)) + 2 * np.sqrt(rows) * np.eye(rows) if skew else np.eye(rows)
    marginal = [_stretched(cdf, c) for cdf, c in zip(marginal, scale, strict=bool(marginal))]
    mixed = sparse.csc_matrix(mix @ (A / scale))
    return Body(mixed, mix @ b, dimension, scale * mean, scale**2 * variance, kurtosis, marginal)


def _stretched(cdf, scale):
    return lambda y: cdf(y / scale)


def simplex(d, skew=False):
    """Σ y = 1 in d + 1 coordinates: each is Beta(1, d)."""
    one = stats.beta(1, d)
    n = d + 1
    moments = (np.full(n, v) for v in (one.mean(), one.var(), one.stats("k") + 3))
    return _skewed(np.ones((1, n)), np.ones(1), d, *moments, [one.cdf] * n, skew)


def box(d, skew=False):
    """The unit cube with the slacks of its upper walls: all uniform in [0, 1]."""
    A = np.hstack([np.eye(d), np.eye(d)])
    moments = (np.full(2 * d, v) for v in (0.5, 1 / 12, 9 / 5))
    return _skewed(A, np.ones(d), d, *moments, [stats.uniform.cdf] * (2 * d), skew)


def product(sizes, skew=False):
    """Simplices side by side."""
    parts = [simplex(d) for d in sizes]
    A = linalg.block_diag(*[part.A.toarray() for part in parts])
    b, *moments = (np.concatenate([part[k] for part in parts]) for k in (1, 3, 4, 5))
    marginal = [cdf for part in parts for cdf in part.marginal]
    return _skewed(A, b, sum(sizes), *moments, marginal, skew)


def cross_polytope(d, skew=False):
    """Σ |x_i| ≤ 1 by its 2^d walls, y = 1 − s·x with signs s; |x| is Dirichlet(1, …, 1)."""
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * d)).reshape(d, -1).T
    A = linalg.null_space(signs.T).T
    n = len(signs)
    variance = 2 * d / ((d + 1) * (d + 2))
    fourth = 12 * d * (d + 1) / ((d + 1) * (d + 2) * (d + 3) * (d + 4))
    moments = (np.full(n, v) for v in (1.0, variance, fourth / variance**2))
    return _skewed(A, A @ np.ones(n), d, *moments, [], skew)


class BodyWalls:
    """A body as samplers take it, in place of the `Walls` of an ensemble: K as it is written."""

    def __init__(self, body, W=None, d=None):
        """W (k, n), d (k,): weighted with exp(−½ |W y − d|²)."""
        self.dimension = body.dimension
        self.moving = np.arange(len(body.mean))
        self.count = len(self.moving) + -len(self.moving) % BLOCK
        null = linalg.null_space(body.A.toarray(), rcond=1e-9)
        self.centre = body.mean if W is None else _centre(body.mean, null, W.toarray(), d)
        relative = np.zeros((self.count, self.dimension))
        relative[: len(null)] = null / self.centre[:, None]
        W = np.zeros((0, len(null))) if W is None else W.toarray()
        slopes = np.vstack([relative, W @ null])
        # B and W on an orthonormal basis of what balance leaves, rounded as both together are.
        rounded = relative @ np.linalg.inv(np.linalg.qr(slopes, mode="r"))
        measured = (W @ null) @ np.linalg.inv(np.linalg.qr(slopes, mode="r"))
        self.K, self.pushed = rounded @ rounded.T, rounded @ measured.T
        self.pull = np.zeros(0) if d is None else d - W @ self.centre
        self.pulls = sparse.identity(len(W), format="csr")
        basis = np.linalg.qr(relative)[0]
        self.hull = basis @ basis.T

    def rows(self, walls):
        return self.K[walls]

    def moved(self, g, pulls=None):
        return g @ self.K + (0.0 if pulls is None else pulls @ self.pushed.T)

    def on_hull(self, slacks):
        return 1.0 + (slacks - 1.0) @ self.hull

    def points(self, slacks):
        return self.centre * np.maximum(slacks[..., : len(self.centre)], 0.0)


def _centre(y, null, W, d):
    """The y with the largest Σ log y − ½ |W y − d|² among y + null · z, by damped Newton steps."""
    for _ in range(500):
        scaled, pulled = null / y[:, None], W @ null
        slope = scaled.sum(axis=0) + pulled.T @ (d - W @ y)
        relative = scaled @ np.linalg.solve(scaled.T @ scaled + pulled.T @ pulled, slope)
        y = y * (1 + relative / (1 + np.linalg.norm(relative)))
    return y


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


def z_scores(draws, mean, variance, kurtosis):
    """z-scores (k,) of the means and of the second moments of draws (chains, states, k).

    Both against the known values, in known standard deviations: those of the draws would lean
    with their means. What the draws are worth is their own effective sample size.
    """
    scaled = (draws - mean) / np.sqrt(variance)
    squares = (scaled**2 - 1) / np.sqrt(kurtosis - 1)
    return [values.mean(axis=(0, 1)) * np.sqrt(worth(values)) for values in (scaled, squares)]


def worth(draws):
    """How many independent draws the mean of each component (k,) is worth."""
    return array_stats.ess(draws, chain_axis=0, draw_axis=1, method="mean")


def distance_to_marginals(draws, marginal):
    """Kolmogorov's √n D of each coordinate, n its effective sample size."""
    flat = draws.reshape(-1, draws.shape[2])
    distance = [stats.kstest(flat[:, k], cdf).statistic for k, cdf in enumerate(marginal)]
    return np.sqrt(worth(draws)) * np.array(distance)
