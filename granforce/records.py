"""The records that the parts of granforce exchange: named tuples of arrays.

Units: length = largest radius, pressure = P0, mass density = 1. Results depend on them only by
scaling, so any consistent units work for imported packings.
Signs: **n** points from grain i to grain j, **t** = (−n_y, n_x); the force on j from i is
f_n n + f_t t, and f_n ≥ 0 presses.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Annotated, Any, NamedTuple, ParamSpec, Self, TypeVar

import numpy as np
import numpy.typing as npt

from granforce import notebook
from granforce.cell import Cell
from granforce.fields import record
from granforce.quantities import FORCE, Field, quantity
from granforce.tolerances import (
    LARGEST_FRICTION,
    LARGEST_TILT,
    LARGEST_UNIT,
    MU_DIGITS,
    RIGID_OVERLAP,
    TOUCHING,
)
from granforce.types import Floats, Integers, Mask

# Integers up to here are exact in kernels, in JSON and as floats.
LARGEST_WHOLE = 2**53
# More threads, or processes, than any machine can run.
MOST_WORKERS = 4096

P = ParamSpec("P")
T = TypeVar("T")
# Corners of a disk that is a part of a body, as drawn.
_CIRCLE = np.exp(2j * np.pi * np.arange(48) / 48)[:, None].view(float)
# Kinds of array elements that are not real numbers, by numpy's letters.
_KINDS = {"c": "complex ones", "M": "dates", "m": "times", "U": "text", "S": "text", "V": "records"}


class InputError(ValueError):
    """Input cannot be used; the message says in one line what is wrong and what to do."""

    # The name of a refused argument, with which the message begins, and its value.
    argument: str = ""
    value: Any = None

    @classmethod
    def of(cls, argument: str, value: Any, words: str) -> Self:
        """The error of an argument; words follow its name."""
        error = cls(f"{argument} {words}")
        error.argument, error.value = argument, value
        return error

    def __str__(self) -> str:
        return " ".join(super().__str__().split())


class InputWarning(UserWarning):
    """Input can be used, but is probably wrong; the message says what to check."""


class ResultWarning(UserWarning):
    """A result is not what was requested; the message says why, and what to do."""


class NotJammedError(InputError):
    """No admissible force network exists, or none was reached within the budget."""


class UndecidedError(InputError):
    """Solvers reached no result that could be verified: the question is open."""


class UnboundedError(InputError):
    """The forces in S have no upper bounds."""

    described = False  # whether an Ensemble has put the reason into words


class Cancelled(Exception):
    """The work was cancelled on request; the current unit of work is lost."""


@record
class Contacts(NamedTuple):
    """Geometry of N_c contacts: at x_i + a_i n + b_i t, which is also x_j − a_j n + b_j t."""

    i: Annotated[Integers, quantity("contact_i", label="")]
    j: Annotated[Integers, quantity("contact_j", label="")]
    normal: Annotated[Floats, quantity("normal", label="")]
    length: Annotated[Floats, quantity("length", label="")]
    gap: Annotated[Floats, quantity("gap", label="", note="negative if grains overlap")]
    arm_i: Annotated[Floats, quantity("arm_i", label="", note="a_i")]
    arm_j: Annotated[Floats, quantity("arm_j", label="", note="a_j")]
    levers: Annotated[Floats | None, quantity("levers", label="", note="b; None: 0 everywhere")] = (
        None
    )
    friction_ratio: Annotated[
        Floats | None, quantity("friction_ratio", label="", note="None: 1 everywhere")
    ] = None

    def picked(self, rows: Integers | Mask) -> Contacts:
        """The contacts of these rows: a mask (N_c,), or positions (k,)."""
        return Contacts._make(None if values is None else values[rows] for values in self)

    def joined(self, others: Contacts) -> Contacts:
        """These contacts, then the others."""
        both = [self, others]
        if (self.levers is None) != (others.levers is None):
            both = [one._replace(levers=one.offsets) for one in both]
        if (self.friction_ratio is None) != (others.friction_ratio is None):
            both = [one._replace(friction_ratio=one.friction(1.0)) for one in both]
        pairs = zip(*both, strict=True)
        return Contacts._make(None if a is None else np.concatenate([a, b]) for a, b in pairs)

    def friction(self, mu: float) -> Floats:
        """Friction coefficients (N_c,), the largest of the packing being μ."""
        return np.full(len(self.i), mu) if self.friction_ratio is None else mu * self.friction_ratio

    @property
    def tangent(self) -> Floats:
        """Unit vectors t (N_c, 2)."""
        return np.column_stack([-self.normal[:, 1], self.normal[:, 0]])

    @property
    def offsets(self) -> Floats:
        """Levers (N_c, 2), zeros where there are none."""
        return np.zeros((len(self.i), 2)) if self.levers is None else self.levers


@record
class Shapes(NamedTuple):
    """Shapes and inertia of N bodies; their parts are convex polygons, and disks."""

    corners: Annotated[Floats, quantity("corners", label="", note="anticlockwise")]
    sides: Annotated[Integers, quantity("sides", label="")]
    mass: Annotated[Floats, quantity("mass", label="")]
    inertia: Annotated[Floats, quantity("inertia", label="", note="about the centre of mass")]
    body: Annotated[
        Integers | None, quantity("part_body", label="", note="None: each body is one part")
    ] = None
    circles: Annotated[
        Floats | None, quantity("circles", label="", note="None: those of the bodies")
    ] = None

    def part_corners(self) -> list[Floats]:
        """The corners (k, 2) of each part; empty for a disk."""
        return np.split(self.corners, np.cumsum(self.sides)[:-1])

    def polygons(self) -> list[Floats]:
        """The corners (k, 2) of each body; empty for a disk.

        Of several parts one path, which passes from one to the next where their corners are
        closest, and back.
        """
        if self.body is None or self.circles is None:
            return self.part_corners()
        paths = [np.empty((0, 2))] * len(self.mass)
        for body, corners, circle in zip(self.body, self.part_corners(), self.circles, strict=True):
            part = corners if len(corners) else circle[:2] + circle[2] * _CIRCLE
            paths[body] = _path_through(paths[body], part)
        return paths


def _path_through(path: Floats, part: Floats) -> Floats:
    """The closed path with the closed path of one more part."""
    if not len(path):
        return part
    apart = np.hypot(*np.moveaxis(path[:, None] - part, -1, 0))
    at, first = np.unravel_index(np.argmin(apart), apart.shape)
    return np.concatenate([path[: at + 1], part[first:], part[: first + 1], path[at:]])


@record
class Packing(NamedTuple):
    """N disks, or bodies of other shapes, their contacts, and one force network on them."""

    x: Annotated[Floats, quantity("x", label="centre")]
    r: Annotated[Floats, quantity("r", label="radius", note="of polygons to the farthest corner")]
    box: Annotated[Floats, quantity("box", label="")]
    contacts: Annotated[Contacts, "geometry of the contacts"]
    forces: Annotated[Floats, quantity("forces")]
    mu: Annotated[float, quantity("mu", note="the largest if `contacts.friction_ratio` is given")]
    pressure: Annotated[float, quantity("pressure")]
    load: Annotated[Floats, quantity("load", note="NaN: the balance of the grain is left open")]
    info: Annotated[dict[str, Any], "origin: seed, steps, skipped work, … (plain values)"]
    tilt: Annotated[float, quantity("tilt", note="0 if a direction is open")] = 0.0
    shapes: Annotated[Shapes | None, "of bodies other than disks; x are then centres of mass"] = (
        None
    )

    @property
    def cell(self) -> Cell:
        """The periodic cell."""
        return Cell(self.box, self.tilt)

    @property
    def contact_points(self) -> Floats:
        """Points of contact (N_c, 2), at their image in the cell, length."""
        c = self.contacts
        at = self.x[c.i] + c.arm_i[:, None] * c.normal
        return self.cell.wrapped(at if c.levers is None else at + c.levers[:, :1] * c.tangent)

    @property
    def volume(self) -> float:
        """Area V of the cell (length², infinite if open)."""
        return float(np.prod(self.box))

    @property
    def areas(self) -> Floats:
        """Areas (N,) of the grains, length²."""
        areas = np.pi * self.r**2
        for body, corners in enumerate(() if self.shapes is None else self.shapes.polygons()):
            if len(corners):
                x, y = (corners - corners.mean(axis=0)).T
                areas[body] = 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))
        return areas

    @property
    def packing_fraction(self) -> float:
        """φ = Σ π r² / V, including rattlers; NaN in an open box."""
        return float(np.pi * np.sum(self.r**2) / self.volume) if self.volume < np.inf else np.nan

    @property
    def are_walls(self) -> Mask:
        """Which grains (N,) are walls, or fixed bodies among bodies of other shapes."""
        count, walls = len(self.r), self.info.get("walls")
        if isinstance(walls, int):
            walls = np.arange(count) >= count - walls
        else:
            walls = np.arange(count) >= self.info.get("disks", count)
        fixed = np.isnan(self.load).all(axis=1)
        return walls | fixed if self.shapes is not None else walls

    @property
    def touch_walls(self) -> Mask:
        """Which contacts (N_c,) are with `are_walls`."""
        return self.are_walls[np.stack([self.contacts.i, self.contacts.j])].any(axis=0)

    @property
    def walls(self) -> Floats:
        """Ends of the walls (k, 4), length; none if only their contacts with grains are known."""
        ends = self.info.get("walls")  # some importers count walls
        return np.array(ends if isinstance(ends, list) else [], dtype=float).reshape(-1, 4)

    def through_contacts(self, numbers: Integers, forces: Floats) -> tuple[Floats, Floats]:
        """Lines through contacts (k,) along their forces (k, 2): begin and branch (k, 2).

        They are 1.4 times as long as the shorter arm, so that the lines of a body stay apart.
        """
        c = self.contacts.picked(numbers)
        along = forces[:, :1] * c.normal + forces[:, 1:] * c.tangent
        size = np.hypot(*along.T)
        half = 0.7 * np.minimum(np.abs(c.arm_i), np.abs(c.arm_j)) / np.where(size > 0, size, 1.0)
        branch = 2 * half[:, None] * along
        return self.contact_points[numbers] - 0.5 * branch, branch

    def _repr_svg_(self) -> str:
        """The packing as displayed in notebooks."""
        contacts = self.contacts
        begin, branch = self.cell.wrapped(self.x)[contacts.i], contacts.length[:, None]
        branch = branch * contacts.normal
        if self.shapes is not None:
            begin, branch = self.through_contacts(np.arange(len(contacts.i)), self.forces)
        return notebook.packing_svg(
            notebook.Picture(
                cell=self.cell,
                x=self.x,
                r=self.r,
                begin=begin,
                branch=branch,
                forces=self.forces,
                friction=contacts.friction(self.mu),
                mu=self.mu,
                packing_fraction=self.packing_fraction,
                grains=int(np.isfinite(self.load).all(axis=1).sum()),
                polygons=() if self.shapes is None else self.shapes.polygons(),
            )
        )


@record
class Relaxation(NamedTuple):
    """The result of a relaxation solver."""

    forces: Annotated[Floats, Field("contact component", FORCE, "the network")]
    iterations: Annotated[int, "sweeps or iterations used"]
    residual: Annotated[float, quantity("residual", "")]
    violation: Annotated[float, quantity("violation", "")]
    converged: Annotated[bool, "the solver's own iteration ended (at rest or in steady motion)"]
    seconds: Annotated[float, quantity("seconds")]


# The call that makes an argument of a function.
_MAKERS = {
    "Contacts": "contacts = gf.make_contacts(i, j, normal, length, r)",
    "CriticalForce": "critical = gf.critical_force(S, contact)",
    "Ensemble": "S = gf.ensemble(packing)",
    "Packing": "packing = gf.pack(400, 0.1), or gf.load_packing(file)",
    "Snapshots": "snapshots = gf.open_lammps(…), or gf.open_mercury(…)",
    "UniformSample": "sample = gf.sample_uniform(S, 1000)",
    "Walk": "done = gf.walk(S, 1000)",
}


def takes(kind: type | None = None, **kinds: type) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """A decorator: the function raises InputError unless its first argument has this type.

    kinds: {argument: type} of other arguments, which may be None. The message names the call that
    makes such an object. If forces turn out to be unbounded, the error names those of the Ensemble.
    """

    def checked(function: Callable[P, T]) -> Callable[P, T]:
        signature = inspect.signature(function)
        expected = ({} if kind is None else {next(iter(signature.parameters)): kind}) | kinds

        @functools.wraps(function)
        def inside(*arguments: P.args, **options: P.kwargs) -> T:
            given = dict(zip(signature.parameters, arguments, strict=False)) | options
            for name in expected.keys() & given.keys():
                if given[name] is not None or name not in kinds:
                    _check_kind(function.__name__, given[name], expected[name])
            try:
                return function(*arguments, **options)
            except UnboundedError as error:
                able = [one for one in given.values() if hasattr(one, "describe_unbounded")]
                if error.described or not able:
                    raise
                raise able[0].describe_unbounded() from None

        return inside

    return checked


def refuse_options(function: Callable[..., Any], given: Iterable[str], more: Iterable[str]) -> None:
    """TypeError for an option that is neither the function's own nor among `more`."""
    parameters = inspect.signature(function).parameters.values()
    names = [one.name for one in parameters if one.default is not one.empty]
    for name in sorted(set(given) - set(more))[:1]:
        raise TypeError(
            f"{function.__name__} has no option {name!r}; its options are "
            f"{', '.join(dict.fromkeys([*names, *more]))}"
        )


