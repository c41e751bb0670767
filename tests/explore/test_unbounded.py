"""Bounds and limit loads of packings whose grains can be wedged: finite where they exist."""

import json

import numpy as np
import pytest
from packings import REFERENCE
from scipy import optimize

import granforce as gf
from granforce.cli.entry_point import main
from granforce.explore.intervals import limit_load_bounds
from granforce.forces.contact_problem import make_system
from granforce.numerics import certificates
from granforce.records import InputError, UnboundedError
from granforce.tolerances import INTERVAL_GAP

FRICTION = [0.0, 0.1, 0.5, 1.5, 10.0]


def heap(mu=0.5):
    """Twelve disks on a floor between two walls, five of them in the lowest row."""
    rise = np.sqrt(3) / 2
    x = [(k + 0.5 + row / 2, 0.5 + row * rise) for row in range(3) for k in range(5 - row)]
    return gf.from_disks(np.array(x), np.full(12, 0.5), mu, walls="box", gravity=1.0)


def wall_rows(S):
    """Rows G (k, unknowns) with G x ≤ 0 in the cones."""
    rows = []
    for contact, mu in enumerate(S.friction):
        for sign in (1.0, -1.0) if S.per_contact == 2 else (0.0,):
            row = np.zeros(S.A.shape[1])
            row[S.per_contact * contact] = -mu if sign else -1.0
            if sign:
                row[S.per_contact * contact + 1] = sign
            rows.append(row)
    return np.array(rows)


def least(S, cost, columns=None, box=None):
    """The minimum of cost·x over S by another formulation and another front end; −inf without."""
    A, walls = S.A.toarray(), wall_rows(S)
    if columns is not None:
        A, walls = np.column_stack([A, columns]), np.column_stack([walls, np.zeros(len(walls))])
    sides = [(None, None)] * A.shape[1] if box is None else box
    found = optimize.linprog(cost, walls, np.zeros(len(walls)), A, S.b, sides, method="highs")
    assert found.status in (0, 3)
    return found.fun if found.status == 0 else -np.inf


@pytest.mark.parametrize("mu", FRICTION)
def test_every_bound_is_that_of_another_program(mu):
    S = gf.ensemble(heap(), mu)
    exact = gf.intervals(S)
    assert exact.converged and exact.max_gap <= INTERVAL_GAP
    assert np.isinf(exact.high).any()
    for contact in range(len(S.index)):
        for part in range(S.per_contact):
            unit = np.zeros(S.A.shape[1])
            unit[S.per_contact * contact + part] = 1.0
            expected = least(S, unit), -least(S, -unit)
            given = exact.low[contact, part], exact.high[contact, part]
            assert given == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("mu", FRICTION)
def test_every_limit_load_is_that_of_another_program(mu):
    S = gf.ensemble(heap(), mu)
    loads = limit_load_bounds(S)
    assert loads.converged and loads.max_gap <= INTERVAL_GAP
    cost = -np.eye(S.A.shape[1] + 1)[-1]
    for contact, load in enumerate(loads.load):
        pair = S.A[:, [S.per_contact * contact]].toarray()
        assert load == pytest.approx(-least(S, cost, pair), abs=1e-7)
    # Whatever is wedged holds any pair, and at the paper's friction the rest does not.
    assert np.isinf(loads.load).sum() == {0.0: 6, 0.1: 6, 0.5: 6, 1.5: 11, 10.0: 30}[mu]


def test_some_contacts_alone_have_the_same_bounds():
    S = gf.ensemble(heap())
    every, some = gf.intervals(S), gf.intervals(S, [4, 3, 1])
    np.testing.assert_allclose(some.high, every.high[[4, 3, 1]], atol=2 * INTERVAL_GAP)
    assert some.bounded.tolist() == [False, True, False]
    assert np.isfinite(gf.intervals(S, [3]).high).all()


def test_known_forces_bound_what_they_touch():
    S = gf.ensemble(heap(0.0))
    assert np.isinf(gf.intervals(S).high[:, 0]).sum() == 6
    # Without friction one bound ends the growth of the whole lowest row.
    assert gf.intervals(gf.ensemble(S.packing, known=gf.Known([1], [0, 0], [9.0, 0]))).bounded.all()
    # A lower bound does not.
    pressed = gf.ensemble(S.packing, known=gf.Known([1], [2.0, -np.inf], [np.inf, np.inf]))
    exact = gf.intervals(pressed)
    assert exact.converged and np.isinf(exact.high[:, 0]).sum() == 6
    assert exact.low[exact.contacts == 1, 0] == pytest.approx(2.0, abs=1e-7)


