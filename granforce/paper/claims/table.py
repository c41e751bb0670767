"""The claims of the paper and of an earlier letter: what they say, and what is measured."""

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from granforce.paper.claims import contacts, numbers
from granforce.paper.claims.groups import Ends
from granforce.paper.claims.verdicts import Case, range_text
from granforce.paper.tables import StudyTable

# When a range was chosen: before the packings of this study were made, though the results of its
# earlier versions were known, or after.
BEFORE, AFTER = "before", "after"
BY_WALKS = ("gauss_seidel", "nearest")
BY_STATES = (*BY_WALKS, "uniform")  # these have η1 and η2
BY_ALL = (*BY_STATES, "exact")
PACKINGS = ("",)  # no states are needed
PAPERS_PEAK = 0.1  # μ at which the paper finds the largest η
_NEAR = {"": (PAPERS_PEAK / 2, PAPERS_PEAK * 2)}
_NEAR_WHY = "Near means within a factor of two."
_SIGN = "The sign alone is claimed."

# The paper's figures, and what the claims about each are about.
TOPICS = {
    1: "Indeterminacy against friction",
    2: "Response to a local force",
    3: "Networks of one packing",
    4: "Lengths of the intervals",
    5: "Strong and undetermined contacts",
    6: "Correlation of force and interval",
}


class Claim(NamedTuple):
    """A claim in our words, the number that it is judged by, and the range that it states."""

    id: str
    figure: int  # of the paper, to which it belongs
    text: str
    number: str
    ranges: Mapping[str, Ends]  # by the span of a case; a single one has no name
    why: str  # this range
    measure: Callable[[StudyTable, str], Iterator[Case]]
    samplers: tuple[str, ...] = BY_ALL  # the first that is measured decides
    chosen: str = BEFORE
    place: str = ""  # in the paper or the letter, if it is not the text on its figure

    def range(self) -> str:
        """The range in words."""
        named = ((span, range_text(good)) for span, good in self.ranges.items())
        return "; ".join(f"{span}: {words}" if span else words for span, words in named)


def _at_most(end: float) -> dict[str, Ends]:
    return {"": (-np.inf, end)}


def _at_least(end: float) -> dict[str, Ends]:
    return {"": (end, np.inf)}


