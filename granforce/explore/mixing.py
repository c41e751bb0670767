"""Convergence diagnostics: have chains mixed, and what is their effective sample size?

Rank-normalised split R̂ and effective sample sizes as in Vehtari et al., Bayesian Analysis 16, 667
(2021). They compare chains with each other and cannot see a wrong target. ArviZ gives the same
numbers, one component at a time, which for thousands takes longer than sampling.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
import scipy  # which imports its parts on first use
from scipy import fft
from scipy.special import ndtri

from granforce.fields import derived, record
from granforce.quantities import quantity
from granforce.system import cancelling
from granforce.types import Floats, Mask

# Least number of draws for diagnostics of split chains.
FEWEST_DRAWS = 4
# Quantiles whose effective sample size is that of the tails.
_TAILS = 0.05, 0.95
# Components between two calls of cancel.
_AT_ONCE = 128


@record
class Mixing(NamedTuple):
    """Diagnostics of each component; NaN where it cannot vary or there are too few draws."""

    r_hat: Annotated[
        Floats, quantity("r_hat", label="", note="near 1 if all halves of chains agree")
    ]
    bulk: Annotated[Floats, quantity("bulk_size", label="", note="of the middle")]
    tail: Annotated[Floats, quantity("tail_size", label="", note="of the 5 % and 95 % quantiles")]

    @property
    @derived(quantity("worst_r_hat"))
    def worst_r_hat(self) -> float:
        """Largest R̂, NaN if none is known."""
        return float(np.fmax.reduce(self.r_hat, axis=None, initial=np.nan))

    @property
    @derived(quantity("least_bulk_size"))
    def least_bulk(self) -> float:
        """Smallest bulk effective sample size, NaN if none is known."""
        return float(np.fmin.reduce(self.bulk, axis=None, initial=np.nan))

    @property
    @derived(quantity("least_tail_size"))
    def least_tail(self) -> float:
        """Smallest tail effective sample size, NaN if none is known."""
        return float(np.fmin.reduce(self.tail, axis=None, initial=np.nan))


def mixing(draws: Floats, varies: Mask) -> Mixing:
    """Mixing of draws (chains, draws, …); varies (…): which components vary in the target at all.

    A component that should vary but does not in any chain has R̂ = ∞ and an effective size of 0.
    """
    values = draws[:, :, varies]
    answers = np.full((3, values.shape[2]), np.nan)
    if draws.shape[1] >= FEWEST_DRAWS:
        for first in range(0, values.shape[2], _AT_ONCE):
            cancelling.check("diagnosis")
            some = slice(first, first + _AT_ONCE)
            answers[:, some] = _diagnostics(values[:, :, some])
        stuck = np.all(values == values[:, :1], axis=(0, 1))
        answers[:, stuck] = [[np.inf], [0.0], [0.0]]
    full = np.full((3, *varies.shape), np.nan)
    full[:, varies] = answers
    return Mixing(*full)


def _diagnostics(x: Floats) -> Floats:
    """R̂, bulk and tail effective sample size (3, k) of draws x (chains, draws, k)."""
    halves = _halves(x)
    folded = np.abs(halves - np.median(halves, axis=(1, 2), keepdims=True))
    scores, folded = _scores(halves), _scores(folded)
    r_hat = np.maximum(_spread_ratio(scores), _spread_ratio(folded))
    quantiles = np.quantile(x, _TAILS, axis=(0, 1))
    tails = [_effective(_halves(x <= quantile).astype(float)) for quantile in quantiles]
    return np.stack([r_hat, _effective(scores), np.minimum(*tails)])


def _halves(x: Floats) -> Floats:
    """(k, 2 chains, half of the draws) of (chains, draws, k); an odd middle draw is dropped."""
    half = x.shape[1] // 2
    return np.ascontiguousarray(np.moveaxis(np.concatenate([x[:, :half], x[:, -half:]]), 2, 0))


def _scores(x: Floats) -> Floats:
    """Normal scores of the ranks of each component's draws, by Blom."""
    flat = x.reshape(len(x), -1)
    return ndtri((scipy.stats.rankdata(flat, axis=1) - 0.375) / (flat.shape[1] + 0.25)).reshape(
        x.shape
    )


def _spread_ratio(x: Floats) -> Floats:
    """√(total variance over that within chains)."""
    n = x.shape[2]
    between = n * x.mean(axis=2).var(axis=1, ddof=1)
    within = x.var(axis=2, ddof=1).mean(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sqrt((between / within + n - 1) / n)


def _effective(x: Floats) -> Floats:
    """Effective sample size (k,) by Geyer's initial monotone sequence of pairs of correlations."""
    components, chains, n = x.shape
    off = x - x.mean(axis=2, keepdims=True)
    padded = fft.next_fast_len(2 * n, real=True)
    power = np.abs(fft.rfft(off, padded, axis=2)) ** 2
    covariance = fft.irfft(power.mean(axis=1), padded, axis=1)[:, :n] / n
    within = covariance[:, 0] * n / (n - 1)
    total = covariance[:, 0] + x.mean(axis=2).var(axis=1, ddof=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = 1 - (within[:, None] - covariance) / total[:, None]
    correlation[:, 0] = 1.0
    last = max(0, (n - 1) // 2 - 1)
    even, odd = correlation[:, 0 : 2 * last + 1 : 2], correlation[:, 1 : 2 * last + 2 : 2]
    pairs = even + odd
    # The sum ends at the first pair that is not positive.
    ended = pairs <= 0
    end = np.where(ended.any(axis=1), ended.argmax(axis=1), last)
    each = np.arange(components)
    summed = np.cumsum(np.minimum.accumulate(pairs, axis=1), axis=1)
    before = np.where(end > 0, summed[each, end - 1], 0.0)
    rest = np.where(pairs[each, end] < 0, np.maximum(even[each, end], 0.0), even[each, end])
    size = chains * n
    effective = size / np.maximum(2 * before + rest - 1, 1 / np.log10(size))
    return np.where(np.ptp(x, axis=(1, 2)) < np.finfo(float).resolution, size, effective)
