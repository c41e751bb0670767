"""granforce's file format for one packing: an NPZ of plain arrays, never pickled."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import IO, Any, cast

import numpy as np
import numpy.typing as npt

from granforce.packing.importers.geometry import OVERLAP_ALLOWED, check_contacts
from granforce.packing.importers.text import Source, check_grains
from granforce.records import (
    Contacts,
    InputError,
    Packing,
    Shapes,
    float_array,
    make_contacts,
    make_packing,
    takes,
)
from granforce.system.files import expanded, path_text, written
from granforce.types import Floats

_GRAINS = ("x", "r", "P", "mu")
_ARMS = "arm_i", "arm_j"
_CONTACTS = ("i", "j", "nx", "ny", "branch", "fn", "ft")
_SHAPES = "corners", "sides", "mass", "inertia"
_PARTS = "part_body", "circles"  # of bodies of several parts

# Most bytes of the unpacked arrays: a small archive may declare far more than fits into memory.
_UNPACKED = 10**9


def load_packing(
    source: Source, *, unpacked: int = _UNPACKED, most_grains: int | None = None
) -> Packing:
    """The Packing in an NPZ file, its contacts as they are.

    Parameters
    ----------
    source : path or open file
        Arrays: x, r, L (or Lx, Ly, inf if open), P (nan if none), mu, i, j, nx, ny, branch, fn, ft;
        optionally seed, load, tilt, arm_i, arm_j and info (JSON); friction_ratio (N_c,), friction
        of each contact over mu; for bodies other than disks also levers, gap, corners, sides, mass
        and inertia.
    unpacked : int, default 10⁹
        Most bytes of all arrays together.
    most_grains : int, optional
        Largest number of grains.

    Returns
    -------
    Packing
        As saved.

    Raises
    ------
    InputError
        Naming the error.
    """
    opened = hasattr(source, "read")
    name = str(getattr(source, "name", "the given file")) if opened else path_text(source)
    arrays = _arrays(source, name, unpacked, most_grains)
    missing = [key for key in (*_GRAINS, *_CONTACTS) if key not in arrays]
    if any(key.partition(" ")[0] == "states" for key in arrays):
        raise InputError(f"{name}: these are networks; give the file of their packing")
    if missing or not ("L" in arrays or {"Lx", "Ly"} <= set(arrays)):
        missing = ", ".join([*missing, *([] if "L" in arrays else ["L (or Lx, Ly)"])])
        raise InputError(f"{name}: no array {missing}; is it a packing of granforce?")
    try:
        return _packing(arrays)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


@takes(Packing)
def save_packing(packing: Packing, target: str | Path | IO[bytes]) -> None:
    """Write a packing as NPZ; `load_packing` reads it back exactly.

    Parameters
    ----------
    packing : Packing
        The packing.
    target : path or open file
        A path ending with .npz, which is written completely or not at all, or an open binary file.

    Raises
    ------
    InputError
        If info has other values than numbers and strings, for a path that does not end with .npz,
        or on a write error.
    """
    if not hasattr(target, "write"):
        path = expanded(target)
        device = path.exists() and not path.is_file() and not path.is_dir()
        if path.suffix != ".npz" and not device:
            raise InputError(f"{target}: the name must end with .npz")
    try:
        info = json.dumps(packing.info, default=lambda value: value.item())
    except (TypeError, ValueError, AttributeError):
        raise InputError("packing.info must hold plain numbers and strings") from None
    contacts, (width, height) = packing.contacts, packing.box
    arrays = {
        "x": packing.x,
        "r": packing.r,
        **({"L": width} if width == height else {"Lx": width, "Ly": height}),
        "tilt": packing.tilt,
        "P": packing.pressure,
        "mu": packing.mu,
        "i": contacts.i,
        "j": contacts.j,
        "nx": contacts.normal[:, 0],
        "ny": contacts.normal[:, 1],
        "branch": contacts.length,
        "gap": contacts.gap,
        "arm_i": contacts.arm_i,
        "arm_j": contacts.arm_j,
        "fn": packing.forces[:, 0],
        "ft": packing.forces[:, 1],
        "load": packing.load,
        **{
            name: values
            for name in ("levers", "friction_ratio")
            if (values := getattr(contacts, name)) is not None
        },
        **{
            name: values
            for name, values in zip(_SHAPES + _PARTS, packing.shapes or (), strict=False)
            if values is not None
        },
        "info": np.array(info),
        **_seed(packing.info),
    }
    if hasattr(target, "write"):
        np.savez_compressed(target, **arrays)
    else:
        with written(target) as file:
            np.savez_compressed(file, **arrays)


def _seed(info: dict[str, Any]) -> dict[str, Any]:
    """The seed as a separate array, for other readers; in info if int64 cannot represent it."""
    seed = np.array(info.get("seed"))
    return {"seed": seed} if seed.dtype.kind in "iu" else {}


def _arrays(
    source: Source, name: str, unpacked: int, most_grains: int | None
) -> dict[str, npt.NDArray[Any]]:
    """The archive's arrays except those that loading ignores, {name: array}."""
    ignored = {"lo", "hi", "fcrit"}
    with _opened(source, name, unpacked) as archive:
        if "r" in archive.files:
            check_grains(archive["r"].size, most_grains, name)
        if "levers" not in archive.files:  # the gaps of disks follow from their radii
            ignored.add("gap")
        return {key: archive[key] for key in archive.files if key not in ignored}


