"""What each command of the command line does; `cli` parses the words."""

import json
import sys
from pathlib import Path

import numpy as np

from granforce import importers, study
from granforce import sweep as sweeps
from granforce.perturb import COUNTS
from granforce.records import InputError
from granforce.store import open_store
from granforce.terminal import Bar, Steps, print_list, report, table


def _radii(text, n):
    if ":" in text:
        return text
    try:
        radii = [float(line) for line in Path(text).read_text().split()]
    except (OSError, ValueError) as error:
        raise InputError(f"radii file {text}: {error}") from None
    if len(radii) != n:
        raise InputError(f"radii file {text} holds {len(radii)} radii for {n} disks (-n)")
    return radii


def _packing_parameters(arguments, mu, seed):
    return study.packing_parameters(
        arguments.n,
        mu,
        seed,
        radii=_radii(arguments.radii, arguments.n),
        pressure=arguments.pressure,
        dt=arguments.dt,
        box_mass=arguments.box_mass,
        sweeps=arguments.sweeps,
    )


def _required_mu(arguments):
    if arguments.mu is None:
        raise InputError("give the friction coefficient: --mu 0.1")
    return arguments.mu


def pack(arguments):
    """Make or find a packing; report it."""
    parameters = _packing_parameters(arguments, _required_mu(arguments), arguments.seed)
    with Steps("compaction", "step") as progress:
        store = open_store(arguments.cache)
        packing, cached = study.get_packing(
            store, parameters, max_steps=arguments.max_steps, progress=progress
        )
    if arguments.out:
        importers.save_packing(packing, arguments.out)
    work = {k: packing.info[k] for k in ("steps", "sweeps_done", "list_rebuilds")}
    lines = {**importers.report(packing), **work, "cached": cached}
    report(lines, arguments.json)


def _named_packing(arguments, store):
    """The packing's parameters: one from a file is kept in the store, another made if need be."""

    if arguments.packing:
        packing = importers.load_packing(arguments.packing)
        named = study.imported_parameters(packing)
        study.keep_packing(store, named, packing)
        return named
    named = _packing_parameters(arguments, _required_mu(arguments), arguments.seed)
    with Steps("compaction", "step") as progress:
        study.get_packing(store, named, progress=progress)
    return named


def _walked(arguments):
    size = arguments.states, arguments.walk_seed
    options = {"relax": arguments.relax, "chains": arguments.chains}
    # Bad sizes are told before a packing is made.
    study.walk_parameters({"mu": 0.0}, *size, mu=arguments.ensemble_mu, **options)
    store = open_store(arguments.cache)
    named = _named_packing(arguments, store)
    parameters = study.walk_parameters(named, *size, mu=arguments.ensemble_mu, **options)
    with Bar("random walk", "state") as progress:
        dataset, cached = study.get_walk(
            store, parameters, workers=arguments.workers, progress=progress
        )
    return store, parameters, dataset, cached


