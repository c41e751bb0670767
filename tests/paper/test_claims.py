"""Claims: those of the paper are reproduced by what it describes; at a knife edge none is."""

import numpy as np
import pandas as pd
import pytest

from granforce.paper import claims, findings, tables, tails
from granforce.paper.claims import figure1, figure2, figure4, groups, verdicts

PACKINGS, CONTACTS = 10, 2000


def synthetic(eta, **options):
    """A table of ten packings at each of nine μ whose measures are given functions of μ."""
    rng = np.random.default_rng(3)
    rows, samples = [], {name: [] for name in tables.SAMPLES}
    for mu in (0, 0.001, 0.003, 0.01, 0.05, 0.1, 0.3, 1, 10):
        for seed in range(PACKINGS):
            noise = np.exp(0.05 * rng.normal())
            row = {"part": SWEEPS, "n": 400, "mu": mu, "seed": seed, "dimension": 5.0}
            row |= {"eta1": eta(mu) * noise, "eta2": 1.1 * eta(mu) * noise}
            row |= {"eta3": eta(mu) * noise / 0.15, "coordination": 4 - 0.998 * mu / (mu + 0.02)}
            row |= {"original_distance": 1.0, "mean_distance": 1.5, "contacts": 600.0}
            row |= {"pair_spread": 0.1}
            row["correlation"] = noise * (0.3 if mu < 0.05 else 0.5 if mu < 1 else 0.02)
            row |= {name: f(mu) * noise for name, f in options.items() if name in row}
            row["correlation_low"] = row["correlation"] - 0.1
            row["correlation_high"] = row["correlation"] + 0.1
            extent = options.get("extent", default_extent)(mu, rng)
            # Nearly half of the contacts are strong, most of them with large extents, but at 10.
            tied = extent if mu < 10 else 1.0
            rank = np.argsort(np.argsort(tied * np.exp(0.3 * rng.normal(size=len(extent)))))
            normal = options.get("normal", np.where(rank >= 0.53 * len(extent), 3.0, 0.01))
            place = options.get("place", lambda extent, rng: rng.random(len(extent)))(extent, rng)
            values = (len(rows), 0, normal, normal - place * extent, extent)
            for name, value in zip(tables.SAMPLES, values, strict=True):
                samples[name].append(np.broadcast_to(value, extent.shape))
            rows.append(row)
    for row in list(rows):
        answer = {"part": "response", "n": 400, "mu": row["mu"], "seed": row["seed"]}
        answer |= {"critical_force": 1 + eta(row["mu"]), "decay_exponent": 0.5 + eta(row["mu"])}
        answer |= {name: f(row["mu"]) for name, f in options.items() if name in answer}
        rows.append(answer | {"limit_load": 2 * answer["critical_force"]})
    return study(rows, {name: np.concatenate(parts) for name, parts in samples.items()})


def study(rows=(), samples=None, plan=None, **more):
    """A table of some rows."""
    samples = tables.no_samples() if samples is None else pd.DataFrame(samples)
    return tables.StudyTable(plan or {}, tables.make_rows(rows), samples, [], {}, {}, **more)


def with_rows(table, *more):
    """A table with more rows at its end."""
    rows = pd.concat([table.rows, *more], ignore_index=True)
    return table._replace(rows=tables.make_rows(rows))


def changed(table, part, mu=None, **columns):
    """A table with other numbers in a part, at one μ or at all."""
    rows = table.rows.copy()
    chosen = (rows["part"] == part) & (True if mu is None else rows["mu"] == mu)
    for name, values in columns.items():
        rows.loc[chosen, name] = values(rows[chosen]) if callable(values) else values
    return table._replace(rows=rows)


SWEEPS = groups.SAMPLERS["gauss_seidel"]


def default_extent(mu, rng):
    """As the paper has it: exponential, with a peak and a fast tail, stretched; ⟨f_n⟩."""
    width = rise_and_fall(mu) if mu else 1e-14
    if mu <= 0.01:
        return width * rng.exponential(1.0, CONTACTS)
    if mu <= 0.3:
        return 1.5 * rng.weibull(2.5, CONTACTS) * (1 + width)
    return width * rng.weibull(0.6, CONTACTS)


