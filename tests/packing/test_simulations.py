"""What simulations really write: many snapshots, files that are cut off, compressed, listed twice.

The packing is a square lattice of three by three touching disks of radius ½ in a periodic box of
side 3: with f_n = P on all 18 contacts its pressure is P.
"""

import bz2
import gzip
import io
import itertools
import lzma
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from packing.test_importers import tables
from packings import packed

from granforce.cli.entry_point import main
from granforce.explore.intervals import intervals
from granforce.forces.build import ensemble
from granforce.packing.importers import (
    lammps,
    load_packing,
    mercury,
    read_lammps,
    read_mercury,
    read_table,
    read_yade,
    save_packing,
    snapshots,
)
from granforce.records import InputError

PLACES = [(x, y) for y in range(3) for x in range(3)]
PAIRS = [
    (3 * y + x, 3 * ((y + v) % 3) + (x + u) % 3, u, v)
    for x, y in PLACES
    for u, v in ((1, 0), (0, 1))
]
BOX = "ITEM: BOX BOUNDS pp pp pp\n0 3\n0 3\n-0.5 0.5\n"
MU = 0.3


def particles(step, columns="x y", scale=1.0, low=0.0):
    rows = [f"{k + 1} 1 {low + (x + 0.5) * scale:.12g} {low + (y + 0.5) * scale:.12g} 0.5"
            for k, (x, y) in enumerate(PLACES)]  # fmt: skip
    head = f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n9\n{BOX}"
    return "\n".join([f"{head}ITEM: ATOMS id type {columns} radius", *rows, ""])


def contacts(step, pressure, both=(), index=False, columns="atom1 atom2 distance fx fy px py"):
    """Forces are on atom1; `both`: (pair, factor) of those listed from the other side, too."""
    rows = [f"{i + 1} {j + 1} 1 {-u * pressure} {-v * pressure} 0 0" for i, j, u, v in PAIRS]
    for k, factor in both:
        i, j, u, v = PAIRS[k]
        rows.append(f"{j + 1} {i + 1} 1 {u * pressure * factor} {v * pressure * factor} 0 0")
    rows = [f"{k + 1} {row}" if index else row for k, row in enumerate(rows)]
    head = f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ENTRIES\n{len(rows)}\n{BOX}"
    columns = f"index {columns}" if index else columns
    return "\n".join([f"{head}ITEM: ENTRIES {columns}", *rows, ""])


def mercury_files(pressures):
    data, fstat = [], []
    for time, pressure in enumerate(pressures):
        data.append(f"9 {time} 0 0 0 3 3 1")
        data += [f"{x + 0.5} {y + 0.5} 0 0 0 0 0.5 0 0 0 0 0 0 0" for x, y in PLACES]
        fstat += [
            f"{time} {i} {j} 0 0 0 0 0 {pressure} 0 {-u} {-v} 0 {-v} {u} 0" for i, j, u, v in PAIRS
        ]
    return "\n".join(data) + "\n", "\n".join(fstat) + "\n"


def given(*texts):
    return [io.BytesIO(text if isinstance(text, bytes) else text.encode()) for text in texts]


DUMPS = particles(100) + particles(200), contacts(100, 1.0) + contacts(200, 3.0)
MERCURY = mercury_files([1.0, 3.0])
READ = {
    "lammps": (read_lammps, DUMPS, {}, (100, 200)),
    "mercury": (read_mercury, MERCURY, {"box": (3, 3)}, (0, 1)),
}


@pytest.mark.parametrize("name", READ)
def test_a_frame_is_chosen(name):
    read, files, options, (first, last) = READ[name]
    pressures = {first: 1.0, last: 3.0, None: 3.0}
    for frame, pressure in pressures.items():
        found = read(*given(*files), MU, frame=frame, **options)
        assert found.pressure == pytest.approx(pressure) and found.info["residual"] < 1e-12
        assert "notes" not in found.info
    assert read(*given(*files), MU, frame=float(first), **options).pressure == pytest.approx(1.0)
    with pytest.raises(InputError, match=rf"no time ?step 7: there is {first} … {last}$"):
        read(*given(*files), MU, frame=7, **options)


