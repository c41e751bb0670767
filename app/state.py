"""What the page is showing and doing, as parameters: no widgets, no plots."""

from functools import partial

import param

from granforce.records import InputError

from . import compute
from .data import best_cell, nearest_cell
from .jobs import Job, Task, computing, reading
from .limits import LIMITS
from .selection import link, read_link

# What colour, width and order can show: word in links → words on screen.
COLOURS = {
    "mobilised": "mobilisation fₜ/(μ fₙ)",
    "extent": "length of the interval ΔFₙ",
    "change": "change since the original",
    "sign": "sign of fₙ − pinned fₙ",
}
WIDTHS = {"normal": "normal force fₙ", "extent": "ΔFₙ", "difference": "|fₙ − pinned fₙ|"}
SORTS = {
    "original": "original fₙ",
    "extent": "ΔFₙ of all states",
    "exact": "exact ΔFₙ",
    "position": "place of the original in its interval",
}
SCALES = {"mean": "fₙ / ⟨fₙ⟩", "own": "fₙ / original fₙ"}


class AppState(param.Parameterized):
    """The states selected, the catalogue to select from, what is seen of them, and the tasks."""

    catalogue = param.List(doc="all cells, by series and μ")
    selection = param.Parameter(doc="Selection asked for; not on screen while it is `missing`")
    missing = param.Boolean(doc="whether the selection is in no store and has to be computed")
    cell = param.Parameter(doc="the Cell on screen, or None")
    replay = param.Parameter(doc="the Replay on screen, or None")
    exact = param.Parameter(doc="Dataset of exact intervals on the same contacts, or None")
    source = param.String(doc="where the states on screen come from, in words")
    message = param.String(doc="one line about what went wrong, or empty")

    tab = param.String(default="intervals", doc="name of the visible tab; others compute nothing")
    contact = param.Integer(default=None, allow_None=True, doc="selected: position in the backbone")
    frame = param.Integer(default=0, doc="row of `replay` on screen; told while it is at rest")
    reference = param.Integer(default=0, doc="row of `replay` that is pinned, for differences")
    between = param.Tuple(
        default=None, length=2, allow_None=True, doc="rows of `replay` to go to and fro between"
    )
    colour = param.Selector(default="mobilised", objects=list(COLOURS))
    thickness = param.Selector(default="normal", objects=list(WIDTHS))
    overlay = param.Boolean(doc="whether strong and undetermined contacts are marked (Fig. 5)")
    sort = param.Selector(default="original", objects=list(SORTS), doc="order of the intervals")
    scale = param.Selector(default="mean", objects=list(SCALES), doc="unit of the intervals")
    dark = param.Boolean(doc="theme")
    busy = param.Boolean(doc="whether any task is running")
    displacement = param.Parameter(doc="(N, 2) array to animate on the packing, or None")

    def __init__(self, library, wake=None, query="", **params):
        """wake(function): call a function soon on the page's thread; see jobs.Task.

        query: of the address that opened the page.
        """
        super().__init__(**params)
        self.library, self._wake = library, wake
        self.tasks = []
        self.computation, self.reader = self.task(), self.task(reading)
        self.open(query)

    # Tasks

    def piecewise(self, pieces):
        """Have a generator run to its end; other pages are served between its pieces."""
        if self._wake is None:
            for _ in pieces:
                pass
        elif next(pieces, "end") != "end":
            self._wake(partial(self.piecewise, pieces))

    def task(self, pool=computing):
        """A new Task of this page: work off the event loop, ended when the page is closed."""
        task = Task(pool, self._wake)
        task.param.watch(self._tell, "message")
        task.param.watch(self._count, "running")
        self.tasks.append(task)
        return task

    def poll(self):
        """Take over the progress of all tasks."""
        for task in self.tasks:
            task.poll()

    def close(self):
        """End all work of the page."""
        for task in self.tasks:
            task.cancel()

    def _tell(self, event):
        if event.new:
            self.message = event.new

    def _count(self, event):
        self.busy = any(task.running for task in self.tasks)

    # What is on screen

    def open(self, query=""):
        """Show what a link selects, computing it if need be, or what is best to begin with."""
        try:
            wanted, view = read_link(query)
        except InputError as error:
            wanted, view = None, {}
            self.message = str(error)
        self._look_up(wanted, read_view(view))

    def refresh(self, shown=None):
        """Read the catalogue anew; show what was just computed."""
        if shown is not None:
            self._show(shown)
        self.reader.start(lambda job: self.library.cells(), self._list)

    def ask(self, selection, at_once=False):
        """Select states: shown if a store has them, else `missing`, or computed at_once."""
        self.message = ""
        found = best_cell(self.catalogue, selection)
        if found is not None and found.selection.names(selection):
            self.show(found)
            return
        self.param.update(selection=selection, missing=True)
        if at_once:
            self.compute()

    def choose(self, series=None, mu=None):
        """Show the stored cell of this series with the nearest μ; by default those on screen."""
        series = self.cell.series if series is None else series
        mu = self.cell.mu if mu is None else mu
        cells = [cell for cell in self.catalogue if cell.series == series]
        if cells:
            self.show(nearest_cell(cells, mu))

    def cells(self):
        """The cells of the series on screen, by μ."""
        return [c for c in self.catalogue if self.cell is not None and c.series == self.cell.series]

    def show(self, cell):
        """Put a cell on screen: at once if it is in memory, else when it is read."""
        shown = self.library.shown_in_memory(cell)
        if shown is not None:
            self._show_and_read_ahead(shown)
        else:
            self.reader.start(lambda job: self.library.shown(cell), self._show_and_read_ahead)

    def read_ahead(self):
        """Have the cells with the nearest μ read meanwhile: they are the likeliest next."""
        cells = self.cells()
        if self.cell in cells:
            here = cells.index(self.cell)
            for near in cells[max(here - 1, 0) : here + 2]:
                if self.library.shown_in_memory(near) is None:
                    Job(lambda job, near=near: self.library.shown(near), reading)

    def _look_up(self, wanted, view):
        library = self.library

        def read(job):
            cells = library.cells()
            cell = best_cell(cells, wanted)
            return cells, cell and library.shown(cell)

        def done(found):
            cells, shown = found
            self._list(cells)
            self.param.update(**{k: v for k, v in view.items() if k not in OF_A_REPLAY})
            if shown is not None:
                self._show(shown, view)
            if wanted is not None and (shown is None or not shown.cell.selection.names(wanted)):
                self.ask(wanted, at_once=True)

        at_hand = best_cell(library.catalogue, wanted)
        shown = at_hand and library.shown_in_memory(at_hand)
        if shown and (wanted is None or at_hand.selection.names(wanted)):
            done((library.catalogue, shown))  # the first picture needs no thread
            self.refresh()
        else:
            self.reader.start(read, done)

    def _list(self, cells):
        self.catalogue = list(cells)

    def _show_and_read_ahead(self, shown):
        self._show(shown)
        self.read_ahead()

    def _show(self, shown, view=None):
        cell, replay, exact = shown
        where = "finished results" if cell.store is self.library.shipped else "your cache"
        fresh = {"contact": None, "frame": 0, "reference": 0, "between": None}
        if self.replay is replay:
            fresh = {}
        self.param.update(
            selection=cell.selection,
            missing=False,
            cell=cell,
            replay=replay,
            exact=exact,
            source=f"μ = {cell.mu:g}, {cell.series} (from {where})",
            displacement=None,
            **fresh | _fitting(view or {}, replay),
        )

    # What is computed

    def compute(self):
        """Compute the states selected, in the background, and show them."""
        if self.computation.running or self.selection is None:
            return
        self.message = ""
        asked = self.selection
        try:
            sizes = {} if asked.imported else {"n": asked.packing["n"]}
            LIMITS.check(states=asked.states, **sizes)
            asked.parameters()
        except InputError as error:
            self.message = str(error)
            return
        self.computation.start(compute.states(self.library, asked), self.refresh)

    def compute_exact(self):
        """Compute the exact intervals of the packing on screen, in the background."""
        if self.computation.running or self.cell is None or self.exact is not None:
            return
        self.message = ""
        shown = self.library.shown(self.cell)

        def done(found):
            if found.cell == self.cell:
                self._show(found)

        self.computation.start(compute.exact(self.library, shown), done)

    # What a link tells

    def link(self):
        """The query of an address that reopens this view."""
        if self.selection is None:
            return ""
        view = {}
        for name in VIEW:
            value = getattr(self, name)
            if value != self.param[name].default:
                view[name] = _spelled(value)
        return link(self.selection, view)


