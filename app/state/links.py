"""Links: the selection and the view as the query of an address, formatted and parsed."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from typing import Any, NamedTuple
from urllib.parse import parse_qsl, urlencode

import numpy as np

from granforce.packing.scenes import BLOCKS
from granforce.records import InputError, brief, choice, friction
from granforce.study.keys import Parameters
from granforce.system.wording import integer, number
from granforce.types import Integers

from ..results.replays import Replay
from ..results.selection import KINDS, OPTIONS, SOLVERS, Bound, Selection, select, typed, unusual
from . import known, pulls

View = dict[str, Any]  # parameters stored in links
Number = Callable[[int], int]
# Characters of a message about a link, which may contain anything, and of a whole number in a link
# that Python converts.
LONGEST_REASON, MOST_DIGITS = 200, 4000

# The selection


def link(selection: Selection, view: dict[str, Any]) -> str:
    """The query of an address that reopens this selection with the view {name: plain value}."""
    packing = selection.packing
    if selection.imported:
        given = {"packing": packing.get("imported"), "scene": packing.get("scene")}
        given = {name: value for name, value in given.items() if value}
    else:
        given = {"n": packing["n"], "seed": packing["seed"], **unusual(packing)}
    given["mu"] = f"{selection.mu:.9g}"
    if not selection.same_mu:
        given["packed"] = f"{packing['mu']:.9g}"
    given |= {"source": selection.kind, "states": selection.states}
    if selection.kind == "walk":
        given["relax"] = selection.relax
    if selection.seed:
        given["walkseed"] = selection.seed
    if selection.held:
        given["given"] = "~".join(":".join(map(repr, bound)) for bound in selection.held)
    return urlencode(given | view)


def read_link(query: str) -> tuple[Selection | None, dict[str, str]]:
    """(Selection or None, {name: text} of everything else) from a link's query.

    InputError for an invalid selection; a link without "mu" selects nothing, unless it has a scene.
    """
    pairs = parse_qsl(query.lstrip("?"))
    given = dict(pairs)
    try:
        for name, count in Counter(name for name, _ in pairs).items():
            if count > 1:
                raise InputError(f"it contains {brief(name)} {count} times")
        if given.get("scene") in BLOCKS:
            given.setdefault("mu", str(BLOCKS[given["scene"]].mu))
        return (_read_selection(given) if "mu" in given else None), given
    except (ValueError, TypeError) as error:
        raise InputError(f"this link cannot be read: {str(error)[:LONGEST_REASON]}") from None


def _read_selection(given: dict[str, str]) -> Selection:
    kind = choice(given.pop("source", "walk"), KINDS, "source")
    relax = choice(given.pop("relax", "nearest"), SOLVERS, "relax")
    mu = friction(typed(given.pop("mu")))
    packed = friction(typed(given.pop("packed"))) if "packed" in given else mu
    rest: Parameters = {
        "states": _whole(given, "states", 200),
        "seed": _whole(given, "walkseed", 0),
        "held": tuple(map(_bound, filter(None, given.pop("given", "").split("~")))),
    }
    if "packing" in given:
        packing = {"imported": given.pop("packing"), "mu": packed}
        return Selection(packing, mu, kind, relax, **rest)
    if "scene" in given:
        scene = choice(given.pop("scene"), BLOCKS, "scene")
        return Selection({"scene": scene, "mu": packed}, mu, kind, relax, **rest)
    selection = select(
        _whole(given, "n", 400),
        mu,
        _whole(given, "seed", 1),
        packed,
        given.pop("box", "square"),
        kind=kind,
        relax=relax,
        **rest,
    )
    options: Parameters = {
        name: (_whole if name == "sweeps" else _number)(given, name)
        for name in OPTIONS
        if name in given and name != "radii"
    }
    if "radii" in given:
        options["radii"] = given.pop("radii")
        if ":" not in options["radii"]:
            raise InputError("radii in a link must be a named distribution")
    return selection._replace(packing=selection.packing | options)


def _whole(given: dict[str, str], name: str, usual: int = 0) -> int:
    """The whole number of a name, which is taken out; InputError if it is no such number."""
    text = given.pop(name, str(usual))
    if not text.lstrip("+-").isdecimal():
        raise InputError(f"{name} must be a whole number, got {brief(text)}")
    if len(text) > MOST_DIGITS:
        raise InputError(f"{name} must be a number of few digits, got {brief(text)}")
    return int(text)


def _bound(text: str) -> Bound:
    """The bounds on a held force."""
    contact, low, high = text.split(":")
    least, most = number(low), number(high)
    if not -np.inf < least <= most < np.inf:  # also refuses NaN
        raise InputError(f"a held force must lie between two finite numbers, got {brief(text)}")
    return integer(contact), least, most


def _number(given: dict[str, str], name: str) -> float:
    """The number of a name, which is taken out; InputError if it is none."""
    text = given.pop(name)
    try:
        return number(text)
    except ValueError:
        raise InputError(f"{name} must be a number, got {brief(text)}") from None


# The view


def _two(text: str) -> tuple[int, int]:
    a, b = (integer(part) for part in text.split("-"))
    if a == b:
        raise ValueError("one contact twice")
    return a, b


def _joined(pair: tuple[int, int]) -> str:
    return "-".join(map(str, pair))


def _place(text: str) -> tuple[float, ...]:
    place = tuple(number(part) for part in text.split(":"))
    if not all(abs(value) < 1e6 for value in place) or not place[-1] > 0:
        raise ValueError("no visible place")
    return place


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
    "tab": Stored(str),
    "contact": Stored(integer, key="select", numbered=lambda value, contact, _: contact(value)),
    "pair": Stored(_two, _joined, "span", lambda pair, contact, _: tuple(map(contact, pair))),
    "pushed": Stored(integer, key="push", numbered=lambda value, contact, _: contact(value)),
    "paused": Stored(_flag, int),
    "opened": Stored(lambda text: text.split("."), ".".join, "open"),
    "frame": Stored(integer, key="network", numbered=lambda value, _, network: network(value)),
    "zoom": Stored(_place, lambda place: ":".join(f"{value:g}" for value in place)),
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
    "full": Stored(number),
    "stretch": Stored(number),
    "drawn": Stored(str),
    "sort": Stored(str),
    "scale": Stored(str),
    "pushing": Stored(str),
    "sampler": Stored(str),
    "axes": Stored(str),
}  # fmt: skip
OF_THE_PAGE = ("scene", "dark", "embed", "asked")  # read by the pages themselves
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


def read_view(given: Mapping[str, str], parameters: Any) -> tuple[View, list[str]]:
    """Those of `parameters` that are in a link, parsed, and the keys of unknown and invalid ones.

    Values given by number become Numbered, for `fitting`.
    """
    view: View = {}
    usual = {*VIEW, *map(key, VIEW), *OF_THE_PAGE}
    invalid = [name for name in given if name not in usual]
    for name, stored in VIEW.items():
        spelling = key(name) if key(name) in given else name
        if name not in parameters or spelling not in given:
            continue
        try:
            value = stored.read(given[spelling])
            parameters[name]._validate(value)
        except (KeyError, ValueError):
            invalid.append(spelling)
            continue
        numbers = key(name) in given and name in OF_A_REPLAY
        view[name] = Numbered(value) if numbers else value
    if "frame" in given and "frame" in view:
        view.setdefault("paused", True)  # the meaning of older links to a network
    if "pushed" in view:  # what it takes to see it
        view = {"tab": "perturb", "pushing": "one"} | view | {"contact": view["pushed"]}
    return view, invalid


def left_out(keys: Iterable[str]) -> str:
    """A message about the parts of a link that do not fit; empty without any."""
    names = ", ".join(keys)
    return f"left out of this link, as there is no such value here: {names}" if names else ""


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
