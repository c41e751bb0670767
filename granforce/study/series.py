"""Many frames of one experiment: each imported and inferred separately, all in one dataset.

A frame is a cell of a study: it is computed in any process, in any order, and stored as it ends.
Its key contains a digest of its files, so that a changed file is read again.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import warnings
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import xarray as xr

from granforce.experiment.frames import Frame
from granforce.experiment.infer import infer
from granforce.experiment.pegs import Photoelastic, open_frames, read_pegs
from granforce.experiment.regions import regional_stress
from granforce.experiment.remeasured import remeasured
from granforce.experiment.repair import KINDS
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.quantities import FORCE
from granforce.records import (
    InputError,
    InputWarning,
    brief,
    friction,
    positive,
    random_seed,
    whole,
)
from granforce.study import entries
from granforce.study.cells import Kind, StudyCell, get
from granforce.study.keys import Parameters
from granforce.study.scan import run
from granforce.study.schema import attributes, labelled, packing_dataset, to_builtin
from granforce.study.store import Store, is_store, open_store
from granforce.system import cancelling
from granforce.system.files import expanded, sibling
from granforce.types import Floats, Integers, Progress

# Draws for the error bars of a frame, and the assumed error of unmeasured forces, ⟨f_n⟩.
STATES, UNMEASURED = 200, 1.0
# Counts in a frame's report that are stored by frame.
_COUNTS = (*KINDS, "grains", "contacts_listed", "candidates", "candidates_that_carry", "unbalanced")


def parameters(
    frame: Frame,
    *,
    mu: Any,
    states: int = STATES,
    seed: int = 0,
    unmeasured: float = UNMEASURED,
    **options: Any,
) -> Parameters:
    """The parameters of the inference of a Frame; options as for `read_pegs`."""
    forces = options.pop("wall_forces", None) or {}
    return {
        "positions": frame.positions,
        "adjacency": frame.adjacency,
        "content": _digest(frame.positions, frame.adjacency),
        "frame": frame.number,
        "mu": friction(mu),
        "states": whole(states, "states", 2) if states else 0,
        "seed": random_seed(seed),
        "unmeasured": positive(unmeasured, "unmeasured"),
        "wall_forces": {name: list(map(float, values)) for name, values in forces.items()},
        "options": options,
    }


def _digest(*paths: str | Path | None) -> str:
    total = hashlib.blake2b(digest_size=16)
    for path in (one for one in paths if one):
        try:
            total.update(Path(path).read_bytes())
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    return total.hexdigest()


def _inferred(
    store: Store, parameters: Parameters, *, workers: int, progress: Progress | None
) -> xr.Dataset:
    """Dataset of one frame: its packing, measured and inferred forces with errors, its report."""
    chosen = {name: parameters[name] for name in ("mu", "wall_forces")} | parameters["options"]
    columns = chosen.pop("columns", None)
    frames = open_frames(parameters["positions"], parameters["adjacency"], columns=columns)
    number = parameters["frame"] if len(frames.frames) > 1 else None
    with warnings.catch_warnings(action="ignore", category=InputWarning):  # the dataset has them
        photoelastic = read_pegs(frames, frame=number, **chosen)
    return infer_frame(
        photoelastic,
        states=parameters["states"],
        seed=parameters["seed"],
        unmeasured=parameters["unmeasured"],
        workers=workers,
        progress=progress,
        number=parameters["frame"],
    )


def infer_frame(
    photoelastic: Photoelastic,
    *,
    states: int = STATES,
    unmeasured: float = UNMEASURED,
    number: float | None = None,
    **options: Any,
) -> xr.Dataset:
    """Dataset of a Photoelastic: its packing, forces, errors, stresses by region, and report.

    Forces are those of `remeasured`, on all contacts (0 for contacts that cannot carry force), with
    its options. Without states there are no errors.
    """
    S = ensemble(photoelastic.packing)
    drawn = (remeasured if states else infer)(
        *(S, photoelastic.measured[S.index], photoelastic.sigma[S.index]),
        pressures=photoelastic.pressures,
        states=states,
        unmeasured=unmeasured,
        **options,
    )
    stress_of = partial(
        regional_stress,
        S.contacts,
        photoelastic.packing.x,
        len(photoelastic.packing.r) - len(photoelastic.walls),
    )
    stress, errors = stress_of(drawn.forces), {}
    if states:
        off = stress_of(drawn.drawn.flat) - stress
        errors["standard_error"] = _on_all(photoelastic, S, drawn.error, 0.0)
        errors["regional_stress_error"] = np.sqrt(np.mean(off**2, axis=0))
    dataset = packing_dataset(photoelastic.packing).merge(
        labelled(
            {
                "grain_id": photoelastic.ids,
                "added": photoelastic.added,
                "measured": photoelastic.measured,
                "sigma": photoelastic.sigma,
                "inferred": _on_all(photoelastic, S, drawn.forces, 0.0),
                "deviation": _on_all(photoelastic, S, drawn.deviation, np.nan),
                "suspect": drawn.suspects,
                "pressure_deviation": drawn.pressure_deviation,
                "chi_square": drawn.chi_square,
                "freedom": drawn.freedom,
                "regional_stress": stress,
                **errors,
            }
        )
    )
    findings = [one._asdict() for one in photoelastic.findings]
    report = photoelastic.report if number is None else photoelastic.report | {"frame": number}
    attrs: dict[str, Any] = {"report": report, "findings": findings}
    attrs |= {"walls": list(photoelastic.walls), "left_open": photoelastic.left_open.tolist()}
    attrs |= {"at_wall": np.flatnonzero(photoelastic.at_wall).tolist()}
    dataset.attrs["account"] = json.dumps(attrs, default=to_builtin)
    return dataset


def _on_all(photoelastic: Photoelastic, S: Ensemble, values: Floats, elsewhere: float) -> Floats:
    """Values (N_c of S, 2) on all contacts of the frame, with `elsewhere` on the others."""
    whole_packing = np.full(photoelastic.measured.shape, elsewhere)
    whole_packing[S.index] = values
    return whole_packing


FRAME = Kind(
    name="frame", version=3, title="frames", unit="frame", parameters=parameters, compute=_inferred
)


@cancelling.shown
def infer_series(
    path: str | Path,
    frames: Sequence[Frame],
    *,
    mu: Any,
    workers: int = 2,
    scheduler: str | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Any:
    """All frames inferred into the store at path, or loaded from it.

    Parameters
    ----------
    path : path
        Folder of the store.
    frames : sequence of Frame
        From `frames_of`.
    mu : float
        Friction coefficient.
    workers : int, default 2
        Processes.
    scheduler : str, optional
        Address of a dask scheduler to use instead.
    progress : callable, optional
        progress(done, total) counts frames.
    **options
        states (draws for each frame, at least 2, or 0 for no error bars), seed and unmeasured as
        for `infer`, others as for `read_pegs`.

    Returns
    -------
    dataset : xr.Dataset
        A row for each frame.
    failed : list of tuple
        (frame, message) of frames that failed, which are not in the dataset.

    Raises
    ------
    InputError
        If the store cannot be written, and for frames of another kind.
    """
    for frame in frames:
        if not isinstance(frame, Frame):
            raise InputError(f"frames must be those of `frames_of`, got {brief(frame)}")
    cells = [StudyCell(FRAME, parameters(frame, mu=mu, **options)) for frame in frames]
    failed = run(path, cells, workers=workers, scheduler=scheduler, progress=progress)
    lost = {id(cell): message for cell, message in failed}
    store = open_store(path)
    done = [
        (frame.number, get(store, *cell, workers=workers)[0])  # others may have removed the cell
        for frame, cell in zip(frames, cells, strict=True)
        if id(cell) not in lost
    ]
    refused = [
        (frame, lost[id(cell)])
        for frame, cell in zip(frames, cells, strict=True)
        if id(cell) in lost
    ]
    return (combined(done) if done else None), refused


def combined(done: Sequence[tuple[float, xr.Dataset]]) -> xr.Dataset:
    """One dataset (frame, contact, component) of [(number, dataset of a frame), …].

    A contact is a pair of ids, over all frames; NaN in frames without it. change: its inferred
    force minus that in the frame before, and change_error, from both errors. Without draws there
    are no errors. The attribute notes contains notes on frames.
    """
    named = [
        pair_names(one["grain_id"].values, one["contact_i"].values, one["contact_j"].values)
        for _, one in done
    ]
    pairs, places = over_frames(named)
    shape = (len(done), len(pairs), 2)
    quantities = ["measured", "sigma", "inferred"]
    quantities += ["standard_error"] if all("standard_error" in one for _, one in done) else []
    arrays = {name: np.full(shape, np.nan) for name in quantities}
    added = np.zeros(shape[:2], dtype=bool)
    for k, ((_, one), (source, into)) in enumerate(zip(done, places, strict=True)):
        for name, values in arrays.items():
            values[k, into] = one[name].values[source]
        added[k, into] = one["added"].values[source]
    change = np.full(shape, np.nan)
    change[1:] = np.diff(arrays["inferred"], axis=0)
    accounts = [json.loads(one.attrs["account"])["report"] for _, one in done]
    counted = [[one[kind] for kind in _COUNTS] for one in accounts]
    notes = [
        f"frame {number:g}: {note}"
        for (number, _), one in zip(done, accounts, strict=True)
        for note in one.get("notes", [])
    ]
    forces, single = ("frame", "contact", "component"), ("frame",)
    unit = {"units": FORCE, "long_name": "mean measured normal force"}
    counts = {"units": "1", "long_name": "grains, contacts and repairs, by kind"}
    variables: dict[str, Any] = {
        name: (forces, values, attributes(name)) for name, values in arrays.items()
    }
    variables |= {
        "added": (forces[:2], added, attributes("added")),
        "change": (forces, change, {"units": FORCE, "long_name": "since the frame before"}),
        **{
            name: (single, [one[name].item() for _, one in done], attributes(name))
            for name in ("chi_square", "freedom")
        },
        "unit": (single, [one["mean_measured_normal_force"] for one in accounts], unit),
        "account": (("frame", "kind"), counted, counts),
    }
    if "standard_error" in arrays:
        change_error, error = np.full(shape, np.nan), arrays["standard_error"]
        change_error[1:] = np.hypot(error[1:], error[:-1])
        variables["change_error"] = forces, change_error, {"units": FORCE}
    return xr.Dataset(
        variables,
        {
            "frame": [number for number, _ in done],
            "component": ["f_n", "f_t"],
            "kind": list(_COUNTS),
            **ends_of(pairs),
        },
        {"notes": notes},
    )


# Ids of the two grains of a contact; below 0: a wall.
Pair: TypeAlias = tuple[float, float]


def pair_names(ids: Floats, i: Integers, j: Integers) -> list[Pair | None]:
    """Ids of a frame's contacts: pairs, or None for a second contact of one pair."""
    pairs: set[Pair] = set()
    names: list[Pair | None] = []
    for a, b in zip(ids[i].tolist(), ids[j].tolist(), strict=True):
        # Grains before walls, whose ids are below 0.
        pair = (a, b) if b < 0 or (a >= 0 and a <= b) else (b, a)
        names.append(None if pair in pairs else pair)
        pairs.add(pair)
    return names


