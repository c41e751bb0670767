"""Packings uploaded by a visitor, read in memory: their file names never become paths."""

import io
import re
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from granforce.packing import importers
from granforce.records import InputError, Packing
from granforce.study import kinds
from granforce.study.keys import Parameters

from ..background.jobs import Job
from ..background.limits import LIMITS, Limits
from .entry_labels import call
from .library import Library
from .replays import Replay

Files = dict[str, tuple[str, bytes]]  # {role: (name, content)}

# Files that together make a packing; those in brackets are optional.
FAMILIES = {
    "npz": ("NPZ of granforce", ("npz",), ()),
    "lammps": ("LAMMPS dumps", ("particles", "contacts"), ()),
    "table": ("tables", ("grains",), ("joined",)),
    "blocks": ("bodies", ("bodies",), ()),
    "pegs": ("photoelastic frame", ("positions", "adjacency"), ()),
    "solved": ("photoelastic frame", ("solved",), ()),
}
WORDS = {
    "npz": "packing",
    "particles": "dump of the particles",
    "contacts": "dump of the contacts",
    "grains": "table of disks",
    "joined": "table of contacts",
    "bodies": "file of bodies",
    "positions": "positions of the disks",
    "adjacency": "adjacency list with the forces",
    "solved": "frame solved by PeGS 2",
}
PRESSURES = {"pressure", "g2", "g²"}  # columns of positions
# Largest ratio of an archive's unpacked size to the upload limit.
UNPACKED = 8
# Bytes and rows examined to recognise photoelastic files.
LOOKED_AT, ROWS = 4000, 20


class Brought(NamedTuple):
    """A packing that was read and stored."""

    params: Parameters  # its parameters, of kinds.PACKING
    report: dict[str, Any]  # report of granforce.report
    source: str  # names of its files


def role(name: str, content: bytes) -> str:
    """The role of a file, one of WORDS, from its content; InputError for anything else."""
    if content[:4] == b"PK\x03\x04":
        return "npz"
    if content[:2] == b"\x1f\x8b" or content[:4] == b"\x28\xb5\x2f\xfd":
        raise InputError(f"{name}: compressed; unpack it first")
    if content[:6] == b"MATLAB" or content[:4] == b"\x89HDF":
        return "solved"
    if content.lstrip()[:5] == b"ITEM:":
        if b"ITEM: ATOMS" in content:
            return "particles"
        if b"ITEM: ENTRIES" in content:
            return "contacts"
        raise InputError(f"{name}: a LAMMPS dump without ATOMS or ENTRIES")
    columns, measured = _columns(content), _photoelastic(content)
    if "frame" in columns and columns & PRESSURES:
        return "positions"
    if measured and "frame" in columns:
        return measured
    if {"body", "x", "y"} <= columns or content.lstrip()[:1] == b"{":
        return "bodies"
    if {"x", "y", "r"} <= columns:
        return "grains"
    if {"i", "j"} <= columns:
        return "joined"
    if measured:
        return measured
    raise InputError(
        f"{name}: neither an NPZ of granforce, nor a LAMMPS dump, nor a table with columns x, y, r "
        "(disks), i, j (contacts) or body, x, y (bodies), nor a photoelastic list of positions or "
        "of forces"
    )


def _columns(content: bytes) -> set[str]:
    """The names in the header of a table."""
    head = content.lstrip(b"\xef\xbb\xbf \t\r\n").split(b"\n", 1)[0][:2000]
    words = head.decode("utf-8", "replace").lower().replace(";", ",").replace("\t", ",")
    return {word.strip().strip('"') for word in words.split(",")}


def loose(files: Files) -> bool:
    """Whether these are tables in which nothing holds the disks: no load, no force."""
    named = [_columns(files[part][1]) for part in ("grains", "joined") if part in files]
    return "grains" in files and not set().union(*named) & {"fx", "fy", "torque", "fn", "f_n"}


def lists_pressures(files: Files) -> bool:
    """Whether the positions of a photoelastic frame have a column of pressures, or of G²."""
    return "positions" in files and bool(_columns(files["positions"][1]) & PRESSURES)


def _photoelastic(content: bytes) -> str | None:
    """The role of a file of a photoelastic frame, or None: rows of five or six plain numbers."""
    rows: list[list[float]] = []
    lines = content[:LOOKED_AT].decode("utf-8", "replace").splitlines()
    whole = lines if len(content) <= LOOKED_AT else lines[:-1]
    for line in filter(str.strip, whole[:ROWS]):
        try:
            rows.append([float(field) for field in re.split(r"[;,\s]+", line.strip(" ;,\t"))])
        except ValueError:
            if rows:  # only the first line may have names
                return None
    counts = {len(row) for row in rows}
    if counts == {6}:
        return "positions"
    if counts == {5}:  # the ids of two grains, or a grain and its position
        return "adjacency" if all(row[2].is_integer() for row in rows) else "positions"
    return None


def family(roles: Iterable[str]) -> str:
    """The one of FAMILIES that contains these roles."""
    return next(k for k, (_, needed, more) in FAMILIES.items() if set(roles) & {*needed, *more})


