"""Bad words for every option of every command: what the fuzz of the command line is made of."""

import json
import os

import numpy as np

LONG = "9" * 23
SEEDS = ["-1", f"-{LONG}", "1.5", "nan", "inf", "", "one", "0x1", "1e3", "−1"]
WHOLE = ["0", "-1", f"-{LONG}", "1.5", "nan", "inf", "", "many"]
POSITIVE = ["0", "-1", "nan", "inf", "-inf", "1e999", "", "wide", "1,5"]
FRICTION = ["-1", "nan", "inf", "-inf", "1e999", "1e300", "10001", "", "much", "0.1,0.2"]
MEMORY = ["1000000000000", LONG, "9" * 400]
CONTACTS = ["", ",", "0,", "a", "0;1", "-1", "nan", "1.5", LONG, "9" * 5000, "99999"]
SLICES = ["", "0,1", "nan,1,0,1", "0,inf,0,1", "0.5,0.2,0,1", "0,1,0,1,0", "a,b,c,d", "-1,2,0,1"]
FRICTIONS = ["", ",", "a", "0.1;1", "-1", "nan", "0.1,inf", "0.1,1e300", "0.1,,1"]

# Names in the folder that `prepare` makes.
OUTPUTS = ["none/x", "folder", "file/x", "loop", "x" * 300, "y/" * 3000, "a\0b", "", "/proc/none"]
CACHES = [
    *("~nouser/x", "file", "foreign", "newer", "loop", "x" * 300, "y/" * 3000, "a\0b", "file/x"),
    *("/proc/none", "/dev/null"),
]
FILES = ["none", "folder", "loop", "empty", "noise", "cut.npz", "x" * 300, "a\0b", "", "/dev/null"]
RADII = [
    *("", "none", "folder", "nan.txt", "inf.txt", "noise", "empty", "words.txt", "few.txt"),
    *(":", "uniform:", "uniform:1", "uniform:nan,1", "uniform:0.5,inf", "uniform:2,1"),
    *("uniform:0,1", "uniform:-1,1", "bidisperse:1,2", "bidisperse:1,2,3", "bidisperse:0,1,0.5"),
    *("bidisperse:nan,1,0.5", "bidisperse:1,1e999,0.5", "gauss:1,2", "x" * 300, "a\0b"),
]

PACKING = {
    "-n": [*WHOLE, "2", *MEMORY],
    "--radii": RADII,
    "--pressure": [*POSITIVE, "1e300", "1e-300"],
    "--dt": [*POSITIVE, "1e300", "1e-300"],
    "--step-accuracy": POSITIVE,
    "--drag-below": [*POSITIVE, "1.1"],
    "--box-mass": [*POSITIVE, "1e300", "1e-300"],
    "--box": ["", "round", "1 1"],
    "--sweeps": [*WHOLE, LONG],
}
ONE_PACKING = PACKING | {"--mu": FRICTION, "--seed": SEEDS}
ANY_PACKING = ONE_PACKING | {"packing": FILES, "--cache": CACHES, "--workers": WHOLE}
WALK = {
    "--states": [*WHOLE, *MEMORY],
    "--walk-seed": SEEDS,
    "--ensemble-mu": FRICTION,
    "--relax": ["", "magic"],
    "--chains": [*WHOLE, "1000", LONG],
}
KNOWN = {"--known": [*FILES, "grains.csv", "file", "nothing.csv", "letters.csv", "beyond.csv"]}
CONDITIONS = {"--prescribe": ["", "strain"], "--stress": ["", "1,1,0", "a,b,c", "nan,1,0"]}
WALK |= CONDITIONS | KNOWN
EXACT = {
    "--ensemble-mu": FRICTION,
    "--contacts": CONTACTS,
    "--slice": SLICES,
    "--out": OUTPUTS,
    **CONDITIONS,
    **KNOWN,
}

MEASURED = ["grains.csv", "twice.csv", "other.csv", "exact.csv", "unmeasured.csv", "words.csv"]

SCHEDULERS = ["", "nonsense", "tcp://", "tcp://:x", "ftp://here:1"]

