"""Tab: force space."""
