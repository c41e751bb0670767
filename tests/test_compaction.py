"""Compaction: packings that are jammed, balanced, free of overlap and reproducible."""

import numpy as np
import pytest
from packings import packed

from granforce.compaction import draw_radii, pack
from granforce.neighbours import find_pairs, separations
from granforce.polytope import ensemble
from granforce.records import Cancelled, InputError, NotJammedError


def check(packing):
    """What every finished packing must show; returns its ensemble."""
    unit = packing.r.max()
    i, j, shift = find_pairs(packing.x, packing.r, packing.box, 0.01 * unit)
    gap = separations(packing.x, packing.r, packing.box, i, j, shift)[2]
    assert gap.min() > -1e-7 * unit
    assert np.abs(packing.contacts.gap).max() < 1e-6 * unit
    S = ensemble(packing)
    assert S.residual(S.original) < 1e-10
    assert S.violation(S.original) < 1e-9
    assert np.all(S.original[:, 0] > 0)
    # Rattlers carry nothing, the backbone does.
    outside = np.setdiff1d(np.arange(len(packing.r)), S.grains)
    assert S.skipped["rattlers"] == len(outside)
    off = np.setdiff1d(np.arange(len(packing.contacts.i)), S.index)
    assert np.abs(packing.forces[off]).max(initial=0) == 0
    return S


@pytest.mark.parametrize("mu", [0.001, 0.1, 1.0, 10.0])
def test_packings_are_jammed_at_every_friction(mu):
    S = check(packed(60, mu))
    assert 3 <= S.coordination < 4.1


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_frictionless_packings_are_isostatic(seed):
    S = check(packed(60, 0.0, seed))
    assert len(S.index) == 2 * len(S.grains) - 1
    assert S.dimension == 0


def test_contacts_are_closed_exactly():
    for mu in (0.0, 0.3):
        S = ensemble(packed(60, mu))
        assert np.abs(S.contacts.gap).max() < 1e-10


def test_the_same_seed_gives_the_same_packing():
    one, two, other = pack(20, 0.3, 7), pack(20, 0.3, 7), pack(20, 0.3, 8)
    assert np.array_equal(one.x, two.x)
    assert np.array_equal(one.forces, two.forces)
    assert not np.array_equal(one.r, other.r)


def test_pressure_and_radii_only_set_the_units():
    one = pack(20, 0.3, 7)
    # Powers of two, so that rounding is the same: the dynamics is chaotic.
    two = pack(20, 0.3, 7, pressure=2.0**20, radii=f"uniform:{2.0**-11},{2.0**-10}")
    assert np.array_equal(two.box, 2.0**-10 * one.box)
    assert np.array_equal(two.forces, 2.0**10 * one.forces)
    check(two)


def test_ten_disks_and_very_unequal_ones():
    check(pack(10, 0.5, 2))
    check(pack(60, 0.3, 2, radii="bidisperse:0.2,1,0.5"))


def test_radii_are_drawn_as_asked(rng):
    r = draw_radii("bidisperse:1,1.4,0.25", 40, rng)
    assert sorted(set(r)) == [1.0, 1.4]
    assert np.sum(r == 1.4) == 10
    r = draw_radii("uniform:0.5,1", 4000, rng)
    assert 0.5 <= r.min() < 0.51
    assert 0.99 < r.max() <= 1
    given = np.linspace(1, 2, 9)
    assert np.array_equal(draw_radii(given, 9, rng), given)


@pytest.mark.parametrize(
    "options, what",
    [
        ({"n": 2}, "at least 3 disks"),
        ({"mu": -0.1}, "friction coefficient"),
        ({"mu": np.nan}, "friction coefficient"),
        ({"mu": "much"}, "friction coefficient"),
        ({"radii": "uniform:1,0.5"}, "radii"),
        ({"radii": "gaussian:1,0.5"}, "radii"),
        ({"radii": [1.0, -1.0] * 10}, "radii"),
        ({"radii": [1.0] * 3}, "radii"),
        ({"pressure": 0}, "pressure"),
        ({"dt": -1}, "dt"),
        ({"sweeps": 0}, "sweeps"),
    ],
)
def test_bad_input_is_told_in_one_line(options, what):
    with pytest.raises(InputError, match=what) as caught:
        pack(**{"n": 20, "mu": 0.3, "seed": 0} | options)
    assert "\n" not in str(caught.value)


def test_a_budget_too_small_tells_the_state_reached():
    with pytest.raises(NotJammedError, match=r"not jammed after 200 steps: φ = 0\.\d+"):
        pack(40, 0.3, 0, max_steps=200)


def test_compaction_reports_and_can_be_cancelled():
    seen = []
    with pytest.raises(Cancelled):
        pack(40, 0.3, 0, progress=lambda *a: seen.append(a), cancel=lambda: len(seen) == 2)
    assert [step for step, _ in seen] == [100, 200]


@pytest.mark.slow
@pytest.mark.parametrize("mu", [0, 0.001, 0.01, 0.03, 0.1, 0.3, 1, 3, 10])
@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5])
def test_four_hundred_disks_at_every_friction(mu, seed):
    S = check(pack(400, mu, seed))
    if mu == 0:
        assert len(S.index) == 2 * len(S.grains) - 1


@pytest.mark.slow
def test_ten_thousand_disks():
    check(pack(10_000, 0.1, 1))
