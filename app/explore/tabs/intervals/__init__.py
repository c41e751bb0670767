"""Tab: intervals."""
