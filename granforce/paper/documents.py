"""The study's tables in documents, renewed between two marks: no number is copied by hand."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from granforce.measures import statistics
from granforce.paper.claims.figure1 import skipped
from granforce.paper.claims.groups import drawn
from granforce.paper.tables import Table
from granforce.records import InputError, Rows
from granforce.system.files import written

MARK = re.compile(r"(<!-- study: (\w+) -->\n).*?(<!-- end -->)", re.S)

_HEADS = {
    "gauss_seidel": "paper's sweeps, to 10⁻³",
    "gauss_seidel_1e-4": "to 10⁻⁴",
    "nearest": "nearest",
    "uniform": "uniform",
    "exact": "exact",
    "": "packings alone",
}


def named(files: str | None) -> list[Path]:
    """The paths of files separated by commas, or none; InputError for those without a mark."""
    paths = [Path(name) for name in (files or "").split(",") if name]
    for path in paths:
        if not path.is_file() or not MARK.search(path.read_text()):
            raise InputError(f"--documents: {path} is no file with <!-- study: … --> in it")
    return paths


def renew(paths: Sequence[Path], table: Table, claims: Rows) -> None:
    """Write the tables of a `tables.Table` and its judged claims (dicts) into marked files."""
    known = {"measures": lambda: measures(table), "claims": lambda: claim_table(claims)}
    for path in paths:
        text = path.read_text()
        for name in {name for _, name, _ in MARK.findall(text)} - set(known):
            raise InputError(f"{path}: no table {name!r}: take {' or '.join(known)}")
        renewed = MARK.sub(lambda m: m[1] + known[m[2]]() + m[3], text)
        with written(path) as file:
            file.write(renewed.encode())


def measures(table: Table) -> str:
    """η1 to η3 against μ as a table: of the paper's sampler, and beside it of others."""
    columns = (
        ("z", "gauss_seidel", "coordination", 1.0, "{:.3f}"),
        ("h", "gauss_seidel", "dimension", 1.0, "{:.0f}"),
        ("η1", "gauss_seidel", "eta1", 1.0, None),
        ("η2", "gauss_seidel", "eta2", 1.0, None),
        ("0.15 η3", "gauss_seidel", "eta3", 0.15, None),
        ("nearest η2", "nearest", "eta2", 1.0, None),
        ("exact 0.15 η3", "exact", "eta3", 0.15, None),
        ("uniform η2", "uniform", "eta2", 1.0, None),
    )
    means = []
    for _, sampler, name, factor, _ in columns:
        rows = drawn(table, sampler)
        if sampler != "exact" and name.startswith("eta"):
            rows = [row for row in rows if not skipped(row)]  # were not measured
        means.append({mu: (m, e) for mu, m, e in statistics.means(rows, name, factor=factor)})
    lines = [[f"{mu:g}"] for mu in sorted(set().union(*means))]
    for (head, *_, form), column in zip(columns, means, strict=True):
        for line in lines:
            mean, error = column.get(float(line[0]), (None, None))
            text = "" if mean is None else form.format(mean) if form else _short(mean)
            line.append(f"{text} ± {error:.3f}" if head == "η2" and text else text)
    return _markdown(["μ", *(head for head, *_ in columns)], lines)


def claim_table(claims: Rows) -> str:
    """Claims with number, interval and verdict, a line for each and a column for each sampler."""
    lines: dict[Any, Any] = {}
    for claim in claims:
        key = claim["statement"], claim["source"], claim["criterion"]
        lines.setdefault(key, {})[claim["sampler"]] = claim
    rows = []
    for (statement, source, criterion), found in lines.items():
        criterion = criterion.replace("[", "(").replace("]", ")")
        cells = [_verdict(found[name]) if name in found else "" for name in _HEADS]
        rows.append([statement, source, criterion, *cells])
    return _markdown(["claim", "from", "criterion", *_HEADS.values()], rows)


def _verdict(claim: dict[str, Any]) -> str:
    why = f" ({claim['why']})" if claim["why"] else ""
    if not np.isfinite(claim["value"]):
        return claim["verdict"] + why
    ends = f" ({claim['low']:.3g} … {claim['high']:.3g})" if np.isfinite(claim["low"]) else ""
    return f"{claim['value']:.3g}{ends}: {claim['verdict']}{why}"


def _short(value: float) -> str:
    """Three decimals, or two digits of what is smaller."""
    if abs(value) < 1e-9:
        return "< 10⁻⁹"
    return f"{value:.3f}" if abs(value) >= 0.01 else f"{value:.2g}"


def _markdown(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
