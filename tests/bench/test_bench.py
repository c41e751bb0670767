"""The benchmark's parts on tiny sizes: promised fields, honest rows, and what is written."""

import json

import numpy as np
import pytest
from packings import packed

from granforce import bench
from granforce.bench import report, runner, siconos, solvers
from granforce.forces.build import ensemble
from granforce.numerics.lanes import LANES
from granforce.packing.compaction import pack

SMALL = {"n": 30, "frictions": (0.3,)}


def named(rows, key, value):
    (row,) = [row for row in rows if row[key] == value]
    return row


def test_relaxation_compares_all_solvers_on_the_same_starts():
    rows = bench.relaxation(repeats=2, **SMALL)
    assert [row["solver"] for row in rows] == list(solvers.solvers())
    for row in rows:
        assert row["runs"] == 2
        assert 0 < row["fastest"] <= row["seconds"] <= row["slowest"]
        assert row["reached"] == 2 and row["worst_residual"] <= solvers.GOAL
        assert row["note"] == "" and not row["ratio_is_lower_bound"]
    assert named(rows, "solver", solvers.BASELINE)["ratio"] == 1


def test_a_baseline_cut_short_says_so_and_bounds_the_ratio():
    rows = bench.relaxation(repeats=2, sweeps=50, **SMALL)
    base = named(rows, "solver", solvers.BASELINE)
    assert base["reached"] == 0 and base["no_equilibrium"] == 0
    assert base["note"].startswith("2 not converged after ")
    assert not base["ratio_is_lower_bound"]
    assert named(rows, "solver", "nearest")["ratio_is_lower_bound"]


def test_ending_in_motion_is_not_called_converged():
    S = ensemble(packed(30, 0.3))
    run = [
        S_run._replace(residual=1e-3, converged=True)
        for S_run in solvers.runs_of(S, [S.original], *solvers.solvers()["nearest"])
    ]
    told = solvers.summary(run)
    assert told["reached"] == 0 and told["no_equilibrium"] == 1
    assert told["note"] == "1 ended in motion"


def test_contact_updates_tell_whether_siconos_is_there():
    rows = bench.contact_updates(n=30, mu=0.3, sweeps=2000)
    assert rows[0]["solver"] == "granforce sweep" and rows[0]["ns_per_update"] > 0
    assert rows[2]["solver"] == "granforce sweep, groups" and rows[2]["ratio"] > 0
    assert float(rows[2]["note"].split()[-2]) < 1e-6
    assert rows[-1]["solver"] == "Siconos NSGS"
    assert ("absent" in rows[-1]["note"]) == (siconos.interpreter() is None)


@pytest.mark.skipif(siconos.interpreter() is None, reason=siconos.ABSENT)
def test_a_sweep_is_that_of_siconos():
    S = ensemble(packed(30, 0.3))
    found = siconos.against_siconos(S, runner.kicked(S, 1, 0)[0], 1e-4)
    assert found["sweeps"] > 10
    assert found["difference"] < 1e-10


def test_scaling_gives_an_exponent_per_solver():
    rows = bench.scaling(n=30, mu=0.3, tiles=(1, 2), repeats=1)
    sizes = [row["n"] for row in rows if row["solver"] == "nearest"]
    assert sizes == [30, 120, "fit"]
    fits = [row for row in rows if row["n"] == "fit"]
    assert [row["solver"] for row in fits] == list(solvers.solvers())
    assert all(np.isfinite(row["exponent"]) for row in fits if row["exponent"] is not None)


def test_a_solver_out_of_patience_is_left_out_of_larger_sizes():
    rows = bench.scaling(n=30, mu=0.3, tiles=(1, 2), repeats=1, patience=1e-9)
    assert {row["n"] for row in rows} == {30, "fit"}
    assert all(row["exponent"] is None for row in rows if row["n"] == "fit")


