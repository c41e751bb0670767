"""The paper's random walk in S: perturb every force, relax to an equilibrium, accept or stay.

The paper relaxes by contact dynamics: relax=gauss_seidel with rest=None and tolerance=EQUILIBRIUM.
By default the network nearest to the perturbed one is taken, which is found 10 to 400 times faster
and for every perturbation; it visits the same kind of states (see `granforce bench`, part walks).
"""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from granforce.records import Cancelled, InputError, NotJammedError
from granforce.relax.accelerated import accelerated
from granforce.relax.nearest import starting_network
from granforce.tolerances import ADMISSIBLE, BALANCED


class Walk(NamedTuple):
    """Accepted states of one or more chains, and what it took to reach them."""

    states: np.ndarray  # (S, N_c, 2) admissible networks, force
    residual: np.ndarray  # (S,) in ⟨f_n⟩, by Ensemble.residual
    violation: np.ndarray  # (S,) in ⟨f_n⟩, by Ensemble.violation
    sweeps: np.ndarray  # (S,) solver iterations spent since the state before, failures included
    attempts: np.ndarray  # (S,) perturbations tried since the state before
    counts: dict  # accepted, rejected (no equilibrium), unconverged, skipped (S is one point)

    @property
    def acceptance(self):
        """Part of all attempts that gave a new state (1 where none was needed)."""
        tried = sum(self.counts[name] for name in ("accepted", "rejected", "unconverged"))
        return self.counts["accepted"] / tried if tried else 1.0


class WalkState(NamedTuple):
    """Where a chain stands: its forces and its own random stream."""

    forces: np.ndarray  # (N_c, 2)
    rng: np.random.Generator


def init(ensemble, seed):
    """A chain at the packing's own network, or at the nearest admissible one if that left S.

    seed: anything numpy.random.default_rng takes. Raises NotJammedError where S is empty.
    """
    return WalkState(np.array(starting_network(ensemble)), np.random.default_rng(seed))


def step(ensemble, state, *, relax=accelerated, **options):
    """One attempt: add to every component a number uniform in ±⟨F_n⟩ of the state, then relax.

    Returns (state, relaxation, outcome): outcome "accepted" moves the chain; "rejected" (the
    solver ended, but not in equilibrium) and "unconverged" (it ran out of iterations) leave it.
    """
    amplitude = np.mean(state.forces[:, 0])
    kick = state.rng.uniform(-amplitude, amplitude, state.forces.shape)
    if ensemble.mu == 0:
        kick[:, 1] = 0.0
    relaxation = relax(ensemble, state.forces + kick, **options)
    outcome = judge(relaxation, options.get("tolerance", BALANCED))
    if outcome == "accepted":
        state = state._replace(forces=relaxation.forces)
    return state, relaxation, outcome


def judge(relaxation, tolerance=BALANCED):
    """ "accepted", "rejected" or "unconverged", by residual and violation in ⟨f_n⟩."""
    if relaxation.residual <= tolerance and relaxation.violation <= ADMISSIBLE:
        return "accepted"
    return "rejected" if relaxation.converged else "unconverged"


def walk(
    ensemble,
    states,
    seed,
    *,
    chains=1,
    workers=1,
    relax=accelerated,
    max_attempts=None,
    progress=None,
    cancel=None,
    **options,
):
    """Random walk until `states` accepted states in all; chains follow each other in the result.

    chains: independent walks from the original network, states shared out evenly; workers:
    threads they run on, which changes nothing in the result. relax, options: the relaxation and
    its options. max_attempts: per chain, by default 20 per state. progress(done, total);
    cancel() returning True raises Cancelled.

    Where S is a single point (h = 0) every state is that point and no relaxation is done. Raises
    InputError for sizes below 1 and NotJammedError when max_attempts bring too few states.
    """
    if states < 1 or chains < 1 or workers < 1 or chains > states:
        raise InputError("states, chains and workers must be at least 1, and chains ≤ states")
    share = [states // chains + (k < states % chains) for k in range(chains)]
    seeds = np.random.SeedSequence(seed).spawn(chains)
    done = [0] * chains

    def one(k):
        def tell(count):
            done[k] = count
            if progress is not None:
                progress(sum(done), states)

        limit = max_attempts or 20 * share[k]
        return _chain(ensemble, share[k], seeds[k], relax, limit, tell, cancel, options)

    with ThreadPoolExecutor(workers) as pool:
        parts = list(pool.map(one, range(chains)))
    counts = {name: sum(part.counts[name] for part in parts) for name in parts[0].counts}
    return Walk(*(np.concatenate(field) for field in list(zip(*parts, strict=True))[:-1]), counts)


def _chain(ensemble, states, seed, relax, limit, tell, cancel, options):
    state = init(ensemble, seed)
    counts = {"accepted": 0, "rejected": 0, "unconverged": 0, "skipped": 0}
    if ensemble.dimension == 0:
        counts["skipped"] = states
        return _single_point(ensemble, state, states, counts)
    found = np.empty((states, *state.forces.shape))
    sweeps, attempts = np.zeros((2, states), dtype=np.int64)
    residual, violation = np.empty((2, states))
    while (k := counts["accepted"]) < states:
        if cancel is not None and cancel():
            raise Cancelled(f"random walk cancelled after {k} of {states} states")
        if sum(counts.values()) >= limit:
            raise NotJammedError(
                f"only {k} of {states} states after {limit} attempts ({counts['rejected']} "
                f"rejected, {counts['unconverged']} unconverged): allow more iterations, or take "
                "another relaxation"
            )
        state, relaxation, outcome = step(ensemble, state, relax=relax, **options)
        counts[outcome] += 1
        sweeps[k] += relaxation.iterations
        attempts[k] += 1
        if outcome == "accepted":
            found[k] = relaxation.forces
            residual[k], violation[k] = relaxation.residual, relaxation.violation
            tell(k + 1)
    return Walk(found, residual, violation, sweeps, attempts, counts)


def _single_point(ensemble, state, states, counts):
    return Walk(
        np.repeat(state.forces[None], states, axis=0),
        np.full(states, ensemble.residual(state.forces)),
        np.full(states, ensemble.violation(state.forces)),
        np.zeros(states, dtype=np.int64),
        np.zeros(states, dtype=np.int64),
        counts,
    )
