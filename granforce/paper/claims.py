"""The paper's claims, judged by the reduced study: for each way to draw states of S on its own.

Every claim has a number and its 95 % confidence interval from a bootstrap over packings. It is
"reproduced" where the number lies in the range that the claim's words are taken to mean and the
interval within a wider range; it "differs" where only the wider range holds the number, and is "not
reproduced" where that does not, and where the interval does not reach the first range; in all other
cases it is "undecided". Both ranges are told beside the verdict. Where some μ has fewer than
LEAST_DISKS disks in all its packings, or there is one packing only, data are too few to judge.

Samplers: "gauss_seidel", the paper's relaxation, whose sweeps end at 10⁻³ of ⟨f_n⟩ here, which they
reach at every μ; "gauss_seidel_1e-4", the same to 10⁻⁴; "nearest" networks; "uniform" states; and
"exact" bounds. Claims about packings alone have none. Sources: "PRE", the paper; "PRL", the letter
before it; "ours".
"""

from typing import NamedTuple

import numpy as np
from scipy import stats

from granforce import statistics

REPRODUCED, UNDECIDED, DIFFERS = "reproduced", "undecided", "differs"
FAILED, FEW, MISSING = "not reproduced", "too few data", "no data"

SAMPLERS = {  # parts of the table
    "gauss_seidel": "sweeps_1e-3",
    "gauss_seidel_1e-4": "sweeps_1e-4",
    "nearest": "walk",
    "uniform": "uniform",
    "exact": "exact",
}
BY_STATES = ("gauss_seidel", "gauss_seidel_1e-4", "nearest", "uniform")  # have η1 and η2
BY_WALKS = ("gauss_seidel", "gauss_seidel_1e-4", "nearest")
PRE, PRL, OURS = "PRE", "PRL", "ours"

LEAST_DISKS = 1000
# Packings at smaller μ are finished by linear programs; those of the paper all come from dynamics.
LEAST_DYNAMIC = 0.001
SMALL, MIDDLE, LARGE = (LEAST_DYNAMIC, 0.01), (0.05, 0.3), (5, np.inf)  # ranges of μ, ends included
BIN = 0.25  # of P(ΔF_n), ⟨f_n⟩
NEAR_PEAK = 2.0  # in μ: what lies within this factor of the largest says where the maximum is
LOW = 1e-3  # of the largest: what is lower says no more about where that is
BARELY_RIGID = 0.5  # μ from which on S has few dimensions
# Part of the states wanted that a walk must have reached to be judged.
WHOLE_WALK = 0.3


class Claim(NamedTuple):
    """One claim, what was measured, and the verdict."""

    statement: str
    sampler: str  # of SAMPLERS; "" where no states are needed
    source: str  # who claims it: PRE, PRL or OURS
    measured: str  # what the number is
    value: float
    low: float
    high: float
    criterion: str  # range for "reproduced", in brackets the wider one
    verdict: str


def judged(table):
    """All claims about a `tables.Table`, the paper's sampler first; those without data say so.

    Samplers of which the table has no row are left out, except the paper's.
    """
    known = [name for name, part in SAMPLERS.items() if table.part(part)]
    samplers = ["gauss_seidel", *(name for name in known if name != "gauss_seidel")]
    found = []
    for family, takes in FAMILIES.items():
        for sampler in samplers if takes else [""]:
            if takes and sampler not in takes:
                continue
            for claim in family(table, sampler):
                lacking = claim.verdict == MISSING and table.rows and sampler in ("", *known)
                found.append(claim._replace(verdict=FEW) if lacking else claim)
    return found


# Claims about measures


