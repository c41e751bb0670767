"""S: the balance equations and Coulomb cones of a packing, its backbone, and the two judges.

Unknowns x = (f_n1, f_t1, f_n2, …), or (f_n1, f_n2, …) at μ = 0 where no contact can carry f_t.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from granforce import programs
from granforce.records import Contacts, InputError, NotJammedError, Packing, friction
from granforce.relax.nearest import least_unbalanced, nearest
from granforce.tolerances import ADMISSIBLE, BALANCED, CARRYING

# Rows beyond which the dense eigenvalues that give a rank are not worth their time.
LARGEST_RANK = 3000


@dataclass(frozen=True, eq=False)
class Ensemble:
    """S = {x : A x = b, f_n ≥ 0, |f_t| ≤ μ f_n} for one packing; see `ensemble`."""

    packing: Packing
    mu: float  # friction coefficient of the cones (not necessarily the packing's)
    index: np.ndarray  # (N_c,) the unknown contacts, as positions in packing.contacts
    contacts: Contacts  # their geometry
    grains: np.ndarray  # (M,) grains of the backbone, as positions in packing.x
    A: sparse.csr_matrix  # (rows, unknowns): x and y force and torque/r per grain, then pressure
    b: np.ndarray  # (rows,) force
    force_scale: float  # ⟨f_n⟩ weighted with ℓ: 2 P0 V / Σ ℓ where the pressure is prescribed
    original: np.ndarray  # (N_c, 2) the packing's own network on these contacts
    frozen: np.ndarray  # contacts held at their original forces, as positions in packing.contacts
    skipped: dict  # counts of what was left out: rattlers, unloaded contacts, tangential unknowns

    @property
    def per_contact(self):
        """Unknowns per contact: 2, or 1 at μ = 0."""
        return 2 if self.mu > 0 else 1

    @property
    def has_pressure_row(self):
        """Whether the pressure is prescribed (a periodic box without frozen contacts)."""
        return self.A.shape[0] % (1 + self.per_contact) == 1

    @cached_property
    def dimension(self):
        """Dimension h of S: unknowns less independent balance rows.

        2N_c − (3M − 1) in a disordered packing with prescribed pressure (N_c − (2M − 1) at μ = 0),
        more in crystals, whose rows depend on each other: rows are counted by the eigenvalues of
        A Aᵀ. Beyond LARGEST_RANK rows the generic value is given.
        """
        rows, unknowns = self.A.shape
        if rows > LARGEST_RANK:
            return max(0, unknowns - (rows - (2 if self.has_pressure_row else 3)))
        if not unknowns:
            return 0
        square = np.linalg.eigvalsh((self.A @ self.A.T).toarray())
        return unknowns - int(np.sum(square > 1e-12 * square[-1]))

    @property
    def coordination(self):
        """Mean coordination number z = 2 N_c / M of the backbone."""
        return 2 * len(self.index) / max(1, len(self.grains))

    @cached_property
    def cone_form(self):
        """(A T, T) in csc form with x = T y, y ≥ 0: f_n = (p + q)/2, f_t = μ (p − q)/2."""
        if self.mu == 0:
            T = sparse.identity(self.A.shape[1], format="csc")
        else:
            block = np.array([[0.5, 0.5], [0.5 * self.mu, -0.5 * self.mu]])
            T = sparse.kron(sparse.identity(len(self.index)), block, format="csc")
        return sparse.csc_matrix(self.A @ T), T

    @cached_property
    def scaled_form(self):
        """(A, b, T) of S = {x = ⟨f_n⟩ T y : A y = b, y ≥ 0}, each row's largest entry 1.

        Torque rows are as small (or large) as μ otherwise, which costs solvers their last digits.
        """
        A, T = self.cone_form
        largest = abs(A).max(axis=1).toarray().ravel()
        scale = 1 / np.where(largest > 0, largest, 1.0)
        return sparse.csc_matrix(sparse.diags(scale) @ A), scale * self.b / self.force_scale, T

    def positions(self, contacts):
        """Positions (k,) in the ensemble of contacts (k,) of the packing; InputError for others."""
        contacts = np.asarray(contacts, dtype=int)
        unknown = np.setdiff1d(contacts, self.index)
        if len(unknown):
            raise InputError(
                f"contact {unknown[0]} is none of the {len(self.index)} that carry a load in this "
                "packing"
            )
        return np.searchsorted(self.index, contacts)

    def to_vector(self, forces):
        """Forces (…, N_c, 2) as vectors x (…, unknowns)."""
        forces = np.asarray(forces, dtype=np.float64)
        return forces[..., : self.per_contact].reshape(*forces.shape[:-2], -1)

    def to_forces(self, vector):
        """Vectors x (…, unknowns) as forces (…, N_c, 2)."""
        shape = (*vector.shape[:-1], len(self.index), self.per_contact)
        forces = np.zeros((*shape[:-1], 2))
        forces[..., : self.per_contact] = vector.reshape(shape)
        return forces

    def expand(self, forces):
        """Forces (…, N_c, 2) of the ensemble on all contacts of the packing: zero off the backbone.

        Frozen contacts get their original forces.
        """
        forces = np.asarray(forces)
        count = len(self.packing.contacts.i)
        full = np.zeros((*forces.shape[:-2], count, 2))
        full[..., self.index, :] = forces
        full[..., self.frozen, :] = self.packing.forces[self.frozen]
        return full

    def residual(self, forces):
        """Largest unbalance |A x − b| over rows, in ⟨f_n⟩: scalar, or (…,) for (…, N_c, 2).

        Rows are force components and torque/r of every backbone grain, and the pressure as mean
        normal force. NaN forces give NaN.
        """
        x = self.to_vector(forces)
        columns = x.reshape(int(np.prod(x.shape[:-1])), x.shape[-1]).T
        rows = np.abs(self.A @ columns - self.b[:, None])
        worst = rows.max(axis=0, initial=0.0) / self.force_scale
        return _plain(worst.reshape(x.shape[:-1]))

    def violation(self, forces):
        """Largest violation of f_n ≥ 0 and |f_t| ≤ μ f_n, in ⟨f_n⟩: scalar, or (…,)."""
        forces = np.asarray(forces, dtype=np.float64)
        normal, tangential = forces[..., 0], forces[..., 1]
        excess = np.maximum(-normal, np.abs(tangential) - self.mu * np.maximum(normal, 0.0))
        return _plain(np.maximum(excess.max(axis=-1, initial=0.0), 0.0) / self.force_scale)

    def admits(self, forces, residual=BALANCED, violation=ADMISSIBLE):
        """Whether forces (N_c, 2) are an equilibrium inside the cones, to the given tolerances."""
        return bool(self.residual(forces) <= residual and self.violation(forces) <= violation)


def _plain(values):
    return float(values) if values.ndim == 0 else values


def ensemble(packing, mu=None, *, frozen=None, prune=True):
    """The set S of admissible force networks of a packing.

    mu: friction coefficient of the cones, by default the packing's. frozen: mask (N_c,) or
    positions of contacts held at their original forces, which drops the pressure row (PRL 94,
    178001). prune: leave out rattlers and contacts that carry nothing in any state of S.

    Raises NotJammedError where S is empty, naming the grains with the largest unbalanced load.
    """
    mu = packing.mu if mu is None else friction(mu)
    count = len(packing.contacts.i)
    held = np.zeros(count, dtype=bool)
    if frozen is not None:
        held[_frozen_positions(frozen, count)] = True
    free = np.flatnonzero(~held)
    if prune:
        free = _without_danglers(packing, free, held)
    full = _assemble(packing, mu, free, held)
    if not prune:
        return full
    carrying = _carrying(full)
    return full if carrying.all() else _assemble(packing, mu, free[carrying], held)


def _frozen_positions(frozen, count):
    frozen = np.asarray(frozen)
    if frozen.dtype == bool:
        if frozen.shape != (count,):
            raise InputError(f"frozen must mask {count} contacts, got shape {frozen.shape}")
        return np.flatnonzero(frozen)
    if frozen.size and (frozen.min() < 0 or frozen.max() >= count):
        raise InputError(f"a frozen contact lies outside 0 … {count - 1}")
    return frozen.astype(np.int64)


def _without_danglers(packing, free, held):
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


def _assemble(packing, mu, free, held):
    contacts = Contacts(*(field[free] for field in packing.contacts))
    loaded = np.any(packing.load != 0, axis=1)
    grains = np.union1d(np.union1d(contacts.i, contacts.j), np.flatnonzero(loaded))
    A, b = _balance(packing, contacts, grains, held, mu)
    original = packing.forces[free]
    pressure = _pressure_row(packing, contacts, held, mu)
    if pressure is not None:
        A = sparse.vstack([A, sparse.csr_matrix(pressure[0])], format="csr")
        b = np.append(b, pressure[1])
        scale = pressure[1]
    else:
        scale = float(np.mean(np.abs(original[:, 0]))) if len(free) else 0.0
    return Ensemble(
        packing=packing,
        mu=mu,
        index=free,
        contacts=contacts,
        grains=grains,
        A=A,
        b=b,
        force_scale=float(scale) or 1.0,
        original=original,
        frozen=np.flatnonzero(held),
        skipped={
            "rattlers": len(packing.r) - len(grains),
            "unloaded_contacts": len(held) - len(free) - int(held.sum()),
            "tangential_unknowns": len(free) if mu == 0 else 0,
        },
    )


def _balance(packing, contacts, grains, held, mu):
    """Force and torque rows of the given grains; frozen contacts and loads go to the right."""
    row_of = np.full(len(packing.r), -1)
    row_of[grains] = np.arange(len(grains))
    size = 3 if mu > 0 else 2
    A = _force_matrix(packing, contacts, row_of, len(grains), size)
    b = -packing.load[grains, :size]
    b[:, 2:] /= packing.r[grains, None]
    b = b.ravel()
    if held.any():
        fixed = Contacts(*(field[held] for field in packing.contacts))
        fixed_matrix = _force_matrix(packing, fixed, row_of, len(grains), 3)
        unbalance = fixed_matrix @ packing.forces[held].ravel()
        b = b - unbalance.reshape(-1, 3)[:, :size].ravel()
    if mu == 0:
        A = A[:, ::2]
    return sparse.csr_matrix(A), b


def _force_matrix(packing, contacts, row_of, count, size):
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


def _pressure_row(packing, contacts, held, mu):
    """Σ f_n ℓ / Σ ℓ = 2 P0 V / Σ ℓ, or None where the pressure is not prescribed."""
    if held.any() or np.isnan(packing.pressure) or not np.isfinite(packing.volume):
        return None
    length = contacts.length
    total = float(length.sum())
    if total == 0:
        raise NotJammedError("the packing has no contact that could carry a load")
    row = np.zeros(len(length) * (2 if mu > 0 else 1))
    row[:: 2 if mu > 0 else 1] = length / total
    return row[None, :], 2 * packing.pressure * packing.volume / total


def _carrying(full):
    """Mask of contacts whose largest f_n over S is positive, exactly.

    What carries in a known state carries; known are the original network, or the one nearest to
    equal f_n, and one that is pulled towards forces on the contacts without any. Contacts of grains
    that cannot balance any force on them carry nothing. Only contacts that are neither are left to
    a linear program over all of S.
    """
    known = full.original
    if not full.admits(known):
        known = _nearest_to(full, np.zeros_like(known), np.ones(len(known), bool))
    trusted = full.admits(known)
    idle = np.ones(len(known), bool)
    dead = ~idle
    if trusted:
        idle = known[:, 0] <= CARRYING * full.force_scale
        dead = idle & _cannot_balance(full, idle)
        open_ones = idle & ~dead
        if open_ones.any():
            pulled = _nearest_to(full, known, open_ones)
            idle &= (pulled[:, 0] <= CARRYING * full.force_scale) | (not full.admits(pulled))
    return ~(dead | _proven_idle(full, idle & ~dead, trusted))


def _nearest_to(full, known, pulled):
    target = known.copy()
    target[pulled, 0] += full.force_scale
    return nearest(full, target).forces


def _cannot_balance(full, idle):
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
        return np.zeros(len(idle), bool)
    A, T = full.cone_form
    local = A[: len(rows)].tocsr()[rows][:, columns]
    normal = sparse.csr_matrix(T)[:: full.per_contact][idle][:, columns]
    model = programs.standard_form(local, np.zeros(local.shape[0]), upper=1.0)
    programs.set_cost(model, -(normal.T @ np.ones(int(idle.sum()))))
    status, y = programs.solve(model)
    mask = np.zeros(len(idle), bool)
    if status == programs.OPTIMAL:
        mask[idle] = normal @ y <= CARRYING
    return mask


def _proven_idle(full, idle, trusted):
    """Those of the idle contacts whose sum, and so each, can only be 0 over S."""
    if not idle.any():
        return idle
    A, b, T = full.scaled_form
    model = programs.standard_form(A, b, solver="ipm")
    model.setOptionValue("run_crossover", "off")  # no vertex is wanted
    normal_rows = sparse.csr_matrix(T)[:: full.per_contact]
    while idle.any():
        programs.set_cost(model, -(normal_rows.T @ idle.astype(float)))
        status, y = programs.solve(model)
        if status != programs.OPTIMAL:
            # Asked without a goal, HiGHS tells an empty S from one without bounds.
            programs.set_cost(model, np.zeros(A.shape[1]))
            if programs.solve(model)[0] == programs.OPTIMAL:
                raise NotJammedError(
                    "the forces on this packing are not bounded: is a pressure or load set?"
                )
            if not trusted:
                raise NotJammedError(_unbalanced_message(full))
            return idle  # feasible within BALANCED but not exactly: no more is known to carry
        newly = idle & (normal_rows @ y > CARRYING)
        if not newly.any():
            return idle
        idle = idle & ~newly
    return idle


def _unbalanced_message(full):
    A, _ = full.cone_form
    _, rest = least_unbalanced(A, full.b / full.force_scale)
    size = 1 + full.per_contact
    load = np.linalg.norm(rest[: size * len(full.grains)].reshape(-1, size), axis=1)
    worst = np.argsort(load)[::-1][:5]
    named = ", ".join(f"{full.grains[k]} ({load[k]:.2g} ⟨f_n⟩)" for k in worst if load[k] > 0)
    return (
        "no admissible force network exists: the packing is not jammed, or contacts are missing; "
        f"grains with the largest unbalanced load: {named or 'none'}"
    )
