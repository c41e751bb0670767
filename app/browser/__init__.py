"""Joining of scripts, and communication with the server."""