def rise_and_fall(mu):
    return 0.4 * (mu / 0.1) / (1 + (mu / 0.1) ** 2) if mu else 1e-14


def judged(table, families=None, sampler="gauss_seidel"):
    """{id: verdict} of the claims about one sampler and those about packings."""
    if families is None:
        found = claims.judged(table)
    else:
        found = [claim for family in families for claim in family(table, sampler)]
    return {c.id: c.verdict for c in found if c.sampler in (sampler, "")}


def test_what_the_paper_says_is_reproduced_by_what_it_describes():
    found = judged(synthetic(rise_and_fall))
    # Its packings all come from contact dynamics.
    without = {"everywhere", "cluster", "frozen", "finished", "size"}
    without.add("eta3-of-samples")  # there are no exact bounds
    without |= {"repeated-walks", "longer-walk", "power-law"}  # nor these
    for name, verdict in found.items():
        few_packings = "error-bar" in name  # even ten of ten leave a fraction of 0.7 possible
        if few_packings or ("tail" in name and "0.5" not in name):
            assert verdict in (verdicts.REPRODUCED, verdicts.UNDECIDED)
        elif verdict != verdicts.REPRODUCED:
            assert verdict in (verdicts.MISSING, verdicts.FEW), name
            assert any(word in name for word in without), name
    assert sum(verdict == verdicts.REPRODUCED for verdict in found.values()) >= 45


def weak_first(mu, rng):
    """Extents of contacts of which the first, the strong ones, are determined best."""
    return np.sort(rng.weibull(2.5, CONTACTS))


@pytest.mark.parametrize(
    ("family", "name", "options"),
    [
        (claims.agreement, "eta1-eta3-ratio", {"eta3": lambda mu: 40 * rise_and_fall(mu)}),
        (
            claims.agreement,
            "eta2-eta1-constant",
            {"eta1": lambda mu: rise_and_fall(mu) * (1 + 4 * mu)},
        ),
        (claims.maximum, "eta2-turns", {"eta2": lambda mu: 1 / (mu + 1e-4)}),
        (claims.small_friction, "small-friction-dynamic", {"eta2": lambda mu: mu**2}),
        (
            claims.counts,
            "equal-counts",
            {"normal": np.r_[np.full(20, 3.0), np.full(CONTACTS - 20, 1.0)]},
        ),
        (claims.pairs, "pair-distances", {"pair_spread": lambda mu: 0.5}),
        (
            claims.widths,
            "extent-peak",
            {"extent": lambda mu, r: mu * r.exponential(1.0, CONTACTS)},
        ),
        (claims.widths, "width-peak", {"extent": lambda mu, r: mu * r.exponential(1.0, CONTACTS)}),
        (claims.correlation, "correlation-vanishes-chance", {"correlation": lambda mu: 0.19}),
        (claims.error_bars, "error-bar-large", {"correlation": lambda mu: 0.5}),
        (
            claims.response,
            "critical-force-branches",
            {"critical_force": lambda mu: 3 if mu > 0.1 else 1 + rise_and_fall(mu)},
        ),
        (claims.vanishing, "vanishing", {"eta2": lambda mu: 0.01 + mu}),
        (claims.coordination, "z-largest", {"coordination": lambda mu: 3.5}),
        (claims.coordination, "z-falls", {"coordination": lambda mu: 3 + mu}),
        (claims.shape, "shape-small", {"extent": lambda mu, r: 2 * r.weibull(3, CONTACTS)}),
        (
            claims.shape,
            "scaled-shape-intermediate",
            {"extent": lambda mu, r: r.weibull(0.9, CONTACTS)},
        ),
        (claims.tails, "tail-small-0.5", {"extent": lambda mu, r: r.weibull(2, CONTACTS)}),
        (claims.correlation, "correlation-vanishes", {"correlation": lambda mu: 0.5}),
        (claims.correlation, "correlation-significant", {"correlation": lambda mu: -0.2}),
        (
            claims.response,
            "critical-force-rises",
            {"critical_force": lambda mu: 2 - rise_and_fall(mu)},
        ),
        (claims.perturbation, "decay-exponent-peak", {"decay_exponent": lambda mu: 1 + mu}),
        (
            claims.correlation,
            "correlation-weaker-small",
            {"correlation": lambda mu: 0.7 if mu < 0.05 else 0.5},
        ),
        (
            claims.enrichment,
            "enrichment",
            {"normal": np.r_[np.full(20, 3.0), np.full(CONTACTS - 20, 1.0)], "extent": weak_first},
        ),
        (
            claims.elongation,
            "elongation-large",
            {"extent": lambda mu, r: r.weibull(2.5 if mu < 1 else 4, CONTACTS)},
        ),
        (claims.centre, "centre", {"original_distance": lambda mu: 2.0}),
    ],
)
def test_what_contradicts_the_paper_is_not_reproduced(family, name, options):
    found = judged(synthetic(rise_and_fall, **options), [family])
    assert found[name] in (verdicts.CONTRADICTED, verdicts.STRONGLY)


