"""The gain from each shortcut: switched on and off on the same packing."""

import tempfile
from collections.abc import Callable

from granforce.bench.runner import Row, kicked, packings
from granforce.explore.intervals import intervals
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.forces.nearest import nearest
from granforce.motion.gauss_seidel import gauss_seidel
from granforce.packing import pair_list
from granforce.packing.compaction import pack
from granforce.records import Packing
from granforce.study import cells as study
from granforce.study import kinds
from granforce.study.store import open_store
from granforce.system.clock import timed


def skips(n: int = 400, mu: float = 0.1) -> list[Row]:
    """Rows: what is skipped, how often, seconds with and without the shortcut, and their ratio."""
    ((case, S),) = packings("skips", n, [mu])
    rows = [
        _rattlers(S),
        _tangential(pack(n, 0.0, 1)),
        _finish(S),
        _neighbour_lists(n, mu),
        _programs(S),
        _cells(n, mu),
    ]
    return [case | row for row in rows]


def _row(what: str, count: int, seconds: float, without: float) -> Row:
    ratio = without / seconds
    return {"skipped": what, "count": count, "seconds": seconds, "without": without, "ratio": ratio}


def _seconds(action: Callable[[], object], repeats: int = 5) -> float:
    """Run time of an action after a first call: the least, so that stalls do not count."""
    action()
    return min(timed(action)[0] for _ in range(repeats))


def _rattlers(S: Ensemble) -> Row:
    """A relaxation of all contacts of all grains, as in an unpruned import."""
    whole = ensemble(S.packing, prune=False)
    start = kicked(whole, 1, 0)[0]
    few = _seconds(lambda: nearest(S, start[S.index]))
    every = _seconds(lambda: nearest(whole, start))
    count = S.skipped["rattlers"] + S.skipped["unloaded_contacts"]
    return _row("rattlers and unloaded contacts, one relaxation", count, few, every)


def _tangential(packing: Packing) -> Row:
    """The balance of a frictionless packing with the unknowns f_t kept (at μ = 1e-6) or not."""
    without = ensemble(packing, mu=1e-6)
    S = ensemble(packing)
    few = _seconds(lambda: intervals(S, S.index[:2]))
    every = _seconds(lambda: intervals(without, without.index[:2]))
    what = "tangential unknowns and torque rows at μ = 0, four bounds"
    return _row(what, S.skipped["tangential_unknowns"], few, every)


def _finish(S: Ensemble) -> Row:
    """Sweeps saved by the exact finish of Gauss–Seidel, at the same tolerance 1e-6."""
    start = kicked(S, 1, 0)[0]
    short = gauss_seidel(S, start, tolerance=1e-6)
    long = gauss_seidel(S, start, tolerance=1e-6, rest=None)
    few = _seconds(lambda: gauss_seidel(S, start, tolerance=1e-6), 3)
    every = _seconds(lambda: gauss_seidel(S, start, tolerance=1e-6, rest=None), 3)
    what = "Gauss–Seidel sweeps after 1e-3, one relaxation"
    return _row(what, long.iterations - short.iterations, few, every)


def _neighbour_lists(n: int, mu: float) -> Row:
    """Compaction with its neighbour list, and with a list rebuilt in every step."""
    pack(n, mu, 1)  # compile and load kernels
    seconds, rebuilds, usual = [], [], pair_list.MOVED
    try:
        for moved in (usual, 0.0):
            pair_list.MOVED = moved
            spent, packing = timed(pack, n, mu, 1)
            rebuilds.append(packing.info["list_rebuilds"])
            seconds.append(spent)
    finally:
        pair_list.MOVED = usual
    return _row("new neighbour lists, one compaction", rebuilds[1] - rebuilds[0], *seconds)


def _programs(S: Ensemble) -> Row:
    exact = intervals(S)
    few = _seconds(lambda: intervals(S), 1)
    every = _seconds(lambda: intervals(S, skip=False), 1)
    count = exact.counts["f_n = 0 seen in a known state"]
    return _row("linear programs for a minimum f_n already known to be 0", count, few, every)


def _cells(n: int, mu: float) -> Row:
    with tempfile.TemporaryDirectory() as folder:
        store = open_store(folder)
        of = kinds.PACKING.parameters
        named = kinds.WALK.parameters(of(n, mu, 1), 50)
        study.get(store, kinds.WALK, kinds.WALK.parameters(of(n, mu, 2), 50))  # compiles
        every, _ = timed(study.get, store, kinds.WALK, named)
        few = _seconds(lambda: study.get(store, kinds.WALK, named))
    return _row("a result already in the store (packing and 50 states)", 1, few, every)
