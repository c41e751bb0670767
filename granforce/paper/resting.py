"""h and exact η3 at large friction, by the imbalance at which drag replaces inertia."""

import numpy as np

from granforce.measures import statistics
from granforce.packing.compaction import NEARLY_BALANCED
from granforce.paper import plan as plans
from granforce.paper.formatting import with_error
from granforce.paper.tables import StudyTable, packings_at_each
from granforce.system import markdown

_MEASURED = (("h", "dimension"), ("exact η3", "eta3"))
_FRICTIONS = (1.0, 10.0)


def resting(table: StudyTable) -> str:
    """A table with a line for each preparation; empty without such packings."""
    known = [part for part in plans.RESTING if part in table.parts()]
    if not known:
        return ""
    columns = [(f"{word}, μ = {mu:g}", name, mu) for word, name in _MEASURED for mu in _FRICTIONS]
    lines = []
    for part in known:
        rows = table.part(part)
        line = [_below(part), packings_at_each(rows[rows["mu"].isin(_FRICTIONS)])]
        for _, name, mu in columns:
            values = statistics.grouped(rows, name)
            line.append(with_error(values[mu]) if mu in values else "")
        lines.append(line)
    return markdown.table(["drag below, ⟨f_n⟩", "packings", *(head for head, *_ in columns)], lines)


def _below(part: str) -> str:
    """The imbalance below which drag acts in the packings of a part, in ⟨f_n⟩."""
    below = plans.RESTING[part].get("drag_below", NEARLY_BALANCED)
    power = int(np.floor(np.log10(below)))
    return f"{below / 10.0**power:.2g}·10{str(power).translate(markdown.RAISED)}"
