"""Forces held on a page, written to a file for the Python session that opened the page."""

import json
import os
from pathlib import Path
from typing import Any

from granforce.cli.viewer import HELD_VARIABLE
from granforce.system.files import written

from .known import Knowledge, rows


def follow(knowledge: Knowledge) -> None:
    """Keep the file of the packing on screen up to date if the server was started by `gf.show`."""
    folder = os.environ.get(HELD_VARIABLE)
    if not folder:
        return

    def write(event: Any) -> None:
        state = knowledge.state
        digest = state.cell and state.cell.selection.packing.get("imported")
        if digest and state.replay is not None:
            held = [row[:3] for row in rows(state.replay, knowledge.known)]
            with written(Path(folder) / f"{digest}.json") as file:
                file.write(json.dumps(held).encode())

    knowledge.param.watch(write, "known")
