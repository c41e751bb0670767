"""What a link holds of the view, beside the states that it selects: how it is spelled and read."""

from collections.abc import Callable, Mapping
from typing import Any

from ..results.replays import Replay
from . import known, pulls

View = dict[str, Any]  # parameters that a link may name


def _pair(text: str) -> tuple[int, int]:
    a, b = (int(part) for part in text.split("-"))
    return a, b


def _place(text: str) -> tuple[float, ...]:
    place = tuple(float(part) for part in text.split(":"))
    if not all(abs(value) < 1e6 for value in place) or not place[-1] > 0:
        raise ValueError("no place that can be seen")
    return place


def _tab(text: str) -> str:
    return {"projection": "plane"}.get(text, text)  # as older links call it


def _flag(text: str) -> bool:
    return {"0": False, "1": True}[text]


# Parameters that a link holds where they are not as in a new page, and how they are read.
VIEW: dict[str, Callable[[str], Any]] = {
    "tab": _tab,
    "contact": int,
    "pair": _pair,
    "frame": int,
    "reference": int,
    "between": _pair,
    "zoom": _place,
    "split": _flag,
    "beside": float,
    "predict": int,
    "pulls": pulls.read,
    "known": known.read,
    "colour": str,
    "thickness": str,
    "full": float,
    "stretch": float,
    "overlay": _flag,
    "drawn": str,
    "sort": str,
    "scale": str,
    "figure": str,
    "axis": str,
    "pushing": str,
    "axes": str,
    "dark": _flag,
}
SPELLED: dict[str, Callable[[Any], Any]] = {"pulls": pulls.spelled, "known": known.spelled}
SPELLED["zoom"] = lambda place: ":".join(f"{value:g}" for value in place)
# What belongs to the states on screen, as it is where others come.
UNSEEN: View = {"contact": None, "pair": None, "frame": 0, "reference": 0, "between": None}
UNSEEN |= {"pulls": [], "known": []}
OF_A_REPLAY = tuple(UNSEEN)


def spelled(name: str, value: Any) -> Any:
    """A parameter's value as a link holds it."""
    if name in SPELLED:
        return SPELLED[name](value)
    if isinstance(value, tuple):
        return "-".join(str(part) for part in value)
    return int(value) if isinstance(value, bool) else value


def read_view(given: Mapping[str, str], parameters: Any) -> View:
    """Those of `parameters` that a link names by its texts; what makes no sense is left out."""
    view = {}
    for name, cast in VIEW.items():
        try:
            value = cast(given[name])
            parameters[name]._validate(value)
        except (KeyError, ValueError):
            continue
        view[name] = value
    return view


def fitting(view: View, replay: Replay) -> View:
    """Of these rows and contacts those that a Replay has."""
    frames, contacts = replay.normal.shape
    sizes = dict.fromkeys(OF_A_REPLAY, frames)
    sizes |= dict.fromkeys(("contact", "pair", "pulls", "known"), contacts)

    def fits(name: str) -> bool:
        if view[name] is None:
            return True
        values = view[name] if name in ("between", "pair") else (view[name],)
        if name == "pulls":
            values = list(pulls.contacts(view[name]))
        if name == "known":
            values = [one.contact for one in view[name]]
        if name == "pair" and len(set(values)) < 2:
            return False
        return all(0 <= value < sizes[name] for value in values)

    return {name: view[name] for name in OF_A_REPLAY if name in view and fits(name)}
