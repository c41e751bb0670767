"""Data for the chapters of Learn: exact intervals of small scenes, and stored packings."""

from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from granforce.live import hulls
from granforce.live.pulls import Puller
from granforce.records import InputError, float_array
from granforce.study import kinds
from granforce.study.cells import entries
from granforce.types import Floats

from ...packing.legend import exact_intervals
from ...packing.player import frames
from ...results import planes
from ...results.library import Cell, Library, Shown, best_cell
from ...state.perturbations import path
from ...state.pulls import rail_of
from . import small_scenes

MU = 0.1  # of the packing that is pulled and pushed
NEAR = 0.5  # largest distance of a marked contact from the centre, in half view widths
STRONG = 1.5  # least force of the contact that is pulled, ⟨f_n⟩
FIRM = 0.5  # least critical force of the contact that is pushed, ⟨f_n⟩
MARKED = ("grabbed", "other")  # the contacts that are pulled, as in `Packings.packing`
STARTS = 4  # networks from which it is pushed: as packed, and others of the stored walk

SCENES = "ladder", "groove", "box", "thirteen"

BAND = np.linspace(0, 0.9999, 9)  # pushes at which S is measured, relative to the limit load


@lru_cache
def scene(name: str) -> dict[str, Any]:
    """A small scene as from `small_scenes.drawn`; cached."""
    return small_scenes.drawn(name)


