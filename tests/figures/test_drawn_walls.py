"""Pictures and tables tell walls from grains."""

import numpy as np
import pytest
from packings import packed

import granforce as gf


def shapes(picture):
    return sum(len(one.data) for one in picture.values() if type(one).__name__ == "Polygons")


def walls(picture):
    return [one for one in picture.values() if one.label == "wall"]


@pytest.mark.parametrize("number", [10, None])
def test_grains_whose_balance_is_open_are_drawn_as_disks(number):
    """Grains flagged as touching a wall, in the interior too, are no dashes."""
    packing = packed(30, 0.3)
    load = np.zeros((30, 3))
    load[:number] = np.nan
    packing = packing._replace(box=np.full(2, np.inf), load=load, pressure=np.nan)
    picture = gf.plot(packing)
    assert shapes(picture) == 30 and not walls(picture)
    assert "30 disks" in repr(picture.opts.get(backend="bokeh"))


@pytest.mark.parametrize("name, touched", [("groove", 2), ("pyramid", 2), ("books", 2)])
def test_tables_name_walls_and_give_normals_and_points(name, touched):
    packing = gf.scene(name)
    assert walls(gf.plot(packing)) or name == "books"
    S = gf.ensemble(packing)
    table = gf.to_dataframe(gf.intervals(S), S)
    c = packing.contacts.picked(S.index)
    assert np.array_equal(table[["n_x", "n_y"]], c.normal)
    assert np.array_equal(table[["x", "y"]], packing.contact_points[S.index])
    held = np.isnan(packing.load[:, 0])
    assert np.array_equal(table["wall"] == 1, held[c.i] | held[c.j])
    assert table["wall"].sum() >= touched
