"""S: the balance equations and Coulomb cones of a packing, its backbone, and the two judges.

Unknowns x = (f_n1, f_t1, f_n2, …), or (f_n1, f_n2, …) at μ = 0 where no contact can carry f_t.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import highspy
import numpy as np
import numpy.typing as npt
from scipy import sparse

from granforce import notebook
from granforce.forces import knowledge
from granforce.forces.knowledge import Known
from granforce.forces.nearest import nearest, some_network
from granforce.numerics import certificates
from granforce.numerics import highs as programs
from granforce.records import (
    Contacts,
    Floats,
    InputError,
    Integers,
    Mask,
    NotJammedError,
    Packing,
    are_whole,
    float_array,
    friction,
)
from granforce.system import cancelling
from granforce.tolerances import ADMISSIBLE, BALANCED, CARRYING, ROUNDING, SEEN_CARRYING

# What is prescribed, by its number of values.
_NAMES = {1: "pressure", 3: "stress"}

# Rows beyond which the dense eigenvalues that give a rank are not worth their time.
LARGEST_RANK = 3000


@dataclass(frozen=True, eq=False)
class Ensemble:
    """S = {x : A x = b, f_n ≥ 0, |f_t| ≤ μ f_n, low ≤ f ≤ high} for one packing; see `ensemble`."""

    packing: Packing
    mu: float  # friction coefficient of the cones (not necessarily the packing's)
    index: Integers  # (N_c,) the unknown contacts, as positions in packing.contacts
    contacts: Contacts  # their geometry
    grains: Integers  # (M,) grains of the backbone, as positions in packing.x
    A: sparse.csr_matrix  # (rows, unknowns): forces and torque/r by grain, then what is prescribed
    b: Floats  # (rows,) force
    force_scale: float  # ⟨f_n⟩ weighted with ℓ: 2 P0 V / Σ ℓ where the pressure is prescribed
    original: Floats  # (N_c, 2) the packing's own network on these contacts
    frozen: Integers  # contacts held at their original forces, as positions in packing.contacts
    skipped: dict[str, int]  # what was left out: rattlers, unloaded contacts, tangential unknowns
    prescribed: str  # "pressure", "stress" (with the pressure) or "none"
    known: knowledge.Polygons | None  # bounds on single forces, in ⟨f_n⟩; None without any
    found: Floats | None = None  # (N_c, 2) a network met while these contacts were sorted out

    @property
    def per_contact(self) -> int:
        """Unknowns per contact: 2, or 1 at μ = 0."""
        return 2 if self.mu > 0 else 1

    @property
    def has_pressure_row(self) -> bool:
        """Whether the pressure is prescribed, alone or with the whole stress.

        It is in a periodic box without frozen contacts.
        """
        return self.prescribed != "none"

    @property
    def pressure_row(self) -> int:
        """Row of A with the pressure, if it is prescribed: the first below those of the grains."""
        return (1 + self.per_contact) * len(self.grains)

    @cached_property
    def dimension(self) -> int:
        """Dimension h of S: unknowns that are not pinned, less independent rows.

        2N_c − (3M − 1) in a disordered packing with prescribed pressure (N_c − (2M − 1) at μ = 0),
        more in crystals, whose rows depend on each other: rows are counted by the eigenvalues of
        A Aᵀ. Two less where the whole stress is prescribed. Beyond LARGEST_RANK rows the generic
        value is given.
        """
        A = self.free_columns
        rows, unknowns = A.shape
        if rows > LARGEST_RANK:
            dependent = 2 if self.has_pressure_row else 3
            dependent = 0 if left_open_in(self.packing).any() else dependent
            return max(0, unknowns - (rows - dependent))
        if not unknowns:
            return 0
        square = cancelling.apart(np.linalg.eigvalsh, (A @ A.T).toarray())
        return unknowns - int(np.sum(square > 1e-12 * square[-1]))

    @property
    def free_columns(self) -> sparse.csr_matrix:
        """A without the columns of components that are pinned."""
        if self.known is None:
            return self.A
        return self.A.tocsc()[:, ~self.to_vector(self.known.pinned).astype(np.bool_)]

    @property
    def coordination(self) -> float:
        """Mean coordination number z = 2 N_c / M of the backbone."""
        return 2 * len(self.index) / max(1, len(self.grains))

    @cached_property
    def cone_form(self) -> tuple[sparse.csc_matrix, sparse.csc_matrix]:
        """(A T, T) in csc form with x = T y, y ≥ 0: f_n = (p + q)/2, f_t = μ (p − q)/2."""
        if self.mu == 0:
            T = sparse.identity(self.A.shape[1], format="csc")
        else:
            block = np.array([[0.5, 0.5], [0.5 * self.mu, -0.5 * self.mu]])
            T = sparse.kron(sparse.identity(len(self.index)), block, format="csc")
        return sparse.csc_matrix(self.A @ T), T

    @cached_property
    def member(self) -> Floats | None:
        """A network (N_c, 2) of S that is at hand, force; None without one.

        It is a certificate that S is not empty, which no program can contradict.
        """
        at_hand = (forces for forces in (self.original, self.found) if forces is not None)
        return next((forces for forces in at_hand if self.admits(forces)), None)

    @cached_property
    def scaled_form(self) -> tuple[sparse.csc_matrix, Floats, sparse.csc_matrix]:
        """(A, b, T) of S = {x = ⟨f_n⟩ T y : A y = b, y ≥ 0}; where forces are known, with slacks.

        The largest entry of each row of the balance is 1: torque rows are as small (or large) as μ
        otherwise, which costs solvers their last digits. Where a network is at hand, b is what it
        gives: its own unbalance, up to BALANCED, would be magnified by that scale, and rows that
        follow from others would contradict them.
        """
        A, b, T = self._scaled_balance
        if self.known is not None:
            A, b, T = knowledge.extended(A, b, T, self.known, self.mu, self.known.value)
        y = None if self.member is None else self.coordinates(self.member)
        if y is not None and self.residual(self.to_forces(T @ y * self.force_scale)) <= BALANCED:
            b = A @ y
        return A, b, T

    @cached_property
    def slack(self) -> Floats:
        """(rows,) of `scaled_form`: up to what it may differ from b in forces that are admitted."""
        scale = self._row_scale
        if self.known is None:
            return BALANCED * scale
        unit = knowledge.units(self.mu)
        parts = self.known.component, knowledge.pins(self.known, self.mu)[1]
        return np.append(BALANCED * scale, ADMISSIBLE / unit[np.concatenate(parts)])

    def coordinates(self, forces: Floats) -> Floats:
        """y (n,) ≥ 0 of `scaled_form` nearest to forces (N_c, 2)."""
        normal, tangential = forces.T / self.force_scale
        y = normal[:, None]
        if self.mu > 0:
            y = np.column_stack([normal + tangential / self.mu, normal - tangential / self.mu])
        y = y.ravel()
        if self.known is not None:
            known = self.known
            rest = (
                known.limit - known.sign * forces[known.contact, known.component] / self.force_scale
            )
            y = np.append(y, rest / knowledge.units(self.mu)[known.component])
        return np.maximum(y, 0.0)

    @cached_property
    def _row_scale(self) -> Floats:
        """(rows,) what makes the largest entry of each row of `cone_form` 1."""
        largest = abs(self.cone_form[0]).max(axis=1).toarray().ravel()
        return 1 / np.where(largest > 0, largest, 1.0)

    @cached_property
    def _scaled_balance(self) -> tuple[sparse.csc_matrix, Floats, sparse.csc_matrix]:
        scale = self._row_scale
        A, T = self.cone_form
        return sparse.csc_matrix(sparse.diags(scale) @ A), scale * self.b / self.force_scale, T

    def _repr_html_(self) -> str:
        """The ensemble as notebooks show it."""
        lines = {
            "disks of the backbone M": len(self.grains),
            "contacts that carry N_c": len(self.index),
            "friction coefficient μ": self.mu,
            "mean coordination z": self.coordination,
            "dimension h": self.dimension,
            "mean normal force ⟨fₙ⟩": self.force_scale,
            "prescribed": self.prescribed,
        }
        if len(self.frozen):
            lines["frozen contacts"] = len(self.frozen)
        if self.known is not None:
            lines["contacts of which something is known"] = int(self.known.informed.sum())
        left_out = {name.replace("_", " "): n for name, n in self.skipped.items() if n}
        return notebook.table("Admissible force networks S", lines | left_out)

    def with_normal(self, position: int, value: float, found: Floats) -> Ensemble:
        """The same where f_n of the contact at `position` is known, too, to be `value` (force).

        found (N_c, 2): a network of S with that f_n, which is then at hand.
        """
        bounds = np.empty((len(self.index), 2, 2))
        bounds[..., 0], bounds[..., 1] = -np.inf, np.inf
        if self.known is not None:
            bounds[..., 0] = self.known.low * self.force_scale
            bounds[..., 1] = self.known.high * self.force_scale
        bounds[position, 0] = value
        known = knowledge.polygons(bounds, self.mu, self.force_scale, self.index)
        return replace(self, known=known, found=found)

    def positions(self, contacts: npt.ArrayLike) -> Integers:
        """Positions (k,) in the ensemble of contacts (k,) of the packing; InputError for others."""
        contacts = np.asarray(contacts)
        unknown = contacts[~np.isin(contacts, self.index)]
        if len(unknown):
            raise InputError(
                f"contact {unknown[0]} is none of the {len(self.index)} that carry a load in this "
                "packing"
            )
        return np.searchsorted(self.index, contacts)

    def to_vector(self, forces: Any) -> Any:
        """Forces (…, N_c, 2) as vectors x (…, unknowns)."""
        forces = np.asarray(forces, dtype=np.float64)
        return forces[..., : self.per_contact].reshape(*forces.shape[:-2], -1)

    def to_forces(self, vector: Floats) -> Floats:
        """Vectors x (…, unknowns) as forces (…, N_c, 2)."""
        shape = (*vector.shape[:-1], len(self.index), self.per_contact)
        forces = np.zeros((*shape[:-1], 2))
        forces[..., : self.per_contact] = vector.reshape(shape)
        return forces

    def expand(self, forces: Floats) -> Floats:
        """Forces (…, N_c, 2) of S on all contacts of the packing: zero off the backbone.

        Frozen contacts get their original forces.
        """
        forces = np.asarray(forces)
        count = len(self.packing.contacts.i)
        full = np.zeros((*forces.shape[:-2], count, 2))
        full[..., self.index, :] = forces
        full[..., self.frozen, :] = self.packing.forces[self.frozen]
        return full

    def pin(self, forces: Floats) -> Floats:
        """The forces (…, N_c, 2) with all pinned components at their values."""
        if self.known is not None:
            pinned = self.known.pinned
            forces[..., pinned] = self.known.value[pinned] * self.force_scale
        return forces

    def residual(self, forces: Floats) -> Any:
        """Largest unbalance |A x − b| over rows, in ⟨f_n⟩: scalar, or (…,) for (…, N_c, 2).

        Rows are force components and torque/r of every backbone grain, and the pressure as mean
        normal force (with it the stress, where that is prescribed). NaN forces give NaN.
        """
        x = self.to_vector(forces)
        columns = x.reshape(int(np.prod(x.shape[:-1])), x.shape[-1]).T
        rows = np.abs(self.A @ columns - self.b[:, None])
        worst = rows.max(axis=0, initial=0.0) / self.force_scale
        return _plain(worst.reshape(x.shape[:-1]))

    def violation(self, forces: Floats) -> Any:
        """Largest violation of f_n ≥ 0, |f_t| ≤ μ f_n and what is known, in ⟨f_n⟩, (…,)."""
        forces = np.asarray(forces, dtype=np.float64)
        normal, tangential = forces[..., 0], forces[..., 1]
        excess = np.maximum(-normal, np.abs(tangential) - self.mu * np.maximum(normal, 0.0))
        worst = np.maximum(excess.max(axis=-1, initial=0.0), 0.0) / self.force_scale
        if self.known is not None:
            scaled = forces / self.force_scale
            outside = np.maximum(self.known.low - scaled, scaled - self.known.high)
            worst = np.maximum(worst, outside.max(axis=(-2, -1), initial=0.0))
        return _plain(worst)

    def admits(
        self, forces: Floats, residual: float = BALANCED, violation: float = ADMISSIBLE
    ) -> bool:
        """Whether forces (N_c, 2) are an equilibrium inside the cones, to the given tolerances."""
        return bool(self.residual(forces) <= residual and self.violation(forces) <= violation)


def _plain(values: Floats) -> Floats | float:
    return float(values) if values.ndim == 0 else values


def ensemble(
    packing: Packing,
    mu: float | None = None,
    *,
    prescribed: str = "pressure",
    stress: npt.ArrayLike | None = None,
    known: Known | None = None,
    frozen: npt.ArrayLike | None = None,
    prune: bool = True,
) -> Ensemble:
    """The set S of admissible force networks of a packing.

    mu: friction coefficient of the cones, by default the packing's. prescribed: "pressure", the
    whole "stress", or "none" (nothing but loads, or forces outside). stress (3,): σ_xx, σ_yy and
    σ_xy, force per length, by default those of the packing's own network. known: a Known, bounds on
    single forces. frozen: mask (N_c,) or positions of contacts held at their original forces, which
    drops the pressure row (PRL 94, 178001). prune: leave out rattlers and contacts that carry
    nothing in any state of S. Grains whose load is NaN need not balance.

    Raises NotJammedError where S is empty, naming the grains with the largest unbalanced load, or
    the statements of what is known that cannot hold together; InputError for conditions that make
    no sense together.
    """
    mu = packing.mu if mu is None else friction(mu)
    count = len(packing.contacts.i)
    held = np.zeros(count, dtype=bool)
    if frozen is not None:
        held[_frozen_positions(frozen, count)] = True
    loaded = np.nan_to_num(packing.load).any()
    if np.isnan(packing.pressure) and not packing.forces.any() and not loaded:
        raise InputError(
            "all forces are zero, and nothing says how large they are: give forces, a pressure, or "
            "loads on the grains"
        )
    bounds = None if known is None else knowledge.bounds_of(known, count)
    asked = _Asked(mu, held, _prescribed(packing, prescribed, stress, held), bounds)
    free = np.flatnonzero(~held)
    if prune:
        free = _without_danglers(packing, free, held)
    full = _assemble(packing, asked, free)
    _check_frozen_and_known(packing, held, bounds, full.force_scale)
    if not prune:
        return full
    carrying, found = _carrying(full)
    pruned = full if carrying.all() else _assemble(packing, asked, free[carrying])
    pruned = replace(pruned, found=None if found is None else found[carrying])
    _check_idle_and_known(pruned, bounds)
    return pruned


class _Asked(NamedTuple):
    """What an ensemble is asked to hold to."""

    mu: float
    held: Mask  # (contacts,) bool, frozen
    stress: Floats | None  # prescribed: (1,) pressure, (3,) xx, yy, xy, or None
    bounds: Floats | None  # (contacts, 2, 2) force, by knowledge.bounds_of


def _prescribed(
    packing: Packing, prescribed: str, stress: npt.ArrayLike | None, held: Mask
) -> Floats | None:
    """What is prescribed, as in _Asked; InputError where it makes no sense here."""
    if prescribed not in ("pressure", "stress", "none"):
        raise InputError(f"prescribed must be pressure, stress or none, got {prescribed!r:.40}")
    if stress is not None and prescribed != "stress":
        raise InputError('a stress is given, but not prescribed: add prescribed="stress"')
    closed = np.isfinite(packing.volume) and not np.isnan(packing.pressure)
    if prescribed == "none" and closed and not held.any() and not packing.load.any():
        raise InputError(
            "with nothing prescribed nothing says how large the forces are: prescribe the pressure "
            "or the stress, or freeze contacts"
        )
    if prescribed == "none":
        return None
    if prescribed == "pressure":
        return np.array([packing.pressure]) if closed and not held.any() else None
    if held.any():
        raise InputError(
            "the stress cannot be prescribed where contacts are frozen: their forces decide it"
        )
    if not np.isfinite(packing.volume):
        raise InputError("the stress can be prescribed in a periodic box only; this one is open")
    if stress is None:
        stress = stress_of(packing, packing.forces)
        if not stress[0] + stress[1] > 0:
            raise InputError(
                "the packing has no forces of its own to take the stress from: give the stress"
            )
    stress = float_array(stress, (3,), "stress")
    if not stress[0] + stress[1] > 0:
        raise InputError("a stress must press: σ_xx + σ_yy must be above 0")
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


def _check_frozen_and_known(
    packing: Packing, held: Mask, bounds: Floats | None, scale: float
) -> None:
    if bounds is None or not held.any():
        return
    outside = np.maximum(bounds[..., 0] - packing.forces, packing.forces - bounds[..., 1])
    wrong = np.flatnonzero(held & (outside.max(axis=1) > ADMISSIBLE * scale))
    if len(wrong):
        raise InputError(
            f"contact {wrong[0]} is frozen at a force that contradicts what is known of it: leave "
            "one of both out"
        )


def _check_idle_and_known(S: Ensemble, bounds: Floats | None) -> None:
    """Contacts that carry nothing may not be known to carry."""
    if bounds is None:
        return
    out = np.setdiff1d(np.arange(len(bounds)), np.append(S.index, S.frozen))
    short = np.maximum(bounds[out, :, 0], -bounds[out, :, 1]).max(axis=1, initial=0.0)
    if np.any(short > ADMISSIBLE * S.force_scale):
        worst = int(np.argmax(short))
        raise NotJammedError(
            f"contact {out[worst]} carries nothing in any network of these conditions; what is "
            f"known of it would have to give {short[worst]:.3g}"
        )


def left_open_in(packing: Packing) -> Mask:
    """Mask (N,) of grains whose balance is left open: nothing is known of the load on them."""
    return np.any(np.isnan(packing.load), axis=1)


def _frozen_positions(frozen: npt.ArrayLike, count: int) -> Integers:
    frozen = np.asarray(frozen)
    if frozen.dtype == bool:
        if frozen.shape != (count,):
            raise InputError(f"frozen must mask {count} contacts, got shape {frozen.shape}")
        return np.flatnonzero(frozen)
    if not are_whole(frozen, count - 1).all():
        raise InputError(f"a frozen contact lies outside 0 … {count - 1}")
    return frozen.astype(np.int64)


def _without_danglers(packing: Packing, free: Integers, held: Mask) -> Integers:
    """Drop, one after another, contacts of unloaded grains that have no other contact."""
    i, j = packing.contacts.i, packing.contacts.j
    count = len(packing.r)
    anchored = np.any(packing.load != 0, axis=1)
    anchored[i[held]] = anchored[j[held]] = True
    while True:
        number = np.bincount(i[free], minlength=count) + np.bincount(j[free], minlength=count)
        lonely = (number == 1) & ~anchored
        keep = ~(lonely[i[free]] | lonely[j[free]])
        if keep.all():
            return free
        free = free[keep]


def _assemble(packing: Packing, asked: _Asked, free: Integers) -> Ensemble:
    mu, held = asked.mu, asked.held
    if not len(free):
        if held.any():
            raise InputError(
                "no free contact can carry a force; freeze fewer contacts, or take a larger slice"
            )
        raise NotJammedError("the packing has no contact that could carry a load")
    contacts = packing.contacts.picked(free)
    loaded = np.any(packing.load != 0, axis=1)
    grains = np.union1d(np.union1d(contacts.i, contacts.j), np.flatnonzero(loaded))
    left_open = np.flatnonzero(left_open_in(packing))
    touched = np.intersect1d(grains, left_open)
    grains = np.setdiff1d(grains, left_open)
    A, b = _balance(packing, contacts, grains, held, mu)
    original = packing.forces[free]
    if asked.stress is None:
        scale = float(np.mean(np.abs(original[:, 0])))
    else:
        rows, values = _conditions(packing, contacts, mu, asked.stress)
        A = sparse.vstack([A, sparse.csr_matrix(rows)], format="csr")
        b, scale = np.append(b, values), values[0]
    scale = float(scale) or 1.0
    A = _without_rounding(A, len(grains) * (3 if mu > 0 else 2), contacts)
    if held.any():
        b = _held_in_balance(A, b, original if mu > 0 else original[:, :1], BALANCED * scale)
    known = None
    if asked.bounds is not None:
        known = knowledge.polygons(asked.bounds[free], mu, scale, free)
    return Ensemble(
        packing=packing,
        mu=mu,
        index=free,
        contacts=contacts,
        grains=grains,
        A=A,
        b=b,
        force_scale=scale,
        original=original,
        frozen=np.flatnonzero(held),
        skipped={
            "rattlers": len(packing.r) - len(grains) - len(touched),
            "unloaded_contacts": len(held) - len(free) - int(held.sum()),
            "tangential_unknowns": len(free) if mu == 0 else 0,
        },
        prescribed="none" if asked.stress is None else _NAMES[len(asked.stress)],
        known=known,
    )


def _balance(
    packing: Packing, contacts: Contacts, grains: Integers, held: Mask, mu: float
) -> tuple[sparse.csr_matrix, Floats]:
    """Force and torque rows of the given grains; frozen contacts and loads go to the right."""
    row_of = np.full(len(packing.r), -1)
    row_of[grains] = np.arange(len(grains))
    size = 3 if mu > 0 else 2
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


def _without_rounding(A: sparse.csr_matrix, balance: int, contacts: Contacts) -> sparse.csr_matrix:
    """A without entries that are rounding of 0: n_y of contacts along x, n_x² − n_y² at 45°.

    A row of nothing else would be a condition of its own once it is scaled. Entries of the
    `balance` rows are of order 1, those of what is prescribed of order ℓ/Σℓ.
    """
    unit = np.ones(A.shape[0])
    unit[balance:] = contacts.length.max() / contacts.length.sum()
    A = sparse.csr_matrix(A)
    A.data[np.abs(A.data) < ROUNDING * np.repeat(unit, np.diff(A.indptr))] = 0.0
    A.eliminate_zeros()
    return A


def _held_in_balance(A: sparse.csr_matrix, b: Floats, original: Floats, tolerance: float) -> Floats:
    """A x of the original network x, if that is balanced: b without what rounding left of it.

    Frozen surroundings determine most forces, and leave rows of A that follow from others times
    10⁴: what frozen forces are out of balance by, 10⁻¹², would contradict itself there by 10⁻⁸.
    """
    balanced = A @ original.ravel()
    return balanced if np.abs(balanced - b).max(initial=0.0) <= tolerance else b


def _force_matrix(
    packing: Packing, contacts: Contacts, row_of: Integers, count: int, size: int
) -> sparse.csr_matrix:
    """Sparse (size · count, 2 N_c): what unit f_n, f_t do to each grain (torque divided by r)."""
    columns = 2 * np.arange(len(contacts.i))
    n_x, n_y = contacts.normal.T
    entries = []
    for grain, sign, arm in ((contacts.i, -1.0, contacts.arm_i), (contacts.j, 1.0, contacts.arm_j)):
        row = row_of[grain]
        inside = row >= 0
        parts = [(0, 0, sign * n_x), (1, 0, sign * n_y), (0, 1, -sign * n_y), (1, 1, sign * n_x)]
        if size == 3:
            parts.append((2, 1, -arm / packing.r[grain]))
        for component, tangential, value in parts:
            entries.append(
                (value[inside], size * row[inside] + component, columns[inside] + tangential)
            )
    value, row, column = (np.concatenate(part) for part in zip(*entries, strict=True))
    return sparse.csr_matrix((value, (row, column)), shape=(size * count, 2 * len(columns)))


def _conditions(
    packing: Packing, contacts: Contacts, mu: float, stress: Floats
) -> tuple[Any, Floats]:
    """Rows (m, unknowns) and values (m,) of what is prescribed, as mean normal forces.

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


