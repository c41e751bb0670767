"""Packings from files: granforce's own NPZ, LAMMPS dumps, and tables; what is wrong is said once.

Whatever a file holds, these functions return a validated Packing or raise InputError.
"""

from granforce.importers.lammps import read_lammps
from granforce.importers.network import report
from granforce.importers.npz import load_packing, save_packing
from granforce.importers.tables import read_table

__all__ = ["load_packing", "read_lammps", "read_table", "report", "save_packing"]
