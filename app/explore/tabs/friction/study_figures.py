"""Figures over μ: the finished study with its error bars, and on top what is on the page."""

import html
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, DataRange1d, FixedTicker, GlyphRenderer, Label, Title
from bokeh.plotting import figure as Figure

from granforce.measures import statistics
from granforce.types import Floats

from ....results import distributions, study_data
from ....results.distributions import Row
from ....widgets.hints import term
from ....widgets.label_places import labels
from ....widgets.parts import figure
from ....widgets.plot_style import DOT, SERIES, corner, hover, legend_above

MEASURES = (
    ("eta1", "spread η1", 1.0),
    ("eta2", "distance η2", 1.0),
    ("eta3", "0.15 × range η3", 0.15),
)
EXACT = "exact"  # what is, is dashed
# Parts of the study, and what they are called.
SAMPLERS = {
    "walk": "random walk",
    "sweeps_1e-3": "by Gauss–Seidel, to 10⁻³",
    "uniform": "uniform in S",
    "exact": EXACT,
    "sweeps_1e-4": "by Gauss–Seidel, to 10⁻⁴",
}
OWN, HERE = "on this page", "this packing"
# Names of this packing's ring, of what a visitor draws, and of the word that asks for it.
THIS, GUESS, DRAW, BAND = "own", "guess", "draw", "band"
PEAK = "↓ most here: click"
LIKE = {0.03: "like ice", 1.0: "like rubber"}  # about, against themselves or a road
RISES = "friction gives\neach force room"
FALLS = "but packings have\nfewer contacts"
COLOURS = (*SERIES, "#cc79a7", "#56b4e9", "#e69f00")
MARKERS = ("circle", "square", "triangle", "diamond", "inverted_triangle")
SHOWN = (0.01, 0.1, 1.0, 10.0)  # frictions of the study whose P(ΔF_n) is drawn
# Titles of the figures of indeterminacy after the first, which are closed at first.
FOLDED = (
    "Why it falls again: with more friction, packings have fewer contacts",
    "Three measures of how much forces vary",
    "Networks found in other ways",
)
DECADES = [1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1, 10]
CLAIMS = """<details>
<summary>What the published study found, and what was found here</summary>
<table class="claims"><caption>The paper (Shaebani, Unger, Kertész, PRE 79, 052302)
says, and what the study found, with its 95 % interval</caption>{}</table>{}</details>"""
CLAIM = "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>"
VERDICTS = {"reproduced": "✓", "differs": "≈", "not reproduced": "✗"}
# Whose numbers a claim is judged by.
JUDGED = {
    "gauss_seidel": f"{term('gauss_seidel_only', 'walk by Gauss–Seidel')}, to 10⁻³",
    "gauss_seidel_1e-4": f"{term('gauss_seidel_only', 'walk by Gauss–Seidel')}, to 10⁻⁴",
    "gauss_seidel_1e-6": f"{term('gauss_seidel_only', 'walk by Gauss–Seidel')}, to 10⁻⁶",
    "nearest": "walk to nearest networks",
    "uniform": "uniform networks",
    "exact": "exact",
    "": "perturbed contacts",
}
Points = Sequence[tuple[float, float, float]]  # x, y and error
Drawn = tuple[list[Figure], str, str]  # figures, lead and caption
RINGS = f"open symbols: {term('store', 'precomputed results')} made like those on screen"
STUDY = f"lines: means over the packings of {term('study', 'the study')}, bars their standard error"


def claims(about: str) -> str:
    """The paper's claims and what was found, as HTML."""
    found = study_data.claims(about)
    measured = [claim for claim in found if np.isfinite(claim["value"])]
    lines = (
        CLAIM.format(
            html.escape(written(f"{c['statement']} ({c['measured']})")),
            JUDGED[c["sampler"]],
            _with_interval(c),
            f"{VERDICTS.get(c['verdict'], '')} {html.escape(c['verdict'])}",
        )
        for c in measured
    )
    left = len(found) - len(measured)
    rest = f"<p>{left} more of its statements have not been measured yet.</p>" if left else ""
    return CLAIMS.format("".join(lines), rest) if found else ""


