"""What one command writes, in every format that it offers, other commands read.

A table of all pairs: files that commands write × options that read files. Each pair works, or is
refused in one line, and nothing is written.
"""

import contextlib
import io
import os
import warnings

import frames
import numpy as np
import pytest

from granforce.cli import input_tables
from granforce.cli.entry_point import main
from granforce.cli.parser import make_parser
from granforce.cli.path_roles import Edited, Input, Output, TableOrStore, Workplace
from granforce.packing import importers

# {(command, option): (kind, command line)} of every option that writes a file, in the order in
# which they can be called. {} is the file.
WRITTEN = {
    ("pack", "out"): ("packing", "pack -n 12 --mu 0.3 --out {}"),
    ("walk", "out"): ("states", "walk pack.npz --states 3 --out {}"),
    ("uniform", "out"): ("states", "uniform pack.npz --states 9 --chains 2 --out {}"),
    ("measure", "out"): ("normal forces", "measure pack.npz --states 3 --out {}"),
    ("intervals", "out"): ("bounds", "intervals pack.npz --out {}"),
    ("limit-loads", "out"): ("loads", "limit-loads pack.npz --out {}"),
    ("stress", "out"): ("outline", "stress pack.npz --angles 8 --out {}"),
    ("perturb", "out"): ("responses", "perturb pack.npz --contacts 2,5 --precision 0.1 --out {}"),
    ("informative", "out"): ("ranking", "informative pack.npz --states 9 --best 2 --out {}"),
    ("scan", "out"): ("scan", "scan --mu 0.3 -n 12 --states 2 --workers 1 --out {}"),
    ("figures", "out"): ("picture", "figures scan.zarr --out {}"),
    ("plot", "out"): ("picture", "plot pack.npz --out {}"),
    ("export", "grains"): ("exported", "export pack.npz {} contacts.{suffix}"),
    ("export", "contacts"): ("exported", "export pack.npz grains.{suffix} {}"),
    ("import lammps", "out"): ("packing", "import lammps {dump} --mu 0.3 --out {}"),
    ("import lammps", "csv"): (
        "rows",
        "import lammps {dump} --mu 0.3 --frames all --workers 1 --csv {}",
    ),
    ("import table", "out"): (
        "open packing",
        "import table grains.csv --walls floor --gravity 1 --mu 1 --out {}",
    ),
    ("import blocks", "out"): ("bodies", "import blocks bodies.csv --mu 0.6 --out {}"),
    ("import pegs", "out"): ("open packing", "import pegs {frame} --mu 0.3 --reach 0.1 --out {}"),
    ("import pegs", "measured"): (
        "measured",
        "import pegs {frame} --mu 0.3 --reach 0.1 --measured {}",
    ),
    ("infer", "out"): ("network", "infer {inferred} --states 9 --certain --out {}"),
}
TABLES = ("csv", "npz", "zarr")
# Other forms of these commands: {(command, form): (kind, command line, suffixes)}.
FORMS = {
    ("pack", "scene"): ("open packing", "pack --scene groove --mu 1.2 --out {}", ["npz"]),
    ("walk", "mean"): ("forces in ⟨f_n⟩", "walk pack.npz --states 3 --unit mean --out {}", TABLES),
    ("infer", "mean"): (
        "forces in ⟨f_n⟩",
        "infer {inferred} --states 0 --unit mean --out {}",
        TABLES,
    ),
    ("intervals", "mean"): ("forces in ⟨f_n⟩", "intervals pack.npz --unit mean --out {}", TABLES),
    ("intervals", "infinite"): ("infinite bounds", "intervals pack-scene.npz --out {}", TABLES),
    ("import lammps", "frames"): (
        *("snapshots", "import lammps {dump} --mu 0.3 --frames all --workers 1 --out {}", ["zarr"]),
    ),
    ("infer", "frames"): (
        *(
            "frames",
            "infer {frame} --frames all --mu 0.3 --states 0 --workers 1 --out {}",
            ["zarr"],
        ),
    ),
}
SHORT = {
    "{dump}": "export-grains.dump export-contacts.dump",
    "{frame}": "positions.txt adjacency.txt",
    "{inferred}": "import-pegs.npz --measured import-pegs-measured.csv",
}
# Folders of many files, and formats whose options are those of others above.
NOT_HERE = {"study", "docs", "bench", "cache", "import mercury", "import yade"}
ANY = ("packing", "open packing", "bodies")
KNOWN = ("bounds", "normal forces")
# {(command, argument): (kinds or files that it reads, command line)} of options that read files.
READ = {
    ("walk", "packing"): (ANY, "walk {} --states 2"),
    ("uniform", "packing"): (("packing",), "uniform {} --states 8"),
    ("volume", "packing"): (("packing",), "volume {} --accuracy 5"),
    ("infer", "files"): (ANY, "infer {} --measured one.csv --states 0"),
    ("informative", "packing"): (("packing",), "informative {} --states 8 --best 1 --check 0"),
    ("measure", "packing"): (("packing",), "measure {} --states 2"),
    ("plot", "packing"): (ANY, "plot {} --out drawn.html"),
    ("intervals", "packing"): (ANY, "intervals {} --contacts 1"),
    ("limit-loads", "packing"): (ANY, "limit-loads {} --contacts 1"),
    ("load-factor", "packing"): (("bodies",), "load-factor {} --load horizontal"),
    ("rest", "packing"): (ANY, "rest {}"),
    ("stress", "packing"): (("packing",), "stress {} --angles 4"),
    ("perturb", "packing"): (("packing",), "perturb {} --contacts 1 --precision 0.5"),
    ("export", "packing"): (("packing", "open packing"), "export {} drawn.vtp also.vtp"),
    ("plot", "states"): (("states", "network"), "plot {packing} --states {} --out drawn.html"),
    ("walk", "known"): (KNOWN, "walk pack.npz --states 2 --known {}"),
    ("uniform", "known"): (KNOWN, "uniform pack.npz --states 8 --known {}"),
    ("volume", "known"): (KNOWN, "volume pack.npz --accuracy 5 --known {}"),
    ("infer", "known"): (KNOWN, "infer pack.npz --measured one.csv --states 0 --known {}"),
    ("informative", "known"): (("bounds",), "informative pack.npz --states 8 --best 1 --known {}"),
    ("measure", "known"): (KNOWN, "measure pack.npz --states 2 --known {}"),
    ("intervals", "known"): (KNOWN, "intervals pack.npz --contacts 1 --known {}"),
    ("limit-loads", "known"): (KNOWN, "limit-loads pack.npz --contacts 1 --known {}"),
    ("stress", "known"): (KNOWN, "stress pack.npz --angles 4 --known {}"),
    ("infer", "measured"): (("measured",), "infer import-pegs.npz --states 0 --measured {}"),
    ("figures", "scan"): (("store",), "figures {} --out drawn.html"),
    ("import lammps", "grains"): (
        ("export-grains.dump",),
        "import lammps {} export-contacts.dump --mu 0.3",
    ),
    ("import lammps", "contacts"): (
        ("export-contacts.dump",),
        "import lammps export-grains.dump {} --mu 0.3",
    ),
}
# Arguments for files that no command writes, or that a server opens.
OTHERS = {
    ("app", "packing"),
    ("app", "basic_auth"),
    ("infer", "pressures"),
    *((f"import {name}", "grains") for name in ("table", "blocks", "pegs")),
    *((f"import {name}", "contacts") for name in ("table", "pegs")),
}
# One of each kind of reader, on which all that it does not read is tried.
TRIED = [("plot", "packing"), ("plot", "states"), ("intervals", "known"), ("infer", "measured")]
TRIED += [("figures", "scan")]


