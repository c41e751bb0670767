"""Networks while a contact is pulled or pushed.

They lie along the interval of a contact's f_n, over a plane of S, or under a growing load.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from granforce.explore.intervals import intervals
from granforce.explore.outline import extremes
from granforce.explore.pull import Pull, Reach, pull, reach
from granforce.forces.build import ensemble
from granforce.forces.nearest import nearest
from granforce.perturb.critical_force import CriticalForce, Response, critical_force, response
from granforce.perturb.loaded import Loaded, loaded_networks
from granforce.records import InputError, Packing
from granforce.study import conditions
from granforce.types import Floats, Mask

STOPS = 17  # networks along a rail
# With more than MANY contacts a rail has fewer stops, enough for one batch of lanes, and starts
# this fraction of its width inside its ends, where each network is found quickly.
MANY, FEW_STOPS, INWARD = 5000, 5, 1e-4
RIBS = 48  # directions of a fan
LOADS = 9  # on the way to the largest; the line between two of their networks is balanced too
WORKERS = 2  # threads, while a user is dragging


class Rail(NamedTuple):
    """Networks of S in which f_n of one contact ranges from its least to its largest value."""

    low: float  # exact bounds, force
    high: float
    values: Floats  # (k,) f_n of the contact in the states, force, ascending
    states: Floats  # (k, N_c, 2) the networks nearest to the pulled one, force
    residual: Floats  # (k,) in ⟨f_n⟩
    opened: Mask  # (2, N_c) bool, contacts without force at the lower and upper ends
    sliding: Mask  # (2, N_c) bool, contacts at the limit of friction there
    whole: bool = True  # False while values near the ends are missing


class Fan(NamedTuple):
    """Networks of S at the corners of a convex polygon close to the outline of S in a plane."""

    points: Floats  # (k, 2) corners, anticlockwise: (axes[0]·F, axes[1]·F)/⟨f_n⟩
    states: Floats  # (k, N_c, 2) the networks there, force
    residual: Floats  # (k,) in ⟨f_n⟩


class GivenWay(NamedTuple):
    """A force pair that grows on one contact until grains move."""

    critical: CriticalForce
    motion: Response
    under: Loaded  # networks under loads from none to the critical force


class Puller:
    """Pulls contacts of one packing at one friction, sharing what all pulls have in common."""

    def __init__(self, packing: Packing, mu: float, known: Any = None) -> None:
        """known: forces that stay fixed, as for `conditions.conditions`."""
        self._S = ensemble(packing, mu, **conditions.of(conditions.conditions(known=known)))

    def rail(self, contact: int, state: Floats, many: bool | None = None) -> Rail:
        """The whole Rail of a contact (its number in the packing) for the network `state` (N_c, 2).

        many: whether to use few stops; by default if S has more than MANY contacts. Raises the
        errors of `pull` and `reach`.
        """
        *_, whole = self.rails(contact, state, many)
        return whole

    def rails(self, contact: int, state: Floats, many: bool | None = None) -> Iterator[Rail]:
        """Yield the Rail; with many contacts first a part without the ends, which take longest."""
        ends = reach(self._S, contact, workers=WORKERS)
        (position,) = self._S.positions([contact])
        many = len(self._S.index) > MANY if many is None else many
        inward = (ends.high - ends.low) * (INWARD if many else 0.0)
        low, high = ends.low + inward, ends.high - inward
        # The network itself is included, so that nothing jumps when dragging starts.
        stops = np.linspace(low, high, FEW_STOPS if many else STOPS)
        values = np.union1d(stops, np.clip(state[position, 0], low, high))
        inner = (values > low) & (values < high)
        parts: list[Pull] = []
        some = values[inner] if many and inner.any() else values
        if len(some) < len(values):
            parts.append(pull(self._S, contact, some, state, workers=WORKERS))
            yield _rail(ends, parts, whole=False)
            some = values[~inner]
        parts.append(pull(self._S, contact, some, state, workers=WORKERS))
        yield _rail(ends, parts)

    def at(self, contact: int, value: float, state: Floats) -> tuple[Floats, float]:
        """The network (N_c, 2) nearest to `state` with f_n = value on a contact, and its residual.

        Raises the errors of `pull`.
        """
        pulled = pull(self._S, contact, [value], state)
        return pulled.states[0], float(pulled.residual[0])

    def near(self, state: Floats) -> tuple[Floats, float]:
        """The network (N_c, 2) of S nearest to any forces `state`, and its residual."""
        forces = nearest(self._S, state).forces
        return forces, float(self._S.residual(forces[None])[0])

    def loaded(self, contact: int, load: float) -> Loaded:
        """Networks under force pairs on a contact, from none to `load` (force), with some between.

        Raises the errors of `loaded_networks`.
        """
        return loaded_networks(self._S, contact, np.linspace(0.0, load, LOADS))

    def band(self, contact: int, loads: Floats) -> Floats:
        """Least and largest f_n (k, 2) of a contact under force pairs on it (k,), in force.

        Raises the errors of `intervals`.
        """
        S = self._S
        pair = np.zeros((len(S.index), 2))
        pair[S.position(contact), 0] = 1.0
        turned = S.A @ S.to_vector(pair)
        under = [replace(S, b=S.b - load * turned, computed=None) for load in loads]
        exact = [intervals(one, [contact]) for one in under]
        return np.array([[one.low[0, 0], one.high[0, 0]] for one in exact])

    def given_way(self, contact: int, state: Floats, limit: float) -> GivenWay:
        """How a contact with this limit load (force) gives way, from the network `state` (N_c, 2).

        If `state` is rounded, the nearest network of S is used. Raises the errors of
        `critical_force`.
        """
        S = replace(self._S, original=state)
        critical = critical_force(S, contact, limit_load=limit)
        return GivenWay(
            critical=critical,
            motion=response(S, contact, critical=critical),
            under=loaded_networks(S, contact, np.linspace(0.0, critical.low, LOADS)),
        )

    def fan(self, axes: Floats) -> Fan:
        """The Fan of the plane of two axes (2, N_c, 2).

        Raises InputError if S is a line or a point in this plane, and the errors of `outline`.
        """
        S = self._S
        ends = extremes(S, axes, np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]))
        width = np.ptp(self._points(axes, ends), axis=0)
        angle = 2 * np.pi * np.arange(RIBS) / RIBS
        around = np.column_stack([np.cos(angle), np.sin(angle)]) / np.maximum(width, 1e-9)
        states = np.concatenate([ends, extremes(S, axes, around)])
        points = self._points(axes, states)
        try:
            corners = ConvexHull(points).vertices
        except QhullError:
            raise InputError("S has no area in this plane: the point cannot be pulled") from None
        return Fan(points[corners], states[corners], S.residual(states[corners]))

    def _points(self, axes: Floats, states: Floats) -> Floats:
        return np.tensordot(states, axes, ((1, 2), (1, 2))) / self._S.force_scale

    def mixed(self, fan: Fan, axes: Floats, point: Floats, state: Floats) -> tuple[Floats, float]:
        """The network (N_c, 2) at a point (2,) of a fan, and its residual.

        It is on a straight line between `state` and a network on the polygon's edge, which lies in
        S; a point outside the polygon is replaced by the nearest one on its edge. `state` may be
        rounded: the nearest network of S is used.
        """
        state, _ = self.near(state)
        (origin,) = self._points(axes, state[None])
        k, (a, b) = _triangle(fan.points, origin, _inside(fan.points, np.asarray(point, float)))
        after = (k + 1) % len(fan.points)
        forces = (1 - a - b) * state + a * fan.states[k] + b * fan.states[after]
        return forces, float(self._S.residual(forces[None])[0])


def _rail(ends: Reach, parts: list[Pull], whole: bool = True) -> Rail:
    """The Rail of networks pulled to values between two ends."""
    values = np.concatenate([part.values for part in parts])
    order = np.argsort(values)
    return Rail(
        low=ends.low,
        high=ends.high,
        values=values[order],
        states=np.concatenate([part.states for part in parts])[order],
        residual=np.concatenate([part.residual for part in parts])[order],
        opened=ends.opened,
        sliding=ends.sliding != 0,
        whole=whole,
    )


def _inside(corners: Floats, point: Floats) -> Floats:
    """The point, or the nearest one on the polygon's edge if it is outside."""
    edge = np.roll(corners, -1, axis=0) - corners
    away = point - corners
    if np.all(edge[:, 0] * away[:, 1] >= edge[:, 1] * away[:, 0]):
        return point
    along = np.clip((edge * away).sum(axis=1) / (edge**2).sum(axis=1), 0, 1)
    nearest = corners + along[:, None] * edge
    return nearest[np.argmin(((nearest - point) ** 2).sum(axis=1))]


def _triangle(corners: Floats, origin: Floats, point: Floats) -> tuple[int, Floats]:
    """(k, weights (2,)) of a point in the triangle of `origin` and corners k and k + 1."""
    first, second, away = corners - origin, np.roll(corners, -1, axis=0) - origin, point - origin
    area = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        a = (away[0] * second[:, 1] - away[1] * second[:, 0]) / area
        b = (first[:, 0] * away[1] - first[:, 1] * away[0]) / area
    short = np.minimum(np.minimum(a, b), 1 - a - b)
    k = int(np.argmax(np.where(np.isfinite(short), short, -np.inf)))
    weights = np.clip([a[k], b[k]], 0, 1)
    return k, weights / max(1.0, weights.sum())
