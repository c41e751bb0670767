"""Layers on a floor, periodic in x, under gravity; and clumps of disks."""

import io
import itertools

import numpy as np
import pytest
from scipy.optimize import linprog

import granforce as gf
from granforce.packing.masonry import rectangle

OPEN = np.inf


def zigzag(mu, rows=6, shift=0.0, unit=1.0):
    """One disk a row, which rests on two images of the disk below: angle θ, cos θ = 0.8."""
    x = [(shift + 1.2 * k, 1 + 1.6 * k) for k in range(rows)]
    return gf.from_disks(
        unit * np.array(x),
        np.full(rows, unit),
        mu,
        box=[2.4 * unit, OPEN],
        walls="floor",
        gravity=1,
    )


def test_columns_have_the_forces_of_the_weights_above():
    column = gf.from_disks(
        [(1, 1 + 2 * k) for k in range(5)], np.ones(5), 0.5, box=[4, OPEN], walls="floor", gravity=1
    )
    assert gf.ensemble(column).dimension == 0
    assert sorted(column.forces[:, 0] / np.pi) == pytest.approx([1, 2, 3, 4, 5])
    for shift, unit in ((0.0, 1.0), (2.3, 1e3)):
        smooth = zigzag(0.0, shift=shift, unit=unit)
        above = np.repeat(np.arange(1, 6), 2) / (2 * 0.8)
        assert np.sort(smooth.forces[:, 0]) / (np.pi * unit**2) == pytest.approx([*above, 6])
        assert gf.ensemble(zigzag(0.5, shift=shift, unit=unit)).dimension == 5


def of_its_own(packing):
    """A, cones and load, from positions and radii alone; floor contacts come last."""
    n, (width, _) = packing.info["disks"], packing.box
    x, r, tolerance = packing.x, packing.r, 1e-9
    columns, places = [], []
    for i, j in itertools.combinations(range(n), 2):
        for image in (-1, 0, 1):
            away = x[j] - x[i] + [image * width, 0]
            if np.hypot(*away) - r[i] - r[j] < tolerance:
                columns.append((i, j, away / np.hypot(*away)))
    columns += [(i, -1, np.array([0.0, -1.0])) for i in range(n) if x[i, 1] - r[i] < tolerance]
    A = np.zeros((3 * n, 2 * len(columns)))
    for c, (i, j, normal) in enumerate(columns):
        for part, way in enumerate((normal, np.array([-normal[1], normal[0]]))):
            for disk, sign in ((i, -1), (j, 1)):
                if disk >= 0:
                    arm = -sign * r[disk] * normal
                    A[3 * disk : 3 * disk + 2, 2 * c + part] = sign * way
                    A[3 * disk + 2, 2 * c + part] = sign * (arm[0] * way[1] - arm[1] * way[0])
        places.append((i, j, *np.round(normal, 9)))
    load = np.column_stack([np.zeros(n), np.pi * r[:n] ** 2, np.zeros(n)]).ravel()
    cones = np.kron(np.eye(len(columns)), [[-packing.mu, 1], [-packing.mu, -1]])
    return A, load, cones, places


@pytest.fixture(scope="module")
def heap():
    return gf.pack(25, 0.3, seed=3, box="floor")


