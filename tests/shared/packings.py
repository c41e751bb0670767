"""Packings that many tests share: made once a run, small enough to be made at all."""

import functools
from pathlib import Path

import numpy as np

from granforce.packing.compaction import pack
from granforce.packing.importers import load_packing
from granforce.records import make_contacts, make_packing

REFERENCE = Path(__file__).parents[1] / "reference"


@functools.cache
def packed(n, mu, seed=1):
    """A packing of n disks, made once."""
    return pack(n, mu, seed)


@functools.cache
def reference(name):
    """A reference packing by its file's stem."""
    return load_packing(REFERENCE / f"{name}.npz")


def two_disks(pressure=1.0, height=3.0):
    """Two disks of radius 1/2 in a row across a periodic box 2 wide: they touch on both sides."""
    x = [[0.25, 1.0], [1.25, 1.0]]
    r = np.full(2, 0.5)
    contacts = make_contacts([0, 0], [1, 1], [[1.0, 0.0], [-1.0, 0.0]], [1.0, 1.0], r)
    return make_packing(x, r, [2.0, height], contacts, np.zeros((2, 2)), 0.5, pressure)


def lattice(columns, rows, mu, triangular=False):
    """A crystal of touching disks of radius 1/2 in a periodic box, without forces."""
    across = np.arange(columns * rows) % columns
    up = np.arange(columns * rows) // columns
    directions = [(1, 0), (0, 1)]
    height = 1.0
    if triangular:
        height = np.sqrt(3) / 2
        directions.append((-1, 1))
    box = np.array([columns, rows * height])
    x = np.column_stack([across + 0.5 * triangular * up, up * height])
    i, j, normal = [], [], []
    for a, b in directions:
        i.append(np.arange(columns * rows))
        shifted = (across + a + _slip(up + b, rows, triangular)) % columns
        j.append(shifted + columns * ((up + b) % rows))
        normal.append(np.tile([a + 0.5 * triangular * b, b * height], (columns * rows, 1)))
    r = np.full(columns * rows, 0.5)
    i, j, normal = np.concatenate(i), np.concatenate(j), np.concatenate(normal)
    contacts = make_contacts(i, j, normal, np.ones(len(i)), r)
    return make_packing(x % box, r, box, contacts, np.zeros((len(i), 2)), mu, 1.0)


def skewed(packing, basis=((2, 1), (1, 1))):
    """The same periodic structure, turned: its cell spanned by other vectors of the same lattice.

    basis: the new a and b in the old ones. Returns the packing and turn (2, 2): points of the old
    one lie at x @ turn.
    """
    a, b = np.array(basis) @ packing.cell.vectors
    along = a / np.linalg.norm(a)
    turn = np.array([[along[0], -along[1]], [along[1], along[0]]])
    contacts = packing.contacts._replace(normal=packing.contacts.normal @ turn)
    found = make_packing(
        packing.x @ turn,
        packing.r,
        [np.linalg.norm(a), (b @ turn)[1]],
        contacts,
        packing.forces,
        packing.mu,
        packing.pressure,
        packing.load,
        packing.info,
        (b @ turn)[0],
    )
    return found, turn


def reversed_contacts(packing):
    """Every contact seen from its other grain: n and t turn over, f_n and f_t stay."""
    c = packing.contacts
    return packing._replace(
        contacts=c._replace(i=c.j, j=c.i, normal=-c.normal, arm_i=c.arm_j, arm_j=c.arm_i)
    )


def quarter_turned(packing):
    """The packing turned by a quarter to the left."""
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
    return packing._replace(
        x=packing.x @ turn + [packing.box[1], 0.0],
        box=packing.box[::-1].copy(),
        contacts=packing.contacts._replace(normal=packing.contacts.normal @ turn),
    )


def relabelled(packing, grains, order=slice(None)):
    """Grain k becomes grain grains[k]; contacts come in the given order."""
    place = np.argsort(grains)
    c = packing.contacts.picked(order)
    return packing._replace(
        x=packing.x[place],
        r=packing.r[place],
        load=packing.load[place],
        forces=packing.forces[order],
        contacts=c._replace(i=grains[c.i], j=grains[c.j]),
    )


def _slip(up, rows, triangular):
    # A triangular lattice leans by half a disk a row: crossing the top shifts by rows/2 columns.
    return np.where(up >= rows, rows // 2, 0) * triangular
