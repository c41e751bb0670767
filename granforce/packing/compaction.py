"""From a dilute gas of disks to a jammed packing at rest, at constant pressure (arXiv:0803.3566).

Each time step of contact dynamics is solved by Gauss–Seidel sweeps, over- or under-relaxed, to a
given accuracy; steps grow as grains slow down. Once grains are nearly in balance the last phase
(`settling`) brings them to rest and tests it; if grains keep moving, the dynamics resumes. At μ
= 0 contact dynamics alone does not reach isostaticity, and below 1e-4 it takes very long to come to
rest; there, linear programs finish the packing (`closing`).
"""

from __future__ import annotations

import inspect
import itertools
from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce.fields import record
from granforce.motion import contact_dynamics as dynamics
from granforce.motion.rest import Rest, rest
from granforce.numerics.lanes import MANY, ONE, allocating
from granforce.packing import pair_list
from granforce.packing.closing import margin, prescribed_of, shrink_to_isostatic
from granforce.packing.pair_list import cell_of, motionless, relisted
from granforce.packing.pouring import poured
from granforce.packing.settling import come_to_rest, same_state, slump
from granforce.records import (
    InputError,
    NotJammedError,
    Packing,
    brief,
    choice,
    float_array,
    friction,
    make_packing,
    moderate,
    positive,
    random_seed,
    whole,
)
from granforce.system import cancelling
from granforce.system.memory import check_memory
from granforce.system.wording import number
from granforce.tolerances import MANY_DISKS
from granforce.types import Cancel, Floats, Integers, Mask, Progress

INITIAL_FRACTION = 0.5
# The last phase is tried every CHECK_EVERY steps, once no grain's momentum changes by more than
# NEARLY_BALANCED in a step, in ⟨f_n⟩; beyond LATER_FROM disks, later by the square of their number,
# as the many places where grains still move need many systems, and beyond MANY_DISKS again only
# after twice as many steps each time.
CHECK_EVERY = 25
NEARLY_BALANCED, LATER_FROM = 0.02, 2000
# Longest time step, and most sweeps in it. From SETTLED_FROM on, steps of 0.1 leave wider intervals
# than shorter ones, by 8 % at μ = 0.3, 13 % at 0.5, half at 1. Steps of 0.03 and less agree if the
# last sweeps of a step settle, and then a quarter of the sweeps is enough.
LONGEST, SWEEPS = 0.1, 600
SETTLED_FROM = 0.2
LONGEST_SETTLED, SWEEPS_SETTLED = 0.03, 150
SETTLING = 5  # divisor: this fraction of the sweeps settles
# Up to this μ a packing is finished like a frictionless one, as its geometry differs only by order
# μ and contact dynamics takes very long to reach rest.
NEARLY_FRICTIONLESS = 1e-4
# Strain of the box per step below which the linear programs finish a frictionless packing.
BOX_AT_REST = 1e-6
# Time steps start at SHORTEST times the longest, and grow while no carrying grain moves farther
# than STRIDE (in largest radii).
SHORTEST, STRIDE = 0.1, 0.02
# Shapes of the box, with the number of strain rates; a floor has no box that moves.
BOXES = {"square": 1, "isotropic": 3, "floor": 0, "smooth floor": 0}
# Counters of a compaction besides its steps and sweeps.
WORK = (
    *("list_rebuilds", "linear_programs", "certificates_tried", "implicit_steps"),
    *("linear_systems", "touching_without_force"),
)
# Least memory per disk of a packing: the lists of pairs and one factor of its balance.
DISK_BYTES = 2000
# Coarsest accuracy of a step: an error as fast as the fastest grain means nothing was solved.
COARSEST = 1.0
# The compaction ends if the last phase fails in the same state so many times after the first.
MOST_REPEATS = 2
# How often disks on a floor may fail to come to rest, and after how many times they are poured
# anew: where more contacts press than rigid disks can close at once, no time suffices.
MOST_HEAPS, BEFORE_A_NEW_HEAP = 40, 4
# Steps between two calls of `watch`.
WATCH_EVERY = 5