# Parameters that a link holds where they are not as in a new page, and how they are read.
def _pair(text):
    a, b = (int(part) for part in text.split("-"))
    return a, b


def _flag(text):
    return {"0": False, "1": True}[text]


VIEW = {
    "tab": str,
    "contact": int,
    "frame": int,
    "reference": int,
    "between": _pair,
    "colour": str,
    "thickness": str,
    "overlay": _flag,
    "sort": str,
    "scale": str,
    "dark": _flag,
}
OF_A_REPLAY = ("contact", "frame", "reference", "between")


def _spelled(value):
    if isinstance(value, tuple):
        return "-".join(str(part) for part in value)
    return int(value) if isinstance(value, bool) else value


def read_view(given):
    """Parameters of AppState from a link's texts; what makes no sense is left out."""
    view = {}
    for name, cast in VIEW.items():
        try:
            value = cast(given[name])
            AppState.param[name]._validate(value)
        except (KeyError, ValueError):
            continue
        view[name] = value
    return view


def _fitting(view, replay):
    """Of these rows and contacts those that a Replay has."""
    frames, contacts = replay.normal.shape
    sizes = {"contact": contacts, "frame": frames, "reference": frames, "between": frames}

    def fits(name):
        values = view[name] if name == "between" else (view[name],)
        return all(0 <= value < sizes[name] for value in values)

    return {name: view[name] for name in OF_A_REPLAY if name in view and fits(name)}