def walk(arguments):
    """Random walk, made or found; report how it went."""
    store, parameters, dataset, cached = _walked(arguments)
    lines = {
        "entry": store.name("walk", parameters, version=study.WALK_VERSION),
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


def uniform(arguments):
    """Uniform sample, drawn or found; report it. Returns 1 if it is not worth what was wanted."""
    size = arguments.states, arguments.sample_seed
    options = {"chains": arguments.chains, "effective": arguments.effective}
    options["mu"] = arguments.ensemble_mu
    # Bad sizes are told before a packing is made.
    study.uniform_parameters({"mu": 0.0}, *size, **options)
    if arguments.workers < 1:
        raise InputError("--workers must be at least 1")
    store = open_store(arguments.cache)
    parameters = study.uniform_parameters(_named_packing(arguments, store), *size, **options)
    with Bar("uniform sample", "state") as progress:
        dataset, cached = study.get_uniform(
            store, parameters, workers=arguments.workers, progress=progress
        )
    reached = bool(dataset["reached"].item())
    lines = {
        "entry": store.name("uniform", parameters, version=study.UNIFORM_VERSION),
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
    return 1 if arguments.effective and not reached else 0


def measure(arguments):
    """Measures of a walk, made or found."""
    _, parameters, dataset, _ = _walked(arguments)
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
    if arguments.contacts:
        columns = {"contact": dataset["backbone"].values}
        for name, source in (("f_n", "original"), ("f_n_min", "low"), ("f_n_max", "high")):
            columns[name] = dataset[source].values[:, 0]
        _write_csv(arguments.contacts, columns)
    report(lines, arguments.json)


def _write_csv(path, columns):
    """Columns {name: array} as a table; whole numbers stay whole."""
    try:
        np.savetxt(
            path,
            np.column_stack(list(columns.values())),
            fmt=["%d" if v.dtype.kind == "i" else "%.17g" for v in columns.values()],
            delimiter=",",
            header=",".join(columns),
            comments="",
        )
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}") from None


def perturb(arguments):
    """Critical forces and first motions of contacts, computed or found; report them."""
    try:
        chosen = arguments.contacts and [int(text) for text in arguments.contacts.split(",")]
    except ValueError:
        raise InputError("--contacts takes numbers separated by commas") from None
    if arguments.workers < 1:
        raise InputError("--workers must be at least 1")
    options = {
        "mu": arguments.ensemble_mu,
        "contacts": chosen,
        "random": None if arguments.all or chosen else arguments.random,
        "seed": arguments.draw_seed,
        "precision": arguments.precision,
    }
    # Bad options are told before a packing is made.
    study.perturbation_parameters({"mu": 0.0}, **options)
    store = open_store(arguments.cache)
    parameters = study.perturbation_parameters(_named_packing(arguments, store), **options)
    with Bar("local perturbation", "contact") as progress:
        dataset, cached = study.get_perturbation(
            store, parameters, workers=arguments.workers, progress=progress
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
        "seconds": dataset["seconds"].item(),
        "cached": cached,
    }
    if arguments.csv:
        names = ("limit_load", "critical_low", "critical_high", "pair_opening")
        names += ("opened", "slid", "kept", *COUNTS)
        columns = {"contact": dataset["backbone"].values}
        _write_csv(arguments.csv, columns | {name: dataset[name].values for name in names})
    report(lines, arguments.json)


def _exact_source(arguments, store):
    try:
        chosen = arguments.contacts and [int(text) for text in arguments.contacts.split(",")]
        edges = arguments.slice and [float(text) for text in arguments.slice.split(",")]
    except ValueError:
        raise InputError("--contacts and --slice take numbers separated by commas") from None
    if arguments.workers < 1:
        raise InputError("--workers must be at least 1")
    named = _named_packing(arguments, store)
    options = {"mu": arguments.ensemble_mu, "contacts": chosen, "slice_": edges}
    return study.exact_parameters(named, **options)


def intervals(arguments):
    """Exact intervals, computed or found; report them."""
    store = open_store(arguments.cache)
    parameters = _exact_source(arguments, store)
    with Bar("exact bounds", "bound") as progress:
        dataset, cached = study.get_intervals(
            store, parameters, workers=arguments.workers, progress=progress
        )
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
    if arguments.csv:
        columns = {"contact": dataset["backbone"].values}
        for name, side in (("min", "low"), ("max", "high")):
            columns |= {f"f_n_{name}": dataset[side].values[:, 0]}
            columns |= {f"f_t_{name}": dataset[side].values[:, 1]}
        _write_csv(arguments.csv, columns | {"cluster": cluster})
    report(lines, arguments.json)


def limit_loads(arguments):
    """Limit loads, computed or found; report them."""
    store = open_store(arguments.cache)
    parameters = _exact_source(arguments, store)
    with Bar("limit loads", "contact") as progress:
        dataset, cached = study.get_limit_loads(
            store, parameters, workers=arguments.workers, progress=progress
        )
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
    if arguments.csv:
        names = {"contact": "backbone", "limit_load": "limit_load"}
        _write_csv(arguments.csv, {k: dataset[v].values for k, v in names.items()})
    report(lines, arguments.json)


def import_(arguments):
    """Read a packing from elsewhere; report and save it."""
    if arguments.format == "lammps":
        if arguments.contacts is None:
            raise InputError("import lammps needs two dumps: particles and contacts")
        packing = importers.read_lammps(arguments.grains, arguments.contacts, arguments.mu)
    else:
        packing = importers.read_table(
            arguments.grains,
            arguments.contacts,
            mu=arguments.mu,
            box=arguments.box,
            forces=True if arguments.forces else None,
            pressure=arguments.pressure,
        )
    lines = importers.report(packing) | {
        k: v for k, v in packing.info.items() if k == "contacts_skipped"
    }
    if arguments.out:
        importers.save_packing(packing, arguments.out)
    report(lines, arguments.json)


def sweep(arguments):
    """Cells over processes into a store; print their table. Returns 1 if a cell failed."""
    try:
        mus = [float(text) for text in arguments.mu.split(",")]
    except ValueError:
        raise InputError(
            f"--mu {arguments.mu!r}: give numbers separated by commas, such as 0,0.1,1"
        ) from None
    if arguments.seeds < 1 or arguments.workers < 1:
        raise InputError("--seeds and --workers must be at least 1")
    cells = [
        study.walk_parameters(
            _packing_parameters(arguments, mu, seed),
            arguments.states,
            arguments.walk_seed,
            mu=arguments.ensemble_mu,
            relax=arguments.relax,
            chains=arguments.chains,
            keep=arguments.keep,
        )
        for mu in mus
        for seed in range(1, arguments.seeds + 1)
    ]
    store = open_store(arguments.out or arguments.cache)
    with Bar("sweep", "cell") as progress:
        rows, failed = sweeps.sweep(
            store.path,
            cells,
            workers=arguments.workers,
            scheduler=arguments.scheduler,
            dtypes={"states": "float32"} if arguments.float32 else None,
            progress=progress,
        )
    _report_sweep(rows, failed, arguments.json)
    return 1 if failed else 0


def _report_sweep(rows, failed, as_json):
    found = sum(line["cached"] for line in rows)
    summary = {"cells": len(rows) + len(failed), "found": found, "failed": len(failed)}
    if as_json:
        errors = [{"cell": cell, "error": message} for cell, message in failed]
        print(json.dumps({"rows": rows, "errors": errors, **summary}, indent=1))
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


def study_(arguments):
    """The study of the paper. Returns 1 if a cell failed."""
    from granforce.paper.main import main  # its imports are of no use to other commands

    return main(arguments)


def bench(arguments):
    """The benchmark's report."""
    from granforce.bench import main  # its imports are of no use to other commands

    main(arguments.out, arguments.quick, arguments.json)


def cache(arguments):
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
