"""Bodies of any shape: their contacts, closed forms for S, files, and what is refused."""

import io
import json

import numpy as np
import pytest
from scipy.optimize import linprog

import granforce as gf
from granforce.cli.entry_point import main
from granforce.packing.assemblies import with_network
from granforce.packing.masonry import rectangle
from granforce.study.kinds import imported_parameters
from granforce.study.schema import dataset_packing, packing_dataset

GROUND = rectangle(-3, -1, 3, 0)


def stands(name, *arguments, **options):
    try:
        gf.scene(name, *arguments, **options)
    except gf.NotJammedError:
        return False
    return True


@pytest.mark.parametrize("mu, width", [(0.5, 1.0), (0.9, 0.6), (0.3, 2.0)])
def test_a_block_rests_on_a_slope_up_to_friction_or_to_its_width(mu, width):
    most = np.degrees(np.arctan(min(mu, width)))
    assert stands("slope", mu, angle=most - 1e-5, width=width)
    assert not stands("slope", mu, angle=most + 1e-5, width=width)


@pytest.mark.parametrize("count", [1, 4, 12])
def test_books_overhang_by_half_the_harmonic_sum(count):
    packing = gf.scene("books", books=count, overhang=1 - 1e-6)
    reach = packing.shapes.polygons()[0][:, 0].max()
    assert reach == pytest.approx(0.5 * np.sum(1 / np.arange(1, count + 1)), rel=2e-6)
    assert not stands("books", books=count, overhang=1 + 1e-6)


@pytest.mark.parametrize("mu, angle", [(0.4, 60.0), (0.3, 70.0), (0.6, 45.0), (0.35, 59.0)])
def test_s_of_a_ladder_has_both_ends_of_the_textbook(mu, angle):
    """F: the upward friction of the wall; N = (W/2 − F) cot θ is its pressure, W − F the floor's.

    |F| ≤ μ N, and N ≤ μ (W − F) on the floor.
    """
    S = gf.ensemble(gf.scene("ladder", mu, angle=angle))
    flat = 1 / np.tan(np.radians(angle))
    high = mu * flat / 2 / (1 + mu * flat)
    low = -mu * flat / 2 / (1 - mu * flat) if mu * flat < 1 else -np.inf
    if flat > mu:
        low = max(low, (flat / 2 - mu) / (flat - mu))
    bounds = gf.intervals(S)
    assert S.dimension == 1 and bounds.converged
    pressure = [(0.5 - end) * flat for end in (high, low)]
    floor, wall = (int(np.argmax(np.abs(S.contacts.normal[:, k]))) for k in (1, 0))
    assert np.allclose([bounds.low[wall, 0], bounds.high[wall, 0]], pressure, atol=1e-9)
    assert np.allclose([bounds.low[floor, 0], bounds.high[floor, 0]], [1 - high, 1 - low])


def test_an_arch_needs_the_thickness_of_milankovitch():
    """0.1075 of the mean radius, as voussoirs become many."""
    for thickness, standing in ((0.1073, False), (0.1077, True)):
        assert stands("arch", 0.8, voussoirs=80, thickness=thickness) is standing


def test_edges_touch_at_both_ends_of_what_they_share_and_corners_at_one_point():
    turned = np.array([[0, 0], [1, 1], [0, 2], [-1, 1]]) / 2 + [2.2, 0]
    bodies = [rectangle(0, 0, 1, 1), rectangle(0.4, 1, 2, 2), turned, [-0.5, 0.5, 0.5], GROUND]
    packing = gf.blocks(bodies, 0.5, fixed=[4], balanced=False)
    at = {}
    for c, point in enumerate(packing.contact_points):
        pair = int(packing.contacts.i[c]), int(packing.contacts.j[c])
        at.setdefault(pair, []).append([*point, *packing.contacts.normal[c]])
    assert np.allclose(sorted(at.pop((0, 1))), [[0.4, 1, 0, 1], [1, 1, 0, 1]])
    assert np.allclose(sorted(at.pop((0, 4))), [[0, 0, 0, -1], [1, 0, 0, -1]])
    assert np.allclose(at.pop((2, 4)), [[2.2, 0, 0, -1]])
    assert np.allclose(at.pop((3, 4)), [[-0.5, 0, 0, -1]])
    assert np.allclose(at.pop((0, 3)), [[0, 0.5, -1, 0]])
    assert not at


