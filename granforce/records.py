"""The records that the parts of granforce hand to each other: named tuples of arrays.

Units: length = largest radius, pressure = P0, mass density = 1; nothing depends on them except by
scaling, so any consistent units will do for packings from elsewhere.
Signs: **n** points from grain i to grain j, **t** = (−n_y, n_x); the force on j from i is
f_n n + f_t t, and f_n ≥ 0 presses.
"""

import os
from typing import NamedTuple

import numpy as np

from granforce import notebook
from granforce.tolerances import LARGEST_UNIT, MU_DIGITS, RIGID_OVERLAP

# Whole numbers up to here are exact in kernels, in JSON and in floats alike.
LARGEST_WHOLE = 2**53


class InputError(ValueError):
    """What was given cannot be used; the message says what is wrong and what to do."""


class NotJammedError(InputError):
    """No admissible force network exists, or none was reached within the budget."""


class UndecidedError(InputError):
    """Solvers reached no result that could be checked: nothing is known either way."""


class Cancelled(Exception):
    """The work was cancelled on request; nothing was kept of the unit under way."""


class Contacts(NamedTuple):
    """Geometry of N_c contacts."""

    i: np.ndarray  # (N_c,) int64, first grain
    j: np.ndarray  # (N_c,) int64, second grain
    normal: np.ndarray  # (N_c, 2) unit vector n from i to j
    length: np.ndarray  # (N_c,) centre distance ℓ
    gap: np.ndarray  # (N_c,) ℓ − r_i − r_j, negative where grains overlap
    arm_i: np.ndarray  # (N_c,) lever arm a_i from the centre of i to the contact point
    arm_j: np.ndarray  # (N_c,) lever arm a_j


class Packing(NamedTuple):
    """N disks, their contacts, and one force network on them."""

    x: np.ndarray  # (N, 2) centres, length
    r: np.ndarray  # (N,) radii, length
    box: np.ndarray  # (2,) sides L_x, L_y of the periodic box; inf in an open direction
    contacts: Contacts
    forces: np.ndarray  # (N_c, 2) f_n, f_t of the packing's own ("original") network, force
    mu: float  # friction coefficient μ
    pressure: float  # P0, force per length; nan where no pressure is prescribed
    load: (
        np.ndarray
    )  # (N, 3) external force and torque on each grain; NaN: its balance is left open
    info: dict  # how it was made: seed, steps, skipped work, … (plain numbers and strings)

    @property
    def volume(self):
        """Area V of the box (length², infinite if open)."""
        return float(np.prod(self.box))

    @property
    def packing_fraction(self):
        """φ = Σ π r² / V, rattlers included."""
        return float(np.pi * np.sum(self.r**2) / self.volume)

    def _repr_svg_(self):
        """The packing as notebooks show it."""
        return notebook.packing_svg(self)


class Relaxation(NamedTuple):
    """What a relaxation solver reached."""

    forces: np.ndarray  # (N_c, 2)
    iterations: int  # sweeps or iterations used
    residual: float  # unbalance in ⟨f_n⟩, by Ensemble.residual
    violation: float  # cone violation in ⟨f_n⟩, by Ensemble.violation
    converged: bool  # the solver's own iteration ended (at rest or in steady motion)
    seconds: float  # wall time