def _with_interval(claim: dict[str, Any]) -> str:
    low, high = claim["low"], claim["high"]
    interval = f" ({low:.2g} … {high:.2g})" if np.isfinite([low, high]).all() else ""
    return f"{claim['value']:.2g}{interval}"


def written(text: str) -> str:
    """A text with its symbols as on the page."""
    return text.replace("F_n", "Fₙ").replace("f_n", "fₙ").replace("F_crit", "Fᶜʳⁱᵗ")


def indeterminacy(own: list[Row], exact: list[Row], here: Row, log: bool) -> Drawn:
    """η1 against μ by the walk, z, all three η, and 0.15 η3 by all samplers: four figures.

    here: of the rows `own` that of the packing on screen.
    """
    kind = {"y_axis_type": "log" if log else "linear"}
    walks = study_data.rows("walk")
    spread = _over_mu("spread", "how much a force varies (mean force = 1)", 330, **kind)
    found = statistics.means(walks, "eta1")
    _line(spread, found, f"mean of {_packings(walks)} packings", log)
    _own(spread, [(here["mu"], here["eta1"], 0.0)], log, colour=DOT, label=HERE, name=THIS)
    _peak(spread, found)
    etas = _over_mu("indeterminacy", "how undetermined, η", 270, title=FOLDED[1], **kind)
    for k, (name, label, factor) in enumerate(MEASURES):
        _line(etas, statistics.means(walks, name, factor=factor), label, log, k)
    for k, (name, _, factor) in enumerate(MEASURES):
        _own(etas, statistics.means(own, name, factor=factor), log, k)
    for fig in (spread, etas):
        corner(fig, "measured in networks found at random")
        legend_above(fig)
    seen = _over_mu("samplers", "0.15 × range η3", 270, title=FOLDED[2], **kind)
    for k, (part, label) in enumerate(SAMPLERS.items()):
        points = statistics.means(study_data.in_force_space(part), "eta3", factor=0.15)
        _line(seen, points, label, log, k)
    _own(seen, statistics.means(own, "eta3", factor=0.15), log)
    _own(seen, statistics.means(exact, "eta3", factor=0.15), log, 3)
    corner(seen, "dashed exact, others measured")
    z = _over_mu("coordination", "contacts per disk z", 220, title=FOLDED[0])
    _line(z, statistics.means(study_data.rows("walk"), "coordination"), "z")
    _own(z, statistics.means(own, "coordination"))
    corner(z, "measured: of the packings")
    legend_above(seen, 3)
    z.legend.visible = False
    text = (
        f"{_averaged(walks, own)}How undetermined the forces are, against friction: "
        f"{term('eta1')}, {term('eta2')}, {term('eta3', '0.15 η3')}; {STUDY}; {RINGS}. Friction "
        "widens what each contact may carry, but a packing made with more of it has fewer contacts "
        "(z falls from 4 to 3), so fewer forces are free: η rises and then falls. Each μ "
        "has its own packing. Found "
        f"in several ways: 0.15 η3 of the {term('walk', 'random walk')}, of the "
        f"{term('gauss_seidel_only', 'walk by Gauss–Seidel')} to two unbalances, of networks "
        f"{term('uniform')}, and {term('exact', 'exact')}."
    )
    return [spread, z, etas, seen], most_undetermined(found), text


def hide_curve(fig: Figure, hidden: bool) -> None:
    """Hide all of the first figure but the packing on screen and the axes, or show it."""
    for part in (*fig.renderers, *fig.center):
        if isinstance(part, GlyphRenderer) and part.name == DRAW:
            part.visible = hidden
        elif isinstance(part, GlyphRenderer) and part.name not in (THIS, GUESS):
            part.visible = not hidden
        elif isinstance(part, Label) and part.name in ("peak", "rises", "falls"):
            part.visible = not hidden
    for said in (*fig.select(Title), *fig.select(name=BAND)):
        said.visible = not hidden
    fig.legend.visible = not hidden


