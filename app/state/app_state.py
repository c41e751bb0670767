"""The states that a page has selected and shows, as parameters: no widgets, no plots."""

from collections.abc import Callable
from functools import partial
from typing import Any
from urllib.parse import parse_qs

import numpy as np
import param

from granforce.records import InputError

from ..background.jobs import Job, Visitor
from ..background.limits import LIMITS
from ..background.notifications import as_one, observe
from ..results import compute, durations
from ..results.library import Cell, Library, Shown, best_cell, cell_of, nearest_cell, with_states
from ..results.progress_feed import Following, numbers
from ..results.replays import Replay
from ..results.selection import Selection, brief, command
from . import known, perturbations
from .known import Knowledge
from .links import (
    OF_A_REPLAY,
    VIEW,
    Numbered,
    Numbers,
    View,
    fitting,
    key,
    left_out,
    link,
    read_link,
    read_view,
    spelled,
)
from .page_tasks import Work
from .place import Place
from .pulls import Hand
from .view_settings import Looks

EXACT_FOLLOW = 1500  # contacts up to which exact intervals are computed automatically
# Parameters of Looks that change by playing, zooming or computing, not by the visitor's choice of
# view: going back does not restore the previous frame or zoom.
PASSING = ("frame", "paused", "opened", "zoom", "pushed")
PRECOMPUTED, COMPUTED = "precomputed", "computed on this server"