@pytest.mark.parametrize(
    ("family", "name", "options", "verdict"),
    [
        # A contact lies the higher in its interval the longer that is: no chance.
        (
            claims.origin,
            "origin",
            {
                "normal": 3 * np.arange(CONTACTS) / CONTACTS,
                "extent": lambda mu, r: np.linspace(0.5, 3, CONTACTS),
                "place": lambda extent, rng: extent / 3,
            },
            verdicts.STRONGLY,
        ),
        (
            claims.patterns,
            "patterns",
            {
                "normal": np.r_[np.full(CONTACTS - 300, 1.0), np.full(300, 5.0)],
                "extent": weak_first,
            },
            verdicts.STRONGLY,
        ),
        (
            claims.relative,
            "relative-turns",
            {"extent": lambda mu, r: (0.1 + mu) * r.weibull(2.5, CONTACTS)},
            verdicts.CONTRADICTED,
        ),
        (
            claims.relative,
            "relative-weak",
            {
                "normal": np.linspace(0.5, 1, CONTACTS),
                "extent": lambda mu, r: np.linspace(0.5, 3, CONTACTS),
            },
            verdicts.STRONGLY,
        ),
    ],
)
def test_what_a_figure_is_said_to_show_can_fail(family, name, options, verdict):
    assert judged(synthetic(rise_and_fall, **options), [family])[name] == verdict


def test_a_power_law_and_an_exponential_are_told_apart(rng):
    r = 0.25 + 0.5 * np.arange(3, 17)
    for law, verdict in ((r**-0.7, verdicts.REPRODUCED), (np.exp(-r / 4), verdicts.CONTRADICTED)):
        table, decays = synthetic(rise_and_fall), {}
        answers = table.part("response")
        for row in answers[answers["mu"] >= 0.01].itertuples():
            shells = len(r) - row.seed % 2  # boxes differ
            noise = np.exp(0.05 * rng.normal(size=shells))
            decays[row.Index] = np.column_stack([r[:shells], law[:shells] * noise])
        (claim,) = figure2.law(table._replace(decays=decays), "")
        assert claim.verdict == verdict
    decays = {k: decay[:3] for k, decay in decays.items()}
    assert next(figure2.law(table._replace(decays=decays), "")).verdict == verdicts.MISSING


@pytest.mark.parametrize(
    ("scatter", "longer", "verdict"),
    [(0.01, 1.0, verdicts.REPRODUCED), (0.3, 1.3, verdicts.STRONGLY)],
)
def test_walks_are_repeated_in_the_same_packings(rng, scatter, longer, verdict):
    table = synthetic(rise_and_fall)
    rows = table.part(SWEEPS)
    rows = rows[rows["mu"].isin((0.1, 10))]
    longer = {name: rows[name] * longer for name in ("eta2", "eta3")}
    more = [rows.assign(part="repeat_sweeps_long", **longer)]
    for k in (1, 2):
        eta = rows["eta2"] * np.exp(scatter * rng.normal(size=len(rows)))
        more.append(rows.assign(part=f"repeat_sweeps_{k}", eta2=eta))
    table = with_rows(table, *more)
    found = judged(table, [claims.reproducible])
    assert len(found) == 3
    assert set(found.values()) == {verdict}


