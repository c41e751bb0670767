"""Contacts that certainly carry force: in every network that agrees with a measurement."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import sparse

from granforce import notebook
from granforce.experiment.infer import measured_rows
from granforce.explore.intervals import Bounds, Key, SmallestForces, solved
from granforce.fields import record
from granforce.forces.contact_problem import make_system
from granforce.forces.ensemble import Ensemble
from granforce.forces.grain_pressures import GrainPressures, Rows
from granforce.forces.likeliest import checked, likeliest, spread_of
from granforce.numerics import highs as programs
from granforce.numerics.certified_values import Solver
from granforce.quantities import Field, quantity
from granforce.records import positive, takes
from granforce.system import cancelling
from granforce.tolerances import CARRYING, INTERVAL_GAP
from granforce.types import Cancel, Floats, Integers, Mask, Progress

# Bound on unmeasured forces, in the largest measured one.
_MOST = 10.0
# Factor by which bounds are widened beyond a violation, so that networks exist.
_BEYOND = 1.1
# Coordinates and slacks of such forces, in the largest force: f_n ± f_t/μ, and differences of them.
_LARGEST = 4.0
# Programs between two checks for contacts without force in some network.
_AT_ONCE = 64


@record
class Carrying(NamedTuple):
    """The least f_n of k contacts over all networks that agree with a measurement."""

    contacts: Annotated[Integers, quantity("backbone")]
    least: Annotated[Floats, quantity("least_normal", label="f_n_least", note="certified")]
    carries: Annotated[Mask, Field("contact", "", "least is above 0: they certainly carry force")]
    widened: Annotated[
        int, "measured forces and pressures with widened bounds, as no network agreed"
    ]
    counts: Annotated[
        dict[str, int], "programs solved, and skipped because f_n = 0 in some network"
    ]

    def _repr_html_(self) -> str:
        """The result as displayed in notebooks."""
        lines = {"contacts": len(self.contacts), "carry for certain": int(self.carries.sum())}
        return notebook.table("Contacts that carry", lines | self.counts)


@takes(Ensemble)
@cancelling.cancellable
def carrying(
    ensemble: Ensemble,
    measured: npt.ArrayLike | None = None,
    sigma: npt.ArrayLike | None = None,
    contacts: npt.ArrayLike | None = None,
    *,
    pressures: GrainPressures | None = None,
    within: float = 3.0,
    unmeasured: float | None = None,
    workers: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Carrying:
    """Least f_n of contacts over the networks within some σ of a measurement.

    Forces that were not measured are bounded by ten times the largest measured one. Each contact
    takes one linear program, or none if f_n = 0 in a known network.

    Parameters
    ----------
    ensemble, measured, sigma, pressures, unmeasured
        As for `infer`.
    contacts : (k,) array of int, optional
        Numbers in the packing, by default all that were not measured.
    within : float, default 3
        Bounds on each measured value, in σ; if the most likely network is farther away, its
        distance and a tenth, so that there always is a network.
    workers : int, default 1
        Threads.
    progress : callable, optional
        progress(done, total).
    cancel : callable, optional
        Polled; returning True raises Cancelled.

    Returns
    -------
    Carrying
        least (k,), force, and where it is above 0.

    Raises
    ------
    InputError, NotJammedError
        As `infer` does.
    """
    within = positive(within, "within")
    m, s = checked(ensemble, measured, sigma)
    rows = measured_rows(ensemble, measured, pressures)
    best = likeliest(ensemble, m, s, spread_of(ensemble, unmeasured), rows)
    width = np.fmax(within, _BEYOND * np.abs(best.deviation)) * s
    most = _MOST * np.nanmax(np.abs(m), initial=np.abs(best.forces).max())
    bounds = ensemble.bounds
    bounds[..., 0] = np.maximum(np.nan_to_num(m - width, nan=-most), bounds[..., 0])
    bounds[..., 1] = np.minimum(np.nan_to_num(m + width, nan=most), bounds[..., 1])
    bounded = ensemble.with_bounds(bounds, best.forces)
    places = np.flatnonzero(np.isnan(m[:, 0]))
    if contacts is not None:
        places = ensemble.positions(contacts)
    if len(rows.values):
        width = np.fmax(within, _BEYOND * np.abs(best.of_rows)) * rows.sigma
        largest = _LARGEST * most / (ensemble.force_scale * ensemble.units.min())
        least, counts = _least_with_rows(bounded, rows, width, largest, places, progress)
    else:
        least, counts = _least(bounded, places, best.forces, workers, progress)
    return Carrying(
        ensemble.index[places],
        least * ensemble.force_scale,
        least > CARRYING,
        int(np.sum(np.abs(best.deviation) > within) + np.sum(np.abs(best.of_rows) > within)),
        counts,
    )


def _least_with_rows(
    ensemble: Ensemble,
    rows: Rows,
    width: Floats,
    largest: float,
    places: Integers,
    progress: Progress | None,
) -> tuple[Floats, dict[str, int]]:
    """As `_least`, with bounds `width` (k,) around the values of rows, for coordinates < `largest`.

    A multiplier λ of the rows of A y = b proves c·y ≥ b·λ + Σ min(c − Aᵀλ, 0) · largest.
    """
    A, b, T = ensemble.scaled_form
    sums = rows.unknowns(ensemble) @ T * ensemble.force_scale
    scale = 1 / np.maximum(np.abs(sums).max(axis=1).toarray().ravel(), 1e-300)
    width, unit = scale * width, sparse.identity(len(width))
    whole = sparse.block_array(
        [[A, None, None], [sparse.diags(scale) @ sums, unit, None], [None, unit, unit]],
        format="csc",
    )
    right = np.concatenate([b, scale * rows.values + width, 2 * width])
    model, columns = programs.going_on(whole, right), whole.shape[1]
    T = sparse.csr_matrix(sparse.hstack([T, sparse.csr_matrix((T.shape[0], 2 * len(width)))]))
    seen, least = np.full(len(ensemble.index), np.inf), np.zeros(len(places))
    solved = 0
    for done, place in enumerate(places.tolist()):
        if seen[place] > INTERVAL_GAP:
            cost = T[[ensemble.per_contact * place]].toarray().ravel()
            programs.set_cost(model, cost)
            _, y = programs.solve(model)
            multiplier = programs.multipliers(model, whole, cost)
            short = np.minimum(cost - whole.T @ multiplier, 0.0)
            least[done] = max(0.0, right @ multiplier + largest * short.sum())
            normal = ensemble.to_forces(T @ np.maximum(y[:columns], 0.0))[:, 0]
            seen, solved = np.minimum(seen, normal), solved + 1
        cancelling.check("exact bounds")
        if progress is not None:
            progress(done + 1, len(places))
    skipped = len(places) - solved
    return least, {"programs": solved, "f_n = 0 seen in a known network": skipped}


def _least(
    ensemble: Ensemble, places: Integers, forces: Floats, workers: int, progress: Progress | None
) -> tuple[Floats, dict[str, int]]:
    """Certified lower bounds (k,) of f_n, in ⟨f_n⟩, and counts."""
    smallest = SmallestForces(ensemble, forces)
    solver = Solver(make_system(ensemble), workers=workers, on_state=lambda key, y: smallest.add(y))
    keys: list[Key] = [(int(c), 0, 0) for c in places]
    bounds: Bounds = {}
    waiting = keys
    while waiting:
        waiting = [key for key in waiting if smallest.least[key[0]] > INTERVAL_GAP]
        batch, waiting = waiting[:_AT_ONCE], waiting[_AT_ONCE:]
        bounds |= solved(ensemble, solver, batch)
        cancelling.check("exact bounds")
        if progress is not None:
            progress(len(keys) - len(waiting), len(keys))
    values = np.array([bounds.get(key, (0.0, 0.0))[1] for key in keys])
    counts = solver.counts | {"f_n = 0 seen in a known network": len(keys) - len(bounds)}
    return np.where(np.isfinite(values), np.maximum(values, 0.0), 0.0), counts
