"""Frames written by PeGS 2: *_solved.mat, a MATLAB struct array `particle`.

Fields as documented in its module adjacencyMatrix (PeGS 2, Lee et al., arXiv:2507.01933,
github.com/photoelasticity): id; x, y, r in pixels, rm in metres; edge (not 0 at a wall); and, for
each contact, neighbours (ids; −1: a wall), forces F, alphas α (0: normal, ±π/2: tangential), betas
β (the azimuth of the contact, in the axes of the image); fitError, the sum of the squared
differences of fitted and observed brightness. So

    f_n = F cos α,   f_t = F sin α,   n = (cos β, sin β),

and each contact between two grains is measured twice, once from each side. The variance of a fit's
forces is proportional to that of its brightness, which is fitError over the pixels of the disk: σ²
∝ fitError/r².
"""

import io
import os
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce.experiment.listings.listing import Listing
from granforce.experiment.listings.matfile import read_struct
from granforce.packing.importers.text import LARGEST, EmptyError, Source
from granforce.records import InputError
from granforce.system.files import content_of, path_text
from granforce.types import Floats

_NEEDED = ("id", "x", "y", "r", "neighbours", "forces", "alphas")
_FIELDS = (*_NEEDED, "betas", "fitError", "edge")
# Largest factor by which the weight of a fit may differ from the usual one.
_WEIGHTS = 100.0
_LARGEST_FILE = 10**9


class SolvedFrame(NamedTuple):
    """One frame, already read."""

    frames: Floats  # (1,) its number
    only: Listing

    def listing(self, frame: float | None = None) -> Listing:
        """Its Listing; InputError for another frame."""
        if frame is not None and frame != self.frames[0]:
            raise InputError(
                f"{self.only.names[0]} is frame {self.frames[0]:g}, not frame {frame:g}"
            )
        return self.only


def read_solved(source: Source) -> SolvedFrame:
    """The SolvedFrame in a *_solved.mat (a path or an open binary file), numbered by its name.

    Raises InputError for other files.
    """
    name, content = _content(source)
    hdf5 = content[:8] == b"\x89HDF\r\n\x1a\n" or content[:15] == b"MATLAB 7.3 MAT-"
    label = f"{name}: a MATLAB file of version 7.3 (HDF5)" if hdf5 else name
    try:
        if hdf5:
            particles = _version_73(name, content)
        else:
            particles = read_struct(content, "particle", _FIELDS, _LARGEST_FILE)
        columns = _columns(particles)
    except InputError:
        raise
    except Exception:
        # Reading a damaged file may fail in zlib, in the tags, or on inconsistent shapes.
        raise InputError(
            f"{label} that is damaged; save it again in MATLAB with save(…, '-v7')"
            if hdf5
            else f"{name}: not a MATLAB file with a struct array, or damaged"
        ) from None
    if columns is None:
        raise InputError(
            f"{label}: no struct array `particle` with {', '.join(_NEEDED)}; is it a *_solved.mat "
            "of PeGS 2 (after diskSolve)?"
        )
    digits = re.findall(r"\d+", re.sub(r"\.mat$", "", name))
    number = float(digits[-1]) if digits and len(digits[-1]) < 16 else 1.0
    return SolvedFrame(np.array([number]), _listing(name, number, columns))


def _content(source: Source) -> tuple[str, bytes]:
    if hasattr(source, "read"):
        name, content = str(getattr(source, "name", "the given file")), source.read()
    else:
        name = path_text(source)
        content = content_of(name, _LARGEST_FILE)
    name = os.path.basename(name) or name
    if isinstance(content, str) or not content:
        raise InputError(f"{name}: not a MATLAB file")
    return name, content


def _version_73(name: str, content: bytes) -> list[dict[str, Any]]:
    """The particles of a file of version 7.3, which is HDF5: each field a column of references."""
    try:
        import h5py
    except ImportError:
        raise InputError(
            f"{name}: a MATLAB file of version 7.3 (HDF5); install h5py to read it, or save it in "
            "MATLAB with save(…, '-v7')"
        ) from None
    with h5py.File(io.BytesIO(content), "r") as file:
        if "particle" not in file or not hasattr(_member(file, "particle"), "keys"):
            return []
        group = file["particle"]
        fields = {field: _member(group, field) for field in set(_FIELDS) & set(group)}
        # A single particle is stored without references.
        stored = {
            field: [file[one] for one in np.ravel(_value(values))]
            if values.dtype == object
            else [values]
            for field, values in fields.items()
        }
        if sum(one.nbytes for column in stored.values() for one in column) > _LARGEST_FILE:
            raise ValueError("unpacked")
        columns = {field: list(map(_value, column)) for field, column in stored.items()}
        counts = {len(column) for column in columns.values()}
        if len(counts) != 1:
            return []
        return [{field: columns[field][k] for field in columns} for k in range(*counts)]


