"""The study: its plan, its reduced table, its verdicts, and the command that runs it."""

import contextlib
import io
import json
import os
import shutil
import signal
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from heeding import heeding, interrupted, until_it_left

from granforce import measures
from granforce.cli.entry_point import main
from granforce.explore.stress_outline import stress_plane
from granforce.forces.build import ensemble
from granforce.measures import statistics
from granforce.paper import (
    claims,
    csv_tables,
    documents,
    drawings,
    findings,
    formatting,
    tables,
)
from granforce.paper import plan as plans
from granforce.paper.claims import groups, verdicts
from granforce.paper.claims.table import CLAIMS
from granforce.records import InputError
from granforce.study import kinds
from granforce.study.cells import load
from granforce.study.store import open_store
from granforce.system import markdown

TINY = plans.Plan(
    n=20,
    frictions=(0, 0.1, 0.3),
    packings=2,
    states=6,
    gauss_seidel_packings=1,
    response_packings=1,
    response_contacts=3,
    perturb_packings=0,
    prepared_packings=2,
    prepared_frictions=(0.1,),
    opened_packings=2,
    repeat_packings=2,
    repeat_frictions=(0.1,),
    frozen_packings=2,
    frozen_large=80,
    frozen_large_frictions=(),
    stress_packings=2,
    stress_states=5,
    volume_packings=2,
    volume_accuracy=0.5,
    sizes=(12,),
    size_packings=2,
    size_frictions=(0.1,),
    largest_exact=12,
)
WORDS = [
    *("study", "-n", "20", "--mu", "0,0.1,0.3", "--packings", "2", "--states", "6"),
    *("--gauss-seidel-packings", "1", "--response-packings", "0", "--perturb-packings", "0"),
    *("--sizes", "12"),
]

