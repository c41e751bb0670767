"""Captions and names of pictures and files."""

from collections.abc import Iterator
from typing import Any

from ..results.geometry import CHAIN_WIDTH
from ..results.library import Cell
from ..results.selection import Selection
from ..state.app_state import AppState
from ..state.view_settings import WIDTHS
from .legend import colour_bar, colours, quantities

GROUND = ("#ffffff", "#121212")  # by day, by night
MOTION = "Arrows: first motion at F_crit; rings: contacts that open; blue dots: those that slide."
PACKED = "network as packed"
NAMED = 4  # known forces in a caption


def caption(state: AppState, moving: bool = False) -> dict[str, Any]:
    """The caption of a picture: background, colour bar, scale and words; moving: of a movie."""
    looks = state.looks
    low, stops, high = colour_bar(state)
    contrast = "#f2f5f9" if looks.dark else "#18191d"
    return {
        "background": GROUND[looks.dark],
        "ink": contrast,
        "bar": {"low": low, "high": high, "stops": stops},
        "lines": [
            f"Width: {quantities(state, WIDTHS)[looks.thickness]}; "
            f"colour: {quantities(state, colours(state))[looks.colour]}.",
            origin(state.cell),
            *([] if moving else [f"{network(state)}."]),
            *([] if state.motion is None else [MOTION]),
            *known_words(state),
            f"granforce ?{state.link()}",
        ],
        "width": CHAIN_WIDTH * looks.stretch,  # of a force ⟨f_n⟩, in `unit` of the picture
    }


def network(state: AppState) -> str:
    """The network on screen, in words, and whether it has the held forces."""
    number, held = _number(state), state.knowledge.known
    words = f"network {number} of {state.replay.summary['states']}" if number else PACKED
    if _pushed(state):
        words += ", under a push"
    elif state.hand.held is not None:
        return f"Pulled by hand from the {words}" + (", with the held forces" if held else "")
    ignored = held and not (number and state.obeying)
    return words.capitalize() + (", which ignores the held forces" if ignored else "")


def _pushed(state: AppState) -> bool:
    """Whether the network on screen is the one as packed, under a push."""
    return state.looks.pulled == "push"


def _number(state: AppState) -> int:
    if _pushed(state):
        return 0
    frame = min(state.looks.frame, len(state.replay.number) - 1)
    return int(state.replay.number[frame])


def origin(cell: Cell) -> str:
    """The origin of states, with everything needed to compute them again."""
    return f"μ = {cell.mu:g}, {cell.series}"


def known_words(state: AppState, most: int = NAMED) -> Iterator[str]:
    """The held forces as a line of a caption, or nothing; most: how many are named."""
    number = state.replay.backbone
    statements = [one.words(number[one.contact]) for one in state.knowledge.known]
    if statements:
        more = f" and {len(statements) - most} more" if len(statements) > most else ""
        yield f"Held: {'; '.join(statements[:most])}{more}."


def shown_stem(state: AppState) -> str:
    """A file name without suffix that also names the network on screen."""
    pulled = "_pulled" if state.hand.held is not None else ""
    pulled = "_pushed" if _pushed(state) else pulled
    return f"{stem(state.cell.selection)}_network{_number(state)}{pulled}"


def stem(selection: Selection) -> str:
    """A file name without suffix."""
    if selection.imported:
        return f"granforce_{selection.name}_mu{selection.mu:g}"
    return f"granforce_n{selection.packing['n']}_mu{selection.mu:g}_s{selection.packing['seed']}"
