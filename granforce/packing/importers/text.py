"""Text from a path or an open file, and tables whose errors name file and line."""

from __future__ import annotations

import bz2
import csv
import gzip
import io
import itertools
import lzma
import math
import os
import re
import zlib
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from importlib import import_module
from typing import IO, Any, NamedTuple

import numpy as np

from granforce.records import InputError, are_whole
from granforce.system.files import content_of, path_text
from granforce.system.wording import number
from granforce.types import Floats, Integers, Mask

# Larger numbers cannot be lengths or forces, and their squares would overflow.
LARGEST = 1e100

# Compressed text may unpack to _RATIO times its size, and small files to _SMALL bytes: dumps reach
# 3 to 20 times their size, and files with a far larger ratio are not dumps.
_RATIO, _SMALL = 100, 2**24
_COMMENT = "#%"  # begins a comment above the header
# First bytes of compressed files, and what unpacks them.
_PACKED: dict[bytes, Any] = {b"\x1f\x8b": gzip, b"BZh": bz2, b"\xfd7zXZ\0": lzma}
_ZSTD, _ZIP = b"\x28\xb5\x2f\xfd", b"PK\x03\x04"

Source = str | os.PathLike[str] | IO[str] | IO[bytes]  # a path, or an open file


# Texts of missing values, in lower case.
MISSING = ("", "nan", "-nan")
# Suffix allowed in the names of columns of forces in the packing's unit.
PACKING = " [packing]"


class EmptyError(InputError):
    """A file contains nothing."""


class Table(NamedTuple):
    """Rows of text fields and their places in a file, under columns once they are `named`."""

    name: str  # file name, for messages
    header: tuple[str, ...]  # column names
    rows: list[list[str]]  # of one table with as many fields as columns
    lines: Sequence[int | str]  # line number of each row, and which of several files it is in
    word: str = "line"  # what these numbers count
    comments: Sequence[str] = ()  # lines that began with a comment sign, without it
    complete: bool = True  # False if the last number may be cut off: its line has no end

    def named(self, header: Sequence[str]) -> Table:
        """The table with other column names, checked to be as many as the fields of every row.

        Raises InputError naming a row of another length, or a repeated column name.
        """
        for column, times in Counter(header).items():
            if column and times > 1:
                raise InputError(
                    f"{self.name}: column {some_of([column])} appears twice; rename or remove one"
                )
        for row, fields in enumerate(self.rows):
            if len(fields) != len(header):
                raise InputError(
                    f"{self.place(row)}: {len(fields)} fields for {len(header)} columns; "
                    "fill or remove the row"
                )
        return self._replace(header=tuple(header))

    def place(self, row: int) -> str:
        """'file, line n' of a row."""
        return f"{self.name}, {self.word} {self.lines[row]}"

    def some(self, rows: Iterable[int]) -> Table:
        """The table with some of its rows, in this order."""
        chosen = list(rows)
        return self._replace(
            rows=[self.rows[k] for k in chosen], lines=[self.lines[k] for k in chosen]
        )

    def in_packing_unit(self, forces: Collection[str]) -> Table:
        """The table without the suffix ``[packing]`` of names.

        forces: columns that must be in this unit. Raises InputError for one in another.
        """
        for name in self.header:
            column, bracket, _ = name.partition(" [")
            if bracket and column in forces and not name.endswith(PACKING):
                raise InputError(
                    f"{self.name}: column {_quoted(name)} is not in the packing's unit; write the "
                    "table with --unit packing, or multiply it and leave out the brackets"
                )
        return self.named([name.removesuffix(PACKING) for name in self.header])

    def require(self, *columns: str) -> None:
        """InputError unless all these columns are present."""
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

    def numbers(self, column: str, missing: Collection[str] = ()) -> Floats:
        """One column as float64 (rows,); InputError names the line of an invalid number.

        missing: texts in lower case, such as "nan", whose number is NaN.
        """
        values = np.empty(len(self.rows))
        for row, text in enumerate(self.fields(column)):
            values[row] = value = number_or_nan(text)
            if math.isnan(value) and text.lower() not in missing:
                raise InputError(
                    f"{self.place(row)}: {column} is {_quoted(text)}, not a finite number; "
                    "repair or remove the row"
                )
        return values

    def whole(self, column: str) -> Integers:
        """One column as int64 (rows,) ≥ 0; InputError names the line of an invalid entry."""
        values = self.numbers(column)
        for row in np.flatnonzero(~are_whole(values))[:1]:
            raise InputError(
                f"{self.place(row)}: {column} is {_quoted(self.fields(column)[row])}, but must be "
                "a whole number, at least 0; repair or remove the row"
            )
        return values.astype(np.int64)

    def index(self, column: str) -> dict[int | str, int]:  # type: ignore[override]
        """Row number of each label in a column, a dict; InputError for a repeated label."""
        rows: dict[int | str, int] = {}
        for row, text in enumerate(self.fields(column)):
            first = rows.setdefault(_label(text), row)
            if first != row:
                raise InputError(
                    f"{self.place(row)}: {column} {_quoted(text)} already appears in {self.word} "
                    f"{self.lines[first]}; give each grain once"
                )
        return rows

    def among(self, column: str, index: Mapping[Any, int]) -> Mask:
        """Mask (rows,) of the labels in a column that are in the index."""
        return np.array([_label(text) in index for text in self.fields(column)], dtype=bool)

    def lookup(self, column: str, index: Mapping[Any, int]) -> Integers:
        """Row numbers (rows,) int64 of the labels in a column; InputError for an unknown label."""
        positions = np.empty(len(self.rows), dtype=np.int64)
        for row, text in enumerate(self.fields(column)):
            position = index.get(_label(text))
            if position is None:
                raise InputError(
                    f"{self.place(row)}: {column} names grain {_quoted(text)}, which is not "
                    "among the grains; correct it or add the grain"
                )
            positions[row] = position
        return positions


