"""Push the disks of a contact apart: limit load, critical force, and the first motion."""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import panel as pn
import panel_material_ui as pmui
from bokeh.plotting import figure as Figure

from ....background.jobs import Job
from ....results.library import Cell, Library
from ....results.replays import Replay, worded
from ....state import perturbations
from ....state.app_state import AppState
from ....state.perturbations import Loads, Motion, Pushed
from ....state.view_settings import PUSHES
from ....widgets.contact_scatter import ContactScatter
from ....widgets.parts import PRIMARY, TabView, folded, note, plotted, question
from ..friction import claims
from . import all_contacts, one_contact
from .load_slider import LoadSlider
from .over_packings import responses

ISOSTATIC = (
    "<b>Without friction, any push moves the packing:</b> it has only as many contacts as "
    "equations (it is isostatic)."
)
OVER_STORE = (
    "<b>Do packings whose forces are less determined give way earlier?</b> All pushed packings of "
    "the study and of this page."
)
COMING = '<p role="status">In progress: {}.</p>'
SCALE = 2.0  # of the largest force, initial end of the slider


class Shown(NamedTuple):
    """The contents of the tab."""

    lead: str
    plots: Iterable[Figure] = ()
    numbers: str = ""
    details: str = ""  # small print


class View(TabView):
    """The selected contact pushed; every contact's limit load; critical force and decay."""

    name = "perturb"

    def __init__(self, state: AppState) -> None:
        super().__init__(state, "replay", "looks.contact", "looks.pushed", "knowledge.known")
        self.what = question("Push", PUSHES, self.looks, "pushing", width=320, margin=(4, 8))
        self.load = LoadSlider(self._push, self._give_way)
        self.every = pmui.Button(label="Compute for all contacts", margin=(4, 8), **PRIMARY)
        self.animate = pmui.Switch(
            label="animate the first motion", value=False, size="small", margin=(4, 10)
        )
        self.plots = pn.Column(sizing_mode="stretch_width")
        self.lead, self.doing, self.numbers, self.details = note(), note(), note(), note()
        self.task = state.work.task()
        self.loads: tuple[Loads, ContactScatter] | None = None
        self.pushed: Pushed | None = None
        self._of: tuple[int, Replay] | None = None  # contact and packing of the push
        self.reached = False  # whether the push has reached the load at which disks move
        self._shown: Replay | None = None
        self.what.param.watch(self.refresh, "value")
        self.animate.param.watch(self._animate, "value")
        self.every.on_click(lambda event: self._find_loads())
        self.task.param.watch(self._ended, "running")
        self.task.param.watch(self._tell, "words")
        self.looks.param.watch(self._animate, "tab")
        self.catch_up()

    def panel(self) -> pn.Column:
        """Choices, buttons, numbers and plot."""
        wide = {"sizing_mode": "stretch_width"}
        return pn.Column(
            self.what, self.lead, self.load, self.every, self.doing, self.numbers, self.animate,
            self.plots, self.details, **wide,
        )  # fmt: skip

    def update(self) -> None:
        """Show the selection; unknown results wait for a push, except Fig. 2."""
        what, replay = self.what.value, self.state.replay
        if replay is not self._shown:
            self._shown, self.loads = replay, None
        if self._of is not None and not self._is_of(self.contact, replay):
            self.task.cancel()
            self.pushed, self._of, self.reached = None, None, False
        self.state.pushed = self.pushed
        if self.looks.pushed not in (None, self.contact):
            self.looks.pushed = None
        one, fixed = what == "one", replay is None or replay.summary["mu"] == 0
        self.load.visible = one and not fixed
        self.every.visible = what == "all" and not fixed and self.loads is None
        self.animate.visible = one and self.reached
        if replay is None:
            self._show(Shown(self.state.nothing))
            return
        self.load.param.update(
            contact=self.contact,
            path={} if self.pushed is None else self.pushed.path,
            limit=None if self.pushed is None else self.pushed.limit,
            most=float(f"{SCALE * replay.normal[0].max(initial=0.5):.2g}"),
        )
        if fixed:
            self._show(Shown(ISOSTATIC))
        elif what == "store":
            self._over_store()
        else:
            self._show(self._one(replay) if one else self._all())
            self._animate()
            if one and self._of is None and self.looks.pushed is not None:
                self._push(linked=True)

    @property
    def contact(self) -> int | None:
        """The contact to push: the selected one, or a strong one near the centre."""
        replay, chosen = self.state.replay, self.looks.contact
        return replay.inviting if chosen is None and replay is not None else chosen

    def _show(self, shown: Shown) -> None:
        replay = self.state.replay
        self.lead.object, self.details.object = (
            text if replay is None else worded(replay, text) for text in (shown.lead, shown.details)
        )
        self.numbers.object = shown.numbers
        self.plots.objects = [plotted(fig) for fig in shown.plots]

    def _tell(self, event: Any) -> None:
        """Show what is being computed, and the time left."""
        self.doing.object = COMING.format(event.new) if event.new else ""

    # One contact

    def _is_of(self, contact: int | None, replay: Replay | None) -> bool:
        return self._of is not None and self._of[0] == contact and self._of[1] is replay

    def _push(self, linked: bool = False) -> None:
        """The slider was moved, or a link names a push: compute its end."""
        state, contact, replay = self.state, self.contact, self.state.replay
        if contact is None or replay is None or self.what.value != "one":
            return
        self._of = contact, replay
        work = perturbations.push(state.library, state.cell, replay, contact, linked=linked)
        self.task.start(work, lambda pushed: self._push_known(pushed, contact, replay))
        self.looks.pushed = contact

    def _ended(self, event: Any) -> None:
        """A push that failed or was cancelled is no longer requested."""
        self.load.running = event.new
        if not event.new and self.pushed is None:
            self.looks.pushed = self._of = None

    def _push_known(self, pushed: Pushed, contact: int, replay: Replay) -> None:
        if self._is_of(contact, replay) and replay is self.state.replay:
            self.pushed, self.reached = pushed, False
            self.refresh()

    def _give_way(self) -> None:
        self.reached = self.pushed is not None
        self.animate.visible = self.reached and self.what.value == "one"
        self._animate()

    def _one(self, replay: Replay) -> Shown:
        contact, held = self.contact, len(self.state.knowledge.known)
        if contact is None:
            return Shown("No contact carries a force.")
        pushed = self.pushed
        lead = one_contact.sentence(replay, contact, pushed, held)
        if pushed is None:
            return Shown(lead, details=folded(one_contact.COMPUTED))
        text = one_contact.decay_sentence(pushed) + folded(one_contact.COMPUTED)
        numbers = one_contact.table(replay, contact, pushed) + one_contact.difference(pushed)
        return Shown(lead, [one_contact.decay(pushed, bool(replay.outlines))], numbers, text)

    def _animate(self, *events: Any) -> None:
        """Show the first motion on the packing while this tab is visible."""
        shown = self.visible and self.what.value == "one" and self.reached
        pushed = self.pushed if shown else None
        self.state.motion = pushed and Motion(
            pushed.displacement, pushed.contacts, self.animate.value
        )

    # All contacts

    def _find_loads(self) -> None:
        replay = self.state.replay
        work = perturbations.limit_loads(self.state.library, self.state.cell)
        self.task.start(work, lambda loads: self._loads_known(replay, loads))

    def _loads_known(self, replay: Replay, loads: Loads) -> None:
        if replay is self.state.replay:
            self.loads = loads, all_contacts.drawn(replay, loads, self._choose)
            self.refresh()

    def _all(self) -> Shown:
        note_of_held = all_contacts.HELD if self.state.knowledge.known else ""
        if self.loads is None:
            return Shown(all_contacts.ASKED + note_of_held)
        loads, drawn = self.loads
        drawn.mark(self.looks.contact)
        lead = all_contacts.sentence(loads) + note_of_held
        return Shown(lead, [drawn.figure], details=folded(all_contacts.computed(loads)))

    def _choose(self, contact: int) -> None:
        self.looks.contact = contact

    # Over the store

    def _over_store(self) -> None:
        state = self.state
        self._show(Shown(OVER_STORE))
        self._animate()
        work = over_store(state.library, list(state.catalogue), state.cell)
        self.task.start(work, self._show_store)

    def _show_store(self, shown: Shown) -> None:
        if self.what.value == "store":
            self._show(shown)


def over_store(library: Library, cells: list[Cell], cell: Cell) -> Callable[[Job], Shown]:
    """Work that draws Fig. 2 of the paper: the study, and all perturbed packings of the stores."""

    def work(job: Job) -> Shown:
        job.begin("reading the stores")
        rows = perturbations.over_store(library, cells, cell)
        job.begin("drawing")
        drawn, lead, text = responses(rows)
        table = claims.claims(2, opened=True)
        return Shown(lead, drawn, details=text + table)

    return work