def test_an_exponent_is_the_slope_of_the_sizes_that_were_reached():
    rows = [
        {"n": n, "seconds": 1e-3 * n**1.25, "solver": "nearest", "reached": 1, "runs": 1}
        for n in (100, 400, 1600)
    ]
    rows.append({**rows[-1], "n": 6400, "seconds": 1e9, "reached": 0})
    fit = named(solvers.exponents(rows, 0.1), "solver", "nearest")
    assert fit["exponent"] == pytest.approx(1.25)
    assert fit["note"] == "N = 100 … 1600"


def test_walls_of_blocks_agree_with_highs():
    rows = bench.masonry(bench.SMALL)
    assert {row["bodies"] for row in rows} == {56} and rows[-1]["r_hat"] > 0
    compared = [row for row in rows if "difference" in row]
    assert len(compared) == 4 and all(row["difference"] < 1e-8 for row in compared)


def test_compaction_rows():
    rows = bench.compaction(n=30, mu=0.3, steps=(0.05, 1e9), accuracies=(0.01,), seeds=1)
    assert [row["failed"] for row in rows] == [0, 1]
    S = ensemble(pack(30, 0.3, 1, dt=0.05, accuracy=0.01))
    assert rows[0]["z"] == pytest.approx(S.coordination)
    assert rows[0]["h"] == S.dimension
    assert rows[0]["phi"] == pytest.approx(S.packing.packing_fraction)
    assert {"seconds", "steps", "systems", "contact_updates", "overlap"} <= rows[0].keys()
    assert "phi" not in rows[1]


def test_short_runs_are_repeated_and_the_fastest_counts(monkeypatch):
    S, taken = ensemble(packed(30, 0.3)), iter([9.0, 0.03, 0.01, 0.02, 9.0])
    monkeypatch.setattr(solvers, "STEADY", 0.05)

    def solver(S, start, **options):
        return solvers.nearest(S, start, **options)._replace(seconds=next(taken))

    (run,) = solvers.runs_of(S, [S.original], solver, {})
    assert run.seconds == 0.01 and next(taken) == 9.0


def test_compiling_one_kernel_is_timed():
    begin = "import numpy as np; from granforce.numerics.elimination import _by_subtrees"
    (row,) = bench.compiling({"one": f"{begin}; _by_subtrees(np.zeros(2, int), np.zeros(1, int))"})
    assert row["seconds"] > row["seconds_compiled"] > 0 and row["ratio"] > 1


def test_kernels_are_compiled_before_packings_are_timed(monkeypatch):
    made = []
    monkeypatch.setattr(
        bench.packings, "pack", lambda n, *rest, **_: made.append(n) or packed(30, 0.3)
    )
    bench.compaction_growth(mu=0.3, sizes=(400, 800), seeds=1)
    assert made == [bench.packings.WARM_UP, 400, bench.packings.WARM_UP, 800]


def test_compaction_at_each_friction_and_size():
    rows = bench.compaction_frictions(n=30, frictions=(0.3, 1.0), seeds=2)
    assert [row["mu"] for row in rows] == [0.3, 1.0]
    assert all(0 < row["seconds"] <= row["slowest"] and row["seconds_rest"] > 0 for row in rows)
    rows = bench.compaction_growth(mu=0.3, sizes=(20, 30), seeds=1)
    assert [row["n"] for row in rows] == [20, 30, "fit"]
    assert np.isfinite(rows[-1]["exponent"])


def test_pushed_contacts_are_compared_at_the_same_critical_forces():
    rows = bench.pushes(n=20, frictions=(0.3,), contacts=4)
    assert [row["way"] for row in rows] == ["one at a time", f"{LANES} lanes"]
    assert all(row["seconds_per_contact"] > 0 and row["differ"] == 0 for row in rows)