def options():
    """(command, argument, action) of the whole command line; commands such as "import pegs"."""

    def visit(parser, name):
        for action in parser._actions:
            if action.dest in ("command", "format"):
                for word, below in action.choices.items():
                    yield from visit(below, f"{name} {word}".strip())
            elif name not in NOT_HERE:
                yield name, action.dest, action

    return list(visit(make_parser(), ""))


def suffixes(action):
    """Those that the help of an option offers."""
    if action.dest in ("grains", "contacts"):  # of export
        return ["vtp", "dump"]
    return action.suffixes


def called(words):
    """Exit code, and the lines on stderr that are not progress, with warnings."""
    err = io.StringIO()
    with (
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(err),
        warnings.catch_warnings(record=True) as warned,
    ):
        warnings.simplefilter("always")
        try:
            code = main(words.split())
        except SystemExit as stop:
            code = stop.code
    lines = [line for line in err.getvalue().split("\n") if line and "\r" not in line]
    return code, lines, warned


def written():
    """(file, kind, command line) of everything that commands write."""
    action_of = {(name, dest): action for name, dest, action in options()}
    for (command, option), (kind, words) in WRITTEN.items():
        offered = suffixes(action_of[command, option])
        for suffix in offered[:1] if kind == "picture" else offered:  # which none reads
            if suffix == "zarr" and command == "import lammps":
                continue  # of many snapshots, below
            stem = command if option == "out" else f"{command}-{option}"
            yield f"{stem.replace(' ', '-')}.{suffix}", kind, words
    for (command, form), (kind, words, offered) in FORMS.items():
        for suffix in offered:
            yield f"{command.replace(' ', '-')}-{form}.{suffix}", kind, words


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with everything that commands write, {file: kind}."""
    folder = tmp_path_factory.mktemp("files")
    with contextlib.chdir(folder), pytest.MonkeyPatch.context() as patch:
        patch.setenv("GRANFORCE_CACHE", str(folder / "cache"))
        frames.write(folder, *frames.frame(30, missing=0.1, noise=0.1, seed=2)[:2])
        (folder / "grains.csv").write_text("x,y,r\n0,1,1\n2,1,1\n")
        corners = [(0, 0), (4, 0), (4, 1), (0, 1)], [(1, 1), (3, 1), (3, 2), (1, 2)]
        rows = [f"{k},{x},{y},{int(k == 0)}" for k, body in enumerate(corners) for x, y in body]
        (folder / "bodies.csv").write_text("\n".join(["body,x,y,fixed", *rows]))
        (folder / "one.csv").write_text("contact,f_n,f_t,sigma_n,sigma_t\n0,1,,0.1,\n")
        kinds = {}
        for name, kind, words in written():
            for short, files in SHORT.items():
                words = words.replace(short, files)
            suffix = name.rpartition(".")[2]
            code, lines, _ = called(words.replace("{}", name).replace("{suffix}", suffix))
            assert code == 0, (words, lines)
            kinds[name] = kind
        kinds["scan.zarr"] = "store"
        yield kinds


def test_every_option_that_writes_or_reads_is_in_the_tables():
    writes = (Output, TableOrStore, Workplace, Edited)
    found = {(name, dest): action for name, dest, action in options()}
    assert {key for key, action in found.items() if action.type in writes} == WRITTEN.keys()
    assert {key for key, action in found.items() if action.type is Input} == READ.keys() | OTHERS


def given(command, argument, name):
    """The command line that reads a file."""
    packing = "import-pegs.npz" if name.startswith("infer") else "pack.npz"
    return READ[command, argument][1].replace("{packing}", packing).replace("{}", name)


@pytest.mark.parametrize(("command", "argument"), READ)
def test_a_command_reads_what_others_write(folder, command, argument):
    kinds, _ = READ[command, argument]
    read = [name for name, kind in folder.items() if kind in kinds]
    read += [name for name in kinds if name in folder]
    assert read
    for name in read:
        code, lines, _ = called(given(command, argument, name))
        assert code == 0, (name, lines)


@pytest.mark.parametrize(("command", "argument"), TRIED)
def test_a_command_refuses_all_else_in_a_line(folder, command, argument):
    before = sorted(os.listdir())
    for name in [name for name, kind in folder.items() if kind not in READ[command, argument][0]]:
        code, lines, _ = called(given(command, argument, name))
        assert code == 2 and len(lines) == 1, (name, lines)
    assert sorted(os.listdir()) == before


def test_states_and_networks_are_the_same_in_every_format(folder):
    for stem, packing in (("walk", "pack"), ("uniform", "pack"), ("infer", "import-pegs")):
        packing = importers.load_packing(f"{packing}.npz")
        first, *others = (
            input_tables.read_states(f"{stem}.{suffix}", packing) for suffix in TABLES
        )
        for other in others:
            assert all(map(np.array_equal, first, other))


@pytest.mark.parametrize("stem", ["intervals", "intervals-infinite", "measure", "infer"])
def test_known_forces_are_the_same_in_every_format(folder, stem):
    first, *others = (input_tables.read_known(f"{stem}.{suffix}") for suffix in TABLES)
    for other in others:
        assert all(map(np.array_equal, first, other))


@pytest.mark.parametrize("suffix", TABLES)
def test_bounds_of_an_unbounded_S_are_read(folder, suffix):
    code, (note,), _ = called(f"intervals pack-scene.npz --known intervals-infinite.{suffix}")
    assert code == 0 and "1 grain is wedged (0, counted from 0)" in note
    words = f"intervals import-pegs.npz --contacts 1 --known infer.{suffix}"
    assert called(words)[:2] == (0, [])


def test_an_exact_value_outside_its_bounds_is_refused(folder):
    head, row, *_ = open("intervals.csv").read().split("\n")
    low, high = (
        float(row.split(",")[head.split(",").index(f"f_n_{side} [packing]")])
        for side in ("low", "high")
    )
    for value, code in (((low + high) / 2, 0), (high + 1e-3, 2)):
        with open("known.csv", "w") as file:
            file.write(f"{head},f_n [packing]\n{row},{value}\n")
        done, lines, _ = called("intervals pack.npz --contacts 0 --known known.csv")
        assert done == code
    assert "line 2: f_n is" in lines[0] and "outside its bounds" in lines[0]


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (lambda rows: [*rows[:1], f"1{rows[1][1:]}", *rows[2:]], "complete"),
        (lambda rows: rows[:-1], "complete"),
        (lambda rows: [*rows[:-1], rows[-2]], "same contacts"),
    ],
)
def test_states_that_contradict_themselves_are_refused(folder, changed, words):
    rows = open("walk.csv").read().splitlines()
    with open("changed.csv", "w") as file:
        file.write("\n".join(changed(rows)))
    code, lines, _ = called("plot pack.npz --states changed.csv --out drawn.html")
    assert code == 2 and len(lines) == 1 and words in lines[0]