@record
class Glimpse(NamedTuple):
    """A packing while it is compressed, as passed to `watch` of `pack`; all arrays are copies."""

    step: Annotated[int, "time steps so far"]
    x: Annotated[Floats, "(N, 2) centres inside the box, length"]
    r: Annotated[Floats, "(N,) radii, length"]
    box: Annotated[Floats, "(2,) sides of the cell, length"]
    i: Annotated[Integers, "(k,) grains of the contacts that carry force"]
    j: Annotated[Integers, "(k,) the others"]
    reach: Annotated[Floats, "(k, 2) from the centre of grain i to that of grain j, length"]
    forces: Annotated[Floats, "(k, 2) f_n, f_t, force"]
    packing_fraction: Annotated[float, "φ, rattlers included"]
    unbalance: Annotated[float, "largest change of a grain's momentum per step, ⟨f_n⟩"]
    tilt: Annotated[float, "tilt of the cell, length"] = 0.0

    @property
    def state(self) -> str:
        """Density and distance from rest, in words."""
        return _state(self.packing_fraction, self.unbalance)


@cancelling.cancellable
def pack(
    n: int,
    mu: float,
    seed: int = 1,
    *,
    radii: str | npt.ArrayLike = "uniform:0.5,1",
    pressure: float = 1.0,
    dt: float | None = None,
    box_mass: float = 100.0,
    sweeps: int | None = None,
    accuracy: float = 0.01,
    drag_below: float | None = None,
    box: str = "square",
    max_steps: int = 100_000,
    progress: Progress | None = None,
    watch: Callable[[Glimpse], object] | None = None,
    cancel: Cancel | None = None,
) -> Packing:
    """A jammed packing of n disks with friction coefficient μ in a doubly periodic box, or a heap.

    Parameters
    ----------
    n : int
        Number of disks.
    mu : float
        Friction coefficient μ.
    seed : int, default 1
        Seed of the radii and of the dilute gas at the start.
    radii : str or (n,) array, default "uniform:0.5,1"
        "uniform:LOW,HIGH", "bidisperse:SMALL,LARGE,FRACTION_LARGE", or the radii. In other units of
        length, the same seed gives another packing unless the factor is a power of two, as rounding
        decides which contacts form.
    pressure : float, default 1
        P0, force per length.
    dt : float, optional
        Longest time step, used while no carrying grain moves farther than 0.02. By default 0.1, and
        0.03 from μ = 0.2 on. In units of the largest radius, P0 and the mass density.
    box_mass : float, default 100
        Inertia M_λ of the box, in the same units.
    sweeps : int, optional
        Maximum per step. By default 600, and 150 from μ = 0.2 on.
    accuracy : float, default 0.01
        Largest violation of the laws of Signorini and Coulomb after a step, as a velocity relative
        to the fastest carrying grain.
    drag_below : float, optional
        Drag takes the place of inertia once no grain's momentum changes by more than this in a
        step, in ⟨f_n⟩; by default 0.02, less from 2000 disks on. Only for μ above 10⁻⁴.
    box : {"square", "isotropic", "floor", "smooth floor"}
        Sides and tilt of an isotropic box follow the stress until σ_xx = σ_yy = P0 and σ_xy = 0:
        jammed against shear too. On a floor, disks of weight π r² are poured one by one in a layer
        that is periodic in x and about as deep as wide, and slump until they rest, without inertia:
        μ above 10⁻⁴ (0 at a smooth floor), neither pressure nor settings of the dynamics.
    max_steps : int, default 100,000
        Maximum number of time steps.
    progress : callable, optional
        progress(steps done, None) is called repeatedly, as the total is unknown. It does not change
        a bit of the result.
    watch : callable, optional
        watch(Glimpse) is called at least every 5 steps. It does not change a bit of the result. On
        a floor it is not called.
    cancel : callable, optional
        Polled; returning True raises Cancelled.

    Returns
    -------
    Packing
        Forces balance to 10⁻¹⁰ ⟨f_n⟩. Pressing contacts are closed to 10⁻¹¹ of the largest radius,
        without larger overlaps. Other pairs with gaps below 10⁻⁹ are contacts without force. This
        limit is a convention, as gaps without force may have any size: in about one of eight
        packings of 100 disks, a contact without force has a gap above rounding, and `margin` is not
        certain. Its gaps are also in `info`. info["unfinished_steps"] is the number of steps that
        ended before they were accurate.

    Raises
    ------
    NotJammedError
        After max_steps, with the state reached, or once a state that fails the test of rest returns
        again and again.
    InputError
        For bad input.
    """
    mu = friction(mu)
    pressure = moderate(pressure, "pressure")
    n, seed = number_of_disks(n), random_seed(seed)
    dt, sweeps = default_steps(mu, dt, sweeps)
    dt, box_mass = moderate(dt, "dt"), moderate(box_mass, "box_mass")
    accuracy = positive(accuracy, "accuracy", most=COARSEST)
    sweeps, max_steps = whole(sweeps, "sweeps", 1), whole(max_steps, "max_steps", 1)
    drag_below = check_drag(drag_below, mu)
    check_box(box)
    rng = np.random.default_rng(seed)
    r = draw_radii(radii, n, rng)
    unit = r.max()
    if not BOXES[box]:
        _refuse_unused(
            box,
            (dt, sweeps) != default_steps(mu, None, None),
            pressure=pressure,
            box_mass=box_mass,
            accuracy=accuracy,
            drag_below=drag_below,
            max_steps=max_steps,
        )
        info = {"seed": seed, "radii": radii if isinstance(radii, str) else "list", "box": box}
        return _heap(r / unit, unit, mu, rng, info, progress)
    motion = _dilute_gas(r / unit, rng, BOXES[box])
    motion.pace[:] = SHORTEST * dt, dynamics.MOST_RELAXATION
    settling = sweeps // SETTLING if mu >= SETTLED_FROM else 0
    pace = dynamics.Pace(box_mass, SHORTEST * dt, dt, STRIDE, int(sweeps), settling, accuracy)
    settings = {"dt": dt, "box_mass": box_mass, "sweeps": sweeps, "accuracy": accuracy}
    slow = NEARLY_BALANCED * min(1.0, (LATER_FROM / n) ** 2) if drag_below is None else drag_below
    counters = np.zeros(4, dtype=np.int64)
    work = dict.fromkeys(WORK, 0)
    look = None if watch is None else _looking(watch, unit, pressure, counters)
    if look is not None:
        look(motion, np.inf)
    tested: Packing | None = None
    repeats, wait, next_trial = 0, CHECK_EVERY, 0
    while True:
        motion, overlap, unbalance = _advance(motion, mu, pace, counters, work, look)
        step = int(counters[dynamics.STEPS])
        if progress is not None:
            progress(step, None)
        cancelling.check("compaction")
        is_slow = unbalance <= slow and step >= next_trial
        motion, finished, certificate = _finish(motion, mu, is_slow, work, look)
        if is_slow and n > MANY_DISKS:
            next_trial, wait = step + wait, 2 * wait
        if finished is not None and certificate is not None:
            if certificate.at_rest:
                break
            repeats = repeats + 1 if tested is not None and same_state(tested, finished) else 0
            tested = finished
            if repeats >= MOST_REPEATS:
                raise NotJammedError(
                    f"not at rest after {step} steps: {certificate.reason}, and the dynamics leads "
                    "back to the same state; use another seed"
                )
        if step >= max_steps:
            raise NotJammedError(
                f"not jammed after {step} steps: {_state(_fraction(motion), unbalance)}, strain "
                f"rate {_fastest_strain(motion):.1e}; allow more steps (max_steps) or more sweeps"
            )
    _check_neighbours(finished)
    apart = margin(finished)
    info = {
        "seed": seed,
        "radii": radii if isinstance(radii, str) else "list",
        **settings,
        **({} if box == "square" else {"box": box}),
        **({} if drag_below is None else {"drag_below": drag_below}),
        "steps": step,
        "sweeps_done": int(counters[dynamics.SWEEPS]),
        "contact_updates": int(counters[dynamics.UPDATES]),
        "unfinished_steps": int(counters[dynamics.UNFINISHED]),
        "mean_overlap_of_dynamics": overlap,
        "largest_contact_gap": apart.contact,
        "least_other_gap": apart.other,
        "distance_to_rest": certificate.distance,
        "noise_at_rest": max(certificate.noise),
        **work,
    }
    return _in_users_units(finished, unit, unit * pressure, pressure, info)


