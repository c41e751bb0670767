"""Over the whole parser: every option is used or refused, no output replaces what is read."""

import argparse
import ast
import json
import os
import re
import shlex
import shutil
from pathlib import Path
from types import SimpleNamespace

import frames
import numpy as np
import pytest
from packings import packed

from granforce.cli import command_table, commands, entry_point, option_table, parser
from granforce.cli import frames as series_of_frames
from granforce.cli.path_roles import ROLES, Input, Output, Series, StorePath, Workplace
from granforce.forces.build import ensemble
from granforce.packing.exporters import save_lammps
from granforce.packing.importers import load_packing, read_table, save_packing
from granforce.packing.importers.snapshots import Snapshot, Snapshots
from granforce.packing.scenes import scene
from granforce.records import InputError
from granforce.study.store import open_store

MU = "-n 8 --mu 0.3"
FRAMES = "positions.txt adjacency.txt"

# Command lines, one at least for each way of calling a command, as its parser knows them.
LINES = {
    "pack": [MU, "--scene groove --mu 0.5"],
    "walk": [f"{MU} --states 3", "p.npz --states 3 --out walk.csv"],
    "measure": [f"{MU} --states 3", "p.npz --states 3"],
    "uniform": [f"{MU} --states 8", "p.npz --states 8 --out states.csv"],
    "volume": [f"{MU} --accuracy 0.5", "p.npz --accuracy 0.5"],
    "infer": [
        f"{MU} --measured m.csv --states 8",
        f"{MU} --measured m.csv --states 0",
        f"{MU} --measured m.csv --states 0 --certain",
        "p.npz --measured m.csv --states 8",
        "p.npz --pressures g.csv --pressure-column G2 --calibration 1,0,0.1 --states 0",
        f"{FRAMES} --frames all --mu 0.3 --states 4 --workers 1 --strict",
    ],
    "informative": [f"{MU} --states 8", "p.npz --states 8"],
    "scan": [
        "-n 8 --mu 0.3 --states 3",
        "-n 8 --mu 0.3 --states 3 --out scan.zarr",
        "-n 8 --mu 0.3 --states 3 --out scan.csv",
    ],
    "intervals": [MU, "p.npz", f"{MU} --slice 0,0.9,0,0.9"],
    "limit-loads": [MU, "p.npz", f"{MU} --slice 0,0.9,0,0.9"],
    "load-factor": [
        "blocks.npz --load horizontal",
        "blocks.npz --load horizontal --critical --precision 0.01",
    ],
    "rest": ["p.npz", "p.npz --ensemble-mu 0.2"],
    "stress": [f"{MU} --angles 4", "p.npz --angles 4"],
    "perturb": [
        f"{MU} --random 1",
        "p.npz --random 1",
        f"{MU} --all",
        f"{MU} --contacts 1",
    ],
    "plot": ["p.npz --out p.png", "p.npz --out p.png --states states.npz --state 0"],
    "figures": ["done/cells.zarr --out figure1.pdf"],
    "study": [
        "--quick",
        "--quick --status --out done",
        "--quick --reduce done/cells.zarr --out here",
        "--table table.zarr --out here",
    ],
    "app": ["", "--basic-auth users.json --cookie-secret signs"],
    "docs": ["--out reference.html"],
    "completion": ["bash"],
    "import lammps": [
        "particles.dump contacts.dump --mu 0.5",
        "particles.dump contacts.dump --mu 0.5 --frames all --workers 1",
        "particles.dump contacts.dump --mu 0.5 --frames all --states 2 --workers 1",
    ],
    "import yade": ["bodies.txt interactions.txt --mu 0.5"],
    "import mercury": [
        "run.data run.fstat --mu 0.5",
        "run.data run.fstat --mu 0.5 --frames 0 --workers 1",
        "run.data run.fstat --mu 0.5 --frames 0 --states 2 --workers 1",
    ],
    "import table": ["grains.csv --mu 0.3", "grains.csv contacts.csv --mu 0.3"],
    "import blocks": ["bodies.csv --mu 0.5"],
    "import pegs": [f"{FRAMES} --mu 0.3", f"{FRAMES} --mu 0.3 --strict"],
    "export": ["p.npz g.vtp c.vtp"],
    "bench": [
        "--quick",
        "--documents bench.md --table bench.json",
        "--table bench.json --out done",
    ],
    "cache": ["list", "size", "verify", "clear --yes", "path", "size --kind kernels"],
}


