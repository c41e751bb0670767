"""The plane of stresses among the planes of force space, for whoever draws it."""

from granforce.explore import stress_outline
from granforce.forces.build import ensemble
from granforce.records import Packing
from granforce.types import Floats


def stress_axes(packing: Packing, mu: float) -> Floats:
    """Axes (2, N_c, 2) of ((σ_xx − σ_yy)/2P, σ_xy/P) for the forces of a packing's S in ⟨f_n⟩.

    Raises what `stress_outline` raises.
    """
    return stress_outline.stress_axes(ensemble(packing, mu))
