"""States of S from any sampler, as datasets with all their measures."""

from typing import Any

import numpy as np
import xarray as xr

from granforce import measures
from granforce.experiment.infer import Draws, Inference
from granforce.explore.mixing import Mixing
from granforce.explore.random_walk import Walk
from granforce.explore.uniform import UniformSample
from granforce.forces.ensemble import Ensemble
from granforce.forces.grain_pressures import GrainPressures
from granforce.study.schema import extension, labelled, loaded, stored
from granforce.types import Floats, Integers


def walk_dataset(
    S: Ensemble, done: Walk, *, keep: int | None = None, seconds: float = 0.0
) -> xr.Dataset:
    """A Walk with its measures as a dataset; stores `keep` evenly spaced states, or all."""
    pick = _evenly_spaced(len(done.states), keep)
    return labelled(
        {
            **stored(done),
            **_measured(S, done.states, pick),
            **{name: getattr(done, name)[pick] for name in Walk._fields[1:-1]},
            "mean_sweeps": done.sweeps.mean() if len(done.sweeps) else np.nan,
            **done.counts,
            **S.skipped,
            "seconds": seconds,
        }
    )


def walk_of(dataset: xr.Dataset) -> Walk:
    """The Walk of a dataset that contains all its states."""
    counted = ("accepted", "rejected", "unconverged", "skipped")
    return loaded(Walk, dataset, counts={name: dataset[name].item() for name in counted})


def uniform_dataset(
    S: Ensemble, drawn: UniformSample, *, keep: int | None = None, seconds: float = 0.0
) -> xr.Dataset:
    """A UniformSample with its measures as a dataset; states stored as in `walk_dataset`."""
    pick = _evenly_spaced(len(drawn.flat), keep)
    return labelled(
        {
            **_measured(S, drawn.flat, pick),
            **_diagnostics(drawn, pick),
            **stored(drawn.mixing),
            **S.skipped,
            "seconds": seconds,
        }
    )


def uniform_of(dataset: xr.Dataset) -> UniformSample:
    """The UniformSample of a dataset that contains all its states, without its chains' ends."""
    chains = len(np.unique(dataset["chain"]))
    by_chain = {
        name: dataset[name].values.reshape(chains, -1, *dataset[name].shape[1:])
        for name in ("states", "residual", "violation")
    }
    counted = ("turns", "refused", "dropped", "held", "skipped")
    return loaded(
        UniformSample,
        dataset,
        **by_chain,
        mixing=loaded(Mixing, dataset),
        reached=bool(dataset["reached"]),
        counts={name: dataset[name].item() for name in counted},
        diagnosis_seconds=np.nan,
        method="billiard",
        reach=np.nan,
        ends=(),
    )


def inference_dataset(
    S: Ensemble,
    inference: Inference,
    measured: Floats,
    sigma: Floats,
    pressures: GrainPressures | None = None,
    certain: Any = None,
    *,
    unmeasured: float,
    keep: int | None = None,
    seconds: float = 0.0,
) -> xr.Dataset:
    """An Inference and its measurement as a dataset; draws stored as in `walk_dataset`.

    pressures: the measured ones, if any. certain: a Carrying of contacts that were not measured, if
    requested. unmeasured: the standard error of unmeasured components, in ⟨f_n⟩.
    """
    arrays: dict[str, Any] = {
        **stored(inference),
        "backbone": S.index,
        "original": S.original,
        "measured": measured,
        "sigma": sigma,
        "unmeasured": unmeasured,
        "bounded": int(S.bounded),
        "force_scale": S.force_scale,
        **extension(S),
        **S.skipped,
        "seconds": seconds,
    }
    if pressures is not None:
        for name, values in zip(
            ("measured_pressure", "pressure_sigma"), pressures[1:], strict=True
        ):
            arrays[name] = np.full(len(S.packing.r), np.nan)
            arrays[name][pressures.grains] = values
    if certain is not None:
        arrays["least_normal"] = np.full(len(S.index), np.nan)
        arrays["least_normal"][S.positions(certain.contacts)] = certain.least
    if inference.draws is not None:
        pick = _evenly_spaced(len(inference.draws.flat), keep)
        arrays |= {"states": inference.draws.flat[pick], **_diagnostics(inference.draws, pick)}
    return labelled(arrays)


def _diagnostics(drawn: UniformSample | Draws, pick: slice | Integers) -> dict[str, Any]:
    """Chains and mixing diagnostics of drawn states, and the picked states."""
    return {
        "residual": drawn.residual.ravel()[pick],
        "violation": drawn.violation.ravel()[pick],
        "chain": drawn.chain[pick],
        "worst_r_hat": drawn.mixing.worst_r_hat,
        "least_bulk_size": drawn.mixing.least_bulk,
        "least_tail_size": drawn.mixing.least_tail,
        "reached": drawn.reached,
        **drawn.counts,
        "setup_seconds": drawn.setup_seconds,
        "sampling_seconds": drawn.sampling_seconds,
    }


def _evenly_spaced(count: int, keep: int | None) -> slice | Integers:
    if keep is None or keep >= count:
        return slice(None)
    return np.linspace(0, count - 1, keep).astype(int)


_MEASURES = (
    *("eta1", "eta2", "eta3", "correlation", "correlation_low", "correlation_high"),
    "original_distance",
)


def _measured(S: Ensemble, states: Floats, pick: slice | Integers) -> dict[str, Any]:
    """Measures of all states, and the picked states; NaN without states."""
    known = {
        "states": states[pick],
        "backbone": S.index,
        "original": S.original,
        "packing_fraction": S.packing.packing_fraction,
        "coordination": S.coordination,
        **extension(S),
        "force_scale": S.force_scale,
    }
    if not len(states):
        unknown = np.full(S.original.shape, np.nan)
        return known | {"distance_to_centre": [], "low": unknown, "high": unknown}
    centre = measures.mean_network(states)
    low, high = measures.sampled_intervals(states)
    distance = measures.distances(states, centre) / S.force_scale
    known |= {"distance_to_centre": distance[pick], "low": low, "high": high}
    if not S.bounded:  # measures would grow with the number of states
        return known | dict.fromkeys(_MEASURES, np.nan)
    extent = measures.normal_extent(low, high)
    in_error = measures.correlation_range(states, extent)
    return known | {
        "eta1": measures.eta1(states),
        "eta2": measures.eta2(states),
        "eta3": measures.eta3(low, high),
        "correlation": measures.correlation(S.original[:, 0], extent),
        "correlation_low": in_error[0],
        "correlation_high": in_error[1],
        "original_distance": measures.distances(S.original[None], centre)[0] / S.force_scale,
    }