def _refuse_unused(box: str, steps_given: bool, **settings: Any) -> None:
    """InputError for settings of the dynamics, which a floor does not use."""
    parameters = inspect.signature(pack).parameters
    given = ["dt, sweeps"] if steps_given else []
    given += [name for name, value in settings.items() if value != parameters[name].default]
    if given:
        raise InputError(f'box="{box}" has no use for {given[0]}: leave it out')


def _heap(
    r: Floats,
    unit: float,
    mu: float,
    rng: np.random.Generator,
    info: dict[str, Any],
    progress: Progress | None,
) -> Packing:
    """Disks at rest on a floor, in the user's units."""
    if mu <= NEARLY_FRICTIONLESS:
        least = f"{NEARLY_FRICTIONLESS:g}"
        raise InputError(f'box="{info["box"]}" needs a friction coefficient above {least}')
    coefficients = mu if info["box"] == "floor" else np.array([mu, 0.0])
    work, looks = dict.fromkeys(WORK, 0), itertools.count(1)

    def look(motion: dynamics.Motion, unbalance: float) -> None:
        if progress is not None:
            progress(next(looks), None)

    for attempt in range(MOST_HEAPS):
        if attempt % BEFORE_A_NEW_HEAP == 0:
            motion = slump(poured(r, rng), coefficients, work, look)
        motion, finished, certificate = come_to_rest(motion, coefficients, work, look)
        if finished is not None and certificate is not None and certificate.at_rest:
            break
    else:
        raise NotJammedError("the disks on the floor did not come to rest; use another seed")
    apart = margin(finished)
    info |= {
        "steps": 0,
        "sweeps_done": 0,
        "largest_contact_gap": apart.contact,
        "least_other_gap": apart.other,
        "distance_to_rest": certificate.distance,
        "noise_at_rest": max(certificate.noise),
        **work,
    }
    weight = np.pi * np.sum(r**2) / finished.box[0] * unit**2
    return _in_users_units(finished, unit, weight, np.nan, info)


