"""Data for the chapters of Learn: exact intervals of small scenes, and stored packings."""

from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from granforce.records import InputError, float_array
from granforce.study import kinds
from granforce.study.cells import entries
from granforce.study.pulls import Puller

from ...packing.player import frames
from ...packing.view import exact_intervals
from ...results import study_data
from ...results.library import Cell, Library, Shown, best_cell
from ...state.perturbations import path
from ...state.pulls import rail_of
from . import small_scenes

MU = 0.1  # of the packing that is pulled and pushed
NEAR = 0.5  # largest distance of a marked contact from the centre, in half view widths
STRONG = 1.5  # least force of the contact that is pulled, ⟨f_n⟩


@lru_cache
def scene(name: str) -> dict[str, Any]:
    """A small scene as from `small_scenes.drawn`; cached."""
    return small_scenes.drawn(name)


@lru_cache
def ends(name: str, plane: tuple[int, int]) -> dict[str, Any]:
    """Exact interval of every normal force in a small scene, and the outline of S on two forces."""
    return small_scenes.measured(small_scenes.packing_of(name), plane=plane)


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
        self.rail = lru_cache(1)(self._rail)
        self.push = lru_cache(1)(self._push)

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
        """Disks, networks and exact intervals at μ, with counts; forces in ⟨f_n⟩."""
        replay, exact = self.shown(mu).replay, self.shown(mu).exact
        if exact is None:
            raise InputError("this chapter needs exact intervals that the store does not have")
        bounds, summary = exact_intervals(exact, replay), replay.summary
        return {
            **frames(replay),
            "least": bounds["low"],
            "largest": bounds["high"],
            "typical": replay.typical,
            "grabbed": self._grabbed(mu),
            "spread": summary["eta1"],
            "disks": summary["n"] - summary["rattlers"],
            "all_disks": summary["n"],
        }

    def _grabbed(self, mu: float) -> int:
        """The contact to pull: of the strong ones near the centre, the least determined one."""
        replay = self.shown(mu).replay
        bounds = exact_intervals(self.shown(mu).exact, replay)
        fits = (_away(replay) < NEAR) & (replay.normal[0] > STRONG)
        return int(np.argmax(np.where(fits, bounds["high"] - bounds["low"], -1.0)))

    def _puller(self) -> Puller:
        cell = self.cells[MU]
        return Puller(self.library.packing(cell.params["packing"]), cell.mu)

    def _rail(self) -> dict[str, Any]:
        """Networks from the least to the largest force of the marked contact, as packed."""
        replay = self.shown(MU).replay
        as_packed = np.concatenate([replay.normal[0], replay.tangential[0]])
        return self.rail_from(str(self._grabbed(MU)), as_packed)

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

    def _push(self) -> dict[str, Any]:
        """Networks under a push on the most resistant contact near the centre, and the motion."""
        replay = self.shown(MU).replay
        found = self._pushed()
        position = {int(number): k for k, number in enumerate(replay.backbone)}
        contacts = np.array([position[int(number)] for number in found["backbone"].values])
        scale, carried = replay.force_scale, found["critical_low"].values
        row = int(np.argmax(np.where(_away(replay)[contacts] < NEAR, carried, -1.0)))
        low = carried[row]
        under = self._puller().loaded(int(replay.backbone[contacts[row]]), low)
        return {
            "contact": int(contacts[row]),
            **path(under, scale),
            "limit": float(found["limit_load"].values[row] / scale),
            "opened": int(found["opened"].values[row]),
            "slid": int(found["slid"].values[row]),
            "displacement": np.nan_to_num(found["displacement"].values[row]).ravel(),
        }

    def curve(self) -> dict[str, Any]:
        """Variation of forces against friction, and the friction of the nearest packing.

        The variation is the mean over the packings of the study or, without a study, that of each
        packing.
        """
        own = self.frictions
        points = [
            (mu, spread)
            for mu, spread in study_data.against_friction("eta1")
            if own and own[0] <= mu <= own[-1]
        ] or [(mu, self.shown(mu).replay.summary["eta1"]) for mu in own]
        packed = [min(own, key=lambda one: abs(np.log(one / mu))) for mu, _ in points]
        return {"mu": [mu for mu, _ in points], "spread": [s for _, s in points], "packed": packed}

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
    links, (left, right, bottom, top) = replay.links, replay.window
    away = np.maximum(
        np.abs(links.x0 + links.x1 - left - right), np.abs(links.y0 + links.y1 - bottom - top)
    )
    nearest = np.full(len(replay.backbone), np.inf)
    np.minimum.at(nearest, links.contact, away / (right - left))
    return nearest
