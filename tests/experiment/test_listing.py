"""What text files of photoelastic frames list, where columns and flags are not what they seem."""

import gzip
import io
import re
from types import SimpleNamespace

import numpy as np
import pytest
from frames import file, frame

from app.results.photoelastic_frames import account
from granforce.cli.entry_point import main
from granforce.experiment.boundary import boundary
from granforce.experiment.frames import frames_of
from granforce.experiment.pegs import read_pegs
from granforce.experiment.walls import bad_fit, fitted, flagged
from granforce.records import InputError, InputWarning

N = 40
CLEAN = {"mu": 0.3, "reach": 0.1, "error": 0.001}


def read(grains, rows, **options):
    return read_pegs(file(grains, "positions.txt"), file(rows, "adjacency.txt"), **CLEAN, **options)


def with_flag(grains, flag):
    return [[*row[:-1], flag] for row in grains]


def columns(rows, *chosen):
    return [[row[k] for k in chosen] for row in rows]


@pytest.fixture(scope="module")
def made():
    grains, rows, _ = frame(N)
    return grains, rows


@pytest.fixture(scope="module")
def taken(made):
    return read(*made)


def same(found, taken):
    assert np.array_equal(found.packing.contacts.i, taken.packing.contacts.i)
    assert np.allclose(found.measured, taken.measured, equal_nan=True)
    assert np.allclose(found.packing.forces, taken.packing.forces)


@pytest.mark.parametrize("flag", [1, -1, 7])
def test_a_flag_of_all_grains_is_no_flag_of_walls(made, flag):
    """Those at the boundary are at walls: nearly the same as with the right flags."""
    grains, rows = made
    found = read(with_flag(grains, flag), rows)
    right = np.array([row[-1] for row in grains]) != 0
    assert np.mean(found.at_wall == right) > 0.85
    (note,) = found.report["notes"]
    assert f"{N} of {N} grains are flagged" in note and "\n" not in note
    assert "--walls box or auto" in note and "annulus" not in note
    assert found.report["flags_ignored"] == N
    assert f"Warning: {N} disks are flagged" in " ".join(account(found.report))
    same(found, read(with_flag(grains, flag), rows, flag="ignore"))
    assert "notes" not in read(grains, rows, flag="ignore").report
    with pytest.raises(InputError, match="flag"):
        read(grains, rows, flag="use")


@pytest.mark.parametrize("flag", [0, 1])
@pytest.mark.parametrize("walls", ["box", "auto"])
def test_walls_are_found_without_flags(made, flag, walls):
    grains, rows = made
    found = read(with_flag(grains, flag), rows, walls=walls)
    assert found.walls == ("left", "right", "bottom", "top")
    assert ("notes" in found.report) == (flag == 1)
    numbers = "box:0,{0},0,{0}".format(max(row[2] for row in grains) + 20)
    given = read(with_flag(grains, flag), rows, walls=numbers)
    assert given.walls == found.walls and 8 < given.report["grains_at_walls"] < 30


def annulus(rng, inner):
    """Disks of radius 5 in a ring of radii 60 and 130, without room for more."""
    x = np.mgrid[-150:150:9.9, -150:150:9.9].reshape(2, -1).T + rng.normal(0, 0.3, (961, 2))
    away = np.hypot(*x.T)
    return x[(away < 125) & (away > inner + 5)] + [500, 300]


@pytest.mark.parametrize("inner", [0, 60])
def test_an_annulus_is_told_from_a_circle(rng, inner):
    x = annulus(rng, inner)
    r = np.full(len(x), 5.0)
    sides = boundary(x, r)
    away = np.hypot(*(x - [500, 300]).T)
    assert np.all(away[sides == 1] > 110) and np.all(away[sides == -1] < 80)
    assert np.any(sides == -1) == (inner > 0)
    found = fitted("auto", x, r, sides != 0, sides.astype(float))
    assert found.shape == ("annulus" if inner else "circle")
    assert np.allclose(found.numbers[:2], [500, 300], atol=3)
    assert np.allclose(found.numbers[-1], 128, atol=5)


def test_an_outline_of_another_shape_is_noted(rng):
    x = annulus(rng, 0)
    sides = boundary(x, r := np.full(len(x), 5.0))
    at_wall = sides != 0
    box, circle = (fitted(shape, x, r, at_wall, sides) for shape in ("box", "circle"))
    assert bad_fit(circle, x, r, at_wall) is None
    note = bad_fit(box, x, r, at_wall)
    assert f"walls box: the {at_wall.sum()} grains at walls lie 1." in note and "auto" in note