# Of the last snapshot: its rows, its last row, all but its title, its number, the end of a number.
CUTS = [
    *(("lammps", 0, cut) for cut in ("\n9 1 2.5", " 2.5 0.5\n", "\nITEM: ATOMS", "\n200\n")),
    *(("lammps", 1, cut) for cut in ("\n9 3 1", " 0 0\n", "\nITEM: NUMBER", "\n200\n")),
    *(("mercury", 0, cut) for cut in ("\n2.5 2.5", " 0 0\n", "\n0.5 0.5", " 3 3 1\n")),
    ("mercury", 1, " -1 0 0\n"),
    *(("lammps", file, cut) for file, cut in ((0, ".5\n"), (0, "\n"), (1, "\n"))),
    *(("mercury", file, "\n") for file in (0, 1)),
]


@pytest.mark.parametrize("name, file, cut", CUTS)
def test_the_last_whole_frame_is_read_where_a_file_is_cut_off(name, file, cut):
    read, files, options, (first, last) = READ[name]
    files = list(files)
    files[file] = files[file][: files[file].rindex(cut)]
    found = read(*given(*files), MU, **options)
    assert found.pressure == pytest.approx(1.0)
    lost = snapshots_of(name, files, options).lost
    if "200" not in cut:  # else the dump ends without a word of it
        assert "is cut off in the given file" in lost and found.info["notes"][0].startswith(lost)
        with pytest.raises(
            InputError, match=rf"no time ?step {last}: there is {first}; .* cut off"
        ):
            read(*given(*files), MU, frame=last, **options)


def snapshots_of(name, files, options):
    opened = {"lammps": lammps.open_lammps, "mercury": mercury.open_mercury}[name]
    found = opened(*given(*files), MU, **options)
    assert isinstance(found, snapshots.Snapshots)
    return found


def some_empty(name, missing):
    """Files of snapshots 0, 1, …, each whole or without "particles" or "contacts"."""
    data = fstat = ""
    for k, what in enumerate(missing):
        one, two = particles(k), contacts(k, k + 1.0)
        if name == "mercury":
            one, two = (text.replace("9 0 ", f"9 {k} ") for text in mercury_files([k + 1.0]))
            two = re.sub(r"(?m)^0 ", f"{k} ", two)
            if what:
                two = f"# {k} 1\n"
            if what == "particles":
                one = f"0 {k} 0 0 0 3 3 1\n"
        elif what:
            two = re.sub(r"(?m)^18$", "0", two[: two.index("py\n") + 3])
            if what == "particles":
                one = re.sub(r"(?m)^9$", "0", one[: one.index("radius\n") + 7])
        data, fstat = data + one, fstat + two
    return data, fstat


@pytest.mark.parametrize("name", READ)
@pytest.mark.parametrize(
    "missing", [case for case in itertools.product(("", "particles", "contacts"), repeat=3)]
)
def test_empty_frames_are_left_out_and_named_unless_they_are_chosen(name, missing, tmp_path):
    read, _, options, _ = READ[name]
    files = some_empty(name, missing)
    whole = [k for k, what in enumerate(missing) if not what]
    if not whole:
        with pytest.raises(InputError, match=r"empty|no line with numbers|no contacts at"):
            read(*given(*files), MU, **options)
        return
    assert list(snapshots_of(name, files, options).numbers) == whole
    for frame in (None, *whole):
        found = read(*given(*files), MU, frame=frame, **options)
        assert found.pressure == pytest.approx(1.0 + (whole[-1] if frame is None else frame))
        assert len(found.info.get("notes", [])) == (
            len(set(missing) - {""}) if frame is None else 0
        )
    for k, what in enumerate(missing):
        if what:
            what = what.replace("particles", "atoms") if name == "lammps" else what
            with pytest.raises(InputError, match=rf"time ?step {k} has no {what}: there is \d"):
                read(*given(*files), MU, frame=k, **options)


@pytest.mark.parametrize("name", READ)
def test_a_series_leaves_out_empty_frames_and_says_so(name, tmp_path, capsys):
    paths = [str(tmp_path / part) for part in ("one", "two")]
    for path, text in zip(paths, some_empty(name, ("particles", "", "contacts")), strict=True):
        Path(path).write_text(text)
    options = ["--mu", "0.3", *(["--box", "3", "3"] if name == "mercury" else [])]
    out = ["--out", str(tmp_path / "s.zarr"), "--cache", str(tmp_path / "cache")]
    assert main(["import", name, *paths, *options, "--frames", "all", "--workers", "1", *out]) == 0
    said = capsys.readouterr()
    assert len(said.out.splitlines()) == 2
    assert re.search("time ?step 0 has no (atoms|particles): left out", said.err)
    assert re.search("time ?step 2 has no contacts: left out", said.err)
    assert main(["import", name, *paths, *options, "--frames", "0,1", *out]) == 2
    assert re.search("time ?step 0 has no (atoms|particles): there is 1", capsys.readouterr().err)


