"""The cell list against all pairs and all images."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from granforce.cell import Cell
from granforce.packing.neighbours import find_pairs, separations


def every_pair(x, r, cell, cutoff, images=3):
    """The same by brute force over so many images each way."""
    found = set()
    shifts = [range(-images, images + 1) if np.isfinite(side) else [0] for side in cell.box]
    for i in range(len(r)):
        for j in range(i + 1, len(r)):
            for a in shifts[0]:
                for b in shifts[1]:
                    if np.hypot(*(x[j] + [a, b] @ cell.vectors - x[i])) < r[i] + r[j] + cutoff:
                        found.add((i, j, a, b))
    return found


def rows_of(pairs):
    i, j, shift = pairs
    rows = list(zip(i.tolist(), j.tolist(), *shift.T.tolist(), strict=True))
    assert len(rows) == len(set(rows))
    return set(rows)


def geometry_of(x, r, cell, cutoff):
    """Pairs as sorted rows i, j, branch x, y (P, 4): what no description of the cell may change."""
    i, j, shift = find_pairs(x, r, cell, cutoff)
    normal, length, gap = separations(x, r, cell, i, j, shift)
    assert gap == pytest.approx(length - r[i] - r[j])
    rows = np.column_stack([i, j, normal * length[:, None]])
    return rows[np.lexsort(np.round(rows, 6).T[::-1])]


@pytest.mark.parametrize("tilt", [0.0, 1.3, -6.0])
@pytest.mark.parametrize(
    "n, box",
    [
        (60, (14.0, 14.0)),
        (60, (40.0, 7.0)),
        (60, (7.0, 40.0)),
        (8, (3.1, 2.9)),
        (40, (np.inf, 9.0)),
        (40, (np.inf, np.inf)),
    ],
)
def test_all_pairs_are_found_once(n, box, tilt, rng):
    cell = Cell(np.array(box), tilt if np.isfinite(box).all() else 0.0)
    r = rng.uniform(0.3, 1.0, n)
    x = cell.wrapped(rng.uniform(-5, 15, (n, 2)))
    found = rows_of(find_pairs(x, r, cell, 0.3))
    assert found == every_pair(x, r, cell, 0.3, images=6 if n < 10 else 3)


@settings(max_examples=150, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(2, 12),
    st.floats(0.3, 12),
    st.floats(0.3, 12),
    st.floats(-6, 6),
)
def test_pairs_in_small_and_skew_cells_are_those_of_many_images(seed, n, width, height, tilt):
    """Cells smaller than the disks too, where one pair touches through several images."""
    rng = np.random.default_rng(seed)
    r = rng.uniform(0.2, 0.6, n)
    cell = Cell(np.array([width, height]), tilt)
    x = cell.wrapped(rng.uniform(-20, 20, (n, 2)))
    # Images that come within reach: along b the height bounds them, along a what b leaves over.
    reach = 2 * r.max() + 0.1
    up = int(np.ceil(reach / height)) + 1
    across = int(np.ceil((reach + up * abs(tilt)) / width)) + 2
    want = every_pair_fast(x, r, cell, 0.1, across, up)
    assert rows_of(find_pairs(x, r, cell, 0.1)) == want


def every_pair_fast(x, r, cell, cutoff, across, up):
    """every_pair with bounds of its own along a and b."""
    a, b = np.mgrid[-across : across + 1, -up : up + 1].reshape(2, -1)
    moved = np.column_stack([a, b]) @ cell.vectors
    i, j = np.triu_indices(len(r), 1)
    apart = np.linalg.norm((x[j] - x[i])[:, None] + moved, axis=-1)
    pair, image = np.nonzero(apart < (r[i] + r[j])[:, None] + cutoff)
    columns = i[pair], j[pair], a[image], b[image]
    return set(zip(*(column.tolist() for column in columns), strict=True))


def disks(seed, width, height, tilt):
    """About as many disks as the cell can hold."""
    rng = np.random.default_rng(seed)
    n = int(np.clip(width * height, 5, 80))
    cell = Cell(np.array([width, height]), tilt)
    return rng.random((n, 2)) @ cell.vectors, rng.uniform(0.3, 0.6, n), cell, rng


CELLS = st.integers(0, 2**32 - 1), st.floats(2, 12), st.floats(2, 12), st.floats(-6, 6)


@settings(max_examples=100, deadline=None)
@given(*CELLS, st.integers(-3, 3))
def test_a_tilt_further_by_whole_sides_is_the_same_cell(seed, width, height, tilt, times):
    x, r, cell, _ = disks(seed, width, height, tilt)
    other = Cell(cell.box, tilt + times * width)
    one, two = geometry_of(x, r, cell, 0.2), geometry_of(x, r, other, 0.2)
    assert one == pytest.approx(two, abs=1e-9)


@settings(max_examples=100, deadline=None)
@given(*CELLS)
def test_relabelled_disks_have_the_same_pairs(seed, width, height, tilt):
    x, r, cell, rng = disks(seed, width, height, tilt)
    order = rng.permutation(len(r))
    i, j, shift = find_pairs(x[order], r[order], cell, 0.2)
    i, j = order[i], order[j]
    swapped = i > j
    shift[swapped] *= -1
    i[swapped], j[swapped] = j[swapped], i[swapped]
    assert rows_of((i, j, shift)) == rows_of(find_pairs(x, r, cell, 0.2))


@settings(max_examples=100, deadline=None)
@given(*CELLS)
def test_a_lattice_turned_until_b_lies_along_x_has_the_same_gaps(seed, width, height, tilt):
    """b turned into (|b|, 0) and −a into the upper half: the same structure in another cell."""
    x, r, cell, _ = disks(seed, width, height, tilt)
    a, b = cell.vectors
    along = b / np.linalg.norm(b)
    turn = np.array([[along[0], -along[1]], [along[1], along[0]]])
    turned = Cell(np.array([np.linalg.norm(b), (-a @ turn)[1]]), float((-a @ turn)[0]))
    assert turned.vectors[0] == pytest.approx(b @ turn, abs=1e-12)
    one, two = geometry_of(x, r, cell, 0.2), geometry_of(x @ turn, r, turned, 0.2)
    assert len(one) == len(two)
    length = [np.sort(np.hypot(*rows[:, 2:].T)) for rows in (one, two)]
    assert length[0] == pytest.approx(length[1], abs=1e-9)
    assert np.sort(one[:, :2], axis=0) == pytest.approx(np.sort(two[:, :2], axis=0))


def test_separations_follow_the_image(rng):
    cell = Cell(np.array([5.0, np.inf]), 0.0)
    x = np.array([[0.2, 1.0], [4.9, 1.0]])
    r = np.array([0.3, 0.2])
    i, j, shift = find_pairs(x, r, cell, 0.0)
    normal, length, gap = separations(x, r, cell, i, j, shift)
    assert normal == pytest.approx(np.array([[-1.0, 0.0]]))
    assert length == pytest.approx([0.3])
    assert gap == pytest.approx([-0.2])


def test_separations_follow_the_image_across_a_tilted_side():
    cell = Cell(np.array([5.0, 4.0]), 1.5)
    x = np.array([[2.0, 0.1], [3.5, 3.9]])
    r = np.full(2, 0.2)
    i, j, shift = find_pairs(x, r, cell, 0.0)
    assert shift.tolist() == [[0, -1]]
    normal, length, _ = separations(x, r, cell, i, j, shift)
    assert normal == pytest.approx(np.array([[0.0, -1.0]]), abs=1e-12)
    assert length == pytest.approx([0.2])
