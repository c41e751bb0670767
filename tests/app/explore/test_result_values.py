"""The numbers of the results line: values with errors, and what they are worth in words."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from small_store import ROOT
from visitor import wait_for

from app.explore import result_values
from app.explore.result_values import between, short, with_error
from app.explore.results_line import results
from app.packing import legend
from app.results.library import Library, Shown


@pytest.fixture
def ready(visited, tmp_path):
    """A page on the walk of 400 disks that ships: 50 of 1000 networks, and exact intervals."""
    library = Library(ROOT / "data" / "start.zarr", tmp_path / "cache.zarr")
    return visited("?n=400&seed=1&mu=0.1", library)


def by_key(found):
    return {one.key: one for one in found}


def test_values_are_those_of_the_states_with_errors_and_of_s(ready):
    found, summary = by_key(result_values.measures(ready)), ready.replay.summary
    for name in ("eta1", "eta2"):
        value, error = map(float, found[name].seen.split(" ± "))
        assert value == pytest.approx(summary[name], rel=1e-2) and 0 < error < 0.05 * value
    assert found["eta3"].seen == short(0.15 * summary["eta3"])
    kept = 0.15 * ready.replay.growth["eta3"][-1]  # of the 50 networks that are stored
    assert float(found["eta3"].seen) > kept + 0.01
    told = results(ready)
    assert 'data-term="error"' in told
    assert "seen in all 1000 networks" in told and "from these 50, the values from all 1000" in told
    assert found["eta3"].exact == short(0.15 * ready.exact["eta3"].item())
    assert float(found["extent"].exact) > float(found["extent"].seen) > 0


def test_whatever_replaces_the_results_is_compared_with_them(state):
    seen, was = state.replay.summary, state.cell.mu
    assert state.before is None and "→" not in results(state)
    state.choose(mu=1)
    wait_for(state)
    now = state.replay.summary
    line = re.sub("<[^>]*>", "", results(state))
    assert f"μ {was:g} → 1, η₁ {short(seen['eta1'])} → {short(now['eta1'])}, " in line
    assert f"h {seen['dimension']} → {now['dimension']}" in line
    state.looks.colour = "extent"
    assert f" at μ = {was:g})" in legend.legend(state)
    state.ask(state.cell.selection._replace(states=5), at_once=True)
    wait_for(state)
    assert state.before.cell.mu == 1  # only the number of networks has changed
    line = re.sub("<[^>]*>", "", results(state))
    assert f"5 networks: η₁ {short(now['eta1'])} → " in line and "μ 1" not in line
    contact = int(np.argmax(np.ptp(state.replay.normal, axis=0)))
    state.knowledge.hold(contact, float(state.replay.normal[1:, contact].mean()))
    wait_for(state)
    state.sample_held()
    wait_for(state)
    line = re.sub("<[^>]*>", "", results(state))
    assert "→" in line.partition("1 force held: η₁ ")[2]


def test_numbers_of_one_state_are_not_mixed_with_those_of_another(state):
    """Networks without the held forces are older; exact values wait for all bounds given them."""
    state.compute_exact()
    wait_for(state)
    free = by_key(result_values.measures(state))["eta3"].exact
    contact = int(np.argmax(np.ptp(state.replay.normal, axis=0)))
    state.knowledge.hold(contact, float(state.replay.normal[1:, contact].mean()))
    assert state.knowledge.whole is None and free not in results(state)
    assert "exact given the held forces: being computed" in results(state)
    assert 'class="line older"' in results(state)
    wait_for(state)
    held = by_key(result_values.measures(state))["eta3"].exact
    assert float(held) < float(free)
    assert f"(exact given the held forces <b>{held}</b>)" in results(state)
    assert "older than the held forces" in results(state)
    state.looks.tab = "perturb"  # a push ignores what is held
    assert f"(exact <b>{free}</b>)" in results(state) and "older" not in results(state)
    state.looks.tab = "intervals"
    state.sample_held()
    wait_for(state)
    assert "older" not in results(state) and "seen given the held forces" in results(state)


def test_results_before_a_release_are_those_of_the_networks_with_the_held_force(state):
    state.compute_exact()
    wait_for(state)
    contact = int(np.argmax(np.ptp(state.replay.normal, axis=0)))
    state.knowledge.hold(contact, float(state.replay.normal[1:, contact].mean()))
    wait_for(state)
    state.sample_held()
    wait_for(state)
    held = short(0.15 * state.replay.summary["eta3"])
    state.ask(state.cell.selection._replace(held=(), states=7), at_once=True)
    assert f"0.15 η₃ (seen) {held}" in results(state).partition("Before: ")[2]


@pytest.mark.parametrize("kind", ["uniform", "walk"])
def test_packings_that_have_nothing_in_common_are_not_compared(state, kind):
    """Only another sampler is named; the colour scale is that of this packing alone."""
    state.ask(state.cell.selection._replace(kind=kind), at_once=True)
    wait_for(state)
    state.open("?scene=slope")
    wait_for(state)
    assert state.before.cell.kind == kind and state.before.cell.mu != state.cell.mu
    now = Shown(state.cell, state.replay, state.exact)
    change = re.sub("<[^>]*>", "", result_values.changes(now, state.before))
    state.looks.colour = "extent"
    assert "at μ" not in legend.legend(state)
    assert change == ("Networks: uniform in S → random walk" if kind == "uniform" else "")
    assert change in results(state)


def test_free_dimensions_are_derived(ready):
    h, _, unknowns, _, equations = by_key(result_values.packing(ready))["h"].exact.split()
    assert int(h) == int(unknowns) - int(equations) == ready.replay.summary["dimension"]
    assert int(unknowns) == 2 * ready.replay.summary["contacts"]


def test_the_walk_says_how_it_was_sampled(ready):
    told = result_values.sampling(ready)
    line = re.sub("<[^>]*>", "", str(told))
    assert line.startswith("nearest-network walk (not uniform), 1000 of 1000 attempts accepted")
    assert "50 kept" in told.networks and "at least" in told.mixing and not told.doubt
    for key in ("walk", "accepted", "ess"):
        assert f'data-term="{key}"' in str(told)
    assert told.verdict == "mixed" and "≤ 1.1" in told.mixing and ">mixed</span>" in str(told)


def test_a_walk_that_is_short_is_not_said_to_have_mixed(state):
    told = result_values.sampling(state)
    assert not told.verdict and "too few" in told.doubt
    assert "±" not in result_values.measures(state)[0].seen


def test_errors_have_two_digits():
    assert with_error(0.101234, 0.00123) == "0.1012 ± 0.0012"
    assert with_error(-487.23, 12.7) == "−487 ± 13"
    assert with_error(0.5, float("nan")) == "0.5000"
    assert between(1.40012, 1.40034) == "1.40012 … 1.40034" and between(2.0, 2.0) == "2.000"
    assert short(1e-17) == "0" and short(float("nan")) == "–"
    assert [short(value) for value in (0.118, 0.2084, 2, 1234, 12345)] == [
        "0.1180", "0.2084", "2.000", "1234", "1.234e+04",
    ]  # fmt: skip


def test_infinite_intervals_make_their_mean_infinite_and_are_drawn_as_the_longest():
    high = np.array([[3.0, 0.0], [np.inf, 0.0], [1.0, 0.0]])
    possible = xr.Dataset(
        {
            "low": (("contact", "component"), np.zeros((3, 2))),
            "high": (("contact", "component"), high),
            "force_scale": 2.0,
        }
    )
    assert result_values._mean_extent(possible) == "∞"
    assert with_error(np.nan, 0.1) == "–"
    exact = {"low": np.zeros(3), "high": high[:, 0]}
    assert legend.normal_extent(None, exact).tolist() == [3.0, 3.0, 1.0]


def test_an_empty_colour_scale_says_why():
    def end(dimension, most=0.0, full=None):
        shown, looks = SimpleNamespace(summary={"dimension": dimension}), SimpleNamespace(full=full)
        one = SimpleNamespace(shown=shown, looks=looks, drawn=None, free=None, before=None)
        return legend._full(one, most)

    assert end(0) == "0: every force is determined"
    assert end(51) == "(being computed)"
    assert end(51, 2.5) == "≥ 2.50 ⟨fₙ⟩ (seen, this packing)"
    assert end(51, 2.5, 2.5) == "≥ 2.50 ⟨fₙ⟩ (seen)"
