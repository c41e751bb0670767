"""Packings from files: known numbers, exact round trips, and errors that say what to do."""

import io
import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from packings import skewed

import granforce as gf
from granforce.forces.balance import stress_of
from granforce.forces.build import ensemble
from granforce.numerics import interior_point
from granforce.packing.closing import margin
from granforce.packing.compaction import pack
from granforce.packing.exporters import save_lammps
from granforce.packing.importers import (
    lammps,
    load_packing,
    read_known,
    read_lammps,
    read_table,
    report,
    save_packing,
)
from granforce.packing.importers.geometry import vectors
from granforce.packing.importers.text import make_table
from granforce.records import (
    InputError,
    InputWarning,
    NotJammedError,
    make_contacts,
    make_packing,
    repeated,
)

HERE = Path(__file__).parents[1]
REFERENCES = sorted((HERE / "reference").glob("n*_s??.npz"))
PARTICLES, CONTACTS = (
    HERE / "lammps" / f"lammps_n400_mu0.3.{kind}.dump" for kind in ("particles", "contacts")
)
SMALL = HERE / "reference" / "n100_mu0.1_s11.npz"


def csv(**columns):
    """A CSV file in memory with all digits of its columns."""
    rows = zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    return io.StringIO("\n".join(lines) + "\n")


def tables(packing, forces=True, **grain_columns):
    c = packing.contacts
    grains = csv(x=packing.x[:, 0], y=packing.x[:, 1], r=packing.r, **grain_columns)
    carried = {"fn": packing.forces[:, 0], "ft": packing.forces[:, 1]} if forces else {}
    normals = {"nx": c.normal[:, 0], "ny": c.normal[:, 1], "length": c.length}
    return grains, csv(i=c.i, j=c.j, **normals, **carried)


def assert_same(a, b, **tolerance):
    same = np.testing.assert_allclose if tolerance else np.testing.assert_array_equal
    for one, two in zip([*a.contacts, *a], [*b.contacts, *b], strict=True):
        if one is not None and one is not a.contacts and not isinstance(one, dict):
            same(one, two, **tolerance)


def cluster(packing, reach):
    """The grains within reach of the first one, as an open set under the forces cut around it."""
    c, box = packing.contacts, packing.box
    x = packing.x - packing.x[0]
    x -= box * np.round(x / box)
    inside = np.hypot(*x.T) < reach
    number = np.cumsum(inside) - 1
    load = np.zeros((len(x), 3))
    tangent = np.column_stack([-c.normal[:, 1], c.normal[:, 0]])
    force = packing.forces[:, :1] * c.normal + packing.forces[:, 1:] * tangent
    kept = inside[c.i] & inside[c.j]
    for grain, sign, arm in ((c.i, -1.0, c.arm_i), (c.j, 1.0, c.arm_j)):
        cut = inside[grain] & ~kept
        np.add.at(load[:, :2], grain[cut], sign * force[cut])
        np.add.at(load[:, 2], grain[cut], -(arm * packing.forces[:, 1])[cut])
    r = packing.r[inside]
    contacts = make_contacts(
        number[c.i[kept]], number[c.j[kept]], c.normal[kept], c.length[kept], r
    )
    return make_packing(
        x[inside], r, (np.inf, np.inf), contacts, packing.forces[kept], packing.mu,
        load=load[inside],
    )  # fmt: skip


# NPZ


@pytest.mark.parametrize("path", REFERENCES, ids=lambda path: path.stem)
def test_reference_packings_are_balanced_inside_their_cones(path, monkeypatch):
    packing = load_packing(path)
    with monkeypatch.context() as patch:
        patch.setattr(interior_point, "look", None)  # a report compiles nothing
        known = report(packing)
    assert known["grains"] == len(np.load(path)["r"])
    assert known["contacts"] == len(np.load(path)["fn"])
    assert known["residual"] < 2e-12
    assert known["violation"] < 1e-12
    assert known["pressure"] == 1.0
    S = ensemble(packing)
    assert S.residual(S.original) < 1e-8 and S.dimension == known["dimension"] > 0


def test_report_counts_what_the_paper_counts():
    known = report(load_packing(SMALL))
    assert known["backbone_grains"] == 89 and known["backbone_contacts"] == 159
    assert known["rattlers"] == 11
    assert known["coordination"] == pytest.approx(2 * 159 / 89)
    assert known["dimension"] == 2 * 159 - (3 * 89 - 1)
    assert 0.8 < known["packing_fraction"] < 0.85
    assert 0 <= known["largest_overlap"] < 1e-4
    apart = margin(load_packing(SMALL))
    assert (known["largest_contact_gap"], known["least_other_gap"]) == apart
    assert json.loads(json.dumps(known)) == known


def test_soft_disks_have_no_margin():
    known = report(read_lammps(PARTICLES, CONTACTS, 0.3))
    assert known["largest_contact_gap"] is known["least_other_gap"] is None


def test_report_without_forces_says_none():
    packing = load_packing(SMALL)
    known = report(packing._replace(forces=np.zeros_like(packing.forces)))
    assert known["residual"] is known["violation"] is known["mean_normal_force"] is None
    assert known["backbone_contacts"] == 159


def wide(packing):
    """The same disks in a box wider than high: the right half is empty."""
    return packing._replace(box=packing.box * [2.0, 1.0], pressure=np.nan)


@pytest.mark.parametrize(
    "variant",
    [
        lambda p: p,
        wide,
        lambda p: skewed(p)[0],
        lambda p: cluster(p, 5.0),
        lambda p: p._replace(info={"seed": 3, "steps": np.int64(7), "note": "μ", "x": 0.1 + 0.2}),
        lambda p: read_lammps(PARTICLES, CONTACTS, 0.3),
    ],
    ids=["periodic", "rectangular", "tilted", "open", "info", "soft"],
)
def test_saved_packings_come_back_to_the_last_bit(tmp_path, variant):
    packing = variant(load_packing(SMALL))
    save_packing(packing, tmp_path / "p.npz")
    again = load_packing(tmp_path / "p.npz")
    assert_same(packing, again)
    assert again.info == packing.info
    assert again.x.dtype == again.forces.dtype == np.float64 and again.contacts.i.dtype == np.int64
    with open(tmp_path / "p.npz", "rb") as file:
        assert_same(packing, load_packing(file))
    file = io.BytesIO()
    save_packing(packing, file)
    assert_same(packing, load_packing(io.BytesIO(file.getvalue())))
    assert [path.name for path in tmp_path.iterdir()] == ["p.npz"]


