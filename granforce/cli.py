"""The command line: `granforce COMMAND --help` tells each command with an example."""

import argparse
import json
import sys
from pathlib import Path

# Only the standard library up here: --help must not wait for numba, xarray and HiGHS.

EXAMPLE = argparse.RawDescriptionHelpFormatter


def main(argv=None):
    """Run one command; the exit code: 0, 1 (some cells failed), 2 (bad input) or 130 (Ctrl-C)."""
    arguments = _parser().parse_args(argv)
    from granforce.records import Cancelled, InputError

    try:
        return arguments.run(arguments) or 0
    except InputError as error:
        print(f"granforce: {error}", file=sys.stderr)
        return 2
    except (KeyboardInterrupt, Cancelled):
        print("granforce: interrupted; finished entries are kept", file=sys.stderr)
        return 130
    except BrokenPipeError:
        sys.stderr.close()  # the reader of our output (head, less) has gone; that is no error
        return 0


def _parser():
    parser = argparse.ArgumentParser(
        prog="granforce",
        description="Explore how undetermined the forces in a packing of rigid disks are.",
        epilog="Example:\n  granforce walk -n 400 --mu 0.1 --seed 1 --states 1000",
        formatter_class=EXAMPLE,
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    _add_pack(commands)
    _add_walk(commands)
    _add_measure(commands)
    _add_sweep(commands)
    _add_intervals(commands)
    _add_limit_loads(commands)
    _add_import(commands)
    _add_cache(commands)
    return parser


def _command(commands, name, run, summary, example):
    command = commands.add_parser(
        name,
        help=summary,
        description=summary[0].upper() + summary[1:] + ".",
        epilog=f"Example:\n  {example}",
        formatter_class=EXAMPLE,
        allow_abbrev=False,
    )
    command.set_defaults(run=run)
    command.add_argument("--json", action="store_true", help="print the report as JSON")
    return command


def _add_store(command):
    command.add_argument(
        "--cache",
        metavar="FOLDER",
        help="store of results (default: $GRANFORCE_CACHE, else the user's cache folder)",
    )


def _add_packing(command, several=False):
    group = command.add_argument_group("the packing")
    group.add_argument("-n", type=int, default=400, help="number of disks (default 400)")
    if not several:
        group.add_argument("--mu", type=float, help="friction coefficient μ")
        group.add_argument("--seed", type=int, default=1, help="random seed (default 1)")
    group.add_argument(
        "--radii",
        default="uniform:0.5,1",
        help="uniform:LOW,HIGH or bidisperse:SMALL,LARGE,FRACTION_LARGE, or a file with a radius "
        "per line (default uniform:0.5,1)",
    )
    group.add_argument("--pressure", type=float, default=1.0, help="pressure P0 (default 1)")
    group.add_argument("--dt", type=float, default=0.01, help="time step (default 0.01)")
    group.add_argument("--box-mass", type=float, default=100.0, help="box inertia (default 100)")
    group.add_argument("--sweeps", type=int, default=100, help="sweeps per step (default 100)")


def _add_walk_options(command):
    group = command.add_argument_group("the random walk")
    group.add_argument("--states", type=int, default=1000, help="accepted states (default 1000)")
    group.add_argument("--walk-seed", type=int, default=0, help="seed of the walk (default 0)")
    group.add_argument("--ensemble-mu", type=float, help="friction of the cones, if not --mu")
    group.add_argument(
        "--relax",
        choices=["gauss_seidel", "gauss_seidel_only", "nearest"],
        default="gauss_seidel",
        help="the paper's contact dynamics with an exact finish or (slower, to 1e-6) without, or "
        "the nearest admissible network (fastest)",
    )
    group.add_argument("--chains", type=int, default=1, help="independent chains (default 1)")
    group.add_argument("--workers", type=int, default=2, help="processors to use (default 2)")


def _add_pack(commands):
    command = _command(
        commands,
        "pack",
        _pack,
        "make a jammed packing, or find it in the store",
        "granforce pack -n 400 --mu 0.1 --seed 1 --out packing.npz",
    )
    _add_packing(command)
    _add_store(command)
    command.add_argument("--max-steps", type=int, default=100_000, help="step budget")
    command.add_argument("--out", metavar="FILE.npz", help="also save the packing to this file")


def _add_walk(commands):
    command = _command(
        commands,
        "walk",
        _walk,
        "walk at random through the force networks of a packing",
        "granforce walk -n 400 --mu 0.1 --seed 1 --states 1000",
    )
    _add_source(command)


def _add_source(command):
    command.add_argument("--packing", metavar="FILE.npz", help="take this packing, make none")
    _add_packing(command)
    _add_walk_options(command)
    _add_store(command)


def _add_measure(commands):
    command = _command(
        commands,
        "measure",
        _measure,
        "measure the indeterminacy of a walk, contact by contact if wanted",
        "granforce measure -n 400 --mu 0.1 --seed 1 --states 1000 --contacts contacts.csv",
    )
    _add_source(command)
    command.add_argument(
        "--contacts", metavar="FILE.csv", help="write f_n and its interval per contact"
    )


def _add_sweep(commands):
    command = _command(
        commands,
        "sweep",
        _sweep,
        "packings and walks for many μ and seeds, over processes, resumable",
        "granforce sweep --mu 0,0.01,0.1,1,10 --seeds 2 -n 400 --states 1000 --out sweep.zarr",
    )
    command.add_argument("--mu", required=True, help="friction coefficients, separated by commas")
    command.add_argument("--seeds", type=int, default=1, help="packings per μ: seeds 1 … SEEDS")
    _add_packing(command, several=True)
    _add_walk_options(command)
    command.add_argument("--out", metavar="STORE", help="store for the results")
    _add_store(command)
    command.add_argument("--keep", type=int, help="store only so many states, evenly spaced")
    command.add_argument("--float32", action="store_true", help="store states in single precision")


def _add_exact(command):
    command.add_argument("--packing", metavar="FILE.npz", help="take this packing, make none")
    _add_packing(command)
    group = command.add_argument_group("the ensemble")
    group.add_argument("--ensemble-mu", type=float, help="friction of the cones, if not --mu")
    group.add_argument("--contacts", help="only these contacts, numbers separated by commas")
    group.add_argument(
        "--slice",
        metavar="X0,X1,Y0,Y1",
        help="freeze the forces on contacts outside this part of the box, such as 0.2,0.8,0,1",
    )
    group.add_argument("--workers", type=int, default=2, help="processors to use (default 2)")
    group.add_argument("--csv", metavar="FILE.csv", help="write the result per contact")
    _add_store(command)


def _add_intervals(commands):
    command = _command(
        commands,
        "intervals",
        _intervals,
        "compute the exact interval of every contact force",
        "granforce intervals -n 400 --mu 0.1 --seed 1 --csv bounds.csv",
    )
    _add_exact(command)


def _add_limit_loads(commands):
    command = _command(
        commands,
        "limit-loads",
        _limit_loads,
        "compute the largest force pair each contact can be pushed apart with",
        "granforce limit-loads -n 400 --mu 0.1 --seed 1 --contacts 0,5,17",
    )
    _add_exact(command)


def _add_import(commands):
    command = _command(
        commands,
        "import",
        _import,
        "read a packing from elsewhere, check it and keep it",
        "granforce import lammps particles.dump contacts.dump --mu 0.3 --out packing.npz\n"
        "  granforce import table grains.csv contacts.csv --box 30 30 --mu 0.3 --out packing.npz",
    )
    command.add_argument("format", choices=["lammps", "table"])
    command.add_argument("grains", help="LAMMPS particle dump, or table with x, y, r")
    command.add_argument("contacts", nargs="?", help="LAMMPS contact dump, or table with i, j")
    command.add_argument("--mu", type=float, required=True, help="friction coefficient μ")
    command.add_argument(
        "--box", type=float, nargs=2, metavar=("LX", "LY"), help="table: box sides"
    )
    command.add_argument("--forces", action="store_true", help="table: fn, ft must be given")
    command.add_argument("--pressure", type=float, default=1.0, help="table without forces: P0")
    command.add_argument("--out", metavar="FILE.npz", help="save the packing to this file")


def _add_cache(commands):
    command = _command(
        commands,
        "cache",
        _cache,
        "list, size, clear or verify the store",
        "granforce cache verify --cache sweep.zarr",
    )
    command.add_argument("action", choices=["list", "size", "clear", "verify"])
    command.add_argument("--kind", help="only entries of this kind (packing, walk, …)")
    _add_store(command)


def _store(arguments):
    from granforce.store import open_store

    return open_store(getattr(arguments, "out", None) or arguments.cache)


def _radii(text, n):
    if ":" in text:
        return text
    from granforce.records import InputError

    try:
        radii = [float(line) for line in Path(text).read_text().split()]
    except (OSError, ValueError) as error:
        raise InputError(f"radii file {text}: {error}") from None
    if len(radii) != n:
        raise InputError(f"radii file {text} holds {len(radii)} radii for {n} disks (-n)")
    return radii


def _packing_parameters(arguments, mu, seed):
    from granforce import study

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
    from granforce.records import InputError

    if arguments.mu is None:
        raise InputError("give the friction coefficient: --mu 0.1")
    return arguments.mu


def _pack(arguments):
    from granforce import study
    from granforce.importers import report, save_packing
    from granforce.store import open_store

    parameters = _packing_parameters(arguments, _required_mu(arguments), arguments.seed)
    with _Steps("compaction", "step") as progress:
        store = open_store(arguments.cache)
        packing, cached = study.get_packing(
            store, parameters, max_steps=arguments.max_steps, progress=progress
        )
    if arguments.out:
        save_packing(packing, arguments.out)
    work = {k: packing.info[k] for k in ("steps", "sweeps_done", "list_rebuilds")}
    lines = {**report(packing), **work, "cached": cached}
    _report(lines, arguments.json)


def _named_packing(arguments, store):
    """The packing's parameters: one from a file is kept in the store, another made if need be."""
    from granforce import study

    if arguments.packing:
        from granforce.importers import load_packing

        packing = load_packing(arguments.packing)
        named = study.imported_parameters(packing)
        study.keep_packing(store, named, packing)
        return named
    named = _packing_parameters(arguments, _required_mu(arguments), arguments.seed)
    with _Steps("compaction", "step") as progress:
        study.get_packing(store, named, progress=progress)
    return named


def _walked(arguments):
    from granforce import study

    size = arguments.states, arguments.walk_seed
    options = {"relax": arguments.relax, "chains": arguments.chains}
    # Bad sizes are told before a packing is made.
    study.walk_parameters({"mu": 0.0}, *size, mu=arguments.ensemble_mu, **options)
    store = _store(arguments)
    named = _named_packing(arguments, store)
    parameters = study.walk_parameters(named, *size, mu=arguments.ensemble_mu, **options)
    with _Bar("random walk", "state") as progress:
        dataset, cached = study.get_walk(
            store, parameters, workers=arguments.workers, progress=progress
        )
    return store, parameters, dataset, cached


def _walk(arguments):
    from granforce import study

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
    _report(lines, arguments.json)


def _measure(arguments):
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
    _report(lines, arguments.json)


def _write_csv(path, columns):
    """Columns {name: array} as a table; whole numbers stay whole."""
    import numpy as np

    from granforce.records import InputError

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


def _exact_source(arguments, store):
    from granforce import study
    from granforce.records import InputError

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


def _intervals(arguments):
    import numpy as np

    from granforce import study

    store = _store(arguments)
    parameters = _exact_source(arguments, store)
    with _Bar("exact bounds", "bound") as progress:
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
    _report(lines, arguments.json)


def _limit_loads(arguments):
    from granforce import study

    store = _store(arguments)
    parameters = _exact_source(arguments, store)
    with _Bar("limit loads", "contact") as progress:
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
    _report(lines, arguments.json)


def _import(arguments):
    from granforce.importers import read_lammps, read_table, report, save_packing
    from granforce.records import InputError

    if arguments.format == "lammps":
        if arguments.contacts is None:
            raise InputError("import lammps needs two dumps: particles and contacts")
        packing = read_lammps(arguments.grains, arguments.contacts, arguments.mu)
    else:
        packing = read_table(
            arguments.grains,
            arguments.contacts,
            mu=arguments.mu,
            box=arguments.box,
            forces=True if arguments.forces else None,
            pressure=arguments.pressure,
        )
    lines = report(packing) | {k: v for k, v in packing.info.items() if k == "contacts_skipped"}
    if arguments.out:
        save_packing(packing, arguments.out)
    _report(lines, arguments.json)


def _sweep(arguments):
    from granforce import study
    from granforce.records import InputError

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
    store = _store(arguments)
    with _Bar("sweep", "state") as progress:
        rows, failed = study.sweep(
            store.path,
            cells,
            workers=arguments.workers,
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
    _table(rows, names, heads)
    for cell, message in failed:
        where = f"μ = {cell['packing']['mu']}, seed {cell['packing']['seed']}"
        print(f"granforce: cell {where}: {message}", file=sys.stderr)
    print(
        f"{summary['cells']} cells: {found} found in the store, "
        f"{len(rows) - found} computed, {len(failed)} failed",
        file=sys.stderr,
    )


def _cache(arguments):
    store = _store(arguments)
    if arguments.action == "clear":
        lines = {"removed": store.clear(arguments.kind), "temporaries": store.clean()}
        _report(lines, arguments.json)
    elif arguments.action == "size":
        entries = store.find(arguments.kind)
        size = sum(entry.bytes for entry in entries)
        _report({"path": str(store.path), "entries": len(entries), "bytes": size}, arguments.json)
    elif arguments.action == "verify":
        verdicts = [
            v._asdict()
            for v in store.verify()
            if not arguments.kind or v.name.startswith(f"{arguments.kind}-")
        ]
        _list(verdicts, ("name", "ok", "reason"), arguments.json)
        return 0 if all(verdict["ok"] for verdict in verdicts) else 1
    else:
        entries = [
            {**entry._asdict(), "params": json.dumps(entry.params)}
            for entry in store.find(arguments.kind)
        ]
        _list(entries, ("name", "bytes", "created", "params"), arguments.json)
    return 0


def _list(rows, names, as_json):
    if as_json:
        print(json.dumps(rows, indent=1))
    else:
        _table(rows, names, {})


def _report(lines, as_json):
    """A report on stdout: names and numbers in two columns, or JSON."""
    if as_json:
        print(json.dumps(lines, indent=1))
        return
    width = max(len(name) for name in lines)
    for name, value in lines.items():
        print(f"{name.replace('_', ' '):<{width}}  {_text(value)}")


def _table(rows, names, heads):
    cells = [[heads.get(name, name) for name in names]]
    cells += [[_text(line[name]) for name in names] for line in rows]
    widths = [max(len(line[k]) for line in cells) for k in range(len(names))]
    for line in cells:
        print("  ".join(f"{text:>{width}}" for text, width in zip(line, widths, strict=True)))


def _text(value):
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


class _Bar:
    """A tqdm bar on stderr that a progress(done, total) callable drives; gone when not used."""

    def __init__(self, label, unit):
        self.label, self.unit, self.bar = label, unit, None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.bar is not None:
            self.bar.close()

    def __call__(self, done, total):
        if self.bar is None:
            from tqdm import tqdm

            self.bar = tqdm(total=total, desc=self.label, unit=self.unit, file=sys.stderr)
        self.bar.update(done - self.bar.n)


class _Steps(_Bar):
    """The same for work whose end is not known: progress(step, message)."""

    def __call__(self, step, message):
        super().__call__(step, None)
        self.bar.set_postfix_str(message)


if __name__ == "__main__":
    sys.exit(main())
