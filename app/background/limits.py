"""Limits per visitor, from the environment variable GRANFORCE_LIMITS."""

import math
import os
from typing import Any, NamedTuple

from granforce.records import InputError, brief
from granforce.system.wording import number

LIMITS_VARIABLE = "GRANFORCE_LIMITS"


MOST = 10**9  # largest value of any limit
MOST_COMPUTATIONS = 64  # largest number of threads
LONGEST = 600  # default time limit of a computation on a shared server, s
MOST_SEED = 2**53 - 1  # integers that browsers represent exactly


class Limits(NamedTuple):
    """Largest sizes that are computed or accepted; the defaults suit a personal machine.

    On a `shared` server, parameters that only lengthen a computation have narrower bounds.
    """

    n: int = 20_000  # disks of a packing
    states: int = 20_000  # states of a walk or sample
    upload: int = 64  # size of an uploaded file, MB
    computations: int = 2  # simultaneous ones, for all visitors together
    seconds: int | None = None  # per computation; None on a personal machine

    @property
    def shared(self) -> bool:
        """Whether the server is for others than its owner."""
        return self.seconds is not None

    def check(self, **values: Any) -> None:
        """InputError if a number is outside its limits, or radii differ by more than SIZE_RATIO.

        values: any of NAMES.
        """
        for name, value in values.items():
            if name == "radii":
                _check_radii(value)
                continue
            if name in ("box", "version"):
                continue  # checked when it was given, or a parameter of the algorithm
            words, least, most = NAMES[name]
            if self.shared:
                least, most = SHARED.get(name, (least, most))
            most = getattr(self, name) if most is None else most
            if not least <= value <= most:  # also refuses NaN
                raise InputError(
                    f"{words} must lie between {least:g} and {most}, got {_plain(value)}"
                )


SIZE_RATIO = 20  # largest over smallest radius of a distribution
DISTRIBUTIONS = {"uniform": 2, "bidisperse": 3}  # of radii, with the number of parameters
# Name in words and range of each parameter: up to the limit, or in which the dynamics makes sense.
NAMES: dict[str, tuple[str, float, float | None]] = {
    "n": ("N", 1, None),
    "states": ("the number of networks", 1, None),
    "upload": ("an upload's size in MB", 1, None),
    "mu": ("the friction coefficient", 0, 1000),
    "seed": ("a seed", 0, MOST_SEED),
    "pressure": ("the pressure", 1e-6, 1e6),
    "dt": ("the time step dt", 0.01, 1),
    "box_mass": ("the box mass", 10, 10_000),
    "sweeps": ("the number of sweeps", 1, 10_000),
    "accuracy": ("the accuracy of a step", 1e-6, 1),
    "drag_below": ("the unbalance below which drag begins", 1e-6, 1),
}
# At these bounds a packing takes up to about ten times as long as usual; at the others, a thousand
# times and more.
SHARED: dict[str, tuple[float, float | None]] = {
    "dt": (0.02, 1), "box_mass": (10, 300), "sweeps": (1, 1000), "accuracy": (1e-3, 1),
    "drag_below": (1e-3, 1),
}  # fmt: skip


def _check_radii(text: Any) -> None:
    """InputError unless it is a valid distribution of sizes that can be packed together."""
    kind, _, numbers = str(text).partition(":")
    try:
        values = [number(part) for part in numbers.split(",")]
    except ValueError:
        values = []
    sizes = values[:2]
    if len(values) != DISTRIBUTIONS.get(kind) or not (
        0 < min(sizes) <= max(sizes) <= SIZE_RATIO * min(sizes) < math.inf
    ):
        raise InputError(
            "radii must be named as uniform:LOW,HIGH or bidisperse:SMALL,LARGE,FRACTION, the "
            f"largest at most {SIZE_RATIO} times the smallest, got {brief(text)}"
        )


def _plain(number: float) -> str:
    """A number as people write it: 1e+09, not 1000000000.0."""
    return f"{number:g}" if isinstance(number, float) else brief(number)


def read_limits(text: str | None = None) -> Limits:
    """Limits from "n=1000,states=2000,upload=10,computations=2,seconds=600", each optional.

    text: by default the value of GRANFORCE_LIMITS; without it, the limits of a personal machine.
    InputError for other names or values.
    """
    text = os.environ.get(LIMITS_VARIABLE) if text is None else text
    if text is None:
        return Limits()
    given = {"seconds": LONGEST}
    for part in filter(None, text.replace(" ", "").split(",")):
        name, _, value = part.partition("=")
        most = MOST_COMPUTATIONS if name == "computations" else MOST
        digits = value if value.isdecimal() and len(value) <= len(str(MOST)) else "0"
        if name not in Limits._fields or not 1 <= int(digits) <= most:
            names = ", ".join(Limits._fields)
            raise InputError(
                f"{LIMITS_VARIABLE}: {brief(part)} is not one of {names} = a whole number from 1 "
                f"to {most}"
            )
        given[name] = int(value)
    return Limits(**given)


LIMITS = read_limits()