def test_saving_leaves_nothing_behind_when_it_fails(tmp_path):
    packing = load_packing(SMALL)
    with pytest.raises(InputError, match="plain numbers"):
        save_packing(packing._replace(info={"a": object()}), tmp_path / "p.npz")
    (tmp_path / "taken.npz").mkdir()
    with pytest.raises(InputError, match="cannot write"):
        save_packing(packing, tmp_path / "taken.npz")
    for name in ("a.csv", "b"):
        with pytest.raises(InputError, match=rf"{name}: the name must end with \.npz"):
            save_packing(packing, tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == ["taken.npz"]
    save_packing(packing, "/dev/null")


def archive(**changes):
    """The small reference with arrays replaced, or left out where None, as an open file."""
    arrays = {**np.load(SMALL), **changes}
    file = io.BytesIO()
    np.savez(file, **{key: value for key, value in arrays.items() if value is not None})
    file.seek(0)
    return file


def altered(key, position, value):
    array = np.load(SMALL)[key].copy()
    array[position] = value
    return {key: array}


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"fn": None}, "no array fn"),
        ({"L": None}, r"no array L \(or Lx, Ly\)"),
        ({"mu": -0.1}, "friction coefficient"),
        ({"mu": [0.1, 0.2]}, "mu must be one number"),
        ({"P": 0.0}, "pressure must be finite and > 0"),
        ({"L": 1.5}, "box sides"),
        ({"x": np.array([{"pickled": 1}])}, "plain arrays"),
        ({"x": np.zeros((3, 2))}, "centres must have shape"),
        ({"r": np.full(100, "a")}, "array r has type"),
        ({"r": np.empty(0)}, "no grains"),
        ({"i": np.load(SMALL)["i"].astype(float)}, "array i has type"),
        ({"info": np.array("[1]")}, "not a JSON object"),
        ({"arm_i": np.ones(164), "arm_j": np.ones(164)}, "lever arms arm_i"),
        (altered("r", 5, -1.0), "radius of grain 5"),
        (altered("fn", 5, np.nan), "fn contains NaN"),
        (altered("i", 5, 100), "outside 0 … 99"),
        (altered("branch", 5, 0.5), "contact 5: grains .* overlap by"),
        (altered("branch", 5, 5.0), "contact 5: grains .* are apart by"),
        (altered("nx", 5, 5.0), "unit vectors"),
    ],
)
def test_damaged_archives_are_refused_with_a_reason(changes, message):
    with pytest.raises(InputError, match=message):
        load_packing(archive(**changes))


def test_archives_that_announce_more_than_allowed_are_refused():
    with pytest.raises(InputError, match=r"more than 0\.01 MB unpacked"):
        load_packing(SMALL, unpacked=10_000)


# LAMMPS


def test_lammps_packing_is_one_point_of_its_ensemble():
    packing = read_lammps(PARTICLES, CONTACTS, 0.3)
    assert len(packing.r) == 400 and len(packing.contacts.i) == 615
    assert packing.info["contacts_skipped"] == 984 - 615
    assert packing.info["timestep"] == 1900000
    assert report(packing)["rattlers"] == 49
    S = ensemble(packing)
    assert S.residual(S.original) < 1e-9
    assert S.violation(S.original) < 1e-9
    assert (len(S.grains), len(S.index), S.dimension) == (351, 604, 156)
    virial = packing.forces[:, 0] @ packing.contacts.length
    assert packing.pressure == virial / (2 * packing.volume)
    np.testing.assert_allclose(
        packing.contacts.arm_i + packing.contacts.arm_j, packing.contacts.length, rtol=1e-14
    )


def lines(path):
    return path.read_text().splitlines()


def rewritten(particles=lambda rows: rows, contacts=lambda rows: rows):
    """Both dumps as open files, the words of their rows changed."""

    def apply(path, change):
        text = lines(path)
        head = next(k for k, line in enumerate(text) if line.startswith(("ITEM: AT", "ITEM: EN")))
        body = change([line.split() for line in text[head:]])
        return io.StringIO("\n".join(text[:head] + [" ".join(row) for row in body]))

    return apply(PARTICLES, particles), apply(CONTACTS, contacts)


def test_lammps_columns_come_in_any_order_and_unwrapped():
    def unwrapped(rows):
        side = 29.747389457354078
        return [
            ["ITEM:", "ATOMS", "diameter", "xu", "yu", "id"],
            *([repr(2 * float(r)), repr(float(x) - side), y, n] for n, _, x, y, r in rows[1:]),
        ]

    shuffled = np.random.default_rng(1).permutation(984) + 1

    def mixed(rows):
        head = ["ITEM:", "ENTRIES", "distance", "fx", "fy", "px", "py", "atom2", "atom1"]
        return [head, *([*rows[k][2:], rows[k][1], rows[k][0]] for k in shuffled)]

    packing = read_lammps(*rewritten(unwrapped, mixed), 0.3)
    plain = read_lammps(PARTICLES, CONTACTS, 0.3)
    np.testing.assert_allclose(packing.x, plain.x, atol=1e-12)
    assert packing.pressure == pytest.approx(plain.pressure, rel=1e-12)
    assert packing.info["residual"] < 1e-9
    assert packing.contacts.i.tolist() != plain.contacts.i.tolist()


def test_lammps_columns_may_be_named():
    def extra(rows):
        head = ["ITEM:", "ENTRIES", *"zabcdefg"]
        return [head, *(["7", *row] for row in rows[1:])]

    dumps = rewritten(contacts=extra)
    columns = dict(zip(lammps.CONTACT_COLUMNS, "abcdefg", strict=True))
    packing = read_lammps(*dumps, 0.3, columns=columns)
    assert_same(packing, read_lammps(PARTICLES, CONTACTS, 0.3))
    with pytest.raises(InputError, match=r"8 columns .*columns="):
        read_lammps(*rewritten(contacts=extra), 0.3)


def total_only(rows):
    """Contacts with their total force in columns of any name, as `force` of LIGGGHTS."""
    sums = ([float(row[k]) + float(row[k + 2]) for k in (3, 4)] for row in rows[1:])
    total = [[*row[:2], *map(repr, force), "0"] for row, force in zip(rows[1:], sums, strict=True)]
    return [["ITEM:", "ENTRIES", *"abcde"], *total]


def test_lammps_total_forces_are_split_at_the_line_of_centres():
    columns = dict(zip(("atom1", "atom2", "fx", "fy"), "abcd", strict=True))
    found = read_lammps(*rewritten(contacts=total_only), 0.3, columns=columns)
    plain = read_lammps(PARTICLES, CONTACTS, 0.3)
    np.testing.assert_allclose(found.forces, plain.forces, atol=1e-12)
    assert found.info["residual"] < 1e-9 and "notes" not in found.info

    def normal_only(rows):
        return total_only([rows[0], *([*row[:5], "0", "0"] for row in rows[1:])])

    with pytest.warns(InputWarning, match="all forces point along the line of centres"):
        read_lammps(*rewritten(contacts=normal_only), 0.3, columns=columns)


