"""Snapshots of a simulation: their numbers, and the packing of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, NamedTuple

import numpy as np

from granforce.fields import record
from granforce.packing.importers.notes import noted, with_notes
from granforce.records import InputError, Packing, brief_list
from granforce.types import Floats


@record
class Snapshot(NamedTuple):
    """A packing, and the ids of its grains in the files; −1, −2, … for walls."""

    packing: Annotated[Packing, "with the simulation's own forces"]
    ids: Annotated[Floats, "(N,) of its grains"]


def with_walls(ids: Floats, walls: int) -> Floats:
    """Ids of grains, and −1, −2, … for walls."""
    return np.concatenate([ids, -1.0 - np.arange(walls)])


@record
class Snapshots(NamedTuple):
    """The complete snapshots in the files of a simulation."""

    word: Annotated[str, "kind of number: timestep, …"]
    numbers: Annotated[Sequence[int], "in the order of the files, at least one; without empty ones"]
    read: Annotated[Callable[[int], Snapshot], "the snapshot of a number"]
    lost: Annotated[str, "description of what was cut off after the last of them"] = ""
    empty: Annotated[Mapping[int, str], "numbers of empty ones, and what is missing there"] = {}

    @property
    def notes(self) -> list[str]:
        """Words on snapshots that are cut off or empty."""
        missing = sorted(set(self.empty.values()))
        named = {words: [k for k, why in self.empty.items() if why == words] for words in missing}
        return [self.lost] * bool(self.lost) + [
            f"{self.word}{'s' if len(some) > 1 else ''} {brief_list(some)} "
            f"{'have' if len(some) > 1 else 'has'} no {words}: left out"
            for words, some in named.items()
        ]

    def refusal(self, number: float) -> InputError:
        """The error of a number that is not among them."""
        ends = sorted({self.numbers[0], self.numbers[-1]})
        available = f"there is {' … '.join(map(str, ends))}" + (self.lost and f"; {self.lost}")
        if number in self.empty:
            missing = self.empty[int(number)]
            return InputError(f"{self.word} {number:g} has no {missing}: {available}")
        return InputError(f"no {self.word} {number:g}: {available}")

    @noted(lambda snapshot: snapshot.packing.info)
    def snapshot(self, number: int | None = None) -> Snapshot:
        """One Snapshot, by default the last; InputError for a number that is not in the files.

        Notes on its packing are InputWarnings.
        """
        return self.chosen(number)

    def chosen(self, number: int | None = None) -> Snapshot:
        """One Snapshot, as by `snapshot`, without warnings."""
        if number is None:
            last = self.numbers[-1]
            notes = [f"{note}; {self.word} {last} is read" for note in self.notes]
            snapshot = self.read(last)
            return snapshot._replace(packing=with_notes(snapshot.packing, notes))
        if number not in self.numbers:
            raise self.refusal(number)
        return self.read(self.numbers[self.numbers.index(number)])  # 100.0 is 100
