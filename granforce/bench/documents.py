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
# Heads of columns whose names in the rows are short; columns without a head have their name.
HEADS = {
    "mu": "μ",
    "differ": "largest difference",
    "off": "largest difference",
    "solver": "method",
    "seeds": "packings",
    "way": "method",
    "eta1": "η1",
    "eta2": "η2",
    "eta3": "η3",
    "eta3_part": "η3/exact",
    "mean_extent": "mean ΔF_n",
    "extent_part": "ΔF_n/exact",
    "states": "networks",
    "ms_per_state": "ms per network",
    "seconds_per_state": "CPU seconds per effective network",
    "effective": "effective networks",
    "setup_seconds": "set-up seconds",
    "r_hat": "R̂",
    "two_cores": "speed-up on two cores",
    "null_space_ratio": "null space/set-up",
    "z_mean": "difference of means",
    "z_square": "difference of squares",
    "chi_square": "χ²",
    "phi": "φ",
    "setup": "set-up / s",
    "relaxation": "one relaxation / s",
    "bound": "one bound / s",
    "max_gap": "largest gap",
    "peak_MB": "memory / MB",
    "without": "seconds without",
    "sigma": "σ",
    "mu_over_true": "assumed/true μ",
    "raw_f_n": "f_n: measured",
    "likeliest_f_n": "f_n: most likely",
    "raw_f_t": "f_t: measured",
    "likeliest_f_t": "f_t: most likely",
    "raw_stress": "pressure: measured",
    "stress": "pressure: most likely",
    "cover": "coverage",
    "said_to_carry": "reported to carry",
    "carry": "precision of report",
    "chi": "χ²/degrees of freedom",
    "suspected": "recall of outliers",
    "told": "precision of outliers",
}
HIDDEN = ("counts",)  # columns of JSON that no table shows
# Part → the columns of its tables, for parts with more than a page has room for.
COLUMNS: dict[str, tuple[tuple[str, ...], ...]] = {
    "relaxation": (("n", "mu", "solver", "seconds", "worst_residual", "reached", "ratio", "note"),),
    "walks": (
        (
            "n",
            "mu",
            "solver",
            "packings",
            "states",
            "eta1",
            "eta2",
            "eta3",
            "acceptance",
            "seconds",
        ),
    ),
    "intervals": (("n", "mu", "method", "states", "seconds", "eta3", "eta3_part", "extent_part"),),
    "uniform": (
        ("n", "mu", "h", "method", "seconds_per_state", "ratio", "effective", "r_hat", "two_cores"),
        ("n", "mu", "h", "method", "z_mean", "z_square", "setup_seconds", "null_space_ratio"),
    ),
    "inference": (
        ("n", "mu", "unknowns", "method", "seconds", "ratio", "chi_square", "off", "residual"),
    ),
    "knowledge": (
        ("n", "mu", "task", "programs", "method", "seconds", "ratio", "gap", "off", "residual"),
    ),
    "frames": (
        (
            *("n", "sigma", "missed", "mu_over_true", "raw_f_n", "likeliest_f_n", "raw_f_t"),
            *("likeliest_f_t", "cover"),
        ),
        (
            *("n", "sigma", "missed", "mu_over_true", "said_to_carry", "carry", "suspected"),
            *("told", "chi"),
        ),
    ),
    "compaction_frictions": (
        ("n", "mu", "seeds", "failed", "seconds", "slowest", "phi", "z", "h"),
    ),
    "compaction_growth": (("n", "mu", "seeds", "failed", "seconds", "slowest", "z", "h"),),
}
CONSTANT = ("n", "mu", "packings", "states", "unknowns")  # stated above a table if all rows agree
USUAL = 400  # disks, of which a sentence says how long they take
# Part → a column without which a row shows nothing.
NEEDED = {"uniform": "seconds_per_state"}
# Columns of ratios, and the parts in which the ratio is the time of the row over granforce's; in
# others it is the time of a baseline over that of the row.
RATIOS = "ratio", "ratio_to_piqp"
OVER_GRANFORCE = "uniform", "inference"
SPEED_UP, RELATIVE_TIME = "speed-up", "relative time"  # heads of these columns
# Part → its section, for parts that are often not measured.
SECTIONS = {
    "masonry": (
        "## Walls of blocks\n\n"
        "We compute bounds for 16 contacts, the horizontal load factor and 100 uniform networks of "
        "a dry-stone wall. For the\nbounds, the baseline is one HiGHS model that starts each "
        "program from the last basis; for the load factor, it is\n`scipy.optimize.linprog`. "
        "Neither certifies its result. Where R̂ is above 1.1, 100 networks are too few to\n"
        "represent the uniform distribution.\n\n"
    )
}
# Task, baseline, part, columns of the method and of granforce's error, and the method with a ratio:
# granforce's, or the baseline where times are relative to granforce's.
SUMMARY = (
    (
        "certified bounds",
        "a loop with HiGHS",
        "interval_methods",
        "method",
        "error",
        "granforce, 1 thread",
    ),
    ("nearest network", "Gauss–Seidel sweeps", "relaxation", "solver", "worst_residual", "nearest"),
    ("nearest networks, side by side", "PIQP", "starts", "solver", "", "8 lanes"),
    (
        "uniform networks",
        "coordinate hit-and-run",
        "uniform",
        "method",
        "",
        "coordinate hit-and-run",
    ),
    ("critical forces, side by side", "one after another", "pushes", "way", "", "8 lanes"),
    ("inference", "PIQP", "inference", "method", "", "PIQP"),
)


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
    markdown.renew(
        paths,
        KIND,
        lambda path, part: markdown.typeset(
            _TEXTS[part](results) if part in _TEXTS else _table(part, shown.get(part))
        ),
    )


