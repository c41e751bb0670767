"""The command line as a user meets it: reports, exit codes, one-line errors, no heavy start."""

import contextlib
import errno
import io
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from heeding import heed, heeding, interrupted, until_it_computes, until_it_left
from numba.core.caching import _CacheLocator
from packings import packed

import granforce as gf
from granforce.cli import commands, viewer
from granforce.cli.commands import service
from granforce.cli.entry_point import main
from granforce.packing.importers import save_packing
from granforce.study.store import open_store
from granforce.system import compiled, interrupts

SMALL = ["-n", "20", "--mu", "0.3", "--relax", "nearest", "--states", "5"]


@pytest.fixture
def run(away, capsys):
    """Run a command on a store of this test alone; returns exit code, stdout, stderr."""

    def call(*words):
        try:
            code = main([str(word) for word in words])
        except SystemExit as stop:
            code = stop.code
        out, err = capsys.readouterr()
        return code, out, err

    return call


def test_a_packing_in_a_file_needs_no_store_that_lasts(away, run, monkeypatch):
    """Another process clears the store whenever the packing has been saved to it."""
    keep = commands.exact.kinds.keep_packing

    def overtaken(store, *args, **options):
        keep(store, *args, **options)
        open_store(store.path).clear()

    save_packing(packed(8, 0.3), "p.npz")
    wanted = run("intervals", "p.npz", "--out", "x.csv")
    monkeypatch.setattr(commands.exact.kinds, "keep_packing", overtaken)
    for words in (
        ("intervals", "p.npz", "--out", "y.csv"),
        ("walk", "p.npz", "--states", "3", "--out", "states.csv"),
    ):
        code, out, err = run(*words)
        assert code == 0 and "cached" in out and "granforce:" not in err
    assert wanted[0] == 0 and Path("x.csv").read_bytes() == Path("y.csv").read_bytes()


def test_help_needs_no_heavy_import():
    code = (
        "import sys\nfrom granforce.cli import main\n"
        "try: main(['--help'])\nexcept SystemExit: pass\n"
        "print([m for m in ('numpy','numba','xarray','highspy','panel') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    "command",
    [
        "pack",
        "walk",
        "measure",
        "scan",
        "intervals",
        "limit-loads",
        "stress",
        "app",
        "import",
        "cache",
    ],
)
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
    assert "step" not in err  # no terminal
    assert json.loads(run("pack", "-n", 20, "--mu", 0.3, "--json")[1])["cached"] is True
    code, out, _ = run("walk", file, "--states", 4, "--relax", "nearest", "--json")
    assert json.loads(out)["accepted"] == 4


