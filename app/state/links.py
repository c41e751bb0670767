"""The parameters of the view in a link, besides the selection: formatting and parsing."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from granforce.types import Integers

from ..results.replays import Replay
from . import known, pulls

View = dict[str, Any]  # parameters stored in links
Number = Callable[[int], int]


def _pair(text: str) -> tuple[int, int]:
    a, b = (int(part) for part in text.split("-"))
    return a, b


def _two(text: str) -> tuple[int, int]:
    a, b = _pair(text)
    if a == b:
        raise ValueError("one contact twice")
    return a, b


def _joined(pair: tuple[int, int]) -> str:
    return "-".join(map(str, pair))


def _place(text: str) -> tuple[float, ...]:
    place = tuple(float(part) for part in text.split(":"))
    if not all(abs(value) < 1e6 for value in place) or not place[-1] > 0:
        raise ValueError("no visible place")
    return place


def _tab(text: str) -> str:
    return {"projection": "plane"}.get(text, text)  # former name in links


def _flag(text: str) -> bool:
    return {"0": False, "1": True}[text]


class Stored(NamedTuple):
    """How links hold a parameter.

    Contacts are given by their numbers in the packing and networks by their numbers in the walk,
    under the parameter's `key`; under its own name, as in older links, they are positions in the
    arrays of a Replay.
    """

    read: Callable[[str], Any]
    spell: Callable[[Any], Any] = lambda value: value
    key: str = ""  # in links; by default its own name
    # (value, contact, network) → the value with each contact and each network translated; only of
    # parameters that belong to the states on screen.
    numbered: Callable[[Any, Number, Number], Any] | None = None


# Parameters stored in a link if they differ from a new page.
VIEW: dict[str, Stored] = {
    "tab": Stored(_tab),
    "contact": Stored(int, key="select", numbered=lambda value, contact, _: contact(value)),
    "pair": Stored(_two, _joined, "span", lambda pair, contact, _: tuple(map(contact, pair))),
    "paused": Stored(_flag, int),
    "opened": Stored(lambda text: text.split("."), ".".join, "open"),
    "frame": Stored(int, key="network", numbered=lambda value, _, network: network(value)),
    "reference": Stored(int, key="pinned", numbered=lambda value, _, network: network(value)),
    "between": Stored(_pair, _joined, "swing", lambda pair, _, network: tuple(map(network, pair))),
    "zoom": Stored(_place, lambda place: ":".join(f"{value:g}" for value in place)),
    "split": Stored(_flag, int),
    "beside": Stored(float),
    "pulls": Stored(
        pulls.read, pulls.spelled, "pull",
        lambda given, contact, _: pulls.renumbered(given, contact),
    ),
    "known": Stored(
        known.read, known.spelled, "hold",
        lambda given, contact, _: known.renumbered(given, contact),
    ),
    "colour": Stored(str),
    "thickness": Stored(str),
    "full": Stored(float),
    "stretch": Stored(float),
    "drawn": Stored(str),
    "sort": Stored(str),
    "scale": Stored(str),
    "pushing": Stored(str),
    "axes": Stored(str),
}  # fmt: skip
OF_A_REPLAY = tuple(name for name, stored in VIEW.items() if stored.numbered)


def key(name: str) -> str:
    """The name of a parameter in links."""
    return VIEW[name].key or name


def _translated(name: str, value: Any, contact: Number, network: Number) -> Any:
    numbered = VIEW[name].numbered
    return value if value is None or numbered is None else numbered(value, contact, network)


class Numbered(NamedTuple):
    """A value of a link in which contacts and networks are given by number."""

    value: Any


class Numbers(NamedTuple):
    """The numbers of contacts and networks on screen, by position."""

    contacts: Integers  # (N_c,) in the packing
    networks: Any  # (F,) in the walk

    def of(self, view: View) -> View:
        """A view with contacts and networks given by number instead of position."""
        contact, network = (lambda k, of=of: int(of[k]) for of in self)
        return {name: _translated(name, value, contact, network) for name, value in view.items()}

    def positions(self, name: str, value: Any) -> Any:
        """A parameter's value by positions; ValueError for unknown numbers.

        A network that was not stored is replaced by the nearest stored one.
        """

        def row(number: int) -> int:
            if not 0 <= number <= self.networks[-1]:
                raise ValueError(number)
            return int(np.argmin(np.abs(self.networks - number)))

        return _translated(name, value, self.contacts.tolist().index, row)


def spelled(view: View, numbers: Numbers | None) -> dict[str, Any]:
    """Parameters as text for a link: {key: plain value}.

    numbers: of the states on screen; without them parameters that belong to the states are left
    out.
    """
    if numbers is None:
        view = {name: value for name, value in view.items() if name not in OF_A_REPLAY}
    else:
        view = numbers.of(view)
    return {key(name): VIEW[name].spell(value) for name, value in view.items()}


def read_view(given: Mapping[str, str], parameters: Any) -> View:
    """Those of `parameters` that are in a link, parsed; invalid values are left out.

    Values given by number become Numbered, for `fitting`.
    """
    view: View = {}
    for name, stored in VIEW.items():
        numbers = key(name) in given and name in OF_A_REPLAY
        try:
            value = stored.read(given[key(name) if key(name) in given else name])
            parameters[name]._validate(value)
        except (KeyError, ValueError):
            continue
        view[name] = Numbered(value) if numbers else value
    if "frame" in given and "frame" in view:
        view.setdefault("paused", True)  # the meaning of older links to a network
    return view


def fitting(view: View, replay: Replay) -> View:
    """The rows and contacts that exist in a Replay, as positions."""
    numbers = Numbers(replay.backbone, replay.number)
    places = [range(len(of)).index for of in numbers]  # ValueError for others
    values = {}
    for name in OF_A_REPLAY:
        with suppress(KeyError, ValueError):
            value = view[name]
            if isinstance(value, Numbered):
                values[name] = numbers.positions(name, value.value)
            else:
                values[name] = _translated(name, value, *places)
    return values
