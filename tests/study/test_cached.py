"""Functions in gf.cached: the second call loads, and the command line knows the same entries."""

import json
import threading
import warnings

import numpy as np
import pytest

import granforce as gf
from granforce.cli.entry_point import main
from granforce.study import cells, kinds

# Calls on S; the same as commands; and a call that differs in one argument.
CALLS = {
    "walk": (
        lambda S: gf.walk(S, 4, seed=2),
        "walk {} --states 4 --walk-seed 2",
        lambda S: gf.walk(S, 4, seed=3),
    ),
    "uniform": (
        lambda S: gf.sample_uniform(S, 40, seed=1),
        "uniform {} --states 40 --sample-seed 1",
        lambda S: gf.sample_uniform(S, 40, 5, seed=1),
    ),
    "intervals": (
        lambda S: gf.intervals(S, workers=2),
        "intervals {}",
        lambda S: gf.intervals(S, S.index[:2]),
    ),
    "limit_loads": (
        lambda S: gf.limit_load_bounds(S, S.index[:3].tolist()),
        "limit-loads {} --contacts 0,1,2",
        lambda S: gf.limit_load_bounds(S, S.index[:2].tolist()),
    ),
    "volume": (
        lambda S: gf.volume(S, accuracy=0.3),
        "volume {} --accuracy 0.3",
        lambda S: gf.volume(S, accuracy=0.4),
    ),
    "stress": (
        lambda S: gf.stress_outline(S, 8),
        "stress {} --angles 8",
        lambda S: gf.stress_outline(S, 6),
    ),
    "informative": (
        lambda S: gf.informative(S, 2, check=2, states=60),
        "informative {} --best 2 --check 2 --states 60",
        lambda S: gf.informative(S, 2, check=0, states=60),
    ),
}
pytestmark = pytest.mark.filterwarnings("ignore::granforce.ResultWarning")


@pytest.fixture(scope="module")
def packing():
    return gf.pack(12, 0.3)


def forbidden(*arguments, **options):
    raise AssertionError("computed")


def reported(capsys, line):
    """What a command reports; line: its words."""
    main([*line.split(), "--json"])
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("kind", CALLS)
def test_the_second_call_is_loaded_and_equals_the_first(tmp_path, packing, monkeypatch, kind):
    call, _, other = CALLS[kind]
    with gf.cached(tmp_path / "s") as store:
        first, different = call(gf.ensemble(packing)), other(gf.ensemble(packing))
        assert len(store.entries()) == 3  # with the packing
        monkeypatch.setattr("granforce.study.kinds.cached.get", forbidden)
        assert call(gf.ensemble(packing)) == first != different
    monkeypatch.undo()
    usual, arrays = call(gf.ensemble(packing)), {}
    for name in set(usual._fields) - {"ends", "walls", "mixing", "counts"}:
        if not name.endswith("seconds") and name != "reach":
            arrays[name] = getattr(usual, name), getattr(first, name)
    for name, (expected, found) in arrays.items():
        assert type(expected) is type(found), name
        assert np.array_equal(expected, found), name


@pytest.mark.parametrize("kind", CALLS)
def test_the_command_line_and_python_find_what_the_other_saved(
    away, packing, capsys, monkeypatch, kind
):
    call, line, _ = CALLS[kind]
    gf.save_packing(packing, "p.npz")
    packing = gf.load_packing("p.npz")  # its gaps are rounded
    with gf.cached() as store:
        call(gf.ensemble(packing))
        assert reported(capsys, line.format("p.npz"))["cached"]
        store.clear(kind)
        assert not reported(capsys, line.format("p.npz"))["cached"]
        monkeypatch.setattr("granforce.study.kinds.cached.get", forbidden)
        call(gf.ensemble(packing))


@pytest.mark.parametrize("box", ["square", "floor"])
def test_a_packing_made_by_the_command_line_is_not_made_again(away, capsys, monkeypatch, box):
    made = f"-n 12 --mu 0.3 --box {box}"
    reported(capsys, f"pack {made}")
    reported(capsys, f"intervals {made}")
    monkeypatch.setattr("granforce.study.kinds.cached.get", forbidden)
    with gf.cached():
        packing = gf.pack(12, 0.3, box=box)
        exact = gf.intervals(gf.ensemble(packing))
    assert packing == gf.pack(12, 0.3, box=box)._replace(info=packing.info)
    assert exact == gf.intervals(gf.ensemble(packing))


