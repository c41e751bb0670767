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
from scipy import sparse
from scipy.spatial import cKDTree

from granforce import notebook
from granforce.experiment.listings import solved
from granforce.experiment.listings.listing import Frames, Listing, plain
from granforce.experiment.listings.text_frames import read_frames
from granforce.experiment.repair import KINDS, OVERLAP, Account, Finding, repaired
from granforce.experiment.walls import Bodies, bad_fit, bodies, flagged, read_outline, wall_contacts
from granforce.fields import record
from granforce.forces.build import ensemble
from granforce.forces.likeliest import Likeliest, likeliest
from granforce.numerics import highs
from granforce.packing.importers.geometry import OPEN, check_disks, gain_by_reversing
from granforce.packing.importers.network import WORTH_REVERSING, judged, worth_reversing
from granforce.packing.importers.notes import noted
from granforce.packing.importers.text import Source, check_grains
from granforce.records import (
    InputError,
    Packing,
    UndecidedError,
    friction,
    make_contacts,
    make_packing,
    positive,
)
from granforce.tolerances import OUTLIER
from granforce.types import Floats, Integers, Mask

# Cost of changing a measured force by ⟨f_n⟩, compared with 1 for ⟨f_n⟩ of unbalance.
_CHANGE = 0.2
# Unbalance in ⟨f_n⟩ up to which a grain is balanced.
_BALANCED = 1e-6
# Interior-point steps after which another method is tried; usually 10 to 40 are enough.
_ITERATIONS = 500
# Most estimates of the default error: outliers change it, and it decides what is one.
_ESTIMATES = 4
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
    if walls is not None and not hasattr(walls, "gaps"):
        walls = read_outline(walls)
    opened = open_frames(positions, adjacency, columns=columns)
    listing = opened.listing(frame)
    check_grains(len(listing.ids), most_grains, listing.names[0])
    listing = listing._replace(r=scale * listing.r)
    if reverse:
        listing = listing._replace(forces=listing.forces * [1, -1])
    listing, account, renamed = repaired(listing, mu, repair)
    x, r = listing.x, listing.r
    check_disks(x, r, OPEN, lambda g: listing.place(0, g), OVERLAP)
    sides, note = flagged(listing, flag, walls)
    ignored = {} if note is None else {"flags_ignored": int(np.sum(listing.flag != 0))}
    listing = listing._replace(flag=sides)
    at_wall = sides != 0
    rows = listing.rows
    with_wall = (rows == -1).any(axis=1)
    at_wall[rows[with_wall].max(axis=1)] = True
    listed = _listed(listing, rows)
    branch = x[listed.pairs[:, 1]] - x[listed.pairs[:, 0]]
    normal = branch / np.hypot(*branch.T)[:, None]
    saved = gain_by_reversing(
        (*listed.pairs.T, normal), np.nan_to_num(listed.forces), np.zeros_like(x), ~at_wall
    )
    notes = [] if frame is not None else [*getattr(opened, "notes", [])]
    notes += [] if note is None else [note]
    if saved > WORTH_REVERSING:
        notes.append(worth_reversing(saved, reverse))
    touching = wall_contacts(listing, x, r, at_wall, walls, reach)
    if touching is not None and touching.outline is not None:
        note = bad_fit(touching.outline, x, r, at_wall)
        notes += [] if note is None else [note]
    if wall_forces and touching is None:
        raise InputError("a force on a wall needs walls: give the outline, such as --walls box")
    wall_bodies = None if touching is None else bodies(touching, x, r, wall_forces or {})
    alone = _packing(x, r, listed, np.zeros((0, 2), int), at_wall, mu, wall_bodies)
    still_open = at_wall.copy()
    if touching is not None:
        still_open[touching.grain] = False
    pairs = _candidates(x, r, listed, still_open, reach)
    packing = _packing(x, r, listed, pairs, at_wall, mu, wall_bodies)
    measured, sigma, factor, added = _measurement(listed, len(pairs), wall_bodies)
    unit = float(np.nanmean(np.abs(listed.forces[:, 0])))
    if not unit > 0:
        raise InputError(f"{listing.names[1]}: all measured normal forces are 0")
    of_alone = np.delete(np.arange(len(measured)), len(listed.pairs) + np.arange(len(pairs)))
    before = _unbalance(alone, measured[of_alone], unit)
    after = _unbalance(packing, measured, unit) if len(pairs) else before
    left_open = np.flatnonzero(after > _BALANCED)
    load = packing.load.copy()
    load[left_open] = np.nan
    packing = packing._replace(load=load)
    best, sigma = _inferred(packing, measured, sigma, factor, listed.spread, error, unit)
    packing = packing._replace(forces=best.forces)
    names = () if wall_bodies is None else wall_bodies.names
    ids = np.concatenate([listing.ids, -1.0 - np.arange(len(names))])
    change = np.nanmean(np.abs(best.forces - measured), axis=0) / unit
    gap = packing.contacts.gap
    first = len(listed.pairs)
    report = {
        "frame": plain(listing.frame),
        "columns": listing.description,
        **({"names": renamed} if renamed else {}),
        "grains": len(r),
        **ignored,
        "grains_at_walls": int(at_wall.sum()),
        "contacts_listed": first,
        "listed_twice": listed.twice,
        "listed_twice_with_other_forces": listed.unequal,
        "contacts_with_a_wall": int(with_wall.sum()),
        **account.counts,
        "walls": ", ".join(names) or "open",
        "wall_contacts": 0 if touching is None else len(touching.grain),
        "unbalance_saved_if_tangential_forces_were_reversed": saved,
        "mean_measured_normal_force": unit,
        "median_gap_in_mean_radii": float(np.median(gap[:first]) / r.mean()),
        "candidates": len(pairs),
        "unbalanced_on_listed_contacts": int(np.sum(before > _BALANCED)),
        "unbalance_on_listed_contacts": float(before.sum()),
        "unbalanced": len(left_open),
        "unbalance": float(after.sum()),
        "left_open": [plain(ids[k]) for k in left_open],
        "candidates_that_carry": int(np.sum(best.forces[added, 0] > _BALANCED * unit)),
        "error": float(np.nanmedian(sigma[:first, 0]) / unit),
        "chi_square": best.chi_square,
        "freedom": best.freedom,
        "mean_change_of_f_n": float(change[0]),
        "mean_change_of_f_t": float(change[1]),
        **({"notes": notes} if notes else {}),
        "findings": _finding_lines(account),
    }
    shorter = np.minimum(*packing.r[np.stack([packing.contacts.i, packing.contacts.j])])
    info = {"source": "pegs", "frame": report["frame"], "walls": len(names)}
    info["largest_gap"] = float(np.abs(gap / shorter).max())
    packing = packing._replace(info=info | judged(packing))
    open_or_wall = np.concatenate([at_wall, np.ones(len(names), dtype=bool)])
    return Photoelastic(
        packing=packing,
        measured=measured,
        sigma=sigma,
        added=added,
        left_open=left_open,
        at_wall=open_or_wall,
        ids=ids,
        walls=names,
        findings=account.findings,
        report=report,
    )