def added(files: Files, new: Iterable[tuple[str, bytes]], limits: Limits = LIMITS) -> Files:
    """{role: (name, content)} of the previous files and new ones [(name, content), …].

    A new file replaces the one with its role, and all files of another family. Raises InputError
    for a file that is none of WORDS, or if all together are too large.
    """
    for name, content in new:
        part = role(name, content)
        if part == "grains" and "adjacency" in files and _photoelastic(content):
            part = "positions"
        if part == "adjacency" and "grains" in files and _photoelastic(files["grains"][1]):
            files = {"positions": files["grains"]}
        files = {k: v for k, v in files.items() if family([k]) == family([part])}
        files[part] = (name, content)
    size = sum(len(content) for _, content in files.values())
    if size > limits.upload * 1e6:
        raise InputError(f"the files have {size / 1e6:.1f} MB; at most {limits.upload} MB are read")
    return files


def missing(files: Files) -> list[str]:
    """Roles that are needed in addition to those of the files."""
    needed: tuple[str, ...] = FAMILIES[family(files)][1] if files else ()
    return [part for part in needed if part not in files]


def read(files: Files, *, limits: Limits = LIMITS, **options: Any) -> Packing:
    """The Packing in files {role: (name, content)}.

    options: of `read_lammps`, `read_blocks` or `read_table`. Raises InputError, naming file and
    line, for invalid files and beyond the limits.
    """
    if "pressure" in options:
        limits.check(pressure=options["pressure"])
    given = {part: opened(*file) for part, file in files.items()}
    if "npz" in files:
        unpacked = UNPACKED * limits.upload * 10**6
        packing = importers.load_packing(given["npz"], unpacked=unpacked, most_grains=limits.n)
    elif "particles" in files:
        packing = importers.read_lammps(
            given["particles"], given["contacts"], most_grains=limits.n, **options
        )
    elif "bodies" in files:
        packing = importers.read_blocks(given["bodies"], **options)
    else:
        packing = importers.read_table(
            given["grains"], given.get("joined"), most_grains=limits.n, **options
        )
    limits.check(mu=packing.mu, n=len(packing.r))
    return packing


def opened(name: str, content: bytes) -> io.BytesIO:
    """A file with this content; its name is for messages only."""
    file = io.BytesIO(content)
    file.name = name
    return file


def bring(library: Library, files: Files, **options: Any) -> Callable[[Job], Brought]:
    """Work for jobs.Task that reads a packing, reports on it and saves it in the cache."""

    def work(job: Job) -> Brought:
        job.begin("reading")
        packing = read(files, **options)
        names = " and ".join(name for name, _ in files.values())
        return keep(library, packing, f"{FAMILIES[family(files)][0]}: {names}")(job)

    return work


def keep(library: Library, packing: Packing, source: str) -> Callable[[Job], Brought]:
    """Work for jobs.Task that reports on a packing and saves it in the cache; a Brought.

    source: the names of its files, used as its name in lists.
    """

    def work(job: Job) -> Brought:
        job.begin("finding its backbone")
        report = importers.report(packing) | {"notes": packing.info.get("notes", [])}
        if library.cache is None:
            raise InputError("no cache folder can be written, so no files can be read")
        params = kinds.imported_parameters(packing)
        kinds.keep_packing(library.cache, params, packing)
        call(library.cache, str(params["imported"]), source.partition(": ")[2])
        return Brought(params, report, source)

    return work


def at_friction(report: dict[str, Any], replay: Replay) -> dict[str, Any]:
    """The report with numbers of the packing on screen, whose friction may differ."""
    summary = replay.summary
    same = summary["mu"] == report["mu"]
    return report | {
        "rattlers": summary.get("rattlers", report["rattlers"]),
        "backbone_contacts": summary["contacts"],
        "coordination": summary["coordination"],
        "dimension": summary["dimension"],
        "mu": summary["mu"],
        "mean_normal_force": replay.force_scale,
        "violation": report["violation"] if same else None,
    }


def report_rows(report: dict[str, Any]) -> list[tuple[str, str]]:
    """The report as rows (name, value) of texts for the page."""
    known = ((*row, report[row[1]]) for row in _ROWS)
    rows = [
        (label, f"{v:{form if v else 'g'}}{unit}")
        for label, _, form, unit, v in known
        if v is not None
    ]
    return rows + [("note", note) for note in report.get("notes", [])]


_ROWS = (
    ("disks or bodies", "grains", ",d", ""),
    ("loose disks", "rattlers", ",d", ""),
    ("contacts listed", "contacts", ",d", ""),
    ("contacts that can carry", "backbone_contacts", ",d", ""),
    ("coordination z", "coordination", ".3f", ""),
    ("dimension h of S", "dimension", ",d", ""),
    ("friction μ", "mu", "g", ""),
    ("packing fraction φ", "packing_fraction", ".4f", ""),
    ("pressure", "pressure", ".4g", ""),
    ("mean normal force", "mean_normal_force", ".4g", ""),
    ("unbalance of the forces", "residual", ".1e", " ⟨fₙ⟩"),
    ("distance from Coulomb's cones", "violation", ".1e", " ⟨fₙ⟩"),
    ("largest overlap", "largest_overlap", ".1e", " radii"),
)