def test_intervals_of_walks_grow_towards_the_exact_ones():
    rows = bench.intervals(n=30, frictions=(0.3,), states=(5, 20))
    exact = named(rows, "method", "exact")
    for method in ("Gauss–Seidel, exact finish", "nearest (PIQP)"):
        few, many = [row for row in rows if row["method"] == method]
        assert (few["states"], many["states"]) == (5, 20)
        assert few["mean_extent"] <= many["mean_extent"] <= exact["mean_extent"] * (1 + 1e-6)
        assert many["extent_part"] == pytest.approx(many["mean_extent"] / exact["mean_extent"])
        assert 0 < few["seconds"] <= many["seconds"]


def test_missing_references_are_told(tmp_path):
    (row,) = bench.interval_methods(folder=tmp_path)
    assert "not found" in row["note"]


TWO = {
    "one": bench.Part(
        lambda quick=False: [{"seconds": 1.5, "quick": quick, "note": ""}],
        "The first",
        {"quick": True},
    ),
    "two": bench.Part(lambda: [{"solver": "a", "ratio": None}, {"solver": "b"}], "The second", {}),
}


def test_run_writes_what_it_returns(tmp_path, capsys):
    found = bench.run(tmp_path / "new", quick=True, parts=TWO)
    assert json.loads((tmp_path / "new" / "bench.json").read_text()) == found
    assert not list((tmp_path / "new").glob("*.part"))
    assert found["one"] == [{"seconds": 1.5, "quick": True, "note": ""}]
    told = capsys.readouterr()
    assert "The first" in told.out and "The second" in told.out
    assert "two: " in told.err and "two: " not in told.out
    assert {"environment", "quick", "seconds", *TWO} == set(found)


def test_figures_are_drawn_from_rows_alone(tmp_path):
    row = {"mu": 0.1, "solver": "nearest", "seconds": 1.0}
    rows = {"relaxation": [row | {"mu": mu} for mu in (0.1, 1.0, 10.0)]}
    assert bench.draw(tmp_path, rows)
    assert {path.name for path in tmp_path.iterdir()} == {"bench.png", "bench.html"}
    assert not bench.draw(tmp_path / "none", {"environment": {}})


def test_main_prints_json_only_when_asked(capsys):
    assert bench.main(None, True, True, TWO)
    assert json.loads(capsys.readouterr().out)["quick"] is True
    assert bench.main(None, True, False, TWO)
    assert "Environment" in capsys.readouterr().out


def test_environment_names_machine_and_versions():
    found = report.environment()
    assert found["cores"] >= 1 and found["cpu"] and found["python"]
    assert found["libraries"]["numba"] and "siconos" in found["libraries"]


def test_table_aligns_and_leaves_out_empty_columns():
    text = report.table("T", [{"a": 1.23456, "b": None, "c": True}, {"a": 10, "b": "", "c": False}])
    assert text.splitlines() == ["T", "-", "a     c", "1.23  yes", "10"]


def test_frames_are_nearer_to_the_truth_when_inferred():
    (row,) = bench.frames(n=60, packings=2, cases=((0.2, 0.1, 1.0),))
    assert 0 < row["likeliest_f_n"] < row["raw_f_n"] and row["likeliest_f_t"] < row["raw_f_t"]
    assert row["stress"] < row["raw_stress"] and row["suspected"] > 0.7
    assert 0.4 < row["cover"] < 0.95 and 0.5 < row["chi"] < 1.6


def test_uniform_states_against_size_reach_what_was_asked_for():
    rows = bench.uniform_growth(n=30, mu=0.3, tiles=(1, 2), effective=60)
    ours = [row for row in rows if "effective" in row]
    assert [row["n"] for row in ours] == [30, 120]
    assert all(row["reached"] and row["effective"] >= 60 for row in ours)
    assert all(row["seconds_of_eight"] > 0 for row in ours)
    assert ours[1]["h"] == 4 * (ours[0]["h"] - 1) + 1
    for place in ("16 rows at a time", "rows within the memory", "all rows kept"):
        *sizes, fit = [row for row in rows if row["rows"] == place]
        cost = [row["seconds_per_state"] for row in sizes]
        assert min(cost) > 0 and np.isclose(fit["exponent"], np.log(cost[1] / cost[0]) / np.log(4))
