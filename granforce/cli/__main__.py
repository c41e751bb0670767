"""`python -m granforce.cli` is the command `granforce`."""

from granforce.cli.parser import command

command()
