"""The tutorial notebook: it runs, and was committed as it runs."""

from pathlib import Path

import nbformat
from nbclient import NotebookClient

TOUR = Path(__file__).parents[1] / "data" / "tour.ipynb"


def shown(notebook):
    """For each cell of code the kinds of what it shows, but plain text beside something better."""
    return [
        {kind for output in cell.outputs for kind in output.get("data", {})} - {"text/plain"}
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


def test_the_tour_runs_and_shows_what_it_showed():
    assert TOUR.stat().st_size < 1e6
    committed = nbformat.read(TOUR, as_version=4)
    here = {"metadata": {"path": str(TOUR.parent)}}
    executed = nbformat.from_dict(committed)
    for cell in executed.cells:
        if cell.cell_type == "code":
            cell.outputs = []
    NotebookClient(executed, timeout=300, kernel_name="python3", resources=here).execute()
    assert shown(executed) == shown(committed)
    kinds = set().union(*shown(committed))
    assert {"image/svg+xml", "text/html"} <= kinds  # pictures and tables
