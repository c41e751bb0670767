"""The first motion drawn on the packing shows what it was given."""

import holoviews as hv
import numpy as np
import pytest
from packings import packed, skewed

import granforce as gf
from granforce.figures import style
from granforce.figures.displacement import LONGEST_ARROW, displacement
from granforce.figures.networks import overlaid

pytestmark = pytest.mark.fast

GROUND = [[-50, -1], [50, -1], [50, 0], [-50, 0]]


@pytest.mark.parametrize("backend", ["bokeh", "matplotlib"])
def test_arrows_are_proportional_to_displacements_and_rattlers_have_none(backend, tmp_path):
    packing = packed(20, 0.3)
    field = np.random.default_rng(0).normal(size=(20, 2))
    field[3] = np.nan
    figure = displacement(packing, field, contact=0, backend=backend)
    paths = figure.traverse(lambda element: element, [hv.Path])
    without, grains, arrows = (
        [np.array(p) for p in path.split(datatype="array")] for path in paths
    )
    assert (len(without), len(grains), len(arrows)) == (1, 19, 19)
    drawn = np.array([line[-1] - line[0] for line in arrows])
    known = np.delete(field, 3, axis=0)
    ratio = drawn / known
    assert np.allclose(ratio, ratio[0, 0])
    longest = np.linalg.norm(drawn, axis=1).max()
    assert longest == pytest.approx(LONGEST_ARROW * 2 * packing.r.mean())
    suffix = "html" if backend == "bokeh" else "png"
    style.save(figure, tmp_path / f"figure.{suffix}")
    assert (tmp_path / f"figure.{suffix}").stat().st_size > 0


def test_bodies_move_as_the_bodies_they_are():
    packing = gf.blocks([[[0, 0], [1, 0], [1, 1], [0, 1]], [0.5, 1.5, 0.5], GROUND], 0.5, fixed=[2])
    field = np.array([[1.0, 0], [2.0, 0], [np.nan, np.nan]])
    paths = displacement(packing, field).traverse(lambda element: element, [hv.Path])
    fixed, moving, arrows = ([np.array(p) for p in path.split(datatype="array")] for path in paths)
    for line, corners in ((fixed[0], GROUND), (moving[0], [[0, 0], [1, 0], [1, 1], [0, 1]])):
        assert {tuple(point) for point in line} == {tuple(point) for point in corners}
        assert tuple(line[0]) == tuple(line[-1])
    assert np.hypot(*(moving[1] - [0.5, 1.5]).T) == pytest.approx(0.5)
    # Longest in diameters of what may move, however large the ground is.
    size = packing.r[:2].mean()
    assert np.ptp(arrows[1][:, 0]) == pytest.approx(LONGEST_ARROW * 2 * size)


def test_tilted_cells_are_outlined_and_grains_lie_inside():
    packing = skewed(packed(20, 0.3))[0]
    field = np.random.default_rng(0).normal(size=(20, 2))
    figure = displacement(packing, field, contact=0)
    (curve,) = figure.traverse(lambda element: element, [hv.Curve])
    outline = np.column_stack([curve.dimension_values(0), curve.dimension_values(1)])
    assert outline == pytest.approx(packing.cell.corners)
    at = packing.contact_points
    for points in (at, packing.cell.wrapped(packing.x)):
        parts = packing.cell.parts(points)
        assert parts.min() > -1e-12 and parts.max() < 1 + 1e-12
    groups = {0.3: (packing, np.arange(len(at)), packing.forces[:, 0], packing.forces[:, 0])}
    frames = overlaid(groups).traverse(lambda element: element, [hv.Overlay])
    assert frames and all(frame.traverse(lambda e: e, [hv.Curve]) for frame in frames)
