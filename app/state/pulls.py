"""Forces pulled by the visitor: the pulls, and the networks that follow.

A pull is a pair (position of a contact, its f_n in ⟨f_n⟩), or a triple (name of a plane, x, y) if
the point in force space was pulled.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import param

from granforce.live.pulls import Puller
from granforce.records import InputError
from granforce.system.wording import integer, number
from granforce.types import Floats

from ..background.jobs import Job, reading
from ..background.notifications import observe
from ..results import planes
from ..results.library import Cell, Library
from ..results.replays import Replay, flat
from . import known

Pull = tuple[Any, ...]  # see above
Message = dict[str, Any]  # to or from the player

MOST_PULLS = 32  # pulls per page or link
PULLERS_KEPT = 4  # for all visitors

_pullers: OrderedDict[tuple[str, str], Puller] = OrderedDict()
_lock = threading.Lock()


class Held(NamedTuple):
    """A network reached by the visitor's pulls; forces in ⟨f_n⟩."""

    forces: Floats  # (N_c, 2)
    residual: float


def puller_of(library: Library, cell: Cell, given: list[list[Any]]) -> Puller:
    """The Puller of a cell's packing; given: rows of known forces, which pulls keep."""
    key = cell.name, str(given)
    with _lock:
        puller = _pullers.pop(key, None)
    if puller is None:
        puller = Puller(library.packing(cell.params["packing"]), cell.mu, given or None)
    with _lock:
        _pullers[key] = puller
        while len(_pullers) > PULLERS_KEPT:
            _pullers.popitem(last=False)
    return puller


class Hand(param.Parameterized):
    """The pulls of one page, as a stack; networks are computed in the background.

    Known forces are kept in all of them. `tell(message)`, once set, sends a message of
    Player.to_browser: {"held": …}, {"rail": …} for a contact and {"fan": …} for a plane.
    """

    pulls = param.List(doc="the pulls, in order, starting from the state on screen")
    held = param.Parameter(doc="the Held that pulls have led to, or None")

    def __init__(self, state: Any) -> None:
        super().__init__()  # type: ignore[no-untyped-call]  # param has no type hints
        self.state, self.work, self._task = state, state.work, state.work.task(reading)
        self.tell: Callable[[Message], object] = lambda message: None
        self._steps: list[tuple[Pull, Held]] = []  # one for each pull
        self._base: tuple[Any, ...] | None = None  # and their origin
        self._followed: tuple[Any, ...] = self._all
        self._task.param.watch(self._failed, "message")
        self.param.watch(self._follow, "pulls")
        observe(self._follow, state, "replay", "looks.frame", "knowledge.known")

    def grab(self, contact: int) -> None:
        """Select a contact and compute its rail, from the network on screen."""
        state = self.state
        if contact not in state.contacts or state.growing:
            return
        state.looks.contact = contact
        if contact in _held(state.knowledge.known):
            self.work.message = (
                f"contact {state.replay.backbone[contact]} is held: release it (H) to pull it"
            )
            self.tell({"rail": None})
        else:
            self._work(contact)

    def grab_point(self) -> None:
        """Compute the fan of the plane on screen."""
        if self.state.plane is not None and not self.state.growing:
            self._work(self.state.plane)

    def pull(self, contact: int, value: float) -> None:
        """Pull f_n of a contact to a value, where it stays."""
        if contact in self.state.contacts and np.isfinite(value):
            self._add((contact, float(value)))

    def pull_point(self, x: float, y: float) -> None:
        """Pull the point in the plane on screen, where it stays."""
        if self.state.plane is not None and np.isfinite([x, y]).all():
            self._add((planes.name(self.state.plane), float(x), float(y)))

    def _add(self, pull: Pull) -> None:
        if len(self.pulls) >= MOST_PULLS:
            self.work.message = f"{MOST_PULLS} pulls are the maximum; undo some (Z)"
            return
        self.pulls = [*self.pulls, pull]

    def undo(self) -> None:
        """Undo the last pull."""
        self.pulls = self.pulls[:-1]

    def free(self) -> None:
        """Undo all pulls."""
        self.pulls = []

    @property
    def _all(self) -> tuple[Any, ...]:
        """The dependencies: pulls, the Replay and its row on screen, known forces."""
        state = self.state
        return self.pulls, state.replay, state.looks.frame, tuple(state.knowledge.known)

    def _follow(self, *events: Any) -> None:
        """Pulls belong to one state and are removed when another one is shown."""
        pulls, replay, frame, known = self._followed
        self._followed = now = self._all
        if pulls != now[0]:
            self._work()
        elif pulls and (replay is not now[1] or frame != now[2]):
            self.pulls = []
        elif pulls and known != now[3]:
            self._work()  # networks with the new known forces

    def _work(self, grabbed: int | planes.Plane | None = None) -> None:
        """Compute the networks of all pulls, and the rail of a contact or the fan of a Plane."""
        state, pulls = self.state, list(self.pulls)
        replay, cell, frame = state.replay, state.cell, state.looks.frame
        if replay is None or cell is None:
            return
        statements = tuple(state.knowledge.known)
        base = cell.name, frame, statements
        networks = self._steps if self._base == base else []
        first = Held(_forces(replay, frame), float(replay.residual[frame]))
        library = state.library

        def work(job: Job) -> tuple[Any, ...]:
            puller = puller_of(library, cell, known.rows(replay, statements))
            pulled = partial(_pulled, library, cell, replay, puller)
            held, refusal = _networks(pulled, _held(statements), networks, pulls, first)
            ready: Iterator[Message] = iter(())
            if grabbed is not None and not refusal:
                last = held[-1][1] if held else first
                ready = _to_pull(puller, replay, last, grabbed)
            return base, held, next(ready, None), ready, refusal

        if pulls or grabbed is not None:
            self._task.start(work, self._done)
        else:
            self._task.cancel()
            self._steps, self._base, self.held = [], base, None
            self.tell({"held": None})

    def _done(self, result: tuple[Any, ...]) -> None:
        base, networks, ready, more, refusal = result
        self._steps, self._base = networks, base
        self.held = networks[-1][1] if networks else None
        if refusal:
            self.pulls = [pull for pull, _ in networks]
            self.tell({"rail": None})
            self.work.message = refusal  # set last, because observers of the pulls would clear it
            return
        if ready is not None:
            self.tell(ready)
            if "rail" in ready and not ready["rail"]["whole"]:
                self._task.start(lambda job: next(more), self.tell)
        elif networks:
            self.show()

    def show(self) -> None:
        """Show the network after all pulls, if there are any."""
        if self._steps:
            pull, held = self._steps[-1]
            network = flat(held.forces) | {"residual": held.residual}
            self.tell({"held": network | {"pull": list(pull)}})

    def _failed(self, event: Any) -> None:
        if event.new:
            self.work.message = event.new
            self.tell({"rail": None, "fan": None})


