"""Inference: the admissible network behind forces that were measured with errors.

A measurement gives components m of forces with standard errors σ. The network in S with the least

    χ² = Σ ((f − m)/σ)²

is the likeliest one, and all of S, weighted with exp(−χ²/2), is a normal distribution cut by the
walls of S: what is known of the forces once balance and Coulomb's law are. Draws from it give the
standard error of every force, of those that were not measured too.
"""

import copy
import time
from typing import NamedTuple

import numpy as np
from scipy import linalg, sparse

from granforce import notebook
from granforce.explore import billiard, uniform
from granforce.explore.chart import chart
from granforce.explore.mixing import Mixing, mixing
from granforce.forces.contact_problem import inner_network
from granforce.forces.likeliest import UNMEASURED, checked, likeliest
from granforce.records import whole
from granforce.system import cancelling
from granforce.tolerances import ADMISSIBLE, BALANCED

# Residuals beyond so many standard errors are told.
SUSPECT = 3.0
# A quarter of an oscillation: without walls the next state does not depend on the last.
_TIME = np.pi / 2
# Paths between states that are kept: 1000 states are then worth 300 to 900 independent ones.
_PATHS = 4
# States dropped at the start of each chain, and states between two calls of progress.
_DROPPED, _ROUND = 20, 20


class Draws(NamedTuple):
    """States of S drawn with the weight exp(−χ²/2), by chain, and whether they can be trusted."""

    states: np.ndarray  # (chains, k, N_c, 2) admissible networks, force
    residual: np.ndarray  # (chains, k) in ⟨f_n⟩, by Ensemble.residual
    violation: np.ndarray  # (chains, k) in ⟨f_n⟩, by Ensemble.violation
    mixing: Mixing  # R̂, bulk and tail effective sample size of each component
    reached: bool  # all in S, and R̂ ≤ MIXED
    counts: dict  # turns, refused paths, dropped states, held coordinates
    setup_seconds: float  # wall time of the chart
    sampling_seconds: float  # wall time of the draws, those dropped included

    effective = uniform.UniformSample.effective
    flat = uniform.UniformSample.flat
    chain = uniform.UniformSample.chain


class Inference(NamedTuple):
    """The network that a measurement speaks for, and how sure it is."""

    forces: np.ndarray  # (N_c, 2) the admissible network with the least χ², force
    chi_square: float  # its Σ ((f − m)/σ)²
    freedom: int  # degrees of freedom: what was measured less what the network could adapt to
    deviation: np.ndarray  # (N_c, 2) its (f − m)/σ, NaN where nothing was measured
    suspects: np.ndarray  # (s,) contacts, as numbers in the packing, beyond 3 σ, largest first
    residual: float  # in ⟨f_n⟩, by Ensemble.residual
    violation: float  # in ⟨f_n⟩, by Ensemble.violation
    draws: Draws | None  # None where none were asked for
    seconds: float  # wall time, draws included

    @property
    def mean(self):
        """(N_c, 2) mean of the draws, force."""
        return self.draws.flat.mean(axis=0)

    @property
    def error(self):
        """(N_c, 2) standard error of every force: the standard deviation of the draws."""
        return self.draws.flat.std(axis=0)

    def _repr_html_(self):
        """The inference as notebooks show it."""
        lines = {
            "measured components": int(np.isfinite(self.deviation).sum()),
            "χ²": self.chi_square,
            "degrees of freedom": self.freedom,
            "contacts beyond 3 σ": len(self.suspects),
        }
        if self.draws is not None:
            lines |= {"draws": len(self.draws.flat), "mean standard error": self.error.mean()}
            lines |= {"worst R̂": self.draws.mixing.worst_r_hat, "worth": self.draws.effective}
        return notebook.table("Inferred forces", lines)


@cancelling.cancellable
def infer(
    ensemble,
    measured,
    sigma,
    *,
    states=0,
    seed=0,
    unmeasured=UNMEASURED,
    chains=4,
    workers=1,
    progress=None,
    cancel=None,
):
    """The admissible network with the least Σ ((f − m)/σ)², and draws around it; an Inference.

    measured, sigma: m and σ (N_c of S, 2), force; NaN where a component was not measured. σ may be
    one number, or two for f_n and f_t. states: at least so many draws from the normal distribution
    of the measurement cut by S, for error bars, by `chains` independent chains. workers: threads,
    which change nothing in the result. progress(done, total) counts draws.

    unmeasured: what was not measured counts as 0 with a standard error of so many ⟨f_n⟩. As it is,
    that only chooses the least of networks that fit equally well; where neither S nor the
    measurement bounds some forces (no pressure is prescribed), it is all that does.

    Raises InputError for shapes that do not fit and σ ≤ 0, NotJammedError where S is empty.
    """
    begin = time.perf_counter()
    states = whole(states, "the number of draws")
    chains, workers = whole(chains, "chains", 1), whole(workers, "workers", 1)
    m, s = checked(ensemble, measured, sigma)
    best = likeliest(ensemble, m, s, unmeasured)
    far = np.nan_to_num(np.abs(best.deviation)).max(axis=1, initial=0.0)
    beyond = np.flatnonzero(far > SUSPECT)
    draws = None
    if states:
        fit = _fit(ensemble, m, s, unmeasured)
        draws = _draws(ensemble, *fit, states, chains, seed, workers, progress)
    return Inference(
        *best,
        ensemble.index[beyond[np.argsort(-far[beyond], kind="stable")]],
        ensemble.residual(best.forces),
        ensemble.violation(best.forces),
        draws,
        time.perf_counter() - begin,
    )