def _carrying(full: Ensemble) -> tuple[Mask, Floats | None]:
    """Mask of contacts whose largest f_n over S is positive, exactly; and a network, or None.

    What presses in a known state carries; known are the original network, or the one nearest to
    equal f_n, and one that is pulled towards forces on the contacts without any. Contacts of grains
    that cannot balance any force on them carry nothing. Only contacts that are neither are left to
    a linear program over all of S. That a contact carries nothing is proved by duality, so that it
    does not depend on which state is known.
    """
    known = full.original
    if not full.admits(known):
        known = some_network(full, np.zeros_like(known))
    trusted = full.admits(known)
    if not trusted and full.known is not None:
        _tell_contradiction(full)
    idle = np.ones(len(known), np.bool_)
    dead = ~idle
    if trusted:
        idle = known[:, 0] <= SEEN_CARRYING * full.force_scale
        dead = idle & _cannot_balance(full, idle)
        open_ones = idle & ~dead
        if open_ones.any():
            pulled = _nearest_to(full, known, open_ones)
            idle &= (pulled[:, 0] <= SEEN_CARRYING * full.force_scale) | (not full.admits(pulled))
    carrying = ~(dead | _proven_idle(full, idle & ~dead, trusted))
    return carrying, known if trusted else None


def _tell_contradiction(full: Ensemble) -> None:
    """NotJammedError with the statements that cannot hold together, where that can be proved."""
    assert full.known is not None
    A, b, T = full._scaled_balance
    message = knowledge.contradiction(
        A, b, T, full.known, full.mu, full.index, full.force_scale, full.slack
    )
    if message is not None:
        raise NotJammedError(message)