def test_a_comment_without_an_end_cuts_off_no_contact():
    data, fstat = some_empty("mercury", ("", "", "contacts"))
    found = read_mercury(*given(data, fstat.rstrip("\n")), MU, frame=1, box=(3, 3))
    assert found.pressure == pytest.approx(2.0)


def test_a_single_frame_that_is_cut_off_is_refused():
    text = particles(100)
    with pytest.raises(InputError, match="8 rows, but 9 are announced; is the file cut off"):
        read_lammps(*given(text[: text.rindex("\n9 1")], contacts(100, 1.0)), MU)


@pytest.mark.parametrize("name, file", [(name, file) for name in READ for file in (0, 1)])
@pytest.mark.parametrize("before", [[], ["particles"], ["particles", "contacts"]])
def test_a_single_frame_needs_no_end_of_its_last_line(name, file, before):
    """Editors strip it; and empty frames before it do not matter."""
    read, _, options, _ = READ[name]
    files = list(some_empty(name, [*before, ""]))
    files[file] = files[file].rstrip()
    found = read(*given(*files), MU, **options)
    assert found.pressure == pytest.approx(len(before) + 1) and found.info["residual"] < 1e-12


def test_a_single_contact_that_is_cut_off_is_refused():
    data, fstat = mercury_files([1.0])
    for cut in (" -1 0 0\n", "\n0 "):
        end = fstat.rindex(cut) + 2
        with pytest.raises(InputError, match="fields where there should be 16; is the file cut"):
            read_mercury(*given(data, fstat[:end]), MU, box=(3, 3))


@pytest.mark.parametrize("columns", ["xs ys", "xsu ysu"])
@pytest.mark.parametrize("low", [0.0, -2.0])
def test_scaled_coordinates(columns, low):
    bounds = BOX.replace("0 3\n0 3", f"{low} {low + 3}\n{low} {low + 3}")
    dump = particles(1, columns, scale=1 / 3).replace(BOX, bounds)
    found = read_lammps(*given(dump, contacts(1, 1.0)), MU)
    np.testing.assert_allclose(found.x, np.array(PLACES) + 0.5, atol=1e-9)
    assert found.pressure == pytest.approx(1.0)


@pytest.mark.parametrize("index", [False, True])
def test_pairs_that_are_listed_twice_count_once(index):
    names = "c_1[1] c_1[2] c_2[1] c_2[2] c_2[3] c_2[4] c_2[5]"
    once, twice = (
        read_lammps(*given(particles(1), contacts(1, 1.0, both, index, names)), MU)
        for both in ((), [(k, 1) for k in range(5)])
    )
    assert len(twice.contacts.i) == 18 and twice.pressure == once.pressure
    np.testing.assert_array_equal(once.forces, twice.forces)
    with pytest.raises(InputError, match=r"line 28: grains .* before .*line 13.* another force"):
        read_lammps(*given(particles(1), contacts(1, 1.0, [(3, 2)])), MU)


def test_columns_of_dumps_have_any_names():
    text = contacts(1, 1.0, columns="a b c d e f g")
    words = dict(
        zip("abcdefg", ("atom1", "atom2", "distance", "fx", "fy", "px", "py"), strict=True)
    )
    columns = {name: theirs for theirs, name in words.items()} | {"radius": "c_r"}
    grains = particles(1).replace("radius", "c_r")
    assert read_lammps(*given(grains, text), MU, columns=columns).pressure == pytest.approx(1.0)
    with pytest.raises(InputError, match="no column 'q'; the columns are"):
        read_lammps(*given(grains, text), MU, columns=columns | {"fx": "q"})
    with pytest.raises(InputError, match="unknown column 'speed'"):
        read_lammps(*given(grains, text), MU, columns=columns | {"speed": "h"})
    for wrong in (["a", "b"], {"fx": 3}):
        with pytest.raises(InputError, match="columns must be"):
            read_lammps(*given(grains, text), MU, columns=wrong)


