"""granforce: how undetermined are the contact forces in a packing of rigid frictional disks?"""

import importlib
from typing import Any

from granforce.system.compiled import find_a_place

find_a_place()

# Names are looked up on first use, so that `granforce --help` need not load numba and HiGHS.
_HOME = {
    "Cancelled": "records",
    "Contacts": "records",
    "InputError": "records",
    "NotJammedError": "records",
    "Packing": "records",
    "UndecidedError": "records",
    "make_contacts": "records",
    "make_packing": "records",
    "pack": "packing.compaction",
    "margin": "packing.closing",
    "scene": "packing.scenes",
    "Ensemble": "forces.ensemble",
    "Known": "forces.knowledge",
    "ensemble": "forces.ensemble",
    "gauss_seidel": "forces.gauss_seidel",
    "nearest": "forces.nearest",
    "nearest_of_many": "forces.nearest",
    "nearest_piqp": "forces.nearest_piqp",
    "walk": "explore.random_walk",
    "sample_uniform": "explore.uniform",
    "intervals": "explore.intervals",
    "limit_loads": "explore.intervals",
    "critical_force": "perturb.critical_force",
    "critical_forces": "perturb.critical_force",
    "response": "perturb.critical_force",
    "outline": "explore.outline",
    "body": "explore.bodies",
    "fall": "explore.bodies",
    "infer": "explore.infer",
    "informative": "explore.informative",
    "remeasured": "explore.remeasured",
    "volume": "explore.volume",
    "carrying": "explore.carrying",
    "pull": "explore.pull",
    "reach": "explore.pull",
    "stress_outline": "explore.stress_outline",
    "stress_plane": "explore.stress_outline",
    "load_packing": "packing.importers",
    "save_packing": "packing.importers",
    "read_known": "packing.importers",
    "read_lammps": "packing.importers",
    "read_mercury": "packing.importers",
    "read_pegs": "packing.importers",
    "read_table": "packing.importers",
    "read_yade": "packing.importers",
    "synthetic_frame": "packing.importers",
    "report": "packing.importers",
    "frames_of": "study.series",
    "infer_series": "study.series",
    "open_store": "study.store",
    "figures": "",
    "measures": "",
}

__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'granforce' has no attribute {name!r}")
    if not _HOME[name]:
        return importlib.import_module(f"granforce.{name}")
    return getattr(importlib.import_module(f"granforce.{_HOME[name]}"), name)
