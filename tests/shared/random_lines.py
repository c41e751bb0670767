"""Command lines drawn from the parser itself: any options, with any words, right or wrong."""

import argparse

import numpy as np

from granforce.cli import path_roles
from granforce.cli.parser import make_parser

LONG = "9" * 30
WHOLE = ["-1", "0", "1", "2", "1.5", "nan", "", "three", "1e3", LONG]
REAL = ["-1", "0", "0.5", "1", "1e-300", "1e300", "nan", "inf", "-inf", "", "half", "1,5"]
TEXT = [
    *("", ",", "0", "0,1", "1,2,3,4", "nan", "all", "left: 1 2 0.1", "x=a,y=b", "box", "groove"),
    *("html", "walk", "\0", "x" * 300, "μ", "../..", "-", "1e300,1", "0.1,0.3"),
]
# Names in the folder that `command_lines.prepare` makes, with right files among them.
PATHS = [
    *("p.npz", "grains.csv", "measured.csv", "positions.txt", "adjacency.txt", "r.txt", "new"),
    *("none/x", "folder", "loop", "empty", "noise", "cut.npz", "file", "/dev/null", "", "a\0b"),
    *("./p.npz", "../place/p.npz", "link.npz", "cache", "foreign"),
]
# Sizes that keep what is accepted short; without them a line would take minutes.
SMALL = {
    "n": "8",
    "mu": "0.3",
    "states": "3",
    "accuracy": "0.5",
    "random": "1",
    "angles": "4",
    "seeds": "1",
    "workers": "1",
    "chains": "1",
}
# What opens a page or computes for minutes (their options have tests of their own).
LEFT_OUT = {"app", "docs", "bench", "study", "scan"}
# Words that are right and cost much.
DEAR = {
    *(("sweeps", "1"), ("sweeps", "2"), ("max_steps", LONG), ("volume_seed", LONG)),
}


def parsers(of=None, words=()):
    """(words, parser) of every command and format that is drawn."""
    of = make_parser() if of is None else of
    inner = [a for a in of._actions if isinstance(a, argparse._SubParsersAction)]
    if not inner:
        yield words, of
    for action in inner:
        for name, one in action.choices.items():
            if name not in LEFT_OUT and one.prog.endswith(f" {name}"):
                yield from parsers(one, (*words, name))


def words_for(action):
    """Words that an option may get."""
    if action.choices:
        return [*map(str, action.choices), "none of these"]
    if action.type is int:
        return WHOLE
    if action.type is float:
        return REAL
    return PATHS if action.type in path_roles.ROLES else [*TEXT, *PATHS]


def line(command, parser, rng):
    """One command line of this command."""
    words = list(command)
    given = any(a.dest == "packing" for a in parser._actions) and rng.random() < 0.3
    words += ["p.npz"] if given else []
    for action in parser._actions:
        if action.dest in ("help", "scheduler", "packing" if given else ""):
            continue
        drawn = rng.random() < 0.07
        count = action.nargs if isinstance(action.nargs, int) else 1
        pool = words_for(action)
        values = [str(pool[k]) for k in rng.integers(len(pool), size=count)]
        values = [value for value in values if (action.dest, value) not in DEAR]
        if not action.option_strings:
            words += values if drawn or action.required else []
        elif drawn and count == 1:
            words.append(f"{action.option_strings[-1]}={values[0]}" if values else "--json")
        elif drawn:
            words += [action.option_strings[-1], *values]
        elif action.dest in SMALL and not (given and action.dest in ("n", "mu")):
            words += [action.option_strings[-1], SMALL[action.dest]]
    return words


def lines(count, seed=0):
    """So many command lines, of all commands in turn."""
    every, rng = list(parsers()), np.random.default_rng(seed)
    return [line(*every[k % len(every)], rng) for k in range(count)]