def test_cones_and_contacts_are_judged_each_by_itself():
    table = synthetic(rise_and_fall)
    exact = table.part(SWEEPS).assign(part="exact")
    exact = exact.assign(eta3=np.where(exact["mu"] == 10, 5.0, 1.0))[exact["mu"] > 0]
    some = exact[exact["mu"] < 10]
    table = with_rows(
        table,
        exact.assign(
            part="opened_exact", packing_mu=0, eta3=30 * exact["mu"] ** 0.3 + 0.01 * exact["seed"]
        ),
        exact,
        some.assign(
            part="widest_exact",
            packing_mu=some["mu"],
            mu=10,
            eta3=18 - np.log(some["mu"]) + 0.01 * some["seed"],
        ),
    )
    opened, contacts = claims.causes(table, "exact")
    assert opened.verdict == verdicts.REPRODUCED
    # Packings with the most friction are those of exact bounds, those without were opened.
    assert contacts.verdict == verdicts.REPRODUCED
    assert contacts.value == pytest.approx(-1)
    table = changed(table, "opened_exact", eta3=lambda rows: 30 - rows["mu"])
    opened, contacts = claims.causes(table, "exact")
    assert opened.verdict == verdicts.STRONGLY


def test_findings_compare_the_same_packings():
    table = synthetic(rise_and_fall)
    rows = table.part(SWEEPS).assign(walk_ratio=1.5, original_ratio=0.5)
    table = with_rows(
        table,
        *(
            rows.assign(part=part, eta3=eta3 * rows["eta3"], eta2=eta2 * rows["eta2"])
            for part, eta3, eta2 in (("walk", 1, 1), ("exact", 2, np.nan), ("uniform", 1, 0.5))
        ),
    )
    told = {(finding.id, finding.span): finding for finding in findings.measured(table)}
    for word in ("small", "intermediate", "large"):
        ratio = told["coverage-nearest", word]
        assert (ratio.value, ratio.low, ratio.high) == pytest.approx((0.5, 0.5, 0.5))
        assert told["eta2-nearest", word].value == pytest.approx(2)
    assert told["exact-peak", ""].value == pytest.approx(0.1, rel=0.3)
    slope = told["exact-slope-above", ""]
    assert slope.low < slope.value < slope.high
    assert slope.value == pytest.approx(1, abs=0.05)
    assert told["part-of-load", "large"].value == pytest.approx(0.5)
    # The pair's share of the pressure: one contact of 600.
    assert 1 < told["excluded-pair", "large"].value < 1.01
    table = table._replace(rows=table.part(SWEEPS), samples=tables.no_samples())
    assert not [f for f in findings.measured(table) if "sweeps_1e" not in f.statement]


def peak_of(heights):
    keys = np.array(list(heights), dtype=float)
    return verdicts.peak(keys, np.array(list(heights.values())))


def test_the_range_of_the_maximum_is_not_biased_by_where_the_grid_lies():
    """A parabola in log μ is found where it is, between grid points and with uneven neighbours."""
    for top in (0.08, 0.12, 0.18):
        heights = {
            mu: 5 - np.log(mu / top) ** 2 for mu in (0.01, 0.05, 0.07, 0.1, 0.14, 0.2, 0.3, 1)
        }
        assert peak_of(heights) == pytest.approx(top, rel=1e-6)


def test_a_maximum_beyond_the_window_of_its_parabola_is_not_clipped():
    """The largest mean is an outlier at 0.2; all others lie on a parabola with its top at 0.45."""
    heights = {mu: 5 - np.log(mu / 0.45) ** 2 for mu in (0.1, 0.14, 0.2, 0.3, 0.5, 1, 2)}
    heights[0.2] += 0.2 + heights[0.5] - heights[0.2]
    heights[0.14] = heights[0.1] = 0
    assert peak_of(heights) > 0.3 * (1 + 1e-6)  # the last mean within the window of 0.2
    assert peak_of({0.1: 1, 1: 2, 10: 3}) == 10
    assert peak_of({0.1: 0.2, 1: 0.3, 10: -1e-17}) < 1
    assert peak_of({0.01: -0.3, 0.1: -0.1, 1: -0.3}) == pytest.approx(0.1)  # of any sign


def test_negative_exponents_count():
    signs = {"decay_exponent": lambda rows: np.where(rows["seed"] < 5, -0.1, 0.1)}
    table = changed(synthetic(rise_and_fall), "response", 0.1, **signs)
    _, alpha = figure2.perturbation(table, "")
    assert alpha.value != pytest.approx(0.1, rel=0.5)
    rises = {c.id: c for c in figure2.response(table, "gauss_seidel")}
    assert rises["decay-exponent-rises"].verdict != verdicts.REPRODUCED


