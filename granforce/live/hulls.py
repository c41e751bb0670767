"""All balanced networks on small sets, with or without friction cones: the space that contains S.

The balance A x = b depends on the disks and their loads, not on friction: its solutions are an
affine space, x = A⁺ b + u · axes. Cones of any μ cut S out of it; a drawing of S can do this again
for every μ and, as b is linear in the loads, for every load.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from granforce.explore import bodies, stress_outline
from granforce.explore import outline as outlines
from granforce.explore import thrust as bands
from granforce.explore.intervals import intervals
from granforce.forces.build import ensemble
from granforce.forces.knowledge import Known
from granforce.numerics import certificates
from granforce.perturb.grain_loads import load_factor
from granforce.records import InputError, Packing, are_whole
from granforce.types import Floats, Integers

# Singular values of A below this, relative to the largest, count as 0.
_RANK = 1e-10
# Largest distance of the outline from the half planes that contain S, relative to its extent.
_OUTLINED = 1e-4


class BalanceSpace(NamedTuple):
    """The affine space of all balanced networks on the N_c contacts of a packing."""

    A: Floats  # (rows, 2 N_c): forces and torque/r of each grain that must balance, then pressure
    b: Floats  # (rows,)
    lift: Floats  # (2 N_c, rows) the pseudoinverse A⁺
    axes: Floats  # (h, 2 N_c) orthonormal
    grains: Integers  # (M,) grains with three consecutive rows each
    equations: int  # independent rows


def hull(packing: Packing) -> BalanceSpace:
    """The BalanceSpace of a packing in which every contact may carry force, at any friction."""
    whole = ensemble(packing, 1.0, prune=False)
    A = whole.A.toarray()
    left, values, right = np.linalg.svd(A)
    rank = int(np.sum(values > _RANK * values.max(initial=0.0)))
    lift = right[:rank].T @ (left[:, :rank] / values[:rank]).T
    return BalanceSpace(
        A=A, b=whole.b, lift=lift, axes=right[rank:], grains=whole.grains, equations=rank
    )


def fall(packing: Packing) -> Floats | None:
    """The motion (N, 3) that proves that nothing balances, or None; see `bodies.fall`."""
    return bodies.fall(packing)


def limit(packing: Packing, load: Floats) -> float:
    """The largest λ for which bodies under λ times a load (N, 3), besides their own, balance.

    Raises the errors of `load_factor`.
    """
    return load_factor(ensemble(packing), load).factor


def bounds(packing: Packing) -> Floats | None:
    """Least and largest f_n (N_c, 2) of every contact, NaN if not certified; 0 for idle contacts.

    None if S is unbounded, by a certificate.
    """
    S = ensemble(packing)
    if certificates.recession(S.scaled_form[0]) is not None:
        return None
    exact = intervals(S)
    both = np.zeros((len(packing.contacts.i), 2))
    both[S.index] = np.column_stack([exact.low[:, 0], exact.high[:, 0]])
    return both


def outline(packing: Packing, plane: Sequence[Any], most: float | None = None) -> Floats:
    """Corners (k, 2) of the outline of S on two force components, in force; empty without an area.

    plane: two numbers, 2 c for f_n and 2 c + 1 for f_t of contact c of the packing. Its certified
    outer polygon is at most _OUTLINED times the extent away. most: largest f_n of every contact,
    for an unbounded S.

    Raises InputError for other components, and if S is unbounded.
    """
    count = len(packing.contacts.i)
    limit = np.array([np.inf if most is None else most, np.inf])
    S = ensemble(
        packing,
        known=Known(np.arange(count), np.full((count, 2), -np.inf), np.tile(limit, (count, 1))),
    )
    chosen = np.array(plane)
    if chosen.shape != (2,) or not are_whole(chosen, 2 * count - 1).all():
        raise InputError("a plane needs two force components: 2 c for f_n, 2 c + 1 for f_t")
    axes = np.zeros((2, count, 2))
    axes.reshape(2, -1)[[0, 1], chosen] = 1.0
    carrying = axes[:, S.index]
    if chosen[0] == chosen[1] or not carrying.any(axis=(1, 2)).all():
        return np.empty((0, 2))
    return S.force_scale * outlines.outline(S, carrying, tolerance=_OUTLINED).inner


def thrust(packing: Packing, mu: float) -> tuple[Integers, Floats, Floats]:
    """Joints (2, k), and the parts low and high (k,) between which resultants can pass."""
    lines = bands.thrust(ensemble(packing, mu))
    return lines.contacts.T, lines.low, lines.high


def stress_axes(packing: Packing, mu: float) -> Floats:
    """Axes (2, N_c, 2) of ((σ_xx − σ_yy)/2P, σ_xy/P) for the forces of a packing's S in ⟨f_n⟩.

    Raises the errors of `stress_outline`.
    """
    return stress_outline.stress_axes(ensemble(packing, mu))
