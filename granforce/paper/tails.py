"""The decay of P(f_n) of uniform states: exponential, Gaussian, or in between.

The fraction of the forces beyond f is compared with exp(−(λ f)^b): b = 1 is the exponential tail
reported for measured contact forces, b = 2 the Gaussian one of the force network ensemble in two
dimensions with the whole stress prescribed (Tighe, Snoeijer, Vlugt, van Hecke, Soft Matter 6, 2908
(2010)).
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from granforce.paper.tables import FORCES, StudyTable
from granforce.types import Floats

# The prescribed quantities of the uniform states of large packings, in words.
PRESCRIBED = {"tails": "pressure prescribed", "tails_stress": "whole stress prescribed"}
# Fits start here, in ⟨f_n⟩, and end at the last bin with this many forces.
_FROM, _ENOUGH = 2.0, 10
# Fewer bins do not determine an exponent: a range of 1 ⟨f_n⟩.
_FEWEST = 8
_POWERS = np.linspace(0.3, 9.0, 871)


class Tail(NamedTuple):
    """The best exp(−(λ f)^b) for the fraction of forces beyond f."""

    power: float  # b
    low: float  # range of the fit in f, ⟨f_n⟩
    high: float
    off: float  # root mean square residual of ln P
    off_exponential: float  # the same for the best fit with b = 1
    off_gaussian: float  # and with b = 2


def counts(table: StudyTable) -> dict[str, dict[float, list[Floats]]]:
    """{words: {μ: [counts of f_n in the bins with edges FORCES, of each packing]}}."""
    counts_by_part: dict[Any, Any] = {}
    for k, counted in table.tails.items():
        row = table.rows.loc[k]
        known = counts_by_part.setdefault(PRESCRIBED[row["part"]], {})
        known.setdefault(row["mu"], []).append(counted)
    return {word: dict(sorted(known.items())) for word, known in counts_by_part.items()}


def densities(packings: Sequence[Floats]) -> list[tuple[float, float]]:
    """[(f, P)] from the counts of some packings, for nonempty bins."""
    counted, width = np.sum(packings, axis=0), FORCES[0]
    parts = counted / (counted.sum() * width)
    return [(f - width / 2, p) for f, p in zip(FORCES, parts, strict=True) if p]


def fitted(packings: Sequence[Floats]) -> Tail | None:
    """The Tail of the counts of some packings, or None if too few forces are large."""
    counted = np.sum(packings, axis=0)
    begins = FORCES - FORCES[0]
    chosen = (begins >= _FROM) & (counted >= _ENOUGH)
    if chosen.sum() < _FEWEST:
        return None
    f, beyond = begins[chosen], counted[::-1].cumsum()[::-1][chosen]
    # ln P = −(λ f)^b + ln P₀ is a line in f^b: the residual of the best line for each b.
    x, y = f ** _POWERS[:, None], np.log(beyond / counted.sum())
    x, y = x - x.mean(axis=1, keepdims=True), y - y.mean()
    left = y @ y - (x @ y) ** 2 / (x * x).sum(axis=1)
    off = np.sqrt(np.maximum(left, 0.0) / len(f))
    best, one, two = int(np.argmin(off)), *(np.argmin(np.abs(_POWERS - b)) for b in (1.0, 2.0))
    return Tail(
        power=float(_POWERS[best]),
        low=float(f[0]),
        high=float(f[-1]),
        off=float(off[best]),
        off_exponential=float(off[one]),
        off_gaussian=float(off[two]),
    )


def described(table: StudyTable) -> str:
    """All fits in words."""
    fits = (
        (f"{word}, μ = {mu:g}", fitted(packings))
        for word, known in counts(table).items()
        for mu, packings in known.items()
    )
    return "; ".join(
        f"{case}: b = {tail.power:.2f} from {tail.low:g} to {tail.high:g} ⟨f_n⟩"
        for case, tail in fits
        if tail is not None
    )