def parsers(of=None, words=()):
    """(words, parser) of every command, and of every format of `import`."""
    of = parser.make_parser() if of is None else of
    inner = [a for a in of._actions if isinstance(a, argparse._SubParsersAction)]
    if not inner:
        yield " ".join(words), of
    for action in inner:
        for name, one in action.choices.items():
            if one.prog.endswith(f" {name}"):  # not a former name
                yield from parsers(one, (*words, name))


PARSERS = dict(parsers())
CASES = [(command, line) for command, lines in LINES.items() for line in lines]


class Recording(argparse.Namespace):
    """Arguments that note which of them a command reads."""

    def __getattribute__(self, name):
        values = object.__getattribute__(self, "__dict__")
        # Handed on by name as a whole: a reader refuses what it does not know (test_import.py).
        values["_read"] |= values.keys() if name == "__dict__" else {name}
        return object.__getattribute__(self, name)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the files that the command lines name, and a store of its own."""
    folder = tmp_path_factory.mktemp("place")
    save_packing(packed(8, 0.3), folder / "p.npz")
    save_packing(scene("slope"), folder / "blocks.npz")
    (folder / "users.json").write_text('{"ann": "word"}')
    (folder / "g.csv").write_text("grain,G2\n0,1\n")
    (folder / "m.csv").write_text("contact,f_n,f_t,sigma_n,sigma_t\n0,1,0,0.1,0.1\n")
    (folder / "grains.csv").write_text("x,y,r\n0,0,1\n2,0,1\n")
    (folder / "bodies.csv").write_text("body,x,y\n")
    S = ensemble(packed(8, 0.3))
    ends = {"i": S.contacts.i, "j": S.contacts.j, "contact": S.index}
    np.savez(folder / "states.npz", **ends, **{"states [packing]": S.original[None]})
    (folder / "r.txt").write_text("1\n" * 8)
    (folder / "known.csv").write_text("contact,f_n_low\n0,0\n")
    grains, rows, _ = frames.frame(40, missing=0.1, noise=0.1)
    frames.write(folder, grains, rows)
    open_store(folder / "done" / "cells.zarr").make()
    (folder / "bench.md").write_text("<!-- bench: frames -->\n<!-- end -->\n")
    rows = [{"solver": "nearest", "mu": 0.1, "n": n, "seconds": 1.0} for n in (1, 2, 3)]
    results = {"environment": {"libraries": {}}, "scaling": rows}
    (folder / "bench.json").write_text(json.dumps(results))
    return folder


@pytest.fixture
def here(place, monkeypatch):
    monkeypatch.chdir(place)
    monkeypatch.setenv("GRANFORCE_CACHE", str(place / "cache"))
    # What opens a page, and what computes for minutes; what they are given is read before.
    monkeypatch.setattr(commands.service.runpy, "run_module", lambda *args, **kwargs: None)
    monkeypatch.setattr("granforce.bench.main", lambda *args: None)
    monkeypatch.setattr(commands.service, "_build_docs", lambda folder: None)
    monkeypatch.setattr(commands.states.scans, "scan", lambda *args, **kwargs: ([], []))
    monkeypatch.setattr("granforce.figures.indeterminacy", lambda *args, **kwargs: None)
    monkeypatch.setattr("granforce.figures.save", lambda *args: None)
    reduced = SimpleNamespace(skipped={"missing_cells": 0})
    for name, value in {
        "plans.compute": [],
        "plans.remaining": [],
        "tables.reduce": reduced,
        "tables.load": reduced,
        "tables.merged": reduced,
        "tables.save": None,
        "drawings.draw": None,
        "csv_tables.save": None,
        "claims.judge": [],
        "findings.all_findings": [],
    }.items():
        monkeypatch.setattr(f"granforce.paper.main.{name}", lambda *a, value=value, **k: value)
    for name in commands.packings.READERS:
        monkeypatch.setitem(
            commands.packings.READERS, name, lambda *files, **options: load_packing("p.npz")
        )
    one = Snapshot(load_packing("p.npz"), np.arange(8.0))
    for name in commands.packings.OPENERS:
        opened = Snapshots("step", [0], lambda number: one)
        monkeypatch.setitem(commands.packings.OPENERS, name, lambda *f, o=opened, **_: o)
    return place


def parsed(command, line):
    words = [*command.split(), *shlex.split(line)]
    return parser.make_parser().parse_args(words)


def test_every_command_and_every_way_has_a_line():
    assert LINES.keys() == PARSERS.keys()
    for command, one in PARSERS.items():
        given = [parsed(command, line) for line in LINES[command]]
        for way in one.unused:
            held = {bool(way.holds(arguments)) for arguments in given}
            assert held == {True, False}, (command, way.words)
            assert way.names <= one.options.keys(), (command, way.words)


def test_every_option_of_the_table_belongs_to_a_command():
    commands_and_formats = [*command_table.COMMANDS, *command_table.FORMATS]
    keys = set()
    for command in commands_and_formats:
        for part in command.parts:
            grouped = isinstance(part, command_table.Group)
            keys.update(option.key for option in (part.one_of + part.options if grouped else part))
    assert keys == option_table.OPTIONS.keys()


@pytest.mark.parametrize("command, line", CASES)
def test_every_option_is_read_or_refused(command, line, here):
    arguments = parsed(command, line)
    one = PARSERS[command]
    left_out = {name for way in one.unused if way.holds(arguments) for name in way.names}
    recording = Recording(**vars(arguments), _read=set())
    getattr(commands, arguments.run)(recording)
    read = recording._read
    assert one.options.keys() - read - left_out == set()


def _typed(action):
    """Words that give an option a value which its type takes."""
    word = str(action.choices[0]) if action.choices else "1"
    return [action.option_strings[-1], *([word] * (1 if action.nargs is None else action.nargs))]


WAYS = [
    (command, line, way.words)
    for command, line in CASES
    for way in PARSERS[command].unused
    if way.holds(parsed(command, line))
]


@pytest.mark.parametrize("command, line, said", WAYS)
def test_what_is_not_used_is_refused(command, line, said, capsys):
    one = PARSERS[command]
    (way,) = (way for way in one.unused if way.words == said)
    for action in one._actions:
        if action.dest in way.names and action.option_strings:
            words = [*command.split(), *shlex.split(line), *_typed(action)]
            with pytest.raises(SystemExit) as stop:
                entry_point.main(words)
            told = capsys.readouterr()
            assert stop.value.code == 2 and told.out == "" and told.err.count("\n") == 1
            # Another way may come first: two options of which only one may be given, say.
            assert "no effect" in told.err or "not allowed with" in told.err


def test_a_second_packing_is_refused(here, capsys):
    assert entry_point.main(["infer", "p.npz", "blocks.npz", "--measured", "m.csv"]) == 2
    assert "give one packing file" in capsys.readouterr().err


def test_messages_that_name_an_argument_name_its_option_too():
    names = {action.dest for command in PARSERS.values() for action in command._actions}
    library = Path(parser.__file__).parents[1]
    wrong = []
    for path in (*library.glob("packing/**/*.py"), *library.glob("experiment/*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Raise) and node.exc is not None:
                text = ast.unparse(node.exc)
                named = set(re.findall(r"\b(\w+)=(?=[,)…; ])", text)) & names
                wrong += [(path.name, name) for name in named if f"--{name}" not in text]
    assert wrong == []


def _takes_numbers(action):
    """Whether an option takes words that may begin with a minus."""
    return action.option_strings and action.nargs is None and not action.choices


@pytest.mark.parametrize("command", PARSERS)
def test_values_that_begin_with_a_minus_need_no_equals_sign(command):
    one = PARSERS[command]
    lists = [action for action in one._actions if _takes_numbers(action) and action.type is str]
    for action in lists:
        for value in ("-0.1,1,0", "-.5,-1e-3", "-2"):
            typed = action.option_strings[-1]
            given = [shlex.split(line) for line in LINES[command]]
            words = next((line for line in given if typed in line), given[0])
            if typed in words:  # perhaps required: the value replaces the one there
                del words[words.index(typed) : words.index(typed) + 2]
            one.seen.clear()
            found = argparse.ArgumentParser.parse_known_args(one, [*words, typed, value])[0]
            assert getattr(found, action.dest) in (value, [value])


@pytest.mark.parametrize(
    "line",
    [
        "intervals -n 8 --mu 0.3 --contacts 3,0,3",
        "scan --mu 0.3,0.30",
        "study --mu 0.1,0.1 --out s",
    ],
)
def test_a_case_given_twice_is_refused(line, here, capsys):
    assert entry_point.main(line.split()) == 2
    assert "is given twice; give it once" in capsys.readouterr().err


def test_a_frame_given_twice_is_refused():
    assert series_of_frames._chosen([1, 2, 3], "3,1") == [1, 3]
    with pytest.raises(InputError, match="given twice"):
        series_of_frames._chosen([1, 2], "1,1")


def test_a_sign_that_changes_nothing_is_refused(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("two.csv").write_text("x,y,r\n0,0,1\n2,0,1\n")
    Path("pair.csv").write_text("i,j,f_n,f_t\n0,1,1,0\n")
    line = "import table two.csv pair.csv --mu 0.3 --reverse --out new.npz"
    assert entry_point.main(line.split()) == 2
    assert "every tangential force is 0" in capsys.readouterr().err
    assert not (tmp_path / "new.npz").exists()
    with pytest.raises(InputError, match="leave it out"):
        read_table("two.csv", "pair.csv", mu=0.3, reverse=True)
    save_lammps(packed(20, 0.0), "grains.dump", "contacts.dump")
    for many in ("", " --frames all --cache store --out all.zarr"):
        line = f"import lammps grains.dump contacts.dump --mu 0 --reverse{many}"
        assert entry_point.main(line.split()) == 2
        assert "every tangential force is 0" in capsys.readouterr().err
    assert not (tmp_path / "all.zarr").exists()


def test_the_suffix_of_a_scan_decides_between_table_and_store(here, capsys, monkeypatch):
    counts = dict.fromkeys(("rejected", "unconverged", "skipped", "dimension"), 3)
    reals = dict.fromkeys(("packing_fraction", "coordination", "eta1", "eta2", "eta3"), 0.25)
    rows = [{"mu": 0.5, "seed": 1, **reals, "acceptance": 1.0, **counts, "cached": False}]
    paths = []

    def scan(path, *args, **kwargs):
        paths.append(path)
        return rows, []

    monkeypatch.setattr(commands.states.scans, "scan", scan)
    line = "scan --mu 0.3 -n 8 --cache done/cells.zarr --out"
    assert entry_point.main([*line.split(), "table.csv"]) == 0
    head, line_of_table = Path("table.csv").read_text().splitlines()
    assert head == ",".join(name for name in rows[0] if name != "cached")
    assert line_of_table == "0.5,1,0.25,0.25,0.25,0.25,0.25,1,3,3,3,3"
    assert paths == [here / "done" / "cells.zarr"]
    with pytest.raises(SystemExit):
        entry_point.main([*line.split(), "other.zarr"])
    assert "--cache has no effect with --out FOLDER.zarr" in capsys.readouterr().err
    assert entry_point.main("scan --mu 0.3 --out table.txt".split()) == 2
    assert "the name must end with .csv or .zarr" in capsys.readouterr().err
    assert not Path("table.txt").exists()


def test_a_default_that_is_typed_counts_as_given(capsys):
    with pytest.raises(SystemExit):
        entry_point.main(["walk", "p.npz", "--seed", "1"])
    assert "--seed has no effect with the file of a packing" in capsys.readouterr().err


def test_every_option_says_what_its_words_are():
    """A path is an input, an output, a store …; `str` is for words that name none."""
    for command, one in PARSERS.items():
        for action in one._actions:
            takes_words = action.nargs != 0 and not action.choices
            assert not takes_words or action.type is not None, (command, action.dest)
            names_path = any(
                word in str(action.metavar) for word in ("FILE", "FOLDER", "STORE")
            ) or action.dest in ("grains", "files", "out", "csv", "cache")
            assert action.type in ROLES or not names_path, (command, action.dest)


def _of_role(one, *roles):
    return [action for action in one._actions if action.type in roles]


def _clashes():
    """(command, words) in which an output is an input, another output, or inside the store."""
    for command, one in PARSERS.items():
        outputs = _of_role(one, Output, Workplace)
        others = [*outputs, *_of_role(one, Input, Series, StorePath)]
        for out in outputs:
            for other in others:
                if other is not out:
                    yield command, out, other


@pytest.mark.parametrize("alias", ["same", "symbolic", "hard"])
def test_no_output_is_an_input_or_another_output(alias, tmp_path, monkeypatch, capsys):
    """All pairs of paths of all commands, each under another name of the same file."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GRANFORCE_CACHE", str(tmp_path / "cache"))
    tried = 0
    Path("nowhere").touch()  # an input that is there
    for command, out, other in _clashes():
        name, file = "data", Path("data")
        folder = Workplace in (out.type, other.type) or other.type is StorePath
        if folder and alias == "hard":
            continue
        file.mkdir() if folder else file.write_text("precious")
        twin = {"same": "./data", "symbolic": "twin", "hard": "twin"}[alias]
        if alias == "symbolic":
            os.symlink(name, twin)
        elif alias == "hard":
            os.link(name, twin)
        words = [*command.split(), *_clash_line(command, {out.dest: twin, other.dest: name})]
        before = sorted(Path().iterdir())
        try:
            code = entry_point.main(words)
        except SystemExit as stop:
            code = stop.code
        told = capsys.readouterr()
        assert code == 2, words
        assert "would overwrite" in told.err or "no effect" in told.err, (words, told.err)
        assert told.err.count("\n") == 1 and told.out == ""
        assert sorted(Path().iterdir()) == before
        assert folder or file.read_text() == "precious"
        for path in (Path("twin"), file):
            if path.is_symlink() or path.is_file():
                path.unlink()
            elif path.is_dir():
                shutil.rmtree(path)
        tried += "would overwrite" in told.err
    assert tried >= 20


