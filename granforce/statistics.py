"""Statistics over packings: means with intervals, bootstraps, the tail of a distribution."""

import numpy as np
from scipy import optimize, stats

LEVEL = 0.95  # of every confidence interval
RESAMPLES = 999


def mean_interval(values):
    """Mean and its confidence interval (Student's t): (mean, low, high); NaN where unknown.

    values: one number per packing; NaN are left out. One packing has no interval.
    """
    values = _finite(values)
    if not len(values):
        return (float("nan"),) * 3
    mean = float(values.mean())
    if len(values) < 2:
        return mean, float("nan"), float("nan")
    reach = stats.t.ppf((1 + LEVEL) / 2, len(values) - 1) * stats.sem(values)
    return mean, float(mean - reach), float(mean + reach)


def grouped(rows, name, by="mu"):
    """{μ: array of the values of one name over packings}, in order of μ; NaN left out.

    rows: dicts with μ (or what else to group by) and the name; rows without it are passed over.
    """
    found = {}
    for row in rows:
        value = row.get(name)
        if value is not None and np.isfinite(value):
            found.setdefault(row[by], []).append(value)
    return {key: np.array(found[key]) for key in sorted(found)}


def means(rows, name, by="mu", factor=1.0):
    """Points [(μ, mean, standard error over packings)] of one name, times a factor."""
    points = []
    for key, values in grouped(rows, name, by).items():
        error = values.std(ddof=1) / np.sqrt(len(values)) if len(values) > 1 else 0.0
        points.append((key, factor * values.mean(), factor * error))
    return points


def bootstrap(statistic, groups, seed=0, resamples=RESAMPLES):
    """(value, low, high) of statistic(*groups) with a percentile interval.

    groups: sequences, one item per packing; each group is resampled on its own. Groups of one
    packing do not vary; where all are such there is no interval (NaN). The result is a function of
    the seed.
    """
    rng = np.random.default_rng(seed)
    groups = [list(group) for group in groups]
    if max(map(len, groups)) < 2:
        return float(statistic(*groups)), float("nan"), float("nan")
    drawn = np.empty(resamples)
    for k in range(resamples):
        chosen = [rng.integers(len(group), size=len(group)) for group in groups]
        drawn[k] = statistic(*([g[i] for i in c] for g, c in zip(groups, chosen, strict=True)))
    if not np.isfinite(drawn).any():
        return float(statistic(*groups)), float("nan"), float("nan")
    tails = 100 * (1 - LEVEL) / 2
    low, high = np.nanpercentile(drawn, [tails, 100 - tails])
    return float(statistic(*groups)), float(low), float(high)


def density(values, edges):
    """Probability density of values in the bins of edges; values outside count in the norm."""
    counts = np.histogram(values, edges)[0]
    return counts / (len(values) * np.diff(edges))


def tail_exponent(values, quantile=0.5):
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

    def minus_likelihood(log_b):
        b = np.exp(log_b)
        excess = np.expm1(b * logs).sum()
        return np.log(excess) - log_b - b * logs.mean()

    found = optimize.minimize_scalar(minus_likelihood, bounds=np.log([0.02, 50]), method="bounded")
    return float(np.exp(found.x))


def _finite(values):
    values = np.asarray(list(values), float)
    return values[np.isfinite(values)]
