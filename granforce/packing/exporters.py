"""Force networks in files of other programs: VTK XML for ParaView, dumps of LAMMPS."""

from __future__ import annotations

import base64
import struct
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from granforce.forces.balance import left_open_in
from granforce.records import InputError, Packing, float_array, refuse_shapes, takes
from granforce.system.files import expanded, written
from granforce.system.wording import counted
from granforce.types import Floats

_VTK_TYPES = {"f": "Float64", "i": "Int64"}


@takes(Packing)
def save_vtk(
    packing: Packing, grains: str | Path, contacts: str | Path, forces: npt.ArrayLike | None = None
) -> None:
    """Write a packing as two .vtp files (VTK XML PolyData), which ParaView opens.

    Lengths and forces are in the packing's units.

    Parameters
    ----------
    packing : Packing
        Disks.
    grains : path
        Points with radius, number of contacts, load (F_x, F_y, 0) and torque.
    contacts : path
        Lines from grain i along the branch to j, also across periodic sides, or to the wall if j is
        one; with i, j, f_n, f_t, the force on j (a vector) and the gap as data of the lines, and
        f_n also at their ends, for tubes.
    forces : (N_c, 2) array, optional
        f_n, f_t, by default the packing's own.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    refuse_shapes(packing, "files for other programs are written")
    forces, c = _forces(packing, forces), packing.contacts
    count, links = len(packing.r), len(c.i)
    ends = np.concatenate([c.i, c.j])
    points = {
        "radius": packing.r,
        "contacts": np.bincount(ends, minlength=count),
        "load": _spatial(packing.load[:, :2]),
        "torque": packing.load[:, 2],
    }
    # A wall has no lever arm: the line ends at the wall.
    reach = np.where(c.arm_j == 0, c.arm_i, c.length)
    start = packing.x[c.i]
    both = np.stack([start, start + reach[:, None] * c.normal], axis=1).reshape(-1, 2)
    lines = {
        "f_n": forces[:, 0],
        "f_t": forces[:, 1],
        "force": _spatial(forces[:, :1] * c.normal + forces[:, 1:] * c.tangent),
        "gap": c.gap,
        "i": c.i,
        "j": c.j,
    }
    one, two = np.arange(count), np.arange(2 * links)
    of_ends = {"f_n": np.repeat(forces[:, 0], 2)}
    _write(
        (grains, _poly_data(packing.x, "Verts", one, one + 1, points, {})),
        (contacts, _poly_data(both, "Lines", two, two[1::2] + 1, of_ends, lines)),
    )


@takes(Packing)
def save_lammps(
    packing: Packing,
    particles: str | Path,
    contacts: str | Path,
    forces: npt.ArrayLike | None = None,
) -> None:
    """Write a packing as two dumps of LAMMPS, which `read_lammps` reads back.

    A dump has no friction coefficient, no loads (when it is read back, the loads balance the
    forces), no gaps and no walls: these become grains, with a warning.

    Parameters
    ----------
    packing : Packing
        Disks.
    particles : path
        ``dump custom`` with id, type, x, y and radius.
    contacts : path
        ``dump local`` with atom1, atom2, distance and, on atom1, the normal force fx, fy and the
        tangential force px, py.
    forces : (N_c, 2) array, optional
        f_n, f_t, by default the packing's own.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    refuse_shapes(packing, "files for other programs are written")
    forces, c = _forces(packing, forces), packing.contacts
    if held := int(left_open_in(packing).sum()):
        warnings.warn(
            f"{counted(held, 'wall or other grain', 'walls or other grains')} whose balance is not "
            "required: in LAMMPS dumps these are ordinary grains; `granforce import lammps` gives "
            "them loads and requires their balance, so S becomes smaller",
            stacklevel=3,
        )
    ids = np.arange(1, len(packing.r) + 1)
    on_i = np.column_stack([-forces[:, :1] * c.normal, -forces[:, 1:] * c.tangent])
    box = _bounds(packing)
    atoms = np.column_stack([ids, np.ones_like(ids), packing.x, packing.r])
    pairs = np.column_stack([c.i + 1, c.j + 1, c.length, on_i])
    _write(
        (particles, _dump("ATOMS", "id type x y radius", box, atoms)),
        (contacts, _dump("ENTRIES", "atom1 atom2 distance fx fy px py", box, pairs)),
    )


def _forces(packing: Packing, forces: npt.ArrayLike | None) -> Floats:
    if forces is None:
        return packing.forces
    return float_array(forces, packing.forces.shape, "forces")


