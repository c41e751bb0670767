"""Hostile values end in a result or in one line; results know what they are of."""

import io
import warnings

import hostile
import numpy as np
import pandas as pd
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


@pytest.mark.parametrize("column", ["i", "j", "fx", "fy"])
def test_hostile_words_in_tables_of_total_forces(column):
    packing = packed(20, 0.3)
    c = packing.contacts
    fx, fy = (packing.forces[:, :1] * c.normal + packing.forces[:, 1:] * c.tangent).T
    grains = pd.DataFrame({"x": packing.x[:, 0], "y": packing.x[:, 1], "r": packing.r})
    links = pd.DataFrame({"i": c.i, "j": c.j, "fx": fx, "fy": fy}).astype(object)
    options = {"box": packing.box, "mu": 0.3}

    def read(table):
        files = [io.StringIO(one.to_csv(index=False)) for one in (grains, table)]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", gf.InputWarning)  # of forces that do not balance
            return gf.read_table(*files, **options)

    wrong, bad = [words for words in hostile.VALUES.values() if np.isscalar(words)], {}
    for words in [*wrong, "1e", "0x1", "-", "1 2", "١"]:
        table = links.copy()
        table.loc[3, column] = words
        if told := hostile.fault(read, {"table": table}):
            bad[str(words)] = told
    assert hostile.fault(read, {"table": links}) is None and bad == {}


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
        (gf.sample_uniform, (16, 2, 0), {"previous": sample}),
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


def test_results_with_other_arguments_are_not_continued(S):
    walk, sample = gf.walk(S, 3, 0), gf.sample_uniform(S, 8, 2, 0)
    for wrong in ({"seed": 1}, {"seed": 0, "relax": gf.gauss_seidel, "rest": None}):
        with pytest.raises(InputError, match="give the same arguments"):
            gf.walk(S, 4, begun=walk, **wrong)
    right = {"chains": 2, "seed": 0, "method": "billiard"}
    for wrong in ({"chains": 4}, {"seed": 1}, {"method": "hit_and_run"}):
        with pytest.raises(InputError, match=f"drawn with {next(iter(wrong))} = "):
            gf.sample_uniform(S, 16, previous=sample, **right | wrong)


def test_walks_of_one_point_and_of_no_states_are_continued(S):
    point = gf.ensemble(gf.scene("groove", 0.0))
    again = gf.walk(point, 5, 0, begun=gf.walk(point, 3, 0))
    assert point.dimension == 0 and again.counts["skipped"] == 5
    none = gf.walk(S, 3, 0, whole=False, max_attempts=1, tolerance=1e-300)
    assert not len(none.states)
    np.testing.assert_array_equal(gf.walk(S, 3, 0, begun=none).states, gf.walk(S, 3, 0).states)


def test_records_of_another_kind_are_named(S, tmp_path):
    walk, sample, c = gf.walk(S, 3, 0), gf.sample_uniform(S, 8, 2, 0), S.index[0]
    for call, kind in (
        (lambda: gf.walk(S, 4, 0, begun=sample), "a Walk, not a UniformSample"),
        (lambda: gf.sample_uniform(S, 9, 2, 0, previous=walk), "UniformSample, not a Walk"),
        (lambda: gf.informative(S, sample=walk), "UniformSample, not a Walk"),
        (lambda: gf.response(S, c, critical=walk), "CriticalForce, not a Walk"),
        (lambda: gf.evolution(tmp_path / "s.zarr", [1, 2]), "Snapshots, not a list"),
        (lambda: gf.infer_series(tmp_path / "s.zarr", ["a.txt"], mu=0.3), "frames_of"),
    ):
        with pytest.raises(InputError, match=kind):
            call()


def test_conditions_beside_an_ensemble_are_refused(S):
    c = S.index[0]
    for call in (
        lambda: gf.critical_force(S, c, mu=0.1),
        lambda: gf.response(S, c, mu=0.1),
        lambda: gf.rest(S, mu=0.1),
        lambda: gf.rest(S, prescribed="stress"),
    ):
        with pytest.raises(InputError, match="an ensemble already has"):
            call()


def test_limit_loads_of_other_contacts_are_refused(S):
    contacts = S.index[:3]
    loads = gf.limit_loads(S, contacts)
    assert len(set(np.round(loads, 6))) > 1
    gf.critical_forces(S, contacts, limit_loads=loads)
    with pytest.raises(InputError, match=r"the limit load of contact \d+ is"):
        gf.critical_forces(S, contacts, limit_loads=0.1 * loads)


def test_labels_of_another_ensemble_are_refused(S):
    other = gf.ensemble(packed(12, 0.3, seed=3))
    bounds = gf.intervals(S)
    assert gf.to_dataset(bounds, S).sizes["contact"] == len(S.index)
    with pytest.raises(InputError, match="belongs to another ensemble"):
        gf.to_dataset(bounds, other)


def test_networks_of_another_packing_are_refused_by_every_method(S, others):
    foreign = others["packing"].original
    for method in (S.residual, S.violation, S.admits, S.expand, S.to_vector):
        assert np.shape(foreign)[0] != len(S.index)
        with pytest.raises(InputError, match="not networks of this ensemble"):
            method(foreign)


def test_masks_are_no_list_of_contacts(S):
    mask = np.zeros(len(S.index), dtype=bool)
    with pytest.raises(InputError, match="list of contact numbers of the packing"):
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


@pytest.mark.parametrize("noise", [0.1, "a", (-1.0,), (np.nan,), [[0.1]], None])
def test_noise_that_is_no_list_of_deviations_is_refused(S, noise):
    with pytest.raises(InputError, match="noise"):
        gf.rest(S, noise=noise)