def with_article(noun: str) -> str:
    """A noun with its indefinite article: a Packing, an Ensemble, a UniformSample."""
    return f"{'an' if noun[0] in 'AEIOaeio' else 'a'} {noun}"


def _check_kind(function: str, given: Any, kind: type) -> None:
    if isinstance(given, kind):
        return
    plain, maker = isinstance(given, (str, int, float)), _MAKERS[kind.__name__]
    if isinstance(getattr(given, "packing", None), Packing):  # a Photoelastic
        maker = maker.replace("(packing)", "(photo.packing)")
    raise InputError(
        f"{function} takes {with_article(kind.__name__)}, not "
        f"{brief(given) if plain else with_article(type(given).__name__)}; make one first: {maker}"
    )


def refuse_hidden(values: T, name: str) -> T:
    """The values themselves, unless a cast to floats would silently change them.

    Raises InputError naming the array for masked values, imaginary parts, dates, and text.
    """
    if np.ma.isMaskedArray(values) and np.ma.getmaskarray(values).any():
        raise InputError(f"{name} has masked values; leave them out, or fill them in")
    try:
        kind = np.asarray(values).dtype.kind
    except ValueError:
        raise InputError(f"{name} must be a regular array, not rows of different lengths") from None
    if kind not in "biufO":
        raise InputError(f"{name} must be real numbers, got {_KINDS.get(kind, 'something else')}")
    return values