def test_a_contact_given_twice_is_refused_unless_its_places_differ():
    x, r = [[0, 1], [0, -1]], [1.5, 1.5]

    def made(places):
        points = np.column_stack([places, np.zeros(len(places))])
        pairs, down = np.zeros((2, len(places)), dtype=int), np.tile([0.0, -1.0], (len(places), 1))
        contacts = gf.make_contacts_at(pairs[0], pairs[1] + 1, points, down, x)
        forces = np.zeros((len(places), 2))
        return gf.make_packing(x, r, [np.inf, np.inf], contacts, forces, 0.5)

    assert len(made([-1.0, 1.0]).contacts.i) == 2
    with pytest.raises(gf.InputError, match="contacts 0 and 2 are the same"):
        made([-1.0, 1.0, -1.0])


def test_doubtful_pairs_are_named():
    bodies = [rectangle(0, 0, 1, 1), rectangle(1, 1, 2, 2), rectangle(1.00003, 0, 2, 0.5), GROUND]
    packing = gf.blocks(bodies, 0.5, fixed=[3], tolerance=1e-6, balanced=False)
    assert packing.info["corner_on_corner"] == [[0, 1]]
    ((i, j, gap),) = packing.info["nearly_touching"]
    assert (i, j) == (0, 2) and gap == pytest.approx(3e-5)
    closer = gf.blocks(bodies, 0.5, fixed=[3], tolerance=1e-4, balanced=False)
    assert len(closer.contacts.i) == len(packing.contacts.i) + 2
    assert closer.contacts.gap.max() == pytest.approx(3e-5)


def random_assembly(rng):
    """Boxes, leaning or upright, and disks: each near the middle of one in the layer below."""
    kept, middles, low = [], np.arange(-2.0, 2.5), 0.0
    for _ in range(rng.integers(1, 4)):
        height, above = rng.uniform(0.3, 0.8), []
        for middle in rng.permutation(middles)[: rng.integers(1, 7)]:
            width, x = rng.uniform(0.3, 1.0), middle + rng.uniform(-0.2, 0.2)
            body = rectangle(x - width / 2, low, x + width / 2, low + height)
            if rng.random() < 0.15:
                body = [x, low + height / 2, height / 2]
            elif rng.random() < 0.5:
                body[2:, 0] += rng.uniform(-0.2, 0.2)
            try:
                gf.blocks([*kept, body, GROUND], 0.5, fixed=[len(kept) + 1], balanced=False)
            except gf.InputError:  # it overlaps another
                continue
            kept.append(body)
            above.append(x)
        middles, low = np.array(above), low + height
    mu = float(rng.uniform(0.1, 0.9))
    made = gf.blocks([*kept, GROUND], mu, fixed=[len(kept)], balanced=False)
    # A disk that rests on one point rolls under any of it.
    made.load[made.shapes.sides > 0, 0] = (
        rng.uniform(-0.15, 0.15) * made.load[made.shapes.sides > 0, 1]
    )
    if rng.random() < 0.5:  # each contact with its own friction, some without any
        ratio = rng.choice([0.0, 0.4, 1.0], len(made.contacts.i), p=[0.1, 0.3, 0.6])
        made = made._replace(contacts=made.contacts._replace(friction_ratio=ratio))
    return made


def own_program(packing, load=None):
    """Rows and right-hand side of the balance in f_n, f_t, from points and normals alone."""
    moving = np.flatnonzero(~np.isnan(packing.load[:, 0]))
    rows = {int(body): 3 * k for k, body in enumerate(moving)}
    A = np.zeros((3 * len(moving), 2 * len(packing.contacts.i)))
    for c, point in enumerate(packing.contact_points):
        n = packing.contacts.normal[c]
        for body, sign in ((packing.contacts.i[c], -1), (packing.contacts.j[c], 1)):
            if int(body) not in rows:
                continue
            arm = point - packing.x[body]
            for part, way in enumerate((n, np.array([-n[1], n[0]]))):
                force = sign * way
                torque = arm[0] * force[1] - arm[1] * force[0]
                A[rows[int(body)] : rows[int(body)] + 3, 2 * c + part] = [*force, torque]
    count, mu = len(packing.contacts.i), packing.contacts.friction(packing.mu)
    cones = np.zeros((2 * count, 2 * count))
    for c in range(count):
        cones[2 * c : 2 * c + 2, 2 * c] = -mu[c]
        cones[2 * c : 2 * c + 2, 2 * c + 1] = 1, -1
    return A, -(packing.load if load is None else load)[moving].ravel(), cones


