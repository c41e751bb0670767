"""The study's figures, each as a page and as pictures."""

from granforce import figures

SHOWN = (0.01, 0.05, 0.1, 0.3, 1, 10)  # frictions of Figure 4, of those that the study has


FORMATS = ("html", "png", "svg")


def draw(table, folder, *, formats=FORMATS, progress=None):
    """Draw every figure that a table has the data of into a folder; returns the paths.

    progress(figures drawn, figures in all).
    """
    folder.mkdir(parents=True, exist_ok=True)
    made = all_figures(table) if formats else {}
    paths = []
    for done, (name, figure) in enumerate(made.items()):
        for form in formats:
            backend = "bokeh" if form == "html" else "matplotlib"
            paths.append(folder / f"{name}.{form}")
            figures.save(figure(backend=backend), paths[-1])
        if progress is not None:
            progress(done + 1, len(made))
    return paths


def all_figures(table):
    """{file name: figure(backend=…)} of all figures that a table has the data of."""
    walk = table.part("walk")
    exact, uniform = table.part("exact"), table.part("uniform")
    beside = {word: rows for word, rows in (("exact", exact), ("uniform", uniform)) if rows}
    made = {}
    if walk:
        made["figure1"] = _later(figures.indeterminacy, walk, beside={"exact": exact})
        made["figure4"] = _later(figures.extents, _some(table.extents("walk")))
        made["figure6"] = _later(figures.correlations, walk, beside=beside)
    if uniform:
        made["figure1_uniform"] = _later(figures.indeterminacy, walk, beside={"uniform": uniform})
    if exact:
        made["figure4_exact"] = _later(figures.extents, _some(table.extents("exact")))
    if table.part("perturb"):
        made["figure2"] = _later(figures.perturbation, table.answers())
    if table.shown:
        made["figure3"] = _later(figures.possible_forces, _shown_forces(table))
        made["figure5"] = _later(figures.places, _shown_places(table))
    if table.part("size"):
        made["sizes"] = _later(figures.sizes, _with_sizes(table))
    if table.part("opened"):
        made["opened"] = _later(figures.opened, table.part("opened"), walk)
    if table.part("frozen"):
        periodic = [row for row in exact if row["mu"] > 0]
        made["frozen"] = _later(figures.frozen, periodic, table.part("frozen"))
    if any("walk_ratio" in row for row in uniform):
        made["distances"] = _later(figures.distances, uniform)
    return made


def _later(figure, *arguments, **options):
    return lambda backend: figure(*arguments, backend=backend, **options)


def _some(groups):
    few = {mu: group for mu, group in groups.items() if mu in SHOWN}
    return few or groups


def _with_sizes(table):
    frictions = {row["mu"] for row in table.part("size")}
    return [row for row in table.part("size", "walk") if row["mu"] in frictions]


def _shown_contacts(table):
    """(position in rows, row, contacts, f_n, least f_n, ΔF_n) of the walks that are shown."""
    wanted = {k for k, _ in table.shown}
    contacts = {id(row): arrays for row, *arrays in table.contacts("walk")}
    for k in sorted(wanted):
        row = table.rows[k]
        yield k, row, *contacts[id(row)]


def _shown_forces(table):
    states = dict(table.shown)
    return {
        row["mu"]: (normal, states[k], least, extent)
        for k, row, _, normal, least, extent in _shown_contacts(table)
    }


def _shown_places(table):
    return {
        row["mu"]: (table.packings[k], contacts, normal, extent)
        for k, row, contacts, normal, _, extent in _shown_contacts(table)
        if row["mu"] in (0.1, 10)
    }