def test_named_contacts_need_no_distance():
    text = contacts(1, 1.0).replace("distance", "c_3")
    assert read_lammps(*given(particles(1), text), MU).pressure == pytest.approx(1.0)


def test_rows_of_contacts_have_any_label():
    """As `dump_modify label CONTACTS` writes it."""
    pairs = DUMPS[1].replace("ENTRIES", "CONTACTS")
    assert read_lammps(*given(DUMPS[0], pairs), MU).pressure == pytest.approx(3.0)
    cut = pairs[: pairs.rindex("\n9 3 1")]
    assert read_lammps(*given(DUMPS[0], cut), MU).pressure == pytest.approx(1.0)


def test_titles_of_units_and_times_are_passed_over():
    """As `dump_modify units yes time yes` writes them, before each timestep."""
    grains, pairs = (
        "ITEM: UNITS\nlj\n" + text.replace("ITEM: TIMESTEP", "ITEM: TIME\n0.5\nITEM: TIMESTEP")
        for text in DUMPS
    )
    assert read_lammps(*given(grains, pairs), MU).pressure == pytest.approx(3.0)
    assert read_lammps(*given(grains, pairs), MU, frame=100).pressure == pytest.approx(1.0)


# Compressed


@pytest.mark.parametrize("packer", [gzip, bz2, lzma])
def test_compressed_dumps_are_unpacked(packer):
    packed = [packer.compress(text.encode()) for text in DUMPS]
    assert read_lammps(*given(*packed), MU).pressure == pytest.approx(3.0)
    with pytest.raises(InputError, match=r"cannot be unpacked .* is it cut off\?"):
        read_lammps(*given(packed[0][:-9], packed[1]), MU)


def test_a_zip_archive_is_named():
    with pytest.raises(InputError, match="a ZIP or NPZ archive, not a text file"):
        read_lammps(*given(b"PK\x03\x04" + b"0" * 50, DUMPS[1].encode()), MU)


def test_zstandard_is_unpacked_where_python_can(monkeypatch):
    packed = [b"\x28\xb5\x2f\xfd" + b"0" * 50] * 2
    for module in ("compression", "compression.zstd", "backports", "backports.zstd"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, match=r"zstd -d, or install backports\.zstd"):
        read_lammps(*given(*packed), MU)
    monkeypatch.undo()
    zstd = pytest.importorskip("backports.zstd")
    found = read_lammps(*given(*(zstd.compress(text.encode()) for text in DUMPS)), MU)
    assert found.pressure == pytest.approx(3.0)
    with pytest.raises(InputError, match="cannot be unpacked"):
        read_lammps(*given(*packed), MU)


@pytest.mark.parametrize("damage", [lambda b: b[:-20], lambda b: b[:40] + b"#" * 9 + b[49:]])
def test_damaged_gzip_is_refused(damage):
    content = gzip.compress(DUMPS[0].encode())
    with pytest.raises(InputError, match="cannot be unpacked"):
        read_lammps(*given(damage(content), DUMPS[1]), MU)


def test_what_unpacks_to_far_too_much_is_refused():
    """No more is unpacked than the bound: 200 MB of blanks are 200 KB."""
    bomb = gzip.compress(b" " * 200_000_000, 1)
    with pytest.raises(InputError, match="unpacks to more than 100 times its size"):
        read_lammps(*given(bomb, DUMPS[1]), MU)


# Walls of YADE and MercuryDPM: four disks of diameter 1 in a box of side 2.

BODIES = "#format x_y_z_r_attrs\n# x y z r id\n" + "".join(
    f"{0.5 + x} {0.5 + y} 0 0.5 {4 + x + 2 * y}\n" for y, x in itertools.product((0, 1), (0, 1))
)
INNER = ["4 5 1 0 0 0 0 0", "6 7 1 0 0 0 0 0", "4 6 0 1 0 0 0 0", "5 7 0 1 0 0 0 0"]
# Bodies 0 … 3 are the walls left, right, bottom and top, as the first or the second of a pair.
OUTER = ["0 4 1 0 0 0 0 0", "0 6 1 0 0 0 0 0", "1 5 -1 0 0 0 0 0", "1 7 -1 0 0 0 0 0"]
OUTER += ["4 2 0 -1 0 0 0 0", "5 2 0 -1 0 0 0 0", "3 6 0 -1 0 0 0 0", "7 3 0 1 0 0 0 0"]


