"""The kinds of stored results, one record each, with parameters and computation.

To add a kind, add a record to the file of its family, and its name here; stores, scans, the command
line and the app take it from `KINDS`.
"""

from granforce.study.kinds.bounds import INTERVALS, LIMIT_LOADS, OUTLINE, STRESS
from granforce.study.kinds.packings import (
    PACKING,
    get_packing,
    imported_parameters,
    keep_packing,
    parameters_of,
    remember,
)
from granforce.study.kinds.perturbations import PERTURBATION, PERTURBED_CONTACT
from granforce.study.kinds.states import INFERENCE, INFORMATIVE, UNIFORM, VOLUME, WALK

__all__ = [
    "INFERENCE",
    "INFORMATIVE",
    "INTERVALS",
    "KINDS",
    "LIMIT_LOADS",
    "OUTLINE",
    "PACKING",
    "PERTURBATION",
    "PERTURBED_CONTACT",
    "STRESS",
    "UNIFORM",
    "VOLUME",
    "WALK",
    "get_packing",
    "imported_parameters",
    "keep_packing",
    "parameters_of",
    "remember",
]

KINDS = {
    kind.name: kind
    for kind in (
        *(PACKING, WALK, UNIFORM, INFERENCE, INTERVALS, LIMIT_LOADS, OUTLINE, STRESS),
        *(PERTURBATION, PERTURBED_CONTACT, INFORMATIVE, VOLUME),
    )
}
