"""The paper's claims, judged by the reduced study.

Every claim has a number and its 95 % confidence interval from a bootstrap over packings. It is
"reproduced" where the number lies in the range that the claim's words are taken to mean and the
interval within a wider range; "undecided" where the interval is wider than that; it "differs"
where only the wider range holds the number, and is "not reproduced" elsewhere. Both ranges are told
beside the verdict.
"""

from typing import NamedTuple

import numpy as np
from scipy import stats

from granforce import statistics

REPRODUCED, UNDECIDED, DIFFERS = "reproduced", "undecided", "differs"
FAILED, MISSING = "not reproduced", "no data"

SMALL, MIDDLE, LARGE = (0, 0.01), (0.05, 0.3), (5, np.inf)  # ranges of μ, ends included


class Claim(NamedTuple):
    """One claim, what was measured, and the verdict."""

    statement: str
    measured: str  # what the number is
    value: float
    low: float
    high: float
    criterion: str  # range for "reproduced", in brackets the wider one
    verdict: str


def judged(table):
    """All claims about a `tables.Table`; those without data say so."""
    return [claim for family in FAMILIES for claim in family(table)]


def agreement(table):
    """η1 ≈ η2 ≈ 0.15 η3 over all μ."""
    names = ("eta1", "eta2", "eta3")
    groups = {}
    for row in table.part("walk"):
        if row["mu"] > 0 and all(row[name] > 0 for name in names):
            logs = np.log([row["eta1"], row["eta2"], 0.15 * row["eta3"]])
            groups.setdefault(row["mu"], []).append(logs)

    def factor(*logs):
        return np.exp(max(np.ptp(np.mean(group, axis=0)) for group in logs))

    yield _claim(
        "η1 ≈ η2 ≈ 0.15 η3 over all μ",
        "largest factor between the three at any μ",
        factor,
        groups.values(),
        good=(1, 1.5),
        fair=(1, 2),
    )


def maximum(table):
    """η(μ) is largest near μ = 0.1."""
    for name, label in (("eta1", "η1"), ("eta2", "η2"), ("eta3", "η3")):
        groups = positive(statistics.grouped(table.part("walk"), name))
        if len(groups) > 2:
            yield _claim(
                f"{label}(μ) is not monotonic: largest near μ = 0.1",
                "μ of the maximum (parabola through the three highest neighbours, log μ)",
                peak(list(groups)),
                groups.values(),
                good=(0.05, 0.2),
                fair=(min(0.05, sorted(groups)[1]), max(0.2, sorted(groups)[-2])),
            )


def small_friction(table):
    """η ∝ μ at small μ, with a floor from the solver's accuracy at 0."""
    groups = statistics.grouped(table.part("walk"), "eta2")
    few = {mu: groups[mu] for mu in [mu for mu in groups if mu > 0][:2]}
    word = " and ".join(f"{mu:g}" for mu in few)
    yield _claim(
        "η ∝ μ at small μ",
        f"slope of log η2 against log μ, μ = {word}",
        slope(few),
        few.values() if len(few) > 1 else [],
        good=(0.9, 1.1),
        fair=(0.7, 1.3),
    )
    yield _claim(
        "η vanishes at μ = 0 within the solver's accuracy",
        "mean η2 at μ = 0",
        np.mean,
        [groups.get(0, [])],
        good=(0, 1e-7),
    )


def coordination(table):
    """z falls from 4 towards 3."""
    groups = statistics.grouped(table.part("walk"), "coordination")
    ends = [groups[min(groups)], groups[max(groups)]] if groups else [[], []]

    def fall(*values):
        return stats.spearmanr(list(groups), [np.mean(v) for v in values]).statistic

    for values, word, limit, good in (
        (ends[0], "smallest", 4, (3.9, 4.0)),
        (ends[1], "largest", 3, (3.0, 3.1)),
    ):
        told = f"z → {limit} at the {word} μ"
        yield _claim(told, "mean z there", np.mean, [values], good=good)
    yield _claim(
        "z falls with μ",
        "rank correlation of mean z with μ",
        fall,
        groups.values() if len(groups) > 2 else [],
        good=(-1, -0.95),
        fair=(-1, -0.8),
    )


