"""Hostile values end in a result or in one line; results know what they are of."""

import warnings

import hostile
import numpy as np
import pytest
from packings import packed

import granforce as gf
from granforce.records import InputError, friction
from granforce.tolerances import LARGEST_FRICTION, LARGEST_UNIT


@pytest.fixture(scope="module")
def calls():
    return list(hostile.calls(hostile.functions()))


NONE, EMPTY = np.zeros(0, dtype=int), np.zeros((0, 2))


def judged(chosen):
    return {words: bad for words, *call in chosen if (bad := hostile.fault(*call))}


def test_some_hostile_values(calls):
    """One in eleven, in an order that is drawn."""
    order = np.random.default_rng(47).permutation(len(calls))[::11]
    assert len(order) >= 300
    assert judged([calls[k] for k in order]) == {}


@pytest.mark.stress
def test_all_hostile_values(calls):
    assert len(calls) >= 3000
    assert judged(calls) == {}


@pytest.fixture(scope="module")
def S():
    return gf.ensemble(packed(12, 0.3), 0.6)


@pytest.fixture(scope="module")
def others(S):
    """Ensembles that results of S do not belong to: of another packing, and at a smaller μ."""
    return {"packing": gf.ensemble(packed(20, 0.3)), "mu": gf.ensemble(S.packing)}


def of(S):
    """Results of an ensemble, as other functions take them: [(function, arguments of it)]."""
    c = S.index[1]
    sample = gf.sample_uniform(S, 8, 2, 0)
    return [
        (gf.response, (c,), {"critical": gf.critical_force(S, c)}),
        (gf.walk, (4, 0), {"begun": gf.walk(S, 3, 0)}),
        (gf.sample_uniform, (16,), {"previous": sample}),
        (gf.informative, (1,), {"sample": sample, "check": 0}),
    ]


def test_results_are_taken_by_what_they_are_of(S, others):
    for function, words, result in of(S):
        function(S, *words, **result)
        for other in others.values():
            own = (int(other.index[1]),) if function is gf.response else words
            with pytest.raises(InputError, match=r"another|networks of this|not of|computed at mu"):
                function(other, *own, **result)


def test_a_critical_force_of_another_contact_is_refused(S):
    c, d = (int(contact) for contact in S.index[:2])
    critical = gf.critical_force(S, d)
    assert gf.response(S, d, critical=critical).contact == d
    with pytest.raises(InputError, match=f"contact {d}, not of {c}"):
        gf.response(S, c, critical=critical)


def test_networks_of_another_packing_are_refused_by_every_method(S, others):
    foreign = others["packing"].original
    for method in (S.residual, S.violation, S.admits, S.expand, S.to_vector):
        assert np.shape(foreign)[0] != len(S.index)
        with pytest.raises(InputError, match="not networks of this ensemble"):
            method(foreign)


def test_masks_are_no_list_of_contacts(S):
    mask = np.zeros(len(S.index), dtype=bool)
    with pytest.raises(InputError, match="numbers in the packing"):
        gf.intervals(S, mask)


def test_an_outline_of_long_axes_is_that_of_short_ones(S):
    axes = np.zeros((2, len(S.index), 2))
    axes[0, 0, 0] = axes[1, 1, 0] = 1.0
    usual, long = gf.outline(S, axes), gf.outline(S, axes * 1e50)
    assert usual.converged and long.converged
    np.testing.assert_allclose(long.inner / 1e50, usual.inner, rtol=1e-12)
    with pytest.raises(InputError, match="axes"):
        gf.outline(S, axes * 1e155)


def test_what_arrays_hide_is_no_packing(S):
    packing = S.packing
    right = {
        "x": packing.x,
        "r": packing.r,
        "box": packing.box,
        "contacts": packing.contacts,
        "forces": packing.forces,
        "mu": 0.3,
    }
    for name, values in (("x", packing.x), ("forces", packing.forces), ("r", packing.r)):
        for hidden in (
            np.ma.masked_array(values, mask=np.arange(values.size).reshape(values.shape) == 0),
            values + 0.5j,
            values.astype("datetime64[s]"),
        ):
            with pytest.raises(InputError, match=r"masked|real numbers"):
                gf.make_packing(**right | {name: hidden})
    unmasked = np.ma.masked_array(packing.r, mask=False)
    assert np.all(gf.make_packing(**right | {"r": unmasked}).r == packing.r)


def test_one_rule_for_friction(S):
    assert friction(LARGEST_FRICTION) == LARGEST_FRICTION
    assert friction(1 / LARGEST_UNIT) > 0 and not np.signbit(friction(-0.0))
    for mu in (1e-320, 1e-300, 1.1 * LARGEST_FRICTION, 1e300, np.inf, np.nan, -1e-300, "much", 1j):
        with pytest.raises(InputError, match="friction"):
            friction(mu)
    for call in (
        lambda: gf.ensemble(S.packing, 1e300),
        lambda: gf.pack(8, 1e300, 1),
        lambda: gf.scene("groove", 1e300),
        lambda: gf.make_packing(
            [[0, 0]], [1], [9, 9], S.contacts.picked(NONE), np.zeros((0, 2)), 1e300
        ),
        lambda: gf.critical_force(S.packing, 0, mu=1e300),
    ):
        with pytest.raises(InputError, match="too large"):
            call()
    with pytest.raises(InputError, match="too small"):
        gf.ensemble(S.packing, 1e-320)


@pytest.mark.parametrize("seed", [-1, 1.5, "a", np.nan, None])
def test_one_rule_for_seeds(S, seed):
    zeros = np.ones(len(S.index)) * 0.1
    for call in (
        lambda: gf.pack(8, 0.3, seed),
        lambda: gf.walk(S, 2, seed),
        lambda: gf.sample_uniform(S, 2, seed=seed),
        lambda: gf.volume(S, seed=seed),
        lambda: gf.informative(S, seed=seed),
        lambda: gf.infer(S, S.original, zeros.mean(), states=2, seed=seed),
        lambda: gf.remeasured(S, S.original, zeros.mean(), states=2, seed=seed),
        lambda: gf.gauss_seidel(S, S.original, order="random", seed=seed),
    ):
        with pytest.raises(InputError, match="seed"):
            call()


def test_loads_beyond_what_can_balance_are_refused(S):
    with pytest.raises(InputError, match="limit load"), warnings.catch_warnings():
        warnings.simplefilter("error")
        gf.loaded_networks(S, S.index[0], [1e300])


def test_whole_numbers_of_compaction_settings_compile_nothing_anew(S):
    """An int where a float is usual took a minute to compile for."""
    assert gf.pack(8, 0.3, 1, box_mass=100).info["box_mass"] == 100.0
    assert isinstance(gf.pack(8, 0.3, 1, box_mass=100).info["box_mass"], float)
