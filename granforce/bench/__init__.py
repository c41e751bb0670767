"""The benchmark: run time against error of every solver, on the present machine.

`main` is the command `granforce bench`; each part can be called on its own and returns rows
(dicts of plain numbers and strings).
"""

import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from granforce.bench import packings
from granforce.bench.compiling import FIRST, compiling
from granforce.bench.conditions import inference
from granforce.bench.exact import REFERENCES, interval_methods
from granforce.bench.frames import frames
from granforce.bench.kernel import growth, kernel, pushes, starts
from granforce.bench.masonry import SMALL, masonry
from granforce.bench.packings import compaction, compaction_frictions, compaction_growth
from granforce.bench.report import environment, table
from granforce.bench.runner import note
from granforce.bench.solvers import contact_updates, relaxation, scaling
from granforce.bench.states import intervals
from granforce.bench.uniform import uniform, uniform_growth
from granforce.system.files import make_folder, written
from granforce.system.wording import json_text
from granforce.types import Rows


class Part(NamedTuple):
    """A part of the benchmark."""

    measure: Callable[..., Rows]
    heading: str
    quick: Mapping[str, Any]  # its arguments with --quick; by default it is full


def _part(measure: Callable[..., Rows], heading: str, **quick: Any) -> tuple[str, Part]:
    return measure.__name__, Part(measure, heading, quick)


PARTS = dict(
    [
        _part(contact_updates, "One contact update of Gauss–Seidel", n=100),
        _part(
            relaxation,
            "One relaxation to 1e-9 ⟨f_n⟩, from the same kicked starts",
            n=100,
            repeats=3,
            sweeps=100_000,
        ),
        _part(scaling, "One relaxation against the number of disks", tiles=(1, 2, 4), patience=2.0),
        _part(
            compiling,
            "First results, with no kernel compiled yet",
            first={"pack": FIRST["pack"]},
        ),
        _part(kernel, "Factorisation: part of what the machine can do", tiles=(1, 2)),
        _part(starts, "Nearest networks: PIQP, one at a time, and in lanes", n=100, repeats=2),
        _part(pushes, "Critical forces: one contact at a time, and in lanes", n=60, contacts=10),
        _part(
            growth,
            "Set-up, relaxation and exact bound against the number of disks",
            tiles=(1, 2, 4),
        ),
        _part(
            compaction,
            "Compaction: run time and overlap by time step and sweeps",
            n=100,
            steps=(0.05, 0.1),
            accuracies=(0.1, 0.01),
            seeds=2,
        ),
        _part(
            compaction_frictions,
            "Compaction at each μ",
            n=100,
            frictions=packings.FRICTIONS[::3],
            seeds=2,
        ),
        _part(
            compaction_growth,
            "Compaction against the number of disks",
            sizes=(50, 100, 200),
            seeds=2,
        ),
        _part(
            intervals,
            "Intervals seen by walks against exact ones",
            n=100,
            frictions=(0.1,),
            states=(30, 100),
        ),
        _part(interval_methods, "Exact intervals against other tools", names=REFERENCES[:2]),
        _part(uniform, "Uniform sampling of S", n=100, frictions=(0.1, 1.0), rounded=0),
        _part(uniform_growth, "Uniform sampling against the number of disks", n=100, tiles=(1, 2)),
        _part(inference, "The likeliest network of a measurement", n=100, frictions=(0.1,)),
        _part(
            frames,
            "Photoelastic frames of known forces: distance from the truth in ⟨f_n⟩",
            n=100,
            packings=2,
        ),
        _part(masonry, "Dry-stone walls beside HiGHS", size=SMALL),
    ]
)
Parts = Mapping[str, Part]


def run(
    folder: str | Path | None = None,
    quick: bool = True,
    *,
    parts: Parts = PARTS,
    show: Callable[[str], object] = print,
) -> dict[str, Any]:
    """Measure parts, by default all, and return {"environment": …, part: rows}.

    folder: where to write bench.json, after every part so that nothing is lost, and the figures
    (bench.html, bench.png); None: write no files. show: called with each finished table.
    """
    folder = None if folder is None else make_folder(folder)
    results: dict[str, Any] = {"environment": environment(), "quick": bool(quick), "seconds": {}}
    for name, part in parts.items():
        begin = time.perf_counter()
        results[name] = part.measure(**(part.quick if quick else {}))
        results["seconds"][name] = time.perf_counter() - begin
        note(f"{name}: {results['seconds'][name]:.1f} s")
        show(table(part.heading, results[name]))
        if folder is not None:
            with written(folder / "bench.json") as file:
                file.write(json_text(results, ascii_only=False).encode())
    # As stored, so that tables and figures drawn later from the file are the same: NaN is null.
    results = json.loads(json_text(results, ascii_only=False))
    if folder is not None:
        draw(folder, results)
    return results


def draw(folder: str | Path, results: Mapping[str, Any]) -> bool:
    """Write the figures (bench.html, bench.png) of results; whether they have a part to draw."""
    from granforce import figures

    for name, backend in (("bench.html", "bokeh"), ("bench.png", "matplotlib")):
        figure = figures.benchmark(results, backend=backend)
        if figure is None:
            return False
        figures.save(figure, Path(folder) / name)
    return True


def main(
    out: str | Path | None = None, quick: bool = False, as_json: bool = False, parts: Parts = PARTS
) -> dict[str, Any]:
    """The command `granforce bench`: tables or JSON on stdout, progress on stderr."""
    results = run(out, quick, parts=parts, show=(lambda text: None) if as_json else print)
    if as_json:
        print(json_text(results, ascii_only=False))
    else:
        print(table("Environment", [{**results["environment"], **_versions(results)}]))
    return results


def _versions(results: dict[str, Any]) -> dict[str, str]:
    libraries = results["environment"]["libraries"]
    return {"libraries": " ".join(f"{name} {v}" for name, v in libraries.items() if v)}