def boxed(lines, **options):
    return read_yade(*given(BODIES, "\n".join(lines)), 0.5, **options)


def test_contacts_with_walls_are_loads():
    found, without = boxed(OUTER + INNER), boxed(INNER)
    assert found.forces.tolist() == without.forces.tolist() == [[1, 0]] * 4
    assert found.load.tolist() == [[1, 1, 0], [-1, 1, 0], [1, -1, 0], [-1, -1, 0]]
    (note,) = found.info["notes"]
    assert "8 contacts with walls (0, 1, 2, 3) count as loads" in note
    assert "notes" not in without.info


def test_walls_are_grains_where_asked(tmp_path):
    """24 forces; 12 equations of disks and 8 of walls, two of which follow: h = 6."""
    found = boxed(OUTER + INNER, walls="pressing")
    assert len(found.r) == 8 and len(found.contacts.i) == 12 and found.info["walls"] == 4
    assert np.allclose(found.forces, [[1, 0]] * 12)
    # The force on each wall is its load, and disks have none.
    assert np.allclose(found.load[:4], 0)
    assert np.allclose(found.load[4:], [[2, 0, 0], [-2, 0, 0], [0, 2, 0], [0, -2, 0]])
    assert found.info["residual"] < 1e-12 and ensemble(found).dimension == 6
    assert found.x[4:].tolist() == [[-1, 1], [3, 1], [1, -1], [1, 3]]
    save_packing(found, tmp_path / "p.npz")
    assert ensemble(load_packing(tmp_path / "p.npz")).dimension == 6
    with pytest.raises(InputError, match="no contact with a wall"):
        boxed(INNER, walls="pressing")
    with pytest.raises(InputError, match="periodic in both directions has no walls"):
        boxed(OUTER + INNER, walls="pressing", box=(9, 9))


def test_a_disk_in_a_groove_is_that_of_the_scene():
    """Weight 1 between two walls at ±45°: if held, f_n goes from 0.71/(1 + μ) to 0.71/(1 − μ).

    Where they press, the force on each is given, and nothing is left to choose.
    """
    f = 0.5**0.5
    lines = [f"0 2 {f * f} {f * f} 0 0 0 0", f"1 2 {-f * f} {f * f} 0 0 0 0"]
    files = "#format x_y_z_r_attrs\n# id\n0 0 0 1 2\n", "\n".join(lines)
    S = ensemble(read_yade(*given(*files), 0.5, walls="held"))
    bounds = intervals(S)
    assert S.dimension == 1
    np.testing.assert_allclose(bounds.low[:, 0], f / 1.5, atol=1e-8)
    np.testing.assert_allclose(bounds.high[:, 0], f / 0.5, atol=1e-8)
    assert ensemble(read_yade(*given(*files), 0.5, walls="pressing")).dimension == 0
    for wrong, said in ((None, "no contact of two grains"), ("box", "walls are held or pressing")):
        with pytest.raises(InputError, match=said):
            read_yade(*given(*files), 0.5, walls=wrong)


def mercury_in_a_box(turned):
    """The same box; n and t of the force on the wall (turned = 1) or on the grain (−1)."""
    places = [(x, y) for y in (0, 1) for x in (0, 1)]
    data = ["4 0 0 0 0 2 2 1", *(f"{x + 0.5} {y + 0.5} 0 0 0 0 0.5 0" for x, y in places)]
    rows = []
    for k, (x, y) in enumerate(places):
        for wall, (u, v) in ((-1 - x, (2 * x - 1, 0)), (-3 - y, (0, 2 * y - 1))):
            point = f"{x + 0.5 + 0.5 * u} {y + 0.5 + 0.5 * v} 0"
            rows.append(f"0 {k} {wall} {point} 0 0 1 0 {turned * u} {turned * v} 0 0 0 0")
    for i, j in ((0, 1), (2, 3), (0, 2), (1, 3)):
        u, v = np.subtract(places[j], places[i])
        rows.append(f"0 {i} {j} 0 0 0 0 0 1 0 {-u} {-v} 0 0 0 0")
    return "\n".join(data), "\n".join(rows)


@pytest.mark.parametrize("turned", [1, -1])
def test_walls_of_mercury(turned):
    found = read_mercury(*given(*mercury_in_a_box(turned)), 0.5, walls="pressing")
    assert np.allclose(found.forces, [[1, 0]] * 12) and ensemble(found).dimension == 6
    assert np.allclose(found.load[4:], boxed(OUTER + INNER, walls="pressing").load[4:])
    assert found.info["walls"] == 4


