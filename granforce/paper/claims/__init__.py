"""The paper's claims, judged by the reduced study.

Each claim of `table.CLAIMS` is judged by every way to draw networks that it lists; the first that
was measured decides, which is the paper's own walk wherever networks are needed and those of the
walk are close enough to S. How a verdict follows from numbers and a range is in `verdicts`.

Samplers: "gauss_seidel", the paper's relaxation, whose sweeps end at 10⁻³ of ⟨f_n⟩ here, which they
reach at every μ; "nearest" networks; "uniform" states; "exact" bounds; and "" for packings alone.
A name that ends in "late drag" is of packings in which drag sets in later.

Verdicts are not corrected for the number of claims: each is an answer of its own.
"""

from typing import Any

from granforce.paper.claims.table import CLAIMS, Claim
from granforce.paper.claims.verdicts import (
    CONTRADICTED,
    DEPENDS,
    MISSING,
    REPRODUCED,
    Case,
    verdict_of,
)
from granforce.paper.tables import StudyTable
from granforce.types import Rows

# From this μ on, results depend on how packings come to rest, and claims need both preparations.
PREPARED_FROM = 1.0
LATE_DRAG = "prepared_late_drag"
# Both preparations have these parts.
_PREPARED = {"walk": LATE_DRAG, "exact": f"{LATE_DRAG}_exact"}


def judge(table: StudyTable) -> Rows:
    """All claims about a `tables.StudyTable` as dicts, even without data.

    "by" has, for each sampler, its verdict and cases; "late" is the verdict in packings with late
    drag, and "same_networks" that by default with networks drawn alike at the same μ. Both are
    empty if the claim is not about μ ≥ PREPARED_FROM, or if packings with late drag lack the
    numbers.
    """
    usual, late = in_preparations(table)
    return [_judge(claim, table, usual, late) for claim in CLAIMS]


def _judge(claim: Claim, table: StudyTable, usual: StudyTable, late: StudyTable) -> dict[str, Any]:
    cases = {name: list(claim.measure(table, name)) for name in claim.samplers}
    by = {name: verdict_of(one, claim.ranges) for name, one in cases.items()}
    measured = [name for name in by if by[name]["verdict"] != MISSING]
    sampler = (measured or list(by))[0]
    verdict, needed = by[sampler]["verdict"], _large(cases[sampler])
    # The paper's walk and uniform networks are known in one preparation.
    both = next((name for name in claim.samplers if name not in ("gauss_seidel", "uniform")), "")
    other = list(claim.measure(late, both)) if needed else []
    late_verdict = compared = ""
    if _large(other):
        by[f"{both}, late drag" if both else "late drag"] = of_late = verdict_of(
            other, claim.ranges
        )
        late_verdict = of_late["verdict"]
        compared = verdict_of(list(claim.measure(usual, both)), claim.ranges)["verdict"]
        if {late_verdict, compared} == {REPRODUCED, CONTRADICTED}:
            verdict = DEPENDS
    return {
        "id": claim.id,
        "figure": claim.figure,
        "place": claim.place or f"Fig. {claim.figure}, text",
        "text": claim.text,
        "number": claim.number,
        "range": claim.range(),
        "why": claim.why,
        "chosen": claim.chosen,
        "verdict": verdict,
        "sampler": sampler,
        "late": late_verdict,
        "same_networks": compared,
        "one_preparation": needed and not late_verdict,
        "by": by,
    }


def _large(cases: list[Case]) -> bool:
    """Whether cases are about friction at which the preparation matters."""
    return any(case.largest >= PREPARED_FROM for case in cases)


def in_preparations(table: StudyTable) -> tuple[StudyTable, StudyTable]:
    """The table as it is, and with late drag, at the μ ≥ PREPARED_FROM that both have."""
    rows = table.rows
    shared = set(rows["mu"][rows["part"] == LATE_DRAG])
    large = rows["mu"] >= PREPARED_FROM
    kept = ~large | rows["part"].isin(_PREPARED) & rows["mu"].isin(shared)
    usual = rows.assign(part=rows["part"].where(kept, ""))
    changed = {late: part for part, late in _PREPARED.items()}
    parts = rows["part"].where(~large, rows["part"].map(changed).fillna(""))
    # The place of a row names its samples: no row is removed.
    return table._replace(rows=usual), table._replace(rows=rows.assign(part=parts))
