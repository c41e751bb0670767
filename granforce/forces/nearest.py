"""The admissible network nearest to given forces, by Newton's method on grain velocities.

The dual of the projection onto S has one unknown per balance equation: velocities v of the grains
and the dilation rate of the box. Contact forces follow from v contact by contact, as the
projection of the start + Aᵀv onto the cone, and the change of the unbalance with v is a weighted
Laplacian of the contact graph, A K Aᵀ, with one 2×2 conductance K per contact. Two phases:

1. A barrier keeps forces inside their cones, so that K (between 0 and 1) changes smoothly, and is
   lowered step by step (`contact_program`, w = 1).
2. Once the barrier is low enough to tell which contacts stick, slide and open, Newton's method
   without a barrier ends in the exact optimum after one to three steps. Started too early it leaves
   the neighbourhood at once; the first phase then continues.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from granforce.forces.contact_problem import problem_of
from granforce.forces.ensemble import Ensemble
from granforce.forces.nearest_piqp import likeliest_piqp, restored
from granforce.numerics import certificates, cone_projection, contact_program, highs, interior_point
from granforce.numerics.contact_program import PINNED, Problem
from granforce.numerics.interior_point import OPTIMUM, PROJECTED
from granforce.numerics.lanes import LANES, MANY, ONE
from granforce.records import InputError, Relaxation, float_array, positive, takes, whole
from granforce.system import cancelling
from granforce.tolerances import BALANCED
from granforce.types import Cancel, Floats

# Distance to the nearest network itself (over all components) that ends the steps. This and INSIDE
# are in ⟨f_n⟩, or in rms forces of the start where those are larger.
NEAREST = 1e-6
# First forces and multipliers lie at least this far inside their cones: with 0.3 and less steps
# are short (three times as many at 0.1).
INSIDE = 1.0
# The second phase is tried when the mean of f · multiplier (in ⟨f_n⟩²) has fallen to this, and
# each time it has fallen by LOWER since; it may take so many steps, and is given up where the
# unbalance (in ⟨f_n⟩) exceeds LOST.
ATTEMPT, LOWER, FINAL_STEPS, LOST = 1e-6, 1e-2, 3, 1.0
# Steps after which no network will be reached; 10 to 40 are usual.
MOST_STEPS = 100
# Steps shorter than this, so many in a row, mean that no network will be reached.
SHORT, SHORT_IN_A_ROW = 1e-4, 8


@takes(Ensemble)
def nearest(
    ensemble: Ensemble,
    start: Floats,
    *,
    tolerance: float = BALANCED,
    max_iterations: int = MOST_STEPS,
    cancel: Cancel | None = None,
) -> Relaxation:
    """The point of S with the least Σ |F_c − F_start,c|².

    Ends when the residual is below the tolerance and the distance to the optimum below 10⁻⁶ ⟨f_n⟩.

    Parameters
    ----------
    ensemble : Ensemble
        S.
    start : (N_c, 2) array
        Force.
    tolerance : float, default 10⁻¹⁰
        Residual, in ⟨f_n⟩.
    max_iterations : int, default 100
        Of the solver.
    cancel : callable, optional
        Polled; returning True raises Cancelled.

    Returns
    -------
    Relaxation
        ``converged`` is False where the end was not reached (S is empty, or max_iterations were too
        few): forces are the last iterate, inside the cones.
    """
    (relaxation,) = nearest_of_many(
        ensemble, [start], tolerance=tolerance, max_iterations=max_iterations, cancel=cancel
    )
    return relaxation


@takes(Ensemble)
def nearest_of_many(
    ensemble: Ensemble,
    starts: Sequence[Floats],
    *,
    tolerance: float = BALANCED,
    max_iterations: int = MOST_STEPS,
    cancel: Cancel | None = None,
) -> list[Relaxation]:
    """`nearest` of each of the starts, vectorised: bit-identical results.

    Parameters
    ----------
    ensemble : Ensemble
        S.
    starts : sequence of (N_c, 2) array
        Force.
    tolerance, max_iterations, cancel
        As for `nearest`.

    Returns
    -------
    list of Relaxation
        In the order of the starts.
    """
    if cancel is not None:
        with cancelling.scope(cancel):
            return nearest_of_many(
                ensemble, starts, tolerance=tolerance, max_iterations=max_iterations
            )
    tolerance = positive(tolerance, "tolerance", or_zero=True)
    max_iterations = whole(max_iterations, "max_iterations", 1)
    starts = [ensemble.network(start, "start") for start in _each(starts)]
    relaxations: list[Relaxation] = []
    while len(relaxations) < len(starts):
        left = starts[len(relaxations) :]
        relaxations += _batch(
            ensemble, left[: LANES if len(left) > 1 else 1], tolerance, max_iterations
        )
    return relaxations


def _each(starts: Any) -> list[Any]:
    try:
        return list(starts)
    except TypeError:
        raise InputError("starts are a sequence of networks (N_c, 2)") from None


def _batch(
    ensemble: Ensemble, starts: Sequence[Floats], tolerance: float, max_iterations: int
) -> list[Relaxation]:
    begin = time.perf_counter()
    problem, width = problem_of(ensemble), 1 if len(starts) == 1 else LANES
    targets = np.zeros((len(ensemble.index), 2, width))
    targets[..., : len(starts)] = np.moveaxis(np.asarray(starts, dtype=np.float64), 0, -1)
    search = Search(problem, targets / ensemble.force_scale)
    search.run(min(tolerance, BALANCED) / 4, max_iterations, len(starts))
    forces = ensemble.pin(search.forces() * ensemble.force_scale)
    converged = [search.ended[k] for k in range(len(starts))]
    if ensemble.member is not None and max_iterations >= MOST_STEPS:
        # S is not empty, and the step limit was not reached: at μ ≳ 10³ the steps may fail to
        # converge.
        for k in np.flatnonzero(~np.array(converged)).tolist():
            if np.isfinite(starts[k]).all():
                forces[k] = likeliest_piqp(ensemble, np.ones_like(forces[k]), starts[k])
                converged[k] = ensemble.admits(forces[k])
    residual = ensemble.residual(forces[: len(starts)])
    seconds = (time.perf_counter() - begin) / len(starts)
    return [
        Relaxation(
            forces=forces[k],
            iterations=search.steps[k],
            residual=float(residual[k]),
            violation=ensemble.violation(forces[k]),
            converged=bool(converged[k] and residual[k] <= tolerance),
            seconds=seconds,
        )
        for k in range(len(starts))
    ]


def starting_network(ensemble: Ensemble) -> Floats:
    """The packing's own network (N_c, 2), or another admitted one if that is outside S.

    Raises NotJammedError if S is empty, UndecidedError if this could not be decided.
    """
    if ensemble.admits(ensemble.original):
        return ensemble.original
    network = nearest(ensemble, ensemble.original).forces
    if ensemble.admits(network):
        return network
    member = ensemble.member
    if member is not None:
        return member
    network = some_network(ensemble, ensemble.original)
    if not ensemble.admits(network):
        A, b, _ = ensemble.scaled_form
        raise certificates.why_unsolved(A, b, slack=ensemble.slack)
    return network


def given_network(ensemble: Ensemble, state: Floats | None) -> Floats:
    """A network (N_c, 2) given as `state`, by default the `starting_network`.

    Raises InputError for another shape, and for forces that are not finite.
    """
    network = starting_network(ensemble) if state is None else state
    return float_array(ensemble.network(network, "state"), (-1, 2), "state")


def some_network(ensemble: Ensemble, start: Floats) -> Floats:
    """A network (N_c, 2) of S, the one nearest to start if the steps converge.

    Otherwise PIQP is tried, then HiGHS, whose vertices are exact to rounding. If all fail, the
    result is the known network if it is the only one, or else the last iterate, which is not
    admitted.
    """
    network = nearest(ensemble, start).forces
    if ensemble.admits(network):
        return network
    other = likeliest_piqp(ensemble, np.ones_like(start), start)
    if ensemble.admits(other):
        return other
    A, b, _ = ensemble.scaled_form
    for y in highs.points(A, b):
        other = restored(ensemble, y)
        if ensemble.admits(other):
            return other
    only = ensemble.member
    return network if only is None or ensemble.dimension else only


class Search:
    """Up to LANES searches at once, each at its own step."""

    def __init__(self, problem: Problem, targets: Floats, start: Floats | None = None) -> None:
        """targets (N_c, 2, W) in ⟨f_n⟩; those of lanes that are not used are 0.

        start (2 N_c, W): first y of contacts with pinned components, by default the problem's.
        """
        width = targets.shape[2]
        self.problem, self.lanes = problem, ONE if width == 1 else MANY
        self.at = contact_program.make_iterate(problem, width)
        self.work = contact_program.make_workspace(problem, width)
        self.count = max(1, len(targets))
        # Distant starts need proportional room: from 10⁴ ⟨f_n⟩ away this takes a third of the
        # steps.
        square = [np.sum(np.ascontiguousarray(targets[..., k]) ** 2) for k in range(width)]
        self.size = np.maximum(1.0, np.sqrt(np.array(square) / self.count))
        self._begin(targets, start)
        self.steps, self.short = [0] * width, [0] * width
        self.ended = [False] * width
        self.solution = self.at.y[:-1].copy()

    def _begin(self, targets: Floats, start: Floats | None) -> None:
        """y and z of each contact's own projection, moved inside; pinned ones stay."""
        problem, mu, at = self.problem, self.problem.mu[:, None], self.at
        first, second = slice(0, len(problem.w), 2), slice(1, len(problem.w), 2)
        pinned = np.flatnonzero(np.repeat((problem.w >= PINNED).reshape(-1, 2).any(axis=1), 2))
        if start is not None:
            at.y[pinned] = start[pinned]
        stay = at.y[pinned]
        normal, tangential = targets[:, 0], mu * targets[:, 1]
        at.c[first], at.c[second] = -0.5 * (normal + tangential), -0.5 * (normal - tangential)
        cone_projection.project(self.problem, at, self.work, self.lanes)
        f_n, f_t = 0.5 * (at.y[first] + at.y[second]), 0.5 * (at.y[first] - at.y[second])
        slope_n, slope_t = f_n - normal, mu * mu * f_t - tangential
        inside = INSIDE * self.size
        at.y[:-1] = np.maximum(at.y[:-1], 0.0) + inside
        at.y[pinned] = stay
        at.z[first] = np.maximum(0.5 * (slope_n + slope_t), 0.0) + inside
        at.z[second] = np.maximum(0.5 * (slope_n - slope_t), 0.0) + inside
        slacks = slice(len(problem.w), len(at.z) - 1)
        at.y[slacks], at.z[slacks] = problem.start[slacks, None], 1.0

    def run(self, tolerance: float, most: int, used: int) -> None:
        """Step until every lane in use has converged or failed."""
        near = [NEAREST * size for size in self.size.tolist()]
        # Between sides, `project` does not know the nearest point.
        attempt = [0.0 if len(self.problem.side) else ATTEMPT * self.count] * len(near)
        active = list(range(used))
        while active:
            cancelling.check()
            product, unbalance, slackness = self._look()
            ready, going = [], []
            for k in active:
                solved = unbalance[k] <= tolerance and slackness[k] <= near[k]
                if solved and product[k] <= near[k] ** 2:
                    self._end(k, True)
                elif product[k] < attempt[k]:  # once only where it is 0
                    ready.append(k)
                elif (
                    self.steps[k] >= most
                    or self.short[k] >= SHORT_IN_A_ROW
                    or not product[k] < 1e200
                ):
                    self._end(k, False)
                else:
                    going.append(k)
            active = ready + going
            # Lanes that are ready wait for the others, which share the factorisation.
            if going:
                self._step(going)
            elif ready:
                for k in ready:
                    attempt[k] = LOWER * product[k]
                active = self._finish(ready, tolerance, most)

    def forces(self) -> Floats:
        """Forces (W, N_c, 2) found, in ⟨f_n⟩."""
        pairs = self.solution[: len(self.problem.w)].reshape(-1, 2, self.solution.shape[1])
        normal, tangential = 0.5 * (pairs[:, 0] + pairs[:, 1]), 0.5 * (pairs[:, 0] - pairs[:, 1])
        return np.moveaxis(np.stack([normal, self.problem.mu[:, None] * tangential], axis=1), -1, 0)

    def _look(self) -> tuple[list[float], list[float], list[float]]:
        """Products, unbalance and slackness by lane."""
        interior_point.look(self.problem, False, self.at, self.work, self.lanes)
        work = self.work
        return work.product[0].tolist(), work.unbalance[0].tolist(), work.slackness[0].tolist()

    def _end(self, lane: int, reached: bool) -> None:
        self.solution[:, lane] = self.at.y[:-1, lane]
        self.ended[lane] = reached

    def _advance(self, going: Sequence[int], mode: int) -> None:
        """One step of the lanes `going`."""
        self.work.going[:] = 0.0
        for k in going:
            self.work.going[0, k] = 1.0
            self.steps[k] += 1
        interior_point.advance(self.problem, False, mode, self.at, self.work, self.lanes)

    def _step(self, going: Sequence[int]) -> None:
        self._advance(going, OPTIMUM)
        for k in going:
            length = min(self.work.primal[0, k], self.work.dual[0, k])
            self.short[k] = self.short[k] + 1 if length < SHORT else 0

    def _finish(self, ready: Sequence[int], tolerance: float, most: int) -> list[int]:
        """Newton's method without barrier, from the iterate's v; which lanes did not converge.

        Those return to their previous iterate and continue.
        """
        at, trying = self.at, ready
        kept = at.y.copy(), at.v.copy(), at.v_border.copy()
        for attempt in range(FINAL_STEPS + 1):
            cone_projection.project(self.problem, at, self.work, self.lanes)
            unbalance, going = self.work.unbalance[0].tolist(), []
            for k in trying:
                if unbalance[k] <= tolerance:
                    self._end(k, True)
                elif unbalance[k] < LOST and self.steps[k] < most:
                    going.append(k)
            trying = going
            if attempt == FINAL_STEPS or not trying:
                break
            self._advance(trying, PROJECTED)
        left = [k for k in ready if not self.ended[k]]
        for values, before in zip((at.y, at.v, at.v_border), kept, strict=True):
            values[:, left] = before[:, left]
        return left
