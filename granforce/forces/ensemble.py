"""S: the admissible force networks of a packing, and the two criteria for membership.

S is convex: the plane A x = b of the `balance` of all grains, cut by one Coulomb cone per contact
of the `backbone` and by known forces (`knowledge`). Unknowns are x = (f_n1, f_t1,
f_n2, …), or (f_n1, f_n2, …) at μ = 0 where no contact can carry f_t. A cone is spanned by its two
edges, so that x = T y with y ≥ 0 and S = {T y : A T y = b, y ≥ 0}, as linear programs want it.

Two numbers, both in ⟨f_n⟩, decide whether a network is in S: its distance from the plane
(`Ensemble.residual`) and from the cones (`Ensemble.violation`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse import csgraph

from granforce import notebook
from granforce.fields import record
from granforce.forces import balance, knowledge
from granforce.forces.balance import LARGEST_RANK, left_free
from granforce.numerics import certificates, inner_point
from granforce.quantities import quantity
from granforce.records import (
    Contacts,
    InputError,
    Packing,
    UnboundedError,
    brief_list,
    real_array,
    refuse_hidden,
    whole,
)
from granforce.system import cancelling
from granforce.tolerances import ADMISSIBLE, AT_REST, BALANCED, LARGEST_UNIT, LOCKED
from granforce.types import Floats, Integers, Mask


class Hull(NamedTuple):
    """A point inside S relative to its affine hull, the walls that hold S in it, and h."""

    inner: Floats  # (n,) y of `Ensemble.scaled_form`, positive where not held
    held: Mask  # (n,) bool
    dimension: int
    b: Floats  # (rows,) A inner, A that of `Ensemble.scaled_form`
    resolution: float  # in ⟨f_n⟩ (f_t in μ ⟨f_n⟩): no point of S is farther from a held wall


@record
@dataclass(frozen=True, eq=False)
class Ensemble:
    """S = {x : A x = b, f_n ≥ 0, |f_t| ≤ μ f_n, low ≤ f ≤ high} for one packing; see `ensemble`.

    ⟨f_n⟩ = Σ f_n ℓ / Σ ℓ is 2 P0 V / Σ ℓ in all networks if the pressure is prescribed; otherwise
    it is the mean |f_n| of the packing's own network, or its mean load without forces.
    """

    packing: Annotated[Packing, "whose networks these are"]
    mu: Annotated[
        float, "the largest friction coefficient of the cones (not necessarily the packing's)"
    ]
    index: Annotated[Integers, quantity("backbone", note="the unknown contacts")]
    contacts: Annotated[Contacts, "their geometry"]
    grains: Annotated[Integers, "(M,) grains of the backbone, as positions in packing.x"]
    A: Annotated[sparse.csr_matrix, "(rows, unknowns): forces and torque/r by grain, then stress"]
    b: Annotated[Floats, "(rows,) force"]
    force_scale: Annotated[float, quantity("force_scale")]
    original: Annotated[Floats, quantity("original", label="")]
    frozen: Annotated[
        Integers, "contacts held at their original forces, as positions in packing.contacts"
    ]
    skipped: Annotated[
        dict[str, int], "counts left out: rattlers, unloaded contacts, tangential unknowns"
    ]
    prescribed: Annotated[str, '"pressure", "stress" (with the pressure) or "none"']
    known: Annotated[
        knowledge.Polygons | None, "bounds on single forces, in ⟨f_n⟩; None without any"
    ]
    find_hull: Annotated[
        Callable[[Ensemble], Hull], "computes `hull`, by programs that import this file"
    ]
    computed: Annotated[
        Floats | None, "(N_c, 2) a network computed while the backbone was determined"
    ] = None
    # Not copied to ensembles that are made from this one.
    conditions: Annotated[
        dict[str, Any] | None, "arguments of `ensemble`; None if made in another way"
    ] = field(default=None, init=False)

    @property
    def per_contact(self) -> int:
        """Unknowns per contact: 2, or 1 at μ = 0."""
        return 2 if self.mu > 0 else 1

    @property
    def per_grain(self) -> int:
        """Rows of A per grain: 3, or 2 if no force can turn it."""
        return balance.rows_per_grain(self.contacts, self.mu)

    @cached_property
    def friction(self) -> Floats:
        """Friction coefficient (N_c,) of each contact."""
        return self.contacts.friction(self.mu)

    @cached_property
    def slopes(self) -> Floats:
        """Slopes (N_c,) of the cones of programs: μ of each contact.

        Contacts without friction among others have cones like the roughest, and pinned f_t = 0.
        """
        return np.where(self.friction > 0, self.friction, self.mu)

    @cached_property
    def units(self) -> Floats:
        """Units (N_c, 2) of f_n and f_t in programs, in ⟨f_n⟩."""
        return knowledge.units(self.slopes)

    @property
    def from_cones(self) -> sparse.csc_matrix:
        """T (unknowns, 2 N_c): forces T y, in ⟨f_n⟩, of y = f_n ± f_t/μ."""
        size = self.per_contact
        block = np.array([[0.5, 0.5], [0.5, -0.5]])[:size]
        T = sparse.kron(sparse.identity(len(self.index)), block, format="csc")
        T.data *= self.units[:, :size].ravel()[T.indices]
        return T

    @property
    def informed(self) -> Mask:
        """Mask (N_c,) of contacts with a known force, besides f_t = 0 for want of friction."""
        if self.known is None:
            return np.zeros(len(self.index), dtype=bool)
        finite = np.isfinite(self.known.low) | np.isfinite(self.known.high)
        finite[:, 1] &= self.slopes == self.friction
        return np.asarray(finite.any(axis=1))

    @property
    def has_pressure_row(self) -> bool:
        """Whether the pressure is prescribed, alone or with the whole stress.

        It is in a periodic box without frozen contacts.
        """
        return self.prescribed != "none"

    @property
    def pressure_row(self) -> int:
        """Row of A with the pressure, if it is prescribed: the first below those of the grains."""
        return self.per_grain * len(self.grains)

    @cached_property
    def hull(self) -> Hull:
        """The affine hull of S: a point inside, the walls held, and the dimension."""
        return self.find_hull(self)

    @property
    def dimension(self) -> int:
        """Dimension h of S: free after balance, pinned components and held walls.

        2N_c − (3M − 1) in a disordered packing with prescribed pressure (N_c − (2M − 1) at μ = 0),
        more in crystals, whose rows depend on each other; two less if the whole stress is
        prescribed; and 2 N_c (N_c at μ = 0) if no grain has to balance. Directions in which S is
        narrower than FLAT do not count (`flat_directions`).
        """
        return self.hull.dimension

    @property
    def flat_directions(self) -> int:
        """Directions in which forces could balance but S is too narrow to be resolved: not in h.

        No wall is farther than `hull.resolution` from any point of S there. Components with equal
        bounds do not count, as they are prescribed.
        """
        exactly = self.known is not None and self.to_vector(self.known.low == self.known.high)
        columns = self.A.tocsc()[:, ~np.broadcast_to(exactly, self.free.shape).astype(np.bool_)]
        same = columns.shape == self.free_columns.shape
        return max(0, (self.freedom if same else self._left_free(columns)) - self.dimension)

    @cached_property
    def freedom(self) -> int:
        """Dimensions that A x = b leaves, whatever the walls: free unknowns less independent rows.

        Beyond LARGEST_RANK rows the generic value is given.
        """
        return self._left_free(self.free_columns)

    def _left_free(self, columns: sparse.csc_matrix) -> int:
        rows, unknowns = columns.shape
        if rows <= LARGEST_RANK:
            return left_free(columns)
        dependent = 2 if self.has_pressure_row else 3
        dependent = 0 if balance.left_open_in(self.packing).any() else dependent
        return max(0, unknowns - (rows - dependent))

    @property
    def is_determined(self) -> bool:
        """Whether A x = b leaves no freedom, known up to LARGEST_RANK rows."""
        return self.A.shape[0] <= LARGEST_RANK and self.freedom == 0

    @property
    def free(self) -> Mask:
        """(unknowns,) bool: components that are not pinned."""
        if self.known is None:
            return np.ones(self.A.shape[1], dtype=bool)
        return ~self.to_vector(self.known.pinned).astype(np.bool_)

    @property
    def free_columns(self) -> sparse.csc_matrix:
        """A without the columns of components that are pinned."""
        return self.A.tocsc()[:, self.free]

    @property
    def coordination(self) -> float:
        """Mean number z of contacts of a grain of the backbone; NaN without grains to balance.

        Contacts with walls belong to a grain's contacts, but walls, other grains left open and
        rattlers are not among the grains of the mean: a contact of two grains counts twice, one
        with a wall once. Without walls, z = 2N_c/N_g.
        """
        if not len(self.grains):
            return np.nan
        ends = np.isin([self.contacts.i, self.contacts.j], self.grains)
        return float(ends.sum() / len(self.grains))

    @cached_property
    def cone_form(self) -> tuple[sparse.csc_matrix, sparse.csc_matrix]:
        """(A T, T) in csc form with x = T y, y ≥ 0: f_n = (p + q)/2, f_t = μ (p − q)/2."""
        if self.mu == 0:
            T = sparse.identity(self.A.shape[1], format="csc")
        else:
            T = self.from_cones
        return sparse.csc_matrix(self.A @ T), T

    @cached_property
    def member(self) -> Floats | None:
        """A known network (N_c, 2) of S, force; None without one.

        It certifies that S is not empty, whatever a solver reports.
        """
        at_hand = (forces for forces in (self.original, self.computed) if forces is not None)
        return next((forces for forces in at_hand if self.admits(forces)), None)

    @cached_property
    def reference(self) -> Floats | None:
        """The `member` that makes redundant rows consistent; None without one.

        Up to LARGEST_RANK rows it is balanced to rounding, if that leaves it in S: its residual, up
        to BALANCED, may exceed the width of a thin S, and distant ends magnify it.
        """
        if self.member is None or self.A.shape[0] > LARGEST_RANK:
            return self.member
        vector, free = self.to_vector(self.member) / self.force_scale, self.free
        A, b = self.free_columns, self.b / self.force_scale
        rest = b - self.A @ np.where(free, 0.0, vector)
        vector[free], _ = cancelling.apart(inner_point.balanced, A, rest, vector[free])
        near = self.to_forces(vector * self.force_scale)
        return near if self.admits(near) else self.member

    @cached_property
    def scaled_form(self) -> tuple[sparse.csc_matrix, Floats, sparse.csc_matrix]:
        """(A, b, T) of S = {x = ⟨f_n⟩ T y : A y = b, y ≥ 0}; with slacks for known forces.

        The largest entry of each row of the balance is 1: torque rows are as small (or large) as μ
        otherwise, which costs solvers their last digits. If a network is known, b is A y of that
        network: its residual, up to BALANCED, would be magnified by that scale, and redundant rows
        would contradict the others.
        """
        A, b, T = self.scaled_balance
        if self.known is not None:
            A, b, T = knowledge.extended(A, b, T, self.known, self.slopes, self.known.value)
        y = None if self.reference is None else self.coordinates(self.reference)
        if y is not None and self.residual(self.to_forces(T @ y * self.force_scale)) <= BALANCED:
            b = A @ y
        return A, b, T

    @cached_property
    def slack(self) -> Floats:
        """(rows,) of `scaled_form`: how much admitted forces may differ from b."""
        scale = self._row_scale
        if self.known is None:
            return BALANCED * scale
        sides = self.known.contact, self.known.component
        parts = np.concatenate([sides, knowledge.pins(self.known, self.slopes)], axis=1)
        return np.append(BALANCED * scale, ADMISSIBLE / self.units[tuple(parts)])

    def coordinates(self, forces: Floats) -> Floats:
        """y (n,) ≥ 0 of `scaled_form` nearest to forces (N_c, 2)."""
        normal, tangential = forces.T / self.force_scale
        y = normal[:, None]
        if self.mu > 0:
            across = tangential / self.slopes
            y = np.column_stack([normal + across, normal - across])
        y = y.ravel()
        if self.known is not None:
            known = self.known
            rest = (
                known.limit - known.sign * forces[known.contact, known.component] / self.force_scale
            )
            y = np.append(y, rest / self.units[known.contact, known.component])
        return np.maximum(y, 0.0)

    @cached_property
    def bounded(self) -> bool:
        """Whether S is bounded; the pressure bounds every force."""
        return self.has_pressure_row or certificates.recession(self.scaled_form[0]) is None

    def describe_unbounded(self) -> UnboundedError:
        """An UnboundedError that names the wedged grains, and the bounds that would help.

        `takes` raises it in place of a plain one. Grains are named only if the growing forces lock
        grains whose balance is required between walls, or grains whose balance is not.
        """
        growing = self._growing_contacts()
        left_open = balance.left_open_in(self.packing)
        i, j = self.contacts.i[growing], self.contacts.j[growing]
        ends = np.union1d(i, j)
        wedged = ends[~left_open[ends]]
        error = UnboundedError(certificates.UNBOUNDED)
        if 0 < len(wedged) < len(ends):
            numbers = self.index[growing]
            one_each = numbers[np.unique(_groups(i, j, left_open), return_index=True)[1]]
            error = UnboundedError(self._wedged_words(wedged, numbers, one_each))
        error.described = True
        return error

    def _growing_contacts(self) -> Integers:
        """Contacts whose forces can grow together without a load, as many as possible."""
        ray = certificates.widest_recession(self.scaled_form[0])
        if ray is None:
            return np.zeros(0, dtype=np.int64)
        cones = ray[: self.per_contact * len(self.index)].reshape(len(self.index), -1)
        return np.flatnonzero(cones.max(axis=1) > LOCKED * ray.max())

    def _wedged_words(self, wedged: Integers, numbers: Integers, one_each: Integers) -> str:
        """wedged: grains; numbers: their contacts; one_each: one contact of each group."""
        grains, are = ("Grain", "is") if len(wedged) == 1 else ("Grains", "are")
        smaller = ""
        if self.mu > 0 and not self._grows_without_friction:
            smaller = "a smaller friction coefficient (--ensemble-mu, mu=) or "
        some = "of one of these contacts"
        if len(one_each) > 1:
            some = f"of one contact in each of {len(one_each)} groups, such as "
            some += f"{brief_list(one_each)},"
        return (
            "the forces in S are not bounded: some can press against each other without a "
            f"load. {grains} {brief_list(wedged)} (counted from 0) {are} wedged between walls or "
            f"fixed grains by contacts {brief_list(numbers)} at friction {self.mu:g}. Use "
            f"{smaller}an upper bound on f_n {some} (f_n_high in --known, known=)"
        )

    @property
    def _grows_without_friction(self) -> bool:
        """Whether S is unbounded at every friction: forces without f_t are part of all cones."""
        A, sides = self.scaled_form[0], 2 * len(self.index)
        normal = A[:, 0:sides:2] + A[:, 1:sides:2]
        return (
            certificates.recession(sparse.hstack([normal, A[:, sides:]], format="csc")) is not None
        )

    @cached_property
    def _row_scale(self) -> Floats:
        """(rows,) factors that make the largest entry of each row of `cone_form` 1."""
        largest = abs(self.cone_form[0]).max(axis=1).toarray().ravel()
        return 1 / np.where(largest > 0, largest, 1.0)

    @cached_property
    def scaled_balance(self) -> tuple[sparse.csc_matrix, Floats, sparse.csc_matrix]:
        """(A, b, T) of `scaled_form` without known forces."""
        scale = self._row_scale
        A, T = self.cone_form
        return sparse.csc_matrix(sparse.diags(scale) @ A), scale * self.b / self.force_scale, T

    def _repr_html_(self) -> str:
        """HTML for notebooks."""
        lines = {
            "disks of the backbone M": len(self.grains),
            "contacts that carry N_c": len(self.index),
            "friction coefficient μ": self.mu,
            "mean coordination z": self.coordination,
            "dimension h": self.dimension,
            **({"directions taken as pinned": flat} if (flat := self.flat_directions) else {}),
            "mean normal force ⟨fₙ⟩": self.force_scale,
            "prescribed": self.prescribed,
        }
        if len(self.frozen):
            lines["frozen contacts"] = len(self.frozen)
        if self.informed.any():
            lines["contacts with a known force"] = int(self.informed.sum())
        left_out = {name.replace("_", " "): n for name, n in self.skipped.items() if n}
        return notebook.table("Admissible force networks S", lines | left_out)

    @property
    def bounds(self) -> Floats:
        """Known forces, as bounds (N_c, 2, 2) [contact, component, low or high], force."""
        if self.known is None:
            return np.tile([-np.inf, np.inf], (len(self.index), 2, 1))
        return self.force_scale * np.stack([self.known.low, self.known.high], axis=-1)

    def with_bounds(self, bounds: Floats, network: Floats) -> Ensemble:
        """The ensemble with other `bounds`; network (N_c, 2): a network of S, force."""
        known = knowledge.polygons(bounds, self.slopes, self.force_scale, self.index)
        return replace(self, known=known, computed=network)

    def with_normal(self, position: int, network: Floats) -> Ensemble:
        """The ensemble with f_n of the contact at `position` known as well.

        network (N_c, 2): a network of S with that f_n, which becomes its `member`.
        """
        bounds = self.bounds
        bounds[position, 0] = network[position, 0]
        return self.with_bounds(bounds, network)

    def positions(self, contacts: npt.ArrayLike) -> Integers:
        """Positions of contacts in the ensemble.

        Parameters
        ----------
        contacts : (k,) array of int
            Numbers in the packing.

        Returns
        -------
        (k,) array of int
            Such that ``index[positions]`` are the contacts.

        Raises
        ------
        InputError
            For contacts that carry no force in the packing.
        """
        contacts = np.asarray(refuse_hidden(contacts, "contacts"))
        if contacts.ndim != 1 or not (contacts.dtype.kind in "iuf" or not contacts.size):
            raise InputError("contacts must be a list of contact numbers of the packing")
        unknown = contacts[~np.isin(contacts, self.index)]
        if len(unknown):
            raise InputError(
                f"contact {unknown[0]} is not one of the {len(self.index)} that carry a load in "
                "this packing"
            )
        return np.searchsorted(self.index, contacts)

    def position(self, contact: int) -> int:
        """Position in the ensemble of one contact of the packing; InputError for any other."""
        return int(self.positions([whole(contact, "the number of a contact")])[0])

    def networks(self, forces: Any, name: str = "forces") -> Any:
        """Forces as an array (…, N_c, 2); InputError for those of another number of contacts."""
        if not (type(forces) is np.ndarray and forces.dtype == np.float64):
            forces = real_array(forces, name)
        count = len(self.index)
        if forces.shape[-2:] != (count, 2):
            raise InputError(
                f"{name} of shape {forces.shape} are not networks of this ensemble, which has "
                f"{count} contacts: (…, {count}, 2)"
            )
        return forces

    def network(self, forces: npt.ArrayLike, name: str) -> Floats:
        """One network (N_c, 2) to begin with, not so large that its squares overflow.

        NaN is not refused: no solver converges from it.
        """
        network = real_array(forces, name)
        if network.shape != (len(self.index), 2):
            raise InputError(f"{name} must have shape {(len(self.index), 2)}, got {network.shape}")
        if np.abs(network).max(initial=0.0) > LARGEST_UNIT * self.force_scale:
            raise InputError(f"{name} is beyond {LARGEST_UNIT:g} times the mean normal force")
        return network

    def refuse_foreign(self, forces: Any, residual: Any, name: str) -> None:
        """InputError unless networks (…, N_c, 2) of a result belong to this ensemble.

        They must balance here nearly as well as in their own ensemble (residual (…,)) and respect
        its cones: networks of another packing, or at another μ, would silently give wrong numbers.
        """
        forces = self.networks(forces, name)
        balanced = np.all(self.residual(forces) <= np.maximum(AT_REST, 2 * np.asarray(residual)))
        if not (balanced and np.all(self.violation(forces) <= AT_REST)):
            raise InputError(f"{name} belongs to another ensemble")

    def to_vector(self, forces: Any) -> Any:
        """Forces (…, N_c, 2) as vectors x (…, unknowns)."""
        forces = self.networks(forces)
        unknowns = forces.shape[-2] * self.per_contact
        return forces[..., : self.per_contact].reshape(*forces.shape[:-2], unknowns)

    def to_forces(self, vector: Floats) -> Floats:
        """Vectors x (…, unknowns) as forces (…, N_c, 2)."""
        shape = (*vector.shape[:-1], len(self.index), self.per_contact)
        forces = np.zeros((*shape[:-1], 2))
        forces[..., : self.per_contact] = vector.reshape(shape)
        return forces

    def expand(self, forces: Floats) -> Floats:
        """Forces of S on all contacts of the packing: zero off the backbone.

        Parameters
        ----------
        forces : (…, N_c, 2) array
            Networks.

        Returns
        -------
        (…, contacts of the packing, 2) array
            Frozen contacts have their original forces.
        """
        forces = self.networks(forces)
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
        """Largest unbalance |A x − b| over rows, in ⟨f_n⟩.

        Parameters
        ----------
        forces : (…, N_c, 2) array
            Networks; NaN gives NaN.

        Returns
        -------
        float or (…,) array
            Rows are force components and torque/r of every backbone grain, and the pressure as mean
            normal force (with it the stress, where that is prescribed).
        """
        x = self.to_vector(forces)
        columns = x.reshape(int(np.prod(x.shape[:-1])), x.shape[-1]).T
        rows = np.abs(self.A @ columns - self.b[:, None])
        worst = rows.max(axis=0, initial=0.0) / self.force_scale
        return _plain(worst.reshape(x.shape[:-1]))

    def violation(self, forces: Floats) -> Any:
        """Largest violation of f_n ≥ 0, |f_t| ≤ μ f_n and what is known, in ⟨f_n⟩.

        Parameters
        ----------
        forces : (…, N_c, 2) array
            Networks.

        Returns
        -------
        float or (…,) array
            0 inside the cones.
        """
        forces = self.networks(forces)
        normal, tangential = forces[..., 0], forces[..., 1]
        excess = np.maximum(-normal, np.abs(tangential) - self.friction * np.maximum(normal, 0.0))
        worst = np.maximum(excess.max(axis=-1, initial=0.0), 0.0) / self.force_scale
        if self.known is not None:
            scaled = forces / self.force_scale
            outside = np.maximum(self.known.low - scaled, scaled - self.known.high)
            worst = np.maximum(worst, outside.max(axis=(-2, -1), initial=0.0))
        return _plain(worst)

    def admits(
        self, forces: Floats, residual: float = BALANCED, violation: float = ADMISSIBLE
    ) -> Any:
        """Whether forces are an equilibrium inside the cones.

        Parameters
        ----------
        forces : (…, N_c, 2) array
            Networks.
        residual, violation : float
            Tolerances, in ⟨f_n⟩.

        Returns
        -------
        bool or (…,) array of bool
            For each network.
        """
        return (self.residual(forces) <= residual) & (self.violation(forces) <= violation)


def _groups(i: Integers, j: Integers, left_open: Mask) -> Integers:
    """Number (k,) of the group of each contact i, j that shares grains which are not left open."""
    both = ~left_open[i] & ~left_open[j]
    bonds = sparse.coo_matrix((np.ones(both.sum()), (i[both], j[both])), (len(left_open),) * 2)
    return csgraph.connected_components(bonds, directed=False)[1][np.where(left_open[i], j, i)]


def _plain(values: Floats) -> Floats | float:
    return float(values) if values.ndim == 0 else values
