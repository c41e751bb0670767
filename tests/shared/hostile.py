"""Hostile values for the arguments of public functions: what the fuzz of the API is made of."""

import contextlib
import io
import warnings

import numpy as np
from packings import packed

import granforce as gf

# What no argument was made for; each function has to take it or to say in one line what is wrong.
VALUES = {
    "none": None,
    "minus one": -1,
    "zero": 0,
    "half": 1.5,
    "nan": np.nan,
    "inf": np.inf,
    "minus inf": -np.inf,
    "huge": 1e300,
    "large": 1e155,
    "tiny": 1e-300,
    "more than memory": 10**15,
    "beyond integers": 10**30,
    "minus beyond": -(10**30),
    "letter": "a",
    "digits": "3",
    "empty word": "",
    "empty list": [],
    "list": [0],
    "nested": [[0]],
    "ragged": [[0, 1], [2]],
    "flag": True,
    "flags": [True, False],
    "complex": 1 + 1j,
    "date": np.datetime64("2009-05-01"),
    "duration": np.timedelta64(3, "s"),
    "object": object(),
    "mapping": {},
    "nans": np.full((3, 2), np.nan),
    "many": np.zeros((2, 3, 4, 5)),
}


def spoiled(array):
    """Arrays like this one, each wrong in one way."""
    array = np.asarray(array, dtype=float)
    masked = np.ma.masked_array(array, mask=np.zeros(array.shape, dtype=bool))
    if masked.size:
        masked.mask.flat[0] = True
    holed = array.copy()
    holed.flat[:1] = np.nan
    return {
        "masked": masked,
        "imaginary": array + 1j,
        "dates": array.astype("datetime64[s]"),
        "text": array.astype(str),
        "longer": np.concatenate([array, array]),
        "shorter": array[:-1],
        "flat": array.ravel()[:, None],
        "holed": holed,
        "times 1e155": array * 1e155,
        "times 1e300": array * 1e300,
        "times 1e-300": array * 1e-300,
        "negative": -array,
        "transposed": array.T,
    }


