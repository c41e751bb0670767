"""Tab: export."""
