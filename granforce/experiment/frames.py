"""The frames of an experiment: their files and their numbers."""

from __future__ import annotations

import itertools
import re
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

from granforce.experiment.pegs import open_frames
from granforce.fields import record
from granforce.packing.importers.text import EmptyError
from granforce.records import InputError, InputWarning
from granforce.system.files import expanded

# The contents of files, by their names.
_POSITIONS, _CONTACTS = re.compile("position|cent(er|re)s", re.I), re.compile("adjacency", re.I)
_TEXT = (".txt", ".csv", ".dat")
_PACKED = (".gz", ".bz2", ".xz", ".zst")


@record
class Frame(NamedTuple):
    """One frame: its files, and its number in them."""

    positions: Annotated[str, "file of positions"]
    adjacency: Annotated[str | None, "file of contacts; None for a *_solved.mat"]
    number: Annotated[float, "of the frame in its files"]


def frames_of(*paths: str | Path, columns: Mapping[str, str] | None = None) -> list[Frame]:
    """Frames of a folder, of files *_solved.mat, or of a file of positions and one of contacts.

    InputWarnings name files that are empty, and frames that are in one of two files only.

    Parameters
    ----------
    *paths : path
        The folder, or the files.
    columns : mapping, optional
        Of text files, as for `read_pegs`.

    Returns
    -------
    list of Frame
        Sorted by number.

    Raises
    ------
    InputError
        If there are no frames, or two with the same number.
    """
    if not paths:
        raise InputError("give a folder of frames, or their files")
    pairs = _file_pairs(*paths)
    if not pairs:
        raise InputError(
            f"{', '.join(map(str, paths))}: no frames; expected *_solved.mat, or text files with "
            "'positions' (or 'centers') and 'adjacency' in their names"
        )
    frames = []
    for one, two in pairs:
        try:
            numbers = _numbers(one, two, len(pairs), columns)
        except EmptyError as error:
            if len(pairs) == 1:
                raise
            warnings.warn(f"{error}: left out", InputWarning, stacklevel=2)
            continue
        files = str(one), None if two is None else str(two)
        frames += [Frame(*files, float(number)) for number in numbers]
    if not frames:
        raise InputError(f"{pairs[0][0]} and all others contain no frame")
    frames.sort(key=lambda frame: frame.number)
    for one, two in itertools.pairwise(frames):
        if one.number == two.number:
            raise InputError(f"{one.positions} and {two.positions} are both frame {one.number:g}")
    return frames


def _file_pairs(*paths: str | Path) -> list[tuple[Path, Path | None]]:
    """Pairs (positions, contacts) of files in folders or of files; (*_solved.mat, None)."""
    files: list[Path] = []
    for path in map(expanded, paths):
        folder = sorted(one for one in path.rglob("*") if one.is_file()) if path.is_dir() else []
        files += folder if path.is_dir() else [path]
    solved = [one for one in files if one.suffix.lower() == ".mat" and "solved" in one.name.lower()]
    if not solved and len(paths) == 1 and files and files[0].suffix.lower() == ".mat":
        solved = files
    if solved:
        return [(one, None) for one in solved]
    if len(files) == 2 and not any(expanded(path).is_dir() for path in paths):
        return [(files[0], files[1])]
    return list(_paired(list(filter(_is_text, files))))


def _is_text(path: Path) -> bool:
    name = path.name.lower()
    return any(name.removesuffix(end).endswith(_TEXT) for end in ("", *_PACKED))


def _numbers(
    one: Path, two: Path | None, count: int, columns: Mapping[str, str] | None
) -> list[float]:
    """Numbers of the frames in one pair of files; from the name if each file has one frame."""
    opened = open_frames(one, two, columns=columns)
    inside = opened.frames
    for note in getattr(opened, "notes", []):
        warnings.warn(note, InputWarning, stacklevel=3)
    by_name = _digits(one) if count > 1 and two is not None else []
    return [float(by_name[-1])] if by_name and len(inside) == 1 else inside.tolist()


def _digits(path: Path) -> list[str]:
    return [part for part in re.findall(r"\d+", path.stem) if len(part) < 16]


def _paired(files: Sequence[Path]) -> list[tuple[Path, Path]]:
    """Pairs (positions, contacts) that have the same number, or none, in their names."""
    positions = [one for one in files if _POSITIONS.search(one.name)]
    contacts = [one for one in files if _CONTACTS.search(one.name)]
    # A file of all frames comes before files of single frames.
    for choose in (lambda path: not _digits(path), _digits):
        some = [[one for one in those if choose(one)] for those in (positions, contacts)]
        if len(some[0]) == len(some[1]) == 1:
            return [(some[0][0], some[1][0])]
        by_number = [{_digits(one)[-1]: one for one in those if _digits(one)} for those in some]
        both = sorted(set(by_number[0]) & set(by_number[1]), key=int)
        if both:
            for key in sorted(set(by_number[0]) ^ set(by_number[1]), key=int):
                found = by_number[key not in by_number[0]][key]
                note = f"{found}: no file has the other half of frame {key}: left out"
                warnings.warn(note, InputWarning, stacklevel=4)
            return [(by_number[0][key], by_number[1][key]) for key in both]
    return []
