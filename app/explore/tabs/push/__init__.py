"""Tab: push."""