def test_what_grows_is_proved_both_ways():
    A, _, _ = gf.ensemble(heap(1.5)).scaled_form
    found = certificates.growing(A)
    ray, weight = found.rays[0], A.T @ found.rows
    assert ray.min() >= 0 and np.abs(A @ ray).max() <= 1e-13
    assert np.array_equal(ray > 0, found.mask) and 0 < found.mask.sum() < len(ray)
    assert weight[~found.mask].min() > 0.5
    assert np.abs(weight[found.mask]).max() <= 1e-12 * np.abs(found.rows).max()


def test_a_false_ray_and_false_multipliers_prove_nothing(monkeypatch):
    A, _, _ = gf.ensemble(heap(1.5)).scaled_form
    true = list(certificates.widest(A))
    wide = np.ones(A.shape[1])
    for d, rows in ((wide, true[0][1]), (true[0][0], np.zeros(A.shape[0]))):
        monkeypatch.setattr(certificates, "widest", lambda A, d=d, rows=rows: [(d, rows)])
        assert certificates.growing(A) is None


def test_nothing_grows_in_a_bounded_set():
    S = gf.ensemble(gf.scene("groove", 0.3))
    assert certificates.growing(S.scaled_form[0]) is None
    assert make_system(S).grows is None


def test_what_needs_a_bounded_set_still_refuses():
    S = gf.ensemble(heap())
    gf.intervals(S)
    for refused in (gf.sample_uniform, gf.volume, gf.informative):
        with pytest.raises(UnboundedError, match=r"Grains 0, 1, 2, 3, 4 .* are wedged"):
            refused(S)


def test_loads_move_what_is_not_wedged():
    S = gf.ensemble(heap())
    limit = gf.limit_loads(S, [0])[0]
    found = gf.critical_force(S, 0)
    assert found.converged and 0 < found.low <= limit + INTERVAL_GAP
    with pytest.raises(InputError, match="grains of contacts 1, 4: other contacts can balance any"):
        gf.critical_forces(S, [0, 1, 4])
    # A disk at the top rolls over its right neighbour: a force on it alone carries nothing across,
    # so it points along the line of centres, 30° from the vertical.
    factor = gf.load_factor(S)
    assert factor.gap <= INTERVAL_GAP
    assert factor.factor == pytest.approx(np.tan(np.radians(30)), abs=1e-7)


