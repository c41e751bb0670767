"""Controls and plots that Panel does not provide."""
