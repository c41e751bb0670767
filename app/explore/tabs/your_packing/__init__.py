"""Tab: your packing."""