def _finding_lines(account: Account) -> list[str]:
    """The findings of each kind, in lines of words, only the first ones of many."""
    lines = []
    for kind, (words, *_) in KINDS.items():
        findings = account.of(kind)
        if findings:
            more = f"; and {len(findings) - _LISTED} more" if len(findings) > _LISTED else ""
            text = "; ".join(one.text for one in findings[:_LISTED])
            lines.append(f"{words} ({len(findings)}): {text}{more}")
    return lines


class _Listed(NamedTuple):
    """Contacts between two grains, each once."""

    pairs: Integers  # (k, 2) grains, the first before the second
    forces: Floats  # (k, 2) mean of the listed forces; NaN if not measured
    spread: Floats  # (k, 2) half the largest difference
    factor: Floats  # (k,) variance of the mean, relative to a usual line
    twice: int
    unequal: int  # listed twice, with different forces


def _listed(listing: Listing, rows: Integers) -> _Listed:
    """The _Listed of a repaired listing; rows (k, 2) of its ends."""
    inner = np.all(rows >= 0, axis=1)
    # f_t has the sign of n and t turned together, which stays the same when i and j are swapped.
    pairs, which = np.unique(np.sort(rows[inner]), axis=0, return_inverse=True)
    which, values = which.ravel(), listing.forces[inner]
    good = np.isfinite(values[:, 0])
    weight = np.where(good, listing.weight[inner], 0.0)
    total = np.bincount(which, weight, len(pairs))
    low, high, mean = np.full((3, len(pairs), 2), 0.0)
    low[:], high[:] = np.inf, -np.inf
    np.minimum.at(low, which[good], values[good])
    np.maximum.at(high, which[good], values[good])
    np.add.at(mean, which[good], weight[good, None] * values[good])
    with np.errstate(divide="ignore", invalid="ignore"):
        mean /= total[:, None]
        factor = (
            1 if listing.both_ways else np.bincount(which[good], minlength=len(pairs))
        ) / total
        spread = np.where(np.isfinite(mean), 0.5 * (high - low), np.nan)
    times = np.bincount(which, minlength=len(pairs))
    unequal = int(np.sum(np.nan_to_num(spread).any(axis=1)))
    return _Listed(
        pairs=pairs,
        forces=mean,
        spread=spread,
        factor=factor,
        twice=int(np.sum(times > 1)),
        unequal=unequal,
    )


