"""Packings from files: NPZ, LAMMPS, YADE, MercuryDPM, tables, and bodies of any shape.

These functions return a validated Packing or raise InputError.
"""

from granforce.packing.importers.blocks import read_blocks
from granforce.packing.importers.disks import from_disks
from granforce.packing.importers.known import read_known
from granforce.packing.importers.lammps import open_lammps, read_lammps
from granforce.packing.importers.mercury import open_mercury, read_mercury
from granforce.packing.importers.network import report
from granforce.packing.importers.npz import load_packing, save_packing
from granforce.packing.importers.snapshots import Snapshot, Snapshots
from granforce.packing.importers.tables import read_table
from granforce.packing.importers.text import read_columns
from granforce.packing.importers.yade import read_yade

__all__ = [
    "Snapshot",
    "Snapshots",
    "from_disks",
    "load_packing",
    "open_lammps",
    "open_mercury",
    "read_blocks",
    "read_columns",
    "read_known",
    "read_lammps",
    "read_mercury",
    "read_table",
    "read_yade",
    "report",
    "save_packing",
]
