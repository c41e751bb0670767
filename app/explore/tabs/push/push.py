"""Push the disks of a contact apart: limit load, critical force, and how the packing gives way."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui
from bokeh.models import BoxAnnotation, ColumnDataSource, TapTool
from bokeh.plotting import figure as Figure

from ....background.jobs import Job
from ....results.library import Cell, Library
from ....results.replays import Replay
from ....state import perturbations
from ....state.app_state import AppState
from ....state.perturbations import Loads, Pushed
from ....state.view_settings import PUSHES
from ....widgets.hints import term
from ....widgets.parts import LATER, PRIMARY, TabView, figure, folded, note, plotted, question
from ....widgets.plot_style import DARK, DOT, ORIGINAL, corner, hover, legend_above
from ....widgets.progress import Progress
from ..friction import claims
from .load_slider import LoadSlider
from .over_packings import responses

TILE = (
    '<div style="padding:4px 10px;border-radius:6px;background:rgba(128,128,128,.1)"{}>'
    '<div style="font-size:11px;opacity:.75">{}</div>'
    '<div style="font-size:15px;font-variant-numeric:tabular-nums">{}</div></div>'
)
EXPLAINED = {  # words on tiles → keys of the glossary
    "carries as packed": "fn",
    "gives way at": "critical_force",
    "limit load": "limit_load",
}
TILES = '<div style="display:flex;flex-wrap:wrap;gap:6px">{}</div>'
SKETCH = """<svg viewBox="0 -10 320 174" width="320" height="174" role="img"
 aria-label="two disks that touch, with an arrow on each, away from the other, held by pale disks
 around them" fill="none" stroke="currentColor" style="display:block;margin:6px 0 2px">
 <g fill="rgba(139,160,187,0.14)" stroke="#8fa1b5" stroke-opacity="0.5">
 <circle cx="54.3" cy="51.4" r="34"/><circle cx="65.5" cy="115.6" r="31"/>
 <circle cx="160" cy="20.8" r="29"/><circle cx="160" cy="132.4" r="30"/>
 <circle cx="265.7" cy="51.4" r="34"/><circle cx="254.5" cy="115.6" r="31"/></g>
 <g fill="rgba(139,160,187,0.45)" stroke="#8fa1b5" stroke-width="1.5">
 <circle cx="122" cy="76" r="38"/><circle cx="198" cy="76" r="38"/></g>
 <g stroke="{colour}" stroke-width="4" stroke-linecap="round">
 <path d="M112 76H72M84 66L72 76L84 86M208 76H248M236 66L248 76L236 86"/></g>
 <g fill="currentColor" stroke="none" font-size="11" opacity="0.75" text-anchor="middle">
 <text x="50" y="42">neighbour</text><text x="50" y="56">holds</text>
 <text x="270" y="42">neighbour</text><text x="270" y="56">holds</text></g>
 <g fill="{colour}" stroke="none" font-size="11" text-anchor="middle">
 <text x="122" y="98">your push</text><text x="198" y="98">your push</text></g>
