"""Beyond the paper: how its results depend on sampler, solver and definition.

Numbers with 95 % confidence intervals over packings, without a verdict; ratios are of the same
packing. They tell why a claim holds or does not.
"""

import numpy as np

from granforce import statistics
from granforce.paper.claims import LARGE, MIDDLE, SMALL, Claim, peak, pooled, positive, slope

_RANGES = (("small", SMALL), ("intermediate", MIDDLE), ("large", LARGE))


def found(table):
    """All findings about a `tables.Table`; those without data are left out."""
    return [finding for family in FAMILIES for finding in family(table)]


def sampled_part(table):
    """How much of the exact extent 1000 states see."""
    for source, word in (("walk", "the walk's"), ("uniform", "uniform")):
        yield from _by_range(
            _ratios(table, "eta3", source, "exact"), f"η3 of {word} states over exact η3"
        )


def measure(table):
    """How the walk's measure differs from the uniform one."""
    for name, label in (("eta1", "η1"), ("eta2", "η2")):
        yield from _by_range(
            _ratios(table, name, "walk", "uniform"), f"{label} of the walk over {label} of S"
        )
    rows = [row for row in table.part("uniform") if "walk_ratio" in row]
    for name, label in (("original_ratio", "the original network"), ("walk_ratio", "walk states")):
        yield from _by_range(
            statistics.grouped(rows, name),
            f"distance of {label} from the centre over that of uniform states",
        )


def solver(table):
    """Whether the paper's relaxation and the default one walk alike."""
    for name, label in (("eta2", "η2"), ("eta3", "η3")):
        yield from _by_range(
            _ratios(table, name, "gauss_seidel", "walk"), f"{label} by Gauss–Seidel over default"
        )


def exact_shape(table):
    """Maximum, small-μ slope and tails of the exact and of the uniform indeterminacy."""
    for part, name, label in (("exact", "eta3", "exact η3"), ("uniform", "eta2", "uniform η2")):
        groups = positive(statistics.grouped(table.part(part), name))
        if len(groups) > 2:
            yield _finding(f"μ where {label} is largest", peak(list(groups)), groups.values())
        yield from _growth(groups, label)
    for word, span in _RANGES:
        items = pooled(table.extents("exact"), span)
        if items:
            yield _finding(
                f"tail exponent b of exact P(ΔF_n), {word} μ",
                lambda drawn: statistics.tail_exponent(np.concatenate(drawn)),
                [items],
                resamples=199,
            )


def opened(table):
    """How η grows with the friction of the cones alone, in packings made without friction."""
    groups = statistics.grouped(table.part("opened_exact"), "eta3")
    yield from _growth(groups, "exact η3, packings made at μ = 0,")


def _growth(groups, label):
    """Slopes on both sides of the crossover at 0.001."""
    for low, high in ((0, 0.001), (0.001, SMALL[1])):
        few = {mu: groups[mu] for mu in groups if low <= mu <= high and mu > 0}
        if len(few) > 1:
            ends = f"μ = {min(few):g} … {max(few):g}"
            yield _finding(f"slope of log {label} against log μ, {ends}", slope(few), few)


def size(table):
    """Whether exact η3 depends on N."""
    rows = table.part("size_exact", "exact")
    for mu in sorted({row["mu"] for row in table.part("size_exact")}):
        groups = statistics.grouped([row for row in rows if row["mu"] == mu], "eta3", "n")
        if len(groups) > 1:
            yield _finding(
                f"slope of log exact η3 against log N, μ = {mu:g}", slope(groups), groups
            )


def strength(table):
    """How far the critical force stays below the limit load."""
    rows = [
        row | {"part_of_load": row["critical_force"] / row["limit_load"]}
        for row in table.part("perturb")
        if row["limit_load"] > 0
    ]
    yield from _by_range(statistics.grouped(rows, "part_of_load"), "⟨F_crit⟩ over ⟨limit load⟩")


FAMILIES = (sampled_part, measure, solver, exact_shape, opened, size, strength)


def _ratios(table, name, above, below):
    """{μ: ratios of one number in the same packings}, where both parts have it."""
    known = {(row["mu"], row["seed"]): row.get(name) for row in table.part(below)}
    ratios = {}
    for row in table.part(above):
        value = known.get((row["mu"], row["seed"]))
        if value and row["dimension"] > 0 and name in row:
            ratios.setdefault(row["mu"], []).append(row[name] / value)
    return ratios


def _by_range(groups, statement):
    for word, (low, high) in _RANGES:
        values = [v for mu, group in groups.items() if low <= mu <= high for v in group]
        if values:
            yield _finding(f"{statement}, {word} μ", np.mean, [values])


def _finding(statement, statistic, groups, **options):
    groups = list(groups.values()) if isinstance(groups, dict) else list(groups)
    value, low, high = statistics.bootstrap(statistic, groups, **options)
    return Claim(statement, statement, value, low, high, "", "measured")
