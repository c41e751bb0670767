"""The command line as a user meets it: reports, exit codes, one-line errors, no heavy start."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from granforce.cli import main

SMALL = ["-n", "20", "--mu", "0.3", "--relax", "nearest", "--states", "5"]


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run a command on a store of this test alone; returns exit code, stdout, stderr."""
    monkeypatch.setenv("GRANFORCE_CACHE", str(tmp_path / "cache"))

    def call(*words):
        try:
            code = main([str(word) for word in words])
        except SystemExit as stop:
            code = stop.code
        out, err = capsys.readouterr()
        return code, out, err

    return call


def test_help_needs_no_heavy_import():
    code = (
        "import sys\nfrom granforce.cli import main\n"
        "try: main(['--help'])\nexcept SystemExit: pass\n"
        "print([m for m in ('numpy','numba','xarray','highspy','panel') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize("command", ["pack", "walk", "measure", "sweep", "cache"])
def test_every_command_has_help_with_an_example(run, command):
    code, out, _ = run(command, "--help")
    assert code == 0
    assert f"Example:\n  granforce {command}" in out


def test_pack_reports_and_saves(run, tmp_path):
    file = tmp_path / "p.npz"
    code, out, err = run("pack", "-n", 20, "--mu", 0.3, "--out", file, "--json")
    report = json.loads(out)
    assert code == 0
    assert report["grains"] == 20
    assert report["residual"] < 1e-10
    assert report["cached"] is False
    assert "step" in err
    assert json.loads(run("pack", "-n", 20, "--mu", 0.3, "--json")[1])["cached"] is True
    code, out, _ = run("walk", "--packing", file, "--states", 4, "--relax", "nearest", "--json")
    assert json.loads(out)["accepted"] == 4


def test_walk_and_measure_agree(run, tmp_path):
    file = tmp_path / "contacts.csv"
    walked = json.loads(run("walk", *SMALL, "--json")[1])
    measured = json.loads(run("measure", *SMALL, "--contacts", file, "--json")[1])
    assert walked["eta2"] == measured["eta2"] > 0
    lines = file.read_text().splitlines()
    assert lines[0] == "contact,f_n,f_n_min,f_n_max"
    assert len(lines) > 20


def test_sweep_table_and_resume(run, tmp_path):
    words = ["sweep", "--mu", "0,0.3", "-n", 20, "--states", 4, "--relax", "nearest"]
    words += ["--out", tmp_path / "s.zarr"]
    code, out, err = run(*words)
    assert code == 0
    assert len(out.splitlines()) == 3
    assert "2 cells: 0 found in the store, 2 computed" in err
    assert "2 found in the store, 0 computed" in run(*words)[2]
    rows = json.loads(run(*words, "--json")[1])["rows"]
    assert [line["mu"] for line in rows] == [0, 0.3]
    assert rows[0]["eta2"] < 1e-6 < rows[1]["eta2"]
    assert rows[0]["skipped"] == 4


def test_cache_commands(run):
    run("walk", *SMALL)
    entries = json.loads(run("cache", "list", "--json")[1])
    assert sorted(entry["kind"] for entry in entries) == ["packing", "walk"]
    assert json.loads(run("cache", "size", "--json")[1])["bytes"] > 1000
    assert run("cache", "verify")[0] == 0
    assert json.loads(run("cache", "clear", "--kind", "walk", "--json")[1])["removed"] == 1
    assert len(json.loads(run("cache", "list", "--json")[1])) == 1


@pytest.mark.parametrize(
    "words, what",
    [
        (["pack"], "--mu"),
        (["pack", "--mu", "-1"], "friction coefficient"),
        (["pack", "--mu", "nan"], "friction coefficient"),
        (["pack", "--mu", "0.1", "-n", "1"], "at least 3 disks"),
        (["pack", "--mu", "0.1", "--radii", "no-such-file"], "no-such-file"),
        (["pack", "--mu", "0.1", "--radii", "uniform:2,1"], "radii"),
        (["pack", "-n", "40", "--mu", "0.3", "--max-steps", "100"], "not jammed"),
        (["walk", "--packing", "no-such-file.npz"], "no-such-file.npz"),
        (["walk", "--mu", "0.1", "--states", "0"], "states"),
        (["sweep", "--mu", "0.1;1"], "--mu"),
        (["sweep", "--mu", "0.1", "--seeds", "0"], "--seeds"),
        (["cache", "list", "--cache", __file__], "test_cli.py"),
    ],
)
def test_bad_input_is_one_line_and_code_2(run, words, what):
    code, out, err = run(*words)
    assert code == 2
    assert out == ""
    last = err.strip().splitlines()[-1]
    assert last.startswith("granforce: ")
    assert what in last
    assert "Traceback" not in err


@pytest.mark.parametrize("words", [["fly"], ["pack", "--colour"], ["pack", "-n", "many"], []])
def test_unknown_words_are_code_2(run, words):
    code, _, err = run(*words)
    assert code == 2
    assert "usage: granforce" in err


def test_interrupt_ends_quietly_and_keeps_what_is_finished(tmp_path):
    words = ["sweep", "--mu", "0.3", "--seeds", "40", "-n", "20", "--states", "40"]
    words += ["--out", str(tmp_path / "s.zarr")]
    running = subprocess.Popen(
        [sys.executable, "-m", "granforce.cli", *words],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.time() + 120
    while not list((tmp_path / "s.zarr").glob("walk-*")) and time.time() < deadline:
        time.sleep(0.02)
    os.killpg(running.pid, signal.SIGINT)  # as a terminal does: workers get it too
    out, err = running.communicate(timeout=60)
    assert running.returncode == 130
    assert out == ""
    assert "Traceback" not in err
    assert "finished entries are kept" in err
