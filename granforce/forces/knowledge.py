"""Known bounds on single contact forces, in addition to balance and Coulomb's law.

Bounds on f_n and f_t of a contact cut its cone down to a small convex polygon. A component whose
bounds coincide is *pinned*; every other bound is a *side*.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from scipy import sparse

from granforce.fields import record
from granforce.numerics import certificates
from granforce.numerics import highs as programs
from granforce.records import Contacts, InputError, NotJammedError, are_whole, real_array
from granforce.tolerances import ADMISSIBLE, BALANCED, FLAT, REVERSED, ROUNDING
from granforce.types import Floats, Integers, Mask

_NAMES = "f_n", "f_t"
# Least multiplier of a condition that takes part in a conflict, relative to the largest.
_WEIGHTY = 1e-6


@record
class Known(NamedTuple):
    """Bounds on the forces of k contacts: low ≤ (f_n, f_t) ≤ high, or on f_n alone; see `sides`."""

    contacts: Annotated[Integers, "(k,) numbers in the packing"]
    low: Annotated[
        Floats,
        "(k, 2) force, or (k,) or one number for f_n alone; −inf, or left out, where nothing is "
        "known",
    ] = np.array(-np.inf)
    high: Annotated[Floats, "the same, inf where nothing is known; low for an exact value"] = (
        np.array(np.inf)
    )
    grains: Annotated[
        Integers | None, "(k, 2) that these contacts should join; None: not checked"
    ] = None

    @property
    def sides(self) -> tuple[Floats, Floats]:
        """low and high as (k, 2); ValueError or TypeError for other shapes."""
        low, high = (
            _both(side, np.size(self.contacts), unknown)
            for side, unknown in ((self.low, -np.inf), (self.high, np.inf))
        )
        return low, high


def _both(side: Floats, count: int, unknown: float) -> Floats:
    """Bounds (count, 2) of those given, which are (count, 2) or bounds of f_n alone."""
    given = real_array(side, "bounds")
    if given.shape == (2,) and count == 1:  # of the only contact
        given = given[None]
    if given.ndim == 0:
        given = np.full(count, given)
    if given.ndim == 1:
        given = np.column_stack([given, np.full(len(given), unknown)])
    if given.shape != (count, 2):
        raise ValueError
    return given


class Polygons(NamedTuple):
    """Known forces of the N_c contacts of an ensemble, in ⟨f_n⟩."""

    low: Floats  # (N_c, 2) as given, for `violation`
    high: Floats  # (N_c, 2)
    pinned: Mask  # (N_c, 2) bool
    value: Floats  # (N_c, 2) pinned values, 0 elsewhere
    contact: Integers  # (sides,) contact of each side
    component: Integers  # (sides,) 0 for f_n, 1 for f_t
    sign: Floats  # (sides,) 1 for a bound from above, −1 from below
    limit: Floats  # (sides,) sign · f ≤ limit

    @property
    def wholly(self) -> Mask:
        """(N_c,) bool: contacts with both components pinned."""
        return np.all(self.pinned, axis=1)


def refuse_others(known: Known, contacts: Contacts) -> None:
    """InputError if known contacts, if they exist, join other grains than they should."""
    if known.grains is None:
        return
    number = np.asarray(known.contacts)
    exists = number < len(contacts.i)
    joined = np.column_stack([contacts.i, contacts.j])[number[exists]]
    if not np.array_equal(known.grains[exists], joined):
        raise InputError(
            "a table of known forces names other grains of its contacts; does it belong to another "
            "packing?"
        )


def bounds_of(known: Known | None, count: int) -> Floats:
    """Bounds (count, 2, 2) [contact, component, low or high] of all contacts, force.

    known: a Known. Several bounds on one contact are combined. Raises InputError for
    contacts that do not exist, bounds of another shape or NaN, and low > high beyond rounding.
    """
    try:
        if not isinstance(known, Known):
            raise TypeError
        contacts = np.atleast_1d(real_array(known.contacts, "contacts"))
        if contacts.ndim > 1:
            raise TypeError
        low, high = known.sides
    except (TypeError, ValueError):
        raise InputError(
            "known must be Known(contacts, low, high): contact numbers (k,), and bounds (k, 2) on "
            "f_n and f_t or (k,) on f_n alone, as in gf.Known([13], [0.05], [0.05])"
        ) from None
    valid = are_whole(contacts, count - 1)
    if not valid.all():
        first = contacts[~valid][0]
        raise InputError(
            f"known contact {first:g} does not exist; the packing's contacts are 0 … {count - 1}"
        )
    contacts = contacts.astype(np.int64)
    if np.isnan(low).any() or np.isnan(high).any():
        raise InputError(
            "a bound is NaN; use −inf and inf for unknown bounds, or give bounds (k,) on f_n alone"
        )
    bounds = np.empty((count, 2, 2))
    bounds[..., 0], bounds[..., 1] = -np.inf, np.inf
    np.maximum.at(bounds[..., 0], contacts, low)
    np.minimum.at(bounds[..., 1], contacts, high)
    bounds[..., 0], bounds[..., 1] = ordered(bounds[..., 0], bounds[..., 1])
    wrong = np.argwhere((bounds[..., 0] > bounds[..., 1]) | (bounds[..., 0] == np.inf))
    wrong = wrong if len(wrong) else np.argwhere(bounds[..., 1] == -np.inf)
    if len(wrong):
        c, k = wrong[0]
        raise InputError(
            f"the bounds on {_NAMES[k]} of contact {c} are contradictory: at least "
            f"{bounds[c, k, 0]:.6g}, at most {bounds[c, k, 1]:.6g}"
        )
    return bounds


def ordered(low: Floats, high: Floats, apart: float = 0.0) -> tuple[Floats, Floats]:
    """Bounds (…) with both at their midpoint where low exceeds high by up to REVERSED.

    Also where they are up to `apart` from each other; both relative to the largest finite bound.
    """
    both = np.concatenate([low.ravel(), high.ravel()])
    largest = np.abs(both[np.isfinite(both)]).max(initial=0.0)
    with np.errstate(invalid="ignore"):
        over = low - high
    rounded = (-apart * largest <= over) & (over <= REVERSED * largest)
    middle = 0.5 * (low[rounded] + high[rounded])
    low, high = low.copy(), high.copy()
    low[rounded] = high[rounded] = middle
    return low, high


def polygons(bounds: Floats, mu: Floats, scale: float, index: Integers) -> Polygons | None:
    """The Polygons of bounds (N_c, 2, 2), force; None if there are no bounds.

    mu (N_c,): slopes of the cones. scale: ⟨f_n⟩. index (N_c,): numbers of the contacts, for
    messages. Raises NotJammedError if the bounds on one contact conflict with Coulomb's law.
    """
    if not np.isfinite(bounds).any():
        return None
    low, high = bounds[..., 0] / scale, bounds[..., 1] / scale
    least, most = low.copy(), high.copy()
    least[:, 0] = np.maximum(least[:, 0], 0.0)
    # Coulomb's law tightens a contact's bounds: the smallest |f_t| requires its f_n.
    smallest = np.maximum(0.0, np.maximum(least[:, 1], -most[:, 1]))
    rough = mu > 0
    needed = np.where(smallest > ADMISSIBLE, np.inf, 0.0)
    needed[rough] = smallest[rough] / mu[rough]
    # Admissible forces may exceed their cone by ADMISSIBLE in f_n or in f_t.
    over = needed - most[:, 0] > ADMISSIBLE / np.where(rough, np.minimum(mu, 1.0), 1.0)
    over |= least[:, 0] - most[:, 0] > ADMISSIBLE
    least[:, 0] = np.maximum(least[:, 0], needed)
    short = least[:, 0] - most[:, 0]
    if np.any(over):
        c = int(np.argmax(np.where(over, short, -np.inf)))
        raise NotJammedError(_beyond_coulomb(index[c], bounds[c], mu[c], short[c] * scale))
    pinned, value = np.zeros(low.shape, dtype=bool), np.zeros(low.shape)
    pinned[:, 0] = most[:, 0] - least[:, 0] <= FLAT
    value[pinned[:, 0], 0] = np.maximum(most[pinned[:, 0], 0], 0.0)
    cone = np.zeros(len(low))
    cone[rough] = mu[rough] * np.where(pinned[:, 0], value[:, 0], most[:, 0])[rough]
    least[:, 1], most[:, 1] = np.maximum(least[:, 1], -cone), np.minimum(most[:, 1], cone)
    pinned[:, 1] = most[:, 1] - least[:, 1] <= FLAT * mu
    pinned[:, 1] &= rough | pinned[:, 0]
    fixed = pinned[:, 1] & rough
    value[fixed, 1] = 0.5 * (least[fixed, 1] + most[fixed, 1])
    # Forces given exactly keep their balance even if they are outside their cone by more than
    # rounding.
    exactly = (low == high) & pinned & rough[:, None] & (np.abs(low - value) > ROUNDING)
    value[exactly] = low[exactly]
    slid = np.abs(value[:, 1]) / np.where(rough, mu, np.inf)
    bounded = np.zeros((*low.shape, 2), dtype=bool)  # [contact, component, low or high]
    bounded[:, 0, 0] = low[:, 0] > np.where(pinned[:, 1], slid, 0.0)
    bounded[:, 0, 1] = np.isfinite(high[:, 0])
    bounded[:, 1, 0], bounded[:, 1, 1] = low[:, 1] > -cone, high[:, 1] < cone
    bounded[:, 1] &= rough[:, None]
    bounded &= ~pinned[..., None]
    contact, component, above = np.nonzero(bounded)
    sign = np.where(above, 1.0, -1.0)
    limit = sign * np.stack([low, high], axis=-1)[contact, component, above]
    return Polygons(low, high, pinned, value, contact, component, sign, limit)


def _beyond_coulomb(contact: int, bounds: Floats, mu: float, short: Floats) -> str:
    (_, high), (t_low, t_high) = bounds
    if high < 0:
        return (
            f"no network satisfies the bounds on contact {contact}: f_n ≤ {high:.6g}, but "
            f"contacts can only press; the bound must be relaxed by {-high:.3g}"
        )
    tangential = f"f_t ≥ {t_low:.6g}" if t_low > 0 else f"f_t ≤ {t_high:.6g}"
    if mu == 0:
        return (
            f"no network satisfies the bounds on contact {contact}: {tangential}, but f_t is 0 "
            f"where μ is 0; the bound must be relaxed by {max(t_low, -t_high):.3g}"
        )
    return (
        f"no network satisfies the bounds on contact {contact}: f_n ≤ {high:.6g} and "
        f"{tangential} contradict Coulomb's law at μ = {mu:g}; the bound on f_n must be relaxed by "
        f"{short:.3g}"
    )


def first_forces(known: Polygons, mu: Floats) -> Floats:
    """Forces (N_c, 2) to start programs from, f_t in units of μ ⟨f_n⟩.

    Pinned components are at their values, inside the cone; fully known contacts stay at (1, 0)
    instead, as their force may lie on the cone.
    """
    unit = units(mu)
    low, high, value = known.low / unit, known.high / unit, known.value / unit
    both = np.isfinite(low) & np.isfinite(high)
    with np.errstate(invalid="ignore"):
        middle = np.where(both, 0.5 * (low + high), np.clip([1.0, 0.0], low, high))
    first = np.where(known.pinned, value, middle)
    free_n, free_t = ~known.pinned.T
    first[free_n, 0] = np.maximum(first[free_n, 0], 0.1)
    inside = 0.5 * first[:, 0]
    first[free_t, 1] = np.clip(first[free_t, 1], -inside[free_t], inside[free_t])
    stuck = free_n & ~free_t
    first[stuck, 0] = np.maximum(first[stuck, 0], np.abs(first[stuck, 1]) + 0.5)
    first[known.wholly] = 1.0, 0.0
    return first


def units(mu: Floats) -> Floats:
    """Units (N_c, 2) of f_n and f_t in programs, in ⟨f_n⟩, of cones of slopes (N_c,)."""
    return np.column_stack([np.ones(len(mu)), np.where(mu > 0, mu, 1.0)])


def extended(
    A: sparse.csr_matrix,
    b: Floats,
    T: sparse.csc_matrix,
    known: Polygons,
    mu: Floats,
    value: Floats,
) -> tuple[sparse.csc_matrix, Floats, sparse.csc_matrix]:
    """A y = b with rows and slacks of known bounds: (A, b, T) in y and the slacks of the sides.

    A (rows, n) and T (unknowns, n) in cone coordinates y, T y being forces in ⟨f_n⟩; value (N_c,
    2): pinned components. Rows of sides and then of pinned components, in units of the programs.
    """
    parts, T, unit = T.shape[0] // len(known.pinned), sparse.csr_matrix(T), units(mu)
    at, size = parts * known.contact + known.component, unit[known.contact, known.component]
    bounds = sparse.diags(known.sign / size) @ T[at]
    contact, component = pins(known, mu)
    held = sparse.diags(1 / unit[contact, component]) @ T[parts * contact + component]
    sides = len(at)
    empty = sparse.csr_matrix((A.shape[0], sides)), sparse.csr_matrix((len(contact), sides))
    whole = sparse.vstack(
        [
            sparse.hstack([sparse.csr_matrix(A), empty[0]]),
            sparse.hstack([bounds, sparse.identity(sides)]),
            sparse.hstack([held, empty[1]]),
        ],
        format="csc",
    )
    right = [b, known.limit / size, value[contact, component] / unit[contact, component]]
    T = sparse.hstack([T, sparse.csr_matrix((T.shape[0], sides))], format="csc")
    return whole, np.concatenate(right), T


def pins(known: Polygons, mu: Floats) -> tuple[Integers, Integers]:
    """Contact and component of each pinned unknown; without friction, f_t is not an unknown."""
    contact, component = np.nonzero(known.pinned[:, : 2 if mu.any() else 1])
    return contact, component


def contradiction(
    A: sparse.csr_matrix,
    b: Floats,
    T: sparse.csc_matrix,
    known: Polygons,
    mu: Floats,
    index: Integers,
    scale: float,
    slack: Floats,
    friction: Floats,
) -> str | None:
    """The message that names the conflicting conditions, with proof; None if no conflict was found.

    A, b, T: `Ensemble.scaled_form` without what is known; scale: ⟨f_n⟩; slack:
    `Ensemble.slack`; friction (N_c,): `Ensemble.friction`. The conditions named are those with a
    multiplier in the program that minimises the total relaxation.
    """
    whole, right, _ = extended(A, b, T, known, mu, known.value)
    (rows, n), sides = A.shape, len(known.contact)
    count = len(right) - rows
    # Sides are relaxed upwards, pinned components both ways.
    give = sparse.vstack([sparse.csr_matrix((rows, count)), sparse.identity(count)], format="csc")
    relaxed = sparse.hstack([whole, -give, give[:, sides:]], format="csc")
    cost = np.append(np.zeros(n + sides), np.ones(relaxed.shape[1] - n - sides))
    model = programs.standard_form(relaxed, right)
    programs.set_cost(model, cost)
    for status, y in programs.solutions(model):
        if status != programs.OPTIMAL:
            continue
        multiplier = programs.multipliers(model, relaxed, cost)
        if certificates.proves_empty(whole, right, multiplier, slack):
            given = y[n + sides :][:count]
            given[sides:] += y[n + sides + count :]
            return _statements(known, mu, index, scale, multiplier[rows:], given, friction)
        if y[n + sides :].sum() <= BALANCED:
            return None
    return None


def _statements(
    known: Polygons,
    mu: Floats,
    index: Integers,
    scale: float,
    multiplier: Floats,
    given: Floats,
    friction: Floats,
) -> str:
    """The conditions with a multiplier, largest first, and the necessary relaxation."""
    contact, component = pins(known, mu)
    contact = np.append(known.contact, contact)
    component = np.append(known.component, component)
    value = np.append(known.sign * known.limit, known.value[pins(known, mu)]) * scale
    relation = ["≤" if sign > 0 else "≥" for sign in known.sign]
    relation += ["="] * (len(contact) - len(relation))
    size = np.abs(multiplier) / np.abs(multiplier).max()
    given = given * units(mu)[contact, component] * scale
    named = [k for k in np.argsort(-size, kind="stable") if size[k] > _WEIGHTY]
    texts = []
    for k in named:
        text = f"{_NAMES[component[k]]} {relation[k]} {value[k]:.6g} on contact {index[contact[k]]}"
        if given[k] > BALANCED * scale:
            text += f" (must be relaxed by {given[k]:.3g})"
        texts.append(text)
    smooth = any(component[k] == 1 and friction[contact[k]] == 0 for k in named)
    frictionless = ", and f_t = 0 where μ is 0" if smooth else ""
    return (
        f"no network satisfies all known forces{frictionless}; these conflict: {'; '.join(texts)}"
    )