def test_what_rises_to_the_end_is_monotonic(rng):
    def turning(heights):
        noise = {mu: height + 0.05 * rng.normal(size=10) for mu, height in heights.items()}
        return verdicts.turns("", "", packings(noise))

    assert turning({0.01: 0, 0.1: 1, 1: 2, 10: 1}).verdict == verdicts.REPRODUCED
    assert turning({0.01: 0, 0.1: 1, 1: 2, 10: 3}).verdict == verdicts.CONTRADICTED
    assert turning({0.01: 3, 0.1: 2, 1: 1, 10: 0.5}).verdict == verdicts.CONTRADICTED
    # It rises for certain, and whether it falls again nobody knows.
    plateau = turning({0.01: 0.1, 0.1: 1, 1: 2, 10: 2})
    assert plateau.verdict == verdicts.UNDECIDED
    assert plateau.low < 0 < plateau.high
    # Of a constant the largest is not picked for free.
    flat = [turning(dict.fromkeys((0.01, 0.03, 0.1, 0.3, 1, 3, 10), 1.0)) for _ in range(20)]
    assert sum(claim.verdict == verdicts.REPRODUCED for claim in flat) <= 1
    few = {mu: [(20, height) for height in rng.random(3)] for mu in (0.1, 1, 10)}
    assert verdicts.turns("", "", few).verdict == verdicts.FEW
    assert verdicts.turns("", "", {}).verdict == verdicts.MISSING


def test_coordination_has_to_come_near_its_limit():
    for height, verdict in ((3.005, verdicts.REPRODUCED), (3.02, verdicts.CONTRADICTED)):
        near = {"coordination": lambda rows, height=height: height + 1e-4 * rows["seed"]}
        table = changed(synthetic(rise_and_fall), SWEEPS, **near)
        assert judged(table, [claims.coordination])["z-largest"] == verdict


def packings(values, n=400):
    return {mu: [(n, value) for value in group] for mu, group in values.items()}


def over_all(groups, good, fair=None, statistic=verdicts.slope, **options):
    return verdicts.over_all("", "", "", statistic, groups, good=good, fair=fair, **options)


def test_a_verdict_at_a_knife_edge_is_undecided(rng):
    """A slope of 0.5 ± 0.02: clear of an end of the range, across it, and turned by one μ."""
    clear = packings({mu: mu**0.5 * np.exp(0.1 * rng.normal(size=10)) for mu in (0.1, 1, 10, 100)})
    assert over_all(clear, (0.3, 0.7)).verdict == verdicts.REPRODUCED
    assert over_all(clear, (0.7, 0.9)).verdict == verdicts.CONTRADICTED  # there is no wider range
    assert over_all(clear, (0.7, 0.9), (0.6, 1)).verdict == verdicts.STRONGLY
    assert over_all(clear, (0.7, 0.9), (0.2, 0.9)).verdict == verdicts.CONTRADICTED
    edge = over_all(clear, (0.3, 0.5))
    assert edge.verdict == verdicts.UNDECIDED
    assert edge.low < 0.5 < edge.high
    turned = packings({1: [1.0] * 10, 10: [10.0] * 10, 100: [12.0] * 10})
    found = over_all(turned, (0.45, 1.1))
    assert found.verdict == verdicts.UNDECIDED
    assert found.before == verdicts.REPRODUCED
    assert found.why.startswith("reproduced, but ") and "without μ = 1" in found.why
    # Certainly outside, but not always beyond the wider range.
    found = over_all(turned, (1.2, 2), (0.8, 2))
    assert over_all(turned, (1.2, 2), (0.2, 2)).verdict == verdicts.CONTRADICTED
    assert found.verdict == verdicts.CONTRADICTED
    assert "contradicted without μ = 100" in found.why