def most_undetermined(points: Points) -> str:
    """At which friction of (μ, η, error) η is largest, in words; empty without any."""
    if not points:
        return ""
    peak = max(points, key=lambda point: point[1])[0]
    return (
        f"<b>Forces vary most at friction {peak:g}.</b> More friction leaves every "
        "force more room, but disks packed with more friction come to rest with fewer contacts, "
        "so fewer numbers are free. Click a point to see such a packing; individual packings lie "
        "above or below the average."
    )


def _averaged(walks: list[Row], own: list[Row]) -> str:
    """Over how many packings the first figure's points are means, in a sentence or two."""
    if not walks or not own:
        return ""
    return (
        "Each point: by how much a contact's force varies over the networks of a packing, as "
        f"mean over {_packings(walks)} packings; open symbols: over {_packings(own)} computed on "
        "this page, which need not lie on the line, as packings differ. Grey: the friction on "
        "screen. "
    )


def _packings(rows: list[Row]) -> str:
    """How many packings there are at a friction: "10 to 30"."""
    counts = Counter(row["mu"] for row in rows).values()
    least, most = min(counts, default=0), max(counts, default=0)
    return str(most) if least == most else f"{least} to {most}"


def _peak(fig: Figure, points: Points) -> None:
    """Mark the largest of the points (μ, η, error), and say why it lies between the ends."""
    if not points:
        return
    x, y, error = max(points, key=lambda point: point[1])
    fig.y_range = DataRange1d(end=1.25 * (y + error))  # room for what is written
    told = (
        (x, y + error, PEAK, "left", DOT, "peak"),
        (points[1][0], 0.45 * y, RISES, "left", "#808080", "rises"),
        (points[-1][0], 0.22 * y, FALLS, "right", "#808080", "falls"),
        *((at, 0.0, word, "center", "#808080", "like") for at, word in LIKE.items()),
    )
    for at, up, text, align, colour, name in told:
        fig.add_layout(
            Label(
                x=at, y=up, text=text, x_offset=-4, y_offset=6, text_align=align,
                text_font_size="12px", text_color=colour, name=name,
            )
        )  # fmt: skip


def correlations(own: list[Row], exact: list[Row]) -> Drawn:
    """corr(f_n, ΔF_n) against μ."""
    fig = _over_mu("correlation", "correlation of fₙ and ΔFₙ", 380)
    for k, part in enumerate(("walk", "uniform", "exact")):
        _line(fig, statistics.means(study_data.rows(part), "correlation"), SAMPLERS[part], k=k)
    known = [row for row in own if np.isfinite(row["correlation"])]
    _own(fig, statistics.means(known, "correlation"))
    _own(fig, statistics.means(exact, "correlation"), k=2)
    legend_above(fig)
    corner(fig, "dashed exact, others measured")
    text = (
        "Whether strong contacts are the undetermined ones: correlation over contacts of the "
        f"fₙ {term('original', 'as packed')} with the extent {term('extent', 'ΔFₙ')}; {STUDY}; "
        f"{RINGS}."
    )
    return [fig], strong_and_undetermined(), text


def strong_and_undetermined() -> str:
    """Between which values the walk's correlation lies, in words; empty without a study."""
    points = statistics.means(study_data.rows("walk"), "correlation")
    if not points:
        return ""
    values = [value for _, value, _ in points]
    peak = max(points, key=lambda point: point[1])[0]
    return (
        f"<b>Over all frictions the correlation lies between {min(values):.2f} and "
        f"{max(values):.2f}, largest at {peak:g}.</b> 1: the strongest contacts are the least "
        "determined ones; 0: strength says nothing about it."
    )


