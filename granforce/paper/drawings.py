"""The study's figures, each as a web page and as pictures."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from granforce import figures
from granforce.measures import statistics
from granforce.paper.claims.groups import SAMPLERS, outside, positive, rows_of
from granforce.paper.resting import resting_rows
from granforce.paper.tables import StudyTable
from granforce.system.files import make_folder
from granforce.types import Floats, Progress

SHOWN = (0.001, 0.01, 0.05, 0.1, 0.3, 1, 10)  # frictions shown in Figure 4, if the study has them
LARGEST = 5.0  # ΔF_n of Figure 4, ⟨f_n⟩
BIN = 0.25  # of P(ΔF_n), ⟨f_n⟩

# Least packings of a curve among others, as a fraction of the most: fewer hide what all show.
ENOUGH = 0.2

FORMATS = ("html", "png", "svg")

POINTS = "points are means over packings, bars standard errors"
_TAILS = (
    "linear, and semi-logarithmic for three ranges of friction. b is the exponent of tails "
    f"exp(−(λ ΔF_n)^b), fitted beyond the upper quartile; {POINTS}"
)
# Caption of each figure, stored in its file; {walk}: how networks of the walk were relaxed. Figures
# 1 to 6 are the paper's, by its own relaxation if the study has it at every μ.
CAPTIONS = {
    "figure1": "Coordination z of the backbone, and indeterminacy η1, η2 and 0.15 η3 ({walk}), "
    f"against μ; {POINTS}. The paper finds η1 ≈ η2 ≈ 0.15 η3.",
    "figure2": "Mean critical force of pushed contacts in ⟨f_n⟩, and exponent α of the decay "
    "|u| ~ r^−α of the first motion, against η2 ({walk}) in the same packings, joined in order of "
    f"μ; {POINTS}.",
    "figure2_limit": "As Figure 2, with the limit load (dashed).",
    "figure3": "Normal forces of contacts over those in the original network, from weak to strong: "
    "the range seen (bars), and the fraction of networks ({walk}) with each ratio (colour). Bars "
    "are cut at 3; titles count the contacts that reach beyond.",
    "figure4": f"Distribution of ΔF_n/⟨f_n⟩ ({{walk}}): {_TAILS}.",
    "figure5": "Contacts with f_n > 2⟨f_n⟩, on top of those with ΔF_n > ⟨ΔF_n⟩ ({walk}). Grey: "
    "all contacts.",
    "figure6": "Correlation of f_n in the original network with ΔF_n over the contacts of a "
    "packing, against μ ({walk}). Bars: its range if f_n is taken from other networks of the walk. "
    "Dotted: ± two standard deviations of its mean for shuffled forces and as many packings.",
    "samplers": "Indeterminacy η1, η2 and 0.15 η3 of networks drawn in several ways, against μ; "
    f"{POINTS}.",
    "figure6_exact": "As Figure 6 for the nearest-network walk, with exact intervals and uniform "
    "networks.",
    "sizes": "Indeterminacy η1, η2 and 0.15 η3 of the nearest-network walk, and 0.15 η3 of the "
    f"exact intervals (dashed), against the number N of disks; {POINTS}.",
    "resting": "Dimension h and exact η3 of packings of 100 disks against the imbalance of forces "
    f"below which drag replaces inertia; {POINTS}.",
    "opened": "η2 and 0.15 η3 of packings made without friction whose cones are opened to μ, and "
    f"of packings made with μ; {POINTS}.",
    "stresses": "Shear stress over pressure against μ: the largest in S, and that of the original "
    "network. The latter, and that of uniform networks, as fractions of the largest in the same "
    f"packing; {POINTS}.",
    "volumes": "Width V^(1/h)/√(2πe) of S in ⟨f_n⟩ against μ, from its volume V, and ln V per "
    f"grain of the backbone against the number N of disks; {POINTS}.",
    "distances": "Distance of the original network and of the nearest-network walk from the centre "
    f"of S, over that of uniform networks; {POINTS}.",
}
_SWEPT = {
    "sweeps_1e-3": "paper's walk to 1e-3",
    "sweeps_1e-4": "paper's walk to 1e-4",
    "sweeps_1e-6": "paper's walk to 1e-6",
}
_DRAWN = {name: _SWEPT[part] for name, part in SAMPLERS.items() if part in _SWEPT} | {
    "nearest": "nearest-network walk"
}
_WALKS = {"gauss_seidel": "paper's walk", "nearest": "nearest-network walk"}
_RELAXED = {
    "gauss_seidel": "the paper's walk, by Gauss–Seidel sweeps that end at 10⁻³ ⟨f_n⟩",
    "nearest": "the nearest-network walk",
}


def paper_sampler(table: StudyTable) -> str:
    """Sampler of Figures 1 to 6: the paper's if the table has it at every μ of its plan."""
    known = set(table.part(SAMPLERS["gauss_seidel"])["mu"])
    frictions = set(table.plan.get("frictions", ()))
    return "gauss_seidel" if frictions and frictions <= known else "nearest"


