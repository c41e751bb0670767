"""The place of a visitor among networks and contacts, to be found again in other states."""

from typing import NamedTuple

import numpy as np

from granforce.study.keys import Parameters

from ..results.replays import Replay

DISKS = ("n", "seed", "radii", "box")  # parameters of a compaction that give its disks


class Place(NamedTuple):
    """A network and a contact of the states on screen, and whether the player rests."""

    packing: Parameters
    replay: Replay
    number: int  # of the network in its walk
    paused: bool
    contact: int | None  # position in the backbone

    def contact_in(self, packing: Parameters, replay: Replay) -> int | None:
        """The position of the contact in other states; None if it does not exist there.

        In a packing of the same disks at another μ it is the one between the same two disks.
        """
        if self.contact is None:
            return None
        if packing == self.packing:
            found = np.flatnonzero(replay.backbone == self.replay.backbone[self.contact])
        elif "n" in packing and all(packing.get(k) == self.packing.get(k) for k in DISKS):
            here = np.sort([self.replay.i[self.contact], self.replay.j[self.contact]])
            pairs = np.sort([replay.i, replay.j], axis=0)
            found = np.flatnonzero((pairs == here[:, None]).all(axis=0))
        else:
            return None
        return int(found[0]) if len(found) else None
