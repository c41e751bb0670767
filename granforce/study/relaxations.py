"""The names of the relaxations of a walk: as typed, and in keys of results."""

# As typed, with the names of functions, and in keys of results.
RELAXATIONS = {
    "nearest": "accelerated",
    "nearest_piqp": "nearest",
    "gauss_seidel": "gauss_seidel",
    "gauss_seidel_only": "gauss_seidel_only",
}


def typed_relaxation(stored: str) -> str:
    """The name under which a relaxation is typed; `stored`: its name in keys of results."""
    return next(typed for typed, name in RELAXATIONS.items() if name == stored)