def check_against_linprog(seed):
    """Whether the assembly of this seed stands, as linprog says; so are bounds and limit load."""
    rng = np.random.default_rng(seed)
    packing = random_assembly(rng)
    A, b, cones = own_program(packing)
    free = [(0, None), (None, None)] * len(packing.contacts.i)

    def least(cost):  # of what A, cones and free are now
        return linprog(cost, cones, np.zeros(len(cones)), A, b, free, method="highs")

    try:
        S = gf.ensemble(packing)
    except gf.NotJammedError:
        assert least(np.zeros(A.shape[1])).status == 2
        return False
    k = int(rng.integers(len(S.index)))
    bounds = gf.intervals(S, [S.index[k]])
    for part in (0, 1):
        cost = np.zeros(A.shape[1])
        cost[2 * S.index[k] + part] = 1.0
        for sign, value in ((1, bounds.low), (-1, bounds.high)):
            found = least(sign * cost)
            scale = S.force_scale
            assert sign * found.fun == pytest.approx(value[0, part], abs=1e-6 * scale)
    turned = np.zeros_like(packing.load)
    turned[:, 0] = -np.nan_to_num(packing.load[:, 1])
    A = np.column_stack([A, -own_program(packing, turned)[1]])
    cones, free = np.pad(cones, [(0, 0), (0, 1)]), [*free, (0, None)]
    found = least(-np.eye(A.shape[1])[-1])
    limit = gf.load_factor(S)
    assert limit.factor == (np.inf if found.status == 3 else pytest.approx(-found.fun, abs=1e-7))
    if found.status == 0 and seed % 4 == 0:
        critical = gf.critical_load(S)
        assert critical.low <= limit.factor and critical.residual <= 1e-10
    return True


def test_bounds_and_limit_loads_of_random_assemblies_agree_with_linprog():
    stood = [check_against_linprog(seed) for seed in range(60)]
    assert 20 < sum(stood) < 58


def work_of(packing, forces):
    """The most that weights do beyond friction at these normal forces, by linprog, for |u| ≤ 1."""
    A, b, _ = own_program(packing)
    friction = packing.contacts.friction(packing.mu) * forces[:, 0]
    opening, sliding = A[:, ::2].T, A[:, 1::2].T
    slip, none = np.eye(len(friction)), np.zeros((len(friction),) * 2)
    rows = np.block([[-opening, none], [sliding, -slip], [-sliding, -slip]])
    bounds = [(-1, 1)] * len(b) + [(0, None)] * len(friction)
    return -linprog(np.append(b, friction), rows, np.zeros(len(rows)), bounds=bounds).fun


def test_nothing_at_rest_can_lose_height_and_what_falls_does():
    stood = 0
    for seed in range(16):
        packing = random_assembly(np.random.default_rng(seed))
        A, b, _ = own_program(packing)
        fall = gf.fall(packing)
        if fall is None:
            S = gf.ensemble(packing)
            certificate = gf.rest(gf.ensemble(with_network(packing)))
            states = S.expand(gf.sample_uniform(S, 2, seed=1).states)
            networks = [certificate.forces, *states.reshape(-1, *packing.forces.shape)]
            assert certificate.at_rest
            assert max(work_of(packing, one) for one in networks) < 1e-8 * np.abs(b).max()
            stood += 1
            continue
        fall[:, 2] /= packing.r
        u = fall[~np.isnan(packing.load[:, 0])].ravel()
        opening, sliding = (A.T @ u).reshape(-1, 2).T
        least = packing.contacts.friction(packing.mu) * np.abs(sliding)
        assert np.all(opening >= least - 1e-9) and -b @ u > 1e-6
    assert 4 < stood < 14


