"""Errors in a photoelastic frame, their repair, and a record of them.

Each step takes a Listing, records errors, and returns a Listing without them. Invalid lines are
dropped; invalid forces count as not measured. If more than a tenth of the grains or of the contacts
is affected, nothing is repaired: then the files do not belong together, or a unit is wrong.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from granforce.experiment.listings.listing import FAR, Listing, plain
from granforce.packing.importers.geometry import OPEN, check_disks, overlapping
from granforce.records import InputError
from granforce.types import Floats, Integers


class Kind(NamedTuple):
    """A kind of finding."""

    words: str
    of_grains: bool = False  # otherwise of contacts
    repaired: bool = True  # data are dropped, or count as not measured; otherwise only reported
    is_error: bool = True  # in the file: raised if `strict`; otherwise measurement noise


KINDS = {
    "unreadable_grains": Kind(
        "grains with a field that is not a finite number, or without a radius", of_grains=True
    ),
    "doubled_grains": Kind("grains listed twice", of_grains=True),
    "false_detections": Kind(
        "grains inside others, which fit fewer contacts and sizes", of_grains=True
    ),
    "unreadable_contacts": Kind("contacts with a field that cannot be a name or a force"),
    "contacts_with_themselves": Kind("contacts of a grain with itself"),
    "contacts_of_missing_grains": Kind("contacts that name a missing grain"),
    "contacts_too_long": Kind("contacts of grains too far apart to touch"),
    "negative_normal_forces": Kind("contacts that pull, taken as not measured", is_error=False),
    "beyond_friction": Kind(
        "measured forces beyond the friction limit at this μ, not changed",
        repaired=False,
        is_error=False,
    ),
}
# Overlap, as a fraction of the smaller radius, beyond which one of two disks must be false.
OVERLAP = 0.5
# Largest fraction of the data to repair, by default.
MOST = 0.1
# Two detections are the same grain if centres are closer than the first fraction of the smaller
# radius and radii differ by less than the second.
_SAME = 0.5, 0.3
# Gaps fit up to this many mean radii, and radii within this fraction are of one size.
_FIT, _SIZE = 0.5, 0.05
# A force this many times the usual one was not measured: extra digits, or a lost exponent.
HUGE = 1e6
# A force at the edge of its cone exceeds it by no more than this fraction.
_ROUNDING = 1e-9


class Finding(NamedTuple):
    """One error."""

    kind: str  # one of KINDS
    text: str  # in words, with file and line
    x: float  # its place, NaN if unknown
    y: float


class Account(NamedTuple):
    """The findings in a frame, in the order of the checks."""

    findings: list[Finding]
    strict: bool  # whether the first finding is raised as an error
    most: float  # largest fraction of grains and of contacts to repair

    def note(self, kind: str, texts: Sequence[str], places: Floats) -> None:
        """Record findings of a kind, places (k, 2). If strict, errors raise InputError."""
        if self.strict and texts and KINDS[kind].is_error:
            raise InputError(f"{texts[0]}; correct or remove the line, or read it with repair")
        for text, (x, y) in zip(texts, places, strict=True):
            self.findings.append(Finding(kind, text, float(x), float(y)))

    def of(self, kind: str) -> list[Finding]:
        """The findings of one kind."""
        return [one for one in self.findings if one.kind == kind]

    @property
    def counts(self) -> dict[str, int]:
        """{kind: number of findings}, of all kinds."""
        return {kind: len(self.of(kind)) for kind in KINDS}

    def check(self, grains: int, contacts: int) -> None:
        """InputError if too many of these grains and contacts were repaired."""
        for count, what in ((grains, "grains"), (contacts, "contacts")):
            concerned = {
                name: kind
                for name, kind in KINDS.items()
                if kind.repaired and kind.of_grains == (what == "grains")
            }
            spoilt = [one for one in self.findings if one.kind in concerned]
            if len(spoilt) > self.most * count and not self.strict:
                kinds = ", ".join(
                    f"{kind.words} ({len(self.of(name))})"
                    for name, kind in concerned.items()
                    if self.of(name)
                )
                raise InputError(
                    f"{len(spoilt)} of {count} {what} would have to be repaired, more than "
                    f"{self.most:.0%}: {kinds}; the first: {spoilt[0].text}; check units, columns "
                    "and that both files are of one frame"
                )


def repaired(listing: Listing, mu: float, repair: bool = True) -> tuple[Listing, Account, str]:
    """The repaired Listing: each contact is between two existing grains or with a wall.

    repair: True, False (the first error is raised), or the largest fraction of the data to repair.
    Returns it with the Account and a description of any change of ids ("" if none).
    """
    most = MOST if repair is True else float(repair)
    if not 0 <= most <= 1:
        raise InputError(f"repair must be a fraction of the data, from 0 to 1, got {repair}")
    account = Account([], repair is False, most)
    whole = len(listing.ids), len(listing.ends)
    listing, note = _named(listing, account)
    for step in (
        _without_unreadable_grains,
        _without_doubled_names,
        _without_false_detections,
        _without_unreadable_contacts,
        _without_missing_grains,
        _without_long_contacts,
        _without_tension,
    ):
        listing = step(listing, account)
        account.check(*whole)
    _note_friction(listing, account, mu)
    if not np.any(np.all(listing.ends >= 0, axis=1)):
        raise InputError(f"{listing.names[1]}: no contact between two grains")
    return listing, account, note


def _named(listing: Listing, account: Account) -> tuple[Listing, str]:
    """The listing with ids under which contacts join neighbours, and a description of the change.

    If the ids of one file were reassigned (by tracking, say), contacts may still count the grains
    of the frame in some order; the order is accepted if contacts then join neighbours.
    """
    needed = 1 - account.most
    share = listing.fit
    readable = np.mean(np.isfinite(listing.r) & (listing.r > 0)) if len(listing.r) else 0.0
    if account.strict or share >= needed or readable < needed:
        return listing, ""
    for words, first, other in listing.renumbered():
        if other.fit >= needed:
            return other, (
                f"the ids of {listing.names[1]} are not those of {listing.names[0]}: they count "
                f"its grains {words}, from {first}; taken so, {other.fit:.0%} of the contacts join "
                f"neighbours (by their names {share:.0%})"
            )
    raise InputError(_strangers(listing, share))


def _strangers(listing: Listing, share: float) -> str:
    """Why ids and positions do not belong together, and what to do."""
    rows = listing.rows
    gap, radius = listing.gaps, listing.mean_radius
    absent = np.flatnonzero((rows == -2).any(axis=1))
    words = f"only {share:.0%} of the contacts in {listing.names[1]} join neighbours"
    if len(absent):
        row = absent[0]
        named = listing.ends[row][rows[row] == -2][0]
        words += f"; {len(absent)} name missing grains ({plain(named)}, the first)"
    if np.isfinite(gap).any():
        words += f"; the median gap is {np.nanmedian(gap) / radius:.3g} mean radii"
        i, j = rows[np.isfinite(gap)].T
        ratio = (gap[np.isfinite(gap)] / (listing.r[i] + listing.r[j])) + 1
        low, middle, high = np.quantile(ratio, [0.25, 0.5, 0.75])
        if middle > 1.3 and high - low < 0.2 * middle:
            words += (
                f", but distances are {middle:.3g} times the radii: try a scale of {middle:.3g}"
            )
    return (
        f"{words}; no order of the grains in {listing.names[0]} fits either; check that both files "
        "are of one frame and one tracking, and the unit of the radii"
    )


def _without_unreadable_grains(listing: Listing, account: Account) -> Listing:
    fields = np.column_stack([listing.ids, listing.x, listing.r])
    bad = ~np.isfinite(fields).all(axis=1) | ~(listing.r > 0)
    texts = [
        f"{listing.place(0, k)}: "
        + (
            f"radius {listing.r[k]:g} is not positive"
            if np.isfinite(fields[k]).all()
            else "id, x, y or radius is not a finite number"
        )
        for k in np.flatnonzero(bad)
    ]
    account.note("unreadable_grains", texts, listing.x[bad])
    return listing.with_grains(np.flatnonzero(~bad))


def _without_doubled_names(listing: Listing, account: Account) -> Listing:
    """Keep the first of several lines with the same id."""
    _, first, which = np.unique(listing.ids, return_index=True, return_inverse=True)
    repeats = np.flatnonzero(first[which] != np.arange(len(which)))
    texts = [
        f"{listing.place(0, k)}: id {plain(listing.ids[k])} already appears in line "
        f"{int(listing.lines[0][first[which[k]]])}"
        for k in repeats
    ]
    account.note("doubled_grains", texts, listing.x[repeats])
    return listing.with_grains(np.sort(first))


def _without_false_detections(listing: Listing, account: Account) -> Listing:
    """Of two disks in one place, keep the one that fits more contacts and sizes."""
    x, r, ids = listing.x, listing.r, listing.ids
    if not len(r):
        return listing
    check_disks(x, r, OPEN, lambda g: listing.place(0, g), np.inf)
    i, j, gap = overlapping(x, r, OPEN)
    deep = np.flatnonzero(-gap > OVERLAP * np.minimum(r[i], r[j]))
    fit = _fits(listing) if len(deep) else np.zeros(len(r))
    dropped, ends = {}, listing.ends.copy()
    for c in deep[np.argsort(gap[deep], kind="stable")]:
        a, b = int(i[c]), int(j[c])
        if a in dropped or b in dropped:
            continue
        false, true = (a, b) if (fit[a], r[a]) < (fit[b], r[b]) else (b, a)
        small, large = sorted((r[a], r[b]))
        near = np.hypot(*(x[a] - x[b])) < _SAME[0] * small
        kind = "doubled_grains" if near and large - small < _SAME[1] * large else "false_detections"
        dropped[false] = kind, true, -gap[c]
        if kind == "doubled_grains":
            ends[ends == ids[false]] = ids[true]
    for kind in ("doubled_grains", "false_detections"):
        those = [g for g in sorted(dropped) if dropped[g][0] == kind]
        texts = [
            f"{listing.place(0, g)}: grains {plain(ids[g])} and {plain(ids[dropped[g][1]])} "
            f"overlap by {dropped[g][2]:.3g}, more than {OVERLAP:.0%} of a radius"
            for g in those
        ]
        account.note(kind, texts, x[those])
    rows = np.setdiff1d(np.arange(len(r)), list(dropped))
    return listing._replace(ends=ends).with_grains(rows)


def _fits(listing: Listing) -> Floats:
    """(N,) fit of each grain: contacts with a usual gap count 1, others down to −1.

    An unusual radius subtracts up to 2.
    """
    rows = listing.rows
    gap = listing.gaps
    finite = np.isfinite(gap)
    off = np.abs(gap[finite] - np.median(gap[finite]) if finite.any() else gap[finite])
    value = np.clip(1 - off / (_FIT * listing.r.mean()), -1, 1)
    fit = np.zeros(len(listing.r))
    for side in rows[finite].T:
        np.add.at(fit, side, value)
    order = np.sort(listing.r)
    alike = np.searchsorted(order, listing.r * (1 + _SIZE)) - np.searchsorted(
        order, listing.r * (1 - _SIZE)
    )
    return fit + 2 * alike / alike.max()


def _without_unreadable_contacts(listing: Listing, account: Account) -> Listing:
    """Drop lines without two ids; forces that are not numbers count as not measured."""
    named = np.all(np.isfinite(listing.ends), axis=1)
    finite = np.all(np.isfinite(listing.forces), axis=1)
    size = np.abs(np.where(finite[:, None], listing.forces, 0.0)).max(axis=1, initial=0.0)
    usual = np.median(size[size > 0]) if np.any(size > 0) else np.inf
    readable = finite & (size <= HUGE * usual)
    bad = np.flatnonzero(~(named & readable))
    texts = [
        f"{listing.place(1, k)}: "
        + (
            f"a force of {size[k]:.3g}, where {usual:.3g} is usual"
            if named[k] and finite[k]
            else "a name or a force is not a finite number"
        )
        for k in bad
    ]
    account.note("unreadable_contacts", texts, _places(listing, bad))
    forces = np.where(readable[:, None], listing.forces, np.nan)
    return listing._replace(forces=forces).with_contacts(np.flatnonzero(named))


def _without_missing_grains(listing: Listing, account: Account) -> Listing:
    loops = np.flatnonzero(listing.ends[:, 0] == listing.ends[:, 1])
    texts = [f"{listing.place(1, k)}: the grain touches itself" for k in loops]
    account.note("contacts_with_themselves", texts, _places(listing, loops))
    listing = listing.with_contacts(np.setdiff1d(np.arange(len(listing.ends)), loops))
    rows = listing.rows
    bad = np.flatnonzero((rows == -2).any(axis=1) | (rows < 0).all(axis=1))
    texts = []
    for k in bad:
        named = listing.ends[k][rows[k] < 0][0]
        texts.append(
            f"{listing.place(1, k)}: grain {plain(named)} is not among the grains"
            if named >= 0
            else f"{listing.place(1, k)}: the contact joins no grain"
        )
    account.note("contacts_of_missing_grains", texts, _places(listing, bad))
    return listing.with_contacts(np.setdiff1d(np.arange(len(rows)), bad))


def _without_long_contacts(listing: Listing, account: Account) -> Listing:
    rows = listing.rows
    gap = listing.gaps
    with np.errstate(invalid="ignore"):
        bad = np.flatnonzero(gap > FAR * listing.r.mean())
    texts = [
        f"{listing.place(1, k)}: grains {plain(listing.ends[k, 0])} and "
        f"{plain(listing.ends[k, 1])} are {gap[k] / listing.r.mean():.3g} mean radii apart"
        for k in bad
    ]
    account.note("contacts_too_long", texts, _places(listing, bad))
    return listing.with_contacts(np.setdiff1d(np.arange(len(rows)), bad))


def _without_tension(listing: Listing, account: Account) -> Listing:
    """Dry grains only press: a negative normal force is a bad fit and counts as not measured."""
    bad = np.flatnonzero(listing.forces[:, 0] < 0)
    texts = [f"{listing.place(1, k)}: f_n = {listing.forces[k, 0]:.3g} pulls" for k in bad]
    account.note("negative_normal_forces", texts, _places(listing, bad))
    if account.strict:
        return listing
    forces = listing.forces.copy()
    forces[bad] = np.nan
    return listing._replace(forces=forces)


def _note_friction(listing: Listing, account: Account, mu: float) -> None:
    normal, tangential = listing.forces.T
    with np.errstate(invalid="ignore"):
        beyond = np.abs(tangential) > mu * normal * (1 + _ROUNDING)
        bad = np.flatnonzero(beyond & (normal >= 0))
    texts = [
        f"{listing.place(1, k)}: |f_t| = {abs(tangential[k]):.3g}, more than μ f_n = "
        f"{mu * normal[k]:.3g}"
        for k in bad
    ]
    account.note("beyond_friction", texts, _places(listing, bad))


def _places(listing: Listing, contacts: Integers) -> Floats:
    """(k, 2) places of contacts: between their grains, or at the only existing one."""
    rows = listing.rows[contacts]
    listed = rows >= 0
    x = np.where(listed[..., None], listing.x[np.where(listed, rows, 0)], np.nan)
    with np.errstate(invalid="ignore"):
        count = listed.sum(axis=1)[:, None]
        return np.where(count, np.nansum(x, axis=1) / np.maximum(count, 1), np.nan)
