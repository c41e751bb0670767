"""S and single networks: equations, residual and violation, and the networks nearest to given
forces."""
