"""The command `granforce study`: compute, reduce, draw, judge."""

import json
import sys
from pathlib import Path

from granforce.paper import claims, drawings, findings, tables
from granforce.paper import plan as plans
from granforce.records import InputError, friction
from granforce.store import open_store
from granforce.terminal import Bar, table

_LEAST = {"n": 3, "packings": 1, "states": 2}
_NUMBERS = (
    *("n", "packings", "states", "gauss_seidel_packings", "exact_packings"),
    *("uniform_packings", "perturb_packings", "perturb_contacts"),
)


def main(arguments):
    """Run the study into a folder. Returns 1 if a cell failed.

    The folder gets cells.zarr (every cell), study.zarr (the reduced table), figures, and the claims
    as claims.json.
    """
    folder = Path(arguments.out)
    formats = [word for word in arguments.formats.split(",") if word]
    if set(formats) - set(drawings.FORMATS):
        raise InputError(f"--formats {arguments.formats!r}: take some of html, png, svg")
    failed = []
    if arguments.table is None:
        plan = plan_of(arguments)
        parts = None if arguments.parts is None else arguments.parts.split(",")
        wanted = plans.chosen(plan, parts)
        store = open_store(folder / "cells.zarr")
        failed = compute(store.path, wanted, arguments)
        reduced = tables.reduce(store.path, plan)
        tables.save(reduced, folder / "study.zarr")
    else:
        reduced = tables.load(arguments.table)
    with Bar("figures", "figure") as progress:
        drawings.draw(reduced, folder / "figures", formats=formats, progress=progress)
    told = {
        "claims": [claim._asdict() for claim in claims.judged(reduced)],
        "findings": [finding._asdict() for finding in findings.found(reduced)],
        "skipped": reduced.skipped,
    }
    (folder / "claims.json").write_text(json.dumps(told, indent=1, ensure_ascii=False))
    report(told, arguments.json)
    return 1 if failed else 0


def plan_of(arguments):
    """The Plan of the command line's options; InputError for impossible ones."""
    plan = plans.QUICK if arguments.quick else plans.Plan()
    for name in _NUMBERS:
        value = getattr(arguments, name)
        if value is None:
            continue
        if value < _LEAST.get(name, 0):
            raise InputError(f"{name.replace('_', ' ')} must be at least {_LEAST.get(name, 0)}")
        plan = plan._replace(**{name: value})
    if arguments.mu is not None:
        plan = plan._replace(frictions=_numbers("mu", arguments.mu, friction))
    if arguments.sizes is not None:
        plan = plan._replace(sizes=_numbers("sizes", arguments.sizes, int))
    if arguments.workers < 1:
        raise InputError("--workers must be at least 1")
    return plan


def _numbers(option, text, cast):
    try:
        numbers = sorted({cast(part) for part in text.split(",") if part})
    except ValueError:
        raise InputError(f"--{option} {text!r}: give numbers separated by commas") from None
    return tuple(numbers)


def compute(path, wanted, arguments):
    """Compute the tasks, with bars on stderr; returns what failed."""
    bars = []

    def bar(what):
        bars.append(Bar(what, "cell"))
        return bars[-1]

    try:
        failed = plans.compute(
            path,
            wanted,
            workers=arguments.workers,
            scheduler=arguments.scheduler,
            dtypes={"states": "float32"},
            progress=bar,
        )
    finally:
        for each in bars:
            each.__exit__()
    for cell, message in failed:
        print(f"granforce: {cell.kind} of {cell.parameters}: {message}", file=sys.stderr)
    return failed


def report(told, as_json):
    """Claims with their verdicts, and findings, on stdout."""
    if as_json:
        print(json.dumps(told, indent=1))
        return
    for word, names in (
        ("claims", ("claim", "measured", "95 %", "criterion", "verdict")),
        ("findings", ("finding", "measured", "95 %")),
    ):
        lines = [
            {
                names[0]: claim["statement"],
                "measured": f"{claim['value']:.3g}",
                "95 %": f"{claim['low']:.3g} … {claim['high']:.3g}",
                "criterion": claim["criterion"],
                "verdict": claim["verdict"],
            }
            for claim in told[word]
        ]
        table(lines, names, {})
        print()
    if told["skipped"]["missing_cells"]:
        print(f"{told['skipped']['missing_cells']} cells of the plan are missing", file=sys.stderr)
