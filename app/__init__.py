"""The app: `panel serve app` from the repository's root."""