def functions():
    """{name: (function, {argument: right value})}; every argument is spoiled in turn."""
    packing = packed(8, 0.3)
    S = gf.ensemble(packing)
    c, count = int(S.index[0]), len(S.index)
    walk = gf.walk(S, 3, 0)
    sample = gf.sample_uniform(S, 8, 2, 0)
    critical = gf.critical_force(S, c)
    axes = np.zeros((2, count, 2))
    axes[0, 0, 0] = axes[1, 1, 0] = 1.0
    contacts = packing.contacts
    forces = S.original
    ensembled = {"ensemble": S}
    pair, third = [[0, 0.5, 0.5], [1.0, 0.5, 0.5]], [[0, 1], [1, 1], [1, 2], [0, 2]]
    ground = [[-2, -1], [3, -1], [3, 0], [-2, 0]]
    return {
        "blocks of parts": (lambda **given: gf.blocks([pair, third, ground], **given), {
            "mu": 0.5, "fixed": [2], "weights": [2.0, 1.0, 1.0], "tolerance": 1e-6}),
        "parts": (lambda disk, corners: gf.blocks([[disk, corners], ground], 0.5, fixed=[1]), {
            "disk": pair[0], "corners": [[1, 0], [2, 0], [2, 1], [1, 1]]}),
        "from_disks on a floor": (gf.from_disks, {
            "x": [[0, 1], [2, 1]], "r": [1.0, 1.0], "mu": 0.5, "walls": "floor", "gravity": 1.0,
            "clumps": [0, 0], "tolerance": 1e-6}),
        "pack on a floor": (gf.pack, {"n": 5, "mu": 0.3, "seed": 1, "radii": "uniform:0.5,1",
                                      "box": "floor"}),
        "grain_pressures": (gf.grain_pressures, ensembled | {"forces": forces}),
        "pressures": (lambda **given: gf.infer(S, pressures=gf.GrainPressures(*given.values())), {
            "grains": [0, 1], "values": [1.0, 0.9], "errors": [0.1, 0.2]}),
        "informative_grains": (lambda states, k, by: gf.informative_grains(S, states, by, k), {
            "states": walk.states, "k": 2, "by": 0.1}),
        "pack": (gf.pack, {"n": 8, "mu": 0.3, "seed": 1, "radii": "uniform:0.5,1", "pressure": 1.0,
                           "dt": 0.05, "box_mass": 100.0, "sweeps": 100, "accuracy": 0.01,
                           "drag_below": 0.02, "box": "square", "max_steps": 3000}),
        "scene": (gf.scene, {"name": "groove", "mu": 0.5}),
        "make_packing": (gf.make_packing, {
            "x": packing.x, "r": packing.r, "box": packing.box, "contacts": contacts,
            "forces": packing.forces, "mu": 0.3, "pressure": 1.0, "load": packing.load,
            "tilt": 0.0}),
        "make_contacts": (gf.make_contacts, {
            "i": contacts.i, "j": contacts.j, "normal": contacts.normal,
            "length": contacts.length, "r": packing.r}),
        "ensemble": (gf.ensemble, {"packing": packing, "mu": 0.3, "prescribed": "stress",
                                   "stress": [1.0, 1.0, 0.0]}),
        "ensemble frozen": (gf.ensemble, {"packing": packing, "frozen": [c]}),
        "walk": (gf.walk, ensembled | {"states": 3, "seed": 0, "chains": 1, "workers": 1,
                                       "relax": gf.nearest, "max_attempts": 60}),
        "walk that goes on": (gf.walk, ensembled | {"states": 4, "seed": 0, "begun": walk}),
        "sample_uniform": (gf.sample_uniform, ensembled | {
            "states": 8, "chains": 2, "seed": 0, "workers": 1, "effective": 5.0,
            "method": "billiard"}),
        "volume": (gf.volume, ensembled | {"accuracy": 1.0, "seed": 0, "workers": 1}),
        "intervals": (gf.intervals, ensembled | {
            "contacts": [c], "workers": 1, "states": walk.states, "widths": np.ones(count)}),
        "limit_loads": (gf.limit_loads, ensembled | {"contacts": [c], "workers": 1}),
        "limit_load_bounds": (gf.limit_load_bounds, ensembled | {"contacts": [c], "workers": 1}),
        "outline": (gf.outline, ensembled | {"axes": axes, "tolerance": 0.01, "workers": 1}),
        "stress_outline": (gf.stress_outline, ensembled | {"angles": 4, "workers": 1}),
        "admissible_stress": (gf.admissible_stress, ensembled | {"workers": 1}),
        "stress_plane": (gf.stress_plane, ensembled | {"states": walk.states}),
        "pull": (gf.pull, ensembled | {"contact": c, "values": forces[:1, 0], "state": forces,
                                       "workers": 1}),
        "reach": (gf.reach, ensembled | {"contact": c, "workers": 1}),
        "loaded_networks": (gf.loaded_networks, ensembled | {
            "contact": c, "loads": [0.01], "state": forces}),
        "critical_force": (gf.critical_force, {
            "packing": S, "contact": c, "limit_load": critical.limit_load, "precision": 0.1,
            "rise": 0.4, "max_steps": 20}),
        "critical_forces": (gf.critical_forces, ensembled | {
            "contacts": [c], "limit_loads": [critical.limit_load], "workers": 1}),
        "response": (gf.response, {"packing": S, "contact": c, "force": 2 * critical.limit_load,
                                   "critical": critical, "precision": 0.1}),
        "nearest": (gf.nearest, ensembled | {"start": forces, "tolerance": 1e-10,
                                             "max_iterations": 100}),
        "nearest_of_many": (gf.nearest_of_many, ensembled | {"starts": walk.states[:2]}),
        "nearest_piqp": (gf.nearest_piqp, ensembled | {"start": forces, "tolerance": 1e-10,
                                                       "max_iterations": 100}),
        "gauss_seidel": (gf.gauss_seidel, ensembled | {
            "start": forces, "order": "sequential", "seed": 0, "tolerance": 1e-6, "rest": 1e-3,
            "max_iterations": 2000}),
        "informative": (gf.informative, ensembled | {
            "k": 2, "states": 20, "seed": 0, "check": 1, "sample": sample, "workers": 1}),
        "carrying contacts": (gf.carrying, ensembled | {
            "measured": forces, "sigma": 0.1, "contacts": [c], "within": 3.0}),
        "infer seed": (gf.infer, ensembled | {
            "measured": forces, "sigma": 0.1, "states": 8, "seed": 0, "chains": 2}),
        "remeasured seed": (gf.remeasured, ensembled | {
            "measured": forces, "sigma": 0.1, "states": 8, "seed": 0, "chains": 2}),
        "residual": (S.residual, {"forces": forces}),
        "violation": (S.violation, {"forces": forces}),
        "admits": (S.admits, {"forces": forces}),
        "expand": (S.expand, {"forces": forces}),
        "to_vector": (S.to_vector, {"forces": forces}),
        "positions": (S.positions, {"contacts": [c]}),
        "eta1": (gf.measures.eta1, {"states": walk.states}),
        "eta2": (gf.measures.eta2, {"states": walk.states}),
        "sampled_intervals": (gf.measures.sampled_intervals, {"states": walk.states}),
    }  # fmt: skip


# Arguments that are records: what stands in their place is a type error of Python.
RECORDS = {"ensemble", "packing", "contacts of make_packing", "critical", "begun", "sample"}
# Those whose own tests spoil them.
ELSEWHERE = {"measured", "sigma"}


def calls(table):
    """(words, function, arguments) of every call with one hostile argument."""
    for name, (function, right) in table.items():
        for argument, value in right.items():
            if {argument, f"{argument} of {name}"} & (RECORDS | ELSEWHERE):
                continue
            hostile = dict(VALUES)
            if isinstance(value, (np.ndarray, list)):
                hostile |= spoiled(value)
            for word, wrong in hostile.items():
                yield f"{name}({argument}={word})", function, right | {argument: wrong}


def fault(function, arguments):
    """What is wrong with how a call ended; None for a result, and for an InputError of one line."""
    with warnings.catch_warnings(record=True) as told, contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("always")
        warnings.simplefilter("ignore", gf.ResultWarning)  # a few states of a sample cannot mix
        warnings.simplefilter("ignore", gf.InputWarning)  # of what can be used
        try:
            function(**arguments)
        except gf.InputError as error:
            if "\n" in str(error) or not str(error):
                return f"says {error}"
        except Exception as error:
            return f"{type(error).__name__}: {error}"[:200]
    return f"warns: {told[0].message}"[:200] if told else None
