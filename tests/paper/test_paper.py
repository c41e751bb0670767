"""The study: its plan, its reduced table, its verdicts, and the command that runs it."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from granforce import measures
from granforce.cli.parser import main
from granforce.explore.stress_outline import stress_plane
from granforce.forces.ensemble import ensemble
from granforce.paper import claims, drawings, findings, tables
from granforce.paper import plan as plans
from granforce.records import InputError
from granforce.study import kinds
from granforce.study.cells import load
from granforce.study.store import open_store

TINY = plans.Plan(
    n=20,
    frictions=(0, 0.1, 0.3),
    packings=2,
    states=6,
    gauss_seidel_packings=1,
    hardest_packings=1,
    fine_frictions=(),
    large_frictions=(),
    many_packings=0,
    exact_packings=1,
    uniform_packings=1,
    response_packings=0,
    perturb_packings=0,
    frozen_packings=1,
    frozen_large=80,
    frozen_large_frictions=(),
    prepared_packings=1,
    prepared_frictions=(),
    sizes=(12,),
    size_frictions=(0.1,),
    largest_exact=12,
    stress_packings=1,
    stress_uniform_packings=1,
    stress_states=5,
    volume_packings=2,
    volume_accuracy=0.5,
    tails_n=20,
    tails_frictions=(0.1, 0.3),
    tails_packings=1,
    tails_states=8,
)
WORDS = [
    *("study", "-n", "20", "--mu", "0,0.1,0.3", "--packings", "2", "--states", "6"),
    *("--gauss-seidel-packings", "1", "--exact-packings", "1", "--uniform-packings", "1"),
    *("--response-packings", "0", "--perturb-packings", "0", "--sizes", "12"),
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
    for mu in plans.FRICTIONS:
        assert {task.seed for task in walks if task.mu == mu} >= set(range(1, 11))
        least = {"exact": 3, "uniform": 3, "sweeps_1e-3": 10, "sweeps_1e-4": 10}
        if mu == 0 or mu >= 0.001:
            least["response"] = 10
        for part, packings in least.items():
            assert sum(task.part == part and task.mu == mu for task in found) >= packings
    for mu in (0.05, 0.07, 0.1, 0.14, 0.2, 0.3):
        for part in ("walk", "exact", "sweeps_1e-3"):
            assert sum(task.part == part and task.mu == mu for task in found) == 30
    pushed = next(task.cell.parameters for task in found if task.part == "response")
    assert pushed["rise"] <= 0.1
    assert 10 * pushed["random"] >= 200
    assert {task.n for task in found} == {100, 200, 400, 800, 1600}
    assert all(task.cell.parameters["states"] == 1000 for task in walks)
    names = [json.dumps([task.cell.kind.name, task.cell.parameters]) for task in found]
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


def test_the_papers_part_is_its_walks_and_its_responses():
    some = plans.chosen(plans.Plan(), plans.PAPER)
    relaxed = {task.cell.parameters.get("relax", "none") for task in some}
    assert relaxed == {"gauss_seidel_only", "none"}
    assert {task.part for task in some} == {
        *("sweeps_1e-3", "sweeps_1e-4", "sweeps_1e-6", "response", "response_long", "perturb")
    }


def test_rows_are_the_numbers_of_their_cells(done):
    table = tables.reduce(done / "cells.zarr", TINY)
    assert table.skipped == {"missing_cells": 0}
    assert len(table.rows) == len(plans.tasks(TINY))
    store = open_store(done / "cells.zarr")
    for task, row in zip(plans.tasks(TINY), table.rows, strict=True):
        dataset = load(store, *task.cell)
        assert (row["part"], row["mu"], row["seed"]) == (task.part, task.mu, task.seed)
        if task.part == "sweeps_1e-6" and not dataset.sizes["state"]:
            continue  # nothing was reached, nothing measured
        if task.cell.kind == kinds.VOLUME:
            assert row["extent"] == dataset["extent"].item()
            assert row["log_volume_error"] <= TINY.volume_accuracy
            continue
        if task.part == "stress":
            assert row["friction"] == dataset["friction"].item()
            assert row["own_shear"] == np.hypot(*dataset["stress_own"].values)
            continue
        assert row["eta3"] == dataset["eta3"].item()
        extent = measures.normal_extent(dataset["low"].values, dataset["high"].values)
        scale = dataset["force_scale"].item()
        assert row["mean_extent"] == pytest.approx(np.mean(extent) / scale if len(extent) else 0)
        if task.cell.kind == kinds.INTERVALS:
            assert row["undetermined"] == np.sum(dataset["cluster"] >= 0)
            assert row["max_gap"] <= 1e-8
    exact, walk = (table.part(part, n=20) for part in ("exact", "walk"))
    for row in exact:
        (beside,) = (w for w in walk if (w["mu"], w["seed"]) == (row["mu"], row["seed"]))
        assert row["mean_extent"] >= beside["mean_extent"] - 1e-9
    for row in table.part("uniform"):
        assert ("walk_ratio" in row) == (row["dimension"] > 0)
    for row, beside in zip(table.part("stress"), table.part("stress_uniform"), strict=True):
        assert (row["mu"], row["seed"]) == (beside["mu"], beside["seed"])
        assert 0 < beside["mean_shear"] < beside["largest_shear"] < row["friction"]
        assert row["own_shear"] < row["friction"]
        task = next(
            t for t in plans.tasks(TINY) if t.part == "stress_uniform" and t.mu == row["mu"]
        )
        packing, _ = kinds.get_packing(store, task.cell.parameters["packing"])
        S, states = ensemble(packing), load(store, *task.cell)["states"].values
        shears = [np.hypot(*stress_plane(S, state)) for state in states]
        np.testing.assert_allclose(
            [np.mean(shears), np.max(shears)], [beside["mean_shear"], beside["largest_shear"]]
        )
    for row in table.part("sweeps_1e-3"):
        assert row["reached_part"] == 1
        assert row["acceptance"] > 0
        # Distances of pairs by pairs.
        assert ("pair_spread" in row) == (row["dimension"] > 0)
    task = next(t for t in plans.tasks(TINY) if (t.part, t.mu) == ("walk", 0.3))
    states = load(store, *task.cell)["states"].values
    apart = [np.linalg.norm(a - b) for k, a in enumerate(states) for b in states[:k]]
    (row,) = (r for r in walk if (r["mu"], r["seed"]) == (0.3, task.seed))
    assert row["pair_spread"] == pytest.approx(np.std(apart) / np.mean(apart), rel=1e-4)


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
    for family in (claims.maximum, claims.correlation, claims.counts, claims.pairs):
        told = (family(each, "nearest") for each in (found, table))
        for one, other in zip(*told, strict=True):
            assert one.verdict == other.verdict
            assert one.value == pytest.approx(other.value, rel=1e-5, nan_ok=True)
    with pytest.raises(InputError, match="no reduced study"):
        tables.load(done / "cells.zarr")


def test_a_part_of_the_cells_makes_a_part_of_the_table(done):
    larger = TINY._replace(packings=3)
    table = tables.reduce(done / "cells.zarr", larger)
    assert table.skipped["missing_cells"] == len(plans.tasks(larger)) - len(plans.tasks(TINY))
    with pytest.raises(InputError, match="nothing of this study"):
        tables.reduce(done / "cells.zarr", TINY._replace(n=21, sizes=(), tails_n=21))


def test_rows_that_a_store_lacks_come_from_the_older_table(done):
    old = tables.reduce(done / "cells.zarr", TINY)
    few = plans.chosen(TINY, ["walk"])
    new = tables.reduce(done / "cells.zarr", TINY)
    kept = [k for k, row in enumerate(new.rows) if row["part"] == "exact"]
    fewer = new._replace(
        rows=[new.rows[k] for k in kept],
        samples={
            name: values[np.isin(new.samples["row"], kept)] for name, values in new.samples.items()
        },
        shown=[],
        packings={},
        skipped={"missing_cells": len(few)},
    )
    fewer.samples["row"][:] = np.searchsorted(kept, fewer.samples["row"])
    fewer.rows[0]["eta3"] = 7.0  # the newer row is the one that is taken
    old.rows.append({"part": "of another plan", "n": 20, "mu": 0.1, "seed": 1})
    lost = fewer.rows[-1].pop("dimension")
    joined = tables.merged(fewer, old)
    assert len(joined.rows) == len(new.rows)
    assert joined.rows[len(fewer.rows) - 1]["dimension"] == lost
    assert joined.rows[0]["eta3"] == 7.0
    for part in ("walk", "exact", "uniform"):
        for mu, group in joined.extents(part).items():
            for one, other in zip(group, new.extents(part)[mu], strict=True):
                assert np.array_equal(one, other)
    for k, normal in joined.shown:
        assert joined.rows[k]["part"] in tables.SHOWN_PARTS
        assert k in joined.packings
        assert normal.shape[1] == joined.rows[k]["contacts"]


def test_every_figure_of_the_table_is_made(done):
    table = tables.reduce(done / "cells.zarr", TINY)
    made = drawings.all_figures(table)
    assert {"figure1", "figure3", "figure4", "figure5", "figure6"} <= made.keys()
    assert {"figure1_uniform", "opened", "frozen", "sizes", "distances"} <= made.keys()
    assert {"volumes", "tails"} <= made.keys()
    assert {"samplers", "effort", "places"} <= made.keys()
    assert made.keys() <= drawings.captions(table).keys()
    assert "Gauss–Seidel" in drawings.captions(table)["figure1"]
    for figure in made.values():
        assert figure(backend="bokeh") is not None


def synthetic(eta, **options):
    """A table of five packings at each of nine μ whose measures are given functions of μ."""
    rng = np.random.default_rng(3)
    rows, samples = [], {name: [] for name in tables.SAMPLES}
    for mu in (0, 0.001, 0.003, 0.01, 0.05, 0.1, 0.3, 1, 10):
        for seed in range(5):
            noise = np.exp(0.05 * rng.normal())
            row = {"part": SWEEPS, "n": 400, "mu": mu, "seed": seed, "dimension": 5.0}
            row |= {"eta1": eta(mu) * noise, "eta2": 1.1 * eta(mu) * noise}
            row |= {"eta3": eta(mu) * noise / 0.15, "coordination": 4 - 0.95 * mu / (mu + 0.1)}
            row |= {"original_distance": 1.0, "mean_distance": 1.5, "contacts": 600.0}
            row |= {"pair_spread": 0.1}
            row["correlation"] = 0.5 * noise if mu < 1 else 0.02 * noise
            row |= {name: f(mu) * noise for name, f in options.items() if name in row}
            row["correlation_low"] = row["correlation"] - 0.1
            row["correlation_high"] = row["correlation"] + 0.1
            extent = options.get("extent", default_extent)(mu, rng)
            normal = rng.permutation(np.r_[np.full(380, 3.0), np.full(420, 0.1)])
            values = (len(rows), 0, options.get("normal", normal), 0, extent)
            for name, value in zip(tables.SAMPLES, values, strict=True):
                samples[name].append(np.broadcast_to(value, extent.shape))
            rows.append(row)
    for row in list(rows):
        answer = {"part": "response", "n": 400, "mu": row["mu"], "seed": row["seed"]}
        answer |= {"critical_force": 1 + eta(row["mu"]), "decay_exponent": 0.5 + eta(row["mu"])}
        answer |= {name: f(row["mu"]) for name, f in options.items() if name in answer}
        rows.append(answer | {"limit_load": 2 * answer["critical_force"]})
    joined = {name: np.concatenate(parts) for name, parts in samples.items()}
    return tables.Table({}, rows, joined, [], {}, {})


SWEEPS = claims.SAMPLERS["gauss_seidel"]


def default_extent(mu, rng):
    """As the paper has it: exponential, with a peak and a fast tail, stretched; ⟨f_n⟩."""
    width = rise_and_fall(mu) if mu else 1e-14
    if mu <= 0.01:
        return width * rng.exponential(1.0, 800)
    if mu <= 0.3:
        return 1.5 * rng.weibull(2.5, 800) * (1 + width)
    return width * rng.weibull(0.6, 800)


def rise_and_fall(mu):
    return 0.2 * mu / (0.1 + mu) / (1 + mu / 0.1) * 4 if mu else 1e-14


def verdicts(table, families=None, sampler="gauss_seidel"):
    """{statement: verdict} of the claims about one sampler and those about packings."""
    found = claims.judged(table)
    if families is not None:
        named = [family(table, sampler) for family in families]
        found = [claim for family in named for claim in family]
    return {c.statement: c.verdict for c in found if c.sampler in (sampler, "")}


def test_what_the_paper_says_is_reproduced_by_what_it_describes():
    found = verdicts(synthetic(rise_and_fall))
    # Its packings all come from contact dynamics.
    without = {"with only the pressure", "and not in", "with frozen", "linear programs", "N"}
    for statement, verdict in found.items():
        if verdict != claims.REPRODUCED:
            assert verdict in (claims.MISSING, claims.FEW), statement
            assert any(word in statement for word in without), statement
    assert sum(verdict == claims.REPRODUCED for verdict in found.values()) >= 30


@pytest.mark.parametrize(
    ("family", "statement", "options"),
    [
        (
            claims.agreement,
            "η1 ≈ η2 ≈ 0.15 η3 up to a constant factor: value of η1/η3",
            {"eta3": lambda mu: 40 * rise_and_fall(mu)},
        ),
        (
            claims.agreement,
            "η1 ≈ η2 ≈ 0.15 η3 up to a constant factor: η2/η1 is constant",
            {"eta1": lambda mu: rise_and_fall(mu) * (1 + 4 * mu)},
        ),
        (claims.maximum, "η2(μ) is not monotonic: largest near μ = 0.1", {"eta2": lambda mu: mu}),
        (
            claims.small_friction,
            "η ∝ μ at small μ: packings made by contact dynamics",
            {"eta2": lambda mu: mu**2},
        ),
        (
            claims.counts,
            "f_n > 2⟨f_n⟩ and ΔF_n > ⟨ΔF_n⟩ hold for about as many contacts (μ = 0.1)",
            {"normal": np.r_[np.full(20, 3.0), np.full(780, 1.0)]},
        ),
        (
            claims.pairs,
            "distances between pairs of states are sharply peaked",
            {"pair_spread": lambda mu: 0.5},
        ),
        (
            claims.extents,
            "ΔF_n is not monotonic: largest at intermediate μ",
            {"extent": lambda mu, r: mu * r.exponential(1.0, 800)},
        ),
        (
            claims.extents,
            "P(ΔF_n) is broadest at intermediate μ",
            {"extent": lambda mu, r: mu * r.exponential(1.0, 800)},
        ),
        (
            claims.correlation,
            "corr(f_n, ΔF_n) vanishes at large μ, against chance",
            {"correlation": lambda mu: 0.19},
        ),
        (
            claims.correlation,
            "the paper's error bar of corr(f_n, ΔF_n) holds 0 at large μ",
            {"correlation": lambda mu: 0.5},
        ),
        (
            claims.response,
            "F_crit is similar at equal η on both sides of the maximum",
            {"critical_force": lambda mu: 3 if mu > 0.1 else 1 + rise_and_fall(mu)},
        ),
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
            {"extent": lambda mu, r: 2 * r.weibull(3, 800)},
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
        (
            claims.response,
            "F_crit rises with η",
            {"critical_force": lambda mu: 2 - rise_and_fall(mu)},
        ),
        (claims.perturbation, "α is largest near μ = 0.1", {"decay_exponent": lambda mu: 1 + mu}),
        (
            claims.centre,
            "the original network lies closer to the centre than sampled states",
            {"original_distance": lambda mu: 2.0},
        ),
    ],
)
def test_what_contradicts_the_paper_is_not_reproduced(family, statement, options):
    found = verdicts(synthetic(rise_and_fall, **options), [family])
    assert found[statement] == claims.FAILED


def test_findings_compare_the_same_packings():
    table = synthetic(rise_and_fall)
    for part, eta3, eta2 in (("walk", 1, 1), ("exact", 2, np.nan), ("uniform", 1, 0.5)):
        for row in table.part(SWEEPS):
            copied = row | {"part": part, "eta3": eta3 * row["eta3"], "eta2": eta2 * row["eta2"]}
            table.rows.append(copied | {"walk_ratio": 1.5, "original_ratio": 0.5})
    told = {finding.statement: finding for finding in findings.found(table)}
    for word in ("small", "intermediate", "large"):
        ratio = told[f"η3 of the walk's states over exact η3, {word} μ"]
        assert (ratio.value, ratio.low, ratio.high) == pytest.approx((0.5, 0.5, 0.5))
        assert told[f"η2 of the walk over η2 of S, {word} μ"].value == pytest.approx(2)
        assert told[f"η2 of gauss_seidel over η2 of nearest, {word} μ"].value == pytest.approx(1)
    assert told["μ where exact η3 is largest"].value == pytest.approx(0.1, rel=0.3)
    slope = told["slope of log exact η3 against log μ, μ = 0.001 … 0.01"]
    assert slope.low < slope.value < slope.high
    assert slope.value == pytest.approx(0.95, abs=0.1)  # the function given, not quite ∝ μ
    assert told["⟨F_crit⟩ over ⟨limit load⟩, large μ"].value == pytest.approx(0.5)
    # The pair's share of the pressure: one contact of 600.
    left_out = told[
        "⟨F_crit⟩ with the pair left out of the pressure over the same with it, large μ"
    ]
    assert 1 < left_out.value < 1.01
    table.rows[:] = table.part(SWEEPS)
    for values in table.samples.values():
        values.resize(0, refcheck=False)
    assert not [f for f in findings.found(table) if "sweeps_1e" not in f.statement]


def test_the_range_of_the_maximum_is_not_biased_by_where_the_grid_lies():
    """A parabola in log μ is found where it is, between grid points and with uneven neighbours."""
    frictions = [0.01, 0.05, 0.07, 0.1, 0.14, 0.2, 0.3, 1]
    for top in (0.08, 0.12, 0.18):
        heights = [[np.exp(-(np.log(mu / top) ** 2))] for mu in frictions]
        assert claims.peak(frictions)(*heights) == pytest.approx(top, rel=1e-6)


def test_the_maximum_is_found_beside_packings_without_indeterminacy():
    assert 0.1 < claims.peak([0.1, 1, 10])([0.2], [0.3], [-1e-17]) < 1
    assert claims.peak([0.01, 0.1, 10])([0.0], [0.0], [0.2]) == 10


def test_a_distribution_has_a_dip_where_its_first_bin_is_low():
    even = np.linspace(0, 1, 1001)[:-1]
    assert claims.dip([even]) == pytest.approx(0, abs=0.01)
    assert claims.dip([even, 0.3 + even / 10]) == pytest.approx(1 - 0.25 / (0.25 + 0.95), abs=0.05)


def test_a_wide_interval_decides_nothing():
    table = synthetic(rise_and_fall)
    for row in table.rows:
        row["correlation"] = 0.9 if row["seed"] == 0 and row["mu"] == 0.3 else 0.11
        if row["mu"] >= 1:
            row["correlation"] = 0.5 * (-1) ** row["seed"] - 0.1
    found = verdicts(table, [claims.correlation])
    assert found["corr(f_n, ΔF_n) vanishes at large μ"] == claims.UNDECIDED


def test_few_disks_decide_nothing():
    table = synthetic(rise_and_fall)
    for row in table.rows:
        row["n"] = 40
    families = [claims.agreement, claims.maximum, claims.correlation, claims.counts, claims.pairs]
    assert set(verdicts(table, families).values()) == {claims.FEW}


def test_a_walk_that_reached_few_states_is_not_judged():
    table = synthetic(rise_and_fall)
    for row in table.part(SWEEPS):
        row["reached_part"] = 0.1 if row["mu"] == 10 else 1.0
    assert 10 not in claims.items(claims.drawn(table, "gauss_seidel"), "eta2")
    assert 10 not in claims.sampled(table, "gauss_seidel")


def test_every_claim_names_its_sampler_and_its_source():
    table = synthetic(rise_and_fall)
    table.rows[:] = [row for row in table.rows if row["mu"] < 0.01]
    for values in table.samples.values():
        values.resize(0, refcheck=False)
    for claim in claims.judged(table):
        assert claim.sampler in {"", *claims.SAMPLERS}
        assert claim.source in {claims.PRE, claims.PRL, claims.OURS}


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
    # The store alone, reduced, tells the same, and so does the reduced study.
    words = [*WORDS, "--reduce", f"{folder}/cells.zarr", "--out", str(tmp_path / "beside")]
    assert main([*words, "--table", f"{folder}/study.zarr", "--formats", "", "--json"]) == 0
    beside = json.loads(capsys.readouterr().out)["claims"]
    assert [claim["verdict"] for claim in beside] == [c["verdict"] for c in told["claims"]]
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
        (["--paper", "--parts", "walk"], "--paper names the parts"),
        (["--reduce", "nowhere.zarr"], "no store"),
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
