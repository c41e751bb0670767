"""The columns of text files of grains and contacts, recognised by their header or contents.

Without a header, columns are recognised by their number and contents, which may allow several
readings:

    frame, id, x, y, radius, flag     id, x, y, radius, flag     x, y, radius, flag
    frame, id, x, y, radius           id, x, y, radius           x, y, radius
    frame, id1, id2, f_t, f_n         id1, id2, f_t, f_n         (the contacts; ids < 0: a wall)
    id1, id2, flag, f_t, f_n          (where the third is 0 or 1 throughout)
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from granforce.records import InputError
from granforce.types import Floats, Integers

GRAINS = ("frame", "id", "x", "y", "radius", "flag")
PRESSURE = "pressure"  # of grains, recognised by its header only
CONTACTS = ("frame", "id1", "id2", "tangential", "normal")
# Synonyms, in lower case without blanks and brackets.
_WORDS = {
    "frame": ("frame", "frameid", "frame_id", "image", "step", "t"),
    "id": ("id", "particle", "particleid", "particle_id", "grain", "track", "label"),
    "x": ("x", "xpos", "x_px", "cx"),
    "y": ("y", "ypos", "y_px", "cy"),
    "radius": ("radius", "r", "r_px", "rad"),
    "pressure": ("pressure", "g2", "g²"),
    "flag": ("flag", "edge", "wall", "boundary"),
    "id1": ("id1", "i", "particle1", "grain1"),
    "id2": ("id2", "j", "particle2", "grain2"),
    "tangential": ("tangential", "ft", "f_t", "tangentialforce", "tangential_force"),
    "normal": ("normal", "fn", "f_n", "normalforce", "normal_force"),
}
SLIDING = "flag (not used)"  # of a contact
# Least mean number of grains per frame, if frames are recognised by their ids.
_LEAST = 3
# Least fraction of the rows that have a property if the column has it; others may be damaged.
_NEARLY_ALL = 0.9


def columns_by_name(columns: Mapping[str, str]) -> dict[str, str]:
    """The given columns under the names used here; InputError for an unknown or repeated name."""
    given: dict[str, str] = {}
    for word, header in columns.items():
        name = next((name for name, words in _WORDS.items() if word.lower() in words), None)
        if name is None:
            raise InputError(
                f"unknown column {word[:40]!r}; choose from frame, id, x, y, r, flag, pressure, "
                "i, j, f_t, f_n"
            )
        if name in given:
            raise InputError(f"the column {name} is given twice; give each name once")
        given[name] = header
    return given


def columns_of_file(
    given: Mapping[str, str], wanted: Sequence[str], header: Sequence[str] | None
) -> dict[str, str]:
    """The given columns that are of a file with these wanted columns and this header.

    A frame alone may be of the other file if its header is not in this one.
    """
    ours = {name: given[name] for name in wanted if name in given}
    if ours.keys() == {"frame"}:
        headers = [] if header is None else map(_bare, header)
        return ours if _bare(ours["frame"]) in headers else {}
    return ours


def possible_names(
    file: str,
    header: Sequence[str] | None,
    numbers: Floats,
    wanted: Sequence[str],
    given: Mapping[str, str],
) -> Sequence[Sequence[str]]:
    """Possible names of the columns (rows, columns) of a file, the most likely first.

    The names are `wanted` ones, "" for other columns; given: {name: its header or number}. Raises
    InputError if there are none.
    """
    width = numbers.shape[1]
    header = header if header is not None and len(header) == width else None
    if given:
        return [_names_given(file, header or [""] * width, wanted, given)]
    names = [] if header is None else _names_by_header(header, wanted)
    named = set(filter(None, names))
    if named >= _needed(wanted) and len(named) == len(list(filter(None, names))):
        return [names]
    readings = _of_contacts(numbers) if "id1" in wanted else _of_grains(numbers)
    if not readings:
        usual = ", ".join(name for name in wanted if name != PRESSURE)
        raise InputError(
            f"{file}: {width} fields in a line, which are not "
            f"{usual} (the first and the last may be missing); is it a PeGS file? "
            "Give a header line that names the columns"
        )
    return readings


def restarts(ids: Floats) -> Integers | None:
    """(rows,) numbers from 1 of the parts in which ids restart; None for a single part.

    A part has at least half as many rows as the largest, and most of its ids are in the first.
    """
    for parts in (ascending_parts(ids), np.cumsum(ids == ids[0])):
        sizes = np.bincount(parts)[1:]
        if 1 < len(sizes) <= len(ids) / _LEAST and 2 * sizes.min() >= sizes.max():
            known = np.isin(ids, ids[parts == 1])
            if np.bincount(parts, known)[1:].min() * 2 > sizes.max():
                return parts
    return None


def ascending_parts(values: Floats) -> Integers:
    """(rows,) numbers from 1 of the parts in which values ascend."""
    with np.errstate(invalid="ignore"):
        return np.cumsum(np.concatenate([[True], np.diff(values) < 0]))


def _names_by_header(header: Sequence[str], wanted: Sequence[str]) -> list[str]:
    """The wanted name of each column by its header, "" for other columns."""
    words = [re.sub(r"[\[(].*|[\s\"'#]", "", word.lower()) for word in header]
    return [next((name for name in wanted if word in _WORDS[name]), "") for word in words]


def _bare(word: str) -> str:
    """A header as it is compared with a given one."""
    return word.strip(" #\"'").lower()


def _needed(wanted: Sequence[str]) -> set[str]:
    return {"x", "y", "radius"} if "x" in wanted else set(wanted) - {"frame"}


def _names_given(
    file: str, header: Sequence[str], wanted: Sequence[str], given: Mapping[str, str]
) -> list[str]:
    """Names of the columns of which some are given by header or number; "" for others."""
    names = [name if name not in given else "" for name in _names_by_header(header, wanted)]
    for name, header_name in given.items():
        column = _column_given(file, header, name, header_name)
        if names[column] in given:
            raise InputError(
                f"{file}: column {header_name[:40]!r} is used twice, for {names[column]} and {name}"
            )
        names[column] = name
    missing = sorted(_needed(wanted) - set(names))
    if missing:
        raise InputError(f"{file}: also give the columns for {', '.join(missing)}")
    return names


def _column_given(file: str, header: Sequence[str], name: str, given: str) -> int:
    """The column, from 0, that is given by its header or its number from 1."""
    bare_words, word = [_bare(one) for one in header], _bare(given)
    if word in bare_words:
        return bare_words.index(word)
    if word.isdecimal() and 1 <= int(word[:9]) <= len(header):
        return int(word) - 1
    headers = ", ".join(filter(None, header)) or "they have no names"
    raise InputError(
        f"{file}: no column {given[:40]!r} for {name} among {len(header)} ({headers}); "
        "give a header, or a number from 1"
    )


def _of_contacts(numbers: Floats) -> list[Sequence[str]]:
    """Possible names of columns of contacts."""
    width = numbers.shape[1]
    readings: list[Sequence[str]] = [CONTACTS[5 - width :]] if width in (4, 5) else []
    if width == 5 and _are_among(numbers[:, 2], (0, 1)):
        flagged = ("id1", "id2", SLIDING, "tangential", "normal")
        # No grain is in every contact: of zeros alone it is a flag even beside several frames.
        readings.insert(1 if np.nan_to_num(numbers[:, 2]).any() else 0, flagged)
    return [
        names
        for names in readings
        if all(_are_whole(numbers[:, names.index(end)]) for end in ("id1", "id2"))
    ]


def _of_grains(numbers: Floats) -> list[Sequence[str]]:
    """Possible names of columns of grains, the most likely first."""
    width = numbers.shape[1]
    if width == 3:
        return [GRAINS[2:5]]
    if width == 4:
        return _of_four(numbers)
    if width == 5:
        return _of_five(numbers)
    if width >= 6 and _are_whole(numbers[:, 0]):
        return [(*GRAINS, *[""] * (width - 6))]
    return []


def _of_four(numbers: Floats) -> list[Sequence[str]]:
    """x, y, radius, flag, or id, x, y, radius, the most likely first."""
    first, last = numbers[:, 0], numbers[:, 3]
    is_flag = _are_among(last, (-1, 0, 1))
    are_ids = _are_whole(first) and (_occur_once(first) or restarts(first) is not None)
    readings: list[Sequence[str]] = [GRAINS[2:]] if is_flag else []
    if are_ids and (_are_radii(last) or not is_flag):
        readings.append(GRAINS[1:5])
    # A flag on all grains says nothing, radii of 1 do.
    return readings[::-1] if np.all(last == 1) else readings


def _of_five(numbers: Floats) -> list[Sequence[str]]:
    """id, x, y, radius, flag, or frame, id, x, y, radius, the most likely first.

    A frame number repeats; the id of a grain occurs once per frame.
    """
    first, last = numbers[:, 0], numbers[:, 4]
    if not _are_whole(first):
        return []
    once = _occur_once(first)
    restart = not once and restarts(first) is not None
    with_flag = _are_among(last, (-1, 0, 1)) and (once or restart)
    readings: list[Sequence[str]] = [GRAINS[1:]] if with_flag else []
    if _are_radii(last) or not with_flag:
        readings.append(GRAINS[:5])
    # Two columns of whole numbers are a frame and an id.
    are_ids = once or (restart and not _are_whole(numbers[:, 1]))
    return readings if are_ids else readings[::-1]


def _are_whole(column: Floats) -> bool:
    """Whether nearly all are whole numbers."""
    finite = column[np.isfinite(column)]
    return len(finite) > 0 and bool(np.mean(finite == np.round(finite)) > _NEARLY_ALL)


def _are_among(column: Floats, values: Sequence[int]) -> bool:
    """Whether nearly all numbers are among these."""
    finite = column[np.isfinite(column)]
    return len(finite) > 0 and bool(np.mean(np.isin(finite, values)) > _NEARLY_ALL)


def _are_radii(column: Floats) -> bool:
    """Whether nearly all numbers may be radii."""
    return bool(np.mean(column > 0) > _NEARLY_ALL)


def _occur_once(column: Floats) -> bool:
    """Whether nearly all numbers differ."""
    finite = column[np.isfinite(column)]
    return len(np.unique(finite)) > _NEARLY_ALL * len(finite)
