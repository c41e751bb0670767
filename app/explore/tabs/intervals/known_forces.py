"""Known forces above the intervals: chips, their effect, and the next measurement."""

from typing import Any

import numpy as np
import param

from granforce.types import Integers

from ....background.notifications import observe
from ....browser.bundle import Scripted
from ....browser.messages import forward, from_browser
from ....results.selection import KINDS
from ....state.app_state import AppState
from ....state.known import Knowledge, Ranked
from ....widgets.hints import term

STRONGEST = 5  # number of contacts listed whose interval has shrunk most
LINK = '<button type="button" class="found" data-contact="{}">{}</button>'
SAMPLE = '<button type="button" class="found" data-sample>Sample networks</button>'
ASK = "Hold a force (H): other intervals shrink."


class Known(Scripted):
    """Chips of known forces; see known_forces.js. Contacts are positions in the backbone."""

    chips = param.List(doc="pairs (contact, words)")
    words = param.String(doc="effect on the other intervals, HTML")
    ranked = param.List(doc="pairs (contact, words), the best to measure first")
    meaning = param.String(doc="of the numbers in `ranked`")
    asking = param.Boolean(doc="whether the best contacts to measure are being computed")
    samplers = param.List(default=[*map(list, KINDS.items())], doc="pairs (name, words)")
    sampler = param.String(doc="of the networks, one of `samplers`")

    def __init__(self, state: AppState, **params: Any) -> None:
        super().__init__(sizing_mode="stretch_width", margin=0, visible=False, **params)
        self._state = state
        observe(self._show, state, "shown", "replay", "selection")
        observe(
            self._show, state.knowledge, "known", "narrowed", "ranked", "task.running",
            "ranking.words",
        )  # fmt: skip
        self._show()

    _release = forward("_state.knowledge.release", release=int)
    _rank = forward("_state.knowledge.rank", next=True)
    _dismiss = forward("_state.knowledge.dismiss", dismiss=True)
    _sample = forward("_state.sample_held", sample=True)

    @from_browser(choose=int)
    def _choose(self, choose: int) -> None:
        if choose in self._state.contacts:
            self._state.looks.contact = choose

    @from_browser(sampler=str)
    def _sample_by(self, sampler: str) -> None:
        state = self._state
        if sampler in KINDS and state.selection is not None:
            requested = state.selection._replace(kind=sampler)
            state.ask(state.given_held(requested), at_once=True)

    def _show(self, *events: Any) -> None:
        state = self._state
        if state.replay is None:
            return
        number, knowledge = state.replay.backbone, state.knowledge
        best = knowledge.ranked
        self.param.update(
            visible=state.shown.summary["dimension"] > 0 or bool(knowledge.known),
            chips=[[one.contact, one.words(number[one.contact])] for one in knowledge.known],
            words=words(knowledge, number) + sampled(state),
            ranked=[] if best is None else _ranks(best, number),
            meaning=meaning(best, knowledge.ranking.words),
            asking=knowledge.ranking.running,
            sampler=state.selection.kind,
        )


def words(knowledge: Knowledge, number: Integers) -> str:
    """The remaining freedom given the known forces, as HTML."""
    narrowed, known = knowledge.narrowed, tuple(knowledge.known)
    if not known:
        return ASK
    if narrowed is None or narrowed.known != known:
        working = knowledge.task.running
        return "Computing the other intervals …" if working else "Not computed: cancelled."
    if narrowed.left:
        return f"Exact bounds, largest change first: {1 - narrowed.left:.0%}."
    (h, less), (mean, left) = narrowed.dimension, narrowed.mean
    text = (
        f"<b>{less} of {h}</b> {term('h', 'free dimensions')} are left"
        f"{'' if less < h else ' (an error bar fixes no number)'}; a contact's "
        f"{term('exact', 'possible')} fₙ spans <b>{mean:.3f} → {left:.3f} × the mean force</b> on "
        f"average ({_change(mean, left)}); {narrowed.carrying} of {len(narrowed.shortened)} "
        f"contacts {term('carrying', 'certain to carry force')}."
    )
    short = narrowed.shortened
    order = [c for c in np.argsort(-short)[:STRONGEST] if short[c] > 0.005]
    if order:
        most = ", ".join(f"{LINK.format(c, number[c])} (by {short[c]:.2f})" for c in order)
        text += f" Shortened most: contacts {most}."
    return text


def sampled(state: AppState) -> str:
    """Whether the networks to be played have the held forces, in words."""
    held = len(state.knowledge.known)
    if not held:
        return ""
    them = "it" if held == 1 else "them"
    if state.obeying:
        return f" The networks played have {them}, too."
    return f" {SAMPLE} that have {them}."


def _ranks(best: Ranked, number: Integers) -> list[list[Any]]:
    rows = zip(best.contacts.tolist(), best.after, best.expected, strict=True)
    return [
        [c, f"contact {number[c]}: {_worth(best.before, after, expected)}"]
        for c, after, expected in rows
    ]


def meaning(best: Ranked | None, running: str) -> str:
    """The meaning of the numbers in a list of contacts to measure, and which of them are exact.

    running: what is being computed, in words; empty if nothing is.
    """
    lines = [f"In progress: {running}."] if running else []
    if best is None:
        return " ".join(lines)
    exact, listed = int(np.isfinite(best.after).sum()), len(best.after)
    if exact:
        which = "" if exact == listed else f" for the best {exact}"
        lines.append(
            f"Exact{which}: mean interval of all fₙ, now → with this force held at its mean over "
            "uniform networks."
        )
    if exact < listed:
        rest = "The others are estimated" if exact else "Estimated"
        why = (
            "exact bounds of the best follow"
            if running
            else "exact bounds of every contact would take too long"
        )
        lines.append(
            f"{rest} from uniform networks: decrease of the mean standard deviation of all fₙ, "
            f"with this force known; {why}."
        )
    return " ".join(lines)


def _worth(before: float, after: float, expected: float) -> str:
    """The value of knowing a contact."""
    if np.isnan(after) or np.isnan(before):
        return f"spread about {100 * expected:.1f} % smaller"
    return f"mean interval {before:.3f} → {after:.3f} ({_change(before, after)})"


def _change(before: float, after: float) -> str:
    return f"{100 * (after / before - 1):+.0f} %".replace("-", "−") if before > 0 else "–"