def test_lammps_reads_the_last_common_timestep_and_shifted_boxes():
    low, side = -3.5, 29.747389457354078
    particles = lines(PARTICLES)
    shifted = [*particles]
    shifted[5:7] = [f"{low!r} {low + side!r}"] * 2
    for k, row in enumerate(map(str.split, particles[9:]), start=9):
        x, y = (repr(float(word) + low) for word in row[2:4])
        shifted[k] = f"{row[0]} {row[1]} {x} {y} {row[4]}"
    early = ["ITEM: TIMESTEP", "5", *particles[2:9], *(["1 1 0 0 nan"] * 400)]
    only_grains = ["ITEM: TIMESTEP", "1900001", *early[2:]]
    dump = io.BytesIO("\n".join([*early, *shifted, *only_grains]).encode())
    packing = read_lammps(dump, CONTACTS, 0.3)
    plain = read_lammps(PARTICLES, CONTACTS, 0.3)
    np.testing.assert_allclose(packing.x, plain.x, atol=1e-12)
    assert packing.info["timestep"] == 1900000 and packing.info["residual"] < 1e-9


def test_lammps_walls_become_loads():
    """Along an open direction the grains at the border keep what their images held."""
    text = PARTICLES.read_text().replace("pp pp pp", "ff pp pp")
    kept = [
        line for line in lines(CONTACTS)[9:]
        if abs(np.subtract(*(_x_of(line.split()[k]) for k in (0, 1)))) < 5
    ]  # fmt: skip
    head = lines(CONTACTS)[:9]
    head[3] = str(len(kept))
    packing = read_lammps(io.StringIO(text), io.StringIO("\n".join(head + kept)), 0.3)
    assert np.isinf(packing.box[0]) and np.isnan(packing.pressure)
    mean = packing.forces[:, 0].mean()
    loaded = np.hypot(*packing.load[:, :2].T) > 1e-6 * mean
    edge = np.minimum(packing.x[:, 0], 29.7473894 - packing.x[:, 0]) < 2.0  # two radii
    assert 10 < loaded.sum() < 60 and np.all(edge[loaded])
    assert packing.info["residual"] < 1e-9
    assert ensemble(packing).dimension > 0


def _x_of(grain):
    return float(lines(PARTICLES)[8 + int(grain)].split()[2])


def tilted_text(flags, xy, xz):
    """The particle dump with another box, but its bounds and positions as they were."""
    text = lines(PARTICLES)
    text[4] = f"ITEM: BOX BOUNDS xy xz yz {flags}"
    for k, tilt in enumerate((xy, xz, 0.0)):
        text[5 + k] += f" {tilt!r}"
    return io.StringIO("\n".join(text)), CONTACTS


def triclinic(packing, basis, scaled=False, angle=None):
    """The dumps of a packing in another cell of its lattice, turned so that a lies along x.

    Written as LAMMPS documents it (docs.lammps.org, Howto triclinic): bounds are those of the
    rectangle around the cell, tilts stand in a third column. With an angle the particles' dump is
    general triclinic: the cell and its positions, but not the contacts, turned by it.
    """
    other, turn = skewed(packing, basis)
    (width, height), tilt = other.box.tolist(), other.tilt
    low = [-2.5, 4.0]
    bounds = [
        "ITEM: BOX BOUNDS xy xz yz pp pp pp",
        f"{low[0] + min(0.0, tilt)!r} {low[0] + width + max(0.0, tilt)!r} {tilt!r}",
        f"{low[1]!r} {low[1] + height!r} 0.0",
        "-0.5 0.5 0.0",
    ]
    spin = np.eye(2)
    if angle is not None:
        spin = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        sides = zip((other.cell.vectors @ spin).tolist(), low, strict=True)
        bounds = [
            "ITEM: BOX BOUNDS abc origin pp pp pp",
            *(f"{a} {b} 0 {c}" for (a, b), c in sides),
        ]
        bounds.append("0 0 1 -0.5")
    x = other.cell.parts(other.x) if scaled else other.cell.wrapped(other.x) @ spin + low

    def placed(row):
        across, up = x[int(row[0]) - 1].tolist()
        return f"{row[0]} {row[1]} {across!r} {up!r} {row[4]}"

    def turned(row):
        forces = np.array(row[3:7], float).reshape(2, 2) @ turn
        return " ".join([*row[:3], *map(repr, forces.ravel().tolist())])

    files = []
    for path, change in ((PARTICLES, placed), (CONTACTS, turned)):
        text = lines(path)
        rows = [change(line.split()) for line in text[9:]]
        head = text[8].replace(" x y ", " xs ys ") if scaled else text[8]
        files.append(io.StringIO("\n".join([*text[:4], *bounds, head, *rows])))
    return files


@pytest.mark.parametrize(
    "basis, scaled, angle",
    [
        (((2, 1), (1, 1)), False, None),
        (((2, 1), (1, 1)), True, None),
        (((1, 1), (0, 1)), False, None),
        (((1, -1), (1, 0)), True, None),
        (((1, 3), (0, 1)), False, None),
        (((1, 1), (0, 1)), False, 2.0),
        (((1, -1), (1, 0)), True, -0.3),
    ],
)
def test_lammps_tilted_boxes_are_read(basis, scaled, angle):
    """The same structure in another cell: the same forces, pressure, contacts and dimension."""
    plain = read_lammps(PARTICLES, CONTACTS, 0.3)
    packing = read_lammps(*triclinic(plain, basis, scaled, angle), 0.3)
    other, turn = skewed(plain, basis)
    assert packing.tilt == pytest.approx(other.tilt, abs=1e-9) and packing.tilt != 0
    np.testing.assert_allclose(packing.box, other.box, rtol=1e-12)
    parts = packing.cell.parts(packing.x)
    assert parts.min() >= -1e-12 and parts.max() < 1 + 1e-12
    apart = packing.cell.nearest(packing.x - plain.x @ turn)
    np.testing.assert_allclose(apart, 0, atol=1e-11)
    np.testing.assert_array_equal(packing.contacts.i, plain.contacts.i)
    np.testing.assert_allclose(packing.contacts.normal, plain.contacts.normal @ turn, atol=1e-11)
    mean = plain.forces[:, 0].mean()
    np.testing.assert_allclose(packing.forces, plain.forces, atol=1e-9 * mean)
    assert packing.pressure == pytest.approx(plain.pressure, rel=1e-11)
    assert packing.info["residual"] < 1e-9
    S, T = ensemble(plain), ensemble(packing)
    assert (T.dimension, len(T.grains), len(T.index)) == (S.dimension, len(S.grains), len(S.index))


