"""Packings as files of ParaView and LAMMPS."""

import base64
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from packing.test_importers import PARTICLES, SMALL, cluster
from packing.test_simulations import INNER, OUTER, boxed
from packings import packed, skewed

from granforce.cli.entry_point import main
from granforce.explore.random_walk import walk
from granforce.forces.build import ensemble
from granforce.packing.exporters import save_lammps, save_vtk
from granforce.packing.importers import load_packing, read_lammps, save_packing
from granforce.packing.scenes import scene
from granforce.records import InputError

pytestmark = pytest.mark.fast

PACKINGS = {
    "periodic": lambda: load_packing(SMALL),
    "tilted": lambda: skewed(load_packing(SMALL))[0],
    "tilted to the left": lambda: skewed(load_packing(SMALL), ((1, -1), (1, 0)))[0],
    "open": lambda: cluster(load_packing(SMALL), 5.0),
    "soft": lambda: read_lammps(PARTICLES, str(PARTICLES).replace("particles", "contacts"), 0.3),
}


@pytest.mark.parametrize("name", PACKINGS)
def test_dumps_come_back_with_the_same_forces(tmp_path, name):
    packing = PACKINGS[name]()
    files = tmp_path / "p.dump", tmp_path / "c.dump"
    save_lammps(packing, *files)
    again = read_lammps(*files, packing.mu)
    pressing = packing.forces.any(axis=1)
    c = packing.contacts
    for one, two in ((c.i, again.contacts.i), (c.j, again.contacts.j)):
        np.testing.assert_array_equal(one[pressing], two)
    mean = packing.forces[:, 0].mean()
    np.testing.assert_allclose(again.forces, packing.forces[pressing], atol=1e-9 * mean)
    np.testing.assert_allclose(again.contacts.normal, c.normal[pressing], atol=1e-9)
    np.testing.assert_allclose(again.box, packing.box)
    assert again.tilt == pytest.approx(packing.tilt, abs=1e-12)
    np.testing.assert_array_equal(again.r, packing.r)
    if np.isfinite(packing.pressure):
        assert again.pressure == pytest.approx(packing.pressure, rel=1e-6)
        np.testing.assert_allclose(again.cell.nearest(again.x - packing.x), 0, atol=1e-12)
    else:
        np.testing.assert_allclose(again.load, packing.load, atol=1e-8 * mean)
        np.testing.assert_allclose(np.ptp(again.x - packing.x, axis=0), 0, atol=1e-12)


def arrays(path):
    """{part: {name: array}} of a .vtp."""
    (piece,) = ET.parse(path).getroot().iter("Piece")
    found = {"counts": {k: int(v) for k, v in piece.attrib.items()}}
    for part in piece:
        found[part.tag] = {}
        for one in part:
            raw = base64.b64decode(one.text)
            assert int.from_bytes(raw[:8], "little") == len(raw) - 8
            kind = {"Float64": "<f8", "Int64": "<i8"}[one.get("type")]
            values = np.frombuffer(raw[8:], kind)
            wide = int(one.get("NumberOfComponents"))
            found[part.tag][one.get("Name")] = values.reshape(-1, wide) if wide > 1 else values
    return found


@pytest.mark.parametrize("name", PACKINGS)
def test_vtk_holds_disks_and_forces(tmp_path, name):
    packing = PACKINGS[name]()
    c, files = packing.contacts, (tmp_path / "g.vtp", tmp_path / "c.vtp")
    save_vtk(packing, *files)
    grains, contacts = map(arrays, files)
    n, links = len(packing.r), len(c.i)
    assert grains["counts"]["NumberOfPoints"] == grains["counts"]["NumberOfVerts"] == n
    assert contacts["counts"]["NumberOfPoints"] == 2 * contacts["counts"]["NumberOfLines"]
    np.testing.assert_array_equal(grains["Points"]["points"][:, :2], packing.x)
    np.testing.assert_array_equal(grains["PointData"]["radius"], packing.r)
    assert grains["PointData"]["contacts"].sum() == 2 * links
    np.testing.assert_array_equal(grains["Verts"]["offsets"], np.arange(n) + 1)
    np.testing.assert_array_equal(contacts["Lines"]["offsets"], 2 * np.arange(links) + 2)
    np.testing.assert_array_equal(contacts["Lines"]["connectivity"], np.arange(2 * links))
    data = contacts["CellData"]
    np.testing.assert_array_equal(np.column_stack([data["f_n"], data["f_t"]]), packing.forces)
    np.testing.assert_array_equal(contacts["PointData"]["f_n"], np.repeat(data["f_n"], 2))
    # Lines lead from i to an image of j, and the forces on each grain balance its load.
    ends = contacts["Points"]["points"].reshape(-1, 2, 3)
    np.testing.assert_array_equal(ends[:, 0, :2], packing.x[c.i])
    apart = packing.cell.nearest(ends[:, 1, :2] - packing.x[c.j])
    assert np.abs(apart).max() < 1e-6
    total = grains["PointData"]["load"].copy()
    np.add.at(total, data["j"], data["force"])
    np.add.at(total, data["i"], -data["force"])
    assert np.abs(total).max() < 1e-6 * data["f_n"].mean()


def test_lines_end_at_walls(tmp_path):
    """Four disks of radius ½ in a box: lines from disk to disk are 1 long, those to walls ½."""
    save_vtk(boxed(OUTER + INNER, walls="pressing"), tmp_path / "g.vtp", tmp_path / "c.vtp")
    ends = arrays(tmp_path / "c.vtp")["Points"]["points"].reshape(-1, 2, 3)
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert sorted(length.tolist()) == [0.5] * 8 + [1.0] * 4


def test_balances_that_are_left_open_are_no_numbers(tmp_path):
    save_vtk(scene("groove", 0.5), tmp_path / "g.vtp", tmp_path / "c.vtp")
    load = arrays(tmp_path / "g.vtp")["PointData"]["load"]
    assert load[0].tolist() == [0, -1, 0] and np.isnan(load[1:, :2]).all()


def test_states_are_exported(tmp_path):
    packing = packed(20, 0.3)
    S = ensemble(packing)
    state = S.expand(walk(S, 1, 0).states[0])
    save_vtk(packing, tmp_path / "g.vtp", tmp_path / "c.vtp", state)
    np.testing.assert_array_equal(arrays(tmp_path / "c.vtp")["CellData"]["f_n"], state[:, 0])
    with pytest.raises(InputError, match="forces"):
        save_vtk(packing, tmp_path / "g.vtp", tmp_path / "c.vtp", state[:3])


def test_by_the_command_line(away, capsys):
    save_packing(load_packing(SMALL), "p.npz")
    assert main("export p.npz g.vtp c.vtp".split()) == 0
    assert main("export p.npz p.dump c.dump".split()) == 0
    assert main("import lammps p.dump c.dump --mu 0.1 --json".split()) == 0
    assert '"dimension": 52' in capsys.readouterr().out
    for words in ("p.npz g.vtp c.dump", "p.npz g.txt c.txt", "none.npz g.vtp c.vtp"):
        assert main(["export", *words.split()]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert main("export p.npz folder/g.vtp c2.vtp".split()) == 2 and not (away / "c2.vtp").exists()
