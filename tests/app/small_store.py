"""What the app's small test store holds, and where the app is."""

from pathlib import Path

from granforce import study

ROOT = Path(__file__).resolve().parents[2]
DISKS, STATES, KEPT = 30, 30, 12


def cell_parameters(mu, **options):
    """Walk parameters of the small store's cells."""
    packing = study.packing_parameters(DISKS, mu, 1)
    return study.walk_parameters(packing, STATES, 0, relax="nearest", keep=KEPT, **options)
