"""Packings and measured forces from photoelastic experiments, in the format of PeGS.

positions: a line per grain with frame, id, x, y, radius and, if wanted, a flag that is not 0 for
grains at a wall. adjacency: a line per contact with frame, the two ids (negative: a wall),
tangential and normal force; contacts may be listed both ways.

Such data do not balance: contacts were missed, others are wrong, and radii are known to some
tenths only. So pairs that are about as near as the listed ones join as candidates that were not
measured; a linear program then finds the fewest grains that still cannot be balanced, and their
balance is left open, as is that of grains at walls.
"""

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from granforce import notebook
from granforce.forces.ensemble import ensemble
from granforce.forces.likeliest import likeliest
from granforce.numerics import highs
from granforce.packing.importers.geometry import check_disks
from granforce.packing.importers.network import judged
from granforce.packing.importers.text import check_grains, make_table, read_text
from granforce.records import (
    Cell,
    InputError,
    Packing,
    UndecidedError,
    friction,
    make_contacts,
    make_packing,
    positive,
)

_GRAINS = ("frame", "id", "x", "y", "radius", "flag")
_CONTACTS = ("frame", "id1", "id2", "tangential", "normal")
# What changing a measured force by ⟨f_n⟩ costs, where ⟨f_n⟩ of unbalance costs 1.
_CHANGE = 0.2
# Unbalance in ⟨f_n⟩ up to which a grain is balanced.
_BALANCED = 1e-6
# Disks may overlap by this part of the smaller radius before the file must be wrong.
_OVERLAP = 0.5
# Contacts a grain needs at least to be judged by its balance.
_ENOUGH = 3


class Photoelastic(NamedTuple):
    """A packing with measured forces; contacts are those listed, then the candidates."""

    packing: Packing  # its own network is the likeliest one; loads are NaN where balance is open
    measured: np.ndarray  # (N_c, 2) f_n, f_t as listed, force; NaN for candidates
    sigma: np.ndarray  # (N_c, 2) their standard errors
    added: np.ndarray  # (N_c,) mask of the candidates
    left_open: np.ndarray  # (k,) grains that no admissible forces balance, walls apart
    ids: np.ndarray  # (N,) their names in the files
    report: dict  # plain numbers: what was found and what was done

    def _repr_html_(self):
        """The import as notebooks show it."""
        lines = {name.replace("_", " "): value for name, value in self.report.items()}
        return notebook.table("Photoelastic frame", lines)


def read_pegs(
    positions,
    adjacency,
    *,
    mu,
    frame=None,
    reach=0.5,
    scale=1.0,
    error=None,
    reverse=False,
    most_grains=None,
):
    """A Photoelastic of one frame, from files or open files of positions and contacts.

    frame: its number, by default the last one that both files have. scale: factor on the radii as
    listed. reach: largest gap between the disks of a candidate, in mean radii (0: no candidates).
    error: standard error of a measured component, force; by default the one that makes χ² equal
    to its degrees of freedom; half the difference of what was listed twice is added in quadrature.
    reverse: take f_t with the other sign (programs differ). most_grains: how many are taken.

    The report tells, in mean measured normal forces, how many inner grains cannot be balanced on
    the listed contacts alone and with the candidates, by how much in sum, and what came of it.

    Raises InputError naming file and line.
    """
    mu, scale = friction(mu), positive(scale, "scale")
    if not 0 <= reach <= 2:
        raise InputError(f"reach is in mean radii and must lie between 0 and 2, got {reach}")
    grains, links = _table(positions, _GRAINS), _table(adjacency, _CONTACTS)
    frame = _frame(grains, links, frame)
    grains, links = _of_frame(grains, frame), _of_frame(links, frame)
    check_grains(len(grains.rows), most_grains, grains.name)
    x, r, ids, at_wall = _disks(grains, scale)
    listed = _listed(links, grains.index("id"), at_wall)
    if reverse:
        listed = listed._replace(forces=listed.forces * [1, -1])
    saved = _gain_by_reversing(x, listed, at_wall)
    alone = _packing(x, r, listed, np.zeros((0, 2), int), at_wall, mu)
    pairs = _candidates(x, r, listed, at_wall, reach)
    packing = _packing(x, r, listed, pairs, at_wall, mu)
    m = np.full((len(packing.contacts.i), 2), np.nan)
    m[: len(listed.pairs)] = listed.forces
    unit = float(np.nanmean(np.abs(m[:, 0])))
    before, after = (_unbalance(P, m[: len(P.contacts.i)], unit) for P in (alone, packing))
    left_open = np.flatnonzero(after > _BALANCED)
    load = packing.load.copy()
    load[left_open] = np.nan
    packing = packing._replace(load=load)
    best, sigma = _inferred(packing, m, listed.spread, error, unit)
    packing = packing._replace(forces=best.forces)
    added = np.arange(len(m)) >= len(listed.pairs)
    change = np.nanmean(np.abs(best.forces - m), axis=0) / unit
    gap = packing.contacts.gap
    report = {
        "frame": frame,
        "grains": len(r),
        "grains_at_walls": int(at_wall.sum()),
        "contacts_listed": len(listed.pairs),
        "listed_twice": listed.twice,
        "listed_twice_with_other_forces": listed.unequal,
        "contacts_with_a_wall": listed.with_wall,
        "negative_normal_forces": int(np.sum(listed.forces[:, 0] < 0)),
        "beyond_friction": int(np.sum(np.abs(m[:, 1]) > mu * m[:, 0])),
        "unbalance_saved_if_tangential_forces_were_reversed": saved,
        "mean_measured_normal_force": unit,
        "median_gap_in_mean_radii": float(np.median(gap[~added]) / r.mean()),
        "candidates": len(pairs),
        "unbalanced_on_listed_contacts": int(np.sum(before > _BALANCED)),
        "unbalance_on_listed_contacts": float(before.sum()),
        "unbalanced": len(left_open),
        "unbalance": float(after.sum()),
        "left_open": [_plain(ids[k]) for k in left_open],
        "candidates_that_carry": int(np.sum(best.forces[added, 0] > _BALANCED * unit)),
        "error": float(np.nanmedian(sigma[:, 0]) / unit),
        "chi_square": best.chi_square,
        "freedom": best.freedom,
        "mean_change_of_f_n": float(change[0]),
        "mean_change_of_f_t": float(change[1]),
    }
    info = {"source": "pegs", "frame": frame, "largest_gap": float(np.abs(gap).max() / r.min())}
    packing = packing._replace(info=info | judged(packing))
    return Photoelastic(packing, m, sigma, added, left_open, ids, report)


