"""The list of pairs that may touch, rebuilt while a packing moves."""

import numpy as np

from granforce.cell import Cell
from granforce.motion.contact_dynamics import REACH, Motion
from granforce.numerics.lanes import allocating
from granforce.packing.neighbours import find_pairs
from granforce.records import NotJammedError
from granforce.types import Floats, Integers

# Pairs closer than SKIN (in largest radii) are listed. The list is rebuilt once two grains may have
# approached by MOVED.
SKIN = 0.2
MOVED = SKIN - REACH


def cell_of(motion: Motion) -> Cell:
    """The periodic cell of a moving packing."""
    return Cell(motion.box, float(motion.tilt[0]))


def motionless(x: Floats, r: Floats, box: Floats, dilation: Floats) -> Motion:
    """Disks without velocities and forces, with their list of pairs."""
    none, no_shift, no_force = np.zeros(0, np.int64), np.zeros((0, 2), np.int64), np.zeros((0, 2))
    return relisted(
        Motion(
            *(x, np.zeros((len(r), 3)), r, np.pi * r**2, box, np.zeros(1), dilation),
            *(none, none, no_shift, no_force, np.zeros(1), np.zeros(2)),
        )
    )


def relisted(motion: Motion) -> Motion:
    """The motion with a new list of pairs, whose forces are carried over.

    Raises NotJammedError if the box is as small as a disk.
    """
    motion = _leant_back(motion)
    if cell_of(motion).shortest <= 2 * motion.r.max():
        raise NotJammedError(
            "the box shrank to the largest disk's diameter without jamming: too few disks"
        )
    i, j, shift = find_pairs(motion.x, motion.r, cell_of(motion), SKIN)
    # Sorted, so that the order of sweeps does not depend on when the list was built.
    order = np.lexsort((shift[:, 1], shift[:, 0], j, i))
    i, j, shift = i[order], j[order], shift[order]
    force = _carry_over(motion.i, motion.j, motion.shift, motion.force, i, j, shift)
    return motion._replace(i=i, j=j, shift=shift, force=force, drift=np.zeros(1))


def _leant_back(motion: Motion) -> Motion:
    """The motion with a tilt between ∓L_x/2 that spans the same lattice."""
    times = np.round(motion.tilt[0] / motion.box[0])
    if times == 0:
        return motion
    # The image s_x a + s_y b is (s_x + times s_y) a + s_y (b − times a).
    along = motion.shift[:, 0] + int(times) * motion.shift[:, 1]
    return motion._replace(
        tilt=motion.tilt - times * motion.box[0], shift=np.column_stack([along, motion.shift[:, 1]])
    )


@allocating
def _carry_over(
    old_i: Integers,
    old_j: Integers,
    old_shift: Integers,
    old_force: Floats,
    i: Integers,
    j: Integers,
    shift: Integers,
) -> Floats:
    """Forces of the old pairs on the new ones, by grain numbers and image."""
    grains = 0
    for a in old_i:
        grains = max(grains, a + 1)
    for a in i:
        grains = max(grains, a + 1)
    start = np.zeros(grains + 1, np.int64)
    # Lists are grouped by i, so the old pairs of one grain are adjacent.
    for a in old_i:
        start[a + 1] += 1
    for a in range(grains):
        start[a + 1] += start[a]
    force = np.zeros((len(i), 2))
    for p in range(len(i)):
        for q in range(start[i[p]], start[i[p] + 1]):
            same = shift[p, 0] == old_shift[q, 0] and shift[p, 1] == old_shift[q, 1]
            if old_j[q] == j[p] and same:
                force[p, 0], force[p, 1] = old_force[q, 0], old_force[q, 1]
    return force
