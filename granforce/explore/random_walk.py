"""The paper's random walk in S: perturb every force, relax to an equilibrium, accept or stay.

The paper relaxes by contact dynamics: relax=gauss_seidel with rest=None and tolerance=EQUILIBRIUM.
By default the network nearest to the perturbed one is taken, which is found 10 to 400 times faster
and for every perturbation; it visits the same kind of states (see `granforce bench`, part walks).
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from granforce import measures, notebook
from granforce.forces.ensemble import Ensemble
from granforce.forces.gauss_seidel import SideBySide, gauss_seidel
from granforce.forces.nearest import nearest, nearest_of_many, starting_network
from granforce.numerics.lanes import LANES
from granforce.records import (
    Cancel,
    Floats,
    InputError,
    Integers,
    NotJammedError,
    Progress,
    Relaxation,
)
from granforce.system import cancelling
from granforce.tolerances import ADMISSIBLE, BALANCED

# Chains from which on a thread steps them side by side: eight lanes cost as much as three chains.
WORTH_LANES = 4
SHUFFLED = ("order", "seed")  # options of relaxations that each have their own order of contacts


Seed = int | np.random.SeedSequence
Relax = Callable[..., Relaxation]  # as `nearest`


class Walk(NamedTuple):
    """Accepted states of one or more chains, and what it took to reach them."""

    states: Floats  # (S, N_c, 2) admissible networks, force
    residual: Floats  # (S,) in ⟨f_n⟩, by Ensemble.residual
    violation: Floats  # (S,) in ⟨f_n⟩, by Ensemble.violation
    sweeps: Integers  # (S,) solver iterations spent since the state before, failures included
    attempts: Integers  # (S,) perturbations tried since the state before
    counts: dict[str, int]  # accepted, rejected (no equilibrium), unconverged, skipped (a point)

    @property
    def acceptance(self) -> float:
        """Part of all attempts that gave a new state (1 where none was needed)."""
        tried = sum(self.counts[name] for name in ("accepted", "rejected", "unconverged"))
        return self.counts["accepted"] / tried if tried else 1.0

    def _repr_html_(self) -> str:
        """The walk as notebooks show it."""
        lines = {"states": len(self.states), "acceptance": self.acceptance, **self.counts}
        if self.states.size:
            lines |= {"η1": measures.eta1(self.states), "η2": measures.eta2(self.states)}
            lines["largest residual / ⟨fₙ⟩"] = self.residual.max()
            lines["largest violation / ⟨fₙ⟩"] = self.violation.max()
        return notebook.table("Random walk in S", lines)


class Found(NamedTuple):
    """One accepted state of a walk under way, as `watch` of `walk` gets it."""

    chain: int
    number: int  # among the chain's states, from 0
    forces: Floats  # (N_c, 2) its own copy
    residual: float  # ⟨f_n⟩
    violation: float  # ⟨f_n⟩
    attempts: int  # perturbations tried since the state before


class ChainState(NamedTuple):
    """Where a chain stands: its forces and its own random stream."""

    forces: Floats  # (N_c, 2)
    rng: np.random.Generator


class Attempt(NamedTuple):
    """What one step did."""

    relaxation: Relaxation  # of the perturbed forces
    outcome: str  # "accepted": the chain moved; "rejected" or "unconverged": it did not


def init(ensemble: Ensemble, seed: Seed) -> ChainState:
    """A chain at the packing's own network, or at the nearest admissible one if that left S.

    seed: anything numpy.random.default_rng takes. Raises NotJammedError where S is empty.
    """
    return ChainState(np.array(starting_network(ensemble)), np.random.default_rng(seed))


def step(
    ensemble: Ensemble, state: ChainState, *, relax: Relax = nearest, **options: Any
) -> tuple[ChainState, Attempt]:
    """One attempt: add to every component a number uniform in ±⟨F_n⟩ of the state, then relax.

    Returns (state, Attempt): "accepted" moves the chain; "rejected" (the solver ended, but not in
    equilibrium) and "unconverged" (it ran out of iterations) leave it. The given state is left as
    it was.
    """
    start, rng = kicked(ensemble, state)
    return _moved(state, rng, relax(ensemble, start, **options), options)


def kicked(ensemble: Ensemble, state: ChainState) -> tuple[Floats, np.random.Generator]:
    """A state's forces (N_c, 2), a number uniform in ±⟨F_n⟩ added to each, and the stream then."""
    rng = copy.deepcopy(state.rng)
    amplitude = np.mean(state.forces[:, 0])
    kick = rng.uniform(-amplitude, amplitude, state.forces.shape)
    if ensemble.mu == 0:
        kick[:, 1] = 0.0
    return state.forces + kick, rng


def _moved(
    state: ChainState, rng: np.random.Generator, relaxation: Relaxation, options: dict[str, Any]
) -> tuple[ChainState, Attempt]:
    outcome = judge(relaxation, options.get("tolerance", BALANCED))
    forces = relaxation.forces if outcome == "accepted" else state.forces
    return ChainState(forces, rng), Attempt(relaxation, outcome)


