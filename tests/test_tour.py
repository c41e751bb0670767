"""The notebooks: they run, and were committed as they run."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

DATA = Path(__file__).parents[1] / "data"
# What each shows at least: pictures and tables.
NOTEBOOKS = {
    "tour.ipynb": {"image/svg+xml", "text/html"},
    "frames.ipynb": {"image/png", "text/html"},
}


def shown(notebook):
    """For each cell of code the kinds of what it shows, but plain text beside something better."""
    return [
        {kind for output in cell.outputs for kind in output.get("data", {})} - {"text/plain"}
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_it_runs_and_shows_what_it_showed(name):
    assert (DATA / name).stat().st_size < 1e6
    committed = nbformat.read(DATA / name, as_version=4)
    here = {"metadata": {"path": str(DATA)}}
    executed = nbformat.from_dict(committed)
    for cell in executed.cells:
        if cell.cell_type == "code":
            cell.outputs = []
    NotebookClient(executed, timeout=300, kernel_name="python3", resources=here).execute()
    assert shown(executed) == shown(committed)
    assert NOTEBOOKS[name] <= set().union(*shown(committed))
