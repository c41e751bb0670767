"""The command line."""

from granforce.cli.parser import main

__all__ = ["main"]