def over_frames(
    named: Sequence[Sequence[Pair | None]],
) -> tuple[list[Pair], list[tuple[list[int], list[int]]]]:
    """All pairs of all frames, sorted, and for each frame its contacts and their places."""
    pairs = sorted({pair for names in named for pair in names if pair is not None})
    row = {pair: k for k, pair in enumerate(pairs)}
    places = [
        (
            [c for c, pair in enumerate(names) if pair is not None],
            [row[pair] for pair in names if pair is not None],
        )
        for names in named
    ]
    return pairs, places


def ends_of(pairs: Sequence[Pair]) -> dict[str, Any]:
    """The coordinates id1, id2 of pairs."""
    ends = np.array(pairs, dtype=float).reshape(-1, 2)
    return {
        "id1": ("contact", ends[:, 0], {"long_name": "name of the first grain"}),
        "id2": ("contact", ends[:, 1], {"long_name": "of the second; below 0: a wall"}),
    }


def check_folder(path: str | Path) -> Path:
    """The path, if a Zarr folder can be created there; InputError otherwise."""
    path = expanded(path)
    if path.is_symlink() and not path.exists():
        raise InputError(f"{path}: is a broken link; choose another")
    if path.exists() and not (path / "zarr.json").is_file():
        raise InputError(f"{path}: already exists and is not a Zarr folder; choose another")
    if is_store(path):
        raise InputError(
            f"{path}: is a store of results, which would be overwritten; choose another"
        )
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist")
    return path


def save_series(dataset: xr.Dataset, path: str | Path) -> None:
    """Write a dataset as a Zarr folder, completely or not at all, replacing an existing one."""
    path = check_folder(path)
    aside = sibling(path)
    try:
        entries.move(entries.encoded(dataset), aside)
        if path.exists():
            shutil.rmtree(path)
        aside.rename(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        shutil.rmtree(aside, ignore_errors=True)
