"""Figures as HoloViews objects: one function each, for the backend "bokeh" or "matplotlib".

Inputs are plain: rows are dicts of numbers, one for each packing or walk (as `study.row` gives
them), other arrays are named by the function that takes them. Where one μ has several rows, points
are means with 95 % confidence intervals.
"""

from granforce.figures.bench import walk_against_exact
from granforce.figures.indeterminacy import correlations, extents, indeterminacy
from granforce.figures.style import save

__all__ = ["correlations", "extents", "indeterminacy", "save", "walk_against_exact"]
