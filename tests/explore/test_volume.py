"""The volume of S: small ones enumerated vertex by vertex decide, and how far repeats scatter.

`reference/volume_small.npz` holds 52 packings of 6 to 20 disks (concatenated), and `rows` with the
columns N, μ, seed, h, ln V, ⟨f_n⟩: ln V is that of a convex hull of vertices (qhull).
"""

import numpy as np
import pytest
from packings import REFERENCE, lattice, packed, two_disks

import granforce as gf
from granforce.explore import volume as ladder
from granforce.records import Contacts, make_packing

FIELDS = "i", "j", "normal", "length", "gap", "arm_i", "arm_j"


def references():
    """(packing, h, ln V, ⟨f_n⟩) of every row."""
    kept = np.load(REFERENCE / "volume_small.npz")
    grains = np.append(0, np.cumsum(kept["grains"]))
    ends = np.append(0, np.cumsum(kept["contacts"]))
    for k, (_, mu, _, h, log_volume, scale) in enumerate(kept["rows"]):
        some, own = slice(grains[k], grains[k + 1]), slice(ends[k], ends[k + 1])
        contacts = Contacts(*(kept[f"contact_{name}"][own] for name in FIELDS))
        place = kept["x"][some], kept["r"][some], kept["box"][k]
        packing = make_packing(*place, contacts, kept["forces"][own], mu, kept["pressure"][k])
        yield packing, int(h), log_volume, scale


@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.slow)])
def test_small_volumes_are_those_of_their_vertices(every):
    scores = []
    for number, (packing, h, log_volume, scale) in list(enumerate(references()))[::every]:
        S = gf.ensemble(packing)
        assert S.dimension == h and S.force_scale == pytest.approx(scale)
        found = gf.volume(S, seed=number)
        assert found.dimension == h and found.error <= 0.05 and found.reached
        assert found.counts["refused"] == 0
        scores.append((found.log_volume - log_volume) / found.error)
    assert np.abs(scores).max() < 4 and 0.7 < np.sqrt(np.mean(np.square(scores))) < 1.3


def test_the_error_is_the_scatter_of_repeats():
    S = gf.ensemble(packed(40, 0.3))
    found = [gf.volume(S, seed=seed, accuracy=0.1) for seed in range(20)]
    scatter = np.std([one.log_volume for one in found], ddof=1)
    claimed = np.sqrt(np.mean([one.error**2 for one in found]))
    # The deviation of 20 has an error of a sixth.
    assert 0.5 < scatter / claimed < 1.5
    assert all(one.reached for one in found)


def test_same_seed_same_volume_for_any_number_of_workers_and_any_memory(monkeypatch):
    S = gf.ensemble(packed(40, 0.3))
    one, two = (gf.volume(S, accuracy=0.2, workers=workers) for workers in (1, 3))
    monkeypatch.setattr(ladder.billiard, "MEMORY", 20 * 8 * 192)
    three = gf.volume(S, accuracy=0.2, workers=2)
    told: list[tuple[float, float]] = []
    other = gf.volume(S, accuracy=0.2, seed=1, progress=lambda *paths: told.append(paths))
    done = [paths for paths, _ in told]
    assert len(told) > 10 and done == sorted(done) and told[-1][0] == told[-1][1]
    assert all(0.2 < total / told[-1][0] < 5 for _, total in told)  # estimates, from the first
    assert one.log_volume == two.log_volume == three.log_volume != other.log_volume
    assert one.counts == two.counts == three.counts


def test_the_volume_scales_with_no_pressure_and_falls_with_what_is_known():
    """Forces are in ⟨f_n⟩; half of the range of one force leaves less than all of it."""
    packing = packed(40, 0.3)
    S = gf.ensemble(packing)
    double = packing._replace(pressure=2 * packing.pressure, forces=2 * packing.forces)
    same = gf.volume(gf.ensemble(double), accuracy=0.2)
    whole = gf.volume(S, accuracy=0.2)
    assert same.log_volume == pytest.approx(whole.log_volume, abs=1e-6)
    contact = S.index[np.argmax(np.ptp(gf.intervals(S)[1:3], axis=0)[:, 0])]
    reach = gf.reach(S, contact)
    middle = 0.5 * (reach.low + reach.high)
    halves = []
    for low, high in ((-np.inf, middle), (middle, np.inf)):
        known = gf.Known([contact], [[low, -np.inf]], [[high, np.inf]])
        halves.append(gf.volume(gf.ensemble(packing, known=known), accuracy=0.1))
    assert {half.dimension for half in halves} == {whole.dimension}
    together = np.logaddexp(*(half.log_volume for half in halves))
    error = np.sqrt(0.1**2 * 2 + 0.2**2)
    assert abs(together - whole.log_volume) < 4 * error


def test_a_point_has_no_extent_and_crystals_have_one():
    for packing in (packed(40, 0.0), two_disks()):
        point = gf.volume(gf.ensemble(packing))
        assert point.log_volume == point.error == point.width == 0 and point.reached
    crystal = gf.ensemble(lattice(4, 4, 0.2, triangular=True))
    found = gf.volume(crystal, accuracy=0.3)
    assert found.dimension == crystal.dimension and found.width > 0


@pytest.mark.parametrize("n, mu, seed, h", [(6, 0.3, 1, 0), (8, 1.0, 1, 0), (16, 1.0, 1, 1)])
def test_a_thin_s_under_a_whole_stress_is_what_its_corners_say(n, mu, seed, h):
    """Rows of its balance follow from others: a point is drawn as one, a segment has its length."""
    S = gf.ensemble(packed(n, mu, seed), prescribed="stress")
    corners = gf.body(S).corners / S.force_scale
    found, sample = gf.volume(S), gf.sample_uniform(S, 80)
    assert corners.shape[1] == found.dimension == sample.walls.dimension == h
    assert found.reached and sample.residual.max() < 1e-10 and sample.counts["refused"] == 0
    length = np.log(np.ptp(corners)) if h else 0.0
    assert abs(found.log_volume - length) <= 4 * found.error


def test_what_has_no_volume_is_told():
    S = gf.ensemble(packed(40, 0.3))
    for options in ({"accuracy": 0.0}, {"accuracy": 0.009}, {"workers": 0}, {"seed": -1}):
        with pytest.raises(gf.InputError):
            gf.volume(S, **options)
    with pytest.raises(gf.Cancelled):
        gf.volume(S, accuracy=0.01, cancel=lambda: True)