def _fit(ensemble, m, s, unmeasured):
    """W sparse (k, n) and d (k,): χ² = |W y − d|² in the coordinates of `Ensemble.scaled_form`."""
    m, s = (ensemble.to_vector(values) / ensemble.force_scale for values in (m, s))
    weight = 1 / np.where(np.isnan(m), unmeasured, s)
    W = sparse.diags(weight) @ ensemble.scaled_form[2]
    return sparse.csc_matrix(W), weight * np.nan_to_num(m)


def _draws(ensemble, W, d, states, chains, seed, workers, progress):
    begin = time.perf_counter()
    A, b, _ = ensemble.scaled_form
    made = chart(A, b, inner_network(ensemble), (W, d))
    turned, shift, follow = rounded(made, W, d)
    ends = [uniform.init(turned, one) for one in np.random.SeedSequence(seed).spawn(chains)]
    ready = time.perf_counter()
    parts, counts, have, target = [], {"turns": 0, "refused": 0}, -_DROPPED, -(-states // chains)
    with cancelling.threads(workers) as pool:
        while have < target:
            count = min(_ROUND, target - have) if have >= 0 else -have
            done = pool.map(lambda end, count=count: step(turned, shift, follow, end, count), ends)
            ends, moves = zip(*done, strict=True)
            for name in counts:
                counts[name] += sum(getattr(one, name) for one in moves)
            if have >= 0:
                parts.append(uniform.forces_of(ensemble, made, np.stack([m.slacks for m in moves])))
                if progress is not None:
                    progress((have + count) * chains, target * chains)
            have += count
    found = np.concatenate(parts, axis=1)
    drawn = time.perf_counter()
    residual, violation = ensemble.residual(found), ensemble.violation(found)
    worth = mixing(found, uniform.varying(ensemble, made))
    inside = residual.max() <= BALANCED and violation.max() <= ADMISSIBLE
    mixed = not made.dimension or worth.worst_r_hat <= uniform.MIXED
    counts |= {"dropped": _DROPPED * chains, "held": len(made.centre) - len(made.moving)}
    return Draws(
        *(found, residual, violation, worth, bool(inside and mixed), counts),
        *(ready - begin, drawn - ready),
    )


def rounded(made, W, d):
    """The chart in coordinates in which the cut normal distribution is round, shift and θ (h,).

    ½ |W y − d|² is ½ Λ u·u − g·u in the chart, centred where its barrier has the curvature 1: in
    the axes of Λ, stretched by √(Λ + 1), both together have the curvature 1, 1 − θ of it by the
    measurement and θ by the companion that stands for the walls (see `billiard.harmonic`).
    """
    slopes = W[:, made.moving] @ (made.centre[made.moving, None] * made.G[: len(made.moving)])
    tilt = slopes.T @ (d - W @ made.centre)
    triangle = np.linalg.qr(slopes, mode="r")  # the same |slopes u|, with at most h rows
    _, size, axes = cancelling.apart(linalg.svd, triangle)
    narrow = 1 / np.hypot(1.0, np.pad(size, (0, made.dimension - len(size))))
    G = made.G @ axes.T * narrow
    K = cancelling.apart(np.matmul, G, G.T)
    diagonal = np.diagonal(K)
    turn = np.divide(2.0, diagonal, out=np.zeros(len(G)), where=diagonal > 0)
    turned = made._replace(G=G, columns=np.ascontiguousarray(G.T), K=K, turn=turn)
    return turned, narrow * (axes @ tilt), narrow**2


def step(turned, shift, follow, state, count):
    """The next `count` states of a chain, as `uniform.step` gives them."""
    place, rng = state.place.copy(), copy.deepcopy(state.rng)
    slacks, turns, refused = np.ones((count, len(turned.G))), 0, 0
    if turned.dimension:
        walls = turned.G, turned.columns, turned.K, turned.turn, shift, follow
        path = _TIME, uniform.MOST_TURNS * (turned.dimension + 1), _PATHS
        turns, refused = billiard.harmonic(*walls, place, rng, *path, slacks, cancelling.flag())
    cancelling.check("inference")
    return uniform.ChainState(place, rng), uniform.Moves(slacks, turns, refused)
