"""How forces are dragged."""
