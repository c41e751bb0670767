"""The parameters of the view in a link, besides the selection: formatting and parsing."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from granforce.types import Integers

from ..results.replays import Replay
from . import known, pulls

View = dict[str, Any]  # parameters stored in links


def _pair(text: str) -> tuple[int, int]:
    a, b = (int(part) for part in text.split("-"))
    return a, b


def _place(text: str) -> tuple[float, ...]:
    place = tuple(float(part) for part in text.split(":"))
    if not all(abs(value) < 1e6 for value in place) or not place[-1] > 0:
        raise ValueError("no visible place")
    return place


def _tab(text: str) -> str:
    return {"projection": "plane"}.get(text, text)  # former name in links


def _flag(text: str) -> bool:
    return {"0": False, "1": True}[text]


# Parameters stored in a link if they differ from a new page, and their parsers.
VIEW: dict[str, Callable[[str], Any]] = {
    "tab": _tab,
    "contact": int,
    "pair": _pair,
    "paused": _flag,
    "opened": lambda text: text.split("."),
    "frame": int,
    "reference": int,
    "between": _pair,
    "zoom": _place,
    "split": _flag,
    "beside": float,
    "pulls": pulls.read,
    "known": known.read,
    "colour": str,
    "thickness": str,
    "full": float,
    "stretch": float,
    "drawn": str,
    "sort": str,
    "scale": str,
    "pushing": str,
    "axes": str,
    "dark": _flag,
}
SPELLED: dict[str, Callable[[Any], Any]] = {"pulls": pulls.spelled, "known": known.spelled}
SPELLED["opened"] = ".".join
SPELLED["zoom"] = lambda place: ":".join(f"{value:g}" for value in place)
# Parameters that belong to the states on screen, with their values for new states.
UNSEEN: View = {"contact": None, "pair": None, "frame": 0, "reference": 0, "between": None}
UNSEEN |= {"pulls": [], "known": []}
OF_A_REPLAY = tuple(UNSEEN)

Number = Callable[[int], int]


class Numbered(NamedTuple):
    """A value of a link in which contacts and networks are given by number."""

    value: Any


# Names of parameters in links. Those of UNSEEN give contacts by their numbers in the packing and
# networks by their numbers in the walk; under the parameters' own names, as in older links, they
# are positions in the arrays of a Replay.
KEYS = {
    "contact": "select",
    "pair": "span",
    "pulls": "pull",
    "known": "hold",
    "frame": "network",
    "reference": "pinned",
    "between": "swing",
    "opened": "open",
}
# (value, contact, network) → the value with each contact and each network translated.
TRANSLATED: dict[str, Callable[[Any, Number, Number], Any]] = {
    "contact": lambda value, contact, network: contact(value),
    "pair": lambda value, contact, network: tuple(map(contact, value)),
    "pulls": lambda value, contact, network: pulls.renumbered(value, contact),
    "known": lambda value, contact, network: known.renumbered(value, contact),
    "frame": lambda value, contact, network: network(value),
    "reference": lambda value, contact, network: network(value),
    "between": lambda value, contact, network: tuple(map(network, value)),
}


def key(name: str) -> str:
    """The name of a parameter in links."""
    return KEYS.get(name, name)


class Numbers(NamedTuple):
    """The numbers of contacts and networks on screen, by position."""

    contacts: Integers  # (N_c,) in the packing
    networks: Any  # (F,) in the walk

    def of(self, view: View) -> View:
        """A view with contacts and networks given by number instead of position."""
        contacts, networks = self
        return {
            name: value
            if value is None or name not in TRANSLATED
            else TRANSLATED[name](value, lambda c: int(contacts[c]), lambda f: int(networks[f]))
            for name, value in view.items()
        }

    def positions(self, name: str, value: Any) -> Any:
        """A parameter's value by positions; KeyError for unknown numbers.

        A network that was not stored is replaced by the nearest stored one.
        """
        contacts = {int(number): k for k, number in enumerate(self.contacts)}

        def row(number: int) -> int:
            if not 0 <= number <= self.networks[-1]:
                raise KeyError(number)
            return int(np.argmin(np.abs(self.networks - number)))

        return TRANSLATED[name](value, contacts.__getitem__, row)


def spelled(view: View, numbers: Numbers | None) -> dict[str, Any]:
    """Parameters as text for a link: {key: plain value}.

    numbers: of the states on screen; without them parameters that belong to the states are left
    out.
    """
    if numbers is None:
        view = {name: value for name, value in view.items() if name not in OF_A_REPLAY}
    else:
        view = numbers.of(view)
    return {key(name): _plain(name, value) for name, value in view.items()}


def _plain(name: str, value: Any) -> Any:
    if name in SPELLED:
        return SPELLED[name](value)
    if isinstance(value, tuple):
        return "-".join(str(part) for part in value)
    return int(value) if isinstance(value, bool) else value


def read_view(given: Mapping[str, str], parameters: Any) -> View:
    """Those of `parameters` that are in a link, parsed; invalid values are left out.

    Values given by number become Numbered, for `fitting`.
    """
    view: View = {}
    for name, cast in VIEW.items():
        numbers = key(name) in given and name in TRANSLATED
        try:
            value = cast(given[key(name) if key(name) in given else name])
            parameters[name]._validate(value)
        except (KeyError, ValueError):
            continue
        view[name] = Numbered(value) if numbers else value
    if "frame" in given and "frame" in view:
        view.setdefault("paused", True)  # the meaning of older links to a network
    return view


def fitting(view: View, replay: Replay) -> View:
    """The rows and contacts that exist in a Replay, as positions."""
    numbers, found = Numbers(replay.backbone, replay.number), {}
    for name in OF_A_REPLAY:
        with suppress(KeyError):
            value = view[name]
            if isinstance(value, Numbered):
                value = numbers.positions(name, value.value)
            if _fits(name, value, replay):
                found[name] = value
    return found


def _fits(name: str, value: Any, replay: Replay) -> bool:
    if value is None:
        return True
    frames, contacts = replay.normal.shape
    size = contacts if name in ("contact", "pair", "pulls", "known") else frames
    values = value if name in ("between", "pair") else (value,)
    if name == "pulls":
        values = list(pulls.contacts(value))
    if name == "known":
        values = [one.contact for one in value]
    if name == "pair" and len(set(values)) < 2:
        return False
    return all(0 <= one < size for one in values)
