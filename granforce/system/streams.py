"""Standard output and standard error that may be full, closed, or without a reader.

Failure to print a result is an error; failure to print progress is not. Standard library only: this
runs before anything else is imported.
"""

import errno
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO


class OutputError(Exception):
    """Standard output cannot be written; the message gives the reason."""


class ReaderGone(OutputError):
    """The reader of our output (head, less) has ended, which is not an error."""


class _Stream:
    """A text stream, or None for one that was closed at the start."""

    def __init__(self, stream: TextIO | None, number: int) -> None:
        self._stream, self._number = stream, number

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        return self._tried("write", text) or 0

    def flush(self) -> None:
        self._tried("flush")

    def isatty(self) -> bool:
        return self._stream is not None and self._stream.isatty()

    def _tried(self, method: str, *words: str) -> Any:
        try:
            if self._stream is None:
                raise OSError(errno.EBADF, os.strerror(errno.EBADF))
            return getattr(self._stream, method)(*words)
        except OSError as error:
            self._drain()
            self.failed(error)

    def failed(self, error: OSError) -> None:
        raise NotImplementedError

    def _drain(self) -> None:
        """Discard buffers, or Python would try to write them again at exit."""
        with suppress(OSError, AttributeError):
            if self._stream is not None and self._stream.fileno() == self._number:
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, self._number)
                os.close(nowhere)
                self._stream.flush()


class _OutputStream(_Stream):
    def failed(self, error: OSError) -> None:
        kind = ReaderGone if isinstance(error, BrokenPipeError) else OutputError
        raise kind(error.strerror or str(error)) from None


class _Progress(_Stream):
    def failed(self, error: OSError) -> None:
        pass


@contextmanager
def guard_output() -> Iterator[None]:
    """Within, stdout raises OutputError if it cannot be written, and stderr never raises."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = _OutputStream(sys.stdout, 1), _Progress(sys.stderr, 2)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def prepare() -> None:
    """Open those of the first three descriptors that are closed, and make all letters printable.

    Otherwise a file would get one of their numbers, and output of libraries would be written into
    it. Letters missing from the encoding of stdout are written as their codes.
    """
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDONLY if number < 2 else os.O_WRONLY)  # the lowest free one


def tell(line: str) -> None:
    """Print a line on stderr, if it can be written."""
    if sys.stderr is not None:
        with suppress(OSError):
            print(line, file=sys.stderr)
