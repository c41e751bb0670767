"""How records show themselves in a notebook."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from packings import packed, skewed, two_disks

import granforce as gf
from granforce import notebook
from granforce.records import make_contacts, make_packing

pytestmark = pytest.mark.fast

SVG = "{http://www.w3.org/2000/svg}"


def test_a_packing_is_drawn_to_scale_with_every_contact_that_presses():
    packing = packed(30, 0.3)
    picture = ET.fromstring(packing._repr_svg_())
    inner = picture.find(f"{SVG}svg")
    scale = float(inner.get("width")) / packing.box[0]
    radii = np.array([float(c.get("r")) for c in inner.iter(f"{SVG}circle")])
    assert len(radii) >= 30  # disks across a side are seen on both
    assert set(np.round(packing.r * scale, 1)) == set(radii)
    lines = [len(re.findall("M", path.get("d"))) for path in inner.iter(f"{SVG}path")]
    assert sum(lines) >= (packing.forces[:, 0] > 0).sum()
    strongest = max(float(path.get("stroke-width")) for path in inner.iter(f"{SVG}path"))
    assert strongest <= 2 * packing.r.max() * scale
    assert f"φ = {packing.packing_fraction:.4f}" in picture.find(f"{SVG}title").text


def loaded_pair():
    """Two disks in the open."""
    r = np.full(2, 0.5)
    contact = make_contacts([0], [1], [[1.0, 0.0]], [1.0], r)
    load = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]
    return make_packing([[0, 0], [1, 0]], r, [np.inf] * 2, contact, [[1.0, 0.0]], 0.0, load=load)


def nothing():
    none = make_contacts([], [], np.empty((0, 2)), [], np.empty(0))
    return make_packing(np.empty((0, 2)), [], [1.0, 1.0], none, np.empty((0, 2)), 0.5)


@pytest.mark.parametrize(
    ("packing", "disks", "lines"), [(two_disks, 3, 0), (loaded_pair, 2, 1), (nothing, 0, 0)]
)
def test_any_packing_has_a_picture(packing, disks, lines):
    """Open and periodic, with and without forces, friction and disks."""
    picture = ET.fromstring(packing()._repr_svg_())
    assert len(list(picture.iter(f"{SVG}circle"))) == disks
    assert len(list(picture.iter(f"{SVG}path"))) == lines
    assert "nan" not in picture.find(f"{SVG}title").text


def test_a_tilted_cell_is_cut_at_its_sides():
    """Every disk is drawn, those across a side at each image that reaches into the cell."""
    packing, _ = skewed(packed(30, 0.3))
    picture = ET.fromstring(packing._repr_svg_())
    clip = next(picture.iter(f"{SVG}clipPath"))
    corners = [p.split(",") for p in clip[0].get("points").split()]
    corners = np.array(corners, float)
    assert len(corners) == 4
    scale = notebook.SIDE / np.ptp(packing.cell.bounding_box, axis=0).max()
    assert np.linalg.norm(corners[1] - corners[0]) == pytest.approx(packing.box[0] * scale, abs=0.2)
    drawn = np.array(
        [[float(c.get(key)) for key in ("cx", "cy", "r")] for c in picture.iter(f"{SVG}circle")]
    )
    # By brute force: disks at many images, seen where they overlap the parallelogram.
    steps = np.mgrid[-6:7, -6:7].reshape(2, -1).T
    at = packing.cell.across(packing.x[:, None] + steps @ packing.cell.vectors)
    reach = packing.r[:, None, None]
    seen = np.all((at > -reach) & (at < packing.cell.heights + reach), axis=-1)
    assert len(drawn) == np.count_nonzero(seen) > len(packing.r)
    group = next(g for g in picture.iter(f"{SVG}g") if g.get("clip-path"))
    assert group.get("clip-path") == f"url(#{clip.get('id')})"
    assert len(list(group.iter(f"{SVG}circle"))) == len(drawn)


def test_ensembles_walks_and_intervals_are_small_tables():
    S = gf.ensemble(packed(30, 0.3))
    walk = gf.walk(S, 5, 0)
    bounds = gf.intervals(S)
    for record, name, value in (
        (S, "dimension h", S.dimension),
        (walk, "η2", f"{gf.measures.eta2(walk.states):.4g}"),
        (bounds, "exact η3", f"{gf.measures.eta3(bounds.low, bounds.high):.4g}"),
    ):
        table = ET.fromstring(record._repr_html_())
        rows = {row[0].text: row[1].text for row in table.iter("tr")}
        assert rows[name] == str(value)
        assert len(rows) < 20


def test_figures_are_public():
    assert callable(gf.figures.indeterminacy)
