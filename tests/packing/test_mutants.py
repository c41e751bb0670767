"""Files with a few bytes changed: refused in one line, or taken for something whole."""

import gzip
import io
import warnings
from functools import partial

import numpy as np
import pytest
from experiment.test_solved import mat, mat73
from frames import file, frame, solved
from mutants import refusals
from packing.test_importers import SMALL, cluster, tables
from packing.test_simulations import (
    BODIES,
    INNER,
    MERCURY,
    OUTER,
    contacts,
    mercury_in_a_box,
    particles,
)
from packings import packed
from simulators import MU, N, mercury, yade

from granforce.experiment.measurements import read_measurement
from granforce.experiment.pegs import read_pegs
from granforce.forces.knowledge import bounds_of
from granforce.packing.importers import (
    load_packing,
    read_known,
    read_lammps,
    read_mercury,
    read_table,
    read_yade,
    save_packing,
)
from granforce.records import InputError

CONTACTS = 40
_rows = range(0, CONTACTS, 3)
MEASURED = "contact,f_n,f_t,sigma_n,sigma_t\n" + "\n".join(f"{c},1.5,,0.1," for c in _rows)
KNOWN = "contact,f_n,f_t_min,f_t_max\n" + "\n".join(f"{c},1.5,-0.25,0.25" for c in _rows)


def measured(source):
    forces, sigma = read_measurement(source).on(CONTACTS)
    assert forces.shape == sigma.shape == (CONTACTS, 2)
    assert not np.isinf(forces).any() and not np.any(sigma <= 0)


def known(source):
    bounds = bounds_of(read_known(source), CONTACTS)
    assert bounds.shape == (CONTACTS, 2, 2) and np.all(bounds[..., 0] <= bounds[..., 1])


def whole(packing):
    """What is taken must be a packing throughout."""
    c, r = packing.contacts, packing.r
    assert c.levers is None  # of disks
    arrays = (packing.x, r, packing.forces, packing.load, *c)
    assert all(np.all(np.isfinite(array)) for array in arrays if array is not None)
    assert np.all(r > 0) and np.all(packing.box > 2 * r.max()) and packing.mu >= 0
    assert np.all((c.i != c.j) & (np.minimum(c.i, c.j) >= 0) & (np.maximum(c.i, c.j) < len(r)))
    assert np.all(np.abs(np.hypot(*c.normal.T) - 1) < 1e-6)
    assert np.all(np.abs(c.gap) <= 0.2001 * np.minimum(r[c.i], r[c.j]))


def whole_frame(found):
    """The same of a packing and its measured forces."""
    packing, c = found.packing, found.packing.contacts
    arrays = (packing.x, packing.r, packing.forces, *c)
    assert all(np.all(np.isfinite(array)) for array in arrays if array is not None)
    assert np.all(packing.r > 0) and len(found.ids) == len(packing.r)
    assert np.all((c.i != c.j) & (np.minimum(c.i, c.j) >= 0))
    assert np.all(np.maximum(c.i, c.j) < len(packing.r))
    assert np.all(np.isnan(found.measured[:, 0]) | (found.sigma[:, 0] > 0))
    # The network may be none: told in its own mean force, what is left of nothing is large.
    mean = np.abs(packing.forces[:, 0]).mean() / found.report["mean_measured_normal_force"]
    assert packing.info["residual"] * mean < 1e-8


def known_forces(kind):
    """Tables of what is known of forces."""
    return {"measured": ([MEASURED.encode()], measured), "known": ([KNOWN.encode()], known)}[kind]


def few_grains(kind):
    """A packing of a few grains in formats of our own, and as LAMMPS has it."""
    part = cluster(load_packing(SMALL), 2.6)
    pair = [file.getvalue().encode() for file in tables(part)]
    loads = dict(zip(("fx", "fy", "torque"), part.load.T, strict=True))
    found = [file.getvalue().encode() for file in tables(part, forces=False, **loads)]
    archive = io.BytesIO()
    save_packing(part, archive)
    return {
        "npz": ([archive.getvalue()], load_packing),
        "table": (pair, partial(read_table, mu=part.mu)),
        "found": (found, partial(read_table, mu=part.mu)),
        "lammps": (small_dumps(), partial(read_lammps, mu=0.3)),
    }[kind]