def agreement(table, sampler):
    """η1 ≈ η2 ≈ 0.15 η3 over all μ, up to a constant factor."""
    rows = dynamic(drawn(table, sampler))
    for above, below, word, good, fair in (
        ("eta2", "eta1", "η2/η1", (1 / 1.5, 1.5), (0.5, 2)),
        ("eta1", "eta3", "η1/η3", (0.12, 0.18), (0.1, 0.225)),
        ("eta2", "eta3", "η2/η3", (0.12, 0.18), (0.1, 0.225)),
    ):
        groups = items(
            rows, lambda r, a=above, b=below: np.log(r[a] / r[b]), positive=(above, below)
        )
        told = "η1 ≈ η2 ≈ 0.15 η3 up to a constant factor"
        yield _claim(
            f"{told}: {word} is constant",
            sampler,
            PRE,
            f"largest {word} over the smallest, μ ≥ {LEAST_DYNAMIC:g}",
            lambda *logs: np.exp(np.ptp([np.mean(group) for group in logs])),
            groups if len(groups) > 2 else {},
            good=(1, 1.5),
            fair=(1, 2),
        )
        yield _claim(
            f"{told}: value of {word}",
            sampler,
            PRE,
            f"geometric mean of {word} over μ ≥ {LEAST_DYNAMIC:g}",
            lambda *logs: np.exp(np.mean([np.mean(group) for group in logs])),
            groups,
            good=good,
            fair=fair,
        )


def _peaked(claim, sampler, groups):
    """A claim of the paper that what is grouped by μ is largest near 0.1."""
    return _claim(
        claim,
        sampler,
        PRE,
        _PEAK,
        peak(list(groups)),
        groups if len(groups) > 2 else {},
        good=(0.05, 0.2),
        fair=(0.02, 0.5),
    )


def maximum(table, sampler):
    """η(μ) is largest near μ = 0.1."""
    rows = drawn(table, sampler)
    names = (("eta3", "η3"),) if sampler == "exact" else _MEASURES
    for name, label in names:
        groups = {mu: g for mu, g in items(rows, name, positive=(name,)).items() if mu > 0}
        yield _peaked(f"{label}(μ) is not monotonic: largest near μ = 0.1", sampler, groups)


_MEASURES = (("eta1", "η1"), ("eta2", "η2"), ("eta3", "η3"))
_PEAK = (
    f"μ of the maximum (parabola in log μ through what lies within a factor {NEAR_PEAK:g} of it)"
)


def small_friction(table, sampler):
    """η ∝ μ at small μ, with a floor from the solver's accuracy at 0."""
    name, label = ("eta3", "η3") if sampler == "exact" else ("eta2", "η2")
    groups = items(drawn(table, sampler), name, positive=(name,))
    for low, high, word in (
        (LEAST_DYNAMIC, SMALL[1], "packings made by contact dynamics"),
        (0, LEAST_DYNAMIC / 10, "packings finished by linear programs"),
        (0, SMALL[1], "all packings"),
    ):
        few = {mu: groups[mu] for mu in groups if low <= mu <= high and mu > 0}
        span = f", μ = {min(few):g} … {max(few):g}" if few else ""
        yield _claim(
            f"η ∝ μ at small μ: {word}",
            sampler,
            PRL,
            f"slope of log {label} against log μ{span}",
            slope(few),
            few if len(few) > 1 else {},
            good=(0.9, 1.1),
            fair=(0.7, 1.3),
        )
    if sampler != "exact":
        at_rest = [row for row in drawn(table, sampler) if row["mu"] == 0]
        yield _claim(
            "η vanishes at μ = 0 within the solver's accuracy",
            sampler,
            PRL,
            "mean η2 at μ = 0",
            np.mean,
            items(at_rest, "eta2"),
            good=(0, 1e-7),
        )


def coordination(table, sampler):
    """z falls from 4 towards 3."""
    rows = table.part("walk") or drawn(table, "gauss_seidel")
    groups = items(rows, "coordination")
    ends = ({mu: groups[mu]} for mu in (min(groups), max(groups))) if groups else ({}, {})
    for group, word, limit, good in zip(
        ends, ("smallest", "largest"), (4, 3), ((3.9, 4.0), (3.0, 3.1)), strict=True
    ):
        told = f"z → {limit} at the {word} μ"
        yield _claim(told, sampler, PRE, "mean z there", np.mean, group, good=good)
    yield _claim(
        "z falls with μ",
        sampler,
        PRE,
        "rank correlation of mean z with μ",
        lambda *v: stats.spearmanr(list(groups), [np.mean(values) for values in v]).statistic,
        groups if len(groups) > 2 else {},
        good=(-1, -0.95),
        fair=(-1, -0.8),
    )


# Claims about ΔF_n


