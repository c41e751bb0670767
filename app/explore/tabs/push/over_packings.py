"""The paper's Figure 2: critical force and decay exponent against indeterminacy."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from bokeh.models import ColumnDataSource
from bokeh.plotting import figure as Figure

from granforce.measures import statistics

from ....results import study_data
from ....results.distributions import Row
from ....widgets.hints import term
from ....widgets.label_places import labels
from ....widgets.parts import figure
from ....widgets.plot_style import legend_above
from ...result_values import with_error
from ..friction.against_friction import COLOURS, MARKERS, draw_means

ACROSS = "how undetermined the forces are, η₂"
LINES = {"critical_force": "critical force", "limit_load": "limit load"}


def responses(page_rows: list[Row]) -> tuple[list[Figure], str, str]:
    """⟨F_crit⟩, limit load and α against η2, joined in order of μ: figures, lead and caption.

    page_rows: rows of the page's packings, drawn as open symbols.
    """
    table = study_data.study()
    study = pd.DataFrame() if table is None else table.answers()
    force = figure("critical_force", None, ACROSS, "push, in mean forces", height=300)
    _against_eta2(force, study, LINES)
    alpha = figure("decay", None, ACROSS, "decay exponent α", height=280)
    _against_eta2(alpha, study, {"decay_exponent": "α of |u| ~ r⁻ᵅ"})
    _ring(force, page_rows, list(LINES))
    _ring(alpha, page_rows, ["decay_exponent"])
    for fig in (force, alpha):
        if fig.renderers:
            legend_above(fig)
    text = (
        f"{term('critical_force', 'Critical force')}: the push at which the packing gives way. "
        f"{term('limit_load', 'Limit load')}: the push beyond which no network balances. "
        f"{term('alpha', 'α')}: how fast the first motion decays with distance, |u| ~ r⁻ᵅ. Each "
        "point is the mean over the packings of one μ, which is written where there is room, "
        f"with its standard error; open symbols: {len(page_rows)} packings on this page."
    )
    return [force, alpha], _lead(study), text


def _lead(study: pd.DataFrame) -> str:
    """The μ of the largest critical force, and whether η2 is largest there too, as HTML."""
    points = statistics.means(study, "critical_force")
    if not points:
        return ""
    mu, value, error = max(points, key=lambda point: point[1])
    loosest = max(statistics.means(study, "eta2"), key=lambda point: point[1])[0]
    return (
        f"<b>The critical force is largest at μ = {mu:g}: {with_error(value, error)} mean "
        f"forces.</b> Forces are least determined at μ = {loosest:g}."
    )


def _against_eta2(fig: Figure, rows: pd.DataFrame, lines: dict[str, str]) -> None:
    """Lines {name: label} against η2, with μ next to the points of the first."""
    drawn = []
    for k, (name, label) in enumerate(lines.items()):
        known = rows.dropna(subset=[name]) if len(rows) else rows
        across, up = statistics.means(known, "eta2"), statistics.means(known, name)
        if not up:
            continue
        mu = [m for m, _, _ in across]
        x, (y, error) = np.array([eta for _, eta, _ in across]), np.array(up).T[1:]
        columns = {"x": x, "y": y, "mu": mu, "error": error}
        draw_means(fig, label, columns, k, ("at μ", "@mu{0.[00000]}"), ("η₂", "@x{0.0000}"))
        drawn.append((mu, np.column_stack([x, y, error])))
    if not drawn:
        return
    mu, points = drawn[0]
    every = np.concatenate([points for _, points in drawn])
    span = np.ptp(every[:, 0]), np.ptp([every[:, 1] - every[:, 2], every[:, 1] + every[:, 2]])
    places = labels(points[:, 0], points[:, 1], [f"{m:g}" for m in mu], span)
    fig.text(
        "x", "y", "text", source=ColumnDataSource(places), x_offset="right", y_offset="down",
        text_align="align", text_baseline="baseline", text_font_size="10px",
        text_color="#808080", name="frictions",
    )  # fmt: skip


def _ring(fig: Figure, rows: list[Row], names: Sequence[str]) -> None:
    """Open symbols at rows, in the colours of the lines with these names."""
    for k, name in enumerate(names):
        known = [row for row in rows if np.isfinite(row.get(name, np.nan))]
        if known:
            fig.scatter(
                [row["eta2"] for row in known], [row[name] for row in known], size=12,
                marker=MARKERS[k], fill_alpha=0, line_color=COLOURS[k], line_width=2.2,
                legend_label="on this page",
            )  # fmt: skip
