"""What the page shows, as plain arrays."""
