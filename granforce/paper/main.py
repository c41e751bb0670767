"""The command `granforce study`: compute, reduce, draw, judge."""

import sys
from pathlib import Path

from granforce.paper import plan as plans
from granforce.records import InputError, friction
from granforce.store import open_store
from granforce.terminal import Bar


def main(arguments):
    """Run the study into a folder. Returns 1 if a cell failed."""
    plan = plan_of(arguments)
    parts = None if arguments.parts is None else arguments.parts.split(",")
    wanted = plans.chosen(plan, parts)
    folder = Path(arguments.out)
    store = open_store(folder / "cells.zarr")
    failed = compute(store.path, wanted, arguments)
    return 1 if failed else 0


def plan_of(arguments):
    """The Plan of the command line's options; InputError for impossible ones."""
    plan = plans.QUICK if arguments.quick else plans.Plan()
    given = {
        "n": arguments.n,
        "packings": arguments.packings,
        "states": arguments.states,
        "gauss_seidel_packings": arguments.gauss_seidel_packings,
        "exact_packings": arguments.exact_packings,
    }
    for name, value in given.items():
        if value is not None and value < (1 if name in ("n", "packings", "states") else 0):
            raise InputError(f"--{name.replace('_', '-')} is too small: {value}")
    plan = plan._replace(**{name: value for name, value in given.items() if value is not None})
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
