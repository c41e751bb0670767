"""Random walks in S: perturb every force, relax to an equilibrium, accept or stay.

The paper's walk relaxes by contact dynamics: relax="gauss_seidel_only". The nearest-network walk,
the default, moves to the network nearest to the perturbed one, which is 10 to 400 times faster and
always exists. The two spread differently (see the page on results).
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np

from granforce import measures, notebook
from granforce.fields import derived, record
from granforce.forces.ensemble import Ensemble
from granforce.forces.nearest import nearest, nearest_of_many, starting_network
from granforce.forces.nearest_piqp import nearest_piqp
from granforce.motion.gauss_seidel import SideBySide, gauss_seidel
from granforce.numerics.lanes import LANES
from granforce.quantities import quantity
from granforce.records import (
    InputError,
    NotJammedError,
    Relaxation,
    ResultWarning,
    choice,
    random_seed,
    refuse_options,
    takes,
    worker_count,
)
from granforce.records import whole as whole_number
from granforce.system import cancelling
from granforce.system.memory import check_memory
from granforce.tolerances import ADMISSIBLE, AT_REST, BALANCED, EQUILIBRIUM
from granforce.types import Cancel, Floats, Integers, Progress

# Number of chains from which a thread vectorises them: eight lanes cost as much as three chains.
WORTH_LANES = 4
UNBOUNDED_WALK = "S is unbounded, so that forces grow with the number of states"
SHUFFLED = ("order", "seed")  # options of relaxations with their own order of contacts


Seed = int | np.random.SeedSequence
Relax = Callable[..., Relaxation]  # as `nearest`
# Relaxations as typed, with their options.
RELAXATIONS: dict[str, dict[str, Any]] = {
    "nearest": {"relax": nearest},
    "nearest_piqp": {"relax": nearest_piqp},
    "gauss_seidel": {"relax": gauss_seidel},
    "gauss_seidel_only": {"relax": gauss_seidel, "rest": None, "tolerance": EQUILIBRIUM},
}


@record
class Walk(NamedTuple):
    """Accepted states of one or more chains, and the effort to reach them."""

    states: Annotated[Floats, quantity("states")]
    residual: Annotated[Floats, quantity("residual", note="by Ensemble.residual")]
    violation: Annotated[Floats, quantity("violation", note="by Ensemble.violation")]
    sweeps: Annotated[Integers, quantity("sweeps", note="since the previous state")]
    attempts: Annotated[Integers, quantity("attempts")]
    counts: Annotated[dict[str, int], "accepted, rejected (no equilibrium), unconverged, skipped"]

    @property
    @derived(quantity("acceptance"))
    def acceptance(self) -> float:
        """Fraction of attempts that gave a new state (1 if none was needed)."""
        tried = sum(self.counts[name] for name in ("accepted", "rejected", "unconverged"))
        return self.counts["accepted"] / tried if tried else 1.0

    def _repr_html_(self) -> str:
        """HTML for notebooks."""
        lines = {"states": len(self.states), "acceptance": self.acceptance, **self.counts}
        if self.states.size:
            lines |= {"η1": measures.eta1(self.states), "η2": measures.eta2(self.states)}
            lines["largest residual / ⟨fₙ⟩"] = self.residual.max()
            lines["largest violation / ⟨fₙ⟩"] = self.violation.max()
        return notebook.table("Random walk in S", lines)


@record
class WalkState(NamedTuple):
    """One accepted state of a running walk, as passed to `watch` of `walk`."""

    chain: Annotated[int, "that the state belongs to"]
    number: Annotated[int, "among the chain's states, from 0"]
    forces: Annotated[Floats, "(N_c, 2) its own copy, force"]
    residual: Annotated[float, quantity("residual", "")]
    violation: Annotated[float, quantity("violation", "")]
    attempts: Annotated[int, quantity("attempts", "")]


def judge(relaxation: Relaxation, tolerance: float = BALANCED) -> str:
    """ "accepted", "rejected" or "unconverged", by residual and violation in ⟨f_n⟩."""
    if not relaxation.converged:
        return "unconverged"
    admitted = relaxation.residual <= tolerance and relaxation.violation <= ADMISSIBLE
    return "accepted" if admitted else "rejected"


def _check_options(relax: Relax, options: dict[str, Any]) -> None:
    """TypeError for an option of neither `walk` nor the relaxation, naming those they have."""
    _, _, *relaxing = inspect.signature(relax).parameters.values()
    if not any(one.kind is one.VAR_KEYWORD for one in relaxing):
        refuse_options(walk, options, [one.name for one in relaxing])


@takes(Ensemble, begun=Walk)
@cancelling.cancellable
def walk(
    ensemble: Ensemble,
    states: int = 1000,
    seed: int = 0,
    *,
    chains: int = 1,
    workers: int = 1,
    relax: Relax | str = "nearest",
    max_attempts: int | None = None,
    whole: bool = True,
    skip: bool = True,
    begun: Walk | None = None,
    enough: Callable[[], bool] | None = None,
    progress: Progress | None = None,
    watch: Callable[[WalkState], object] | None = None,
    cancel: Cancel | None = None,
    **options: Any,
) -> Walk:
    """Random walk through S until `states` accepted states in all.

    If S is a single point (h = 0), every state is that point and no relaxation is done, unless skip
    is False: sweeps end at a small residual, not exactly at that point. A warning reports an
    unbounded S: forces then grow with the number of states.

    Parameters
    ----------
    ensemble : Ensemble
        S.
    states : int, default 1000
        Accepted states of all chains together.
    seed : int, default 0
        Seed of all chains.
    chains : int, default 1
        Independent walks from the original network, with states divided evenly; they follow each
        other in the result.
    workers : int, default 1
        Threads, each of which vectorises many chains. Neither workers nor chains change the states
        of a chain.
    relax : str or callable, default "nearest"
        "nearest", "nearest_piqp", "gauss_seidel", "gauss_seidel_only" (the paper's walk), or a
        function like `nearest`.
    max_attempts : int, optional
        Per chain, by default 20 per state.
    whole : bool, default True
        Whether fewer states than requested are an error; otherwise there may be fewer, or none.
    skip : bool, default True
        Whether to skip relaxations in an S of a single point.
    begun : Walk, optional
        A Walk of one chain with the same arguments and fewer states, which is continued; its last
        state is computed again and must agree.
    enough : callable, optional
        enough() is called after each state of a single chain; True ends it with the states so far.
    progress : callable, optional
        progress(done, total); does not change the result.
    watch : callable, optional
        watch(WalkState) receives each state as it is accepted, from the worker thread; does not
        change the result.
    cancel : callable, optional
        Polled; returning True raises Cancelled.
    **options
        Of the relaxation.

    Returns
    -------
    Walk
        states (states, N_c, 2), force, and the effort to reach them.

    Raises
    ------
    InputError
        For sizes below 1, for several chains with `begun` or `enough`, and if `begun` has other
        arguments.
    NotJammedError
        If max_attempts yield too few states of a whole walk.
    """
    states, chains = whole_number(states, "states", 1), whole_number(chains, "chains", 1)
    workers, seed = worker_count(workers), random_seed(seed)
    if max_attempts is not None:
        max_attempts = whole_number(max_attempts, "max_attempts", 1)
    if chains > states:
        raise InputError(f"there must be at least as many states as chains, got {states}")
    if not callable(relax):
        options = RELAXATIONS[choice(relax, RELAXATIONS, "relax")] | options
        relax = options.pop("relax")
        assert callable(relax)
    _check_options(relax, options)
    check_memory(16 * states * len(ensemble.index), f"{states} states")
    if chains > 1 and not (begun is None and enough is None):
        raise InputError("begun and enough require a single chain")
    all_chains = [
        _Chain(ensemble, k, states // chains + (k < states % chains), child, max_attempts, whole)
        for k, child in enumerate(np.random.SeedSequence(seed).spawn(chains))
    ]

    def tell() -> None:
        if progress is not None:
            progress(sum(chain.counts["accepted"] for chain in all_chains), states)

    point = ensemble.dimension == 0 and skip
    if not ensemble.bounded:
        words = f"{UNBOUNDED_WALK}: η1, η2 and η3 are undefined"
        warnings.warn(words, ResultWarning, stacklevel=4)
    if begun is not None:
        ensemble.refuse_foreign(begun.states, begun.residual, "the walk to continue")
    if begun is not None and len(begun.states) and not point:
        all_chains[0].go_on(begun, lambda start: relax(ensemble, start, **options), watch)
    if point:
        for chain in all_chains:
            chain.stay()
    else:
        with cancelling.threads(workers) as pool:
            groups = _groups(all_chains, relax, workers, options)
            list(pool.map(lambda group: _run(group, relax, tell, watch, enough, options), groups))
    return _joined([chain.walked() for chain in all_chains])


def _joined(walks: Sequence[Walk]) -> Walk:
    """The walks of several chains, one after the other."""
    *arrays, counts = zip(*walks, strict=True)
    total = {name: sum(one[name] for one in counts) for name in counts[0]}
    return Walk._make([*map(np.concatenate, arrays), total])


def _groups(
    chains: list[_Chain], relax: Relax, workers: int, options: dict[str, Any]
) -> list[list[_Chain]]:
    """Groups of chains that run together, vectorised if there are enough.

    States do not depend on the grouping.
    """
    in_lanes = relax is nearest or (relax is gauss_seidel and options.keys().isdisjoint(SHUFFLED))
    together = min(LANES, -(-len(chains) // workers))
    together = together if in_lanes and together >= WORTH_LANES else 1
    return [chains[k : k + together] for k in range(0, len(chains), together)]


def _run(
    group: list[_Chain],
    relax: Relax,
    tell: Callable[[], None],
    watch: Callable[[WalkState], object] | None,
    enough: Callable[[], bool] | None,
    options: dict[str, Any],
) -> None:
    """Run all chains of a group."""
    at_own_pace = relax is gauss_seidel and len(group) > 1
    results = _each_at_its_pace(group, options) if at_own_pace else _in_step(group, relax, options)
    for chain, relaxation in results:
        accepted = chain.take(relaxation, options)
        if accepted and watch is not None:
            watch(chain.accepted_state())
        if accepted and enough is not None:
            chain.ended = enough()
        tell()
        cancelling.check("random walk")


# Each yields (chain, relaxation of its perturbed state) until all chains have ended.


def _in_step(
    chains: list[_Chain], relax: Relax, options: dict[str, Any]
) -> Iterator[tuple[_Chain, Relaxation]]:
    S = chains[0].ensemble
    while left := [chain for chain in chains if not chain.done]:
        starts = [chain.kicked() for chain in left]
        if relax is nearest:
            relaxations = nearest_of_many(S, starts, **options)
        else:
            relaxations = [relax(S, start, **options) for start in starts]
        yield from zip(left, relaxations, strict=True)


def _each_at_its_pace(
    chains: list[_Chain], options: dict[str, Any]
) -> Iterator[tuple[_Chain, Relaxation]]:
    searches = SideBySide(chains[0].ensemble, len(chains), **options)
    for lane, chain in enumerate(chains):
        searches.begin(lane, chain.kicked())
    going_on = len(chains)
    while going_on:
        for lane, relaxation in searches.ended():
            yield chains[lane], relaxation
            if chains[lane].done:
                going_on -= 1
            else:
                searches.begin(lane, chains[lane].kicked())


class _Chain:
    """One chain of a walk, and its states."""

    def __init__(
        self,
        ensemble: Ensemble,
        number: int,
        states: int,
        seed: Seed,
        limit: int | None,
        whole: bool,
    ) -> None:
        self.ensemble, self.number = ensemble, number
        self.limit, self.whole, self.ended = limit or 20 * states, whole, False
        # At the packing's own network, or at the nearest admissible one if its own is not in S.
        self.forces, self.rng = np.array(starting_network(ensemble)), np.random.default_rng(seed)
        self.counts = {"accepted": 0, "rejected": 0, "unconverged": 0, "skipped": 0}
        self.walk = Walk(
            states=np.empty((states, *self.forces.shape)),
            residual=np.empty(states),
            violation=np.empty(states),
            sweeps=np.zeros(states, dtype=np.int64),
            attempts=np.zeros(states, dtype=np.int64),
            counts=self.counts,
        )

    @property
    def done(self) -> bool:
        """Whether it has all its states, or may end early."""
        ended = not self.whole and sum(self.counts.values()) >= self.limit
        return ended or self.ended or self.counts["accepted"] == len(self.walk.states)

    def go_on(
        self,
        begun: Walk,
        relaxed: Callable[[Floats], Relaxation],
        watch: Callable[[WalkState], object] | None,
    ) -> None:
        """Continue from the states of an earlier walk, at its position in the random stream."""
        tried, count = int(begun.attempts.sum()), len(begun.states)
        if count > len(self.walk.states) or tried != sum(begun.counts.values()):
            raise InputError("the walk to continue already has more states, or ended within a step")
        for _ in range(tried - 1):  # each attempt drew this many numbers
            self.rng.uniform(size=self.forces.shape)
        if count > 1:
            self.forces = begun.states[-2]
        repeated = relaxed(self.kicked()).forces
        if not np.abs(repeated - begun.states[-1]).max() <= AT_REST * self.ensemble.force_scale:
            raise InputError(
                "the walk to continue was made with another seed, relaxation or ensemble, as its "
                "last state shows; give the same arguments"
            )
        self.counts.update(begun.counts)
        for kept, given in zip(self.walk[:-1], begun[:-1], strict=True):
            kept[:count] = given
        self.forces = begun.states[-1]
        if watch is not None:
            for k in range(len(begun.states)):
                watch(self.accepted_state(k))

    def kicked(self) -> Floats:
        """The start of the next attempt: a number uniform in ±⟨F_n⟩ is added to every component.

        Raises NotJammedError after too many attempts.
        """
        if sum(self.counts.values()) >= self.limit:
            raise NotJammedError(
                f"only {self.counts['accepted']} of {len(self.walk.states)} states after "
                f"{self.limit} attempts ({self.counts['rejected']} rejected, "
                f"{self.counts['unconverged']} unconverged): allow more iterations, or use "
                "another relaxation"
            )
        amplitude = np.mean(self.forces[:, 0])
        kick = self.rng.uniform(-amplitude, amplitude, self.forces.shape)
        if self.ensemble.mu == 0:
            kick[:, 1] = 0.0
        return self.forces + kick

    def take(self, relaxation: Relaxation, options: dict[str, Any]) -> bool:
        """Count an attempt, and store its state if accepted; returns whether it was."""
        walk, k = self.walk, self.counts["accepted"]
        outcome = judge(relaxation, options.get("tolerance", BALANCED))
        self.counts[outcome] += 1
        walk.sweeps[k] += relaxation.iterations
        walk.attempts[k] += 1
        if outcome != "accepted":
            return False
        walk.states[k] = self.forces = relaxation.forces
        walk.residual[k], walk.violation[k] = relaxation.residual, relaxation.violation
        return True

    def accepted_state(self, k: int = -1) -> WalkState:
        """An accepted state, by default the last one."""
        k %= self.counts["accepted"]
        return WalkState(
            chain=self.number,
            number=k,
            forces=self.walk.states[k].copy(),
            residual=float(self.walk.residual[k]),
            violation=float(self.walk.violation[k]),
            attempts=int(self.walk.attempts[k]),
        )

    def stay(self) -> None:
        """Set all states to the current one: S is a single point."""
        self.counts["skipped"] = len(self.walk.states)
        self.walk.states[:] = self.forces
        self.walk.residual[:] = self.ensemble.residual(self.forces)
        self.walk.violation[:] = self.ensemble.violation(self.forces)

    def walked(self) -> Walk:
        """The walk with its states so far."""
        count = self.counts["accepted"] + self.counts["skipped"]
        return Walk._make([*(kept[:count] for kept in self.walk[:-1]), self.counts])
