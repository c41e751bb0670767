"""The study: its plan, its reduced table, its verdicts, and the command that runs it."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from granforce import measures, sweep
from granforce.cli import main
from granforce.paper import claims, drawings, findings, tables
from granforce.paper import plan as plans
from granforce.records import InputError
from granforce.store import open_store

TINY = plans.Plan(
    n=20,
    frictions=(0, 0.1, 0.3),
    packings=2,
    states=6,
    gauss_seidel_packings=1,
    exact_packings=1,
    uniform_packings=1,
    perturb_packings=0,
    sizes=(12,),
    size_frictions=(0.1,),
    largest_exact=12,
)
WORDS = [
    *("study", "-n", "20", "--mu", "0,0.1,0.3", "--packings", "2", "--states", "6"),
    *("--gauss-seidel-packings", "1", "--exact-packings", "1", "--uniform-packings", "1"),
    *("--perturb-packings", "0", "--sizes", "12"),
]


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A tiny study, computed once."""
    folder = tmp_path_factory.mktemp("study")
    options = {"dtypes": {"states": "float32"}}  # as the command keeps them
    assert not plans.compute(folder / "cells.zarr", plans.tasks(TINY), **options)
    return folder


def test_the_default_plan_is_the_papers():
    found = plans.tasks(plans.Plan())
    walks = [task for task in found if task.part == "walk"]
    frictions = {task.mu for task in walks}
    assert 0 in frictions
    assert len(frictions - {0}) >= 12
    assert {0.001, 10} <= frictions
    assert max(frictions) == 10
    for mu in frictions:
        assert {task.seed for task in walks if task.mu == mu} == set(range(1, 11))
        least = {"exact": 3, "uniform": 3, "gauss_seidel": 2}
        if mu == 0 or mu >= 0.001:
            least["perturb"] = 3
        for part, packings in least.items():
            assert sum(task.part == part and task.mu == mu for task in found) >= packings
    assert {task.n for task in found} == {100, 200, 400, 800, 1600}
    assert all(task.cell.parameters["states"] == 1000 for task in walks)
    names = [json.dumps([task.cell.kind, task.cell.parameters]) for task in found]
    assert len(set(names)) == len(names)  # no cell twice


def test_packings_are_named_once():
    found = plans.packings(plans.tasks(TINY))
    assert sorted((c.parameters["n"], c.parameters["mu"], c.parameters["seed"]) for c in found) == [
        *((12, 0.1, seed) for seed in (1, 2)),
        *((20, mu, seed) for mu in (0, 0.1, 0.3) for seed in (1, 2)),
    ]


def test_parts_are_chosen_by_name():
    some = plans.chosen(TINY, ["exact", "opened"])
    assert {task.part for task in some} == {"exact", "opened", "opened_exact"}
    assert plans.chosen(TINY) == plans.tasks(TINY)
    with pytest.raises(InputError, match="unknown part 'exakt'"):
        plans.chosen(TINY, ["exakt"])


def test_rows_are_the_numbers_of_their_cells(done):
    table = tables.reduce(done / "cells.zarr", TINY)
    assert table.skipped == {"missing_cells": 0}
    assert len(table.rows) == len(plans.tasks(TINY))
    store = open_store(done / "cells.zarr")
    for task, row in zip(plans.tasks(TINY), table.rows, strict=True):
        dataset = sweep.load(store, task.cell)
        assert (row["part"], row["mu"], row["seed"]) == (task.part, task.mu, task.seed)
        assert row["eta3"] == dataset["eta3"].item()
        extent = measures.normal_extent(dataset["low"].values, dataset["high"].values)
        scale = dataset["force_scale"].item()
        assert row["mean_extent"] == pytest.approx(np.mean(extent) / scale if len(extent) else 0)
        if task.cell.kind == "intervals":
            assert row["undetermined"] == np.sum(dataset["cluster"] >= 0)
            assert row["max_gap"] <= 1e-8
    exact, walk = (table.part(part, n=20) for part in ("exact", "walk"))
    for row in exact:
        (beside,) = (w for w in walk if (w["mu"], w["seed"]) == (row["mu"], row["seed"]))
        assert row["mean_extent"] >= beside["mean_extent"] - 1e-9
    for row in table.part("uniform"):
        assert ("walk_ratio" in row) == (row["dimension"] > 0)


