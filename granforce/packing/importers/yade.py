"""Packings from text files written by YADE.

Bodies are those of `export.textExt` (format x_y_z_r, id_x_y_z_r_matId, or x_y_z_r_attrs with a
column id in its comment; without ids, lines are numbered from 0). Interactions are lines with id1,
id2 and the vectors phys.normalForce and phys.shearForce, which its documentation (NormShearPhys)
defines in global coordinates, as acting on particle #2 from particle #1.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from granforce.packing.importers.layers import (
    Layer,
    WallContacts,
    make_options,
    packing_of,
    plane_of,
    vectors_in,
)
from granforce.packing.importers.network import refuse_idle_reverse
from granforce.packing.importers.notes import packing_noted
from granforce.packing.importers.text import Source, Table, is_number, read_rows, renamed
from granforce.records import InputError, Packing
from granforce.types import Mask

# Forces below this are zero and have no direction.
_TINY = 1e-300
_BODY = ("x", "y", "z", "r", "id")
_INTERACTION = ("id1", "id2", "fnx", "fny", "fnz", "fsx", "fsy", "fsz")


@packing_noted
def read_yade(
    bodies: Source,
    interactions: Source,
    mu: Any,
    *,
    box: npt.ArrayLike | None = None,
    tilt: float = 0.0,
    columns: Mapping[str, str] | None = None,
    walls: str | None = None,
    reverse: bool = False,
    most_grains: int | None = None,
) -> Packing:
    """A Packing from YADE's bodies and interactions.

    Bodies that interact but are not listed are walls, if the list has ids. An InputWarning (also in
    packing.info) reports how they are treated.

    Parameters
    ----------
    bodies, interactions : path or open file
        The two lists.
    mu : float
        Friction coefficient.
    box : (2,) array, optional
        L_x, L_y of the plane, inf for an open direction; by default the set is open.
    tilt : float, default 0
        Of the cell, whose upper side begins at (tilt, L_y).
    columns : mapping, optional
        {name here: name in the files} for columns x, y, z, r, id, id1, id2, fnx … fsz with other
        names.
    walls : {"held", "pressing"}, optional
        By default the walls' forces on grains become the grains' load. With `walls` they become
        contact forces: each wall is then one more grain, "held" (its balance is not required, so it
        takes any force) or "pressing" (its load is its force in the simulation).
    reverse : bool, default False
        Change the sign of shear forces.
    most_grains : int, optional
        Largest number of grains.

    Returns
    -------
    Packing
        With the forces of the simulation.

    Raises
    ------
    InputError
        Naming file and line.
    """
    options = make_options(mu, box, tilt, walls, reverse, most_grains)
    tables = _bodies(bodies), _interactions(interactions, bool(columns))
    grains, links = renamed({} if columns is None else columns, _BODY + _INTERACTION, *tables)
    grains.require("x", "y", "z", "r")
    links.require(*_INTERACTION)
    packing = packing_of(_layer(grains, links), options, "yade")
    refuse_idle_reverse(packing.forces, reverse)
    return packing


def _layer(grains: Table, links: Table) -> Layer:
    """The Layer of bodies and interactions, whose bodies that are not listed are walls."""
    plane = plane_of(grains)
    numbered = "id" not in grains.header
    ids = {row: row for row in range(len(grains.rows))} if numbered else grains.index("id")
    are_listed = np.array([links.among(end, ids) for end in ("id1", "id2")])
    if numbered:
        _check_all_listed(links, are_listed, len(grains.rows))
    at_wall = are_listed[0] != are_listed[1]
    on_walls = None
    if at_wall.any():
        rows = np.flatnonzero(at_wall)
        on_walls = _wall_contacts(links.some(rows), are_listed[:, rows], ids, plane)
    links = links.some(np.flatnonzero(~at_wall))
    i, j = links.lookup("id1", ids), links.lookup("id2", ids)
    force = vectors_in(links, plane, "fn") + vectors_in(links, plane, "fs")
    return Layer(grains, plane, links, i, j, force, on_walls)


def _check_all_listed(links: Table, are_listed: Mask, count: int) -> None:
    """InputError naming an interaction of a body that is not among the bodies."""
    for row in np.flatnonzero(~are_listed.all(axis=0))[:1]:
        raise InputError(
            f"{links.place(row)}: a body is not among the {count} bodies, whose ids count lines "
            "from 0; if walls are bodies, too, export the ids (format x_y_z_r_attrs)"
        )


def _wall_contacts(
    links: Table, are_listed: Mask, ids: Mapping[Any, int], plane: str
) -> WallContacts:
    """The WallContacts of interactions, one body of which is listed: are_listed (2, w)."""
    normal, shear = vectors_in(links, plane, "fn"), vectors_in(links, plane, "fs")
    wall_end = are_listed[0].astype(int)
    ends = np.array([links.fields("id1"), links.fields("id2")])
    rows = np.arange(len(wall_end))
    grain_ids = links._replace(header=("id",), rows=[[id] for id in ends[1 - wall_end, rows]])
    names, wall = np.unique(ends[wall_end, rows], return_inverse=True)
    # Forces act on the second body.
    sign = np.where(wall_end, 1.0, -1.0)[:, None]
    unit = np.maximum(np.hypot(*normal.T), _TINY)[:, None]
    return WallContacts(
        grain=grain_ids.lookup("id", ids),
        wall=wall,
        normal=sign * normal / unit,
        force=sign * (normal + shear),
        names=names.tolist(),
    )


def _interactions(source: Source, has_names: bool) -> Table:
    """A Table of interactions, with the names of the file if valid, otherwise the standard ones."""
    table = read_rows(source)
    names = [word.lower() for word in table.rows[0]]
    if is_number(names[0]):
        names = table.comments[-1].split() if table.comments else []
    else:
        table = table.some(range(1, len(table.rows)))
    if not table.rows:
        raise InputError(f"{table.name}: no line with numbers")
    fits = len(names) == len(table.rows[0])
    return table.named(
        names if fits and (has_names or set(_INTERACTION) <= set(names)) else _INTERACTION
    )


def _bodies(source: Source) -> Table:
    """A Table of bodies, with columns given by the format and the last comment."""
    table = read_rows(source)
    formats = [words[-1] for words in map(str.split, table.comments) if words[:1] == ["format"]]
    header = (formats[0] if formats else "x_y_z_r").removesuffix("_attrs").split("_")
    more = len(table.rows[0]) - len(header)
    if more > 0:
        others = [line.split() for line in table.comments if not line.startswith("format")]
        words = others[-1] if others else []
        words = words if len(words) == more else words[len(header) :]
        if len(words) != more:
            words = [f"column {len(header) + k + 1}" for k in range(more)]
        header += ["id" if word == "b.id" else word for word in words]
    return table.named(header)