def make_table(
    name: str,
    header: Sequence[str],
    rows: list[list[str]],
    lines: Sequence[int],
    word: str = "line",
) -> Table:
    """A Table with named columns; InputError as by `Table.named`."""
    return Table(name, (), rows, lines, word).named(header)


def some_of(columns: Sequence[str]) -> str:
    """The names of columns for a message, only the first of many."""
    names = [name if len(name) <= 40 else name[:37] + "…" for name in columns[:12]]
    return ", ".join([*names, *(["…"] if len(columns) > len(names) else [])])


def renamed(columns: Mapping[str, str], names: Sequence[str], *tables: Table) -> list[Table]:
    """The tables with columns renamed to the names used here.

    columns: {name here: name in the files}, case-insensitive. Raises InputError for a name that is
    not in `names`, or a column that no table has.
    """
    if not isinstance(columns, Mapping) or not all(isinstance(v, str) for v in columns.values()):
        raise InputError(f"columns must be {{name here: name in the files}}, got {columns!r:.60}")
    by_column = {theirs.lower(): name for name, theirs in columns.items()}
    if len(by_column) < len(columns):
        raise InputError("one column is used for two names; give each its own column")
    header = [one for table in tables for one in table.header]
    for name, theirs in columns.items():
        if name not in names:
            raise InputError(f"unknown column {name[:40]!r}; choose from {', '.join(names)}")
        if theirs.lower() not in map(str.lower, header):
            raise InputError(f"no column {theirs[:40]!r}; the columns are {some_of(header)}")

    def ours(column: str, header: Sequence[str]) -> str:
        if column.lower() in by_column:
            return by_column[column.lower()]
        # A column whose name is assigned to another column is renamed.
        taken = column in columns and columns[column].lower() in map(str.lower, header)
        return f"other {column}" if taken else column

    return [
        table._replace(header=tuple(ours(one, table.header) for one in table.header))
        for table in tables
    ]


def read_columns(text: str, option: str = "--columns") -> dict[str, str]:
    """{name here: name in the file} of 'x=…,y=…'; InputError, naming the option, otherwise."""
    pairs = [part.split("=", 1) for part in text.split(",")]
    if not all(len(pair) == 2 and pair[1].strip() for pair in pairs):
        raise InputError(f"{option} {text[:40]!r}: give them as NAME=…,NAME=…")
    names = [name.strip() for name, _ in pairs]
    if len(set(names)) < len(names):
        raise InputError(f"{option} {text[:40]!r}: give each name once")
    return dict(zip(names, (theirs.strip() for _, theirs in pairs), strict=True))


