"""The memory of this machine: computations that need more are rejected before they start."""

import math
import os

from granforce.records import InputError


def machine_memory() -> float:
    """The memory of this machine in bytes; inf where the system does not report it."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return math.inf


def check_memory(needed: float, what: str) -> None:
    """InputError if a computation needs more bytes than this machine has memory."""
    available = machine_memory()  # if it is unknown, an allocation will fail instead
    if needed > available:
        raise InputError(
            f"{what} would need {min(needed, 1e300) / 1e9:.3g} GB of memory, but this machine has "
            f"{available / 1e9:.3g} GB; choose smaller values"
        )
