"""The animation of states."""
