"""A photoelastic frame: measured against inferred forces, the network, and an honest account."""

import html

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource, LinearColorMapper, Title

from granforce.records import InputError

from .. import photoelastic
from ..exports import File
from .handover import Handover
from .parts import choice, figure, note
from .style import BLUE, EDGE, GREY, ORANGE, SERIES, corner, hover, legend_above, ramp

COMPONENTS = (("fₙ", BLUE), ("fₜ", ORANGE))
WIDEST = 9.0  # px, of the strongest contacts
STRONG = 0.995  # quantile of f_n from which on they are that wide
SHOWN = {"inferred": "Inferred", "measured": "Measured", "deviation": "Difference in σ"}
WORDS = {
    "inferred": "inferred; width: fₙ, pale: one standard error more",
    "measured": "measured; width: fₙ",
    "deviation": "inferred less measured fₙ, in its σ",
}
OFF = 4.0  # σ at which the colour of a difference ends
AMBER = "#e69f00"  # suspects: a warning
TOLD = 12  # contacts that are listed
PLAYED_MS = 700  # a frame of a series
WIDE = {"sizing_mode": "stretch_width", "margin": 0}


class Frames:
    """What there is to see of the frames in the files that were dropped, one at a time."""

    def __init__(self, first, files, task, **options):
        self.files, self.task, self.options = files, task, options
        self.known = {first.report["frame"]: first}
        self.frame = first
        self.body = pn.Column(**WIDE)
        self.choice = choice(SHOWN, "inferred")
        self.choice.param.watch(lambda event: self._dress(event.new), "value")
        self.save = Handover(
            self._hand_over, files={"This frame": {"table": "All contacts (CSV)"}}, margin=(4, 10)
        )
        self.player = pn.widgets.DiscretePlayer(
            label="frame", options=list(first.numbers), value=first.report["frame"],
            interval=PLAYED_MS, loop_policy="loop", visible=len(first.numbers) > 1,
            show_loop_controls=False, **WIDE,
        )  # fmt: skip
        self.player.param.watch(lambda event: self._turn(event.new), "value")
        self._show(first)

    def panel(self):
        """All of it, from above."""
        return [self.player, self.body]

    def _turn(self, number):
        """Another frame: as it is known, or inferred first, while the player waits."""
        if number in self.known:
            self._show(self.known[number])
        elif not self.task.running:
            self.player.pause()
            work = photoelastic.infer(self.files, number=number, **self.options)
            self.task.start(work, self._came)

    def _came(self, frame):
        self.known[frame.report["frame"]] = frame
        self._show(frame)
        if self.player.value not in self.known:  # turned on in the meantime
            self._turn(self.player.value)

    def _show(self, frame):
        self.frame = frame
        told = "".join(
            f"<p style='margin:5px 0'>{html.escape(line)}</p>"
            for line in photoelastic.account(frame.report)
        )
        head = f"<p><b>{html.escape(frame.source)}</b>, frame {frame.report['frame']}</p>"
        self.picture, self.layers = network(frame)
        self._dress(self.choice.value)
        self.body[:] = [
            note(head + told),
            self.choice,
            pn.pane.Bokeh(self.picture, **WIDE),
            note(listed(frame)),
            pn.pane.Bokeh(compared(frame), **WIDE),
            note(stresses(frame)),
            self.save,
        ]

    def _dress(self, shown):
        for name, drawn in self.layers.items():
            for renderer in drawn:
                renderer.visible = name == shown
        self.picture.select_one({"name": "shown"}).text = WORDS[shown]

    def _hand_over(self, key):
        name = f"frame{self.frame.report['frame']}.csv"
        try:
            self.save.hand_over(File(name, "text/csv", photoelastic.table(self.frame)))
        except InputError:
            self.save.rest()


def compared(frame):
    """Figure of inferred against measured forces, of the contacts that were measured."""
    fig = figure("photoelastic_forces", None, "measured / ⟨fₙ⟩", "inferred / ⟨fₙ⟩", height=340)
    seen = np.isfinite(frame.measured).all(axis=1)
    drawn, ends = [], [0.0]
    for part, (label, colour) in enumerate(COMPONENTS):
        x, y, error = (
            values[seen, part] for values in (frame.measured, frame.inferred, frame.error)
        )
        ends += [x.min(initial=0), x.max(initial=0), y.min(initial=0), y.max(initial=0)]
        source = ColumnDataSource(
            {"x": x, "y": y, "low": y - error, "high": y + error, "contact": np.flatnonzero(seen)},
            name=f"photoelastic_{'nt'[part]}",
        )
        fig.segment("x", "low", "x", "high", source=source, color=colour, alpha=0.2)
        drawn.append(
            fig.scatter(
                "x", "y", source=source, size=4, alpha=0.5, color=colour, legend_label=label
            )
        )
    ends = [min(ends), max(ends)]
    fig.line(ends, ends, color="#888888", line_dash="dashed", legend_label="as measured")
    fig.add_tools(hover(drawn, ("measured", "@x{0.00}"), ("inferred", "@y{0.00}")))
    legend_above(fig)
    corner(fig, "inferred: in balance, within friction")
    return fig