</svg>"""
LEAD = (
    "<b>You push two touching disks apart, harder and harder,</b> with two opposite forces. At "
    "first they only press less on each other; then their neighbours have to hold them. It holds "
    "as long as they find forces that balance your push; then disks begin to move."
)
WHERE = (
    "At rest these two press on each other with {now:.1f}; the mean force is 1, the largest in "
    "this packing {most:.1f}. Click another line to push there."
)
SHOWN = (
    "Pushed is contact {number}, in the picture fainter where the box repeats. Of all sets of "
    "forces that balance the push, those nearest to the forces as packed are shown; orange carries "
    "more than before, blue less. The push grows until contact dynamics finds no rest."
)
ISOSTATIC = (
    "<b>Without friction the least push moves the packing:</b> it has just as many contacts as it "
    "needs (it is isostatic)."
)
EVERY = (
    "<b>The failure load of a contact</b> (limit load): the largest pair of forces that may push "
    "its two disks apart before no forces at all can hold the packing."
)
Said = tuple[str, list[Figure], str, str]  # text, plots, numbers and lead

SCALE = 2.0  # of the largest force, up to which the slider goes at first
UNIT = "Forces are in units of the mean normal force."


class View(TabView):
    """The selected contact pushed; every contact's limit load; critical force and decay."""

    name = "perturb"

    def __init__(self, state: AppState) -> None:
        super().__init__(state, "replay", looks=["contact"])
        self.what = question("Question", PUSHES, self.looks, "pushing")
        self.load = LoadSlider(self._push, self._give_way)
        self.every = pmui.Button(label="Compute for all contacts", margin=(4, 8), **PRIMARY)
        self.animate = pmui.Switch(label="animate the first motion", value=True, margin=(4, 10))
        self.numbers = pn.pane.HTML(sizing_mode="stretch_width", margin=(4, 10))
        self.plots = pn.Column(sizing_mode="stretch_width")
        self.lead, self.told = note(), note()
        self.task = state.work.task(told=False)
        self.loads: Loads | None = None
        self.pushed: Any = None  # (Pushed, contact, Replay)
        self.gave = False  # whether the push has come to where disks move, which is not told before
        self._shown: Replay | None = None
        self.chosen = ColumnDataSource({"x": [], "y": []})
        self.what.param.watch(self.refresh, "value")
        self.animate.param.watch(self._animate, "value")
        self.every.on_click(lambda event: self._find_loads())
        self.task.param.watch(self.failed, "message")
        self.task.param.watch(lambda event: self.load.param.update(running=event.new), "running")
        self.looks.param.watch(self._animate, "tab")
        self.catch_up()

    def panel(self) -> pn.Column:
        """Choices, buttons, numbers and plot."""
        wide = {"sizing_mode": "stretch_width"}
        return pn.Column(
            pn.Column(self.what, styles=LATER, **wide),
            self.lead,
            self.load,
            pn.FlexBox(self.every, self.animate, **wide),
            Progress(self.task),
            self.numbers,
            self.plots,
            self.told,
            **wide,
        )

    def update(self) -> None:
        """Show what is chosen; what is not known yet waits for a hand, but for Fig. 2."""
        state, what = self.state, self.what.value
        if state.replay is not self._shown:
            self._shown, self.loads = state.replay, None
        if self.pushed is not None and not self._holds():
            self.task.cancel()
            self.pushed, self.gave = None, False
        one, fixed = what == "one", state.replay is None or state.replay.summary["mu"] == 0
        self.load.visible = one and not fixed
        self.every.visible = what == "all" and not fixed
        self.animate.visible = one and self.gave
        if state.replay is None:
            return
        self.load.param.update(
            contact=self.contact,
            path={} if self.pushed is None else path(self.pushed[0]),
            most=float(f"{SCALE * state.replay.normal[0].max(initial=0.5):.2g}"),
        )
        if fixed:
            self._say("", lead=ISOSTATIC)
            return
        {"one": self._one, "all": self._all, "store": self._store}[what]()
        self._animate()

    @property
    def contact(self) -> int | None:
        """What is pushed: the selected contact, or the one that is pointed out in the packing."""
        replay, chosen = self.state.replay, self.looks.contact
        return replay.invited if chosen is None and replay is not None else chosen

    def _holds(self) -> bool:
        """Whether what was pushed is still what is to be."""
        return self.pushed[1] == self.contact and self.pushed[2] is self.state.replay

    def _say(
        self, text: str, plots: Iterable[Figure] = (), numbers: str = "", lead: str = ""
    ) -> None:
        self.lead.object, self.told.object, self.numbers.object = lead, text, numbers
        self.plots.objects = [plotted(fig) for fig in plots]

    # One contact

    def _push(self) -> None:
        """The slider was moved: find out how far it goes."""
        state, contact, replay = self.state, self.contact, self.state.replay
        if contact is None or replay is None or self.what.value != "one":
            return
        work = perturbations.push(state.library, state.cell, replay, contact)
        self.task.start(work, lambda found: self._found(found, contact, replay))

    def _found(self, found: Pushed, contact: int, replay: Replay) -> None:
        if contact == self.contact and replay is self.state.replay:
            self.pushed, self.gave = (found, contact, replay), False
            self.refresh()

    def _give_way(self) -> None:
        self.gave = self.pushed is not None
        self.refresh()

    def _one(self) -> None:
        contact, replay = self.contact, self.state.replay
        drawn = LEAD + SKETCH.format(colour=DOT)
        if contact is None:
            self._say("", lead=drawn)
            return
        tiles = [("carries as packed", f"{replay.normal[0, contact]:.2f}")]
        if not self.gave:
            where = WHERE.format(now=replay.normal[0, contact], most=replay.normal[0].max())
            how = folded(SHOWN.format(number=replay.backbone[contact]))
            loads = [] if self.loads is None else [self.loads.load[contact]]
            known = _tiles([("limit load", f"{load:.2f}") for load in loads])
            self._say(how, numbers=known, lead=drawn + where)
            return
        pushed = self.pushed[0]
        tiles += [("gives way at", f"{pushed.low:.2f}"), ("limit load", f"{pushed.limit:.2f}")]
        lead = (
            f"<b>Pushed apart with about {pushed.low:.2g} times the mean force, the packing gives "
            f"way:</b> {pushed.opened} of its contacts open, {pushed.slid} slide, {pushed.kept} "
            "hold. At the end of the slider the packing shows how disks set off."
        )
        text = (
            f"The {term('critical_force', 'critical force')} of contact "
            f"{replay.backbone[contact]}, with which the packing gives way, lies between "
            f"{pushed.low:.3f} and {pushed.high:.3f} × the mean force; it is never above the "
            f"{term('limit_load', 'limit load')}, beyond which no network in balance exists. "
            "|u| is how far a disk moves first, against the root mean square over all disks."
        )
        if np.isfinite(pushed.exponent):  # not in boxes too small for a fit
            inner, outer = pushed.fit
            text += (
                f" The mean of |u| in shells goes like {term('alpha', 'r<sup>−α</sup>')} with "
                f"α = {pushed.exponent:.2f}, fitted from r = {inner:.1f} to {outer:.1f} largest "
                "radii (shaded); other ranges give α "
                f"from {pushed.spread[0]:.2f} to {pushed.spread[1]:.2f}."
            )
        self._say(UNIT + folded(text), [self._decay(pushed)], _tiles(tiles), lead)

    def _decay(self, pushed: Pushed) -> Figure:
        """|u| of every grain against its distance from the contact, and its mean in shells."""
        fig = figure(
            "displacement", "How far the push reaches",
            "distance from the pushed contact, in largest radii",
            "how far a disk moves (1: typical)", height=330, x_axis_type="log", y_axis_type="log",
        )  # fmt: skip
        seen = (pushed.size > 1e-4 * pushed.size.max()) & (pushed.distance > 0)
        fig.scatter(
            pushed.distance[seen], pushed.size[seen], size=4, color=DARK, alpha=0.5,
            legend_label="one dot, one disk",
        )  # fmt: skip
        known = np.isfinite(pushed.profile) & (pushed.profile > 0)
        fig.line(
            pushed.radius[known], pushed.profile[known], color=ORIGINAL, line_width=2.5,
            legend_label="mean at this distance",
        )  # fmt: skip
        if np.isfinite(pushed.exponent):
            _fit(fig, pushed)
        legend_above(fig)
        corner(fig, "measured: the first motion")
        return fig

    def _animate(self, *events: Any) -> None:
        """The first motion goes to and fro on the packing while this tab is seen."""
        shown = self.visible and self.what.value == "one" and self.animate.value
        field = self.pushed[0].displacement if shown and self.gave else None
        if self.state.displacement is not field:
            self.state.displacement = field

    # All contacts

    def _find_loads(self) -> None:
        work = perturbations.limit_loads(self.state.library, self.state.cell)
        self.task.start(work, self._loads_known)

    def _loads_known(self, found: Loads) -> None:
        self.loads = found
        self.refresh()

    def _all(self) -> None:
        if self.loads is None:
            self._say(folded("One linear program for each contact."), lead=EVERY)
            return
        replay, loads = self.state.replay, self.loads
        fig = figure(
            "limit_loads", None, "its normal force fₙ as packed, in mean forces",
            "failure load of a contact, in mean forces", height=380,
        )  # fmt: skip
        source = ColumnDataSource(
            {"x": replay.normal[0], "y": loads.load, "contact": replay.backbone}
        )
        points = fig.scatter(
            "x", "y", source=source, size=4.5, color=DARK, alpha=0.75, nonselection_alpha=0.75
        )
        fig.scatter(
            "x", "y", source=self.chosen, size=13, fill_alpha=0, line_color=DOT, line_width=2
        )
        contact = self.looks.contact
        here = [] if contact is None else [contact]
        self.chosen.data = {"x": replay.normal[0, here], "y": loads.load[here]}
        fig.add_tools(
            hover(
                [points], ("contact", "@contact"), ("fₙ", "@x{0.00}"), ("limit load", "@y{0.00}")
            ),
            TapTool(renderers=[points]),
        )
        source.selected.on_change("indices", self._tapped)
        corner(fig, "exact: certified bounds")
        median, most = np.percentile(loads.load, [50, 90])
        lead = (
            f"<b>Half of the contacts bear a push of {median:.2f} mean forces, one in ten more "
            f"than {most:.2f}.</b> Each dot is one contact: click it to find it in the packing."
        )
        text = (
            f"{EVERY} One linear program for each of {len(loads.load)} contacts, certified to "
            f"{loads.gap:.0e} of the mean force, in {loads.seconds:.1f} s."
        )
        self._say(folded(text), [fig], lead=lead)

    def _tapped(self, name: str, old: Any, new: list[int]) -> None:
        if new:
            self.looks.contact = int(new[0])

    # Over the store

    def _store(self) -> None:
        state = self.state
        self._say("")
        self.task.start(
            over_store(state.library, list(state.catalogue), state.cell), self._show_store
        )

    def _show_store(self, found: Said) -> None:
        if self.what.value == "store":
            self._say(*found)


