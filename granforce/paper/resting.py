"""h and exact η3 at large friction, by the imbalance at which drag replaces inertia."""

import numpy as np

from granforce.measures import statistics
from granforce.packing.compaction import NEARLY_BALANCED
from granforce.paper import plan as plans
from granforce.paper.formatting import listed, with_error
from granforce.paper.tables import StudyTable, packings_at_each
from granforce.system import markdown

_MEASURED = (("h", "dimension"), ("exact η3", "eta3"))


def resting(table: StudyTable) -> str:
    """A table for each number, with a line for each preparation; empty without such packings."""
    known = [part for part in plans.RESTING if part in table.parts()]
    text = ""
    for word, name in _MEASURED:
        groups = {part: statistics.grouped(table.part(part), name) for part in known}
        frictions = sorted(set().union(*groups.values()))
        lines = [
            [_below(part), *(with_error(group[mu]) if mu in group else "" for mu in frictions)]
            for part, group in groups.items()
        ]
        heads = [f"{word}, drag below, ⟨f_n⟩", *(f"μ = {mu:g}" for mu in frictions)]
        text += f"{markdown.table(heads, lines)}\n" if lines else ""
    if not text:
        return text
    numbers = [f"{packings_at_each(table.part(part))} for {_below(part)}" for part in known]
    return f"{text}Packings at each μ: {listed(numbers)}.\n"


def _below(part: str) -> str:
    """The imbalance below which drag acts in the packings of a part, in ⟨f_n⟩."""
    below = plans.RESTING[part].get("drag_below", NEARLY_BALANCED)
    power = int(np.floor(np.log10(below)))
    return f"{below / 10.0**power:.2g}·10{str(power).translate(markdown.RAISED)}"