@pytest.mark.parametrize("mu, width", [(0.5, 1.0), (0.9, 0.6)])
def test_motion_at_the_critical_load_loses_what_friction_takes(mu, width):
    """Of the work of weight and load, sliding dissipates all and tipping nothing."""
    S = gf.ensemble(gf.scene("slope", mu, angle=15, width=width))
    found, packing, turn = gf.critical_load(S, precision=1e-4), S.packing, np.radians(15)
    weight, u = -packing.load[0, 1], found.displacement[0]
    gained = weight * (found.high * u[0] - u[1])
    along, across = u @ [np.cos(turn), np.sin(turn)], u @ [-np.sin(turn), np.cos(turn)]
    if mu < width:
        assert across == pytest.approx(0.0, abs=1e-3)
        pressure = weight * (np.cos(turn) + found.high * np.sin(turn))
        assert gained == pytest.approx(mu * pressure * along, rel=2e-3)
    else:
        assert (along, across) == pytest.approx(np.array([1, width]) / np.hypot(1, width), abs=1e-3)
        assert gained == pytest.approx(0.0, abs=2e-3)


def test_a_ladder_on_a_smooth_wall_has_the_one_network_of_the_textbook():
    """N = (W/2) cot θ, which the floor must hold by friction: cot θ ≤ 2 μ."""
    packing = gf.scene("ladder", 0.5, angle=60)
    at_wall = np.abs(packing.contacts.normal[:, 0]) > 0.5
    S = gf.ensemble(packing, np.where(at_wall, 0.0, 0.5))
    pressure = 0.5 / np.tan(np.radians(60))
    assert S.dimension == 0 and gf.body(S).corners.shape == (1, 0)
    bounds = gf.intervals(S)
    assert np.allclose(bounds.low, bounds.high)
    assert np.allclose(bounds.low[at_wall], [[pressure, 0]])
    elsewhere = gf.rest(S)  # the scene's own forces need friction at the wall
    assert not elsewhere.at_rest and "no network" in elsewhere.reason
    alone = packing._replace(forces=elsewhere.forces)
    assert gf.rest(gf.ensemble(alone, np.where(at_wall, 0.0, 0.5))).at_rest
    with pytest.raises(gf.NotJammedError):
        gf.ensemble(packing, np.where(at_wall, 0.0, 0.999 * pressure))


def test_friction_of_pairs_of_materials_in_arrays_and_files():
    """A crate on a plank that lies on ice: either may slide first."""
    ice, plank, crate = GROUND, rectangle(0, 0, 2, 0.1), rectangle(0.5, 0.1, 1.5, 1.1)
    for of_crate, of_plank, expected in ((0.1, 0.3, 0.1), (0.3, 0.2, 0.2)):
        pairs = {("wood", "steel"): of_crate, ("wood", "ice"): of_plank}
        materials = ["steel", "wood", "ice"]
        packing = gf.blocks(
            [crate, plank, ice], 0.9, fixed=[2], materials=materials, friction=pairs
        )
        assert gf.load_factor(gf.ensemble(packing)).factor == pytest.approx(expected)
        assert gf.load_factor(gf.ensemble(packing, 0.5 * packing.mu)).factor == pytest.approx(
            0.5 * expected
        )
        bodies = [
            {"corners": body.tolist(), "material": material, "fixed": material == "ice"}
            for body, material in zip([crate, plank, ice], materials, strict=True)
        ]
        text = json.dumps({"bodies": bodies, "friction": [[*k, v] for k, v in pairs.items()]})
        again = gf.read_blocks(io.StringIO(text), mu=0.9)
        assert np.array_equal(
            again.contacts.friction(again.mu), packing.contacts.friction(packing.mu)
        )


