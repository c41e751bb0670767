"""granforce: how undetermined are the contact forces in a packing of rigid frictional disks?"""

import importlib

# Names are looked up on first use, so that `granforce --help` need not load numba and HiGHS.
_HOME = {
    "Cancelled": "records",
    "Contacts": "records",
    "InputError": "records",
    "NotJammedError": "records",
    "Packing": "records",
    "make_contacts": "records",
    "make_packing": "records",
    "pack": "compaction",
    "Ensemble": "polytope",
    "ensemble": "polytope",
    "gauss_seidel": "relax.gauss_seidel",
    "nearest": "relax.nearest",
    "accelerated": "relax.accelerated",
    "walk": "random_walk",
    "sample_uniform": "uniform",
    "intervals": "bounds",
    "limit_loads": "bounds",
    "critical_force": "perturb",
    "response": "perturb",
    "outline": "projection",
    "load_packing": "importers",
    "save_packing": "importers",
    "read_lammps": "importers",
    "read_table": "importers",
    "report": "importers",
    "open_store": "store",
    "measures": "",
}

__all__ = list(_HOME)


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module 'granforce' has no attribute {name!r}")
    if not _HOME[name]:
        return importlib.import_module(f"granforce.{name}")
    return getattr(importlib.import_module(f"granforce.{_HOME[name]}"), name)
