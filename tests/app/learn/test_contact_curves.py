"""Where bodies of a built scene touch as the browser computes it, beside the library's contacts."""

import numpy as np
import pytest

from app.learn.model import small_scenes
from granforce.packing import assemblies

FOUND = """({ contactCurves, foot, gap, meet, shape }, { moved, others, at }) => {
    const all = others.map(shape), around = shape([0, 0, ...moved])
    const curves = all.flatMap((other) => contactCurves(around, other))
    const twice = curves.flatMap((one, k) => curves.slice(k + 1).flatMap((two) => meet(one, two)))
    const gaps = ([x, y]) => all.map((other) => gap(shape([x, y, ...moved]), other))
    const free = (places) => places.map((place) => [...place, ...gaps(place)])
        .filter(([, , ...apart]) => Math.min(...apart) > -1e-9)
    return [free(curves.map((curve) => foot(curve, at))), free(twice)]
}"""
OTHERS = [[0, 0, 1], [2.6, 0.5, 2, 1, 20], [-3, -1.2, 5, -1.5], [-2, 0.4, 0.5, 3, -35]]


@pytest.mark.parametrize("moved", [[0.7], [1.5, 0.4, 0], [1, 1, 20], [3, 0.1, 60]])
def test_a_body_is_placed_where_the_library_finds_contacts(run, moved):
    once, twice = run("learn/model/contact_curves", FOUND, moved=moved, others=OTHERS, at=[1, 1.4])
    assert len(once) > 2 and len(twice) > 2
    for places, contacts in ((once, 1), (twice, 2)):
        for x, y, *gaps in places:
            assert np.sum(np.abs(gaps) < 1e-9) >= contacts
            rows = [np.array([x, y, *moved]), *map(np.array, OTHERS)]
            bodies = [
                row.reshape(2, 2) if len(row) == 4 else small_scenes.outline(row) for row in rows
            ]
            packing = assemblies.blocks(bodies, 0.5, fixed=[3], tolerance=1e-6, balanced=False)
            touched = packing.contacts.j[packing.contacts.i == 0] - 1
            assert set(touched) == set(np.flatnonzero(np.abs(gaps) < 1e-9))
