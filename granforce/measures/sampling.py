"""Sampling of η: its standard error, whether states have mixed, and their effective size.

All are computed from the states alone, in the order in which they were drawn. η is a sum over
contacts, so the diagnostics also sum variances and covariances over all components: the extreme of
thousands of single components would indicate "not mixed" for independent states.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from scipy import fft

from granforce.measures import statistics
from granforce.measures.states import networks
from granforce.types import Floats

BLOCKS = 10  # runs of consecutive states, left out one at a time
MIXED = 1.1  # largest R̂ of states that have mixed
FEWEST = 2 * BLOCKS  # effective states below which blocks depend on each other

Moments = tuple[int, Floats, Floats]  # number of states, sum (N_c, 2), sum of squares (N_c,)


class Sampling(NamedTuple):
    """Reliability of states; NaN if there are too few."""

    eta1_error: float  # standard error of η1, by leaving out each block once
    eta2_error: float  # the same for η2
    r_hat: float  # √(variance of all states / that within either half), summed over components
    effective: float  # equivalent number of independent states
    states: int  # number of states

    @property
    def mixed(self) -> bool:
        """Whether both halves agree, and blocks are long enough for the errors to be valid."""
        return self.r_hat <= MIXED and self.effective >= FEWEST


def sampling(states: Floats) -> Sampling:
    """Sampling of consecutive states of one chain.

    Parameters
    ----------
    states : (S, N_c, 2) array
        Force networks (f_n, f_t).

    Returns
    -------
    Sampling
        NaN if there are too few states.
    """
    states = networks(states)
    count = len(states)
    if count < FEWEST:
        return Sampling(np.nan, np.nan, np.nan, np.nan, count)
    mean = states.mean(axis=0, dtype=float)
    off = np.subtract(states, mean, dtype=float)
    blocks = [_moments(block) for block in np.array_split(off, BLOCKS)]
    return Sampling(
        eta1_error=statistics.jackknife_error(partial(_eta1, mean), blocks),
        eta2_error=statistics.jackknife_error(partial(_eta2, mean), blocks),
        r_hat=_r_hat(off),
        effective=_effective(off),
        states=count,
    )


def _moments(off: Floats) -> Moments:
    return len(off), off.sum(axis=0), (off**2).sum(axis=(0, 2))


def _joined(origin: Floats, blocks: list[Moments]) -> tuple[int, Floats, Floats]:
    """Number of states, their mean (N_c, 2) and variance (N_c,)."""
    count = sum(number for number, _, _ in blocks)
    shift = np.sum([total for _, total, _ in blocks], axis=0) / count
    square = np.sum([total for _, _, total in blocks], axis=0) / count
    return count, origin + shift, np.maximum(0.0, square - (shift**2).sum(axis=1))


def _eta1(origin: Floats, blocks: list[Moments]) -> float:
    _, mean, variance = _joined(origin, blocks)
    return float(np.sqrt(variance).mean() / np.linalg.norm(mean, axis=1).mean())


def _eta2(origin: Floats, blocks: list[Moments]) -> float:
    count, mean, variance = _joined(origin, blocks)
    return float(np.sqrt(2 * count / (count - 1) * variance.sum() / (mean**2).sum()))


def _r_hat(off: Floats) -> float:
    """Gelman and Rubin's R̂ of the halves of a chain, variances summed over components."""
    half = len(off) // 2
    halves = np.stack([off[:half], off[-half:]])
    within = halves.var(axis=1, ddof=1).mean(axis=0).sum()
    between = halves.mean(axis=1).var(axis=0, ddof=1).sum()
    if within <= 0:
        return float(np.inf if between > 0 else np.nan)
    return float(np.sqrt((half - 1) / half + between / within))


def _effective(off: Floats) -> float:
    """S/τ, at most S, with τ the autocorrelation time summed over components.

    The sum over lags ends before the first pair of lags that is not positive (Geyer).
    """
    count = len(off)
    power = np.abs(fft.rfft(off.reshape(count, -1), fft.next_fast_len(2 * count), axis=0)) ** 2
    covariance = fft.irfft(power.sum(axis=1), fft.next_fast_len(2 * count))[:count]
    if covariance[0] <= 0:
        return float("nan")
    correlation = covariance[: 2 * (count // 2)] / covariance[0]
    pairs = correlation[::2] + correlation[1::2]
    ended = np.flatnonzero(pairs <= 0)
    time = 2 * pairs[: ended[0] if len(ended) else None].sum() - 1
    return count / max(1.0, float(time))
