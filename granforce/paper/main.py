"""The command `granforce study`: compute, reduce, draw, judge."""

import argparse
import sys
import time
from collections.abc import Callable, Collection
from itertools import pairwise
from pathlib import Path
from typing import Any

from granforce.packing.compaction import number_of_disks
from granforce.paper import claims, csv_tables, documents, drawings, findings, tables
from granforce.paper import plan as plans
from granforce.paper.plan import Plan, Task
from granforce.records import InputError, friction, positive, whole, worker_count
from granforce.study import scan
from granforce.study.cells import StudyCell
from granforce.study.store import open_store
from granforce.system import markdown
from granforce.system.files import check_apart, make_folder, written
from granforce.system.memory import check_memory
from granforce.system.terminal import Bar, print_list
from granforce.system.wording import integer, json_text, number

_LEAST = {"n": 3, "packings": 1, "states": 2}
_NUMBERS = (
    *("n", "packings", "states", "gauss_seidel_packings", "response_packings"),
    *("response_contacts", "perturb_packings"),
)


def main(arguments: argparse.Namespace) -> int:
    """Run the study into a folder. Returns 1 if a cell failed.

    The folder gets cells.zarr (every cell), study.zarr (the reduced table), figures, tables (CSV),
    and the claims as claims.json. With --reduce the cells of another store are used unchanged, and
    rows missing there come from --table; with --table alone nothing is computed or reduced. With
    --status only the progress is reported.
    """
    formats = [word for word in arguments.formats.split(",") if word]
    if set(formats) - set(drawings.FORMATS):
        raise InputError(f"--formats {arguments.formats!r}: choose from html, png, svg")
    worker_count(arguments.workers, "--workers")
    if arguments.minutes is not None:
        positive(arguments.minutes, "--minutes")
    renewed = markdown.marked_files(arguments.documents, documents.KIND)
    if arguments.status:
        return status(arguments)
    _check_apart(arguments)
    failed = []
    if arguments.reduce is not None:
        reduced = tables.reduce(arguments.reduce, plan_of(arguments))
        if arguments.table is not None:
            reduced = tables.merged(reduced, tables.load(arguments.table))
        folder = make_folder(arguments.out)
        tables.save(reduced, folder / "study.zarr")
    elif arguments.table is not None:
        reduced = tables.load(arguments.table)
        folder = make_folder(arguments.out)
    else:
        plan = plan_of(arguments)
        tasks = plans.chosen(plan, _parts(arguments))
        folder = make_folder(arguments.out)
        store = open_store(folder / "cells.zarr")
        failed = compute(store.path, tasks, arguments)
        reduced = tables.reduce(store.path, plan, tasks)
        tables.save(reduced, folder / "study.zarr")
    with Bar("figures", "figure") as progress:
        drawings.draw(reduced, folder / "figures", formats=formats, progress=progress)
    results: dict[str, Any] = {
        "claims": claims.judge(reduced),
        "findings": [finding._asdict() for finding in findings.all_findings(reduced)],
        "skipped": reduced.skipped,
    }
    with written(folder / "claims.json") as file:
        file.write(json_text(results, ascii_only=False).encode())
    judged = reduced, results["claims"], results["findings"]
    csv_tables.save(folder / "tables", *judged)
    documents.renew(renewed, *judged)
    print_claims(results, arguments.json)
    return 1 if failed else 0


def _check_apart(arguments: argparse.Namespace) -> None:
    """InputError if a store to be written in the folder is also read."""
    if arguments.reduce is not None:
        written_store = "the reduced study", Path(arguments.out) / "study.zarr"
        read = [("--reduce", arguments.reduce), ("--table", arguments.table)]
        check_apart(
            replaced=[written_store],
            read=[(typed, path) for typed, path in read if path is not None],
        )


