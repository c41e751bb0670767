"""The results of the states on screen: how undetermined forces are, seen and exact, and why."""

from collections.abc import Iterator
from typing import Any

import param
import xarray as xr

from ..browser.bundle import Scripted
from ..browser.messages import Message
from ..packing.view import exact_intervals
from ..results.progress_feed import Summary
from ..results.replays import Replay
from ..state.app_state import AppState
from ..widgets.hints import term
from .volume import Volume

PART = 0.15  # of η3, to be compared with η1 and η2
# Beyond these, numbers from a sample are flagged: chains do not agree, or too few states count.
MOST_R_HAT, LEAST_SIZE = 1.1, 100
MEASURE = '<button type="button" class="soft">measure</button>'


class Results(Scripted):
    """Two tables of numbers with symbol and word; see results_line.js."""

    html = param.String()

    def __init__(self, state: AppState, volume: Volume, **params: Any) -> None:
        super().__init__(**params)
        self._state, self._volume = state, volume
        state.param.watch(self._tell, ["replay", "exact"])
        volume.param.watch(self._tell, ["found", "offered"])
        self._tell()

    def _tell(self, *events: Any) -> None:
        state, volume = self._state, self._volume
        if state.replay is not None:
            self.html = tables(state.replay, state.exact, volume.found, volume.offered)

    def _heard(self, message: Message) -> None:
        self._volume.measure()


def tables(
    replay: Replay, exact: xr.Dataset | None, volume: xr.Dataset | None, measurable: bool
) -> str:
    """All numbers as HTML; measurable: the volume of S can be asked for."""
    flags = "".join(f'<p class="flag" role="note">{line}</p>' for line in doubts(replay.summary))
    left = f'<p class="left">{left_out(replay.summary)}</p>'
    return undetermined(replay, exact) + packed(replay, volume, measurable) + left + flags


def undetermined(replay: Replay, exact: xr.Dataset | None) -> str:
    """η1, η2, 0.15 η3 and mean ΔF_n: over the states, and over all of S where known."""
    summary = replay.summary
    known = exact_intervals(exact, replay)
    seen_extent = (replay.high[:, 0] - replay.low[:, 0]).mean() if len(replay.low) else 0.0
    rows = [
        ["seen in {} networks".format(summary["states"]), f"{summary['eta1']:.3f}",
         f"{summary['eta2']:.3f}", f"{PART * summary['eta3']:.3f}", _mean(seen_extent)],
    ]  # fmt: skip
    if exact is not None and known:
        whole = (known["high"] - known["low"]).mean()
        rows.append(["exact", "", "", f"{PART * float(exact['eta3']):.3f}", _mean(whole)])
    head = [
        "How undetermined",
        term("eta1", "η₁ spread"),
        term("eta2", "η₂ distance"),
        term("eta3", "0.15 η₃ intervals"),
        term("extent", "ΔFₙ mean"),
    ]
    return _table(head, rows)


def packed(replay: Replay, volume: xr.Dataset | None, measurable: bool) -> str:
    """z, φ, h with its count, and ln V of the packing."""
    summary = replay.summary
    forces, free = 2 * summary["contacts"], summary["dimension"]
    count = f"{free} = {forces} − {forces - free}" if free else "0"
    measured = MEASURE if measurable else "–"
    if volume is not None:
        error = float(volume["log_volume_error"])
        measured = f"{float(volume['log_volume']):.1f} ± {error:.1g}".replace("-", "−")
    head = [
        term("z", "z contacts per disk"),
        term("phi", "φ packing fraction"),
        term("h", "h free dimensions"),
        term("volume", "ln V volume of S"),
    ]
    row = [f"{summary['coordination']:.3f}", f"{summary['packing_fraction']:.4f}", count, measured]
    return _table(head, [row])


def doubts(summary: Summary) -> Iterator[str]:
    """Sentences on what is not good enough to be relied on."""
    r_hat, size = summary.get("worst_r_hat"), summary.get("least_bulk_size")
    if r_hat is not None and r_hat > MOST_R_HAT:
        yield (
            f"The chains have not mixed: R̂ = {r_hat:.2f} for the worst component, more than "
            f"{MOST_R_HAT:g}. Ask for more networks before relying on these numbers."
        )
    if size is not None and size < LEAST_SIZE:
        yield (
            f"The worst component is worth {size:.0f} independent networks only, fewer than "
            f"{LEAST_SIZE}: its errors are large. Ask for more networks."
        )


def _mean(value: float) -> str:
    return f"{value:.3f} ⟨fₙ⟩"


def _table(head: list[str], rows: list[list[str]]) -> str:
    titles = "".join(f'<th scope="col">{title}</th>' for title in head)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{titles}</tr></thead><tbody>{body}</tbody></table>"


# Number of the summary → key of the glossary, and words.
LEFT_OUT = {
    "rattlers": ("rattler", "loose disks"),
    "unloaded_contacts": ("unloaded", "contacts without force"),
    "tangential_unknowns": ("no_friction", "forces along contacts"),
    "skipped": ("determined", "networks that could only be the same"),
    "held": ("held_components", "forces that cannot vary"),
    "dropped": ("dropped", "networks on the way to the sample"),
}


def left_out(summary: Summary) -> str:
    """One line on work that was skipped and attempts that failed, as HTML."""
    counts = [
        f"{summary[key]} {term(key_of_term, words)}"
        for key, (key_of_term, words) in LEFT_OUT.items()
        if summary.get(key)
    ]
    line = f"Not counted: {', '.join(counts) or 'nothing'}."
    if summary.get("rejected") or summary.get("unconverged"):
        line += (
            f" {term('failed', 'Failed attempts')}: {summary['rejected']} not in balance, "
            f"{summary['unconverged']} not finished."
        )
    if summary["kept"] < summary["states"]:
        line += f" Shown: {summary['kept']} evenly spaced of {summary['states']} networks."
    return line