def test_a_table_survives_its_store(done, tmp_path):
    table = tables.reduce(done / "cells.zarr", TINY)
    tables.save(table, tmp_path / "study.zarr")
    tables.save(table, tmp_path / "study.zarr")  # again: replaced, not doubled
    store = open_store(tmp_path / "study.zarr")
    assert len(store.find("study")) == 1
    assert all(verdict.ok for verdict in store.verify())
    found = tables.load(tmp_path / "study.zarr")
    known = [{name: value for name, value in row.items() if value == value} for row in table.rows]
    assert found.rows == known
    assert found.skipped == table.skipped
    for name, values in table.samples.items():
        np.testing.assert_allclose(found.samples[name], values, rtol=1e-6, atol=1e-7)
    assert [k for k, _ in found.shown] == [k for k, _ in table.shown]
    assert found.packings.keys() == table.packings.keys()
    for one, other in zip(claims.judged(found), claims.judged(table), strict=True):
        assert one.verdict == other.verdict
        assert one.value == pytest.approx(other.value, rel=1e-5, nan_ok=True)
    with pytest.raises(InputError, match="no reduced study"):
        tables.load(done / "cells.zarr")


def test_a_part_of_the_cells_makes_a_part_of_the_table(done):
    larger = TINY._replace(packings=3)
    table = tables.reduce(done / "cells.zarr", larger)
    assert table.skipped["missing_cells"] == len(plans.tasks(larger)) - len(plans.tasks(TINY))
    with pytest.raises(InputError, match="nothing of this study"):
        tables.reduce(done / "cells.zarr", TINY._replace(n=21, sizes=()))


def test_every_figure_of_the_table_is_made(done):
    table = tables.reduce(done / "cells.zarr", TINY)
    made = drawings.all_figures(table)
    assert {"figure1", "figure3", "figure4", "figure5", "figure6"} <= made.keys()
    assert {"figure1_uniform", "opened", "frozen", "sizes", "distances"} <= made.keys()
    for figure in made.values():
        assert figure(backend="bokeh") is not None


def synthetic(eta, **options):
    """A table of five packings at each of nine μ whose measures are given functions of μ."""
    rng = np.random.default_rng(3)
    rows, samples = [], {name: [] for name in tables.SAMPLES}
    for mu in (0, 0.001, 0.003, 0.01, 0.05, 0.1, 0.3, 1, 10):
        for seed in range(5):
            noise = np.exp(0.05 * rng.normal())
            row = {"part": "walk", "n": 400, "mu": mu, "seed": seed, "dimension": 5.0}
            row |= {"eta1": eta(mu) * noise, "eta2": 1.1 * eta(mu) * noise}
            row |= {"eta3": eta(mu) * noise / 0.15, "coordination": 4 - 0.95 * mu / (mu + 0.1)}
            row |= {"original_distance": 1.0, "mean_distance": 1.5}
            row["correlation"] = 0.5 * noise if mu < 1 else 0.02 * noise
            row |= {name: f(mu) * noise for name, f in options.items() if name in row}
            extent = options.get("extent", default_extent)(mu, rng)
            for name, values in zip(tables.SAMPLES, (len(rows), 0, 0, 0, extent), strict=True):
                samples[name].append(np.broadcast_to(values, extent.shape))
            rows.append(row)
    for row in list(rows):
        answer = {"part": "perturb", "n": 400, "mu": row["mu"], "seed": row["seed"]}
        answer |= {"critical_force": 1 + eta(row["mu"]), "decay_exponent": 0.5 + eta(row["mu"])}
        answer |= {name: f(row["mu"]) for name, f in options.items() if name in answer}
        rows.append(answer | {"limit_load": 2 * answer["critical_force"]})
    joined = {name: np.concatenate(parts) for name, parts in samples.items()}
    return tables.Table({}, rows, joined, [], {}, {})


def default_extent(mu, rng):
    """As the paper has it: exponential, with a peak and a fast tail, stretched."""
    if mu <= 0.01:
        return rng.exponential(1.0, 800)
    return rng.weibull(2.5, 800) if mu <= 0.3 else rng.weibull(0.6, 800)


def rise_and_fall(mu):
    return 0.2 * mu / (0.1 + mu) / (1 + mu / 0.1) * 4 if mu else 1e-14


def verdicts(table, families=claims.FAMILIES):
    return {claim.statement: claim.verdict for family in families for claim in family(table)}


