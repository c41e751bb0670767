"""`python -m granforce` is the command `granforce`."""

from granforce.cli.entry_point import command

command()
