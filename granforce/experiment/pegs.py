"""Packings and measured forces from photoelastic experiments, in the formats of PeGS.

Such data do not balance: some contacts are missing, others are wrong, and radii are known only to
some tenths. Errors that show in the data themselves are repaired first (`repair`). Pairs about as
close as the listed ones are added as unmeasured candidates; a linear program then finds the fewest
grains that still cannot be balanced, and their balance is left open. So is that of grains at walls,
unless the directions of their contacts with the walls are known (`walls`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NamedTuple, cast

import numpy as np

from granforce import notebook
from granforce.experiment.assembly import (
    BALANCED,
    Assembly,
    Measured,
    candidates,
    inferred,
    measured_pairs,
    unbalance,
)
from granforce.experiment.listings import solved
from granforce.experiment.listings.listing import Frames, Listing, plain
from granforce.experiment.listings.text_frames import read_frames
from granforce.experiment.measurements import checked_calibration
from granforce.experiment.repair import KINDS, OVERLAP, Account, Finding, repaired
from granforce.experiment.walls import (
    Bodies,
    WallContacts,
    WallOutline,
    bad_fit,
    bodies,
    flagged,
    read_outline,
    wall_contacts,
)
from granforce.fields import record
from granforce.forces.grain_pressures import GrainPressures
from granforce.forces.likeliest import Likeliest
from granforce.packing.importers.geometry import OPEN, check_disks, gain_by_reversing
from granforce.packing.importers.network import WORTH_REVERSING, accuracy_of, worth_reversing
from granforce.packing.importers.notes import noted
from granforce.packing.importers.snapshots import with_walls
from granforce.packing.importers.text import Source, check_grains
from granforce.records import InputError, Packing, friction, positive
from granforce.types import Floats, Integers, Mask

# Findings of one kind listed in the report.
_LISTED = 10


@record
class Photoelastic(NamedTuple):
    """A packing with measured forces; contacts: listed, candidates, then walls."""

    packing: Annotated[
        Packing, "its own network is the likeliest one; loads are NaN if balance is open"
    ]
    measured: Annotated[Floats, "(N_c, 2) f_n, f_t as listed, force; NaN for candidates"]
    sigma: Annotated[Floats, "(N_c, 2) their standard errors"]
    added: Annotated[Mask, "(N_c,) mask of contacts that were not listed"]
    left_open: Annotated[Integers, "(k,) grains that no admissible forces balance, except at walls"]
    at_wall: Annotated[Mask, "(N,) mask of grains at walls, and of the walls themselves"]
    ids: Annotated[Floats, "(N,) their ids in the files; −1, −2, … for the walls"]
    walls: Annotated[
        tuple[str, ...], "names of the walls, which are the last bodies of the packing"
    ]
    findings: Annotated[list[Finding], "repairs, and their places"]
    report: Annotated[dict[str, Any], "findings and actions, in plain numbers and words"]
    pressures: Annotated[GrainPressures | None, "calibrated pressures of grains; None without"] = (
        None
    )

    def _repr_html_(self) -> str:
        """The import as displayed in notebooks."""
        lines = {name.replace("_", " "): value for name, value in self.report.items()}
        return notebook.table("Photoelastic frame", lines)


def open_frames(
    positions: Source | Frames,
    adjacency: Source | None = None,
    *,
    columns: Mapping[str, str] | None = None,
) -> Frames:
    """Frames to read: `frames` (their numbers) and `listing(frame)`.

    From two text files, or, without adjacency, from a *_solved.mat of PeGS 2; existing frames
    (`synthetic_frame`) are returned unchanged. columns: of text files, as for `read_frames`.
    """
    if columns and (adjacency is None or hasattr(positions, "listing")):
        raise InputError("columns are named in two text files, positions and adjacency, only")
    if hasattr(positions, "listing"):
        return cast("Frames", positions)
    if adjacency is None:
        return solved.read_solved(positions)
    return read_frames(positions, adjacency, columns)


@noted(lambda photoelastic: photoelastic.report)
def read_pegs(
    positions: Source | Frames,
    adjacency: Source | None = None,
    *,
    mu: float,
    frame: float | None = None,
    reach: float = 0.5,
    scale: float = 1.0,
    error: float | None = None,
    reverse: bool = False,
    repair: bool = True,
    columns: Mapping[str, str] | None = None,
    flag: str | None = None,
    walls: str | None = None,
    wall_forces: Mapping[str, Sequence[float]] | None = None,
    calibration: Sequence[float] | None = None,
    most_grains: int | None = None,
) -> Photoelastic:
    """A Photoelastic of one frame, from files of positions and contacts.

    Parameters
    ----------
    positions : path, open file or frames
        Without adjacency, a *_solved.mat of PeGS 2, or frames from `open_frames`.
    adjacency : path or open file, optional
        The contacts.
    mu : float
        Friction coefficient.
    frame : float, optional
        Its number, by default the last one in both files.
    reach : float, default 0.5
        Largest gap between the disks of a candidate, in mean radii (0: no candidates).
    scale : float, default 1
        Factor on the listed radii.
    error : float, optional
        Standard error of a measured component, force; by default the one that makes χ² equal to its
        degrees of freedom. Where two measurements of a contact differ by far more, half their
        difference is added in quadrature.
    reverse : bool, default False
        Change the sign of f_t (programs differ).
    repair : bool or float, default True
        Repair errors in up to a tenth of the data (or in the given fraction); False: the first
        error raises.
    columns : mapping, optional
        {name here: header or number in the files}, such as {"r": "diameter", "f_n": "5"}, for
        columns that are not recognised.
    flag : str, optional
        Grains at walls are flagged in the files. "ignore" uses the grains at the boundary of the
        frame instead, which are also used if nearly all grains are flagged; a note in the report
        says so.
    walls : str, optional
        "open" (the balance of grains at walls is not required), "box", "annulus", "circle" or
        "auto" (the best fit), found from the grains at walls or given with numbers
        (`walls.read_outline`). By default contacts with walls count if the solver lists their
        directions.
    wall_forces : mapping, optional
        {"right": (f_x, f_y, σ)}, forces of the grains on straight walls, measured by load cells.
    calibration : (a, b, σ), optional
        The pressure of a grain is a times the column `pressure` of the positions (G², for example)
        plus b, with standard error σ. Of grains at walls without listed contacts with them, and of
        those left open, it is not used.
    most_grains : int, optional
        Largest number of grains.

    Returns
    -------
    Photoelastic
        The report gives the repairs, by kind; how many inner grains cannot be balanced on the
        listed contacts alone and with the candidates, with their total unbalance in mean measured
        normal forces; and the result. Its notes are also InputWarnings.

    Raises
    ------
    InputError
        Naming file and line.
    """
    mu, scale = friction(mu), positive(scale, "scale")
    if not 0 <= reach <= 2:
        words = f"is in mean radii and must lie between 0 and 2, got {reach}"
        raise InputError.of("reach", reach, words)
    outline = walls if walls is None or hasattr(walls, "gaps") else read_outline(walls)
    opened = open_frames(positions, adjacency, columns=columns)
    listing = opened.listing(frame)
    check_grains(len(listing.ids), most_grains, listing.names[0])
    listing = listing._replace(r=scale * listing.r)
    if reverse:
        listing = listing._replace(forces=listing.forces * [1, -1])

    grains = _grains(listing, mu, repair, flag, outline)
    sides = _sides(grains, outline, wall_forces or {}, reach)
    assembly = _assembly(grains, sides, mu, reach)
    saved = _saved_by_reversing(assembly)
    balance = _balance(assembly, listing.names[1])
    pressures = _pressures(grains.listing, balance.packing, calibration)
    fit = _fit(assembly, balance, pressures, error)

    notes = [] if frame is not None else [*getattr(opened, "notes", [])]
    notes += grains.notes
    notes += [worth_reversing(saved, reverse)] if saved > WORTH_REVERSING else []
    notes += sides.notes
    ids = with_walls(grains.listing.ids, len(sides.names))
    lines = {
        **grains.lines(),
        **_pair_lines(grains, assembly),
        **sides.lines(),
        "unbalance_saved_if_tangential_forces_were_reversed": saved,
        **balance.lines(assembly, ids),
        **({} if pressures is None else {"measured_pressures": len(pressures.grains)}),
        **fit.lines(balance.unit, len(assembly.listed.pairs)),
        **({"notes": notes} if notes else {}),
        "findings": _finding_lines(grains.account),
    }
    walls_there = len(sides.names)
    return Photoelastic(
        packing=_packing(balance, fit, lines["frame"], walls_there),
        measured=fit.measured.forces,
        sigma=fit.sigma,
        added=fit.measured.added,
        left_open=balance.left_open,
        at_wall=np.concatenate([grains.at_wall, np.ones(walls_there, dtype=bool)]),
        ids=ids,
        walls=sides.names,
        findings=grains.account.findings,
        report=lines,
        pressures=pressures,
    )


# The stages of reading a frame; what each finds out is a record, which has lines of the report.


class _Grains(NamedTuple):
    """A repaired frame, and the grains at its walls."""

    listing: Listing  # its flag: of grains at walls
    account: Account
    renamed: str  # how the ids of contacts were understood, "" if as they are
    at_wall: Mask  # (N,) flagged, or listed in contact with a wall
    flags_ignored: int | None  # number of flags that do not mark walls
    notes: list[str]

    def lines(self) -> dict[str, Any]:
        """Lines of the report."""
        ignored = self.flags_ignored
        return {
            "frame": plain(self.listing.frame),
            "columns": self.listing.description,
            **({"names": self.renamed} if self.renamed else {}),
            "grains": len(self.listing.r),
            **({} if ignored is None else {"flags_ignored": ignored}),
            "grains_at_walls": int(self.at_wall.sum()),
        }


class _Sides(NamedTuple):
    """The walls of a frame."""

    contacts: WallContacts | None  # None if the walls are open
    bodies: Bodies | None
    notes: list[str]

    @property
    def names(self) -> tuple[str, ...]:
        return () if self.bodies is None else self.bodies.names

    def lines(self) -> dict[str, Any]:
        """Lines of the report."""
        return {
            "walls": ", ".join(self.names) or "open",
            "wall_contacts": 0 if self.contacts is None else len(self.contacts.grain),
        }


class _Balance(NamedTuple):
    """Which grains can be balanced."""

    packing: Packing  # the balance of others is open
    unit: float  # mean measured normal force
    before: Floats  # (N,) unbalance on the listed contacts, in `unit`
    after: Floats  # (N,) with the candidates
    left_open: Integers  # grains that are not balanced with the candidates

    def lines(self, assembly: Assembly, ids: Floats) -> dict[str, Any]:
        """Lines of the report."""
        gap = self.packing.contacts.gap[: len(assembly.listed.pairs)]
        return {
            "mean_measured_normal_force": self.unit,
            "median_gap_in_mean_radii": float(np.median(gap) / assembly.r.mean()),
            "candidates": len(assembly.candidates),
            "unbalanced_on_listed_contacts": int(np.sum(self.before > BALANCED)),
            "unbalance_on_listed_contacts": float(self.before.sum()),
            "unbalanced": len(self.left_open),
            "unbalance": float(self.after.sum()),
            "left_open": [plain(ids[k]) for k in self.left_open],
        }


class _Fit(NamedTuple):
    """The most likely network."""

    measured: Measured
    best: Likeliest
    sigma: Floats  # (N_c, 2)

    def lines(self, unit: float, listed: int) -> dict[str, Any]:
        """Lines of the report; listed: number of contacts that were listed, which are the first."""
        best, measured = self.best, self.measured
        change = np.nanmean(np.abs(best.forces - measured.forces), axis=0) / unit
        carrying = best.forces[measured.added, 0] > BALANCED * unit
        return {
            "candidates_that_carry": int(np.sum(carrying)),
            "error": float(np.nanmedian(self.sigma[:listed, 0]) / unit),
            "chi_square": best.chi_square,
            "freedom": best.freedom,
            "mean_change_of_f_n": float(change[0]),
            "mean_change_of_f_t": float(change[1]),
        }


def _grains(
    listing: Listing, mu: float, repair: bool, flag: str | None, outline: str | WallOutline | None
) -> _Grains:
    """The repaired frame."""
    listing, account, renamed = repaired(listing, mu, repair)
    check_disks(listing.x, listing.r, OPEN, lambda g: listing.place(0, g), OVERLAP)
    flags, note = flagged(listing, flag, outline)
    ignored = None if note is None else int(np.sum(listing.flag != 0))
    at_wall, rows = flags != 0, listing.rows
    at_wall[rows[(rows == -1).any(axis=1)].max(axis=1)] = True
    notes = [] if note is None else [note]
    return _Grains(listing._replace(flag=flags), account, renamed, at_wall, ignored, notes)


def _sides(
    grains: _Grains,
    outline: str | WallOutline | None,
    wall_forces: Mapping[str, Sequence[float]],
    reach: float,
) -> _Sides:
    """The walls that an outline or the listing gives."""
    listing, at_wall = grains.listing, grains.at_wall
    x, r = listing.x, listing.r
    contacts = wall_contacts(listing, x, r, at_wall, outline, reach)
    if contacts is None:
        if wall_forces:
            raise InputError("a force on a wall needs walls: give the outline, such as --walls box")
        return _Sides(None, None, [])
    note = None if contacts.outline is None else bad_fit(contacts.outline, x, r, at_wall)
    return _Sides(contacts, bodies(contacts, x, r, wall_forces), [] if note is None else [note])


def _assembly(grains: _Grains, sides: _Sides, mu: float, reach: float) -> Assembly:
    """The grains with their measured contacts and candidates."""
    listing, left_open = grains.listing, grains.at_wall.copy()
    if sides.contacts is not None:
        left_open[sides.contacts.grain] = False
    pairs = measured_pairs(listing)
    more = candidates(listing.x, listing.r, pairs.pairs, left_open, reach)
    return Assembly(listing.x, listing.r, mu, grains.at_wall, pairs, more, sides.bodies)


def _saved_by_reversing(assembly: Assembly) -> float:
    """Fraction of the unbalance of listed forces that the other sign of f_t would remove."""
    i, j = assembly.listed.pairs.T
    branch = assembly.x[j] - assembly.x[i]
    normal = branch / np.hypot(*branch.T)[:, None]
    forces, load = np.nan_to_num(assembly.listed.forces), np.zeros_like(assembly.x)
    return gain_by_reversing((i, j, normal), forces, load, ~assembly.at_wall)


def _balance(assembly: Assembly, name: str) -> _Balance:
    """The packing, whose grains that cannot be balanced are open; name: file of the contacts."""
    unit = float(np.nanmean(np.abs(assembly.listed.forces[:, 0])))
    if not unit > 0:
        raise InputError(f"{name}: all measured normal forces are 0")
    alone, packing = assembly.without_candidates(), assembly.packing()
    before = unbalance(alone.packing(), alone.measured().forces, unit)
    after = before
    if len(assembly.candidates):
        after = unbalance(packing, assembly.measured().forces, unit)
    left_open = np.flatnonzero(after > BALANCED)
    load = packing.load.copy()
    load[left_open] = np.nan
    return _Balance(packing._replace(load=load), unit, before, after, left_open)


def _pressures(
    listing: Listing, packing: Packing, calibration: Sequence[float] | None
) -> GrainPressures | None:
    """The calibrated pressures of grains that must balance; None without a calibration."""
    if calibration is None:
        return None
    if listing.pressure is None:
        raise InputError(
            f"{listing.names[0]}: no column of pressures to calibrate; name it (--pressure-column, "
            'columns={"pressure": …})'
        )
    values, sigma = checked_calibration(calibration).pressures(listing.pressure)
    balanced = ~np.isnan(packing.load[: len(values)]).any(axis=1)
    used = np.flatnonzero(balanced & np.isfinite(values))
    return GrainPressures(used, values[used], sigma[used])


def _fit(
    assembly: Assembly, balance: _Balance, pressures: GrainPressures | None, error: float | None
) -> _Fit:
    """The most likely network of the packing."""
    measured, spread = assembly.measured(), assembly.listed.spread
    best = inferred(balance.packing, measured, pressures, spread, error, balance.unit)
    return _Fit(measured, *best)


def _packing(balance: _Balance, fit: _Fit, frame: float, walls: int) -> Packing:
    """The packing with the most likely network and its info."""
    packing = balance.packing._replace(forces=fit.best.forces)
    c = packing.contacts
    shorter = np.minimum(packing.r[c.i], packing.r[c.j])
    info = {
        "source": "pegs",
        "frame": frame,
        "walls": walls,
        "largest_gap": float(np.abs(c.gap / shorter).max()),
    }
    return packing._replace(info=info | accuracy_of(packing))


def _pair_lines(grains: _Grains, assembly: Assembly) -> dict[str, Any]:
    """Lines of the report on the listed contacts and on repairs."""
    return {
        "contacts_listed": len(assembly.listed.pairs),
        "listed_twice": assembly.listed.twice,
        "listed_twice_with_other_forces": assembly.listed.unequal,
        "contacts_with_a_wall": int((grains.listing.rows == -1).any(axis=1).sum()),
        **grains.account.counts,
    }


def _finding_lines(account: Account) -> list[str]:
    """The findings of each kind, in lines of words, only the first ones of many."""
    lines = []
    for name, kind in KINDS.items():
        findings = account.of(name)
        if findings:
            more = f"; and {len(findings) - _LISTED} more" if len(findings) > _LISTED else ""
            text = "; ".join(one.text for one in findings[:_LISTED])
            lines.append(f"{kind.words} ({len(findings)}): {text}{more}")
    return lines
