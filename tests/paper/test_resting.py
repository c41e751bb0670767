"""h at large friction by the imbalance at which drag sets in."""

from granforce.paper import drawings, resting, tables
from granforce.paper import plan as plans


def test_packings_differ_only_in_when_drag_sets_in():
    tasks = plans.chosen(plans.Plan(), ["resting"])
    assert {task.part for task in tasks} == set(plans.RESTING)
    for task in tasks:
        packed = dict(task.cell.parameters["packing"])
        packed.pop("drag_below", None)
        assert packed == plans.kinds.PACKING.parameters(100, task.mu, task.seed)
    assert {task.mu for task in tasks} == {0.5, 1, 3, 10}


def test_a_line_for_each_imbalance_and_how_many_packings_it_has():
    rows = [
        {"part": part, "n": 100, "mu": mu, "seed": seed, "dimension": h, "eta3": h / 4}
        for part, mu, dimensions in (
            ("resting_default", 1, (2, 4)),
            ("resting_default", 10, (1, 1)),
            ("resting_10000", 10, (3, 5)),
        )
        for seed, h in enumerate(dimensions)
    ]
    table = tables.StudyTable({"n": 400}, tables.make_rows(rows), tables.no_samples(), [], {}, {})
    drawn = drawings.all_figures(table)["resting"](backend="bokeh")
    labels = [{element.label for element in frame} - {""} for frame in drawn]
    assert labels == 2 * [{"μ = 1", "μ = 10"}]
    text = resting.resting(table)
    lines = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.splitlines()
        if line.startswith("| ") and "---" not in line
    ]
    heads = ["h, μ = 1", "h, μ = 10", "exact η3, μ = 1", "exact η3, μ = 10"]
    assert lines[0] == ["drag below, ⟨f_n⟩", "packings", *heads]
    assert lines[1] == ["2·10⁻²", "2", "3.0(10)", "1.000", "0.75(25)", "0.250"]
    assert lines[2] == ["2·10⁻⁶", "2", "", "4.0(10)", "", "1.00(25)"]
    assert not resting.resting(tables.StudyTable({"n": 400}, tables.make_rows([]), {}, [], {}, {}))
