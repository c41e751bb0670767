"""The packing of a photoelastic frame: measured contacts, candidates, walls, and what balances.

Pairs about as close as the listed ones are candidates, of unmeasured force. A linear program finds
the fewest grains that still cannot be balanced.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from granforce.experiment.listings.listing import Listing
from granforce.experiment.walls import Bodies
from granforce.forces.build import ensemble
from granforce.forces.grain_pressures import GrainPressures, rows_of
from granforce.forces.likeliest import Likeliest, likeliest
from granforce.numerics import highs
from granforce.records import Packing, UndecidedError, make_contacts, make_packing, positive
from granforce.tolerances import OUTLIER
from granforce.types import Floats, Integers, Mask

# Unbalance in ⟨f_n⟩ up to which a grain is balanced.
BALANCED = 1e-6
# Cost of changing a measured force by ⟨f_n⟩, compared with 1 for ⟨f_n⟩ of unbalance.
_CHANGE = 0.2
# Interior-point steps after which another method is tried; usually 10 to 40 are enough.
_ITERATIONS = 500
# Most estimates of the default error: outliers change it, and it decides what is one.
_ESTIMATES = 4


class MeasuredPairs(NamedTuple):
    """Contacts between two grains, each once."""

    pairs: Integers  # (k, 2) grains, the first before the second
    forces: Floats  # (k, 2) mean of the listed forces; NaN if not measured
    spread: Floats  # (k, 2) half the largest difference
    factor: Floats  # (k,) variance of the mean, relative to a usual line
    twice: int  # contacts that are listed more than once
    unequal: int  # listed more than once, with different forces


class Measured(NamedTuple):
    """The measurement on the contacts of a packing; NaN where there is none."""

    forces: Floats  # (N_c, 2)
    sigma: Floats  # (N_c, 2) errors that are known, of load cells
    factor: Floats  # (N_c,) of the variance
    added: Mask  # (N_c,) contacts that were not listed


class Assembly(NamedTuple):
    """Grains, contacts and walls of a frame, of which its packing is made."""

    x: Floats  # (N, 2)
    r: Floats  # (N,)
    mu: float
    at_wall: Mask  # (N,)
    listed: MeasuredPairs
    candidates: Integers  # (k, 2)
    walls: Bodies | None

    def without_candidates(self) -> Assembly:
        """The assembly of the listed contacts and the walls alone."""
        return self._replace(candidates=np.zeros((0, 2), int))

    def packing(self) -> Packing:
        """Listed, candidate and wall contacts, with forces as listed, otherwise 0.

        Contact points are midway between the disks, whose radii are not known accurately.
        """
        x, r, walls = self.x, self.r, self.walls
        i, j = np.concatenate([self.listed.pairs, self.candidates]).T
        branch = x[j] - x[i]
        length = np.hypot(*branch.T)
        contacts = make_contacts(i, j, branch / length[:, None], length, r)
        contacts = contacts._replace(arm_i=r[i] + contacts.gap / 2, arm_j=r[j] + contacts.gap / 2)
        load = np.where(self.at_wall[:, None], np.nan, np.zeros((len(r), 3)))
        if walls is not None:
            load[walls.contacts.i[walls.contacts.i < len(r)]] = 0.0
            x, r, load = (
                np.concatenate(both) for both in ((x, walls.x), (r, walls.r), (load, walls.load))
            )
            contacts = contacts.joined(walls.contacts)
        forces = np.nan_to_num(self.measured().forces)
        return make_packing(x, r, np.full(2, np.inf), contacts, forces, self.mu, load=load)

    def measured(self) -> Measured:
        """The measurement on the contacts of the packing."""
        listed, walls, count = self.listed, self.walls, len(self.candidates)
        nothing = np.full((count, 2), np.nan)
        parts = [
            Measured(
                listed.forces,
                np.full_like(listed.forces, np.nan),
                listed.factor,
                np.zeros(len(listed.pairs), dtype=bool),
            ),
            Measured(nothing, nothing, np.ones(count), np.ones(count, dtype=bool)),
        ]
        if walls is not None:
            added = np.isnan(walls.measured[:, 0])
            parts.append(Measured(walls.measured, walls.sigma, walls.factor, added))
        return Measured(*map(np.concatenate, zip(*parts, strict=True)))


def measured_pairs(listing: Listing) -> MeasuredPairs:
    """The MeasuredPairs of a repaired listing."""
    rows = listing.rows
    inner = np.all(rows >= 0, axis=1)
    # f_t has the sign of n and t turned together, which stays the same when i and j are swapped.
    pairs, which = np.unique(np.sort(rows[inner]), axis=0, return_inverse=True)
    which, values = which.ravel(), listing.forces[inner]
    good = np.isfinite(values[:, 0])
    weight = np.where(good, listing.weight[inner], 0.0)
    total = np.bincount(which, weight, len(pairs))
    low, high, mean = np.full((3, len(pairs), 2), 0.0)
    low[:], high[:] = np.inf, -np.inf
    np.minimum.at(low, which[good], values[good])
    np.maximum.at(high, which[good], values[good])
    np.add.at(mean, which[good], weight[good, None] * values[good])
    with np.errstate(divide="ignore", invalid="ignore"):
        mean /= total[:, None]
        factor = (
            1 if listing.both_ways else np.bincount(which[good], minlength=len(pairs))
        ) / total
        spread = np.where(np.isfinite(mean), 0.5 * (high - low), np.nan)
    times = np.bincount(which, minlength=len(pairs))
    unequal = int(np.sum(np.nan_to_num(spread).any(axis=1)))
    return MeasuredPairs(
        pairs=pairs,
        forces=mean,
        spread=spread,
        factor=factor,
        twice=int(np.sum(times > 1)),
        unequal=unequal,
    )


def candidates(x: Floats, r: Floats, known: Integers, left_open: Mask, reach: float) -> Integers:
    """Pairs (k, 2) that are not known, with a gap up to `reach`, at least one to be balanced."""
    far = 2 * r.max() + reach * r.mean()
    pairs = cKDTree(x).query_pairs(far, output_type="ndarray") if reach else np.zeros((0, 2), int)
    pairs = np.sort(pairs.astype(np.int64))
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    gap = np.hypot(*(x[pairs[:, 1]] - x[pairs[:, 0]]).T) - r[pairs].sum(axis=1)
    are_known = np.isin(pairs @ [len(x), 1], known @ [len(x), 1])
    return pairs[(gap <= reach * r.mean()) & ~are_known & ~left_open[pairs].all(axis=1)]


def unbalance(packing: Packing, m: Floats, unit: float) -> Floats:
    """(N,) unbalance of each grain that no admissible forces near the measured ones can remove.

    From the least Σ |unbalance| + _CHANGE Σ |f − m|, in units of `unit`: sums of absolute values
    leave few grains unbalanced.
    """
    S = ensemble(packing, prune=False)
    of_grains = np.zeros(len(packing.r))
    if not len(S.grains):
        return of_grains
    A, T = S.cone_form
    m = S.to_vector(m) / unit
    measured = np.flatnonzero(np.isfinite(m))
    rows, columns = A.shape[0], A.shape[1]
    both = sparse.vstack([A, sparse.csr_matrix(T)[measured]])
    slack = sparse.identity(rows + len(measured))
    cost = np.concatenate([np.ones(rows), np.full(len(measured), _CHANGE)])
    right = np.concatenate([np.zeros(rows), m[measured]])
    # Five times as fast as the simplex method here; its crossover also ends in a vertex.
    model = highs.standard_form(sparse.hstack([both, slack, -slack]), right, solver="ipm")
    model.setOptionValue("ipm_iteration_limit", _ITERATIONS)
    highs.set_cost(model, np.concatenate([np.zeros(columns), cost, cost]))
    solution = highs.optimal(model)
    if solution is None:
        raise UndecidedError("which grains can be balanced is undecided: no solver reached an end")
    off = np.abs(A @ np.maximum(solution[:columns], 0.0)).reshape(-1, S.per_grain)
    of_grains[S.grains] = off.sum(axis=1)
    return np.where(of_grains > BALANCED, of_grains, 0.0)


def inferred(
    packing: Packing,
    measured: Measured,
    pressures: GrainPressures | None,
    spread: Floats,
    error: float | None,
    unit: float,
) -> tuple[Likeliest, Floats]:
    """The Likeliest network, and σ (N_c, 2): as given for load cells, else from the factors."""
    S, m = ensemble(packing, prune=False), measured.forces
    relative = np.sqrt(measured.factor)[:, None] * np.ones(2)
    unknown = np.isnan(measured.sigma)
    differing = np.zeros_like(m)
    differing[: len(spread)] = np.nan_to_num(spread)

    def with_spread(error: float) -> Floats:
        # Smaller differences are the noise itself: adding them would count it twice.
        noise = error * relative
        return np.hypot(noise, np.where(differing > OUTLIER * noise, differing, 0.0))

    if error is None:
        error = unit
        for _ in range(_ESTIMATES):
            best = likeliest(S, np.where(unknown, m, np.nan), with_spread(error))
            freedom = max(best.freedom, 1)
            least = unit * np.sqrt(BALANCED / freedom)
            error = max(error * np.sqrt(best.chi_square / freedom), least)
            if not (differing > OUTLIER * error * relative).any():
                break
    sigma = np.where(unknown, with_spread(positive(error, "error")), measured.sigma)
    sigma[np.isnan(m)] = np.nan
    return likeliest(S, m, sigma, rows=rows_of(S, pressures)), sigma
