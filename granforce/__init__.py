"""granforce: how undetermined are the contact forces in a packing of rigid frictional disks?

A session: ``packing = gf.pack(400, mu=0.1, seed=1)``, ``S = gf.ensemble(packing)``, then
``gf.intervals(S)`` for exact bounds, or ``gf.walk(S, 1000, seed=0)`` and
``gf.sample_uniform(S, 1000)`` for states, measured by ``gf.measures`` and drawn by ``gf.figures``.
``granforce docs`` opens the reference of all names, with examples.
"""

import difflib
import importlib

from granforce.system.compiled import find_a_place as _find_a_place

__version__ = "0.3.0"

_find_a_place()

# Names and their modules in the order of the reference, imported on first use so that `granforce
# --help` does not load numba and HiGHS. A function and the record it returns share a module.
_BY_QUESTION = {
    "Make or read a packing": {
        "pack": "packing.compaction",
        "scene": "packing.scenes",
        "from_disks": "packing.importers",
        "blocks": "packing.assemblies",
        "read_table": "packing.importers",
        "read_blocks": "packing.importers",
        "read_lammps": "packing.importers",
        "read_yade": "packing.importers",
        "read_mercury": "packing.importers",
        "open_lammps": "packing.importers",
        "open_mercury": "packing.importers",
        "Snapshots": "packing.importers",
        "Snapshot": "packing.importers",
        "Glimpse": "packing.compaction",
        "report": "packing.importers",
        "margin": "packing.closing",
        "Margin": "packing.closing",
        "make_packing": "records",
        "make_contacts": "records",
        "make_contacts_at": "records",
    },
    "What forces are possible": {
        "ensemble": "forces.build",
        "Ensemble": "forces.ensemble",
        "intervals": "explore.intervals",
        "Intervals": "explore.intervals",
        "Bound": "explore.intervals",
        "nearest": "forces.nearest",
        "nearest_of_many": "forces.nearest",
        "nearest_piqp": "forces.nearest_piqp",
        "gauss_seidel": "motion.gauss_seidel",
        "Relaxation": "records",
        "body": "explore.bodies",
        "Body": "explore.bodies",
        "Side": "explore.bodies",
        "outline": "explore.outline",
        "Outline": "explore.outline",
        "stress_outline": "explore.stress_outline",
        "StressOutline": "explore.stress_outline",
        "stress_plane": "explore.stress_outline",
        "admissible_stress": "explore.stress_outline",
        "fall": "explore.bodies",
    },
    "Explore them": {
        "walk": "explore.random_walk",
        "Walk": "explore.random_walk",
        "WalkState": "explore.random_walk",
        "sample_uniform": "explore.uniform",
        "UniformSample": "explore.uniform",
        "Mixing": "explore.mixing",
        "volume": "explore.volume",
        "Volume": "explore.volume",
        "pull": "explore.pull",
        "Pull": "explore.pull",
        "reach": "explore.pull",
        "Reach": "explore.pull",
        "scan": "study.scan",
        "evolution": "study.evolution",
    },
    "Measures of states": {"measures": ""},
    "What is known and measured": {
        "Known": "forces.knowledge",
        "read_known": "packing.importers",
        "grain_pressures": "forces.grain_pressures",
        "GrainPressures": "forces.grain_pressures",
        "infer": "experiment.infer",
        "Inference": "experiment.infer",
        "Draws": "experiment.infer",
        "remeasured": "experiment.remeasured",
        "Remeasured": "experiment.remeasured",
        "informative": "experiment.informative",
        "Informative": "experiment.informative",
        "informative_grains": "experiment.informative",
        "InformativeGrains": "experiment.informative",
        "carrying": "experiment.carrying",
        "Carrying": "experiment.carrying",
        "read_measurement": "experiment.measurements",
        "Measurement": "experiment.measurements",
        "read_pressures": "experiment.measurements",
        "read_pegs": "experiment.pegs",
        "Photoelastic": "experiment.pegs",
        "frames_of": "experiment.frames",
        "Frame": "experiment.frames",
        "infer_series": "study.series",
        "synthetic_frame": "experiment.synthetic",
        "SyntheticFrame": "experiment.synthetic",
    },
    "How it resists: rest, loads, pushes": {
        "rest": "motion.rest",
        "Rest": "motion.rest",
        "limit_loads": "explore.intervals",
        "limit_load_bounds": "explore.intervals",
        "LimitLoads": "explore.intervals",
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
    },
    "Save, read, draw": {
        "show": "cli.viewer",
        "View": "cli.viewer",
        "plot": "figures.picture",
        "to_dataset": "labelled",
        "to_dataframe": "labelled",
        "to_arviz": "labelled",
        "save_packing": "packing.importers",
        "load_packing": "packing.importers",
        "save_lammps": "packing.exporters",
        "save_vtk": "packing.exporters",
        "cached": "study.kinds.cached",
        "open_store": "study.store",
        "Store": "study.store",
        "Entry": "study.store",
        "Verdict": "study.store",
    },
    "Figures": {"figures": ""},
    "Records and errors": {
        "Packing": "records",
        "Contacts": "records",
        "Shapes": "records",
        "Cell": "cell",
        "InputError": "records",
        "NotJammedError": "records",
        "UnboundedError": "records",
        "UndecidedError": "records",
        "InputWarning": "records",
        "ResultWarning": "records",
        "Cancelled": "records",
    },
}
_HOME = {name: home for names in _BY_QUESTION.values() for name, home in names.items()}

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
