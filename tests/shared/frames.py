"""Frames of photoelastic experiments, made from packings whose forces are known."""

import io

import numpy as np
from packings import packed

from granforce.forces.build import ensemble

PIXELS, NEWTON = 50.0, 0.01


def frame(n=150, mu=0.3, *, missing=0.0, noise=0.0, blur=0.0, seed=0, number=1):
    """Rows of positions and of contacts, and the true forces by pair: a packing cut at its box.

    Grains that touch through the sides of the box are flagged; `missing` of the contacts are not
    listed, forces have errors `noise` (in ⟨f_n⟩), different both ways, radii errors `blur`.
    """
    packing, rng = packed(n, mu), np.random.default_rng(seed)
    S = ensemble(packing)
    c = S.contacts
    branch = packing.x[c.j] - packing.x[c.i]
    inside = np.abs(branch - c.length[:, None] * c.normal).max(axis=1) < 1e-6
    flag = np.zeros(n, int)
    flag[c.i[~inside]] = flag[c.j[~inside]] = 1
    r = packing.r * (1 - blur * rng.random(n))
    grains = [
        [number, 10 * k + 3, *(PIXELS * packing.x[k]), PIXELS * r[k], flag[k]] for k in range(n)
    ]
    truth, rows = {}, []
    for k in np.flatnonzero(inside):
        force = NEWTON * S.original[k] / S.force_scale
        truth[int(c.i[k]), int(c.j[k])] = force
        if rng.random() < missing:
            continue
        for first, second in ((c.i[k], c.j[k]), (c.j[k], c.i[k])):
            f_n, f_t = force + noise * NEWTON * rng.standard_normal(2)
            rows.append([number, 10 * first + 3, 10 * second + 3, f_t, f_n])
    return grains, rows, truth


def file(rows, name="frame.txt"):
    text = "\n".join(",".join(f"{value:.12g}" for value in row) for row in rows)
    made = io.StringIO(text)
    made.name = name
    return made


def write(folder, grains, rows):
    """The two files of a frame, as programs write them."""
    for name, lines in (("positions.txt", grains), ("adjacency.txt", rows)):
        (folder / name).write_text(file(lines).getvalue())


def solved(n=60, mu=0.3, *, noise=0.0, seed=0, walls=True):
    """Particles of a PeGS 2 frame, dicts by field, and the true forces by pair of rows.

    A packing cut at its box: what pressed through its sides presses on walls there, in the same
    direction, so that every grain is balanced. Each contact is fitted from both sides, with errors
    `noise` (in ⟨f_n⟩) times the root of the grain's fitError, which are 1 and 4 in turn.
    """
    packing, rng = packed(n, mu), np.random.default_rng(seed)
    S = ensemble(packing)
    c = S.contacts
    branch = packing.x[c.j] - packing.x[c.i]
    inside = np.abs(branch - c.length[:, None] * c.normal).max(axis=1) < 1e-6
    particles = [
        {
            **{"id": 10.0 * k + 3, "x": PIXELS * packing.x[k, 0], "y": PIXELS * packing.x[k, 1]},
            **{"r": PIXELS * packing.r[k], "rm": 0.01 * packing.r[k], "edge": 0.0},
            **{"neighbours": [], "forces": [], "alphas": [], "betas": []},
            "fitError": (1.0 + 3.0 * (k % 2)) * packing.r[k] ** 2,
        }
        for k in range(n)
    ]
    truth = {}
    for k in range(len(c.i)):
        force = NEWTON * S.original[k] / S.force_scale
        way = np.arctan2(*c.normal[k][::-1])
        ends = int(c.i[k]), int(c.j[k])
        if inside[k]:
            truth[ends] = force
        elif not walls:
            continue
        for own, other, angle in ((*ends, way), (*ends[::-1], way + np.pi)):
            error = noise * NEWTON * (1 + own % 2)
            f_n, f_t = force + error * rng.standard_normal(2)
            one = particles[own]
            one["neighbours"].append(10.0 * other + 3 if inside[k] else -1.0)
            one["forces"].append(np.hypot(f_n, f_t))
            one["alphas"].append(np.arctan2(f_t, f_n))
            one["betas"].append(angle)
            one["edge"] = one["edge"] if inside[k] else 1.0
    return particles, truth