def real_array(values: npt.ArrayLike, name: str) -> Floats:
    """A new contiguous float64 array of real numbers, which may include NaN and infinity.

    Raises InputError as `refuse_hidden`, and for irregular arrays or entries that are not numbers.
    """
    try:
        return np.array(refuse_hidden(values, name), dtype=np.float64, order="C")
    except InputError:
        raise
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} must be real numbers in a regular array") from None


def float_array(values: npt.ArrayLike, shape: tuple[int, ...], name: str) -> Floats:
    """Cast to a contiguous float64 array of the given shape (−1: any) and check it is finite.

    Raises InputError naming the array, as `real_array` does.
    """
    array = real_array(values, name)
    if array.ndim != len(shape) or any(
        want not in (-1, have) for want, have in zip(shape, array.shape, strict=True)
    ):
        wanted = str(shape).replace("-1", "N")
        raise InputError(f"{name} must have shape {wanted}, got {array.shape}")
    if not np.all(np.isfinite(array)):
        raise InputError(f"{name} contains NaN or infinite values; remove or repair them")
    return array


def real(value: Any, name: str) -> float:
    """One real number as a float, which may be NaN or infinity; InputError otherwise."""
    array = real_array(value, name)
    if array.ndim:
        raise InputError.of(name, value, f"must be one number, got {brief(value)}")
    return float(array)


