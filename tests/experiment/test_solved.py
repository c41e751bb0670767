"""Frames as PeGS 2 leaves them, written here by SciPy (and h5py, where it is installed)."""

import io

import numpy as np
import pytest
from frames import NEWTON, solved
from scipy.io import savemat

from granforce.experiment.pegs import read_pegs
from granforce.forces.build import ensemble
from granforce.packing.importers import load_packing, save_packing
from granforce.records import InputError

FIELDS = ("neighbours", "forces", "alphas", "betas")


def mat(particles, name="Step09-0007_solved.mat", **options):
    """A file with the struct array of particles, each field a row as MATLAB has it."""
    kinds = [(field, object) for field in particles[0]]
    array = np.zeros((1, len(particles)), kinds)
    for k, one in enumerate(particles):
        for field, value in one.items():
            array[0, k][field] = np.atleast_2d(np.asarray(value, dtype=float))
    made = io.BytesIO()
    savemat(made, {"particle": array}, **options)
    made.seek(0)
    made.name = name
    return made


MATLAB_73 = (
    b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Thu Nov 26 2026 HDF5 schema 1.00 ."
)


def mat73(particles, name="Step09-0007_solved.mat"):
    """The same of version 7.3: each field a column of references to arrays with swapped axes."""
    import h5py

    made = io.BytesIO()
    with h5py.File(made, "w", userblock_size=512) as file:
        group, refs = file.create_group("particle"), file.create_group("#refs#")
        for field in particles[0]:
            column = group.create_dataset(field, (len(particles), 1), dtype=h5py.ref_dtype)
            for k, one in enumerate(particles):
                value = np.atleast_2d(np.asarray(one[field], dtype=float)).T
                empty = not value.size  # MATLAB keeps the shape in place of the array
                value = np.array([0, 0], np.uint64) if empty else value
                stored = refs.create_dataset(f"{field}{k}", data=value)
                if empty:
                    stored.attrs["MATLAB_empty"] = np.uint8(1)
                column[k, 0] = stored.ref
    made.seek(0)
    made.write(MATLAB_73.ljust(128))
    made.seek(0)
    made.name = name
    return made


def by_pair(found, truth):
    pairs = zip(found.packing.contacts.i.tolist(), found.packing.contacts.j.tolist(), strict=True)
    return np.array([truth.get(pair, np.full(2, np.nan)) for pair in pairs])


@pytest.mark.parametrize("options", [{}, {"do_compression": True}])
def test_a_perfect_frame_is_taken_as_it_is(options):
    """Walls count: their directions are known, so that every grain is balanced."""
    particles, truth = solved()
    found = read_pegs(mat(particles, **options), mu=0.3, reach=0, error=0.1 * NEWTON)
    told = found.report
    assert told["frame"] == 7 and told["contacts_listed"] == len(truth) == told["listed_twice"]
    assert told["walls"].startswith("wall")
    assert told["wall_contacts"] == told["contacts_with_a_wall"] > 10
    assert told["unbalanced"] == 0 and not found.findings
    # Nothing is open but the wall, which counts again for a grain that touches it again.
    assert np.isnan(found.packing.load).any(axis=1).sum() == len(found.walls)
    true = by_pair(found, truth)
    here = np.isfinite(true[:, 0])
    assert np.abs(found.packing.forces - true)[here].max() < 1e-6 * NEWTON
    assert told["chi_square"] < 1e-9
    S = ensemble(found.packing)
    assert S.admits(found.packing.forces[S.index])


def test_walls_may_stay_open():
    particles, _ = solved()
    found = read_pegs(mat(particles), mu=0.3, reach=0, walls="open")
    assert found.report["walls"] == "open" and not found.walls
    edge = np.array([one["edge"] for one in particles]) != 0
    assert np.array_equal(np.isnan(found.packing.load).any(axis=1), edge)


def test_either_side_is_a_measurement_weighed_by_its_fit():
    particles, _ = solved(noise=0.1)
    found = read_pegs(mat(particles), mu=0.3, reach=0, error=0.05 * NEWTON, repair=1.0)
    c = found.packing.contacts
    middle = 2.5  # the median of fitError over the area, here 1 and 4
    for k in np.flatnonzero(~found.added)[:20]:
        i, j = int(c.i[k]), int(c.j[k])
        if j >= len(particles):
            continue
        f_n, w = [], []
        for own, other in ((i, j), (j, i)):
            one = particles[own]
            at = one["neighbours"].index(particles[other]["id"])
            f_n.append(one["forces"][at] * np.cos(one["alphas"][at]))
            w.append(middle / (one["fitError"] / one["r"] ** 2 * 2500))
        if min(f_n) < 0:
            continue
        assert found.measured[k, 0] == pytest.approx(np.average(f_n, weights=w))
        error = 0.05 * NEWTON / np.sqrt(sum(w))
        half = abs(f_n[0] - f_n[1]) / 2
        far = half if half > 3 * error else 0.0  # otherwise it is noise
        assert found.sigma[k, 0] == pytest.approx(np.hypot(error, far))


