"""How grains move: contact dynamics, its exact step, overdamped motion, and whether grains rest."""
