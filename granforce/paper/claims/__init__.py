"""The paper's claims, judged by the reduced study, separately for each way to draw states of S.

Every claim has a number, its 95 % confidence interval over packings, and two ranges: an
interpretation of the claim's words, and a wider one. A claim is "reproduced" if the whole interval
is in the first range, "contradicted" if it is entirely outside the first, "strongly contradicted"
if it is also entirely outside a wider one, and "undecided" if it crosses an end of the first range,
or if another draw of means or the omission of one μ would change the verdict (`verdicts`). Claims
about a range of μ are judged at each μ in it, so that no mean hides a change of sign. Claims about
the shape of P(ΔF_n) use no bins.

Samplers: "gauss_seidel", the paper's relaxation, whose sweeps end at 10⁻³ of ⟨f_n⟩ here, which they
reach at every μ; "gauss_seidel_1e-4" and "gauss_seidel_1e-6", the same to 10⁻⁴ and 10⁻⁶; "nearest"
networks; "uniform" states; and "exact" bounds. If the networks from sweeps exceed the exact
intervals by more than the length of those, they are not judged, and the claim says at which μ.
Claims about packings alone have no sampler. Sources: "PRE", the paper; "PRL", the letter before it.

The modules are named after the paper's figures to which the claims belong.
"""

from collections.abc import Callable, Iterable, Sequence

from granforce.paper.claims.figure1 import (
    agreement,
    causes,
    coordination,
    maximum,
    measure,
    reproducible,
    size,
    small_friction,
    vanishing,
)
from granforce.paper.claims.figure2 import law, perturbation, response
from granforce.paper.claims.figure3 import centre, pairs, relative
from granforce.paper.claims.figure4 import elongation, shape, tails, widths
from granforce.paper.claims.figure5 import counts, enrichment, frozen, patterns, place
from granforce.paper.claims.figure6 import correlation, error_bars, origin
from granforce.paper.claims.groups import SAMPLERS, outside
from granforce.paper.claims.verdicts import FEW, MISSING, Claim
from granforce.paper.tables import StudyTable

BY_SWEEPS = ("gauss_seidel", "gauss_seidel_1e-4", "gauss_seidel_1e-6")
BY_WALKS = (*BY_SWEEPS, "nearest")
BY_STATES = (*BY_WALKS, "uniform")  # these have η1 and η2

# The paper's figures, and what the claims about each are about.
TOPICS = {
    1: "Indeterminacy against friction",
    2: "Response to a local force",
    3: "Networks of one packing",
    4: "Lengths of the intervals",
    5: "Strong and undetermined contacts",
    6: "Correlation of force and interval",
}
# The families of each figure, and their samplers: none for claims about packings alone.
FAMILIES: dict[int, dict[Callable[..., Iterable[Claim]], tuple[str, ...]]] = {
    1: {
        agreement: BY_STATES,
        maximum: tuple(SAMPLERS),
        small_friction: tuple(SAMPLERS),
        vanishing: tuple(SAMPLERS),
        measure: BY_STATES,
        reproducible: ("gauss_seidel", "nearest"),
        causes: ("exact",),
        size: ("gauss_seidel", "nearest", "exact"),
        coordination: (),
    },
    2: {perturbation: (), response: tuple(SAMPLERS), law: ()},
    3: {pairs: BY_STATES, centre: BY_STATES, relative: tuple(SAMPLERS)},
    4: dict.fromkeys((shape, tails, widths, elongation), tuple(SAMPLERS)),
    5: {
        **dict.fromkeys((counts, enrichment, patterns), tuple(SAMPLERS)),
        place: ("exact",),
        frozen: ("exact",),
    },
    6: {correlation: tuple(SAMPLERS), error_bars: BY_WALKS, origin: tuple(SAMPLERS)},
}


def judged(table: StudyTable) -> list[Claim]:
    """All claims about a `tables.StudyTable`, the paper's sampler first, even without data.

    Samplers without rows in the table are left out, except the paper's.
    """
    known = [name for name, part in SAMPLERS.items() if len(table.part(part))]
    samplers = ["gauss_seidel", *(name for name in known if name != "gauss_seidel")]
    beyond = {name: outside(table, SAMPLERS[name]) for name in BY_SWEEPS}
    claims = []
    for figure, families in FAMILIES.items():
        for family, takes in families.items():
            for sampler in [name for name in samplers if name in takes] if takes else [""]:
                for claim in family(table, sampler):
                    lacking = (
                        claim.verdict == MISSING and len(table.rows) and sampler in ("", *known)
                    )
                    verdict = FEW if lacking else claim.verdict
                    claim = claim._replace(sampler=sampler, verdict=verdict, figure=figure)
                    claims.append(without(claim, beyond.get(sampler, [])))
    return claims


def without(claim: Claim, beyond: Sequence[float]) -> Claim:
    """The claim, with the μ at which it is not judged because states are outside S."""
    if not beyond:
        return claim
    where = f"outside S, and not judged, at {', '.join(f'{mu:g}' for mu in beyond)}"
    return claim._replace(why=f"{claim.why}; {where}" if claim.why else where, outside=beyond)
