"""The reduced study: a row of numbers per cell, samples per contact, small enough to ship."""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import numpy as np
import pandas as pd
import xarray as xr
from scipy.spatial.distance import pdist

from granforce import measures
from granforce.explore.stress_outline import plane_of
from granforce.figures import ratio_counts
from granforce.forces.balance import stress_of
from granforce.measures import statistics
from granforce.paper import plan as plans
from granforce.paper.plan import Plan, Task
from granforce.records import InputError, Packing, friction
from granforce.study import cells, kinds
from granforce.study.cells import packing_version
from granforce.study.schema import ROW_SCALARS, VARIABLES, dataset_packing, labelled
from granforce.study.store import Entry, Store, open_store
from granforce.types import Floats, Integers

VERSION = 1

# Parts with samples of single contacts, and walks that are compared with exact intervals.
SAMPLED = (
    *("sweeps_1e-3", "sweeps_1e-4", "sweeps_1e-6", "walk", "exact", "uniform"),
    *("prepared_late_drag", "prepared_late_drag_exact"),
)
WALKED = (*plans.SWEEPS, "walk")
SAMPLES = ("row", "contact", "normal", "least", "extent")
COLUMNS = [name.removeprefix("row_") for name in VARIABLES if name.startswith("row_")]


def make_rows(rows: statistics.Table) -> pd.DataFrame:
    """A table with a column for every number of the schema's row_…, NaN where a row has none."""
    table = pd.DataFrame(rows).reindex(columns=COLUMNS)
    kinds = dict.fromkeys(COLUMNS, float) | {"part": str, "n": int, "seed": int}
    return table.astype(kinds).copy()  # as one block


class StudyTable(NamedTuple):
    """The reduced study."""

    plan: dict[str, Any]  # fields of `plans.Plan`
    rows: pd.DataFrame  # of cells, see `make_rows`: part, n, mu, seed, and their numbers
    # columns SAMPLES, in order of row: row, contact, f_n, its least value, ΔF_n in ⟨f_n⟩
    samples: pd.DataFrame
    # (row, counts of states (N_c, bins of `figures.ratio_counts`)) of some walks
    shown: list[tuple[int, Integers]]
    packings: dict[int, Packing]  # {row: Packing} of those walks
    skipped: dict[str, int]  # counts of the plan's cells missing from the store
    # {row: (shells, 2) radii in mean diameters and mean |u| in the range of the fit of α}
    decays: Mapping[int, Floats] = MappingProxyType({})

    def part(self, *names: str, n: int | None = None) -> pd.DataFrame:
        """Rows of some parts; n: only of this number of disks."""
        chosen = self.rows["part"].isin(names)
        return self.rows[chosen if n is None else chosen & (self.rows["n"] == n)]

    def parts(self) -> list[str]:
        """Names of its parts, in order of their first rows."""
        return list(self.rows["part"].unique())

    def contacts(self, part: str) -> Iterator[tuple[Any, pd.DataFrame]]:
        """Each row of a sampled part, and the samples of its contacts."""
        edges = np.searchsorted(self.samples["row"], np.arange(len(self.rows) + 1))
        for row in self.part(part).itertuples():
            yield row, self.samples[edges[row.Index] : edges[row.Index + 1]]

    def extents(self, part: str) -> dict[float, list[Floats]]:
        """{μ: list of ΔF_n (N_c,) of each packing} of a sampled part."""
        extents: dict[float, list[Floats]] = {}
        for row, contacts in self.contacts(part):
            extents.setdefault(row.mu, []).append(contacts["extent"].to_numpy())
        return extents

    def answers(self, part: str = "walk", eta: str = "eta2") -> pd.DataFrame:
        """Rows of the perturbation, each with the η of a part in the same packing."""
        pairs = statistics.paired(self.part("response"), self.part(part).dropna(subset=[eta]))
        return pairs.assign(**{eta: pairs[f"{eta}_other"]})