def test_conditions_of_ensembles_do_not_collide(tmp_path, packing):
    c = int(gf.ensemble(packing).index[0])
    force, stress = packing.forces[c, 0], gf.admissible_stress(gf.ensemble(packing))
    conditions = (
        {},
        {"mu": 0.4},
        {"prescribed": "stress"},
        {"prescribed": "stress", "stress": stress},
        {"known": gf.Known([c], [force * 0.9], [force * 1.1])},
    )
    usual = [gf.intervals(gf.ensemble(packing, **some)) for some in conditions]
    for _ in range(2):
        with gf.cached(tmp_path / "s") as store:
            found = [gf.intervals(gf.ensemble(packing, **some)) for some in conditions]
        assert found == usual
        assert len(store.entries()) == 1 + len(conditions)


def test_a_change_of_what_was_given_does_not_change_the_key(tmp_path, packing):
    low, high = np.array([[0.0, -1.0]]), np.array([[9.0, 1.0]])
    S = gf.ensemble(packing, known=gf.Known([0], low, high))
    high[:] = 1e-6
    with gf.cached(tmp_path / "s") as store:
        gf.intervals(S)
        (bounds,) = store.find("intervals")[0].params["known"]
    assert bounds == [0, 0, 9, -1, 1]


def test_what_has_no_key_is_computed_as_usual(tmp_path, packing):
    S = gf.ensemble(packing)
    frozen = gf.ensemble(packing, frozen=[0])
    narrowed = S.with_normal(0, S.original)
    calls = [
        lambda: gf.walk(S, 3, relax=gf.nearest),
        lambda: gf.walk(S, 3, max_iterations=900),
        lambda: gf.intervals(S, states=S.original[None]),
        lambda: gf.intervals(S, S.index[1::-1]),
        lambda: gf.intervals(frozen),
        lambda: gf.intervals(narrowed),
        lambda: gf.sample_uniform(S, 8, method="hit_and_run").flat.tolist(),
    ]
    usual = [call() for call in calls]
    with gf.cached(tmp_path / "s") as store:
        for call, expected in zip(calls, usual, strict=True):
            assert call() == expected
        assert store.entries() == []


def test_mistakes_are_refused_as_ever(tmp_path, packing):
    S = gf.ensemble(packing)
    with gf.cached(tmp_path / "s") as store:
        with pytest.raises(gf.InputError, match="states must be"):
            gf.walk(S, 0)
        with pytest.raises(TypeError, match="no_such"):
            gf.volume(S, no_such=1)
        with pytest.raises(gf.InputError, match="a store cannot be continued"):
            gf.sample_uniform(S, 80, previous=gf.sample_uniform(S, 40))
        with pytest.raises(gf.Cancelled):
            gf.sample_uniform(S, 4000, cancel=lambda: True)
        assert sorted(entry.kind for entry in store.entries()) == ["packing", "uniform"]


def test_a_shortfall_is_told_once_by_each_call(tmp_path, packing):
    with gf.cached(tmp_path / "s"):
        for _ in range(2):
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always")
                gf.sample_uniform(gf.ensemble(packing), 8)
            assert [one.category for one in told] == [gf.ResultWarning]
            assert told[0].filename == __file__


def test_the_context_ends_and_is_that_of_one_thread(tmp_path, packing):
    S, found = gf.ensemble(packing), []

    def work(folder):
        with gf.cached(folder):
            found.append(gf.walk(S, 3))

    with gf.cached(tmp_path / "a") as a:
        threads = [threading.Thread(target=work, args=(tmp_path / "b",)) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert a.entries() == []
    assert len(found) == 4 and all(one == found[0] for one in found)
    gf.walk(S, 4)
    walks = cells.entries(gf.open_store(tmp_path / "b"), kinds.WALK)
    assert [entry.params["states"] for entry in walks] == [3]