def test_another_seed_of_the_bootstrap_never_turns_a_verdict(rng):
    """Ranges that end about where the interval does: reproduced becomes undecided at the most."""
    groups = packings({mu: mu**0.5 * np.exp(0.1 * rng.normal(size=10)) for mu in (0.1, 1, 10, 100)})
    high = over_all(groups, (0, 1)).high
    for end in high + np.linspace(-0.01, 0.01, 9):
        told = {over_all(groups, (0.3, end), seed=seed).verdict for seed in range(3)}
        assert told <= {verdicts.REPRODUCED, verdicts.UNDECIDED}
        if end < high - 0.004 or end > high + 0.008:
            assert len(told) == 1


def test_a_change_of_sign_at_one_friction_is_not_averaged_away(rng):
    values = {mu: 0.5 + 0.02 * rng.normal(size=10) for mu in (0.1, 1, 10)}
    claim = verdicts.at_each("", "", "", packings(values), good=(0, 1))
    assert claim.verdict == verdicts.REPRODUCED
    values[1] = 1.2 + 0.02 * rng.normal(size=10)
    claim = verdicts.at_each("", "", "distance", packings(values), good=(0, 1), fair=(0, 1.1))
    assert claim.verdict == verdicts.CONTRADICTED
    assert claim.why == "reproduced at 0.1, 10; strongly contradicted at 1"
    assert claim.value == pytest.approx(1.2, abs=0.05)
    assert (claim.measured, claim.number) == ("distance, at the deciding μ (1)", "distance")
    assert (claim.good, claim.fair) == ("0 … 1", "0 … 1.1")
    values = {mu: group + 1 for mu, group in values.items()}
    claim = verdicts.at_each("", "", "", packings(values), good=(0, 1), fair=(0, 1.1))
    assert claim.verdict == verdicts.STRONGLY
    assert verdicts.at_each("", "", "", packings(values, 1), good=(0, 1)).verdict == (verdicts.FEW)


def test_an_interval_ends_at_possible_values_and_may_be_too_wide():
    few = packings({1: [0.2, 1.0, 0.9]})
    claim = verdicts.at_each("", "", "", few, good=(0.5, 1), possible=verdicts.FRACTION)
    assert (claim.low, claim.high, claim.verdict) == (0, 1, verdicts.FEW)
    claim = verdicts.at_each("", "", "", few, good=(0.5, np.inf), possible=verdicts.POSITIVE)
    assert claim.low == 0 and claim.verdict == verdicts.FEW
    # A wide interval that decides is enough.
    claim = verdicts.at_each("", "", "", few, good=(0, 3), possible=verdicts.POSITIVE)
    assert claim.verdict == verdicts.REPRODUCED


def test_the_number_shown_is_from_a_friction_that_decides(rng):
    values = {mu: 0.5 + 0.02 * rng.normal(size=10) for mu in (0.1, 1)}
    values[0.1] += 0.6
    values[10] = 3 * rng.random(3)  # farther away, but uncertain
    claim = verdicts.at_each("", "", "", packings(values), good=(0, 1))
    assert claim.verdict == verdicts.CONTRADICTED
    assert (claim.mu, claim.packings) == (0.1, 10)


def test_a_peak_that_packings_of_different_width_hide_shows_in_their_own_units(rng):
    """Weibull distributions of widths that differ tenfold look monotonic when they are joined."""
    values = [width * rng.weibull(2, 500) for width in np.geomspace(0.1, 1, 12)]
    joined = figure4.departure(values, 0.95)
    own = figure4.departure([v / v.mean() for v in values], 0.95)
    assert joined[1] == 0
    assert own[1] > 0.05


def test_what_was_not_relaxed_was_not_measured():
    table = synthetic(rise_and_fall)
    (claim,) = figure1.vanishing(table, "gauss_seidel")
    assert claim.verdict == verdicts.REPRODUCED
    table = changed(table, SWEEPS, 0, dimension=0.0)
    (claim,) = figure1.vanishing(table, "gauss_seidel")
    assert claim.verdict == verdicts.UNMEASURED
    table = changed(table, SWEEPS, skipped_part=0.0, eta2=0.024)
    (claim,) = figure1.vanishing(table, "gauss_seidel")
    assert (claim.verdict, claim.value) == (verdicts.CONTRADICTED, pytest.approx(0.024))


