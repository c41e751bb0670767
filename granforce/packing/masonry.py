"""Scenes of rigid blocks: a ladder, a block on a slope, books, an arch, a dry-stone wall.

Each function returns a Packing with zero forces. Fixed bodies come last.
"""

import itertools
from typing import Any

import numpy as np

from granforce.packing import assemblies
from granforce.records import InputError, Packing, positive, whole
from granforce.types import Floats

# The ladder and the slope: thickness of the ladder, and of fixed bodies.
_THIN, _THICK = 0.02, 0.2
_MOST_BLOCKS = 10_000


def rectangle(x0: float, y0: float, x1: float, y1: float) -> Floats:
    """Corners (4, 2) of an upright rectangle."""
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def _between(value: float, name: str, least: float, most: float) -> float:
    value = positive(value, name)
    if not least <= value <= most:
        raise InputError(f"{name} must lie between {least:g} and {most:g}, got {value:g}")
    return value


def ladder(mu: float, angle: float = 60.0) -> Packing:
    """A ladder of length and weight 1 on a rough floor and wall; angle (degrees) with the floor."""
    slope = np.radians(_between(angle, "angle", 5, 85))
    foot, top = np.zeros(2), np.array([np.cos(slope), np.sin(slope)])
    across = 0.5 * _THIN * np.array([-top[1], top[0]])
    rod = np.array([foot, top / 2 - across, top, top / 2 + across])
    floor = rectangle(-0.5, -_THICK, top[0], 0)  # room to slide
    wall = rectangle(top[0], 0, top[0] + _THICK, top[1] + _THICK)
    return assemblies.blocks(
        [rod, floor, wall], mu, fixed=[1, 2], weights=[1, 1, 1], balanced=False
    )


def slope(mu: float, angle: float = 20.0, width: float = 1.0, height: float = 1.0) -> Packing:
    """A block of width and height on a fixed slope; angle in degrees."""
    turn = np.radians(_between(angle, "angle", 0.1, 80))
    width, height = positive(width, "width"), positive(height, "height")
    along = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    ground = rectangle(-width, -_THICK * width, 2 * width, 0)
    bodies = [rectangle(0, 0, width, height), ground]
    return assemblies.blocks([body @ along for body in bodies], mu, fixed=[1], balanced=False)


def books(mu: float, books: int = 5, overhang: float = 0.95) -> Packing:
    """Equal books of length 1 over the edge of a table, by this part of ½ Σ 1/k, the most."""
    count = whole(books, "books", 1, _MOST_BLOCKS)
    overhang = _between(overhang, "overhang", 1e-3, 2)
    # From the top, each book extends by 1/2k beyond the next; the table ends at x = 0.
    steps = overhang / (2 * np.arange(1, count + 1))
    ends = np.cumsum(steps[::-1])[::-1]
    bottoms = _THICK * np.arange(count)[::-1]
    stack = [
        rectangle(end - 1, low, end, low + _THICK) for end, low in zip(ends, bottoms, strict=True)
    ]
    return assemblies.blocks(
        [*stack, rectangle(-2, -_THICK, 0, 0)], mu, fixed=[count], balanced=False
    )


def arch(mu: float, voussoirs: int = 11, thickness: float = 0.2, opening: float = 180.0) -> Packing:
    """A circular arch of mean radius 1 on two fixed springers; opening in degrees."""
    count = whole(voussoirs, "voussoirs", 1, _MOST_BLOCKS)
    half = 0.5 * _between(thickness, "thickness", 1e-3, 1.9)
    turn = np.radians(_between(opening, "opening", 5, 240)) / 2
    angles = np.linspace(turn, -turn, count + 1)
    rays = np.column_stack([np.sin(-angles), np.cos(angles)])
    inner, outer = (1 - half) * rays, (1 + half) * rays
    stones = [np.array([inner[k], inner[k + 1], outer[k + 1], outer[k]]) for k in range(count)]
    return assemblies.blocks(
        [*stones, *(_springer(inner[k], outer[k], k) for k in (0, -1))],
        mu,
        fixed=[count, count + 1],
        balanced=False,
    )


def _springer(inner: Floats, outer: Floats, end: int) -> Floats:
    """A fixed block under one end of an arch, on the joint from inner to outer."""
    along = outer - inner
    below = np.array([along[1], -along[0]]) * (-1.0 if end == 0 else 1.0)
    return np.array([inner, outer, outer + below, inner + below])


def wall(
    mu: float, courses: int = 6, blocks: int = 5, width: float = 0.4, height: float = 0.175
) -> Packing:
    """A wall in running bond on fixed ground; every other course ends in half blocks."""
    courses, blocks = whole(courses, "courses", 1), whole(blocks, "blocks", 1)
    if courses * blocks > _MOST_BLOCKS:
        raise InputError(f"a wall has at most {_MOST_BLOCKS} blocks")
    width, height = positive(width, "width"), positive(height, "height")
    whole_ones = np.arange(blocks + 1.0)
    halved = np.concatenate([[0.0], whole_ones[:-1] + 0.5, [blocks]])
    bodies: list[Any] = []
    for course in range(courses):
        ends = width * (whole_ones if course % 2 else halved)
        low, high = height * course, height * (course + 1)
        bodies += [rectangle(a, low, b, high) for a, b in itertools.pairwise(ends)]
    ground = rectangle(-width, -height, (blocks + 1) * width, 0)
    return assemblies.blocks([*bodies, ground], mu, fixed=[len(bodies)], balanced=False)