@pytest.mark.parametrize(
    "words",
    ["uniform -n 8 --mu 0 --seed 1 --states 8", "perturb -n 8 --mu 0 --seed 1 --contacts 0"],
)
def test_reports_are_json_where_nothing_can_be_told(run, words):
    """S is one point there: nothing mixes, and no exponent can be fitted."""
    code, out, _ = run(*words.split(), "--json")
    assert code == 0
    told = json.loads(out, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    assert None in told.values()


def test_a_scene_is_packed_without_a_store(run, tmp_path):
    file = tmp_path / "groove.npz"
    code, out, _ = run("pack", "--scene", "groove", "--mu", "0.2", "--json", "--out", file)
    assert code == 0
    told = json.loads(out)
    assert (told["scene"], told["dimension"], told["mu"]) == ("groove", 1, 0.2)
    assert file.exists() and not (tmp_path / "cache").exists()
    code, _, err = run("pack", "--scene", "grove")
    assert code == 2 and err.count("\n") == 1 and "groove" in err


def test_walk_and_measure_agree(run, tmp_path):
    file = tmp_path / "contacts.csv"
    walked = json.loads(run("walk", *SMALL, "--json")[1])
    measured = json.loads(run("measure", *SMALL, "--out", file, "--json")[1])
    assert walked["eta2"] == measured["eta2"] > 0
    lines = file.read_text().splitlines()
    assert (
        lines[0] == "contact,i,j,x,y,n_x,n_y,wall,"
        "f_n [packing],f_n_seen_low [packing],f_n_seen_high [packing]"
    )
    assert len(lines) > 20


def test_scan_table_and_resume(run, tmp_path):
    words = ["scan", "--mu", "0,0.3", "-n", 20, "--states", 4, "--relax", "nearest"]
    words += ["--workers", 1, "--out", tmp_path / "s.zarr"]
    code, out, err = run(*words)
    assert code == 0
    assert len(out.splitlines()) == 3
    assert "2 cells: 0 found in the store, 2 computed" in err
    assert "2 found in the store, 0 computed" in run(*words)[2]
    rows = json.loads(run(*words, "--json")[1])["rows"]
    assert [line["mu"] for line in rows] == [0, 0.3]
    assert rows[0]["eta2"] < 1e-6 < rows[1]["eta2"]
    assert rows[0]["skipped"] == 4


def test_intervals_hold_the_walk(run, tmp_path):
    exact, seen = tmp_path / "exact.csv", tmp_path / "seen.csv"
    words = SMALL[:4]
    report = json.loads(run("intervals", *words, "--out", exact, "--json")[1])
    assert report["largest_duality_gap"] <= 1e-8
    assert report["exact_eta3"] > json.loads(run("measure", *SMALL, "--json")[1])["eta3"]
    run("measure", *SMALL, "--out", seen)
    bounds, walked = pd.read_csv(exact), pd.read_csv(seen)
    assert np.array_equal(bounds["contact"], walked["contact"])
    for name in ("f_n", "f_n_seen_low", "f_n_seen_high"):
        assert np.all(walked[f"{name} [packing]"] >= bounds["f_n_low [packing]"] - 1e-7)
        assert np.all(walked[f"{name} [packing]"] <= bounds["f_n_high [packing]"] + 1e-7)
    assert json.loads(run("intervals", *words, "--json")[1])["cached"] is True
    # A subset gives the same bounds for what was asked.
    part = tmp_path / "part.csv"
    run("intervals", *words, "--contacts", f"{bounds['contact'][3]:.0f}", "--out", part)
    one = pd.read_csv(part)["f_n_high [packing]"].item()
    assert one == pytest.approx(bounds["f_n_high [packing]"][3], rel=1e-7)


def test_what_is_known_can_be_what_intervals_wrote(run, tmp_path):
    words = ["intervals", *SMALL[:4], "--json"]
    bounds, known, after = (tmp_path / f"{name}.csv" for name in ("bounds", "known", "after"))
    free = json.loads(run(*words, "--out", bounds)[1])
    # The bounds of all contacts, of which three have become half as wide.
    table, most = pd.read_csv(bounds), "f_n_high [packing]"
    middle = 0.5 * (table["f_n_low [packing]"] + table[most])
    table.loc[[2, 9, 20], most] = middle[[2, 9, 20]]
    table.to_csv(known, index=False)
    code, out, _ = run(*words, "--known", known, "--out", after)
    report = json.loads(out)
    assert code == 0 and report["largest_duality_gap"] <= 1e-8
    assert report["mean_extent_of_f_n [packing]"] < free["mean_extent_of_f_n [packing]"]
    assert np.all(pd.read_csv(after)[most] <= table[most] + 1e-7)
    assert json.loads(run(*words, "--known", known)[1])["cached"] is True
    name = "mean_extent_of_f_n [packing]"
    assert json.loads(run(*words)[1])[name] == free[name]


def test_forces_known_exactly_and_contradictions(run, tmp_path):
    known = tmp_path / "known.csv"
    known.write_text("contact;f_n;f_t\n0;1000;\n")
    code, out, err = run("intervals", *SMALL[:4], "--known", known)
    assert code == 2 and not out
    assert "these conflict: f_n = 1000 on contact 0 (must be relaxed by" in err
    known.write_text("contact,f_n\n0,1\n0.5,1\n")
    assert "known.csv, line 3" in run("intervals", *SMALL[:4], "--known", known)[2]


def test_prescribed_stress_is_kept_by_every_command(run):
    stress = ["--prescribe", "stress", "--json"]
    free = json.loads(run("intervals", *SMALL[:4], "--json")[1])
    bound = json.loads(run("intervals", *SMALL[:4], *stress)[1])
    assert bound["dimension"] == free["dimension"] - 2
    drawn = json.loads(run("uniform", *SMALL[:4], "--states", 16, *stress)[1])
    assert drawn["dimension"] == bound["dimension"] and drawn["largest_residual"] < 1e-10
    assert json.loads(run("walk", *SMALL, *stress)[1])["largest_residual"] < 1e-10
    loads = json.loads(run("limit-loads", *SMALL[:4], *stress)[1])
    pushed = json.loads(run("perturb", *SMALL[:4], "--random", 2, *stress)[1])
    assert loads["largest_duality_gap"] <= 1e-8
    assert pushed["mean_critical_force [packing]"] <= pushed["mean_limit_load [packing]"]


def test_the_outline_of_stresses(run, tmp_path):
    table = tmp_path / "stress.csv"
    words = ["stress", *SMALL[:4], "--angles", 8, "--json"]
    report = json.loads(run(*words, "--out", table)[1])
    assert report["own_shear_over_pressure"] <= report["largest_shear_over_pressure"]
    assert report["largest_shear_over_pressure"] <= report["certainly_not_above"]
    rows = pd.read_csv(table)
    assert len(rows) == 8 and rows["largest [pressure]"].max() <= report["certainly_not_above"]
    assert json.loads(run(*words)[1])["cached"] is True


def test_the_volume_and_its_error(run):
    words = ["volume", *SMALL[:4], "--accuracy", 0.2, "--json"]
    report = json.loads(run(*words)[1])
    assert report["reached"] and 0 < report["ln_volume_error"] <= 0.2
    both = report["ln_volume_on_the_way_down"], report["ln_volume_on_the_way_up"]
    assert report["ln_volume"] == pytest.approx(np.mean(both))
    assert json.loads(run(*words, "--workers", 1)[1])["cached"] is True
    assert run("volume", *SMALL[:4], "--accuracy", 0)[0] == 2


def test_a_frozen_frame_determines_more(run):
    words = ["intervals", "-n", "60", "--mu", "0.3", "--json"]
    free = json.loads(run(*words)[1])
    held = json.loads(run(*words, "--slice", "0.1,0.9,0.1,0.9")[1])
    assert held["contacts"] < free["contacts"]
    assert held["dimension"] < free["dimension"]
    assert free["undetermined_clusters"] == 1


def test_perturbation_of_chosen_contacts(run, tmp_path):
    table = tmp_path / "contacts.csv"
    words = ["perturb", *SMALL[:4], "--json", "--out", table]
    code, out, _ = run(*words, "--random", 3)
    assert code == 0
    report = json.loads(out)
    assert report["contacts"] == 3
    assert 0 <= report["mean_critical_force [packing]"] <= report["mean_limit_load [packing]"]
    rows = pd.read_csv(table)
    assert np.all(rows["critical_low [packing]"] <= rows["limit_load [packing]"])
    chosen = ",".join(str(int(c)) for c in rows["contact"])
    again = json.loads(run(*words, "--contacts", chosen)[1])
    assert again["mean_critical_force [packing]"] == report["mean_critical_force [packing]"]
    code, _, err = run(*words, "--contacts", "9999")
    assert code == 2
    assert len(err.splitlines()[-1:]) == 1 and "9999" in err


def test_limit_loads_of_chosen_contacts(run, tmp_path):
    bounds = tmp_path / "loads.csv"
    words = ["limit-loads", *SMALL[:4], "--json", "--out", bounds]
    report = json.loads(run(*words)[1])
    assert report["least_limit_load [packing]"] >= 0
    assert report["largest_duality_gap"] <= 1e-8
    assert bounds.read_text().startswith("contact,i,j,x,y,n_x,n_y,wall,limit_load [packing]\n")


def test_rest_tells_whether_the_forces_themselves_balance(run):
    """From forces out of balance grains come to rest elsewhere, at those of a network."""
    packing = packed(30, 0.3)
    wrong = packing.forces.copy()
    wrong[3] *= 1.5
    for forces, balanced in ((packing.forces, True), (wrong, False)):
        save_packing(packing._replace(forces=forces), "p.npz")
        code, out, _ = run("rest", "p.npz", "--json")
        report = json.loads(out)
        assert code == 0 and report["at_rest"] == balanced
        assert (report["residual"] < 1e-9) == balanced == (report["distance_to_rest"] < 1e-9)
        assert balanced or f"of {report['residual']:.2g} ⟨f_n⟩; grains come" in report["reason"]


def test_import_keeps_what_was_read(run, tmp_path):
    folder = Path(__file__).parents[1] / "lammps"
    dumps = [folder / f"lammps_n400_mu0.3.{kind}.dump" for kind in ("particles", "contacts")]
    file = tmp_path / "p.npz"
    code, out, _ = run("import", "lammps", *dumps, "--mu", 0.3, "--out", file, "--json")
    report = json.loads(out)
    assert code == 0
    assert report["grains"] == 400
    assert report["residual"] < 1e-9
    assert report["violation"] < 1e-9
    words = ["intervals", file, "--contacts", "0,1,2", "--json"]
    found = json.loads(run(*words)[1])
    assert found["contacts"] == 3
    # The elastic network is one point of S: inside every exact interval.
    assert sum(found["position_of_f_n_in_tenths"]) == 3


def test_cache_commands(run):
    run("walk", *SMALL)
    entries = json.loads(run("cache", "list", "--json")[1])
    assert sorted(entry["kind"] for entry in entries) == ["packing", "walk"]
    assert json.loads(run("cache", "size", "--json")[1])["bytes"] > 1000
    assert run("cache", "verify")[0] == 0
    assert json.loads(run("cache", "clear", "--kind", "walk", "--json", "--yes")[1])["removed"] == 1
    assert len(json.loads(run("cache", "list", "--json")[1])) == 1
    assert json.loads(run("cache", "verify", "--kind", "frame", "--json")[1]) == []
    for kind in ("wlk", "", "*"):
        code, out, err = run("cache", "verify", "--kind", kind)
        assert (code, out, err.count("\n")) == (2, "", 1) and "choose one of packing, walk" in err


def test_clear_asks_in_a_terminal_and_needs_yes_in_scripts(run, away, monkeypatch):
    run("pack", "-n", "8", "--mu", "0.3")

    class Terminal(io.StringIO):
        def isatty(self):
            return True

    code, out, err = run("cache", "clear")
    assert (code, out, err.count("\n")) == (2, "", 1) and "remove 1 result: add --yes" in err
    for answer, removed in (("", False), ("n\n", False), ("y\n", True)):
        monkeypatch.setattr("sys.stdin", Terminal(answer))
        code, out, err = run("cache", "clear")
        assert code == 0 and "Remove 1 result (" in err and str(away / "cache") in err
        assert (
            ("removed" in out) == removed == (json.loads(run("cache", "list", "--json")[1]) == [])
        )


def test_built_documentation_and_kernels_are_measured_and_removed(run, away, monkeypatch):
    monkeypatch.setattr(service.platformdirs, "user_cache_path", lambda name: away / name)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(away / "numba"))
    monkeypatch.setattr(compiled, "__file__", str(away / "granforce" / "system" / "compiled.py"))
    package = away / "granforce"
    name = _CacheLocator.get_suitable_cache_subpath(str(package / "__init__.py"))
    kernels = [package / "__pycache__" / "a.nbi", away / "numba" / name / "b.nbc"]
    others = [package / "__init__.py", away / "numba" / "other" / "c.nbc"]
    site = away / "granforce-docs" / "site" / "index.html"
    for file in (*kernels, *others, site):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("12345")
    run("pack", "-n", "8", "--mu", "0.3")
    sizes = json.loads(run("cache", "size", "--json")[1])
    assert (sizes["documentation_bytes"], sizes["kernels_bytes"]) == (5, 10)
    for kind, removed, kept in (
        ("kernels", kernels, [*others, site]),
        ("documentation", [site], others),
    ):
        code, _, err = run("cache", "clear", "--kind", kind)
        assert code == 2 and err.count("\n") == 1 and "--yes" in err
        assert json.loads(run("cache", "size", "--kind", kind, "--json")[1])["files"] == len(
            removed
        )
        assert run("cache", "clear", "--kind", kind, "--yes")[0] == 0
        assert not any(map(Path.exists, removed)) and all(map(Path.exists, kept))
    assert len(json.loads(run("cache", "list", "--json")[1])) == 1
    assert "no effect" in run("cache", "size", "--kind", "kernels", "--cache", "s")[2]