def small_dumps():
    """Three grains in a row under forces that walls hold, as dumps."""
    head = "ITEM: TIMESTEP\n7\nITEM: NUMBER OF {}\n{}\nITEM: BOX BOUNDS ff ff pp\n"
    box = "0 10\n0 10\n-0.5 0.5\nITEM: {}\n{}\n"
    atoms = "1 1 5 1\n2 3 5 1\n3 5 5 1"
    pairs = "1 2 2 -1.5 0 0 0.25\n2 3 2 -1.5 0 0 0.25"
    dumps = (
        head.format("ATOMS", 3) + box.format("ATOMS id x y radius", atoms),
        head.format("ENTRIES", 2) + box.format("ENTRIES atom1 atom2 distance fx fy px py", pairs),
    )
    return [dump.encode() for dump in dumps]


def simulated(kind):
    """A packing as other simulators write it."""
    options = {"mu": MU, "box": packed(N, MU).box}
    return {
        "yade": (yade(header=True), partial(read_yade, **options)),
        "mercury": (mercury(steps=1), partial(read_mercury, **options)),
        "mercury, flat": (mercury(flat=True, both=False), partial(read_mercury, **options)),
    }[kind]


def many_snapshots(kind):
    """Two snapshots of nine disks, as simulators write them, or four disks in a box of walls."""
    scaled = particles(1, "xs ys", scale=1 / 3) + particles(2, "xs ys", scale=1 / 3)
    twice = [(k, 1) for k in range(5)]
    pairs = contacts(1, 1.0, twice, index=True) + contacts(2, 2.0, twice, index=True)
    in_box = BODIES, "id1 id2 fnx fny fnz fsx fsy fsz\n" + "\n".join(OUTER + INNER)
    texts, read = {
        "dumps": ((scaled, pairs), partial(read_lammps, mu=0.3)),
        "dumps, chosen": ((scaled, pairs), partial(read_lammps, mu=0.3, frame=1)),
        "dumps, gzip": ((scaled, pairs), partial(read_lammps, mu=0.3)),
        "mercury, many": (MERCURY, partial(read_mercury, mu=0.3, box=(3, 3))),
        "mercury, walls": (mercury_in_a_box(1), partial(read_mercury, mu=0.5, walls="pressing")),
        "yade, walls": (in_box, partial(read_yade, mu=0.5, walls="pressing")),
        "yade, loads": (in_box, partial(read_yade, mu=0.5)),
    }[kind]
    contents = [text.encode() for text in texts]
    if kind.endswith("gzip"):
        contents = [gzip.compress(content, mtime=0) for content in contents]
    return contents, read


def photoelastic(kind):
    """A frame of an experiment."""
    read = partial(read_pegs, mu=0.3, reach=0.2)
    if kind == "few":
        grains, rows, _ = frame(8, 0.5)
        return [file(lines).getvalue().encode() for lines in (grains, rows)], partial(read, mu=0.5)
    grains, rows, _ = frame(16, noise=0.1)
    particles, _ = solved(16)
    text = [file(lines).getvalue().encode() for lines in (grains, rows)]
    if kind == "solved, 7.3":
        pytest.importorskip("h5py")
        return [mat73(particles).getvalue()], read
    blanks = [content.replace(b",", b" ") for content in text]
    return {
        "text": (text, read),
        "blanks, walls": (blanks, partial(read, walls="circle")),
        "solved": ([mat(particles).getvalue()], read),
        "solved, packed": ([mat(particles, do_compression=True).getvalue()], read),
    }[kind]