EMPTY = tables.StudyTable({}, tables.make_rows([]), tables.no_samples(), [], {}, {})


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A tiny study, computed once."""
    folder = tmp_path_factory.mktemp("study")
    options = {"workers": 1, "dtypes": {"states": "float32"}}  # as the command keeps them
    assert not plans.compute(folder / "cells.zarr", plans.tasks(TINY), **options)
    return folder


@pytest.fixture(scope="module")
def table(done):
    """It reduced; not to be changed."""
    return tables.reduce(done / "cells.zarr", TINY)


def test_the_default_plan_is_the_papers():
    found = plans.tasks(plans.Plan())
    walks = [task for task in found if task.part == "walk"]
    frictions = {task.mu for task in walks}
    assert 0 in frictions
    assert len(frictions - {0}) >= 12
    assert {0.001, 10} <= frictions
    assert max(frictions) == 10
    pushed = next(task.cell.parameters for task in found if task.part == "response")
    assert "rise" not in pushed and "max_steps" not in pushed
    assert 10 * pushed["random"] >= 200
    assert {task.n for task in found} == {100, 200, 400, 800, 1600}
    assert all(task.cell.parameters["states"] == 1000 for task in walks)
    once = [task for task in found if task.part != "resting_default"]  # some are in "size_exact"
    names = [json.dumps([task.cell.kind.name, task.cell.parameters]) for task in once]
    assert len(set(names)) == len(names)  # no cell twice


def test_columns_are_of_the_same_packings():
    """Exact ones of thirty, all others of the first of those; each variation has a default."""
    made = {}
    for task in plans.tasks(plans.Plan()):
        if task.n == plans.Plan().n:
            packed = task.cell.parameters["packing"]
            made.setdefault(task.part, {}).setdefault(task.mu, []).append(packed)
    for mu in plans.FRICTIONS:
        assert made["exact"][mu] == made["walk"][mu] == made["uniform"][mu]
        assert [packed["seed"] for packed in made["exact"][mu]] == list(range(1, 31))
        for part in ("sweeps_1e-3", "sweeps_1e-4", "sweeps_1e-6", "response", "volume", "stress"):
            few = made[part].get(mu, [])
            assert few == made["exact"][mu][: len(few)]
    default = plans.variations(1)
    for name in default:
        for mu in (0.1, 0.5, 1, 3, 10):
            some = made[f"prepared_{name}"][mu]
            assert some == made[f"prepared_{name}_exact"][mu]
            assert [packed["seed"] for packed in some] == list(range(1, 21))
            (changed,) = {
                tuple(key for key in packed if packed[key] != made["exact"][mu][k].get(key))
                for k, packed in enumerate(some)
            }
            assert changed and set(changed) <= plans.variations(mu)[name].keys()


def test_the_most_valuable_cells_come_first():
    found = plans.tasks(plans.Plan())
    parts = list(dict.fromkeys(task.part for task in found))
    first = [
        "exact",
        "walk",
        "uniform",
        "response",
        "response_long",
        "response_fine",
        "sweeps_1e-3",
    ]
    assert parts[:7] == first
    for part in parts:
        seeds = [task.seed for task in found if task.part == part]
        assert seeds == sorted(seeds)  # any beginning has as many packings at each μ


def test_a_study_that_ends_early_has_its_first_parts(monkeypatch):
    """Cells come in the order of the plan, each packing just before the first that needs it."""
    asked = []
    monkeypatch.setattr(plans.scan, "run", lambda path, cells, **options: asked.extend(cells))
    some = plans.chosen(TINY, ["exact", "walk", "prepared"])
    plans.compute("", some)
    assert [cell for cell in asked if cell.kind != kinds.PACKING] == [task.cell for task in some]
    made = [cell for cell in asked if cell.kind == kinds.PACKING]
    assert made == plans.packings(some)
    for cell in made:
        after = asked[asked.index(cell) + 1]
        assert after.parameters["packing"] == cell.parameters


def test_packings_are_named_once():
    found = plans.packings(plans.tasks(TINY))
    named = [(c.parameters["n"], c.parameters["mu"], c.parameters["seed"]) for c in found]
    assert sorted(named) == sorted(
        [
            *((12, 0.1, seed) for seed in (1, 2)),
            *((20, mu, seed) for mu in (0, 0.1, 0.3) for seed in (1, 2)),
            *((20, 0.1, seed) for seed in (1, 2) for _ in plans.variations(0.1)),
        ]
    )


def test_parts_are_chosen_by_name():
    some = plans.chosen(TINY, ["exact", "opened"])
    assert {t.part for t in some} == {"exact", "opened", "opened_exact", "widest_exact"}
    assert plans.chosen(TINY) == plans.tasks(TINY)
    with pytest.raises(InputError, match="unknown part 'exakt'"):
        plans.chosen(TINY, ["exakt"])


def test_the_papers_part_is_its_walks_and_its_responses():
    some = plans.chosen(plans.Plan(), plans.PAPER)
    relaxed = {task.cell.parameters.get("relax", "none") for task in some}
    assert relaxed == {"gauss_seidel_only", "none"}
    assert {task.part for task in some} == {
        *("sweeps_1e-3", "sweeps_1e-4", "sweeps_1e-6"),
        *("response", "response_long", "response_fine"),
    }


def test_rows_are_the_numbers_of_their_cells(done, table):
    assert table.skipped == {"missing_cells": 0}
    assert len(table.rows) == len(plans.tasks(TINY))
    store = open_store(done / "cells.zarr")
    for task, (_, row) in zip(plans.tasks(TINY), table.rows.iterrows(), strict=True):
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
        if task.cell.kind == kinds.PERTURBATION:
            assert row["critical_force"] == dataset["critical_force"].item()
            continue
        assert row["eta3"] == dataset["eta3"].item()
        extent = measures.normal_extent(dataset["low"].values, dataset["high"].values)
        scale = dataset["force_scale"].item()
        assert row["mean_extent"] == pytest.approx(np.mean(extent) / scale if len(extent) else 0)
        if task.cell.kind == kinds.INTERVALS:
            assert row["undetermined"] == np.sum(dataset["cluster"] >= 0)
            assert row["max_gap"] <= 1e-8
    exact, walk = (table.part(part, n=20) for part in ("exact", "walk"))
    pairs = statistics.paired(exact, walk)
    assert len(pairs) == len(exact) and len(exact)
    assert (pairs["mean_extent"] >= pairs["mean_extent_other"] - 1e-9).all()
    uniform = table.part("uniform")
    assert (uniform["walk_ratio"].notna() == (uniform["dimension"] > 0)).all()
    stressed = (table.part(part).iterrows() for part in ("stress", "stress_uniform"))
    for (_, row), (_, beside) in zip(*stressed, strict=True):
        assert (row["mu"], row["seed"]) == (beside["mu"], beside["seed"])
        assert 0 < beside["mean_shear"] < beside["largest_shear"] < row["friction"]
        assert row["own_shear"] < row["friction"]
        named = "stress_uniform", row["mu"], row["seed"]
        task = next(t for t in plans.tasks(TINY) if (t.part, t.mu, t.seed) == named)
        packing, _ = kinds.get_packing(store, task.cell.parameters["packing"])
        S, states = ensemble(packing), load(store, *task.cell)["states"].values
        shears = [np.hypot(*stress_plane(S, state)) for state in states]
        np.testing.assert_allclose(
            [np.mean(shears), np.max(shears)], [beside["mean_shear"], beside["largest_shear"]]
        )
    swept = table.part("sweeps_1e-3")
    assert (swept["reached_part"] == 1).all() and (swept["acceptance"] > 0).all()
    # Distances of pairs by pairs.
    assert (swept["pair_spread"].notna() == (swept["dimension"] > 0)).all()
    task = next(t for t in plans.tasks(TINY) if (t.part, t.mu) == ("walk", 0.3))
    states = load(store, *task.cell)["states"].values
    apart = [np.linalg.norm(a - b) for k, a in enumerate(states) for b in states[:k]]
    (spread,) = walk["pair_spread"][(walk["mu"] == 0.3) & (walk["seed"] == task.seed)]
    assert spread == pytest.approx(np.std(apart) / np.mean(apart), rel=1e-4)


def test_a_table_survives_its_store(done, table, tmp_path):
    tables.save(table, tmp_path / "study.zarr")
    store = open_store(tmp_path / "study.zarr")
    made = table.rows.loc[list(table.packings), ["n", "mu", "seed"]]
    names = set(made.itertuples(index=False, name=None))
    older = kinds.PACKING.parameters(*min(names), dt=0.5)
    kinds.keep_packing(store, older, next(iter(table.packings.values())))
    tables.save(table, tmp_path / "study.zarr")  # again: replaced, not doubled
    assert len(store.find("study")) == 1
    assert len(store.find("packing")) == len(names)  # none that was made otherwise
    assert all(verdict.ok for verdict in store.verify())
    found = tables.load(tmp_path / "study.zarr")
    pd.testing.assert_frame_equal(found.rows, table.rows, rtol=0, atol=0)
    assert found.skipped == table.skipped
    np.testing.assert_allclose(found.samples, table.samples, rtol=1e-6, atol=1e-7)
    for (one, counted), (other, counts) in zip(found.shown, table.shown, strict=True):
        assert one == other
        assert np.array_equal(counted, counts)
        assert counts.sum(axis=1).max() == TINY.states  # all of them
    assert found.packings.keys() == table.packings.keys()
    for claim in CLAIMS:
        if claim.id in ("peak", "weaker", "equal-counts", "pair-distances"):
            told = (list(claim.measure(each, "nearest")) for each in (found, table))
            for one, other in zip(*told, strict=True):
                value = other.interval(0.95)[0]
                assert one.interval(0.95)[0] == pytest.approx(value, rel=1e-5, nan_ok=True)
    with pytest.raises(InputError, match="no reduced study"):
        tables.load(done / "cells.zarr")


def test_a_part_of_the_cells_makes_a_part_of_the_table(done):
    larger = TINY._replace(packings=3)
    table = tables.reduce(done / "cells.zarr", larger)
    assert table.skipped["missing_cells"] == len(plans.tasks(larger)) - len(plans.tasks(TINY))
    with pytest.raises(InputError, match="no results of this study"):
        tables.reduce(done / "cells.zarr", TINY._replace(n=21, sizes=()))


def test_rows_that_a_store_lacks_come_from_the_older_table(table):
    old = new = table
    few = plans.chosen(TINY, ["walk"])
    rows = new.part("exact")
    place = {k: at for at, k in enumerate(rows.index)}
    samples = new.samples[new.samples["row"].isin(place)]
    lost, rows = rows["dimension"].iloc[-1], rows.reset_index(drop=True)
    rows.loc[0, "eta3"] = 7.0  # the newer row is the one that is taken
    rows.loc[len(rows) - 1, "dimension"] = np.nan
    fewer = new._replace(
        rows=rows,
        samples=samples.assign(row=samples["row"].map(place)),
        shown=[],
        packings={},
        skipped={"missing_cells": len(few)},
    )
    other = tables.make_rows([{"part": "of another plan", "n": 20, "mu": 0.1, "seed": 1}])
    old = old._replace(rows=pd.concat([old.rows, other], ignore_index=True))
    joined = tables.merged(fewer, old)
    assert len(joined.rows) == len(new.rows)
    assert joined.rows.loc[len(rows) - 1, "dimension"] == lost
    assert joined.rows.loc[0, "eta3"] == 7.0
    for part in ("walk", "exact", "uniform"):
        for mu, group in joined.extents(part).items():
            for one, other in zip(group, new.extents(part)[mu], strict=True):
                assert np.array_equal(one, other)
    for k, counts in joined.shown:
        assert joined.rows.loc[k, "part"] in plans.SHOWN_PARTS
        assert k in joined.packings
        assert len(counts) == joined.rows.loc[k, "contacts"]


def test_every_figure_of_the_table_is_made(table):
    made = drawings.all_figures(table)
    assert {"figure1", "figure3", "figure4", "figure5", "figure6"} <= made.keys()
    assert {"samplers", "opened", "sizes", "distances", "volumes"} <= made.keys()
    assert made.keys() <= drawings.captions(table).keys()
    assert "Gauss–Seidel" in drawings.captions(table)["figure1"]
    for name, figure in made.items():
        assert figure(backend="bokeh") is not None, name
    assert "lie outside of S" in drawings.captions(table)["figure1"]


@pytest.fixture(scope="module")
def commanded(done, tmp_path_factory):
    """The folder of a study by the command, which had most cells already, and what it printed."""
    folder = tmp_path_factory.mktemp("command")
    shutil.copytree(done / "cells.zarr", folder / "cells.zarr")
    with contextlib.redirect_stdout(io.StringIO()) as out:
        words = [*WORDS, "--workers", "1", "--out", str(folder)]
        assert main([*words, "--formats", "", "--json"]) == 0
    return folder, out.getvalue()


def test_the_command_computes_and_judges(commanded, tmp_path, capsys):
    folder, printed = commanded
    told = json.loads(printed, parse_constant=pytest.fail)
    assert told["skipped"]["missing_cells"] == 0
    assert [claim["text"] for claim in told["claims"]]
    assert json.loads((folder / "claims.json").read_text()) == told
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
def test_the_command_draws(commanded, tmp_path):
    words = ["study", "--table", f"{commanded[0]}/study.zarr", "--out", str(tmp_path)]
    assert main(words) == 0
    names = {path.name for path in (tmp_path / "figures").iterdir()}
    assert {"figure1.html", "figure1.png", "figure1.svg", "distances.png"} <= names


def test_a_study_tells_what_is_left_and_ends_in_time(commanded, tmp_path, capsys):
    folder = str(commanded[0])
    assert main([*WORDS, "--out", folder, "--status", "--json"]) == 0
    rows = {row["part"]: row for row in json.loads(capsys.readouterr().out)}
    assert all(row["cells"] == row["done"] > 0 for row in rows.values())
    assert {row["minutes left"] for row in rows.values()} == {0.0}
    # A larger study: the time of what is left is that of what is done.
    more = [*WORDS[:6], "4", *WORDS[7:]]
    assert main([*more, "--out", folder, "--status", "--json", "--parts", "walk"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["cells"], row["done"]) == (12, 6)
    assert row["minutes left"] == pytest.approx(row["minutes"], abs=0.2)
    # No time: nothing is begun, and what is missing is told.
    late = ["study", "--quick", "--parts", "walk", "--minutes", "1e-9", "--workers", "1"]
    assert main([*late, "--out", str(tmp_path / "late"), "--formats", ""]) == 2
    assert "has no results of this study" in capsys.readouterr().err
    assert not list((tmp_path / "late" / "cells.zarr").glob("walk-*"))


def test_tables_in_documents_are_renewed(table, tmp_path):
    told = claims.judge(table)
    found = [finding._asdict() for finding in findings.all_findings(table)]
    page = tmp_path / "page.md"
    blocks = "<!-- study: {} -->\nold\n<!-- end -->\n"
    names = ("friction", "sweeps", "preparation", "resting", "claims", "figures")
    names += ("headlines", "highlights", "certificates")
    page.write_text("before\n" + "".join(map(blocks.format, names)) + "after\n")
    (path,) = markdown.marked_files(str(page), documents.KIND)
    documents.renew([path], table, told, found)
    text = page.read_text()
    assert text.startswith("before\n<!-- study: friction -->\n| μ | z | h |")
    assert text.endswith("<!-- end -->\nafter\n")
    assert "\nold\n" not in text
    for claim in told:
        assert claim["text"].replace("|", "\\|") in text
    documents.renew([path], table, told, found)
    assert page.read_text() == text
    page.write_text(blocks.format("everything"))
    with pytest.raises(InputError, match="unknown table 'everything'"):
        documents.renew([path], table, told, found)


def test_numbers_at_each_friction_are_of_packings_with_exact_intervals(table):
    rows = csv_tables.by_friction(table).set_index(["quantity", "mu"])
    walk = statistics.grouped(table.part("walk"), "eta2")[0.3]
    told = rows.loc["η2, nearest-network walk", 0.3].to_list()
    assert told == pytest.approx([walk.mean(), walk.std(ddof=1) / np.sqrt(2), 2])
    # The paper's walk is of the first packing: its ratio is to the other walk in the same one.
    (swept,) = statistics.grouped(table.part("sweeps_1e-3"), "eta2")[0.3]
    ratio = rows.loc["η2, paper's walk over nearest-network walk", 0.3]
    assert (ratio["mean"], ratio["packings"]) == pytest.approx((swept / walk[0], 1))
    for quantity in documents._MEASURES.values():
        assert quantity in rows.index


def test_what_lies_outside_of_s_is_no_value_of_eta(table):
    """At μ = 0 S is one point: sweeps end beside it, by more than its extent."""
    assert groups.outside(table, "walk") == []
    assert 0 in groups.outside(table, "sweeps_1e-3")
    assert (table.part("sweeps_1e-3", "walk")["excess"] >= 0).all()
    assert groups.positive(table.part("walk"), "mu")["excess"].max() < 1e-8
    rows = csv_tables.by_friction(table).set_index(["quantity", "mu"])
    assert ("η2, paper's walk", 0) not in rows.index
    assert rows.loc["excess over the exact intervals, paper's walk to 0.001, ⟨f_n⟩", 0]["mean"] > 0
    assert set(groups.rows_of(table, "gauss_seidel")["mu"]) <= {0.1, 0.3}


def test_sweeps_are_compared_by_the_residual_at_which_they_end(table):
    heads, *lines = table_of(documents.sweeps(table, csv_tables.by_friction(table)))
    words = ["10⁻³", "10⁻⁴", "10⁻⁶"]
    assert heads == ["μ", *(f"sweeps to {word}" for word in words), *(f"η2, {w}" for w in words)]
    (swept,) = statistics.grouped(table.part("sweeps_1e-4"), "mean_sweeps")[0.1]
    assert lines[-1][:3:2] == ["0.1", f"{swept:.0f}" if swept >= 1000 else f"{swept:.3f}"]
    only = table.rows[~table.rows["part"].isin(("sweeps_1e-4", "sweeps_1e-6"))]
    few = table._replace(rows=only)
    text = documents.sweeps(few, csv_tables.by_friction(few))
    assert "| μ | sweeps to 10⁻³ | η2, 10⁻³ |" in text


def test_what_packings_depend_on_is_told_by_paired_differences(table):
    """The default's own mean first."""
    rows = csv_tables.by_preparation(table)
    rows = rows[rows["mu"] == 0.1].set_index(["quantity", "options"])
    assert len(rows.loc["h"]) == 1 + len(plans.variations(0.1))
    some, usual = (
        statistics.grouped(table.part(part, n=20), "dimension")[0.1]
        for part in ("prepared_box_mass_30_exact", "exact")
    )
    assert rows.loc["h", "default"]["mean"] == usual.mean()
    apart = rows.loc["h", "box mass 30"]
    assert (apart["mean"], apart["packings"]) == ((some - usual).mean(), 2)
    assert "up to 2 pairs of packings" in documents.preparation(table).splitlines()[-1]