LETTER = "letter"  # PRL 94, 178001, before the paper
CLAIMS = (
    Claim(
        "alike",
        1,
        "η1, η2 and η3 depend on μ in the same way: they are equal up to constant factors.",
        "largest ratio over the smallest at μ ≥ 0.001",
        {"": (1, 1.5)},
        "Much less than η itself varies, by a factor of three or more.",
        numbers.constancy,
        BY_STATES,
    ),
    Claim(
        "factors",
        1,
        "The factors are η1 ≈ 0.15 η3 and η2 ≈ 0.15 η3.",
        "geometric mean of the ratio over μ ≥ 0.001",
        dict.fromkeys(numbers.GIVEN, (0.12, 0.18)),
        "The factor 0.15 is taken within a fifth.",
        numbers.factors,
        BY_STATES,
    ),
    Claim(
        "turns",
        1,
        "η(μ) is not monotonic: it rises, and then falls.",
        "the smaller of the rise to the maximum and of the fall from it, over the maximum",
        _at_least(0),
        _SIGN,
        numbers.turns,
    ),
    Claim(
        "peak",
        1,
        "η(μ) is largest near μ = 0.1.",
        "μ at the top of a parabola in log μ",
        _NEAR,
        _NEAR_WHY,
        numbers.peaks,
    ),
    Claim(
        "linear",
        1,
        "η vanishes in proportion to μ as μ → 0.",
        "slope of log exact η3 against log μ, μ = 10⁻⁵ … 10⁻⁴",
        {"": (0.9, 1.1)},
        "The limit is judged at the smallest μ, after slopes at larger μ were known.",
        numbers.smallest,
        ("exact", "nearest", "uniform"),
        chosen=AFTER,
        place=LETTER,
    ),
    Claim(
        "reproducible",
        1,
        "η is well reproducible: other walks in the same packing give the same value.",
        "standard deviation of η2 over three walks, over its mean",
        _at_most(0.05),
        "Small compared with the differences between packings.",
        numbers.repeated,
        BY_WALKS,
        place="text",
    ),
    Claim(
        "size",
        1,
        "η hardly depends on the number N of disks.",
        "slope of log η2 against log N; for exact η3 see the findings",
        {"": (-0.1, 0.1)},
        "Less than 15 % for four times as many disks.",
        numbers.sizes,
        (*BY_WALKS, "exact"),
        place="text",
    ),
    Claim(
        "coordination",
        1,
        "The coordination z depends strongly on μ, and falls.",
        "z at μ = 0.001 minus z at the largest μ",
        _at_least(0.5),
        "Half of the way from 4 to 3, where packings without and with friction are isostatic.",
        numbers.coordination,
        PACKINGS,
        chosen=AFTER,
        place="Fig. 1, inset",
    ),
    Claim(
        "fewer-contacts",
        1,
        "With the same μ in Coulomb's law, η is smaller in packings that were made with more "
        "friction, and have fewer contacts.",
        "rank correlation of mean exact η3 with the μ of preparation, for the largest μ in "
        "Coulomb's law",
        {"": (-1, -0.95)},
        "Monotonic, but for noise.",
        numbers.fewer_contacts,
        ("exact",),
        place=LETTER,
    ),
    Claim(
        "response-peak",
        2,
        "The critical force F_crit and the exponent α are largest near μ = 0.1, as η is.",
        "μ at the top of a parabola in log μ",
        _NEAR,
        _NEAR_WHY,
        numbers.answer_peaks,
        PACKINGS,
    ),
    Claim(
        "response",
        2,
        "F_crit and α are strongly related to η: they are not unique functions of it, but similar "
        "at similar η.",
        "distance of means at equal η, one at smaller and one at larger μ than the maximum of η, "
        "over the whole range of the means",
        _at_most(0.5),
        "Responses at equal η are similar if they differ by less than half as much as all do.",
        numbers.answers,
        chosen=AFTER,
    ),
    Claim(
        "power-law",
        2,
        "The first motion |u|(r) decays as a power law.",
        "misfit of the best power law over that of the best exponential, rms of ln |u|",
        _at_most(1),
        "The power law fits better.",
        numbers.law,
        PACKINGS,
    ),
    Claim(
        "pair-distances",
        3,
        "Distances between pairs of networks are sharply peaked.",
        "standard deviation over mean, μ ≥ 0.001",
        _at_most(0.2),
        "A peak is sharp if it is narrow compared with its distance from zero.",
        numbers.pair_distances,
        BY_STATES,
        place="text",
    ),
    Claim(
        "centre",
        3,
        "The original network lies closer to the mean of sampled ones than these do.",
        "its distance from the mean over their mean distance, μ ≥ 0.001",
        _at_most(1),
        _SIGN,
        numbers.centre,
        BY_STATES,
        place=LETTER,
    ),
    Claim(
        "relative-turns",
        3,
        "The relative extent ΔF_n/F_orig of a contact is not monotonic in μ: it rises, and then "
        "falls.",
        "the smaller of rise and fall, over the maximum, of the median over contacts",
        _at_least(0),
        _SIGN,
        contacts.relative_turns,
        place="Fig. 3",
    ),
    Claim(
        "relative-weak",
        3,
        "Weak contacts have the largest relative extents ΔF_n/F_orig.",
        "rank correlation of ΔF_n/F_orig with F_orig, μ ≥ 0.001",
        _at_most(-0.3),
        "More than a trend that many contacts make significant.",
        contacts.relative_weak,
        place="Fig. 3",
    ),
    Claim(
        "shape",
        4,
        "P(ΔF_n) falls monotonically at small and at large μ, and has a peak at intermediate μ.",
        "departure from a falling density",
        {"small": (-np.inf, 0.05), "intermediate": (0.1, np.inf), "large": (-np.inf, 0.05)},
        "0.05 and 0.1 are those of Weibull distributions with exponents 1.5 and 2.",
        contacts.shape,
    ),
    Claim(
        "tail",
        4,
        "The tail of P(ΔF_n) is exponential at small μ, falls faster at intermediate, and more "
        "slowly at large μ.",
        "b of exp(−(λ ΔF_n)^b) beyond the upper quartile",
        {"small": (0.85, 1.15), "intermediate": (1, np.inf), "large": (-np.inf, 1)},
        "b = 1 is exponential. Of three quantiles that were judged, this is that of Figure 4.",
        contacts.tails,
        chosen=AFTER,
    ),
    Claim(
        "width",
        4,
        "P(ΔF_n) is broader at intermediate μ.",
        "μ at the top of a parabola in log μ, for the standard deviation of ΔF_n",
        {"": (0.05, 0.3)},
        "Our range of intermediate μ.",
        contacts.width,
    ),
    Claim(
        "elongation",
        4,
        "S is more elongated at small and at large than at intermediate μ.",
        "mean of std/mean of ΔF_n over that at intermediate μ",
        _at_least(1),
        _SIGN,
        contacts.elongation,
    ),
    Claim(
        "equal-counts",
        5,
        "At μ = 0.1, f_n > 2⟨f_n⟩ and ΔF_n > ⟨ΔF_n⟩ hold for about equally many contacts.",
        "number of the former over that of the latter",
        {"": (0.8, 1.25)},
        "About equally many means within a fifth.",
        contacts.counts,
    ),
    Claim(
        "patterns",
        5,
        "At μ = 10, contacts with f_n > 2⟨f_n⟩ and those with ΔF_n > ⟨ΔF_n⟩ form seemingly "
        "different patterns.",
        "share of the former among the latter, on a scale from 0 (as of all contacts) to 1",
        _at_most(0.5),
        "Closer to unrelated patterns than to the same one.",
        contacts.patterns,
        chosen=AFTER,
    ),
    Claim(
        "everywhere",
        5,
        "With only the pressure prescribed, indeterminacy is everywhere.",
        "undetermined fraction of the force-carrying contacts, μ > 0",
        _at_least(0.9),
        "At most one contact in ten is determined.",
        numbers.everywhere,
        ("exact",),
    ),
    Claim(
        "frozen",
        5,
        "With frozen boundary forces, indeterminacy is almost everywhere at μ ≤ 0.05, and in small "
        "clusters at μ ≥ 0.5.",
        "fraction of the contacts inside that are undetermined, or in the largest cluster",
        {numbers.SMALL_FROZEN: (0.75, np.inf), numbers.LARGE_FROZEN: (-np.inf, 0.25)},
        "Three quarters of the contacts are most of them, a quarter is a small part.",
        numbers.frozen,
        ("exact",),
        place=LETTER,
    ),
    Claim(
        "significant",
        6,
        "The correlation of f_n with ΔF_n is significant at intermediate μ.",
        "corr(f_n, ΔF_n), mean over packings",
        _at_least(0.1),
        "More than two standard deviations of its values for shuffled f_n.",
        numbers.significant,
    ),
    Claim(
        "weaker",
        6,
        "The correlation of f_n with ΔF_n is weaker at small and at large than at intermediate μ.",
        "mean of corr(f_n, ΔF_n) minus that at intermediate μ",
        _at_most(0),
        _SIGN,
        numbers.weaker,
    ),
    Claim(
        "vanishing",
        6,
        "The correlation of f_n with ΔF_n vanishes at large μ.",
        "corr(f_n, ΔF_n), mean over packings",
        {"": (-0.1, 0.1)},
        "The complement of a significant one.",
        numbers.vanishing,
    ),
    Claim(
        "origin",
        6,
        "The correlation of f_n with ΔF_n is of statistical origin: the position of f_n in its "
        "interval hardly matters.",
        "corr(f_n, ΔF_n) minus its mean if positions are shuffled among contacts, intermediate μ",
        {"": (-0.1, 0.1)},
        "Small compared with the correlation.",
        contacts.origin,
        place="footnote on Fig. 6",
    ),
)