def float_array(values, shape, name):
    """Cast to a contiguous float64 array of the given shape (−1: any) and check it is finite.

    Raises InputError naming the array.
    """
    try:
        array = np.array(values, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise InputError(f"{name} must be numbers of shape {shape}") from None
    if array.ndim != len(shape) or any(
        want not in (-1, have) for want, have in zip(shape, array.shape, strict=True)
    ):
        raise InputError(f"{name} must have shape {shape}, got {array.shape}")
    if not np.all(np.isfinite(array)):
        raise InputError(f"{name} holds NaN or infinite values; remove or repair them")
    return array


def friction(mu):
    """μ as a float on the storage grid (9 significant digits); InputError unless finite and ≥ 0."""
    try:
        value = float(mu)
    except (TypeError, ValueError):
        raise InputError(f"friction coefficient must be a number, got {mu!r}") from None
    if not np.isfinite(value) or value < 0:
        raise InputError(f"friction coefficient must be finite and ≥ 0, got {mu}")
    return float(f"{value:.{MU_DIGITS}g}")


def positive(value, name):
    """The value as a finite float > 0; InputError otherwise."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be a number, got {value!r}") from None
    if not np.isfinite(number) or number <= 0:
        raise InputError(f"{name} must be finite and > 0, got {value}")
    return number


def whole(value, name, least=0, most=LARGEST_WHOLE):
    """The value as an int from least to most (None: any size); InputError otherwise."""
    try:
        number = int(value)
        exact = number == value
    except (TypeError, ValueError, OverflowError):
        exact = False
    if not exact:
        raise InputError(f"{name} must be a whole number, got {value!r:.40}")
    if number < least:
        raise InputError(f"{name} must be at least {least}, got {value!r:.40}")
    if most is not None and number > most:
        raise InputError(f"{name} must be at most {most}, got {value!r:.40}")
    return number


def are_whole(values, most=LARGEST_WHOLE):
    """Mask of values (…) that are whole numbers from 0 to `most`: those that a cast to int keeps.

    To be asked before every cast: what int64 cannot hold becomes another number in silence.
    """
    values = np.asarray(values)
    try:
        with np.errstate(invalid="ignore"):
            return (values >= 0) & (values <= most) & (values % 1 == 0)
    except TypeError:  # no numbers at all
        return np.zeros(values.shape, dtype=bool)


def random_seed(value, name="seed"):
    """The value as an int ≥ 0 of any size; InputError otherwise."""
    return whole(value, name, most=None)


def check_memory(needed, what):
    """InputError where what needs more bytes than this machine has memory."""
    try:
        there = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return  # not told by this system: an allocation will fail instead
    if needed > there:
        raise InputError(
            f"{what} would need {min(needed, 1e300) / 1e9:.3g} GB of memory, and this machine has "
            f"{there / 1e9:.3g} GB; ask for less"
        )


def moderate(value, name):
    """The value as a float > 0 whose powers stay finite; InputError otherwise."""
    number = positive(value, name)
    if not 1 / LARGEST_UNIT <= number <= LARGEST_UNIT:
        raise InputError(
            f"{name} must lie between {1 / LARGEST_UNIT:g} and {LARGEST_UNIT:g}, got {number:g}; "
            "choose another unit"
        )
    return number


def make_contacts(i, j, normal, length, r):
    """Contacts from array-likes, cast once: grains i, j and centre distances (N_c,), normals.

    Lever arms are the radii r where no contact overlaps by more than RIGID_OVERLAP (rigid disks),
    and reach the middle of the overlap, a = r − overlap/2, otherwise (soft disks).

    Raises InputError for grain numbers outside 0 … N − 1, self-contacts, normals that are not unit
    vectors, or distances ≤ 0.
    """
    i, j = np.asarray(i), np.asarray(j)
    if i.ndim != 1 or i.shape != j.shape:
        raise InputError(f"contact lists i and j differ in shape: {i.shape} and {j.shape}")
    count = len(i)
    if not all(are_whole(k, len(r) - 1).all() for k in (i, j)):
        raise InputError(f"a contact names a grain outside 0 … {len(r) - 1}")
    i, j = (np.ascontiguousarray(k, dtype=np.int64) for k in (i, j))
    if np.any(i == j):
        raise InputError(f"contact {int(np.argmax(i == j))} joins a grain with itself")
    normal = float_array(normal, (count, 2), "contact normals")
    norm = np.hypot(normal[:, 0], normal[:, 1])
    if np.any(np.abs(norm - 1) > 1e-6):
        raise InputError("contact normals must be unit vectors")
    length = float_array(length, (count,), "centre distances")
    if np.any(length <= 0):
        raise InputError(f"contact {int(np.argmax(length <= 0))} has centre distance ≤ 0")
    gap = length - r[i] - r[j]
    soft = count > 0 and gap.min() < -RIGID_OVERLAP * r.max()
    inward = gap / 2 if soft else np.zeros(count)
    return Contacts(i, j, normal / norm[:, None], length, gap, r[i] + inward, r[j] + inward)


def make_packing(x, r, box, contacts, forces, mu, pressure=np.nan, load=None, info=None):
    """A Packing from array-likes, cast and validated once; see the fields of Packing.

    Raises InputError for wrong shapes, non-finite numbers, radii ≤ 0, a contact given twice, or box
    sides not above the largest diameter (a grain may not touch its own image).
    """
    r = float_array(r, (-1,), "radii")
    if np.any(r <= 0):
        raise InputError(f"radius of grain {int(np.argmax(r <= 0))} is not positive")
    x = float_array(x, (len(r), 2), "centres")
    box = np.array(box, dtype=np.float64)
    if box.shape != (2,) or np.any(np.isnan(box)) or np.any(box <= 2 * r.max(initial=0)):
        raise InputError(f"box sides must be two numbers above the largest diameter, got {box}")
    load = np.zeros((len(r), 3)) if load is None else _loads(load, len(r))
    if not np.isnan(pressure):
        pressure = moderate(pressure, "pressure")
    forces = float_array(forces, (len(contacts.i), 2), "forces")
    _check_repeated(contacts)
    return Packing(
        x, r, box, contacts, forces, friction(mu), float(pressure), load, dict(info or {})
    )


def _loads(load, count):
    """Loads (N, 3) whose rows are finite, or NaN as a whole."""
    load = np.array(load, dtype=np.float64, order="C")
    left_open = np.isnan(load).all(axis=-1) if load.ndim == 2 else np.zeros(len(load), dtype=bool)
    float_array(np.where(left_open[..., None], 0.0, load), (count, 3), "loads")
    return load


def _check_repeated(contacts):
    """Two grains touch twice only through different images, whose normals differ by 60° or more."""
    low, high = np.minimum(contacts.i, contacts.j), np.maximum(contacts.i, contacts.j)
    normal = np.where((contacts.i > contacts.j)[:, None], -contacts.normal, contacts.normal)
    order = np.lexsort((high, low))
    for apart in range(1, len(order)):
        a, b = order[:-apart], order[apart:]
        same = (low[a] == low[b]) & (high[a] == high[b])
        if not same.any():
            return
        for k in np.flatnonzero(same & (np.sum(normal[a] * normal[b], axis=1) > 0.75)):
            raise InputError(
                f"contacts {min(a[k], b[k])} and {max(a[k], b[k])} are one: both join grains "
                f"{low[a[k]]} and {high[a[k]]}; give each contact once"
            )