def check_grains(count: int, most: int | None, name: str) -> None:
    """InputError if a file has more grains than allowed (most; None: any number)."""
    if most is not None and count > most:
        raise InputError(f"{name}: {count} grains; at most {most} are supported")


def read_text(source: Source) -> tuple[str, str]:
    """Name and text (UTF-8) of a path or of an open text or binary file; InputError otherwise.

    Files compressed by gzip, bzip2 or xz are unpacked, and by Zstandard if Python has a module for
    it.
    """
    if hasattr(source, "read"):
        name, content = str(getattr(source, "name", "the given file")), source.read()
    else:
        name, content = path_text(source), content_of(source)
    name = os.path.basename(name) or name
    try:
        if not isinstance(content, str):
            content = _unpacked(name, bytes(content)).decode("utf-8-sig")
        text = content
    except UnicodeDecodeError:
        raise InputError(f"{name}: not a text file; give plain text in UTF-8") from None
    if not text.strip():
        raise EmptyError(f"{name}: the file is empty")
    return name, text


def read_csv(source: Source) -> Table:
    """A Table from text with a header line, separated by commas, semicolons, tabs or blanks.

    Column names are converted to lower case; comments above the header, empty rows at the end, and
    empty fields at the end of all lines are skipped. Raises InputError, also for empty rows between
    others, where data may be missing.
    """
    return csv_table(*read_text(source))


def csv_table(name: str, text: str) -> Table:
    """A Table from the text of a file that `read_csv` takes."""
    lines = _from_the_header(text.splitlines())
    head = next(line for line in lines if line.strip())
    delimiter = separator_of(head) or (" " if " " in head.strip() else ",")
    lines = [line.strip() for line in lines] if delimiter == " " else lines
    reader = csv.reader(lines, delimiter=delimiter, skipinitialspace=True)
    rows, numbers = [], []
    try:
        for fields in reader:
            rows.append([field.strip() for field in fields])
            numbers.append(reader.line_num)
    except csv.Error as error:
        raise InputError(f"{name}, line {reader.line_num}: {error}; repair the line") from None
    filled = [k for k, fields in enumerate(rows) if any(fields)]
    for before, after in itertools.pairwise(filled):
        if after > before + 1 and before > filled[0]:
            raise InputError(f"{name}, line {numbers[before + 1]}: an empty row; fill or remove it")
    rows, numbers = [rows[k] for k in filled], [numbers[k] for k in filled]
    if len(rows) < 2:
        raise InputError(f"{name}: a header line and at least one row are needed")
    header, *rows = _trimmed(rows)
    if all(is_number(column) for column in header):
        raise InputError(
            f"{name}: the first line contains only numbers; add a line with the names of the "
            "columns, such as x,y,r for grains (other names: --columns, or columns= in Python)"
        )
    return make_table(name, [column.lower() for column in header], rows, numbers[1:])


def read_rows(*sources: Source) -> Table:
    """A Table without names, at least one row, of fields separated by blanks or commas.

    Lines that begin with # are its comments, in lower case. Several files are read as one. Raises
    InputError.
    """
    texts = [read_text(source) for source in sources]
    lines = [
        (number if len(texts) == 1 else f"{number} of {name}", line.lstrip())
        for name, text in texts
        for number, line in numbered_lines(text)
    ]
    rows = [(number, line) for number, line in lines if not line.startswith("#")]
    name = texts[0][0] if len(texts) == 1 else os.path.splitext(texts[0][0])[0]
    if not rows:
        raise InputError(f"{name}: no line with numbers")
    return Table(
        name,
        (),
        [line.replace(",", " ").split() for _, line in rows],
        [number for number, _ in rows],
        comments=[line.lstrip("# \t").lower() for _, line in lines if line.startswith("#")],
        complete=texts[-1][1].endswith("\n") or lines[-1][1].startswith("#"),
    )


def numbered_lines(text: str) -> list[tuple[int, str]]:
    """The lines that are not blank, and their numbers from 1."""
    return [(k, line) for k, line in enumerate(text.splitlines(), start=1) if line.strip()]


def separator_of(line: str) -> str | None:
    """What separates the fields of a line: a comma, semicolon or tab, or None for blanks."""
    return next((mark for mark in ",;\t" if mark in line), None)


