"""Statistics over packings: means, intervals, bootstraps, and the shape of distributions."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from typing import Any, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt
import pandas as pd
import scipy  # which imports its parts on first use

from granforce.types import Floats

T = TypeVar("T")
Table: TypeAlias = pd.DataFrame | Sequence[Mapping[str, Any]]  # or rows as dicts

LEVEL = 0.95  # of every confidence interval
RESAMPLES = 999


def mean_interval(values: Iterable[float], level: float = LEVEL) -> tuple[float, float, float]:
    """Mean and its confidence interval (Student's t): (mean, low, high); NaN where unknown.

    values: one number per packing; NaN are left out. A single packing has no interval.
    """
    values = _finite(values)
    if not len(values):
        return (float("nan"),) * 3
    mean = float(values.mean())
    if len(values) < 2:
        return mean, float("nan"), float("nan")
    reach = scipy.stats.t.ppf((1 + level) / 2, len(values) - 1) * scipy.stats.sem(values)
    return mean, float(mean - reach), float(mean + reach)


def difference_interval(
    values: Floats, others: Floats, level: float = LEVEL
) -> tuple[float, float, float]:
    """Mean of values minus that of others, (difference, low, high), by Welch's t.

    At least two values each.
    """
    difference = float(values.mean() - others.mean())
    counts = np.array([len(values), len(others)])
    squares = np.array([values.var(ddof=1), others.var(ddof=1)]) / counts
    if not squares.any():
        return difference, difference, difference
    freedom = squares.sum() ** 2 / (squares**2 / (counts - 1)).sum()
    reach = float(scipy.stats.t.ppf((1 + level) / 2, freedom) * np.sqrt(squares.sum()))
    return difference, difference - reach, difference + reach


def jackknife(
    statistic: Callable[[list[T]], float], items: Iterable[T], level: float = LEVEL
) -> tuple[float, float, float]:
    """(value, low, high) of statistic(items), by leaving out each item once (Student's t).

    items: one per packing. The interval depends on the data alone, and requires a statistic that
    changes little with any one item. A single item has no interval (NaN).
    """
    items = list(items)
    value = float(statistic(items))
    reach = scipy.stats.t.ppf((1 + level) / 2, max(1, len(items) - 1)) * jackknife_error(
        statistic, items
    )
    return value, float(value - reach), float(value + reach)


def jackknife_error(statistic: Callable[[list[T]], float], items: Sequence[T]) -> float:
    """Standard error of statistic(items), by leaving out each item once; NaN for one item."""
    items, count = list(items), len(items)
    if count < 2:
        return float("nan")
    without = np.array([statistic(items[:k] + items[k + 1 :]) for k in range(count)])
    return float(np.sqrt((count - 1) * without.var()))


def stratified_interval(groups: Iterable[Iterable[float]]) -> tuple[float, float, float]:
    """Mean of the means of several groups and its interval: (mean, low, high).

    Differences between groups, such as a trend with μ, are not part of the error. The degrees of
    freedom are Welch's and Satterthwaite's. groups: one number per packing; a group of a single
    packing leaves no interval.
    """
    arrays = [values for values in map(_finite, groups) if len(values)]
    if not arrays:
        return (float("nan"),) * 3
    mean = float(np.mean([values.mean() for values in arrays]))
    if min(map(len, arrays)) < 2:
        return mean, float("nan"), float("nan")
    squares = np.array([values.var(ddof=1) / len(values) for values in arrays]) / len(arrays) ** 2
    if not squares.any():
        return mean, mean, mean
    freedom = squares.sum() ** 2 / np.sum(squares**2 / [len(values) - 1 for values in arrays])
    reach = float(scipy.stats.t.ppf((1 + LEVEL) / 2, freedom) * np.sqrt(squares.sum()))
    return mean, mean - reach, mean + reach


def grouped(rows: Table, name: str, by: str = "mu") -> dict[float, Floats]:
    """{μ: array of the values of one name over packings}, in order of μ, without NaN.

    rows: a table, or dicts, with μ (or another key to group by); rows without the name are skipped.
    """
    table = pd.DataFrame(rows)
    if name not in table:
        return {}
    values = table[name].astype(float)
    known = values[np.isfinite(values)]
    return {key: group.to_numpy() for key, group in known.groupby(table[by])}


def paired(rows: Table, others: Table) -> pd.DataFrame:
    """Rows with a match of the same μ and seed among the others, whose columns end in "_other"."""
    others = pd.DataFrame(others).add_suffix("_other")
    on = ["mu", "seed"], ["mu_other", "seed_other"]
    return pd.DataFrame(rows).merge(others, left_on=on[0], right_on=on[1])


def means(
    rows: Table, name: str, by: str = "mu", factor: float = 1.0
) -> list[tuple[float, float, float]]:
    """Points [(μ, mean, standard error over packings)] of one name, times a factor."""
    points = []
    for key, values in grouped(rows, name, by).items():
        error = values.std(ddof=1) / np.sqrt(len(values)) if len(values) > 1 else 0.0
        points.append((key, factor * values.mean(), factor * error))
    return points


def bootstrap(
    statistic: Callable[..., float], groups: Sequence[Sequence[Any] | Floats]
) -> tuple[float, float, float]:
    """(value, low, high) of statistic(*groups) with a percentile interval.

    groups: sequences, one item per packing; each group is resampled separately. Groups of one
    packing do not vary; if all groups are such there is no interval (NaN). The resampling is always
    the same.
    """
    rng = np.random.default_rng(0)
    groups = [list(group) for group in groups]
    if max(len(group) for group in groups) < 2:
        return float(statistic(*groups)), float("nan"), float("nan")
    drawn = np.empty(RESAMPLES)
    for k in range(RESAMPLES):
        chosen = [rng.integers(len(group), size=len(group)) for group in groups]
        drawn[k] = statistic(*([g[i] for i in c] for g, c in zip(groups, chosen, strict=True)))
    if not np.isfinite(drawn).any():
        return float(statistic(*groups)), float("nan"), float("nan")
    tails = 100 * (1 - LEVEL) / 2
    low, high = np.nanpercentile(drawn, [tails, 100 - tails])
    return float(statistic(*groups)), float(low), float(high)


def drawn_means(groups: Sequence[npt.ArrayLike], draws: int = RESAMPLES) -> Floats:
    """Means (draws, groups, …) that the values of some packings leave possible, by Student's t.

    groups: arrays (n, …), one item per packing. A mean is drawn as m + (s/√n) T, with mean m and
    standard deviation s of its group and T from Student's distribution with n − 1 degrees of
    freedom; the components of an item are drawn jointly. The percentiles of one mean are those of
    `mean_interval`, while resampled packings (a bootstrap) would give intervals that are too short
    for few of them. The mean of a single packing does not vary.
    """
    rng = np.random.default_rng(0)
    drawn = []
    for group in map(np.asarray, groups):
        count, mean = len(group), group.mean(axis=0)
        freedom = max(1, count - 1)
        apart = (group - mean).reshape(count, -1) / np.sqrt(count * freedom)
        scale = np.sqrt(rng.chisquare(freedom, draws) / freedom)
        offset = rng.standard_normal((draws, count)) @ apart / scale[:, None]
        drawn.append(mean + offset.reshape(draws, *group.shape[1:]))
    return np.stack(drawn, axis=1)


def percentile_interval(drawn: Floats, level: float = LEVEL) -> tuple[float, float]:
    """The ends (low, high) of the middle part of draws."""
    tail = 50 * (1 - level)
    low, high = np.percentile(drawn, [tail, 100 - tail])
    return float(low), float(high)


def rank_correlation(x: npt.ArrayLike, y: npt.ArrayLike) -> float:
    """Spearman's rank correlation; ties share their rank. NaN if one of them does not vary."""
    ranks = scipy.stats.rankdata(x), scipy.stats.rankdata(y)
    if min(map(np.ptp, ranks)) == 0:
        return float("nan")
    return float(np.corrcoef(*ranks)[0, 1])


def density(values: Floats, edges: Floats) -> Floats:
    """Probability density of values in the bins of edges; outside values count in the norm."""
    counts = np.histogram(values, edges)[0]
    return counts / (len(values) * np.diff(edges))


def departure(values: npt.ArrayLike) -> float:
    """Departure of a density on x ≥ 0 from one that falls everywhere: sup of Ĉ − F over x.

    F is the distribution function of the values (n,), Ĉ its least concave majorant, whose slope is
    Grenander's estimate of a density that never rises (Skand. Aktuarietidskr. 39, 125 (1956)). It
    is the fraction of the values that are too far right for such a density, and equals Hartigan's
    dip (Ann. Stat. 13, 70 (1985)) with the mode fixed at 0. It needs no bins and does not depend on
    the unit; it is 0.002 for 20,000 numbers from an exponential distribution, 0.05 and 0.11 for
    Weibull distributions with exponents 1.5 and 2.
    """
    at, count = np.unique(np.asarray(values, float), return_counts=True)
    if at[0] > 0:
        at, count = np.r_[0.0, at], np.r_[0, count]
    below = np.cumsum(count) / count.sum()
    gap = np.diff(at)
    slope = scipy.optimize.isotonic_regression(
        np.diff(below) / gap, weights=gap, increasing=False
    ).x
    majorant = below[0] + np.r_[0.0, np.cumsum(slope * gap)]
    # F is lowest just before it rises.
    return float((majorant[1:] - below[:-1]).max(initial=0.0))


def chance_departure(number: float, level: float = LEVEL) -> float:
    """The departure that this many values of a falling density exceed in 1 − level of cases.

    The uniform density is closest to rising, so it is the null; the distribution of √n times its
    departure is simulated once.
    """
    return float(np.quantile(_uniform_departures(), level) / np.sqrt(number))


@cache
def _uniform_departures(size: int = 1000, repeats: int = 4999) -> Floats:
    rng = np.random.default_rng(0)
    return np.sqrt(size) * np.array([departure(rng.random(size)) for _ in range(repeats)])


def effective_number(groups: Sequence[Sequence[float] | Floats]) -> float:
    """Effective number of independent values for F, of groups of values, one per packing.

    It is based on the variance of F over packings at its deciles, compared with that of as many
    independent values: values of one packing are correlated, and packings differ.
    """
    joined = np.concatenate(groups)
    if len(groups) < 2:
        return float("nan")
    part = np.arange(1, 10) / 10
    at = np.quantile(joined, part)
    below = np.array([(np.asarray(group)[:, None] <= at).mean(axis=0) for group in groups])
    size = np.mean([len(group) for group in groups])
    excess = (below.var(axis=0, ddof=1) * size / (part * (1 - part))).mean()
    return len(joined) / max(1.0, float(excess))


def decay_misfits(r: Floats, u: Floats) -> tuple[float, float]:
    """Root mean square misfit of ln u (k,) at distances r (k,) to a power law and an exponential.

    NaN for fewer than three distances.
    """
    if len(r) < 3:
        return float("nan"), float("nan")
    y = np.log(u)
    power, exponential = (np.std(y - np.polyval(np.polyfit(x, y, 1), x)) for x in (np.log(r), r))
    return float(power), float(exponential)


def tail_exponent(values: npt.ArrayLike, quantile: float = 0.5) -> float:
    """Exponent b of P(X > x) ∝ exp(−(λ x)^b) beyond a quantile, by maximum likelihood.

    b = 1 is an exponential tail, b > 1 falls faster, b < 1 slower. The likelihood is that of a
    Weibull distribution truncated from the left at u: with n values x > u its maximum over λ is at
    λ^b = n / Σ(x^b − u^b), which leaves one unknown. NaN for fewer than 10 values.
    """
    values = np.asarray(values, float)
    start = np.quantile(values, quantile) if len(values) else 0.0
    tail = values[values > start] / (start or 1.0)
    if len(tail) < 10 or start <= 0:
        return float("nan")
    logs = np.log(tail)

    def minus_likelihood(log_b: float) -> float:
        b = np.exp(log_b)
        excess = np.expm1(b * logs).sum()
        return np.log(excess) - log_b - b * logs.mean()

    optimum = scipy.optimize.minimize_scalar(
        minus_likelihood, bounds=np.log([0.02, 50]), method="bounded"
    )
    return float(np.exp(optimum.x))


def _finite(values: Iterable[float]) -> Floats:
    values = np.asarray(list(values), float)
    return values[np.isfinite(values)]
