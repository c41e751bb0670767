"""Forces that a visitor declares known, exactly or within error bars, and their consequences."""

import math
import shlex
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
import param
import xarray as xr

from granforce.records import InputError
from granforce.study import kinds
from granforce.system.wording import integer, number
from granforce.tolerances import CARRYING
from granforce.types import Floats, Integers

from ..background.jobs import Job, Task
from ..background.notifications import as_one
from ..results import compute
from ..results.library import Cell, Library, Shown
from ..results.replays import Replay
from ..results.selection import KNOWN_FILE, Bound, Selection, known_file, of_packing
from ..results.selection import rows as rows_of

MOST_KNOWN = 32  # statements per page or link
LARGEST = 1e6  # ⟨fₙ⟩
# A force whose interval is shorter than this, in ⟨fₙ⟩, is determined already.
DETERMINED = 1e-6
# Distance of held forces from the ends of their interval, as a fraction: at the ends rounding
# decides.
INWARD = 1e-4
# Length of the list of contacts to measure next; of many contacts, how many are checked by exact
# bounds.
LISTED, CHECKED, FEW = 10, 3, 200


class Statement(NamedTuple):
    """The statement that f_n of a contact is `value` ± `error`; both in ⟨f_n⟩."""

    contact: int  # position in the backbone
    value: float
    error: float = 0.0

    @property
    def force(self) -> str:
        """The force and its error bar, in ⟨f_n⟩."""
        return f"{self.value:.3f} ± {self.error:.3g}" if self.error else f"{self.value:.3f}"

    def words(self, number: int) -> str:
        """The statement in words, with the contact's number in the packing."""
        return f"contact {number}: fₙ = {self.force} × the mean force"


class Narrowed(NamedTuple):
    """Exact intervals of all contacts with the known forces, and without."""

    known: tuple[Statement, ...]
    before: xr.Dataset  # intervals dataset
    after: xr.Dataset
    left: float = 0.0  # fraction of the bounds in `after` that are not yet updated

    @property
    def dimension(self) -> tuple[int, int]:
        """h before and after."""
        return int(self.before["dimension"]), int(self.after["dimension"])

    @property
    def mean(self) -> tuple[float, float]:
        """Mean interval of f_n before and after, in ⟨f_n⟩."""
        before, after = self.extents
        return float(before.mean()), float(after.mean())

    @property
    def extents(self) -> tuple[Floats, Floats]:
        """Length of the intervals of f_n (N_c,), before and after, in ⟨f_n⟩."""
        return _extent(self.before), _extent(self.after)

    @property
    def reduction(self) -> Floats:
        """(N_c,) reduction of the intervals of f_n, in ⟨f_n⟩."""
        before, after = self.extents
        return np.maximum(before - after, 0.0)

    @property
    def shortened(self) -> Floats:
        """The same for contacts that are not known themselves; 0 for known ones."""
        change = self.reduction
        change[[one.contact for one in self.known]] = 0.0
        return change

    @property
    def carrying(self) -> int:
        """Number of contacts that carry force in every remaining network, by certified bounds."""
        low, gap = (self.after[name].values for name in ("low", "interval_gap"))
        least = low[:, 0] / self.after["force_scale"].item() - gap[:, 0, 0]
        return int(np.sum(least > CARRYING))


def _normal(dataset: xr.Dataset, name: str) -> Floats:
    return dataset[name].values[:, 0] / dataset["force_scale"].item()


def _extent(dataset: xr.Dataset) -> Floats:
    return _normal(dataset, "high") - _normal(dataset, "low")


class Underway:
    """Intervals with known forces during their computation, available as a Narrowed at any time."""

    def __init__(
        self, known: tuple[Statement, ...], before: xr.Dataset, backbone: Integers
    ) -> None:
        self.known, self._before, self._backbone = known, before, backbone
        self._after, self._count = before.copy(deep=True), 0

    def add(self, bound: Any) -> None:
        """Record a Bound."""
        place = np.searchsorted(self._backbone, bound.contact)
        name = "high" if bound.side else "low"
        self._after[name].values[place, bound.component] = bound.value
        self._count += 1

    @property
    def narrowed(self) -> Narrowed:
        """The intervals so far."""
        left = 1 - self._count / (4 * len(self._backbone))
        return Narrowed(self.known, self._before, self._after.copy(deep=True), max(left, 1e-3))


