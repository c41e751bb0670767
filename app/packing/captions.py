"""Captions and names of pictures and files."""

from collections.abc import Iterator
from typing import Any

from ..results.library import Cell
from ..results.selection import Selection
from ..state.app_state import AppState
from ..state.view_settings import WIDTHS
from .view import colour_bar, colours, quantities

GROUND = ("#ffffff", "#121212")  # by day, by night
NAMED = 4  # known forces in a caption


def caption(state: AppState) -> dict[str, Any]:
    """The caption of a picture: background, colour bar, scale and words."""
    looks = state.looks
    low, stops, high = colour_bar(state)
    contrast = "#f2f5f9" if looks.dark else "#18191d"
    return {
        "background": GROUND[looks.dark],
        "ink": contrast,
        "bar": {"low": low, "high": high, "stops": stops},
        "lines": [
            f"Width: {quantities(state, WIDTHS)[looks.thickness]}; "
            f"colour: {colours(state, "pull" if state.hand.pulls else "")[looks.colour]}.",
            origin(state.cell),
            *known_words(state),
            f"granforce ?{state.link()}",
        ],
    }


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


def stem(selection: Selection) -> str:
    """A file name without suffix."""
    if selection.imported:
        return f"granforce_{selection.name}_mu{selection.mu:g}"
    return f"granforce_n{selection.packing['n']}_mu{selection.mu:g}_s{selection.packing['seed']}"
