"""Which contacts carry for certain: in every network that agrees with a measurement."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce import notebook
from granforce.explore.intervals import bound_of
from granforce.forces import knowledge
from granforce.forces.contact_problem import make_system
from granforce.forces.ensemble import Ensemble
from granforce.forces.likeliest import UNMEASURED, checked, likeliest
from granforce.numerics.certified_values import Solver
from granforce.records import Cancel, Floats, Integers, Mask, Progress, positive
from granforce.system import cancelling
from granforce.tolerances import CARRYING, INTERVAL_GAP

# Forces that were not measured stay below this, in the largest measured one.
_MOST = 10.0
# Bounds that the likeliest network breaks give so much more than they must: what is left has room.
_BEYOND = 1.1
# Programs between two looks at which contacts were seen without force.
_AT_ONCE = 64


class Carrying(NamedTuple):
    """The least f_n of k contacts over all networks that agree with a measurement."""

    contacts: Integers  # (k,) their numbers in the packing
    least: Floats  # (k,) certified lower bound of f_n, force
    carries: Mask  # (k,) bool: it is above 0, so they carry for certain
    widened: int  # measured components whose bounds had to give, as no network agreed
    counts: dict[str, int]  # programs solved, and skipped as f_n = 0 was seen in some network

    def _repr_html_(self) -> str:
        """The result as notebooks show it."""
        lines = {"contacts": len(self.contacts), "carry for certain": int(self.carries.sum())}
        return notebook.table("Contacts that carry", lines | self.counts)


@cancelling.cancellable
def carrying(
    ensemble: Ensemble,
    measured: npt.ArrayLike,
    sigma: npt.ArrayLike,
    contacts: npt.ArrayLike | None = None,
    *,
    within: float = 3.0,
    unmeasured: float = UNMEASURED,
    workers: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Carrying:
    """Least f_n of contacts over the networks within so many σ of a measurement; a Carrying.

    measured, sigma, unmeasured: as for `infer`. contacts: numbers in the packing, by default all
    that were not measured. within: bounds on each measured component, in σ; where the likeliest
    network is farther off, a tenth beyond its distance, so that there always is a network. Forces
    that were not measured stay below ten times the largest measured one.

    Each contact takes one linear program, none where f_n = 0 was seen in a known network. Raises
    InputError and NotJammedError as `infer` does.
    """
    m, s = checked(ensemble, measured, sigma)
    best = likeliest(ensemble, m, s, unmeasured)
    width = np.fmax(positive(within, "within"), _BEYOND * np.abs(best.deviation)) * s
    most = _MOST * np.nanmax(np.abs(m), initial=np.abs(best.forces).max())
    bounds = np.stack([np.nan_to_num(m - width, nan=-most), np.nan_to_num(m + width, nan=most)], -1)
    if ensemble.known is not None:
        low, high = (
            side * ensemble.force_scale for side in (ensemble.known.low, ensemble.known.high)
        )
        bounds = np.stack([np.maximum(bounds[..., 0], low), np.minimum(bounds[..., 1], high)], -1)
    known = knowledge.polygons(bounds, ensemble.mu, ensemble.force_scale, ensemble.index)
    bounded = replace(ensemble, known=known, found=best.forces)
    if contacts is None:
        places = np.flatnonzero(np.isnan(m[:, 0]))
    else:
        places = ensemble.positions(contacts)
    least, counts = _least(bounded, places, best.forces, workers, progress)
    return Carrying(
        ensemble.index[places],
        least * ensemble.force_scale,
        least > CARRYING,
        int(np.sum(np.abs(best.deviation) > within)),
        counts,
    )


def _least(
    ensemble: Ensemble, places: Integers, forces: Floats, workers: int, progress: Progress | None
) -> tuple[Floats, dict[str, int]]:
    """Certified lower bounds (k,) of f_n, in ⟨f_n⟩, and counts."""
    seen = forces[:, 0] / ensemble.force_scale

    def note(key: Any, y: Floats) -> None:
        np.minimum(seen, y[: 2 * len(seen)].reshape(-1, 2).mean(axis=1), out=seen)

    solver = Solver(make_system(ensemble), workers=workers, seen=note)
    least: dict[Any, tuple[float, float]] = {}
    done = 0
    waiting = [int(c) for c in places]
    while waiting:
        waiting = [c for c in waiting if seen[c] > INTERVAL_GAP]
        batch, waiting = waiting[:_AT_ONCE], waiting[_AT_ONCE:]
        keys = [(c, 0, 0) for c in batch]
        least |= solver.solve(keys, [bound_of(ensemble, *key) for key in keys])
        cancelling.check("exact bounds")
        done = len(places) - len(waiting)
        if progress is not None:
            progress(done, len(places))
    values = np.array([least.get((int(c), 0, 0), (0.0, 0.0))[1] for c in places])
    counts = solver.counts | {"f_n = 0 seen in a known network": len(places) - len(least)}
    return np.where(np.isfinite(values), np.maximum(values, 0.0), 0.0), counts