def reduce(path: str | Path, plan: Plan, wanted: Sequence[Task] | None = None) -> StudyTable:
    """The StudyTable of a plan's cells in the store at path; InputError if there are none.

    wanted: the tasks to report if missing, by default all of the plan.
    """
    store = open_store(path, readonly=True)
    rows: list[dict[str, Any]] = []
    samples: list[pd.DataFrame] = []
    shown: list[tuple[int, Integers]] = []
    packings: dict[int, Packing] = {}
    centres: dict[tuple[float, int], tuple[Floats, dict[str, Any]]] = {}
    exact: dict[tuple[float, int], xr.Dataset] = {}
    decays: dict[int, Floats] = {}
    every = plans.tasks(plan)
    for task, dataset in plans.finished_tasks(path, plan):
        k = len(rows)
        rows.append(row_of(task, dataset))
        if task.part == "exact":
            exact[task.mu, task.seed] = dataset
        if task.part in WALKED and (task.mu, task.seed) in exact and _has_states(dataset):
            rows[k]["excess"] = _excess(dataset, exact[task.mu, task.seed])
        if "profile" in dataset:
            decays[k] = _decay(store, task, dataset)
        if task.part == "stress_uniform":
            packing, _ = kinds.get_packing(store, task.cell.parameters["packing"])
            rows[k] |= _shears(packing, dataset)
        if task.part in SAMPLED and _has_states(dataset):
            samples.append(_samples(k, dataset))
        if task.part == "uniform":
            centres[task.mu, task.seed] = dataset["states"].values.mean(axis=0), rows[k]
        first = task.part in plans.SHOWN_PARTS and task.seed == 1 and _has_states(dataset)
        if first and task.mu in plans.SHOWN_FRICTIONS:
            original, states = (dataset[name].values[..., 0] for name in ("original", "states"))
            shown.append((k, ratio_counts(original, states)))
            packings[k] = kinds.get_packing(store, task.cell.parameters["packing"])[0]
    _compare_distances(store, every, centres)
    if not rows:
        raise InputError(f"the store at {path} has no results of this study")
    table = make_rows(rows)
    missing = (~_names(_tasks_named(every if wanted is None else wanted)).isin(_names(table))).sum()
    return StudyTable(
        plan=plan._asdict(),
        rows=table,
        samples=pd.concat([no_samples(), *samples], ignore_index=True),
        shown=shown,
        packings=packings,
        skipped={"missing_cells": int(missing)},
        decays=decays,
    )


def _excess(walked: xr.Dataset, exact: xr.Dataset) -> float:
    """Mean excess of the states' intervals over the exact ones, ⟨f_n⟩.

    States in S have none. NaN if the two have different contacts.
    """
    if not np.array_equal(walked["backbone"], exact["backbone"]):
        return np.nan
    low, high = (np.maximum(s * (walked[e] - exact[e]), 0) for s, e in ((-1, "low"), (1, "high")))
    return float((low + high).mean() / exact["force_scale"])


def _decay(store: Store, task: Task, dataset: xr.Dataset) -> Floats:
    """Radii of shells in mean diameters and mean |u| in them over contacts, (shells, 2).

    The shells are those in the fit of α that contain grains for every contact.
    """
    packing, _ = kinds.get_packing(store, task.cell.parameters["packing"])
    inner, outer = json.loads(dataset.attrs["fit_range"])
    radius, profile = dataset["shell_radius"].values, dataset["profile"].values
    fitted = (radius >= inner) & (radius <= outer) & np.isfinite(profile).all(axis=0)
    diameter = 2 * float(packing.r.mean())
    return np.column_stack([radius[fitted] / diameter, profile[:, fitted].mean(axis=0)])


def _compare_distances(store: Store, wanted: Any, centres: Any) -> None:
    """Add the distances of original and walk states from the mean of uniform states."""
    for task in wanted:
        key = task.mu, task.seed
        if task.part != "walk" or key not in centres:
            continue
        walk = cells.load(store, *task.cell)
        middle, row = centres[key]
        if walk is not None and row["dimension"] > 0:
            unit = row["mean_distance"] * walk["force_scale"].item()
            for name, states in (
                ("original_ratio", walk["original"].values[None]),
                ("walk_ratio", walk["states"].values),
            ):
                row[name] = float(measures.distances(states, middle).mean() / unit)


