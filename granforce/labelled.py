"""Results as xarray datasets and pandas tables, with labelled contacts and components."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from granforce.experiment.informative import Informative
from granforce.explore.intervals import Intervals
from granforce.explore.pull import Pull
from granforce.explore.random_walk import Walk
from granforce.explore.uniform import UniformSample
from granforce.fields import fields, label_of
from granforce.forces.ensemble import Ensemble
from granforce.forces.nearest import starting_network
from granforce.perturb.critical_force import CriticalForce
from granforce.quantities import FORCE, LENGTH, MEAN, Field, quantity
from granforce.records import InputError, Packing, choice, with_article
from granforce.study.bounds import clusters_of
from granforce.tolerances import AT_REST
from granforce.types import Integers

COMPONENTS = ["f_n", "f_t"]
_FOREIGN = "the result belongs to another ensemble"
# The word for a unit of force in the name of a column, and its name in attributes.
UNITS = {"packing": FORCE, "mean": MEAN}
# Units in the names of columns; others, of lengths and numbers, are not.
WORDS = {unit: word for word, unit in UNITS.items()} | {
    unit: unit for unit in ("sigma", "rad", "pressure")
}
# Labels of dimensions; those of contacts and grains are their numbers.
_LABELS = {
    "component": COMPONENTS,
    "side": ["low", "high"],
    "axis": ["x", "y"],
    "load_component": ["x", "y", "torque"],
    "ladder": ["down", "up"],
}
# Dimensions in front of contacts, in the order of the columns of a table.
_RUNNING = ("chain", "state", "value", "load", "side", "direction")

Declared = dict[str, tuple[Field, Any]]  # variables: what they are, and their values


def column_name(component: str | None, variable: str, unit: str | None = None) -> str:
    """The name of a column: f_n_low [packing], from "f_n", "low" and "packing"."""
    name = "_".join(part for part in (component, variable) if part)
    return f"{name} [{unit}]" if unit else name


def to_dataset(
    result: Any, ensemble: Ensemble | None = None, *, unit: str = "packing"
) -> xr.Dataset:
    """A result as an xarray Dataset with labels: component="f_n", contact with i, j, x, y.

    Records have this function, and `to_dataframe`, as methods: ``exact.to_dataset(S)``.

    Parameters
    ----------
    result : record, list or array
        A Packing, a record returned by `intervals`, `walk` and others, the list from
        `critical_forces`, networks (N_c, 2), (S, N_c, 2) or (chains, S, N_c, 2), or a number per
        contact (N_c,), such as limit loads of all of S.
    ensemble : Ensemble, optional
        Of the result; not needed for a Packing, Volume, Outline or StressOutline.
    unit : {"packing", "mean"}
        Of forces: the packing's, or the mean normal force ⟨f_n⟩ of the ensemble, as ``--unit`` of
        the command line. Quantities relative to ⟨f_n⟩ by definition, such as residuals, are always
        in it.

    Returns
    -------
    xr.Dataset
        Coordinates: contact, its number in the packing; i and j, its grains; x and y, the point of
        contact, length; component, "f_n" or "f_t"; polygon, "inner" or "outer" for an outline's
        corners; angle, of a StressOutline. Numbers and texts of the record become attributes, with
        forces in the same unit.

    Raises
    ------
    InputError
        For anything else, for a unit without effect, and if the ensemble is missing or does not
        match.
    """
    choice(unit, UNITS, "unit")
    declared = _declared(result, ensemble)
    used = {word for field, _ in declared.values() for word in field.dims.split()}
    contacts = None
    if isinstance(result, Packing):
        packing: Packing | None = result
    elif used & {"contact", "grain", "packing_contact"}:
        _check_ensemble(ensemble, result)
        assert ensemble is not None
        packing = ensemble.packing
        if "packing_contact" not in used:
            _refuse_foreign(result, ensemble)
            contacts = _numbers(result, ensemble)
    else:
        packing = None
    scalars = _scalars(result, ensemble)
    if unit == "mean":
        _check_unit(declared, ensemble)
        assert ensemble is not None
        declared = in_mean_forces(declared, ensemble.force_scale)
        scalars = in_mean_forces(scalars, ensemble.force_scale)
    try:
        dataset = labelled_dataset(declared, packing, contacts)
    except ValueError as error:
        raise InputError(f"{_FOREIGN}: {error}") from None
    return dataset.assign_attrs({name: value for name, (_, value) in scalars.items()})


def labelled_dataset(
    declared: Declared, packing: Packing | None = None, contacts: Integers | None = None
) -> xr.Dataset:
    """Variables with labels on all their dimensions; contacts (k,): by default all of the packing.

    Raises ValueError for arrays that do not match.
    """
    variables = {
        name: xr.Variable(_dimensions(field), values, _attributes(field))
        for name, (field, values) in declared.items()
    }
    used = {word for variable in variables.values() for word in variable.dims}
    labels: dict[str, Any] = {
        # Text of fixed length is not in Zarr's specification: writing it warns.
        name: np.array(text, dtype=object)
        for name, text in _LABELS.items()
        if name in used
    }
    if packing is not None and used & {"contact", "grain"}:
        labels |= contact_labels(packing, contacts)
    texts = [name for name, variable in variables.items() if variable.dtype == object]
    return xr.Dataset(variables, labels).set_coords(texts)


CONTACT_LABELS = ("i", "j", "x", "y", "n_x", "n_y", "wall")  # coordinates of `contact_labels`


def contact_labels(packing: Packing, contacts: Integers | None = None) -> dict[str, Any]:
    """Coordinates of contacts (k,), by default all of the packing: grains, and point of contact."""
    if contacts is None:
        contacts = np.arange(len(packing.contacts.i))
    every, at = packing.contacts, packing.contact_points[contacts]
    point = {"units": LENGTH, "long_name": "point of contact"}
    normal = {"units": "1", "long_name": "unit normal from i to j"}
    wall = {"long_name": "1 where i or j is a wall or a fixed body, else 0"}
    return {
        "contact": contacts,
        "i": ("contact", every.i[contacts], {"long_name": "first grain"}),
        "j": ("contact", every.j[contacts], {"long_name": "second grain"}),
        "x": ("contact", at[:, 0], point),
        "y": ("contact", at[:, 1], point),
        "n_x": ("contact", every.normal[contacts, 0], normal),
        "n_y": ("contact", every.normal[contacts, 1], normal),
        "wall": ("contact", packing.touch_walls[contacts].astype(np.int64), wall),
    }


def to_dataframe(
    result: Any, ensemble: Ensemble | None = None, *, unit: str = "packing"
) -> pd.DataFrame:
    """A result as a pandas table: a row for each contact, or for each contact in each state.

    `read_known` and ``--known`` read the file that the table's `to_csv` writes.

    Parameters
    ----------
    result, ensemble, unit
        As for `to_dataset`, which raises the same errors.

    Returns
    -------
    pd.DataFrame
        Columns have the names of the tables of the command line: contact, i, j, x, y, then
        component, variable and unit, such as ``f_n [packing]`` for networks and ``f_n_low
        [packing]`` for bounds. Of intervals, ``cluster`` is the cluster of undetermined contacts,
        −1 where determined. A Volume has a row for each ladder, an Outline for each corner, a
        StressOutline for each angle, a Body for each contact along each direction.
    """
    dataset = to_dataset(result, ensemble, unit=unit)
    if "contact" in dataset.dims or "angle" in dataset.dims:
        return table(dataset)
    if "corner" in dataset.dims:
        u = dataset["corners"].values
        return pd.DataFrame({"polygon": dataset["polygon"].values, "u1": u[:, 0], "u2": u[:, 1]})
    return dataset.to_dataframe()


def to_arviz(draws: Any, ensemble: Ensemble, *, unit: str = "packing") -> xr.DataTree:
    """Draws of several chains for ArviZ: from version 1 on it takes this tree as it is.

    ArviZ 0.23, the last for Python 3.11, turns it into InferenceData: ``az.from_datatree(tree)``.

    Parameters
    ----------
    draws : UniformSample, Draws, Inference or (chains, k, N_c, 2) array
        The draws, or an inference with some. Of a walk in one chain, ``walk.states[None]``.
    ensemble, unit
        As for `to_dataset`, which raises the same errors.

    Returns
    -------
    xr.DataTree
        Group posterior with ``force`` (chain, draw, contact, component), and group sample_stats
        with ``residual`` and ``violation`` of each draw.

    Raises
    ------
    InputError
        For results without chains.
    """
    draws = getattr(draws, "draws", draws)
    states = getattr(draws, "states", draws)
    if not isinstance(states, np.ndarray) or states.ndim != 4:
        raise InputError(
            "ArviZ needs draws by chain: give a UniformSample, an Inference with draws, or an "
            "array (chains, k, N_c, 2), such as walk.states[None]"
        )
    posterior = to_dataset(states, ensemble, unit=unit).rename(states="force", state="draw")
    checks = {name: getattr(ensemble, name)(states) for name in ("residual", "violation")}
    if states is not draws:
        ensemble.refuse_foreign(states, draws.residual, "the result")
    variables = {
        name: xr.Variable(("chain", "draw"), values, _attributes(quantity(name)))
        for name, values in checks.items()
    }
    numbers = {name: np.arange(posterior.sizes[name]) for name in ("chain", "draw")}
    groups = {"posterior": posterior, "sample_stats": xr.Dataset(variables)}
    return xr.DataTree.from_dict({name: one.assign_coords(numbers) for name, one in groups.items()})


def table(dataset: xr.Dataset) -> pd.DataFrame:
    """The variables of contacts, or of angles, with a row for each, or for each in each state."""
    rows = "contact" if "contact" in dataset.dims else "angle"
    columns: dict[str, xr.DataArray] = {}
    for name, values in dataset.data_vars.items():
        if rows in values.dims and "side" not in values.dims[1:]:
            columns |= _columns(str(name), values)
    order = [name for name in _RUNNING if any(name in values.dims for values in columns.values())]
    frame = xr.Dataset(columns).to_dataframe([*order, rows]).reset_index()
    named = {name: column_name(None, name, _word(dataset[name])) for name in (*order, rows)}
    labels = CONTACT_LABELS if rows == "contact" else ()
    first = [*named.values(), *labels]
    frame = frame.rename(columns=named)
    return frame[[*first, *(name for name in columns if name not in first)]]


def _columns(name: str, values: xr.DataArray) -> dict[str, xr.DataArray]:
    """The columns of a variable: one, or one of each component."""
    if "component" not in values.dims:
        return {column_name(None, name, _word(values)): values}
    variable = "" if name in ("states", "forces") else name
    return {
        column_name(part, variable, _word(values)): values.sel(component=part, drop=True)
        for part in COMPONENTS
    }


def _word(values: xr.DataArray) -> str | None:
    """The unit in the name of a column."""
    return WORDS.get(values.attrs.get("units", ""))


def from_store(kind: type, stored: xr.Dataset, *labels: str) -> Declared:
    """Fields of a record in its stored dataset, by their labels, by default all that are there."""
    declared: Declared = {}
    for name, field in fields(kind).items():
        label = label_of(name, field)
        if label and field.stored in stored and label in (labels or (label,)):
            field = field._replace(dims="contact") if field.each else field
            declared[label] = field, stored[field.stored].values
    return declared


def in_mean_forces(declared: Declared, scale: float) -> Declared:
    """Variables with all forces divided by ⟨f_n⟩, which is `scale`."""
    return declared | {
        name: (field._replace(unit=field.unit.replace(FORCE, MEAN)), values / scale)
        for name, (field, values) in declared.items()
        if _is_force(field)
    }


def _is_force(field: Field) -> bool:
    return field.unit.split(";")[0] == FORCE


def _dimensions(field: Field) -> list[str]:
    return [word.removeprefix("packing_") for word in field.dims.split()]


def _attributes(field: Field) -> dict[str, str]:
    units = {"units": field.unit} if field.unit else {}
    return units | ({"long_name": field.long_name} if field.meaning else {})


def _declared(result: Any, ensemble: Ensemble | None) -> Declared:
    """The variables of a result, by their labels; InputError for what is none."""
    if isinstance(result, np.ndarray) and result.ndim == 1:
        return {"value": (Field("contact", "", ""), result)}
    if isinstance(result, np.ndarray) and result.ndim in (2, 3, 4):
        dims = ["chain", "state", "contact", "component"][-result.ndim :]
        return {"states": (quantity("states", " ".join(dims)), result)}
    if isinstance(result, list) and all(isinstance(one, CriticalForce) for one in result):
        return _several(result)
    declared: Declared = {}
    for name, field in fields(type(result)).items():
        label = label_of(name, field)
        value = getattr(result, name, None) if label else None  # no mean without draws
        if value is not None:
            declared[label] = (field, value)
    if not declared:
        raise InputError(
            f"{with_article(type(result).__name__)} cannot be labelled; labels exist for a "
            "Packing, results such as those of intervals and walk, and networks"
        )
    if isinstance(result, Intervals) and isinstance(ensemble, Ensemble):
        declared["cluster"] = (quantity("cluster"), clusters_of(ensemble, result))
    if isinstance(result, Informative):
        declared = {name: _in_force(*one, ensemble) for name, one in declared.items()}
    return declared


def _several(results: list[CriticalForce]) -> Declared:
    """Several critical forces as arrays over their contacts."""
    return {
        field.label: (
            field._replace(dims="contact"),
            np.array([getattr(one, name) for one in results]),
        )
        for name, field in fields(CriticalForce).items()
        if field.each and field.label
    }


def _in_force(field: Field, value: Any, ensemble: Ensemble | None) -> tuple[Field, Any]:
    """A length of intervals in ⟨f_n⟩ as a force."""
    if field.unit != MEAN or not isinstance(ensemble, Ensemble):
        return field, value
    return field._replace(unit=FORCE), value * ensemble.force_scale


def _scalars(result: Any, ensemble: Ensemble | None) -> Declared:
    """The numbers and texts of a record, by their labels."""
    scalars: Declared = {}
    names = getattr(result, "_fields", ())
    declared = fields(type(result)) if names else {}
    for name in names:
        field, value = declared.get(name, Field("", "", "")), getattr(result, name)
        if isinstance(value, (bool, int, float, str)):
            value = int(value) if isinstance(value, bool) else value
            one = (field, value)
            scalars[field.label or name] = (
                _in_force(*one, ensemble) if isinstance(result, Informative) else one
            )
    return scalars


def _check_unit(declared: Declared, ensemble: Any) -> None:
    """InputError for ⟨f_n⟩ as the unit without an ensemble, or without forces."""
    if not isinstance(ensemble, Ensemble):
        raise InputError('unit="mean" needs S as the second argument: (result, S, unit="mean")')
    if not any(_is_force(field) for field, _ in declared.values()):
        raise InputError(
            'unit="mean" changes nothing here, as no variable is known to be a force; leave it '
            "out (a force divided by S.force_scale is in units of ⟨f_n⟩)"
        )


def _numbers(result: Any, ensemble: Ensemble) -> Integers:
    """The numbers of a result's contacts in the packing."""
    if isinstance(result, list):
        return np.array([one.contact for one in result])
    return np.asarray(getattr(result, "contacts", ensemble.index))