def choice(value: Any, options: Collection[str], name: str) -> str:
    """The value, if it is one of the options; InputError otherwise."""
    if not isinstance(value, str) or value not in options:
        *others, last = options
        words = f"must be {', '.join(others)} or {last}, got {brief(value)}"
        raise InputError.of(name, value, words)
    return value


def worker_count(value: Any, name: str = "workers") -> int:
    """The value as a number of threads or processes; InputError otherwise."""
    return whole(value, name, 1, MOST_WORKERS)


def brief(value: Any) -> str:
    """A value for a message: one line of at most 40 characters."""
    return " ".join(repr(value).split())[:40]


def brief_list(values: Collection[Any], most: int = 8) -> str:
    """The first values for a message, separated by commas, and how many more there are."""
    first = ", ".join(str(value)[:40] for value in list(values)[:most])
    return first if len(values) <= most else f"{first} and {len(values) - most} more"


def _number(value: Any, name: str) -> float:
    """The value as a float; InputError for anything else, also for text."""
    try:
        if isinstance(value, (str, bytes)):
            raise TypeError
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError.of(name, value, f"must be a number, got {brief(value)}") from None


def friction(mu: Any) -> float:
    """μ as a float on the storage grid (15 digits).

    Raises InputError unless it is 0 or between 1/LARGEST_UNIT and LARGEST_FRICTION.
    """
    name = "friction coefficient"
    value = _number(mu, name)
    if not np.isfinite(value) or value < 0:
        raise InputError.of(name, mu, f"must be finite and ≥ 0, got {value:g}")
    if value > LARGEST_FRICTION:
        why = "is too large for the balance of forces in double precision; use at most"
        raise InputError.of(name, mu, f"{value:g} {why} {LARGEST_FRICTION:g}")
    if 0 < value < 1 / LARGEST_UNIT:  # its inverse, or a product of two, would overflow
        words = f"{value:g} is too small; take 0, or at least {1 / LARGEST_UNIT:g}"
        raise InputError.of(name, mu, words)
    return float(f"{abs(value):.{MU_DIGITS}g}")  # also for −0