def row_of(task: Task, dataset: xr.Dataset) -> dict[str, Any]:
    """The numbers of one cell: scalars of its dataset, and sums over its contacts."""
    row = _named(task)
    for name in ROW_SCALARS:
        if name in dataset and dataset[name].size:
            row[name] = float(dataset[name].max())
    if "attempts" in task.cell.parameters:
        # A walk may have ended with fewer states than requested, or none.
        done = int(dataset["accepted"] + dataset["skipped"])
        row["reached_part"] = done / task.cell.parameters["states"]
    if "accepted" in dataset:
        row["skipped_part"] = float(dataset["skipped"]) / max(
            1.0, float(dataset["accepted"] + dataset["skipped"])
        )
    if "states" in dataset and dataset.sizes["state"] > 2:
        row["mean_distance"] = float(dataset["distance_to_centre"].mean())
        if row["dimension"] > 0:
            row["pair_spread"] = _pair_spread(dataset["states"].values)
    if "stress_own" in dataset:
        row["own_shear"] = float(np.hypot(*dataset["stress_own"].values))
    if "limit_load" in dataset:
        row["contacts"] = dataset.sizes["contact"]
        row["limit_load"] = float(dataset["limit_load"].mean() / dataset["force_scale"])
    if "high" in dataset and _has_states(dataset):
        low, high = dataset["low"].values, dataset["high"].values
        scale = dataset["force_scale"].item()
        row["contacts"] = len(low)
        row["mean_extent"] = float(measures.normal_extent(low, high).mean() / scale)
        row["mean_length"] = float((high - low).mean() / scale)
    if "cluster" in dataset:
        counts = np.bincount(dataset["cluster"].values[dataset["cluster"].values >= 0])
        row["undetermined"] = int(counts.sum())
        row["undetermined_part"] = row["undetermined"] / max(1, row["contacts"])
        row["clusters"] = len(counts)
        row["largest_cluster"] = int(counts.max(initial=0))
    return row


def _shears(packing: Packing, dataset: xr.Dataset) -> dict[str, float]:
    """Mean and largest shear stress over pressure of the states."""
    states = dataset["states"].values
    forces = np.zeros((len(states), len(packing.contacts.i), 2))
    forces[:, dataset["backbone"].values] = states
    shear = np.hypot(*plane_of(stress_of(packing, forces)).T)
    return {"mean_shear": float(shear.mean()), "largest_shear": float(shear.max())}


def _has_states(dataset: xr.Dataset) -> bool:
    """Whether there are states; a walk without a successful attempt has none. True for bounds."""
    return dataset.sizes.get("state", 1) > 0


def _pair_spread(states: Floats) -> float:
    """Standard deviation over mean of the distances between pairs of states."""
    apart = pdist(states.reshape(len(states), -1))
    return float(apart.std() / apart.mean())


def _samples(k: int, dataset: xr.Dataset) -> pd.DataFrame:
    scale = dataset["force_scale"].item()
    extent = measures.normal_extent(dataset["low"].values, dataset["high"].values)
    columns = {
        "row": k,
        "contact": dataset["backbone"].values,
        "normal": dataset["original"].values[:, 0] / scale,
        "least": dataset["low"].values[:, 0] / scale,
        "extent": extent / scale,
    }
    return pd.DataFrame(columns)


def no_samples() -> pd.DataFrame:
    """Samples of no contact."""
    whole = dict.fromkeys(("row", "contact"), int)
    return pd.DataFrame(columns=SAMPLES, dtype=float).astype(whole)


def packings_at_each(rows: pd.DataFrame) -> str:
    """The number of packings at each μ, in words: "10", or "10 to 30"."""
    made_at = rows["packing_mu"].fillna(rows["mu"])  # packings may share the friction of cones
    counts = rows.groupby(made_at)["seed"].nunique()
    low, high = (counts.min(), counts.max()) if len(counts) else (0, 0)
    return f"{low}" if low == high else f"{low} to {high}"


