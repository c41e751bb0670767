"""Exact bounds, limit loads, outlines and volumes, of S and of its stresses, as datasets."""

import json
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from granforce import measures
from granforce.experiment.informative import Informative
from granforce.explore.intervals import Intervals, LimitLoads
from granforce.explore.outline import Outline
from granforce.explore.stress_outline import StressOutline
from granforce.explore.volume import Volume
from granforce.forces.contact_problem import wedged
from granforce.forces.ensemble import Ensemble
from granforce.study.schema import extension, labelled, loaded, stored
from granforce.tolerances import CARRYING
from granforce.types import Floats, Integers

T = TypeVar("T")

# Forces whose exact interval is longer than this, in ⟨f_n⟩, are undetermined.
UNDETERMINED = 1e-6


def _dataset(result: Any, **arrays: Any) -> xr.Dataset:
    """The stored fields of a result, and more arrays, with its counts."""
    attrs = {"counts": json.dumps(result.counts)} if hasattr(result, "counts") else {}
    return labelled(stored(result) | arrays, attrs)


def result_of(kind: Callable[..., T], dataset: xr.Dataset, **others: Any) -> T:
    """The result of a dataset, with its counts, and what the dataset lacks."""
    counts = dataset.attrs.get("counts")
    more = {} if counts is None else {"counts": json.loads(counts)}
    return loaded(kind, dataset, **more, **others)


def intervals_of(S: Ensemble, dataset: xr.Dataset) -> Intervals:
    """The Intervals of S in a dataset."""
    low, high = dataset["low"].values, dataset["high"].values
    return result_of(
        Intervals,
        dataset,
        backbone=high[:, 0] > CARRYING * S.force_scale,
        converged=not (np.isnan(low) | np.isnan(high)).any(),
        wedged=wedged(S),
    )


def intervals_dataset(S: Ensemble, bounds: Intervals, *, seconds: float = 0.0) -> xr.Dataset:
    """Intervals as a dataset, with their measures and the clusters of undetermined contacts.

    In an unbounded S η3 would be ∞/∞ and is NaN; the correlation is that of the bounded contacts.
    """
    low, high = bounds.low, bounds.high
    place = S.positions(bounds.contacts)
    original = S.original[place]
    some = bounds.bounded
    position, correlation = np.full(len(place), np.nan), np.nan
    if some.any():
        within = low[some], high[some]
        position[some] = measures.position_in_interval(original[some, 0], *within)
        correlation = measures.correlation(original[some, 0], measures.normal_extent(*within))
    return _dataset(
        bounds,
        seconds=seconds,
        original=original,
        position=position,
        cluster=clusters_of(S, bounds),
        eta3=measures.eta3(low, high) if some.all() else np.nan,
        correlation=correlation,
        **extension(S),
        coordination=S.coordination,
        packing_fraction=S.packing.packing_fraction,
        force_scale=S.force_scale,
        **S.skipped,
    )


def clusters_of(S: Ensemble, bounds: Intervals) -> Integers:
    """The cluster of undetermined contacts (k,) of each contact, −1 for determined ones.

    Contacts whose bounds are not certified count as undetermined.
    """
    place = S.positions(bounds.contacts)
    ends = S.contacts.i[place], S.contacts.j[place]
    extent = bounds.high - bounds.low
    extent[np.isnan(extent)] = np.inf
    return measures.undetermined_clusters(*ends, extent, UNDETERMINED * S.force_scale)[0]


def informative_dataset(
    S: Ensemble, informative: Informative, *, seconds: float = 0.0
) -> xr.Dataset:
    """An Informative as a dataset; its backbone lists its contacts, the best first.

    The attribute twins lists, for each of them, contacts whose measurement gives the same.
    """
    dataset = _dataset(informative, seconds=seconds, force_scale=S.force_scale, **extension(S))
    return dataset.assign_attrs(twins=json.dumps(informative.twins))


def limit_loads_dataset(S: Ensemble, loads: LimitLoads, *, seconds: float = 0.0) -> xr.Dataset:
    """LimitLoads as a dataset."""
    original = S.original[S.positions(loads.contacts)]
    return _dataset(loads, seconds=seconds, force_scale=S.force_scale, original=original)


def stress_dataset(S: Ensemble, outline: StressOutline, *, seconds: float = 0.0) -> xr.Dataset:
    """A StressOutline as a dataset."""
    return _dataset(outline, seconds=seconds, **extension(S))


def volume_dataset(S: Ensemble, volume: Volume) -> xr.Dataset:
    """A Volume as a dataset."""
    reduced = {"coordination": S.coordination, "force_scale": S.force_scale, **S.skipped}
    return _dataset(volume, reached=volume.reached, **extension(S), **reduced)


def outline_dataset(
    S: Ensemble, axes: Floats, outline: Outline, *, seconds: float = 0.0
) -> xr.Dataset:
    """An Outline in the plane of axes (2, N_c, 2) as a dataset."""
    return _dataset(
        outline,
        seconds=seconds,
        backbone=S.index,
        axes=axes,
        programs=outline.counts["programs"],
        force_scale=S.force_scale,
    )
