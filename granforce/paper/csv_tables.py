"""Numbers of the study as tables, which `granforce study` writes as CSV files into tables/.

friction: means at each μ; preparation: how they change with the options of packing; claims, and
their cases by each way to draw networks; findings: numbers beyond the claims; contents: number of
packings of each part.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from granforce.measures import statistics
from granforce.paper import plan as plans
from granforce.paper.claims.groups import SAMPLERS, positive, rows_of, skipped
from granforce.paper.formatting import NOTHING
from granforce.paper.tables import StudyTable
from granforce.system.files import make_folder, written
from granforce.types import Floats, Rows

WALKS = {
    "nearest": "nearest-network walk",
    "gauss_seidel": "paper's walk",
    "uniform": "uniform networks",
}
DEFAULT = "default"
# How packings are made, in words; see `plan.variations`.
OPTIONS = {
    "prepared_half_steps": "half Δt",
    "prepared_double_steps": "double Δt",
    "prepared_accuracy": "10 times the accuracy, 4 times the sweeps",
    "prepared_sweeps": "4 times the sweeps",
    "prepared_late_drag": "drag at 1/100 of the imbalance",
}
# What the parts contain whose names begin like this; see `plan`.
CONTENTS = {
    "exact": "exact intervals",
    "walk": "nearest-network walks",
    "uniform": "uniform networks",
    "response": "critical forces and first motions",
    "response_long": "critical forces, four times as many implicit steps",
    "response_fine": "critical forces, load steps a quarter as long",
    "sweeps_": "the paper's walk",
    "prepared_": "walks and exact intervals, packings made with other options",
    "resting_": "exact intervals of small packings, drag setting in earlier or later",
    "opened": "walks and exact intervals, frictionless packings with a larger μ in the Coulomb "
    "condition",
    "widest_exact": "exact intervals, packings of smaller μ with the largest μ in the Coulomb "
    "condition",
    "stress": "stresses that the contacts can carry",
    "stress_uniform": "stresses of uniform networks",
    "frozen": "exact intervals inside a frozen boundary",
    "volume": "volume of S",
    "repeat_": "repeated and longer walks",
    "size": "nearest-network walks, other numbers of disks",
    "size_sweeps": "the paper's walk, other numbers of disks",
    "size_exact": "exact intervals, other numbers of disks",
}
# Numbers that may depend on the preparation, the ending of their parts, and their names in rows.
_PREPARED = (
    ("h", "_exact", "dimension"),
    ("φ", "_exact", "packing_fraction"),
    ("exact η3", "_exact", "eta3"),
    ("η2, nearest-network walk", "", "eta2"),
)


def save(folder: Path, table: StudyTable, claims: Rows, findings: Rows) -> None:
    """Write all tables; claims, findings: as `documents.renew` takes them."""
    made = {
        "friction": by_friction(table),
        "preparation": by_preparation(table),
        "claims": by_claim(claims),
        "cases": by_case(claims),
        "findings": pd.DataFrame(findings),
        "contents": contents(table),
    }
    make_folder(folder)
    for name, frame in made.items():
        with written(folder / f"{name}.csv") as file:
            file.write(frame.to_csv(index=False, float_format="%.6g").encode())


def by_friction(table: StudyTable) -> pd.DataFrame:
    """Mean, standard error and number of packings of each quantity at each μ, one in a line.

    All are of packings with exact intervals; a ratio is the mean of the ratios of packings.
    """
    known = table.part(SAMPLERS["exact"])[["mu", "seed"]]
    lines = [
        {"quantity": quantity, "mu": mu, **_mean(values)}
        for quantity, rows, name in _quantities(table)
        for mu, values in statistics.grouped(rows.merge(known), name).items()
    ]
    return pd.DataFrame(lines, columns=["quantity", "mu", "mean", "standard_error", "packings"])


def _quantities(table: StudyTable) -> Iterator[tuple[str, pd.DataFrame, str]]:
    """Name, rows and column of each quantity."""
    exact, walk = table.part(SAMPLERS["exact"]), table.part(SAMPLERS["nearest"])
    yield "packing fraction φ", exact, "packing_fraction"
    yield "coordination z", exact, "coordination"
    yield "dimension h", exact, "dimension"
    yield "exact η3", exact, "eta3"
    for sampler, word in WALKS.items():
        rows = rows_of(table, sampler)
        rows = rows[~skipped(rows)]
        for name, symbol in (("eta1", "η1"), ("eta2", "η2"), ("eta3", "η3")):
            yield f"{symbol}, {word}", rows, name
        yield f"η3, {word} over exact", over(rows, exact, "eta3"), "ratio"
        if sampler != "nearest":
            yield f"η2, {word} over nearest-network walk", over(rows, walk, "eta2"), "ratio"
    yield "mean length of the exact intervals, ⟨f_n⟩", exact, "mean_length"
    for part, residual in plans.SWEEPS.items():
        swept, ends = table.part(part), f"paper's walk to {residual:g}"
        yield f"sweeps per network, {ends}", positive(swept, "mean_sweeps"), "mean_sweeps"
        yield f"excess over the exact intervals, {ends}, ⟨f_n⟩", swept, "excess"
        yield f"η2, {ends} over nearest-network walk", over(swept, walk, "eta2"), "ratio"
    pushed = positive(table.part("response"), "limit_load")
    pushed = pushed.assign(part_of_load=pushed["critical_force"] / pushed["limit_load"])
    yield "critical force, ⟨f_n⟩", pushed, "critical_force"
    yield "critical force over limit load", pushed, "part_of_load"
    yield "exponent α of the first motion", pushed, "decay_exponent"
    yield "width of S, ⟨f_n⟩", table.part("volume"), "extent"
    yield "undetermined fraction, frozen boundary", table.part("frozen"), "undetermined_part"
    yield "largest shear stress over pressure", table.part("stress"), "friction"


def over(rows: pd.DataFrame, others: pd.DataFrame, name: str) -> pd.DataFrame:
    """Rows with the "ratio" of a number to that of another row of the same packing."""
    pairs = statistics.paired(rows.dropna(subset=[name]), others)
    pairs = pairs[pairs[f"{name}_other"] > NOTHING]
    return pairs.assign(ratio=pairs[name] / pairs[f"{name}_other"])


def by_preparation(table: StudyTable) -> pd.DataFrame:
    """How quantities change with the options of packing, a quantity, options and μ in a line.

    The lines of the default options have means over the seeds of all others. The other lines have
    mean differences from the default in the same seeds, and their p-value by Student's t.
    """
    names = [part.removesuffix("_exact") for part in table.parts() if part.startswith("prepared_")]
    variants = list(dict.fromkeys(names))
    varied = table.part(*variants)[["mu", "seed"]].drop_duplicates()
    lines = []
    for quantity, ending, name in _PREPARED:
        usual = table.part("exact" if ending else "walk", n=table.plan["n"])
        usual = usual.merge(varied).dropna(subset=[name])
        for mu, values in statistics.grouped(usual, name).items():
            lines.append({"quantity": quantity, "options": DEFAULT, "mu": mu, **_mean(values)})
        for variant in variants:
            pairs = statistics.paired(table.part(variant + ending), usual)
            pairs = pairs.assign(apart=pairs[name] - pairs[f"{name}_other"])
            word = OPTIONS.get(variant, variant.removeprefix("prepared_").replace("_", " "))
            for mu, apart in statistics.grouped(pairs, "apart").items():
                line = {"quantity": quantity, "options": word, "mu": mu, **_mean(apart)}
                lines.append(line | {"p": _chance(apart)})
    columns = ["quantity", "options", "mu", "mean", "standard_error", "packings", "p"]
    return pd.DataFrame(lines, columns=columns)


def by_claim(claims: Rows) -> pd.DataFrame:
    """Each claim with its place in the paper, its range, and why this range."""
    names = ("id", "place", "text", "number", "range", "why", "chosen", "verdict", "late")
    return pd.DataFrame([{name: claim[name] for name in names} for claim in claims])


def by_case(claims: Rows) -> pd.DataFrame:
    """Every case of every claim, by every way to draw networks, in a line."""
    lines = [
        {"id": claim["id"], "networks": sampler} | case
        for claim in claims
        for sampler, judged in claim["by"].items()
        for case in judged["cases"]
    ]
    return pd.DataFrame(lines)


def contents(table: StudyTable) -> pd.DataFrame:
    """Number of packings of each part at each number of disks and μ."""
    rows = table.rows.fillna({"packing_mu": table.rows["mu"]})
    groups = rows.groupby(["part", "n", "mu", "packing_mu"], sort=False)["seed"]
    counts = groups.nunique().rename("packings").reset_index()
    counts.insert(1, "content", [_content(part) for part in counts["part"]])
    return counts


def _content(part: str) -> str:
    """What a part contains; the longest beginning of its name that is known."""
    begins = [name for name in CONTENTS if part.startswith(name)]
    return CONTENTS[max(begins, key=len)] if begins else part


def _mean(values: Floats) -> dict[str, float]:
    error = values.std(ddof=1) / np.sqrt(len(values)) if len(values) > 1 else np.nan
    return {"mean": values.mean(), "standard_error": error, "packings": len(values)}


def _chance(apart: Floats) -> float:
    """The p-value of a mean difference; NaN without scatter."""
    if len(apart) < 2 or np.ptp(apart) <= NOTHING * np.abs(apart).max():
        return np.nan
    return float(stats.ttest_1samp(apart, 0).pvalue)