def test_a_heap_rests_and_its_bounds_are_those_of_linprog(heap):
    A, load, cones, places = of_its_own(heap)
    S, c = gf.ensemble(heap), heap.contacts
    assert gf.rest(heap).at_rest and S.admits(S.original) and len(places) == len(c.i)
    exact = gf.intervals(S, S.index[:: len(S.index) // 6])
    for contact, low, high in zip(exact.contacts, exact.low, exact.high, strict=True):
        key = (c.i[contact], c.j[contact] if c.j[contact] < 25 else -1)
        place = next(
            k
            for k, (i, j, *normal) in enumerate(places)
            if (i, j) == key and np.allclose(normal, c.normal[contact], atol=1e-6)
        )
        for part, sign in itertools.product((0, 1), (1, -1)):
            cost = np.zeros(A.shape[1])
            cost[2 * place + part] = sign
            found = linprog(cost, cones, np.zeros(len(cones)), A, load, (None, None))
            expected = sign * found.fun if found.status == 0 else -sign * np.inf
            assert (low if sign > 0 else high)[part] == pytest.approx(expected, abs=1e-6)
    floor = c.j >= 25
    assert heap.forces[floor, 0].sum() == pytest.approx(np.pi * np.sum(heap.r[:25] ** 2))
    assert heap.walls.tolist() == [[0, 0, heap.box[0], 0]] and np.isinf(heap.box[1])
    assert gf.pack(25, 0.3, seed=3, box="floor") == heap


def test_a_smooth_floor_bears_weight_but_no_friction():
    heap = gf.pack(25, 0.3, seed=3, box="smooth floor")
    S, floor = gf.ensemble(heap), heap.contacts.j >= 25
    exact = gf.intervals(S)
    assert gf.rest(heap).at_rest and heap.mu == 0.3
    assert (
        not exact.high[floor[exact.contacts], 1].any()
        and exact.high[~floor[exact.contacts], 1].any()
    )
    assert heap.forces[floor, 0].sum() == pytest.approx(np.pi * np.sum(heap.r[:25] ** 2))


def test_other_programs_take_and_give_layers_that_are_periodic_in_x(heap, tmp_path):
    gf.save_packing(heap, tmp_path / "heap.npz")
    assert gf.load_packing(tmp_path / "heap.npz").forces == pytest.approx(heap.forces)
    again = gf.from_disks(
        heap.x[:25], heap.r[:25], 0.3, box=heap.box, walls="floor", gravity=1, tolerance=1e-8
    )
    ours, own = (np.sort(gf.intervals(gf.ensemble(one)).high, axis=0) for one in (again, heap))
    assert ours == pytest.approx(own, abs=1e-5)
    c, inner = heap.contacts, heap.contacts.j < 25
    force = heap.forces[:, :1] * c.normal, heap.forces[:, 1:] * c.tangent
    bodies = "\n".join(
        f"{x} {y} 0 {r} {k}"
        for k, ((x, y), r) in enumerate(zip(heap.x[:25], heap.r[:25], strict=True))
    )
    links = "\n".join(
        " ".join(map(str, [i, min(j, 25), *n, 0, *t, 0]))
        for i, j, n, t in zip(c.i, c.j, *force, strict=True)
    )
    yade = gf.read_yade(
        io.StringIO("#format x_y_z_r_attrs\n# b.id\n" + bodies), io.StringIO(links), 0.3,
        box=heap.box, walls="held",
    )  # fmt: skip
    assert len(yade.contacts.i) == len(c.i) and yade.info["residual"] < 1e-6
    gf.save_lammps(heap, tmp_path / "a.dump", tmp_path / "b.dump")
    assert "pp ff pp" in (tmp_path / "a.dump").read_text()
    read = gf.read_lammps(tmp_path / "a.dump", tmp_path / "b.dump", mu=0.3)
    assert read.box.tolist() == heap.box.tolist() and read.info["residual"] < 1e-6
    assert inner.sum() < len(read.contacts.i) == len(c.i)
    rows = [f"25 0 0 0 0 {heap.box[0]} 99 0"]
    rows += [
        f"{x} {y} 0 0 0 0 {r} 0 0 0 0 0 0 0"
        for (x, y), r in zip(heap.x[:25], heap.r[:25], strict=True)
    ]
    stat = ["# 0 1 2", "# info", "# info"]
    for i, j, normal, (f_n, f_t) in zip(c.i, c.j, c.normal, heap.forces, strict=True):
        t = -np.sign(f_t or 1.0) * np.array([-normal[1], normal[0]])
        row = [0, i, j if j < 25 else -1, 0, 0, 0, 0, 0, f_n, abs(f_t), *-normal, 0, *t, 0]
        stat.append(" ".join(map(str, row)))
    mercury = gf.read_mercury(
        io.StringIO("\n".join([*rows, ""])), io.StringIO("\n".join([*stat, ""])), 0.3,
        box=heap.box, walls="held",
    )  # fmt: skip
    assert len(mercury.contacts.i) == len(c.i) and mercury.info["residual"] < 1e-6


def test_clumps_are_the_bodies_that_blocks_make():
    top = 1 + np.sqrt(4 - 0.6**2)
    x = [(0, 1), (1.2, 1), (0.6, top)]
    clumps = gf.from_disks(x, np.ones(3), 0.5, clumps=["a", "a", "b"], walls="floor", gravity=1)
    bodies = [[[*x[0], 1], [*x[1], 1]], [*x[2], 1], rectangle(-5, -1, 5, 0)]
    blocks = gf.blocks(bodies, 0.5, fixed=[2])
    assert clumps.forces == pytest.approx(blocks.forces) and gf.rest(clumps).at_rest
    one, two = (gf.intervals(gf.ensemble(packing)) for packing in (clumps, blocks))
    assert one.high == pytest.approx(two.high) and one.low == pytest.approx(two.low)
    assert clumps.shapes.inertia[:2] == pytest.approx(blocks.shapes.inertia[:2])
    assert clumps._repr_svg_().count("<polygon") == 2
    # Across the side of the box: a pair of disks and its image carry a third.
    across = gf.from_disks(
        [(-0.6, 1), (0.6, 1), (2.4, 1 + np.sqrt(4 - 1.8**2))],
        np.ones(3), 0.9, clumps=[4, 4, 7], box=[4.8, OPEN], walls="floor", gravity=1,
    )  # fmt: skip
    assert across.x[0] == pytest.approx([0, 1])
    assert np.abs(across.contacts.normal[across.contacts.j == 1, 0]) == pytest.approx([0.9, 0.9])


def test_clumps_are_read_from_a_column_of_labels():
    x, r = [(0, 1), (1.2, 1), (0.6, 1 + np.sqrt(4 - 0.6**2))], np.ones(3)
    options = {"mu": 0.5, "walls": "floor", "gravity": 1}
    rows = "".join(f"{a},{b},1,{label}\n" for (a, b), label in zip(x, "ccb", strict=True))
    with pytest.warns(gf.InputWarning, match="parts of bodies 1 overlap") as told:
        read = gf.read_table(io.StringIO("x,y,r,body\n" + rows), **options)
        made = gf.from_disks(x, r, clumps=list("ccb"), **options)
    assert read == made and len(told) == 2
    with pytest.raises(gf.InputError, match="leave out contacts, forces, loads"):
        gf.read_table(io.StringIO("x,y,r,body,fx\n0,1,1,a,0\n"), **options)


def one_disk(**options):
    return gf.from_disks([(1, 1)], [1], 0.5, **options)


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda: one_disk(box=[4, OPEN], walls="box", gravity=1), "only wall"),
        (lambda: one_disk(box=[4, 9], walls="floor", gravity=1), "open in y"),
        (lambda: one_disk(box=[4, OPEN], walls="floor"), "add gravity"),
        (lambda: one_disk(clumps=[1, 2], walls="floor", gravity=1), "1 labels"),
        (lambda: one_disk(clumps=[1], box=[4, 4]), "clumps need walls"),
        (lambda: gf.pack(9, 0.5, box="floor", pressure=2.0), "no use for pressure"),
        (lambda: gf.pack(9, 0.5, box="floor", dt=0.01), "no use for dt"),
        (lambda: gf.pack(9, 0.5, box="floor", max_steps=9), "no use for max_steps"),
        (lambda: gf.pack(9, 0.0, box="floor"), "friction coefficient above"),
    ],
)  # fmt: skip
def test_what_is_no_floor_is_refused(call, words):
    with pytest.raises(gf.InputError, match=words) as refused:
        call()
    assert "\n" not in str(refused.value)