class _Listed(NamedTuple):
    """Contacts between two grains, each once."""

    pairs: np.ndarray  # (k, 2) grains, the first before the second
    forces: np.ndarray  # (k, 2) mean of what is listed
    spread: np.ndarray  # (k, 2) half of the largest difference
    twice: int
    unequal: int  # listed twice, with different forces
    with_wall: int


def _table(source, header):
    """A Table of comma-separated numbers, its first line left out where that has names."""
    name, text = read_text(source)
    rows, lines = [], []
    for number, line in enumerate(text.splitlines(), start=1):
        fields = [field.strip() for field in line.replace(";", ",").split(",")]
        if not any(fields) or (not rows and not _is_number(fields[0])):
            continue
        if len(fields) < 5:
            raise InputError(
                f"{name}, line {number}: {len(fields)} fields where {', '.join(header)} are "
                "wanted; is it a file of PeGS?"
            )
        rows.append(([*fields, "0"])[: len(header)])
        lines.append(number)
    if not rows:
        raise InputError(f"{name}: no line with numbers; is it a file of PeGS?")
    return make_table(name, header, rows, lines)


def _is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


def _frame(grains, links, frame):
    """The number of the frame to take."""
    both = np.intersect1d(grains.numbers("frame"), links.numbers("frame"))
    if not len(both):
        raise InputError(f"{grains.name} and {links.name} have no frame in common")
    if frame is None:
        return _plain(both[-1])
    if frame not in both:
        raise InputError(
            f"frame {frame} is not in both files; they have {_plain(both[0])} … {_plain(both[-1])}"
        )
    return _plain(float(frame))


def _plain(number):
    return int(number) if float(number).is_integer() else float(number)


def _of_frame(table, frame):
    here = np.flatnonzero(table.numbers("frame") == frame)
    rows, lines = ([values[k] for k in here] for values in (table.rows, table.lines))
    return table._replace(rows=rows, lines=lines)


def _disks(table, scale):
    """Positions, radii, names, and which grains are at a wall."""
    x = np.column_stack([table.numbers("x"), table.numbers("y")])
    r = scale * table.numbers("radius")
    check_disks(x, r, Cell(np.full(2, np.inf), 0.0), table.place, _OVERLAP)
    return x, r, table.numbers("id"), table.numbers("flag") != 0


def _listed(table, index, at_wall):
    """The _Listed of a table; grains that touch a wall, by a negative id, are noted in at_wall."""
    ends = np.column_stack([table.numbers("id1"), table.numbers("id2")])
    walls = ends < 0
    rows = np.flatnonzero(~walls.any(axis=1))
    for row in np.flatnonzero(walls.any(axis=1)):
        for end in ends[row][~walls[row]]:
            if end in index:
                at_wall[index[end]] = True
    inner = table._replace(rows=[table.rows[k] for k in rows], lines=[table.lines[k] for k in rows])
    if not len(rows):
        raise InputError(f"{table.name}: no contact between two grains")
    i, j = inner.lookup("id1", index), inner.lookup("id2", index)
    for c in np.flatnonzero(i == j)[:1]:
        raise InputError(f"{inner.place(c)}: the grain touches itself; remove the line")
    # f_t is that of n and t turned together: it keeps its sign when i and j change places.
    values = np.column_stack([inner.numbers("normal"), inner.numbers("tangential")])
    pairs, which = np.unique(np.sort(np.column_stack([i, j])), axis=0, return_inverse=True)
    times = np.bincount(which.ravel())
    low, high, total = np.full((3, len(pairs), 2), 0.0)
    low[:], high[:] = np.inf, -np.inf
    for reduce, into in ((np.minimum, low), (np.maximum, high), (np.add, total)):
        reduce.at(into, which.ravel(), values)
    spread, twice = 0.5 * (high - low), times > 1
    return _Listed(
        *(pairs, total / times[:, None], spread),
        *(int(twice.sum()), int(np.sum(spread.any(axis=1)))),
        int(walls.any(axis=1).sum()),
    )


