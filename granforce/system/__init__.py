"""What is asked of the operating system: files, the terminal, cancelling, compiled kernels."""