@pytest.mark.parametrize(
    "flag, walls, words",
    [
        (1, "circle:0,0,9000", "walls circle: no grain lies at these walls"),
        (None, "circle:0,0,9000", r"walls circle: the \d+ grains at walls lie \d\d"),
        (None, "box", None),
    ],
)
def test_numbers_of_walls_elsewhere_are_noted(made, flag, walls, words):
    grains, rows = made
    found = read(grains if flag is None else with_flag(grains, flag), rows, walls=walls)
    notes = found.report.get("notes", [])
    assert bool(notes) == bool(words) and (not words or re.search(words, notes[-1]))


def test_one_flag_for_both_walls_of_an_annulus_is_told_apart(rng):
    x = annulus(rng, 60)
    r = np.full(len(x), 5.0)
    sides = boundary(x, r)
    listing = SimpleNamespace(x=x, r=r, flag=np.abs(sides).astype(float), ends=np.zeros((1, 2)))
    for walls in ("annulus", "auto"):
        assert np.array_equal(flagged(listing, None, walls)[0], sides)
    assert np.array_equal(flagged(listing, None, "box")[0], listing.flag)


def test_an_outline_without_a_shape_is_refused(rng):
    x = np.concatenate([annulus(rng, 0), np.add(annulus(rng, 0), [230, 0])])
    sides = boundary(x, r := np.full(len(x), 5.0))
    with pytest.raises(InputError, match="auto: neither box nor circle fits"):
        fitted("auto", x, r, sides != 0, sides.astype(float))


@pytest.mark.parametrize("x", [[[0, 0]], [[0, 0], [1, 1], [2, 2]], [[0, 0], [9, 0], [0, 9]]])
def test_few_grains_are_all_at_the_boundary(x):
    assert np.all(boundary(np.array(x, float), np.full(len(x), 0.5)) == 1)


@pytest.mark.parametrize("numbered", [False, True])
@pytest.mark.parametrize("flags", [False, True])
def test_ids_that_begin_anew_begin_another_frame(made, taken, numbered, flags):
    """By the ids of both files, or with a column for the frame in that of the contacts."""
    grains, rows = made
    moved = [[row[0], row[1], row[2] + 1000, *row[3:]] for row in grains]
    ordered = sorted(rows, key=lambda row: row[1])
    # Forces of the first frame are twice as large.
    contacts = [[4, *row[1:3], 2 * row[3], 2 * row[4]] for row in ordered]
    contacts += [[9, *row[1:]] for row in ordered]
    if not numbered:
        contacts = columns(contacts, 1, 2, 3, 4)
    listed = columns(grains + moved, 1, 2, 3, 4, 5)
    listed = listed if flags else columns(listed, 0, 1, 2, 3)
    texts = [one.getvalue() for one in (file(listed), file(contacts))]
    taken = taken if flags else read(with_flag(grains, 0), rows)
    found = read_pegs(*map(io.StringIO, texts), **CLEAN)
    same(found, taken)
    assert found.packing.x[:, 0].min() > 900 and "told apart by the ids" in found.report["columns"]
    first, last = (4, 9) if numbered else (1, 2)
    assert found.report["frame"] == last
    found = read_pegs(*map(io.StringIO, texts), frame=first, **CLEAN)
    assert np.allclose(found.measured, 2 * taken.measured, equal_nan=True)
    with pytest.raises(InputError, match="frame 7 is not in both"):
        read_pegs(*map(io.StringIO, texts), frame=7, **CLEAN)


def test_frames_of_contacts_that_nothing_tells_apart_are_refused(made, rng):
    grains, rows = made
    mixed = [rows[k] for k in rng.permutation(len(rows))]
    with pytest.raises(InputError, match=r"ids restart 2 times.*add a column for the frame"):
        read(columns(grains + grains, 1, 2, 3, 4, 5), columns(mixed + mixed, 1, 2, 3, 4))
    three = [[k, *row[1:]] for k in (1, 2, 3) for row in rows]
    with pytest.raises(InputError, match=r"restart 2 times, but adjacency.txt has 3 frames"):
        read(columns(grains + grains, 1, 2, 3, 4, 5), three)


def test_a_line_that_is_there_twice_begins_no_frame(made, taken):
    grains, rows = made
    listed = columns(grains, 1, 2, 3, 4, 5)
    found = read([*listed, listed[0]], columns(rows, 1, 2, 3, 4))
    same(found, taken)
    assert found.report["doubled_grains"] == 1


def test_a_third_column_of_zeros_is_a_flag(made, taken):
    """No grain is in every contact."""
    grains, rows = made
    same(read(grains, [[row[1], row[2], 0, row[3], row[4]] for row in rows]), taken)
    with pytest.raises(InputError, match="so the columns of the grains are unknown: name the col"):
        read(grains, [[1, row[1], 0, row[3], row[4]] for row in rows])