def _forces(replay: Replay, frame: int) -> Floats:
    return np.stack([replay.normal[frame], replay.tangential[frame]], axis=1).astype(np.float64)


def _held(statements: Iterable[known.Statement]) -> dict[int, float]:
    """{contact: f_n} of exactly held forces."""
    return {one.contact: one.value for one in statements if not one.error}


def _networks(
    pulled: Callable[[Held, Pull], Held],
    held: Mapping[int, float],
    networks: Sequence[tuple[Pull, Held]],
    pulls: Sequence[Pull],
    first: Held,
) -> tuple[list[tuple[Pull, Held]], str]:
    """The networks of all pulls, including existing ones, and a refusal.

    pulled(network, pull): the network after a pull; held: {contact: f_n} fixed in all of them.
    """
    reused = 0
    while reused < min(len(networks), len(pulls)) and networks[reused][0] == pulls[reused]:
        reused += 1
    networks = list(networks[:reused])
    for pull in pulls[reused:]:
        last = networks[-1][1] if networks else first
        try:
            # A pull on a contact that was held later.
            to = (pull[0], held[pull[0]]) if pull[0] in held else pull
            networks.append((pull, pulled(last, to)))
        except InputError as error:
            return networks, str(error)
    return networks, ""


def _pulled(
    library: Library, cell: Cell, replay: Replay, puller: Puller, last: Held, pull: Pull
) -> Held:
    """The network after one pull."""
    scale = replay.force_scale
    if isinstance(pull[0], str):
        plane = planes.named(library, cell, replay, pull[0])
        point = np.array(pull[1:]) + plane.origin
        pulled = puller.mixed(puller.fan(plane.axes), plane.axes, point, last.forces * scale)
    else:
        pulled = puller.at(int(replay.backbone[pull[0]]), pull[1] * scale, last.forces * scale)
    return Held(pulled[0] / scale, pulled[1])


def _to_pull(
    puller: Puller, replay: Replay, last: Held, grabbed: int | planes.Plane
) -> Iterator[Message]:
    """The data that the page needs to pull a contact or the point in a Plane, possibly in parts."""
    scale = replay.force_scale
    if isinstance(grabbed, planes.Plane):
        yield {"fan": _fan(puller.fan(grabbed.axes), grabbed, scale)}
        return
    for rail in puller.rails(int(replay.backbone[grabbed]), last.forces * scale):
        yield {"rail": {"contact": grabbed} | rail_of(rail, scale)}


def _fan(fan: Any, plane: planes.Plane, scale: float) -> Message:
    """A Fan for the player, in the coordinates of the plane on screen."""
    points = fan.points - plane.origin
    return {
        "x": points[:, 0].copy(),
        "y": points[:, 1].copy(),
        **flat(fan.states / scale),
        "residual": fan.residual.astype(np.float64),
    }


def rail_of(rail: Any, scale: float) -> Message:
    """A Rail for a script: flat arrays, forces in ⟨f_n⟩."""
    return {
        "lower": rail.low / scale,
        "upper": rail.high / scale,
        "whole": rail.whole,
        "values": (rail.values / scale).astype(np.float64),
        **flat(rail.states / scale),
        "residual": rail.residual.astype(np.float64),
        "opened": rail.opened.astype(np.uint8).ravel(),
        "sliding": rail.sliding.astype(np.uint8).ravel(),
    }


def spelled(pulls: Iterable[Pull]) -> str:
    """Pulls as text for a link, with all digits, as rounding could pass the end of an interval."""
    return "~".join(":".join([str(name), *map(str, at)]) for name, *at in pulls)


def read(text: str) -> list[Pull]:
    """Pulls from a link's text; ValueError if invalid."""
    pulls = [_read(*part.split(":")) for part in text.split("~")[: MOST_PULLS + 1]]
    if len(pulls) > MOST_PULLS:
        raise ValueError("too many pulls")
    return pulls


def _read(name: str, *at: str) -> Pull:
    values = tuple(map(number, at))
    if not all(abs(value) < 1e6 for value in values):
        raise ValueError("impossible forces")
    if len(values) == 2:
        planes.read(name)
        return name, *values
    (value,) = values
    if integer(name) < 0 or value < 0:
        raise ValueError("impossible forces")
    return integer(name), value


def renumbered(pulls: Iterable[Pull], number: Callable[[int], int]) -> list[Pull]:
    """Pulls with renumbered contacts."""
    return [
        (planes.renumbered(name, number) if isinstance(name, str) else number(name), *at)
        for name, *at in pulls
    ]
