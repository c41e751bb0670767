"""Six steps over the real page, for those who see it for the first time."""

import re
from typing import Any
from urllib.parse import parse_qsl

import numpy as np
import param

from ..browser.bundle import Scripted
from ..browser.messages import Message
from ..learn.small_scene import FIRST_STEPS
from ..state.app_state import AppState

# Title and two sentences of each step, and the part of the page that it is about, see tour.js.
STEPS = (
    (
        "One pressure, many disks",
        "These {n} rigid disks are pressed together from all sides by one pressure, and none can "
        "move. Lines are the forces at their contacts: thick ones are large, and together they "
        "hold every disk in balance.",
        "scene",
    ),
    (
        "Other forces balance too",
        "The same disks, in the same places, held by other forces: the picture changes into "
        "another network and back, and every network on the way balances every disk, too. Balance "
        "and friction alone don't say which of them the packing carries. Drag the slider beside "
        "Play to step through them yourself.",
        "scene",
    ),
    (
        "Grab a force",
        "Drag the marked contact: its force moves between its smallest and largest possible "
        "values, and the others follow, so that every disk stays in balance. Let go and it stays "
        "(press Z to undo); the pale bars show how far each contact can go.",
        "scene",
    ),
    (
        "All networks form one body",
        "Every point here is one whole network of forces, seen as the shadow that force space S "
        "casts on a plane: dots are networks found at random, and the shaded outline holds every "
        "network there is. S is convex: go straight from any network to any other, and you stay "
        "inside.",
        "plane",
    ),
    (
        "How friction matters",
        "More friction widens what each contact may carry, but leaves fewer contacts per disk "
        "(z), so that the indeterminacy η rises and then falls. Drag the friction μ, marked here, "
        "and watch the packing and its forces change.",
        "friction",
    ),
    (
        "Push until it gives way",
        "Two forces push the disks of the marked contact apart: drag the slider, see who helps to "
        "hold them, and find out how much load the packing can take before it begins to move. "
        "That's the tour. Try anything.",
        "perturb",
    ),
)
TABS = {3: "intervals", 4: "plane", 5: "statistics", 6: "perturb"}


class Tour(Scripted):
    """A card with the steps, which closes into the page as it is; see tour.js."""

    step = param.Integer(default=0, doc="1 … 6 while the tour is on, else 0")
    steps = param.List(doc="title, text and target of each step")
    before = param.Integer(default=len(FIRST_STEPS), doc="steps of the tour on the page before")
    scene = param.String(default=FIRST_STEPS[-1][2]["scene"], doc="of the last of these")
    first = param.Boolean(doc="whether the page was opened without a view to show")

    def __init__(self, state: AppState, query: str = "", **params: Any) -> None:
        """query: of the address; `tour=2` opens the second step."""
        wanted = dict(parse_qsl(query.lstrip("?"))).get("tour", "")
        super().__init__(first=not query.lstrip("?"), **params)
        self._state, self._set_up = state, False  # whether the page shows what the step is about
        self._tell()
        state.param.watch(self._tell, "replay")
        if re.fullmatch("[1-6]", wanted):
            self._go(int(wanted))

    def _tell(self, *events: Any) -> None:
        replay = self._state.replay
        disks = "" if replay is None else replay.summary["n"]
        self.steps = [[title, text.format(n=disks), target] for title, text, target in STEPS]
        if self.step and not self._set_up:
            self._go(self.step)  # now that there is something to show

    def _heard(self, message: Message) -> None:
        """The visitor goes to a step, or closes the tour (0)."""
        if 0 <= message["step"] <= len(STEPS):
            self._go(message["step"])

    def _go(self, step: int) -> None:
        self.step = step
        self._set_up = self._state.replay is not None
        if step and self._set_up:
            self._state.looks.param.update(**_shown(self._state, step))


def _shown(state: AppState, step: int) -> dict[str, Any]:
    """Looks with which the page shows what a step is about."""
    normal, extent = state.replay.normal, (state.replay.high - state.replay.low)[:, 0]
    changes: dict[str, Any] = {"between": None}
    if step == 2 and len(normal) > 1:
        changes["between"] = (0, _farthest(normal))
    if step == 3:
        changes["contact"] = int(np.argmax(extent))
    if step == 5:
        changes["guess"] = False  # it tells what would be guessed
    if step == 6:
        changes["contact"] = int(np.argmax(normal[0]))
    if step in TABS and not state.looks.shows(TABS[step]):
        changes["tab"] = TABS[step]
    return changes


def _farthest(normal: Any) -> int:
    """The state that differs most from the original network."""
    return int(np.argmax(np.abs(normal - normal[0]).sum(axis=1)))