def number_of_disks(n: int) -> int:
    """n as an int; InputError for fewer than 3, or for more than fit into memory."""
    n = whole(n, "the number of disks", most=None)
    if n < 3:
        raise InputError(f"a packing needs at least 3 disks, got {n!s:.40}")
    check_memory(DISK_BYTES * n, f"a packing of {n!s:.40} disks")
    return n


def _state(packing_fraction: float, unbalance: float) -> str:
    rest = f", unbalance {unbalance:.1e} ⟨f_n⟩" if np.isfinite(unbalance) else ""
    return f"φ = {packing_fraction:.4f}{rest}"


def _check_neighbours(packing: Packing) -> None:
    """NotJammedError if two disks touch more than once: they are their own neighbours."""
    pairs = np.sort(np.stack([packing.contacts.i, packing.contacts.j]), axis=0)
    if np.unique(pairs, axis=1).shape[1] < pairs.shape[1]:
        raise NotJammedError(
            f"{len(packing.r)} disks are too few for a periodic box: two of them touch through "
            "both sides of it; use more disks, or another seed"
        )


def default_steps(mu: float, dt: float | None, sweeps: int | None) -> tuple[float, int]:
    """The longest time step Δt and the most sweeps in it; None selects the default for μ.

    The defaults are 0.1 and 600, and from μ = 0.2 on 0.03 and 150.
    """
    usual = (LONGEST, SWEEPS) if mu < SETTLED_FROM else (LONGEST_SETTLED, SWEEPS_SETTLED)
    return usual[0] if dt is None else dt, usual[1] if sweeps is None else sweeps


