"""Listings of photoelastic frames, from files of any kind."""
