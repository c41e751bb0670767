"""Packings of YADE and MercuryDPM, in files of `simulators`."""

import io
import json

import numpy as np
import pytest
from packings import packed, skewed
from simulators import MU, N, mercury, vectors, yade

from granforce.cli.entry_point import main
from granforce.forces.build import ensemble
from granforce.packing.importers import read_columns, read_mercury, read_table, read_yade
from granforce.records import InputError


def given(*contents):
    return [io.BytesIO(content) for content in contents]


def as_it_was(packing):
    true, _, forces, *_ = vectors()
    assert packing.pressure == pytest.approx(1.0, rel=1e-6)
    assert packing.info["residual"] < 1e-6 and packing.info["violation"] < 1e-6
    assert len(packing.contacts.i) == len(forces)
    one, two = (values[np.lexsort(values.T)] for values in (packing.forces, forces))
    assert np.allclose(one, two, atol=1e-9) and np.allclose(packing.r.sum(), true.r.sum())


@pytest.mark.parametrize(
    "options", [{}, {"plane": "xz"}, {"ids": True}, {"header": True, "plane": "yz"}]
)
def test_yade(options):
    as_it_was(read_yade(*given(*yade(**options)), MU, box=packed(N, MU).box))


@pytest.mark.parametrize(
    "options", [{}, {"flat": True}, {"both": False}, {"turned": True}, {"steps": 1}]
)
def test_mercury(options):
    as_it_was(read_mercury(*given(*mercury(**options)), MU, box=packed(N, MU).box))


@pytest.mark.parametrize("read, made", [(read_yade, yade), (read_mercury, mercury)])
def test_cells_may_be_tilted(read, made):
    """Without the tilt, contacts across the upper side have other directions."""
    cell = skewed(packed(N, MU))[0].cell
    found = read(*given(*made(tilted=True)), MU, box=cell.box, tilt=cell.tilt)
    as_it_was(found)
    assert found.tilt == pytest.approx(cell.tilt) and cell.tilt != 0
    S = ensemble(packed(N, MU))
    assert found.info["residual"] == pytest.approx(S.residual(S.original), abs=1e-12)


def test_walls_and_open_boxes_become_loads():
    """Contacts inside an open box only: what is left over is the load."""
    bodies, links = yade()
    packing = packed(N, MU)
    c = ensemble(packing).contacts
    branch = packing.x[c.j] - packing.x[c.i]
    inside = np.abs(branch - c.length[:, None] * c.normal).max(axis=1) < 1e-6
    kept = b"\n".join(np.array(links.split(b"\n"))[inside])
    found = read_yade(*given(bodies, kept), MU)
    assert found.load.any() and found.info["residual"] < 1e-9


@pytest.mark.parametrize(
    "read, files, words",
    [
        (read_yade, (b"1 2 3 1\n4 5 9 1", b"0 1 1 0 0 0 0 0"), "plane"),
        (
            read_yade,
            (b"0 0 0 1\n2 0 0 1", b"0 5 1 0 0 0 0 0"),
            "line 1: a body is not among the 2 bodies",
        ),
        (read_yade, (b"0 0 0 1\n2 0 0 1", b"0 1 1 0 0"), "fields"),
        (read_mercury, (b"0 0 0 1\n", b"0 1 1"), "is it a .data"),
        (read_mercury, (b"9 0 0 0 1 1\n0 0 0 0 1 0 0 0\n", b"0 1 1"), "cut off"),
    ],
)
def test_what_is_wrong_is_told(read, files, words):
    with pytest.raises(InputError, match=words):
        read(*given(*files), MU)


def test_by_the_command_line(away, capsys):
    width = str(packed(N, MU).box[0])
    for name, made in (("yade", yade()), ("mercury", mercury())):
        for k, content in enumerate(made):
            (away / f"{name}{k}").write_bytes(content)
        words = ["import", name, f"{name}0", f"{name}1", "--mu", "0.3", "--box", width, width]
        assert main([*words, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["contacts"] == len(vectors()[2])
        with pytest.raises(SystemExit):
            main(words[:3] + words[4:])


def test_tables_with_columns_of_any_name():
    grains = b"Pos X;y pos;Radius;r;z\n0;0;1;9;1\n2;0;1;9;1\n"
    contacts = b"a;b;N;T\n0;1;1;0\n"
    named = "x=pos x,y=y pos,r=radius,i=a,j=b,fn=n,ft=T"
    found = read_table(*given(grains, contacts), mu=0.3, columns=read_columns(named))
    assert found.r.tolist() == [1, 1] and found.forces.tolist() == [[1, 0]]
    for text in ("x", "x=", "speed=a", f"{named},nx=absent"):
        with pytest.raises(InputError):
            read_table(*given(grains, contacts), mu=0.3, columns=read_columns(text))
