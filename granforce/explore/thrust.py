"""Lines of thrust: where the resultant of the forces at a joint can pass.

A joint is an edge that two bodies share, with a contact at each end, a and b. The resultant of its
normal forces passes at the part p = F_b/(F_a + F_b) of the way from a to b. Over S, p is a linear
fractional function: c is its maximum exactly if max (1 − c) F_b − c F_a over S is 0 (Dinkelbach,
Manage. Sci. 13, 492 (1967)), and each linear program has a certified bound.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from granforce.explore.outline import solved
from granforce.forces.contact_problem import cone_costs, known_part, make_system
from granforce.forces.ensemble import Ensemble
from granforce.numerics.certified_values import Solver
from granforce.tolerances import JOINT_GAP, LOADED_JOINT
from granforce.types import Floats, Integers

_ROUNDS = 30


class Thrust(NamedTuple):
    """Joints, and where their resultants can pass: parts of the way from contact a to b."""

    contacts: Integers  # (k, 2) a, b: positions in the backbone
    low: Floats  # (k,) attained by networks; NaN if not certified
    high: Floats  # (k,)
    gap: Floats  # (k,) no network in which the joint carries LOADED_JOINT ⟨f_n⟩ goes farther beyond


def thrust(ensemble: Ensemble) -> Thrust:
    """The Thrust of every joint of which both contacts are in the backbone."""
    c = ensemble.contacts
    _, pair, count = np.unique(
        np.column_stack([c.i, c.j]), axis=0, return_inverse=True, return_counts=True
    )
    order = np.argsort(pair, kind="stable")
    joints = order[count[pair[order]] == 2].reshape(-1, 2)
    size = len(joints)
    axes = np.zeros((2 * size, len(c.i), 2))
    axes[np.arange(2 * size), joints.ravel(), 0] = 1.0
    plane = cone_costs(ensemble, axes).T, known_part(ensemble, axes)
    solver, keys = Solver(make_system(ensemble)), 0
    # Two searches for each joint: the largest p, and the largest 1 − p, with a and b exchanged.
    ends = np.arange(2 * size).reshape(-1, 2)
    ends = np.concatenate([ends, ends[:, ::-1]])
    start = ensemble.original[:, 0][joints] + np.finfo(float).tiny
    part = np.concatenate([start[:, 1], start[:, 0]]) / np.tile(start.sum(axis=1), 2)
    gap, active = np.full(2 * size, np.inf), np.arange(2 * size)
    for _ in range(_ROUNDS):
        a, b = ends[active].T
        directions, rows = np.zeros((len(active), 2 * size)), np.arange(len(active))
        directions[rows, a], directions[rows, b] = -part[active], 1 - part[active]
        supports = solved(solver, plane, directions, keys)[1]
        keys += len(active)
        gap[active] = np.maximum(supports.bound, 0.0) / LOADED_JOINT
        force = np.maximum(supports.point, 0.0)
        total = force[rows, a] + force[rows, b]
        farther = force[rows, b] / np.where(total > 0, total, 1.0)
        going = (gap[active] > JOINT_GAP) & (farther > part[active])
        part[active] = np.where(going, farther, part[active])
        active = active[going]
        if not len(active):
            break
    part = np.where(gap <= JOINT_GAP, part, np.nan)
    return Thrust(joints, 1 - part[size:], part[:size], np.maximum(gap[:size], gap[size:]))
