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
# Heads of columns whose names in the rows are short; columns without a head have their name.
HEADS = {
    "mu": "μ",
    "differ": "largest difference",
    "off": "largest difference",
    "way": "method",
    "eta1": "η1",
    "eta1_error": "standard error of η1",
    "eta2": "η2",
    "eta2_error": "standard error of η2",
    "eta3": "η3",
    "eta3_error": "standard error of η3",
    "eta3_part": "η3/exact",
    "mean_extent": "mean ΔF_n",
    "extent_part": "ΔF_n/exact",
    "distance": "distance from centre",
    "distance_error": "standard error of distance",
    "original": "distance of original network",
    "ratio_is_lower_bound": "lower bound",
    "seconds_per_state": "seconds per effective state",
    "effective": "effective states",
    "r_hat": "R̂",
    "two_cores": "speed-up on two cores",
    "null_space_ratio": "null space/set-up",
    "z_mean": "difference of means",
    "z_square": "difference of squares",
    "chi_square": "χ²",
    "above": "excess of minimum",
    "phi": "φ",
    "peak_MB": "peak MB",
    "without": "seconds without",
    "sigma": "σ",
    "mu_over_true": "assumed/true μ",
    "raw_f_n": "f_n: measured",
    "likeliest_f_n": "f_n: most likely",
    "mean_f_n": "f_n: mean",
    "raw_f_t": "f_t: measured",
    "likeliest_f_t": "f_t: most likely",
    "mean_f_t": "f_t: mean",
    "likeliest_all": "all: most likely",
    "raw_stress": "pressure: measured",
    "stress": "pressure: most likely",
    "cover": "coverage",
    "said_to_carry": "reported to carry",
    "carry": "precision of report",
    "chi": "χ²/degrees of freedom",
    "suspected": "outliers: recall",
    "told": "outliers: precision",
}
HIDDEN = ("counts",)  # columns of JSON that no table shows
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
SPEED_UP, RELATIVE_TIME = "speed-up", "relative time"  # heads of these columns
# Part → its section, for parts that are often not measured.
SECTIONS = {
    "masonry": (
        "## Walls of blocks\n\n"
        "Bounds for 16 contacts, the horizontal load factor and 100 uniform states of dry-stone "
        "walls. The baseline of\nthe bounds is one HiGHS model that starts each program from the "
        "last basis, and that of the load factor\n`scipy.optimize.linprog`; neither certifies its "
        "result.\n\n"
    )
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
    sizes = {"sizes": "small (--quick)"} if results.get("quick") else {}
    shown = {**results, "environment": sizes | results.get("environment", {})}
    filled.renew(paths, KIND, lambda path, part: _table(part, shown.get(part)))


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
    names = [
        name
        for name in names
        if name not in HIDDEN and any(row.get(name) not in (None, "") for row in rows)
    ]
    heads = [HEADS.get(name, name.replace("_", " ")) for name in names]
    if part in RATIOS:
        heads[names.index(RATIOS[part][1])] = _ratio_head(part)
    rows = [[_cell(row.get(name)) for name in names] for row in rows]
    return SECTIONS.get(part, "") + markdown_table(heads, rows) + remark


def _ratio_head(part: str) -> str:
    return RELATIVE_TIME if RATIOS[part][0] == FASTER else SPEED_UP


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
    return f"\n{words} ({_ratio_head(part)} below 1): {'; '.join(below)}.\n" if below else ""


def _place(row: Mapping[str, Any]) -> str:
    words = {"n": "n = ", "mu": "μ = ", "packing": "", "task": "", "what": ""}
    return ", ".join(f"{word}{row[name]}" for name, word in words.items() if name in row)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else ""
    return f"{value:.3g}" if isinstance(value, float) else str(value)
