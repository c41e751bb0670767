"""The equations A x = b of a packing: balance of every grain, and the prescribed stress.

Grain g of a network is pushed by F = ±(f_n n + f_t t) at each of its contacts (+ where it is their
second grain j, t = (−n_y, n_x)), and turned by −a f_t in either place, a its lever arm. Where the
contact point lies b beside the end of the arm, along t, f_n turns it by ±b f_n (− on j). With the
loads e on the grains that gives three rows each, the torque divided by r so that all are forces:

    Σ ±(f_n n + f_t t) = −(e_x, e_y),    −Σ (a f_t ± b f_n) / r = −e_τ / r.

At μ = 0 there is no f_t, and for disks no torque that it could balance: two rows a grain. Frozen
contacts push with known forces, which move to the right-hand side.

The prescribed quantity is the stress σ_ab = (1/V) Σ F_a ℓ_b over contacts, ℓ from centre to
centre. Its trace is the pressure, Σ f_n ℓ = 2 P0 V, as f_t is across ℓ; divided by Σ ℓ the row
reads as a mean normal force, which is the scale of all forces. The rows (σ_xx − σ_yy)/2 and σ_xy
follow where the whole stress is prescribed.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import linalg, sparse

from granforce.records import (
    Contacts,
    InputError,
    Packing,
    are_whole,
    choice,
    float_array,
    refuse_hidden,
)
from granforce.system import cancelling
from granforce.tolerances import BALANCED, ROUNDING
from granforce.types import Floats, Integers, Mask

# Up to this many rows, ranks come from pivots of dense matrices, relative to the largest row sum.
LARGEST_RANK, _LEAST_PIVOT = 3000, 1e-12


def prescribed_stress(
    packing: Packing, prescribed: str, stress: npt.ArrayLike | None, held: Mask
) -> Floats | None:
    """(1,) the pressure, (3,) σ_xx, σ_yy, σ_xy, or None: the prescribed values, force per length.

    Raises InputError if this packing does not support that choice.
    """
    prescribed = choice(prescribed, ("pressure", "stress", "none"), "prescribed")
    if stress is not None and prescribed != "stress":
        raise InputError('a stress is given, but not prescribed: add prescribed="stress"')
    closed = np.isfinite(packing.volume) and not np.isnan(packing.pressure)
    if packing.contacts.levers is not None and (closed or prescribed == "stress"):
        raise InputError(
            "pressure and stress can be prescribed for disks only; give these bodies loads, in an "
            "open box without a pressure"
        )
    if prescribed == "none" and closed and not held.any() and not packing.load.any():
        raise InputError(
            "without a prescribed pressure or stress, the scale of the forces is undetermined: "
            "prescribe one, or freeze contacts"
        )
    if prescribed == "none":
        return None
    if prescribed == "pressure":
        return np.array([packing.pressure]) if closed and not held.any() else None
    if held.any():
        raise InputError(
            "the stress cannot be prescribed together with frozen contacts, whose forces "
            "determine it"
        )
    if not np.isfinite(packing.volume):
        raise InputError("the stress can be prescribed in a periodic box only; this one is open")
    if stress is None:
        stress = stress_of(packing, packing.forces)
        if not stress[0] + stress[1] > 0:
            raise InputError(
                "the packing has no forces from which to compute the stress: give the stress"
            )
    stress = float_array(stress, (3,), "stress (σ_xx, σ_yy, σ_xy)")
    if not stress[0] + stress[1] > 0:
        raise InputError(
            "the stress must be compressive, which is positive: σ_xx + σ_yy must be above 0"
        )
    return stress


def stress_of(packing: Packing, forces: Floats) -> Floats:
    """σ_xx, σ_yy, σ_xy (…, 3) of networks (…, N_c, 2) on all contacts, force per length.

    σ_ab = (1/V) Σ F_a ℓ_b; off the diagonal the mean of both, which are equal in balance.
    """
    return np.einsum("kci,...ci->...k", stress_rows(packing.contacts), forces) / packing.volume


def stress_rows(contacts: Contacts) -> Floats:
    """V σ of unit f_n and f_t: (3, N_c, 2)."""
    n_x, n_y = contacts.normal.T
    normal = np.stack([n_x * n_x, n_y * n_y, n_x * n_y])
    tangential = np.stack([-n_x * n_y, n_x * n_y, 0.5 * (n_x * n_x - n_y * n_y)])
    return np.stack([normal, tangential], axis=-1) * contacts.length[:, None]


def left_open_in(packing: Packing) -> Mask:
    """Mask (N,) of grains whose balance is not required, as the load on them is unknown."""
    return np.any(np.isnan(packing.load), axis=1)


def mean_load(packing: Packing) -> float:
    """Mean size of the known loads (force, or torque over r_max if larger), force; 0 for none."""
    known = np.nan_to_num(packing.load)
    size = np.maximum(np.hypot(*known[:, :2].T), np.abs(known[:, 2]) / packing.r.max())
    return float(size[size > 0].mean()) if size.any() else 0.0


def rows_per_grain(contacts: Contacts, mu: float) -> int:
    """3 (two forces and a torque), or 2 if no force can turn a grain: disks without friction."""
    return 3 if mu > 0 or contacts.levers is not None else 2


def equations(
    packing: Packing, free: Integers, grains: Integers, held: Mask, mu: float, stress: Floats | None
) -> tuple[sparse.csr_matrix, Floats, float]:
    """A (rows, unknowns), b (rows,) of the free contacts (k,), and the scale ⟨f_n⟩ of forces.

    Rows are those of the grains (M,), then of the stress as by `prescribed_stress`. held (N_c,):
    frozen contacts. The scale is the packing's own mean |f_n| where nothing is prescribed, or its
    mean load without forces.
    """
    contacts, original = packing.contacts.picked(free), packing.forces[free]
    A, b = _balance(packing, contacts, grains, held, mu)
    if stress is None:
        scale = float(np.mean(np.abs(original[:, 0]))) or mean_load(packing) or 1.0
    else:
        rows, values = _conditions(packing, contacts, mu, stress)
        A = sparse.vstack([A, sparse.csr_matrix(rows)], format="csr")
        b, scale = np.append(b, values), float(values[0])
    A = _without_rounding(A, len(grains) * rows_per_grain(contacts, mu), contacts)
    if held.any():
        b = _held_in_balance(A, b, original if mu > 0 else original[:, :1], BALANCED * scale)
    return A, b, scale


def _balance(
    packing: Packing, contacts: Contacts, grains: Integers, held: Mask, mu: float
) -> tuple[sparse.csr_matrix, Floats]:
    """Force and torque rows of the given grains; frozen contacts and loads are on the right-hand
    side."""
    row_of = np.full(len(packing.r), -1)
    row_of[grains] = np.arange(len(grains))
    size = rows_per_grain(contacts, mu)
    A = _force_matrix(packing, contacts, row_of, len(grains), size)
    b = -packing.load[grains, :size]
    b[:, 2:] /= packing.r[grains, None]
    b = b.ravel()
    if held.any():
        fixed = packing.contacts.picked(held)
        fixed_matrix = _force_matrix(packing, fixed, row_of, len(grains), 3)
        unbalance = fixed_matrix @ packing.forces[held].ravel()
        b = b - unbalance.reshape(-1, 3)[:, :size].ravel()
    if mu == 0:
        A = A[:, ::2]
    return sparse.csr_matrix(A), b


def _conditions(
    packing: Packing, contacts: Contacts, mu: float, stress: Floats
) -> tuple[Any, Floats]:
    """Rows (m, unknowns) and values (m,) of the prescribed stress, as mean normal forces.

    The pressure comes first: Σ f_n ℓ / Σ ℓ = 2 P0 V / Σ ℓ. With the whole stress, (σ_xx − σ_yy)/2
    and σ_xy follow on the same scale.
    """
    length = contacts.length
    total = float(length.sum())
    size = 2 if mu > 0 else 1
    row = np.zeros(len(length) * size)
    row[::size] = length / total
    if len(stress) == 1:
        return row[None, :], np.array([2 * stress[0] * packing.volume / total])
    xx, yy, xy = stress_rows(contacts)[..., :size].reshape(3, -1) / total
    s_xx, s_yy, s_xy = stress * packing.volume / total
    return np.stack([row, 0.5 * (xx - yy), xy]), np.array([s_xx + s_yy, 0.5 * (s_xx - s_yy), s_xy])


def _force_matrix(
    packing: Packing, contacts: Contacts, row_of: Integers, count: int, size: int
) -> sparse.csr_matrix:
    """Sparse (size · count, 2 N_c): what unit f_n, f_t do to each grain (torque divided by r)."""
    columns = 2 * np.arange(len(contacts.i))
    n_x, n_y = contacts.normal.T
    entries = []
    for side, (grain, sign, arm) in enumerate(
        ((contacts.i, -1.0, contacts.arm_i), (contacts.j, 1.0, contacts.arm_j))
    ):
        row = row_of[grain]
        inside = row >= 0
        parts = [(0, 0, sign * n_x), (1, 0, sign * n_y), (0, 1, -sign * n_y), (1, 1, sign * n_x)]
        if size == 3:
            parts.append((2, 1, -arm / packing.r[grain]))
        if contacts.levers is not None:
            parts.append((2, 0, -sign * contacts.levers[:, side] / packing.r[grain]))
        for component, tangential, value in parts:
            entries.append(
                (value[inside], size * row[inside] + component, columns[inside] + tangential)
            )
    value, row, column = (np.concatenate(part) for part in zip(*entries, strict=True))
    return sparse.csr_matrix((value, (row, column)), shape=(size * count, 2 * len(columns)))


def _without_rounding(A: sparse.csr_matrix, balance: int, contacts: Contacts) -> sparse.csr_matrix:
    """A without entries that are rounding of 0: n_y of contacts along x, n_x² − n_y² at 45°.

    A row of nothing but rounding would become a condition once it is scaled. Entries of the
    `balance` rows are of order 1, those of the stress rows of order ℓ/Σℓ.
    """
    unit = np.ones(A.shape[0])
    unit[balance:] = contacts.length.max() / contacts.length.sum()
    A = sparse.csr_matrix(A)
    A.data[np.abs(A.data) < ROUNDING * np.repeat(unit, np.diff(A.indptr))] = 0.0
    A.eliminate_zeros()
    return A


def _held_in_balance(A: sparse.csr_matrix, b: Floats, original: Floats, tolerance: float) -> Floats:
    """A x of the original network x, if that is balanced: b without rounding errors.

    Frozen surroundings determine most forces and make some rows of A follow from others times 10⁴.
    An unbalance of 10⁻¹² in the frozen forces would become a contradiction of 10⁻⁸.
    """
    balanced = A @ original.ravel()
    return balanced if np.abs(balanced - b).max(initial=0.0) <= tolerance else b


def frozen_positions(frozen: npt.ArrayLike, count: int) -> Integers:
    """Positions (k,) of the frozen of so many contacts, from a mask (N_c,) or positions."""
    frozen = np.asarray(refuse_hidden(frozen, "frozen contacts"))
    if frozen.dtype == bool:
        if frozen.shape != (count,):
            raise InputError(f"frozen must mask {count} contacts, got shape {frozen.shape}")
        return np.flatnonzero(frozen)
    if not are_whole(frozen, count - 1).all():
        raise InputError(f"a frozen contact lies outside 0 … {count - 1}")
    return frozen.astype(np.int64)


def left_free(rows: sparse.csr_matrix) -> int:
    """Unknowns less independent rows, of rows (k, unknowns) of order 1.

    The rank is that of a Cholesky factor with complete pivoting (Higham, Accuracy and stability of
    numerical algorithms, 2nd ed., 10.3).
    """
    if not all(rows.shape):  # everything is pinned, or no grain has to balance
        return rows.shape[1]
    square = (rows @ rows.T).toarray()
    least = _LEAST_PIVOT * np.abs(square).sum(axis=1).max()
    _, _, rank, _ = cancelling.apart(partial(linalg.lapack.dpstrf, tol=least), square)
    return rows.shape[1] - int(rank)