def _summary(results: Mapping[str, Any]) -> str:
    """How much faster granforce is than a baseline at each task, and its error, as a table."""
    lines = []
    for task, baseline, part, column, error, method in SUMMARY:
        rows = [row for row in results.get(part) or [] if row.get(column) == method]
        ratio = next((name for row in rows for name in RATIOS if name in row), "")
        factors = {row[ratio]: _shown(row, ratio) for row in rows if row.get(ratio) is not None}
        if factors:
            errors = [row[error] for row in rows if row.get(error) is not None]
            ends = dict.fromkeys(factors[end] for end in (min(factors), max(factors)))
            lines.append([task, baseline, " to ".join(ends), _cell(max(errors)) if errors else ""])
    return markdown.table(["task", "baseline", "times faster", "largest error, ⟨f_n⟩"], lines)


def _extent(results: Mapping[str, Any]) -> str:
    """Whether the run was a quick one, in a sentence."""
    cores = results["environment"].get("cores", "?")
    if results.get("quick"):
        return (
            f"It was a quick run (`--quick`) on {cores} cores: small packings and few repetitions, "
            "so the numbers are only indicative.\n"
        )
    return f"It was a full run on {cores} cores.\n"


def _table(part: str, rows: Any) -> str:
    """The rows of a part as a table; empty for a part that was not measured."""
    if not rows:
        return ""
    if isinstance(rows, dict):  # the environment
        libraries = {name: version for name, version in rows["libraries"].items() if version}
        values = {name: value for name, value in rows.items() if name != "libraries"} | libraries
        return markdown.table(["", "value"], [[name, str(value)] for name, value in values.items()])
    if part in NEEDED:
        rows = [row for row in rows if row.get(NEEDED[part]) is not None]
    if part == "compaction_growth":  # the exponent of the fit is below the times, as in `growth`
        fitted = [
            {"n": "exponent", "mu": row["mu"], "seconds": row["exponent"]}
            for row in rows
            if row["n"] == "fit"
        ]
        rows = [*(row for row in rows if row["n"] != "fit"), *fitted]
    every = tuple(dict.fromkeys(name for row in rows for name in row))
    chosen = COLUMNS.get(part, (every,))
    constant = [
        name
        for name in CONSTANT
        if part in COLUMNS and len(rows) > 1 and len({str(row.get(name)) for row in rows}) == 1
        if name in every and any(name in names for names in chosen)
    ]
    above = ", ".join(f"{_head(part, name)} = {_cell(rows[0][name])}" for name in constant)
    tables = [
        _columns(part, rows, [name for name in names if name not in constant]) for names in chosen
    ]
    above = f"In all rows, {above}.\n\n" if above else ""
    below = _long(rows) if part == "growth" else ""
    return SECTIONS.get(part, "") + above + "\n".join(tables) + below


def _long(rows: Rows) -> str:
    """How long a thousand relaxations and bounds take in packings of USUAL disks, in a sentence."""
    for row in rows:
        if row["n"] == USUAL:
            seconds = (f"{1000 * row[name]:.1f} s" for name in ("relaxation", "bound"))
            return "\nWith {} disks, 1000 relaxations take {} and 1000 bounds {}.\n".format(
                USUAL, *seconds
            )
    return ""


def _columns(part: str, rows: Rows, names: Sequence[str]) -> str:
    """A table of the named columns that have any value."""
    names = [
        name
        for name in names
        if name not in HIDDEN and any(row.get(name) not in (None, "") for row in rows)
    ]
    heads = [_head(part, name) for name in names]
    return markdown.table(heads, [[_shown(row, name) for name in names] for row in rows])


def _head(part: str, name: str) -> str:
    if name in RATIOS:
        return RELATIVE_TIME if part in OVER_GRANFORCE else SPEED_UP
    return HEADS.get(name, name.replace("_", " "))


def _shown(row: Mapping[str, Any], name: str) -> str:
    """A cell: with its standard error, of how many, or as a lower bound, where rows have these."""
    text = _cell(row.get(name))
    if f"{name}_error" in row:
        return f"{text} ± {_cell(row[f'{name}_error'])}"
    if name == "reached" and "runs" in row:
        return f"{text} of {row['runs']}"
    return f"≥ {text}" if name == "ratio" and row.get("ratio_is_lower_bound") else text


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else ""
    if isinstance(value, float):
        return f"{value:.3g}"
    return str(value).replace(" states", " networks")


_TEXTS = {"quick": _extent, "summary": _summary}  # marks that are no part
