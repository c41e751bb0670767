"""Packings of rigid bodies from files: a table of corners (CSV), or a list of bodies (JSON)."""

from __future__ import annotations

import io
import json
from typing import Any, NamedTuple

import numpy as np

from granforce.packing.assemblies import area, blocks
from granforce.packing.importers.text import Source, Table, read_csv, read_text
from granforce.records import InputError, Packing, brief, positive
from granforce.types import Floats, Integers

KEYS = ("corners", "disk", "density", "fixed", "material")  # of a body in JSON


class _Bodies(NamedTuple):
    outlines: list[Any]  # corners (k, 2), or x, y, r of a disk
    density: list[float | None]  # None: not given
    fixed: list[bool]
    materials: list[Any] | None
    friction: dict[Any, Any]  # of pairs of materials


def read_blocks(
    source: Source, *, mu: Any, density: Any = None, tolerance: float | None = None
) -> Packing:
    """A Packing of rigid bodies from a file, as `blocks` makes it.

    source: a path or an open file. CSV: a row for each corner, columns body (any label), x, y;
    optionally r (above 0: the row is a disk), and density and fixed (0 or 1), alike in all rows of
    a body. JSON: an object {"bodies": […]} of objects with corners [[x, y], …] or disk [x, y, r],
    and optionally density, fixed (true or false) and material, and in the object "friction" of
    pairs of materials, [["stone", "wood", 0.4], …]. mu: friction coefficient of all other contacts.
    density: mass per area of the bodies that have none in the file, by default 1. tolerance: as for
    `blocks`. packing.info has notes on pairs in doubt, and lists them.

    Raises InputError naming the line or the body, NotJammedError if nothing balances the weights.
    """
    name, text = read_text(source)
    if text.lstrip()[:1] in "{[":
        found = _from_json(name, text)
    else:
        file = io.StringIO(text)
        file.name = name
        found = _from_table(read_csv(file))
    if density is not None and None not in found.density:
        raise InputError(f"{name} gives the density of every body: leave out density")
    usual = 1.0 if density is None else positive(density, "density")
    try:
        own = [
            usual if one is None else positive(one, f"the density of body {k}")
            for k, one in enumerate(found.density)
        ]
        packing = blocks(
            found.outlines,
            mu,
            fixed=np.flatnonzero(found.fixed),
            weights=np.array(own) * [area(body, k) for k, body in enumerate(found.outlines)],
            materials=found.materials,
            friction=found.friction,
            tolerance=tolerance,
        )
    except InputError as error:
        raise type(error)(f"{name}: {error}") from None
    notes = _notes(packing)
    return packing._replace(info=packing.info | {"source": "blocks"} | notes)


def _notes(packing: Packing) -> dict[str, list[str]]:
    words = {
        "corner_on_corner": "meet corner on corner, which is no contact",
        "nearly_touching": "nearly touch, and are no contacts",
    }
    counts = {word: len(packing.info[key]) for key, word in words.items()}
    notes = [f"pairs of bodies that {word}: {n}" for word, n in counts.items() if n]
    return {"notes": notes} if notes else {}


def _from_table(table: Table) -> _Bodies:
    labels = table.fields("body")
    first = {label: labels.index(label) for label in dict.fromkeys(labels)}
    body = np.array([list(first).index(label) for label in labels])
    x = np.column_stack([table.numbers("x"), table.numbers("y")])
    r = table.numbers("r") if "r" in table.header else np.zeros(len(x))
    rows = [np.flatnonzero(body == k) for k in range(len(first))]
    for some in rows:
        if len(some) > 1 and r[some].any():
            raise InputError(f"{table.place(some[1])}: a disk is one row; r of a corner is 0")
    begin = np.array(list(first.values()))

    def alike(name: str, values: Floats | Integers) -> list[Any]:
        for row in np.flatnonzero(values != values[begin][body])[:1]:
            raise InputError(f"{table.place(row)}: {name} differs within body {labels[row][:40]}")
        return values[begin].tolist()

    none: list[Any] = [None] * len(first)
    held = table.whole("fixed") if "fixed" in table.header else np.zeros(len(x), dtype=int)
    for row in np.flatnonzero(held > 1)[:1]:
        raise InputError(f"{table.place(row)}: fixed must be 0 or 1")
    return _Bodies(
        [np.array([*x[k[0]], r[k[0]]]) if r[k[0]] else x[k] for k in rows],
        alike("density", table.numbers("density")) if "density" in table.header else none,
        [bool(value) for value in alike("fixed", held)],
        None,
        {},
    )


def _from_json(name: str, text: str) -> _Bodies:
    try:
        given = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{name}: not JSON ({brief(str(error))}); repair it") from None
    bodies = given.get("bodies") if isinstance(given, dict) else None
    if not isinstance(bodies, list) or not bodies:
        raise InputError(f'{name}: give an object {{"bodies": [{{"corners": [[x, y], …]}}, …]}}')
    for k, body in enumerate(bodies):
        if not isinstance(body, dict) or ("corners" in body) == ("disk" in body):
            raise InputError(f'{name}: body {k} must have either "corners" or "disk"')
        if strange := sorted(body.keys() - set(KEYS)):
            raise InputError(f"{name}: body {k} has {brief(strange[0])}; take {', '.join(KEYS)}")
        if not isinstance(body.get("fixed", False), bool):
            raise InputError(f"{name}: fixed of body {k} must be true or false")
    shapes = [body.get("corners", body.get("disk")) for body in bodies]
    held = [body.get("fixed", False) for body in bodies]
    materials = [body.get("material") for body in bodies]
    if not all(isinstance(material, str | None) for material in materials):
        raise InputError(f"{name}: a material is a text")
    friction = {}
    for row in _rows_of(given.get("friction", []), name):
        friction[row[0], row[1]] = row[2]
    return _Bodies(shapes, [body.get("density") for body in bodies], held, materials, friction)


def _rows_of(given: Any, name: str) -> list[list[Any]]:
    """Pairs of materials and their friction, [a, b, μ]."""
    rows = given if isinstance(given, list) else [given]
    for row in rows:
        kinds = [type(value) for value in row] if isinstance(row, list) else []
        if kinds[:2] != [str, str] or len(kinds) != 3 or kinds[2] not in (int, float):
            raise InputError(f'{name}: "friction" is [["stone", "wood", 0.4], …], not {brief(row)}')
    return rows