def extents(table, sampler):
    """P(ΔF_n): monotonic or peaked at each μ, its width, and how its tail falls."""
    everywhere = sampled(table, sampler)
    for word, span, peaked in (
        ("small", SMALL, False),
        ("intermediate", MIDDLE, True),
        ("large", LARGE, False),
    ):
        worst = np.min if peaked else np.max
        yield _claim(
            f"P(ΔF_n) at {word} μ {'has a peak' if peaked else 'falls monotonically'}",
            sampler,
            PRE,
            f"how far its first bin of {BIN:g} ⟨f_n⟩ lies below the highest, in parts of it: "
            f"{'least' if peaked else 'largest'} of all μ in {_span(span)}",
            lambda *groups, worst=worst: worst([dip(g) for g in groups]),
            _within(everywhere, span),
            good=(0.25, 1) if peaked else (0, 0.1),
            fair=(0.1, 1) if peaked else (0, 0.25),
            resamples=199,  # of up to 1e5 contacts each
        )
    for word, span, how, good, fair in (
        ("small", SMALL, "exponential", (0.85, 1.15), (0.7, 1.3)),
        ("intermediate", MIDDLE, "falls faster than exponentially", (1.15, np.inf), (1, np.inf)),
        ("large", LARGE, "falls slower than exponentially", (0, 0.85), (0, 1)),
    ):
        yield _claim(
            f"tail of P(ΔF_n) at {word} μ: {how}",
            sampler,
            PRE,
            f"b of exp(−(λ ΔF_n)^b) beyond the median, mean over μ in {_span(span)}",
            tail,
            _within(everywhere, span),
            good=good,
            fair=fair,
            resamples=199,
        )
    means = {mu: [(n, v.mean()) for n, v in g] for mu, g in everywhere.items() if mu > 0}
    widths = {mu: [(n, v.std()) for n, v in g] for mu, g in everywhere.items() if mu > 0}
    for groups, statement, what in (
        (means, "ΔF_n is not monotonic: largest at intermediate μ", "⟨ΔF_n⟩/⟨f_n⟩"),
        (widths, "P(ΔF_n) is broadest at intermediate μ", "the standard deviation of ΔF_n/⟨f_n⟩"),
    ):
        groups = {mu: g for mu, g in groups.items() if np.mean([v for _, v in g]) > 0}
        yield _claim(
            statement,
            sampler,
            PRE,
            f"{_PEAK}, of {what}",
            peak(list(groups)),
            groups if len(groups) > 2 else {},
            good=(0.05, 0.3),
            fair=(0.02, 0.5),
        )


def dip(values, width=BIN):
    """1 − P(first bin)/max P of ΔF_n arrays: 0 where P falls from the start."""
    joined = np.concatenate(values)
    edges = width * np.arange(int(joined.max(initial=0.0) / width) + 2)
    height = statistics.density(joined, edges)
    return 1 - height[0] / height.max()


def tail(*groups, quantile=0.5):
    """Mean over μ of the tail exponents b of ΔF_n arrays."""
    return np.mean([statistics.tail_exponent(np.concatenate(g), quantile) for g in groups])


def correlation(table, sampler):
    """corr(f_n, ΔF_n) is significant at intermediate μ and vanishes at large μ."""
    rows = [row for row in drawn(table, sampler) if np.isfinite(row.get("correlation", np.nan))]
    for word, span, good, fair, limits, wider in (
        ("is significant at intermediate", MIDDLE, (0.1, 1), (0, 1), (3, np.inf), (2, np.inf)),
        ("vanishes at large", LARGE, (-0.1, 0.1), (-0.2, 0.2), (-2, 2), (-3, 3)),
    ):
        groups = _within(items(rows, "correlation"), span)
        yield _claim(
            f"corr(f_n, ΔF_n) {word} μ",
            sampler,
            PRE,
            f"mean over packings and μ in {_span(span)}",
            _mean,
            groups,
            good=good,
            fair=fair,
        )
        scores = items(rows, lambda r: r["correlation"] * np.sqrt(r["contacts"] - 1))
        yield _claim(
            f"corr(f_n, ΔF_n) {word} μ, against chance",
            sampler,
            PRE,
            "the same in standard deviations 1/√(N_c − 1) of a packing whose f_n are shuffled",
            _mean,
            _within(scores, span),
            good=limits,
            fair=wider,
        )
    if sampler not in BY_WALKS:
        return
    for word, span, test in (
        ("excludes 0 at intermediate", MIDDLE, lambda r: r["correlation_low"] > 0),
        (
            "holds 0 at large",
            LARGE,
            lambda r: r["correlation_low"] <= 0 <= r["correlation_high"],
        ),
    ):
        yield _claim(
            f"the paper's error bar of corr(f_n, ΔF_n) {word} μ",
            sampler,
            PRE,
            "part of packings in which the range over all other networks of the walk does so",
            _mean,
            _within(items(rows, lambda r, test=test: float(test(r))), span),
            good=(0.9, 1),
            fair=(0.5, 1),
        )


