"""One verdict per claim, from those by sampler, and their numbers."""

from typing import Any

from granforce.paper.claims.verdicts import (
    CONTRADICTED,
    FEW,
    MISSING,
    REPRODUCED,
    STRONGLY,
    UNDECIDED,
    UNMEASURED,
)
from granforce.types import Rows

PAPERS = "gauss_seidel"  # the sampler of the paper
# Whose verdict is the verdict on the claim: the first of these that a claim has and that was
# measured. No other sampler replaces the paper's, even where its verdict is open.
FIRST = (PAPERS, "exact", "")
# Verdict → its symbol in tables.
SYMBOLS = {
    REPRODUCED: "✓",
    CONTRADICTED: "✗",
    STRONGLY: "✗✗",
    UNDECIDED: "?",
    FEW: "…",
    UNMEASURED: "–",
    MISSING: "–",
}
# Outcome → verdicts on a claim, in the order of the tables.
OUTCOMES = {
    "contradicted": (STRONGLY, CONTRADICTED),
    "open": (UNDECIDED, FEW, UNMEASURED, MISSING),
    "reproduced": (REPRODUCED,),
}


def by_claim(claims: Rows) -> dict[str, dict[str, dict[str, Any]]]:
    """The claims of each id, by sampler."""
    grouped: dict[str, dict[str, dict[str, Any]]] = {}
    for claim in claims:
        grouped.setdefault(claim["id"], {})[claim["sampler"]] = claim
    return grouped


def decisive(by_sampler: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """The claim by the sampler whose verdict counts; see FIRST."""
    candidates = [by_sampler[name] for name in (*FIRST, *by_sampler) if name in by_sampler]
    measured = [claim for claim in candidates if claim["verdict"] != UNMEASURED]
    return (measured or candidates)[0]


def decided(claims: Rows) -> list[dict[str, Any]]:
    """The decisive claim of each id."""
    return [decisive(by_sampler) for by_sampler in by_claim(claims).values()]


def counted(claims: Rows) -> dict[str, int]:
    """The number of claims with each outcome of OUTCOMES."""
    verdicts = [claim["verdict"] for claim in decided(claims)]
    return {word: sum(map(verdicts.count, words)) for word, words in OUTCOMES.items()}


def score(claims: Rows) -> str:
    """How many claims have which outcome, in sentences."""
    count = counted(claims)
    strongly = sum(claim["verdict"] == STRONGLY for claim in decided(claims))
    by_walk = sum(claim["sampler"] == PAPERS for claim in decided(claims))
    return (
        f"The study that ships with granforce tests {sum(count.values())} claims of the paper and "
        "of an earlier letter (PRL 94, 178001), with variants counted separately: "
        f"{count['reproduced']} are reproduced, {count['contradicted']} contradicted "
        f"({strongly} strongly) and {count['open']} open (undecided or too few data). {by_walk} of "
        "them are judged with the paper's own random walk, the others with exact intervals, the "
        "packings or their response to a push."
    )
