"""Operating-system services: files, the terminal, cancelling, and compiled kernels."""