FLAGS = {"0 and 1": lambda k: k % 3 == 0, "all 1": lambda k: 1, "one 1": lambda k: k == 5}


@pytest.mark.parametrize("flag", FLAGS)
@pytest.mark.parametrize("ids", ["listed", "counted", "restarting", "framed"])
def test_a_third_column_of_zeros_and_ones_is_a_flag(made, taken, flag, ids):
    """Whether grains have ids, count from 0, or have several frames; and the report says so."""
    grains, rows = made
    end = (lambda id: (id - 3) // 10) if ids == "counted" else (lambda id: id)
    flagged = [
        [end(row[1]), end(row[2]), int(FLAGS[flag](k)), row[3], row[4]]
        for k, row in enumerate(sorted(rows))
    ]
    listed = columns(grains, *{"counted": (2, 3, 4, 5), "framed": range(6)}.get(ids, range(1, 6)))
    times = 2 if ids == "restarting" else 1
    found = read(listed * times, flagged * times)
    same(found, taken)
    assert "id1, id2, flag (not used), tangential, normal" in found.report["columns"]


@pytest.mark.parametrize(
    "number, first, marked", [(0, 0, lambda k: k == 5), (1, 1, lambda k: k != 5)]
)
def test_a_flag_is_no_grain_where_few_contacts_happen_to_fit(made, taken, number, first, marked):
    """Grains of one frame; of contacts without frames, the first grain is no frame."""
    grains, rows = made
    ids = {row[1]: k + first for k, row in enumerate(grains)}
    flagged = [
        [ids[row[1]], ids[row[2]], int(marked(k)), *row[3:]] for k, row in enumerate(sorted(rows))
    ]
    same(read([[number, ids[row[1]], *row[2:]] for row in grains], flagged), taken)


def test_frames_are_no_flag():
    """Two frames 0 and 1, in which grain 1 takes part in every contact."""
    grains = [[f, k, 2.0 * k, 0.0, 1.0, 0] for f in (0, 1) for k in range(3)]
    rows = [[f, a, 1, 0.0, 5.0] for f in (0, 1) for a in (0, 2)]
    for text in (grains, [row[1:] for row in grains]):
        found = read(text, rows, frame=0)
        assert found.report["contacts_listed"] == 2 and found.report["unbalanced"] == 0
    rows = [[7, *row[1:]] for row in rows[:2]]  # one frame, in a list of one frame
    found = read([row[1:] for row in grains[:3]], rows)
    assert found.report["frame"] == 7 and found.report["contacts_listed"] == 2


@pytest.mark.parametrize("chosen", [(1, 2, 3, 4), (2, 3, 4), (2, 3, 4, 5), (1, 2, 3, 4, 5)])
def test_radii_of_1_are_no_flag(made, chosen):
    """Equal grains in units of their radius; and a flag of grains at whole pixels."""
    grains = [
        [0, k, float(2 * (k % 6) + k // 6 % 2), 2.0 * (k // 6), 1.0, int(k % 6 in (0, 5))]
        for k in range(24)
    ]
    x = np.array([row[2:4] for row in grains])
    near = [(i, j) for i in range(24) for j in range(i) if np.hypot(*(x[i] - x[j])) < 2.3]
    first = 0 if 1 in chosen else 1
    rows = [[i + first, j + first, 0.0, 1.0] for i, j in near]
    found = read(columns(grains, *chosen), rows)
    assert np.all(found.packing.r[:24] == 1) and np.array_equal(found.packing.x[:24], x)
    assert found.report["contacts_listed"] == len(near)


def test_frames_in_one_file_only_are_named(made, tmp_path):
    grains, rows = made
    later = [[k, *row[1:]] for k in (2, 3) for row in grains]
    found = read([*grains, *later], [*rows, *([3, *row[1:]] for row in rows)])
    assert found.report["frame"] == 3
    assert any("frames 2 are not in both files" in note for note in found.report["notes"])
    for k, listed in ((1, rows), (2, []), (3, rows)):
        (tmp_path / f"positions_{k}.txt").write_text(file(grains).getvalue())
        (tmp_path / f"adjacency_{k}.txt").write_text(file(listed).getvalue())
    (tmp_path / "adjacency_4.txt").write_text(file(rows).getvalue())
    with pytest.warns(InputWarning) as noted:
        assert [frame.number for frame in frames_of(tmp_path)] == [1, 3]
    text = " ".join(str(one.message) for one in noted)
    assert "adjacency_2.txt: the file is empty: left out" in text
    assert "adjacency_4.txt: no file has the other half of frame 4" in text


def test_columns_are_named_by_header_or_number(made, taken):
    grains, rows = made
    head = "size;where_x;where_y;name;edge\n"
    text = head + "\n".join(";".join(f"{row[k]:.12g}" for k in (4, 2, 3, 1, 5)) for row in grains)
    mixed = [[row[4], row[3], 3.5, row[1], row[2]] for row in rows]
    names = {"r": "size", "x": "where_x", "y": "WHERE_Y", "id": "name", "fn": "1", "ft": "2"}
    names |= {"i": "4", "j": "5"}
    found = read_pegs(io.StringIO(text), file(mixed), columns=names, **CLEAN)
    same(found, taken)
    assert np.array_equal(found.at_wall, taken.at_wall)
    for wrong, words in (
        ({"q": "1"}, "unknown column 'q'; choose from frame, id, x"),
        ({"r": "radius", "x": "2", "y": "3"}, "no column 'radius' for radius among 5 .size"),
        ({"x": "2"}, "also give the columns for radius, y"),
        (names | {"flag": "size"}, "column 'size' is used twice, for radius and flag"),
        (names | {"radius": "edge"}, "the column radius is given twice"),
        (names | {"fn": "9"}, "no column '9' for normal among 5 .they have no names"),
        ({name: names[name] for name in ("r", "x", "y", "fn")}, "columns for id1, id2, tangential"),
    ):
        with pytest.raises(InputError, match=words):
            read_pegs(io.StringIO(text), file(mixed), columns={**wrong}, **CLEAN)


@pytest.mark.parametrize("headed", ["both", "positions", "adjacency"])
def test_a_column_for_the_frame_is_named_by_its_header(made, headed):
    """Where it is unknown to one file, that is the same in all frames."""
    grains, rows = made
    heads = {"positions": "Bild,id,x,y,r,flag\n", "adjacency": "Bild;i;j;ft;fn\n"}
    files = []
    for (name, head), listed in zip(heads.items(), made, strict=True):
        has = headed in ("both", name)
        twice = [[frame, *row[1:]] for frame in ((3, 8) if has else (1,)) for row in listed]
        if headed != "both" and has:
            twice = [[8, *row[1:]] for row in listed]
        mark = ";" if ";" in head else ","
        lines = [mark.join(f"{value:.12g}" for value in row[0 if has else 1 :]) for row in twice]
        head = head if has else head.removeprefix(f"Bild{mark}")
        files.append(io.StringIO(head + "\n".join(lines)))
    found = read_pegs(*files, columns={"frame": "bild"}, **CLEAN)
    assert found.report["frame"] == 8
    same(found, read(grains, rows))


@pytest.mark.parametrize("number", ["1", "9", "name"])
def test_a_column_for_the_frame_alone_has_no_number(made, number):
    with pytest.raises(
        InputError, match=f"header '{number}' for frame; to give its number, also give the"
    ):
        read(*made, columns={"frame": number})


def test_columns_are_of_text_files(made):
    for given in ((io.BytesIO(b"MATLAB"), None), (made, None)):
        with pytest.raises(InputError, match="two text files"):
            read_pegs(*given, columns={"x": "1"}, **CLEAN)


def test_tangential_forces_of_the_other_sign_are_noticed(made, taken):
    grains, rows = made
    other = [[*row[:3], -row[3], row[4]] for row in rows]
    (note,) = read(grains, other).report["notes"]
    assert "other sign" in note and "--reverse" in note
    found = read(grains, other, reverse=True)
    assert "notes" not in found.report
    same(found, taken)


def test_by_the_command_line_with_compressed_files(away, made, capsys):
    """Notes go to stderr; series read the same files with the same options."""
    grains, rows = made
    for name, lines in (
        ("positions", with_flag(grains, 1)),
        ("adjacency", columns(rows, 1, 2, 4, 3)),
    ):
        text = "\n".join(" ".join(f"{value:.12g}" for value in row) for row in lines)
        (away / f"{name}.txt.gz").write_bytes(gzip.compress(text.encode()))
    files = "positions.txt.gz adjacency.txt.gz"
    options = "--mu 0.3 --reach 0.1 --columns i=1,j=2,fn=3,ft=4"
    assert main(f"import pegs {files} {options} --out p.npz --json".split()) == 0
    out, err = capsys.readouterr()
    assert f"granforce: {N} of {N} grains are flagged" in err and err.count("\n") == 1
    assert '"walls": "open"' in out
    assert main(f"import pegs {files} {options} --flag ignore --walls auto".split()) == 0
    out, err = capsys.readouterr()
    assert err == "" and "left, right, bottom, top" in out
    (one,) = frames_of(away, columns={"i": "1", "j": "2", "fn": "3", "ft": "4"})
    assert one.positions.endswith("positions.txt.gz")
    assert main(f"infer {files} --frames all --states 0 --workers 1 {options}".split()) == 0
    assert f"granforce: frame 1: {N} of {N} grains are flagged" in capsys.readouterr().err