@pytest.mark.parametrize("action", ["list", "size", "verify", "clear"])
def test_cache_commands_make_no_store(run, tmp_path, action):
    code, out, err = run("cache", action, "--cache", tmp_path / "typo")
    assert (code, out, err.count("\n")) == (2, "", 1) and "there is no store at" in err
    assert not (tmp_path / "typo").exists()


@pytest.mark.parametrize("action", ["list", "size", "verify", "clear", "path"])
def test_cache_commands_refuse_a_store_of_a_newer_schema(run, tmp_path, action):
    root = {"zarr_format": 3, "node_type": "group", "attributes": {"granforce_store": 1000}}
    (tmp_path / "zarr.json").write_text(json.dumps(root))
    code, out, err = run("cache", action, "--cache", tmp_path)
    assert (code, out, err.count("\n")) == (2, "", 1) and "made by a newer granforce" in err


def test_a_file_in_the_place_of_a_result_is_told_before_anything_is_computed(run, tmp_path):
    run("walk", *SMALL, "--cache", tmp_path / "s")
    (entry,) = (tmp_path / "s").glob("walk-*")
    open_store(tmp_path / "s").clear()
    entry.write_text("")
    code, out, err = run("walk", *SMALL, "--cache", tmp_path / "s")
    assert (code, out) == (2, "") and f"{entry} is a file" in err.splitlines()[-1]
    assert not list((tmp_path / "s").glob("packing-*"))
    assert run("cache", "verify", "--cache", tmp_path / "s")[0] == 1


