"""The first motion drawn on the packing shows what it was given."""

import holoviews as hv
import numpy as np
import pytest
from packings import packed

from granforce.figures import style
from granforce.figures.displacement import LONGEST_ARROW, displacement


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