def _candidates(x: Floats, r: Floats, listed: _Listed, left_open: Mask, reach: float) -> Integers:
    """Pairs (k, 2) that are not listed, with a gap up to `reach`, at least one to be balanced."""
    far = 2 * r.max() + reach * r.mean()
    pairs = cKDTree(x).query_pairs(far, output_type="ndarray") if reach else np.zeros((0, 2), int)
    pairs = np.sort(pairs.astype(np.int64))
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    gap = np.hypot(*(x[pairs[:, 1]] - x[pairs[:, 0]]).T) - r[pairs].sum(axis=1)
    known = np.isin(pairs @ [len(x), 1], listed.pairs @ [len(x), 1])
    return pairs[(gap <= reach * r.mean()) & ~known & ~left_open[pairs].all(axis=1)]


def _packing(
    x: Floats,
    r: Floats,
    listed: _Listed,
    pairs: Integers,
    at_wall: Mask,
    mu: float,
    walls: Bodies | None = None,
) -> Packing:
    """The packing of listed, candidate and wall contacts; forces as listed, otherwise 0.

    Contact points are midway between the disks, whose radii are not known accurately.
    """
    i, j = np.concatenate([listed.pairs, pairs]).T
    branch = x[j] - x[i]
    length = np.hypot(*branch.T)
    contacts = make_contacts(i, j, branch / length[:, None], length, r)
    contacts = contacts._replace(arm_i=r[i] + contacts.gap / 2, arm_j=r[j] + contacts.gap / 2)
    forces = [np.nan_to_num(listed.forces), np.zeros((len(pairs), 2))]
    load = np.where(at_wall[:, None], np.nan, np.zeros((len(r), 3)))
    if walls is not None:
        load[walls.contacts.i[walls.contacts.i < len(r)]] = 0.0
        x, r, load = (
            np.concatenate(both) for both in ((x, walls.x), (r, walls.r), (load, walls.load))
        )
        contacts = contacts.joined(walls.contacts)
        forces.append(np.nan_to_num(walls.measured))
    return make_packing(x, r, np.full(2, np.inf), contacts, np.concatenate(forces), mu, load=load)


