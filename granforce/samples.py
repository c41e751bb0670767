"""States of S, from whatever sampler, as datasets with all their measures."""

import numpy as np

from granforce import measures
from granforce.schema import labelled


def walk_dataset(S, done, *, keep=None, seconds=0.0):
    """A Walk with its measures as a dataset; `keep` evenly spaced states are kept, or all."""
    pick = _picked(len(done.states), keep)
    return labelled(
        {
            **_measured(S, done.states, pick),
            "residual": done.residual[pick],
            "violation": done.violation[pick],
            "sweeps": done.sweeps[pick],
            "attempts": done.attempts[pick],
            "acceptance": done.acceptance,
            **done.counts,
            **S.skipped,
            "seconds": seconds,
        }
    )


def uniform_dataset(S, drawn, *, keep=None, seconds=0.0):
    """A UniformSample with its measures as a dataset; states kept as in `walk_dataset`."""
    pick = _picked(len(drawn.flat), keep)
    mixing = drawn.mixing
    return labelled(
        {
            **_measured(S, drawn.flat, pick),
            "residual": drawn.residual.ravel()[pick],
            "violation": drawn.violation.ravel()[pick],
            "chain": drawn.chain[pick],
            "r_hat": mixing.r_hat,
            "bulk_size": mixing.bulk,
            "tail_size": mixing.tail,
            "worst_r_hat": mixing.worst_r_hat,
            "least_bulk_size": mixing.least_bulk,
            "least_tail_size": mixing.least_tail,
            "reached": drawn.reached,
            **drawn.counts,
            **S.skipped,
            "setup_seconds": drawn.setup_seconds,
            "sampling_seconds": drawn.sampling_seconds,
            "seconds": seconds,
        }
    )


def _picked(count, keep):
    if keep is None or keep >= count:
        return slice(None)
    return np.linspace(0, count - 1, keep).astype(int)


def _measured(S, states, pick):
    """What any states say: measures of all, and those that are picked."""
    centre = measures.mean_network(states)
    low, high = measures.intervals_seen(states)
    extent = measures.normal_extent(low, high)
    in_error = measures.correlation_range(states, extent)
    distance = measures.distances(states, centre) / S.force_scale
    return {
        "states": states[pick],
        "distance_to_centre": distance[pick],
        "backbone": S.index,
        "original": S.original,
        "low": low,
        "high": high,
        "eta1": measures.eta1(states),
        "eta2": measures.eta2(states),
        "eta3": measures.eta3(low, high),
        "correlation": measures.correlation(S.original[:, 0], extent),
        "correlation_low": in_error[0],
        "correlation_high": in_error[1],
        "packing_fraction": S.packing.packing_fraction,
        "coordination": S.coordination,
        "dimension": S.dimension,
        "force_scale": S.force_scale,
        "original_distance": measures.distances(S.original[None], centre)[0] / S.force_scale,
    }
