"""The command line; `granforce COMMAND --help` explains each command with an example."""

from __future__ import annotations

import argparse
import errno
import os
import sys
import warnings
from collections.abc import Sequence
from typing import NoReturn

from granforce.cli.parser import Parser, make_parser, refuse
from granforce.cli.path_roles import Input, Output, StorePath, Workplace
from granforce.system import interrupts, streams

# Standard library only: --help must not wait for numba, xarray and HiGHS.


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code.

    0; 1 if some cells failed, or a result could not be printed or stored; 2 for invalid input; 130
    after Ctrl-C.
    """
    with streams.guard_output():
        try:
            try:
                return _main(argv)
            finally:
                sys.stdout.flush()
        except (streams.ReaderGone, BrokenPipeError):  # BrokenPipeError: a file that is a pipe
            return 0
        except streams.OutputError as error:
            print(f"granforce: cannot write to standard output: {error}", file=sys.stderr)
            return 1


def _main(argv: Sequence[str] | None) -> int:
    parser = make_parser()
    arguments = parser.parse_args(argv)
    usual = warnings.formatwarning
    with interrupts.record_interrupts():
        try:
            return _run(arguments, parser)
        except KeyboardInterrupt as error:
            return _report_interrupt(str(error))
        except streams.OutputError:
            raise
        except Exception:
            if interrupts.interrupted():  # raised by a library because of Ctrl-C
                return _report_interrupt()
            raise
        finally:
            warnings.formatwarning = usual


def command() -> NoReturn:
    """The process `granforce`: runs main and exits without waiting for remaining threads."""
    streams.prepare()
    code = main()
    cancelling = sys.modules.get("granforce.system.cancelling")
    if cancelling is not None and cancelling.left_behind():
        os._exit(code)  # main has flushed all output
    sys.exit(code)


def _run(arguments: argparse.Namespace, parser: Parser) -> int:
    command = parser.chosen(arguments)
    for _, path in command.paths(arguments):
        # Before the imports, which take seconds.
        if isinstance(path, Input) and not os.path.lexists(os.path.expanduser(path)):
            return refuse(f"{path}: cannot be read (No such file or directory); check the path")
    threads = os.environ.get("NUMBA_NUM_THREADS", "").strip()
    if threads.lstrip("-").isdecimal() and threads.lstrip("0")[:1] in ("", "-"):
        # numba's import would fail.
        return refuse(
            f"NUMBA_NUM_THREADS must be at least 1, got {threads[:20]}; change or unset it"
        )
    if arguments.run == "app":
        # Several computations share the cores: BLAS threads of each would wait for one another.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from granforce.records import Cancelled, InputError
    from granforce.system.terminal import one_line

    warnings.formatwarning = one_line
    try:
        from granforce.cli import commands
        from granforce.system.compiled import tell_when_compiling
        from granforce.system.terminal import Bar

        interrupts.check()  # an import may have swallowed Ctrl-C
        tell_when_compiling(_say_compiling, Bar.restart)
        _check_paths(arguments, command)
        code: int = getattr(commands, arguments.run)(arguments) or 0
        store = getattr(arguments, "store", None)
        return max(code, 1) if store is not None and store.incomplete else code
    except InputError as error:
        option = command.option_of(error.argument, error.value, arguments)
        return refuse(option + str(error).removeprefix(error.argument) if option else str(error))
    except OSError as error:
        if error.errno not in (errno.EMFILE, errno.ENFILE):
            raise
        return refuse("too many open files; use fewer --workers, or raise the limit (ulimit -n)")
    except MemoryError as error:
        return refuse(f"not enough memory: {str(error) or 'ask for less'}")
    except Cancelled:
        return _report_interrupt()


def _check_paths(arguments: argparse.Namespace, command: Parser) -> None:
    """InputError if an input file would be overwritten, or two results have one name."""
    from granforce.records import InputError
    from granforce.study.store import default_path
    from granforce.system.files import check_apart

    named = list(command.paths(arguments))
    if "cache" in command.options and not any(isinstance(path, StorePath) for _, path in named):
        named.append(("the store", StorePath(default_path())))
    check_apart(
        replaced=[(typed, path) for typed, path in named if isinstance(path, Output)],
        folders=[(typed, path) for typed, path in named if isinstance(path, Workplace)],
        stores=[(typed, path) for typed, path in named if isinstance(path, StorePath)],
        read=[(typed, path) for typed, path in named if isinstance(path, Input)],
    )
    if strange := command.strange_suffix(arguments):
        raise InputError(strange)


def _report_interrupt(saved: str = "") -> int:
    saved = saved and f"; {saved}; run the same command again to continue"
    print(f"granforce: interrupted{saved}", file=sys.stderr)
    return 130


def _say_compiling() -> None:
    # Like a progress line, which later ones may overwrite.
    print("\rgranforce: compiling what this command needs, once per machine …", file=sys.stderr)