def extents(own: list[Row], mu: float, log: bool) -> Drawn:
    """P(ΔF_n) in ⟨f_n⟩ for some μ of the study, and of the packings on the page with this μ."""
    groups = distributions.groups(own, mu)
    fig = figure(
        "extents", None, "length ΔFₙ of a contact's interval, in mean forces",
        "how often, P(ΔFₙ)", height=400, y_axis_type="log" if log else "linear",
    )  # fmt: skip
    table = study_data.study()
    known = {} if table is None else table.extents("walk")
    curves = [(value, known[value], f"μ = {value:g}") for value in SHOWN if value in known]
    if mu in groups:
        curves.append((mu, groups[mu], f"μ = {mu:g}, {OWN}"))
    largest = max((np.quantile(np.concatenate(g), 0.995) for _, g, _ in curves), default=1.0)
    edges = np.linspace(0, largest, 31)
    middle = (edges[1:] + edges[:-1]) / 2
    tails = []
    for k, (_, group, label) in enumerate(curves):
        values = np.concatenate(group)
        height = statistics.density(values, edges)
        height = np.where(height > 0, height, np.nan) if log else height
        mine = label.endswith(OWN)
        tails.append(f"{label}: b = {statistics.tail_exponent(values):.2f}")
        look = {
            "color": "#b5236b" if mine else COLOURS[k],
            "legend_label": label,
        }
        fig.line(middle, height, line_width=3 if mine else 1.6, **look)
        fig.scatter(middle, height, size=5, marker=MARKERS[k % 4], **look)
    if curves:
        legend_above(fig, 2)
    corner(fig, "seen by the walk")
    text = (
        "How the extents ΔFₙ of the normal forces are distributed, in units of the mean force. b: "
        "beyond the median the tail falls like exp(−(λx)ᵇ); b = 1 is exponential, larger b falls "
        f"faster. Thin: ten packings of {term('study', 'the study')} each; thick: {OWN} made like "
        f"those on screen. {'; '.join(tails)}."
    )
    lead = "" if mu not in groups else (
        f"<b>At friction {mu:g} one contact's force differs by "
        f"{np.mean(np.concatenate(groups[mu])):.2f} mean forces on average</b> between the "
        "networks seen. Each curve is one friction: how many contacts have how long an interval."
    )  # fmt: skip
    return [fig], lead, text


def responses(own: list[Row]) -> Drawn:
    """⟨F_crit⟩ and α against η2, joined in order of μ: the study, and on top own rows."""
    table = study_data.study()
    study = [] if table is None else table.answers()
    across = "how undetermined the forces are, η2"
    force = figure("critical_force", None, across, "push, in mean forces", height=300)
    lines = {"critical_force": "gives way at (critical force)", "limit_load": "limit load"}
    _against_eta2(force, study, lines)
    for k, name in enumerate(("critical_force", "limit_load")):
        _own(force, _pairs(own, name), k=k)
    title = "How fast the motion fades with distance: |u| ~ r⁻ᵅ"
    alpha = figure("decay", title, across, "decay exponent α", height=280)
    _against_eta2(alpha, study, {"decay_exponent": "α"})
    known = [row for row in own if np.isfinite(row["decay_exponent"])]
    _own(alpha, _pairs(known, "decay_exponent"))
    for fig in (force, alpha):
        if fig.renderers:
            legend_above(fig)
        corner(fig, "measured: contacts pushed one by one")
    text = (
        f"How hard a contact must be pushed until the packing gives way ("
        f"{term('critical_force', 'critical force')}; {term('limit_load', 'limit load')}), and how "
        f"fast the motion decays with distance ({term('alpha', '|u| ~ r⁻ᵅ')}), against "
        f"how undetermined the forces are ({term('eta2', 'η2')}). Joined in order of μ, which is "
        "written where there is room: means over three packings of "
        f"{term('study', 'the study')} with 30 contacts each, bars standard errors; {RINGS} "
        f"({len(own)})."
    )
    most = max(statistics.means(study, "critical_force"), key=lambda at: at[1], default=None)
    lead = "" if most is None else f"<b>The hardest pushes are borne at friction {most[0]:g}.</b> "
    lead += (
        "Critical force against η2: each point is the mean over packings of one friction μ, "
        "written beside it, and the line goes from the least to the largest friction."
    )
    return [force, alpha], lead, text


