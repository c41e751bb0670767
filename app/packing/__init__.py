"""The packing on screen and its player."""
