"""Packings from files: our own NPZ, LAMMPS, YADE, MercuryDPM, tables, photoelastic experiments.

Whatever a file holds, these functions return a validated Packing or raise InputError.
"""

from granforce.packing.importers.dem import open_mercury, read_mercury, read_yade
from granforce.packing.importers.known import read_known
from granforce.packing.importers.lammps import open_lammps, read_lammps
from granforce.packing.importers.measurements import Measurement, read_measurement
from granforce.packing.importers.network import report
from granforce.packing.importers.npz import load_packing, save_packing
from granforce.packing.importers.pegs import Photoelastic, read_pegs
from granforce.packing.importers.snapshots import Snapshot, Snapshots
from granforce.packing.importers.synthetic import SyntheticFrame, synthetic_frame
from granforce.packing.importers.tables import read_table
from granforce.packing.importers.text import read_columns
from granforce.packing.importers.walls import read_wall_force

__all__ = [
    "Measurement",
    "Photoelastic",
    "Snapshot",
    "Snapshots",
    "SyntheticFrame",
    "load_packing",
    "open_lammps",
    "open_mercury",
    "read_columns",
    "read_known",
    "read_lammps",
    "read_measurement",
    "read_mercury",
    "read_pegs",
    "read_table",
    "read_wall_force",
    "read_yade",
    "report",
    "save_packing",
    "synthetic_frame",
]