def test_eta3_is_compared_with_the_exact_one_of_the_same_packing():
    table = synthetic(rise_and_fall)
    rows = table.part(SWEEPS)
    table = with_rows(table, rows.assign(part="exact", eta3=rows["eta3"] * 2))
    (claim,) = figure1.measure(table, "gauss_seidel")
    assert (claim.verdict, claim.value) == (verdicts.STRONGLY, pytest.approx(0.5))


def test_the_papers_own_walks_are_compared_over_sizes():
    table = synthetic(rise_and_fall)
    rows = table.part(SWEEPS)
    rows = rows[rows["mu"] == 0.1].assign(part="size_sweeps")
    sized = (rows.assign(n=n, eta2=rows["eta2"] * (n / 400) ** 0.5) for n in (100, 1600))
    table = with_rows(table, *sized)
    (claim,) = figure1.size(table, "gauss_seidel")
    assert claim.value == pytest.approx(0.5, abs=0.02)
    assert claim.verdict == verdicts.STRONGLY


def test_few_disks_decide_nothing():
    table = synthetic(rise_and_fall)
    table = table._replace(rows=table.rows.assign(n=40))
    families = [claims.agreement, claims.maximum, claims.correlation, claims.counts, claims.pairs]
    assert set(judged(table, families).values()) == {verdicts.FEW}


def test_a_walk_that_reached_few_states_is_not_judged():
    table = changed(synthetic(rise_and_fall), SWEEPS, 10, reached_part=0.1)
    assert 10 not in groups.items(groups.drawn(table, "gauss_seidel"), "eta2")
    assert 10 not in groups.sampled(table, "gauss_seidel")


def test_every_claim_has_an_id_a_sampler_and_a_source():
    table = synthetic(rise_and_fall)
    few = tables.make_rows(table.rows[table.rows["mu"] < 0.01].reset_index(drop=True))
    table = table._replace(rows=few, samples=tables.no_samples())
    found = claims.judged(table)
    assert len({(claim.id, claim.sampler) for claim in found}) == len(found)
    for claim in found:
        assert claim.sampler in {"", *groups.SAMPLERS}
        assert claim.source in {verdicts.PRE, verdicts.PRL}


def test_without_data_there_is_no_verdict():
    assert set(judged(study()).values()) == {verdicts.MISSING}


@pytest.mark.parametrize("power", [1, 2])
def test_tails_of_uniform_forces_tell_an_exponential_from_a_gaussian(power):
    rng = np.random.default_rng(0)
    forces = rng.exponential(1.0, 10**6) if power == 1 else np.abs(rng.normal(0, 1.6, 10**6))
    counted = np.histogram(forces, np.append(0.0, tables.FORCES))[0]
    tail = tails.fitted([counted * 0.5, counted * 0.5])
    assert tail.power == pytest.approx(power, abs=0.15 * power) and tail.low == 2.0
    right, wrong = tail.off_exponential, tail.off_gaussian
    right, wrong = (right, wrong) if power == 1 else (wrong, right)
    assert tail.off <= right < 0.3 * wrong
    assert tails.fitted([np.r_[100.0, np.zeros(159)]]) is None
    row = {"part": "tails_stress", "n": 10, "mu": 0.1, "seed": 1}
    table = study([row], tails={0: counted.astype(float)})
    told = [finding.statement for finding in findings.forces(table)]
    assert len(told) == 3 and all("whole stress prescribed, μ = 0.1, f = 2 …" in t for t in told)
    assert tails.described(table).startswith("whole stress prescribed, μ = 0.1: b = ")


def test_volumes_tell_where_they_are_largest_and_what_they_follow():
    frictions, rows = (0.01, 0.1, 1.0), []
    for mu, width in zip(frictions, (0.02, 0.2, 0.1), strict=True):
        for seed in (1, 2, 3):
            row = {"n": 400, "mu": mu, "seed": seed, "dimension": 10}
            sized = {"extent": width + 0.001 * seed, "log_volume_per_grain": np.log(width)}
            rows.append(row | {"part": "volume"} | sized)
            rows.append(row | {"part": "walk", "coordination": 4 - mu, "eta2": width * seed})
    table = study(rows)
    told = {finding.id: finding.value for finding in findings.volume(table)}
    assert 0.03 < told["volume-peak"] < 0.5
    assert told["volume-rank"] > 0.6
    assert not any("volume-size" in name for name in told)  # not comparable between μ
