"""Cells and the store behind them."""

import inspect
from itertools import product

import numpy as np
import pytest

from granforce import measures
from granforce.forces.build import ensemble
from granforce.forces.knowledge import Known
from granforce.records import InputError
from granforce.study import cells as study
from granforce.study import kinds
from granforce.study.keys import canonical
from granforce.study.store import open_store
from granforce.tolerances import MANY_DISKS


def cell(packed_mu=0.3, seed=1, states=6, n=20, **options):
    packing = kinds.PACKING.parameters(n, packed_mu, seed)
    return kinds.WALK.parameters(packing, states, relax="nearest_piqp", **options)


def test_a_cell_is_computed_once(tmp_path):
    store = open_store(tmp_path / "s")
    first, cached = study.get(store, kinds.WALK, cell())
    again, cached_again = study.get(store, kinds.WALK, cell())
    assert (cached, cached_again) == (False, True)
    assert np.array_equal(first["states"], again["states"])
    assert sorted(entry.kind for entry in store.entries()) == ["packing", "walk"]


def test_a_walk_that_was_enough_is_found_as_one_of_so_many_states_and_goes_on(tmp_path):
    store, other = open_store(tmp_path / "s"), open_store(tmp_path / "other")
    asked = iter(range(6))
    study.get(store, kinds.WALK, cell(), enough=lambda: next(asked) == 2)
    assert study.get(store, kinds.WALK, cell(states=3))[1]
    assert study.load(store, kinds.WALK, cell()) is None
    begun = []
    found, _ = study.get(store, kinds.WALK, cell(), watch=begun.append)
    wanted, _ = study.get(other, kinds.WALK, cell())
    assert [one.number for one in begun] == list(range(6))
    assert found.drop_vars("seconds").identical(wanted.drop_vars("seconds"))


def test_a_shorter_walk_that_was_rounded_or_thinned_is_not_gone_on_from(tmp_path):
    store = open_store(tmp_path / "s")
    study.get(store, kinds.WALK, cell(states=3), dtypes={"states": "float32"})
    study.get(store, kinds.WALK, cell(states=4, keep=2))
    found, _ = study.get(store, kinds.WALK, cell())
    wanted = kinds.WALK.compute(open_store(tmp_path / "t"), cell(), workers=1, progress=None)
    assert np.array_equal(found["states"], wanted["states"])


def test_friction_is_quantised_in_names(tmp_path):
    store = open_store(tmp_path / "s")
    study.get(store, kinds.WALK, cell(0.3))
    assert study.get(store, kinds.WALK, cell(0.1 + 0.2))[1]


def test_rows_of_one_scan_have_cones_of_one_kind(tmp_path):
    store = open_store(tmp_path / "s")
    for mu in (0.1, 0.3):
        study.get(store, kinds.WALK, cell(mu, mu=0.3))
    assert [row["mu"] for row in study.scan_rows(store)] == [0.1, 0.3]
    study.get(store, kinds.WALK, cell(0.1))
    with pytest.raises(InputError, match="differ in the friction of the cones"):
        study.scan_rows(store)


def test_a_damaged_cell_is_computed_again(tmp_path):
    store = open_store(tmp_path / "s")
    first, _ = study.get(store, kinds.WALK, cell())
    name = study.entry_name(store, kinds.WALK, cell())
    chunk = store.path / name / "states" / "c" / "0" / "0" / "0"
    chunk.write_bytes(chunk.read_bytes()[:-9])
    with pytest.warns(UserWarning, match="damaged"):
        again, cached = study.get(store, kinds.WALK, cell())
    assert not cached
    assert np.array_equal(first["states"], again["states"])
    assert all(verdict.ok for verdict in store.verify())


def test_measures_in_the_store_are_those_of_all_states(tmp_path):
    store = open_store(tmp_path / "s")
    few, _ = study.get(store, kinds.WALK, cell(states=9, keep=3))
    full, _ = study.get(store, kinds.WALK, cell(states=9))
    assert few.sizes["state"] == 3
    assert full.sizes["state"] == 9
    for name in ("eta1", "eta2", "eta3", "correlation"):
        assert few[name].item() == full[name].item()
    assert few["eta2"].item() == measures.eta2(full["states"].values)
    assert np.array_equal(few["states"], full["states"][[0, 4, 8]])
    packing, _ = kinds.get_packing(store, cell()["packing"])
    S = ensemble(packing)
    assert full["dimension"].item() == S.dimension
    assert np.array_equal(full["backbone"], S.index)