def with_friction(contacts: Contacts, mu: Any) -> tuple[Contacts, float]:
    """The contacts with friction coefficients μ (N_c,), and the largest of these.

    One number is that of the roughest contacts; the ratio of others to it stays as it is.
    """
    several = np.iterable(mu) and not isinstance(mu, str)
    if not several:
        return contacts, friction(mu)
    values = float_array(mu, contacts.i.shape, "friction coefficients")
    each, place = np.unique(values, return_inverse=True)
    each = np.array([friction(value) for value in each])
    most = float(each.max(initial=0.0))
    ratio = (each / most)[place] if len(each) > 1 else None
    return contacts._replace(friction_ratio=ratio), most


def positive(
    value: Any, name: str, *, or_zero: bool = False, least: float = 0.0, most: float = np.inf
) -> float:
    """The value as a finite float > 0 (or_zero: ≥ 0) from least to most; InputError otherwise."""
    number = _number(value, name)
    if not np.isfinite(number) or number < 0 or (number == 0 and not or_zero):
        words = f"must be finite and {'≥' if or_zero else '>'} 0, got {number:g}"
        raise InputError.of(name, value, words)
    if number < least:
        raise InputError.of(name, value, f"must be at least {least:g}, got {number:g}")
    if number > most:
        raise InputError.of(name, value, f"must be at most {most:g}, got {number:g}")
    return number


def whole(value: Any, name: str, least: int = 0, most: int | None = LARGEST_WHOLE) -> int:
    """The value as an int from least to most (None: any size); InputError otherwise."""
    try:
        number = int(value)
        exact = number == value
    except (TypeError, ValueError, OverflowError):
        exact = False
    if not exact:
        raise InputError.of(name, value, f"must be a whole number, got {brief(value)}")
    if number < least:
        raise InputError.of(name, value, f"must be at least {least}, got {brief(value)}")
    if most is not None and number > most:
        raise InputError.of(name, value, f"must be at most {most}, got {brief(value)}")
    return number


def are_whole(values: npt.ArrayLike, most: int = LARGEST_WHOLE) -> Mask:
    """Mask of values (…) that are integers from 0 to `most`, which a cast to int preserves.

    For use before every cast: numbers too large for int64 would silently become other numbers.
    """
    values = np.asarray(values)
    try:
        with np.errstate(invalid="ignore"):
            return (values >= 0) & (values <= most) & (values % 1 == 0)
    except TypeError:  # not numbers
        return np.zeros(values.shape, dtype=bool)


def random_seed(value: Any, name: str = "seed") -> int:
    """The value as an int ≥ 0 of any size; InputError otherwise."""
    return whole(value, name, most=None)


def moderate(value: Any, name: str) -> float:
    """The value as a float > 0 whose powers stay finite; InputError otherwise."""
    number = positive(value, name)
    if not 1 / LARGEST_UNIT <= number <= LARGEST_UNIT:
        limits = f"between {1 / LARGEST_UNIT:g} and {LARGEST_UNIT:g}"
        words = f"must lie {limits}, got {number:g}; choose another unit"
        raise InputError.of(name, value, words)
    return number


