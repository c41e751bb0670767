"""S: its equations and judges, contact dynamics, and the networks nearest to given forces."""
