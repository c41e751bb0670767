"""Claims about the response to a local force, against η (Figure 2)."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from granforce.measures import statistics
from granforce.paper.claims.figure1 import peaked
from granforce.paper.claims.groups import SAMPLERS, Groups, items, positive, positive_friction
from granforce.paper.claims.verdicts import CORRELATION, POSITIVE, Claim, at_each, over_all
from granforce.paper.tables import StudyTable
from granforce.types import Floats

FEWEST_SHELLS = 4  # fewer do not distinguish the two laws
_ANSWERS = (("critical_force", "F_crit"), ("decay_exponent", "α"))


def perturbation(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """F_crit and α are largest near μ = 0.1."""
    for name, label in _ANSWERS:
        groups = positive_friction(items(table.part("response"), name))
        yield peaked(f"{name}-peak", f"{label} is largest near μ = 0.1", groups)


def response(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """F_crit and α rise with η, and are similar at similar η."""
    eta, word = ("eta3", "exact η3") if sampler == "exact" else ("eta2", "η2")
    rows = table.answers(SAMPLERS[sampler], eta)
    for name, label in _ANSWERS:
        groups = positive_friction(items(positive(rows, eta), eta, name))
        yield over_all(
            f"{name}-rises",
            f"{label} rises with η",
            f"rank correlation of mean {label} with mean {word} over μ > 0",
            lambda _, means: statistics.rank_correlation(*means.T),
            groups,
            good=(0.7, 1),
            fair=(0.3, 1),
            least=3,
            possible=CORRELATION,
        )
        yield over_all(
            f"{name}-branches",
            f"{label} is similar at equal η on both sides of the maximum",
            f"{label} beyond the maximum of {word}(μ) over that below it at the same {word}, "
            "mean of the ratios",
            lambda _, means: branches(means),
            groups,
            good=(0.8, 1.25),
            fair=(1 / 1.5, 1.5),
            least=3,
            possible=POSITIVE,
        )


def law(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """The first motion falls with distance as a power law, not exponentially."""
    groups: Groups = {}
    for row in table.part("response").itertuples():
        decay = table.decays.get(row.Index, ())
        if len(decay) >= FEWEST_SHELLS:
            groups.setdefault(row.mu, []).append((row.n, decay))
    yield at_each(
        "power-law",
        "the first motion |u|(r) decays as a power law, not exponentially",
        "misfit of the best power law over that of the best exponential, rms of ln |u|",
        {mu: groups[mu] for mu in sorted(groups)},
        good=(-np.inf, 1),
        interval=_misfits,
        possible=POSITIVE,
    )


def _misfits(decays: Sequence[Floats], level: float) -> tuple[float, float, float]:
    """`misfit_ratio` with its jackknife interval, computed for its logarithm."""
    log = statistics.jackknife(lambda some: np.log(misfit_ratio(some)), decays, level)
    return tuple(np.exp(log).tolist())


def misfit_ratio(decays: Sequence[Floats]) -> float:
    """Misfit of mean ln |u| to the best power law in r, over that to the best exponential.

    decays: (shells, 2) of each packing, r in mean diameters and |u|; over shells that all have.
    """
    known = [dict(np.round(decay, 9)) for decay in decays]
    r = np.array(sorted(set.intersection(*(set(decay) for decay in known))))
    if len(r) < FEWEST_SHELLS:
        return np.nan
    u = np.exp(np.mean([[np.log(decay[x]) for x in r] for decay in known], axis=0))
    power, exponential = statistics.decay_misfits(r, u)
    return power / exponential


def branches(means: Any) -> float:
    """Ratio of responses at equal η beyond and below the maximum of η(μ); means (k, 2) of both.

    NaN if no η beyond the maximum is reached below it.
    """
    eta, answer = means.T
    top = int(np.argmax(eta))
    order = np.argsort(eta[: top + 1])
    below, known = eta[: top + 1][order], answer[: top + 1][order]
    beyond = [k for k in range(top + 1, len(eta)) if below[0] <= eta[k] <= below[-1]]
    if not beyond:
        return np.nan
    return np.mean([answer[k] / np.interp(eta[k], below, known) for k in beyond])
