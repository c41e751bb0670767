"""What is on screen as files made in memory: table, dataset, packing, parameters."""

import io
import json
import zipfile
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import xarray as xr

from granforce.packing import importers
from granforce.records import Packing
from granforce.study.entries import encoded
from granforce.study.keys import canonical
from granforce.study.schema import packing_dataset

from ....results.library import Cell
from ....results.replays import Replay, worded
from ....results.saved_file import Columns
from ....results.selection import command
from ....state.known import Knowledge
from ....state.perturbations import Pushed
from ....state.pulls import Held

# The contact dimension of a packing's own arrays; that of the states contains only the backbone.
PACKING_CONTACTS = "packing_contact"


def contacts(
    replay: Replay,
    exact: xr.Dataset | None,
    frame: int,
    held: Held | None = None,
    knowledge: Knowledge | None = None,
) -> Columns:
    """One row per contact of the backbone, forces in ⟨f_n⟩ as on screen: {name: array}.

    On screen is the state of this frame, or the network after pulls, with the bounds given the
    known forces.
    """
    normal, tangential = replay.normal[frame], replay.tangential[frame]
    if held is not None:
        normal, tangential = held.forces.T
    columns = {"contact": replay.backbone, "i": replay.i, "j": replay.j}
    columns["x"], columns["y"] = replay.contact_points.T
    columns["n_x"], columns["n_y"] = replay.contact_normals.T
    columns["wall"] = replay.at_walls.astype(int)
    known = [] if knowledge is None else [one.contact for one in knowledge.known]
    if known:
        columns["known"] = np.isin(np.arange(len(replay.backbone)), known).astype(int)
    columns |= {
        "f_n_original": replay.normal[0],
        "f_t_original": replay.tangential[0],
        "f_n": normal,
        "f_t": tangential,
    }
    for k, part in enumerate(("f_n", "f_t")):
        columns[f"{part}_seen_low"] = replay.low[:, k]
        columns[f"{part}_seen_high"] = replay.high[:, k]
    narrowed = None if knowledge is None or not known else knowledge.whole
    if narrowed is not None:
        columns |= _bounds(narrowed.after, replay) | _bounds(narrowed.before, replay, FREE)
    elif exact is not None:
        columns |= _bounds(exact, replay, FREE if known else "")
    return {f"{name} [mean]" if name.startswith("f_") else name: columns[name] for name in columns}


FREE = "_without_known"  # suffix of the names of bounds without known forces


def _bounds(exact: xr.Dataset, replay: Replay, ending: str = "") -> Columns:
    """Exact bounds in ⟨f_n⟩, 0 within their gap; none if they belong to other contacts."""
    if not np.array_equal(exact["backbone"].values, replay.backbone):
        return {}
    bounds = {}
    for k, part in enumerate(("f_n", "f_t")):
        for end, side in enumerate(("low", "high")):
            value = exact[side].values[:, k] / replay.force_scale
            zero = np.abs(value) <= exact["interval_gap"].values[:, k, end]
            bounds[f"{part}_{side}{ending}"] = np.where(zero, 0.0, value)
        bounds[f"{part}_gap{ending}"] = exact["interval_gap"].values[:, k].max(axis=-1)
    return bounds


# The meaning of the columns in the table of contacts.
COLUMNS = {
    "contact": "number of the contact in the packing",
    "i": "number of the first disk; the normal n points from i to j",
    "j": "number of the second disk",
    "x": "place of the contact, in the unit of length of the packing",
    "y": "place of the contact, in the unit of length of the packing",
    "n_x": "component of the normal n",
    "n_y": "component of the normal n",
    "wall": "1 where i or j is a wall or a fixed body, else 0",
    "known": "1 where the normal force is held, else 0",
    "f_n_original": "normal force as packed",
    "f_t_original": "tangential force as packed, along t = (-n_y, n_x)",
    "f_n": "normal force in the network on screen",
    "f_t": "tangential force in the network on screen",
    "f_n_seen_low": "smallest normal force in all networks",
    "f_n_seen_high": "largest normal force in all networks",
    "f_t_seen_low": "smallest tangential force in all networks",
    "f_t_seen_high": "largest tangential force in all networks",
    "f_n_low": "least possible normal force (exact; 0 within its duality gap)",
    "f_n_high": "largest possible normal force (exact; 0 within its duality gap)",
    "f_t_low": "least possible tangential force (exact; 0 within its duality gap)",
    "f_t_high": "largest possible tangential force (exact; 0 within its duality gap)",
    "f_n_gap": "most that f_n_low and f_n_high can be off, as their certificates show",
    "f_t_gap": "most that f_t_low and f_t_high can be off, as their certificates show",
}