def test_isotropic_packings_come_back_from_lammps(tmp_path):
    packing = pack(20, 0.3, 7, box="isotropic", radii="bidisperse:1,1.4,0.5", pressure=2.0)
    files = tmp_path / "particles.dump", tmp_path / "contacts.dump"
    save_lammps(packing, *files)
    again = read_lammps(*files, 0.3)
    assert again.tilt == pytest.approx(packing.tilt, abs=1e-12) and packing.tilt != 0
    np.testing.assert_allclose(stress_of(again, again.forces), [2, 2, 0], rtol=0, atol=1e-9)
    S = ensemble(again, prescribed="stress", stress=(2, 2, 0))
    assert S.residual(again.forces[S.index]) < 1e-9
    assert S.dimension == ensemble(packing, prescribed="stress").dimension


def written(text):
    return io.StringIO("\n".join(text))


def test_lammps_bounds_are_those_of_the_manual():
    """A box of sides 9.838049, 8.52 tilted by 4.91902 is dumped as 0 … 14.757069."""
    text = lines(PARTICLES)
    text[3] = "1"
    text[4:8] = ["ITEM: BOX BOUNDS xy xz yz", "0 14.757069 4.91902", "0 8.52 0", "0 15 0"]
    low, *_, cell = lammps.box_of("dump", lammps.read_dump(written(text[:10])).items(1900000))
    assert low.tolist() == [0, 0] and cell.box == pytest.approx([9.838049, 8.52])
    assert cell.tilt == 4.91902
    text[5] = "-4.91902 9.838049 -4.91902"
    low, *_, cell = lammps.box_of("dump", lammps.read_dump(written(text[:10])).items(1900000))
    assert low.tolist() == [0, 0] and cell.box == pytest.approx([9.838049, 8.52])
    assert cell.tilt == -4.91902


def test_lammps_boxes_tilted_by_whole_sides_are_straight():
    """``box tilt large`` lets a box lean as far as it was sheared."""
    side = 29.747389457354078
    text = lines(PARTICLES)
    text[4:7] = ["ITEM: BOX BOUNDS xy xz yz pp pp pp", f"0 {2 * side!r} {side!r}", f"0 {side!r} 0"]
    text[7] += " 0"
    packing = read_lammps(io.StringIO("\n".join(text)), CONTACTS, 0.3)
    assert abs(packing.tilt) < 1e-12
    plain = read_lammps(PARTICLES, CONTACTS, 0.3)
    np.testing.assert_allclose(packing.cell.nearest(packing.x - plain.x), 0, atol=1e-11)
    np.testing.assert_allclose(packing.forces, plain.forces, rtol=1e-9, atol=1e-15)


def particle_text(old, new):
    return io.StringIO(PARTICLES.read_text().replace(old, new)), CONTACTS


def general_text(*sides):
    """The particle dump in a general triclinic box."""
    text = lines(PARTICLES)
    text[4:8] = ["ITEM: BOX BOUNDS abc origin pp pp pp", *sides, "0 0 1 0"]
    return io.StringIO("\n".join(text)), CONTACTS


def contact_text(old, new):
    return PARTICLES, io.StringIO(CONTACTS.read_text().replace(old, new))


def swapped_columns(rows):
    return [rows[0], *([*row[:3], *row[5:], *row[3:5]] for row in rows[1:])]


def other_force(rows):
    """The last row tells of the pair of the first, from the other side, half of its force."""
    j, i, length, *forces = rows[1]
    half = [repr(-0.5 * float(force)) for force in forces]
    return [*rows[:-1], [i, j, length, *half]]


@pytest.mark.parametrize(
    "dumps, message",
    [
        (lambda: (PARTICLES, PARTICLES), "no 'ITEM: ENTRIES'"),
        (lambda: (CONTACTS, PARTICLES), "no 'ITEM: ATOMS'"),
        (lambda: (SMALL, CONTACTS), "not a text file"),
        (lambda: (HERE / "nowhere", CONTACTS), r"nowhere: cannot be read \(No such file"),
        (lambda: (HERE, CONTACTS), "cannot be read"),
        (lambda: (io.BytesIO(b" \n"), CONTACTS), "empty"),
        (lambda: (io.StringIO("x,y,r\n1,2,3"), CONTACTS), "line 1: no 'ITEM: TIMESTEP'"),
        (lambda: particle_text("1900000", "19"), "no timestep in common"),
        (lambda: particle_text("1900000", "-1"), "line 2: '-1' is not a whole number"),
        (lambda: particle_text("\n400\n", "\n401\n"), "400 rows, but 401 are announced"),
        (lambda: particle_text("pp pp pp", "xy xz yz pp pp pp"), "line 6: 2 fields for 3 columns"),
        (lambda: particle_text("pp pp pp", "abc origin pp pp pp"), "line 6: 2 fields for 4"),
        (lambda: general_text("9 0 0 0", "0 9 1 0"), "line 7: a and b must lie in the x–y plane"),
        (lambda: general_text("0 9 0 0", "9 0 0 0"), "line 6: .* not a right-handed system"),
        (lambda: particle_text("pp pp pp", "abc pp pp pp"), "of kind 'abc pp pp pp' are not"),
        (lambda: tilted_text("pp pp pp", 0.0, 1.0), "line 7: tilted out of the plane; only xy"),
        (lambda: tilted_text("ff pp pp", 5.0, 0.0), "line 5: a cell tilted by 5 must be periodic"),
        (lambda: tilted_text("pp pp pp", 31.0, 0.0), "line 6: the upper bound of the box"),
        (lambda: tilted_text("pp pp pp", 1.0, 0.0), "overlap by .* check positions"),
        (lambda: particle_text("2.9747389457354078e+01", "-1"), "line 6: the upper bound"),
        (lambda: particle_text("2.9747389457354078e+01", "2.9e+01"), "line"),
        (lambda: particle_text(" radius", " mass"), "no column radius"),
        (lambda: particle_text("\n1 1 22.6", "\n1 1 1 22.6"), "line 10: 6 fields for 5 columns"),
        (lambda: particle_text("0.971220598135208", "0"), "line 10: radius 0 is not positive"),
        (lambda: particle_text("0.971220598135208", "nan"), "line 10: radius is 'nan'"),
        (lambda: particle_text("\n2 1 2.47", "\n1 1 2.47"), "line 11: id '1' already .* line 10"),
        (lambda: particle_text("22.6549104243892", "23.1"), "overlap by .* check positions"),
        (lambda: contact_text("\n110 400 1.49", "\n110 4000 1.49"), "line 10: atom2 .* '4000'"),
        (lambda: contact_text("\n110 400 1.49", "\n110 400 1.45"), "line 10: centre distance 1.45"),
        (lambda: contact_text("\n110 400 1.49", "\n110 110 1.49"), "line 10: .* at the same point"),
        (lambda: contact_text("0.000310905322829523", "1e999"), "line 10: fy is '1e999'"),
        (lambda: rewritten(contacts=swapped_columns), "normal force does not point .* columns"),
        (lambda: rewritten(contacts=other_force), "given before .* with another force"),
    ],
)  # fmt: skip
def test_wrong_dumps_are_refused_with_a_reason(dumps, message):
    with pytest.raises(InputError, match=message) as caught:
        read_lammps(*dumps(), 0.3)
    assert "\n" not in str(caught.value)


