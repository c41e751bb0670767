"""States of S: walks, uniform samples, their measures, and the volume."""

import argparse
import sys
from collections.abc import Sequence

import numpy as np

from granforce.cli import report_lines
from granforce.cli.results import (
    check_outputs,
    conditions,
    distinct,
    interval_lengths,
    packing_options,
    sample_notes,
    stored_result,
    walk_result,
)
from granforce.cli.tables import of_contacts, write_csv, write_states, write_table
from granforce.explore.random_walk import UNBOUNDED_WALK
from granforce.explore.volume import inaccurate
from granforce.labelled import Declared
from granforce.quantities import quantity
from granforce.records import InputError, whole, worker_count
from granforce.study import kinds
from granforce.study import scan as scans
from granforce.study.keys import Parameters
from granforce.study.store import open_store
from granforce.system.terminal import Bar, print_notes, print_report, report_after, table
from granforce.system.wording import number
from granforce.types import Rows

# Digits in the table of a scan, whose numbers are means; the store has them exactly.
DIGITS = 9


def walk(arguments: argparse.Namespace) -> None:
    """Make or load a random walk, and report its course."""
    result = walk_result(arguments, arguments.out)
    if np.isnan(result.dataset["eta1"].item()):
        print_notes([f"{UNBOUNDED_WALK}: η1, η2 and η3 are undefined"])
    write_states(arguments, result)
    print_report(result.report(report_lines.WALK, arguments), arguments.json)


def uniform(arguments: argparse.Namespace) -> int:
    """Draw or load a uniform sample and report it. Returns 1 if it missed the requested size."""
    result = stored_result(
        *(arguments, kinds.UNIFORM, arguments.out),
        states=arguments.states,
        seed=arguments.sample_seed,
        chains=arguments.chains,
        effective=arguments.effective,
        **conditions(arguments),
    )
    write_states(arguments, result)
    reached = bool(result.dataset["reached"].item())
    lines = result.report(
        report_lines.UNIFORM,
        arguments,
        states=result.dataset.sizes["state"],
        **({} if arguments.effective is None else {"reached": reached}),
    )
    print_report(lines, arguments.json)
    notes = sample_notes(result.dataset)
    if arguments.effective is not None and not reached and not notes:
        notes = ["the effective sample size is less than --effective; use more --states"]
    print_notes(notes)
    return 1 if arguments.effective is not None and not reached else 0


def volume(arguments: argparse.Namespace) -> int:
    """Compute or load the volume of S and report it. Returns 1 if its error is too large."""
    chosen = {
        "accuracy": arguments.accuracy,
        "seed": arguments.volume_seed,
        **conditions(arguments),
    }
    result = stored_result(arguments, kinds.VOLUME, **chosen)
    down, up = result.dataset["log_volume_ladders"].values.tolist()
    reached = bool(result.dataset["reached"].item())
    lines = result.report(
        report_lines.VOLUME,
        arguments,
        ln_volume_on_the_way_down=down,
        ln_volume_on_the_way_up=up,
        reached=reached,
    )
    print_report(lines, arguments.json)
    if not reached:
        print_notes([inaccurate(result.dataset["log_volume_error"].item(), down, up)])
    return 0 if reached else 1


def measure(arguments: argparse.Namespace) -> None:
    """Measures of a walk, made or loaded."""
    result = walk_result(arguments, arguments.out)
    if np.isnan(result.dataset["eta1"].item()):
        raise InputError(
            f"{UNBOUNDED_WALK}: nothing to measure; granforce intervals has its bounds"
        )
    given = {name: result.parameters[name] for name in ("mu", "states")} | interval_lengths(
        result.dataset
    )
    lines = result.report(report_lines.MEASURE, arguments, **given)
    with report_after(lines, arguments.json):
        if arguments.out is not None:
            sources = {"f_n": "original", "f_n_seen_low": "low", "f_n_seen_high": "high"}
            declared: Declared = {
                name: (quantity(source, "contact"), result.dataset[source].values[:, 0])
                for name, source in sources.items()
            }
            write_table(arguments.out, of_contacts(arguments, result, declared))


def scan(arguments: argparse.Namespace) -> int:
    """Compute cells by processes into a store; print their table. Returns 1 if a cell failed."""
    mus = distinct("--mu", arguments.mu, number) or []
    seeds = whole(arguments.seeds, "--seeds", 1)
    worker_count(arguments.workers, "--workers")
    to_table = arguments.out is not None and arguments.out.endswith(".csv")
    if to_table:
        check_outputs(arguments.out)
    store = open_store(arguments.cache if to_table else arguments.out or arguments.cache)
    with Bar("scan", "cell") as progress:
        rows, failed = scans.scan(
            store.path,
            mus,
            seeds,
            arguments.n,
            arguments.states,
            walk_seed=arguments.walk_seed,
            ensemble_mu=arguments.ensemble_mu,
            relax=arguments.relax,
            chains=arguments.chains,
            keep=arguments.keep,
            workers=arguments.workers,
            scheduler=arguments.scheduler,
            dtypes={"states": "float32"} if arguments.float32 else None,
            progress=progress,
            **packing_options(arguments),
        )
    try:
        if to_table and rows:
            names = [name for name in rows[0] if name != "cached"]
            columns = {name: np.array([row[name] for row in rows]) for name in names}
            write_csv(arguments.out, columns, digits=DIGITS)
    finally:
        _report_scan(rows, failed, arguments.json)
    return 1 if failed else 0


def _report_scan(rows: Rows, failed: Sequence[tuple[Parameters, str]], as_json: bool) -> None:
    found = sum(line["cached"] for line in rows)
    summary = {"cells": len(rows) + len(failed), "found": found, "failed": len(failed)}
    if as_json:
        errors = [{"cell": cell, "error": message} for cell, message in failed]
        print_report({"rows": rows, "errors": errors, **summary}, as_json)
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
