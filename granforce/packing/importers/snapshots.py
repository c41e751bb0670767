"""Snapshots of a simulation: their numbers, and the packing of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, NamedTuple

from granforce.fields import record
from granforce.packing.importers.notes import noted
from granforce.records import InputError, Packing
from granforce.types import Floats


@record
class Snapshot(NamedTuple):
    """A packing, and the ids of its grains in the files; −1, −2, … for walls."""

    packing: Annotated[Packing, "with the simulation's own forces"]
    ids: Annotated[Floats, "(N,) of its grains"]


@record
class Snapshots(NamedTuple):
    """The complete snapshots in the files of a simulation."""

    word: Annotated[str, "kind of number: timestep, …"]
    numbers: Annotated[Sequence[int], "in the order of the files, at least one"]
    read: Annotated[Callable[[int], Snapshot], "the snapshot of a number"]
    lost: Annotated[str, "description of what was cut off after the last of them"] = ""

    @noted(lambda snapshot: snapshot.packing.info)
    def snapshot(self, number: int | None = None) -> Snapshot:
        """One Snapshot, by default the last; InputError for a number that is not in the files.

        Notes on its packing are InputWarnings.
        """
        return self.chosen(number)

    def chosen(self, number: int | None = None) -> Snapshot:
        """The same without warnings."""
        if number is None:
            last = self.numbers[-1]
            note = f"{self.lost}; {self.word} {last} is read" if self.lost else None
            found = self.read(last)
            return found if note is None else _noted(found, note)
        if number not in self.numbers:
            ends = sorted({self.numbers[0], self.numbers[-1]})
            available = f"there is {' … '.join(map(str, ends))}" + (self.lost and f"; {self.lost}")
            raise InputError(f"no {self.word} {number}: {available}")
        return self.read(self.numbers[self.numbers.index(number)])  # 100.0 is 100


def _noted(found: Snapshot, note: str) -> Snapshot:
    """The snapshot with one more note on its packing."""
    info = found.packing.info
    notes = [*info.get("notes", []), note]
    return found._replace(packing=found.packing._replace(info={**info, "notes": notes}))
