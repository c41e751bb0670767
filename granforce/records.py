"""The records that the parts of granforce hand to each other: named tuples of arrays.

Units: length = largest radius, pressure = P0, mass density = 1; nothing depends on them except by
scaling, so any consistent units will do for packings from elsewhere.
Signs: **n** points from grain i to grain j, **t** = (−n_y, n_x); the force on j from i is
f_n n + f_t t, and f_n ≥ 0 presses.
"""

from typing import NamedTuple

import numpy as np

from granforce.tolerances import MU_DIGITS, RIGID_OVERLAP


class InputError(ValueError):
    """What was given cannot be used; the message says what is wrong and what to do."""


class NotJammedError(InputError):
    """No admissible force network exists, or none was reached within the budget."""


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
    load: np.ndarray  # (N, 3) external force and torque on each grain (zero in a periodic box)
    info: dict  # how it was made: seed, steps, skipped work, … (plain numbers and strings)

    @property
    def volume(self):
        """Area V of the box (length², infinite if open)."""
        return float(np.prod(self.box))

    @property
    def packing_fraction(self):
        """φ = Σ π r² / V, rattlers included."""
        return float(np.pi * np.sum(self.r**2) / self.volume)


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


def make_contacts(i, j, normal, length, r):
    """Contacts from array-likes, cast once: grains i, j and centre distances (N_c,), normals.

    Lever arms are the radii r where no contact overlaps by more than RIGID_OVERLAP (rigid disks),
    and reach the middle of the overlap, a = r − overlap/2, otherwise (soft disks).

    Raises InputError for grain numbers outside 0 … N − 1, self-contacts, normals that are not unit
    vectors, or distances ≤ 0.
    """
    i, j = (np.ascontiguousarray(k, dtype=np.int64) for k in (i, j))
    if i.ndim != 1 or i.shape != j.shape:
        raise InputError(f"contact lists i and j differ in shape: {i.shape} and {j.shape}")
    count = len(i)
    if count and (min(i.min(), j.min()) < 0 or max(i.max(), j.max()) >= len(r)):
        raise InputError(f"a contact names a grain outside 0 … {len(r) - 1}")
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

    Raises InputError for wrong shapes, non-finite numbers, radii ≤ 0, or box sides not above the
    largest diameter (a grain may not touch its own image).
    """
    r = float_array(r, (-1,), "radii")
    if np.any(r <= 0):
        raise InputError(f"radius of grain {int(np.argmax(r <= 0))} is not positive")
    x = float_array(x, (len(r), 2), "centres")
    box = np.array(box, dtype=np.float64)
    if box.shape != (2,) or np.any(np.isnan(box)) or np.any(box <= 2 * r.max(initial=0)):
        raise InputError(f"box sides must be two numbers above the largest diameter, got {box}")
    load = np.zeros((len(r), 3)) if load is None else float_array(load, (len(r), 3), "loads")
    if not np.isnan(pressure):
        pressure = positive(pressure, "pressure")
    forces = float_array(forces, (len(contacts.i), 2), "forces")
    return Packing(
        x, r, box, contacts, forces, friction(mu), float(pressure), load, dict(info or {})
    )