def make_contacts(
    i: npt.ArrayLike, j: npt.ArrayLike, normal: npt.ArrayLike, length: npt.ArrayLike, r: Floats
) -> Contacts:
    """Contacts from array-likes, cast once.

    Parameters
    ----------
    i, j : (N_c,) array of int
        Grains, from 0.
    normal : (N_c, 2) array
        Unit vectors from i to j.
    length : (N_c,) array
        Centre distances.
    r : (N,) array
        Radii.

    Returns
    -------
    Contacts
        Lever arms are the radii if no contact overlaps by more than 10⁻⁵ of the largest radius, and
        otherwise extend to the middle of the overlap, a = r − overlap/2 (soft disks).

    Raises
    ------
    InputError
        For grains outside 0 … N − 1, self-contacts, normals of other length, distances ≤ 0.
    """
    r = float_array(r, (-1,), "radii")
    i, j = _numbers_of_grains(i, "i"), _numbers_of_grains(j, "j")
    if i.ndim != 1 or i.shape != j.shape:
        raise InputError(f"contact lists i and j differ in shape: {i.shape} and {j.shape}")
    count = len(i)
    if not all(are_whole(k, len(r) - 1).all() for k in (i, j)):
        raise InputError(f"a contact names a grain outside 0 … {len(r) - 1}")
    i, j = (np.ascontiguousarray(k, dtype=np.int64) for k in (i, j))
    if np.any(i == j):
        raise InputError(f"contact {int(np.argmax(i == j))} joins a grain with itself")
    normal = float_array(normal, (count, 2), "contact normals")
    norm = np.hypot(normal[:, 0], normal[:, 1])
    if np.any(np.abs(norm - 1) > 1e-6):
        raise InputError("contact normals must be unit vectors")
    length = float_array(length, (count,), "centre distances")
    if np.any(length <= 0):
        raise InputError(f"contact {int(np.argmax(length <= 0))} has centre distance ≤ 0")
    gap = length - r[i] - r[j]
    soft = count > 0 and gap.min() < -RIGID_OVERLAP * r.max()
    inward = gap / 2 if soft else np.zeros(count)
    return Contacts(i, j, normal / norm[:, None], length, gap, r[i] + inward, r[j] + inward)


def make_contacts_at(
    i: npt.ArrayLike,
    j: npt.ArrayLike,
    point: npt.ArrayLike,
    normal: npt.ArrayLike,
    x: npt.ArrayLike,
    gap: npt.ArrayLike | None = None,
) -> Contacts:
    """Contacts of bodies of any shape, from the points where they touch.

    Parameters
    ----------
    i, j : (N_c,) array of int
        Bodies, from 0.
    point : (N_c, 2) array
        Points of contact.
    normal : (N_c, 2) array
        Unit vectors from i to j.
    x : (N, 2) array
        Centres of mass.
    gap : (N_c,) array, optional
        Distance of the surfaces, by default 0.

    Returns
    -------
    Contacts
        For `make_packing`.

    Raises
    ------
    InputError
        As `make_contacts`.
    """
    x = float_array(x, (-1, 2), "centres of mass")
    contacts = make_contacts(i, j, normal, np.ones(np.shape(i)), np.ones(len(x)))
    point = float_array(point, contacts.normal.shape, "points of contact")
    gap = np.zeros(len(point)) if gap is None else float_array(gap, contacts.i.shape, "gaps")
    from_i, from_j = point - x[contacts.i], point - x[contacts.j]
    arms = [np.sum(from_i * contacts.normal, axis=1), -np.sum(from_j * contacts.normal, axis=1)]
    levers = np.stack(
        [np.sum(part * contacts.tangent, axis=1) for part in (from_i, from_j)], axis=1
    )
    # Bodies that hook into each other may have arms, and a length, below 0.
    length = arms[0] + arms[1]
    return contacts._replace(length=length, gap=gap, arm_i=arms[0], arm_j=arms[1], levers=levers)


def refuse_shapes(packing: Packing, what: str) -> None:
    """InputError naming what supports disks only, for a packing of other bodies."""
    if packing.shapes is not None or packing.contacts.levers is not None:
        raise InputError(f"{what} for disks only; this packing has bodies of other shapes")


