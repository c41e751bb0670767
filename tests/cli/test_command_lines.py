"""Bad command lines: one line on stderr, exit code 2, nothing half written, never a traceback."""

import contextlib
import gc
import io
import os
import warnings
from pathlib import Path

import command_lines
import pytest
import random_lines
from packings import packed

from granforce.cli.entry_point import main
from granforce.cli.parser import LONGEST
from granforce.packing.importers import save_packing

PACKING = Path(__file__).parents[1] / "reference" / "n100_mu0.1_s11.npz"
LINES = command_lines.lines()


@pytest.fixture
def folder(away):
    """A folder to work in, with files of every kind, and a store of its own."""
    gc.collect()  # what other tests left behind complains here, not among what a command tells
    command_lines.prepare(away, PACKING)
    return away


def called(words):
    """Exit code, stdout and the lines on stderr that are not progress, warnings among them."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        warnings.catch_warnings(record=True) as told,
    ):
        warnings.simplefilter("always")
        try:
            code = main(words)
        except SystemExit as stop:
            code = stop.code
    said = [line for line in err.getvalue().split("\n") if line and "\r" not in line]
    return code, out.getvalue(), [*said, *(str(warning.message) for warning in told)]


def files(folder):
    """All files of the folder but those of the store, and what a killed writer would leave."""
    listed = {
        path.relative_to(folder)
        for path in folder.rglob("*")
        if "cache" not in path.relative_to(folder).parts
    }
    return listed, [path for path in folder.rglob(".*") if path.name.startswith((".tmp", ".gran"))]


def faults(folder, words):
    """What is wrong with how a bad command line ended, in words; empty where nothing is."""
    before = files(folder)
    try:
        code, out, said = called(words)
    except BaseException as error:
        return [f"{type(error).__name__}: {error}"]
    found = []
    if code != 2:
        found.append(f"exit code {code}")
    # What only turns out not to be writable is printed all the same.
    if out and not any("/proc/none" in word for word in words):
        found.append("something on stdout")
    if len(said) != 1 or not said[0].startswith("granforce: ") or len(said[0]) > LONGEST + 20:
        found.append(f"told {said}")
    if files(folder) != before:
        found.append("files were left")
    return found


def judged(folder, chosen):
    """{words: faults} of those command lines that have any."""
    return {str(words): wrong for words in chosen if (wrong := faults(folder, words))}


def test_some_bad_command_lines(folder):
    """One in twelve, of every command: 125 lines tried, all survived."""
    ordered = sorted(LINES, key=lambda words: words[:1])
    chosen = ordered[::12]
    assert len(chosen) >= 60
    assert judged(folder, chosen) == {}


@pytest.mark.stress
def test_all_bad_command_lines(folder):
    """Every wrong word for every option: 1493 lines tried, all survived, in 50 s."""
    assert len(LINES) >= 500
    assert judged(folder, LINES) == {}


def misbehaved(folder, words):
    """What is wrong with how any command line ended; None where nothing is."""
    try:
        code, _, said = called(words)
    except BaseException as error:
        return f"{type(error).__name__}: {error}"
    if code == 2 and (len(said) != 1 or not said[0].startswith("granforce: ")):
        return f"told {said}"
    return None if code in (0, 1, 2) else f"exit code {code}"


@pytest.fixture
def drawn(folder):
    """The same with a packing of 8 disks, and other files that are right."""
    save_packing(packed(8, 0.3), "p.npz")
    os.symlink("p.npz", "link.npz")
    Path("r.txt").write_text("1\n" * 8)
    return folder


def test_some_random_command_lines(drawn):
    lines = random_lines.lines(48, seed=47)
    assert len({tuple(words) for words in lines}) >= 40
    found = {str(words): wrong for words in lines if (wrong := misbehaved(drawn, words))}
    assert found == {}


@pytest.mark.stress
def test_many_random_command_lines(drawn):
    """1000 lines, about a fifth of which are accepted, in two minutes."""
    lines = random_lines.lines(1000, seed=48)
    found = {str(words): wrong for words in lines if (wrong := misbehaved(drawn, words))}
    assert found == {}