def judge(relaxation: Relaxation, tolerance: float = BALANCED) -> str:
    """ "accepted", "rejected" or "unconverged", by residual and violation in ⟨f_n⟩."""
    if not relaxation.converged:
        return "unconverged"
    admitted = relaxation.residual <= tolerance and relaxation.violation <= ADMISSIBLE
    return "accepted" if admitted else "rejected"


@cancelling.cancellable
def walk(
    ensemble: Ensemble,
    states: int,
    seed: int,
    *,
    chains: int = 1,
    workers: int = 1,
    relax: Relax = nearest,
    max_attempts: int | None = None,
    whole: bool = True,
    skip: bool = True,
    begun: Walk | None = None,
    enough: Callable[[], bool] | None = None,
    progress: Progress | None = None,
    watch: Callable[[Found], object] | None = None,
    cancel: Cancel | None = None,
    **options: Any,
) -> Walk:
    """Random walk until `states` accepted states in all; chains follow each other in the result.

    chains: independent walks from the original network, states shared out evenly; workers: threads
    they run on; many chains go side by side in each. Neither changes the result. relax, options:
    the relaxation and its options. max_attempts: per chain, by default 20 per state. whole: whether
    fewer states than wanted are an error; else there may be fewer, or none.
    begun: a Walk of one chain, otherwise the same, with fewer states: its chain goes on. enough():
    asked after each state of a chain that is alone; True ends it with the states that it has.
    progress(done, total); watch(Found) gets each state as it is accepted, from the thread that
    found it; neither changes the result. cancel() returning True raises Cancelled.

    Where S is a single point (h = 0) every state is that point and no relaxation is done, unless
    skip is False: sweeps end where the unbalance is small, which is not quite that point. Raises
    InputError for sizes below 1, and for more than one chain that goes on or ends by `enough`;
    NotJammedError when max_attempts bring too few of a whole walk.
    """
    if states < 1 or chains < 1 or workers < 1 or chains > states:
        raise InputError("states, chains and workers must be at least 1, and chains ≤ states")
    if chains > 1 and not (begun is None and enough is None):
        raise InputError("only one chain alone goes on from a walk, or ends when it is enough")
    seeds = np.random.SeedSequence(seed).spawn(chains)
    all_chains = []
    for k, own in enumerate(seeds):
        share = states // chains + (k < states % chains)
        limit = max_attempts or 20 * share
        all_chains.append(_Chain(ensemble, k, share, own, limit, whole))
    if begun is not None:
        all_chains[0].go_on(begun, watch)

    def tell() -> None:
        if progress is not None:
            progress(sum(chain.counts["accepted"] for chain in all_chains), states)

    if ensemble.dimension == 0 and skip:
        parts = [chain.single_point() for chain in all_chains]
    else:
        with cancelling.threads(workers) as pool:
            groups = _groups(all_chains, relax, workers, options)
            list(pool.map(lambda group: _run(group, relax, tell, watch, enough, options), groups))
        parts = [chain.walked() for chain in all_chains]
    counts = {name: sum(part.counts[name] for part in parts) for name in parts[0].counts}
    return Walk(
        states=np.concatenate([part.states for part in parts]),
        residual=np.concatenate([part.residual for part in parts]),
        violation=np.concatenate([part.violation for part in parts]),
        sweeps=np.concatenate([part.sweeps for part in parts]),
        attempts=np.concatenate([part.attempts for part in parts]),
        counts=counts,
    )


