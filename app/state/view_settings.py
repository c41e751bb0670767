"""The view of the states on screen, as parameters: no widgets, no plots."""

from typing import Any

import param

# Name of a tab in links → title.
TABS = {
    "intervals": "Intervals",
    "plane": "Force space",
    "statistics": "Friction",
    "perturb": "Push",
    "upload": "Your packing",
    "export": "Export",
}
# Quantities for colour, width and order: name in links → words on screen.
COLOURS = {
    "change": "change since packed",
    "mobilised": "mobilisation fₜ/(μ fₙ)",
    "extent": "interval ΔFₙ",
    "load": "limit load",
    "known": "reduction by held forces",
    "deviation": "inferred − measured fₙ",
}
WIDTHS = {
    "normal": "normal force fₙ",
    "extent": "interval ΔFₙ",
    "load": "limit load",
    "known": "reduction by held forces",
    "measured": "measured fₙ",
}
# Glossary key of each quantity shown by colour or width.
EXPLAINED = {name: name for name in (*COLOURS, *WIDTHS)}
EXPLAINED |= {"mobilised": "mobilisation", "normal": "fn", "load": "limit_load", "known": "gone"}
SORTS = {
    "original": "force as packed",
    "extent": "interval ΔFₙ, seen",
    "exact": "interval ΔFₙ, exact",
    "position": "place in exact interval",
    "shortened": "reduction by held forces",
}
DRAWN = {"all": "all", "some": "a few"}
# Options of single tabs.
PUSHES = {"one": "one contact", "all": "every contact", "store": "against indeterminacy (Figure 2)"}
PLANES = {
    "pair": "the normal forces of two contacts",
    "principal": "the plane in which networks differ most",
    "contact": "both forces of one contact",
    "stress": "the stress that networks carry",
}
# Parts of the study: how their networks were found.
SAMPLERS = {
    "sweeps_1e-3": "the paper’s walk, to 10⁻³",
    "walk": "nearest-network walk",
    "uniform": "uniform in S",
}
SCALES = {"mean": "mean force = 1", "own": "force as packed = 1"}


class Appearance(param.Parameterized):
    """The part of a page's view that its player also knows; see Looks."""

    tab = param.String(default="intervals", doc="name of the visible tab; others compute nothing")
    wide = param.Boolean(doc="whether force space has a place of its own beside the packing")
    views = param.Integer(doc="how many views of tabs there are: what moves in them is drawn then")
    contact = param.Integer(default=None, allow_None=True, doc="selected: position in the backbone")
    paused = param.Boolean(doc="whether the player rests")
    opened = param.List(default=[], item_type=str, doc="names of the panels that are open")
    pulled = param.String(doc='"pull" or "push" if that led to the network on screen')
    frame = param.Integer(default=0, doc="row of `replay` on screen; updated while it is at rest")
    colour: Any = param.Selector(default="change", objects=list(COLOURS))
    thickness: Any = param.Selector(default="normal", objects=list(WIDTHS))
    full = param.Number(
        default=None, bounds=(1e-3, 1e3), allow_None=True,
        doc="⟨f_n⟩ at which colours are full; None: half for changes, else as the packing has it",
    )  # fmt: skip
    stretch = param.Number(default=1.0, bounds=(0.1, 10), doc="how many times as wide chains are")
    pushing: Any = param.Selector(default="one", objects=list(PUSHES), doc="what Perturb shows")
    scale: Any = param.Selector(default="mean", objects=list(SCALES), doc="unit of the intervals")


class Looks(Appearance):
    """The view of a page; rows and contacts are those of its Replay."""

    pair = param.Tuple(
        default=None, length=2, allow_None=True,
        doc="contacts whose normal forces span force space; None: two strong ones",
    )  # fmt: skip
    zoom = param.Tuple(
        default=None, length=3, allow_None=True,
        doc="middle and half width of what is seen, in largest radii; None: the whole packing",
    )  # fmt: skip
    pushed = param.Integer(default=None, allow_None=True, doc="contact whose push is in Push")
    drawn: Any = param.Selector(
        default="all", objects=list(DRAWN), doc="of which contacts intervals are drawn"
    )
    sort: Any = param.Selector(
        default="original", objects=list(SORTS), doc="order of the intervals"
    )
    sampler: Any = param.Selector(default="sweeps_1e-3", objects=list(SAMPLERS), doc="of Figure 1")
    axes: Any = param.Selector(default="pair", objects=list(PLANES), doc="of force space on screen")
    dark = param.Boolean(doc="theme")

    def fit(self, wide: bool) -> None:
        """Give force space a place of its own if the window is wide."""
        self.wide = wide

    def choose_tab(self, number: int) -> None:
        """Show tab 1, 2, …; other numbers, and force space where it has no tab, have no effect."""
        name = dict(enumerate(TABS, 1)).get(number)
        if name is not None and not (self.wide and name == "plane"):
            self.tab = name

    def sync_opened(self, panel: Any, *names: str) -> None:
        """Keep `opened` in sync with a panel: its `active` parts, or whether it is `open`."""
        parameter = "active" if "active" in panel.param else "open"

        def wanted() -> list[int] | bool:
            active = [k for k, name in enumerate(names) if name in self.opened]
            return active if parameter == "active" else bool(active)

        def follow(*events: Any) -> None:
            if getattr(panel, parameter) != wanted():
                panel.param.update({parameter: wanted()})

        def tell(event: Any) -> None:
            if event.new != wanted():
                others = [other for other in self.opened if other not in names]
                active = [0] * event.new if isinstance(event.new, bool) else event.new
                self.opened = [*others, *(names[k] for k in active)]

        self.param.watch(follow, "opened")
        panel.param.watch(tell, parameter)
        follow()

    def shows(self, name: str) -> bool:
        """Whether the tab with this name is on screen."""
        return name == self.tab or (self.wide and name == "plane")