def lammps_in_a_box(walls=("w", "v")):
    """The same box, shifted; the fixes w and v write walls across x and y."""
    low = np.array([3.0, -1.0])
    rows = []
    for k, place in enumerate(itertools.product((0, 1), (0, 1))):
        x = low + place + 0.5
        fixes = []
        for axis in (0, 1):
            out = np.eye(2)[axis] * (2 * place[axis] - 1)
            fixes.append([1, *-out, 0, *(x + out / 2), 0, 0.5])
        words = [k + 1, *x, 0.5, *fixes[0], *(fixes[1] if "v" in walls else [])]
        rows.append(" ".join(f"{word:g}" for word in words))
    columns = " ".join(f"f_{wall}[{k}]" for wall in walls for k in range(1, 9))
    box = "ITEM: BOX BOUNDS ff ff pp\n3 5\n-1 1\n0 1"
    pairs = "1 2 0 -1 0 0\n3 4 0 -1 0 0\n1 3 -1 0 0 0\n2 4 -1 0 0 0\n"
    head = "ITEM: TIMESTEP\n0\nITEM: NUMBER OF {}\n4\n" + box + "\nITEM: {} {}\n{}"
    return (
        head.format("ATOMS", "ATOMS", f"id x y radius {columns}", "\n".join(rows)),
        head.format("ENTRIES", "ENTRIES", "atom1 atom2 fx fy px py", pairs),
    )


@pytest.mark.parametrize("walls", ["pressing", "held"])
def test_walls_of_lammps(walls):
    found = read_lammps(*given(*lammps_in_a_box()), 0.5, walls=walls)
    yade = boxed(OUTER + INNER, walls=walls)
    assert np.allclose(found.forces, [[1, 0]] * 12) and found.info["walls"] == 4
    assert ensemble(found).dimension == ensemble(yade).dimension
    load, same = (values[np.lexsort(values.T)] for values in (found.load, yade.load))
    assert np.allclose(load, same, equal_nan=True)
    assert "(v (0, -1), v (0, 1), w (-1, 0), w (1, 0))" in found.info["notes"][0]


def test_walls_of_lammps_that_are_no_walls_are_refused():
    atoms, links = lammps_in_a_box(["w"])
    for dump, words in (
        (atoms.replace("f_w[8]", "c_w[8]"), "no contact with a wall; dump the columns"),
        (atoms.replace("f_w[3]", "g"), r"no column f_w\[3\]"),
        (atoms.replace(" 3 -0.5 ", " 9 -0.5 "), r"line 10: by f_w\[5\], .* 5.5 from the centre"),
        (atoms.replace("ff ff", "pp pp"), "periodic in both directions has no walls"),
    ):
        with pytest.raises(InputError, match=words) as caught:
            read_lammps(*given(dump, links), 0.5, walls="held")
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="walls are held or pressing"):
        read_lammps(*given(atoms, links), 0.5, walls="box")