def test_walks_by_sweeps_alone_are_kept_with_what_they_reached(tmp_path):
    store = open_store(tmp_path / "s")
    sweeps = {"relax": "gauss_seidel_only", "attempts": 3}
    packing = kinds.PACKING.parameters(20, 0.3, 1)
    coarse = kinds.WALK.parameters(packing, 6, residual=1e-3, **sweeps)
    found, _ = study.get(store, kinds.WALK, coarse)
    assert 1e-6 < found["residual"].max() <= 1e-3
    assert found["mean_sweeps"] >= found["sweeps"].mean() > 0
    # Where no attempt succeeds there is an acceptance, and nothing to measure.
    never = kinds.WALK.parameters(packing, 6, residual=1e-17, **sweeps)
    nothing, _ = study.get(store, kinds.WALK, never)
    assert nothing.sizes["state"] == 0
    assert nothing["acceptance"] == 0
    assert "eta2" not in nothing
    assert np.isnan(nothing["low"]).all()
    # Names of walks without these words are what they were.
    plain = kinds.WALK.parameters(packing, 6, relax="gauss_seidel_only")
    assert not {"residual", "attempts"} & plain.keys()


def test_packings_from_elsewhere_are_named_by_their_content(tmp_path):
    store = open_store(tmp_path / "s")
    packing, _ = kinds.get_packing(store, cell()["packing"])
    named = kinds.imported_parameters(packing)
    kinds.keep_packing(store, named, packing)
    walked = kinds.WALK.parameters(named, 4, relax="nearest_piqp")
    assert study.get(store, kinds.WALK, walked)[0].sizes["state"] == 4
    other = kinds.imported_parameters(packing._replace(mu=0.31))
    assert other != named
    with pytest.raises(InputError, match="import it again"):
        kinds.get_packing(store, other)


def test_a_packing_from_elsewhere_can_be_held(tmp_path):
    """Another process may clear the store between two looks."""
    store = open_store(tmp_path / "s")
    packing, _ = kinds.get_packing(store, cell()["packing"])
    named = kinds.imported_parameters(packing)
    kinds.keep_packing(store, named, packing, in_memory=True)
    open_store(store.path).clear()
    assert kinds.imported_parameters(kinds.get_packing(store, named)[0]) == named
    assert not store.incomplete and not len(store)


@pytest.mark.parametrize("bad", [{"relax": "magic"}, {"states": 0}, {"keep": 0}])
def test_bad_walks_are_refused(bad):
    options = {"states": 4} | bad
    with pytest.raises(InputError):
        kinds.WALK.parameters(kinds.PACKING.parameters(20, 0.3, 1), **options)


MADE = {"n": 20, "mu": 0.3}  # as much of a packing's parameters as others look at
NOT_WHOLE = [0, -1, 1.5, np.nan, np.inf, "many", None, [1], 2**60]
NOT_A_SEED = [-1, 1.5, np.nan, "one", [1]]
NOT_POSITIVE = [0, -1, np.nan, np.inf, "wide", None, [1, 2]]
NO_FRICTION = [-1, np.nan, np.inf, "much"]