def _groups(
    chains: list[_Chain], relax: Relax, workers: int, options: dict[str, Any]
) -> list[list[_Chain]]:
    """Chains that go side by side, in lanes if there are enough; it changes nothing in them."""
    in_lanes = relax is nearest or (relax is gauss_seidel and options.keys().isdisjoint(SHUFFLED))
    together = min(LANES, -(-len(chains) // workers)) if in_lanes else 1
    together = together if together >= WORTH_LANES else 1
    return [chains[k : k + together] for k in range(0, len(chains), together)]


def _run(
    group: list[_Chain],
    relax: Relax,
    tell: Callable[[], None],
    watch: Callable[[Found], object] | None,
    enough: Callable[[], bool] | None,
    options: dict[str, Any],
) -> None:
    """All chains of a group to their end."""
    if len(group) == 1:
        found = _alone(group[0], relax, options)
    elif relax is nearest:
        found = _in_step(group, options)
    else:
        found = _each_at_its_pace(group, options)
    for chain, relaxation in found:
        accepted = chain.take(relaxation, options)
        if accepted and watch is not None:
            watch(chain.found())
        if accepted and enough is not None:
            chain.ended = enough()
        tell()
        cancelling.check("random walk")


# Each yields (chain, relaxation of its kicked state) until no chain goes on.


def _alone(
    chain: _Chain, relax: Relax, options: dict[str, Any]
) -> Iterator[tuple[_Chain, Relaxation]]:
    while not chain.done:
        yield chain, relax(chain.ensemble, chain.kicked(), **options)


def _in_step(chains: list[_Chain], options: dict[str, Any]) -> Iterator[tuple[_Chain, Relaxation]]:
    while left := [chain for chain in chains if not chain.done]:
        starts = [chain.kicked() for chain in left]
        if len(left) > 1:
            found = nearest_of_many(left[0].ensemble, starts, **options)
        else:
            found = [nearest(left[0].ensemble, starts[0], **options)]
        yield from zip(left, found, strict=True)


def _each_at_its_pace(
    chains: list[_Chain], options: dict[str, Any]
) -> Iterator[tuple[_Chain, Relaxation]]:
    beside = SideBySide(chains[0].ensemble, len(chains), **options)
    for lane, chain in enumerate(chains):
        beside.begin(lane, chain.kicked())
    going_on = len(chains)
    while going_on:
        for lane, relaxation in beside.ended():
            yield chains[lane], relaxation
            if chains[lane].done:
                going_on -= 1
            else:
                beside.begin(lane, chains[lane].kicked())


class _Chain:
    """One chain of a walk, and the states it has found."""

    def __init__(
        self, ensemble: Ensemble, number: int, states: int, seed: Seed, limit: int, whole: bool
    ) -> None:
        self.ensemble, self.number = ensemble, number
        self.limit, self.whole, self.ended = limit, whole, False
        self.state = init(ensemble, seed)
        self.rng = self.state.rng  # after the attempt under way
        self.counts = {"accepted": 0, "rejected": 0, "unconverged": 0, "skipped": 0}
        self.states = np.empty((states, *self.state.forces.shape))
        self.sweeps, self.attempts = np.zeros((2, states), dtype=np.int64)
        self.residual, self.violation = np.empty((2, states))

    @property
    def done(self) -> bool:
        """Whether it has all its states, or may end without them."""
        ended = not self.whole and sum(self.counts.values()) >= self.limit
        return ended or self.ended or self.counts["accepted"] == len(self.states)

    def go_on(self, begun: Walk, watch: Callable[[Found], object] | None) -> None:
        """Take over the states of a walk that was the same so far, and its place in the stream."""
        tried = int(begun.attempts.sum())
        if len(begun.states) > len(self.states) or tried != sum(begun.counts.values()):
            raise InputError("the walk to go on from has more states, or ended between two")
        self.counts = dict(begun.counts)
        for name in ("states", "residual", "violation", "sweeps", "attempts"):
            getattr(self, name)[: len(begun.states)] = getattr(begun, name)
        for _ in range(tried):  # each attempt drew so many numbers
            self.rng.uniform(size=self.state.forces.shape)
        self.state = ChainState(np.array(begun.states[-1]), self.rng)
        if watch is not None:
            for k in range(len(begun.states)):
                watch(self.found(k))

    def kicked(self) -> Floats:
        """The start of the next attempt; NotJammedError where there were too many."""
        if sum(self.counts.values()) >= self.limit:
            raise NotJammedError(
                f"only {self.counts['accepted']} of {len(self.states)} states after {self.limit} "
                f"attempts ({self.counts['rejected']} rejected, {self.counts['unconverged']} "
                "unconverged): allow more iterations, or take another relaxation"
            )
        start, self.rng = kicked(self.ensemble, self.state)
        return start

    def take(self, relaxation: Relaxation, options: dict[str, Any]) -> bool:
        """Count an attempt, and keep its state if it is accepted; whether it was."""
        k = self.counts["accepted"]
        self.state, (_, outcome) = _moved(self.state, self.rng, relaxation, options)
        self.counts[outcome] += 1
        self.sweeps[k] += relaxation.iterations
        self.attempts[k] += 1
        if outcome == "accepted":
            self.states[k] = relaxation.forces
            self.residual[k] = relaxation.residual
            self.violation[k] = relaxation.violation
        return outcome == "accepted"

    def found(self, k: int = -1) -> Found:
        """A state accepted, by default the last one."""
        k %= self.counts["accepted"]
        numbers = float(self.residual[k]), float(self.violation[k]), int(self.attempts[k])
        return Found(self.number, k, self.states[k].copy(), *numbers)

    def walked(self) -> Walk:
        """The chain as a Walk."""
        count = self.counts["accepted"] + self.counts["skipped"]
        return Walk(
            states=self.states[:count],
            residual=self.residual[:count],
            violation=self.violation[:count],
            sweeps=self.sweeps[:count],
            attempts=self.attempts[:count],
            counts=self.counts,
        )

    def single_point(self) -> Walk:
        """The Walk where S is the one point that the chain stands at."""
        self.counts["skipped"] = len(self.states)
        self.states[:] = self.state.forces
        self.residual[:] = self.ensemble.residual(self.state.forces)
        self.violation[:] = self.ensemble.violation(self.state.forces)
        return self.walked()
