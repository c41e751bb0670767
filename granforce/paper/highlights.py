"""Ten findings, one sentence each, with numbers from the study.

A finding is omitted if the study lacks one of its numbers.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from granforce.measures import statistics
from granforce.paper.claims.groups import SAMPLERS
from granforce.paper.formatting import with_error
from granforce.paper.tables import StudyTable
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
    """The numbers quoted in sentences; KeyError for those missing from the study."""

    def __init__(self, table: StudyTable, claims: Rows, findings: Rows) -> None:
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
        return with_error(values)

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
        f"Force balance leaves a {of.table.plan['n']}-disk packing with "
        f"{of.whole('exact', 'dimension', USUAL)} free dimensions on average at μ = {USUAL:g}, "
        f"and {of.whole('exact', 'dimension', most)} at μ = {most:g}.",
        "figure1_exact",
        "ensemble",
    )


def _maximum(of: _Numbers) -> Highlight:
    least, most = 0.001, of.frictions[-1]
    return Highlight(
        "Indeterminacy is largest at intermediate friction: the exact 0.15 η3 is "
        f"{of.mean('exact', 'eta3', of.peak, 0.15)} at μ = {of.peak:g}, compared with "
        f"{of.mean('exact', 'eta3', least, 0.15)} at μ = {least:g} and "
        f"{of.mean('exact', 'eta3', most, 0.15)} at μ = {most:g}.",
        "figure1_exact",
        "exact-intervals",
    )


def _coverage(of: _Numbers) -> Highlight:
    return Highlight(
        "A random walk of 1000 states covers only part of S: at intermediate μ its intervals are "
        f"{of.judged(WALK_OVER_EXACT)} times as long as the exact ones, and those of a uniform "
        "sample are "
        f"{of.judged('η3 of uniform states over exact η3, intermediate μ')} times as long.",
        "samplers",
        "exact-intervals",
    )


def _strong(of: _Numbers) -> Highlight:
    statement = "corr(f_n, ΔF_n) is significant at intermediate μ"
    return Highlight(
        "Strong contacts are the least determined: at intermediate μ the correlation between f_n "
        f"and the length of its exact interval is {of.judged(statement, 'exact')}.",
        "figure6_exact",
        "measures",
    )


def _wider(of: _Numbers) -> Highlight:
    return Highlight(
        "The paper's walk is not uniform in S: its states spread "
        f"{of.judged('η1 of the walk over η1 of S, intermediate μ')} times as far as uniform "
        "states at intermediate μ, and "
        f"{of.judged('η1 of the walk over η1 of S, small μ')} times as far at small μ.",
        "distances",
        "uniform-sampling",
    )


def _alike(of: _Numbers) -> Highlight:
    statement = "η1 ≈ η2 ≈ 0.15 η3 up to a constant factor: value of η1/η3"
    return Highlight(
        "The three measures agree up to constant factors: η1/η3 is "
        f"{of.judged(statement, 'nearest')} in walks that project onto S, and "
        f"{of.judged(statement, 'gauss_seidel')} in walks that use the paper's sweeps.",
        "figure1",
        "measures",
    )


def _critical(of: _Numbers) -> Highlight:
    return Highlight(
        "Where friction matters, a contact gives way below its limit load: the ratio of F_crit to "
        f"the limit load is {of.judged('⟨F_crit⟩ over ⟨limit load⟩, small μ')} at small, "
        f"{of.judged('⟨F_crit⟩ over ⟨limit load⟩, intermediate μ')} at intermediate and "
        f"{of.judged('⟨F_crit⟩ over ⟨limit load⟩, large μ')} at large μ.",
        "figure2_limit",
        "local-perturbation",
    )


def _stability(of: _Numbers) -> Highlight:
    return Highlight(
        "The critical force is only loosely related to indeterminacy: over all μ, its rank "
        f"correlation is {of.judged('F_crit rises with η', 'exact')} with the exact η3 and "
        f"{of.judged('F_crit rises with η', 'nearest')} with η2 of nearest walks.",
        "figure2",
        "local-perturbation",
    )


def _shear(of: _Numbers) -> Highlight:
    return Highlight(
        "A packing compressed isotropically can carry shear: the largest possible ratio of "
        "shear stress to pressure is "
        f"{of.judged('largest shear stress over pressure, intermediate μ')} at intermediate μ.",
        "stresses",
        "stresses",
    )


def _volume(of: _Numbers) -> Highlight:
    return Highlight(
        "The volume of S shrinks as friction decreases: ln V per grain is "
        f"{of.judged('ln V per grain, forces in ⟨f_n⟩, large μ')} at large, "
        f"{of.judged('ln V per grain, forces in ⟨f_n⟩, intermediate μ')} at intermediate and "
        f"{of.judged('ln V per grain, forces in ⟨f_n⟩, small μ')} at small μ.",
        "volumes",
        "volume",
    )


SENTENCES: tuple[Callable[[_Numbers], Highlight], ...] = (
    *(_maximum, _free_forces, _coverage, _strong, _wider, _alike, _critical, _stability, _shear),
    _volume,
)


def highlights(table: StudyTable, claims: Rows, findings: Rows) -> list[Highlight]:
    """The findings for which the study has all numbers."""
    numbers, complete = _Numbers(table, claims, findings), []
    for sentence in SENTENCES:
        try:
            complete.append(sentence(numbers))
        except KeyError:
            continue
    return complete