def _write(*files: tuple[str | Path, bytes]) -> None:
    """Write both files or neither."""
    (first, one), (second, two) = files
    if expanded(first) == expanded(second):
        raise InputError(f"{first}: give each of the two files its own name")
    with written(first) as file, written(second) as other:
        file.write(one)
        other.write(two)


def _spatial(vectors: Floats) -> Floats:
    return np.column_stack([vectors, np.zeros(len(vectors))])


def _poly_data(
    x: Floats,
    kind: str,
    connectivity: Any,
    offsets: Any,
    of_points: Mapping[str, Any],
    of_cells: Mapping[str, Any],
) -> bytes:
    """A VTK XML file of points x (n, 2) and of cells of one kind, Verts or Lines."""
    numbers = {part: 0 for part in ("Verts", "Lines", "Strips", "Polys")} | {kind: len(offsets)}
    counts = "".join(f' NumberOf{part}="{number}"' for part, number in numbers.items())
    parts = {
        "PointData": of_points,
        "CellData": of_cells,
        "Points": {"points": _spatial(x)},
        kind: {"connectivity": connectivity, "offsets": offsets},
    }
    inner = ""
    for part, arrays in parts.items():
        text = "".join(_data_array(name, array) for name, array in arrays.items())
        inner += f"<{part}>\n{text}</{part}>\n"
    return (
        '<?xml version="1.0"?>\n'
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n'
        f'<PolyData>\n<Piece NumberOfPoints="{len(x)}"{counts}>\n{inner}</Piece>\n</PolyData>\n'
        "</VTKFile>\n"
    ).encode()


def _data_array(name: str, array: Any) -> str:
    """A DataArray in base64: its number of bytes, then its numbers."""
    array = np.asarray(array)
    kind, wide = array.dtype.kind, array.shape[1] if array.ndim == 2 else 1
    data = array.astype(f"<{kind}8").tobytes()
    text = base64.b64encode(struct.pack("<Q", len(data)) + data).decode()
    return (
        f'<DataArray type="{_VTK_TYPES[kind]}" Name="{name}" NumberOfComponents="{wide}" '
        f'format="binary">{text}</DataArray>\n'
    )


def _bounds(packing: Packing) -> str:
    """The box of a dump; the bounds of a tilted box are those of the rectangle around it."""
    cell, tilt = packing.cell, packing.tilt
    is_open, reach = np.isinf(cell.box), packing.r[:, None]
    low = np.where(is_open, (packing.x - reach).min(axis=0), 0.0)
    high = np.where(is_open, (packing.x + reach).max(axis=0), cell.box)
    low[0], high[0] = low[0] + min(0.0, tilt), high[0] + max(0.0, tilt)
    sides = [[*pair, tilt * (k == 0)] for k, pair in enumerate(zip(low, high, strict=True))]
    thick = packing.r.max()
    rows = [*sides, [-thick, thick, 0.0]]
    flags = " ".join(["ff" if side else "pp" for side in is_open] + ["pp"])
    words = f"xy xz yz {flags}" if tilt else flags
    text = "\n".join(" ".join(f"{v:.17g}" for v in row[: 3 if tilt else 2]) for row in rows)
    return f"ITEM: BOX BOUNDS {words}\n{text}\n"


def _dump(title: str, columns: str, box: str, table: Floats) -> bytes:
    """A dump of one snapshot, with integers in the first two columns."""
    rows = "".join(
        f"{row[0]:.0f} {row[1]:.0f} {' '.join(f'{v:.17g}' for v in row[2:])}\n"
        for row in table.tolist()
    )
    head = f"ITEM: TIMESTEP\n0\nITEM: NUMBER OF {title}\n{len(table)}\n{box}"
    return f"{head}ITEM: {title} {columns}\n{rows}".encode()


# Formats by the suffix of both file names.
FORMATS = {".vtp": save_vtk, ".dump": save_lammps}


def export(packing: Packing, grains: str | Path, contacts: str | Path) -> None:
    """Write a packing as two files in the format given by their suffix.

    Raises InputError for suffixes that are not in FORMATS or differ.
    """
    ends = {Path(path).suffix.lower() for path in (grains, contacts)}
    save = FORMATS.get(ends.pop()) if len(ends) == 1 else None
    if save is None:
        raise InputError(
            f"{grains}, {contacts}: give two files ending in .vtp (ParaView) or in .dump (LAMMPS)"
        )
    save(packing, grains, contacts)