@pytest.mark.parametrize(
    "words, what",
    [
        (["pack"], "--mu"),
        (["pack", "--mu", "-1"], "--mu must be finite"),
        (["pack", "--mu", "nan"], "--mu must be finite"),
        (["pack", "--mu", "0.1", "-n", "1"], "at least 3 disks"),
        (["pack", "--mu", "0.1", "--radii", "no-such-file"], "no-such-file"),
        (["pack", "--mu", "0.1", "--radii", "uniform:2,1"], "radii"),
        (["pack", "-n", "40", "--mu", "0.3", "--max-steps", "100"], "not jammed"),
        (["walk", "no-such-file.npz"], "no-such-file.npz"),
        (["intervals", "-n", "20", "--mu", "0.3", "--contacts", "0,999"], "contact 999"),
        (["intervals", "-n", "20", "--mu", "0.3", "--contacts", "a"], "--contacts"),
        (["intervals", "-n", "20", "--mu", "0.3", "--slice", "0.5,0.2,0,1"], "slice"),
        (["limit-loads", "-n", "20", "--mu", "0.3", "--slice", "0,1"], "four numbers"),
        (["import", "lammps", "no-such.dump", "nor-this.dump", "--mu", "0.3"], "no-such.dump"),
        (["import", "table", "no-such.csv", "--mu", "-1"], ""),
        (["walk", "--mu", "0.1", "--states", "0"], "states"),
        (["scan", "--mu", "0.1;1"], "--mu"),
        (["scan", "--mu", "0.1", "--seeds", "0"], "--seeds"),
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
    code, out, err = run(*words)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1 and err.startswith("granforce: ")
    assert "see granforce" in err and "--help" in err


def test_interrupt_ends_quietly_and_keeps_what_is_finished(tmp_path):
    words = ["scan", "--mu", "0.3", "--seeds", "400", "-n", "20", "--states", "40"]
    words += ["--out", str(tmp_path / "s.zarr")]
    running = heeding("-m", "granforce.cli", *words, start_new_session=True)
    until_it_left(tmp_path / "s.zarr", "walk-*", 1, running)
    interrupted(running)


# A scan whose compiler holds the main thread, as LLVM does, in a call that does not end.
LONG_COMPILATION = """
import ctypes
from granforce.cli import command
from granforce.study import scan

def warm_up(needed):
    print("begun", flush=True)
    ctypes.CDLL(None).sleep(600)

scan.warm_up = warm_up
command()
"""


def test_an_interrupt_does_not_wait_for_the_compiler_and_says_what_is_saved(tmp_path):
    words = ["scan", "--mu", "0.3", "--seeds", "3", "-n", "20", "--out", str(tmp_path / "s.zarr")]
    running = heeding("-c", LONG_COMPILATION, *words)
    assert running.stdout.readline() == "begun\n"
    running.send_signal(signal.SIGINT)
    _, err = running.communicate(timeout=60)
    assert running.returncode == 130
    last = "granforce: interrupted; saved 0 of 3 cells; run the same command again to continue"
    assert err.splitlines()[-1] == last


def swallowed(arguments):
    """A command during which Ctrl-C is lost, as in an import; then it computes."""
    with contextlib.suppress(KeyboardInterrupt):
        os.kill(os.getpid(), signal.SIGINT)
    gf.pack(40, 0.3, 0, sweeps=10**9, accuracy=1e-300)


def altered(arguments):
    """A command during which a library makes another error of Ctrl-C."""
    try:
        os.kill(os.getpid(), signal.SIGINT)
    except KeyboardInterrupt:
        raise ImportError("could not import module datetime") from None


@pytest.mark.parametrize("command", [swallowed, altered])
def test_an_interrupt_that_a_library_swallows_ends_the_command(command, monkeypatch, capsys):
    heed()
    monkeypatch.setattr(commands, "pack", command)
    assert main(["pack"]) == 130
    assert capsys.readouterr().err.splitlines()[-1] == "granforce: interrupted"
    assert not interrupts.interrupted()  # the next command begins anew


# The command `verify` in a process where Ctrl-C comes while Zarr makes its event loop.
ZARR_INTERRUPTED = """
import asyncio, os, signal
from zarr.core import sync
from granforce.cli import command
from granforce.study import store

class Loop(asyncio.SelectorEventLoop):
    def _make_self_pipe(self):
        os.kill(os.getpid(), signal.SIGINT)
        super()._make_self_pipe()

asyncio.new_event_loop = Loop
command()
"""


def test_an_interrupt_within_zarr_leaves_no_message_of_it(run):
    run("pack", "-n", "20", "--mu", "0.3")
    running = heeding("-c", ZARR_INTERRUPTED, "cache", "verify")
    _, err = running.communicate(timeout=60)
    assert (running.returncode, err) == (130, "granforce: interrupted\n")


# A program that HiGHS works on for minutes, as the command `pack`.
LONG_PROGRAM = """
import numpy as np
import pandas as pd
from scipy import sparse
from granforce.cli import command, commands
from granforce.numerics import highs

def solve(arguments):
    rng = np.random.default_rng(0)
    A = sparse.csr_matrix(rng.normal(size=(1000, 2000)))
    model = highs.standard_form(A, A @ rng.random(2000))
    highs.set_cost(model, rng.random(2000))
    print("begun", flush=True)
    with highs.cancelling.scope():
        highs.solve(model)

commands.pack = solve
command()
"""


def test_a_call_that_is_left_behind_does_not_abort_the_process():
    """C++ that returns to an interpreter that has ended does; so the process ends before it."""
    running = heeding("-c", LONG_PROGRAM, "pack")
    assert running.stdout.readline() == "begun\n"
    until_it_computes(running)  # within the solver
    running.send_signal(signal.SIGINT)
    _, err = running.communicate(timeout=60)
    assert (running.returncode, err) == (130, "granforce: interrupted\n")


@pytest.mark.parametrize("words", [[], ["--use-xheaders"]])
def test_the_app_reads_addresses_of_a_proxy_only_if_asked(words, monkeypatch):
    served = []
    monkeypatch.setattr("runpy.run_module", lambda *args, **_: served.append(sys.argv))
    monkeypatch.setattr(sys, "argv", ["granforce"])
    assert main(["app", "--no-show", "--port", "0", *words]) == 0
    assert ("--use-xheaders" in served[0]) == bool(words)


@pytest.mark.parametrize(
    "address, root",
    [
        ("app.example.org", "http://app.example.org:5006"),
        ("::1", "http://[::1]:5006"),
        ("0.0.0.0", "http://localhost:5006"),
    ],
)
def test_a_page_is_opened_at_the_address_of_its_server(address, root, monkeypatch):
    asked = []
    monkeypatch.setattr(
        "urllib.request.urlopen", lambda url, **_: contextlib.nullcontext(asked.append(url))
    )
    page = viewer.page_at(address, 5006)
    assert page == f"{root}/app"
    assert viewer.wait_for_server(f"{page}?packing=1") and asked == [f"{root}/health"]


@pytest.mark.parametrize("options", ["", "--box isotropic --pressure 2", "--radii r.txt"])
def test_a_packing_in_a_file_has_the_results_of_the_options_that_made_it(run, options):
    Path("r.txt").write_text("\n".join(map(str, np.linspace(0.3, 0.7, 12))))
    made = f"-n 12 --mu 0.3 --seed 2 {options}".split()
    assert run("pack", *made, "--out", "p.npz")[0] == 0
    assert json.loads(run("intervals", "p.npz", "--json")[1])["cached"] is False
    for words in (made, ["p.npz"]):
        assert json.loads(run("intervals", *words, "--json")[1])["cached"] is True
    packing = gf.load_packing("p.npz")
    save_packing(packing._replace(forces=2 * packing.forces), "other.npz")
    assert json.loads(run("intervals", "other.npz", "--json")[1])["cached"] is False


def test_too_many_open_files_are_told_in_a_line(run, monkeypatch):
    def scan(arguments):
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(commands, "scan", scan)
    code, out, err = run("scan", "--mu", "0.3")
    assert (code, out, err.count("\n")) == (2, "", 1) and "too many open files; use fewer" in err


@pytest.mark.parametrize("port", ["5060", "6000", "10080"])
def test_a_port_that_browsers_refuse_is_refused_in_a_line(port, capsys):
    assert main(["app", "--no-show", "--port", port]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and f"browsers open no page at port {port}" in err


def test_a_login_needs_a_secret_that_signs_its_cookies(away, capsys, monkeypatch):
    (away / "users.json").write_text('{"ann": "x"}')
    monkeypatch.delenv("PANEL_COOKIE_SECRET", raising=False)
    words = ["app", "--no-show", "--port", "0", "--basic-auth", "users.json"]
    assert main(words) == 2 and "--cookie-secret" in capsys.readouterr().err
    monkeypatch.setattr(sys, "argv", list(sys.argv))
    monkeypatch.setattr("runpy.run_module", lambda *_, **__: None)
    main([*words, "--cookie-secret", "s"])
    assert sys.argv[-6:-2] == ["--basic-auth", "users.json", "--cookie-secret", "s"]
