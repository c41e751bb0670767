"""Exact answers: intervals, limit loads, stresses, and what one contact takes."""

import argparse
import json
from typing import Any

import numpy as np
import xarray as xr

from granforce.cli.asked import conditions, extension, found, known_forces, numbers, write_csv
from granforce.perturb.critical_force import COUNTS
from granforce.study import kinds
from granforce.study.cells import Kind
from granforce.system.terminal import print_report


def perturb(arguments: argparse.Namespace) -> None:
    """Critical forces and first motions of contacts, computed or found; report them."""
    chosen = numbers("--contacts", arguments.contacts, int)
    _, _, dataset, ends = found(
        *(arguments, kinds.PERTURBATION, arguments.csv),
        contacts=chosen,
        random=None if arguments.all or chosen is not None else arguments.random,
        seed=arguments.draw_seed,
        precision=arguments.precision,
        **conditions(arguments),
    )
    scale = dataset["force_scale"].item()
    load, limit = (dataset[name].values / scale for name in ("critical_low", "limit_load"))
    lines = {
        "contacts": len(load),
        "critical_force": dataset["critical_force"].item(),
        "critical_force_deciles": np.quantile(load, np.linspace(0, 1, 11)).tolist(),
        "limit_load": float(limit.mean()),
        **{name: dataset[name].item() for name in ("decay_exponent", "decay_low", "decay_high")},
        "fit_range": json.loads(dataset.attrs["fit_range"]),
        "decay_exponent_of_other_ranges": dataset["fit_exponent"].values.tolist(),
        **{name: int(dataset[name].sum()) for name in COUNTS},
        **{name: dataset[name].item() for name in ("rattlers", "unloaded_contacts")},
        "largest_residual": float(dataset["load_residual"].max()),
        "largest_breach": float(dataset["motion_breach"].max()),
        **ends,
    }
    print_report(lines, arguments.json)
    if arguments.csv is not None:
        names = ("limit_load", "critical_low", "critical_high", "pair_opening")
        names += ("opened", "slid", "kept", *COUNTS)
        columns = {"contact": dataset["backbone"].values}
        write_csv(arguments.csv, columns | {name: dataset[name].values for name in names})


def _exact(arguments: argparse.Namespace, kind: Kind) -> tuple[xr.Dataset, dict[str, Any]]:
    """The dataset of exact bounds or limit loads, and the last lines of its report."""
    contacts = numbers("--contacts", arguments.contacts, int)
    edges = numbers("--slice", arguments.slice, float)
    asked = {"contacts": contacts, "slice_": edges, **conditions(arguments)}
    return found(arguments, kind, arguments.csv, **asked)[2:]


def intervals(arguments: argparse.Namespace) -> None:
    """Exact intervals, computed or found; report them."""
    dataset, ends = _exact(arguments, kinds.INTERVALS)
    scale = dataset["force_scale"].item()
    extent = (dataset["high"] - dataset["low"]).values[:, 0]
    position = dataset["position"].values
    cluster = dataset["cluster"].values
    histogram = np.histogram(position[np.isfinite(position)], bins=10, range=(0, 1))[0]
    lines = {
        "contacts": len(extent),
        **extension(dataset),
        "coordination": dataset["coordination"].item(),
        "exact_eta3": dataset["eta3"].item(),
        "mean_extent_of_f_n": float(extent.mean() / scale),
        "largest_extent_of_f_n": float(extent.max() / scale),
        "correlation": dataset["correlation"].item(),
        "determined_contacts": int(np.sum(cluster < 0)),
        "undetermined_clusters": int(cluster.max(initial=-1)) + 1,
        "position_of_f_n_in_tenths": histogram.tolist(),
        **json.loads(dataset.attrs["counts"]),
        "largest_duality_gap": dataset["max_gap"].item(),
        **ends,
    }
    print_report(lines, arguments.json)
    if arguments.csv is not None:
        columns = {"contact": dataset["backbone"].values}
        for name, side in (("min", "low"), ("max", "high")):
            columns |= {f"f_n_{name}": dataset[side].values[:, 0]}
            columns |= {f"f_t_{name}": dataset[side].values[:, 1]}
        write_csv(arguments.csv, columns | {"cluster": cluster})


def limit_loads(arguments: argparse.Namespace) -> None:
    """Limit loads, computed or found; report them."""
    dataset, ends = _exact(arguments, kinds.LIMIT_LOADS)
    load = dataset["limit_load"].values / dataset["force_scale"].item()
    lines = {
        "contacts": len(load),
        "mean_limit_load": float(load.mean()),
        "least_limit_load": float(load.min()),
        "largest_limit_load": float(load.max()),
        **json.loads(dataset.attrs["counts"]),
        "largest_duality_gap": dataset["max_gap"].item(),
        **ends,
    }
    print_report(lines, arguments.json)
    if arguments.csv is not None:
        names = {"contact": "backbone", "limit_load": "limit_load"}
        write_csv(arguments.csv, {k: dataset[v].values for k, v in names.items()})


def stress(arguments: argparse.Namespace) -> None:
    """The outline of stresses, computed or found; report it."""
    asked = {"angles": arguments.angles, **known_forces(arguments)}
    _, _, dataset, ends = found(arguments, kinds.STRESS, arguments.csv, **asked)
    own = dataset["stress_own"].values
    lines = {
        **extension(dataset),
        "largest_shear_over_pressure": dataset["friction"].item(),
        "certainly_not_above": dataset["friction_bound"].item(),
        "own_shear_over_pressure": float(np.hypot(*own)),
        "own_normal_difference": float(own[0]),
        "own_shear_stress": float(own[1]),
        **json.loads(dataset.attrs["counts"]),
        "largest_duality_gap": float(dataset["stress_gap"].max()),
        **ends,
    }
    print_report(lines, arguments.json)
    if arguments.csv is not None:
        names = {"angle": "stress_angle", "largest": "stress_support"}
        write_csv(arguments.csv, {k: dataset[v].values for k, v in names.items()})
