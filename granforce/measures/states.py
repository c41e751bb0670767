"""Measures of force indeterminacy (PRE 79, 052302) for states from any source.

States are arrays (S, N_c, 2) of force networks (f_n, f_t) on the same contacts.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy  # which imports its parts on first use
from scipy import sparse
from scipy.sparse import csgraph

from granforce.records import InputError, float_array, moderate, real_array, refuse_hidden, whole
from granforce.tolerances import REVERSED
from granforce.types import Floats, Integers


def networks(states: Any) -> Floats:
    """States (S, N_c, 2) as an array; InputError for another shape, and for records."""
    for name in ("flat", "states"):
        if not isinstance(states, np.ndarray) and hasattr(states, name):
            raise InputError(
                f"states must be an array (S, N_c, 2), not a {type(states).__name__}: give its "
                f"`.{name}`"
            )
    states = np.asarray(refuse_hidden(states, "states"))
    if states.ndim != 3 or states.shape[-1] != 2:
        raise InputError(
            f"states must have shape (S, N_c, 2), got {states.shape}; take the states of all "
            "chains one after the other (`flat` of a sample)"
        )
    return states


def _some(states: Any) -> Floats:
    states = networks(states)
    if not states.size:
        raise InputError("nothing to measure: there are no states, or no contacts")
    largest = max(states.max(), -states.min())
    if largest:
        moderate(largest, "the largest force")
    return states


def mean_network(states: Floats) -> Floats:
    """G_c = ⟨F_c⟩, the mean force of each contact over states.

    Parameters
    ----------
    states : (S, N_c, 2) array
        Force networks (f_n, f_t).

    Returns
    -------
    (N_c, 2) array
        Force.
    """
    return _some(states).mean(axis=0)


def eta1(states: Floats) -> float:
    """η1 = ⟨δF_c⟩_c / ⟨|G_c|⟩_c with δF_c = sqrt⟨|F_c − G_c|²⟩ over states.

    Parameters
    ----------
    states : (S, N_c, 2) array
        Force networks (f_n, f_t).

    Returns
    -------
    float
        0 if all states are the same.
    """
    mean = mean_network(states)
    spread = np.sqrt(((states - mean) ** 2).sum(axis=2).mean(axis=0))
    return float(spread.mean() / np.linalg.norm(mean, axis=1).mean())


def eta2(states: Floats) -> float:
    """η2 = sqrt(⟨Σ_c |F_c − F'_c|²⟩ / Σ_c |G_c|²) over all pairs of different states.

    The mean over pairs is 2 S/(S − 1) times the variance, so pairs are never formed.

    Parameters
    ----------
    states : (S, N_c, 2) array
        Force networks (f_n, f_t).

    Returns
    -------
    float
        0 for one state.
    """
    count = len(_some(states))
    if count < 2:
        return 0.0
    mean = mean_network(states)
    variance = ((states - mean) ** 2).sum() / count
    return float(np.sqrt(2 * count / (count - 1) * variance / (mean**2).sum()))


def _alike(one: Floats, other: Floats) -> None:
    """InputError unless both are arrays of the same shape, as for one packing."""
    shapes = [np.shape(refuse_hidden(array, "the array")) for array in (one, other)]
    if shapes[0] != shapes[1]:
        raise InputError(f"shapes {shapes[0]} and {shapes[1]} differ; take both from one packing")


def _bounds(low: Any, high: Any) -> tuple[Floats, Floats]:
    """Smallest and largest values as arrays (N_c, 2); NaN where a bound is missing.

    InputError for arrays of different shapes, and for the largest values given first.
    """
    _alike(low, high)
    low, high = real_array(low, "the smallest values"), real_array(high, "the largest values")
    if low.ndim != 2 or low.shape[1] != 2 or not low.size:
        raise InputError(f"bounds must be two arrays (N_c, 2), low and high, got shape {low.shape}")
    largest = max(np.nanmax(np.abs(both), initial=0.0) for both in (low, high))
    if np.isinf(largest):
        raise InputError("bounds must be finite; remove contacts without a bound")
    if np.any(low - high > REVERSED * largest):
        contact = int(np.argmax(np.nanmax(low - high, axis=1, initial=-np.inf)))
        raise InputError(
            f"the smallest value exceeds the largest on contact {contact} of the arrays; give low "
            "before high"
        )
    return low, high


def eta3(low: Floats, high: Floats | None = None) -> float:
    """η3 = ⟨F_max − F_min⟩ / ⟨(F_max + F_min)/2⟩, both means over all 2N_c components.

    Parameters
    ----------
    low, high : (N_c, 2) array
        Smallest and largest f_n, f_t of each contact, over states or exact.

    Returns
    -------
    float
        Mean length of the intervals, divided by the mean of their midpoints.

    Raises
    ------
    InputError
        If shapes differ, and where low exceeds high.
    """
    if high is None:
        raise InputError(
            "eta3 takes two arrays (N_c, 2): eta3(exact.low, exact.high) of exact intervals, "
            "eta3(*sampled_intervals(states)) of states"
        )
    low, high = _bounds(low, high)
    return float((high - low).mean() / ((high + low) / 2).mean())


def sampled_intervals(states: Floats) -> tuple[Floats, Floats]:
    """Smallest and largest value of each component over states.

    Parameters
    ----------
    states : (S, N_c, 2) array
        Force networks (f_n, f_t).

    Returns
    -------
    low, high : (N_c, 2) array
        Force.
    """
    states = _some(states)
    return states.min(axis=0), states.max(axis=0)


def normal_extent(low: Floats, high: Floats) -> Floats:
    """ΔF_n, the length of the interval of f_n of each contact.

    Parameters
    ----------
    low, high : (N_c, 2) array
        Smallest and largest f_n, f_t of each contact, over states or exact.

    Returns
    -------
    (N_c,) array
        Force.

    Raises
    ------
    InputError
        As `eta3`.
    """
    low, high = _bounds(low, high)
    return high[:, 0] - low[:, 0]


def correlation(normal_forces: Floats, extent: Floats) -> float:
    """corr(f_n, ΔF_n) over contacts (Pearson).

    Parameters
    ----------
    normal_forces, extent : (N_c,) array
        f_n, and ΔF_n.

    Returns
    -------
    float
        NaN if one of them does not vary.

    Raises
    ------
    InputError
        If shapes differ.
    """
    _alike(normal_forces, extent)
    if np.ptp(extent) <= 1e-12 * np.abs(normal_forces).max(initial=0) or np.ptp(normal_forces) == 0:
        return float("nan")
    return float(scipy.stats.pearsonr(normal_forces, extent).statistic)


def correlation_range(states: Floats, extent: Floats) -> tuple[float, float]:
    """Range of corr(f_n, ΔF_n) with any state in place of the original network.

    Parameters
    ----------
    states : (S, N_c, 2) array
        Force networks (f_n, f_t).
    extent : (N_c,) array
        ΔF_n.

    Returns
    -------
    least, largest : float
        The paper's error bar of the correlation.
    """
    values = [correlation(state[:, 0], extent) for state in _some(states)]
    return float(np.min(values)), float(np.max(values))


def distances(states: Floats, centre: Floats) -> Floats:
    """Distance |F − centre| of states in force space.

    Parameters
    ----------
    states : (S, N_c, 2) array
        Force networks (f_n, f_t).
    centre : (N_c, 2) array
        Network.

    Returns
    -------
    (S,) array
        Force.

    Raises
    ------
    InputError
        For different numbers of contacts.
    """
    states = _some(states)
    centre = float_array(centre, states.shape[1:], "centre")
    return np.sqrt(((states - centre) ** 2).sum(axis=(1, 2)))


def principal_axes(states: Floats, count: int = 2) -> tuple[Floats, Floats]:
    """Directions along which states vary most.

    Parameters
    ----------
    states : (S, N_c, 2) array
        Force networks (f_n, f_t).
    count : int, default 2
        Number of axes.

    Returns
    -------
    axes : (count, N_c, 2) array
        Of length 1, with a positive largest component; zero without variation.
    share : (count,) array
        Of the variance.

    Raises
    ------
    InputError
        For a count below 1 or above the number of components 2 N_c.
    """
    states = _some(states)
    count = whole(count, "the number of axes", 1, states[0].size)
    flat = (states - mean_network(states)).reshape(len(states), -1)
    # States are usually fewer than components, so their Gram matrix is smaller.
    value, left = np.linalg.eigh(flat @ flat.T)
    axes, share = np.zeros((count, flat.shape[1])), np.zeros(count)
    varies = value > 1e-12 * max(value[-1], np.finfo(float).tiny) * len(value)
    for k in range(min(count, int(varies.sum()))):
        axis = left[:, -1 - k] @ flat
        axis *= np.sign(axis[np.abs(axis).argmax()]) / np.linalg.norm(axis)
        axes[k], share[k] = axis, value[-1 - k] / value[varies].sum()
    return axes.reshape(count, *states.shape[1:]), share


class Growth:
    """η1, η2 and η3 of states that are added one by one."""

    def __init__(self) -> None:
        self.count = 0

    def add(self, state: Floats) -> tuple[float, float, float]:
        """Add a state (N_c, 2); return (η1, η2, η3) of all states so far."""
        if not self.count:
            # A copy: the caller may use one array for all states.
            self._first = self._low = self._high = float_array(state, (-1, 2), "state")
            self._shift, self._square = np.zeros(state.shape), np.zeros(len(state))
        self.count += 1
        # Moments about the first state: if all are equal, their variance is exactly 0.
        moved = np.subtract(state, self._first, dtype=float)
        self._shift += moved
        self._square += (moved**2).sum(axis=1)
        shift = self._shift / self.count
        variance = np.maximum(0.0, self._square / self.count - (shift**2).sum(axis=1))
        size = np.linalg.norm(self._first + shift, axis=1)
        pairs = 2 * self.count / max(1, self.count - 1) * variance.sum()
        self._low, self._high = np.minimum(self._low, state), np.maximum(self._high, state)
        return (
            np.sqrt(variance).mean() / size.mean(),
            np.sqrt(pairs / (size**2).sum()),
            (self._high - self._low).mean() / ((self._high + self._low).mean() / 2),
        )


def growing(states: Floats) -> dict[str, Floats]:
    """η1, η2 and η3 of the first 1, 2, … S states.

    Parameters
    ----------
    states : (S, N_c, 2) array
        Force networks (f_n, f_t).

    Returns
    -------
    dict
        {"eta1": (S,), "eta2": (S,), "eta3": (S,)}.
    """
    growth = Growth()
    values = np.array([growth.add(state) for state in _some(states)])
    return dict(zip(("eta1", "eta2", "eta3"), values.T, strict=True))


def position_in_interval(normal_forces: Floats, low: Floats, high: Floats) -> Floats:
    """Position of each f_n in its interval, from 0 (least) to 1 (largest).

    Parameters
    ----------
    normal_forces : (N_c,) array
        f_n.
    low, high : (N_c, 2) array
        Smallest and largest f_n, f_t of each contact, over states or exact.

    Returns
    -------
    (N_c,) array
        NaN where the force is determined: ΔF_n is at most 10⁻⁶ of the largest force.

    Raises
    ------
    InputError
        As `eta3`, and for another number of forces.
    """
    low, high = _bounds(low, high)
    normal_forces = float_array(normal_forces, (len(low),), "normal forces")
    extent, rounding = high[:, 0] - low[:, 0], REVERSED * np.nanmax(np.abs(high), initial=0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(extent > rounding, (normal_forces - low[:, 0]) / extent, np.nan)


def undetermined_clusters(
    i: Integers, j: Integers, extent: Floats, tolerance: float
) -> tuple[Integers, Integers]:
    """Clusters of contacts with undetermined forces, connected through shared grains.

    Parameters
    ----------
    i, j : (N_c,) array of int
        Grains.
    extent : (N_c, 2) array
        Lengths of the intervals of f_n and f_t.
    tolerance : float
        A contact is undetermined if one of its lengths exceeds this.

    Returns
    -------
    cluster : (N_c,) array of int
        Cluster of each contact, −1 for determined ones.
    count : array of int
        Number of contacts of each cluster, largest first.

    Raises
    ------
    InputError
        For arrays of different numbers of contacts.
    """
    extent = real_array(extent, "lengths of intervals")
    if extent.shape != (len(i), 2) or len(i) != len(j):
        raise InputError(
            f"{len(i)} and {len(j)} grains and lengths of shape {extent.shape} are not of one list "
            "of contacts: i and j must have shape (N_c,), lengths (N_c, 2)"
        )
    i, j, loose = np.asarray(i), np.asarray(j), extent.max(axis=1) > tolerance
    label = np.full(len(i), -1)
    if not loose.any():
        return label, np.zeros(0, dtype=int)
    size = max(i.max(), j.max()) + 1
    bonds = sparse.coo_matrix((np.ones(loose.sum()), (i[loose], j[loose])), shape=(size, size))
    component = csgraph.connected_components(bonds, directed=False)[1][i[loose]]
    names, cluster, count = np.unique(component, return_inverse=True, return_counts=True)
    order = np.argsort(-count, kind="stable")
    rank = np.empty(len(names), dtype=int)
    rank[order] = np.arange(len(names))
    label[loose] = rank[cluster]
    return label, count[order]
