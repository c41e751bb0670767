"""`granforce import`: each format takes the options that its reader uses, and no others."""

import inspect
import itertools

import pytest

from granforce.cli.commands.packings import READERS
from granforce.cli.entry_point import main
from granforce.cli.parser import make_parser
from granforce.experiment.pegs import read_pegs

FILES = {"help", "json", "out", "measured", "grains", "contacts"}
# What is done with many snapshots.
FILES |= {"frames", "states", "walk_seed", "csv", "workers", "scheduler", "cache"}
# Options of pegs that stand for arguments of another name.
WORDS = {"strict": "repair", "wall_force": "wall_forces"}


def choices(parser):
    (found,) = (a for a in parser._actions if isinstance(a.choices, dict))
    return found.choices


FORMATS = choices(choices(make_parser())["import"])


def options(name):
    """{dest: option string} of a format."""
    actions = (a for a in FORMATS[name]._actions if a.dest not in FILES)
    return {a.dest: a.option_strings[-1] for a in actions}


@pytest.mark.parametrize("name", FORMATS)
def test_options_are_arguments_of_the_reader(name):
    reader = READERS[name] if name != "pegs" else read_pegs
    taken = inspect.signature(reader).parameters
    assert {WORDS.get(dest, dest) for dest in options(name)} <= set(taken)


ALL = {dest: word for name in FORMATS for dest, word in options(name).items()}
FOREIGN = [
    (name, word)
    for name, (dest, word) in itertools.product(FORMATS, ALL.items())
    if dest not in options(name)
]


@pytest.mark.parametrize("name, word", FOREIGN)
def test_options_of_other_formats_are_refused(name, word, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["import", name, "a", "b", "--mu", "0.3", f"{word}=1"])
    _, err = capsys.readouterr()
    assert stop.value.code == 2
    assert err.count("\n") == 1 and word in err and f"granforce import {name} --help" in err


def test_pressure_is_refused_beside_forces(away, capsys):
    (away / "g.csv").write_text("x,y,r\n0,0,1\n2,0,1\n")
    (away / "c.csv").write_text("i,j,fn,ft\n0,1,1,0\n")
    assert main(["import", "table", "g.csv", "c.csv", "--mu", "0.3", "--pressure", "5"]) == 2
    assert "leave it out" in capsys.readouterr().err