# Command → (words that are right, {option: words that are wrong for it}).
COMMANDS = {
    "pack": (
        ["-n", "8", "--mu", "0.3"],
        ONE_PACKING | {"--max-steps": WHOLE, "--out": OUTPUTS, "--cache": CACHES},
    ),
    "walk": (["-n", "8", "--mu", "0.3", "--states", "3"], ANY_PACKING | WALK),
    "measure": (
        ["-n", "8", "--mu", "0.3", "--states", "3"],
        ANY_PACKING | WALK | {"--out": OUTPUTS},
    ),
    "uniform": (
        ["-n", "8", "--mu", "0.3", "--states", "8"],
        ANY_PACKING
        | {
            "--states": [*WHOLE, *MEMORY],
            "--sample-seed": SEEDS,
            "--ensemble-mu": FRICTION,
            "--chains": [*WHOLE, "1000000000000", LONG],
            "--effective": [*POSITIVE, "1e18", "1e300"],
            **CONDITIONS,
            **KNOWN,
        },
    ),
    "volume": (
        ["-n", "8", "--mu", "0.3", "--accuracy", "0.5"],
        ANY_PACKING
        | {
            "--accuracy": [*POSITIVE, "1e-300"],
            "--volume-seed": SEEDS,
            "--ensemble-mu": FRICTION,
            **CONDITIONS,
            **KNOWN,
        },
    ),
    "infer": (
        ["-n", "8", "--mu", "0.3", "--measured", "measured.csv", "--states", "8"],
        ANY_PACKING
        | {
            "--measured": [name for name in FILES if name != "cut.npz"] + MEASURED,
            "--states": ["-1", "1.5", "nan", "many", *MEMORY],
            "--unmeasured": POSITIVE,
            **CONDITIONS,
            **KNOWN,
            "--sample-seed": SEEDS,
            "--ensemble-mu": FRICTION,
            "--chains": [*WHOLE, "1000000000000", LONG],
            "--out": OUTPUTS,
        },
    ),
    "intervals": (["-n", "8", "--mu", "0.3"], ANY_PACKING | EXACT),
    "limit-loads": (["-n", "8", "--mu", "0.3"], ANY_PACKING | EXACT),
    "plot": (
        ["p.npz", "--out", "p.png"],
        {
            "--out": OUTPUTS,
            "--states": [*FILES, "grains.csv"],
            "--state": ["0"],
            "--colour": ["", "spread"],
        },
    ),
    "rest": (["p.npz"], {"--ensemble-mu": ["", "-1", "nan"]}),
    "load-factor": (["p.npz", "--load", "horizontal"], {"--load": ["", "vertical"]}),
    "stress": (
        ["-n", "8", "--mu", "0.3"],
        ANY_PACKING
        | {
            "--ensemble-mu": FRICTION,
            "--angles": [*WHOLE, "5000", LONG],
            "--out": OUTPUTS,
            **KNOWN,
        },
    ),
    "perturb": (
        ["-n", "8", "--mu", "0.3"],
        ANY_PACKING
        | CONDITIONS
        | {
            "--random": [*WHOLE, LONG],
            "--contacts": CONTACTS,
            "--draw-seed": SEEDS,
            "--ensemble-mu": FRICTION,
            "--precision": [*POSITIVE, "1e-300"],
            "--out": OUTPUTS,
        },
    ),
    "scan": (
        ["-n", "8", "--mu", "0.3", "--states", "3"],
        PACKING
        | {option: words for option, words in WALK.items() if option not in CONDITIONS | KNOWN}
        | {
            "--mu": FRICTIONS,
            "--seeds": [*WHOLE, *MEMORY],
            "--out": CACHES,
            "--cache": CACHES,
            "--keep": WHOLE,
            "--workers": WHOLE,
        },
    ),
    "study": (
        ["--quick"],
        {
            "-n": [*WHOLE, "2", *MEMORY],
            "--mu": FRICTIONS,
            "--packings": [*WHOLE, *MEMORY],
            "--states": [*WHOLE, "1", *MEMORY],
            "--gauss-seidel-packings": ["-1", "some"],
            "--perturb-packings": ["-1", "some"],
            "--perturb-contacts": ["-1", "0", "some"],
            "--sizes": [",a", "2", "-5", "nan", "100,1.5", *MEMORY],
            "--parts": ["", "none", "walk,"],
            "--formats": ["gif", "html,,pdf"],
            "--table": CACHES,
            "--out": [name for name in CACHES if name not in ("foreign", "newer")],
            "--workers": WHOLE,
        },
    ),
    "app": (
        ["--no-show"],
        {
            "--port": ["-1", "65536", "1.5", "nan", "", "many", LONG],
            "--address": ["", " ", "192.0.2.1", "x" * 300, "a\0b"],
            "--allow-websocket-origin": ["", "a b", "http://here", "here:port", "a,b"],
        },
    ),
    "bench": ([], {"--out": ["file", "file/x", "loop", "x" * 300, "a\0b", "/proc/none"]}),
    "cache": (["list"], {"--cache": CACHES}),
}
SIMULATIONS = {
    "lammps": ["lammps", "p.dump", "c.dump", "--mu", "0.3"],
    "yade": ["yade", "b.txt", "i.txt", "--mu", "0.3"],
    "mercury": ["mercury", "m.data", "m.fstat", "--mu", "0.3"],
}
SCENES = ["", "wall", "courses", "courses=", "=2", "courses=many", "courses=nan", "course=2"]
EXPORTS = [
    *([name, "g.vtp", "c.vtp"] for name in FILES),
    *(["p.npz", out, "c.dump"] for out in OUTPUTS),
    *(["p.npz", *words] for words in (["g.vtp"], ["g.vtp", "c.dump"], ["g", "c"], ["g.vtp"] * 2)),
    ["p.npz", "p.npz", "c.npz"],
]
IMPORTS = [
    *(["table", name, "--mu", "0.3"] for name in FILES),
    *(["lammps", name, name, "--mu", "0.3"] for name in FILES),
    *(["pegs", name, "adjacency.txt", "--mu", "0.3"] for name in [*FILES, "grains.csv"]),
    *(["pegs", "positions.txt", name, "--mu", "0.3"] for name in [*FILES, "grains.csv"]),
    *(
        ["pegs", "positions.txt", "adjacency.txt", "--mu", "0.3", f"{option}={word}"]
        for option, words in {
            "--frame": ["7", "nan", "inf", "", "first"],
            "--reach": ["-1", "nan", "inf", "3", "", "far"],
            "--scale": POSITIVE,
            "--error": POSITIVE,
            "--out": OUTPUTS,
            "--measured": OUTPUTS,
        }.items()
        for word in words
    ),
    *(["table", "grains.csv", name, "--mu", "0.3"] for name in FILES),
    *(["blocks", name, "--mu", "0.3"] for name in [*FILES, "grains.csv", "letters.csv"]),
    *(["blocks", "blocks.csv", "--mu", "0.3", "--density", word] for word in POSITIVE),
    *(["table", "grains.csv", "--mu", mu] for mu in FRICTION),
    *(["table", "grains.csv", "--mu", "0.3", "--box", side, "9"] for side in POSITIVE),
    *(["table", "grains.csv", "--mu", "0.3", "--pressure", p] for p in POSITIVE),
    *(["table", "grains.csv", "--mu", "0.3", "--out", out] for out in OUTPUTS),
    *(
        [*SIMULATIONS[name], f"{option}={word}"]
        for name in SIMULATIONS
        for option, words in {
            "--out": OUTPUTS,
            "--columns": ["", "x", "x=", "=x", "speed=x", "x=absent"],
            "--tilt": ["nan", "inf", "", "wide", "1"],
            "--frame": ["7", "-7", "1.5", "nan", "", "last", LONG],
            "--frames": ["", ",", "7", "1,7", "nan", "inf", "1e999", "some"],
            "--states": ["3"],
            "--csv": ["s.csv"],
        }.items()
        for word in words
    ),
    *(
        [*SIMULATIONS["lammps"], "--frames", "all", "--states", "2", f"{option}={word}"]
        for option, words in {
            "--frame": ["1"],
            "--states": [*WHOLE[1:], *MEMORY],
            "--walk-seed": SEEDS,
            "--workers": WHOLE,
            "--csv": OUTPUTS,
            "--out": ["none/x", "folder", "file/x", "file", "loop", "a\0b"],
            "--cache": CACHES,
        }.items()
        for word in words
    ),
    *(
        [*SIMULATIONS["lammps"], "--frames", "all", "--states", "9", f"--scheduler={word}"]
        for word in SCHEDULERS
    ),
    *(["lammps", name, "c.dump", "--mu", "0.3", "--frames", "all"] for name in FILES),
    *(["yade", name, "i.txt", "--mu", "0.3"] for name in FILES),
    *(["mercury", "m.data", name, "--mu", "0.3"] for name in FILES),
    *(["lammps", "one.dump", "--mu", "0.3"], ["ovito", "a", "--mu", "1"], ["table"], []),
    ["table", "grains.csv", "--mu", "0.3", "--forces"],
]