@pytest.mark.parametrize(
    "name, given, options",
    [
        (kinds.PACKING.parameters, (20, 0.3, 1), {"pressure": NOT_POSITIVE}),
        (
            kinds.PACKING.parameters,
            (20, 0.3, 1),
            {"dt": [bad for bad in NOT_POSITIVE if bad is not None]},
        ),
        (kinds.PACKING.parameters, (20, 0.3, 1), {"box_mass": NOT_POSITIVE}),
        (
            kinds.PACKING.parameters,
            (20, 0.3, 1),
            {"sweeps": [bad for bad in NOT_WHOLE if bad is not None]},
        ),
        (kinds.PACKING.parameters, (20, 0.3, 1), {"radii": ["uniform:nan,1", [1.0] * 19, None]}),
        (kinds.PACKING.parameters, (20, 0.3, 1), {"radii": [[np.nan] * 20, [0.0] * 20]}),
        (kinds.PACKING.parameters, (20, 0.3), {"seed": NOT_A_SEED}),
        (kinds.PACKING.parameters, (20,), {"mu": NO_FRICTION, "seed": [1]}),
        (kinds.PACKING.parameters, (), {"n": [*NOT_WHOLE, 2], "mu": [0.3], "seed": [1]}),
        (kinds.WALK.parameters, (MADE,), {"states": NOT_WHOLE}),
        (kinds.WALK.parameters, (MADE, 4), {"seed": NOT_A_SEED}),
        (kinds.WALK.parameters, (MADE, 4), {"chains": [*NOT_WHOLE, 5]}),
        (kinds.WALK.parameters, (MADE, 4), {"keep": [0, -1, 1.5, "some"]}),
        (kinds.WALK.parameters, (MADE, 4), {"mu": NO_FRICTION}),
        (kinds.WALK.parameters, (MADE, 4), {"residual": [1e-3]}),  # not of nearest networks
        (
            kinds.WALK.parameters,
            (MADE, 4),
            {"residual": NOT_POSITIVE[:-2], "relax": ["gauss_seidel_only"]},
        ),
        (kinds.WALK.parameters, (MADE, 4), {"attempts": [0, -1, 1.5, "many"]}),
        (kinds.UNIFORM.parameters, (MADE,), {"states": NOT_WHOLE}),
        (kinds.UNIFORM.parameters, (MADE, 4), {"seed": NOT_A_SEED}),
        (kinds.UNIFORM.parameters, (MADE, 4), {"chains": NOT_WHOLE}),
        (kinds.UNIFORM.parameters, (MADE, 4), {"effective": [0, -1, np.nan, np.inf, 1e18]}),
        (kinds.INTERVALS.parameters, (MADE,), {"contacts": [[], [-1], [0.5], ["a"], [2**60]]}),
        (
            kinds.INTERVALS.parameters,
            (MADE,),
            {"slice_": [[], [0, 1], [0, np.nan, 0, 1], "0,1,0,1"]},
        ),
        (kinds.INTERVALS.parameters, (MADE,), {"slice_": [[0.5, 0.2, 0, 1], [0, 2, 0, 1]]}),
        (kinds.INTERVALS.parameters, (MADE,), {"known": [1, [[1]], [[-1, 0, 1, None, None]]]}),
        (
            kinds.INTERVALS.parameters,
            (MADE,),
            {"known": [[[1, low, 1, None, None]] for low in (np.nan, np.inf, "one")]},
        ),
        (
            kinds.INTERVALS.parameters,
            (MADE,),
            {"known": [Known([1, 2], [0.0] * 3, [1.0] * 3), Known([1], [np.inf], [np.inf])]},
        ),
        (kinds.OUTLINE.parameters, (MADE,), {"components": [[], [(0, 0)], [(0, 2), (1, 0)], [1]]}),
        (kinds.OUTLINE.parameters, (MADE,), {"tolerance": NOT_POSITIVE, "states": [{}]}),
        (kinds.PERTURBATION.parameters, (MADE,), {"random": [0, -1, 1.5, "some"]}),
        (kinds.PERTURBATION.parameters, (MADE,), {"seed": NOT_A_SEED, "random": [1]}),
        (kinds.PERTURBATION.parameters, (MADE,), {"contacts": [[], [-1], [np.nan]]}),
        (kinds.PERTURBATION.parameters, (MADE,), {"precision": NOT_POSITIVE}),
        (kinds.PERTURBATION.parameters, (MADE,), {"rise": [*NOT_POSITIVE, 1.1, 2]}),
        (kinds.PERTURBATION.parameters, (MADE,), {"max_steps": NOT_WHOLE}),
    ],
)
def test_parameters_are_judged_where_they_are_named(name, given, options):
    """Once for the library, the command line and the app."""
    for values in product(*options.values()):
        with pytest.raises(InputError) as told:
            name(*given, **dict(zip(options, values, strict=True)))
        assert "\n" not in str(told.value)


def test_names_are_the_same_however_a_number_is_written():
    plain = kinds.WALK.parameters(kinds.PACKING.parameters(20, 0.3, 1), 6, keep=3)
    made = kinds.PACKING.parameters(
        *(20.0, np.float64(0.3), np.int64(1)),
        pressure=1,
        dt=np.float64(0.03),
        box_mass=np.float32(100),
        sweeps=150.0,
    )
    assert canonical(kinds.WALK.parameters(made, np.int32(6), keep=3.0)) == canonical(plain)
    radii = kinds.PACKING.parameters(3, 0.3, 1, radii=np.array([1, 0.5, 1]))["radii"]
    assert radii == [1.0, 0.5, 1.0]


def test_what_would_not_fit_into_memory_is_told_at_once():
    huge = {**MADE, "n": 400}
    for name in (
        lambda: kinds.PACKING.parameters(10**12, 0.3, 1),
        lambda: kinds.WALK.parameters(huge, 10**12),
        lambda: kinds.UNIFORM.parameters(huge, 10**12),
        lambda: kinds.UNIFORM.parameters(huge, 10, effective=1e12),
    ):
        with pytest.raises(InputError, match=r"would need .* GB of memory, but this machine has"):
            name()


def test_public_names_are_what_they_say():
    import granforce
    import granforce.study.cells

    for name in granforce.__all__:
        if name != "measures":
            public = getattr(granforce, name)
            assert callable(public) or inspect.ismodule(public), name
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = granforce.nothing


def test_packings_of_different_algorithms_have_different_versions():
    def versions(n):
        return [kinds.PACKING.parameters(n, mu, 1)["version"] for mu in (0, 1e-4, 0.1)]

    none, finished, few = versions(MANY_DISKS)
    assert none == few != finished  # linear programs finish packings of small friction
    large = set(versions(MANY_DISKS + 1))
    assert len(large) == 1 and not large & {few, finished}
