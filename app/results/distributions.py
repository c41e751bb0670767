"""Statistics over the states in the stores: measures and extents against μ, as plain arrays."""

import threading
from collections import OrderedDict
from collections.abc import Iterable
from typing import Any

import numpy as np

from granforce.study.bounds import UNDETERMINED
from granforce.study.store import Store
from granforce.types import Floats

from .library import Cell, readable
from .selection import Selection, unusual

MEASURES = ("eta1", "eta2", "eta3", "coordination", "dimension", "packing_fraction")
CORRELATIONS = ("correlation", "correlation_low", "correlation_high")
KEPT = 1000  # rows in memory, for all visitors: about 10 kB each
MOST_CURVES = 5  # distributions in one plot

Row = dict[str, Any]

_rows: OrderedDict[tuple[str, str], Row] = OrderedDict()
_lock = threading.Lock()


def alike(cells: Iterable[Cell], cell: Cell) -> list[Cell]:
    """Cells of other packings and μ made with the same options; seed and friction may differ."""
    kin = _kin(cell.selection)
    return [other for other in cells if _kin(other.selection) == kin]


def _kin(selection: Selection) -> tuple[Any, ...]:
    """Properties that all cells of one statistic share."""
    settings = selection.packing
    packing = {name: settings.get(name) for name in ("imported", "scene", "n")}
    packing |= {} if selection.imported else unusual(settings)
    own_mu = None if selection.same_mu else selection.packing["mu"]
    relax = selection.relax if selection.kind == "walk" else ""
    return packing, own_mu, selection.kind, relax, selection.states


def rows(cells: Iterable[Cell]) -> list[Row]:
    """A dict per cell: mu, seed, measures, correlations, `normal` and `extent` (N_c,) in ⟨f_n⟩."""
    return [_row(cell.store, cell.name, cell.selection) for cell in cells]


def _row(store: Store, name: str, selection: Selection) -> Row:
    key = str(store.path), name
    with _lock:
        if key in _rows:
            _rows.move_to_end(key)
            return _rows[key]
    with readable(store, name) as dataset:  # everything except the states, which are most of it
        scale = dataset["force_scale"].item()
        row: Row = {"mu": selection.mu, "seed": selection.packing.get("seed")}
        row |= {k: dataset[k].item() for k in (*MEASURES, *CORRELATIONS) if k in dataset}
        low, high = dataset["low"].values[:, 0], dataset["high"].values[:, 0]
        normal, extent = dataset["original"].values[:, 0] / scale, (high - low) / scale
        bounded = np.isfinite(extent)
        row |= {"normal": normal[bounded], "extent": extent[bounded]}
    with _lock:
        _rows[key] = row
        while len(_rows) > KEPT:
            _rows.popitem(last=False)
    return row


def groups(rows: Iterable[Row], mu: float) -> dict[float, list[Floats]]:
    """{μ: extents of its packings} for this μ and some others, spread over all available ones.

    Packings with determined forces are left out.
    """
    by_mu: dict[float, list[Floats]] = {}
    for row in rows:
        if row["extent"].max(initial=0) > UNDETERMINED:
            by_mu.setdefault(row["mu"], []).append(row["extent"])
    others = sorted(value for value in by_mu if value != mu)
    most = min(MOST_CURVES - (mu in by_mu), len(others))
    pick = np.unique(np.linspace(0, len(others) - 1, most).round().astype(int))
    chosen = sorted({others[k] for k in pick} | ({mu} & set(by_mu)))
    return {value: by_mu[value] for value in chosen}
