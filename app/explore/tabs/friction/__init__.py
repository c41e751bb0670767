"""Tab: friction."""