class Ranked(NamedTuple):
    """Contacts whose f_n is most worth measuring next, the best first."""

    known: tuple[Statement, ...]  # known forces
    contacts: Integers  # (k,) positions in the backbone
    before: float  # mean interval of f_n now, in ⟨f_n⟩
    after: Floats  # (k,) the same with this one also known; NaN if not computed
    expected: Floats  # (k,) fraction by which errors fall, from correlations over the states


class Knowledge(param.Parameterized):
    """The statements of one page; exact intervals with them are computed in the background."""

    known = param.List(doc="Statements: forces of contacts that are taken for known")
    narrowed = param.Parameter(doc="the Narrowed that they leave open, or None")
    ranked = param.Parameter(doc="the Ranked contacts to measure next, or None")

    def __init__(self, state: Any) -> None:
        super().__init__()  # type: ignore[no-untyped-call]  # param has no type hints
        self.state, self.work = state, state.work
        self.task, self.ranking = self.work.task(reported=False), self.work.task()
        self._followed: tuple[Any, tuple[Statement, ...]] = None, ()
        self.param.watch(self._follow, "known")
        state.param.watch(self._follow, "replay")
        self.task.param.watch(self._failed, "message")
        self.task.param.watch(self._arrive, "fraction")
        self.ranking.param.watch(lambda event: self._rank(_so_far(self.ranking)), "fraction")

    def hold(self, contact: int, value: float, error: float = 0.0) -> None:
        """Declare f_n of a contact known, in ⟨f_n⟩; shows a message if that is impossible."""
        state = self.state
        others = [one for one in self.known if one.contact != contact]
        if contact not in state.contacts or state.growing:
            return
        try:
            if len(others) >= MOST_KNOWN:
                raise InputError(f"{MOST_KNOWN} known forces are the maximum; release some")
            self.known = [*others, self._stated(contact, value, error)]
            self.work.message = ""
        except InputError as refusal:
            self.work.message = str(refusal)

    def release(self, contact: int) -> None:
        """Declare f_n of a contact unknown again."""
        self.known = [one for one in self.known if one.contact != contact]

    def compute(self) -> None:
        """Compute the exact intervals given the known forces, in the background."""
        state = self.state
        known, shown = tuple(self.known), Shown(state.cell, state.replay, state.exact)
        self.task.start(narrowing(state.library, shown, known), self._narrow)

    def rank(self) -> None:
        """Find the contact to measure next, in the background."""
        state = self.state
        replay, known = state.replay, tuple(self.known)
        if replay is None or state.elsewhere:
            return
        self.work.message = ""
        self.ranking.start(ranking(state.library, state.cell, replay, known), self._rank)

    def dismiss(self) -> None:
        """Remove the contacts to measure next, found or being found."""
        self.ranking.dismiss()
        self.ranked = None

    def _rank(self, ranked: Ranked | None) -> None:
        if ranked is not None and ranked is not self.ranked:
            self.ranked = ranked if ranked.known == tuple(self.known) else None

    def _stated(self, contact: int, value: float, error: float) -> Statement:
        """The Statement of a force, refused if the known forces exclude it."""
        state = self.state
        value, error = _number(value, "a known force"), _number(error, "an error bar")
        number = state.replay.backbone[contact]
        current = self.whole
        others = state.exact if not self.known else current.after if current else None
        if others is None or error or contact in {one.contact for one in self.known}:
            return Statement(contact, _rounded(value), _rounded(error))
        low, high = (float(_normal(others, name)[contact]) for name in ("low", "high"))
        width = high - low
        if width < DETERMINED:
            raise InputError(
                f"fₙ of contact {number} is {low:.3f} × the mean force in every remaining "
                "network: holding it would add no information"
            )
        if not low - INWARD * width <= value <= high + INWARD * width:
            allow = "the held forces allow" if self.known else "balance allows"
            raise InputError(
                f"fₙ of contact {number} cannot be {value:.3f} × the mean force: {allow} "
                f"{low:.3f} to {high:.3f}"
            )
        inside = np.clip(value, low + INWARD * width, high - INWARD * width)
        return Statement(contact, _rounded(inside))

    @property
    def whole(self) -> Narrowed | None:
        """The Narrowed of all known forces, once all its bounds exist; otherwise None."""
        narrowed: Narrowed | None = self.narrowed
        settled = narrowed and not narrowed.left and narrowed.known == tuple(self.known)
        return narrowed if settled else None

    def _follow(self, *events: Any) -> None:
        """Update intervals for the known forces; statements belong to one packing."""
        (before, statements), cell = self._followed, self.state.cell
        packing = cell and cell.selection.intervals
        self._followed = packing, tuple(self.known)
        if before == packing and statements == tuple(self.known):
            return  # both changed at once, or other networks of the same packing are on screen
        self.ranked = None
        self.ranking.cancel()
        if before != packing or not self.known:
            self.narrowed = None
        looks = self.state.looks
        if statements and not self.known and looks.colour == "known":
            looks.colour = looks.param.colour.default
        if self.known and cell is not None and self.whole is None:
            self.compute()
        else:
            self.task.cancel()

    def _arrive(self, event: Any) -> None:
        """Show the intervals computed so far."""
        arriving = _so_far(self.task)
        # Before them come the intervals without known forces, which are not shown.
        if event.new and isinstance(arriving, Underway) and arriving.known == tuple(self.known):
            self._narrow(arriving.narrowed)

    def _narrow(self, narrowed: Narrowed) -> None:
        with as_one(self, self.state):
            self.narrowed = narrowed
            if self.state.exact is not narrowed.before:
                self.state.exact = narrowed.before

    def _failed(self, event: Any) -> None:
        """Undo conflicting statements; the message names them."""
        if event.new:
            state, narrowed = self.state, self.narrowed
            self.known = list(narrowed.known) if narrowed and not narrowed.left else []
            self.work.message = f"{event.new} (here ⟨fₙ⟩ = {state.replay.force_scale:.4g})"


