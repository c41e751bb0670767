"""Messages between a component and its script, in addition to parameters.

A message is a dict of fields. A field is a number (`int`, `float`), text (`str`), `bool`, `True` if
only its name matters, a list ([int, float] of two, [float, ...] of any length), a dict of fields,
an `Array`, or any `object` if the receiver checks it.

A component states both directions: methods with `from_browser` handle what its script sends, and
`to_browser` lists what is sent to the script.
"""

from collections.abc import Callable
from numbers import Integral, Real
from operator import attrgetter
from typing import Any, TypeVar

import numpy as np

Array = np.ndarray
Message = dict[str, Any]
Method = TypeVar("Method", bound=Callable[..., object])


def from_browser(**shape: Any) -> Callable[[Method], Method]:
    """Make a method of a component handle the messages of its script with exactly these fields.

    It is called with the fields by name, without those that are True.
    """

    def declare(method: Method) -> Method:
        vars(method).setdefault("from_browser", []).append(shape)
        return method

    return declare


def forward(path: str, **shape: Any) -> Callable[..., None]:
    """A method that passes the field of such messages to a method of a part: "_state.hand.grab".

    A list becomes several arguments; nothing is passed for True.
    """

    @from_browser(**shape)
    def passed(self: Any, **fields: Any) -> None:
        (given,) = fields.values() or ((),)
        attrgetter(path)(self)(*(given if isinstance(given, (list, tuple)) else (given,)))

    return passed


def fits(value: Any, shape: Any) -> bool:
    """Whether a value has the shape of a message or field."""
    match shape:
        case dict():
            same = isinstance(value, dict) and value.keys() == shape.keys()
            return same and all(fits(value[name], part) for name, part in shape.items())
        case [part, last] if last is ...:
            return isinstance(value, list) and all(fits(one, part) for one in value)
        case list():
            same = isinstance(value, list | tuple) and len(value) == len(shape)
            return same and all(map(fits, value, shape))
        case None | True:
            return value is shape
    if shape in (int, float):
        # Integers too large for a browser are not valid floats either.
        kind: Any = Integral if shape is int else Real
        whole = isinstance(value, int) and abs(value) > 2**53
        return isinstance(value, kind) and not isinstance(value, bool) and not whole
    return isinstance(value, shape)
