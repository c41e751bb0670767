"""Kinds of stored bounds of S: intervals, limit loads, and outlines."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import xarray as xr

from granforce.explore.intervals import intervals, limit_load_bounds
from granforce.explore.outline import outline
from granforce.explore.stress_outline import stress_outline
from granforce.forces.ensemble import Ensemble
from granforce.records import InputError, positive, whole
from granforce.study.bounds import (
    intervals_dataset,
    limit_loads_dataset,
    outline_dataset,
    stress_dataset,
)
from granforce.study.cells import Kind
from granforce.study.keys import Parameters
from granforce.study.kinds import slices
from granforce.study.kinds.packings import check_complete, chosen_contacts, cones_of, ensemble_of
from granforce.study.store import Store
from granforce.system import cancelling
from granforce.system.clock import timed
from granforce.types import Floats, Progress


def _exact_parameters(
    packing: Parameters,
    *,
    mu: Any = None,
    contacts: Iterable[int] | None = None,
    slice_: Sequence[float] | None = None,
    **conditions: Any,
) -> Parameters:
    """The parameters of exact bounds or limit loads of one packing.

    mu: friction coefficient of the ensemble, by default the packing's. contacts: numbers in the
    packing's contact list, by default all in the backbone. slice_: (x0, x1, y0, y1) in fractions of
    the box: contacts with a grain outside are frozen at their original forces. conditions: on
    the forces.
    """
    if slice_ is not None and conditions.get("prescribed") == "stress":
        raise InputError(
            "the forces around a slice determine its stress: prescribe nothing with a slice"
        )
    return {
        **cones_of(packing, mu, **conditions),
        "contacts": chosen_contacts(contacts),
        "slice": None if slice_ is None else slices.edges(slice_),
    }


def _intervals(
    store: Store,
    parameters: Parameters,
    *,
    workers: int,
    progress: Progress | None,
    begun: Callable[[Ensemble], object] | None = None,
    **options: Any,
) -> xr.Dataset:
    """Dataset of exact bounds and η3, and of clusters of undetermined contacts.

    begun(S) is called before the first program. options: widths and watch, as for `intervals`.
    """
    S = ensemble_of(store, parameters)
    if begun:
        begun(S)
    options |= {"workers": workers, "progress": progress}
    seconds, bounds = timed(intervals, S, parameters["contacts"], **options)
    check_complete(S, bounds, "exact bounds")
    return intervals_dataset(S, bounds, seconds=seconds)


def _limit_loads(
    store: Store, parameters: Parameters, *, workers: int, progress: Progress | None
) -> xr.Dataset:
    """Dataset of the limit loads of contacts."""
    S = ensemble_of(store, parameters)
    options: dict[str, Any] = {"workers": workers, "progress": progress}
    seconds, loads = timed(limit_load_bounds, S, parameters["contacts"], **options)
    check_complete(S, loads, "limit loads")
    return limit_loads_dataset(S, loads, seconds=seconds)


def _outline_parameters(
    packing: Parameters,
    *,
    mu: Any = None,
    components: Any = None,
    states: Any = None,
    tolerance: float = 1e-3,
    **conditions: Any,
) -> Parameters:
    """The parameters of the outline of S in a plane.

    mu: friction coefficient of the ensemble, by default the packing's. components: two pairs
    (contact as its number in the packing, 0 for f_n or 1 for f_t); or states: parameters of the
    walk or sample whose principal axes span the plane. tolerance: as for `outline`. conditions: on
    the forces.
    """
    if (components is None) == (states is None):
        raise InputError("the plane of an outline is given by two components, or by states")
    chosen = None if components is None else _components(components)
    named = cones_of(packing, mu, **conditions) | {"tolerance": positive(tolerance, "tolerance")}
    return named | {"components": chosen, "states": states}


def _components(components: Any) -> list[list[int]]:
    """Two pairs [contact, 0 or 1] as ints."""
    try:
        pairs = [(contact, part) for contact, part in components]
    except (TypeError, ValueError):
        pairs = []
    if len(pairs) != 2:
        raise InputError("a plane is given by two pairs: a contact, and 0 for f_n or 1 for f_t")
    return [
        [whole(c, "the number of a contact"), whole(part, "f_n or f_t", 0, 1)] for c, part in pairs
    ]


def _outline(
    store: Store,
    parameters: Parameters,
    *,
    workers: int,
    progress: Progress | None,
    axes: Floats | None = None,
) -> xr.Dataset:
    """Dataset of the outline of S in a plane.

    axes (2, N_c, 2): principal axes of the states in the parameters; not used with components.
    """
    S = ensemble_of(store, parameters)
    plane = _component_axes(S, parameters["components"]) if axes is None else axes
    options = {"tolerance": parameters["tolerance"], "workers": workers, "progress": progress}
    seconds, polygons = timed(outline, S, plane, **options)
    cancelling.check("outline")
    if not polygons.converged:
        raise InputError(f"outline not closed: a gap of {polygons.gap:.1e} ⟨f_n⟩ is left")
    return outline_dataset(S, plane, polygons, seconds=seconds)


def _component_axes(S: Ensemble, components: Sequence[Sequence[int]]) -> Floats:
    """Axes (2, N_c, 2) along two components (contact in the packing, 0 or 1)."""
    axes = np.zeros((2, len(S.index), 2))
    for k, (contact, part) in enumerate(components or ()):
        axes[k, S.positions([contact]), part] = 1.0
    return axes


def _stress_parameters(
    packing: Parameters, *, mu: Any = None, angles: int = 64, known: Any = None
) -> Parameters:
    """The parameters of the outline of the stresses that a packing can carry.

    mu: friction coefficient of the ensemble, by default the packing's. angles: their number. known:
    as for `conditions`.
    """
    cones = cones_of(packing, mu, known=known)
    return cones | {"angles": whole(angles, "the number of angles", 1, 4096)}


def _stress(
    store: Store, parameters: Parameters, *, workers: int, progress: Progress | None
) -> xr.Dataset:
    """Dataset of the outline of stresses."""
    S = ensemble_of(store, parameters)
    options: dict[str, Any] = {"workers": workers, "progress": progress}
    seconds, polygons = timed(stress_outline, S, parameters["angles"], **options)
    cancelling.check("outline of stresses")
    if not polygons.converged:
        raise InputError("the outline of stresses did not close")
    return stress_dataset(S, polygons, seconds=seconds)


INTERVALS = Kind(
    name="intervals",
    version=1,
    title="exact bounds",
    unit="bound",
    parameters=_exact_parameters,
    compute=_intervals,
)
LIMIT_LOADS = Kind(
    name="limit_loads",
    version=1,
    title="limit loads",
    unit="contact",
    parameters=_exact_parameters,
    compute=_limit_loads,
)
OUTLINE = Kind(
    name="outline",
    version=1,
    title="outline of S",
    unit="program",
    parameters=_outline_parameters,
    compute=_outline,
)
STRESS = Kind(
    name="stress",
    version=1,
    title="outline of stresses",
    unit="program",
    parameters=_stress_parameters,
    compute=_stress,
)
