"""Exact results: intervals, limit loads, stresses, and critical forces of contacts."""

import argparse
import json
from typing import Any

import numpy as np
import xarray as xr

from granforce import measures
from granforce.cli import report_lines
from granforce.cli.results import (
    StoredResult,
    conditions,
    distinct,
    get_packing,
    interval_lengths,
    known_forces,
    numbers,
    stored_result,
)
from granforce.cli.tables import columns, of_contacts, write_table
from granforce.explore.intervals import Intervals, LimitLoads, uncertified
from granforce.explore.stress_outline import StressOutline, stress_inside
from granforce.forces.balance import left_open_in
from granforce.forces.build import ensemble
from granforce.forces.contact_problem import prestress
from granforce.labelled import from_store, labelled_dataset
from granforce.motion import rest as motion
from granforce.packing import importers
from granforce.perturb import grain_loads
from granforce.perturb.critical_force import COUNTS, CriticalForce
from granforce.quantities import quantity
from granforce.study import kinds
from granforce.study.cells import Kind
from granforce.study.responses import unsteady
from granforce.system.terminal import print_notes, print_report, report_after
from granforce.system.wording import integer, number


def listed(dataset: xr.Dataset) -> dict[str, list[Any]]:
    """Columns of a result per contact for the report, which lists at most FEW contacts."""
    few = dataset.sizes["contact"] <= report_lines.FEW
    return {name: values.tolist() for name, values in columns(dataset).items()} if few else {}


def perturb(arguments: argparse.Namespace) -> None:
    """Compute or load critical forces and first motions of contacts, and report them."""
    chosen = distinct("--contacts", arguments.contacts, integer)
    result = stored_result(
        *(arguments, kinds.PERTURBATION, arguments.out),
        contacts=chosen,
        random=None if arguments.all or chosen is not None else arguments.random,
        seed=arguments.draw_seed,
        precision=arguments.precision,
        **conditions(arguments),
    )
    dataset = result.dataset
    declared = from_store(CriticalForce, dataset, *report_lines.CRITICAL)
    few = listed(of_contacts(arguments, result, declared))
    load = dataset["critical_low"].values
    inner, outer = json.loads(dataset.attrs["fit_range"])
    deciles = {} if few else {"critical_force_deciles": np.quantile(load, np.linspace(0, 1, 11))}
    lines = result.report(
        report_lines.PERTURB,
        arguments,
        contacts=len(load),
        mean_critical_force=dataset["critical_force"].item() * dataset["force_scale"].item(),
        fit_range=[inner, outer] if inner < outer else None,
        largest_residual=float(dataset["load_residual"].max()),
        **deciles,
    )
    with report_after(lines, arguments.json, few):
        if arguments.out is not None:
            names = ("pair_opening", "opened", "slid", "kept", *COUNTS)
            declared |= {name: (quantity(name), dataset[name].values) for name in names}
            write_table(arguments.out, of_contacts(arguments, result, declared))
    if note := unsteady(dataset):
        print_notes([note])


def _exact(arguments: argparse.Namespace, kind: Kind) -> StoredResult:
    """Exact bounds or limit loads."""
    contacts = distinct("--contacts", arguments.contacts, integer)
    edges = numbers("--slice", arguments.slice, number)
    chosen = {"contacts": contacts, "slice_": edges, **conditions(arguments)}
    return stored_result(arguments, kind, arguments.out, **chosen)


def intervals(arguments: argparse.Namespace) -> None:
    """Compute or load exact intervals, and report them."""
    result = _exact(arguments, kinds.INTERVALS)
    dataset = result.dataset
    low, high = (dataset[side].values for side in ("low", "high"))
    bounded, certified = np.isfinite(high - low), ~(np.isnan(low) | np.isnan(high))
    left = dataset["backbone"].values[~certified.all(axis=1)]
    # Entries of earlier versions also have positions of determined forces.
    position = np.full(len(low), np.nan)
    if (whole := bounded.all(axis=1)).any():
        normal = dataset["original"].values[whole, 0]
        position[whole] = measures.position_in_interval(normal, low[whole], high[whole])
    cluster = dataset["cluster"].values
    undetermined = np.isfinite(position)
    histogram = np.histogram(np.clip(position[undetermined], 0, 1), bins=10, range=(0, 1))[0]
    given = {
        "contacts": dataset.sizes["contact"],
        **interval_lengths(dataset),
        **_without_limit(bounded | ~certified),
        **({"contacts_not_certified": len(left)} if len(left) else {}),
        "determined_contacts": int(np.sum(cluster < 0)),
        "undetermined_clusters": int(cluster.max(initial=-1)) + 1,
        **({"position_of_f_n_in_tenths": histogram.tolist()} if undetermined.any() else {}),
    }
    lines = result.report(report_lines.INTERVALS, arguments, **given)
    declared = from_store(Intervals, dataset) | {"cluster": (quantity("cluster"), cluster)}
    bounds = of_contacts(arguments, result, declared).assign_attrs(
        max_gap=dataset["max_gap"].item(), converged=int(certified.all())
    )
    with report_after(lines, arguments.json, listed(bounds)):
        if arguments.out is not None:
            write_table(arguments.out, bounds)
    if len(growing := dataset["backbone"].values[np.isinf(high[:, 0])]):
        packing, _ = get_packing(arguments.store, result.parameters["packing"])
        ends = np.append(packing.contacts.i[growing], packing.contacts.j[growing])
        print_notes([prestress(np.setdiff1d(ends, np.flatnonzero(left_open_in(packing))))])
    if len(left):
        print_notes([uncertified(left)])