def test_inferred_forces_are_nearer_to_the_truth_than_measured_ones():
    particles, truth = solved(100, noise=0.1)
    found = read_pegs(mat(particles), mu=0.3, reach=0, repair=1.0)
    true = by_pair(found, truth)
    here = np.isfinite(true[:, 0]) & np.isfinite(found.measured[:, 0])
    off = [np.abs(f - true)[here].mean() for f in (found.packing.forces, found.measured)]
    assert off[0] < 0.8 * off[1]


def test_a_frame_with_walls_is_kept_as_a_packing(tmp_path):
    particles, _ = solved()
    found = read_pegs(mat(particles), mu=0.3, reach=0)
    save_packing(found.packing, tmp_path / "frame.npz")
    again = load_packing(tmp_path / "frame.npz")
    assert np.array_equal(again.forces, found.packing.forces)
    assert np.array_equal(again.contacts.arm_j, found.packing.contacts.arm_j)


def test_fields_that_lack_or_are_empty():
    particles, _ = solved(walls=False)
    for one in particles:
        del one["fitError"], one["edge"]
    found = read_pegs(mat(particles), mu=0.3, reach=0)
    assert found.report["walls"] == "open"
    particles[4]["forces"] = particles[4]["forces"][:-1]  # belongs to no contact any more
    assert read_pegs(mat(particles), mu=0.3, reach=0).report["unreadable_contacts"] > 0
    for one in particles:
        del one["alphas"]
    with pytest.raises(InputError, match="alphas"):
        read_pegs(mat(particles), mu=0.3)


@pytest.mark.parametrize("content", [b"", b"MATLAB 5.0", b"\x89HDF\r\n\x1a\n" + b"0" * 40])
def test_what_is_no_such_file_is_told(content, tmp_path):
    (tmp_path / "a_solved.mat").write_bytes(content)
    with pytest.raises(InputError):
        read_pegs(tmp_path / "a_solved.mat", mu=0.3)
    with pytest.raises(InputError, match="cannot be read"):
        read_pegs(tmp_path / "b_solved.mat", mu=0.3)
    with pytest.raises(InputError, match="is frame 7"):
        read_pegs(mat(solved()[0]), mu=0.3, frame=8)


def test_version_7_3():
    pytest.importorskip("h5py")
    particles, _ = solved()
    found = read_pegs(mat73(particles), mu=0.3, reach=0)
    same = read_pegs(mat(particles), mu=0.3, reach=0)
    assert np.array_equal(found.packing.forces, same.packing.forces)
    assert found.report["frame"] == 7


def test_version_7_3_takes_nothing_from_other_files(tmp_path):
    """A file may point to others, which somebody who sends one to a server must not read."""
    h5py = pytest.importorskip("h5py")
    whole, _ = solved()
    (tmp_path / "secret").write_bytes(np.arange(8.0).tobytes())
    (tmp_path / "other.mat").write_bytes(mat73(whole).getvalue())
    outside = io.BytesIO()
    with h5py.File(outside, "w") as file:
        file["particle"] = h5py.ExternalLink(str(tmp_path / "other.mat"), "particle")
    raw = mat73(whole)
    with h5py.File(raw, "r+") as file:
        external = [(str(tmp_path / "secret"), 0, 64)]
        stored = file.create_dataset("#refs#/taken", (1, 8), "f8", external=external)
        file["particle/x"][0, 0] = stored.ref
    for made in (outside, raw):
        made.seek(0)
        with pytest.raises(InputError, match=r"particle|damaged"):
            read_pegs(made, mu=0.3)


def test_version_7_3_without_h5py_is_told(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "h5py", None)
    given = io.BytesIO(b"MATLAB 7.3 MAT-file" + b" " * 500)
    with pytest.raises(InputError, match="install h5py"):
        read_pegs(given, mu=0.3)


def test_version_7_3_that_is_damaged_is_told():
    """The head that MATLAB writes, and nothing after the signature of HDF5."""
    pytest.importorskip("h5py")
    given = io.BytesIO(MATLAB_73.ljust(512) + b"\x89HDF\r\n\x1a\n" + bytes(200))
    with pytest.raises(InputError, match=r"version 7.3 \(HDF5\) that is damaged; .*'-v7'"):
        read_pegs(given, mu=0.3)
