"""Photoelastic experiments: frames from files, their walls and flaws, and inference of forces."""
