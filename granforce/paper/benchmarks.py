"""The benchmark's tables in documents, between <!-- bench: PART --> and <!-- end -->."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from granforce.paper import filled
from granforce.paper.formatting import markdown_table
from granforce.records import InputError, brief
from granforce.system.files import content_of

KIND = "bench"
# Heads of columns whose names in the rows are short.
HEADS = {
    "differ": "largest difference",
    "way": "method",
    "eta3_part": "η3/exact",
    "extent_part": "extent/exact",
}
# Part → what ratios below 1 mean, and the column. In parts whose ratio is the time of a baseline
# over that of the row, those rows are slower; in others the time of the row is over granforce's.
SLOWER, FASTER = "Slower than the baseline", "Faster than granforce"
RATIOS = {
    "interval_methods": (SLOWER, "ratio"),
    "relaxation": (SLOWER, "ratio"),
    "starts": (SLOWER, "ratio_to_piqp"),
    "pushes": (SLOWER, "ratio"),
    "knowledge": (SLOWER, "ratio"),
    "masonry": (SLOWER, "ratio"),
    "skips": ("Slower with the shortcut", "ratio"),
    "uniform": (FASTER, "ratio"),
    "inference": (FASTER, "ratio"),
}
NAMES = ("solver", "method", "way", "skipped")  # columns that name a row


def load(path: str) -> dict[str, Any]:
    """The results that `granforce bench --out` wrote; InputError for another file."""
    try:
        results = json.loads(content_of(path))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not JSON ({brief(str(error))})") from None
    if not isinstance(results, dict) or "environment" not in results:
        raise InputError(f"{path}: not a benchmark; granforce bench --out FOLDER writes one")
    return results


def renew(paths: Sequence[Path], results: Mapping[str, Any]) -> None:
    """Write the tables into files with marks."""
    filled.renew(paths, KIND, lambda path, part: _table(part, results.get(part)))


def _table(part: str, rows: Any) -> str:
    """The rows of a part as a table; empty for a part that was not measured."""
    if not rows:
        return ""
    if isinstance(rows, dict):  # the environment
        libraries = {name: version for name, version in rows["libraries"].items() if version}
        values = {name: value for name, value in rows.items() if name != "libraries"} | libraries
        return markdown_table(["", "value"], [[name, str(value)] for name, value in values.items()])
    remark = _remark(part, rows)
    names = list(dict.fromkeys(name for row in rows for name in row))
    names = [name for name in names if any(row.get(name) not in (None, "") for row in rows)]
    heads = [HEADS.get(name, name.replace("_", " ")) for name in names]
    rows = [[_cell(row.get(name)) for name in names] for row in rows]
    return markdown_table(heads, rows) + remark


def _remark(part: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """A paragraph on the rows in which granforce is the slower one; empty if there are none."""
    if part not in RATIOS:
        return ""
    words, column = RATIOS[part]
    below = [
        f"{next(row[name] for name in NAMES if name in row)} {_place(row)} ({_cell(row[column])})"
        for row in rows
        if row.get(column) is not None and row[column] < 1
    ]
    return f"\n{words} (ratio below 1): {'; '.join(below)}.\n" if below else ""


def _place(row: Mapping[str, Any]) -> str:
    words = {"n": "n = ", "mu": "μ = ", "packing": "", "task": "", "what": ""}
    return ", ".join(f"{word}{row[name]}" for name, word in words.items() if name in row)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else ""
    return f"{value:.3g}" if isinstance(value, float) else str(value)
