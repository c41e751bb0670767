"""Text from a path or an open file, and tables of it whose errors name file and line."""

from __future__ import annotations

import csv
import math
import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import IO, Any, NamedTuple

import numpy as np

from granforce.records import Floats, InputError, Integers, are_whole

# Numbers beyond this size cannot be lengths or forces, and their squares would overflow.
LARGEST = 1e100

Source = str | os.PathLike[str] | IO[str] | IO[bytes]  # a path, or an open file


class Table(NamedTuple):
    """Rows of text fields under named columns."""

    name: str  # of the file, for messages
    header: tuple[str, ...]  # column names
    rows: list[list[str]]  # as many fields as columns
    lines: list[int]  # line number of each row in the file

    def place(self, row: int) -> str:
        """'file, line n' of a row."""
        return f"{self.name}, line {self.lines[row]}"

    def some(self, rows: Iterable[int]) -> Table:
        """Some of the rows, in this order."""
        chosen = list(rows)
        return self._replace(
            rows=[self.rows[k] for k in chosen], lines=[self.lines[k] for k in chosen]
        )

    def require(self, *columns: str) -> None:
        """InputError unless all these columns are there."""
        missing = [column for column in columns if column not in self.header]
        if missing:
            raise InputError(
                f"{self.name}: no column {', '.join(missing)}; "
                f"the columns are {some_of(self.header)}"
            )

    def fields(self, column: str) -> list[str]:
        """The text of one column, a list."""
        self.require(column)
        position = self.header.index(column)
        return [row[position] for row in self.rows]

    def numbers(self, column: str) -> Floats:
        """One column as float64 (rows,); InputError names the line of what is not a number."""
        values = np.empty(len(self.rows))
        for row, text in enumerate(self.fields(column)):
            try:
                values[row] = float(text)
            except ValueError:
                values[row] = math.nan
            if not abs(values[row]) <= LARGEST:
                raise InputError(
                    f"{self.place(row)}: {column} is {_quoted(text)}, not a finite number; "
                    "repair or remove the row"
                )
        return values

    def whole(self, column: str) -> Integers:
        """One column as int64 (rows,) ≥ 0; InputError names the line of what is not whole."""
        values = self.numbers(column)
        for row in np.flatnonzero(~are_whole(values))[:1]:
            raise InputError(
                f"{self.place(row)}: {column} is {_quoted(self.fields(column)[row])}, and must be "
                "a whole number, at least 0; repair or remove the row"
            )
        return values.astype(np.int64)

    def index(self, column: str) -> dict[int | str, int]:  # type: ignore[override]
        """Row number of each label in a column, a dict; InputError for a label given twice."""
        rows: dict[int | str, int] = {}
        for row, text in enumerate(self.fields(column)):
            first = rows.setdefault(_label(text), row)
            if first != row:
                raise InputError(
                    f"{self.place(row)}: {column} {_quoted(text)} was given in line "
                    f"{self.lines[first]} already; give each grain once"
                )
        return rows

    def lookup(self, column: str, index: Mapping[Any, int]) -> Integers:
        """Row numbers (rows,) int64 of the labels in a column; InputError for an unknown one."""
        found = np.empty(len(self.rows), dtype=np.int64)
        for row, text in enumerate(self.fields(column)):
            position = index.get(_label(text))
            if position is None:
                raise InputError(
                    f"{self.place(row)}: {column} names grain {_quoted(text)}, which is not "
                    "among the grains; correct it or add the grain"
                )
            found[row] = position
        return found


def make_table(name: str, header: Sequence[str], rows: list[list[str]], lines: list[int]) -> Table:
    """A Table, once every row is seen to have as many fields as there are column names.

    Raises InputError naming the row that has not, or the column name that is there twice.
    """
    for column, times in Counter(header).items():
        if column and times > 1:
            raise InputError(
                f"{name}: column {some_of([column])} is there twice; rename or remove one"
            )
    table = Table(name, tuple(header), rows, lines)
    for row, fields in enumerate(rows):
        if len(fields) != len(header):
            raise InputError(
                f"{table.place(row)}: {len(fields)} fields for {len(header)} columns; "
                "fill or remove the row"
            )
    return table


def some_of(columns: Sequence[str]) -> str:
    """The names of columns for a message, the first where there are many."""
    names = [name if len(name) <= 40 else name[:37] + "…" for name in columns[:12]]
    return ", ".join([*names, *(["…"] if len(columns) > len(names) else [])])


def check_grains(count: int, most: int | None, name: str) -> None:
    """InputError for a file of more grains than are taken (most; None: any number)."""
    if most is not None and count > most:
        raise InputError(f"{name}: {count} grains, where at most {most} are taken")


def read_text(source: Source) -> tuple[str, str]:
    """Name and text (UTF-8) of a path or of an open text or bytes file; InputError otherwise."""
    if hasattr(source, "read"):
        name, content = str(getattr(source, "name", "the given file")), source.read()
    else:
        name, content = os.fspath(source), _bytes(source)
    name = os.path.basename(name) or name
    try:
        text = content if isinstance(content, str) else bytes(content).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{name}: not a text file; give plain text in UTF-8") from None
    if not text.strip():
        raise InputError(f"{name}: the file is empty")
    return name, text


def read_csv(source: Source) -> Table:
    """A Table from text with a header line, separated by commas, semicolons, tabs or blanks.

    Column names are taken in lower case; blank lines are skipped. Raises InputError.
    """
    name, text = read_text(source)
    lines = text.splitlines()
    head = next(line for line in lines if line.strip())
    delimiter = next((mark for mark in ",;\t" if mark in head), " " if " " in head.strip() else ",")
    lines = [line.strip() for line in lines] if delimiter == " " else lines
    reader = csv.reader(lines, delimiter=delimiter, skipinitialspace=True)
    rows, numbers = [], []
    try:
        for fields in reader:
            if any(field.strip() for field in fields):
                rows.append([field.strip() for field in fields])
                numbers.append(reader.line_num)
    except csv.Error as error:
        raise InputError(f"{name}, line {reader.line_num}: {error}; repair the line") from None
    if len(rows) < 2:
        raise InputError(f"{name}: a header line and at least one row are needed")
    return make_table(name, [column.lower() for column in rows[0]], rows[1:], numbers[1:])


def _bytes(path: str | os.PathLike[str]) -> bytes:
    try:
        with open(path, "rb") as file:
            return file.read()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read ({reason}); check the path") from None


def _label(text: str) -> int | str:
    """Grain names compare as whole numbers where they are ('7', '7.0', '+7'), else as text."""
    try:
        number = float(text)
    except ValueError:
        return text
    if not number.is_integer():
        return text
    # Past 2⁵³ a float no longer tells neighbouring numbers apart.
    return int(number) if abs(number) < 2**53 else text


def _quoted(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "…")