def _nearest_to(full: Ensemble, known: Floats, pulled: Mask) -> Floats:
    target = known.copy()
    target[pulled, 0] += full.force_scale
    return nearest(full, target).forces


def _cannot_balance(full: Ensemble, idle: Mask) -> Mask:
    """Mask of idle contacts that even their own grains alone cannot balance: local, exact.

    Grains whose contacts are all idle must be in balance; all others may answer any force.
    """
    size = 1 + full.per_contact
    c = full.contacts
    held_up = np.zeros(len(full.packing.r), bool)
    held_up[c.i[~idle]] = held_up[c.j[~idle]] = True
    held_up |= np.any(full.packing.load != 0, axis=1)
    held_up[full.packing.contacts.i[full.frozen]] = True
    held_up[full.packing.contacts.j[full.frozen]] = True
    rows = np.repeat(~held_up[full.grains], size)
    columns = np.repeat(idle, full.per_contact)
    if not rows.any():
        return np.zeros(len(idle), np.bool_)
    A, T = full.cone_form
    local = A[: len(rows)].tocsr()[rows][:, columns]
    normal = sparse.csr_matrix(T)[:: full.per_contact][idle][:, columns]
    model = programs.standard_form(local, np.zeros(local.shape[0]), upper=1.0)
    dead, everyone = np.zeros(len(idle), bool), np.ones(int(idle.sum()), bool)
    shown = _shown_idle(model, local, np.zeros(local.shape[0]), normal, everyone)
    if shown is not None:
        dead[idle] = shown
    return dead