def read_arrays(path: str) -> dict[str, npt.NDArray[Any]]:
    """All arrays of an NPZ file, {name: array}; InputError for any other file."""
    with _opened(path, path, np.inf) as archive:
        return {key: archive[key] for key in archive.files}


@contextmanager
def _opened(source: Source, name: str, unpacked: float) -> Iterator[Any]:
    """An archive of plain arrays, of at most `unpacked` bytes; InputError for anything else."""
    try:
        # Opened here: numpy would leave the file open if it cannot read the archive.
        with (
            nullcontext(source) if hasattr(source, "read") else open(source, "rb") as file,
            np.load(cast("IO[bytes]", file), allow_pickle=False) as archive,
        ):
            if sum(member.file_size for member in archive.zip.infolist()) > unpacked:
                raise InputError(f"{name}: more than {unpacked / 1e6:g} MB unpacked; too large")
            yield archive
    except InputError:
        raise
    except OSError as error:
        raise InputError(
            f"{name}: cannot be read ({error.strerror or error}); check the path"
        ) from None
    except Exception:
        # Reading a damaged archive may fail in zipfile, in zlib, or in numpy's header parser.
        raise InputError(
            f"{name}: not an NPZ archive of plain arrays, or damaged; granforce import reads "
            "tables and files of other programs (in Python: gf.read_table, gf.read_lammps, …)"
        ) from None


def _packing(arrays: dict[str, npt.NDArray[Any]]) -> Packing:
    for key, array in arrays.items():
        kind = "iu" if key in ("i", "j") else "U" if key == "info" else "iuf"
        if array.dtype.kind not in kind:
            raise InputError(f"array {key} has type {array.dtype}; store plain numbers")
    r = float_array(arrays["r"], (-1,), "r")
    if not len(r):
        raise InputError("it has no grains")
    if np.any(r <= 0):
        raise InputError(f"radius of grain {int(np.argmax(r <= 0))} is not positive")
    info = _info(arrays)
    contacts = _contacts(arrays, r, info)
    if "friction_ratio" in arrays:
        ratio = float_array(arrays["friction_ratio"], contacts.i.shape, "friction_ratio")
        if np.any((ratio < 0) | (ratio > 1)):
            raise InputError("friction_ratio must lie between 0 and 1: mu is the largest friction")
        contacts = contacts._replace(friction_ratio=ratio)
    forces = [float_array(arrays[key], contacts.i.shape, key) for key in ("fn", "ft")]
    return make_packing(
        arrays["x"],
        r,
        [_scalar(arrays, key) for key in (("L", "L") if "L" in arrays else ("Lx", "Ly"))],
        contacts,
        np.column_stack(forces),
        _scalar(arrays, "mu"),
        _scalar(arrays, "P"),
        arrays.get("load"),
        info,
        _scalar(arrays, "tilt") if "tilt" in arrays else 0.0,
        _shapes(arrays),
    )


