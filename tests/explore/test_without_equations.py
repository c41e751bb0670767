"""S where the balance of every grain is left open: contacts know nothing of each other.

Then S is the product of one cone for each contact, or of one trapezium where forces are known.
"""

import numpy as np
import pytest
from packings import packed

import granforce as gf
from granforce.records import InputError


def left_open(mu):
    """A packing cut at its box, of 20 disks, none of which need balance."""
    packing = packed(20, 0.3)
    c = packing.contacts
    branch = packing.x[c.j] - packing.x[c.i]
    inside = np.abs(branch - c.length[:, None] * c.normal).max(axis=1) < 1e-6
    forces = packing.forces[inside] * [1.0, min(1.0, mu / 0.3)]
    load = np.full((20, 3), np.nan)
    return gf.make_packing(
        packing.x, packing.r, [np.inf, np.inf], c.picked(inside), forces, mu, load=load
    )


@pytest.fixture(params=[0.0, 0.3])
def S(request):
    return gf.ensemble(left_open(request.param))


@pytest.fixture
def bounded(S):
    """The same between bounds on every f_n, a and b in ⟨f_n⟩."""
    normal, beyond = S.packing.forces[:, 0], np.full(len(S.packing.forces), np.inf)
    low = np.minimum(0.5 * S.force_scale, 0.9 * normal)
    high = np.maximum(1.5 * S.force_scale, 1.1 * normal)
    known = gf.Known(
        np.arange(len(normal)), np.column_stack([low, -beyond]), np.column_stack([high, beyond])
    )
    return gf.ensemble(S.packing, known=known), low[S.index], high[S.index]


def test_every_force_is_free(S):
    assert S.dimension == len(S.index) * S.per_contact and not S.is_determined
    assert np.isnan(S.coordination) and S.residual(-S.original) == 0
    assert gf.report(S.packing)["dimension"] == S.dimension
    assert gf.fall(S.packing) is None


def test_networks_are_found_contact_by_contact(S):
    unit = S.force_scale
    wide = 1.1 * S.original
    for found in (gf.nearest(S, wide), gf.nearest_piqp(S, wide), *gf.nearest_of_many(S, [wide])):
        assert np.abs(found.forces - wide).max() < 1e-4 * unit
    assert np.abs(gf.nearest(S, -S.original).forces).max() < S.mu * S.original[:, 0].max() + 1e-6
    assert gf.gauss_seidel(S, S.original).converged
    assert gf.walk(S, 3, 0).counts["accepted"] == 3
    contact = S.index[0]
    assert gf.pull(S, contact, [3 * unit]).states[0, 0, 0] == pytest.approx(3 * unit)
    assert np.all(gf.loaded_networks(S, contact, [0, unit]).residual == 0)


def test_what_is_measured_is_inferred_contact_by_contact(S):
    unit, measured = S.force_scale, S.original.copy()
    found = gf.infer(S, measured, 0.1 * unit, states=8)
    assert np.allclose(found.forces, measured, atol=1e-6 * unit)
    assert 0 < found.error.mean() < 0.15 * unit
    assert 0 < gf.remeasured(S, measured, 0.1 * unit, states=8).error.mean() < 0.15 * unit
    measured[::2] = np.nan
    assert np.all(gf.carrying(S, measured, 0.1 * unit).least == 0)


def test_without_bounds_forces_have_no_limit(S):
    """All of each cone is in S, and any pair of forces on open grains."""
    found = gf.intervals(S)
    side = np.inf if S.mu else 0.0
    assert found.converged and np.all(found.low == [0.0, -side])
    assert np.all(found.high == [np.inf, side])
    assert np.all(np.isposinf(gf.limit_loads(S)))


def test_without_bounds_that_is_said(S):
    contact, axes = S.index[0], np.eye(2 * len(S.index))[[0, 2]].reshape(2, -1, 2)
    for call in (
        gf.sample_uniform,
        gf.volume,
        gf.informative,
        lambda S: gf.reach(S, contact),
        lambda S: gf.outline(S, axes),
    ):
        with pytest.raises(InputError, match="not bounded: some"):
            call(S)
    for call, words in (
        (gf.body, "dimensions"),
        (gf.stress_outline, "at a prescribed pressure"),
    ):
        with pytest.raises(InputError, match=words):
            call(S)


def test_between_bounds_s_is_a_product(bounded):
    S, low, high = bounded
    a, b, unit = low / S.force_scale, high / S.force_scale, S.force_scale
    found = gf.intervals(S)
    assert np.allclose(found.low[:, 0], low, atol=1e-8) and found.converged
    assert np.allclose(found.high, np.column_stack([high, S.mu * high]), atol=1e-8)
    volume = gf.volume(S, accuracy=0.1)
    exact = np.log(S.mu * (b**2 - a**2) if S.mu else b - a).sum()
    assert abs(volume.log_volume - exact) < 4 * volume.error
    drawn = gf.sample_uniform(S, 400)
    mean = 2 * (b**3 - a**3) / (3 * (b**2 - a**2)) if S.mu else (a + b) / 2
    assert drawn.reached
    assert np.abs(drawn.flat[..., 0].mean() / unit - mean.mean()) < 0.05
    assert len(gf.informative(S, 2, states=40, check=0).contacts) == 2


def test_no_load_on_open_grains_has_a_limit(bounded):
    S, *_ = bounded
    loads = gf.limit_load_bounds(S)
    assert np.all(np.isposinf(loads.load)) and loads.converged and loads.max_gap == 0
    with pytest.raises(InputError, match=f"moves the grains of contact {S.index[1]}:"):
        gf.critical_force(S, S.index[1])


def test_where_some_grains_balance_the_others_have_no_limit():
    packing = packed(20, 0.3)
    first = gf.ensemble(packing)
    c = first.packing.contacts
    load = np.where(np.isin(np.arange(20), [c.i[first.index[0]], c.j[first.index[0]]]), np.nan, 0.0)
    S = gf.ensemble(packing._replace(load=np.tile(load[:, None], (1, 3))))
    between = np.isnan(load)[S.contacts.i] & np.isnan(load)[S.contacts.j]
    # The pressure has the load, too, which bounds it.
    assert between.any() and np.isfinite(gf.limit_loads(S, S.index[between])).all()
