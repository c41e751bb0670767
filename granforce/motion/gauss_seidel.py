"""Relaxation by contact dynamics: the paper's Gauss–Seidel-like sweeps on a fixed geometry."""

from __future__ import annotations

import inspect
import time
from typing import Any

import numpy as np

from granforce.forces.ensemble import Ensemble
from granforce.forces.nearest import nearest
from granforce.motion import sweeps
from granforce.motion.box_motion import BOX_MASS
from granforce.motion.contact_dynamics import StepProblem, add_forces, set_stiffness
from granforce.numerics.lanes import MANY, ONE, room
from granforce.records import (
    InputError,
    Relaxation,
    choice,
    positive,
    random_seed,
    refuse_options,
    takes,
    whole,
)
from granforce.system import cancelling
from granforce.tolerances import AT_REST, BALANCED
from granforce.types import Cancel, Floats


@takes(Ensemble)
@cancelling.cancellable
def gauss_seidel(
    ensemble: Ensemble,
    start: Floats,
    *,
    order: str = "sequential",
    seed: int = 0,
    cancel: Cancel | None = None,
    **options: Any,
) -> Relaxation:
    """One step of contact dynamics from rest, by sweeps until it has ended.

    Parameters
    ----------
    ensemble : Ensemble
        S.
    start : (N_c, 2) array
        First guess, force.
    order : {"sequential", "random"}
        Of the contacts in a sweep; "random" is a new permutation each sweep.
    seed : int, default 0
        Seed of the random order.
    cancel : callable, optional
        Polled; returning True raises Cancelled.
    **options
        tolerance (10⁻¹⁰), the residual in ⟨f_n⟩ that counts as balance; rest (10⁻³), the residual
        from which the nearest network replaces further sweeps, None to sweep down to the tolerance;
        max_iterations, the most sweeps (100,000).

    Returns
    -------
    Relaxation
        ``converged`` is also True if grains move steadily: then no equilibrium is near, and the
        residual shows it.

    Raises
    ------
    InputError
        If the whole stress is prescribed or forces are known.
    """
    refuse_options(gauss_seidel, options, [*inspect.signature(SideBySide).parameters][2:])
    order = choice(order, ("sequential", "random"), "order")
    start = ensemble.network(start, "start")
    seed, alone = random_seed(seed), SideBySide(ensemble, 1, **options)
    if order == "random":
        alone.rng = np.random.default_rng(seed)
    alone.begin(0, start)
    ((_, relaxation),) = alone.ended()
    return relaxation


class SideBySide:
    """Relaxations of one ensemble in lanes, each started when another has ended, all independent.

    Each sweeps until the residual (in ⟨f_n⟩) is below `rest`, until grains move steadily
    (``converged`` with a residual above the tolerance: no equilibrium), or until max_iterations. At
    rest, the nearest admissible network replaces further sweeps down to the tolerance. With
    rest=None it sweeps down to the tolerance.
    """

    def __init__(
        self,
        ensemble: Ensemble,
        count: int,
        *,
        tolerance: float = BALANCED,
        max_iterations: int = 100_000,
        rest: float | None = AT_REST,
    ) -> None:
        self.ensemble, self.tolerance = ensemble, positive(tolerance, "tolerance", or_zero=True)
        self.rest = None if rest is None else positive(rest, "rest")
        self.most = whole(max_iterations, "max_iterations", 1)
        self.rng: np.random.Generator | None = None
        self.problem, self.at_rest, self.dilation, self.unit = from_rest(ensemble)
        set_stiffness(self.problem)
        self.lanes = ONE if count == 1 else MANY
        width = len(self.lanes)
        self.force = room(len(self.problem.i), 2, width)
        self.velocity = room(*self.at_rest.shape, width)
        self.looks = sweeps.Looks(
            dilation=np.zeros(width),
            least=np.zeros(width),
            earlier=np.zeros(width),
            back=np.zeros(width, dtype=np.int64),
            state=np.full(width, sweeps.ENDED),  # nothing started
        )
        self.sweeps = np.zeros(width, dtype=np.int64)
        self.begun = np.zeros(width)

    def begin(self, lane: int, start: Floats) -> None:
        """Relax the given forces (N_c, 2) in an idle lane."""
        self.begun[lane] = time.perf_counter()
        force = np.ascontiguousarray(start, dtype=np.float64) / self.ensemble.force_scale
        velocity = self.at_rest.copy()
        self.looks.dilation[lane] = add_forces(self.problem, force, velocity, self.dilation)
        self.force[:, :, lane], self.velocity[:, :, lane] = force, velocity
        self.looks.least[lane] = self.looks.earlier[lane] = np.inf
        self.looks.back[lane] = sweeps.STALL_AFTER
        self.looks.state[lane] = sweeps.UNDER_WAY
        self.sweeps[lane] = 0

    def ended(self) -> list[tuple[int, Relaxation]]:
        """Sweep until at least one relaxation has ended: [(lane, Relaxation)]."""
        before = self.looks.state.copy()
        sweeps.relax(
            self.problem,
            self.velocity,
            self.unit,
            self.ensemble.mu,
            self.force,
            self.tolerance if self.rest is None else self.rest,
            self.most,
            self.sweeps,
            self.looks,
            self.rng,
            cancelling.flag(),
            self.lanes,
        )
        cancelling.check("relaxation")
        going = sweeps.UNDER_WAY
        ended = np.flatnonzero((before == going) & (self.looks.state != going))
        return [(lane, self._relaxation(lane)) for lane in ended.tolist()]

    def _relaxation(self, lane: int) -> Relaxation:
        S, rest, tolerance = self.ensemble, self.rest, self.tolerance
        forces = self.force[:, :, lane] * S.force_scale
        residual = S.residual(forces)
        if rest is not None and tolerance < residual <= rest:
            forces = nearest(S, forces).forces
            residual = S.residual(forces)
        return Relaxation(
            forces=forces,
            iterations=int(self.sweeps[lane]),
            residual=residual,
            violation=S.violation(forces),
            converged=bool(self.looks.state[lane] == sweeps.SETTLED_DOWN or residual <= tolerance),
            seconds=time.perf_counter() - self.begun[lane],
        )


