"""What crosses the wire beside parameters: what scripts tell the server, and what they are told.

A message is a dict of fields. A field is a number (`int`, `float`), words (`str`), `bool`, `True`
for what says nothing but its name, a list ([int, float] of two, [float, ...] of any length), a dict
of fields, an `Array` or, where the one who takes it looks for himself, any `object`.
"""

from collections.abc import Mapping
from numbers import Integral, Real
from typing import Any

import numpy as np

Array = np.ndarray
Message = dict[str, Any]

# {component: messages that its script sends}; contacts are positions in the backbone.
FROM_BROWSER = {
    "Address": ({"query": str},),  # gone back or forward to
    "Dropper": ({"begin": True}, {"name": str, "data": object}, {"end": True}),  # pieces of files
    "FrictionSlider": ({"typed": str},),
    "Handover": ({"key": str},),  # of a file that is asked for
    "Known": ({"release": int}, {"next": True}, {"choose": int}),  # contacts; what to measure next
    "Lesson": ({"want": str, "name": str},),  # what a chapter shows
    "LoadSlider": ({"push": True}, {"gave": True}),  # was moved; has come to where disks move
    "Mine": ({"open": str}, {"call": [str, str]}, {"delete": str}),  # entries; and a name
    "NumberField": ({"typed": str},),  # and is no number
    "Player": (
        {"tab": int},  # 1, 2, …
        {"wide": bool},
        {"keep": True},  # all networks of the walk are to be stored
        {"hand": {"anew": True}},  # the page is drawn anew, and shows no pull yet
        {"hand": {"grab": int}},
        {"hand": {"hold": [int, float]}},  # a contact, and its f_n in ⟨f_n⟩
        {"hand": {"point": True}},  # in force space is grabbed
        {"hand": {"hold_point": [float, float]}},
        {"hand": {"undo": True}},
        {"hand": {"free": True}},
        {"known": {"hold": [int, float, float]}},  # a contact, its f_n, and ± its error bar
        {"known": {"release": int}},
        {"live": {"anew": True, "seen": bool}},
        {"live": {"seen": bool}},  # whether the page is looked at
        {"live": {"painted": int}},  # the number of the last message that was drawn
    ),
    "Progress": ({"stop": True}, {"cancel": True}),
    "Results": ({"measure": True},),  # the volume of S
    "Workbench": (
        {"scene": str},
        {"scene": str, "mu": float},
        {"query": str},  # gone back or forward to
        {"built": str, "mu": float},  # by hand
        # "file", "fall" or "measured", of a scene under loads (3 N) on its disks
        {
            **{"find": str, "scene": str, "built": str, "mu": float},
            **{"load": [float, ...], "plane": [int, int]},
        },
    ),
    "StatusLine": ({"stop": True}, {"cancel": True}, {"read": True}),  # what failed was read
}

MEASURED = {"scene": str, "mu": float, "plane": [int, int]}  # of a small scene
NETWORK = {"normal": Array, "tangential": Array, "residual": float}
NETWORKS = NETWORK | {"residual": Array}  # several, one after the other
# The networks through which f_n of a contact can be pulled, and what stops it at both ends.
RAIL = NETWORKS | {"contact": int, "lower": float, "upper": float, "values": Array}
RAIL |= {"opened": Array, "sliding": Array, "whole": bool}
# A packing under compression: its box, disks, and contacts with their branch vectors.
PICTURE = {"mu": float, "box": [float, ...], "tilt": float, "fraction": float, "unbalance": float}
PICTURE |= {"x": Array, "radius": Array, "i": Array, "j": Array, "reach": Array}
PICTURE |= {"normal": Array, "tangential": Array}
# States of a walk under way, one after the other, and of each the numbers told beside it.
STATES = {"normal": Array, "tangential": Array, "number": Array, "residual": Array}
STATES |= {"acceptance": Array, "eta1": Array, "eta2": Array, "eta3": Array}

# {component: messages that its script is sent}; forces in ⟨f_n⟩, arrays flat.
TO_BROWSER = {
    "FrictionSlider": ({"settled": True},),  # what was typed is taken, or refused
    "Handover": (
        {"name": str, "mime": str, "content": object},  # a file
        {"name": str, "caption": dict},  # a picture or movie that the browser makes
        {"name": str, "caption": dict, "width": int},  # with the plots, in mm
        {"rest": True},  # nothing comes
    ),
    "Lesson": (
        {"what": str, "name": str, "given": dict},  # what was asked for
        {"what": str, "name": str, "error": str},
    ),
    "Player": (
        {"held": None},  # the states are on screen again
        {"held": NETWORK | {"pull": list}},
        {"rail": None},  # there is none
        {"rail": None, "fan": None},
        {"rail": RAIL},
        {"fan": NETWORKS | {"x": Array, "y": Array}},
        {"picture": PICTURE, "number": int},
        {"states": STATES, "number": int},
        {"bounds": {"low": Array, "high": Array}, "number": int},
    ),
    "Workbench": (
        {"error": str},
        {"fall": [float, ...]},  # motion (3 N) of the disks; empty where nothing falls
        {"file": str},  # base64
        {"measured": {"most": float, "outline": list}, **MEASURED},
        {"measured": {"bounds": list, "outline": list}, **MEASURED},
    ),
}


def listed(messages: Mapping[str, tuple[Message, ...]], component: str, message: Any) -> bool:
    """Whether FROM_BROWSER or TO_BROWSER has a component's message, field by field."""
    return any(fits(message, shape) for shape in messages.get(component, ()))


def fits(value: Any, shape: Any) -> bool:
    """Whether a value is of the shape of a message or field."""
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
        # Larger whole numbers than a browser has are no floats either.
        kind: Any = Integral if shape is int else Real
        whole = isinstance(value, int) and abs(value) > 2**53
        return isinstance(value, kind) and not isinstance(value, bool) and not whole
    return isinstance(value, shape)
