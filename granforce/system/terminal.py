"""Output of commands: reports and tables on stdout, progress on stderr."""

import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, ClassVar, Self

from tqdm import tqdm

from granforce.system.wording import json_text, spaced


def print_list(rows: Sequence[Mapping[str, Any]], names: Sequence[str], as_json: bool) -> None:
    if as_json:
        print(json_text(rows))
    else:
        table(rows, names, {})


def print_report(lines: Mapping[str, Any], as_json: bool) -> None:
    """A report on stdout: names and numbers in two columns, sentences line by line, or JSON."""
    if as_json:
        print(json_text(lines))
        return
    width = max(len(spaced(name)) for name in lines)
    for name, value in lines.items():
        sentences = isinstance(value, list) and any(" " in str(part) for part in value)
        name = spaced(name)
        for part in value if sentences else [value]:
            print(f"{name:<{width}}  {text(part)}")
            name = ""


def print_notes(notes: Iterable[str]) -> None:
    """Notes on a report as lines on stderr; after it, where both go to one place."""
    sys.stdout.flush()
    for note in notes:
        print(f"granforce: {note}", file=sys.stderr)


def print_columns(columns: Mapping[str, Sequence[Any]]) -> None:
    """Columns {name: values} as a table on stdout."""
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    table(rows, list(columns), {name: spaced(name) for name in columns})


@contextmanager
def report_after(
    lines: Mapping[str, Any],
    as_json: bool,
    columns: Mapping[str, Sequence[Any]] | None = None,
    **worded: Sequence[Any],
) -> Iterator[None]:
    """Print a report once the files are written, or cannot be: a closed pipe costs no file.

    columns {name: values}: a table under the report, or more lines of the JSON report; worded:
    values of some columns as texts, for the table.
    """
    columns = columns or {}
    try:
        yield
    finally:
        print_report({**lines, **columns} if as_json else lines, as_json)
        if columns and not as_json:
            print_columns({**columns, **worded})


def table(
    rows: Sequence[Mapping[str, Any]], names: Sequence[str], heads: Mapping[str, str]
) -> None:
    cells = [[heads.get(name, name) for name in names]]
    cells += [[text(line[name]) for name in names] for line in rows]
    widths = [max(len(line[k]) for line in cells) for k in range(len(names))]
    for line in cells:
        print("  ".join(f"{cell:>{width}}" for cell, width in zip(line, widths, strict=True)))


def text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "undefined"
    if isinstance(value, (list, tuple)):
        return " ".join(text(part) for part in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def one_line(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    line: str | None = None,
) -> str:
    """A warning as one line without its place in the code, for warnings.formatwarning."""
    return f"{Bar.line_end()}granforce: {' '.join(str(message).split())}\n"


# Progress where stderr is no terminal: a line every so many seconds, not one for each step.
LOGGED_EVERY = 60.0
LOGGED = "{desc}: {n_fmt}/{total_fmt}{unit} [{elapsed}<{remaining}{postfix}]\n"


class Bar:
    """A tqdm bar on stderr that a progress(done, total) callable drives; invisible until used.

    Where stderr is no terminal, a line every LOGGED_EVERY seconds takes its place.
    """

    _drawn: ClassVar[set[int]] = set()  # those whose line has not ended
    restarts: ClassVar[int] = 0

    @classmethod
    def restart(cls) -> None:
        """Let the clocks of all bars begin at their next call: rates exclude the time until now."""
        cls.restarts += 1

    @classmethod
    def line_end(cls) -> str:
        """The end of an unfinished line of a bar, or an empty string."""
        return "\n" if cls._drawn else ""

    def __init__(self, label: str, unit: str) -> None:
        # Created now, so that its rate counts from the beginning, and shown at the first call.
        self._logged = not sys.stderr.isatty()
        shown: dict[str, Any] = {"delay": math.inf}
        if self._logged:
            shown = dict(delay=LOGGED_EVERY, mininterval=LOGGED_EVERY, bar_format=LOGGED)
        self.bar = tqdm(desc=label, unit=f" {unit}", file=sys.stderr, **shown)
        self._restarted = Bar.restarts

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: Any) -> None:
        if kind is None and self.bar.total and id(self) in self._drawn:
            self.bar.n = self.bar.total  # work that turned out not to be needed is done too
            self.bar.refresh()
        self.bar.close()
        self._drawn.discard(id(self))

    def __call__(self, done: float, total: float | None) -> None:
        """Set the progress; total may be unknown (None)."""
        if not self._logged:
            self._drawn.add(id(self))
            self.bar.delay = 0
        self.bar.total = total
        # Set, not added: quarters of cells would turn integers into 2.0.
        self.bar.n = int(done) if done == int(done) else done
        if self._restarted != Bar.restarts:
            self._restarted = Bar.restarts
            self.bar.unpause()
            self.bar.start_t, self.bar.initial = self.bar.last_print_t, self.bar.n
            self.bar.last_print_n = self.bar.n
        self.bar.update(0)

    def note(self, text: str) -> None:
        """Set the text after the bar when it is next drawn."""
        self.bar.set_postfix_str(text, refresh=False)
