"""The finished study shipped with the app: its numbers, and the verdicts on the paper's claims."""

import json
import math
import threading
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd

from granforce.measures import statistics
from granforce.paper import tables
from granforce.paper.claims.groups import outside
from granforce.records import InputError

DATA = Path(__file__).resolve().parents[2] / "data"
PEAKS = ("eta1-peak", "eta2-peak", "eta3-peak")  # claims

_reading = threading.Lock()


def study() -> tables.StudyTable | None:
    """The reduced study, or None if it is not installed."""
    with _reading:
        return _study()


@cache
def _study() -> tables.StudyTable | None:
    try:
        return tables.load(DATA / "study.zarr")
    except InputError:
        return None


@cache
def claims(figure: int | None = None) -> list[dict[str, Any]]:
    """The claims on a figure of the paper, or all: dicts with statement, value, low, verdict, …

    Values that could not be measured are NaN, null in the file.
    """
    path = DATA / "claims.json"
    if not path.exists():
        return []
    claims_read = json.loads(path.read_text())["claims"]
    return [
        {name: math.nan if value is None else value for name, value in claim.items()}
        for claim in claims_read
        if figure in (None, claim["figure"])
    ]


def maxima() -> list[dict[str, Any]]:
    """The claims about the μ at which each η is largest, as nearest-network walks have it."""
    return [claim for claim in claims(1) if claim["id"] in PEAKS and claim["sampler"] == "nearest"]


def rows(*parts: str) -> pd.DataFrame:
    """Rows of parts of the study at its default number of disks; empty without a study."""
    table = study()
    return pd.DataFrame() if table is None else table.part(*parts, n=table.plan["n"])


def in_force_space(part: str) -> pd.DataFrame:
    """Rows of a part, without the μ at which its states exceed S by more than its extent.

    Sweeps that end early leave such networks, whose spread is not indeterminacy.
    """
    table, some = study(), rows(part)
    return some if table is None else some[~some["mu"].isin(outside(table, part))]


def against_friction(measure: str) -> list[tuple[float, float]]:
    """[(μ, value)] of a measure such as η2, averaged over the walks at each μ."""
    return [(mu, value) for mu, value, _ in statistics.means(rows("walk"), measure)]