def test_differences_of_few_packings_are_judged_by_students_t():
    """3.7 standard errors of three pairs are chance; equal differences have no scatter."""
    rows = [
        {"part": part, "n": 20, "mu": 1.0, "seed": seed, "dimension": dimension}
        for part, dimensions in (
            ("exact", (10, 10, 10)),
            ("prepared_few_exact", (13, 15, 18)),
            ("prepared_same_exact", (16, 16, 16)),
            ("prepared_far_exact", (20, 20.01, 20.02)),
        )
        for seed, dimension in enumerate(dimensions)
    ]
    rows += [row | {"part": row["part"].removesuffix("_exact")} for row in rows[3:]]
    text = documents.preparation(EMPTY._replace(plan={"n": 20}, rows=tables.make_rows(rows)))
    cells = {line[0]: line[1] for line in table_of(text)}
    assert cells["default"] == "10.000" and cells["same"] == "+6.000"
    assert cells["few"] == "+5.3(15)" and cells["far"] == "**+10.0100(58)**"
    assert "up to 3 pairs" in text and "corrected for all 2 differences" in text


def table_of(text):
    """The cells of a table in Markdown."""
    lines = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line] for line in lines]


def case(label, verdict, value, span=""):
    numbers = {"value": value, "low": value - 0.1, "high": value + 0.1, "beyond": abs(value - 1)}
    return {"label": label, "packings": 3, "span": span, "verdict": verdict} | numbers


