"""The benchmark: run time against error of every solver, on the present machine.

`main` is the command `granforce bench`; each part can be called on its own and returns rows
(dicts of plain numbers and strings).
"""

import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from granforce.bench.conditions import knowledge
from granforce.bench.frames import frames
from granforce.bench.inference import inference
from granforce.bench.kernel import growth, kernel, pushes, starts
from granforce.bench.masonry import masonry
from granforce.bench.packings import (
    compaction,
    compaction_frictions,
    compaction_growth,
)
from granforce.bench.report import environment, note, table
from granforce.bench.skips import skips
from granforce.bench.solvers import contact_updates, relaxation, scaling, tile
from granforce.bench.states import batches, interval_methods, intervals, walks
from granforce.bench.uniform import uniform, uniform_growth
from granforce.system.files import make_folder, written
from granforce.system.wording import json_text

__all__ = [
    "PARTS",
    "batches",
    "compaction",
    "compaction_frictions",
    "compaction_growth",
    "contact_updates",
    "draw",
    "environment",
    "frames",
    "growth",
    "inference",
    "interval_methods",
    "intervals",
    "kernel",
    "knowledge",
    "main",
    "masonry",
    "pushes",
    "relaxation",
    "run",
    "scaling",
    "skips",
    "starts",
    "tile",
    "uniform",
    "uniform_growth",
    "walks",
]

# Part → what it measures, and its heading.
Parts = Mapping[str, tuple[Callable[..., list[dict[str, Any]]], str]]
PARTS: Parts = {
    "contact_updates": (contact_updates, "One contact update of Gauss–Seidel"),
    "relaxation": (relaxation, "One relaxation to 1e-9 ⟨f_n⟩, from the same kicked starts"),
    "scaling": (scaling, "One relaxation against the number of disks"),
    "kernel": (kernel, "Factorisation: part of what the machine can do"),
    "starts": (starts, "Nearest networks: PIQP, one at a time, and in lanes"),
    "pushes": (pushes, "Critical forces: one contact at a time, and in lanes"),
    "growth": (growth, "Set-up, relaxation and exact bound against the number of disks"),
    "batches": (batches, "Chains of one packing on one and two threads"),
    "compaction": (compaction, "Compaction: run time and overlap by time step and sweeps"),
    "compaction_frictions": (compaction_frictions, "Compaction at each μ"),
    "compaction_growth": (compaction_growth, "Compaction against the number of disks"),
    "skips": (skips, "What skipping is worth"),
    "intervals": (intervals, "Intervals seen by walks against exact ones"),
    "interval_methods": (interval_methods, "Exact intervals against other tools"),
    "uniform": (uniform, "Uniform sampling of S"),
    "uniform_growth": (uniform_growth, "Uniform sampling against the number of disks"),
    "inference": (inference, "The likeliest network of a measurement"),
    "frames": (frames, "Photoelastic frames of known forces: distance from the truth in ⟨f_n⟩"),
    "knowledge": (knowledge, "What is prescribed and known, beside HiGHS and PIQP"),
    "masonry": (masonry, "Dry-stone walls beside HiGHS"),
    "walks": (walks, "Random walks by solver"),
}


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
    for name, (measure, heading) in parts.items():
        begin = time.perf_counter()
        results[name] = measure(quick)
        results["seconds"][name] = time.perf_counter() - begin
        note(f"{name}: {results['seconds'][name]:.1f} s")
        show(table(heading, results[name]))
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
    out: str | Path | None = None,
    quick: bool = False,
    as_json: bool = False,
    parts: Parts = PARTS,
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
