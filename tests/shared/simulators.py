"""Files of YADE and MercuryDPM, as their documentation describes them, of a packing made here."""

import numpy as np
from packings import packed, skewed

from granforce.forces.build import ensemble

N, MU = 30, 0.3


def vectors(tilted=False, scale=1.0):
    """Disks, pairs, and the forces on the second of each pair, along n and t."""
    packing = skewed(packed(N, MU))[0] if tilted else packed(N, MU)
    S = ensemble(packing)
    c = S.contacts
    lengths = {name: scale * getattr(packing, name) for name in ("x", "r", "box")}
    tangent = np.column_stack([-c.normal[:, 1], c.normal[:, 0]])
    both = S.original[:, :1] * c.normal, S.original[:, 1:] * tangent
    return packing._replace(**lengths), c, S.original, *both


def yade(plane="xy", ids=False, header=False, tilted=False, scale=1.0):
    packing, c, _, normal, shear = vectors(tilted, scale)
    names = 7 * np.arange(N)[::-1] + 2 if ids else np.arange(N)

    def spread(values):
        out = np.zeros((len(values), 3))
        out[:, ["xyz".index(axis) for axis in plane]] = values
        return out

    lines = ["#format x_y_z_r" + ("_attrs" if ids else ""), "# id" if ids else "# by hand"]
    columns = [spread(packing.x), packing.r[:, None], *([names[:, None]] if ids else [])]
    lines += ["\t".join(f"{v:.15g}" for v in row) for row in np.column_stack(columns)]
    links = np.column_stack([names[c.i], names[c.j], spread(normal), spread(shear)])
    words = ["id1 id2 fnx fny fnz fsx fsy fsz"] if header else []
    words += [" ".join(f"{v:.15g}" for v in row) for row in links]
    return ["\n".join(text).encode() for text in (lines, words)]


def mercury(flat=False, steps=2, both=True, turned=False, tilted=False, scale=1.0):
    packing, c, forces, _, _ = vectors(tilted, scale)
    z, n = np.zeros((N, 1)), N
    width = packing.box[0]
    data, fstat = [], []
    for step in range(steps):
        time, x = 0.5 * step, packing.x + 0.01 * (steps - 1 - step)
        if flat:
            data.append(f"{n} {time:g} 0 0 {width:.9g} {width:.9g}")
            rows = np.column_stack([x, z, z, packing.r, z, z, z])
        else:
            data.append(f"{n} {time:g} 0 0 0 {width:.9g} {width:.9g} 0")
            rows = np.column_stack([x, z, z, z, z, packing.r, *[z] * 7])
        data += [" ".join(f"{v:.15g}" for v in row) for row in rows]
        fstat += [f"# {time:g} 1 2", "# info", "# info"]
        for k in range(len(c.i)):
            f_n, f_t = forces[k]
            t = np.sign(f_t or 1.0) * np.array([-c.normal[k, 1], c.normal[k, 0]])
            ends = [(c.i[k], c.j[k], -1.0), (c.j[k], c.i[k], 1.0)][: 2 if both else 1]
            for i, j, sign in ends:
                # The force on i, as n points to it; or, turned, that on j.
                sign = -sign if turned else sign
                row = [time, i, j, 0, 0, 0, 0, 0, f_n, abs(f_t), *sign * c.normal[k], 0]
                fstat.append(" ".join(f"{v:.15g}" for v in [*row, *sign * t, 0]))
        fstat.append(f"{time:g} 0 -1 0 0 0 0 0 1 0 1 0 0 0 1 0")
    return ["\n".join([*text, ""]).encode() for text in (data, fstat)]