def test_disks_take_a_friction_for_each_contact():
    packing = gf.scene("pyramid")
    count = len(packing.contacts.i)
    S, same = gf.ensemble(packing, 0.9), gf.ensemble(packing, np.full(count, 0.9))
    assert np.array_equal(gf.intervals(S).high, gf.intervals(same).high)
    ratio = np.where(np.arange(count) % 2, 1.0, 0.5)
    mixed = gf.ensemble(packing, 0.9 * ratio)
    states = gf.sample_uniform(mixed, 50, seed=0).states
    limit = 0.9 * ratio[mixed.index] * states[..., 0]
    assert np.all(np.abs(states[..., 1]) <= limit + 1e-9) and np.all(S.admits(states))
    with pytest.raises(gf.InputError, match="one μ only"):
        gf.walk(mixed, 2, relax=gf.gauss_seidel)


@pytest.mark.stress
def test_those_of_many_random_assemblies_agree_with_linprog():
    stood = [check_against_linprog(seed) for seed in range(60, 400)]
    assert 110 < sum(stood) < 320


def test_every_view_of_s_takes_bodies():
    packing = gf.scene("arch", voussoirs=5, thickness=0.3)
    S = gf.ensemble(packing)
    for states in (gf.walk(S, 5, seed=1).states, gf.sample_uniform(S, 5, seed=1).states):
        assert np.all(S.admits(states))
    where = gf.reach(S, int(S.index[0]))
    assert where is not None and np.isfinite(gf.volume(S, seed=0).log_volume)
    assert gf.rest(packing).at_rest
    critical = gf.critical_force(S, int(S.index[2]))
    assert critical.low <= critical.limit_load
    assert gf.body(gf.ensemble(gf.scene("ladder"))).corners.shape == (2, 1)


def test_bodies_without_friction_need_their_torques():
    packing = gf.blocks([rectangle(0, 0, 1, 1), GROUND], 0.0, fixed=[1])
    S = gf.ensemble(packing)
    assert S.dimension == 0 and np.allclose(S.original, [[0.5, 0], [0.5, 0]])
    assert gf.intervals(S).converged


def test_files_and_stores_carry_shapes(tmp_path):
    bodies = [rectangle(0, 0, 1, 1), [1.5, 0.5, 0.5], GROUND]
    packing = gf.blocks(bodies, [0.5, 0.5, 0.1, 0.0], fixed=[2])
    gf.save_packing(packing, tmp_path / "blocks.npz")
    for again in (
        gf.load_packing(tmp_path / "blocks.npz"),
        dataset_packing(packing_dataset(packing)),
    ):
        assert imported_parameters(again) == imported_parameters(packing)
        assert all(np.array_equal(a, b) for a, b in zip(again.shapes, packing.shapes, strict=True))
        assert np.array_equal(again.contacts.friction_ratio, packing.contacts.friction_ratio)
        assert again.info == packing.info
    disks = gf.scene("pyramid")
    assert not {"levers", "mass", "friction_ratio"} & set(packing_dataset(disks))