def test_few_cases_are_listed_and_of_many_the_one_that_decides():
    few = [case("η1", verdicts.REPRODUCED, 1.0), case("η2", verdicts.UNDECIDED, 2.0)]
    assert documents.case_texts(few) == ["η1 ✓ 1.00 (0.900 … 1.10)", "η2 ? 2.00 (1.90 … 2.10)"]
    many = [case(f"μ = {mu}", verdicts.REPRODUCED, 1 + mu) for mu in (0.1, 1, 3)]
    many += [case("μ = 10", verdicts.CONTRADICTED, 5.0)]
    assert documents.case_texts(many) == [
        "✓ μ = 0.1 … 3: 4.00 (3.90 … 4.10) at 3",
        "✗ μ = 10: 5.00 (4.90 … 5.10)",
    ]


def test_a_claim_says_by_whose_networks_and_in_which_preparations_it_was_judged():
    one = {"id": "a", "place": "Fig. 4", "text": "It falls.", "number": "b", "why": "so"}
    one |= {"range": "small: ≤ 1; large: ≥ 2", "sampler": "exact", "chosen": "before", "late": ""}
    one["same_networks"] = ""
    one |= {"by": {"exact": {"cases": [case("", verdicts.REPRODUCED, 0.5)]}}}
    usual = one | {"verdict": verdicts.REPRODUCED, "one_preparation": True}
    other = one | {"verdict": verdicts.DEPENDS, "one_preparation": False, "late": "contradicted"}
    other["chosen"] = "after"
    first, second = table_of(documents.claim_table([usual, other]))[2:]
    assert first[:2] == ["`a`<br>Fig. 4", "It falls.<br><small>b, exact intervals</small>"]
    assert first[2] == "small: ≤ 1<br>large: ≥ 2" and second[2] == f"{first[2]} †"
    assert first[4] == "✓\u00a0reproduced<br><small>default preparation only</small>"
    assert second[4].endswith("<small>late drag: contradicted</small>")
    (told,) = csv_tables.by_claim([usual]).to_dict("records")
    assert (told["why"], told["chosen"]) == ("so", "before")


