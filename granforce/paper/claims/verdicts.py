"""How a claim is judged: a number with its interval, two ranges, and tests of the verdict.

There are two kinds of claims. `over_all` judges one number for all μ, such as a slope or the
position of a maximum: its interval contains 95 % of its values for means at each μ that are drawn
from their Student distributions (`statistics.drawn_means`). The verdict must be the same for the
whole interval, wherever other draws could put its ends, and the number must stay in the same range
if any one μ is left out; a number outside the first range, but not always outside the wider one,
contradicts the claim. `at_each` judges a number at every μ by Student's interval over its packings;
together the intervals hold with 95 % confidence (Bonferroni).

Intervals end where the possible values of a number end. A number has too few data if its interval
decides nothing and spans more than a factor WIDE, or nearly all possible values.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from granforce.measures import statistics
from granforce.paper.claims.groups import Ends, Groups
from granforce.types import Floats

REPRODUCED, UNDECIDED, CONTRADICTED = "reproduced", "undecided", "contradicted"
STRONGLY, FEW, MISSING = "strongly contradicted", "too few data", "no data"
UNMEASURED = "not measured"

LEAST_DISKS = 1000  # in all packings of one μ
NEAR_PEAK = 2.0  # in μ: means within this factor of the largest determine the maximum
MOST_NAMED = 3  # μ that are listed singly if omitting any of them changes a verdict
# Intervals of positive numbers that span more than this factor, and of bounded ones that span more
# than this part of the possible values, are too few data.
WIDE, MOST = 10.0, 0.9
ANY, POSITIVE, FRACTION, CORRELATION = (-np.inf, np.inf), (0.0, np.inf), (0.0, 1.0), (-1.0, 1.0)


class Claim(NamedTuple):
    """A claim, the measured number, and the verdict."""

    id: str  # the same for all samplers, and for a finding at all ranges of μ
    statement: str
    sampler: str  # of SAMPLERS; "" if no states are needed
    source: str  # origin of the claim: PRE or PRL; topic of a finding
    measured: str  # description of the number
    value: float
    low: float
    high: float
    criterion: str  # range for "reproduced", with the wider one in brackets
    verdict: str
    why: str = ""  # reason for a negative or open verdict
    mu: float | None = None  # where the number is from, if it is judged at each μ
    packings: int = 0  # at that μ, or the fewest at any
    figure: int = 0  # of the paper, to which the claim belongs; 0 for findings
    variant: str = ""  # end of the statement that distinguishes it from others of the same claim
    number: str = ""  # what is judged: `measured` without the μ that decides
    good: str = ""  # the ranges of the criterion, in words; `fair` only if it is wider
    fair: str = ""
    before: str = ""  # verdict of the interval alone, if the claim's is another
    outside: Sequence[float] = ()  # μ that are not judged because states are outside S
    span: str = ""  # word of RANGES of a finding that has one value for each


PRE, PRL = "PRE", "PRL"


class Ranges(NamedTuple):
    """The interpretation of a claim as a range, and a wider range around it."""

    good: Ends
    fair: Ends

    def verdict(self, low: float, high: float) -> str:
        """The verdict of an interval: UNDECIDED if it crosses an end of the good range.

        An interval entirely outside that range contradicts the claim, strongly if it is also
        entirely outside a wider range.
        """
        if self.good[0] <= low and high <= self.good[1]:
            return REPRODUCED
        if not (high < self.good[0] or low > self.good[1]):
            return UNDECIDED
        wide = self.fair != self.good
        return STRONGLY if wide and (high < self.fair[0] or low > self.fair[1]) else CONTRADICTED

    def words(self) -> tuple[str, str]:
        """Both ranges in words, the wider one empty if it is the same."""
        return _range(self.good), "" if self.fair == self.good else _range(self.fair)


def _range(ends: Ends) -> str:
    low, high = ends
    if not np.isfinite(high):
        return f"≥ {low:g}"
    if not np.isfinite(low):
        return f"≤ {high:g}"
    return f"{low:.3g} … {high:.3g}"


def over_all(
    id: str,
    statement: str,
    measured: str,
    statistic: Callable[..., float],
    groups: Groups,
    *,
    good: Ends,
    fair: Ends | None = None,
    source: str = PRE,
    least: int = 2,
    seed: int = 0,
    possible: Ends = ANY,
    variant: str = "",
) -> Claim:
    """The Claim about one number, statistic(keys, means over packings), of all groups.

    groups: {μ: [(disks, value)]}, with values of any shape; least: minimum number of groups. seed:
    of the drawn means. possible: values that the number can have. variant: end of the statement.
    """
    ranges = Ranges(good, good if fair is None else fair)
    claim = _missing(id, statement, source, measured, ranges, variant)
    if len(groups) < least:
        return claim
    keys = np.array(list(groups), dtype=float)
    values = [np.array([value for _, value in group]) for group in groups.values()]
    means = np.array([value.mean(axis=0) for value in values])
    value = float(statistic(keys, means))
    if not np.isfinite(value):
        return claim
    fewest = min(map(len, values))
    claim = claim._replace(value=value, packings=fewest)
    values_drawn = _drawn(statistic, keys, values, seed)
    single = fewest < 2
    few = min(sum(n for n, _ in group) for group in groups.values()) < LEAST_DISKS
    if single or few or np.isfinite(values_drawn).mean() < 0.9:
        claim = claim._replace(verdict=FEW)
        if single:
            return claim
        low, high = statistics.percentile_ends(values_drawn)[0]
        return claim._replace(low=low, high=high)
    (low, high), farthest = statistics.percentile_ends(values_drawn[np.isfinite(values_drawn)])
    verdict = _judge(ranges, low, high, possible)
    claim = claim._replace(low=low, high=high, verdict=verdict)
    if verdict in (UNDECIDED, FEW):
        return claim
    turned = {None: ranges.verdict(*farthest)}  # by the omitted μ; None: another draw
    for k, key in enumerate(keys) if len(keys) > least else ():
        without = statistic(np.delete(keys, k), np.delete(means, k, axis=0))
        if np.isfinite(without):
            turned[key] = ranges.verdict(without, without)
    why = _turns(turned, verdict)
    if why:
        # A number that is certainly outside the good range does not become undecided.
        outside = {verdict, *turned.values()} <= {CONTRADICTED, STRONGLY}
        before, verdict = verdict, CONTRADICTED if outside else UNDECIDED
        if verdict != before:
            claim, why = claim._replace(before=before), f"{before}, but {why}"
    return claim._replace(verdict=verdict, why=why)


def _drawn(
    statistic: Callable[..., float], keys: Floats, values: Sequence[Floats], seed: int
) -> Floats:
    """The number for drawn means; NaN where these are impossible, such as η < 0."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.array(
            [statistic(keys, draw) for draw in statistics.drawn_means(values, seed=seed)]
        )


