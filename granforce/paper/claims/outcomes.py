"""One verdict per claim, from those by sampler, and their numbers."""

from typing import Any

from granforce.paper.claims.verdicts import (
    DIFFERS,
    FAILED,
    FEW,
    MISSING,
    REPRODUCED,
    UNDECIDED,
    UNMEASURED,
)
from granforce.paper.formatting import listed
from granforce.types import Rows

MIXED = "depends on the sampler"
PAPERS = "gauss_seidel"  # the sampler of the paper
# Of the verdicts by sampler, the first of these is the verdict on the claim.
VERDICTS = (REPRODUCED, DIFFERS, FAILED, UNDECIDED, FEW, UNMEASURED, MISSING)
# Outcome → verdicts on a claim, in the order of the tables.
OUTCOMES = {
    "differ": (FAILED, DIFFERS),
    "depend on the sampler": (MIXED,),
    "open": (UNDECIDED, FEW, UNMEASURED, MISSING),
    "reproduced": (REPRODUCED,),
}


def by_claim(claims: Rows) -> dict[tuple[str, str, str], dict[str, dict[str, Any]]]:
    """The claims of each (statement, source, criterion), by sampler."""
    grouped: dict[tuple[str, str, str], dict[str, dict[str, Any]]] = {}
    for claim in claims:
        key = claim["statement"], claim["source"], claim["criterion"]
        grouped.setdefault(key, {})[claim["sampler"]] = claim
    return grouped


def together(by_sampler: dict[str, dict[str, Any]]) -> str:
    """One verdict on a claim: that of the samplers that decide it, MIXED if they disagree."""
    verdicts = {claim["verdict"] for claim in by_sampler.values()}
    decided = verdicts & {REPRODUCED, DIFFERS, FAILED}
    if REPRODUCED in decided and len(decided) > 1:
        return MIXED
    return next(word for word in VERDICTS if word in verdicts)


def counted(claims: Rows) -> dict[str, int]:
    """The number of claims with each outcome of OUTCOMES."""
    verdicts = [together(by_sampler) for by_sampler in by_claim(claims).values()]
    return {word: sum(map(verdicts.count, words)) for word, words in OUTCOMES.items()}


def score(claims: Rows) -> str:
    """How many claims have which outcome, in a sentence."""
    count, paper = counted(claims), counted([c for c in claims if c["sampler"] == PAPERS])
    parts = [
        f"{count['reproduced']} are reproduced ({paper['reproduced']} by the paper's own walk)",
        f"{count['differ']} contradicted ({paper['differ']} by that walk)",
    ]
    parts += [f"{count['open']} open (undecided or too few data)"] if count["open"] else []
    mixed = count["depend on the sampler"]
    parts += [f"{mixed} depends on how S is sampled"] if mixed else []
    return (
        f"The study that ships with granforce tests {sum(count.values())} claims of the paper and "
        f"of an earlier letter (PRL 94, 178001): {listed(parts)}."
    )