def _shown_idle(
    model: highspy.Highs, A: sparse.csr_matrix, b: Floats, normal: sparse.csr_matrix, idle: Mask
) -> Mask | None:
    """Those of the idle contacts that carry nothing in {y ≥ 0 : A y = b}; None where undecided.

    normal (contacts, n): f_n = normal · y. Contacts that press where Σ f_n is largest are taken
    out, again and again; the multipliers of the last program prove that the others cannot.
    """
    while idle.any():
        gains = normal.T @ idle.astype(float)
        programs.set_cost(model, -gains)
        pressing = None
        for status, y in programs.solutions(model):
            if status != programs.OPTIMAL:
                continue
            pressing = idle & (normal @ y > SEEN_CARRYING)
            if pressing.any():
                break
            if certificates.proves_small(A, b, gains, -programs.multipliers(model, A, -gains)):
                return idle
            pressing = idle & (normal @ y > CARRYING)
        if pressing is None:
            return None
        # Without a proof, and without a state that says so, nothing is called idle.
        idle = idle & ~pressing if pressing.any() else np.zeros(len(idle), bool)
    return idle


def _proven_idle(full: Ensemble, idle: Mask, trusted: bool) -> Mask:
    """Those of the idle contacts whose sum, and so each, can only be 0 over S."""
    if not idle.any():
        return idle
    A, b, T = full.scaled_form
    # Without any load or pressure, S is a cone: what carries in it carries in a bounded part too.
    upper = np.inf if b.any() else 1.0
    model = programs.standard_form(A, b, upper=upper, solver="ipm")
    model.setOptionValue("run_crossover", "off")  # no vertex is wanted
    normal_rows = sparse.csr_matrix(T)[:: full.per_contact]
    shown = _shown_idle(model, A, b, normal_rows, idle)
    if shown is not None:
        return shown
    if trusted:
        return idle  # feasible within BALANCED but not exactly: no more is known to carry
    raise certificates.why_unsolved(A, b, _unbalanced_message(full), slack=full.slack)


def _unbalanced_message(full: Ensemble) -> str:
    A, _ = full.cone_form
    _, rest = programs.least_unbalanced(A, full.b / full.force_scale)
    size = 1 + full.per_contact
    load = np.linalg.norm(rest[: size * len(full.grains)].reshape(-1, size), axis=1)
    worst = np.argsort(load)[::-1][:5]
    carries = "" if full.prescribed != "stress" else "the contacts cannot carry this stress, or "
    named = ", ".join(f"{full.grains[k]} ({load[k]:.2g} ⟨f_n⟩)" for k in worst if load[k] > 0)
    return (
        f"no admissible force network exists: {carries}the packing is not jammed, or contacts are "
        f"missing; grains with the largest unbalanced load: {named or 'none'}"
    )
