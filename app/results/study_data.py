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
Claim = dict[str, Any]

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
def claims(figure: int | None = None) -> list[Claim]:
    """The claims on a figure of the paper, or all: dicts with text, range, verdict, …"""
    path = DATA / "claims.json"
    if not path.exists():
        return []
    claims_read = json.loads(path.read_text(), object_hook=_with_nan)["claims"]
    return [one for one in claims_read if figure in (None, one["figure"])]


def _with_nan(fields: dict[str, Any]) -> dict[str, Any]:
    """Numbers that could not be measured are null in the file."""
    return {name: math.nan if value is None else value for name, value in fields.items()}


def maxima() -> list[dict[str, Any]]:
    """The μ at which each η is largest, as nearest-network walks have it: value, low and high."""
    peaks = (claim["by"]["nearest"]["cases"] for claim in claims(1) if claim["id"] == "peak")
    return next(peaks, [])


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