def extents(table):
    """P(ΔF_n): monotonic or peaked, and how its tail falls."""
    tails = (
        ("small", SMALL, "exponential", (0.85, 1.15), (0.7, 1.3)),
        ("intermediate", MIDDLE, "falls faster than exponentially", (1.15, np.inf), (1, np.inf)),
        ("large", LARGE, "falls slower than exponentially", (0, 0.85), (0, 1)),
    )
    groups = {word: pooled(table.extents("walk"), span) for word, span, *_ in tails}
    for word, group in groups.items():
        peaked = word == "intermediate"
        yield _claim(
            f"P(ΔF_n) at {word} μ {'has a peak' if peaked else 'falls monotonically'}",
            "how far the density at small ΔF_n lies below its maximum, in parts of it",
            _dip,
            [group],
            good=(0.25, 1) if peaked else (0, 0.1),
            fair=(0.1, 1) if peaked else (0, 0.25),
        )
    for word, _, how, good, fair in tails:
        yield _claim(
            f"tail of P(ΔF_n) at {word} μ: {how}",
            "b of exp(−(λ ΔF_n)^b) beyond the median",
            lambda items: statistics.tail_exponent(np.concatenate(items)),
            [groups[word]],
            good=good,
            fair=fair,
            resamples=199,  # of up to 1e5 contacts each
        )


def correlation(table):
    """corr(f_n, ΔF_n) is significant at intermediate μ and vanishes at large μ."""
    groups = statistics.grouped(table.part("walk"), "correlation")
    for word, span, good, fair in (
        ("is significant at intermediate", MIDDLE, (0.1, 1), (0, 1)),
        ("vanishes at large", LARGE, (-0.1, 0.1), (-0.2, 0.2)),
    ):
        values = [v for mu, group in groups.items() if span[0] <= mu <= span[1] for v in group]
        yield _claim(
            f"corr(f_n, ΔF_n) {word} μ",
            "mean over packings",
            np.mean,
            [values],
            good=good,
            fair=fair,
        )


def place(table):
    """Indeterminacy is everywhere in a periodic packing, in clusters where forces are frozen."""
    share, parts = {}, {}
    for part in ("exact", "frozen"):
        rows = [r for r in table.part(part) if r["mu"] > 0 and r["contacts"]]
        share[part] = [r["undetermined"] / r["contacts"] for r in rows]
        parts[part] = [r["clusters"] for r in rows if r["undetermined"]]
    yield _claim(
        "with only the pressure prescribed, indeterminacy is everywhere",
        "undetermined part of the contacts that carry, all μ > 0 (exact)",
        np.mean,
        [share["exact"]],
        good=(0.9, 1),
        fair=(0.5, 1),
    )
    yield _claim(
        "and not in clusters",
        "mean number of clusters of undetermined contacts",
        np.mean,
        [parts["exact"]],
        good=(1, 1.1),
        fair=(1, 2),
    )
    yield _claim(
        "with frozen boundary forces it clusters",
        "mean number of clusters inside the frozen boundary",
        np.mean,
        [parts["frozen"]],
        good=(1.5, np.inf),
        fair=(1.05, np.inf),
    )


def size(table):
    """η hardly depends on N."""
    everywhere = table.part("size", "walk")
    for mu in sorted({row["mu"] for row in table.part("size")}):
        groups = {}
        for row in everywhere:
            if row["mu"] == mu:
                groups.setdefault(row["n"], []).append(row["eta2"])

        yield _claim(
            f"η hardly depends on N (μ = {mu:g})",
            f"slope of log η2 against log N, N = {min(groups)} … {max(groups)}",
            slope(groups),
            groups.values() if len(groups) > 1 else [],
            good=(-0.1, 0.1),
            fair=(-0.3, 0.3),
        )


