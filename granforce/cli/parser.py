"""The parser of command lines: every option is used or rejected, every path has a role.

Standard library only, like everything that `--help` needs.
"""

from __future__ import annotations

import argparse
import difflib
import os
import re
import stat
import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NoReturn

from granforce import __version__
from granforce.cli.command_table import COMMANDS, Command, Group, Options, Rule
from granforce.cli.path_roles import ROLES, Output, TableOrStore
from granforce.cli.report_lines import FEW, explanation
from granforce.system.wording import integer, number

LONGEST = 600  # characters of a message
# A word that begins so is a negative number, or a list of numbers: no option does.
_NEGATIVE = re.compile(r"-\.?\d")


def _no_file(path: str) -> bool:
    """Whether a path is a device, a pipe or an open file, none of which has a suffix."""
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return False
    return not stat.S_ISREG(mode) and not stat.S_ISDIR(mode)


def refuse(reason: str) -> int:
    """Print why a command is rejected, as one line on stderr; returns the exit code 2."""
    line = " ".join(str(reason).split())
    if len(line) > LONGEST:  # for example a name of thousands of characters
        line = f"{line[: LONGEST // 2]} … {line[-LONGEST // 2 :]}"
    print(f"granforce: {line}", file=sys.stderr)
    return 2


def _closest(word: str, names: Iterable[str]) -> str:
    """A question for the name that resembles a mistyped word; empty if none does."""
    names = list(names)
    called = _CALLED.get(word, "")
    if called.partition(" ")[0] in names:
        return f"; did you mean {called}?"
    near = difflib.get_close_matches(word, [str(name) for name in names], n=1, cutoff=0.7)
    return f"; did you mean {near[0]}?" if near else ""


def _unrecognized(words: Sequence[str]) -> str:
    return f"unrecognized arguments: {' '.join(words)}"


# Names of other programs, or of the library, and what they are called here.
_CALLED = {
    "--friction": "--mu",
    "--disks": "-n",
    "critical-load": "load-factor --critical",
    "critical-force": "perturb",
    "critical-forces": "perturb",
    "sample": "uniform",
    "bounds": "intervals",
}
# Arguments of the library as its messages call them, and the attributes of their options.
_ARGUMENTS = {
    "friction coefficient": "mu",
    "the number of disks": "n",
    "the number of random contacts": "random",
    "the number of states kept": "keep",
    "effective sample size": "effective",
    "k": "best",  # of `informative`
}
# Options that a useless one may be mistaken for, as attributes.
_INSTEAD = {"mu": "ensemble_mu"}


# Commands whose names are reserved in Python or used by a package: their functions end in "_".
_TAKEN = ("import", "study")


class _Once(argparse.Action):
    """Stores the value of an option, which may be given once: another value would replace it.

    suffixes: of a file, of which one selects the format; listed: several values, between commas.
    """

    def __init__(
        self, *words: Any, suffixes: Sequence[str] = (), listed: bool = False, **options: Any
    ) -> None:
        self.suffixes, self.listed = suffixes, listed
        if suffixes:
            several = ",".join(suffixes)
            options["metavar"] = f"FILE.{{{several}}}" if len(suffixes) > 1 else f"FILE.{several}"
        super().__init__(*words, **options)

    def __call__(
        self, parser: Any, namespace: Any, values: Any, option_string: str | None = None
    ) -> None:
        if option_string is not None and self.dest in parser.seen:
            parser.error(f"{option_string} is given twice; give it once")
        parser.seen.add(self.dest)
        setattr(namespace, self.dest, values)