@pytest.mark.parametrize(
    ("mean", "error", "told"),
    [
        (0.0473, 0.0025, "0.0473(25)"),
        (221.7, 2.1, "221.7(21)"),
        (294436.0, 223199.0, "294436(223199)"),
        (-0.6, 1.1, "-0.6(11)"),
        (9.4e-8, 4e-9, "9.40(40)·10⁻⁸"),
        (7.0, 0.0, "7.000"),
        (7.0, np.nan, "7.000"),
    ],
)
def test_a_standard_error_is_given_in_units_of_the_last_digits(mean, error, told):
    assert formatting.concise(mean, error) == told


@pytest.mark.parametrize(
    ("numbers", "told"),
    [
        ((3.9947, 3.99468, 3.99473), "3.99470 (3.99468 … 3.99473)"),
        ((2.05, 2.0, 2.114), "2.05 (2.00 … 2.11)"),
        ((1.0, 1.0, 1.0), "1 (no scatter)"),
        ((1.0, 0.68, 1.0), "1.00 (0.680 … 1.00)"),
        ((0.1, 0.0, 0.121), "0.100 (0 … 0.121)"),
    ],
)
def test_an_interval_has_enough_digits_to_show_its_ends(numbers, told):
    assert formatting.between(*numbers, "({} … {})", range(3, 7)) == told


