"""Explore S: random walks, uniform states, exact intervals, outlines, volume."""