def _pairs(rows: list[Row], name: str) -> Points:
    return [(row["eta2"], row[name], 0.0) for row in rows if np.isfinite(row.get(name, np.nan))]


def _against_eta2(fig: Figure, rows: list[Row], lines: dict[str, str]) -> None:
    """Lines {name: label} against η2, and μ beside the points of the first."""
    drawn = []
    for k, (name, label) in enumerate(lines.items()):
        known = [row for row in rows if np.isfinite(row.get(name, np.nan))]
        across, up = statistics.means(known, "eta2"), statistics.means(known, name)
        mu = [m for m, _, _ in across]
        points = [(x, y, e) for (_, x, _), (_, y, e) in zip(across, up, strict=True)]
        if points:
            _line(fig, points, label, k=k, mu=mu)
            drawn.append((mu, np.array(points)))
    if not drawn:
        return
    mu, points = drawn[0]
    every = np.concatenate([points for _, points in drawn])
    span = np.ptp(every[:, 0]), np.ptp([every[:, 1] - every[:, 2], every[:, 1] + every[:, 2]])
    found = labels(points[:, 0], points[:, 1], [f"{m:g}" for m in mu], span)
    fig.text(
        "x", "y", "text", source=ColumnDataSource(found), x_offset="right", y_offset="down",
        text_align="align", text_baseline="baseline", text_font_size="10px",
        text_color="#808080", name="frictions",
    )  # fmt: skip


def _over_mu(
    name: str, label: str, height: int, title: str | None = None, **options: Any
) -> Figure:
    fig = figure(name, title, "friction μ", label, height=height, x_axis_type="log", **options)
    fig.xaxis.ticker = FixedTicker(ticks=DECADES)
    fig.xaxis.major_label_overrides = {mu: f"{mu:g}" for mu in DECADES}
    fig.xaxis.major_label_overrides |= {1e-5: "10⁻⁵", 1e-4: "10⁻⁴"}
    return fig


def _line(
    fig: Figure,
    points: Points,
    label: str,
    log: bool = False,
    k: int = 0,
    mu: Sequence[float] | None = None,
) -> None:
    """Line k of a figure with points and error bars; points (x, y, error); mu: if x is not."""
    x, y, error = _shown(points, log, zero=mu is not None)
    if not len(x):
        return
    colour, marker, dash = COLOURS[k], MARKERS[k], "dashed" if label == EXACT else "solid"
    fig.line(x, y, color=colour, line_width=1.6, line_dash=dash, legend_label=label)
    source = ColumnDataSource({"x": x, "y": y} | ({} if mu is None else {"mu": mu}))
    dots = fig.scatter(
        "x", "y", source=source, color=colour, size=6, marker=marker, legend_label=label
    )
    below = np.maximum(y - error, 0.1 * y) if log else y - error
    fig.segment(x, below, x, y + error, color=colour, line_width=1.4)
    at = ("μ", "@x{0.00000}") if mu is None else ("at μ", "@mu{0.[00000]}")
    fig.add_tools(hover([dots], at, (label, "@y{0.0000}")))


def _own(
    fig: Figure,
    points: Points,
    log: bool = False,
    k: int = 0,
    colour: str = "",
    label: str = OWN,
    name: str | None = None,
) -> None:
    """Rings around the page's own points of line k, over everything; colour: if another one."""
    x, y, _ = _shown(points, log, zero=fig.xaxis.axis_label != "friction μ")
    if len(x):
        fig.scatter(
            x, y, size=12, marker=MARKERS[k], fill_alpha=0, line_color=colour or COLOURS[k],
            line_width=2.2, legend_label=label, name=name,
        )  # fmt: skip


def _shown(points: Points, log: bool, zero: bool = False) -> Floats:
    """Columns of those points that the axes can show."""
    kept = [p for p in points if (zero or p[0] > 0) and (not log or p[1] > 1e-12)]
    return np.array(kept, dtype=float).reshape(-1, 3).T