def lines():
    """All bad command lines, lists of words: one wrong word in each."""
    found = [["import", *words] for words in IMPORTS]
    found += [["export", *words] for words in EXPORTS]
    cell = ["scan", "-n", "8", "--mu", "0.3", "--states", "4"]
    found += [[*cell, f"--scheduler={word}"] for word in SCHEDULERS]
    found += [["pack", "--scene", "wall", f"--scene-options={word}"] for word in SCENES]
    for command, (right, options) in COMMANDS.items():
        for option, wrong in options.items():
            others = _without(right, option)
            found += [[command, *others, *_given(option, word)] for word in wrong]
        found += [[command, *right, "--colour"], [command, *right, "extra", "words"]]
    return [*found, [], ["fly"], ["--", "pack"], ["pack", "walk"], ["\0"]]


def _given(option, word):
    """An option with a word, or the word as a positional argument."""
    if option == "-n":
        return [option, word]
    return [f"{option}={word}"] if option.startswith("-") else [word]


def _without(words, option):
    """The words without an option and its value: given twice it would be refused for that."""
    if option not in words:
        return words
    at = words.index(option)
    return words[:at] + words[at + 2 :]


def prepare(folder, packing):
    """Files of every kind that a word may name, in a folder; packing: an NPZ file."""
    noise = np.random.default_rng(0).bytes(500)
    (folder / "file").write_text("text\n")
    (folder / "empty").write_text("")
    (folder / "noise").write_bytes(noise)
    (folder / "folder").mkdir()
    (folder / "folder" / "inside").write_text("")
    (folder / "foreign").mkdir()
    (folder / "foreign" / "thesis.tex").write_text("")
    (folder / "newer").mkdir()
    root = {"zarr_format": 3, "node_type": "group", "attributes": {"granforce_store": 1000}}
    (folder / "newer" / "zarr.json").write_text(json.dumps(root))
    os.symlink("loop", folder / "loop")
    (folder / "cut.npz").write_bytes(packing.read_bytes()[:2000])
    (folder / "p.npz").write_bytes(packing.read_bytes())
    (folder / "b.txt").write_text("0 0 0 1\n2 0 0 1\n")
    (folder / "i.txt").write_text("0 1 1 0 0 0 0 0\n")
    (folder / "m.data").write_text("2 1 0 0 2 2\n0 0 0 0 1 0 0 0\n2 0 0 0 1 0 0 0\n")
    (folder / "m.fstat").write_text("1 0 1 0 0 0 0 0 1 0 -1 0 0 0 0 0\n")
    head = "ITEM: TIMESTEP\n1\nITEM: NUMBER OF {}\n{}\nITEM: BOX BOUNDS ff ff pp\n0 9\n0 9\n-1 1\n"
    atoms = "ITEM: ATOMS id x y radius\n1 1 1 1\n2 3 1 1\n"
    (folder / "p.dump").write_text(head.format("ATOMS", 2) + atoms)
    pairs = "ITEM: ENTRIES atom1 atom2 distance fx fy px py\n1 2 2 -1 0 0 0\n"
    (folder / "c.dump").write_text(head.format("ENTRIES", 1) + pairs)
    (folder / "grains.csv").write_text("x,y,r\n0,0,1\n2,0,1\n")
    (folder / "blocks.csv").write_text("body,x,y\n0,0,0\n0,1,0\n0,0,1\n")
    (folder / "nothing.csv").write_text("contact,comment\n1,strong\n")
    (folder / "letters.csv").write_text("contact,f_n\n1,strong\n")
    (folder / "beyond.csv").write_text("contact,f_n\n1000000,1\n")
    (folder / "positions.txt").write_text("1,1,0,0,1,0\n1,2,2,0,1,1\n1,3,0,2,1,1\n")
    (folder / "adjacency.txt").write_text("1,1,2,0,1\n1,1,3,0,1\n")
    for name, line in {
        "measured": "0,1,0,0.1,0.1",
        "twice": "0,1,0,0.1,0.1\n0,1,0,0.1,0.1",
        "other": "99999,1,0,0.1,0.1",
        "exact": "0,1,0,0,0.1",
        "unmeasured": "0,1,0,,",
        "words": "0,one,0,0.1,0.1",
    }.items():
        (folder / f"{name}.csv").write_text(f"contact,f_n,f_t,sigma_n,sigma_t\n{line}\n")
    for name, words in {
        "nan": ["nan"] * 8,
        "inf": ["inf"] * 8,
        "words": ["wide"] * 8,
        "few": ["1"] * 3,
    }.items():
        (folder / f"{name}.txt").write_text("\n".join(words))