ETA3 = (
    "eta3: the mean length of the intervals of f_n and f_t, divided by the mean of their "
    "midpoints, which are signed for f_t."
)


def _meaning(column: str) -> str:
    name = column.removesuffix(" [mean]")
    free = ", ignoring held forces" if name.endswith(FREE) else ""
    return f"{COLUMNS[name.removesuffix(FREE)]}{free}"


def bounds_of(knowledge: Knowledge, obeying: bool) -> str:
    """The networks to which a table's bounds refer, in words; empty without held forces.

    obeying: whether the networks seen have the held forces.
    """
    if not knowledge.known:
        return ""
    if knowledge.whole is None:
        return f"Bounds given the held forces are still being computed; {FREE[1:]}: without it."
    seen = "networks with these forces" if obeying else "all of S"
    return (
        f"Bounds are exact given these held forces; {FREE[1:]}: without them. Values seen are "
        f"those of {seen}."
    )


def explained(columns: Iterable[str], replay: Replay, *titles: str) -> str:
    """Lines, each after a #, that explain a table and its units."""
    unit = (
        "Forces are in the mean normal force, as on screen: the mean weighted by the distance "
        "between centres if the pressure is prescribed, otherwise the plain mean of the original "
        f"network; {replay.force_scale:.9g} in the packing's own unit (pressure times length)."
    )
    meanings = (f"{name}: {worded(replay, _meaning(name))}" for name in columns)
    lines = [*filter(None, titles), unit, ETA3, *meanings]
    return "".join(f"# {line}\n" for line in lines)


def motion(packing: Packing, pushed: Pushed, contact: int) -> tuple[Columns, str]:
    """Columns with the first motion of each grain under a push on a contact, and their head."""
    columns = {"grain": np.arange(len(packing.r)), "r": packing.r}
    columns |= dict(zip(("x", "y"), packing.x.T, strict=True))
    columns |= dict(zip(("u_x", "u_y"), pushed.displacement.T, strict=True))
    lines = (
        f"first motion when the disks of contact {contact} are pushed apart, in any unit: its root "
        "mean square over the disks of the backbone is 1; others have 0",
        f"F_crit between {pushed.low:.9g} and {pushed.high:.9g}, limit load {pushed.limit:.9g}, in "
        "mean normal forces",
        f"contacts that open: {pushed.opened}, slide: {pushed.slid}, stick: {pushed.kept}",
    )
    return columns, "".join(f"# {line}\n" for line in lines)


def dataset(packing: Packing, states: xr.Dataset, exact: xr.Dataset | None = None) -> xr.Dataset:
    """Packing, states and, if known, exact intervals (exact_low, exact_high) in one dataset."""
    geometry = packing_dataset(packing)
    geometry = geometry.rename({"contact": PACKING_CONTACTS})
    parts = [states.copy(), geometry.drop_attrs(deep=False)]
    if exact is not None and np.array_equal(exact["backbone"].values, states["backbone"].values):
        names = {"low": "exact_low", "high": "exact_high", "eta3": "exact_eta3"}
        parts.append(exact[list(names)].rename(names))
    whole = xr.merge(parts, combine_attrs="override", join="exact", compat="no_conflicts")
    return whole.assign_attrs(states.attrs)


def netcdf(whole: xr.Dataset) -> bytes:
    """A dataset as NetCDF 3."""
    return bytes(whole.to_netcdf(engine="scipy"))


def zarr_zip(whole: xr.Dataset) -> bytes:
    """A dataset as a zipped Zarr group, which zarr.storage.ZipStore opens."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name, content in sorted(encoded(whole).items()):
            archive.writestr(name, content.to_bytes())
    return file.getvalue()


def npz(packing: Packing) -> bytes:
    """A packing as NPZ, for `granforce` and load_packing."""
    file = io.BytesIO()
    importers.save_packing(packing, file)
    return file.getvalue()


def parameters(cell: Cell, link: str, view: Mapping[str, Any]) -> bytes:
    """The parameters of what is on screen, as JSON: parameters, link, command, view."""
    values = {
        "kind": cell.kind,
        "entry": cell.name,
        "parameters": json.loads(canonical(cell.params)),
        "link": f"?{link}",
        "command": command(cell.selection),
        "view": view,
    }
    return json.dumps(values, indent=1, ensure_ascii=False).encode()