def _numbers_of_grains(values: npt.ArrayLike, name: str) -> npt.NDArray[Any]:
    """Numbers of grains without a cast to floats, which would round large ones."""
    values = np.asarray(refuse_hidden(values, f"contact list {name}"))
    return real_array(values, f"contact list {name}") if values.dtype.kind == "O" else values


def make_packing(
    x: npt.ArrayLike,
    r: npt.ArrayLike,
    box: npt.ArrayLike,
    contacts: Contacts,
    forces: npt.ArrayLike,
    mu: Any,
    pressure: float = np.nan,
    load: npt.ArrayLike | None = None,
    info: Mapping[str, Any] | None = None,
    tilt: float = 0.0,
    shapes: Shapes | None = None,
) -> Packing:
    """A Packing from array-likes, cast and validated once, all in one system of units.

    Parameters
    ----------
    x : (N, 2) array
        Centres.
    r : (N,) array
        Radii.
    box : (2,) array
        Sides L_x, L_y of the cell, inf in an open direction.
    contacts : Contacts
        From `make_contacts`.
    forces : (N_c, 2) array
        f_n, f_t of the packing's network, zeros if there is none.
    mu : float or (N_c,) array
        Friction coefficient, or those of all contacts.
    pressure : float, default NaN
        P0, force per length, NaN if none is prescribed.
    load : (N, 3) array, optional
        External force and torque on each grain, by default none; a row of NaN leaves its balance
        open.
    info : mapping, optional
        Plain values to store with the packing.
    tilt : float, default 0
        x component of the cell's second vector. A tilt beyond ±L_x/2 is replaced by the one in this
        range that spans the same lattice.
    shapes : Shapes, optional
        Of bodies other than disks.

    Returns
    -------
    Packing
        The validated packing.

    Raises
    ------
    InputError
        For wrong shapes, non-finite numbers, radii ≤ 0, repeated contacts, grains that touch their
        own images, and shapes that do not match.
    """
    _check_kind("make_packing", contacts, Contacts)
    r = float_array(r, (-1,), "radii")
    if np.any(r <= 0):
        raise InputError(f"radius of grain {int(np.argmax(r <= 0))} is not positive")
    x = float_array(x, (len(r), 2), "centres")
    box, tilt = make_cell(box, tilt)
    _check_own_images(Cell(box, tilt), 2 * r.max(initial=0))
    load = np.zeros((len(r), 3)) if load is None else _loads(load, len(r))
    pressure = real(pressure, "pressure")
    if not np.isnan(pressure):
        pressure = moderate(pressure, "pressure")
    forces = float_array(forces, (len(contacts.i), 2), "forces")
    if twice := repeated(contacts):
        i, j = contacts.i[twice[0]], contacts.j[twice[0]]
        raise InputError(
            f"contacts {twice[0]} and {twice[1]} are the same: both join grains {i} and {j}; give "
            "each contact once"
        )
    shapes = None if shapes is None else _shapes(shapes, len(r))
    info = dict(info or {})
    pressure = float(pressure)
    contacts, mu = with_friction(contacts, mu)
    return Packing(x, r, box, contacts, forces, mu, pressure, load, info, tilt, shapes)


def _shapes(shapes: Shapes, bodies: int) -> Shapes:
    sides, body, circles = np.asarray(shapes.sides), shapes.body, shapes.circles
    if sides.shape != ((bodies,) if body is None else np.shape(body)) or not are_whole(sides).all():
        raise InputError(f"shapes must give the number of corners of {bodies} bodies, or each part")
    if body is not None:
        if not are_whole(body, bodies - 1).all() or circles is None:
            raise InputError(f"parts must have circles, and be of bodies 0 … {bodies - 1}")
        body = np.asarray(body, dtype=np.int64)
        circles = float_array(circles, (len(sides), 3), "circles of parts")
    corners = float_array(shapes.corners, (int(sides.sum()), 2), "corners of shapes")
    mass = float_array(shapes.mass, (bodies,), "masses")
    inertia = float_array(shapes.inertia, (bodies,), "moments of inertia")
    if np.any(mass <= 0) or np.any(inertia <= 0):
        raise InputError("masses and moments of inertia must be above 0")
    return Shapes(corners, sides.astype(np.int64), mass, inertia, body, circles)


