"""Frames of photoelastic experiments, made from packings whose forces are known."""

import io

import numpy as np
from packings import packed

from granforce.forces.ensemble import ensemble

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
