"""The study's tables in documents, written between two marks, so that no number is copied by hand.

A document contains <!-- study: NAME -->, the generated text, and <!-- end -->. Names: "measures" (η
against μ), "others" (other measures at each μ), "highlights" (ten findings, one sentence each),
"headlines" (the first four of them), "claims" (all claims), "findings" (numbers beyond the claims),
"sweeps" (the residual of the paper's sweeps, and their excess over S), "preparation" (how results
depend on the packing), "counts" (number of packings in each part).
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from granforce.measures import statistics
from granforce.paper import filled
from granforce.paper import plan as plans
from granforce.paper.claims.figure1 import skipped
from granforce.paper.claims.groups import RANGES, SAMPLERS, drawn, excesses, outside
from granforce.paper.formatting import NOTHING, RAISED, markdown_table, with_error
from granforce.paper.highlights import highlights
from granforce.paper.tables import StudyTable
from granforce.records import InputError
from granforce.types import Rows

KIND = "study"

_SWEPT_EXTENT = "sweeps 0.15 η3"
_NEAR, _FAR = 0.001, 0.1  # in extents of S: from the second on, the main table gives the excess
FIGURES = "../../../data/figures"  # relative to the results page
HEADLINES = 4  # highlights in the README
# Findings too numerous for a table; `claims.json` contains them.
_LONG = "departure of P("
_HEADS = {
    "gauss_seidel": "paper's sweeps, to 10⁻³",
    "gauss_seidel_1e-4": "to 10⁻⁴",
    "gauss_seidel_1e-6": "to 10⁻⁶",
    "nearest": "nearest",
    "uniform": "uniform",
    "exact": "exact",
    "": "packings alone",
}


def renew(paths: Sequence[Path], table: StudyTable, claims: Rows, findings: Rows) -> None:
    """Write the study's tables, judged claims and findings into files with marks.

    claims, findings: dicts of `claims.Claim`.
    """
    known = {
        "measures": lambda: measures(table),
        "others": lambda: others(table),
        "highlights": lambda: highlighted(table, claims, findings),
        "headlines": lambda: headlines(table, claims, findings),
        "claims": lambda: claim_table(claims),
        "sweeps": lambda: sweeps(table),
        "preparation": lambda: preparation(table),
        "findings": lambda: finding_table(findings),
        "counts": lambda: counts(table),
    }

    def text_of(path: Path, name: str) -> str:
        if name not in known:
            raise InputError(f"{path}: unknown table {name!r}; choose one of {', '.join(known)}")
        return known[name]()

    filled.renew(paths, KIND, text_of)


def measures(table: StudyTable) -> str:
    """φ, z, h and η against μ as a table, from the same packings in every column.

    The packings are those with exact intervals; a column with fewer of them states their number.
    The last column is the ratio of the paper's sweeps to nearest networks, packing by packing.
    """
    exact = table.part(SAMPLERS["exact"])
    every = {mu: {row["seed"] for row in group} for mu, group in _by_friction(exact).items()}
    swept, nearest = (table.part(SAMPLERS[name]) for name in ("gauss_seidel", "nearest"))
    ratios = _over(swept, nearest, "eta2")
    sources = {name: _drawn_by(table, name) for name in ("gauss_seidel", "nearest", "uniform")}
    columns = (
        ("φ", exact, "packing_fraction", 1.0, "{:.4f}"),
        ("z", exact, "coordination", 1.0, "{:.3f}"),
        ("h", exact, "dimension", 1.0, "{:.0f}"),
        ("exact 0.15 η3", exact, "eta3", 0.15, None),
        ("nearest η2", sources["nearest"], "eta2", 1.0, None),
        ("uniform η2", sources["uniform"], "eta2", 1.0, None),
        ("sweeps η1", sources["gauss_seidel"], "eta1", 1.0, None),
        ("sweeps η2", sources["gauss_seidel"], "eta2", 1.0, None),
        (_SWEPT_EXTENT, sources["gauss_seidel"], "eta3", 0.15, None),
        ("sweeps/nearest η2", ratios, "ratio", 1.0, None),
    )
    swept_part = SAMPLERS["gauss_seidel"]
    beyond, known = outside(table, swept_part), excesses(table, swept_part)
    lines = []
    for mu, seeds in every.items():
        line = [f"{mu:g}", str(len(seeds))]
        for head, rows, name, factor, form in columns:
            if mu in beyond and head.startswith("sweeps"):
                line.append("outside S")
                continue
            chosen = [row for row in rows if row["mu"] == mu and row["seed"] in seeds]
            line.append(_cell(chosen, name, factor, form, len(seeds)))
            if head == _SWEPT_EXTENT and mu in known and known[mu][0] > _FAR * known[mu][1]:
                line[-1] += f", excess {_excess(*known[mu])}"
        lines.append(line)
    return markdown_table(["μ", "packings", *(head for head, *_ in columns)], lines)


def others(table: StudyTable) -> str:
    """Intervals seen by walks, states of contacts, and the width of S against μ, as a table.

    Means ± standard errors over packings; ratios are of the same packing.
    """
    answers = [
        row | {"part": row["critical_force"] / row["limit_load"]}
        for row in table.responses()
        if row.get("limit_load", 0) > 0
    ]
    walk, uniform, exact = (table.part(SAMPLERS[name]) for name in ("nearest", "uniform", "exact"))
    columns = (
        ("walk/uniform η2", _over(walk, uniform, "eta2"), "ratio", None),
        ("walk/exact η3", _over(walk, exact, "eta3"), "ratio", None),
        ("uniform/exact η3", _over(uniform, exact, "eta3"), "ratio", None),
        ("F_crit, ⟨f_n⟩", answers, "critical_force", None),
        ("F_crit/limit load", answers, "part", None),
        ("α", answers, "decay_exponent", None),
        ("width of S, ⟨f_n⟩", table.part("volume"), "extent", None),
        ("ln V per grain", table.part("volume"), "log_volume_per_grain", None),
        (
            "undetermined fraction, frozen surroundings",
            table.part("frozen"),
            "undetermined_part",
            None,
        ),
        ("largest shear stress/pressure", table.part("stress"), "friction", None),
    )
    frictions = sorted({row["mu"] for _, rows, *_ in columns for row in rows if row["mu"] > 0})
    lines = []
    for mu in frictions:
        of_mu = [[row for row in rows if row["mu"] == mu] for _, rows, *_ in columns]
        most = max(map(len, of_mu))
        cells = [
            _cell(rows, name, 1.0, form, most)
            for rows, (_, _, name, form) in zip(of_mu, columns, strict=True)
        ]
        lines.append([f"{mu:g}", str(most), *cells])
    return markdown_table(["μ", "packings", *(head for head, *_ in columns)], lines)


def _over(rows: Rows, others: Rows, name: str) -> list[dict[str, Any]]:
    """Rows with the "ratio" of a number to that of another row of the same packing."""
    return [
        row | {"ratio": row[name] / other[name]}
        for row, other in statistics.paired(rows, others)
        if name in row and other.get(name, 0) > NOTHING
    ]


def sweeps(table: StudyTable) -> str:
    """Walks by sweeps, by their final residual: results and excess over S, as a table.

    Excess: how far the intervals of states exceed the exact ones, over the length of those, as
    means over packings.
    """
    lines = []
    for part, residual in plans.SWEEPS.items():
        known, beyond = excesses(table, part), outside(table, part)
        ratios = _over(table.part(part), table.part(SAMPLERS["nearest"]), "eta2")
        for mu, rows in _by_friction(table.part(part)).items():
            cells = [
                f"10{str(round(np.log10(residual))).translate(RAISED)}",
                f"{mu:g}",
                str(len(rows)),
                _cell(rows, "reached_part", 1.0, "{:.2f}", len(rows)),
                _cell(rows, "mean_sweeps", 1.0, "{:.0f}", len(rows)),
                _excess(*known[mu]) if mu in known else "",
            ]
            compared = [row for row in ratios if row["mu"] == mu]
            eta = (
                ["outside S"] * 2
                if mu in beyond
                else [
                    _cell(rows, "eta2", 1.0, None, len(rows)),
                    _cell(compared, "ratio", 1.0, None, len(rows)),
                ]
            )
            lines.append([*cells, *eta])
    heads = ("residual", "μ", "packings", "fraction reached", "sweeps per state", "excess")
    return markdown_table([*heads, "η2", "relative to nearest η2"], lines)


def _excess(excess: float, length: float) -> str:
    """The excess of states over S relative to its extent; all of it if S is one point."""
    if length < NOTHING:
        return "all" if excess > NOTHING else "0"
    part = excess / length
    return f"{part:.2g}" if part >= _NEAR else f"< {_NEAR:g}"


def preparation(table: StudyTable) -> str:
    """Dependence on the preparation: packings by how they are made, as a table, and a summary.

    In brackets: the difference from the default for the same seeds, in its own standard errors.
    """
    columns = (
        ("h", "exact", "dimension"),
        ("z", "exact", "coordination"),
        ("φ", "exact", "packing_fraction"),
        ("exact η3", "exact", "eta3"),
        ("η2", "walk", "eta2"),
    )
    variants = [
        part.removesuffix("_exact") for part in table.parts() if part.startswith("prepared_")
    ]
    variants = list(dict.fromkeys(variants))
    lines, differences = [], []
    for mu in sorted({row["mu"] for row in table.part(*variants)}):
        seeds = {row["seed"] for row in table.part(*variants) if row["mu"] == mu}
        for name in ("", *variants):
            parts = {"exact": f"{name}_exact" if name else "exact", "walk": name or "walk"}
            cells, counted = [], set()
            for _, source, measure in columns:
                rows = [
                    row
                    for row in table.part(parts[source], n=table.plan["n"])
                    if row["mu"] == mu and row["seed"] in seeds and measure in row
                ]
                counted.add(len(rows))
                text = with_error(np.array([row[measure] for row in rows])) if rows else ""
                if name and rows:
                    apart = _apart(rows, table.part(source, n=table.plan["n"]), measure)
                    if np.isfinite(apart):
                        differences.append(apart)
                        text += f" ({apart:+.1f})"
                cells.append(text)
            if counted != {0}:
                word = name.removeprefix("prepared_").replace("_", " ") or "default"
                lines.append([f"{mu:g}", word, str(max(counted)), *cells])
    heads = ["μ", "options", "packings", *(head for head, *_ in columns)]
    text = markdown_table(heads, lines)
    if not differences:
        return text
    size = np.abs(differences)
    chance = len(size) * 2 * stats.norm.sf(2)
    return text + (
        f"\n{int((size > 2).sum())} of {len(size)} differences exceed two standard errors "
        f"({chance:.1f} expected by chance); the largest is {size.max():.1f}.\n"
    )


def _apart(rows: Rows, others: Rows, name: str) -> float:
    """Mean difference of a number in the same packings, in its standard errors; NaN if unknown."""
    pairs = statistics.paired(rows, [other for other in others if name in other])
    apart = np.array([row[name] - other[name] for row, other in pairs])
    if len(apart) < 2 or not np.ptp(apart):
        return 0.0 if len(apart) > 1 and not apart.any() else float("nan")
    return float(apart.mean() / (apart.std(ddof=1) / np.sqrt(len(apart))))


def headlines(table: StudyTable, claims: Rows, findings: Rows) -> str:
    """The first highlights as a list."""
    chosen = highlights(table, claims, findings)[:HEADLINES]
    return "".join(f"- {one.sentence}\n" for one in chosen)


def highlighted(table: StudyTable, claims: Rows, findings: Rows) -> str:
    """All highlights as a numbered list, each with its figure and a link to its method."""
    return "".join(
        f"{k}. {one.sentence} ([figure]({FIGURES}/{one.figure}.png), "
        f"[method](method.md#{one.method}))\n"
        for k, one in enumerate(highlights(table, claims, findings), 1)
    )


def finding_table(findings: Rows) -> str:
    """Findings as a table: those at three ranges of μ in one row, all others below."""
    ranged: dict[str, dict[str, str]] = {}
    others = []
    for finding in findings:
        statement, number = finding["statement"], _number(finding)
        if statement.startswith(_LONG):
            continue
        for word, _ in RANGES:
            if statement.endswith(f", {word} μ"):
                ranged.setdefault(statement.removesuffix(f", {word} μ"), {})[word] = number
                break
        else:
            others.append([statement, number])
    words = [word for word, _ in RANGES]
    lines = [[name, *(numbers.get(word, "") for word in words)] for name, numbers in ranged.items()]
    first = markdown_table(["finding", *(f"{word} μ" for word in words)], lines) if lines else ""
    second = markdown_table(["finding", "number"], others) if others else ""
    return "\n".join(part for part in (first, second) if part)


def _number(finding: dict[str, Any]) -> str:
    if not np.isfinite(finding["value"]):
        return ""
    known = np.isfinite(finding["low"])
    ends = f" ({finding['low']:.3g} … {finding['high']:.3g})" if known else ""
    return f"{finding['value']:.3g}{ends}"


def counts(table: StudyTable) -> str:
    """Number of packings in each part at each μ, and their versions, as a table."""
    lines = []
    for part in table.parts():
        rows = table.part(part)
        for n in sorted({row["n"] for row in rows}):
            some = [row for row in rows if row["n"] == n]
            # Several packings may have the same friction of cones.
            seeds_at: dict[Any, set[int]] = {}
            for row in some:
                seeds_at.setdefault(row.get("packing_mu", row["mu"]), set()).add(row["seed"])
            each = sorted({len(seeds) for seeds in seeds_at.values()})
            span = f"{each[0]}" if len(each) == 1 else f"{each[0]} to {each[-1]}"
            versions = [_version(some, name) for name in ("version", "packing_version")]
            lines.append([part, str(n), str(len(seeds_at)), span, *versions])
    heads = ("part", "disks", "μ", "packings at each", "version", "version of packings")
    return markdown_table(heads, lines)


def _version(rows: Rows, name: str) -> str:
    return ", ".join(f"{v:g}" for v in sorted({row[name] for row in rows if name in row}))


def _by_friction(rows: Rows) -> dict[float, list[dict[str, Any]]]:
    groups: dict[float, list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault(row["mu"], []).append(row)
    return dict(sorted(groups.items()))


def _drawn_by(table: StudyTable, sampler: str) -> list[dict[str, Any]]:
    """Rows of a sampler with drawn states, without those where S is known to be one point."""
    return [row for row in drawn(table, sampler) if not skipped(row)]


def _cell(rows: Rows, name: str, factor: float, form: str | None, expected: int) -> str:
    """Mean ± standard error over rows, and their number if it is not the expected one."""
    numbers = np.array([row[name] for row in rows if name in row], dtype=float)
    values = factor * numbers[np.isfinite(numbers)]
    if not len(values):
        return ""
    mean = values.mean()
    text = form.format(mean) if form else with_error(values)
    return text if len(values) == expected else f"{text} ({len(values)})"


def claim_table(claims: Rows) -> str:
    """Claims with number, interval and verdict: one row per claim, one column per sampler."""
    lines: dict[Any, Any] = {}
    for claim in claims:
        key = claim["statement"], claim["source"], claim["criterion"]
        lines.setdefault(key, {})[claim["sampler"]] = claim
    rows = []
    for (statement, source, criterion), by_sampler in lines.items():
        criterion = criterion.replace("[", "(").replace("]", ")")
        cells = [_verdict(by_sampler[name]) if name in by_sampler else "" for name in _HEADS]
        rows.append([statement, source, criterion, *cells])
    return markdown_table(["claim", "source", "criterion", *_HEADS.values()], rows)


def _verdict(claim: dict[str, Any]) -> str:
    why = f" ({claim['why']})" if claim["why"] else ""
    if not np.isfinite(claim["value"]):
        return claim["verdict"] + why
    ends = f" ({claim['low']:.3g} … {claim['high']:.3g})" if np.isfinite(claim["low"]) else ""
    return f"{claim['value']:.3g}{ends}: {claim['verdict']}{why}"