def _check_ensemble(ensemble: Any, result: Any) -> None:
    """InputError without an ensemble, or for an array for other than all of its contacts."""
    if not isinstance(ensemble, Ensemble):
        raise InputError(
            "contacts are labelled by the ensemble S of the result: give it too, as in "
            "gf.to_dataframe(result, S) or gf.to_dataset(result, S)"
        )
    if isinstance(result, np.ndarray):
        count = result.shape[0 if result.ndim == 1 else -2]
        if count != len(ensemble.index):
            raise InputError(
                f"an array of {count} contacts has no contact numbers, and S has "
                f"{len(ensemble.index)} contacts: give values for all of them, or the record that "
                "has the numbers, such as gf.limit_load_bounds(S, contacts)"
            )


def _refuse_foreign(result: Any, ensemble: Ensemble) -> None:
    """InputError for a result that cannot be this ensemble's."""
    try:
        ensemble.positions(_numbers(result, ensemble))
        if isinstance(result, (Walk, Pull, UniformSample)):
            ensemble.refuse_foreign(result.states, result.residual, "the result")
        if isinstance(result, Intervals):
            forces = starting_network(ensemble)[ensemble.positions(result.contacts)]
            outside = np.maximum(result.low - forces, forces - result.high)
            if np.nanmax(outside, initial=0.0) > AT_REST * ensemble.force_scale:
                raise InputError("its own forces are outside")
    except InputError as error:
        raise InputError(f"{_FOREIGN}: {str(error).removeprefix(f'{_FOREIGN}: ')}") from None
