"""Have chains mixed, and how many independent states are they worth? By ArviZ.

Rank-normalised split R̂ and effective sample sizes as in Vehtari et al., Bayesian Analysis 16, 667
(2021). They compare chains with each other and cannot see a wrong target.
"""

from importlib import import_module
from typing import NamedTuple

import numpy as np

from granforce.system import cancelling

# Split chains of fewer draws say nothing.
FEWEST_DRAWS = 4
# Quantiles whose effective sample size is that of the tails.
_TAILS = 0.05, 0.95
# Components between two askings of cancel.
_AT_ONCE = 32


class Mixing(NamedTuple):
    """Diagnostics of each component; NaN where it cannot vary or there are too few draws."""

    r_hat: np.ndarray  # (…) split R̂, near 1 where all halves of all chains agree
    bulk: np.ndarray  # (…) effective sample size for the middle of the distribution
    tail: np.ndarray  # (…) effective sample size for its 5 % and 95 % quantiles

    @property
    def worst_r_hat(self):
        """Largest R̂, NaN where none is known."""
        return _over(np.max, self.r_hat)

    @property
    def least_bulk(self):
        """Smallest bulk effective sample size, NaN where none is known."""
        return _over(np.min, self.bulk)

    @property
    def least_tail(self):
        """Smallest tail effective sample size, NaN where none is known."""
        return _over(np.min, self.tail)


def mixing(draws, varies):
    """Mixing of draws (chains, draws, …); varies (…): which components vary in the target at all.

    A component that should vary, and does not in any chain, has R̂ = ∞ and is worth nothing.
    """
    values = draws[:, :, varies]
    answers = np.full((3, values.shape[2]), np.nan)
    if draws.shape[1] >= FEWEST_DRAWS:
        stuck = np.all(values == values[:, :1], axis=(0, 1))
        answers[:, stuck] = [[np.inf], [0.0], [0.0]]
        if not stuck.all():
            answers[:, ~stuck] = _by_arviz(values[:, :, ~stuck])
    full = np.full((3, *varies.shape), np.nan)
    full[:, varies] = answers
    return Mixing(*full)


def _by_arviz(values):
    # The import takes seconds, and not every command needs it.
    array_stats = cancelling.apart(import_module, "arviz_stats.base").array_stats
    axes = {"chain_axis": 0, "draw_axis": 1}
    parts = []
    for first in range(0, values.shape[2], _AT_ONCE):
        cancelling.check("diagnosis")
        part = values[:, :, first : first + _AT_ONCE]
        bulk = array_stats.ess(part, method="bulk", **axes)
        tail = array_stats.ess(part, method="tail", prob=_TAILS, **axes)
        parts.append([array_stats.rhat(part, **axes), bulk, tail])
    return np.concatenate(parts, axis=1)


def _over(choose, values):
    known = values[~np.isnan(values)]
    return float(choose(known)) if known.size else float("nan")