def status(arguments: argparse.Namespace) -> int:
    """Print the progress of the parts of the plan on stdout; returns 0."""
    path = Path(arguments.out) / "cells.zarr"
    tasks = plans.chosen(plan_of(arguments), _parts(arguments))
    rows = plans.remaining(open_store(path, readonly=True).path, tasks)
    print_list(rows, ("part", "cells", "done", "minutes", "minutes left"), arguments.json)
    return 0


def _parts(arguments: argparse.Namespace) -> Collection[str] | None:
    """Families of parts to compute; None for all."""
    if arguments.paper:
        if arguments.parts is not None:
            raise InputError("--paper names the parts of the paper: leave --parts out")
        return plans.PAPER
    return None if arguments.parts is None else arguments.parts.split(",")


def plan_of(arguments: argparse.Namespace) -> Plan:
    """The Plan of the command line's options; InputError for impossible ones."""
    plan = plans.QUICK if arguments.quick else plans.Plan()
    for name in _NUMBERS:
        value = getattr(arguments, name)
        if value is None:
            continue
        given: dict[str, Any] = {name: whole(value, name.replace("_", " "), _LEAST.get(name, 0))}
        plan = plan._replace(**given)
    if arguments.n is not None:
        plan = plan._replace(frozen_large=4 * plan.n)
    if arguments.mu is not None:
        plan = _at(plan, _numbers("mu", arguments.mu, lambda mu: friction(number(mu))))
    if arguments.sizes is not None:
        sizes = _numbers("sizes", arguments.sizes, lambda n: number_of_disks(integer(n)))
        plan = plan._replace(sizes=sizes)
    if not plan.frictions:
        raise InputError("--mu: give at least one friction coefficient")
    cells = plan.packings * (len(plan.frictions) + len(plan.sizes))  # at least
    check_memory(scan.CELL_BYTES * cells, f"a study of {cells} cells or more")
    return plan


def _at(plan: Plan, frictions: tuple[float, ...]) -> Plan:
    """The plan for other friction coefficients; additions at some μ are kept for those of them."""
    some: dict[str, Any] = {
        name: tuple(mu for mu in getattr(plan, name) if mu in frictions)
        for name in ("frozen_large_frictions", "prepared_frictions", "repeat_frictions")
    }
    return plan._replace(frictions=frictions, **some)


def _numbers(option: str, text: str, cast: Callable[[str], Any]) -> tuple[Any, ...]:
    try:
        numbers = sorted(cast(part) for part in text.split(",")) if text else []
    except InputError as error:
        raise InputError(f"--{option}: {error}") from None
    except ValueError:
        raise InputError(f"--{option} {text!r}: give numbers separated by commas") from None
    if twice := [one for one, other in pairwise(numbers) if one == other]:
        raise InputError(f"--{option} {twice[0]} is given twice; give it once")
    return tuple(numbers)


def compute(
    path: str | Path, tasks: list[Task], arguments: argparse.Namespace
) -> list[tuple[StudyCell, str]]:
    """Compute the tasks, with a bar on stderr; return the failures."""
    begin = time.monotonic()

    def enough() -> bool:
        limit = arguments.minutes
        return limit is not None and time.monotonic() - begin > 60 * limit

    with Bar("cells", "cell") as progress:
        failed = plans.compute(
            path,
            tasks,
            workers=arguments.workers,
            scheduler=arguments.scheduler,
            dtypes={"states": "float32"},
            progress=progress,
            enough=enough,
        )
    for cell, message in failed:
        print(f"granforce: {cell.kind.name} of {cell.parameters}: {message}", file=sys.stderr)
    return failed


def print_claims(results: dict[str, Any], as_json: bool) -> None:
    """Print claims with their verdicts, and findings, on stdout."""
    if as_json:
        print(json_text(results))
        return
    print_list(results["claims"], ("id", "sampler", "verdict", "late", "range"), as_json=False)
    print()
    print_list(results["findings"], ("statement", "value", "low", "high"), as_json=False)
    if results["skipped"]["missing_cells"]:
        print(
            f"{results['skipped']['missing_cells']} cells of the plan are missing", file=sys.stderr
        )