def counts(table, sampler):
    """Figure 5: as many strong forces as large extents at μ = 0.1."""
    groups = {0.1: []}
    for row, _, normal, _, extent in table.contacts(SAMPLERS[sampler]):
        if row["mu"] == 0.1 and _enough(row):
            strong, loose = np.sum(normal > 2 * normal.mean()), np.sum(extent > extent.mean())
            groups[0.1].append((row["n"], strong / loose))
    yield _claim(
        "f_n > 2⟨f_n⟩ and ΔF_n > ⟨ΔF_n⟩ hold for about as many contacts (μ = 0.1)",
        sampler,
        PRE,
        "number of the first over that of the second",
        np.mean,
        groups,
        good=(0.8, 1.25),
        fair=(0.5, 2),
    )


def pairs(table, sampler):
    """Distances of pairs of states are sharply peaked."""
    groups = items(dynamic(drawn(table, sampler)), "pair_spread")
    yield _claim(
        "distances between pairs of states are sharply peaked",
        sampler,
        PRE,
        f"their standard deviation over their mean, largest of all μ ≥ {LEAST_DYNAMIC:g}",
        lambda *values: max(np.mean(v) for v in values),
        groups,
        good=(0, 0.2),
        fair=(0, 0.35),
    )


def centre(table, sampler):
    """The original network lies closer to the centre of S than sampled states."""
    name = "original_ratio" if sampler == "uniform" else "centre_ratio"
    rows = [
        row | {"centre_ratio": row["original_distance"] / row["mean_distance"]}
        for row in drawn(table, sampler)
        if row["dimension"] > 0 and row.get("mean_distance", 0) > 0
    ]
    yield _claim(
        "the original network lies closer to the centre than sampled states",
        sampler,
        PRL,
        "its distance over their mean distance, mean over packings and μ > 0",
        _mean,
        items(rows, name),
        good=(0, 1),
    )


# Claims about places and sizes


def place(table, sampler):
    """Indeterminacy is everywhere in a periodic packing."""
    rows = [row for row in table.part("exact") if row["mu"] > 0 and row.get("contacts")]
    yield _claim(
        "with only the pressure prescribed, indeterminacy is everywhere",
        sampler,
        PRE,
        "undetermined part of the contacts that carry, mean over packings and μ > 0",
        _mean,
        items(rows, "undetermined_part"),
        good=(0.9, 1),
        fair=(0.5, 1),
    )
    yield _claim(
        "and not in clusters",
        sampler,
        PRE,
        "number of clusters of undetermined contacts, mean over packings and μ > 0",
        _mean,
        items([row for row in rows if row["undetermined"]], "clusters"),
        good=(1, 1.1),
        fair=(1, 2),
    )


def frozen(table, sampler):
    """Inside a frozen boundary indeterminacy is everywhere at small μ, in clusters at large μ."""
    for part in ("frozen", "frozen_large"):
        rows = [row for row in table.part(part) if row.get("contacts")]
        word = f"N = {rows[0]['n']}" if rows else "N = 400" if part == "frozen" else "N = 1600"
        inside = lambda r: 1 - r["undetermined_part"]  # noqa: E731
        largest = lambda r: r["largest_cluster"] / r["contacts"]  # noqa: E731
        for told, measured, name, span, good, fair in (
            (
                "at small μ contacts are undetermined everywhere",
                "undetermined part of the contacts inside",
                "undetermined_part",
                (0, 0.05),
                (0.75, 1),
                (0.5, 1),
            ),
            (
                "at large μ most contacts are determined",
                "determined part of the contacts inside",
                inside,
                (BARELY_RIGID, np.inf),
                (0.5, 1),
                (0.25, 1),
            ),
            (
                "at large μ those that are not lie in small clusters",
                "part of the contacts inside that are in the largest cluster",
                largest,
                (BARELY_RIGID, np.inf),
                (0, 0.25),
                (0, 0.5),
            ),
        ):
            yield _claim(
                f"with frozen boundary forces, {told} ({word})",
                sampler,
                PRL,
                f"{measured}, mean over packings and μ in {_span(span)}",
                _mean,
                _within(items(rows, name), span),
                good=good,
                fair=fair,
            )