def _member(group: Any, name: str) -> Any:
    """The member of the group with this name; ValueError for a link to another file."""
    if hasattr(group.get(name, getlink=True), "filename"):
        raise ValueError("link")
    return group[name]


def _value(dataset: Any) -> npt.NDArray[Any]:
    """The value of a dataset; MATLAB stores empty arrays as their shape.

    ValueError if its data are in other files, which could be private files of this machine.
    """
    if dataset.external or dataset.is_virtual or dataset.nbytes > _LARGEST_FILE:
        raise ValueError("dataset")
    if dataset.attrs.get("MATLAB_empty", 0):
        return np.zeros(0)
    value = dataset[()]
    return value["real"] if value.dtype.names else value


def _columns(particles: Sequence[Mapping[str, Any]]) -> dict[str, list[Floats]] | None:
    """{field: per particle, a flat float array}, or None if a required field is missing."""
    if not particles:
        return None
    fields = [field for field in _FIELDS if all(field in one for one in particles)]
    if not set(_NEEDED) <= set(fields):
        return None
    return {field: [_numbers(one[field]) for one in particles] for field in fields}


def _numbers(value: Any) -> Floats:
    """A flat array; entries that are not finite numbers are NaN."""
    flat = np.real(np.ravel(np.asarray(value)))
    if flat.dtype.kind not in "iufb":
        return np.full(flat.shape, np.nan)
    flat = flat.astype(np.float64)
    return np.where(np.abs(flat) <= LARGEST, flat, np.nan)


def _listing(name: str, number: float, columns: dict[str, list[Floats]]) -> Listing:
    """The Listing, with a line for each contact of each particle."""
    single = {field: _first(columns, field) for field in ("id", "x", "y", "r", "edge", "fitError")}
    count = len(columns["id"])
    ends, forces, beta, owner = [], [], [], []
    angles = columns.get("betas", [np.zeros(0)] * count)
    for k in range(count):
        neighbours = columns["neighbours"][k]
        size = len(neighbours)
        if not size:
            continue
        force, alpha, azimuth = (
            # Fields of another length cannot be assigned to contacts.
            values if len(values) == size else np.full(size, np.nan)
            for values in (columns["forces"][k], columns["alphas"][k], angles[k])
        )
        ends.append(np.column_stack([np.full(size, single["id"][k]), neighbours]))
        forces.append(np.column_stack([force * np.cos(alpha), force * np.sin(alpha)]))
        beta.append(azimuth)
        owner.append(np.full(size, k))
    if not ends:
        raise EmptyError(f"{name}: no particle has neighbours; is it the file after diskSolve?")
    owner = np.concatenate(owner)
    with np.errstate(all="ignore"):
        spread = single["fitError"] / single["r"] ** 2
        weight = np.nanmedian(spread) / spread if np.isfinite(spread).any() else spread
    weight = np.clip(np.nan_to_num(weight, nan=1.0, posinf=_WEIGHTS), 1 / _WEIGHTS, _WEIGHTS)
    description = "id, x, y, r, neighbours, forces, alphas"
    description += "".join(
        f", {field}" for field in ("betas", "fitError", "edge") if field in columns
    )
    return Listing(
        ids=single["id"],
        x=np.column_stack([single["x"], single["y"]]),
        r=single["r"],
        flag=np.nan_to_num(single["edge"]),
        ends=np.concatenate(ends),
        forces=np.concatenate(forces),
        beta=np.concatenate(beta),
        weight=weight[owner],
        names=(name, name),
        lines=(np.arange(1, count + 1), owner + 1),
        both_ways=True,
        frame=number,
        description=f"{name}: struct array particle with {description}",
    )


def _first(columns: dict[str, list[Floats]], field: str) -> Floats:
    """The one number of each particle, or NaN."""
    return (
        np.array([one[0] if len(one) else np.nan for one in columns[field]])
        if (field in columns)
        else np.full(len(columns["id"]), np.nan)
    )