@pytest.mark.parametrize("numbers", [("0000", "0001", "0002"), ("8", "9", "10")])
def test_one_file_for_each_step_is_a_series(numbers, tmp_path, monkeypatch, capsys):
    """Steps 1 and 2 are those of the one file, and contacts begin at step 1."""
    monkeypatch.chdir(tmp_path)
    for name, text in zip(("run.data", "run.fstat"), mercury_files([2.0, 1.0, 3.0]), strict=True):
        lines = text.splitlines(keepends=True)
        for k, number in enumerate(numbers):
            step = lines[k * len(lines) // 3 : (k + 1) * len(lines) // 3]
            Path(f"{name}.{number}").write_text("".join(step))
    Path(f"run.fstat.{numbers[0]}").write_text("# no contacts\n")
    opened = mercury.open_mercury("run.data", Path("run.fstat"), MU, box=(3, 3))
    assert opened.numbers == [1, 2] and opened.empty == {0: "contacts"}
    assert [opened.read(k).packing.pressure for k in (1, 2)] == pytest.approx([1.0, 3.0])
    command = "import mercury run.data run.fstat --mu 0.3 --box 3 3 --out"
    assert main([*command.split(), "p.npz"]) == 0 and load_packing("p.npz").pressure == 3.0
    assert main([*command.split(), f"run.data.{numbers[0]}"]) == 2
    Path(f"run.fstat.{numbers[1]}").write_text("1 0 1\n")
    capsys.readouterr()
    assert main([*command.split(), "p.npz"]) == 2
    assert f"run.fstat, line 1 of run.fstat.{numbers[1]}: 3 fields" in capsys.readouterr().err


def test_ids_are_told_by_the_name_of_the_attribute():
    named = BODIES.replace("# x y z r id", "# made by hand\n#b.id")
    found = read_yade(*given(named, "\n".join(OUTER + INNER)), 0.5)
    assert found.forces.tolist() == [[1, 0]] * 4


def test_the_format_tells_the_columns_of_bodies():
    """Of `export.textExt`: with the id in front, or with the material behind."""
    rows = [line.split() for line in BODIES.splitlines()[2:]]
    first = "#format id_x_y_z_r_matId\n" + "\n".join(" ".join([r[4], *r[:4], "0"]) for r in rows)
    found = read_yade(*given(first, "\n".join(OUTER + INNER)), 0.5)
    assert found.forces.tolist() == [[1, 0]] * 4
    last = "#format x_y_z_r_matId\n" + "\n".join(" ".join([*r[:4], "4"]) for r in rows)
    with pytest.raises(InputError, match="whose ids count lines from 0"):
        read_yade(*given(last, "\n".join(INNER)), 0.5)
    with pytest.raises(InputError, match="no column x, y, z, r"):
        read_yade(*given("#format jointedPM\n1 2 3 4 5", "\n".join(INNER)), 0.5)


def test_interactions_have_columns_of_any_name_and_order():
    lines = ["# a b nx ny nz sx sy sz", *INNER]
    names = ("id1", "id2", "fnx", "fny", "fnz", "fsx", "fsy", "fsz")
    columns = dict(zip(names, "a b nx ny nz sx sy sz".split(), strict=True))
    assert boxed(lines, columns=columns).forces.tolist() == [[1, 0]] * 4
    swapped = ["fnx fny fnz fsx fsy fsz id1 id2"]
    swapped += [" ".join(line.split()[2:] + line.split()[:2]) for line in INNER]
    assert boxed(swapped).forces.tolist() == [[1, 0]] * 4


# The sign of tangential forces


def reversed_table():
    """A packing whose tangential forces have the other sign, and its tables."""
    packing = packed(30, MU)
    packing = packing._replace(forces=packing.forces * [1, -1])
    return packing, [file.getvalue() for file in tables(packing)]


def test_the_other_sign_of_tangential_forces_is_noted_and_taken():
    packing, files = reversed_table()
    wrong = read_table(*given(*files), mu=MU, box=packing.box)
    of_sign = [note for note in wrong.info["notes"] if "other sign" in note]
    assert len(of_sign) == 1 and "takes away 100% of the unbalance" in of_sign[0]
    assert "--reverse" in of_sign[0]
    right = read_table(*given(*files), mu=MU, box=packing.box, reverse=True)
    assert not any("other sign" in note for note in right.info.get("notes", []))
    assert right.info["residual"] < 1e-8 < wrong.info["residual"]
    with pytest.raises(InputError, match="leave it out"):
        read_table(*given(files[0]), mu=MU, box=packing.box, reverse=True)


def test_rounding_is_no_reason_to_reverse():
    """A row of three disks between loads: f_n balances but for 1e-14, and f_t is smaller."""
    grains = "x,y,r\n" + "\n".join(f"{x},{y},0.5" for x, y in PLACES)
    rows = [f"{i},{j},{1 + 1e-15 * i},{1e-15 * i}" for i, j, *_ in PAIRS]
    found = read_table(*given(grains, "\n".join(["i,j,fn,ft", *rows])), mu=MU, box=(3, 3))
    assert "notes" not in found.info


def test_notes_go_to_stderr(away, capsys):
    (away / "b.txt").write_text(BODIES)
    (away / "i.txt").write_text("\n".join(OUTER + INNER))
    assert main(["import", "yade", "b.txt", "i.txt", "--mu", "0.5", "--json"]) == 0
    out, err = capsys.readouterr()
    assert err.startswith("granforce: 8 contacts with walls") and out.startswith("{")
    assert (
        main(["import", "yade", "b.txt", "i.txt", "--mu", "0.5", "--walls", "held", "--json"]) == 0
    )
    assert '"walls": 4' in capsys.readouterr().out