def _clash_line(command, given):
    """Words that give these options, and what else the command has to be given."""
    one, words = PARSERS[command], []
    for action in one._actions:
        if action.dest in given:
            words += [*action.option_strings[-1:], given[action.dest]]
        elif action.required or action.dest in ("grains", "contacts"):
            words += [*action.option_strings[-1:], "0.3" if action.dest == "mu" else "nowhere"]
    if command == "infer" and ("files" in given or "out" in given):
        words += ["--frames", "all"]
    if command in ("import lammps", "import mercury") and {"csv", "cache"} & given.keys():
        words += ["--frames", "all"]
    return words


def test_outputs_keep_off_the_store_and_what_is_inside_a_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GRANFORCE_CACHE", str(tmp_path / "cache"))
    names = ("positions.txt", "adjacency.txt")
    for folder in ("cache", "frames.zarr", "done/cells.zarr", "done/study.zarr"):
        (tmp_path / folder).mkdir(parents=True)
    for name in ("r.txt", *names, *(f"frames.zarr/{name}" for name in names)):
        (tmp_path / name).touch()
    before = sorted(tmp_path.rglob("*"))
    for words in (
        "intervals -n 8 --mu 0.3 --out cache/zarr.json",
        "pack -n 8 --mu 0.3 --cache kept --out kept/packing.npz",
        "infer frames.zarr/positions.txt frames.zarr/adjacency.txt --frames all --out frames.zarr",
        "infer positions.txt adjacency.txt --frames all --out cache",
        "study --reduce done/cells.zarr --table done/study.zarr --out done",
        "pack -n 8 --mu 0.3 --radii r.txt --out r.txt",
        "import pegs positions.txt adjacency.txt --mu 0.3 --out new --measured ./new",
    ):
        assert entry_point.main(words.split()) == 2, words
        assert "would overwrite" in capsys.readouterr().err
    assert sorted(tmp_path.rglob("*")) == before
    # Devices may be named more than once, and nothing there can be lost.
    words = "import table /dev/null --mu 0.3 --out /dev/null"
    assert entry_point.main(words.split()) == 2
    assert "overwrite" not in capsys.readouterr().err