def strange(kind):
    """A frame of an experiment whose columns or flags are not what they seem."""
    grains, rows, _ = frame(24 if kind == "all flagged" else 8, 0.5)
    rows.sort(key=lambda row: row[1])
    read = partial(read_pegs, mu=0.5, reach=0.2)
    if kind == "all flagged":
        grains, read = [[*row[:-1], 1] for row in grains], partial(read, walls="auto")
    elif kind == "begun anew":
        grains, rows = 2 * [row[1:] for row in grains], 2 * [row[1:] for row in rows]
    elif kind == "third of zeros":
        rows = [[row[1], row[2], 0, row[3], row[4]] for row in rows]
    else:
        named = dict(zip(("i", "j", "ft", "fn", "id", "x", "y", "r"), "23452345", strict=True))
        read = partial(read, columns=named, flag="ignore")
    contents = [file(lines).getvalue().encode() for lines in (grains, rows)]
    return list(map(gzip.compress, contents)) if kind == "gzip" else contents, read


# Who makes which, and judges what is taken; the least share that is refused; how many are tried
# always, and with each of ten seeds from there on under stress. Forces are judged as they are read.
KINDS = [
    *((known_forces, kind, bool, 0.05, 500, 3334, 100) for kind in ("measured", "known")),
    *((few_grains, kind, whole, 0.1, 200, 2500, 100) for kind in ("npz", "table", "found")),
    (few_grains, "lammps", whole, 0.1, 200, 2500, 100),
    *((simulated, kind, whole, 0.1, 100, 1000, 10) for kind in ("yade", "mercury")),
    (simulated, "mercury, flat", whole, 0.1, 100, 1000, 10),
    *((many_snapshots, kind, whole, 0.1, 100, 1000, 10) for kind in ("dumps", "mercury, many")),
    *((many_snapshots, kind, whole, 0.1, 100, 1000, 10) for kind in ("yade, walls", "yade, loads")),
    (many_snapshots, "mercury, walls", whole, 0.1, 100, 1000, 10),
    (many_snapshots, "dumps, chosen", whole, 0.1, 100, 1000, 10),
    (many_snapshots, "dumps, gzip", whole, 0.5, 100, 1000, 10),
    (photoelastic, "few", whole_frame, 0.05, 60, 3334, 100),
    *((photoelastic, kind, whole_frame, 0.1, 60, 1000, 10) for kind in ("text", "solved")),
    (photoelastic, "blanks, walls", whole_frame, 0.1, 60, 1000, 10),
    (photoelastic, "solved, packed", whole_frame, 0.1, 60, 1000, 10),
    (photoelastic, "solved, 7.3", whole_frame, 0.1, 60, 1000, 10),
    *((strange, kind, whole_frame, 0.05, 60, 1000, 10) for kind in ("all flagged", "begun anew")),
    *((strange, kind, whole_frame, 0.05, 60, 1000, 10) for kind in ("third of zeros", "columns")),
    (strange, "gzip", whole_frame, 0.5, 60, 1000, 10),
]


@pytest.mark.parametrize("made, kind, judge, share, count, many, seed", KINDS)
def test_mutants_are_refused_or_whole(made, kind, judge, share, count, many, seed):
    assert share * count < refusals(*made(kind), count, 1, judge)


@pytest.mark.stress
@pytest.mark.parametrize("made, kind, judge, share, count, many, seed", KINDS)
@pytest.mark.parametrize("number", range(10))
def test_thousands_of_mutants_are_refused_or_whole(
    made, kind, judge, share, count, many, seed, number
):
    assert share * many < refusals(*made(kind), many, seed + number, judge)


@pytest.mark.parametrize("number", ["1e19", "9223372036854775808", "1e100", "-1", "0.5"])
@pytest.mark.parametrize("text, read", [(MEASURED, measured), (KNOWN, known)])
def test_a_contact_that_is_no_whole_number_is_named_with_its_line(number, text, read):
    changed = text.replace("\n3,", f"\n{number},")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError, match=r"line 3: contact is .* whole number, at least 0"):
            read(io.StringIO(changed))