class AppState(param.Parameterized):
    """The states selected, and the catalogue to select from.

    `looks` is how they are shown, `work` what is being computed; these do not depend on it.
    `knowledge` holds known forces, and `hand` what was pulled.
    """

    catalogue = param.List(doc="all cells, by series and μ")
    selection = param.Parameter(doc="Selection asked for; not on screen while it is `missing`")
    missing = param.Boolean(doc="whether the selection is in no store and has to be computed")
    cell = param.Parameter(doc="the Cell on screen, or None")
    replay = param.Parameter(doc="the Replay of the cell on screen, or None")
    shown = param.Parameter(doc="the same, or meanwhile that of the walk under way")
    exact = param.Parameter(doc="Dataset of exact intervals on the same contacts, or None")
    measured = param.Parameter(doc="the photoelastic.Measured of the last frame opened, or None")
    loads = param.Parameter(doc="limit loads (N_c,) of the contacts in ⟨f_n⟩, or None if unknown")
    before = param.Parameter(doc="the Shown that this one replaced, or None")
    source = param.String(doc="where the states on screen come from, in words")
    plane = param.Parameter(doc="the planes.Plane of force space on screen, or None")
    pushed = param.Parameter(doc="the perturbations.Pushed of the contact in Push, or None")
    motion = param.Parameter(doc="the perturbations.Motion drawn on the packing, or None")

    def __init__(
        self,
        library: Library,
        wake: Callable[[Callable[[], object]], object] | None = None,
        query: str | None = "",
        visitor: Visitor | None = None,
    ) -> None:
        """wake(function): call a function soon on the page's thread; see jobs.Task.

        query: of the address that opened the page; None: show nothing yet.
        """
        super().__init__()  # type: ignore[no-untyped-call]  # param has no type hints
        self.library, self.work = library, Work(wake, visitor)
        self.looks = Looks()  # type: ignore[no-untyped-call]  # param says no types
        # A refusal is shown until the next action; watched before the parts that may refuse.
        chosen = [name for name in VIEW if name in Looks.param and name not in PASSING]
        self.looks.param.watch(self._forget, chosen)
        self.knowledge = Knowledge(self)
        self.hand = Hand(self)  # uses what is known
        self.parts = self.looks, self.knowledge, self.hand  # which a link names
        self._viewed: dict[str, Any] = {
            name: part.param[name] for name in VIEW for part in self.parts if name in part.param
        }
        observe(self._need_loads, self, "replay", "looks.colour", "looks.thickness")
        self._linked: tuple[Selection, View] | None = None  # of a link to states in no store
        self._stopped: list[tuple[Selection, int]] = []  # each with the networks asked for
        self._invalid: list[str] = []  # parameters of the last link that could not be read
        # Number of the network to show once all are stored, and the frame on screen until then.
        self._wanted = 0, 0
        self._place: Place | None = None
        self.work.computation.param.watch(self._bring_back, ["dismissed", "message"])
        observe(self._forget, self, "cell", "knowledge.known", "hand.pulls")
        observe(self._follow_held, self, "cell", "knowledge.known")
        if query is not None:
            self.open(query)

    def _forget(self, *events: Any) -> None:
        self.work.message = ""

    # The view

    def open(self, query: str = "") -> None:
        """Show the selection of a link, computing it if necessary, or a good one to begin with."""
        selection: Selection | None = None
        texts: dict[str, str] = {}
        self.work.message = ""
        try:
            selection, texts = read_link(query)
            if selection is not None:
                selection.check(LIMITS)
        except InputError as error:
            selection, self.work.message = None, str(error)
        view, self._invalid = read_view(texts, self._viewed)
        new = {name: self._viewed[name].default for name in VIEW}  # what a link omits
        self._look_up(selection, new | view, counted="states" in parse_qs(query.lstrip("?")))

    def _new_view(self, selection: Selection) -> View:
        """The part of the view that belongs to states, for new states; without what stays."""
        stays = ("contact", "known", "pushed") if self._shares_packing(selection) else ()
        return {name: self._viewed[name].default for name in OF_A_REPLAY if name not in stays}

    def _keep_place(self) -> None:
        """Note what the visitor sees before a computation shows its own pictures."""
        replay, looks = self.replay, self.looks
        if replay is None or self.work.live is not None:
            return
        number = int(replay.number[min(looks.frame, len(replay.number) - 1)])
        self._place = Place(
            self.cell.selection.packing, replay, number, looks.paused, looks.contact
        )

    def _placed(self, selection: Selection, replay: Replay) -> View:
        """The noted network and contact in other states, as far as they exist there."""
        self._keep_place()
        place = self._place
        if place is None:
            return {"paused": self.looks.paused, "frame": 0}
        view: View = {"paused": place.paused, "frame": Numbered(place.number)}
        contact = place.contact_in(selection.packing, replay)
        return view if contact is None else view | {"contact": contact}

    @property
    def view(self) -> View:
        """The present view, as far as a link can store it."""
        return {name: getattr(parameter.owner, name) for name, parameter in self._viewed.items()}

    def _look(self, view: View) -> None:
        """Apply a view."""
        for part in self.parts:
            part.param.update(**{name: view[name] for name in view if name in part.param})

    @property
    def contacts(self) -> range:
        """Positions of the contacts of the states on screen."""
        return range(0 if self.replay is None else len(self.replay.backbone))

    @property
    def growing(self) -> bool:
        """Whether the Replay on screen is that of a walk in progress."""
        return self.shown is not self.replay

    @property
    def on_screen(self) -> Selection | None:
        """The Selection of the states on screen; None without states."""
        return self.work.live.selection if self.growing else self.cell and self.cell.selection

    @property
    def elsewhere(self) -> bool:
        """Whether the states on screen are a walk in progress of another packing than `cell`."""
        return self.growing and not (self.cell and self._shares_packing(self.on_screen))

    def _shares_packing(self, selection: Selection | None) -> bool:
        """Whether a Selection is of the packing and μ of `cell`."""
        return bool(self.cell and selection and self.cell.selection.shares_packing(selection))

    @property
    def obeying(self) -> bool:
        """Whether the states on screen are those of S with exactly the held forces."""
        shown, statements = self.on_screen, self.knowledge.known
        if shown is None or self.replay is None:
            return not statements
        held = known.bounds(self.replay, statements)
        return len(held) == len(shown.held) and np.allclose(held, shown.held, rtol=1e-8, atol=0)

    @property
    def free(self) -> Any:
        """The exact intervals of the packing on screen, without held forces; or None."""
        return None if self.elsewhere else self.exact

    @property
    def possible(self) -> Any:
        """The exact intervals of the packing on screen, given the known forces; or None."""
        narrowed = self.knowledge.narrowed
        return self.free if narrowed is None or self.elsewhere else narrowed.after

    @property
    def narrows(self) -> bool:
        """Whether numbers are those given the held forces; a push of all of S ignores them."""
        return bool(self.knowledge.known and (self.obeys_held or self.obeying))

    @property
    def settled(self) -> Any:
        """The exact intervals to which numbers belong; None until all bounds exist."""
        whole = self.knowledge.whole
        if not self.narrows or self.elsewhere:
            return self.free
        return None if whole is None else whole.after

    @property
    def bounds(self) -> str:
        """The kind of the bounds in `possible`, in words."""
        return "exact" if self.knowledge.narrowed is None else "exact given the held forces"

    @property
    def obeys_held(self) -> bool:
        """Whether lines show the held forces; a push, which ignores them, does not."""
        return self.looks.tab != "perturb"

    @property
    def drawn(self) -> Any:
        """The exact intervals that lines show: `possible`, or those without the held forces."""
        return self.possible if self.obeys_held else self.free

    def refresh(self, shown: Shown | None = None) -> None:
        """Read the catalogue again; show what was just computed."""
        if shown is not None:
            self._show(shown)
        self.work.reader.start(lambda job: self.library.cells(), self._list)

    def ask(self, selection: Selection, at_once: bool = False) -> None:
        """Select states: shown if a store has them, otherwise `missing`, or computed at_once."""
        self.work.message = ""
        cell = cell_of(self.catalogue, selection)
        if cell is not None:
            self.show(cell)
            return
        try:
            selection.check(LIMITS)
            selection.parameters()
        except InputError as error:
            self.work.message = str(error)
            return
        self._request(selection, at_once)

    def sample_held(self) -> None:
        """Select the states of S with the held forces, or of all of S if none are held."""
        if self.cell is not None and not self.obeying:
            self.ask(self.given_held(self.cell.selection), at_once=True)

    def given_held(self, selection: Selection) -> Selection:
        """A Selection with the held forces, if they are those of its packing.

        With as many networks as a stopped walk on screen it gets as many as were asked for there:
        stopping one walk does not shorten others.
        """
        of_packing, on_screen = self._shares_packing(selection), self.cell and self.cell.selection
        for stopped, states in self._stopped:
            if stopped.states == selection.states and stopped in (self.selection, on_screen):
                selection = selection._replace(states=states)
        return selection.holding(
            known.bounds(self.replay, self.knowledge.known) if of_packing else ()
        )

    def _follow_held(self, *events: Any) -> None:
        """Once states with held forces are on screen, they follow what is held."""
        if self.cell is not None and self.cell.selection.held:
            self.sample_held()

    def _request(self, selection: Selection, at_once: bool) -> None:
        # Announced together: a short `missing` would move the page.
        with as_one(self.work, self):
            self.param.update(selection=selection, missing=True)
            if at_once:
                self.compute()

    def choose(self, series: str | None = None, mu: float | None = None) -> None:
        """Show a stored series at its μ nearest to that on screen; or the present one at this μ.

        If it has no states there, they are requested and can be computed.
        """
        if mu is not None:
            matching = [cell for cell in self.cells() if np.isclose(cell.mu, mu, rtol=1e-3, atol=0)]
        else:
            cells = [cell for cell in self.catalogue if cell.series == series]
            matching = cells and [nearest_cell(cells, self.selection.mu)]
        if matching:
            self.show(matching[0])
        elif mu is not None and self.cell is not None:
            self.ask(self.given_held(self.cell.selection.at(mu)))

    def cells(self) -> list[Cell]:
        """The cells of the series on screen, by μ."""
        current = self.cell
        return [c for c in self.catalogue if current is not None and c.series == current.series]

    def show(self, cell: Cell) -> None:
        """Show a cell: at once if it is in memory, otherwise after reading it.

        If it cannot be read, its states are computed again.
        """
        library = self.library
        shown = library.shown_in_memory(cell)

        def read(job: Job) -> Shown | None:
            try:
                return library.shown(cell)
            except InputError:
                library.cells()
                return None

        def done(shown: Shown | None) -> None:
            if shown is not None:
                self._show_and_read_ahead(shown)
            else:
                self._list(library.catalogue)
                self._request(cell.selection, at_once=True)

        if shown is not None:
            self._show_and_read_ahead(shown)
        else:
            self.work.reader.start(read, done)

    def read_ahead(self) -> None:
        """Read the cells with the nearest μ in advance: they are the likeliest next."""
        cells = self.cells()
        if self.cell in cells:
            position = cells.index(self.cell)
            self.work.read_ahead(
                partial(lambda near, job: self.library.shown(near), near)
                for near in cells[max(position - 1, 0) : position + 2]
                if self.library.shown_in_memory(near) is None
            )

    def _look_up(self, requested: Selection | None, view: View, counted: bool) -> None:
        """counted: whether exactly this many states are required, not any stored number."""
        library = self.library

        def found(
            cells: list[Cell], requested: Selection | None
        ) -> tuple[Selection | None, Cell | None]:
            if requested is None:
                return None, best_cell(cells)
            selection = requested if counted else with_states(cells, requested)
            return selection, cell_of(cells, selection)

        def read(job: Job) -> tuple[Selection | None, Shown | None, str]:
            damage = ""
            while True:
                named = requested and library.as_imported(requested)
                selection, cell = found(library.cells(), named)
                try:
                    return selection, cell and library.shown(cell), damage
                except InputError as error:
                    damage = str(error)
                    still = cell in library.cells()
                    if selection is not None:
                        return selection, None, damage
                    if still:
                        raise

        def done(result: tuple[Selection | None, Shown | None, str]) -> None:
            selection, shown, damage = result
            message = damage or self.work.message
            self._list(library.catalogue)
            self._look({name: view[name] for name in view if name not in OF_A_REPLAY})
            # The old view stays until the requested states exist; Cancel returns to it.
            if shown is not None:
                self._show(shown, view)
            elif selection is not None:
                self._linked = selection, view
                dear = LIMITS.shared and selection.dear
                self._request(selection, at_once=not dear)
                if dear:
                    self.work.message = (
                        "this link needs a long computation, which a link does not start on this "
                        "server: press Compute"
                    )
            self.work.message = self.work.message or message

        selection, cell = found(library.catalogue, requested)
        shown = cell and library.shown_in_memory(cell)
        if shown:
            done((selection, shown, ""))  # the first picture needs no thread
            self.refresh()
        else:
            self.work.reader.start(read, done)

    def _list(self, cells: list[Cell]) -> None:
        self.catalogue = list(cells)

    def _show_and_read_ahead(self, shown: Shown) -> None:
        self._show(shown)
        self.read_ahead()

    def _show(self, shown: Shown, view: View | None = None) -> None:
        cell, replay, exact = shown
        if view is None and self._linked and cell.selection.names(self._linked[0]):
            view = self._linked[1]
        self._linked = None
        fresh = self._new_view(cell.selection)
        given = self._placed(cell.selection, replay) if view is None else view
        if self._is_grown(replay):
            # The visitor may have chosen another contact meanwhile.
            fresh, given = {}, view or {name: given[name] for name in ("frame", "paused")}
        elif self.shown is replay and view is None:
            fresh, given = {}, {}
        fitted = fitting(given, replay)
        fresh |= fitted
        if "paused" in given:
            fresh["paused"] = given["paused"]
        if cell.selection.held and fresh.get("frame") == 0:
            fresh["frame"] = 1  # the network as packed has other forces
        held = fresh["known"] if "known" in fresh else self.knowledge.known
        if not held:
            fresh["known"] = known.stated(replay, cell.selection.held)
        with as_one(*self.parts, self.work, self):
            self.work.shown(cell.selection)
            self.param.update(
                selection=cell.selection, missing=False, before=self._before(cell), cell=cell,
                replay=replay, shown=replay, exact=exact, source=self._source(cell),
                motion=None, loads=self.loads if self.replay is replay else None,
                plane=self.plane if self.replay is replay else None,
            )  # fmt: skip
            self._look(fresh)
        if view is not None:
            lost = [key(name) for name in OF_A_REPLAY if name in given and name not in fitted]
            lost, self._invalid = self._invalid + lost, []
            self.work.message = self.work.message or left_out(lost)

    def _before(self, cell: Cell) -> Shown | None:
        """The states on screen if those of a cell replace them."""
        now = self.cell
        if now is None or cell.selection.names(now.selection):
            return self.before
        return Shown(now, self.replay, self.exact)

    def _source(self, cell: Cell | None = None) -> str:
        """The source of a cell's states, by default of the cell on screen."""
        cell = cell or self.cell
        if cell is None:
            return ""
        shipped = cell.store is self.library.shipped
        label = brief(cell.selection, cell.series)
        return f"μ = {cell.mu:g}, {label} ({PRECOMPUTED if shipped else COMPUTED})"

    def _is_grown(self, replay: Replay) -> bool:
        """Whether a Replay is the final version of the growing walk on screen."""
        return self.growing and np.array_equal(self.shown.normal[0], replay.normal[0])

    # Computations

    def compute(self) -> None:
        """Compute the selected states in the background, and show them as they are found."""
        selection = self.selection
        live = self.work.live if self.work.computation.running else None
        if selection is None or (live and live.selection == selection):
            return
        self.work.message = ""
        try:
            selection.parameters()
        except InputError as error:
            self.work.message = str(error)
            return
        self._keep_place()
        with as_one(self.work, self):
            self.shown = self.replay
            self.work.compute(self.library, selection, partial(self._computed, selection.states))

    def _computed(self, states: int, shown: Shown) -> None:
        """Show states that were just computed, then their exact intervals if they are quick."""
        if shown.cell.selection.states != states:
            self._stopped.append((shown.cell.selection, states))
        self.refresh(shown)
        if shown.replay.normal.shape[1] <= EXACT_FOLLOW:
            self.compute_exact()

    @property
    def keepable(self) -> float:
        """Expected seconds for all networks of the walk on screen; 0 if no more can be stored."""
        cell = self.cell
        if cell is None or cell.stored >= cell.selection.stored:
            return 0.0
        return durations.seconds(cell.kind, cell.selection.parameters())

    def keep_all(self, number: int) -> None:
        """Compute the networks of the walk on screen that were not stored, keeping the view.

        number: of the network to show then, unless another one was chosen meanwhile. While this
        is under way, another number replaces it.
        """
        cell = self.cell
        self._wanted = number, self.looks.frame
        if not self.keepable or self.missing or self.work.computation.running:
            return
        self.work.message = ""

        def done(shown: Shown) -> None:
            self._list(self.library.cells())
            if self.cell == cell:
                number, frame = self._wanted
                wanted = {"frame": Numbered(number)} if self.looks.frame == frame else {}
                self._show(shown, self._by_numbers() | wanted)

        self.work.computation.start(compute.all_states(self.library, cell), done)

    def _by_numbers(self) -> View:
        """The view on screen by numbers, to be applied to other states of the same walk."""
        assert self.numbers is not None  # a Replay is on screen
        view = {name: value for name, value in self.view.items() if value is not None}
        numbers = self.numbers.of(view)
        return self.view | {
            name: Numbered(numbers[name]) for name in OF_A_REPLAY if name in numbers
        }

    def _bring_back(self, event: Any) -> None:
        """Return to the view before a request that was cancelled or failed.

        If there was none, a cancelled request opens what the page opens with.
        """
        cell = self.cell
        if cell is None and event.name == "dismissed":
            cell = best_cell(self.catalogue)
        if event.new and self.missing and cell is not None:
            message = self.work.message
            self.show(cell)
            self.work.message = message

    def grow(self, replay: Replay) -> None:
        """Show the Replay of a walk that begins."""
        selection = self.work.live.selection
        contact = self._placed(selection, replay).get("contact")
        label = brief(selection, self.library.series(selection))
        source = f"μ = {selection.mu:g}, {label} (as they are sampled)"
        with as_one(*self.parts, self.work, self):
            self.work.param.update(fourfold=0, moving=False)
            self.param.update(shown=replay, plane=None, source=source, motion=None)
            self._look(self._new_view(selection) | {"contact": contact})

    def follow(self) -> Following | None:
        """The computation in progress, from `work`; if it failed, the previous view returns."""
        with as_one(*self.parts, self.work, self):
            if self.work.live is not None and not self.work.computation.running:
                plane = None if self.growing else self.plane
                view = self._new_view(self.work.live.selection)
                self.param.update(shown=self.replay, plane=plane, source=self._source())
                self._look(view)
            return self.work.follow()

    @property
    def requested(self) -> str:
        """The requested packing that is not on screen yet, in words, or an empty string."""
        if not self.missing or self._shares_packing(self.selection):
            return ""
        words = f"μ = {self.selection.mu:g}, {self.library.series(self.selection)}"
        if self.work.computation.running:
            return f"requested: {words}"
        shown = f"of μ = {self.cell.mu:g}; " if self.cell else ""
        return f"{shown}not computed: {words}"

    @property
    def nothing(self) -> str:
        """Why no states are on screen, if there are none."""
        if self.work.reader.running:
            return "Opening the packing …"
        if self.work.computation.running:
            return "Being computed …"
        return f"Nothing is shown ({self.requested})." if self.requested else "Nothing is shown."

    @property
    def unsaved(self) -> str:
        """Why nothing on screen can be saved, or an empty string."""
        if self.replay is None:
            return "Nothing is on screen yet."
        if self.missing:
            return (
                f"What is on screen, of μ = {self.cell.mu:g}, is not what was requested: wait for "
                "the requested networks, or cancel, before saving."
            )
        return ""

    @property
    def packing(self) -> Any:
        """The parameters of the packing on screen, or None."""
        if self.growing:
            return self.work.live.selection.packing
        return self.cell and self.cell.selection.packing

    def compute_exact(self) -> None:
        """Compute the exact intervals of the packing on screen, in the background."""
        if self.work.computation.running or self.cell is None or self.exact is not None:
            return

        def done(result: Shown) -> None:
            if result.cell == self.cell:
                self._show(result)

        self.work.compute_exact(self.library, self.library.shown(self.cell), done)

    @property
    def exact_requested(self) -> bool:
        """Whether exact intervals are neither there nor in progress, and nothing precedes them."""
        under_way = self.work.computation.running or self.knowledge.task.running
        return self.exact is None and not self.growing and not under_way

    def _need_loads(self, *events: Any) -> None:
        """Compute limit loads of all contacts if colour or width show them."""
        replay, cell = self.replay, self.cell
        if "load" not in (self.looks.colour, self.looks.thickness) or replay is None:
            self.work.loading.cancel()
        elif self.loads is None and replay.summary["mu"] > 0:

            def done(found: perturbations.Loads) -> None:
                if self.replay is replay:
                    self.loads = found.load

            self.work.loading.start(perturbations.limit_loads(self.library, cell), done)

    # Links

    @property
    def command(self) -> str:
        """The commands that compute the requested states, and intervals given the known forces."""
        line, statements = command(self.selection), self.knowledge.known
        if not statements or self.replay is None or self.missing:
            return line
        file, intervals = known.commands(self.selection, self.replay, statements)
        return f"{file}\n{line}\n{intervals}"

    def link(self) -> str:
        """The query of an address that reopens this view."""
        if self.selection is None:
            return ""
        view = self.view
        if self.looks.tab != "perturb":
            view["pushed"] = None
        if self.looks.pulled == "push":  # every push begins with the network as packed
            view["frame"] = self._viewed["frame"].default
        changed = {
            name: value for name, value in view.items() if value != self._viewed[name].default
        }
        return link(self.selection, spelled(changed, self.numbers))

    @property
    def numbers(self) -> Numbers | None:
        """Numbers of the contacts and networks on screen, if they belong to the selection."""
        replay = self.shown
        if replay is None or (self.missing and not self.growing):
            return None
        return Numbers(replay.backbone, numbers(replay.summary) if self.growing else replay.number)
