"""The periodic cell: images, its shortest vectors, and that every way to span a lattice is one."""

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from packings import reference, skewed

import granforce as gf
from granforce.bench import runner
from granforce.cell import Cell
from granforce.packing.importers.geometry import touching_contacts
from granforce.perturb import decay
from granforce.records import InputError, make_cell, make_contacts, make_packing
from granforce.study import kinds
from granforce.study.kinds import slices
from granforce.study.schema import dataset_packing, packing_dataset
from granforce.tolerances import TOUCHING

CELLS = st.builds(
    lambda width, height, tilt: Cell(np.array([width, height]), tilt),
    st.floats(0.3, 20),
    st.floats(0.3, 20),
    st.floats(-30, 30),
)
POINTS = st.integers(0, 2**32 - 1).map(
    lambda seed: np.random.default_rng(seed).uniform(-40, 40, (20, 2))
)


def whole_steps(cell, apart):
    """Steps (…, 2) along a and b, and how far they are from whole ones."""
    steps = apart @ np.linalg.inv(cell.vectors)
    return np.abs(steps - np.round(steps)).max()


@settings(max_examples=100, deadline=None)
@given(CELLS, POINTS)
def test_wrapped_points_are_images_inside_the_parallelogram(cell, x):
    found = cell.wrapped(x)
    assert whole_steps(cell, found - x) < 1e-9
    parts = cell.parts(found)
    assert parts.min() > -1e-12 and parts.max() < 1 + 1e-12


@settings(max_examples=100, deadline=None)
@given(CELLS, POINTS)
def test_nearest_is_the_shortest_of_all_images(cell, x):
    found = cell.nearest(x)
    assert whole_steps(cell, found - x) < 1e-9
    # All images that come within the length found: along b and then along a.
    longest = np.linalg.norm(found, axis=1).max()
    up = int(longest / cell.box[1]) + 1
    across = int((longest + up * abs(cell.tilt)) / cell.box[0]) + 1
    steps = np.mgrid[-across : across + 1, -up : up + 1].reshape(2, -1).T
    if len(steps) < 2000:
        images = found[:, None] + steps @ cell.vectors
        shortest = np.linalg.norm(images, axis=-1).min(axis=1)
        assert np.linalg.norm(found, axis=1) == pytest.approx(shortest, abs=1e-9)


@settings(max_examples=100, deadline=None)
@given(CELLS)
def test_reduced_vectors_are_the_shortest_and_span_the_lattice(cell):
    short, long = cell.reduced
    assert whole_steps(cell, np.array([short, long])) < 1e-9
    area = abs(short[0] * long[1] - short[1] * long[0])
    assert area == pytest.approx(np.prod(cell.box))
    assert np.linalg.norm(short) <= np.linalg.norm(long)
    assert abs(short @ long) <= (0.5 + 1e-9) * (short @ short)


def test_straight_and_open_cells_wrap_as_modulo():
    x = np.array([[-1e-300, 7.5], [12.0, -3.0]])
    assert Cell(np.array([5.0, 2.0]), 0.0).wrapped(x).tolist() == [[0.0, 1.5], [2.0, 1.0]]
    assert Cell(np.array([np.inf, 2.0]), 0.0).wrapped(x)[:, 0].tolist() == x[:, 0].tolist()
    steps = Cell(np.array([5.0, np.inf]), 0.0).nearest(np.array([4.0, 9.0]))
    assert steps.tolist() == [-1.0, 9.0]


def test_a_tilt_beyond_half_a_side_is_flipped():
    assert make_cell([4.0, 3.0], 5.0).tilt == 1.0
    assert make_cell([4.0, 3.0], -3.0).tilt == 1.0
    assert make_cell([4.0, 3.0], 2.0).tilt == 2.0
    assert make_cell([4.0, 3.0], 8.0).tilt == 0.0


@pytest.mark.parametrize(
    "box, tilt, message",
    [
        ([4.0, 3.0], np.nan, "finite"),
        ([4.0, 3.0], "far", "number"),
        ([np.inf, 3.0], 1.0, "periodic in both directions"),
        ([4.0, np.inf], 1.0, "periodic in both directions"),
        ([4.0, 0.0], 0.0, "sides"),
    ],
)
def test_cells_that_cannot_be_are_refused(box, tilt, message):
    with pytest.raises(InputError, match=message):
        make_cell(box, tilt)


def one_disk(box, tilt):
    none = make_contacts([], [], np.empty((0, 2)), [], np.ones(1))
    return make_packing([[0.0, 0.0]], [1.0], box, none, np.empty((0, 2)), 0.5, tilt=tilt)


@pytest.mark.parametrize(
    "box, tilt, free",
    [
        ([20.0, 2.01], 0.0, True),
        ([20.0, 1.99], 0.0, False),
        ([20.0, 1.99], 0.2, True),  # b is longer than its height
        ([20.0, 1.0], 7.0, True),  # 3 b − a = (1, 3)
        ([20.0, 1.0], 10.0, False),  # 2 b − a = (0, 2)
        ([20.0, 0.9], 7.0, False),  # lower than a radius
        ([2.0, 9.0], 0.7, False),
    ],
)
def test_a_grain_may_not_touch_its_image_in_any_direction(box, tilt, free):
    if free:
        assert one_disk(box, tilt).tilt == tilt
    else:
        with pytest.raises(InputError, match=r"largest (diameter|radius)"):
            one_disk(box, tilt)