def check_drag(drag_below: float | None, mu: float) -> float | None:
    """The unbalance below which drag begins, None for the default; InputError if it is invalid."""
    if drag_below is None:
        return None
    if mu <= NEARLY_FRICTIONLESS:
        why = "where linear programs finish the packing; leave it out"
        words = f"is not used at μ ≤ {NEARLY_FRICTIONLESS:g}, {why}"
        raise InputError.of("drag_below", drag_below, words)
    return positive(drag_below, "drag_below", most=1.0)


def check_box(box: str) -> str:
    """The name of a box; InputError if the name is unknown."""
    return choice(box, BOXES, "box")


def draw_radii(spec: str | npt.ArrayLike, n: int, rng: np.random.Generator) -> Floats:
    """n radii from "uniform:LOW,HIGH", "bidisperse:SMALL,LARGE,FRACTION_LARGE" or a list."""
    if not isinstance(spec, str):
        r = float_array(spec, (n,), "radii")
    else:
        kind, _, numbers = spec.partition(":")
        try:
            values = [number(v) for v in numbers.split(",")]
        except ValueError:
            values = []
        if kind == "uniform" and len(values) == 2 and 0 < values[0] <= values[1] < np.inf:
            r = rng.uniform(values[0], values[1], n)
        elif kind == "bidisperse" and len(values) == 3 and 0 <= values[2] <= 1:
            r = np.full(n, values[0])
            r[rng.permutation(n)[: round(values[2] * n)]] = values[1]
        else:
            raise InputError(
                f"radii {brief(spec)} not understood: give uniform:LOW,HIGH or "
                "bidisperse:SMALL,LARGE,FRACTION_LARGE with 0 < LOW ≤ HIGH"
            )
    for extreme in (r.min(), r.max()):
        moderate(extreme, "radii")
    return r


def _dilute_gas(r: Floats, rng: np.random.Generator, rates: int) -> dynamics.Motion:
    fraction = INITIAL_FRACTION
    largest_first = np.argsort(-r, kind="stable")
    while True:
        side = np.sqrt(np.pi * np.sum(r**2) / fraction)
        x, placed = _insert(r, largest_first, side, rng, 20_000, cancelling.flag())
        cancelling.check("compaction")
        if placed:
            break
        # Few or very unequal disks may not fit: start more dilute.
        fraction *= 0.9
    dilation = np.zeros(1) if rates == 1 else np.zeros((1, rates))
    return motionless(x, r, np.full(2, side), dilation)


@allocating
def _insert(
    r: Floats, order: Integers, side: float, rng: np.random.Generator, attempts: int, stop: Mask
) -> tuple[Floats, bool]:
    """Random sequential insertion in a periodic square; False if a disk could not be placed.

    Returns early once stop[0] is set.
    """
    x = np.empty((len(r), 2))
    for k in range(len(order)):
        a = order[k]
        for _ in range(attempts):
            x[a, 0] = rng.random() * side
            x[a, 1] = rng.random() * side
            if stop[0]:
                return x, False
            free = 2.0 * r[a] < side
            for m in range(k):
                b = order[m]
                d_x = abs(x[a, 0] - x[b, 0])
                d_y = abs(x[a, 1] - x[b, 1])
                d_x = min(d_x, side - d_x)
                d_y = min(d_y, side - d_y)
                if d_x * d_x + d_y * d_y < (r[a] + r[b]) ** 2:
                    free = False
                    break
            if free:
                break
        else:
            return x, False
    return x, True


