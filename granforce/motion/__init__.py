"""How grains move: contact dynamics, its exact step, overdamped motion, and the test of rest."""
