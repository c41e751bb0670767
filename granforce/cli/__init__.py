"""The command line."""

from granforce.cli.entry_point import command, main

__all__ = ["command", "main"]