def test_a_thin_wall_bears_on_both_sides_and_at_its_ends():
    crate, disk = rectangle(0, 0, 2, 1), [5, 0, 0.5]  # the disk is in line with the wall
    thin = gf.blocks([crate, disk, [[-1, 0], [3, 0]]], 0.5, fixed=[1, 2])
    thick = gf.blocks([crate, rectangle(-1, -1, 3, 0)], 0.5, fixed=[1])
    np.testing.assert_allclose(thin.contact_points, thick.contact_points, atol=1e-12)
    for end in range(2):
        bounds = [gf.intervals(gf.ensemble(packing))[end] for packing in (thin, thick)]
        np.testing.assert_allclose(*bounds, atol=1e-9)
    walls = [[[0.5, -1], [0.5, 0]], [[1.5, 0], [1.5, -1]], [[-1, 1], [3, 1]]]
    held = gf.blocks([crate, [3.5, 1, 0.5], *walls], 0.5, fixed=[1, 2, 3, 4])
    ends = [[0.5, 0], [1.5, 0], [0, 1], [2, 1]]
    assert sorted(np.round(held.contact_points, 12).tolist()) == sorted(ends)


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda: gf.blocks([], 0.5), "no bodies"),
        (lambda: gf.blocks([[[0, 0], [1, 0], [2, 0]]], 0.5), "body 0 needs three corners"),
        (lambda: gf.blocks([[[0, 0], [1, 0]]], 0.5), "only a fixed body can be a thin wall"),
        (lambda: gf.blocks([[[0, 0], [2, 0], [1, 0.5], [1, 2]]], 0.5), "not convex"),
        (lambda: gf.blocks([[0, 0, -1]], 0.5), "above 0"),
        (
            lambda: gf.blocks([rectangle(0, 0, 1, 1), rectangle(0.5, 0, 2, 1)], 0.5),
            "overlap by 0.5",
        ),
        (lambda: gf.blocks([rectangle(0, 0, 1, 1), GROUND], 0.5, fixed=[2]), "from 0 to 1"),
        (lambda: gf.blocks([GROUND], 0.5, weights=[0.0]), "weight ≤ 0"),
        (
            lambda: gf.blocks([GROUND], 0.5, materials=["a", "b"]),
            "material of each of the 1 bodies",
        ),
        (lambda: gf.blocks([GROUND], 0.5, friction={("a", "b"): 1}), "no body has this material"),
        (lambda: gf.ensemble(gf.scene("slope"), [0.5]), "friction coefficients must have shape"),
        (lambda: gf.walk(gf.ensemble(gf.scene("slope")), 2, relax=gf.gauss_seidel), "disks only"),
        (lambda: gf.margin(gf.scene("slope")), "disks only"),
        (lambda: gf.save_vtk(gf.scene("slope"), "a.vtp", "b.vtp"), "disks only"),
        (lambda: gf.ensemble(gf.scene("slope"), prescribed="stress"), "for disks only"),
        (lambda: gf.scene("arch", stones=3), "no option 'stones'"),
    ],
)
def test_what_cannot_be_an_assembly_is_refused(call, words):
    with pytest.raises(gf.InputError, match=words):
        call()


GIVEN = """{"bodies": [
  {"corners": [[-3, -1], [3, -1], [3, 0], [-3, 0]], "fixed": true},
  {"corners": [[0, 0], [1, 0], [1, 1], [0, 1]], "density": 2},
  {"disk": [0.5, 1.3, 0.3]}
]}"""
ROWS = """body,x,y,r,density,fixed
ground,-3,-1,0,1.5,1
ground,3,-1,0,1.5,1
ground,3,0,0,1.5,1
ground,-3,0,0,1.5,1
7,0,0,0,2,0
7,1,0,0,2,0
7,1,1,0,2,0
7,0,1,0,2,0
ball,0.5,1.3,0.3,1.5,0
"""


CROSSED = "7,1,0,0,2,0\n7,1,1,0,2,0", "7,1,1,0,2,0\n7,1,0,0,2,0"


def test_bodies_are_read_from_both_kinds_of_file_as_from_arrays():
    ground, square = np.array([[-3, -1], [3, -1], [3, 0], [-3, 0]]), rectangle(0, 0, 1, 1)
    weights = [1, 2, 1.5 * np.pi * 0.09]
    expected = gf.blocks([ground, square, [0.5, 1.3, 0.3]], 0.5, fixed=[0], weights=weights)
    for file in (
        gf.read_blocks(io.StringIO(GIVEN), mu=0.5, density=1.5),
        gf.read_blocks(io.StringIO(ROWS), mu=0.5),
        gf.read_blocks(io.StringIO(ROWS.replace("1.5,1\n", "1.5,Yes\n")), mu=0.5),
    ):
        assert file.load == pytest.approx(expected.load, nan_ok=True)
        assert file.contact_points == pytest.approx(expected.contact_points)
        assert file.forces == pytest.approx(expected.forces)
        assert file.info["source"] == "blocks" and "notes" not in file.info


