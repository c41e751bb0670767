"""Numbers of the walk on screen, and what was left out or went wrong on the way."""

import panel as pn

TILE = '<div class="tile" title="{title}"><div class="name">{name}</div><div>{value}</div></div>'
STYLE = """
.tiles { display: grid; grid-template-columns: repeat(auto-fill, minmax(52px, 1fr)); gap: 5px;
  margin-top: 6px; }
.tile { padding: 4px 6px 3px; border-radius: 6px; background: rgba(128, 128, 128, 0.1);
  font-variant-numeric: tabular-nums; font-size: 13.5px; line-height: 18px; }
.tile .name { font-size: 11px; line-height: 13px; opacity: 0.75; }
.rest { font-size: 12px; opacity: 0.85; margin: 6px 2px 0; }
"""

TILES = (
    ("N", "n", "d", "number of disks"),
    ("φ", "packing_fraction", ".4f", "packing fraction, rattlers included"),
    ("z", "coordination", ".3f", "mean coordination number of the backbone"),
    ("h", "dimension", "d", "dimension of the set of admissible networks"),
    ("η1", "eta1", ".4f", "mean spread of a contact force over mean force"),
    ("η2", "eta2", ".4f", "distance of two states over the mean state"),
    ("0.15 η3", "scaled_eta3", ".4f", "mean interval over mean force, times 0.15"),
    ("accepted", "acceptance", ".0%", "accepted states per attempt"),
    ("R̂", "worst_r_hat", ".3f", "split R̂ of the component that mixes worst: 1 where chains agree"),
    ("ESS", "least_bulk_size", ".0f", "effective sample size of the component that mixes worst"),
)


def numbers(summary):
    """The tiles and the line below them, as HTML."""
    values = summary | {"scaled_eta3": 0.15 * summary["eta3"]}
    if summary.get("skipped"):
        values["acceptance"] = None  # nothing was tried
    texts = {key: _text(values[key], form) for _, key, form, _ in TILES if key in values}
    tiles = "".join(
        TILE.format(name=name, value=texts[key], title=title)
        for name, key, _, title in TILES
        if key in texts
    )
    return f'<div class="tiles">{tiles}</div><div class="rest">{left_out(summary)}</div>'


def _text(value, form):
    return "–" if value is None else format(value, form)


LEFT_OUT = {
    "rattlers": "rattlers",
    "unloaded_contacts": "unloaded contacts",
    "tangential_unknowns": "tangential unknowns",
    "skipped": "states without relaxation",
    "held": "components that cannot vary",
    "dropped": "states on the way to the sample",
}


def left_out(summary):
    """One line on work that was skipped and attempts that failed."""
    counts = [f"{summary[key]} {words}" for key, words in LEFT_OUT.items() if summary.get(key)]
    line = f"Left out: {', '.join(counts) or 'nothing'}."
    if summary.get("rejected") or summary.get("unconverged"):
        line += f" Failed: {summary['rejected']} rejected, {summary['unconverged']} unconverged."
    if summary["kept"] < summary["states"]:
        line += f" Shown: {summary['kept']} evenly spaced of {summary['states']} states."
    return line


class SummaryView:
    """The numbers of the replay on screen."""

    def __init__(self, state):
        self.state = state
        self.pane = pn.pane.HTML(stylesheets=[STYLE], sizing_mode="stretch_width", margin=(0, 10))
        state.param.watch(self._show, "replay")
        self._show()

    def panel(self):
        """The tiles."""
        return self.pane

    def _show(self, *events):
        replay = self.state.replay
        self.pane.object = numbers(replay.summary) if replay is not None else ""
