"""What the app's small test store holds, and where the app is."""

from pathlib import Path

from granforce.study import kinds

ROOT = Path(__file__).resolve().parents[2]
DISKS, STATES, KEPT = 30, 30, 12


def cell_parameters(mu, **options):
    """Walk parameters of the small store's cells."""
    packing = kinds.PACKING.parameters(DISKS, mu, 1)
    return kinds.WALK.parameters(packing, STATES, 0, relax="nearest_piqp", keep=KEPT, **options)