class Parser(argparse.ArgumentParser):
    """A parser that reports errors in one line and rejects options without effect."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.unused: tuple[Rule, ...] = ()  # forms of the command that exclude options
        self.seen: set[str] = set()  # attributes given so far in a command line
        self._negative_number_matcher = _NEGATIVE
        for name in (None, "store"):
            self.register("action", name, _Once)
        for kind, read in ((float, number), (int, integer)):
            self.register("type", kind, read)

    def error(self, message: str) -> NoReturn:
        self.exit(refuse(f"{message}; see {self.prog} --help"))

    @property
    def options(self) -> dict[str, str]:
        """{attribute: as typed} of all options and positional arguments except --help."""
        return {
            action.dest: action.option_strings[-1] if action.option_strings else action.dest
            for action in self._actions
            if action.dest != "help"
        }

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: Any = None
    ) -> tuple[Any, list[str]]:
        self.seen.clear()
        arguments, unknown = super().parse_known_args(args, namespace)
        if unknown:  # reported here: argparse would pass those of a subcommand to its parent
            self.error(self._unknown(unknown, sys.argv[1:] if args is None else args))
        ways = [way for way in self.unused if way.holds(arguments)]
        if ways:
            given = self._given(args)
            for way in ways:
                if useless := [typed for name, typed in given.items() if name in way.names]:
                    have, them = ("has", "it") if len(useless) == 1 else ("have", "them")
                    other = self._instead(given.keys() & way.names)
                    self.error(
                        f"{' and '.join(useless)} {have} no effect {way.words}; leave {them} out"
                        + (f", or use {other} for other Coulomb cones" if other else "")
                    )
        return arguments, unknown

    def _instead(self, useless: Iterable[str]) -> str | None:
        """The option that was meant by a useless one, as typed, or None."""
        others = [_INSTEAD[name] for name in useless if name in _INSTEAD]
        return self.options.get(others[0]) if others else None

    def _unknown(self, unknown: Sequence[str], args: Sequence[str]) -> str:
        """Why words are not understood: mistyped options, or a second value of an option."""
        first, words = unknown[0], list(args)
        if first.startswith("-"):
            name = first.partition("=")[0]
            hint = _closest(name, self._option_string_actions)
            return f"there is no option {name}{hint}" if hint else _unrecognized(unknown)
        at = words.index(first) if first in words else 0
        action = self._option_string_actions.get(words[at - 2]) if at >= 2 else None
        if action is None or action.nargs is not None:
            return _unrecognized(unknown)
        option, value = words[at - 2 : at]
        if getattr(action, "listed", False):
            return f"{option}: separate values by commas, as in {option} {value},{first}"
        return f"{option} takes one value, not {value} and {first}"

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Reject a value that is not among the choices of an option, or no command."""
        if action.choices is None or value in action.choices:
            return
        name = "/".join(action.option_strings) or str(action.metavar or action.dest).lower()
        hint = (
            _closest(str(value), action.choices)
            or f"; choose from {', '.join(map(str, action.choices))}"
        )
        raise argparse.ArgumentError(None, f"{name} {str(value)[:40]!r} is unknown{hint}")

    def _given(self, args: Sequence[str] | None) -> dict[str, str]:
        """The options given in a command line, whatever their values."""
        defaults = [(action, action.default) for action in self._actions]
        self.seen.clear()
        try:
            for action, _ in defaults:
                action.default = argparse.SUPPRESS
            values = vars(super().parse_known_args(args)[0])
        finally:
            for action, default in defaults:
                action.default = default
        # A missing positional argument may get its default anyway.
        given = {name for name, value in values.items() if value != argparse.SUPPRESS}
        return {name: typed for name, typed in self.options.items() if name in given}

    def every_action(self) -> Iterator[argparse.Action]:
        """The options and arguments of this parser and of the commands below it."""
        for action in self._actions:
            yield action
            if isinstance(action, argparse._SubParsersAction):
                for parser in dict.fromkeys(action.choices.values()):
                    yield from parser.every_action()

    def chosen(self, arguments: argparse.Namespace) -> Parser:
        """The parser of the command in a command line."""
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):
                chosen: Parser = action.choices[getattr(arguments, action.dest)]
                return chosen.chosen(arguments)
        return self

    def strange_suffix(self, arguments: argparse.Namespace) -> str | None:
        """The error in the suffix of an output file, which selects its format, or None."""
        for action in self._actions:
            path, suffixes = getattr(arguments, action.dest, None), getattr(action, "suffixes", ())
            if isinstance(path, (Output, TableOrStore)) and suffixes and not _no_file(path):
                endings = [f".{suffix}" for suffix in suffixes]
                if not path.endswith(tuple(endings)):
                    *others, last = endings
                    words = f"{', '.join(others)} or {last}" if others else last
                    return f"{action.option_strings[-1]} {path}: the name must end with {words}"
        return None

    def option_of(self, argument: str, value: Any, arguments: argparse.Namespace) -> str | None:
        """The option, as typed, that gave an argument of the library its value, or None.

        Of several, such as --seed and --walk-seed for a seed, it is the one with that value.
        """
        word = _ARGUMENTS.get(argument, argument.removeprefix("the number of "))
        found = [
            (typed, given)
            for name, typed in self.options.items()
            if f"_{name}".endswith(f"_{word}")
            and (given := getattr(arguments, name, None)) is not None
        ]
        if len(found) > 1:
            plain = isinstance(value, (int, float, str))
            found = [one for one in found if one[1] is value or (plain and one[1] == value)]
        return found[0][0] if found else None

    def paths(self, arguments: argparse.Namespace) -> Iterator[tuple[str, str]]:
        """(as typed, path with its role) of every path in a command line."""
        for name, typed in self.options.items():
            value = getattr(arguments, name, None)
            for word in value if isinstance(value, list) else [value]:
                for path in getattr(word, "files", [word]):
                    if isinstance(path, ROLES):
                        yield typed, path


def make_parser() -> Parser:
    """The parser of the whole command line."""
    parser = Parser(
        prog="granforce",
        description="Quantify how undetermined the contact forces in packings of rigid disks are.",
        epilog="Example:\n  granforce walk -n 400 --mu 0.1 --seed 1 --states 1000",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"granforce {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for command in COMMANDS:
        function = command.name.replace("-", "_")
        function += "_" if command.name in _TAKEN else ""
        added = _add_command(commands, command, command.example, function)
        if command.formats:
            formats = added.add_subparsers(dest="format", metavar="FORMAT", required=True)
            for form in command.formats:
                example = f"{added.prog} {form.name} {form.example} --mu 0.3 --out packing.npz"
                _add_command(formats, form, example, function)
    return parser


def _add_command(
    commands: argparse._SubParsersAction[Parser], command: Command, example: str, function: str
) -> Parser:
    """Add a command, which runs this function of `granforce.cli.commands`."""
    report = f"Lines of the report:\n{explanation(command.lines)}\n\n" if command.lines else ""
    if command.columns:
        columns = explanation(command.columns)
        report += f"At most {FEW} contacts are listed, with columns\n{columns}\n\n"
    parser = commands.add_parser(
        command.name,
        help=command.summary,
        description=command.summary[0].upper() + command.summary[1:] + ".",
        epilog=f"{report}Example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.set_defaults(run=function)
    for part in command.parts:
        if isinstance(part, Group):
            group = parser.add_argument_group(part.title, part.description)
            if part.one_of:
                _add_options(group.add_mutually_exclusive_group(), part.one_of)
            _add_options(group, part.options)
        else:
            _add_options(parser, part)
    parser.unused = command.rules
    return parser


def _add_options(group: argparse._ActionsContainer, options: Options) -> None:
    for option in options:
        group.add_argument(option.typed, **option.keywords)