class Packings:
    """Packings of the stores in the form for the lesson; results are cached for all visitors."""

    def __init__(self, library: Library) -> None:
        self.library = library
        cells = library.cells()
        first = best_cell(cells)
        series = "" if first is None else first.series
        self.cells: dict[float, Cell] = {}
        for cell in cells:
            if cell.series == series and cell.mu > 0:
                self.cells[cell.mu] = cell
        self.rail = lru_cache(len(MARKED))(self._rail)
        self.band = lru_cache(1)(self._band)
        self.push = lru_cache(STARTS)(self._push)
        self.shadow = lru_cache(1)(self._shadow)

    @property
    def frictions(self) -> list[float]:
        """Every μ above 0 with a packing, ascending."""
        return sorted(self.cells)

    def shown(self, mu: float) -> Shown:
        """The packing at a friction; InputError if there is none."""
        if mu not in self.cells:
            raise InputError("this chapter needs a packing that the store does not have")
        return self.library.shown(self.cells[mu])

    def packing(self, mu: float) -> dict[str, Any]:
        """Disks, networks and exact intervals at μ, with counts; forces in ⟨f_n⟩.

        grabbed: of the strong contacts near the centre, the least determined one; other: the least
        determined one near the centre that shares no disk with it.
        """
        replay, exact = self.shown(mu).replay, self.shown(mu).exact
        if exact is None:
            raise InputError("this chapter needs exact intervals that the store does not have")
        bounds, summary = exact_intervals(exact, replay), replay.summary
        grabbed, other = self._marked(mu)
        return {
            **frames(replay),
            "least": bounds["low"],
            "largest": bounds["high"],
            "grabbed": grabbed,
            "other": other,
            "spread": summary["eta1"],
            "disks": summary["n"] - summary["rattlers"],
            "all_disks": summary["n"],
        }

    def _marked(self, mu: float) -> tuple[int, int]:
        """The two contacts of MARKED."""
        replay = self.shown(mu).replay
        bounds = exact_intervals(self.shown(mu).exact, replay)
        disks, near = np.column_stack([replay.i, replay.j]), _away(replay) < NEAR

        def widest(fits: Any) -> int:
            return int(np.argmax(np.where(near & fits, bounds["high"] - bounds["low"], -1.0)))

        grabbed = widest(replay.normal[0] > STRONG)
        return grabbed, widest(~np.isin(disks, disks[grabbed]).any(axis=1))

    def _shadow(self) -> dict[str, Any]:
        """S on the forces of both marked contacts, and the share that walks fill."""
        replay, marked = self.shown(MU).replay, list(self._marked(MU))
        packing = self.library.packing(self.cells[MU].params["packing"])
        forces = [2 * int(replay.backbone[contact]) for contact in marked]
        outline = hulls.outline(packing, forces) / replay.force_scale
        walked = replay.normal[1:, marked]
        share = planes.area(walked) / planes.area(outline)
        return {"outline": outline.ravel(), "share": share}

    def _puller(self) -> Puller:
        cell = self.cells[MU]
        return Puller(self.library.packing(cell.params["packing"]), cell.mu)

    def _rail(self, marked: str) -> dict[str, Any]:
        """Networks from the least to the largest force of a contact of MARKED, as packed."""
        replay = self.shown(MU).replay
        as_packed = np.concatenate([replay.normal[0], replay.tangential[0]])
        contact = self._marked(MU)[MARKED.index(marked)]
        return self.rail_from(str(contact), as_packed)

    def rail_from(self, contact: str, network: npt.ArrayLike) -> dict[str, Any]:
        """Networks from the least to the largest force of a contact, near a given network.

        network: all normal and then all tangential forces, ⟨f_n⟩.
        """
        replay = self.shown(MU).replay
        count, scale = len(replay.backbone), replay.force_scale
        if not contact.isdecimal() or int(contact) >= count:
            raise InputError("this packing has no such contact")
        forces = float_array(network, (2 * count,), "forces").reshape(2, -1).T
        rail = self._puller().rail(int(replay.backbone[int(contact)]), forces * scale)
        return rail_of(rail, scale)

    def _push(self, start: int) -> dict[str, Any]:
        """Networks under a growing push on a contact, from one of STARTS, and the motion."""
        replay = self.shown(MU).replay
        contact, limit = self._weakened()
        scale, rows = replay.force_scale, np.linspace(0, len(replay.number) - 1, STARTS).astype(int)
        row = int(rows[start])
        state = np.stack([replay.normal[row], replay.tangential[row]], axis=1).astype(float) * scale
        pushed = self._puller().given_way(int(replay.backbone[contact]), state, limit)
        motion = pushed.motion
        return {
            "contact": contact,
            "starts": STARTS,
            "number": int(replay.number[row]),
            **path(pushed.under, scale),
            "limit": limit / scale,
            "band": np.ravel(self.band()) / scale,
            "opened": motion.opened.astype(np.uint8),
            "slid": motion.slid.astype(np.uint8),
            "displacement": np.nan_to_num(motion.displacement).ravel(),
        }

    def _band(self) -> Floats:
        """Least and largest f_n of the pushed contact under pushes up to its limit load.

        (k, 3): push, least, largest; in force.
        """
        position, limit = self._weakened()
        contact = int(self.shown(MU).replay.backbone[position])
        pushes = limit * BAND
        return np.column_stack([pushes, self._puller().band(contact, pushes)])

    def _weakened(self) -> tuple[int, float]:
        """The contact to push, and its limit load.

        Of the firm ones near the centre, it is the one that gives way farthest below its limit
        load, relative to it.
        """
        replay, pushed = self.shown(MU).replay, self._pushed()
        position = {int(number): k for k, number in enumerate(replay.backbone)}
        contacts = np.array([position[int(number)] for number in pushed["backbone"].values])
        carried, limit = pushed["critical_low"].values, pushed["limit_load"].values
        fits = (_away(replay)[contacts] < NEAR) & (carried > FIRM * replay.force_scale)
        row = int(np.argmax(np.where(fits, 1 - carried / limit, -1.0)))
        return int(contacts[row]), float(limit[row])

    def curve(self) -> dict[str, Any]:
        """Of the packing at each friction, the variation of forces and the free numbers."""
        summaries = [self.shown(mu).replay.summary for mu in self.frictions]
        return {
            "mu": self.frictions,
            "spread": [one["eta1"] for one in summaries],
            "free": [one["dimension"] for one in summaries],
        }

    def _pushed(self) -> xr.Dataset:
        """The stored pushed contacts of the packing."""
        selection = self.cells[MU].selection
        for store in self.library.stores:
            for entry in entries(store, kinds.PERTURBATION):
                same = entry.params["packing"] == selection.packing and entry.params["mu"] == MU
                found = store[entry.name] if same else None
                if found is not None:
                    return found
        raise InputError("this chapter needs pushed contacts that the store does not have")


def _away(replay: Any) -> Any:
    """Distance of each contact from the centre of the picture, in half view widths (N_c,)."""
    left, right, bottom, top = replay.window
    middles = replay.starts + replay.reach / 2
    return np.abs(2 * middles - [left + right, bottom + top]).max(axis=1) / (right - left)
