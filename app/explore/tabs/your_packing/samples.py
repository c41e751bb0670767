"""Files to try the page with; all but the shortest are written when they are asked for."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from granforce.experiment.synthetic import synthetic_frame
from granforce.packing import exporters, importers
from granforce.records import Packing

from ....results.saved_file import File

# A heap on a floor, which friction 0.3 holds, and a block on another.
TABLES = {
    "disks": "x,y,r\n1,1,1\n3,1,1\n5,1,1\n2,2.7320508,1\n4,2.7320508,1\n",
    "bodies": "body,x,y,fixed\n1,0,0,0\n1,1,0,0\n1,0,1,0\n2,-1,-1,1\n2,2,-1,1\n2,2,0,1\n2,-1,0,1\n",
}
WRITTEN: dict[str, tuple[tuple[str, str], Callable[[Packing, Path, Path], None]]] = {
    "lammps": (("particles.dump", "contacts.dump"), exporters.save_lammps),
    "photoelastic": (
        ("positions.txt", "adjacency.txt"),
        lambda packing, *paths: synthetic_frame(packing).write(*paths),
    ),
}


def lattice() -> Packing:
    """Disks in a triangular lattice, in a periodic box under pressure."""
    rows, columns, rise = 4, 3, 0.75**0.5
    x = [(k + row % 2 / 2, row * rise) for row in range(rows) for k in range(columns)]
    box = (float(columns), rows * rise)
    return importers.from_disks(np.array(x), np.full(len(x), 0.5), 0.3, box=box, pressure=1.0)


def sample(name: str) -> list[File]:
    """The files of a sample, one of TABLES or WRITTEN."""
    if name in TABLES:
        return [File(f"{name}.csv", "text/csv", TABLES[name].encode())]
    names, write = WRITTEN[name]
    with TemporaryDirectory() as folder:
        paths = [Path(folder) / file for file in names]
        write(lattice(), *paths)
        return [File(path.name, "text/plain", path.read_bytes()) for path in paths]