def test_the_command_reports_what_is_bounded_and_how_much_is_not(tmp_path, capsys):
    file, table = tmp_path / "heap.npz", tmp_path / "bounds.csv"
    gf.save_packing(heap(), file)
    run = ["intervals", str(file), "--cache", str(tmp_path / "store"), "--json"]
    assert main([*run, "--out", str(table)]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["exact_eta3"] is None
    assert report["contacts_with_unbounded_f_n"] == 6
    assert report["contacts_with_unbounded_f_t"] == 0
    rows = np.genfromtxt(table, delimiter=",", names=True, deletechars="")
    extent = rows["f_n_high_[packing]"] - rows["f_n_low_[packing]"]
    assert np.isinf(extent).sum() == 6
    mean = extent[np.isfinite(extent)].mean()
    assert report["mean_extent_of_f_n [packing]"] == pytest.approx(mean)
    assert main(["limit-loads", *run[1:]]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["contacts_without_a_limit"] == 6
    assert 0 < report["mean_limit_load [packing]"] < report["largest_limit_load [packing]"]


def test_a_picture_of_the_intervals_is_drawn(tmp_path):
    gf.figures.save(gf.plot(heap(), colour="interval", backend="matplotlib"), tmp_path / "heap.png")
    assert (tmp_path / "heap.png").stat().st_size > 1e4


def test_a_walk_says_that_its_measures_mean_nothing(tmp_path, capsys):
    with pytest.warns(UserWarning, match="S is unbounded, .* η1, η2 and η3 are undefined"):
        states = gf.walk(gf.ensemble(heap()), 5).states
    assert gf.ensemble(heap()).admits(states).all()
    file = tmp_path / "heap.npz"
    gf.save_packing(heap(), file)
    options = [str(file), "--states", "5", "--cache", str(tmp_path / "store"), "--json"]
    for cached in (False, True):  # once from the walk, once from the store
        assert main(["walk", *options]) == 0
        captured = capsys.readouterr()
        report = json.loads(captured.out)
        assert report["cached"] is cached and report["eta1"] is None
        assert captured.err.count("S is unbounded") == 1
    assert main(["measure", *options]) == 2
    captured = capsys.readouterr()
    assert not captured.out and "nothing to measure" in captured.err


def test_error_bars_of_what_nothing_bounds_have_the_size_of_a_usual_force(tmp_path, capsys):
    packing = heap()
    S = gf.ensemble(packing)
    measured = S.original.copy()
    wedged = ~gf.intervals(S).bounded
    measured[wedged] = np.nan
    sigma = 0.1 * S.force_scale
    for estimate in (gf.infer, gf.remeasured):
        usual = estimate(S, measured, sigma, states=40)
        np.testing.assert_array_equal(
            usual.error, estimate(S, measured, sigma, states=40, unmeasured=1).error
        )
        assert usual.error[wedged, 0].mean() < 3 * S.force_scale
        wide = estimate(S, measured, sigma, states=40, unmeasured=1000)
        assert wide.error[wedged, 0].mean() > 20 * usual.error[wedged, 0].mean()
    file, table = tmp_path / "heap.npz", tmp_path / "heap.csv"
    gf.save_packing(packing, file)
    columns = np.column_stack([S.index, measured, np.full((len(S.index), 2), sigma)])
    header = "contact,f_n,f_t,sigma_n,sigma_t"
    np.savetxt(table, columns[~wedged], delimiter=",", header=header, comments="", fmt="%.17g")
    run = ["infer", str(file), "--measured", str(table), "--states", "40", "--json"]
    for given, spread in ([], 1), (["--unmeasured", "2"], 2):
        assert main([*run, *given, "--cache", str(tmp_path / "store")]) == 0
        captured = capsys.readouterr()
        assert json.loads(captured.out)["unmeasured_spread"] == spread
        assert captured.err.count("S is unbounded") == 1
        assert f"--unmeasured, which is {spread} ⟨f_n⟩" in captured.err


def test_where_everything_is_bounded_unmeasured_forces_may_be_any():
    S = gf.ensemble(gf.scene("groove", 0.3))
    assert S.bounded
    none = np.full_like(S.original, np.nan)
    usual = gf.infer(S, none, 1.0, states=20)
    np.testing.assert_array_equal(
        usual.error, gf.infer(S, none, 1.0, states=20, unmeasured=1000).error
    )


def test_bounds_that_only_enormous_forces_attain_are_left_out_by_name(tmp_path, capsys):
    """A pile at a μ just below which more contacts wedge: all other bounds are certified."""
    pile = gf.read_table(REFERENCE / "pile.csv", mu=1.2, walls="box", gravity=1)
    S = gf.ensemble(pile)
    found = gf.intervals(S)
    left = np.isnan(found.low).any(axis=1) | np.isnan(found.high).any(axis=1)
    assert not found.converged and 0 < left.sum() < 15 and found.max_gap <= 1e-8
    file, table = tmp_path / "pile.npz", tmp_path / "bounds.csv"
    gf.save_packing(pile, file)
    run = [str(file), "--cache", str(tmp_path / "store"), "--out", str(table), "--json"]
    for cached in (False, True):
        assert main(["intervals", *run]) == 0
        captured = capsys.readouterr()
        report = json.loads(captured.out)
        assert report["contacts_not_certified"] == left.sum() and report["cached"] is cached
        assert f"{left.sum()} contacts have values that could not be certified" in captured.err
        assert f": {found.contacts[left][0]}, " in captured.err
        rows = table.read_text().splitlines()[1:]
        assert ["nan" in row for row in rows] == left.tolist()
        # Not certified is not determined.
        assert all(int(row.split(",")[-1]) >= 0 for row in np.array(rows)[left])
    assert main(["limit-loads", *run[:3], "--json"]) == 0