def _without_limit(bounded: Any) -> dict[str, int]:
    """Numbers of contacts with an infinite interval, of bounded (N_c, 2) f_n and f_t; if any."""
    if bounded.all():
        return {}
    return {
        "contacts_with_unbounded_f_n": int(np.sum(~bounded[:, 0])),
        "contacts_with_unbounded_f_t": int(np.sum(~bounded[:, 1])),
    }


def limit_loads(arguments: argparse.Namespace) -> None:
    """Compute or load limit loads, and report them."""
    result = _exact(arguments, kinds.LIMIT_LOADS)
    dataset, load = result.dataset, result.dataset["limit_load"].values
    finite, without = load[np.isfinite(load)], int(np.isinf(load).sum())
    left = dataset["backbone"].values[np.isnan(load)]
    reported = {"mean": finite.mean, "least": finite.min, "largest": finite.max}
    given = {
        "contacts": len(load),
        **{f"{name}_limit_load": float(of()) for name, of in reported.items() if len(finite)},
        **({"contacts_without_a_limit": without} if without else {}),
        **({"contacts_not_certified": len(left)} if len(left) else {}),
    }
    lines = result.report(report_lines.LIMIT_LOADS, arguments, **given)
    declared = from_store(LimitLoads, dataset, "limit_load")
    loads = of_contacts(arguments, result, declared)
    with report_after(lines, arguments.json, listed(loads)):
        if arguments.out is not None:
            write_table(arguments.out, loads)
    if len(left):
        print_notes([uncertified(left)])


def load_factor(arguments: argparse.Namespace) -> None:
    """Compute the load factor of a load on all bodies, and its critical one on request."""
    S = ensemble(importers.load_packing(arguments.packing))
    limit = grain_loads.load_factor(S, arguments.load)
    bodies = int((~left_open_in(S.packing)).sum())
    lines: dict[str, Any] = {"bodies": bodies, "contacts": len(S.packing.contacts.i)}
    lines |= {"load_factor": limit.factor, "certified_error": limit.gap}
    bounded = np.isfinite(limit.factor)
    if arguments.critical and bounded:
        critical = grain_loads.critical_load(S, arguments.load, precision=arguments.precision)
        lines |= {
            "critical_factor_low": critical.low,
            "critical_factor_high": critical.high,
            "precision": critical.precision,
            "residual": critical.residual,
            "breach": critical.breach,
            "converged": critical.converged,
        }
    print_report(lines, arguments.json)
    if arguments.critical and not bounded:
        print_notes([grain_loads.NO_LIMIT])


def rest(arguments: argparse.Namespace) -> None:
    """Test whether contact dynamics leaves a packing at rest."""
    S = ensemble(importers.load_packing(arguments.packing), mu=arguments.ensemble_mu)
    result = motion.rest(S)
    lines: dict[str, Any] = {"at_rest": result.at_rest}
    lines |= {} if result.at_rest else {"reason": result.reason}
    checked = {"residual": S.residual, "violation": S.violation}
    lines |= {name: float(check(S.original)) for name, check in checked.items()}
    lines |= {"distance_to_rest": result.distance, "noise": list(result.noise)}
    lines |= {"draws_at_rest": result.stayed.sum(axis=1).tolist(), "draws": result.stayed.shape[1]}
    lines |= {"wedged_grains": result.wedged.tolist()} if len(result.wedged) else {}
    print_report(lines, arguments.json)
    if len(result.wedged):
        print_notes([prestress(result.wedged)])


def stress(arguments: argparse.Namespace) -> None:
    """Compute or load the outline of stresses, and report it."""
    chosen = {"angles": arguments.angles, **known_forces(arguments)}
    result = stored_result(arguments, kinds.STRESS, arguments.out, **chosen)
    dataset = result.dataset
    original, carried = dataset["stress_own"].values, dataset["stress_inner"].values
    packing, _ = get_packing(arguments.store, result.parameters["packing"])
    middle = stress_inside(carried, packing.pressure)
    lines = result.report(
        report_lines.STRESS,
        arguments,
        own_shear_over_pressure=float(np.hypot(*original)),
        own_normal_difference=float(original[0]),
        own_shear_stress=float(original[1]),
        normal_difference_from_to=np.quantile(carried[:, 0], [0, 1]).tolist(),
        shear_stress_from_to=np.quantile(carried[:, 1], [0, 1]).tolist(),
        admissible_stress=",".join(f"{value:.8g}" for value in middle),
        largest_duality_gap=float(dataset["stress_gap"].max()),
    )
    with report_after(lines, arguments.json):
        if arguments.out is not None:
            write_table(arguments.out, labelled_dataset(from_store(StressOutline, dataset)))
