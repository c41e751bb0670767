"""Linear algebra and optimisation on contact networks: knows matrices and cones, no physics."""
