"""The scenes by name and title, and which of them a link asks for."""

from typing import NamedTuple
from urllib.parse import parse_qsl, urlencode

from granforce.packing import scenes
from granforce.records import InputError, friction

from ..results.selection import typed

FIRST, MANY, OWN, IMPORTED = "groove", "many", "own", "imported"
BLOCKS = ("arch", "wall")
LARGE = (MANY, *BLOCKS, IMPORTED)  # shown by Explore
SMALL = (*(name for name in scenes.SCENES if name != MANY), "ladder", "stones")
LONGEST = 4000  # characters of a built scene in a link


class Request(NamedTuple):
    """The request in a link."""

    scene: str  # one of LARGE for the page of large packings
    mu: float | None
    built: str  # a visitor's scene, as text
    query: str  # for the page of large packings


def request_of(query: str) -> Request:
    """The request in a link's query; invalid parts are left out.

    Older links, from before scenes existed, contain a μ, a tab or similar, and refer to large
    packings.
    """
    pairs = parse_qsl(query.lstrip("?"))
    given = dict(pairs)
    name = given.get("scene", MANY)
    if name not in (*SMALL, *LARGE, OWN):
        name = FIRST
    try:
        mu = friction(typed(given["mu"]))
    except (KeyError, InputError):
        mu = None
    if "scene" in given and name not in BLOCKS:
        others = [pair for pair in pairs if pair[0] != "scene"]
        if name == IMPORTED:  # which packing is in a link's `packing`
            others.append(("tab", "upload"))
        query = f"?{urlencode(others)}" if others else ""
    return Request(name, mu, given.get("built", "")[:LONGEST], query)


def titles() -> list[list[str]]:
    """[name, title, the page that shows it] of every scene, for the list on the page."""
    listed = [[name, scenes.EVERY[name].title, "Learn"] for name in SMALL]
    listed += [[name, scenes.EVERY[name].title, "Explore"] for name in (MANY, *BLOCKS)]
    own = [OWN, "Build your own", "Learn"], [IMPORTED, "Your packing", "Explore"]
    return [*listed, *own]
