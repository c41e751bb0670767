"""Photoelastic frames, made here from packings of known forces, with the flaws of real ones."""

import numpy as np
import pytest
from frames import NEWTON, file, frame

from granforce.experiment.infer import infer
from granforce.experiment.pegs import read_pegs
from granforce.forces.build import ensemble
from granforce.packing.importers import load_packing, save_packing
from granforce.records import InputError


def read(grains, rows, **options):
    return read_pegs(file(grains, "positions.txt"), file(rows, "adjacency.txt"), **options)


def by_pair(found, truth):
    """The true forces (N_c, 2) of an import's contacts, 0 for pairs that do not touch."""
    pairs = zip(found.packing.contacts.i.tolist(), found.packing.contacts.j.tolist(), strict=True)
    return np.array([truth.get(pair, np.zeros(2)) for pair in pairs])


def test_a_perfect_frame_is_taken_as_it_is():
    grains, rows, truth = frame()
    found = read(grains, rows, mu=0.3, error=0.1 * NEWTON)
    told = found.report
    assert told["unbalanced_on_listed_contacts"] == told["unbalanced"] == 0
    assert told["listed_twice"] == told["contacts_listed"] == len(rows) // 2
    assert told["grains_at_walls"] == sum(row[-1] for row in grains)
    assert not found.added[: len(rows) // 2].any() and found.added.sum() == told["candidates"]
    here = ~found.added
    assert np.abs(found.packing.forces - by_pair(found, truth))[here].max() < 1e-6 * NEWTON
    assert told["chi_square"] < 1e-9 and told["mean_change_of_f_n"] < 1e-6
    assert ensemble(found.packing).admits(found.packing.forces[ensemble(found.packing).index])


def test_missing_contacts_are_found_by_balance():
    """Radii known to 5 %, a tenth of the contacts missing: candidates carry what lacks."""
    grains, rows, truth = frame(missing=0.1, noise=0.05, blur=0.05)
    found = read(grains, rows, mu=0.3, reach=0.15)
    told = found.report
    assert told["unbalanced_on_listed_contacts"] > 10 > told["unbalanced"]
    true = by_pair(found, truth)
    carries = found.added & (found.packing.forces[:, 0] > 0.3 * NEWTON)
    assert np.mean(true[carries, 0] > 0) > 0.9
    before = np.nanmean(np.abs(found.measured - true))
    after = np.mean(np.abs(found.packing.forces - true)[~found.added])
    assert after < before
    assert np.allclose(told["chi_square"], told["freedom"], rtol=0.5)


def test_without_candidates_balance_is_left_open():
    grains, rows, _ = frame(missing=0.1)
    found = read(grains, rows, mu=0.3, reach=0)
    assert not found.added.any() and len(found.left_open) == found.report["unbalanced"] > 0
    assert np.isnan(found.packing.load[found.left_open]).all()
    S = ensemble(found.packing)
    assert not np.intersect1d(S.grains, found.left_open).size
    whole = ensemble(found.packing, prune=False)
    assert whole.admits(found.packing.forces)
    assert found.report["left_open"] == [10 * k + 3 for k in found.left_open]


@pytest.mark.parametrize("error", [0.1 * NEWTON, 0.001 * NEWTON])
def test_what_is_listed_twice_is_averaged_and_far_differences_count_as_errors(error):
    grains, rows, _ = frame(noise=0.2)
    found = read(grains, rows, mu=0.3, error=error, repair=False)
    assert found.report["listed_twice_with_other_forces"] == len(rows) // 2
    forward, backward = rows[0], rows[1]
    i, j = sorted(((forward[1] - 3) // 10, (forward[2] - 3) // 10))
    c = np.flatnonzero((found.packing.contacts.i == i) & (found.packing.contacts.j == j))[0]
    for part, column in ((0, 4), (1, 3)):
        mean, half = (
            (forward[column] + backward[column]) / 2,
            (forward[column] - backward[column]) / 2,
        )
        assert found.measured[c, part] == pytest.approx(mean)
        far = half if abs(half) > 3 * error else 0.0
        assert found.sigma[c, part] == pytest.approx(np.hypot(error, far))


def test_a_negative_id_is_a_wall():
    """Its grain need not balance, as if it had been flagged."""
    grains, rows, _ = frame()
    inner = next(k for k, row in enumerate(grains) if row[-1] == 0)
    found = read(grains, [*rows, [1, grains[inner][1], -1, 0.0, NEWTON]], mu=0.3)
    assert found.report["contacts_with_a_wall"] == 1
    assert np.isnan(found.packing.load[inner]).all()
    assert found.report["grains_at_walls"] == 1 + sum(row[-1] for row in grains)


def test_the_last_common_frame_is_read_or_the_one_that_is_named():
    one, two = frame(number=1), frame(number=2, missing=0.2)
    grains, rows = one[0] + two[0], one[1] + two[1]
    for options, lines in (({}, two[1]), ({"frame": 1}, one[1])):
        assert read(grains, rows, mu=0.3, **options).report["contacts_listed"] == len(lines) // 2
    with pytest.raises(InputError, match="frame 7"):
        read(grains, rows, mu=0.3, frame=7)


def test_tangential_forces_of_the_other_sign():
    grains, rows, _ = frame()
    turned = [[*row[:3], -row[3], row[4]] for row in rows]
    found = read(grains, turned, mu=0.3, reverse=True, error=0.1 * NEWTON)
    assert found.report["mean_change_of_f_t"] < 1e-6
    saved = "unbalance_saved_if_tangential_forces_were_reversed"
    assert found.report[saved] < 0 < read(grains, turned, mu=0.3).report[saved]


def test_a_frame_is_kept_as_a_packing(tmp_path):
    grains, rows, _ = frame(missing=0.1, noise=0.05, blur=0.05)
    found = read(grains, rows, mu=0.3)
    save_packing(found.packing, tmp_path / "frame.npz")
    again = load_packing(tmp_path / "frame.npz")
    for one, two in zip(found.packing[:3], again[:3], strict=True):
        assert np.array_equal(one, two)
    assert np.array_equal(found.packing.load, again.load, equal_nan=True)
    assert np.array_equal(found.packing.forces, again.forces)


def test_inferred_forces_of_a_frame_with_error_bars():
    grains, rows, truth = frame(missing=0.1, noise=0.1)
    found = read(grains, rows, mu=0.3, reach=0.05, error=0.1 * NEWTON)
    S = ensemble(found.packing)
    inferred = infer(S, found.measured[S.index], found.sigma[S.index], states=200, unmeasured=1.0)
    assert inferred.draws.residual.max() < 1e-9
    off = (by_pair(found, truth)[S.index] - inferred.mean) / inferred.error
    assert np.median(np.abs(off)) < 1.5


@pytest.mark.parametrize(
    "change, words",
    [
        (lambda g, c: (g, [[1, 3, 99, 0.0, 1.0]]), "99"),
        (lambda g, c: (g, [[1, 3, 3, 0.0, 1.0]]), "itself"),
        (lambda g, c: ([row[:4] for row in g], c), "fields"),
        (lambda g, c: (g, [[1, 3, -1, 0.0, 1.0]]), "no contact"),
        (lambda g, c: ([[2, *row[1:]] for row in g], c), "in common"),
        (lambda g, c: ([[*row[:4], -1.0, 0] for row in g], c), "radius"),
    ],
)
def test_what_is_wrong_is_told(change, words):
    grains, rows, _ = frame()
    with pytest.raises(InputError, match=words):
        read(*change(grains, rows), mu=0.3)
    for options in ({"reach": -1}, {"scale": 0}, {"error": -1.0}):
        with pytest.raises(InputError):
            read(grains, rows, mu=0.3, **options)


@pytest.mark.parametrize("reach", [0, 0.5])
def test_a_frame_whose_grains_are_all_at_walls_is_taken(reach):
    """No balance is left to be judged."""
    grains, rows, _ = frame(8, 0.5)
    found = read([[*row[:-1], 1] for row in grains], rows, mu=0.5, reach=reach)
    assert found.report["unbalanced"] == 0 == found.report["unbalance"]
    assert found.report["grains_at_walls"] == 8 and "notes" not in found.report
    S = ensemble(found.packing)
    assert S.dimension == 2 * len(S.index)


def test_a_frame_of_one_contact_is_taken():
    grains, rows, _ = frame(30)
    pair = [row for row in grains if row[1] in rows[0][1:3]]
    found = read([[*row[:-1], 1] for row in pair], rows[:1], mu=0.3)
    assert found.report["contacts_listed"] == 1 and found.report["unbalanced"] == 0


def test_walls_are_noted_for_whole_grain_numbers_only():
    grains, rows, _ = frame(30)
    inner = next(row for row in grains if not row[-1])
    wall = [[1, -1, inner[1] + 0.5, 0.0, 0.1]]
    at_walls = sum(row[-1] for row in grains)
    assert read(grains, rows + wall, mu=0.3).report["grains_at_walls"] == at_walls
