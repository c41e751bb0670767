"""Packings of rigid bodies from files: a table of corners (CSV), or a list of bodies (JSON)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from granforce.forces.contact_problem import prestress
from granforce.packing.assemblies import areas, blocks, nearly_touching
from granforce.packing.importers.notes import packing_noted, with_notes
from granforce.packing.importers.text import Source, Table, csv_table, read_text
from granforce.records import InputError, Packing, brief, positive
from granforce.system.wording import counted
from granforce.types import Floats, Integers

SHAPES = ("corners", "disk", "parts")  # a body, or a part, has one of these in JSON
KEYS = (*SHAPES, "density", "fixed", "material")  # of a body in JSON
_WORDS = {"1": 1, "0": 0, "1.0": 1, "0.0": 0, "yes": 1, "no": 0, "true": 1, "false": 0}


class _Bodies(NamedTuple):
    outlines: list[Any]  # corners (k, 2), or x, y, r of a disk, or a list of these parts
    density: list[float | None]  # None: not given
    fixed: list[bool]
    names: list[str]  # labels, or numbers
    materials: list[Any] | None
    friction: dict[Any, Any]  # of pairs of materials
    normals: dict[Any, Any]  # of pairs of bodies corner on corner, in degrees


@packing_noted
def read_blocks(
    source: Source, *, mu: Any, density: Any = None, tolerance: float | None = None
) -> Packing:
    """A Packing of rigid bodies from a file, as `blocks` makes it.

    Parameters
    ----------
    source : path or open file
        CSV: a row for each corner, columns body (any label), x, y; optionally r (above 0: the row
        is a disk), part (any label: a body of several convex parts), and density and fixed (0 or 1,
        or no and yes), alike in all rows of a body. JSON: an object {"bodies": […]} of objects with
        corners [[x, y], …], disk [x, y, r] or parts (a list of objects with corners or disk), and
        optionally density, fixed (true or false) and material; and in the object "friction" of
        pairs of materials, [["stone", "wood", 0.4], …], and "normals" of bodies that meet corner on
        corner, [[0, 1, 90], …], in degrees.
    mu : float
        Friction coefficient of all other contacts.
    density : float, optional
        Mass per area of the bodies that have none in the file, by default 1.
    tolerance : float, optional
        As for `blocks`.

    Returns
    -------
    Packing
        InputWarnings report pairs in doubt, which info lists.

    Raises
    ------
    InputError
        Naming the line or the body.
    NotJammedError
        If nothing balances the weights.
    """
    file, text = read_text(source)
    if text.lstrip()[:1] in "{[":
        bodies = _from_json(file, text)
    else:
        bodies = _from_table(csv_table(file, text))
    if density is not None and None not in bodies.density:
        raise InputError(f"{file} gives the density of every body: leave out --density (density=)")
    usual = 1.0 if density is None else positive(density, "density")
    try:
        densities = [
            usual if one is None else positive(one, f"the density of body {name}")
            for name, one in zip(bodies.names, bodies.density, strict=True)
        ]
        packing = blocks(
            bodies.outlines,
            mu,
            fixed=np.flatnonzero(bodies.fixed),
            weights=np.array(densities) * areas(bodies.outlines, bodies.names),
            materials=bodies.materials,
            friction=bodies.friction,
            normals=bodies.normals,
            tolerance=tolerance,
            names=bodies.names,
        )
    except InputError as error:
        raise type(error)(f"{file}: {error}") from None
    packing = packing._replace(info=packing.info | {"source": "blocks"})
    return with_notes(packing, _notes(packing))


def _notes(packing: Packing) -> list[str]:
    """Notes on pairs of bodies that nearly touch, or touch at corners only."""
    notes = []
    if count := len(packing.info["corner_on_corner"]):
        pairs = counted(count, "pair of bodies meets", "pairs of bodies meet")
        notes.append(f"{pairs} corner on corner, which is no contact")
    if near := packing.info["nearly_touching"]:
        notes.append(nearly_touching([gap for _, _, gap in near], packing.info["tolerance"]))
    if words := prestress(np.array(packing.info["wedged"])):
        notes.append(words)
    return notes


def _from_table(table: Table) -> _Bodies:
    for name in ("material", "friction"):
        if name in table.header:
            raise InputError(
                f"{table.name}: column {name}: a table has one friction coefficient, --mu (mu=); "
                "give materials and the friction of their pairs as JSON"
            )
    labels = table.fields("body")
    first = {label: labels.index(label) for label in dict.fromkeys(labels)}
    body = np.array([list(first).index(label) for label in labels])
    x = np.column_stack([table.numbers("x"), table.numbers("y")])
    r = table.numbers("r") if "r" in table.header else np.zeros(len(x))
    part = table.fields("part") if "part" in table.header else [""] * len(labels)
    outlines: list[Any] = []
    for label in first:
        own = [row for row, one in enumerate(labels) if one == label]
        parts = []
        for name in dict.fromkeys(part[row] for row in own):
            rows = [row for row in own if part[row] == name]
            if len(rows) > 1 and r[rows].any():
                raise InputError(f"{table.place(rows[1])}: a disk is one row; r of a corner is 0")
            parts.append(np.array([*x[rows[0]], r[rows[0]]]) if r[rows[0]] else x[rows])
        outlines.append(parts)
    begin = np.array(list(first.values()))

    def alike(name: str, values: Floats | Integers) -> list[Any]:
        for row in np.flatnonzero(values != values[begin][body])[:1]:
            raise InputError(f"{table.place(row)}: {name} differs within body {labels[row][:40]}")
        return values[begin].tolist()

    none: list[Any] = [None] * len(first)
    held = _fixed(table) if "fixed" in table.header else np.zeros(len(x), dtype=int)
    return _Bodies(
        outlines,
        alike("density", table.numbers("density")) if "density" in table.header else none,
        [bool(value) for value in alike("fixed", held)],
        list(first),
        None,
        {},
        {},
    )


def _fixed(table: Table) -> Integers:
    """The column fixed (rows,) as 0 or 1, which may also be written in words."""
    values = [_WORDS.get(text.lower(), -1) for text in table.fields("fixed")]
    if -1 in values:
        row = values.index(-1)
        raise InputError(
            f"{table.place(row)}: fixed is {brief(table.fields('fixed')[row])}; give 1 or 0 (or "
            "yes, no, true, false)"
        )
    return np.array(values)


def _from_json(name: str, text: str) -> _Bodies:
    try:
        given = json.loads(text, object_pairs_hook=partial(_object, name))
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise InputError(f"{name}: not JSON ({brief(str(error))}); repair it") from None
    bodies = given.get("bodies") if isinstance(given, dict) else None
    if not isinstance(bodies, list) or not bodies:
        raise InputError(f'{name}: give an object {{"bodies": [{{"corners": [[x, y], …]}}, …]}}')
    for k, body in enumerate(bodies):
        _check_keys(body, SHAPES, KEYS, f"{name}: body {k}")
        if not isinstance(body.get("fixed", False), bool):
            raise InputError(f"{name}: fixed of body {k} must be true or false")
    shapes = [_shape(body, f"{name}: body {k}") for k, body in enumerate(bodies)]
    held = [body.get("fixed", False) for body in bodies]
    materials = [body.get("material") for body in bodies]
    if not all(isinstance(material, str | None) for material in materials):
        raise InputError(f"{name}: a material is a text")
    friction: dict[Any, float] = {}
    for *pair, mu in _rows_of(given, "friction", name, (str, str), '["stone", "wood", 0.4]'):
        if friction.setdefault(frozenset(pair), mu) != mu:
            raise InputError(
                f"{name}: two friction coefficients of {brief(pair[0])} and {brief(pair[1])}: "
                f"{friction[frozenset(pair)]:g} and {mu:g}; give each pair once"
            )
    names = [str(k) for k in range(len(bodies))]
    density = [body.get("density") for body in bodies]
    normals = {
        (i, j): angle for i, j, angle in _rows_of(given, "normals", name, (int, int), "[0, 1, 90]")
    }
    return _Bodies(shapes, density, held, names, materials, friction, normals)


def _check_keys(given: Any, shapes: Sequence[str], keys: Sequence[str], name: str) -> None:
    """InputError unless an object has one of these shapes, and only these keys."""
    if not isinstance(given, dict) or sum(shape in given for shape in shapes) != 1:
        *others, last = (f'"{shape}"' for shape in shapes)
        raise InputError(f"{name} must have either {', '.join(others)} or {last}")
    if strange := sorted(given.keys() - set(keys)):
        raise InputError(f"{name} has {brief(strange[0])}; take {', '.join(keys)}")


def _shape(body: dict[str, Any], name: str) -> Any:
    """Corners, a disk, or a list of these parts."""
    if "parts" not in body:
        return body.get("corners", body.get("disk"))
    parts = body["parts"]
    if not isinstance(parts, list) or not parts:
        raise InputError(f'{name}: "parts" is a list of objects with "corners" or "disk"')
    for k, part in enumerate(parts):
        _check_keys(part, SHAPES[:2], SHAPES[:2], f"{name}: part {k}")
    return [_shape(part, name) for part in parts]


def _object(name: str, pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object of JSON; InputError for a key that it has twice."""
    given = dict(pairs)
    keys = [key for key, _ in pairs]
    for key in given:
        if keys.count(key) > 1:
            raise InputError(f"{name}: the key {brief(key)} is given twice in one object")
    return given


def _rows_of(
    given: Any, key: str, name: str, pair: tuple[type, type], example: str
) -> list[list[Any]]:
    """The rows of a key: pairs, and a number for each."""
    rows = given.get(key, [])
    for row in rows if isinstance(rows, list) else [rows]:
        kinds = [type(value) for value in row] if isinstance(row, list) else []
        if kinds[:2] != [*pair] or len(kinds) != 3 or kinds[2] not in (int, float):
            raise InputError(f'{name}: "{key}" is [{example}, …], not {brief(row)}')
    return rows
