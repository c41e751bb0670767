"""Photoelastic experiments: frames from files, their walls and repair, and inference of forces."""
