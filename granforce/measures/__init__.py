"""Measures of states, and statistics over packings, for arrays from any source."""

from granforce.measures import statistics
from granforce.measures.sampling import Sampling, sampling
from granforce.measures.states import (
    Growth,
    correlation,
    correlation_range,
    distances,
    eta1,
    eta2,
    eta3,
    growing,
    mean_network,
    normal_extent,
    position_in_interval,
    principal_axes,
    sampled_intervals,
    undetermined_clusters,
)

__all__ = [
    "Growth",
    "Sampling",
    "correlation",
    "correlation_range",
    "distances",
    "eta1",
    "eta2",
    "eta3",
    "growing",
    "mean_network",
    "normal_extent",
    "position_in_interval",
    "principal_axes",
    "sampled_intervals",
    "sampling",
    "statistics",
    "undetermined_clusters",
]