def merged(new: StudyTable, old: StudyTable) -> StudyTable:
    """The StudyTable `new`, followed by rows of its plan that only `old` has.

    A part of which `old` has other versions than the plan comes from `new` alone, as a whole.
    Numbers of a row that depend on other cells (distances from the uniform centre) keep their old
    values if those cells no longer exist. Raises InputError if `new` lacks a part of which `old`
    has other versions.
    """
    planned = _tasks_named(plans.tasks(plans.Plan(**new.plan))).set_index(_KEYS)
    ours, theirs = _names(new.rows), _names(old.rows)
    outdated = _outdated_parts(old.rows, planned.reindex(theirs), new.rows["part"])
    kept = ~old.rows["part"].isin(outdated).to_numpy()
    lacked = theirs.isin(planned.index) & ~theirs.isin(ours) & kept
    place = {k: len(new.rows) + at for at, k in enumerate(np.flatnonzero(lacked).tolist())}
    known = old.rows.set_axis(theirs)[kept].reindex(ours).set_axis(new.rows.index)
    added = old.samples[old.samples["row"].isin(place)]
    added = added.assign(row=added["row"].map(place))
    return new._replace(
        rows=pd.concat([new.rows.fillna(known), old.rows[lacked]], ignore_index=True),
        samples=pd.concat([new.samples, added], ignore_index=True),
        shown=new.shown + [(place[k], counts) for k, counts in old.shown if k in place],
        packings=new.packings | {place[k]: p for k, p in old.packings.items() if k in place},
        skipped={"missing_cells": new.skipped["missing_cells"] - len(place)},
        decays=dict(new.decays) | {place[k]: d for k, d in old.decays.items() if k in place},
    )


def _named(task: Task) -> dict[str, Any]:
    """The identity of a task's row, and the versions of its contents."""
    row: dict[str, Any] = {"part": task.part, "n": task.n, "mu": task.mu, "seed": task.seed}
    if task.packing_mu != task.mu:
        row["packing_mu"] = task.packing_mu
    packing = task.cell.parameters["packing"]["version"]
    return row | {"version": task.cell.kind.version, "packing_version": packing}


# What names a row. Packings may be made at another μ than that of their cones.
_KEYS = ["part", "n", "mu", "seed", "packing_mu"]


def _tasks_named(tasks: Iterable[Task]) -> pd.DataFrame:
    """The rows that tasks will have, without numbers, and with every packing_mu."""
    rows = make_rows(map(_named, tasks))
    return rows.assign(packing_mu=rows["packing_mu"].fillna(rows["mu"]))


def _names(rows: pd.DataFrame) -> pd.MultiIndex:
    full = rows.assign(packing_mu=rows["packing_mu"].fillna(rows["mu"]))
    return pd.MultiIndex.from_frame(full[_KEYS])


def _outdated_parts(rows: pd.DataFrame, planned: pd.DataFrame, replaced: pd.Series) -> set[str]:
    """Parts with a row of another version than the row of the plan below it, if there is one.

    planned: as many rows, NaN where the plan has none. InputError unless all are in `replaced`.
    """
    wanted = planned[_VERSIONS].set_axis(rows.index)
    differ = rows[wanted["version"].notna() & (rows[_VERSIONS] != wanted).any(axis=1)]
    for k, row in differ[~differ["part"].isin(replaced)][:1].iterrows():
        raise InputError(
            f"the older table has {row['part']} {_version_words(row)}, which cannot be combined "
            f"with those {_version_words(wanted.loc[k])}: compute that part, or leave --table out"
        )
    return set(differ["part"])


_VERSIONS = ["version", "packing_version"]


def _version_words(row: Mapping[str, Any]) -> str:
    version, packing = ("unknown" if np.isnan(row[v]) else f"{row[v]:g}" for v in _VERSIONS)
    return f"of version {version} in packings of version {packing}"


def check_versions(rows: pd.DataFrame) -> None:
    """InputError if rows of one part differ in version, or packings made by one algorithm.

    Rows of an older table without a version count as one version.
    """
    made_at = rows["packing_mu"].fillna(rows["mu"])
    # Packings of small friction, and large ones, are made by algorithms with other versions.
    made_by = [packing_version(mu, n) for mu, n in zip(made_at, rows["n"], strict=True)]
    for group, name in zip((rows["part"], pd.Series(made_by, rows.index)), _VERSIONS, strict=True):
        versions = rows[name].fillna(0)
        mixed = rows[versions != versions.groupby(group).transform("first")]
        if len(mixed):
            other = mixed.iloc[0]
            one = rows[group == group[other.name]].iloc[0]
            raise InputError(
                f"the study mixes {other['part']} {_version_words(other)} with {one['part']} "
                f"{_version_words(one)}: reduce it again from cells of one version"
            )


