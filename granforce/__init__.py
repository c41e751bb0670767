"""granforce: how undetermined are the contact forces in a packing of rigid frictional disks?

A session: ``packing = gf.pack(400, mu=0.1, seed=1)``, ``S = gf.ensemble(packing)``, then
``gf.intervals(S)`` for exact bounds, or ``gf.walk(S, 1000, seed=0)`` and
``gf.sample_uniform(S, 1000)`` for states, measured by ``gf.measures`` and drawn by ``gf.figures``.
``granforce docs`` opens the reference of all names, with examples.
"""

import difflib
import importlib

from granforce.system.compiled import find_a_place as _find_a_place

__version__ = "0.3.0.dev0"

_find_a_place()

# Names are looked up on first use, so that `granforce --help` does not load numba and HiGHS. A
# function and the record it returns come from the same module.
_HOME = {
    "Cancelled": "records",
    "Cell": "cell",
    "Contacts": "records",
    "InputError": "records",
    "InputWarning": "records",
    "ResultWarning": "records",
    "NotJammedError": "records",
    "Packing": "records",
    "Relaxation": "records",
    "Shapes": "records",
    "UnboundedError": "records",
    "UndecidedError": "records",
    "make_contacts": "records",
    "make_contacts_at": "records",
    "make_packing": "records",
    "pack": "packing.compaction",
    "Glimpse": "packing.compaction",
    "margin": "packing.closing",
    "Margin": "packing.closing",
    "scene": "packing.scenes",
    "blocks": "packing.assemblies",
    "from_disks": "packing.importers",
    "ensemble": "forces.build",
    "Ensemble": "forces.ensemble",
    "Known": "forces.knowledge",
    "gauss_seidel": "motion.gauss_seidel",
    "nearest": "forces.nearest",
    "nearest_of_many": "forces.nearest",
    "nearest_piqp": "forces.nearest_piqp",
    "rest": "motion.rest",
    "Rest": "motion.rest",
    "walk": "explore.random_walk",
    "Walk": "explore.random_walk",
    "WalkState": "explore.random_walk",
    "sample_uniform": "explore.uniform",
    "UniformSample": "explore.uniform",
    "Mixing": "explore.mixing",
    "intervals": "explore.intervals",
    "Intervals": "explore.intervals",
    "Bound": "explore.intervals",
    "limit_loads": "explore.intervals",
    "limit_load_bounds": "explore.intervals",
    "LimitLoads": "explore.intervals",
    "outline": "explore.outline",
    "Outline": "explore.outline",
    "body": "explore.bodies",
    "Body": "explore.bodies",
    "Side": "explore.bodies",
    "fall": "explore.bodies",
    "infer": "experiment.infer",
    "Inference": "experiment.infer",
    "Draws": "experiment.infer",
    "informative": "experiment.informative",
    "Informative": "experiment.informative",
    "remeasured": "experiment.remeasured",
    "Remeasured": "experiment.remeasured",
    "volume": "explore.volume",
    "Volume": "explore.volume",
    "carrying": "experiment.carrying",
    "Carrying": "experiment.carrying",
    "pull": "explore.pull",
    "Pull": "explore.pull",
    "reach": "explore.pull",
    "Reach": "explore.pull",
    "admissible_stress": "explore.stress_outline",
    "stress_outline": "explore.stress_outline",
    "StressOutline": "explore.stress_outline",
    "stress_plane": "explore.stress_outline",
    "critical_force": "perturb.critical_force",
    "critical_forces": "perturb.critical_force",
    "CriticalForce": "perturb.critical_force",
    "Protocol": "perturb.critical_force",
    "response": "perturb.critical_force",
    "Response": "perturb.critical_force",
    "load_factor": "perturb.grain_loads",
    "LoadFactor": "perturb.grain_loads",
    "critical_load": "perturb.grain_loads",
    "CriticalLoad": "perturb.grain_loads",
    "loaded_networks": "perturb.loaded",
    "Loaded": "perturb.loaded",
    "load_packing": "packing.importers",
    "save_packing": "packing.importers",
    "save_lammps": "packing.exporters",
    "save_vtk": "packing.exporters",
    "read_blocks": "packing.importers",
    "read_known": "packing.importers",
    "read_lammps": "packing.importers",
    "open_lammps": "packing.importers",
    "open_mercury": "packing.importers",
    "Snapshot": "packing.importers",
    "Snapshots": "packing.importers",
    "read_measurement": "experiment.measurements",
    "Measurement": "experiment.measurements",
    "read_mercury": "packing.importers",
    "read_pegs": "experiment.pegs",
    "Photoelastic": "experiment.pegs",
    "read_table": "packing.importers",
    "read_yade": "packing.importers",
    "synthetic_frame": "experiment.synthetic",
    "SyntheticFrame": "experiment.synthetic",
    "report": "packing.importers",
    "scan": "study.scan",
    "evolution": "study.evolution",
    "frames_of": "experiment.frames",
    "Frame": "experiment.frames",
    "infer_series": "study.series",
    "plot": "figures.picture",
    "open_store": "study.store",
    "to_dataset": "labelled",
    "to_dataframe": "labelled",
    "Store": "study.store",
    "Entry": "study.store",
    "Verdict": "study.store",
    "figures": "",
    "measures": "",
}

__all__ = list(_HOME)


def __getattr__(name: str) -> object:
    if name not in _HOME:
        close = difflib.get_close_matches(name, _HOME, 1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        raise AttributeError(f"module 'granforce' has no attribute {name!r}{hint}")
    if not _HOME[name]:
        return importlib.import_module(f"granforce.{name}")
    return getattr(importlib.import_module(f"granforce.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return [*__all__, "__all__", "__doc__", "__file__", "__name__", "__path__", "__version__"]