def _gain_by_reversing(x, listed, at_wall):
    """By what part the unbalance of inner grains falls if all f_t change sign; below 0: it grows.

    Programs that fit forces differ in the sign of f_t.
    """
    branch = x[listed.pairs[:, 1]] - x[listed.pairs[:, 0]]
    normal = branch / np.hypot(*branch.T)[:, None]
    across = np.column_stack([-normal[:, 1], normal[:, 0]])
    inner = ~at_wall & (np.bincount(listed.pairs.ravel(), minlength=len(x)) >= _ENOUGH)
    off = []
    for sign in (1, -1):
        force = listed.forces[:, :1] * normal + sign * listed.forces[:, 1:] * across
        total = np.zeros_like(x)
        np.add.at(total, listed.pairs[:, 1], force)
        np.add.at(total, listed.pairs[:, 0], -force)
        off.append(np.hypot(*total[inner].T).sum())
    return float(1 - off[1] / off[0]) if off[0] > 0 else 0.0


def _candidates(x, r, listed, at_wall, reach):
    """Pairs (k, 2) that are not listed, with a gap up to `reach`, one of them inside."""
    far = 2 * r.max() + reach * r.mean()
    pairs = cKDTree(x).query_pairs(far, output_type="ndarray") if reach else np.zeros((0, 2), int)
    pairs = np.sort(pairs.astype(np.int64))
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    gap = np.hypot(*(x[pairs[:, 1]] - x[pairs[:, 0]]).T) - r[pairs].sum(axis=1)
    known = np.isin(pairs @ [len(x), 1], listed.pairs @ [len(x), 1])
    return pairs[(gap <= reach * r.mean()) & ~known & ~at_wall[pairs].all(axis=1)]


def _packing(x, r, listed, pairs, at_wall, mu):
    """The packing of listed and candidate contacts; forces as listed, 0 for candidates.

    Contact points lie midway between the disks, whose radii are not known well.
    """
    i, j = np.concatenate([listed.pairs, pairs]).T
    branch = x[j] - x[i]
    length = np.hypot(*branch.T)
    contacts = make_contacts(i, j, branch / length[:, None], length, r)
    arms = {"arm_i": r[i] + contacts.gap / 2, "arm_j": r[j] + contacts.gap / 2}
    forces = np.concatenate([listed.forces, np.zeros((len(pairs), 2))])
    load = np.where(at_wall[:, None], np.nan, np.zeros((len(r), 3)))
    box = np.full(2, np.inf)
    return make_packing(x, r, box, contacts._replace(**arms), forces, mu, load=load)


def _unbalance(packing, m, unit):
    """(N,) what of each grain's balance no admissible forces near the measured ones can meet.

    By the least Σ |unbalance| + _CHANGE Σ |f − m|, in units of `unit`: sums of absolute values
    leave few grains unbalanced.
    """
    S = ensemble(packing, prune=False)
    A, T = S.cone_form
    m = S.to_vector(m) / unit
    seen = np.flatnonzero(np.isfinite(m))
    rows, columns = A.shape[0], A.shape[1]
    both = sparse.vstack([A, sparse.csr_matrix(T)[seen]])
    slack = sparse.identity(rows + len(seen))
    cost = np.concatenate([np.ones(rows), np.full(len(seen), _CHANGE)])
    right = np.concatenate([np.zeros(rows), m[seen]])
    # Five times as fast as the simplex method here; its crossover ends in a vertex as well.
    model = highs.standard_form(sparse.hstack([both, slack, -slack]), right, solver="ipm")
    highs.set_cost(model, np.concatenate([np.zeros(columns), cost, cost]))
    found = highs.optimal(model)
    if found is None:
        raise UndecidedError("which grains can be balanced is undecided: no solver reached an end")
    off = np.abs(A @ np.maximum(found[:columns], 0.0)).reshape(-1, 1 + S.per_contact)
    unbalance = np.zeros(len(packing.r))
    unbalance[S.grains] = off.sum(axis=1)
    return np.where(unbalance > _BALANCED, unbalance, 0.0)


def _inferred(packing, m, spread, error, unit):
    """The Likeliest network, and σ (N_c, 2)."""
    S = ensemble(packing, prune=False)
    sigma = np.full(m.shape, np.nan)
    if error is None:
        # With one σ for all, the network does not depend on it, and χ² σ² is what is left over.
        best = likeliest(S, m, unit)
        error = unit * np.sqrt(max(best.chi_square, _BALANCED) / max(best.freedom, 1))
    sigma[: len(spread)] = np.hypot(positive(error, "error"), spread)
    return likeliest(S, m, sigma), sigma
