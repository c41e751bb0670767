"""Photoelastic frames with known forces: the error of measured and inferred forces."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from granforce.bench.runner import Row, means, note
from granforce.experiment.pegs import read_pegs
from granforce.experiment.regions import REGIONS
from granforce.experiment.remeasured import remeasured
from granforce.experiment.synthetic import synthetic_frame
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.packing.compaction import pack
from granforce.records import Packing
from granforce.types import Floats, Mask

# σ in ⟨f_n⟩, fraction of contacts missed, and assumed over true friction.
CASES = (
    *((sigma, 0.0, 1.0) for sigma in (0.05, 0.1, 0.2, 0.5)),
    *((0.1, missed, 1.0) for missed in (0.1, 0.2, 0.5)),
    *((0.2, 0.1, wrong) for wrong in (0.5, 0.8, 1.5, 3.0)),
)
MU, REACH, STATES = 0.3, 0.05, 100
# Number of contacts whose measured f_n is changed by this many ⟨f_n⟩, to test their detection.
_SPOILT, _BY = 5, 3.0


def frames(
    n: int = 400, packings: int = 6, cases: Sequence[tuple[float, ...]] = CASES, mu: float = MU
) -> list[Row]:
    """Rows: mean error in ⟨f_n⟩ (f_n and f_t of listed contacts), and coverage of error bars.

    raw: as measured; likeliest: of `remeasured`, and of all contacts; mean: of its draws; stress:
    of the pressure in each of nine regions, relative. cover: fraction of all forces within one
    standard error of the likeliest network. carry: fraction of the candidates reported to carry
    force (by two standard errors) that do. chi: χ² over its degrees of freedom at the true σ;
    suspected: fraction of contacts changed by 3 ⟨f_n⟩ that are reported; told: fraction of the
    reported contacts that were changed.
    """
    rows = []
    for sigma, missed, wrong in cases:
        note(f"frames: σ = {sigma:g}, missed {missed:g}, μ × {wrong:g}")
        seeds = range(1, packings + 1)
        samples = [_one(pack(n, mu, seed), sigma, missed, wrong, seed) for seed in seeds]
        rows.append(
            {"n": n, "sigma": sigma, "missed": missed, "mu_over_true": wrong, **means(samples)}
        )
    return rows


def _one(packing: Packing, sigma: float, missed: float, wrong: float, seed: int) -> Row:
    frame = synthetic_frame(packing, noise=sigma, missed=missed, seed=seed)
    options: dict[str, Any] = {
        "mu": wrong * packing.mu,
        "reach": REACH,
        "error": sigma * frame.unit,
        "repair": 0.5,
    }
    photo = read_pegs(frame, **options)
    S, unit = ensemble(photo.packing), frame.unit
    m, s = photo.measured[S.index], photo.sigma[S.index]
    # The spread of two sides is part of the noise: only the true σ counts; contacts with walls have
    # one side.
    sides = np.where(S.contacts.j < len(photo.ids) - len(photo.walls), 2.0, 1.0)[:, None]
    s = np.where(np.isfinite(m), sigma * unit / np.sqrt(sides), np.nan)
    drawn = remeasured(S, m, s, states=STATES, seed=seed, unmeasured=2.0)
    true = frame.truth(photo)[S.index]
    inner, listed = np.isfinite(true[:, 0]), np.isfinite(m[:, 0])
    compared = inner & listed
    mean = drawn.drawn.flat.mean(axis=0)
    row = {}
    for k, part in enumerate(("f_n", "f_t")):
        for name, forces in (("raw", m), ("likeliest", drawn.forces), ("mean", mean)):
            row[f"{name}_{part}"] = np.abs(forces - true)[compared, k].mean() / unit
    row["likeliest_all"] = np.abs(drawn.forces - true)[inner].mean() / unit
    row["raw_stress"], row["stress"] = (
        _stress_error(S, np.where(inner[:, None], np.nan_to_num(forces), 0), true)
        for forces in (m, drawn.forces)
    )
    off = np.abs(true - drawn.forces)[inner] / np.maximum(drawn.error[inner], 1e-9 * unit)
    row["cover"] = np.mean(off < 1)
    reported = inner & ~listed & (drawn.forces[:, 0] > 2 * drawn.error[:, 0])
    row["said_to_carry"] = int(reported.sum())
    row["carry"] = np.mean(true[reported, 0] > 0) if reported.any() else np.nan
    row["chi"] = drawn.chi_square / max(drawn.freedom, 1)
    return row | _spoilt(S, m, s, compared, unit, seed)


def _stress_error(S: Ensemble, forces: Floats, true: Floats) -> float:
    """Mean |Δp| over the mean p of the regions, p ∝ Σ f_n ℓ of the contacts in a region."""
    c = S.contacts
    x = S.packing.x[c.i] + 0.5 * c.length[:, None] * c.normal
    low, high = S.packing.x.min(axis=0), S.packing.x.max(axis=0) * (1 + 1e-9)
    cell = np.clip((REGIONS * (x - low) / (high - low)).astype(int), 0, REGIONS - 1)
    cell = cell @ [REGIONS, 1]
    of, exact = (
        np.bincount(cell, np.nan_to_num(f[:, 0]) * c.length, REGIONS**2) for f in (forces, true)
    )
    return np.abs(of - exact).mean() / exact.mean()


def _spoilt(S: Ensemble, m: Floats, s: Floats, measured: Mask, unit: float, seed: int) -> Row:
    """How well changed contacts are detected."""
    rng = np.random.default_rng(seed)
    chosen = rng.choice(np.flatnonzero(measured), _SPOILT, replace=False)
    m = m.copy()
    m[chosen, 0] += _BY * unit
    reported = remeasured(S, m, s, states=2, chains=1, unmeasured=2.0).suspects
    right = np.isin(reported, S.index[chosen])
    return {"suspected": right.sum() / _SPOILT, "told": right.mean() if len(reported) else np.nan}
