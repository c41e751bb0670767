"""Prescribed and known quantities as parameters of entries: plain, and absent by default."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from granforce.forces.knowledge import Known
from granforce.records import InputError, choice, float_array, real, whole
from granforce.study.keys import Parameters

PRESCRIBED = "pressure", "stress", "none"
# Values of unknown bounds in a row: f_n from below and above, f_t likewise.
_UNKNOWN = -np.inf, np.inf, -np.inf, np.inf


def conditions(
    prescribed: str = "pressure", stress: Sequence[float] | None = None, known: Any = None
) -> Parameters:
    """The parameters of conditions other than the pressure alone.

    known: a Known, or rows [contact, least f_n, largest f_n, least f_t, largest f_t] with None for
    unknown bounds. Raises InputError for conditions that no packing could satisfy.
    """
    prescribed = choice(prescribed, PRESCRIBED, "prescribed")
    if stress is not None and prescribed != "stress":
        raise InputError(
            "a stress is given, but not prescribed: add --prescribe stress (prescribed='stress')"
        )
    named = {} if prescribed == "pressure" else {"prescribed": prescribed}
    if stress is not None:
        named["stress"] = float_array(stress, (3,), "stress").tolist()
    rows = [] if known is None else _rows(known)
    return named | ({"known": rows} if rows else {})


def _rows(known: Known | Sequence[Any]) -> list[list[Any]]:
    """Rows of bounds, sorted by contact."""
    given: Any = known
    try:
        if isinstance(known, Known):
            bounds = np.stack(known.sides, axis=-1).reshape(-1, 4)
            given = np.column_stack([np.atleast_1d(known.contacts), bounds]).tolist()
        rows = [[contact, *bounds] for contact, *bounds in given]
    except (TypeError, ValueError):
        rows = [[]]
    if any(len(row) != 5 for row in rows):
        raise InputError(
            "each row of known forces must be a contact and four bounds: two on f_n, two on f_t"
        )
    named = [
        [whole(contact, "the number of a contact"), *map(_bound, bounds, _UNKNOWN)]
        for contact, *bounds in rows
    ]
    return sorted(named, key=lambda row: row[0])


def _bound(given: Any, unknown: float) -> float | None:
    """A bound as a float, or None if it is unknown."""
    value = unknown if given is None else real(given, "a bound")
    if value == unknown:
        return None
    if not np.isfinite(value):
        raise InputError(
            f"a bound on a known force is {value:g}; give a finite number, or where it is unknown "
            "−inf from below and inf from above"
        )
    return value


def of(parameters: Parameters) -> dict[str, Any]:
    """Arguments of `ensemble` for the conditions in the parameters of an entry."""
    given: dict[str, Any] = {
        name: parameters[name] for name in ("prescribed", "stress") if name in parameters
    }
    if "known" in parameters:
        rows = np.array(parameters["known"], dtype=np.float64)  # None becomes NaN
        bounds = rows[:, 1:].reshape(-1, 2, 2)
        low, high = bounds[..., 0], bounds[..., 1]
        low, high = np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high)
        given["known"] = Known(rows[:, 0].astype(np.int64), low, high)
    return given