def make_cell(box: npt.ArrayLike, tilt: float = 0.0) -> Cell:
    """A Cell of sides (2,) > 0, inf in open directions, with a tilt reduced to ±L_x/2.

    Raises InputError for anything else, and for a tilted cell with an open direction.
    """
    try:
        box = real_array(box, "box")
    except InputError as error:
        raise InputError(f"box must be two sides L_x, L_y > 0: {error}") from None
    tilt = real(tilt, "tilt")
    if box.shape != (2,) or not np.all(box > 0):
        raise InputError.of(
            "box", box, f"must be two sides L_x, L_y > 0, got {brief(box.tolist())}"
        )
    if not np.isfinite(tilt):
        raise InputError(f"the tilt of the cell must be a finite number, got {tilt}")
    if tilt and not np.all(np.isfinite(box)):
        raise InputError(
            f"a cell tilted by {tilt:g} must be periodic in both directions, got sides {box}; "
            "leave out the tilt, or give both sides"
        )
    if abs(tilt) > LARGEST_TILT * box[0]:
        raise InputError(
            f"the tilt {tilt:g} is more than {LARGEST_TILT:g} times the side {box[0]:g}; subtract "
            "whole sides"
        )
    return Cell(box, float(tilt - box[0] * np.round(tilt / box[0])) if tilt else 0.0)


def _check_own_images(cell: Cell, diameter: float) -> None:
    if not cell.tilt and np.any(cell.box <= diameter):
        raise InputError(
            f"box sides must be above the largest diameter, {diameter:g}, got {cell.box}: do the "
            "radii, positions and box have the same unit of length?"
        )
    # A tilted cell may be lower than a diameter, because its images are displaced sideways; if it
    # is lower than a radius, every search would visit hundreds of images.
    if cell.tilt and cell.box[1] < diameter / 2:
        raise InputError(
            f"the tilted cell of sides {cell.box} is lower than the largest radius, "
            f"{diameter / 2:g}; describe it by other vectors of its lattice"
        )
    if cell.shortest <= diameter:
        raise InputError(
            f"the cell of sides {cell.box}, tilted by {cell.tilt:g}, has a grain's own image at a "
            f"distance of {cell.shortest:g}, which must be above the largest diameter {diameter:g}"
        )


def _loads(load: npt.ArrayLike, count: int) -> Floats:
    """Loads (N, 3) whose rows are finite, or NaN as a whole."""
    load = real_array(load, "loads")
    if load.shape != (count, 3):
        raise InputError(f"loads must have shape {(count, 3)}, got {load.shape}")
    left_open = np.asarray(np.isnan(load).all(axis=-1))
    float_array(np.where(left_open[..., None], 0.0, load), (count, 3), "loads")
    return load


def repeated(contacts: Contacts) -> tuple[int, int] | None:
    """The first repeated contact, after the contact that it repeats; None if there is none.

    Two disks touch twice only through different images, whose normals differ by 60° or more. At
    most eight directions are 41° (n·n′ = 0.75) apart, so at most eight contacts of a pair precede
    its first repetition. Bodies with edges may touch twice with one normal, at different places.
    """
    low, high = np.minimum(contacts.i, contacts.j), np.maximum(contacts.i, contacts.j)
    turned, (own, other) = contacts.i > contacts.j, contacts.offsets.T
    normal = np.where(turned[:, None], -contacts.normal, contacts.normal)
    arm, lever = np.where(turned, -contacts.arm_j, contacts.arm_i), np.where(turned, other, own)
    # From the first body; disks are round, and images of a pair have one arm.
    place = arm[:, None] * contacts.normal + lever[:, None] * contacts.tangent
    reach = np.abs(contacts.arm_i) + np.abs(contacts.arm_j)
    if contacts.levers is None:
        place[:] = 0.0
    order = np.lexsort((high, low))
    pairs: list[tuple[int, int]] = []
    for apart in range(1, min(len(order), 9)):
        a, b = order[:-apart], order[apart:]
        same = (low[a] == low[b]) & (high[a] == high[b])
        if not same.any():
            break
        same &= np.abs(place[a] - place[b]).max(axis=1) <= TOUCHING * reach[a]
        alike = np.flatnonzero(same & (np.sum(normal[a] * normal[b], axis=1) > 0.75))
        for first in alike[np.argsort(b[alike])][:1]:
            pairs.append((int(a[first]), int(b[first])))
    return min(pairs, key=lambda pair: pair[::-1], default=None)
