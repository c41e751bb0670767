"""Figures as HoloViews objects: one function each, for the backend "bokeh" or "matplotlib".

Rows are dicts of numbers, one for each packing or walk (as returned by `study.row`); other arrays
are described by the function that takes them. If one μ has several rows, points are means and bars
their standard errors.
"""

from granforce.figures.bench import benchmark
from granforce.figures.displacement import displacement
from granforce.figures.indeterminacy import correlations, extents, indeterminacy
from granforce.figures.networks import force_densities, overlaid, possible_forces, ratio_counts
from granforce.figures.response import perturbation
from granforce.figures.style import save
from granforce.figures.variations import (
    distances,
    opened,
    resting,
    samplers,
    sizes,
    stresses,
    volumes,
)

__all__ = [
    "benchmark",
    "correlations",
    "displacement",
    "distances",
    "extents",
    "force_densities",
    "indeterminacy",
    "opened",
    "overlaid",
    "perturbation",
    "possible_forces",
    "ratio_counts",
    "resting",
    "samplers",
    "save",
    "sizes",
    "stresses",
    "volumes",
]