def captions(table: StudyTable) -> dict[str, str]:
    """{file name: caption} of the figures of a table."""
    walk = _RELAXED[paper_sampler(table)]
    beyond = outside(table, SAMPLERS[paper_sampler(table)])
    if beyond:
        walk += f"; crosses or left out at μ = {', '.join(f'{mu:g}' for mu in beyond)}, where the "
        walk += "networks lie outside of S by more than its extent"
    return {name: caption.format(walk=walk) for name, caption in CAPTIONS.items()}


def draw(
    table: StudyTable,
    folder: Path,
    *,
    formats: Sequence[str] = FORMATS,
    progress: Progress | None = None,
) -> list[Path]:
    """Draw every figure for which a table has data into a folder; return the paths.

    progress(figures drawn, figures in all).
    """
    make_folder(folder)
    drawings = all_figures(table) if formats else {}
    texts, paths = captions(table), []
    for done, (name, figure) in enumerate(drawings.items()):
        for form in formats:
            backend = "bokeh" if form == "html" else "matplotlib"
            paths.append(folder / f"{name}.{form}")
            figures.save(figure(backend=backend), paths[-1], texts[name])
        if progress is not None:
            progress(done + 1, len(drawings))
    return paths


def all_figures(table: StudyTable) -> dict[str, Callable[..., Any]]:
    """{file name: figure(backend=…)} of all figures for which a table has data."""
    return _of_the_paper(table) | _beyond(table)


def _of_the_paper(table: StudyTable) -> dict[str, Callable[..., Any]]:
    """Figures 1 to 6, by one sampler."""
    sampler, drawings = paper_sampler(table), {}
    part = SAMPLERS[sampler]
    walk = rows_of(table, sampler)
    if len(walk):
        drawings["figure1"] = _later(figures.indeterminacy, walk, outside=_beyond_S(table, part))
        words = _WALKS[sampler]
        drawings["figure6"] = _later(figures.correlations, walk, chance=_chance(walk), walk=words)
    groups = _some(_loose(_in_S(table, part)))
    if groups:
        options = {"unit": "⟨f_n⟩", "largest": LARGEST, "bins": round(LARGEST / BIN)}
        drawings["figure4"] = _later(figures.extents, groups, **options)
    beyond = outside(table, part)
    answers = table.answers(part).dropna(subset=["decay_exponent"])
    answers = answers[~answers["mu"].isin(beyond)]
    if len(answers):
        drawings["figure2"] = _later(figures.perturbation, answers)
        drawings["figure2_limit"] = _later(figures.perturbation, answers, limit=True)
    forces, places = _shown_forces(table, part), _shown_places(table, part)
    if forces:
        drawings["figure3"] = _later(figures.force_densities, forces)
    if places:
        drawings["figure5"] = _later(figures.overlaid, places)
    return drawings


def _in_S(table: StudyTable, part: str) -> dict[float, list[Floats]]:
    """{μ: extents} of a part, at μ where its states are in S or close to it."""
    beyond = outside(table, part)
    return {mu: group for mu, group in table.extents(part).items() if mu not in beyond}