def test_what_the_paper_says_is_reproduced_by_what_it_describes():
    found = verdicts(synthetic(rise_and_fall))
    without = {"with only the pressure", "and not in", "with frozen", "uniform states", "N"}
    for statement, verdict in found.items():
        if verdict != claims.REPRODUCED:
            assert verdict == claims.MISSING, statement
            assert any(word in statement for word in without), statement
    assert sum(verdict == claims.REPRODUCED for verdict in found.values()) >= 16


@pytest.mark.parametrize(
    ("family", "statement", "options"),
    [
        (
            claims.agreement,
            "η1 ≈ η2 ≈ 0.15 η3 over all μ",
            {"eta3": lambda mu: 40 * rise_and_fall(mu)},
        ),
        (claims.maximum, "η2(μ) is not monotonic: largest near μ = 0.1", {"eta2": lambda mu: mu}),
        (claims.small_friction, "η ∝ μ at small μ", {"eta2": lambda mu: mu**2}),
        (
            claims.small_friction,
            "η vanishes at μ = 0 within the solver's accuracy",
            {"eta2": lambda mu: 0.01 + mu},
        ),
        (claims.coordination, "z → 3 at the largest μ", {"coordination": lambda mu: 3.5}),
        (claims.coordination, "z falls with μ", {"coordination": lambda mu: 3 + mu}),
        (
            claims.extents,
            "P(ΔF_n) at small μ falls monotonically",
            {"extent": lambda mu, r: r.weibull(3, 800)},
        ),
        (
            claims.extents,
            "P(ΔF_n) at intermediate μ has a peak",
            {"extent": lambda mu, r: r.weibull(0.9, 800)},
        ),
        (
            claims.extents,
            "tail of P(ΔF_n) at small μ: exponential",
            {"extent": lambda mu, r: r.weibull(2, 800)},
        ),
        (
            claims.correlation,
            "corr(f_n, ΔF_n) vanishes at large μ",
            {"correlation": lambda mu: 0.5},
        ),
        (
            claims.correlation,
            "corr(f_n, ΔF_n) is significant at intermediate μ",
            {"correlation": lambda mu: -0.2},
        ),
        (claims.perturbation, "F_crit rises with η2", {"critical_force": lambda mu: 2 - mu / 10}),
        (claims.perturbation, "α is largest near μ = 0.1", {"decay_exponent": lambda mu: 1 + mu}),
        (
            claims.centre,
            "the original network lies closer to the centre than the walk's states",
            {"original_distance": lambda mu: 2.0},
        ),
    ],
)
def test_what_contradicts_the_paper_is_not_reproduced(family, statement, options):
    found = verdicts(synthetic(rise_and_fall, **options), [family])
    assert found[statement] == claims.FAILED


def test_findings_compare_the_same_packings():
    table = synthetic(rise_and_fall)
    for part, eta3, eta2 in (("exact", 2, np.nan), ("uniform", 1, 0.5), ("gauss_seidel", 1, 1)):
        for row in table.part("walk"):
            copied = row | {"part": part, "eta3": eta3 * row["eta3"], "eta2": eta2 * row["eta2"]}
            table.rows.append(copied | {"walk_ratio": 1.5, "original_ratio": 0.5})
    told = {finding.statement: finding for finding in findings.found(table)}
    for word in ("small", "intermediate", "large"):
        ratio = told[f"η3 of the walk's states over exact η3, {word} μ"]
        assert (ratio.value, ratio.low, ratio.high) == pytest.approx((0.5, 0.5, 0.5))
        assert told[f"η2 of the walk over η2 of S, {word} μ"].value == pytest.approx(2)
        assert told[f"η2 by Gauss–Seidel over default, {word} μ"].value == pytest.approx(1)
    assert told["μ where exact η3 is largest"].value == pytest.approx(0.1, rel=0.3)
    slope = told["slope of log exact η3 against log μ, μ = 0.001 … 0.01"]
    assert slope.low < slope.value < slope.high
    assert slope.value == pytest.approx(0.95, abs=0.1)  # the function given, not quite ∝ μ
    assert told["⟨F_crit⟩ over ⟨limit load⟩, large μ"].value == pytest.approx(0.5)
    table.rows[:] = table.part("walk")
    assert findings.found(table) == []


def test_a_wide_interval_decides_nothing():
    table = synthetic(rise_and_fall)
    for row in table.rows:
        row["correlation"] = 0.9 if row["seed"] == 0 and row["mu"] == 0.3 else 0.11
        if row["mu"] >= 1:
            row["correlation"] = 0.5 * (-1) ** row["seed"] - 0.1
    found = verdicts(table, [claims.correlation])
    assert found["corr(f_n, ΔF_n) vanishes at large μ"] == claims.UNDECIDED


