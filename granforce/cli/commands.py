"""What each command of the command line does; `cli` parses the words."""

import argparse
import json
import re
import runpy
import socket
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from granforce import measures
from granforce.cli import frames
from granforce.packing import importers, scenes
from granforce.perturb.critical_force import COUNTS
from granforce.records import InputError, Rows, check_memory, whole
from granforce.study import cells as study
from granforce.study import kinds
from granforce.study import scan as scans
from granforce.study.cells import Kind
from granforce.study.keys import Parameters
from granforce.study.store import Store, open_store
from granforce.system.files import check_file, written
from granforce.system.terminal import Bar, Steps, print_list, report, table
from granforce.tolerances import CARRYING


def _radii(text: str, n: int) -> str | list[float]:
    if ":" in text:
        return text
    try:
        radii = [float(line) for line in Path(text).read_text().split()]
    except OSError as error:
        raise InputError(f"radii file {text} cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        raise InputError(f"radii file {text}: {error}") from None
    if len(radii) != n:
        raise InputError(f"radii file {text} holds {len(radii)} radii for {n} disks (-n)")
    return radii


def _numbers(option: str, text: str | None, cast: Callable[[str], Any]) -> list[Any] | None:
    """The numbers of an option, separated by commas; None where it was not given."""
    if text is None:
        return None
    try:
        return [cast(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"{option} {text[:40]!r}: give numbers separated by commas") from None


def _outputs(*paths: str | None) -> None:
    """Files that cannot be written are told before anything is computed."""
    for path in paths:
        if path is not None:
            check_file(path)


def _packing_parameters(arguments: argparse.Namespace, mu: float, seed: int) -> Parameters:
    return kinds.PACKING.parameters(
        arguments.n,
        mu,
        seed,
        radii=_radii(arguments.radii, arguments.n),
        pressure=arguments.pressure,
        dt=arguments.dt,
        box_mass=arguments.box_mass,
        sweeps=arguments.sweeps,
        accuracy=arguments.step_accuracy,
        box=arguments.box,
    )


def _required_mu(arguments: argparse.Namespace) -> float:
    if arguments.mu is None:
        raise InputError("give the friction coefficient: --mu 0.1")
    return arguments.mu


def pack(arguments: argparse.Namespace) -> None:
    """Make or find a packing, or a scene; report it."""
    if arguments.scene is not None:
        return _scene(arguments)
    parameters = _packing_parameters(arguments, _required_mu(arguments), arguments.seed)
    max_steps = whole(arguments.max_steps, "--max-steps", 1)
    _outputs(arguments.out)
    store = open_store(arguments.cache)
    with Steps("compaction", "step") as progress:
        packing, cached = kinds.get_packing(
            store, parameters, max_steps=max_steps, progress=progress
        )
    if arguments.out is not None:
        importers.save_packing(packing, arguments.out)
    told = "steps", "sweeps_done", "unfinished_steps", "largest_contact_gap", "least_other_gap"
    work = {name: packing.info[name] for name in told}
    lines = {**importers.report(packing), **work, "cached": cached}
    report(lines, arguments.json)


def _scene(arguments: argparse.Namespace) -> None:
    _outputs(arguments.out)
    packing = scenes.scene(arguments.scene, arguments.mu)
    if arguments.out is not None:
        importers.save_packing(packing, arguments.out)
    report({"scene": arguments.scene, **importers.report(packing)}, arguments.json)


def _prepared(
    arguments: argparse.Namespace, name: Callable[[Parameters], Parameters], *outputs: str | None
) -> tuple[Store, Parameters]:
    """The store, with the packing in it, and the parameters that name(packing's) gives.

    Everything that can be told from the command line alone is told before a packing is made.
    """
    whole(arguments.workers, "--workers", 1)
    if arguments.packing is None:
        packing = None
        named = _packing_parameters(arguments, _required_mu(arguments), arguments.seed)
    else:
        packing = importers.load_packing(arguments.packing)
        named = kinds.imported_parameters(packing)
    parameters = name(named)
    _outputs(*outputs)
    store = open_store(arguments.cache)
    if packing is None:
        with Steps("compaction", "step") as progress:
            kinds.get_packing(store, named, progress=progress)
    else:
        kinds.keep_packing(store, named, packing)
    return store, parameters


def _get(
    store: Store,
    kind: Kind,
    parameters: Parameters,
    arguments: argparse.Namespace,
    watching: Any = None,
) -> tuple[xr.Dataset, bool]:
    """The dataset of a kind, computed or found, and whether it was found.

    watching(bar): what the kind's compute calls with what it finds, which tells of it on the bar.
    """
    with Bar(kind.title, kind.unit) as progress:
        watch = {} if watching is None else {"watch": watching(progress)}
        told = {"workers": arguments.workers, "progress": progress, **watch}
        return study.get(store, kind, parameters, **told)


def _telling_eta(bar: Any) -> Callable[[Any], None]:
    """watch(Found) of a walk: η1 of all states until now stands beside the bar."""
    growth, lock = measures.Growth(), threading.Lock()

    def watch(found: Any) -> None:
        with lock:
            bar.note(f"η1 = {growth.add(found.forces)[0]:.4f}")

    return watch


def _conditions(arguments: argparse.Namespace) -> dict[str, Any]:
    """What the options say of conditions, as parameters of kinds."""
    asked = {
        "prescribed": arguments.prescribe,
        "stress": _numbers("--stress", arguments.stress, float),
    }
    return asked | _known(arguments)


def _known(arguments: argparse.Namespace) -> dict[str, Any]:
    """The same of known forces."""
    given = getattr(arguments, "known", None)
    return {} if given is None else {"known": importers.read_known(given)}


def _walked(
    arguments: argparse.Namespace, *outputs: str | None
) -> tuple[Store, Parameters, xr.Dataset, bool]:
    asked = _conditions(arguments)

    def name(packing: Parameters) -> Parameters:
        return kinds.WALK.parameters(
            packing,
            arguments.states,
            arguments.walk_seed,
            mu=arguments.ensemble_mu,
            relax=arguments.relax,
            chains=arguments.chains,
            **asked,
        )

    store, parameters = _prepared(arguments, name, *outputs)
    dataset, cached = _get(store, kinds.WALK, parameters, arguments, _telling_eta)
    return store, parameters, dataset, cached


def walk(arguments: argparse.Namespace) -> None:
    """Random walk, made or found; report how it went."""
    store, parameters, dataset, cached = _walked(arguments)
    lines = {
        "entry": study.entry_name(store, kinds.WALK, parameters),
        **{name: dataset[name].item() for name in (*study.ROW, *study.ROW_COUNTS)},
        "mean_iterations": float(dataset["sweeps"].mean()),
        "largest_residual": float(dataset["residual"].max()),
        "largest_violation": float(dataset["violation"].max()),
        "seconds": dataset["seconds"].item(),
        "cached": cached,
    }
    report(lines, arguments.json)


UNIFORM_LINES = (
    *("packing_fraction", "coordination", "dimension", "eta1", "eta2", "eta3", "worst_r_hat"),
    *("least_bulk_size", "least_tail_size", "turns", "refused", "dropped", "held", "skipped"),
    *("rattlers", "unloaded_contacts"),
)


def uniform(arguments: argparse.Namespace) -> int:
    """Uniform sample, drawn or found; report it. Returns 1 if it is not worth what was wanted."""
    asked = _conditions(arguments)

    def name(packing: Parameters) -> Parameters:
        return kinds.UNIFORM.parameters(
            packing,
            arguments.states,
            arguments.sample_seed,
            mu=arguments.ensemble_mu,
            chains=arguments.chains,
            effective=arguments.effective,
            **asked,
        )

    store, parameters = _prepared(arguments, name)
    dataset, cached = _get(store, kinds.UNIFORM, parameters, arguments)
    reached = bool(dataset["reached"].item())
    lines = {
        "entry": study.entry_name(store, kinds.UNIFORM, parameters),
        "states": dataset.sizes["state"],
        **{name: dataset[name].item() for name in UNIFORM_LINES},
        "reached": reached,
        "mean_distance_to_centre": float(dataset["distance_to_centre"].mean()),
        "original_distance": dataset["original_distance"].item(),
        "largest_residual": float(dataset["residual"].max()),
        "largest_violation": float(dataset["violation"].max()),
        "setup_seconds": dataset["setup_seconds"].item(),
        "sampling_seconds": dataset["sampling_seconds"].item(),
        "seconds": dataset["seconds"].item(),
        "cached": cached,
    }
    report(lines, arguments.json)
    return 1 if arguments.effective is not None and not reached else 0


def volume(arguments: argparse.Namespace) -> int:
    """The volume of S, measured or found; report it. Returns 1 if it is not as sure as wanted."""
    asked = _conditions(arguments)

    def name(packing: Parameters) -> Parameters:
        accuracy, seed = arguments.accuracy, arguments.volume_seed
        return kinds.VOLUME.parameters(packing, accuracy, seed, mu=arguments.ensemble_mu, **asked)

    store, parameters = _prepared(arguments, name)
    dataset, cached = _get(store, kinds.VOLUME, parameters, arguments)
    down, up = dataset["log_volume_ladders"].values
    reached = bool(dataset["reached"].item())
    lines = {
        "entry": study.entry_name(store, kinds.VOLUME, parameters),
        "dimension": dataset["dimension"].item(),
        "ln_volume": dataset["log_volume"].item(),
        "standard_error": dataset["log_volume_error"].item(),
        "ln_volume_on_the_way_down": float(down),
        "ln_volume_on_the_way_up": float(up),
        "ln_volume_per_grain": dataset["log_volume_per_grain"].item(),
        "extent_over_mean_normal_force": dataset["extent"].item(),
        "reached": reached,
        **json.loads(dataset.attrs["counts"]),
        "seconds": dataset["seconds"].item(),
        "cached": cached,
    }
    report(lines, arguments.json)
    return 0 if reached else 1


INFERENCE_LINES = (
    *("worst_r_hat", "least_bulk_size", "least_tail_size", "turns", "refused", "dropped", "held"),
    *("setup_seconds", "sampling_seconds"),
)


def infer(arguments: argparse.Namespace) -> int | None:
    """The likeliest network of measured forces, with error bars if wanted; report it."""
    if arguments.frames is not None:
        return frames.infer_frames(arguments, _flaws_and_walls(arguments))
    if arguments.files or arguments.measured is None:
        raise InputError(
            "give --measured FILE.csv and a packing, or files of frames with --frames all"
        )
    asked, states = _conditions(arguments), 1000 if arguments.states is None else arguments.states
    measured = importers.read_measurement(arguments.measured)

    def name(packing: Parameters) -> Parameters:
        return kinds.INFERENCE.parameters(
            packing,
            measured,
            states,
            arguments.sample_seed,
            mu=arguments.ensemble_mu,
            chains=arguments.chains,
            unmeasured=arguments.unmeasured,
            again=arguments.again,
            certain=arguments.certain,
            **asked,
        )

    store, parameters = _prepared(arguments, name, arguments.csv)
    with Bar(kinds.INFERENCE.title, kinds.INFERENCE.unit) as progress:
        dataset, cached = study.get(
            *(store, kinds.INFERENCE, parameters),
            workers=arguments.workers,
            progress=progress,
            measured=measured,
        )
    scale, given = dataset["force_scale"].item(), measured.forces + measured.sigma
    change = np.abs(dataset["inferred"].values - dataset["measured"].values)
    lines = {
        "entry": study.entry_name(store, kinds.INFERENCE, parameters),
        "contacts": len(change),
        "measured_components": int(np.isfinite(change).sum()),
        "measured_where_nothing_can_carry": int(
            np.isfinite(given).sum() - np.isfinite(change).sum()
        ),
        "chi_square": dataset["chi_square"].item(),
        "freedom": dataset["freedom"].item(),
        "mean_change_of_f_n": float(np.nanmean(change[:, 0]) / scale),
        "suspects": dataset["suspect"].values.tolist(),
    }
    columns = {"contact": dataset["backbone"].values}
    for k, part in enumerate(("f_n", "f_t")):
        columns |= {part: dataset["inferred"].values[:, k]}
        columns |= {f"deviation_{part}": dataset["deviation"].values[:, k]}
    if arguments.certain:
        least = dataset["least_normal"].values / scale
        sure = np.flatnonzero(least > CARRYING)
        order = sure[np.argsort(-least[sure], kind="stable")]
        lines |= {"unmeasured_contacts": int(np.isfinite(least).sum())}
        lines |= {"carry_for_certain": columns["contact"][order].tolist()}
        columns |= {"least_f_n": dataset["least_normal"].values}
    if states:
        error = dataset["standard_error"].values
        lines |= {"states": dataset.sizes["state"], "mean_standard_error": error.mean() / scale}
        lines |= {name: dataset[name].item() for name in INFERENCE_LINES}
        lines |= {"reached": bool(dataset["reached"].item())}
        for k, part in enumerate(("f_n", "f_t")):
            columns |= {f"mean_{part}": dataset["expected"].values[:, k]}
            columns |= {f"error_{part}": error[:, k]}
    if arguments.csv is not None:
        _write_csv(arguments.csv, columns)
    report(lines | {"seconds": dataset["seconds"].item(), "cached": cached}, arguments.json)
    return None


def measure(arguments: argparse.Namespace) -> None:
    """Measures of a walk, made or found."""
    _, parameters, dataset, _ = _walked(arguments, arguments.contacts)
    scale = dataset["force_scale"].item()
    extent = (dataset["high"] - dataset["low"]).values[:, 0]
    names = ("coordination", "packing_fraction", "dimension", "eta1", "eta2", "eta3")
    lines = {
        "mu": parameters["mu"],
        "states": parameters["states"],
        **{name: dataset[name].item() for name in names},
        "mean_normal_force": scale,
        "mean_extent_of_f_n": float(extent.mean() / scale),
        "largest_extent_of_f_n": float(extent.max() / scale),
        "correlation": dataset["correlation"].item(),
        "correlation_low": dataset["correlation_low"].item(),
        "correlation_high": dataset["correlation_high"].item(),
        "mean_distance_to_centre": float(dataset["distance_to_centre"].mean()),
        "original_distance": dataset["original_distance"].item(),
    }
    if arguments.contacts is not None:
        columns = {"contact": dataset["backbone"].values}
        for name, source in (("f_n", "original"), ("f_n_min", "low"), ("f_n_max", "high")):
            columns[name] = dataset[source].values[:, 0]
        _write_csv(arguments.contacts, columns)
    report(lines, arguments.json)


def _write_csv(path: str | Path, columns: Mapping[str, Any]) -> None:
    """Columns {name: array} as a table; whole numbers stay whole."""
    with written(path) as file:
        np.savetxt(
            file,
            np.column_stack(list(columns.values())),
            fmt=["%d" if v.dtype.kind == "i" else "%.17g" for v in columns.values()],
            delimiter=",",
            header=",".join(columns),
            comments="",
        )


def perturb(arguments: argparse.Namespace) -> None:
    """Critical forces and first motions of contacts, computed or found; report them."""
    chosen = _numbers("--contacts", arguments.contacts, int)
    asked = _conditions(arguments)

    def name(packing: Parameters) -> Parameters:
        return kinds.PERTURBATION.parameters(
            packing,
            mu=arguments.ensemble_mu,
            contacts=chosen,
            random=None if arguments.all or chosen is not None else arguments.random,
            seed=arguments.draw_seed,
            precision=arguments.precision,
            **asked,
        )

    store, parameters = _prepared(arguments, name, arguments.csv)
    dataset, cached = _get(store, kinds.PERTURBATION, parameters, arguments)
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
        "seconds": dataset["seconds"].item(),
        "cached": cached,
    }
    if arguments.csv is not None:
        names = ("limit_load", "critical_low", "critical_high", "pair_opening")
        names += ("opened", "slid", "kept", *COUNTS)
        columns = {"contact": dataset["backbone"].values}
        _write_csv(arguments.csv, columns | {name: dataset[name].values for name in names})
    report(lines, arguments.json)


def _exact(arguments: argparse.Namespace) -> tuple[Store, Parameters]:
    contacts = _numbers("--contacts", arguments.contacts, int)
    edges = _numbers("--slice", arguments.slice, float)
    asked = _conditions(arguments)

    def name(packing: Parameters) -> Parameters:
        return kinds.INTERVALS.parameters(
            packing, mu=arguments.ensemble_mu, contacts=contacts, slice_=edges, **asked
        )

    return _prepared(arguments, name, arguments.csv)


def intervals(arguments: argparse.Namespace) -> None:
    """Exact intervals, computed or found; report them."""
    store, parameters = _exact(arguments)
    dataset, cached = _get(store, kinds.INTERVALS, parameters, arguments)
    scale = dataset["force_scale"].item()
    extent = (dataset["high"] - dataset["low"]).values[:, 0]
    position = dataset["position"].values
    cluster = dataset["cluster"].values
    histogram = np.histogram(position[np.isfinite(position)], bins=10, range=(0, 1))[0]
    lines = {
        "contacts": len(extent),
        "dimension": dataset["dimension"].item(),
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
        "seconds": dataset["seconds"].item(),
        "cached": cached,
    }
    if arguments.csv is not None:
        columns = {"contact": dataset["backbone"].values}
        for name, side in (("min", "low"), ("max", "high")):
            columns |= {f"f_n_{name}": dataset[side].values[:, 0]}
            columns |= {f"f_t_{name}": dataset[side].values[:, 1]}
        _write_csv(arguments.csv, columns | {"cluster": cluster})
    report(lines, arguments.json)


def limit_loads(arguments: argparse.Namespace) -> None:
    """Limit loads, computed or found; report them."""
    store, parameters = _exact(arguments)
    dataset, cached = _get(store, kinds.LIMIT_LOADS, parameters, arguments)
    load = dataset["limit_load"].values / dataset["force_scale"].item()
    lines = {
        "contacts": len(load),
        "mean_limit_load": float(load.mean()),
        "least_limit_load": float(load.min()),
        "largest_limit_load": float(load.max()),
        **json.loads(dataset.attrs["counts"]),
        "largest_duality_gap": dataset["max_gap"].item(),
        "seconds": dataset["seconds"].item(),
        "cached": cached,
    }
    if arguments.csv is not None:
        names = {"contact": "backbone", "limit_load": "limit_load"}
        _write_csv(arguments.csv, {k: dataset[v].values for k, v in names.items()})
    report(lines, arguments.json)


def stress(arguments: argparse.Namespace) -> None:
    """The outline of stresses, computed or found; report it."""
    known = _known(arguments)

    def name(packing: Parameters) -> Parameters:
        return kinds.STRESS.parameters(
            packing, mu=arguments.ensemble_mu, angles=arguments.angles, **known
        )

    store, parameters = _prepared(arguments, name, arguments.csv)
    dataset, cached = _get(store, kinds.STRESS, parameters, arguments)
    own = dataset["stress_own"].values
    lines = {
        "dimension": dataset["dimension"].item(),
        "largest_shear_over_pressure": dataset["friction"].item(),
        "certainly_not_above": dataset["friction_bound"].item(),
        "own_shear_over_pressure": float(np.hypot(*own)),
        "own_normal_difference": float(own[0]),
        "own_shear_stress": float(own[1]),
        **json.loads(dataset.attrs["counts"]),
        "largest_duality_gap": float(dataset["stress_gap"].max()),
        "seconds": dataset["seconds"].item(),
        "cached": cached,
    }
    if arguments.csv is not None:
        names = {"angle": "stress_angle", "largest": "stress_support"}
        _write_csv(arguments.csv, {k: dataset[v].values for k, v in names.items()})
    report(lines, arguments.json)


def import_(arguments: argparse.Namespace) -> None:
    """Read a packing from elsewhere; report and save it."""
    _outputs(arguments.out)
    if arguments.format == "pegs":
        _import_pegs(arguments)
        return
    if arguments.format == "lammps":
        if arguments.contacts is None:
            raise InputError("import lammps needs two dumps: particles and contacts")
        packing = importers.read_lammps(arguments.grains, arguments.contacts, arguments.mu)
    elif arguments.format in ("yade", "mercury"):
        if arguments.contacts is None:
            raise InputError(f"import {arguments.format} needs two files: grains and contacts")
        read = importers.read_yade if arguments.format == "yade" else importers.read_mercury
        packing = read(arguments.grains, arguments.contacts, arguments.mu, box=arguments.box)
    else:
        columns = None if arguments.columns is None else importers.read_columns(arguments.columns)
        packing = importers.read_table(
            arguments.grains,
            arguments.contacts,
            mu=arguments.mu,
            box=arguments.box,
            tilt=arguments.tilt,
            columns=columns,
            forces=True if arguments.forces else None,
            pressure=arguments.pressure,
        )
    lines = importers.report(packing) | {
        k: v for k, v in packing.info.items() if k == "contacts_skipped"
    }
    if arguments.out is not None:
        importers.save_packing(packing, arguments.out)
    report(lines, arguments.json)


def _import_pegs(arguments: argparse.Namespace) -> None:
    """Read a photoelastic frame; report and save it, and what was measured."""
    _outputs(arguments.measured)
    found = importers.read_pegs(
        *(arguments.grains, arguments.contacts),
        mu=arguments.mu,
        frame=arguments.frame,
        **_flaws_and_walls(arguments),
    )
    if arguments.out is not None:
        importers.save_packing(found.packing, arguments.out)
    if arguments.measured is not None:
        values = np.concatenate([found.measured, found.sigma], axis=1).T
        columns = {"contact": np.arange(len(found.measured))}
        columns |= dict(zip(importers.measurements.COLUMNS, values, strict=True))
        _write_csv(arguments.measured, columns)
    report(found.report, arguments.json)


def _flaws_and_walls(arguments: argparse.Namespace) -> dict[str, Any]:
    """What the options say of flaws and walls, as `importers.read_pegs` takes it."""
    if arguments.strict and arguments.repair is not None:
        raise InputError("--strict mends nothing: leave out --repair")
    repair = True if arguments.repair is None else arguments.repair
    forces = dict(importers.read_wall_force(text) for text in arguments.wall_force)
    return {
        **{name: getattr(arguments, name) for name in ("reach", "scale", "error", "reverse")},
        "repair": False if arguments.strict else repair,
        "walls": arguments.walls,
        "wall_forces": forces,
    }


def scan(arguments: argparse.Namespace) -> int:
    """Cells over processes into a store; print their table. Returns 1 if a cell failed."""
    mus = _numbers("--mu", arguments.mu, float) or []
    seeds = whole(arguments.seeds, "--seeds", 1)
    whole(arguments.workers, "--workers", 1)
    check_memory(scans.CELL_BYTES * len(mus) * seeds, f"{len(mus) * seeds} cells")
    cells = [
        kinds.WALK.parameters(
            _packing_parameters(arguments, mu, seed),
            arguments.states,
            arguments.walk_seed,
            mu=arguments.ensemble_mu,
            relax=arguments.relax,
            chains=arguments.chains,
            keep=arguments.keep,
        )
        for mu in mus
        for seed in range(1, seeds + 1)
    ]
    store = open_store(arguments.out or arguments.cache)
    with Bar("scan", "cell") as progress:
        rows, failed = scans.scan(
            store.path,
            cells,
            workers=arguments.workers,
            scheduler=arguments.scheduler,
            dtypes={"states": "float32"} if arguments.float32 else None,
            progress=progress,
        )
    _report_scan(rows, failed, arguments.json)
    return 1 if failed else 0


def _report_scan(rows: Rows, failed: Sequence[tuple[Parameters, str]], as_json: bool) -> None:
    found = sum(line["cached"] for line in rows)
    summary = {"cells": len(rows) + len(failed), "found": found, "failed": len(failed)}
    if as_json:
        errors = [{"cell": cell, "error": message} for cell, message in failed]
        report({"rows": rows, "errors": errors, **summary}, as_json)
        return
    heads = {"packing_fraction": "φ", "coordination": "z", "dimension": "h", "mu": "μ"}
    heads |= {"eta1": "η1", "eta2": "η2", "eta3": "η3"}
    names = ("mu", "seed", *("packing_fraction", "coordination", "dimension"))
    names += ("eta1", "eta2", "eta3", "acceptance", "rejected", "unconverged", "skipped", "cached")
    table(rows, names, heads)
    for cell, message in failed:
        where = f"μ = {cell['packing']['mu']}, seed {cell['packing']['seed']}"
        print(f"granforce: cell {where}: {message}", file=sys.stderr)
    print(
        f"{summary['cells']} cells: {found} found in the store, "
        f"{len(rows) - found} computed, {len(failed)} failed",
        file=sys.stderr,
    )


def study_(arguments: argparse.Namespace) -> int:
    """The study of the paper. Returns 1 if a cell failed."""
    from granforce.paper.main import main

    return main(arguments)


def app(arguments: argparse.Namespace) -> None:
    """The page, served by `panel serve` in this process until it is interrupted."""
    port = whole(arguments.port, "--port", 0, 65_535)
    for origin in arguments.allow_websocket_origin:
        if not re.fullmatch(r"[^\s:/,]+(:\d{1,5})?", origin):
            raise InputError(
                f"--allow-websocket-origin {origin[:40]!r}: give a name and a port, such as "
                "lab.example.org:5006"
            )
    _check_address(arguments.address, port)
    words = ["panel", "serve", str(_page()), "--port", str(port), "--address", arguments.address]
    for origin in arguments.allow_websocket_origin:
        words += ["--allow-websocket-origin", origin]
    words += [] if arguments.no_show else ["--show"]
    words += ["--warm"] if arguments.warm else []
    sys.argv = words
    runpy.run_module("panel", run_name="__main__", alter_sys=True)


def _page() -> Path:
    """The page's folder: inside the installed package, beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "app", package.parent / "app"):
        if (folder / "main.py").is_file():
            return folder
    raise InputError(f"the page is not installed: {package} has no folder app; install the wheel")


def _check_address(address: str, port: int) -> None:
    """InputError where nothing can listen there, or something listens already."""
    if not address.strip():
        raise InputError("--address is empty; give a name or a number, such as localhost")
    try:
        family, kind, _, _, place = socket.getaddrinfo(address, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(place)
    except (OSError, ValueError) as error:  # ValueError: what cannot be a name at all
        reason = getattr(error, "strerror", None) or "no such name"
        raise InputError(
            f"cannot listen at {address[:40]!r}, port {port}: {reason}; choose another with "
            "--address and --port"
        ) from None


def bench(arguments: argparse.Namespace) -> None:
    """The benchmark's report."""
    from granforce.bench import main

    main(arguments.out, arguments.quick, arguments.json)


def cache(arguments: argparse.Namespace) -> int:
    """List, measure, clear or verify a store. Returns 1 if an entry is damaged."""
    store = open_store(arguments.cache)
    if arguments.action == "clear":
        lines = {"removed": store.clear(arguments.kind), "temporaries": store.clean()}
        report(lines, arguments.json)
    elif arguments.action == "size":
        entries = store.find(arguments.kind)
        size = sum(entry.bytes for entry in entries)
        report({"path": str(store.path), "entries": len(entries), "bytes": size}, arguments.json)
    elif arguments.action == "verify":
        verdicts = [
            v._asdict()
            for v in store.verify()
            if not arguments.kind or v.name.startswith(f"{arguments.kind}-")
        ]
        print_list(verdicts, ("name", "ok", "reason"), arguments.json)
        return 0 if all(verdict["ok"] for verdict in verdicts) else 1
    else:
        entries = [
            {**entry._asdict(), "params": json.dumps(entry.params)}
            for entry in store.find(arguments.kind)
        ]
        print_list(entries, ("name", "bytes", "created", "params"), arguments.json)
    return 0
