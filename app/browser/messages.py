"""Messages between scripts and server, in addition to parameters.

A message is a dict of fields. A field is a number (`int`, `float`), text (`str`), `bool`, `True` if
only its name matters, a list ([int, float] of two, [float, ...] of any length), a dict of fields,
an `Array`, or any `object` if the receiver checks it.
"""

from collections.abc import Mapping
from numbers import Integral, Real
from typing import Any

import numpy as np

Array = np.ndarray
Message = dict[str, Any]

# {component: messages sent by its script}; contacts are positions in the backbone.
FROM_BROWSER = {
    "Address": ({"query": str},),  # after going back or forward
    "Dropper": ({"begin": True}, {"name": str, "data": object}, {"end": True}),  # pieces of files
    "FrictionSlider": ({"typed": str},),
    "Handover": ({"key": str},),  # of the requested file
    "Known": ({"release": int}, {"next": True}, {"choose": int}),  # contacts; next measurement
    "Lesson": (  # data for a chapter, or for a contact in a network
        {"want": str, "name": str},
        {"want": str, "name": str, "network": [float, ...]},
    ),
    "LoadSlider": ({"push": True}, {"reached": True}),  # moved; to where disks move
    "Mine": ({"open": str}, {"call": [str, str]}, {"delete": str}),  # entries; and a name
    "NumberField": ({"typed": str},),  # not a number
    "Player": (
        {"tab": int},  # 1, 2, …
        {"wide": bool},
        {"keep": int},  # store all networks of the walk, then show that of this number
        {"hand": {"anew": True}},  # the page was redrawn and shows no pull yet
        {"hand": {"grab": int}},
        {"hand": {"hold": [int, float]}},  # a contact, and its f_n in ⟨f_n⟩
        {"hand": {"point": True}},  # a point in force space is grabbed
        {"hand": {"hold_point": [float, float]}},
        {"hand": {"undo": True}},
        {"hand": {"free": True}},
        {"known": {"hold": [int, float, float]}},  # a contact, its f_n, and ± its error bar
        {"known": {"release": int}},
        {"live": {"anew": True, "visible": bool}},
        {"live": {"visible": bool}},  # whether the page is visible
        {"live": {"painted": int}},  # number of the last message that was painted
    ),
    "Results": ({"measure": True},),  # measure the volume of S
    "Workbench": (
        {"scene": str},
        {"scene": str, "mu": float},
        {"query": str},  # after going back or forward
        {"built": str, "mu": float},  # by hand
        # "file", "fall", "limit" or "measured", for a scene with loads (3 N) on its disks
        {
            **{"find": str, "S": int, "scene": str, "built": str, "mu": float},
            **{"load": [float, ...], "plane": [int, int]},
        },
    ),
    "StatusLine": ({"stop": True}, {"cancel": True}, {"read": True}),  # a failure was read
}

MEASURED = {"plane": [int, int], "S": int}  # S: the number in the request
NETWORK = {"normal": Array, "tangential": Array, "residual": float}
NETWORKS = NETWORK | {"residual": Array}  # several, one after the other
# The networks through which f_n of a contact can be pulled, and what stops it at both ends.
RAIL = NETWORKS | {"contact": int, "lower": float, "upper": float, "values": Array}
RAIL |= {"opened": Array, "sliding": Array, "whole": bool}
# A packing under compression: its box, disks, and contacts with their branch vectors.
PICTURE = {"mu": float, "box": [float, ...], "tilt": float, "fraction": float, "unbalance": float}
PICTURE |= {"x": Array, "radius": Array, "i": Array, "j": Array, "reach": Array}
PICTURE |= {"normal": Array, "tangential": Array}
# States of a walk in progress, one after the other, each with the numbers shown next to it.
STATES = {"normal": Array, "tangential": Array, "number": Array, "residual": Array}
STATES |= {"eta1": Array, "eta2": Array, "eta3": Array}

# {component: messages sent to its script}; forces in ⟨f_n⟩, arrays flat.
TO_BROWSER = {
    "FrictionSlider": ({"settled": True},),  # the typed value is accepted or refused
    "Handover": (
        {"name": str, "mime": str, "content": object},  # a file
        {"name": str, "caption": dict},  # a picture or movie made by the browser
        {"name": str, "caption": dict, "width": int},  # with the plots, in mm
    ),
    "Lesson": (
        {"what": str, "name": str, "given": dict},  # the requested data
        {"what": str, "name": str, "error": str},
    ),
    "Player": (
        {"held": None},  # the states are on screen again
        {"held": NETWORK | {"pull": list}},
        {"rail": None},  # without a rail
        {"rail": None, "fan": None},
        {"rail": RAIL},
        {"fan": NETWORKS | {"x": Array, "y": Array}},
        {"picture": PICTURE, "number": int},
        {"states": STATES, "number": int},
        {"bounds": {"low": Array, "high": Array}, "number": int},
    ),
    "Workbench": (
        {"error": str},
        {"fall": [float, ...], "S": int},  # motion (3 N) of the disks; empty if nothing falls
        {"file": str},  # base64
        {"limit": float, "S": int},  # times the push that the disks can bear
        {"limit": None, "S": int},  # however hard it is
        {"measured": {"most": float, "outline": list}, **MEASURED},
        {"measured": {"bounds": list, "outline": list}, **MEASURED},
    ),
}


def listed(messages: Mapping[str, tuple[Message, ...]], component: str, message: Any) -> bool:
    """Whether FROM_BROWSER or TO_BROWSER contains a component's message, field by field."""
    return any(fits(message, shape) for shape in messages.get(component, ()))


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
