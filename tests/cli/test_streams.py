"""Streams that are full or closed, and a store on a full disk: a result is printed if it can be."""

import errno
import json
import os
import resource
import subprocess
import sys
import warnings

import pytest

from granforce.cli.entry_point import main
from granforce.study import entries
from granforce.study.store import open_store

PACK = "pack -n 8 --mu 0.3 --json"


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """A store that has what the commands here report."""
    folder = tmp_path_factory.mktemp("streams") / "store"
    assert main([*PACK.split(), "--cache", str(folder)]) == 0
    return folder


def shell(store, words, redirections, **options):
    """A command in a shell with these redirections."""
    line = f'"{sys.executable}" -m granforce.cli {words} {redirections}'
    environment = os.environ | {"GRANFORCE_CACHE": str(store)}
    return subprocess.run(
        line, shell=True, capture_output=True, text=True, env=environment, timeout=300, **options
    )


@pytest.mark.parametrize(
    "words, redirection",
    [
        (PACK, ">/dev/full"),
        ("cache list", ">&-"),
        *(("pack --help", to) for to in (">/dev/full", ">&-")),
    ],
)
def test_a_report_that_cannot_be_printed_is_one_line(store, words, redirection):
    done = shell(store, words, redirection)
    assert done.returncode == 1
    assert done.stderr.startswith("granforce: cannot write to standard output: ")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("redirection, seed", [("2>/dev/full", 2), ("2>&- <&-", 3)])
def test_progress_that_cannot_be_printed_ends_nothing(store, redirection, seed):
    done = shell(store, f"{PACK} --seed {seed}", redirection)
    assert done.returncode == 0 and json.loads(done.stdout)["grains"] == 8


def test_a_refusal_that_cannot_be_printed_has_its_exit_code(store):
    refused = shell(store, "pack --mu -1", "2>&-")
    assert refused.returncode == 2 and refused.stdout == ""


def test_all_streams_may_be_closed(store):
    done = shell(store, PACK, "<&- >&- 2>&-")
    assert (done.returncode, done.stdout, done.stderr) == (1, "", "")


def test_a_reader_that_has_gone_is_no_error(store):
    done = shell(store, "walk --help", "| head -n 1; echo ${PIPESTATUS[0]}", executable="bash")
    assert done.stdout.splitlines()[1:] == ["0"] and done.stderr == ""


def test_letters_that_a_terminal_lacks_are_written_in_others(store):
    done = subprocess.run(
        [sys.executable, "-m", "granforce.cli", "pack", "--help"],
        capture_output=True,
        env=os.environ | {"PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"},
    )
    assert done.returncode == 0 and b"friction coefficient" in done.stdout


def test_what_cannot_be_kept_is_printed_all_the_same(away, capsys, monkeypatch):
    def full(*args):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(entries, "write", full)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        code = main("walk -n 8 --mu 0.3 --states 3 --json".split())
    report = json.loads(capsys.readouterr().out)
    assert code == 1 and report["accepted"] == 3 and not report["cached"]
    assert {str(one.message).count("No space left") for one in told} == {1}
    assert len(open_store(away / "cache")) == 0


def test_a_full_disk_is_one_line_beside_the_report(store, tmp_path):
    """Files may not grow beyond a few bytes, as on a full disk; the system says so itself."""

    def little():
        resource.setrlimit(resource.RLIMIT_FSIZE, (300, 300))

    main(["cache", "size", "--cache", str(tmp_path / "new")])
    done = shell(store, f"{PACK} --cache {tmp_path / 'new'}", "", preexec_fn=little)
    assert done.returncode == 1 and json.loads(done.stdout)["grains"] == 8
    told = [line for line in done.stderr.splitlines() if "cannot write to the store" in line]
    assert len(told) == 1 and told[0].startswith("granforce: ")
    assert "Traceback" not in done.stderr


def test_a_file_that_cannot_be_written_leaves_the_report(away, capsys):
    assert main([*PACK.split(), "--out", "/dev/full"]) == 2
    told = capsys.readouterr()
    assert json.loads(told.out)["grains"] == 8
    assert "cannot write /dev/full: No space left" in told.err
