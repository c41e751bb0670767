"""Figures hold what they were given; pages need no network, pictures no browser."""

import contextlib
import io
import pathlib
import re
import subprocess
import sys
from xml.etree import ElementTree

import holoviews as hv
import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.path import Path
from matplotlib.text import Text
from PIL import Image

import granforce as gf
from granforce import figures
from granforce.figures import style
from granforce.paper import drawings, tables
from granforce.records import InputError

ROOT = pathlib.Path(__file__).parents[2]


def curves(frame):
    """{label: (x, y)} of the lines of one frame."""
    return {
        e.label: (e.dimension_values(0), e.dimension_values(1))
        for e in frame.traverse(lambda e: e, [hv.Curve])
    }


def frames(figure):
    return figure.values()


def test_the_benchmark_has_a_frame_for_each_part_with_enough_points():
    rows = [
        {"mu": mu, "method": method, "seconds": seconds, "extent_part": part}
        for mu in (0.1, 1.0)
        for method, seconds, part in (
            *(("exact", 4, 1.0), ("walk", 9, 0.5), ("walk", 1, 0.3), ("walk", 4, 0.4)),
        )
    ]
    ours = {"mu": 0.1, "solver": "ours"}
    sizes = [{"n": n, **ours, "seconds": n / 100} for n in (100, 200, 400)]
    results = {"intervals": rows, "scaling": [*sizes, {"n": "fit", **ours}]}
    results["uniform"] = [{"h": 60, "method": "billiard", "seconds_per_state": 1e-4}]  # one point
    figure = figures.benchmark(results)
    scaling, first, second = (curves(frame) for frame in frames(figure))
    np.testing.assert_allclose(scaling["ours"], ([100, 200, 400], [1, 2, 4]))
    np.testing.assert_allclose(first["walk"], ([1, 4, 9], [0.3, 0.4, 0.5]))
    np.testing.assert_allclose(second["exact"], ([4], [1.0]))


