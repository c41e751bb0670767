"""How a claim is judged: its cases, each a number with an interval, and the range that it states.

A claim has one case, or several: one for each μ of a range, or for each of η1, η2 and η3. It is
"reproduced" if the 95 % interval of every case is in its range. This needs no correction for the
number of cases, as all of them must hold. It is "contradicted" if the interval of some case, made
wider for their number (Bonferroni), is entirely outside its range; otherwise it is "undecided". The
interval that is shown is the one that counts: 95 % if it is in the range, else the wider one.
Nothing else changes a verdict, except that a claim about μ ≥ 1 must not be reproduced in one
preparation and contradicted in another (`judge` in this folder).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from granforce.measures import statistics
from granforce.paper.claims.groups import Ends, Groups
from granforce.types import Floats

REPRODUCED, UNDECIDED, CONTRADICTED = "reproduced", "undecided", "contradicted"
DEPENDS = "depends on the preparation"
FEW, MISSING = "too few data", "no data"
# Verdict → its symbol in tables.
SYMBOLS = {REPRODUCED: "✓", CONTRADICTED: "✗", DEPENDS: "⇄", UNDECIDED: "?", FEW: "…", MISSING: "–"}

LEAST_DISKS = 1000  # in all packings of one μ
NEAR_PEAK = 2.0  # in μ: means within this factor of the largest determine the maximum
ANY, FRACTION = (-np.inf, np.inf), (0.0, 1.0)

Interval = Callable[[float], tuple[float, float, float]]  # level → (value, low, high)


class Case(NamedTuple):
    """One number that a claim is judged by."""

    label: str  # "μ = 0.1", "η3"; empty if there is only one
    interval: Interval
    packings: int  # at its μ, or the fewest at any
    largest: float  # μ
    enough: bool  # disks
    span: str = ""  # key of its range


def verdict_of(cases: Sequence[Case], ranges: Mapping[str, Ends]) -> dict[str, Any]:
    """{"verdict", "cases"} of a claim; a case has its label, interval and verdict."""
    level = 1 - (1 - statistics.LEVEL) / max(1, len(cases))
    told = [_judge_case(case, ranges[case.span], level) for case in cases]
    kinds = {one["verdict"] for one in told}
    order = (CONTRADICTED, FEW, UNDECIDED, REPRODUCED)
    return {"verdict": next((kind for kind in order if kind in kinds), MISSING), "cases": told}


def _judge_case(case: Case, good: Ends, level: float) -> dict[str, Any]:
    """A case with its verdict; level: of an interval that is outside the range."""
    value, low, high = case.interval(statistics.LEVEL)
    if not (case.enough and np.isfinite([value, low, high]).all()):
        verdict = FEW
    elif good[0] <= low and high <= good[1]:
        verdict = REPRODUCED
    else:
        value, low, high = case.interval(level)
        verdict = CONTRADICTED if high < good[0] or low > good[1] else UNDECIDED
    numbers = {"value": float(value), "low": float(low), "high": float(high)}
    beyond = max(good[0] - value, value - good[1])  # of the range; negative inside
    words = {"label": case.label, "packings": case.packings, "span": case.span}
    return words | numbers | {"beyond": float(beyond), "verdict": verdict}


def range_text(good: Ends) -> str:
    """A range in words."""
    low, high = good
    if not np.isfinite(high):
        return f"≥ {low:g}"
    return f"≤ {high:g}" if not np.isfinite(low) else f"{low:.3g} … {high:.3g}"


def over_all(
    label: str, statistic: Callable[..., float], groups: Groups, *, least: int = 2, span: str = ""
) -> Iterator[Case]:
    """The case of one number of all groups, statistic(keys, means over packings); or none.

    Its interval contains the middle part of the numbers for means that are drawn from their Student
    distributions (`statistics.drawn_means`). groups: {μ: [(disks, value)]}, with values of any
    shape; least: minimum number of groups.
    """
    if len(groups) < least:
        return
    keys = np.array(list(groups), dtype=float)
    values = [np.array([value for _, value in group]) for group in groups.values()]
    value = float(statistic(keys, np.array([group.mean(axis=0) for group in values])))
    if not np.isfinite(value):
        return
    fewest = min(map(len, values))
    numbers = np.zeros(0)
    if fewest > 1:
        with np.errstate(invalid="ignore", divide="ignore"):
            numbers = np.array([statistic(keys, m) for m in statistics.drawn_means(values)])
        numbers = numbers[np.isfinite(numbers)]  # without impossible means, such as η < 0

    def interval(level: float) -> tuple[float, float, float]:
        if not len(numbers):
            return value, np.nan, np.nan
        return (value, *statistics.percentile_interval(numbers, level))

    yield Case(label, interval, fewest, float(keys.max()), _enough(groups), span)


def at_each(
    groups: Groups,
    *,
    interval: Callable[..., tuple[float, float, float]] = statistics.mean_interval,
    possible: Ends = ANY,
    span: str = "",
) -> Iterator[Case]:
    """A case for each μ. interval: (values, level) → (value, low, high); possible: values."""
    for mu, group in groups.items():
        values = [value for _, value in group]

        def clipped(level: float, values: Any = values) -> tuple[float, float, float]:
            value, *ends = interval(values, level)
            return (value, *np.clip(ends, *possible).tolist())

        yield Case(f"μ = {mu:g}", clipped, len(group), mu, _enough({mu: group}), span)


def turning(label: str, groups: Groups) -> Iterator[Case]:
    """The case of how far a number rises to its maximum and then falls, over the maximum.

    For every μ between the ends, take the smaller of the rise from the first and of the fall to the
    last; the largest is the number, negative without a maximum. Its interval is from Welch's t,
    widened to hold for all of them together, so that the choice of the maximum is accounted for.
    """
    if len(groups) < 3:
        return
    first, *between, last = (np.array([value for _, value in g]) for g in groups.values())
    fewest = min(map(len, (first, *between, last)))

    def interval(level: float) -> tuple[float, float, float]:
        if fewest < 2:
            return (np.nan,) * 3
        together = 1 - (1 - level) / (2 * len(between))
        rises = []
        for middle in between:
            ends = [statistics.difference_interval(middle, end, together) for end in (first, last)]
            rises.append((np.min(ends, axis=0) / middle.mean()).tolist())
        return tuple(max(rises))

    yield Case(label, interval, fewest, max(groups), _enough(groups))


def _enough(groups: Groups) -> bool:
    """Whether each group has enough disks for a verdict."""
    return all(sum(n for n, _ in group) >= LEAST_DISKS for group in groups.values())


# Statistics of keys (k,) and means over packings (k, …)


def slope(keys: Floats, means: Floats) -> float:
    """Slope of the logarithm of the means against that of the keys."""
    return np.polyfit(np.log(keys), np.log(means), 1)[0]


def peak(keys: Floats, means: Floats) -> float:
    """μ where the means are largest, between grid values; the end of the grid if they rise there.

    The top of a parabola in log μ through the means within a factor NEAR_PEAK of the largest one,
    and its neighbours; where the top lies beyond them, through the next ones on that side, too.
    """
    x = np.log(keys)
    k = int(np.argmax(means))
    near = np.abs(x - x[k]) <= np.log(NEAR_PEAK) * (1 + 1e-9)
    near[max(0, k - 1) : k + 2] = True
    first, last = np.flatnonzero(near)[[0, -1]]
    if last - first < 2:
        return float(keys[k])
    while first >= 0 and last < len(x):
        a, b, _ = np.polyfit(x[first : last + 1] - x[k], means[first : last + 1], 2)
        top = x[k] - b / (2 * a) if a < 0 else np.copysign(np.inf, b)
        if x[first] <= top <= x[last]:
            return float(np.exp(top))
        first, last = (first, last + 1) if top > x[last] else (first - 1, last)
    return float(keys[0] if first < 0 else keys[-1])
