"""h and exact η3 at large friction, by the imbalance at which drag replaces inertia."""

import numpy as np
import pandas as pd

from granforce.measures import statistics
from granforce.packing.compaction import NEARLY_BALANCED
from granforce.paper import plan as plans
from granforce.paper.formatting import with_error
from granforce.paper.tables import StudyTable, packings_at_each
from granforce.system import markdown

_MEASURED = (("h", "dimension"), ("exact η3", "eta3"))
_FRICTIONS = (1.0, 10.0)


def resting_rows(table: StudyTable) -> pd.DataFrame:
    """The rows of packings that differ in when drag sets in, with the imbalance "drag_below"."""
    rows = table.part(*plans.RESTING)
    usual = {part: how.get("drag_below", NEARLY_BALANCED) for part, how in plans.RESTING.items()}
    return rows.assign(drag_below=rows["part"].map(usual))


def resting(table: StudyTable) -> str:
    """A table with a line for each preparation; empty without such packings."""
    rows = resting_rows(table)
    if not len(rows):
        return ""
    rows = rows[rows["mu"].isin(_FRICTIONS)]
    columns = [(f"{word}, μ = {mu:g}", name, mu) for word, name in _MEASURED for mu in _FRICTIONS]
    lines = []
    for below, group in sorted(rows.groupby("drag_below"), reverse=True):
        line = [_power(below), packings_at_each(group)]
        for _, name, mu in columns:
            values = statistics.grouped(group, name)
            line.append(with_error(values[mu]) if mu in values else "")
        lines.append(line)
    return markdown.table(["drag below, ⟨f_n⟩", "packings", *(head for head, *_ in columns)], lines)


def _power(number: float) -> str:
    power = int(np.floor(np.log10(number)))
    return f"{number / 10.0**power:.2g}·10{str(power).translate(markdown.RAISED)}"
