"""Drawings of small scenes and their S."""
