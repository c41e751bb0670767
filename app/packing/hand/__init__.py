"""Dragging of forces."""