def _shapes(arrays: dict[str, npt.NDArray[Any]]) -> Shapes | None:
    missing = [key for key in _SHAPES if key not in arrays]
    if 0 < len(missing) < len(_SHAPES):
        raise InputError(f"no array {', '.join(missing)}; give all of {', '.join(_SHAPES)}")
    if missing:
        return None
    return Shapes(*(arrays[key] for key in _SHAPES), *(arrays.get(key) for key in _PARTS))


def _contacts(arrays: dict[str, npt.NDArray[Any]], r: Floats, info: dict[str, Any]) -> Contacts:
    i, j = arrays["i"], arrays["j"]
    normal = [float_array(arrays[key], i.shape[:1], key) for key in ("nx", "ny")]
    normal = np.column_stack(normal)
    if "levers" in arrays:
        return _of_bodies(make_contacts(i, j, normal, np.ones(np.shape(i)), r), normal, arrays)
    contacts = make_contacts(i, j, normal, arrays["branch"], r)
    check_contacts(contacts, r, "contact {}".format, _gap_allowed(info))
    if not set(_ARMS) <= set(arrays):
        return contacts
    # Single precision is accepted; residual and violation show the resulting unbalance.
    exact = all(arrays[key].dtype != np.float32 for key in ("r", "nx", "ny", "branch", *_ARMS))
    rounding = 1e-9 if exact else 1e-6
    arms = {}
    for key, grain in zip(_ARMS, (contacts.i, contacts.j), strict=True):
        arms[key] = float_array(arrays[key], grain.shape, key)
        # From the rigid disk's radius to the middle of the overlap at most; 0 for a wall.
        far = np.abs(arms[key] - r[grain]) > np.abs(contacts.gap) / 2 + rounding * r[grain]
        if np.any(far & (arms[key] != 0)):
            raise InputError(f"lever arms {key} do not fit the radii; remove them")
    # Written by save_packing: its normals were already normalised.
    if exact:
        contacts = contacts._replace(normal=normal)
    return contacts._replace(arm_i=arms["arm_i"], arm_j=arms["arm_j"])


def _of_bodies(contacts: Contacts, normal: Floats, arrays: dict[str, Any]) -> Contacts:
    """The contacts with the gaps, arms and levers of a file, whose radii do not give them."""
    missing = [key for key in ("gap", *_ARMS) if key not in arrays]
    if missing:
        raise InputError(f"contacts with levers also need {', '.join(missing)}")
    count = len(contacts.i)
    length, gap, arm_i, arm_j = (
        float_array(arrays[key], (count,), key) for key in ("branch", "gap", *_ARMS)
    )
    return contacts._replace(
        normal=normal,
        length=length,
        gap=gap,
        arm_i=arm_i,
        arm_j=arm_j,
        levers=float_array(arrays["levers"], (count, 2), "levers"),
    )


def _gap_allowed(info: dict[str, Any]) -> float:
    """Largest allowed gap, which importers store in info if radii were measured only roughly."""
    noted = info.get("largest_gap")
    return max(OVERLAP_ALLOWED, noted) if isinstance(noted, float) else OVERLAP_ALLOWED


def _scalar(arrays: dict[str, npt.NDArray[Any]], key: str) -> float:
    if arrays[key].shape != ():
        raise InputError(f"array {key} must be one number, got shape {arrays[key].shape}")
    return float(arrays[key])


def _info(arrays: dict[str, npt.NDArray[Any]]) -> dict[str, Any]:
    if "info" not in arrays:
        return {"seed": int(_scalar(arrays, "seed"))} if "seed" in arrays else {}
    try:
        info = json.loads(str(arrays["info"]))
    except (ValueError, RecursionError):
        info = None
    if not isinstance(info, dict):
        raise InputError("info is not a JSON object")
    return info
