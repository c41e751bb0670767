"""Claims about the distribution P(ΔF_n) (Figure 4): its shape, its tail, its width."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from granforce.measures import statistics
from granforce.paper.claims.figure1 import PEAK, peaked
from granforce.paper.claims.groups import (
    LARGE,
    MIDDLE,
    SMALL,
    Ends,
    each,
    positive_friction,
    sampled,
    span_text,
    within,
)
from granforce.paper.claims.verdicts import FRACTION, POSITIVE, Claim, at_each, over_all
from granforce.paper.tables import StudyTable
from granforce.types import Floats

# Values of `statistics.departure`: 0.05 is that of a Weibull distribution with exponent 1.5.
FLAT, RAISED = 0.05, 0.1
TAILS = ((0.5, "median"), (0.75, "upper quartile"), (0.9, "upper decile"))


def shape(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """P(ΔF_n) falls monotonically at small and large μ and has a peak in between."""
    everywhere = sampled(table, sampler)
    scaled = each(everywhere, lambda values: values / values.mean())
    for word, span, has_peak in (
        ("small", SMALL, False),
        ("intermediate", MIDDLE, True),
        ("large", LARGE, False),
    ):
        shape_of = "has a peak" if has_peak else "falls monotonically"
        for key, groups, unit in (
            ("shape", everywhere, "⟨f_n⟩"),
            ("scaled-shape", scaled, "its mean in each packing"),
        ):
            yield at_each(
                f"{key}-{word}",
                f"P(ΔF_n) at {word} μ {shape_of}",
                "departure from a falling density",
                within(groups, span),
                good=(RAISED, np.inf) if has_peak else (-np.inf, FLAT),
                fair=(FLAT, np.inf) if has_peak else (-np.inf, RAISED),
                interval=departure,
                possible=FRACTION,
                variant=f" (ΔF_n in units of {unit})",
            )


def departure(values: Sequence[Floats], level: float) -> tuple[float, float, float]:
    """Departure of all packings' values from a falling density, with its interval.

    The interval extends down to 0 if chance could produce the departure from as many values.
    """
    value, low, high = statistics.jackknife(
        lambda groups: statistics.departure(np.concatenate(groups)), values, level
    )
    if value <= statistics.chance_departure(statistics.effective_number(values), level):
        low = min(low, 0.0)
    return value, max(low, 0.0), high


def tails(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """The tail of P(ΔF_n) at each μ, beyond several quantiles."""
    everywhere = sampled(table, sampler)
    for word, span, how, good, fair in (
        ("small", SMALL, "is exponential", (0.85, 1.15), (0.7, 1.3)),
        ("intermediate", MIDDLE, "falls faster than an exponential", (1, np.inf), None),
        ("large", LARGE, "falls more slowly than an exponential", (-np.inf, 1), None),
    ):
        for quantile, beyond in TAILS:
            yield at_each(
                f"tail-{word}-{quantile}",
                f"the tail of P(ΔF_n) at {word} μ {how}",
                "b of exp(−(λ ΔF_n)^b)",
                within(everywhere, span),
                good=good,
                fair=fair,
                interval=_exponents(quantile),
                possible=POSITIVE,
                variant=f", beyond the {beyond}",
            )


def _exponents(quantile: float) -> Callable[[Any, float], Any]:
    """The exponent b beyond a quantile with its interval, computed for log b."""

    def log_exponent(groups: Sequence[Floats]) -> float:
        return np.log(statistics.tail_exponent(np.concatenate(groups), quantile))

    return lambda values, level: np.exp(statistics.jackknife(log_exponent, values, level))


def widths(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """ΔF_n and the width of its distribution are largest at intermediate μ."""
    everywhere = positive_friction(sampled(table, sampler))
    for name, measure, statement, what in (
        ("extent", np.mean, "ΔF_n is not monotonic: largest at intermediate μ", "⟨ΔF_n⟩/⟨f_n⟩"),
        (
            "width",
            np.std,
            "P(ΔF_n) is broadest at intermediate μ",
            "the standard deviation of ΔF_n/⟨f_n⟩",
        ),
    ):
        groups = each(everywhere, measure)
        yield peaked(f"{name}-peak", statement, groups, f"{PEAK}, for {what}", good=(0.05, 0.3))


def elongation(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """S is elongated at small and at large μ: some of its extents are much larger than others."""
    ratio = each(sampled(table, sampler), lambda values: values.std() / values.mean())
    middle = within(ratio, MIDDLE)
    for word, span in (("small", SMALL), ("large", LARGE)):
        groups = middle | within(ratio, span)
        yield over_all(
            f"elongation-{word}",
            f"S is more elongated at {word} than at intermediate μ",
            f"mean of std/mean of ΔF_n at {span_text(span)} over that at {span_text(MIDDLE)}",
            lambda keys, means, span=span: _over_middle(keys, means, span),
            dict(sorted(groups.items())),
            good=(1, np.inf),
            possible=POSITIVE,
        )


def _over_middle(keys: Floats, means: Floats, span: Ends) -> float:
    """The mean over a range of μ divided by that over intermediate μ; NaN if one is empty."""
    outer, inner = ((keys >= low) & (keys <= high) for low, high in (span, MIDDLE))
    return means[outer].mean() / means[inner].mean() if outer.any() and inner.any() else np.nan
