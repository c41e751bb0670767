"""Frames in text files of positions and contacts.

The files may have a column for the frame, a flag for grains at walls, and a header, with fields
separated by commas, semicolons, tabs or blanks. Where header or contents of the columns allow two
readings (`columns`), contacts must join neighbours. Without a column for the frame, a new frame
begins where the ids of the grains restart.

The formats of PeGS are those in its README (github.com/photoelasticity), modules particleTrack and
adjacencyMatrix. Angles and signs refer to the axes of the files: **t** is **n** turned from x to y.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from granforce.experiment.listings.columns import (
    CONTACTS,
    GRAINS,
    PRESSURE,
    SLIDING,
    ascending_parts,
    columns_by_name,
    columns_of_file,
    possible_names,
    restarts,
)
from granforce.experiment.listings.listing import Listing, plain
from granforce.packing.importers.text import (
    EmptyError,
    Source,
    Table,
    number_or_nan,
    numbered_lines,
    read_text,
    separator_of,
)
from granforce.records import InputError, brief_list
from granforce.types import Floats, Integers

# Least fraction of the contacts that join neighbours if the columns are those that were recognised.
_FITS = 0.9
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", None: "blanks"}


class Columns(NamedTuple):
    """The numbers in a text file, by the recognised names of columns."""

    name: str  # file name
    values: dict[str, Floats]  # {column: (rows,)}
    lines: Integers  # (rows,) line numbers
    description: str
    frame_given: bool  # whether the column for the frame is one that was given

    @property
    def frames(self) -> Floats:
        """Numbers of the frames, ascending; empty without such a column."""
        numbers = self.values.get("frame", np.zeros(0))
        return np.unique(numbers[np.isfinite(numbers)])

    @property
    def has_frames(self) -> bool:
        """Whether there is a column for the frame, or ids that restart."""
        return "frame" in self.values or (
            "id" in self.values and restarts(self.values["id"]) is not None
        )

    def of(self, frame: float) -> Columns:
        """The rows of one frame, or all rows if there is no column for the frame."""
        if "frame" not in self.values:
            return self
        rows = self.values["frame"] == frame
        values = {name: column[rows] for name, column in self.values.items()}
        return self._replace(values=values, lines=self.lines[rows])

    def with_frames(self, frame: Floats | Integers) -> Columns:
        """The columns and one for the frame (rows,), derived from ids."""
        values = self.values | {"frame": np.asarray(frame, dtype=np.float64)}
        return self._replace(
            values=values, description=f"{self.description}, frames told apart by the ids"
        )


class TextFrames(NamedTuple):
    """The two files of one or many frames."""

    grains: Columns
    contacts: Columns

    @property
    def frames(self) -> Floats:
        """Numbers of the frames that are in both files, ascending, at least one."""
        one, two = self.grains.frames, self.contacts.frames
        if len(one) and len(two):
            both = np.intersect1d(one, two)
            if not len(both):
                raise InputError(
                    f"{self.grains.name} and {self.contacts.name} have no frame in common"
                )
            return both
        if len(one) > 1 or len(two) > 1:
            single, many = (self.grains, self.contacts) if len(two) > 1 else reversed(self)
            raise InputError(
                f"{many.name} has {len(many.frames)} frames, but {single.name} has no column for "
                "the frame; give files with one frame, or add the column"
            )
        return one if len(one) else two if len(two) else np.ones(1)

    @property
    def notes(self) -> list[str]:
        """Words on frames that are in one of the files only."""
        numbers = np.setxor1d(self.grains.frames, self.contacts.frames)
        if not len(numbers) or not (len(self.grains.frames) and len(self.contacts.frames)):
            return []
        named = brief_list([plain(number) for number in numbers])
        return [f"frames {named} are not in both files: left out"]

    def listing(self, frame: float | None = None) -> Listing:
        """The Listing of a frame, by default the last."""
        available = self.frames
        if frame is None:
            frame = available[-1]
        if frame not in available:
            raise InputError(
                f"frame {plain(float(frame))} is not in both files; "
                f"they have {plain(available[0])} … {plain(available[-1])}"
            )
        grains, contacts = (one.of(frame) for one in self)
        g, c = grains.values, contacts.values
        count, links = len(grains.lines), len(contacts.lines)
        return Listing(
            ids=g["id"] if "id" in g else np.arange(1.0, count + 1),
            x=np.column_stack([g["x"], g["y"]]),
            r=g["radius"],
            flag=np.nan_to_num(g["flag"]) if "flag" in g else np.zeros(count),
            ends=np.column_stack([c["id1"], c["id2"]]),
            forces=np.column_stack([c["normal"], c["tangential"]]),
            beta=np.full(links, np.nan),
            weight=np.ones(links),
            names=(grains.name, contacts.name),
            lines=(grains.lines, contacts.lines),
            both_ways=False,
            frame=float(frame),
            description=f"{grains.description}; {contacts.description}",
            pressure=g.get("pressure"),
        )


def read_frames(
    positions: Source, adjacency: Source, columns: Mapping[str, str] | None = None
) -> TextFrames:
    """The TextFrames in two files, paths or open files; InputError for other files.

    columns: {frame, id, x, y, r, flag, pressure, i, j, f_t or f_n: its header in the files, or its
    number from 1}. If one column of a file is given, the others are recognised by headers only.
    frame is that of both files; its number applies to files of which other columns are given, too.
    """
    given = columns_by_name(columns or {})
    grains, contacts = (
        _readings(source, wanted, given)
        for source, wanted in ((positions, (*GRAINS, PRESSURE)), (adjacency, CONTACTS))
    )
    if "frame" in given and not (grains[0].frame_given or contacts[0].frame_given):
        raise InputError(
            f"{grains[0].name} and {contacts[0].name}: no column has the header "
            f"{given['frame'][:40]!r} for frame; to give its number, also give the other columns "
            "of its file"
        )
    return _best_fitting(grains, contacts)


# A file: its fields, its header, its numbers, and the possible names of its columns.


def _readings(source: Source, wanted: Sequence[str], given: Mapping[str, str]) -> Sequence[Columns]:
    """The possible Columns of a text file of grains or contacts, the most likely first."""
    table, separator = _separated(source)
    header, table = _header_and_rows(table)
    numbers = _numbers(table)
    ours = columns_of_file(given, wanted, header)
    return [
        Columns(
            table.name,
            {column: numbers[:, k] for k, column in enumerate(names) if column},
            np.array(table.lines),
            f"{table.name}: {', '.join(filter(None, names))}, separated by "
            f"{_SEPARATORS[separator]}",
            "frame" in ours,
        )
        for names in possible_names(table.name, header, numbers, wanted, ours)
    ]


def _separated(source: Source) -> tuple[Table, str | None]:
    """The fields of all lines, and what separates them in the last."""
    name, text = read_text(source)
    if "\0" in text:
        raise InputError(f"{name}: not a text file; give plain text")
    numbers, lines = zip(*numbered_lines(text), strict=True)
    separator = separator_of(lines[-1])
    rows = [[field.strip() for field in line.split(separator)] for line in lines]
    return Table(name, (), rows, list(numbers)), separator


def _header_and_rows(table: Table) -> tuple[Sequence[str] | None, Table]:
    """The last line without numbers above the first with numbers, and the rows from there."""
    first = next(
        (k for k, row in enumerate(table.rows) if np.isfinite(list(map(number_or_nan, row))).any()),
        None,
    )
    if first is None:
        raise EmptyError(f"{table.name}: no line with numbers; is it a PeGS file?")
    header = table.rows[first - 1] if first else None
    return header, table.some(range(first, len(table.rows)))


def _numbers(table: Table) -> Floats:
    """The numbers (rows, columns), NaN in lines of another length than most.

    Such lines do not belong to the table.
    """
    counts = [len(row) for row in table.rows]
    width = max(set(counts), key=counts.count)
    numbers = np.full((len(counts), width), np.nan)
    for row, fields in zip(numbers, table.rows, strict=True):
        if len(fields) == width:
            row[:] = [number_or_nan(field) for field in fields]
    return numbers


# Both files: the readings that fit, and their frames.


def _best_fitting(grains: Sequence[Columns], contacts: Sequence[Columns]) -> TextFrames:
    """The readings of both files by which most contacts join neighbours, or else the first.

    If the grains have no frames, a third column of 0 and 1 of the contacts is a flag.
    """
    pairs = [
        (one, two)
        for one in grains
        for two in sorted(
            contacts, key=lambda two: SLIDING not in two.values and not one.has_frames
        )
    ]
    joined = [_joined(*pair) for pair in pairs] if len(pairs) > 1 else [1]
    one, two = pairs[joined.index(max(joined))]
    first = two.values["id1"]
    is_constant = len(np.unique(first)) == 1 < len(first)
    if np.count_nonzero(joined) != 1 and SLIDING in two.values and is_constant:
        raise InputError(
            f"{two.name}: the first of five columns is always {plain(first[0])}, and the third is "
            "0 or 1, so the columns of the grains are unknown: name the columns (--columns "
            "i=…,j=…,f_t=…,f_n=…)"
        )
    return _with_frames(one, two)


def _joined(grains: Columns, contacts: Columns) -> int:
    """Number of contacts in the last frame; 0 if too few join neighbours, with any order of ids."""
    try:
        listing = _with_frames(grains, contacts).listing()
    except InputError:
        return 0
    fit = max(listing.fit, *(other.fit for _, _, other in listing.renumbered()))
    return len(listing.ends) if fit >= _FITS else 0


def _with_frames(grains: Columns, contacts: Columns) -> TextFrames:
    """Both files with a column for the frame; without one, it is derived from restarting ids."""
    if "frame" in grains.values or "id" not in grains.values:
        return TextFrames(grains, contacts)
    parts = restarts(grains.values["id"])
    if parts is None:
        return TextFrames(grains, contacts)
    count, numbers = int(parts[-1]), contacts.frames
    if not len(numbers):
        contacts = contacts.with_frames(_frames_by_ends(grains, contacts, count))
    elif len(numbers) == count:
        parts = numbers[parts - 1]
    else:
        raise InputError(
            f"{grains.name}: ids restart {count} times, but {contacts.name} has {len(numbers)} "
            "frames; add a column for the frame"
        )
    return TextFrames(grains.with_frames(parts), contacts)


def _frames_by_ends(grains: Columns, contacts: Columns, count: int) -> Integers:
    """Frames (rows,) from 1 to `count` of contacts, by where the ids of their grains restart."""
    for end in ("id1", "id2"):
        parts = ascending_parts(contacts.values[end])
        if parts[-1] == count:
            return parts
    raise InputError(
        f"{grains.name}: ids restart {count} times, but in {contacts.name} it is unclear "
        "where a frame ends; add a column for the frame to both files"
    )
