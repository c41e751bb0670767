"""What the outline of all stresses says, in words."""

import numpy as np

from ....results.planes import Outlined
from ....widgets.hints import term


def told(found: Outlined) -> str:
    """Of a planes.Outlined in the plane of stresses."""
    reach = np.hypot(*found.inner.T).max(initial=0.0)
    path = np.hypot(*found.plane.path.T)
    return (
        f"Shaded: every {term('stress', 'stress')} that these contacts can carry at this pressure, "
        f"exactly ({found.programs} linear programs, {found.seconds:.1f} s). The farther from "
        f"(0, 0), the more shear: at most <b>{reach:.3f}</b> of the pressure, certainly not above "
        f"{reach + found.gap:.3f}; the network as packed carries {path[0]:.3f}, the "
        f"{len(path) - 1} networks shown up to {path[1:].max():.3f}. The pressure alone is held."
    )