def _judge(ranges: Ranges, low: float, high: float, possible: Ends) -> str:
    """The verdict of an interval, FEW if it decides nothing and is too wide."""
    verdict = ranges.verdict(low, high)
    return FEW if verdict == UNDECIDED and too_wide(low, high, possible) else verdict


def too_wide(low: float, high: float, possible: Ends) -> bool:
    """Whether an interval spans orders of magnitude, or nearly all possible values."""
    if np.isfinite(possible).all():
        return high - low > MOST * (possible[1] - possible[0])
    return possible[0] >= 0 and high > WIDE * low


def _missing(
    id: str, statement: str, source: str, measured: str, ranges: Ranges, variant: str = ""
) -> Claim:
    """The Claim before any result; `judged` adds its sampler."""
    good, fair = ranges.words()
    return Claim(
        id=id.replace("_", "-"),
        statement=statement + variant,
        sampler="",
        source=source,
        measured=measured,
        value=np.nan,
        low=np.nan,
        high=np.nan,
        criterion=f"{good} [{fair}]" if fair else good,
        verdict=MISSING,
        variant=variant,
        number=measured,
        good=good,
        fair=fair,
    )


def _turns(turned: Any, verdict: str) -> str:
    """Other possible verdicts and their causes, in words."""
    why = []
    for other in sorted(set(turned.values()) - {verdict}):
        if turned[None] == other:
            why.append(f"{other} with another draw of the means")
        left_out = [
            f"{mu:g}" for mu, direction in turned.items() if mu is not None and direction == other
        ]
        if len(left_out) > MOST_NAMED:
            why.append(f"{other} without any one of {len(left_out)} μ")
        elif left_out:
            why.append(f"{other} without μ = {' or '.join(left_out)}")
    return ", ".join(why)