def from_rest(ensemble: Ensemble) -> tuple[StepProblem, Floats, float, Floats]:
    """The step problem in units of r_max and ⟨f_n⟩, and the velocities without contact forces.

    The right-hand side b of the balance (loads, frozen contacts, pressure) is the force on grains
    and box apart from the unknown contact forces. Δt = 1 throughout. Grains whose balance is not
    required do not move: they share a last row with zero inverse mass.
    """
    if ensemble.prescribed == "stress" or ensemble.known is not None:
        raise InputError(
            "contact dynamics supports only the pressure and Coulomb's law: with a prescribed "
            "stress, or known forces, use the nearest network"
        )
    contacts, grains = ensemble.contacts, ensemble.grains
    if contacts.levers is not None or ensemble.packing.shapes is not None:
        raise InputError("sweeps of contact dynamics support disks only: use the nearest network")
    if contacts.friction_ratio is not None:
        raise InputError("sweeps of contact dynamics support one μ only: use the nearest network")
    longest = float(ensemble.packing.r.max())
    r = ensemble.packing.r[grains] / longest
    row_of = np.full(len(ensemble.packing.r), len(grains))
    row_of[grains] = np.arange(len(grains))
    size = ensemble.per_grain
    count = len(contacts.i)
    held = int(np.any(row_of[np.concatenate([contacts.i, contacts.j])] == len(grains)))
    velocity = np.zeros((len(grains) + held, 3))
    outer = -ensemble.b[: size * len(grains)].reshape(-1, size) / ensemble.force_scale
    mass = np.pi * r**2
    inertia = 0.5 * mass * r**2
    velocity[: len(grains), :2] = outer[:, :2] / mass[:, None]
    if size == 3:
        velocity[: len(grains), 2] = outer[:, 2] * r / inertia
    compliance = dilation = 0.0
    length = contacts.length / longest
    if ensemble.has_pressure_row:
        # 2 V in units of r_max² and P0 in ⟨f_n⟩/r_max: P0 · 2 V = Σ ℓ, by the choice of ⟨f_n⟩.
        twice_volume = 2 * ensemble.packing.volume / longest**2
        compliance = 1 / (twice_volume * BOX_MASS)
        dilation = -length.sum() * compliance
    problem = StepProblem(
        i=row_of[contacts.i],
        j=row_of[contacts.j],
        n_x=contacts.normal[:, 0].copy(),
        n_y=contacts.normal[:, 1].copy(),
        length=length,
        arm_i=contacts.arm_i / longest,
        arm_j=contacts.arm_j / longest,
        closing=np.zeros(count),
        stiff_n=np.empty(count),
        stiff_t=np.empty(count),
        inverse_mass=np.append(1 / mass, np.zeros(held)),
        inverse_inertia=np.append(1 / inertia, np.zeros(held)),
        box_compliance=compliance,
    )
    # Converts velocities (v_x, v_y, ω) and λ back into forces in ⟨f_n⟩.
    box_unit = 1 / (compliance * length.sum()) if compliance else 0.0
    weight = np.column_stack([mass, mass, inertia / r]).ravel()
    unit = np.concatenate([weight, np.zeros(3 * held), [box_unit]])
    return problem, velocity, dilation, unit