def test_without_data_there_is_no_verdict():
    empty = tables.Table({}, [], {name: np.zeros(0) for name in tables.SAMPLES}, [], {}, {})
    assert set(verdicts(empty).values()) == {claims.MISSING}


def linked(done, folder):
    """A folder for the command that has the cells already."""
    os.makedirs(folder)
    os.symlink(done / "cells.zarr", folder / "cells.zarr")
    return str(folder)


def test_the_command_computes_and_judges(done, tmp_path, capsys):
    folder = linked(done, tmp_path / "out")
    assert main([*WORDS, "--out", folder, "--formats", "", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["skipped"]["missing_cells"] == 0
    assert [claim["statement"] for claim in told["claims"]]
    assert json.loads((tmp_path / "out" / "claims.json").read_text()) == told
    # The reduced study alone tells the same.
    reduced = [*("--table", f"{folder}/study.zarr"), *("--out", str(tmp_path / "again"))]
    assert main(["study", *reduced, "--formats", "", "--json"]) == 0
    again = json.loads(capsys.readouterr().out)["claims"]
    assert [claim["verdict"] for claim in again] == [c["verdict"] for c in told["claims"]]


@pytest.mark.slow
def test_the_command_draws(done, tmp_path):
    folder = linked(done, tmp_path / "out")
    assert main([*WORDS, "--out", folder]) == 0
    names = {path.name for path in (tmp_path / "out" / "figures").iterdir()}
    assert {"figure1.html", "figure1.png", "figure1.svg", "distances.png"} <= names


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--mu", "0.1;1"], "--mu"),
        (["--packings", "0"], "packings must be at least 1"),
        (["--parts", "everything"], "unknown part"),
        (["--workers", "0"], "--workers"),
        (["--table", "nowhere.zarr"], "no store"),
        (["--sizes", "many"], "--sizes"),
        (["--formats", "gif"], "--formats"),
    ],
)
def test_bad_words_are_one_line(tmp_path, capsys, words, told):
    assert main(["study", *words, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def running_study(folder):
    words = [*WORDS[:-2], "--sizes", "12,14,16,18", "--out", str(folder)]
    return subprocess.Popen(
        [sys.executable, "-m", "granforce.cli", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def wait_for(folder, pattern, count, running):
    deadline = time.time() + 200
    while len(list((folder / "cells.zarr").glob(pattern))) < count and time.time() < deadline:
        assert running.poll() is None
        time.sleep(0.01)


@pytest.mark.slow
def test_a_killed_study_goes_on_where_it_was(done, tmp_path):
    running = running_study(tmp_path)
    wait_for(tmp_path, "walk-*", 3, running)
    os.killpg(running.pid, signal.SIGKILL)
    running.wait()
    kept = {
        name: (tmp_path / "cells.zarr" / name).stat().st_ctime_ns for name in _entries(tmp_path)
    }
    assert sum(name.startswith("walk") for name in kept) >= 3
    words = [*WORDS, "--out", str(tmp_path), "--workers", "1", "--formats", ""]
    found = subprocess.run(
        [sys.executable, "-m", "granforce.cli", *words],
        check=True,
        capture_output=True,
        text=True,
    )
    assert "Traceback" not in found.stderr
    # Nothing that was finished was made again, and one worker made what two had made.
    for name, when in kept.items():
        assert (tmp_path / "cells.zarr" / name).stat().st_ctime_ns == when
    one, other = (tables.reduce(f / "cells.zarr", TINY) for f in (done, tmp_path))
    assert [_timeless(row) for row in one.rows] == [_timeless(row) for row in other.rows]
    for name, values in one.samples.items():
        assert np.array_equal(values, other.samples[name])


@pytest.mark.slow
def test_an_interrupted_study_keeps_what_is_finished(tmp_path):
    running = running_study(tmp_path)
    wait_for(tmp_path, "walk-*", 1, running)
    os.killpg(running.pid, signal.SIGINT)
    out, err = running.communicate(timeout=60)
    assert running.returncode == 130
    assert out == ""
    assert "Traceback" not in err
    assert "finished entries are kept" in err
    assert all(verdict.ok for verdict in open_store(tmp_path / "cells.zarr").verify())


def _entries(folder):
    return list(open_store(folder / "cells.zarr", readonly=True))


def _timeless(row):
    return {name: value for name, value in row.items() if name != "seconds" and value == value}
