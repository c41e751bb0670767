"""Error bars of inferred forces by measuring again: for networks that dynamics made.

`infer` weighs all of S alike before a measurement speaks. Networks that come about by dynamics are
not of that kind: some of their contacts slide or carry nothing, so that they lie on walls of S,
where hardly any of its volume is, and half as many of their forces as should be lie within one
standard error. So nothing is said about them here. The likeliest network is measured again, with
new errors,

    m' = f + σ ε,   ε normal,

and the likeliest network of m' is one draw (the parametric bootstrap: Efron, Tibshirani, An
Introduction to the Bootstrap, 1993). It lies on walls as often as networks nearest to something do.
What was not measured counts as 0 with an error of `unmeasured` ⟨f_n⟩, in either measurement.
"""

import time

import numpy as np
import numpy.typing as npt

from granforce import notebook
from granforce.experiment.infer import Inference, asked, judged, told
from granforce.explore.mixing import Mixing
from granforce.forces.ensemble import Ensemble
from granforce.forces.likeliest import fitted_many
from granforce.numerics.lanes import LANES
from granforce.records import random_seed, takes
from granforce.system import cancelling
from granforce.types import Cancel, Floats, Progress

# Forces that were not measured are known to so many ⟨f_n⟩ beforehand.
UNMEASURED = 2.0


@notebook.brief
class Remeasured(Inference):
    """An Inference whose draws tell how far the likeliest network is from the truth.

    Of networks made by dynamics 68 % of the forces lie within one standard error of it
    (data/README.md has how nearly).
    """

    __slots__ = ()

    @property
    def mean(self) -> Floats:
        """(N_c, 2) the likeliest network itself, about which the errors are told, force."""
        return self.forces

    @property
    def error(self) -> Floats:
        """(N_c, 2) standard error of every force: root mean square of draws less that."""
        return np.sqrt(np.mean((self.drawn.flat - self.forces) ** 2, axis=0))


@takes(Ensemble)
@cancelling.cancellable
def remeasured(
    ensemble: Ensemble,
    measured: npt.ArrayLike,
    sigma: npt.ArrayLike,
    *,
    states: int = 200,
    seed: int = 0,
    unmeasured: float = UNMEASURED,
    chains: int = 4,
    workers: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Remeasured:
    """The network with the least Σ ((f − m)/σ)², and what would be found if measured again.

    A Remeasured, with the same arguments as `infer`; its draws are independent of each other (their
    mixing is not diagnosed: NaN) and need no set-up: one contact program each, eight at a time.
    workers: threads, which change nothing in the result.

    Raises InputError for shapes that do not fit and σ ≤ 0, NotJammedError where S is empty.
    """
    begin = time.perf_counter()
    numbers, seed = (states, chains, workers), random_seed(seed)
    m, s, best, numbers = asked(ensemble, measured, sigma, unmeasured, numbers, least=1)
    ready = time.perf_counter()
    width = np.where(np.isnan(m), unmeasured * ensemble.force_scale, s)
    found = _again(ensemble, best.forces, width, *numbers, seed, progress)
    # Independent draws: there is nothing to mix, and nothing is said of it.
    worth = Mixing(*np.full((3, *s.shape), np.nan))
    counts = {"turns": 0, "refused": 0, "dropped": 0, "held": 0}
    draws = judged(ensemble, found, worth, True, counts, 0.0, time.perf_counter() - ready)
    return told(Remeasured, ensemble, best, draws, begin)


def _again(
    ensemble: Ensemble,
    forces: Floats,
    s: Floats,
    states: int,
    chains: int,
    workers: int,
    seed: int,
    progress: Progress | None,
) -> Floats:
    """Networks (chains, k, N_c, 2) of the network measured again, at least `states` in all."""
    each = -(-states // chains)
    streams = map(np.random.default_rng, np.random.SeedSequence(seed).spawn(chains))
    errors = np.stack([rng.standard_normal((each, *s.shape)) for rng in streams])
    again = (forces + s * errors).reshape(-1, *s.shape)
    batches = [again[k : k + LANES] for k in range(0, len(again), LANES)]
    done, found = 0, []
    with cancelling.threads(workers) as pool:
        for networks in pool.map(lambda batch: fitted_many(ensemble, batch, s), batches):
            found.append(networks)
            done += len(networks)
            if progress is not None:
                progress(done, len(again))
    return np.concatenate(found).reshape(chains, each, *s.shape)