def test_outputs_have_a_name_and_series_that_of_a_folder(here, capsys):
    """Else an empty name is the folder one is in, and a folder stands under a file's name."""
    before = sorted(here.rglob("*"))
    for words, said in (
        (("pack", "-n", "8", "--mu", "0.3", "--out="), "--out: the name is empty"),
        (("export", "p.npz", "", "c.vtp"), "grains: the name is empty"),
        (
            "import lammps g.dump c.dump --mu 0.3 --frames all --out s.npz".split(),
            "--frames the name must end with .zarr",
        ),
    ):
        assert entry_point.main(["export", "p.npz", "g.dump", "c.dump"]) == 0
        assert entry_point.main(words) == 2
        assert said in capsys.readouterr().err
    assert {*here.rglob("*")} - {*before} == {here / "g.dump", here / "c.dump"}


def test_frames_replace_no_store(here, capsys):
    kept = sorted((here / "done").rglob("*"))
    words = f"infer {FRAMES} --frames all --mu 0.3 --out done/cells.zarr"
    assert entry_point.main(words.split()) == 2
    assert "is a store of results" in capsys.readouterr().err
    assert sorted((here / "done").rglob("*")) == kept


@pytest.mark.parametrize(
    "line",
    [
        "scan --mu 0.3 --mu 0.5 --seeds 1",
        "walk p.npz --states 3 --states 4",
        "pack -n 8 --mu 0.3 -n 8",
        "import lammps p.dump c.dump --mu 0.3 --frame 1 --frame=2",
        "cache list --cache a --cache b",
    ],
)
def test_an_option_given_twice_is_refused(line, capsys):
    with pytest.raises(SystemExit) as stop:
        entry_point.main(line.split())
    told = capsys.readouterr()
    assert stop.value.code == 2 and told.out == "" and told.err.count("\n") == 1
    assert "is given twice; give it once" in told.err