def network(frame):
    """Figure of the network on the grains, and {shown: renderers} of what it may show."""
    fig = figure(
        "photoelastic_network", None, "x as listed", "y as listed", match_aspect=True,
        aspect_ratio=1.0, sizing_mode="scale_width",
    )  # fmt: skip
    _draw_grains(fig, frame)
    layers = {name: [] for name in SHOWN}
    strong = max(np.quantile(frame.inferred[:, 0], STRONG), 1e-9)

    def chains(layer, normal, chosen, **options):
        width = WIDEST * np.clip(np.nan_to_num(normal) / strong, 0.0, 1.0)
        here = np.flatnonzero(chosen & (width > 0.1) & np.isfinite(frame.lines).all(axis=(1, 2)))
        (x0, y0), (x1, y1) = frame.lines[here, 0].T, frame.lines[here, 1].T
        source = {
            "x0": x0, "y0": y0, "x1": x1, "y1": y1, "width": width[here], "contact": here,
            "off": np.nan_to_num(frame.deviation[here, 0]), "f": np.nan_to_num(normal[here]),
            "error": frame.error[here, 0],
        }  # fmt: skip
        drawn = fig.segment(
            "x0", "y0", "x1", "y1", line_width="width", line_cap="round",
            source=ColumnDataSource(source), **options,
        )  # fmt: skip
        layers[layer].append(drawn)
        return drawn

    everywhere, listed_ones = np.ones(len(frame.added), dtype=bool), ~frame.added
    inferred, measured = frame.inferred[:, 0], frame.measured[:, 0]
    chains("inferred", inferred + frame.error[:, 0], everywhere, color=GREY, line_alpha=0.25)
    tips = [
        chains("inferred", inferred, listed_ones, color=BLUE, legend_label="listed contacts"),
        chains("inferred", inferred, frame.added, color=ORANGE, legend_label="added contacts"),
        chains("measured", measured, listed_ones, color=BLUE),
    ]
    colours = LinearColorMapper(palette=ramp(ORANGE, GREY, BLUE), low=-OFF, high=OFF)
    off = {"field": "off", "transform": colours}
    tips.append(chains("deviation", inferred, np.isfinite(measured), color=off))
    rows = ("contact", "@contact"), ("fₙ", "@f{0.00} ± @error{0.00}"), ("off by", "@off{0.0} σ")
    fig.add_tools(hover(tips, *rows))
    _mark(fig, frame)
    legend_above(fig, 3)
    corner(fig, WORDS["inferred"])
    next(one for one in fig.above if isinstance(one, Title)).name = "shown"
    return fig, layers


def _draw_grains(fig, frame):
    x, y = frame.x.T
    kinds = (
        ("grains", ~(frame.at_wall | frame.left_open), EDGE, 0.18),
        ("at a wall", frame.at_wall, EDGE, 0.5),
        ("left open", frame.left_open, SERIES[1], 0.9),
    )
    for label, chosen, colour, alpha in kinds:
        if chosen.any():
            fig.circle(
                x[chosen], y[chosen], radius=frame.r[chosen], fill_color=colour,
                fill_alpha=alpha, line_color=colour, line_alpha=0.5, legend_label=label,
            )  # fmt: skip


def _mark(fig, frame):
    """Suspects, contacts that carry for certain, and what was mended."""
    middle = frame.lines.mean(axis=1)
    for label, places, marker, colour in (
        ("suspect", middle[frame.suspects], "triangle", AMBER),
        ("certain", middle[frame.certain], "circle", SERIES[2]),
        ("mended", frame.found, "x", AMBER),
    ):
        if len(places):
            fig.scatter(
                *places.T, marker=marker, size=8, line_color=colour, fill_color=None,
                line_width=2, legend_label=label,
            )  # fmt: skip


def listed(frame):
    """Suspects and certain contacts as sentences."""

    def named(c):
        one, two = frame.ids[frame.ends[c]]
        return f"{one:g}–{two:g}" if two >= 0 else f"{one:g}–wall"

    suspects = [
        f"{named(c)} ({np.nanmax(np.abs(frame.deviation[c])):.1f} σ)" for c in frame.suspects[:TOLD]
    ]
    certain = [
        f"{named(c)} ({frame.inferred[c, 0]:.2f} ± {frame.error[c, 0]:.2f} ⟨fₙ⟩)"
        for c in frame.certain[:TOLD]
    ]
    told = []
    for count, words, some in (
        (len(frame.suspects), "measured contacts are beyond 3 σ", suspects),
        (len(frame.certain), "contacts that were not measured carry for certain (2 σ)", certain),
    ):
        more = ", …" if count > len(some) else ""
        told.append(f"<p>{count} {words}{': ' if some else ''}{', '.join(some)}{more}.</p>")
    return "".join(told)


def stresses(frame):
    """The stress by region as a table, the top of the picture above."""
    side = round(len(frame.stress) ** 0.5)
    rows = []
    for b in reversed(range(side)):
        cells = []
        for a in range(side):
            k = a * side + b
            lines = (
                f"{name} {value:.2f} ± {error:.2f}"
                for name, value, error in zip(
                    ("σₓₓ", "σᵧᵧ", "σₓᵧ"), frame.stress[k], frame.stress_error[k], strict=True
                )
            )
            cells.append(f"<td>{'<br>'.join(lines)}</td>")
        rows.append(f"<tr>{''.join(cells)}</tr>")
    head = "Stress by region, in the mean pressure (y grows upwards in the picture)"
    return f"<table class='claims'><caption>{head}</caption>{''.join(rows)}</table>"