def _so_far(task: Task) -> Any:
    return task.job and task.job.so_far


def _number(value: float, what: str) -> float:
    if not 0 <= value < LARGEST:  # also refuses NaN
        raise InputError(f"{what} must lie between 0 and {LARGEST:g} ⟨fₙ⟩, got {value:g}")
    shown = np.float32(value)  # forces on screen are in single precision: 3.7000000477 is 3.7
    return float(str(shown)) if float(shown) == value else float(value)


def _rounded(value: float) -> float:
    return float(f"{value:.9g}")  # as stored in links


def bounds(replay: Replay, known: Iterable[Statement]) -> tuple[Bound, ...]:
    """Statements as held forces of a Selection."""
    scale, number = replay.force_scale, replay.backbone
    return tuple(
        sorted(
            (int(number[c]), (value - error) * scale, (value + error) * scale)
            for c, value, error in known
        )
    )


def rows(replay: Replay, known: Iterable[Statement]) -> list[list[Any]]:
    """Statements as an argument of `conditions`."""
    return rows_of(bounds(replay, known))


def stated(replay: Replay, held: Iterable[Bound]) -> list[Statement]:
    """The Statements of the held forces of a Selection, except on contacts that carry nothing."""
    scale, place = replay.force_scale, {int(c): k for k, c in enumerate(replay.backbone)}
    return [
        Statement(
            place[contact], _rounded((high + low) / 2 / scale), _rounded((high - low) / 2 / scale)
        )
        for contact, low, high in held
        if contact in place
    ]


def commands(selection: Selection, replay: Replay, known: Iterable[Statement]) -> tuple[str, str]:
    """Two lines for a terminal: a file of the known forces, and the intervals with them."""
    words = ["granforce", "intervals", *of_packing(selection), "--known", KNOWN_FILE]
    return known_file(bounds(replay, known)), shlex.join(str(word) for word in words)


