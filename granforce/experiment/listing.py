"""The contents of the files of one photoelastic frame, before any check or repair.

Text files of positions and contacts may have a column for the frame, a flag for grains at walls,
and a header, with fields separated by commas, semicolons, tabs or blanks. Columns are recognised by
the header or, without one, by their number and contents, and where these allow two readings, by
whether contacts join neighbours:

    frame, id, x, y, radius, flag     id, x, y, radius, flag     x, y, radius, flag
    frame, id, x, y, radius           id, x, y, radius           x, y, radius
    frame, id1, id2, f_t, f_n         id1, id2, f_t, f_n         (the contacts; ids < 0: a wall)
    id1, id2, flag, f_t, f_n          (where the third is 0 or 1 throughout)

Without a column for the frame, a new frame begins where the ids of the grains restart.

The formats of PeGS are those in its README (github.com/photoelasticity), modules particleTrack and
adjacencyMatrix. Angles and signs refer to the axes of the files: **t** is **n** turned from x to y.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol, SupportsIndex

import numpy as np

from granforce.packing.importers.text import LARGEST, EmptyError, Source, read_text
from granforce.records import InputError, brief_list
from granforce.system.wording import number
from granforce.types import Floats, Integers, Mask

_GRAINS = ("frame", "id", "x", "y", "radius", "flag")
_CONTACTS = ("frame", "id1", "id2", "tangential", "normal")
# Synonyms, in lower case without blanks and brackets.
_WORDS = {
    "frame": ("frame", "frameid", "frame_id", "image", "step", "t"),
    "id": ("id", "particle", "particleid", "particle_id", "grain", "track", "label"),
    "x": ("x", "xpos", "x_px", "cx"),
    "y": ("y", "ypos", "y_px", "cy"),
    "radius": ("radius", "r", "r_px", "rad"),
    "flag": ("flag", "edge", "wall", "boundary"),
    "id1": ("id1", "i", "particle1", "grain1"),
    "id2": ("id2", "j", "particle2", "grain2"),
    "tangential": ("tangential", "ft", "f_t", "tangentialforce", "tangential_force"),
    "normal": ("normal", "fn", "f_n", "normalforce", "normal_force"),
}
_SLIDING = "flag (not used)"  # of a contact
# Least mean number of grains per frame, if frames are recognised by their ids.
_LEAST = 3
# Least fraction of the contacts that join neighbours if the columns are those that were recognised.
_FITS = 0.9
# Largest gap of two grains that may touch, in mean radii: centres and radii are known only to some
# tenths of a radius.
FAR = 1.0
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", None: "blanks"}


class Listing(NamedTuple):
    """Grains and contacts of one frame as listed; NaN for fields that are not finite numbers."""

    ids: Floats  # (N,) ids of the grains
    x: Floats  # (N, 2) centres
    r: Floats  # (N,) radii
    flag: Floats  # (N,) not 0 for grains at a wall
    ends: Floats  # (k, 2) ids of the two grains of each line; below 0: a wall
    forces: Floats  # (k, 2) f_n, f_t
    beta: Floats  # (k,) angle from the first grain to the contact, rad; NaN: not listed
    weight: Floats  # (k,) 1/σ² of the line's forces relative to a usual line
    names: tuple[str, str]  # of the two files
    lines: tuple[Integers, Integers]  # (N,), (k,): their line numbers
    both_ways: bool  # whether two lines of one contact are independent measurements
    frame: float
    description: str  # the recognised columns, in words

    def place(self, kind: int, row: SupportsIndex) -> str:
        """'file, line n' of a grain (kind 0) or a contact (1)."""
        return f"{self.names[kind]}, line {int(self.lines[kind][row])}"

    def with_grains(self, rows: Integers | Mask) -> Listing:
        """The listing with a selection of its grains, in this order."""
        columns = {name: getattr(self, name)[rows] for name in ("ids", "x", "r", "flag")}
        return self._replace(**columns, lines=(self.lines[0][rows], self.lines[1]))

    def with_contacts(self, rows: Integers | Mask) -> Listing:
        """The listing with a selection of its contacts, in this order."""
        columns = {name: getattr(self, name)[rows] for name in ("ends", "forces", "beta", "weight")}
        return self._replace(**columns, lines=(self.lines[0], self.lines[1][rows]))

    @property
    def rows(self) -> Integers:
        """Rows (k, 2) of the grains in contacts; −1 for a wall, −2 for a missing grain."""
        order = np.argsort(self.ids, kind="stable")
        place = np.searchsorted(self.ids, self.ends, sorter=order)
        rows = order[np.minimum(place, len(order) - 1)]
        rows = np.where(self.ids[rows] == self.ends, rows, -2)
        return np.where(self.ends < 0, -1, rows)

    @property
    def gaps(self) -> Floats:
        """Gaps (k,) of the disks joined by contacts; NaN if one is a wall or missing."""
        rows = self.rows
        listed = np.all(rows >= 0, axis=1)
        i, j = np.where(listed[:, None], rows, 0).T
        gap = np.hypot(*(self.x[j] - self.x[i]).T) - self.r[i] - self.r[j]
        return np.where(listed, gap, np.nan)

    @property
    def mean_radius(self) -> float:
        """The mean of the radii that can be read, NaN without any."""
        good = self.r[np.isfinite(self.r) & (self.r > 0)]
        return float(good.mean()) if len(good) else np.nan

    @property
    def fit(self) -> float:
        """Fraction of the contacts between grains that join existing, close grains."""
        inner = np.all(self.ends >= 0, axis=1)
        return float(np.mean(self.gaps[inner] <= FAR * self.mean_radius)) if inner.any() else 1.0

    def renumbered(self) -> Iterator[tuple[str, int, Listing]]:
        """The listing with ids that count its grains: in which order, from which number."""
        count = len(self.ids)
        orders = {
            "as they are listed": np.arange(count),
            "by id": np.argsort(self.ids, kind="stable"),
            "by x": np.argsort(self.x[:, 0], kind="stable"),
            "by y": np.argsort(self.x[:, 1], kind="stable"),
        }
        for (words, order), first in itertools.product(orders.items(), (1, 0)):
            ids = np.empty(count)
            ids[order] = np.arange(first, first + count)
            yield words, first, self._replace(ids=ids)


class Frames(Protocol):
    """A source of frames: their numbers, and the Listing of one, by default the last."""

    @property
    def frames(self) -> Floats: ...

    def listing(self, frame: float | None = None) -> Listing: ...


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
    def framed(self) -> bool:
        """Whether there is a column for the frame, or ids that restart."""
        return "frame" in self.values or (
            "id" in self.values and _begun_anew(self.values["id"]) is not None
        )

    def of(self, frame: float) -> Columns:
        """The rows of one frame, or all rows if there is no column for the frame."""
        if "frame" not in self.values:
            return self
        rows = self.values["frame"] == frame
        values = {name: column[rows] for name, column in self.values.items()}
        return self._replace(values=values, lines=self.lines[rows])

    def with_frames(self, frame: Floats | Integers) -> Columns:
        """The same with a column for the frame (rows,), derived from ids."""
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
        )


def read_frames(
    positions: Source, adjacency: Source, columns: Mapping[str, str] | None = None
) -> TextFrames:
    """The TextFrames in two files, paths or open files; InputError for other files.

    columns: {frame, id, x, y, r, flag, i, j, f_t or f_n: its header in the files, or its number
    from 1}. If one column of a file is given, the others are recognised by headers only. frame is
    that of both files; its number applies to files of which other columns are given, too.
    """
    given = _by_name(columns or {})
    grains, contacts = (
        _readings(source, wanted, {name: given[name] for name in wanted if name in given})
        for source, wanted in ((positions, _GRAINS), (adjacency, _CONTACTS))
    )
    if "frame" in given and not (grains[0].frame_given or contacts[0].frame_given):
        raise InputError(
            f"{grains[0].name} and {contacts[0].name}: no column has the header "
            f"{given['frame'][:40]!r} for frame; to give its number, also give the other columns "
            "of its file"
        )
    return _fitting(grains, contacts)


def _fitting(grains: Sequence[Columns], contacts: Sequence[Columns]) -> TextFrames:
    """The readings of both files by which most contacts join neighbours, or else the first.

    If the grains have no frames, a third column of 0 and 1 of the contacts is a flag.
    """
    pairs = [
        (one, two)
        for one in grains
        for two in sorted(contacts, key=lambda two: _SLIDING not in two.values and not one.framed)
    ]
    joined = [_joined(*pair) for pair in pairs] if len(pairs) > 1 else [1]
    fitting = [pair for pair, count in zip(pairs, joined, strict=True) if count]
    one, two = pairs[joined.index(max(joined))]
    first = two.values["id1"]
    if len(fitting) != 1 and _SLIDING in two.values and len(np.unique(first)) == 1 < len(first):
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


def _by_name(columns: Mapping[str, str]) -> dict[str, str]:
    """The columns under the names used here."""
    given = {}
    for word, header in columns.items():
        name = next((name for name, words in _WORDS.items() if word.lower() in words), None)
        if name is None:
            raise InputError(
                f"unknown column {word[:40]!r}; choose from frame, id, x, y, r, flag, i, j, f_t, "
                "f_n"
            )
        if name in given:
            raise InputError(f"the column {name} is given twice; give each name once")
        given[name] = header
    return given


def _with_frames(grains: Columns, contacts: Columns) -> TextFrames:
    """Both files with a column for the frame; without one, it is derived from restarting ids."""
    if "frame" in grains.values or "id" not in grains.values:
        return TextFrames(grains, contacts)
    parts = _begun_anew(grains.values["id"])
    if parts is None:
        return TextFrames(grains, contacts)
    count, numbers = int(parts[-1]), contacts.frames
    if not len(numbers):
        ends = (contacts.values[name] for name in ("id1", "id2"))
        frames = next((some for some in map(_ascending, ends) if some[-1] == count), None)
        if frames is None:
            raise InputError(
                f"{grains.name}: ids restart {count} times, but in {contacts.name} it is unclear "
                "where a frame ends; add a column for the frame to both files"
            )
        contacts = contacts.with_frames(frames)
    elif len(numbers) == count:
        parts = numbers[parts - 1]
    else:
        raise InputError(
            f"{grains.name}: ids restart {count} times, but {contacts.name} has {len(numbers)} "
            "frames; add a column for the frame"
        )
    return TextFrames(grains.with_frames(parts), contacts)


def _begun_anew(ids: Floats) -> Integers | None:
    """(rows,) numbers from 1 of the parts in which ids restart; None for a single part.

    A part has at least half as many rows as the largest, and most of its ids are in the first.
    """
    for parts in (_ascending(ids), np.cumsum(ids == ids[0])):
        sizes = np.bincount(parts)[1:]
        if 1 < len(sizes) <= len(ids) / _LEAST and 2 * sizes.min() >= sizes.max():
            known = np.isin(ids, ids[parts == 1])
            if np.bincount(parts, known)[1:].min() * 2 > sizes.max():
                return parts
    return None


def _ascending(values: Floats) -> Integers:
    """(rows,) numbers from 1 of the parts in which values ascend."""
    with np.errstate(invalid="ignore"):
        return np.cumsum(np.concatenate([[True], np.diff(values) < 0]))


def plain(number: float) -> int | float:
    """The number as an int if it is whole."""
    return int(number) if float(number).is_integer() else float(number)


def _readings(source: Source, wanted: Sequence[str], given: Mapping[str, str]) -> Sequence[Columns]:
    """The possible Columns of a text file of grains or contacts, the most likely first.

    given: headers or numbers of columns.
    """
    name, text = read_text(source)
    lines = [(k, line) for k, line in enumerate(text.splitlines(), start=1) if line.strip()]
    if "\0" in text:
        raise InputError(f"{name}: not a text file; give plain text")
    separator = next((mark for mark in ",;\t" if mark in lines[-1][1]), None)
    rows = [(k, [field.strip() for field in line.split(separator)]) for k, line in lines]
    header = None
    while rows and not any(np.isfinite(_number(field)) for field in rows[0][1]):
        header = rows.pop(0)[1]
    if not rows:
        raise EmptyError(f"{name}: no line with numbers; is it a PeGS file?")
    width = max(set(counts := [len(fields) for _, fields in rows]), key=counts.count)
    numbers = np.full((len(rows), width), np.nan)
    for row, (_, fields) in zip(numbers, rows, strict=True):
        # Lines of another length do not belong to this table.
        if len(fields) == width:
            row[:] = [_number(field) for field in fields]
    if given.keys() != {"frame"}:
        taken = bool(given)
    else:  # of the other file, perhaps
        taken = header is not None and _plain(given["frame"]) in map(_plain, header)
    if taken:
        readings = [_given(name, header, wanted, width, given)]
    else:
        named = header and _named(header, wanted, width)
        readings = [named] if named else _by_content(name, numbers, wanted)
    places = np.array([k for k, _ in rows])
    return [
        Columns(
            name,
            {column: numbers[:, k] for k, column in enumerate(names) if column},
            places,
            f"{name}: {', '.join(filter(None, names))}, separated by {_SEPARATORS[separator]}",
            taken and "frame" in given,
        )
        for names in readings
    ]


def _number(text: str) -> float:
    """The number in the text if it is finite, otherwise NaN."""
    try:
        value = number(text)
    except ValueError:
        return np.nan
    return value if abs(value) <= LARGEST else np.nan


def _named(header: Sequence[str], wanted: Sequence[str], width: int) -> list[str] | None:
    """Names of the columns from a header line, "" for others; None if it is insufficient."""
    if header is None or len(header) != width:
        return None
    named = _known(header, wanted)
    recognised = [name for name in named if name]
    return (
        named
        if _needed(wanted) <= set(recognised) and len(recognised) == len(set(recognised))
        else None
    )


def _known(header: Sequence[str], wanted: Sequence[str]) -> list[str]:
    words = [re.sub(r"[\[(].*|[\s\"'#]", "", word.lower()) for word in header]
    return [next((name for name in wanted if word in _WORDS[name]), "") for word in words]


def _plain(word: str) -> str:
    """A header as it is compared with a given one."""
    return word.strip(" #\"'").lower()


def _needed(wanted: Sequence[str]) -> set[str]:
    return {"x", "y", "radius"} if "x" in wanted else set(wanted) - {"frame"}


def _given(
    file: str, header: Sequence[str] | None, wanted: Sequence[str], width: int, given: Any
) -> list[str]:
    """Names of the columns if some are given by header or number; "" for others."""
    header = header if header is not None and len(header) == width else [""] * width
    plain_words = [_plain(word) for word in header]
    named = [name if name not in given else "" for name in _known(header, wanted)]
    for name, header_name in given.items():
        word = _plain(header_name)
        if word in plain_words:
            column = plain_words.index(word)
        elif word.isdecimal() and 1 <= int(word[:9]) <= width:
            column = int(word) - 1
        else:
            headers = ", ".join(filter(None, header)) or "they have no names"
            raise InputError(
                f"{file}: no column {header_name[:40]!r} for {name} among {width} ({headers}); "
                "give a header, or a number from 1"
            )
        if named[column] in given:
            raise InputError(
                f"{file}: column {header_name[:40]!r} is used twice, for {named[column]} and {name}"
            )
        named[column] = name
    missing = sorted(_needed(wanted) - set(named))
    if missing:
        raise InputError(f"{file}: also give the columns for {', '.join(missing)}")
    return named


def _by_content(name: str, numbers: Floats, wanted: Sequence[str]) -> list[Sequence[str]]:
    """Possible names of the columns from their number and contents, the most likely first."""
    readings = _of_contacts(numbers) if "id1" in wanted else _of_grains(numbers)
    if not readings:
        raise InputError(
            f"{name}: {numbers.shape[1]} fields in a line, which are not "
            f"{', '.join(wanted)} (the first and the last may be missing); is it a PeGS file? "
            "Give a header line that names the columns"
        )
    return readings


def _of_contacts(numbers: Floats) -> list[Sequence[str]]:
    width = numbers.shape[1]
    readings: list[Sequence[str]] = [_CONTACTS[5 - width :]] if width in (4, 5) else []
    if width == 5 and _among(numbers[:, 2], (0, 1)):
        flagged = ("id1", "id2", _SLIDING, "tangential", "normal")
        # No grain is in every contact: of zeros alone it is a flag even beside several frames.
        readings.insert(1 if np.nan_to_num(numbers[:, 2]).any() else 0, flagged)
    ends = ("id1", "id2")
    return [
        names for names in readings if all(_whole(numbers[:, names.index(end)]) for end in ends)
    ]


def _of_grains(numbers: Floats) -> list[Sequence[str]]:
    width = numbers.shape[1]
    if width < 3:
        return []
    first, last = numbers[:, 0], numbers[:, min(width, 6) - 1]
    flagged, counted = _among(last, (-1, 0, 1)), _whole(first)
    alone = len(np.unique(first[np.isfinite(first)])) > 0.9 * np.isfinite(first).sum()
    anew = not alone and _begun_anew(first) is not None
    sized = bool(np.mean(last > 0) > 0.9)  # what may be a radius
    if width >= 6:
        return [(*_GRAINS, *[""] * (width - 6))] if counted else []
    if width == 5:
        # A frame number repeats; the id of a grain occurs once per frame.
        if not counted:
            return []
        with_id = flagged and (alone or anew)
        named = alone or (anew and not _whole(numbers[:, 1]))
        readings: list[Sequence[str]] = [_GRAINS[1:]] if with_id else []
        readings += [_GRAINS[:5]] if sized or not with_id else []
        return readings if named else readings[::-1]
    if width == 4:
        with_id = counted and (alone or anew) and (sized or not flagged)
        readings = [*([_GRAINS[2:]] if flagged else []), *([_GRAINS[1:5]] if with_id else [])]
        # A flag on all grains says nothing, radii of 1 do.
        return readings[::-1] if np.all(last == 1) else readings
    return [_GRAINS[2:5]]


def _whole(column: Floats) -> bool:
    """Whether nearly all are whole numbers; exceptions may be damaged lines."""
    finite = column[np.isfinite(column)]
    return len(finite) > 0 and bool(np.mean(finite == np.round(finite)) > 0.9)


def _among(column: Floats, values: Sequence[int]) -> bool:
    """Whether nearly all numbers are among these."""
    finite = column[np.isfinite(column)]
    return len(finite) > 0 and bool(np.mean(np.isin(finite, values)) > 0.9)
