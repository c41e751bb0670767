"""The command line."""

from granforce.cli.parser import command, main

__all__ = ["command", "main"]
