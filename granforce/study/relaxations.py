"""The relaxations of a walk, and their names in keys of results."""

from collections.abc import Mapping
from typing import Any

# Names of the functions, and in keys, which have not changed since the solvers were renamed.
STORED = {
    "nearest": "accelerated",
    "nearest_piqp": "nearest",
    "gauss_seidel": "gauss_seidel",
    "gauss_seidel_only": "gauss_seidel_only",
}
_NAMES = {stored: name for name, stored in STORED.items()}


def as_stored(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters as they enter a key."""
    return _renamed(parameters, STORED)


def from_stored(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters of a key, with the names of functions."""
    return _renamed(parameters, _NAMES)


def _renamed(parameters: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    relax = parameters.get("relax", "")
    return {**parameters, "relax": names[relax]} if relax in names else dict(parameters)