def _looking(
    watch: Callable[[Glimpse], object], unit: float, pressure: float, counters: Integers
) -> Callable[[dynamics.Motion, float], object]:
    """look(motion, unbalance), which calls `watch` in the user's units."""

    def look(motion: dynamics.Motion, unbalance: float) -> None:
        carrying = motion.force[:, 0] > 0
        i, j, shift = motion.i[carrying], motion.j[carrying], motion.shift[carrying]
        cell = cell_of(motion)
        glimpse = Glimpse(
            int(counters[dynamics.STEPS]),
            cell.wrapped(motion.x) * unit,
            motion.r * unit,
            motion.box * unit,
            i,
            j,
            (motion.x[j] - motion.x[i] + shift @ cell.vectors) * unit,
            motion.force[carrying] * (unit * pressure),
            _fraction(motion),
            float(unbalance),
            cell.tilt * unit,
        )
        watch(glimpse)

    return look


def _advance(
    motion: dynamics.Motion,
    mu: float,
    pace: dynamics.Pace,
    counters: Integers,
    work: dict[str, Any],
    look: Callable[[dynamics.Motion, float], object] | None = None,
) -> tuple[dynamics.Motion, float, float]:
    """Do CHECK_EVERY time steps; return the motion, mean overlap and unbalance."""
    goal = counters[dynamics.STEPS] + CHECK_EVERY
    while (left := int(goal - counters[dynamics.STEPS])) > 0:
        steps = left if look is None else min(left, WATCH_EVERY)
        overlap, unbalance = dynamics.advance(
            *(motion, mu, 1.0, pace, pair_list.MOVED, steps, counters, cancelling.flag()),
            ONE if len(motion.r) <= MANY_DISKS else MANY,
        )
        cancelling.check("compaction")
        if motion.drift[0] > pair_list.MOVED:
            motion = relisted(motion)
            work["list_rebuilds"] += 1
        if look is not None:
            look(motion, unbalance)
    return motion, overlap, unbalance


def _fraction(motion: dynamics.Motion) -> float:
    return float(np.pi * np.sum(motion.r**2) / np.prod(motion.box))


def _fastest_strain(motion: dynamics.Motion) -> float:
    return float(np.abs(motion.dilation).max())


def _finish(
    motion: dynamics.Motion,
    mu: float,
    slow: bool,
    work: dict[str, Any],
    look: Callable[[dynamics.Motion, float], object] | None,
) -> tuple[dynamics.Motion, Packing | None, Rest | None]:
    """The packing in natural units with its test of rest, or None if it still moves."""
    if mu > NEARLY_FRICTIONLESS:
        return come_to_rest(motion, mu, work, look) if slow else (motion, None, None)
    if _fastest_strain(motion) * motion.pace[0] > BOX_AT_REST:
        return motion, None, None
    packing = shrink_to_isostatic(motion, mu, work)
    if packing is None:
        return motion, None, None
    certificate = rest(packing, **prescribed_of(motion))
    return motion, packing if certificate.at_rest else None, certificate


def _in_users_units(
    packing: Packing, unit: float, force: float, pressure: float, info: dict[str, Any]
) -> Packing:
    walls = {"walls": (unit * packing.walls).tolist()} if len(packing.walls) else {}
    contacts = packing.contacts
    lengths = {name: getattr(contacts, name) * unit for name in ("length", "gap", "arm_i", "arm_j")}
    return make_packing(
        packing.cell.wrapped(packing.x) * unit,
        packing.r * unit,
        packing.box * unit,
        contacts._replace(**lengths),
        packing.forces * force,
        packing.mu,
        pressure,
        load=packing.load * force,
        info=packing.info | walls | info,
        tilt=packing.tilt * unit,
    )
