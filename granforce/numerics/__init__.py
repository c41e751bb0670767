"""Linear algebra and optimisation on contact networks: matrices and cones, no physics."""
