"""`python -m granforce` is the command `granforce`."""

from granforce.cli.parser import command

command()