@pytest.mark.parametrize(
    "text, options, words",
    [
        (ROWS, {"density": 3}, "density of every body: leave out --density"),
        (ROWS.replace("7,1,1,0,2,0", "7,1,1,0,3,0"), {}, "line 8: density differs within body 7"),
        (ROWS.replace("7,1,1,0,2,0", "7,1,1,0,2,2"), {}, "line 8: fixed is '2'; give 1 or 0"),
        (ROWS.replace("7,1,1,0,2", "7,1,1,0.2,2"), {}, "a disk is one row"),
        (ROWS.replace("body,", "stone,"), {}, "no column body"),
        (ROWS.replace("7,1,1,0", "7,0.5,0.2,0"), {}, "body 7 is not convex"),
        (ROWS.replace(*CROSSED), {}, "corners of body 7 are in the wrong order"),
        (ROWS.replace("ball,0.5,1.3", "ball,0.5,0.9"), {}, "bodies 7 and ball overlap by 0.4"),
        (
            ROWS.replace("ball,0.5,1.3", "ball,0.5,1.31"),
            {},
            r"gaps from 0\.011, .* 3e-09: a larger",
        ),
        (ROWS.replace("ball,0.5,1.3", "ball,0.5,1.9"), {}, "the bodies are 0 ground, 1 7, 2 ball"),
        (ROWS.replace(",2,0", ",-2,0"), {}, "the density of body 7"),
        (GIVEN.replace("corners", "corner"), {}, 'either "corners", "disk" or "parts"'),
        (GIVEN.replace("density", "mass"), {}, "body 1 has 'mass'"),
        (GIVEN.replace("true", "1"), {}, "fixed of body 0 must be true or false"),
        (GIVEN[:-1], {}, "not JSON"),
        ("[1, 2]", {}, "give an object"),
        (GIVEN.replace("0.3]", "null]"), {}, "body 2"),
        (GIVEN, {"density": 0}, "density must be"),
        (GIVEN.replace('"fixed"', '"material": 3, "fixed"'), {}, "a material is a text"),
        (GIVEN.replace("{", '{"friction": [["a", 0.3]], ', 1), {}, '"friction" is'),
    ],
)
def test_what_cannot_be_read_as_bodies_is_one_line(text, options, words):
    with pytest.raises(gf.InputError, match=words) as refused:
        gf.read_blocks(io.StringIO(text), mu=0.5, **options)
    assert "\n" not in str(refused.value)


def test_pairs_of_bodies_in_doubt_are_noted():
    near = GIVEN.replace("1.3", "1.30000001")
    assert gf.read_blocks(io.StringIO(GIVEN), mu=0.5, tolerance=1e-7).info["nearly_touching"] == []
    hangs = "1 pair of bodies nearly touches, with gaps from 1e-08, and no contact at .* 1e-09"
    with pytest.raises(gf.NotJammedError, match=hangs):
        gf.read_blocks(io.StringIO(near), mu=0.5, tolerance=1e-9)
    bodies = '{"corners": [[1, 1], [2, 1], [2, 2], [1, 2]], "fixed": true}, {"disk"'
    found = gf.read_blocks(io.StringIO(GIVEN.replace('{"disk"', bodies)), mu=0.5)
    assert found.info["notes"] == ["1 pair of bodies meets corner on corner, which is no contact"]


@pytest.mark.parametrize(
    "options, bodies", [("courses=2,blocks=3", 7), ("courses=3,blocks=2,height=0.1", 8)]
)
def test_scenes_take_their_options_on_the_command_line(options, bodies, capsys):
    assert main(["pack", "--scene", "wall", "--scene-options", options, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["grains"] == bodies


def test_options_that_a_scene_lacks_are_refused_with_those_it_has(capsys):
    for words, said in (
        (["--scene", "wall", "--scene-options", "course=2"], "courses, blocks, width, height"),
        (["--scene", "box", "--scene-options", "disks=2"], "it has no options"),
        (["--scene", "wall", "--scene-options", "courses=many"], "give NAME=NUMBER"),
        (["--scene", "wall", "--scene-options", "courses=2.5"], "whole number"),
    ):
        assert main(["pack", *words]) == 2
        assert said in capsys.readouterr().err


@pytest.mark.parametrize("column", ["material", "friction"])
def test_a_table_of_corners_with_materials_is_refused(column, tmp_path):
    table = tmp_path / "bodies.csv"
    table.write_text(f"body,x,y,{column}\na,0,0,1\na,1,0,1\na,0,1,1\n")
    with pytest.raises(gf.InputError, match=f"column {column}: .* as JSON"):
        gf.read_blocks(table, mu=0.3)