def of_frame(frame: Any, name: str) -> Table:
    """The Table of a pandas DataFrame; named columns of its index count.

    Raises InputError for a table without rows.
    """
    if any(level is not None for level in frame.index.names):
        frame = frame.reset_index()
    if not len(frame):
        raise InputError(f"the DataFrame of {name} is empty")
    columns = [frame.iloc[:, k].tolist() for k in range(frame.shape[1])]
    return of_columns(f"the DataFrame of {name}", frame.columns, columns)


def of_columns(name: str, header: Iterable[Any], columns: Sequence[Sequence[Any]]) -> Table:
    """The Table of columns of values, whose rows count from 0; missing values are empty fields."""
    texts = [["" if value != value else str(value) for value in column] for column in columns]
    rows = [list(row) for row in zip(*texts, strict=True)]
    names = [str(column).strip().lower() for column in header]
    return make_table(name, names, rows, list(range(len(rows))), "row")


def _from_the_header(lines: list[str]) -> list[str]:
    """The lines, with comments (# or %) above the header left blank.

    If numbers follow them, the last comment is the header, as numpy.savetxt writes it.
    """
    filled = [k for k, line in enumerate(lines) if line.strip()]
    first = next((k for k in filled if lines[k].lstrip()[0] not in _COMMENT), None)
    comments = [k for k in filled if first is None or k < first]
    if first is None or not comments:
        return lines
    kept = [""] * first + lines[first:]
    if all(map(is_number, re.split(r"[,;\s]+", lines[first].strip(" ,;\t")))):
        kept[comments[-1]] = lines[comments[-1]].lstrip(_COMMENT + " \t")
    return kept


def is_number(text: str) -> bool:
    try:
        number(text)
    except ValueError:
        return False
    return True


def number_or_nan(text: str) -> float:
    """The number in a text, NaN unless it is finite and at most LARGEST."""
    try:
        value = number(text)
    except ValueError:
        return math.nan
    return value if abs(value) <= LARGEST else math.nan


def _trimmed(rows: list[list[str]]) -> list[list[str]]:
    """The rows of a table without the empty fields that separators at the end of lines leave."""
    header = rows[0]
    while header and not header[-1]:
        header = header[:-1]
    more = [fields for row in rows[1:] for fields in row[len(header) :]]
    return rows if any(more) else [header, *(row[: len(header)] for row in rows[1:])]


def _unpacked(name: str, content: bytes) -> bytes:
    """The content, decompressed; InputError if it is damaged or unpacks to far too much."""
    module = next((one for first, one in _PACKED.items() if content.startswith(first)), None)
    if content.startswith(_ZSTD):
        module = _zstd(name)
    if content.startswith(_ZIP):
        raise InputError(f"{name}: a ZIP or NPZ archive, not a text file; give the text itself")
    if module is None:
        return content
    most = max(_SMALL, _RATIO * len(content))
    try:
        with module.open(io.BytesIO(content), "rb") as file:
            unpacked = file.read(most + 1)
    except (EOFError, OSError, zlib.error, getattr(module, "ZstdError", lzma.LZMAError)) as error:
        raise InputError(
            f"{name}: compressed, and cannot be unpacked ({error}); is it cut off?"
        ) from None
    if len(unpacked) > most:
        raise InputError(
            f"{name}: unpacks to more than {_RATIO} times its size; unpack it yourself if that is "
            "expected"
        )
    return unpacked


def _zstd(name: str) -> Any:
    """The module that unpacks Zstandard: Python's own (3.14 or later), or its backport."""
    for module in ("compression.zstd", "backports.zstd"):
        try:
            return import_module(module)
        except ImportError:
            continue
    raise InputError(
        f"{name}: compressed with Zstandard; unpack it with zstd -d, or install backports.zstd"
    )


def _label(text: str) -> int | str:
    """An integer if the grain's name is one ('7', '7.0', '+7'), otherwise its text."""
    try:
        value = number(text)
    except ValueError:
        return text
    if not value.is_integer():
        return text
    # Beyond 2⁵³ floats do not distinguish consecutive integers.
    return int(value) if abs(value) < 2**53 else text


def _quoted(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "…")
