"""Ten findings in a sentence each, filled with numbers of the study; none is written where one is
missing.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from granforce.measures import statistics
from granforce.paper.claims.groups import SAMPLERS
from granforce.paper.tables import Table
from granforce.types import Rows

WALK_OVER_EXACT = "η3 of the walk's states over exact η3, intermediate μ"
# Friction at which packings are compared with those of the largest friction.
USUAL = 0.1


class Highlight(NamedTuple):
    """A finding: its sentence, the figure that shows it and the part of the method behind it."""

    sentence: str
    figure: str  # name in data/figures
    method: str  # anchor in the method


class _Numbers:
    """What sentences quote; KeyError for what the study lacks."""

    def __init__(self, table: Table, claims: Rows, findings: Rows) -> None:
        self.table = table
        self._judged = {(row["statement"], row["sampler"]): row for row in (*claims, *findings)}

    def judged(self, statement: str, sampler: str = "") -> str:
        """The value of a claim or finding with its interval."""
        row = self._judged[statement, sampler]
        if not np.isfinite(row["value"]):
            raise KeyError(statement)
        ends = f" ({row['low']:.2g} to {row['high']:.2g})" if np.isfinite(row["low"]) else ""
        return f"{row['value']:.2g}{ends}"

    def mean(self, sampler: str, name: str, mu: float, factor: float = 1.0) -> str:
        """Mean ± standard error over packings at one μ."""
        values = factor * statistics.grouped(self.table.part(SAMPLERS[sampler]), name)[mu]
        return f"{values.mean():.3g} ± {values.std(ddof=1) / np.sqrt(len(values)):.1g}"

    def whole(self, sampler: str, name: str, mu: float) -> str:
        """Mean over packings at one μ, as a whole number."""
        return f"{statistics.grouped(self.table.part(SAMPLERS[sampler]), name)[mu].mean():.0f}"

    @property
    def frictions(self) -> list[float]:
        """All μ with exact intervals."""
        return sorted({row["mu"] for row in self.table.part(SAMPLERS["exact"])})

    @property
    def peak(self) -> float:
        """The μ of the table at which exact η3 is largest."""
        extents = statistics.grouped(self.table.part(SAMPLERS["exact"]), "eta3")
        return max(extents, key=lambda mu: extents[mu].mean())


def _free_forces(of: _Numbers) -> Highlight:
    most = of.frictions[-1]
    return Highlight(
        f"Force balance leaves {of.whole('exact', 'dimension', USUAL)} of the forces of a "
        f"{of.table.plan['n']}-disk packing free at μ = {USUAL:g}, and "
        f"{of.whole('exact', 'dimension', most)} at μ = {most:g}.",
        "figure1_exact",
        "ensemble",
    )


def _maximum(of: _Numbers) -> Highlight:
    least, most = 0.001, of.frictions[-1]
    return Highlight(
        "Indeterminacy is largest at intermediate friction: exact 0.15 η3 is "
        f"{of.mean('exact', 'eta3', of.peak, 0.15)} at μ = {of.peak:g}, against "
        f"{of.mean('exact', 'eta3', least, 0.15)} at μ = {least:g} and "
        f"{of.mean('exact', 'eta3', most, 0.15)} at μ = {most:g}.",
        "figure1_exact",
        "exact-intervals",
    )


def _seen(of: _Numbers) -> Highlight:
    return Highlight(
        "A random walk of 1000 states sees part of what is possible: its intervals are "
        f"{of.judged(WALK_OVER_EXACT)}"
        " times as long as the exact ones at intermediate μ, and those of uniform states "
        f"{of.judged('η3 of uniform states over exact η3, intermediate μ')} times.",
        "samplers",
        "exact-intervals",
    )


def _strong(of: _Numbers) -> Highlight:
    statement = "corr(f_n, ΔF_n) is significant at intermediate μ"
    return Highlight(
        "Strong contacts are the least determined ones: at intermediate μ the correlation of f_n "
        f"with its exact interval is {of.judged(statement, 'exact')}.",
        "figure6_exact",
        "measures",
    )


def _wider(of: _Numbers) -> Highlight:
    return Highlight(
        "The walk of the paper is not uniform in S: at intermediate μ its states spread "
        f"{of.judged('η1 of the walk over η1 of S, intermediate μ')} times as far as uniform "
        "states do, at small μ "
        f"{of.judged('η1 of the walk over η1 of S, small μ')} times.",
        "distances",
        "uniform-sampling",
    )


def _alike(of: _Numbers) -> Highlight:
    statement = "η1 ≈ η2 ≈ 0.15 η3 up to a constant factor: value of η1/η3"
    return Highlight(
        "The three measures agree up to constant factors: η1/η3 is "
        f"{of.judged(statement, 'nearest')} in walks of nearest networks, and "
        f"{of.judged(statement, 'gauss_seidel')} in walks by the paper's sweeps.",
        "figure1",
        "measures",
    )


def _critical(of: _Numbers) -> Highlight:
    return Highlight(
        "A contact gives way below its limit load where friction matters: F_crit over the limit "
        f"load is {of.judged('⟨F_crit⟩ over ⟨limit load⟩, small μ')} at small, "
        f"{of.judged('⟨F_crit⟩ over ⟨limit load⟩, intermediate μ')} at intermediate and "
        f"{of.judged('⟨F_crit⟩ over ⟨limit load⟩, large μ')} at large μ.",
        "figure2_limit",
        "local-perturbation",
    )


def _stability(of: _Numbers) -> Highlight:
    return Highlight(
        "Over all μ, the critical force follows exact η3 only in part: their rank correlation is "
        f"{of.judged('F_crit rises with η', 'exact')}; with η2 of nearest walks it is "
        f"{of.judged('F_crit rises with η', 'nearest')}.",
        "figure2",
        "local-perturbation",
    )


def _shear(of: _Numbers) -> Highlight:
    return Highlight(
        "A packing at rest under isotropic pressure could carry shear: the largest shear stress "
        "over pressure is "
        f"{of.judged('largest shear stress over pressure, intermediate μ')} at intermediate μ.",
        "stresses",
        "stresses",
    )


def _volume(of: _Numbers) -> Highlight:
    return Highlight(
        "The volume of S shrinks as friction falls: ln V per grain is "
        f"{of.judged('ln V per grain, forces in ⟨f_n⟩, large μ')} at large, "
        f"{of.judged('ln V per grain, forces in ⟨f_n⟩, intermediate μ')} at intermediate and "
        f"{of.judged('ln V per grain, forces in ⟨f_n⟩, small μ')} at small μ.",
        "volumes",
        "volume",
    )


SENTENCES: tuple[Callable[[_Numbers], Highlight], ...] = (
    *(_maximum, _free_forces, _seen, _strong, _wider, _alike, _critical, _stability, _shear),
    _volume,
)


def highlights(table: Table, claims: Rows, findings: Rows) -> list[Highlight]:
    """The findings that the study has all numbers of."""
    numbers, found = _Numbers(table, claims, findings), []
    for sentence in SENTENCES:
        try:
            found.append(sentence(numbers))
        except KeyError:
            continue
    return found
