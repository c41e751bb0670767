"""Compaction: what a shorter time step and more sweeps cost, and what packing they give."""

import time

import numpy as np

from granforce.bench.report import note
from granforce.compaction import pack
from granforce.polytope import ensemble
from granforce.records import NotJammedError


def compaction(quick=True, *, n=None, mu=0.1, steps=None, sweeps=None, seeds=None):
    """Rows: time, steps and contact updates until jammed, and φ, z, h of what came out.

    One row per time step Δt and number of sweeps per step; means over seeds. Every packing is
    finished exactly, so the error that a coarse Δt leaves shows only in where it jams; runs that
    did not jam are left out of the means and counted in `failed`.
    """
    n = n or (100 if quick else 400)
    steps = steps or ((0.01, 0.02) if quick else (0.005, 0.01, 0.02, 0.05))
    sweeps = sweeps or ((25, 100) if quick else (25, 100, 400))
    seeds = seeds or (2 if quick else 3)
    rows = []
    for dt in steps:
        for count in sweeps:
            note(f"compaction: N = {n}, μ = {mu:g}, Δt = {dt:g}, {count} sweeps")
            made = [_packed(n, mu, seed, dt, count) for seed in range(1, seeds + 1)]
            kept = [one for one in made if one]
            row = {"n": n, "mu": mu, "dt": dt, "sweeps": count, "seeds": seeds}
            row["failed"] = len(made) - len(kept)
            for key in kept[0] if kept else ():
                row[key] = float(np.mean([one[key] for one in kept]))
            rows.append(row)
    return rows


def _packed(n, mu, seed, dt, sweeps):
    begin = time.perf_counter()
    try:
        packing = pack(n, mu, seed, dt=dt, sweeps=sweeps)
        seconds = time.perf_counter() - begin
        S = ensemble(packing)
    except NotJammedError:
        return {}
    return {
        "seconds": seconds,
        "steps": packing.info["steps"],
        "contact_updates": packing.info["contact_updates"],
        "ns_per_update": 1e9 * seconds / max(1, packing.info["contact_updates"]),
        "phi": packing.packing_fraction,
        "z": S.coordination,
        "h": S.dimension,
    }