def rows(contacts, turn=1.0):
    """Contacts as sorted rows i, j, normal x, y."""
    normal = contacts.normal @ turn if np.ndim(turn) else contacts.normal
    found = np.column_stack([contacts.i, contacts.j, normal])
    return found[np.lexsort(np.round(found, 3).T[::-1])]


def test_a_packing_is_the_same_in_every_cell_of_its_lattice():
    """Contacts, volume, what is found by distance, dimension, bounds."""
    packing = reference("n100_mu0.1_s11")
    S = gf.ensemble(packing)
    bounds = gf.intervals(S)
    near = touching_contacts(packing.x, packing.r, packing.cell, TOUCHING)
    for basis in (((2, 1), (1, 1)), ((1, 1), (0, 1)), ((1, 3), (0, 1))):
        other, turn = skewed(packing, basis)
        assert other.tilt != 0 and other.volume == pytest.approx(packing.volume)
        found = touching_contacts(other.x, other.r, other.cell, TOUCHING)
        assert rows(found) == pytest.approx(rows(near, turn), abs=1e-6)
        T = gf.ensemble(other)
        assert (T.dimension, T.force_scale) == (S.dimension, pytest.approx(S.force_scale))
        assert np.max(np.abs(T.residual(T.original) - S.residual(S.original))) < 1e-9
        for one, two in zip(bounds[1:3], gf.intervals(T)[1:3], strict=True):
            assert one == pytest.approx(two, abs=1e-6 * S.force_scale)


def test_a_tilted_packing_is_kept_to_the_last_bit(tmp_path):
    packing, _ = skewed(reference("n100_mu1_s12"))
    file = io.BytesIO()
    gf.save_packing(packing, file)
    file.seek(0)
    for again in (gf.load_packing(file), dataset_packing(packing_dataset(packing))):
        assert (again.tilt, again.cell.box.tolist()) == (packing.tilt, packing.box.tolist())
        assert again.x.tobytes() == packing.x.tobytes()
        assert again.contacts.normal.tobytes() == packing.contacts.normal.tobytes()


def test_packings_kept_without_a_tilt_have_none():
    packing = reference("n100_mu1_s12")  # a file from before cells were tilted
    assert packing.tilt == 0.0
    assert dataset_packing(packing_dataset(packing).drop_vars("tilt")).tilt == 0.0


def test_the_tilt_names_an_imported_packing():
    packing, _ = skewed(reference("n100_mu1_s12"))
    names = {
        kinds.imported_parameters(packing._replace(tilt=tilt))["imported"]
        for tilt in (0.0, packing.tilt, -packing.tilt)
    }
    assert len(names) == 3


def test_distances_and_slices_follow_a_tilted_cell():
    packing = reference("n100_mu0.1_s11")
    other = skewed(packing)[0]
    for contact in (0, 40, 120):
        one, two = decay.distances(packing, contact), decay.distances(other, contact)
        assert one == pytest.approx(two, abs=1e-9)
    # The cell is low, but no image is nearer than in the straight one.
    assert other.box[1] < 0.5 * packing.box[1]
    assert other.cell.shortest == pytest.approx(packing.cell.shortest)
    assert len(decay.shells(other)) == len(decay.shells(packing))
    # In a slice lie the contacts whose two centres do, with no side of the cell between them.
    x = other.cell.wrapped(other.x)
    c = other.contacts
    steps = np.linalg.inv(other.cell.vectors)
    begin = x[c.i]
    end = begin + c.length[:, None] * c.normal
    inside = [np.all((p @ steps > 0.1) & (p @ steps < 0.9), axis=1) for p in (begin, end)]
    found = slices.outside(other, (0.1, 0.9, 0.1, 0.9))
    assert np.array_equal(found, ~(inside[0] & inside[1]))
    assert 20 < np.count_nonzero(~found) < len(found) - 20


def test_an_open_box_has_no_fractions_to_slice():
    with pytest.raises(gf.InputError, match="this box is open"):
        slices.outside(gf.scene("column", disks=3), (0, 0.5, 0, 1))


def test_a_tilted_packing_is_tiled_by_its_lattice():
    packing = skewed(reference("n100_mu1_s12"))[0]
    S = gf.ensemble(packing)
    larger = runner.tile(S, 2)
    assert larger.tilt == 2 * packing.tilt and larger.volume == pytest.approx(4 * packing.volume)
    T = gf.ensemble(larger, prune=False)
    assert T.residual(T.original) < 1e-9
    # Each contact leads to the grain that is there.
    c = larger.contacts
    apart = larger.x[c.j] - larger.x[c.i] - c.length[:, None] * c.normal
    assert np.abs(larger.cell.nearest(apart)).max() < 1e-6


def test_the_stress_turns_with_the_packing():
    packing = reference("n100_mu0.1_s11")
    other = skewed(packing)[0]
    S, T = gf.ensemble(packing), gf.ensemble(other)
    one, two = (gf.stress_outline(ensemble).friction for ensemble in (S, T))
    assert one == pytest.approx(two, rel=1e-3)