def size(table, sampler):
    """η hardly depends on N."""
    part, name, label = ("size", "eta2", "η2")
    if sampler == "exact":
        part, name, label = ("size_exact", "eta3", "η3")
    everywhere = table.part(part) + drawn(table, sampler)
    for mu in sorted({row["mu"] for row in table.part(part)}):
        rows = [row for row in everywhere if row["mu"] == mu]
        groups = items(rows, name, by="n", positive=(name,))
        yield _claim(
            f"η hardly depends on N (μ = {mu:g})",
            sampler,
            PRE,
            f"slope of log {label} against log N, N = {min(groups)} … {max(groups)}",
            slope(groups),
            groups if len(groups) > 1 else {},
            good=(-0.1, 0.1),
            fair=(-0.3, 0.3),
        )


# Claims about the response


_ANSWERS = (("critical_force", "F_crit"), ("decay_exponent", "α"))


def perturbation(table, sampler):
    """F_crit and α are largest near μ = 0.1."""
    for name, label in _ANSWERS:
        groups = items([r for r in table.responses() if r["mu"] > 0], name, positive=(name,))
        yield _peaked(f"{label} is largest near μ = 0.1", sampler, groups)


def response(table, sampler):
    """F_crit and α rise with η, and are similar where η is."""
    eta, word = ("eta3", "exact η3") if sampler == "exact" else ("eta2", "η2")
    rows = [r for r in table.answers(SAMPLERS[sampler], eta) if r["mu"] > 0]
    for name, label in _ANSWERS:
        groups = items(rows, lambda r, name=name: (r[eta], r[name]), positive=(eta, name))
        enough = groups if len(groups) > 2 else {}
        yield _claim(
            f"{label} rises with η",
            sampler,
            PRE,
            f"rank correlation of mean {label} with mean {word} over μ > 0",
            lambda *g: stats.spearmanr([np.mean(pair, axis=0) for pair in g]).statistic,
            enough,
            good=(0.7, 1),
            fair=(0.3, 1),
        )
        yield _claim(
            f"{label} is similar at equal η on both sides of the maximum",
            sampler,
            PRE,
            f"{label} beyond the maximum of {word}(μ) over that below it at the same {word}, "
            "geometric mean",
            branches,
            enough,
            good=(0.8, 1.25),
            fair=(1 / 1.5, 1.5),
        )


def branches(*groups):
    """Ratio of answers at equal η beyond and below the maximum of η(μ): groups of (η, answer)."""
    eta, answer = np.array([np.mean(pair, axis=0) for pair in groups]).T
    top = int(np.argmax(eta))
    order = np.argsort(eta[: top + 1])
    below, known = eta[: top + 1][order], answer[: top + 1][order]
    beyond = [k for k in range(top + 1, len(eta)) if below[0] <= eta[k] <= below[-1]]
    if not beyond:
        return np.nan
    return np.exp(np.mean([np.log(answer[k] / np.interp(eta[k], below, known)) for k in beyond]))


# The families, and the samplers that each takes: none for claims about packings alone.
FAMILIES = {
    agreement: BY_STATES,
    maximum: tuple(SAMPLERS),
    small_friction: tuple(SAMPLERS),
    coordination: (),
    extents: tuple(SAMPLERS),
    correlation: tuple(SAMPLERS),
    counts: tuple(SAMPLERS),
    pairs: BY_STATES,
    centre: BY_STATES,
    place: ("exact",),
    frozen: ("exact",),
    size: ("nearest", "exact"),
    perturbation: (),
    response: tuple(SAMPLERS),
}