@pytest.mark.parametrize("threads", ["0", "-1", "00"])
def test_a_number_of_threads_that_numba_refuses_is_one_line(threads, here, monkeypatch, capsys):
    monkeypatch.setenv("NUMBA_NUM_THREADS", threads)
    assert entry_point.main(["cache", "list"]) == 2
    assert "NUMBA_NUM_THREADS must be at least 1" in capsys.readouterr().err


def test_a_working_folder_that_was_removed_is_one_line(here, monkeypatch, capsys):
    (here / "gone").mkdir()
    monkeypatch.chdir(here / "gone")
    (here / "gone").rmdir()
    words = ["intervals", str(here / "p.npz"), "--out", "x.csv"]
    assert entry_point.main(words) == 2
    assert "x.csv: the working folder was removed" in capsys.readouterr().err


@pytest.mark.parametrize("command, shown", [("pack", True), ("scan", True), ("walk", False)])
def test_only_commands_about_packings_explain_the_compaction(command, shown, capsys):
    with pytest.raises(SystemExit):
        entry_point.main([command, "--help"])
    said = capsys.readouterr().out
    for option in ("--dt", "--box-mass", "--sweeps", "--step-accuracy"):
        assert (f"  {option} " in said) == shown


@pytest.mark.parametrize("command", PARSERS)
def test_options_with_a_number_take_no_underscores(command):
    one = PARSERS[command]
    for action in one._actions:
        if action.type in (float, int):
            with pytest.raises(argparse.ArgumentError, match="1_5"):
                one._get_value(action, "1_5")


@pytest.mark.parametrize(
    "line",
    [
        "pack -n 4 --mu 0.3 --radii uniform:1,1_5 --out p.npz",
        "pack -n 4 --mu 0.3 --radii underscores.txt --out p.npz",
        "pack --scene groove --scene-options angle=9_0 --out p.npz",
        "perturb p.npz --contacts 1_0",
        "scan --mu 0.1,0_3 --out s.zarr",
        "study --mu 0_3",
        "study --sizes 1_00",
        "import table grains.csv --mu 0.3 --walls 0,0,1_0,0",
    ],
)
def test_lists_of_numbers_take_no_underscores(line, here, capsys):
    (here / "underscores.txt").write_text("1\n1\n1\n1_5\n")
    try:
        assert entry_point.main(line.split()) == 2
    except SystemExit as ended:
        assert ended.code == 2
    said = capsys.readouterr().err
    assert "_" in said and said.count("\n") == 1 and "unrecognized" not in said