def at_each(
    id: str,
    statement: str,
    measured: str,
    groups: Groups,
    *,
    good: Ends,
    fair: Ends | None = None,
    source: str = PRE,
    interval: Callable[[Any, float], tuple[float, float, float]] | None = None,
    possible: Ends = ANY,
    variant: str = "",
) -> Claim:
    """The Claim about a number at each μ, reporting one that decides the verdict.

    Of the μ whose numbers have the verdict of the claim, it is the one farthest from the good
    range. groups: {μ: [(disks, value)]}. interval: (values, level) → (value, low, high), by default
    the mean and Student's interval. possible: values that the number can have. variant: end of the
    statement.
    """
    ranges = Ranges(good, good if fair is None else fair)
    interval = interval or statistics.mean_interval
    claim = _missing(id, statement, source, measured, ranges, variant)
    if not groups:
        return claim
    level = 1 - (1 - statistics.LEVEL) / len(groups)
    estimates, verdicts = {}, {}
    for mu, group in groups.items():
        value, *ends = interval([value for _, value in group], level)
        low, high = np.clip(ends, *possible)
        estimates[mu] = float(value), float(low), float(high)
        few = sum(n for n, _ in group) < LEAST_DISKS or not np.isfinite(estimates[mu][1])
        verdicts[mu] = FEW if few else _judge(ranges, low, high, possible)
    verdict, why = _together(verdicts)
    deciding = [mu for mu in verdicts if verdicts[mu] == verdict] or list(verdicts)
    place = max(deciding, key=lambda mu: _beyond(estimates[mu][0], ranges.good))
    where = f"{measured}, at the deciding μ ({place:g})" if len(estimates) > 1 else measured
    value, low, high = estimates[place]
    return claim._replace(
        measured=where,
        value=value,
        low=low,
        high=high,
        verdict=verdict,
        why=why,
        mu=float(place),
        packings=len(groups[place]),
    )


def turns(id: str, statement: str, groups: Groups, *, source: str = PRE) -> Claim:
    """The Claim that a number first rises and then falls, both significantly, from end to end.

    groups: {μ: [(disks, value)]}. For every μ between the ends, take the smaller of the rise from
    the first and of the fall to the last, relative to the mean there; the largest is reported. Its
    interval is from Welch's t, widened to hold for all of them together (Bonferroni), so that the
    choice of the maximum is accounted for.
    """
    ranges = Ranges((0, np.inf), (0, np.inf))
    span = f", μ = {min(groups):g} … {max(groups):g}" if groups else ""
    measured = (
        f"the smaller of the rise to the maximum and the fall from it, over the maximum{span}"
    )
    claim = _missing(id, statement, source, measured, ranges)
    if len(groups) < 3:
        return claim
    values = [np.array([value for _, value in group]) for group in groups.values()]
    if min(map(len, values)) < 2:
        return claim._replace(verdict=FEW)
    first, *between, last = values
    level = 1 - (1 - statistics.LEVEL) / (2 * len(between))
    rises = []
    for middle in between:
        ends = [statistics.difference_interval(middle, end, level) for end in (first, last)]
        rises.append(np.min(ends, axis=0) / middle.mean())
    value, low, high = max(rises, key=lambda one: one[0])
    high = min(high, 1.0)  # the number is positive at the ends, too
    few = min(sum(n for n, _ in group) for group in groups.values()) < LEAST_DISKS
    # With only two ends nothing turns, and an exact zero is undecided.
    verdict = FEW if few else UNDECIDED if low <= 0 <= high else ranges.verdict(low, high)
    fewest = min(map(len, values))
    return claim._replace(value=value, low=low, high=high, verdict=verdict, packings=fewest)


def _beyond(value: float, ends: Ends) -> float:
    """Distance of a number outside a range; negative inside, the distance to the nearest end."""
    return max(ends[0] - value, value - ends[1])


def _together(verdicts: Any) -> tuple[str, str]:
    """The verdict of a claim from those at each μ, and where they differ."""
    kinds = set(verdicts.values())
    if len(kinds) == 1:
        return kinds.pop(), ""
    where = {kind: [f"{mu:g}" for mu in verdicts if verdicts[mu] == kind] for kind in kinds}
    why = "; ".join(f"{kind} at {', '.join(where[kind])}" for kind in sorted(kinds))
    if STRONGLY in kinds and REPRODUCED not in kinds:
        return STRONGLY, why
    if kinds & {CONTRADICTED, STRONGLY}:
        return CONTRADICTED, why
    return FEW if FEW in kinds else UNDECIDED, why


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