def test_pages_need_no_network_and_pictures_made_after_them_look_the_same(tmp_path):
    # In a process of its own, as the command line's: Panel, where loaded, adds links to its styles.
    path = tmp_path / "figure.html"
    code = (
        "from granforce import figures\n"
        "ours = {'mu': 0.1, 'solver': 'ours'}\n"
        "rows = [{'n': n, **ours, 'seconds': n / 100} for n in (100, 200, 400)]\n"
        f"figures.save(figures.benchmark({{'scaling': rows}}), {str(path)!r})\n"
        "import granforce as gf, holoviews as hv\n"
        "groove = gf.plot(gf.scene('groove', 0.5), backend='matplotlib')\n"
        "disks = hv.render(groove, backend='matplotlib').axes[0].collections[0]\n"
        "print(disks.get_facecolor()[0, 0] > 0.9, disks.get_edgecolor()[0, 0] < 0.7)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.stdout == "True True\n", run.stderr
    # Scripts and styles are in the page: it needs no network.
    assert not re.search(r"<script[^>]+src=|<link[^>]+stylesheet", path.read_text())


ROWS = [
    {"mu": mu, "eta1": k * mu, "eta2": 2 * k * mu, "eta3": 20 * k * mu, "coordination": 4 - mu}
    for mu in (0, 0.1, 1)
    for k in (1, 3)
]


@pytest.mark.parametrize("backend", ["bokeh", "matplotlib"])
def test_indeterminacy_averages_over_packings(backend):
    exact = [{"mu": 0.1, "eta3": 9.0}]
    figure = figures.indeterminacy(ROWS, compare={"exact": exact}, backend=backend)
    contacts, etas = (curves(frame) for frame in frames(figure))
    assert list(etas) == ["η1", "η2", "0.15 η3", "0.15 η3, exact"]
    np.testing.assert_allclose(etas["η2"], ([0.1, 1], [0.4, 4]))  # logarithmic: no place for 0
    np.testing.assert_allclose(etas["0.15 η3"], ([0.1, 1], [0.6, 6]))
    np.testing.assert_allclose(etas["0.15 η3, exact"], ([0.1], [1.35]))
    np.testing.assert_allclose(contacts["z"], ([0.1, 1], [3.9, 3]))
    bars = frames(figure)[1].traverse(lambda e: e, [hv.ErrorBars])[0]
    np.testing.assert_allclose(bars.dimension_values("above"), [0.1, 1])  # standard error of 1, 3


def test_extents_are_densities_with_their_tails(rng):
    groups = {0.1: [rng.exponential(2.0, 4000) for _ in range(2)], 1.0: [np.zeros(5)]}
    linear, log = (curves(frame) for frame in frames(figures.extents(groups)))
    (label,) = linear  # nothing is drawn of a packing without indeterminacy
    b = float(label.partition("b = ")[2])
    assert b == pytest.approx(1, abs=0.15)
    x, height = linear[label]
    assert np.sum(height) * (x[1] - x[0]) == pytest.approx(1 - np.exp(-4), abs=0.01)
    np.testing.assert_allclose(height, np.exp(-x), atol=0.1)
    np.testing.assert_allclose(log[label][1], height)
    few = frames(figures.extents({0.1: [np.array([0.0, 0.0, 1.0])]}))[0]
    assert list(curves(few)) == ["μ = 0.1"]  # too few for a tail


def test_extents_are_shown_by_ranges_with_errors_and_without_bridges():
    alike = {mu: [np.array([0.1, 0.3, 2.1])] * 3 for mu in (0.01, 0.1, 1)}
    alike[0.1] = [np.array([0.1, 0.3, 2.1]), np.array([0.1, 0.1, 2.1])]
    figure = figures.extents(alike, largest=4.0, bins=16, unit="⟨f_n⟩")
    linear, *logs = frames(figure)
    assert len(curves(linear)) == 3
    assert [list(curves(frame)) for frame in logs] == [["μ = 0.01"], ["μ = 0.1"], ["μ = 1"]]
    x, height = curves(logs[1])["μ = 0.1"]
    assert x[-1] == 2.125  # the last bin that holds any
    np.testing.assert_allclose(height[[0, 1, -1]], [2, 2 / 3, 4 / 3])
    assert np.isnan(height[2:-1]).all()  # empty bins interrupt the line
    _, height = curves(linear)["μ = 0.1"]
    assert not height[2:-1].any()
    bars = linear.traverse(lambda e: e, [hv.ErrorBars])[1]
    np.testing.assert_allclose(bars.dimension_values("above"), 2 / 3)  # of 4/3 and 8/3, and 4/3, 0
    assert not len(linear.traverse(lambda e: e, [hv.ErrorBars])[0])  # all alike


def test_correlations_carry_the_range_over_networks():
    rows = [
        {"mu": mu, "correlation": c, "correlation_low": c - 0.1, "correlation_high": c + 0.3}
        for mu in (0, 0.1, 1)
        for c in (mu, mu + 0.2)
    ]
    beside = {"exact": [{"mu": 0.1, "correlation": 0.5}]}
    figure = figures.correlations(rows, compare=beside, chance={0.1: 0.02, 1: 0.05})
    drawn = curves(figure)
    np.testing.assert_allclose(drawn["walk"], ([0.1, 1], [0.2, 1.1]))
    np.testing.assert_allclose(drawn["exact"], ([0.1], [0.5]))
    np.testing.assert_allclose(drawn["chance"], ([0.1, 1], [0.02, 0.05]))
    bars = figure.traverse(lambda e: e, [hv.ErrorBars])[0]
    np.testing.assert_allclose(bars.dimension_values("below"), [0.1, 0.1])
    np.testing.assert_allclose(bars.dimension_values("above"), [0.3, 0.3])


def test_pictures_need_no_browser(tmp_path):
    figure = figures.indeterminacy(ROWS, backend="matplotlib")
    for name in ("a.png", "a.svg", "b.svg"):
        figures.save(figure, tmp_path / name)
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    with pytest.raises(InputError, match=r"not '\.gif'"):
        figures.save(figure, tmp_path / "a.gif")


def test_one_backend_does_not_displace_the_other():
    figures.indeterminacy(ROWS, backend="bokeh")
    current = hv.Store.current_backend
    figures.indeterminacy(ROWS, backend="matplotlib")
    assert hv.Store.current_backend == current
    with pytest.raises(InputError, match="choose bokeh or matplotlib"):
        figures.indeterminacy(ROWS, backend="plotly")


@pytest.mark.parametrize("backend", ["bokeh", "matplotlib"])
def test_perturbation_is_joined_in_order_of_friction(backend):
    rows = [
        {"mu": mu, "eta2": eta + k, "critical_force": 2 + k, "decay_exponent": mu, "limit_load": 5}
        for mu, eta in ((0.1, 3), (0, 0), (10, 1))
        for k in (0, 2)
    ]
    rows.append({"mu": 1, "eta2": 2.0, "critical_force": 1.0, "decay_exponent": np.nan})
    force, decay = frames(figures.perturbation(rows, backend=backend))
    np.testing.assert_allclose(curves(force)["critical force"], ([1, 4, 2, 2], [3, 3, 1, 3]))
    np.testing.assert_allclose(curves(decay)["in order of μ"], ([1, 4, 2], [0, 0.1, 10]))
    assert "limit load" not in curves(force)
    # Each μ has its own symbol, the same in both frames.
    names, looks = zip(*_looks(force, backend), strict=True)
    assert names == ("μ = 0", "μ = 0.1", "μ = 1", "μ = 10")
    assert len(set(looks)) == len(looks)
    assert set(_looks(decay, backend)) < set(zip(names, looks, strict=True))
    force, _ = frames(figures.perturbation(rows, limit=True, backend=backend))
    np.testing.assert_allclose(curves(force)["limit load"], ([1, 4, 2], [5, 5, 5]))


def _looks(frame, backend):
    """[(label, (colour, marker))] of the points of a frame."""
    for dots in frame.traverse(lambda e: e, [hv.Scatter]):
        look = dots.opts.get("style", backend=backend).kwargs
        yield dots.label, (look["color"], look["marker"])


def test_possible_forces_are_relative_to_the_original(rng):
    original = np.array([4.0, 0.0, 1.0, 2.0])
    states = original * np.array([[0.5], [1.5]]) + [0, 0, 0, 9]
    least, extent = original / 2, original
    figure = figures.possible_forces({0.1: (original, states, least, extent)})
    (frame,) = frames(figure)
    dots = frame.traverse(lambda e: e, [hv.Scatter])[0]
    # Weak to strong; no ratio to a force that is 0, none drawn beyond the frame.
    assert sorted(zip(*(dots.dimension_values(k) for k in (0, 1)), strict=True)) == [
        *((1, 0.5), (1, 1.5), (3, 0.5), (3, 1.5))
    ]
    bars = frame.traverse(lambda e: e, [hv.ErrorBars])[0]
    middle, reach = (bars.dimension_values(name) for name in ("y", "below"))
    np.testing.assert_allclose(middle - reach, 0.5)
    np.testing.assert_allclose(middle + bars.dimension_values("above"), 1.5)
    # Intervals that lie beyond the frame altogether are left out.
    beyond = figures.possible_forces({0.1: (original, states, 9 * original, extent)})
    bars = beyond.traverse(lambda e: e, [hv.ErrorBars])[0]
    assert len(bars) == 0


def test_all_states_of_all_contacts_are_counted():
    original = np.array([4.0, 0.0, 1.0])
    states = np.array([[4.0, 1.0, 0.5], [4.01, 1.0, 0.5], [8.0, 1.0, 0.7], [40.0, 1.0, 0.7]])
    counts = figures.ratio_counts(original, states)
    assert counts.sum(axis=1).tolist() == [3, 0, 4]  # one lies beyond, one contact has no force
    least, extent = states.min(axis=0), np.ptp(states, axis=0)
    figure = figures.force_densities({0.1: (original, counts, least, extent)})
    (frame,) = frames(figure)
    (image,) = frame.traverse(lambda e: e, [hv.Image])
    part = image.dimension_values(2, flat=False)
    assert part.shape == (120, 2)
    np.testing.assert_allclose(np.nansum(part, axis=0), [1, 0.75])  # weak to strong, of 4 states
    assert "1 of 2 reach beyond 3" in frame.opts.get("plot", backend="bokeh").kwargs["title"]
    assert "cut at 3" in frame.opts.get("plot", backend="bokeh").kwargs["ylabel"]


def test_a_legend_in_a_picture_shows_symbols():
    drawn = style.rendered(figures.indeterminacy(ROWS, backend="matplotlib"))
    (legend,) = [axes.get_legend() for axes in drawn.axes if axes.get_legend() is not None]
    assert [handle.get_marker() for handle in legend.legend_handles] == ["o", "s", "^"]


def test_variations_show_what_the_rows_hold():
    rows = [{"mu": mu, "n": n, "eta2": n * mu, "eta3": 1} for mu in (0.1, 1) for n in (100, 400)]
    small, large = frames(figures.sizes(rows, exact=[{"mu": 0.1, "n": 100, "eta3": 2.0}]))
    np.testing.assert_allclose(curves(small)["0.15 η3, exact"], ([100], [0.3]))
    assert "0.15 η3, exact" not in curves(large)
    np.testing.assert_allclose(curves(small)["η2"], ([100, 400], [10, 40]))
    np.testing.assert_allclose(curves(large)["0.15 η3"], ([100, 400], [0.15, 0.15]))
    eta2, _ = frames(figures.opened(rows, rows[:1]))
    np.testing.assert_allclose(curves(eta2)["made at μ = 0"], ([0.1, 1], [25, 250]))
    np.testing.assert_allclose(curves(eta2)["made at μ"], ([0.1], [10]))
    *_, eta3 = frames(figures.samplers({"some": [{"mu": 0.1, "eta3": 2.0}]}))
    np.testing.assert_allclose(curves(eta3)["some"], ([0.1], [0.3]))
    carried = [{"mu": mu, "seed": 1, "friction": mu, "own_shear": mu / 4} for mu in (0.1, 2)]
    drawn = [{"mu": 2, "seed": 1, "mean_shear": 0.2, "largest_shear": 0.3}]
    whole, parts = (curves(frame) for frame in frames(figures.stresses(carried, drawn)))
    np.testing.assert_allclose(whole["largest, exact"], ([0.1, 2], [0.1, 2]))
    np.testing.assert_allclose(whole["original network"], ([0.1, 2], [0.025, 0.5]))
    np.testing.assert_allclose(parts["original network"], ([0.1, 2], [0.25, 0.25]))
    np.testing.assert_allclose(parts["uniform networks, largest"], ([2], [0.15]))
    _, parts = frames(figures.stresses(carried, []))
    assert "uniform networks, mean" not in curves(parts)
    far = figures.distances([{"mu": 0.1, "original_ratio": 0.5, "walk_ratio": 1.5}])
    assert {label: y.tolist() for label, (_, y) in curves(far).items()} == {
        "original": [0.5],
        "nearest-network walk": [1.5],
        "uniform": [1.0],
    }


@pytest.fixture(scope="module")
def shipped():
    """All figures of the shipped study."""
    return drawings.all_figures(tables.load(ROOT / "data" / "study.zarr"))


def test_every_figure_of_the_study_has_a_caption(shipped):
    assert {f"figure{k}" for k in range(1, 7)} <= set(shipped) <= set(drawings.CAPTIONS)


OFTEN = "figure1", "figure3", "figure4", "figure5", "distances"  # one of each kind


@pytest.mark.parametrize("often", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_pictures_are_typeset_and_no_legend_lies_over_data(shipped, often):
    """Symbols are mathematical, and no point or line of any frame is under its legend."""
    for name in OFTEN if often else set(shipped) - set(OFTEN):
        drawn = style.rendered(shipped[name](backend="matplotlib"))
        drawn.canvas.draw()
        for text in drawn.findobj(Text):
            bare = re.sub(r"\$[^$]*\$", "", text.get_text())
            assert not re.search(r"_|[ημαΔ]|\w\^", bare), (name, text.get_text())
        for axes in drawn.axes:
            if axes.get_legend() is not None:
                box = axes.get_legend().get_window_extent()
                assert not [line for line in _lines(axes) if line.intersects_bbox(box, False)], name


def _lines(axes):
    """What is drawn in a frame as paths in pixels: lines, bars, points."""
    for line in axes.get_lines():
        yield line.get_transform().transform_path(line.get_path())
    for many in axes.collections:
        if isinstance(many, LineCollection):
            yield from (many.get_transform().transform_path(path) for path in many.get_paths())
        elif len(many.get_offsets()) > 1:
            yield Path(many.get_offset_transform().transform(many.get_offsets()))


def test_symbols_are_typeset_for_pictures_and_pages():
    assert style.typeset("ΔF_n / ⟨ΔF_n⟩", "matplotlib") == r"$\Delta F_n$ / ⟨$\Delta F_n$⟩"
    assert style.typeset("ΔF_n / ⟨ΔF_n⟩", "bokeh") == "ΔFₙ / ⟨ΔFₙ⟩"
    assert style.typeset("μ = 0.1, b = 2", "matplotlib") == r"$\mu$ = 0.1, $b$ = 2"
    assert style.typeset("N", "matplotlib") == "$N$"
    for words in ("same scale", "time / s"):
        assert style.typeset(words, "matplotlib") == words


def test_files_carry_their_caption(tmp_path):
    caption = "η against μ, 1 < 2"
    figure = figures.indeterminacy(ROWS, backend="matplotlib")
    for form in ("png", "svg"):
        figures.save(figure, tmp_path / f"figure.{form}", caption)
    assert Image.open(tmp_path / "figure.png").text["Description"] == caption
    picture = ElementTree.parse(tmp_path / "figure.svg").getroot()
    assert [
        picture.find(f"{{http://www.w3.org/2000/svg}}{name}").text for name in ("title", "desc")
    ] == [*("granforce", caption)]
    page = tmp_path / "figure.html"
    figures.save(figures.indeterminacy(ROWS), page, caption)
    assert "<title>η against μ, 1 &lt; 2</title>" in page.read_text()


def test_bodies_are_drawn_as_they_are():
    ground = [[-3, -1], [3, -1], [3, 0], [-3, 0]]
    box = [[0, 0], [1, 0], [1, 1], [0, 1]]
    packing = gf.blocks([box, [0.5, 1.4, 0.4], ground], 0.5, fixed=[2])
    drawn = gf.plot(packing)
    fixed, bodies = (element for element in drawn if isinstance(element, hv.Polygons))
    assert np.allclose(fixed.dimension_values(0), [-3, 3, 3, -3, -3])
    assert len(bodies.split()) == 2
    (lines,) = (element for element in drawn if isinstance(element, hv.Segments))
    middle = lines.array()[:, :4].reshape(-1, 2, 2).mean(axis=1)
    assert np.allclose(middle, packing.contact_points)
    picture = packing._repr_svg_()
    assert picture.count("<polygon") == 2 and picture.count("<circle") == 1


NOTEBOOK = """
from IPython.core.interactiveshell import InteractiveShell
shell = InteractiveShell.instance()
shell.run_cell('''
import granforce as gf
groove = gf.scene("groove")
drawn = [gf.plot(groove, backend=backend) for backend in ("matplotlib", "bokeh", "matplotlib")]
print(*("data:image" in figure._repr_mimebundle_()[0]["text/html"] for figure in drawn))
''')
"""


def test_notebooks_show_a_figure_in_the_backend_of_its_call():
    done = subprocess.run([sys.executable, "-c", NOTEBOOK], capture_output=True, text=True)
    assert "True False True" in done.stdout.splitlines(), done.stderr


@pytest.mark.parametrize("backend", ["bokeh", "matplotlib"])
def test_a_single_value_has_a_place_on_a_logarithmic_axis(backend, caplog, tmp_path):
    style.ready(backend)
    series = [([(0.3, 0.2, 0.01)], "η", "#000000", "solid", 0)]
    drawn = style.graph(series, backend, logx=True, logy=True, title="", x="μ", y="η")
    suffix = "html" if backend == "bokeh" else "png"
    with contextlib.redirect_stderr(io.StringIO()) as said:
        style.save(drawn, tmp_path / f"one.{suffix}")
    assert "Logarithmic" not in caplog.text + said.getvalue()
    low, high = drawn.opts.get("plot", backend=backend).kwargs["xlim"]
    assert low == 0.15 and high == 0.6
