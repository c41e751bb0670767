"""Packings: how they are made, brought in from elsewhere and kept."""
