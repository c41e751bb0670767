"""The reduced study: a row of numbers per cell, samples per contact, small enough to ship."""

import hashlib
import json
from typing import NamedTuple

import numpy as np

from granforce import measures, study, sweep
from granforce.paper import plan as plans
from granforce.records import InputError
from granforce.schema import labelled
from granforce.store import open_store

VERSION = 1
SHOWN_FRICTIONS = (0.01, 0.1, 1.0, 10.0)  # whose states and packings are kept for Figures 3 and 5
SHOWN_STATES = 30

# Parts whose contacts are kept one by one.
SAMPLED = ("walk", "exact", "uniform")
SAMPLES = ("row", "contact", "normal", "least", "extent")

_SCALARS = (
    *("eta1", "eta2", "eta3", "correlation", "correlation_low", "correlation_high"),
    *("coordination", "dimension", "packing_fraction", "acceptance", "original_distance"),
    *("residual", "max_gap", "worst_r_hat", "least_bulk_size", "seconds"),
    *("critical_force", "decay_exponent", "decay_low", "decay_high"),
)


class Table(NamedTuple):
    """The reduced study."""

    plan: dict  # fields of `plans.Plan`
    rows: list  # dicts: part, n, mu, seed, and the columns of the schema's row_… that apply
    samples: dict  # {name of SAMPLES: array}: row, contact, f_n, its least value, ΔF_n in ⟨f_n⟩
    shown: list  # (row, normal forces (S, N_c) in ⟨f_n⟩) of some walks
    packings: dict  # {row: Packing} of those walks
    skipped: dict  # counts: cells of the plan that the store lacked

    def part(self, *names, n=None):
        """Rows of some parts; n: only of this number of disks."""
        return [r for r in self.rows if r["part"] in names and n in (None, r["n"])]

    def contacts(self, part):
        """[(row, contact numbers, f_n, least f_n, ΔF_n)] of a sampled part, forces in ⟨f_n⟩."""
        found = []
        # Samples lie row by row.
        edges = np.searchsorted(self.samples["row"], np.arange(len(self.rows) + 1))
        for k, row in enumerate(self.rows):
            chosen = slice(edges[k], edges[k + 1])
            if row["part"] == part:
                found.append((row, *(self.samples[name][chosen] for name in SAMPLES[1:])))
        return found

    def extents(self, part):
        """{μ: list of ΔF_n (N_c,) of each packing} of a sampled part."""
        found = {}
        for row, *_, extent in self.contacts(part):
            found.setdefault(row["mu"], []).append(extent)
        return found

    def answers(self):
        """Rows of the part "perturb", each with eta2 of the walk in the same packing."""
        eta2 = {(row["mu"], row["seed"]): row["eta2"] for row in self.part("walk")}
        keys = [(row, (row["mu"], row["seed"])) for row in self.part("perturb")]
        return [row | {"eta2": eta2[key]} for row, key in keys if key in eta2]


def reduce(path, plan):
    """The Table of what the store at path has of a plan. InputError where it has nothing."""
    store = open_store(path, readonly=True)
    rows, samples, shown, packings, centres = [], [], [], {}, {}
    wanted = plans.tasks(plan)
    for task, dataset in plans.finished(path, plan):
        k = len(rows)
        rows.append(row_of(task, dataset))
        if task.part in SAMPLED:
            samples.append(_samples(k, dataset))
        if task.part == "uniform":
            centres[task.mu, task.seed] = dataset["states"].values.mean(axis=0), rows[k]
        if task.part == "walk" and task.seed == 1 and task.mu in SHOWN_FRICTIONS:
            shown.append((k, _shown(dataset)))
            packings[k] = study.get_packing(store, task.cell.parameters["packing"])[0]
    _compare_distances(store, wanted, centres)
    if not rows:
        raise InputError(f"the store at {path} holds nothing of this study")
    joined = {
        name: np.concatenate([part[name] for part in samples]) if samples else np.zeros(0)
        for name in SAMPLES
    }
    skipped = {"missing_cells": len(wanted) - len(rows)}
    return Table(plan._asdict(), rows, joined, shown, packings, skipped)


def _compare_distances(store, wanted, centres):
    """Distances of original and walk states from the mean of uniform states, beside those' own."""
    for task in wanted:
        key = task.mu, task.seed
        if task.part != "walk" or key not in centres:
            continue
        walk = sweep.load(store, task.cell)
        middle, row = centres[key]
        if walk is not None and row["dimension"] > 0:
            unit = row["mean_distance"] * walk["force_scale"].item()
            for name, states in (
                ("original_ratio", walk["original"].values[None]),
                ("walk_ratio", walk["states"].values),
            ):
                row[name] = float(measures.distances(states, middle).mean() / unit)


