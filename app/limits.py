"""How much one visitor may ask of the server, from the environment variable GRANFORCE_LIMITS."""

import os
from typing import NamedTuple

from granforce.records import InputError

LIMITS_VARIABLE = "GRANFORCE_LIMITS"


class Limits(NamedTuple):
    """Largest sizes that are computed or taken; the defaults suit a machine of one's own."""

    n: int = 20_000  # disks of a packing
    states: int = 20_000  # states of a walk or sample
    upload: int = 64  # size of an uploaded file, MB
    computations: int = 2  # at the same time, all visitors together

    def check(self, **asked):
        """InputError if one of the given sizes is below 1 or above its limit."""
        for name, value in asked.items():
            most = getattr(self, name)
            if not 1 <= value <= most:
                raise InputError(f"{NAMES[name]} must lie between 1 and {most}, got {value}")


NAMES = {"n": "N", "states": "the number of states", "upload": "an upload's size in MB"}


def read_limits(text=None):
    """Limits from "n=1000,states=2000,upload=10,computations=2", each optional.

    text: by default what GRANFORCE_LIMITS holds. InputError for other names or values.
    """
    text = os.environ.get(LIMITS_VARIABLE, "") if text is None else text
    given = {}
    for part in filter(None, text.replace(" ", "").split(",")):
        name, _, value = part.partition("=")
        if name not in Limits._fields or not value.isdigit() or int(value) < 1:
            names = ", ".join(Limits._fields)
            raise InputError(f"{LIMITS_VARIABLE}: {part!r} is none of {names} = a whole number")
        given[name] = int(value)
    return Limits(**given)


LIMITS = read_limits()