def perturbation(table):
    """F_crit and α rise with η2, and both are largest near μ = 0.1."""
    rows = table.answers()
    for name, label in (("critical_force", "F_crit"), ("decay_exponent", "α")):
        groups = {}
        for row in rows:
            if row["mu"] > 0 and np.isfinite(row.get(name, np.nan)):
                groups.setdefault(row["mu"], []).append((row["eta2"], row[name]))

        def rank(*pairs):
            return stats.spearmanr([np.mean(pair, axis=0) for pair in pairs]).statistic

        enough = len(groups) > 2
        yield _claim(
            f"{label} rises with η2",
            f"rank correlation of mean {label} with mean η2 over μ",
            rank,
            groups.values() if enough else [],
            good=(0.7, 1),
            fair=(0.3, 1),
        )
        values = positive(statistics.grouped(rows, name))
        yield _claim(
            f"{label} is largest near μ = 0.1",
            "μ of the maximum",
            peak(list(values)),
            values.values() if enough else [],
            good=(0.05, 0.2),
            fair=(0.02, 0.5),
        )


def centre(table):
    """The original network lies closer to the centre of S than sampled states."""
    rows = [r for r in table.part("walk") if r["dimension"] > 0]
    walked = [r["original_distance"] / r["mean_distance"] for r in rows]
    uniform = [r["original_ratio"] for r in table.part("uniform") if "original_ratio" in r]
    for ratios, word in ((walked, "the walk's"), (uniform, "uniform")):
        yield _claim(
            f"the original network lies closer to the centre than {word} states",
            f"its distance over the mean of {word} states, mean over packings",
            np.mean,
            [ratios],
            good=(0, 1),
        )


FAMILIES = (
    *(agreement, maximum, small_friction, coordination, extents, correlation, place, size),
    *(perturbation, centre),
)


def _claim(statement, measured, statistic, groups, *, good, fair=None, **options):
    """Judge one number: `groups` as for `statistics.bootstrap`; no or empty ones are no data."""
    fair = good if fair is None else fair
    groups = [list(group) for group in groups]
    criterion = _range(good) + ("" if fair == good else f" [{_range(fair)}]")
    if not groups or not all(groups):
        unknown = float("nan")
        return Claim(statement, measured, unknown, unknown, unknown, criterion, MISSING)
    value, low, high = statistics.bootstrap(statistic, groups, **options)
    if np.isnan(low):
        verdict = UNDECIDED  # one packing at each μ says nothing of others
    elif not fair[0] <= value <= fair[1]:
        verdict = FAILED
    elif not good[0] <= value <= good[1]:
        verdict = DIFFERS
    else:
        verdict = REPRODUCED if fair[0] <= low and high <= fair[1] else UNDECIDED
    return Claim(statement, measured, value, low, high, criterion, verdict)


def _range(ends):
    low, high = ends
    if not np.isfinite(high):
        return f"≥ {low:g}"
    return f"{low:g} … {high:g}"


def positive(groups):
    """Groups of μ > 0 whose mean is positive."""
    return {mu: values for mu, values in groups.items() if mu > 0 and np.mean(values) > 0}


def slope(groups):
    """Statistic: slope of the logarithm of means over packings against that of the keys."""
    x = np.log(list(groups))
    return lambda *values: np.polyfit(x, [np.log(np.mean(v)) for v in values], 1)[0]


def peak(frictions):
    """Statistic: μ where the means over packings are largest, between grid values."""
    x = np.log(frictions)

    def top(*values):
        y = np.log([np.mean(v) for v in values])
        k = int(np.argmax(y))
        if not 0 < k < len(y) - 1:
            return frictions[k]
        a, b, _ = np.polyfit(x[k - 1 : k + 2] - x[k], y[k - 1 : k + 2], 2)
        return np.exp(x[k] - b / (2 * a)) if a < 0 else frictions[k]

    return top


def pooled(groups, span):
    """ΔF_n/⟨ΔF_n⟩ of each packing with μ > 0 in a range; those without indeterminacy left out."""
    return [
        values / values.mean()
        for mu, group in groups.items()
        if mu > 0 and span[0] <= mu <= span[1]
        for values in group
        if values.any()
    ]


def _dip(items):
    """1 − P(lowest fifth of ⟨ΔF_n⟩)/max P, in fifths of ⟨ΔF_n⟩: 0 where P falls from the start."""
    height = statistics.density(np.concatenate(items), np.linspace(0, 3, 16))
    return 1 - height[0] / height.max()