def save(table: StudyTable, path: str | Path) -> None:
    """Save a table, and the packings it shows, in a separate small store at path."""
    store = open_store(path)
    dataset = _dataset(table)
    store.clear("study")
    store.clear("packing")  # those of an older table, made otherwise, would be found first
    digest = hashlib.sha256(table.rows.to_json().encode()).hexdigest()[:16]
    single = ("sample_normal", "sample_least", "sample_extent")
    store.save(
        "study",
        {**table.plan, "rows": digest},
        dataset,
        version=VERSION,
        dtypes=dict.fromkeys(single, "float32"),
    )
    for k, packing in table.packings.items():
        row = table.rows.loc[k, ["n", "mu", "seed"]]
        named = kinds.PACKING.parameters(int(row["n"]), float(row["mu"]), int(row["seed"]))
        kinds.keep_packing(store, named, packing)


def load(path: str | Path) -> StudyTable:
    """Load the StudyTable at path. InputError if there is none."""
    store = open_store(path, readonly=True)
    for entry in store.find("study"):
        if entry.version == VERSION:
            dataset = store.load("study", entry.params, version=VERSION)
            return _table(store, entry, cast("xr.Dataset", dataset))
    raise InputError(f"the store at {path} contains no reduced study")


def _dataset(table: StudyTable) -> xr.Dataset:
    known = table.rows.dropna(axis="columns", how="all")
    parts, codes = np.unique(known["part"].to_numpy(str), return_inverse=True)
    arrays: dict[str, Any] = {f"row_{name}": known[name] for name in sorted(known)}
    arrays["row_part"] = codes
    arrays |= {f"sample_{name}": table.samples[name] for name in SAMPLES}
    if table.shown:
        arrays["shown_row"] = np.concatenate([np.full(len(s), k) for k, s in table.shown])
        arrays["shown_count"] = np.concatenate([s for _, s in table.shown])
    if table.decays:
        shells = [len(decay) for decay in table.decays.values()]
        arrays["decay_row"] = np.repeat(list(table.decays), shells)
        both = np.concatenate(list(table.decays.values())).T
        arrays["decay_radius"], arrays["decay_size"] = both
    return labelled(
        arrays, {"parts": json.dumps(parts.tolist()), "skipped": json.dumps(table.skipped)}
    )


def _table(store: Store, entry: Entry, dataset: xr.Dataset) -> StudyTable:
    parts = np.array(json.loads(dataset.attrs["parts"]))
    columns = {
        name.removeprefix("row_"): dataset[name].values
        for name in map(str, dataset)
        if name.startswith("row_")
    }
    columns["part"] = parts[columns["part"]]
    rows = make_rows(pd.DataFrame(columns))
    check_versions(rows)
    samples = pd.DataFrame({name: dataset[f"sample_{name}"].values for name in SAMPLES})
    shown, packings = [], {}
    if "shown_row" in dataset:
        for k in np.unique(dataset["shown_row"]).tolist():
            chosen = dataset["shown_row"].values == k
            shown.append((k, dataset["shown_count"].values[chosen]))
            packings[k] = _packing(store, rows.loc[k])
    plan = {name: value for name, value in entry.params.items() if name != "rows"}
    decays = {}
    if "decay_row" in dataset:
        at = dataset["decay_row"].values
        both = np.column_stack([dataset["decay_radius"], dataset["decay_size"]])
        decays = {int(k): both[at == k] for k in np.unique(at)}
    skipped = json.loads(dataset.attrs["skipped"])
    return StudyTable(plan, rows, samples, shown, packings, skipped, decays)


def _packing(store: Store, row: pd.Series) -> Packing:
    """The Packing of a row, of the algorithm's version in the table's store."""
    named = {"n": int(row["n"]), "mu": friction(row["mu"]), "seed": int(row["seed"])}
    return dataset_packing(store[store.find("packing", **named)[0].name])