def row_of(task, dataset):
    """The numbers of one cell: scalars of its dataset and what its contacts sum up to."""
    row = {"part": task.part, "n": task.n, "mu": task.mu, "seed": task.seed}
    for name in _SCALARS:
        if name in dataset:
            row[name] = float(dataset[name].max())
    if "distance_to_centre" in dataset:
        row["mean_distance"] = float(dataset["distance_to_centre"].mean())
    if "limit_load" in dataset:
        row["contacts"] = dataset.sizes["contact"]
        row["limit_load"] = float(dataset["limit_load"].mean() / dataset["force_scale"])
    if "high" in dataset:
        low, high = dataset["low"].values, dataset["high"].values
        scale = dataset["force_scale"].item()
        row["contacts"] = len(low)
        row["mean_extent"] = float(measures.normal_extent(low, high).mean() / scale)
    if "cluster" in dataset:
        counts = np.bincount(dataset["cluster"].values[dataset["cluster"].values >= 0])
        row["undetermined"] = int(counts.sum())
        row["undetermined_part"] = row["undetermined"] / max(1, row["contacts"])
        row["clusters"] = len(counts)
        row["largest_cluster"] = int(counts.max(initial=0))
    return row


def _samples(k, dataset):
    scale = dataset["force_scale"].item()
    extent = measures.normal_extent(dataset["low"].values, dataset["high"].values)
    return {
        "row": np.full(len(extent), k),
        "contact": dataset["backbone"].values,
        "normal": dataset["original"].values[:, 0] / scale,
        "least": dataset["low"].values[:, 0] / scale,
        "extent": extent / scale,
    }


def _shown(dataset):
    states = dataset["states"].values[:, :, 0] / dataset["force_scale"].item()
    pick = np.linspace(0, len(states) - 1, min(SHOWN_STATES, len(states))).astype(int)
    return states[pick]


def save(table, path):
    """Keep a table, and the packings it shows, in a small store of its own at path."""
    store = open_store(path)
    dataset = _dataset(table)
    store.clear("study")
    digest = hashlib.sha256(json.dumps(table.rows).encode()).hexdigest()[:16]
    single = ("sample_normal", "sample_least", "sample_extent", "shown_normal")
    store.save(
        "study",
        {**table.plan, "rows": digest},
        dataset,
        version=VERSION,
        dtypes=dict.fromkeys(single, "float32"),
    )
    for k, packing in table.packings.items():
        row = table.rows[k]
        named = study.packing_parameters(row["n"], row["mu"], row["seed"])
        study.keep_packing(store, named, packing)


def load(path):
    """The Table kept at path. InputError where there is none."""
    store = open_store(path, readonly=True)
    for entry in store.find("study"):
        if entry.version == VERSION:
            return _table(store, entry, store.load("study", entry.params, version=VERSION))
    raise InputError(f"the store at {path} holds no reduced study")


def _dataset(table):
    names = sorted({name for row in table.rows for name in row} - {"part"})
    parts = sorted({row["part"] for row in table.rows})
    arrays = {f"row_{name}": [_number(row.get(name)) for row in table.rows] for name in names}
    arrays["row_part"] = [parts.index(row["part"]) for row in table.rows]
    arrays |= {f"sample_{name}": values for name, values in table.samples.items()}
    if table.shown:
        arrays["shown_row"] = np.concatenate([np.full(s.shape[1], k) for k, s in table.shown])
        arrays["shown_normal"] = np.concatenate([s for _, s in table.shown], axis=1)
    return labelled(arrays, {"parts": json.dumps(parts), "skipped": json.dumps(table.skipped)})


def _number(value):
    return np.nan if value is None else value


def _table(store, entry, dataset):
    parts = json.loads(dataset.attrs["parts"])
    columns = {
        name.removeprefix("row_"): dataset[name].values
        for name in dataset
        if name.startswith("row_")
    }
    rows = []
    for k in range(dataset.sizes["row"]):
        row = {name: values[k].item() for name, values in columns.items()}
        row |= {"part": parts[row["part"]], "n": int(row["n"]), "seed": int(row["seed"])}
        rows.append({name: value for name, value in row.items() if value == value})
    samples = {name: dataset[f"sample_{name}"].values for name in SAMPLES}
    shown, packings = [], {}
    if "shown_row" in dataset:
        for k in np.unique(dataset["shown_row"]).tolist():
            chosen = dataset["shown_row"].values == k
            shown.append((k, dataset["shown_normal"].values[:, chosen]))
            named = study.packing_parameters(rows[k]["n"], rows[k]["mu"], rows[k]["seed"])
            packings[k] = study.get_packing(store, named)[0]
    plan = {name: value for name, value in entry.params.items() if name != "rows"}
    return Table(plan, rows, samples, shown, packings, json.loads(dataset.attrs["skipped"]))