def _beyond_S(table: StudyTable, part: str) -> pd.DataFrame:
    """Rows of a part whose states exceed S by more than its extent."""
    rows = table.part(part)
    return rows[rows["mu"].isin(outside(table, part))]


def _beyond(table: StudyTable) -> dict[str, Callable[..., Any]]:
    """Figures that the paper does not have."""
    walk, exact, uniform = (table.part(part) for part in ("walk", "exact", "uniform"))
    drawings = {}
    sources = {_DRAWN.get(name, name): rows_of(table, name) for name in SAMPLERS}
    packings = {name: rows["seed"].nunique() for name, rows in sources.items()}
    enough = max(1, ENOUGH * max(packings.values()))
    sources = {name: rows for name, rows in sources.items() if packings[name] >= enough}
    if len(sources) > 1:
        drawings["samplers"] = _later(figures.samplers, sources)
    if len(walk) and len(exact):
        both = {"exact": exact} | ({"uniform": uniform} if len(uniform) else {})
        drawings["figure6_exact"] = _later(
            figures.correlations, walk, compare=both, walk=_WALKS["nearest"]
        )
    if len(table.part("size")):
        drawings["sizes"] = _later(
            figures.sizes, _with_sizes(table), exact=table.part("size_exact", "exact")
        )
    if len(resting_rows(table)):
        drawings["resting"] = _later(figures.resting, resting_rows(table))
    if len(table.part("opened")):
        drawings["opened"] = _later(figures.opened, table.part("opened"), walk)
    if uniform["walk_ratio"].notna().any():
        drawings["distances"] = _later(figures.distances, uniform)
    if len(table.part("stress")):
        stress = table.part("stress"), table.part("stress_uniform")
        drawings["stresses"] = _later(figures.stresses, *stress)
    if len(table.part("volume")):
        drawings["volumes"] = _later(
            figures.volumes, table.part("volume"), table.part("volume_size")
        )
    return drawings


def _chance(rows: pd.DataFrame) -> dict[float, float]:
    """{μ: two standard deviations of the mean correlation for shuffled forces}."""
    contacts = statistics.grouped(positive(rows, "mu", "contacts"), "contacts")
    # Each of k packings has a variance of 1/(N_c − 1), and their mean 1/k of that.
    return {mu: 2 * np.sqrt(np.mean(1 / (n - 1)) / len(n)) for mu, n in contacts.items()}


def _loose(groups: dict[float, list[Floats]]) -> dict[float, list[Floats]]:
    """Groups of ΔF_n with any undetermined force."""
    return {mu: group for mu, group in groups.items() if any(v.any() for v in group)}


def _later(figure: Callable[..., Any], *arguments: Any, **options: Any) -> Callable[..., Any]:
    return lambda backend: figure(*arguments, backend=backend, **options)


def _some(groups: dict[float, Any]) -> dict[float, Any]:
    few = {mu: group for mu, group in groups.items() if mu in SHOWN}
    return few or groups


def _with_sizes(table: StudyTable) -> pd.DataFrame:
    rows = table.part("size", "walk")
    return rows[rows["mu"].isin(table.part("size")["mu"])]


def _shown_contacts(table: StudyTable, part: str) -> Iterator[tuple[Any, dict[str, Any]]]:
    """Each row of a walk to show, and {name: array} of the samples of its contacts."""
    shown = {k for k, _ in table.shown}
    for row, contacts in table.contacts(part):
        if row.Index in shown:
            yield row, {name: contacts[name].to_numpy() for name in contacts}


def _shown_forces(table: StudyTable, part: str) -> dict[float, tuple[Any, ...]]:
    counts = dict(table.shown)
    return {
        row.mu: (some["normal"], counts[row.Index], some["least"], some["extent"])
        for row, some in _shown_contacts(table, part)
    }


def _shown_places(table: StudyTable, part: str) -> dict[float, tuple[Any, ...]]:
    return {
        row.mu: (table.packings[row.Index], some["contact"], some["normal"], some["extent"])
        for row, some in _shown_contacts(table, part)
        if row.mu in (0.1, 10)
    }
