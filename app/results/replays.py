"""Replays: states to show, as plain arrays, from a store or from a walk that has just begun."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from granforce import measures
from granforce.records import Packing
from granforce.types import Floats, Integers, Mask

from . import geometry

FRAME_BYTES = 8e6  # of the frames sent to a page


class Replay(NamedTuple):
    """States to show: geometry, frames and numbers. Forces are in ⟨f_n⟩."""

    centres: Floats  # (bodies, 2) in the cell, length
    radius: Floats  # (N,) 0 of what is behind walls
    i: Integers  # (N_c,) grains of the contacts
    j: Integers
    starts: Floats  # (N_c, 2) geometry.lines
    reach: Floats
    box: Floats  # (2,) sides; inf in open directions
    tilt: float  # of the cell
    window: tuple[float, float, float, float]  # x_low, x_high, y_low, y_high of the view, a square
    unit: float  # geometry.unit, the scale of chains and marks, length
    outlines: list[list[float]]  # geometry.outlines
    walls: Floats  # (k, 4) geometry.walls
    inviting: int | None  # contact suggested for dragging
    backbone: Integers  # (N_c,) positions of the contacts in the packing
    contact_normals: Floats  # (N_c, 2) n, from grain i to j
    contact_points: Floats  # (N_c, 2) at their image in the cell, length
    at_walls: Mask  # (N_c,) contacts with walls or fixed bodies
    friction: Floats  # (N_c,) friction coefficients
    force_scale: float  # ⟨f_n⟩, force
    given: bool  # whether the original network came with the packing; otherwise it was computed
    normal: Any  # (F, N_c) float32 f_n: the original network, then the stored states
    tangential: Any  # (F, N_c) float32 f_t
    number: Any  # (F,) number of the state, 0 for the original
    residual: Floats  # (F,) NaN for the original
    growth: Mapping[str, Floats]  # {"eta1", "eta2", "eta3": (F,)} of the states up to each
    low: Any  # (N_c, 2) float32 smallest f_n, f_t of all states, shown or not
    high: Any  # (N_c, 2) float32 largest
    order: Integers  # (N_c,) contacts by original f_n, ascending
    sampling: measures.Sampling  # of the states shown
    summary: dict[str, Any]  # plain numbers of the states, by schema name

    @property
    def pressed(self) -> bool:
        """Whether the pressure is prescribed, see Ensemble.has_pressure_row."""
        return bool(np.isfinite(self.box).any() and not self.at_walls.any())


def worded(replay: Replay, text: str) -> str:
    """A text about disks as packed, for what the replay shows: also bodies, and other origins."""
    if not replay.given:
        text = text.replace("as packed", "at the start").replace("since packed", "since the start")
    return text.replace("disk", "body").replace("bodys", "bodies") if replay.outlines else text


def make_replay(
    packing: Packing, dataset: xr.Dataset, mu: float, most_bytes: float = FRAME_BYTES
) -> Replay:
    """The Replay of a dataset of states on its packing; μ is that of the ensemble.

    most_bytes: of the frames; if there are more, states are left out evenly.
    """
    backbone = dataset["backbone"].values
    scale = float(dataset["force_scale"])
    summary: dict[str, Any] = {
        str(name): array.item() for name, array in dataset.items() if array.ndim == 0
    }
    stored = dataset.sizes["state"]
    walked = int(summary["accepted"] + summary["skipped"]) if "accepted" in summary else stored
    pick = evenly(stored, len(backbone), most_bytes)
    frames: Any = np.concatenate([dataset["original"].values[None], dataset["states"].values[pick]])
    frames = (frames / scale).astype(np.float32)
    number = np.linspace(0, walked - 1, stored).astype(int)[pick] + 1
    summary |= {"mu": mu, "n": geometry.bodies(packing), "contacts": len(backbone)}
    summary |= {"kept": len(pick), "states": walked}

    growing = measures.growing(frames[1:]).items()
    return _replay(
        packing,
        backbone,
        scale,
        frames,
        number=np.append(0, number),
        residual=np.append(np.nan, dataset["residual"].values[pick]),
        growth={name: np.append(np.nan, values) for name, values in growing},
        low=(dataset["low"].values / scale).astype(np.float32),
        high=(dataset["high"].values / scale).astype(np.float32),
        sampling=measures.sampling(frames[1:]),
        summary=summary,
    )


def first_replay(S: Any, states: int) -> Replay:
    """The Replay of an ensemble before its walk: only the original network; `states` will follow.

    S is any object with packing, index, original, force_scale and mu.
    """
    original = (S.original / S.force_scale).astype(np.float32)
    nothing = np.full(1, np.nan)
    return _replay(
        S.packing,
        S.index,
        S.force_scale,
        original[None],
        number=np.zeros(1),
        residual=nothing,
        growth=dict.fromkeys(("eta1", "eta2", "eta3"), nothing),
        low=original,
        high=original,
        sampling=measures.sampling(original[None]),
        summary={
            "mu": S.mu,
            "n": geometry.bodies(S.packing),
            "contacts": len(S.index),
            "states": states,
            "packing_fraction": S.packing.packing_fraction,
            "coordination": S.coordination,
            "dimension": S.dimension,
        },
    )


def _replay(
    packing: Packing, backbone: Integers, scale: float, frames: Any, **numbers: Any
) -> Replay:
    """The Replay of frames (F, N_c, 2), float32, the original network first."""
    x = packing.cell.wrapped(packing.x)
    count, contacts = geometry.bodies(packing), packing.contacts.picked(backbone)
    starts, reach = geometry.lines(packing, x, backbone)
    window = geometry.square(x, packing)
    return Replay(
        centres=x[:count],
        radius=np.append(packing.r[:count], np.zeros(len(packing.r) - count)),
        i=contacts.i,
        j=contacts.j,
        starts=starts,
        reach=reach,
        box=packing.box,
        tilt=packing.tilt,
        window=window,
        unit=geometry.unit(packing),
        outlines=geometry.outlines(packing),
        walls=geometry.walls(packing, backbone),
        inviting=geometry.inviting(starts + reach / 2, frames[0, :, 0], window),
        backbone=backbone,
        contact_normals=contacts.normal,
        contact_points=packing.contact_points[backbone],
        at_walls=packing.touch_walls[backbone],
        friction=contacts.friction(numbers["summary"]["mu"]),
        force_scale=scale,
        given=packing.info.get("forces") != "found",
        normal=np.ascontiguousarray(frames[..., 0]),
        tangential=np.ascontiguousarray(frames[..., 1]),
        order=np.argsort(frames[0, :, 0], kind="stable"),
        **numbers,
    )


def flat(states: Any) -> dict[str, Any]:
    """Networks (…, N_c, 2) for scripts: flat arrays, one network after the other."""
    return {
        name: states[..., part].astype(np.float32).ravel()
        for part, name in enumerate(("normal", "tangential"))
    }


def fitting(contacts: int, most_bytes: float) -> int:
    """Number of states of this many contacts that fit in most_bytes, at least two."""
    return max(2, int(most_bytes / (8 * max(1, contacts))))


def evenly(count: int, contacts: int, most_bytes: float) -> Integers:
    """Evenly spaced indices of `count` states that fit in most_bytes; all, if they do."""
    most = fitting(contacts, most_bytes)
    if count <= most:
        return np.arange(count)
    return np.linspace(0, count - 1, most).astype(int)
