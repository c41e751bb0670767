"""The benchmark's tables in documents, between <!-- bench: PART --> and <!-- end -->."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from granforce.records import InputError, brief
from granforce.system import markdown
from granforce.system.files import content_of
from granforce.types import Rows

KIND = "bench"
# Part → {column: its head}; a table has only columns with values.
COLUMNS = {
    "cost": {
        "n": "n",
        "packing": "packing / s",
        "setup": "set-up / s",
        "relaxation": "nearest network / s",
        "bound": "one of 32 bounds / s",
    },
    "compaction_frictions": {"mu": "μ", "seconds": "median / s"},
    "frames": {
        "sigma": "σ",
        "raw_f_n": "f_n: measured",
        "likeliest_f_n": "f_n: inferred",
        "raw_f_t": "f_t: measured",
        "likeliest_f_t": "f_t: inferred",
        "cover": "coverage",
    },
}
# Task, baseline, part, method with a ratio, columns of the ratio and of granforce's error.
SUMMARY = (
    (
        "all bounds of a packing",
        "HiGHS, one after another",
        "interval_methods",
        "granforce, 1 thread",
        "ratio",
        "error",
    ),
    (
        "bounds and load factor of a wall",
        "HiGHS, scipy",
        "masonry",
        "granforce, certified",
        "ratio",
        "",
    ),
    ("nearest network", "Gauss–Seidel sweeps", "relaxation", "nearest", "ratio", "worst_residual"),
    ("eight nearest networks", "PIQP", "starts", "8 lanes", "ratio_to_piqp", ""),
    (
        "effective uniform networks",
        "coordinate hit-and-run",
        "uniform",
        "coordinate hit-and-run",
        "ratio",
        "",
    ),
    ("eight critical forces", "one after another", "pushes", "8 lanes", "ratio", "differ"),
    ("inference", "PIQP", "inference", "PIQP", "ratio", ""),
)
_METHODS = ("method", "solver", "way")  # columns that name the method of a row


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
    """Write the tables into files with marks; a part that was not measured stays empty."""

    def text_of(path: Path, part: str) -> str:
        if part == "run":
            return markdown.typeset(_run(results))
        if part == "summary":
            return markdown.typeset(_summary(results))
        if part not in COLUMNS:
            raise InputError(
                f"{path}: unknown table {part!r}; choose one of run, summary, {', '.join(COLUMNS)}"
            )
        rows = _cost(results) if part == "cost" else results.get(part, [])
        if part == "frames":
            rows = [row for row in rows if row["missed"] == 0 and row["mu_over_true"] == 1]
        return markdown.typeset(_table(part, rows))

    markdown.renew(paths, KIND, text_of)


def _run(results: Mapping[str, Any]) -> str:
    """The machine and the versions of a run, in a sentence."""
    environment = results["environment"]
    names = {name: version for name, version in environment["libraries"].items() if version}
    versions = ", ".join(f"{name} {version}" for name, version in names.items())
    extent = "a quick run, whose times are only indicative" if results["quick"] else "a full run"
    return (
        f"The numbers are from {extent} on {environment['cores']} cores ({environment['cpu']}), "
        f"with Python {environment['python']}, {versions}.\n"
    )


def _summary(results: Mapping[str, Any]) -> str:
    """How much faster granforce is than a baseline at each task, and its error, as a table."""
    lines = []
    for task, baseline, part, method, ratio, error in SUMMARY:
        rows = [row for row in results.get(part, []) if method in map(row.get, _METHODS)]
        factors = {row[ratio]: row for row in rows if row.get(ratio) is not None}
        if factors:
            errors = [row[error] for row in rows if row.get(error) is not None]
            ends = (factors[end] for end in sorted({min(factors), max(factors)}))
            shown = " to ".join(_bound(row) + _cell(row[ratio]) for row in ends)
            lines.append([task, baseline, shown, _cell(max(errors)) if errors else ""])
    return markdown.table(["task", "baseline", "times faster", "largest error, ⟨f_n⟩"], lines)


def _bound(row: Mapping[str, Any]) -> str:
    return "≥ " if row.get("ratio_is_lower_bound") else ""


def _cost(results: Mapping[str, Any]) -> Rows:
    """Rows: times against the number of disks, and the exponents of power laws in the last."""
    packings = {row["n"]: row for row in results.get("compaction_growth", [])}
    rows = [
        row | {"packing": packings.get(row["n"], {}).get("seconds")}
        for row in results.get("growth", [])
    ]
    for row in rows:
        if row["n"] == "exponent" and "fit" in packings:
            row["packing"] = packings["fit"]["exponent"]
    return rows


def _table(part: str, rows: Rows) -> str:
    heads = {
        name: head
        for name, head in COLUMNS[part].items()
        if any(row.get(name) is not None for row in rows)
    }
    cells = [[_cell(row.get(name)) for name in heads] for row in rows]
    return markdown.table([*heads.values()], cells) if rows else ""


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.3g}" if isinstance(value, float) else str(value)