def path(pushed: Pushed) -> dict[str, Any]:
    """Networks under growing loads as the slider takes them: flat arrays, forces in ⟨f_n⟩."""
    return {
        "values": pushed.loads,
        "normal": pushed.states[..., 0].astype(np.float32).ravel(),
        "tangential": pushed.states[..., 1].astype(np.float32).ravel(),
        "residual": pushed.residual,
    }


def over_store(library: Library, cells: list[Cell], cell: Cell) -> Callable[[Job], Said]:
    """Work that draws Fig. 2 of the paper: the study, and all perturbed packings of the stores."""

    def work(job: Job) -> Said:
        job.begin("reading the stores")
        found = perturbations.over_store(library, cells, cell)
        job.begin("drawing")
        drawn, lead, text = responses(found)
        return (
            folded(text)
            + claims.claims(
                "store", "What the paper claims, and what the study found", opened=True
            ),
            drawn,
            "",
            lead,
        )

    return work


def _fit(fig: Figure, pushed: Pushed) -> None:
    """The power law that was fitted, and over which range."""
    inner, outer = pushed.fit
    known = np.isfinite(pushed.profile) & (pushed.profile > 0)
    known &= (pushed.radius >= inner) & (pushed.radius <= outer)
    r = pushed.radius[known]
    middle = np.exp(np.log(pushed.profile[known]).mean() + pushed.exponent * np.log(r).mean())
    ends = np.array([inner, outer])
    fig.line(
        ends, middle * ends**-pushed.exponent, color=DOT, line_width=2.5, line_dash="dashed",
        legend_label=f"fit, α = {pushed.exponent:.2f}",
    )  # fmt: skip
    fig.add_layout(BoxAnnotation(left=inner, right=outer, fill_alpha=0.1, fill_color="#808080"))


def _tiles(tiles: list[tuple[str, str]]) -> str:
    return TILES.format("".join(TILE.format(_explained(name), name, v) for name, v in tiles))


def _explained(name: str) -> str:
    """Attributes by which a tile is explained where it stands."""
    key = EXPLAINED.get(name)
    return f' tabindex="0" data-term="{key}"' if key else ""