def _measurement(
    listed: _Listed, candidates: int, walls: Bodies | None
) -> tuple[Floats, Floats, Floats, Mask]:
    """Measured forces (N_c, 2), known errors, variance factors, and a mask of added contacts."""
    nothing = np.full((candidates, 2), np.nan)
    measured, factor = [listed.forces, nothing], [listed.factor, np.ones(candidates)]
    sigma = [np.full_like(listed.forces, np.nan), nothing]
    added = [np.zeros(len(listed.pairs), dtype=bool), np.ones(candidates, dtype=bool)]
    if walls is not None:
        measured.append(walls.measured)
        factor.append(walls.factor)
        sigma.append(walls.sigma)
        added.append(np.isnan(walls.measured[:, 0]))
    return (
        np.concatenate(measured),
        np.concatenate(sigma),
        np.concatenate(factor),
        np.concatenate(added),
    )


def _unbalance(packing: Packing, m: Floats, unit: float) -> Floats:
    """(N,) unbalance of each grain that no admissible forces near the measured ones can remove.

    From the least Σ |unbalance| + _CHANGE Σ |f − m|, in units of `unit`: sums of absolute values
    leave few grains unbalanced.
    """
    S = ensemble(packing, prune=False)
    if not len(S.grains):
        return np.zeros(len(packing.r))
    A, T = S.cone_form
    m = S.to_vector(m) / unit
    measured = np.flatnonzero(np.isfinite(m))
    rows, columns = A.shape[0], A.shape[1]
    both = sparse.vstack([A, sparse.csr_matrix(T)[measured]])
    slack = sparse.identity(rows + len(measured))
    cost = np.concatenate([np.ones(rows), np.full(len(measured), _CHANGE)])
    right = np.concatenate([np.zeros(rows), m[measured]])
    # Five times as fast as the simplex method here; its crossover also ends in a vertex.
    model = highs.standard_form(sparse.hstack([both, slack, -slack]), right, solver="ipm")
    model.setOptionValue("ipm_iteration_limit", _ITERATIONS)
    highs.set_cost(model, np.concatenate([np.zeros(columns), cost, cost]))
    solution = highs.optimal(model)
    if solution is None:
        raise UndecidedError("which grains can be balanced is undecided: no solver reached an end")
    off = np.abs(A @ np.maximum(solution[:columns], 0.0)).reshape(-1, S.per_grain)
    unbalance = np.zeros(len(packing.r))
    unbalance[S.grains] = off.sum(axis=1)
    return np.where(unbalance > _BALANCED, unbalance, 0.0)


def _inferred(
    packing: Packing,
    m: Floats,
    sigma: Floats,
    factor: Floats,
    spread: Floats,
    error: float | None,
    unit: float,
) -> tuple[Likeliest, Floats]:
    """The Likeliest network, and σ (N_c, 2): as given for load cells, else from the factors."""
    S = ensemble(packing, prune=False)
    relative = np.sqrt(factor)[:, None] * np.ones(2)
    unmeasured = np.isnan(sigma)
    differing = np.zeros_like(m)
    differing[: len(spread)] = np.nan_to_num(spread)

    def with_spread(error: float) -> Floats:
        # Smaller differences are the noise itself: adding them would count it twice.
        noise = error * relative
        return np.hypot(noise, np.where(differing > OUTLIER * noise, differing, 0.0))

    if error is None:
        error = unit
        for _ in range(_ESTIMATES):
            best = likeliest(S, np.where(unmeasured, m, np.nan), with_spread(error))
            freedom = max(best.freedom, 1)
            least = unit * np.sqrt(_BALANCED / freedom)
            error = max(error * np.sqrt(best.chi_square / freedom), least)
            if not (differing > OUTLIER * error * relative).any():
                break
    sigma = np.where(unmeasured, with_spread(positive(error, "error")), sigma)
    sigma[np.isnan(m)] = np.nan
    return likeliest(S, m, sigma), sigma