def test_versions_are_not_mixed(done, table, tmp_path, capsys):
    for (_, row), task in zip(table.rows.iterrows(), plans.tasks(TINY), strict=True):
        assert row["version"] == task.cell.kind.version
        assert row["packing_version"] == task.cell.parameters["packing"]["version"]
    old = table._replace(rows=table.rows.assign(packing_version=1.0))
    walks = table._replace(rows=table.rows[table.rows["part"] == "walk"])
    with pytest.raises(InputError, match="packings of version 1, which cannot be combined with"):
        tables.merged(walks, old)
    unknown = table.rows.assign(version=np.nan, packing_version=np.nan)
    with pytest.raises(InputError, match="version unknown"):
        tables.merged(walks, table._replace(rows=unknown))
    kind = table._replace(rows=table.rows.assign(version=0.0))
    with pytest.raises(InputError, match="exact of version 0"):
        tables.merged(walks, kind)
    # A part that was computed anew, if only in part, has no rows of the older version.
    is_walk = table.rows["part"] == "walk"
    risen = table._replace(rows=table.rows.assign(version=table.rows["version"] - is_walk))
    first = table._replace(rows=table.rows[is_walk][:1], samples=table.samples[:0])
    joined = tables.merged(first, risen)
    assert len(joined.part("walk")) == 1
    assert len(joined.rows) == len(table.rows) - is_walk.sum() + 1
    # A table that mixes them, however it came about, is not read.
    mixed = pd.concat([table.rows[:-1], old.rows[-1:]])
    tables.save(table._replace(rows=mixed), tmp_path / "mixed.zarr")
    assert main(["study", "--table", str(tmp_path / "mixed.zarr"), "--out", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert "the study mixes" in error and len(error.splitlines()) == 1
    tables.save(old, tmp_path / "old.zarr")
    words = [*WORDS, "--reduce", str(done / "cells.zarr"), "--out", str(tmp_path / "out")]
    assert main([*words, "--table", str(tmp_path / "old.zarr")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--minutes", "0"], "--minutes"),
        (["--status"], "no store"),
        (["--documents", "nowhere.md"], "--documents"),
        (["--mu", "0.1;1"], "--mu"),
        (["--packings", "0"], "packings must be at least 1"),
        (["--parts", "everything"], "unknown part"),
        (["--workers", "0"], "--workers"),
        (["--table", "nowhere.zarr"], "cannot be read"),
        (["--sizes", "many"], "--sizes"),
        (["--sizes", "9" * 400], "--sizes: a packing of 999"),
        (["--formats", "gif"], "--formats"),
        (["--paper", "--parts", "walk"], "--paper names the parts"),
        (["--reduce", "nowhere.zarr"], "cannot be read"),
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
    return heeding("-m", "granforce.cli", *words, start_new_session=True)


@pytest.mark.slow
def test_a_killed_study_goes_on_where_it_was(done, tmp_path):
    running = running_study(tmp_path)
    until_it_left(tmp_path / "cells.zarr", "walk-*", 3, running)
    os.killpg(running.pid, signal.SIGKILL)
    running.wait()
    kept = {
        name: (tmp_path / "cells.zarr" / name).stat().st_ctime_ns for name in _entries(tmp_path)
    }
    assert sum(name.startswith("walk") for name in kept) >= 3
    words = [*WORDS, "--out", str(tmp_path), "--workers", "1", "--formats", ""]
    found = subprocess.run(
        [sys.executable, "-m", "granforce.cli", *words], check=True, capture_output=True, text=True
    )
    assert "Traceback" not in found.stderr
    # Nothing that was finished was made again, and two workers made what one had made.
    for name, when in kept.items():
        assert (tmp_path / "cells.zarr" / name).stat().st_ctime_ns == when
    one, other = (tables.reduce(f / "cells.zarr", TINY) for f in (done, tmp_path))
    one, other = (each._replace(rows=each.rows.drop(columns="seconds")) for each in (one, other))
    for part in ("rows", "samples"):
        pd.testing.assert_frame_equal(getattr(one, part), getattr(other, part), rtol=0, atol=0)


@pytest.mark.slow
def test_an_interrupted_study_keeps_what_is_finished(tmp_path):
    running = running_study(tmp_path)
    until_it_left(tmp_path / "cells.zarr", "walk-*", 1, running)
    interrupted(running)
    assert all(verdict.ok for verdict in open_store(tmp_path / "cells.zarr").verify())


def _entries(folder):
    return list(open_store(folder / "cells.zarr", readonly=True))
