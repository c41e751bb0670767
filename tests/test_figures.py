"""Figures hold what they were given."""

import re

from granforce import figures


def test_walks_stand_beside_the_exact_bounds(tmp_path):
    rows = [
        {"mu": mu, "method": method, "seconds": seconds, "extent_part": part}
        for mu in (0.1, 1.0)
        for method, seconds, part in (("exact", 4, 1.0), ("walk", 1, 0.3), ("walk", 9, 0.5))
    ]
    figure = figures.walk_against_exact(rows)
    assert len(figure) == 2
    walk = figure.values()[0].get(2)
    assert walk.dimension_values(0).tolist() == [1, 9]
    assert walk.dimension_values(1).tolist() == [0.3, 0.5]
    path = tmp_path / "figure.html"
    figures.save(figure, path)
    page = path.read_text()
    # Scripts and styles are in the page: it needs no network.
    assert not re.search(r"<script[^>]+src=|<link[^>]+stylesheet", page)
