"""Photoelastic frames made from packings with known forces, with the errors of real frames."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from granforce.experiment.listings.listing import Listing
from granforce.experiment.pegs import Photoelastic
from granforce.fields import record
from granforce.forces.build import ensemble
from granforce.forces.grain_pressures import grain_pressures
from granforce.records import (
    Contacts,
    InputError,
    Packing,
    positive,
    random_seed,
    real,
    refuse_shapes,
    takes,
    whole,
)
from granforce.system.files import written
from granforce.tolerances import LARGEST_UNIT
from granforce.types import Floats, Integers, Mask


@record
class SyntheticFrame(NamedTuple):
    """A frame as if read from files, and the true forces; `gf.read_pegs` accepts it."""

    only: Annotated[Listing, "what a reader of the files would return"]
    pairs: Annotated[Floats, "(k, 2) ids of the grains that touch inside the frame"]
    forces: Annotated[Floats, "(k, 2) their true f_n, f_t"]
    unit: Annotated[float, "mean true normal force"]

    @property
    def frames(self) -> Floats:
        """Its number."""
        return np.array([self.only.frame])

    def listing(self, frame: float | None = None) -> Listing:
        """Its Listing; InputError for another frame."""
        if frame is not None and frame != self.only.frame:
            raise InputError(f"this is frame {self.only.frame:g}, not frame {frame:g}")
        return self.only

    def truth(self, photo: Photoelastic) -> Floats:
        """True forces (N_c, 2) of a Photoelastic's contacts.

        0 for pairs that do not touch, NaN for contacts with walls.
        """
        c, ids = photo.packing.contacts, photo.ids
        known = {tuple(sorted(pair)): k for k, pair in enumerate(self.pairs.tolist())}
        true = np.zeros((len(c.i), 2))
        for row, (i, j) in enumerate(zip(ids[c.i].tolist(), ids[c.j].tolist(), strict=True)):
            k = known.get((i, j) if i < j else (j, i))
            true[row] = np.nan if j < 0 else 0.0 if k is None else self.forces[k]
        return true

    def write(
        self, positions: str | Path, adjacency: str | Path, *, pressures: bool = False
    ) -> None:
        """Write the files of PeGS: frame, id, x, y, radius, flag; frame, id1, id2, f_t, f_n.

        pressures: whether grains have them in a last column, under a line of headers.
        """
        one, number = self.only, self.only.frame
        grains = np.column_stack([one.ids, one.x, one.r, one.flag])
        links = np.column_stack([one.ends, one.forces[:, ::-1]])
        header = "frame,id,x,y,radius,flag,pressure" if pressures else ""
        if pressures:
            grains = np.column_stack([grains, np.asarray(one.pressure)])
        for path, rows, words in ((positions, grains, header), (adjacency, links, "")):
            with written(path) as file:
                whole = np.column_stack([np.full(len(rows), number), rows])
                np.savetxt(file, whole, fmt="%.9g", delimiter=",", header=words, comments="")


@takes(Packing)
def synthetic_frame(
    packing: Packing,
    *,
    noise: float = 0.1,
    missed: float = 0.0,
    false: float = 0.0,
    blur: float = 0.0,
    walls: bool = True,
    pixels: float = 50.0,
    newton: float = 0.01,
    number: int = 1,
    seed: int = 0,
) -> SyntheticFrame:
    """A SyntheticFrame of a packing and its own forces, cut at the sides of its box.

    Parameters
    ----------
    packing : Packing
        Disks, with forces.
    noise : float, default 0.1
        Standard error of a component, in ⟨f_n⟩, independent on both sides of a contact; and of a
        grain's pressure, in mean pressures.
    missed : float, default 0
        Fraction of contacts that are not listed, weak ones first: a contact of force f is missed
        with probability ∝ 1/(f + ⟨f_n⟩/2).
    false : float, default 0
        Listed pairs that are not contacts, as a fraction of the true ones: the nearest other pairs,
        with forces of about 0.2 ⟨f_n⟩.
    blur : float, default 0
        Error of centres and radii, in radii.
    walls : bool, default True
        Contacts through the sides of the box are listed as contacts with walls, with their
        direction and force; False: grains there are only flagged.
    pixels : float, default 50
        Per unit of length.
    newton : float, default 0.01
        Mean normal force.
    number : int, default 1
        Of the frame.
    seed : int, default 0
        Seed of the errors.

    Returns
    -------
    SyntheticFrame
        Accepted by `read_pegs`, with the true forces.

    Raises
    ------
    InputError
        For values below 0 or beyond 10⁶⁰, and for a packing without forces or with bodies other
        than disks.
    """
    refuse_shapes(packing, "photoelastic frames are made")
    errors = _checked_errors(noise, missed, false, blur)
    for value, name in ((pixels, "pixels"), (newton, "newton")):
        if not 1 / LARGEST_UNIT <= positive(value, name) <= LARGEST_UNIT:
            raise InputError(
                f"{name} must be from {1 / LARGEST_UNIT:g} to {LARGEST_UNIT:g}, got {value}"
            )
    if not np.any(packing.forces[:, 0] > 0):
        raise InputError("the packing has no forces to measure")
    rng = np.random.default_rng(random_seed(seed))
    true = _true_contacts(packing, float(newton))
    lines = _listed_pairs(packing, true, errors, rng)
    if walls:
        lines = _with_walls(lines, true)
    c, inside, count = true.contacts, true.inside, len(packing.r)
    forces = lines.forces + errors.noise * true.unit * rng.standard_normal(lines.forces.shape)
    x = packing.x + errors.blur * packing.r.mean() * rng.standard_normal(packing.x.shape)
    r = packing.r * (1 + errors.blur * rng.standard_normal(count)).clip(0.5, 1.5)
    noise_of_pressures = errors.noise * true.pressures.mean() * rng.standard_normal(count)
    flag = np.zeros(count)
    flag[c.i[~inside]] = flag[c.j[~inside]] = 1.0
    listing = Listing(
        ids=np.arange(1.0, count + 1),
        x=float(pixels) * x,
        r=float(pixels) * r,
        flag=flag,
        ends=np.asarray(lines.ends, dtype=np.float64) + 1.0,
        forces=forces,
        beta=lines.beta,
        weight=np.ones(len(lines.ends)),
        names=("synthetic positions", "synthetic contacts"),
        lines=(np.arange(1, count + 1), np.arange(1, len(lines.ends) + 1)),
        both_ways=True,
        frame=float(whole(number, "number")),
        description="synthetic frame",
        pressure=(true.pressures + noise_of_pressures) / float(pixels),
    )
    pairs: Floats = np.column_stack([c.i, c.j])[inside].astype(np.float64) + 1.0
    return SyntheticFrame(listing, pairs, true.forces[inside], true.unit)


class _Errors(NamedTuple):
    """Errors of a frame, as for `synthetic_frame`."""

    noise: float
    missed: float
    false: float
    blur: float


class _TrueContacts(NamedTuple):
    """The contacts that carry force."""

    contacts: Contacts
    forces: Floats  # (N_c, 2)
    unit: float  # mean normal force
    inside: Mask  # (N_c,) whether they do not cross a side of the box
    pressures: Floats  # (N,) of the grains


class _Lines(NamedTuple):
    """Lines of contacts, each from both sides."""

    ends: Integers  # (k, 2) grains from 0; −2: a wall
    forces: Floats  # (k, 2)
    beta: Floats  # (k,) direction of contacts with walls, otherwise NaN


def _checked_errors(noise: float, missed: float, false: float, blur: float) -> _Errors:
    errors = _Errors(noise, missed, false, blur)
    for name, value in errors._asdict().items():
        if not 0 <= real(value, name) <= LARGEST_UNIT or (name == "missed" and value >= 1):
            raise InputError(
                f"{name} must be from 0 to {LARGEST_UNIT:g} (missed: below 1), got {value}"
            )
    return errors


def _true_contacts(packing: Packing, unit: float) -> _TrueContacts:
    S = ensemble(packing)
    c = S.contacts
    branch = packing.x[c.j] - packing.x[c.i]
    inside = np.abs(branch - c.length[:, None] * c.normal).max(axis=1) < 1e-6 * packing.r.max()
    forces = unit * S.original / S.original[:, 0].mean()
    return _TrueContacts(c, forces, unit, inside, grain_pressures(S, forces))


def _listed_pairs(
    packing: Packing, true: _TrueContacts, errors: _Errors, rng: np.random.Generator
) -> _Lines:
    """Contacts of two grains without the missed ones, and false ones."""
    c, inside, unit = true.contacts, true.inside, true.unit
    chance = inside / (true.forces[:, 0] + unit / 2)
    order = rng.exponential(size=len(chance)) / np.maximum(chance, 1e-300)
    absent = np.zeros(len(chance), dtype=bool)
    absent[np.argsort(order)[: round(errors.missed * inside.sum())]] = True
    seen = np.flatnonzero(inside & ~absent)
    false = _near_pairs(packing, c, round(errors.false * inside.sum()))
    guess = np.abs(rng.normal(0, 0.2 * unit, (len(false), 2))) * [1.0, packing.mu]
    ends = np.concatenate([np.column_stack([c.i, c.j])[seen], false])
    forces = np.concatenate([true.forces[seen], guess])
    ends, forces = np.concatenate([ends, ends[:, ::-1]]), np.tile(forces, (2, 1))
    return _Lines(ends, forces, np.full(len(ends), np.nan))


def _with_walls(lines: _Lines, true: _TrueContacts) -> _Lines:
    """The lines and those of contacts through the sides of the box, as contacts with walls."""
    c, out = true.contacts, np.flatnonzero(~true.inside)
    angle = np.arctan2(*c.normal[out].T[::-1])
    grain = np.concatenate([c.i[out], c.j[out]])
    ends = np.column_stack([grain, np.full(len(grain), -2)])
    return _Lines(
        np.concatenate([lines.ends, ends]),
        np.concatenate([lines.forces, true.forces[out], true.forces[out]]),
        np.concatenate([lines.beta, angle, angle + np.pi]),
    )


def _near_pairs(packing: Packing, contacts: Contacts, count: int) -> Integers:
    """The `count` nearest pairs inside the box that are not contacts."""
    pairs = cKDTree(packing.x).query_pairs(2.5 * packing.r.max(), output_type="ndarray")
    pairs = np.sort(pairs.astype(np.int64))
    touching = np.sort(np.column_stack([contacts.i, contacts.j]))
    pairs = pairs[~np.isin(pairs @ [len(packing.r), 1], touching @ [len(packing.r), 1])]
    gap = np.hypot(*(packing.x[pairs[:, 1]] - packing.x[pairs[:, 0]]).T)
    gap -= packing.r[pairs].sum(axis=1)
    return pairs[np.argsort(gap, kind="stable")[:count]]
