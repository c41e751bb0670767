"""The instrument: controls, results and tabs."""