# Groups: {μ: [(disks, value) of each packing]}


def drawn(table, sampler):
    """Rows of a sampler; walks that reached too few of their states are left out."""
    return [row for row in table.part(SAMPLERS[sampler]) if _enough(row)]


def _enough(row):
    return row.get("reached_part", 1.0) >= WHOLE_WALK


def dynamic(rows):
    """Rows of packings that contact dynamics made."""
    return [row for row in rows if row["mu"] >= LEAST_DYNAMIC]


def items(rows, what, by="mu", positive=()):
    """{μ: [(disks, value)]} in order of μ; what: a name, or a function of the row.

    Rows whose value is unknown, or that lack a positive value of some names, are left out.
    """
    found = {}
    for row in rows:
        if not all(row.get(name, 0) > 0 for name in positive):
            continue
        value = row.get(what, np.nan) if isinstance(what, str) else what(row)
        if np.all(np.isfinite(value)):
            found.setdefault(row[by], []).append((row["n"], value))
    return {key: found[key] for key in sorted(found)}


def sampled(table, sampler):
    """{μ: [(disks, ΔF_n (N_c,) in ⟨f_n⟩)]} of packings with indeterminacy."""
    found = {}
    for row, *_, extent in table.contacts(SAMPLERS[sampler]):
        if _enough(row) and extent.any():
            found.setdefault(row["mu"], []).append((row["n"], extent))
    return {mu: found[mu] for mu in sorted(found)}


def _within(groups, span):
    return {mu: group for mu, group in groups.items() if span[0] <= mu <= span[1]}


def _span(span):
    low, high = span
    return f"{low:g} … {high:g}" if np.isfinite(high) else f"{low:g} …"


def _mean(*groups):
    """Mean over all packings of all groups."""
    return np.mean(np.concatenate(groups))


def _claim(statement, sampler, source, measured, statistic, groups, *, good, fair=None, **options):
    """Judge one number: statistic(*groups of values), from {μ: [(disks, value)]}."""
    fair = good if fair is None else fair
    criterion = _range(good) + ("" if fair == good else f" [{_range(fair)}]")
    groups = list(groups.values())
    values = [[value for _, value in group] for group in groups]
    said = (statement, sampler, source, measured)
    value = low = high = float("nan")
    if not values or not all(values):
        return Claim(*said, value, low, high, criterion, MISSING)
    value, low, high = statistics.bootstrap(statistic, values, **options)
    if min(sum(n for n, _ in group) for group in groups) < LEAST_DISKS or np.isnan(low):
        verdict = FEW if np.isfinite(value) else MISSING
    elif good[0] <= value <= good[1]:
        verdict = REPRODUCED if fair[0] <= low and high <= fair[1] else UNDECIDED
    elif low <= good[1] and high >= good[0]:
        verdict = UNDECIDED
    else:
        verdict = DIFFERS if fair[0] <= value <= fair[1] else FAILED
    return Claim(*said, value, low, high, criterion, verdict)


def _range(ends):
    low, high = ends
    if not np.isfinite(high):
        return f"≥ {low:g}"
    return f"{low:.3g} … {high:.3g}"


def slope(keys):
    """Statistic: slope of the logarithm of means over packings against that of the keys."""
    x = np.log(list(keys))
    return lambda *values: np.polyfit(x, [np.log(np.mean(v)) for v in values], 1)[0]


def peak(frictions):
    """Statistic: μ where the means over packings are largest, between grid values."""
    x = np.log(frictions)

    def top(*values):
        heights = np.array([np.mean(v) for v in values])
        # Where nothing is undetermined rounding may leave less than nothing.
        y = np.log(np.maximum(heights, max(LOW * heights.max(), np.finfo(float).tiny)))
        k = int(np.argmax(y))
        if not 0 < k < len(y) - 1:
            return frictions[k]
        near = np.abs(x - x[k]) <= np.log(NEAR_PEAK) * (1 + 1e-9)
        near[k - 1 : k + 2] = True
        a, b, _ = np.polyfit(x[near] - x[k], y[near], 2)
        place = x[k] - b / (2 * a) if a < 0 else x[k]
        return np.exp(np.clip(place, x[near].min(), x[near].max()))

    return top