def test_pulling_networks_are_refused():
    def pulling(rows):
        flip = lambda word: word[1:] if word.startswith("-") else "-" + word  # noqa: E731
        return [rows[0], *([*row[:3], *map(flip, row[3:])] for row in rows[1:])]

    with pytest.raises(InputError, match="sign"):
        read_lammps(*rewritten(contacts=pulling), 0.3)


# Tables


def test_tables_of_tilted_boxes_are_read():
    """With and without contacts, the nearest images and the normals given."""
    plain = load_packing(SMALL)
    packing = skewed(plain)[0]
    told = {"mu": 0.1, "box": packing.box, "tilt": packing.tilt}
    again = read_table(*tables(packing), **told)
    assert again.tilt == packing.tilt
    np.testing.assert_allclose(again.forces, packing.forces, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(again.contacts.normal, packing.contacts.normal, atol=1e-12)
    assert again.pressure == pytest.approx(plain.pressure, rel=1e-9)
    c = packing.contacts
    nearest = read_table(
        csv(x=packing.x[:, 0], y=packing.x[:, 1], r=packing.r),
        csv(i=c.i, j=c.j, fn=packing.forces[:, 0], ft=packing.forces[:, 1]),
        **told,
    )
    np.testing.assert_allclose(nearest.contacts.normal, c.normal, atol=1e-8)
    grains, _ = tables(packing)
    found = read_table(grains, **told)
    straight = read_table(tables(plain)[0], mu=0.1, box=plain.box)
    assert ensemble(found).dimension == ensemble(straight).dimension
    assert found.volume == pytest.approx(straight.volume)
    assert len(found.contacts.i) == len(straight.contacts.i)
    with pytest.raises(InputError, match="periodic in both directions"):
        read_table(tables(packing)[0], mu=0.1, tilt=1.0)
    with pytest.raises(InputError, match="overlap by"):
        read_table(*tables(packing), mu=0.1, box=packing.box, tilt=packing.tilt + 0.7)


@pytest.mark.parametrize("path", REFERENCES, ids=lambda path: path.stem)
def test_tables_with_forces_give_the_packing_back(path):
    packing = load_packing(path)
    again = read_table(*tables(packing), box=packing.box, mu=packing.mu)
    assert_same(again, packing, rtol=1e-9, atol=1e-12)
    assert again.info["residual"] < 1e-8
    assert report(again)["dimension"] == report(packing)["dimension"]


def test_tables_with_total_forces_give_the_packing_back():
    packing = load_packing(SMALL)
    c, told = packing.contacts, {"box": packing.box, "mu": packing.mu}
    fx, fy = vectors(packing.forces, c.normal).T
    links = csv(i=c.i, j=c.j, fx=fx, fy=fy)
    again = read_table(tables(packing)[0], links, **told)
    np.testing.assert_allclose(again.forces, packing.forces, atol=1e-7)
    assert again.info["forces"] == "given"
    with pytest.raises(InputError, match="no contact presses; check the sign"):
        read_table(tables(packing)[0], csv(i=c.i, j=c.j, fx=-fx, fy=-fy), **told)


def test_tables_without_forces_find_a_network():
    packing = load_packing(SMALL)
    found = read_table(*tables(packing, forces=False), box=packing.box, mu=packing.mu, pressure=2.0)
    assert found.pressure == 2.0 and found.info["forces"] == "found"
    assert found.info["residual"] < 1e-10 and found.info["violation"] < 1e-10
    ignored = read_table(*tables(packing), box=packing.box, mu=packing.mu, forces=False)
    np.testing.assert_allclose(2 * ignored.forces, found.forces, atol=1e-6)
    assert np.abs(ignored.forces - packing.forces).max() > 0.01


def test_contacts_are_detected_from_positions():
    packing = load_packing(SMALL)
    grains, _ = tables(packing)
    found = read_table(grains, box=packing.box, mu=packing.mu)
    pairs = {frozenset(pair) for pair in zip(found.contacts.i, found.contacts.j, strict=True)}
    c = packing.contacts
    assert {frozenset(pair) for pair in zip(c.i, c.j, strict=True)} <= pairs
    assert found.info["residual"] < 1e-10


def test_packings_that_are_not_jammed_name_the_grains():
    packing = load_packing(SMALL)
    grains, contacts = tables(packing, forces=False)
    few = io.StringIO("\n".join(contacts.getvalue().splitlines()[:40]))
    with pytest.raises(NotJammedError, match="grains with the largest unbalanced load"):
        read_table(grains, few, box=packing.box, mu=packing.mu)


def test_relabelled_grains_make_the_same_packing():
    packing = load_packing(SMALL)
    rng = np.random.default_rng(2)
    order, new = rng.permutation(100), rng.permutation(1000)[:100]
    c, f = packing.contacts, packing.forces
    grains = csv(id=new[order], x=packing.x[order, 0], y=packing.x[order, 1], r=packing.r[order])
    mixed = rng.permutation(len(c.i))
    contacts = csv(fn=f[mixed, 0], ft=f[mixed, 1], j=new[c.i[mixed]], i=new[c.j[mixed]])
    again = read_table(grains, contacts, box=packing.box, mu=packing.mu)
    assert again.info["residual"] < 1e-8
    known, plain = report(again), report(packing)
    for key in plain:
        assert known[key] == pytest.approx(plain[key], rel=1e-9, abs=1e-8), key


PRESSED_PAIR = "id,x,y,r,fx\na,0,0,1,3\nb,2,0,1,-3\n"


@pytest.mark.parametrize(
    "text",
    [
        PRESSED_PAIR.replace("\n", ",\n"),
        PRESSED_PAIR.replace("3\n", "3,,\n"),
        "# made by a program\n#\n\n" + PRESSED_PAIR,
        "% two grains, in m\n" + PRESSED_PAIR.replace(",", ";"),
        PRESSED_PAIR.replace("\n", "\r"),
    ],
    ids=["separators at the ends", "in rows only", "comments", "of another kind", "returns"],
)
def test_what_programs_add_to_tables_is_left_out(text):
    assert read_table(io.StringIO(text), mu=0.5).forces == pytest.approx(np.array([[3.0, 0.0]]))


@pytest.mark.parametrize("mark", ["# ", "#", "% "])
def test_a_comment_above_numbers_is_the_header(mark):
    text = f"{mark}written 2026\n{mark}id x y r fx\n1 0 0 1 3\n2 2 0 1 -3\n"
    assert read_table(io.StringIO(text), mu=0.5).forces == pytest.approx(np.array([[3.0, 0.0]]))


def test_one_row_that_is_longer_is_still_named():
    for wrong in (PRESSED_PAIR.replace("-3\n", "-3,7\n"), PRESSED_PAIR.replace("a,", "# a\na,")):
        with pytest.raises(InputError, match=r"line \d: \d fields for 5 columns"):
            read_table(io.StringIO(wrong), mu=0.5)


def test_separators_names_and_bytes():
    text = "\ufeffID;R;X;Y;note\na;1;0;0;\nb;1;2;0;wall\n"
    loads = "id,x,y,r,fx\na,0,0,1,3\nb,2,0,1,-3\n"
    assert read_table(io.BytesIO(loads.encode()), mu=0.5).forces == pytest.approx(
        np.array([[3.0, 0.0]])
    )
    packing = read_table(io.BytesIO(text.encode()), io.StringIO("i\tj\tfn\nb\ta\t3\n\n"), mu=0)
    assert packing.contacts.i.tolist() == [1] and packing.load[:, 0].tolist() == [3.0, -3.0]


def test_open_set_cut_out_of_a_packing_is_balanced_under_the_cut_forces():
    part = cluster(load_packing(SMALL), 5.0)
    assert 20 < len(part.r) < 60
    load = dict(zip(("fx", "fy", "torque"), part.load.T, strict=True))
    known = read_table(*tables(part, **load), mu=part.mu)
    assert known.info["residual"] < 1e-9
    told = read_table(*tables(part), mu=part.mu)
    np.testing.assert_allclose(told.load, part.load, atol=1e-9)
    assert told.info["residual"] < 1e-14
    for packing in (known, told):
        S = ensemble(packing)
        assert not S.has_pressure_row and S.admits(S.original, 1e-9)


def test_open_set_under_known_loads_finds_a_network():
    part = cluster(load_packing(SMALL), 5.0)
    load = dict(zip(("fx", "fy", "torque"), part.load.T, strict=True))
    rounded = {name: np.round(column, 6) for name, column in load.items()}
    for given_load, corrected in ((load, False), (rounded, True)):
        found = read_table(*tables(part, forces=False, **given_load), mu=part.mu)
        assert found.info["residual"] < 1e-9 and found.info["violation"] < 1e-9
        np.testing.assert_allclose(found.load, part.load, atol=1e-5)
        assert (found.info.get("load_change", 0.0) > 1e-7) == corrected
    arms = found.contacts.arm_i + found.contacts.arm_j
    np.testing.assert_allclose(arms, found.contacts.length, rtol=1e-15)


def test_networks_scale_with_the_loads():
    part = cluster(load_packing(SMALL), 5.0)
    found = []
    for scale in (1.0, 1e-7, 1e9):
        load = dict(zip(("fx", "fy", "torque"), scale * part.load.T, strict=True))
        found.append(read_table(*tables(part, forces=False, **load), mu=part.mu).forces / scale)
    np.testing.assert_allclose(found[1], found[0], atol=1e-6)
    np.testing.assert_allclose(found[2], found[0], atol=1e-6)


def test_known_bounds_have_the_names_of_earlier_versions_too():
    now = io.StringIO("contact,f_n_low,f_n_high,f_t_high\n3,1,2,\n0,,5,0.5\n")
    before = io.StringIO("contact,f_n_min,f_n_max [packing],f_t_max\n3,1,2,\n0,,5,0.5\n")
    for one, other in zip(read_known(now), read_known(before), strict=True):
        np.testing.assert_array_equal(one, other)
    with pytest.raises(InputError, match="column f_n_low appears twice"):
        read_known(io.StringIO("contact,f_n_min,f_n_low\n3,1,2\n"))


GRAINS = "id,x,y,r\n7,0,0,1\n8,2,0,1\n9,4,0,1\n"
LINKS = "i,j,fn,ft\n7,8,1,0\n8,9,1,0\n"


@pytest.mark.parametrize(
    "grains, contacts, options, message",
    [
        (GRAINS, LINKS, {"mu": -1}, "friction coefficient must be finite and ≥ 0"),
        (GRAINS, LINKS, {"mu": np.nan}, "friction coefficient"),
        (GRAINS, LINKS, {"mu": "much"}, "friction coefficient must be a number"),
        ("", LINKS, {}, "empty"),
        ("\n \n", LINKS, {}, "empty"),
        ("id,x,y,r\n", LINKS, {}, "at least one row"),
        (b"\xff\xfe\x00", LINKS, {}, "not a text file"),
        (GRAINS.replace("r", "radius"), LINKS, {}, "no column r; the columns are id, x, y, radius"),
        (GRAINS.replace("y", "x"), LINKS, {}, "column x appears twice"),
        (GRAINS.replace("8,2,0", "8,2"), LINKS, {}, "line 3: 3 fields for 4 columns"),
        (GRAINS.replace("8,2,0", "8,nan,0"), LINKS, {}, "line 3: x is 'nan', not a finite"),
        (GRAINS.replace("8,2,0", "8,2_,0"), LINKS, {}, "line 3: x is '2_'"),
        (GRAINS.replace("8,2,0", "8,1e200,0"), LINKS, {}, "line 3: x is '1e200'"),
        (GRAINS.replace("8,2,0", "8,1e50,0"), LINKS, {}, "too far to resolve"),
        (GRAINS.replace("8,2,0,1", "8,2,0,-1"), LINKS, {}, "line 3: radius -1 is not positive"),
        (GRAINS.replace("8,2,0,1", "8,2,0,1e-320"), LINKS, {}, "line 3: radius .* is too small"),
        (GRAINS.replace("8,2", "7,2"), LINKS, {}, "line 3: id '7' already .* line 2"),
        (GRAINS.replace("8,2,", "8,1.5,"), LINKS, {}, "line 3: grains 0 and 1 .* overlap by 0.5"),
        (GRAINS.replace("8,2,", "8,0,"), LINKS, {}, "line 3: grains 0 and 1 .* overlap by 2"),
        ("x,y,r\n" + "0,0,1\n" * 5000, None, {}, "too many grains"),
        ('x,y,r\n"0,0,1\n', LINKS, {}, "line 2: 1 fields for 3 columns"),
        ("x,y,r\n" + "1" * 200000 + ",0,1\n", LINKS, {}, "field larger than field limit"),
        (GRAINS, LINKS, {"box": (1.9, 9)}, "box sides"),
        (GRAINS, LINKS, {"box": 5}, "box must be two sides"),
        (GRAINS, LINKS, {"box": "wide"}, "box must be two sides"),
        (GRAINS, LINKS, {"box": (np.nan, 1)}, "box must be two sides"),
        (GRAINS, LINKS, {"box": (10, 1e12)}, "too far to resolve"),
        (GRAINS, LINKS.replace("8,9", "8,6"), {}, "line 3: j names grain '6', which is not"),
        (GRAINS, LINKS.replace("8,9", "9,9"), {}, "line 3: grains 2 and 2 .* at the same point"),
        (GRAINS, LINKS.replace("8,9", "7,9"), {}, "line 3: grains 0 and 2 .* are apart by 2"),
        (GRAINS, LINKS.replace("8,9", "8,7"), {}, r"line 3: .* given before \(.*, line 2\)"),
        (GRAINS, LINKS.replace("8,9,1", "8,9,?"), {}, r"line 3: f_n is '\?'"),
        (GRAINS, LINKS.replace("ft", "f"), {}, "no column f_t"),
        (GRAINS, LINKS.replace("1,0", "-1,0"), {}, "no contact presses; check the sign"),
        (GRAINS, LINKS.replace("i,j", "a,b"), {}, "no column i"),
        (GRAINS, "i,j,nx,ny,length\n7,8,1,0,2\n8,9,0,1,2\n", {}, "line 3: normal and length end"),
        (GRAINS, "i,j,nx,ny,length\n7,8,2,0,2\n", {}, "line 2: the normal must have length 1"),
        (GRAINS, "i,j,nx\n7,8,1\n", {}, "no column ny"),
        (GRAINS, LINKS, {"columns": {"x": "x", "y": "X"}}, "one column is used for two names"),
        (GRAINS, LINKS, {"box": (10, 10), "tilt": 1e300}, "tilt 1e.300 is more than"),
        (GRAINS, None, {"gravity": 1e300, "walls": "floor"}, "gravity must be at most"),
        (GRAINS, "i,j\n7,8\n", {"tolerance": 3, "walls": "floor"}, "tolerance is in largest"),
        (GRAINS, "i,j\n7,8\n8,9\n", {}, "open set needs loads .* or forces"),
        (GRAINS, "i,j\n7,8\n8,9\n", {"forces": True}, "no column f_n"),
        (GRAINS, None, {"forces": True}, "forces need a table of contacts"),
        (GRAINS, None, {"tolerance": 0}, "tolerance must be finite and > 0"),
        (GRAINS, None, {"tolerance": 3}, "tolerance is in largest radii"),
        (GRAINS, None, {"pressure": 0, "box": (10, 10)}, "pressure must be"),
        (GRAINS, None, {"box": (10, 10)}, "no contact that could carry a load"),
        (
            "x,y,r,fx\n0,0,1,1\n2,0,1,1\n",
            None,
            {},
            r"no forces balance the loads, whose sum is \(2, 0\)",
        ),
        ("x,y,r,fx\n0,0,1,1\n2,0,1,-1\n", None, {"box": (9, 9)}, "line 2: a load in a periodic"),
        ("x,y,r,fx\n0,0,1,-1\n2,0,1,1\n", None, {}, "no forces balance .* at grains 0, 1"),
        ("x,y,r,fx\n0,0,1,1\n3,0,1,-1\n", None, {}, "no grains touch"),
        (
            "x,y,r\n0,1,1\n2,1,1\n1,2.7322,1\n",
            None,
            {"walls": "floor", "gravity": 1},
            r"2 pairs nearly touch, with gaps from 0.00013 .*: a larger tolerance \(--tolerance,",
        ),
    ],
)
def test_wrong_tables_are_refused_with_a_reason(grains, contacts, options, message):
    def file(text):
        if text is None:
            return None
        return io.BytesIO(text) if isinstance(text, bytes) else io.StringIO(text)

    with pytest.raises(InputError, match=message) as caught:
        read_table(file(grains), file(contacts), **{"mu": 0.5, **options})
    assert "\n" not in str(caught.value)


def test_a_contact_given_again_and_again_is_found_in_little_memory():
    """The first that repeats one, as comparing all with all would find it."""
    rng = np.random.default_rng(0)
    i, j, angle = rng.integers(3, size=50), rng.integers(3, 6, size=50), rng.uniform(0, 7, 50)
    normal = np.column_stack([np.cos(angle), np.sin(angle)])
    few = make_contacts(i, j, normal, np.ones(50), np.ones(6))
    alike = (i == i[:, None]) & (j == j[:, None]) & (normal @ normal.T > 0.75)
    again, before = np.nonzero(np.tril(alike, -1))
    assert repeated(few) == (before[0], again[0])

    none = np.zeros(3000, dtype=int)
    many = make_contacts(none, none + 1, [[1.0, 0.0]] * 3000, none + 2.0, np.ones(2))
    tracemalloc.start()
    assert repeated(many) == (0, 1)
    assert tracemalloc.get_traced_memory()[1] < 10_000_000  # all pairs fill 50 times it
    tracemalloc.stop()


# Whatever the bytes: a packing or InputError

WORDS = st.sampled_from(
    ["0", "1", "2.0", "-1", "1e-9", "nan", "inf", "1e99", "", "7", "8", "x", '"', "µ", "1e-320"]
)
FUZZ = settings(max_examples=60, deadline=None)


def survives(read, *arguments, **options):
    try:
        read(*arguments, **options)
    except InputError as error:
        assert str(error)


@FUZZ
@given(st.binary(max_size=300), st.binary(max_size=300))
def test_random_bytes_never_break_the_readers(first, second):
    survives(read_table, io.BytesIO(first), io.BytesIO(second), mu=0.5)
    survives(read_lammps, io.BytesIO(first), io.BytesIO(b"ITEM: TIMESTEP\n" + second), 0.5)
    survives(load_packing, io.BytesIO(first))


@FUZZ
@given(
    st.lists(st.lists(WORDS, min_size=6, max_size=6), min_size=1, max_size=6),
    st.lists(st.lists(WORDS, min_size=4, max_size=4), max_size=6),
    st.sampled_from([None, (10, 10), (10, np.inf), (3, 1e6)]),
    st.booleans(),
)
def test_garbled_tables_never_break_the_reader(grains, contacts, box, forces):
    first = "\n".join(map(",".join, [["x", "y", "r", "fx", "fy", "torque"], *grains]))
    second = "\n".join(map(",".join, [["i", "j", "fn", "ft"], *contacts]))
    pair = io.StringIO(first), io.StringIO(second)
    survives(read_table, *pair, mu=0.5, box=box, forces=forces)
    survives(read_table, io.StringIO(first), mu=0, box=box)


@FUZZ
@given(
    st.lists(
        st.tuples(
            st.floats(0, 6),
            st.floats(0, 6),
            st.floats(0.2, 1.4),
            st.floats(-1, 1),
            st.floats(-1, 1),
        ),
        min_size=1,
        max_size=12,
    ),
    st.sampled_from([None, (6, 6), (6, np.inf)]),
    st.sampled_from([0.0, 0.3]),
    st.floats(1e-6, 1),
)
def test_random_disks_are_a_packing_or_an_error(disks, box, mu, tolerance):
    x, y, r, fx, fy = np.array(disks).T
    load = {} if box == (6, 6) else {"fx": fx - fx.mean(), "fy": fy - fy.mean()}
    grains = csv(x=x, y=y, r=r, **load)
    survives(read_table, grains, mu=mu, box=box, tolerance=tolerance)


@FUZZ
@given(st.data())
def test_garbled_dumps_never_break_the_reader(data):
    pair = []
    for path in (PARTICLES, CONTACTS):
        text = lines(path)
        for _ in range(data.draw(st.integers(0, 2))):
            row = data.draw(st.integers(0, 14))
            words = text[row].split()
            at = data.draw(st.integers(0, len(words)))
            words[at : at + 1] = [data.draw(WORDS)]
            text[row] = " ".join(words)
        pair.append(io.StringIO("\n".join(text)))
    survives(read_lammps, *pair, 0.3)


@FUZZ
@given(st.data())
def test_garbled_archives_never_break_the_reader(data):
    content = bytearray(SMALL.read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    end = data.draw(st.sampled_from([len(content), 1000, 19000]))
    survives(load_packing, io.BytesIO(bytes(content[:end])))


@FUZZ
@given(
    st.sampled_from(sorted(set(np.load(SMALL)) - {"lo", "hi", "fcrit"})),
    st.sampled_from([np.nan, np.inf, -1.0, 0.0, 1e300, 1e-300, 3.0]),
    st.integers(0, 99),
)
def test_garbled_arrays_never_break_the_loader(key, value, position):
    array = np.array(np.load(SMALL)[key])
    if array.dtype.kind == "f":
        array[(position,) if array.ndim else ()] = value
    else:
        array = (array + position * 100).astype(array.dtype)
    survives(load_packing, archive(**{key: array}))


# Limits, and costs in proportion


def test_wide_tables_are_read_in_proportion_to_their_width():
    """Counted, not timed: comparisons of one column name with others grew as their square."""

    class Name(str):
        compared = 0

        def __eq__(self, other):
            Name.compared += 1
            return str.__eq__(self, other)

        __hash__ = str.__hash__

    columns = [Name(f"c{k}") for k in range(40_000)]
    table = make_table("wide.csv", columns, [["1"] * len(columns)], [2])
    assert Name.compared < 2 * len(columns)
    with pytest.raises(InputError, match="no column x, y; the columns are c0, c1") as told:
        table.require("x", "y")
    assert len(str(told.value)) < 300
    with pytest.raises(InputError, match="column c7 appears twice"):
        make_table("wide.csv", [*columns, "c7"], [], [])


def broken(kind, most):
    """Read a packing from a file of that kind, in which one contact names a grain that is none."""
    packing, nobody = load_packing(SMALL), 98765
    c = packing.contacts._replace(i=np.append(nobody, packing.contacts.i[1:]))
    if kind == "npz":
        file = io.BytesIO()
        save_packing(packing._replace(contacts=c), file)
        file.seek(0)
        return load_packing(file, most_grains=most)
    if kind == "lammps":
        begin, last = CONTACTS.read_text().rsplit("ITEM: ENTRIES", 1)
        heading, contact, rest = last.split("\n", 2)
        contact = f"{nobody} {contact.split(maxsplit=1)[1]}"
        text = f"{begin}ITEM: ENTRIES{heading}\n{contact}\n{rest}"
        return read_lammps(PARTICLES, io.StringIO(text), 0.3, most_grains=most)
    files = tables(packing._replace(contacts=c))
    return read_table(*files, box=packing.box, mu=packing.mu, most_grains=most)


@pytest.mark.parametrize("kind, grains", [("npz", 100), ("lammps", 400), ("table", 100)])
def test_more_grains_than_are_taken_are_refused_before_contacts_are_looked_at(kind, grains):
    with pytest.raises(InputError, match=r"98765|names a grain outside"):
        broken(kind, grains)
    with pytest.raises(InputError, match=f"{grains} grains; at most {grains - 1} are supported"):
        broken(kind, grains - 1)


def test_disks_without_radius_are_named():
    with pytest.raises(InputError, match="2 centres, 1 radii"):
        gf.from_disks([[0, 0], [2, 0]], [1], 0.3, walls="floor", gravity=1)


def test_options_of_a_table_are_judged_before_it_is_read(tmp_path):
    for options in ({"pressure": np.nan}, {"box": (0, 1)}, {"mu": -1}):
        with pytest.raises(InputError, match=r"pressure|box|friction"):
            read_table(tmp_path / "nowhere.csv", **{"mu": 0.5, **options})


@pytest.mark.parametrize("soft", [False, True])
def test_single_precision_is_taken_and_its_unbalance_told(soft, tmp_path):
    """Seven digits: forces are out of balance by 10⁻⁷, and S is that of the whole packing."""
    packing = read_lammps(PARTICLES, CONTACTS, 0.3) if soft else load_packing(SMALL)
    whole, short = io.BytesIO(), tmp_path / "single.npz"
    save_packing(packing, whole)
    whole.seek(0)
    arrays = dict(np.load(whole))
    for name, array in arrays.items():
        arrays[name] = array.astype(np.float32) if array.dtype == np.float64 else array
    np.savez(short, **arrays)
    found = load_packing(short)
    assert 1e-9 < report(found)["residual"] < 1e-6
    S, T = ensemble(packing), ensemble(found)
    assert S.dimension == T.dimension and np.array_equal(S.index, T.index)
    assert np.abs(np.hypot(*found.contacts.normal.T) - 1).max() < 1e-15
