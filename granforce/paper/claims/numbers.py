"""The numbers of claims that come from rows of packings: η, z, responses, correlations.

Each function takes a `tables.StudyTable` and a sampler, and yields the cases of a claim.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from granforce.measures import statistics
from granforce.paper.claims.groups import (
    BARELY_RIGID,
    LARGE,
    LEAST_DYNAMIC,
    MIDDLE,
    SAMPLERS,
    SMALL,
    Groups,
    dynamic,
    enough,
    items,
    positive,
    positive_friction,
    rows_of,
    within,
)
from granforce.paper.claims.verdicts import FRACTION, Case, at_each, over_all, peak, slope, turning
from granforce.paper.tables import StudyTable
from granforce.types import Floats

MEASURES = (("eta1", "η1"), ("eta2", "η2"), ("eta3", "η3"))
RATIOS = (("eta2", "eta1", "η2/η1"), ("eta1", "eta3", "η1/η3"), ("eta2", "eta3", "η2/η3"))
GIVEN = ("η1/η3", "η2/η3")  # ratios of which the paper gives the number
ANSWERS = (("critical_force", "F_crit"), ("decay_exponent", "α"))
FEWEST_SHELLS = 4  # fewer do not distinguish the two laws
FROZEN_SMALL = 0.05  # μ up to which contacts with frozen surroundings are judged as at small μ
# Names of the two ranges of μ for these contacts.
SMALL_FROZEN, LARGE_FROZEN = f"μ ≤ {FROZEN_SMALL:g}", f"μ ≥ {BARELY_RIGID:g}"
# Parts with repeated walks.
_AGAIN = {"gauss_seidel": "repeat_sweeps", "nearest": "repeat_walk"}


def ratios(table: StudyTable, sampler: str) -> Iterator[tuple[str, Groups]]:
    """The logarithms of the ratios of η1, η2 and η3, by μ ≥ LEAST_DYNAMIC."""
    rows = dynamic(rows_of(table, sampler))
    for above, below, word in RATIOS:
        known = positive(rows, above, below)
        yield word, items(known.assign(log=np.log(known[above] / known[below])), "log")


def constancy(table: StudyTable, sampler: str) -> Iterator[Case]:
    """The largest over the smallest of each ratio."""
    for word, logs in ratios(table, sampler):
        yield from over_all(word, lambda _, means: np.exp(np.ptp(means)), logs, least=3)


def factors(table: StudyTable, sampler: str) -> Iterator[Case]:
    """The geometric mean over μ of the ratios of which the paper gives one."""
    for word, logs in ratios(table, sampler):
        if word in GIVEN:
            yield from over_all(word, lambda _, means: np.exp(np.mean(means)), logs, span=word)


def _etas(table: StudyTable, sampler: str) -> Iterator[tuple[str, Groups]]:
    rows = rows_of(table, sampler)
    for name, label in MEASURES[2:] if sampler == "exact" else MEASURES:
        yield label, positive_friction(items(positive(rows, name), name))


def turns(table: StudyTable, sampler: str) -> Iterator[Case]:
    """The rise and fall of each η."""
    for label, groups in _etas(table, sampler):
        yield from turning(label, groups)


def peaks(table: StudyTable, sampler: str) -> Iterator[Case]:
    """The μ at which each η is largest."""
    for label, groups in _etas(table, sampler):
        yield from over_all(label, peak, groups, least=3)


def measure_of(sampler: str) -> str:
    """The η that a claim about "η" is judged by."""
    return "eta3" if sampler == "exact" else "eta2"


def smallest(table: StudyTable, sampler: str) -> Iterator[Case]:
    """The slope of log η against log μ below LEAST_DYNAMIC."""
    name = measure_of(sampler)
    groups = positive_friction(items(positive(rows_of(table, sampler), name), name))
    yield from over_all("", slope, within(groups, (0, LEAST_DYNAMIC / 10)))


def repeated(table: StudyTable, sampler: str) -> Iterator[Case]:
    """The scatter of η2 over walks in the same packing, relative to its mean."""
    part, first = _AGAIN[sampler], rows_of(table, sampler)
    names = table.rows["part"]
    again = table.rows[names.str.startswith(f"{part}_") & (names != f"{part}_long")]
    again = statistics.paired(again[enough(again)], first)[first.columns]
    known = statistics.paired(first, again[["mu", "seed"]].drop_duplicates())[first.columns]
    packings = pd.concat([known, again]).groupby(["mu", "seed"], as_index=False)
    scatter = packings.agg(n=("n", "first"), part=("eta2", lambda eta: eta.std() / eta.mean()))
    yield from at_each(items(scatter, "part"), possible=(0, np.inf))


def sizes(table: StudyTable, sampler: str) -> Iterator[Case]:
    """The slope of log η against log N at each μ with several N."""
    name = measure_of(sampler)
    part = {"exact": "size_exact", "nearest": "size", "gauss_seidel": "size_sweeps"}[sampler]
    sized = table.part(part)
    rows = positive(pd.concat([sized, rows_of(table, sampler)]), name)
    for mu in sorted(sized["mu"].unique()):
        groups = items(rows[rows["mu"] == mu], name, by="n")
        for case in over_all(f"μ = {mu:g}", slope, groups):
            yield case._replace(largest=mu)


def coordination(table: StudyTable, sampler: str) -> Iterator[Case]:
    """z at the smallest μ of contact dynamics minus z at the largest."""
    groups = items(dynamic(table.part("exact")), "coordination")
    yield from over_all("", lambda _, means: means[0] - means[-1], groups)


def fewer_contacts(table: StudyTable, sampler: str) -> Iterator[Case]:
    """Rank correlation of exact η3 with the μ of preparation, for cones of the largest μ."""
    wide = table.part("widest_exact")
    if not len(wide):
        return
    # Packings made at both ends of the μ of preparation have those cones in other parts.
    ends = table.part("opened_exact", "exact")
    wide = pd.concat([wide, ends[ends["mu"] == wide["mu"].max()]])
    wide = wide.assign(made=wide["packing_mu"].fillna(wide["mu"]))
    groups = items(wide, "eta3", by="made")
    yield from over_all("", statistics.rank_correlation, groups, least=3)


def answer_peaks(table: StudyTable, sampler: str) -> Iterator[Case]:
    """The μ at which F_crit and α are largest."""
    for name, label in ANSWERS:
        groups = positive_friction(items(table.part("response"), name))
        yield from over_all(label, peak, groups, least=3)


def answers(table: StudyTable, sampler: str) -> Iterator[Case]:
    """The spread of F_crit and of α at equal η; see `spread`."""
    eta = measure_of(sampler)
    rows = positive(table.answers(SAMPLERS[sampler], eta), eta)
    for name, label in ANSWERS:
        groups = positive_friction(items(rows, eta, name))
        yield from over_all(label, lambda _, means: spread(means), groups, least=3)


def spread(means: Any) -> float:
    """Mean distance of responses beyond the maximum of η(μ) from those below it at the same η.

    It is in units of the whole range of the responses. means: (k, 2), η and the response at each μ.
    NaN if no η beyond the maximum is reached below it.
    """
    eta, answer = means.T
    top = int(np.argmax(eta))
    order = np.argsort(eta[: top + 1])
    below, known = eta[: top + 1][order], answer[: top + 1][order]
    beyond = [k for k in range(top + 1, len(eta)) if below[0] <= eta[k] <= below[-1]]
    if not beyond:
        return np.nan
    apart = [abs(answer[k] - np.interp(eta[k], below, known)) for k in beyond]
    return float(np.mean(apart) / np.ptp(answer))


def law(table: StudyTable, sampler: str) -> Iterator[Case]:
    """Misfit of the first motion to a power law over that to an exponential, at each μ."""
    groups: Groups = {}
    for row in table.part("response").itertuples():
        decay = table.decays.get(row.Index, ())
        if len(decay) >= FEWEST_SHELLS:
            groups.setdefault(row.mu, []).append((row.n, decay))
    yield from at_each({mu: groups[mu] for mu in sorted(groups)}, interval=_misfits)


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


def pair_distances(table: StudyTable, sampler: str) -> Iterator[Case]:
    """Relative scatter of the distances between networks."""
    yield from at_each(items(dynamic(rows_of(table, sampler)), "pair_spread"))


def centre(table: StudyTable, sampler: str) -> Iterator[Case]:
    """Distance of the original network from the centre over that of the others."""
    rows = positive(dynamic(rows_of(table, sampler)), "dimension", "mean_distance")
    if sampler == "uniform":  # whose cells do not have the original network
        ratio = rows["original_ratio"]
    else:
        ratio = rows["original_distance"] / rows["mean_distance"]
    yield from at_each(items(rows.assign(ratio=ratio), "ratio"))


def everywhere(table: StudyTable, sampler: str) -> Iterator[Case]:
    """Undetermined fraction of the force-carrying contacts."""
    rows = positive(table.part("exact"), "mu", "contacts")
    yield from at_each(items(rows, "undetermined_part"), possible=FRACTION)


def frozen(table: StudyTable, sampler: str) -> Iterator[Case]:
    """Fraction of the contacts in a frozen boundary that are undetermined, or in one cluster."""
    rows = positive(table.part("frozen"), "contacts")
    rows = rows.assign(cluster_part=rows["largest_cluster"] / rows["contacts"])
    for name, span, word in (
        ("undetermined_part", (0, FROZEN_SMALL), SMALL_FROZEN),
        ("cluster_part", (BARELY_RIGID, np.inf), LARGE_FROZEN),
    ):
        yield from at_each(within(items(rows, name), span), possible=FRACTION, span=word)


def _correlations(table: StudyTable, sampler: str) -> Groups:
    return items(positive(rows_of(table, sampler), "mu"), "correlation")


def significant(table: StudyTable, sampler: str) -> Iterator[Case]:
    """corr(f_n, ΔF_n) at intermediate μ."""
    yield from at_each(within(_correlations(table, sampler), MIDDLE))


def vanishing(table: StudyTable, sampler: str) -> Iterator[Case]:
    """corr(f_n, ΔF_n) at large μ."""
    yield from at_each(within(_correlations(table, sampler), LARGE))


def weaker(table: StudyTable, sampler: str) -> Iterator[Case]:
    """corr(f_n, ΔF_n) at small and at large μ minus that at intermediate μ."""
    yield from beside_middle(_correlations(table, sampler), np.subtract)


def beside_middle(groups: Groups, compare: Callable[[float, float], float]) -> Iterator[Case]:
    """The mean of the means at small and at large μ, compared with that at intermediate μ."""
    for label, span in (("small μ", SMALL), ("large μ", LARGE)):
        outer, inner = within(groups, span), within(groups, MIDDLE)
        if outer and inner:

            def compared(keys: Floats, means: Floats, outer: Groups = outer) -> float:
                far = np.isin(keys, list(outer))
                return float(compare(means[far].mean(), means[~far].mean()))

            yield from over_all(label, compared, dict(sorted((outer | inner).items())))