def narrowing(
    library: Library, shown: Shown, known: tuple[Statement, ...]
) -> Callable[[Job], Narrowed]:
    """Work for jobs.Task that computes the intervals with known forces; a Narrowed.

    Its partial result is an Underway, with the contacts that may change most first.
    """

    def work(job: Job) -> Narrowed:
        whole = (shown if shown.exact is not None else compute.exact(library, shown)(job)).exact
        assert whole is not None  # loaded or computed
        bounds = Underway(known, whole, shown.replay.backbone)
        job.so_far = bounds
        selection = shown.cell.selection
        given: dict[str, Any] = {"mu": selection.mu, "known": rows(shown.replay, known)}
        params = kinds.INTERVALS.parameters(selection.packing, **given)
        stage = "exact intervals given the known forces"
        options: dict[str, Any] = {
            "widths": expected_changes(shown.replay, known),
            "watch": bounds.add,
        }
        dataset = compute.load_or_compute(library, job, stage, kinds.INTERVALS, params, **options)
        return Narrowed(known, whole, dataset)

    return work


def expected_changes(replay: Replay, known: Iterable[Statement]) -> Floats:
    """(N_c,) change of f_n that goes with a known force over the states; largest for known ones.

    It is the covariance with that force, over the force's own spread.
    """
    off = replay.normal[1:] - replay.normal[1:].mean(axis=0)
    spread = np.maximum(off.std(axis=0), DETERMINED)
    chosen = [one.contact for one in known]
    score = spread * np.abs((off / spread).T @ (off[:, chosen] / spread[chosen])).max(axis=1)
    score[chosen] = 1 + 2 * score.max()
    return score


def ranking(
    library: Library, cell: Cell, replay: Replay, known: tuple[Statement, ...]
) -> Callable[[Job], Ranked]:
    """Work for jobs.Task that finds the contacts to measure next; a Ranked.

    Its partial result is their order before the check by exact bounds.
    """

    def ranked(contacts: Integers, expected: Floats, before: Any, after: Floats) -> Ranked:
        place = np.searchsorted(replay.backbone, contacts)
        return Ranked(known, place, before, after, expected)

    def work(job: Job) -> Ranked:
        selection = cell.selection
        given: dict[str, Any] = {"mu": selection.mu, "known": rows(replay, known) or None}
        few = len(replay.backbone) <= FEW
        params = kinds.INFORMATIVE.parameters(
            selection.packing, check=LISTED if few else CHECKED, k=LISTED, **given
        )
        stage = "the best contacts to measure next, from uniform networks"

        def watch(found: Any) -> None:
            job.begin("exact bounds of the best contacts")
            job.so_far = ranked(*found[:4])

        informative = compute.load_or_compute(
            library, job, stage, kinds.INFORMATIVE, params, watch=watch
        )
        names = "backbone", "part_expected", "mean_before", "mean_after"
        return ranked(*(informative[name].values for name in names))

    return work


def spelled(known: Iterable[Statement]) -> str:
    """Statements as text for a link."""
    rows = (one if one.error else one[:2] for one in known)
    return "~".join(":".join(f"{part:.9g}" for part in row) for row in rows)


def renumbered(known: Iterable[Statement], number: Callable[[int], int]) -> list[Statement]:
    """Statements with renumbered contacts."""
    return [one._replace(contact=number(one.contact)) for one in known]


def read(text: str) -> list[Statement]:
    """Statements from a link's text; ValueError if invalid."""
    parts = [part.split(":") for part in text.split("~")[: MOST_KNOWN + 1]]
    pairs = [(contact, rest) for contact, *rest in parts if 1 <= len(rest) <= 2]
    known = [Statement(integer(contact), *map(number, rest)) for contact, rest in pairs]
    numbers = [number for one in known for number in one[1:]]
    contacts = {one.contact for one in known}
    if not len(parts) == len(known) == len(contacts) <= MOST_KNOWN:
        raise ValueError("too many known forces, or one contact twice")
    if min(contacts) < 0 or not all(0 <= n < LARGEST and math.isfinite(n) for n in numbers):
        raise ValueError("impossible forces")
    return known
