"""The data shown by the app, as plain arrays."""
