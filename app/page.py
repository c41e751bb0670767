"""One visitor's page, from the first picture to its end, when nothing more is computed for it."""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any
from urllib.parse import parse_qsl

import panel as pn
import panel_material_ui as pmui
import param
from bokeh.document import Document
from panel.util import edit_readonly  # type: ignore[attr-defined]  # which panel says is no export
from tornado.ioloop import IOLoop

from .background import gc_pauses
from .background.jobs import Task, Visitor, computing
from .explore import explanation
from .explore.controls import Controls
from .explore.page_address import Address
from .explore.results_line import of_which, tiles
from .explore.tabs.export import export, figure
from .explore.tabs.force_space import force_space
from .explore.tabs.friction import friction
from .explore.tabs.intervals import intervals
from .explore.tabs.push import push
from .explore.tabs.your_packing import upload
from .explore.volume import Volume
from .learn.model import small_scenes
from .learn.small_scene import FIRST_STEPS, Small
from .obsolete.tour import STEPS, Tour
from .packing.replay.stream import Stream
from .packing.view import PackingView
from .results.library import Library
from .state.app_state import AppState
from .state.page_tasks import Work
from .widgets.hints import Hints
from .widgets.parts import (
    BESIDE,
    PLAIN,
    answer_with_lock,
    mend_late_views,
    send_what_waits,
    together,
)
from .widgets.progress import Progress

# Where it lies over the page, the sidebar begins unseen: player.js shows it once it is closed.
UNSEEN = ".MuiDrawer-modal { visibility: var(--sidebar, hidden) !important }"
# Where everything is in one column, it leaves room at the lower edge for what is told there
# (progress.py, tour.js); narrow pages have less for their title.
NARROW = """
@media (max-width: 1199.95px) {
  .main-content {
    padding-bottom: calc(var(--task, 0px) + var(--card, 0px));
    scroll-padding-bottom: var(--card, 0px);
  }
}
@media (max-width: 599.95px) { .header .title { font-size: 15px !important } }
"""
# Material UI is fetched and run as soon as the page can, not after the page's contents have come:
# 0.13 s. Its address must be the one that Panel asks for, or it would be run twice.
# From one scene's page to another's the old one stays until the new one is seen, and goes over.
EARLY = """{%% extends "base.html" %%}
{%% block preamble %%}{{ super() }}<style>@view-transition { navigation: auto; }</style><script>
  document.addEventListener("load", (event) => {
    if (event.target.src?.includes("es-module-shims")) importShim("%s")
  }, true)
</script>{%% endblock %%}"""
TITLE = "granforce — grains at rest"
# The template's bar, which never shows anything here but which screen readers would tell.
BAR, HIDDEN = "& .MuiAppBar-root .MuiLinearProgress-root", {"display": "none"}
# Packing and tabs under each other, beside each other, and from 1800 px on (player.js) with force
# space between them. Beside each other each scrolls by itself: the packing stays on screen.
TITLE_HEIGHT = 48  # px
COLUMNS = {"gridTemplateColumns": "repeat(2, minmax(0, 1fr))"}
BY_ITSELF = {"maxHeight": f"calc(100dvh - {TITLE_HEIGHT + 8}px)", "overflowY": "auto"}
SIDE_BY_SIDE = {
    "& .MuiToolbar-root": {"minHeight": f"{TITLE_HEIGHT}px !important"},
    "& .main-content": {
        "display": "grid",
        "gridTemplateColumns": "minmax(0, 1fr)",
        "alignItems": "start",
        "alignContent": "start",
        "columnGap": "8px",
        "@media (min-width: 1200px)": COLUMNS | {"& > *": BY_ITSELF},
        "@media (min-width: 1800px)": {"gridTemplateColumns": "repeat(3, minmax(0, 1fr))"},
    },
    BAR: HIDDEN,
}
# The packing alone, within a page of somebody else's.
BARE = {BAR: HIDDEN, "& .MuiAppBar-root": HIDDEN, "& .MuiToolbar-root": HIDDEN}
ALONE = {"sidebar_variant": "temporary", "sidebar_open": False, "sx": BARE}
AROUND = {
    "sidebar_width": 290,
    "sidebar_resizable": False,  # its handle has a name but no role
    "sx": SIDE_BY_SIDE,
}
POLL_MS = 200  # how often the page asks running work how far it is
WAITING_MS = 250  # how often what Panel has kept back is sent
GONE_MS = (
    3000  # without a browser, after which a page's work is ended; the page itself stays longer
)

# The tabs: name in links → title, and view, made when it is first seen. Their components are known
# before any page is: those that are defined while pages are open, the first page alone learns of.
TABS: dict[str, tuple[str, Callable[[AppState], Any]]] = {
    "intervals": ("How far?", intervals.View),
    "statistics": ("Friction", friction.View),
    "plane": ("Force space", force_space.View),  # the third: see TAB_LESS
    "perturb": ("Push", push.View),
    "upload": ("Your packing", upload.View),
    "export": ("Export", export.View),
}

TAB = {
    "& .MuiTab-root": {"minWidth": 0, "padding": "12px 8px", **PLAIN},
    "& .MuiTab-root:nth-of-type(n+5)": {"visibility": "var(--unseen, visible)"},  # see later.js
}
# The same with the tab of force space hidden, which has a place of its own on a wide screen.
TAB_LESS = TAB | {"& .MuiTab-root:nth-of-type(3)": {"display": "none"}}
GROWING = ("intervals", "plane")  # what shows a walk while it is computed


def page() -> Any:
    """One visitor's page: of a small scene, or of a large packing."""
    pn.extension()
    document = pn.state.curdoc
    assert document is not None  # a page is made for one
    mend_late_views(document)
    answer_with_lock()
    asked = small_scenes.asked(pn.state.location.search if pn.state.location else "")
    return (
        _large(document, asked.query)
        if asked.scene == small_scenes.MANY
        else _small(document, asked)
    )


def _small(document: Document, asked: small_scenes.Asked) -> Any:
    """The page of a small scene, which asks no store."""
    task = Task(computing, _turns(document), _visitor(document))
    plain = asked == small_scenes.asked("")
    steps = len(FIRST_STEPS + STEPS)
    view = Small(asked, task, steps, step=asked.step, first=plain, dark=asked.dark)
    whole = pmui.Page(
        title=TITLE,
        main=[view],
        sx={BAR: HIDDEN},
        template=EARLY % pmui.Page._render_esm(server=True),
        dark_theme=asked.dark,
        busy_indicator=None,
    )
    whole.param.watch(lambda event: view.param.update(dark=event.new), "dark_theme")
    _at_end(task.close)
    return whole


def _large(document: Document, query: str) -> Any:
    """The page of a large packing."""
    library = pn.state.as_cached("library", _open_library)
    state = AppState(library, _turns(document), query, _visitor(document))
    looks, work = state.looks, state.work
    work.message = work.message or " ".join(state.library.notes)
    wide = {"sizing_mode": "stretch_width"}
    packing = PackingView(state)
    Stream(state, packing.player, document)
    hears, state.hand.tell = packing.player.hears, packing.player.tell
    hears["wide"] = lambda wide: looks.param.update(wide=wide)
    hears |= {"hand": state.hand.heard, "known": state.knowledge.heard}
    left = pn.Column(packing.player, **wide)
    middle = pn.Column(visible=False, css_classes=["in-plane"], styles=BESIDE, **wide)
    right, sidebar = pn.Column(styles=BESIDE, **wide), pn.Column()
    header = pn.Row(sizing_mode="stretch_width", align="center", margin=(0, 8))
    alone = dict(parse_qsl(query.lstrip("?"))).get("embed") == "1"
    around = ALONE | {"main": [left]} if alone else AROUND | {
        "header": [header], "sidebar": [sidebar], "main": [left, middle, right],
    }  # fmt: skip
    whole = pmui.Page(
        title=TITLE,
        **around,
        template=EARLY % pmui.Page._render_esm(server=True),
        stylesheets=[UNSEEN, NARROW],
        dark_theme=looks.dark,
        busy_indicator=None,  # but the player's: for this one Bokeh looks through the whole page
    )
    with edit_readonly(whole):
        # pn.state, to which it was bound, would keep every closed page, and does if given a value.
        whole.busy = param.rx(False)

    def parts() -> Iterator[None]:
        """What follows the packing."""
        if alone:
            return
        controls = Controls(state)
        left.extend(
            [
                controls.beside,
                controls.error,
                explanation.view(state),
                Address(state),
                Hints(),
            ]
        )
        header[:] = in_title(state, query)
        widgets = controls.panel()
        yield
        for k in range(0, len(widgets), 3):
            sidebar.extend(widgets[k : k + 3])
            yield
        sidebar.append(figure.panel(state))
        summary = tiles(state, Volume(state))
        right.extend([of_which(state), summary])
        tabs = Tabs(state)
        _pale_when_old([*tabs.pages.items(), ("summary", summary), ("plane", middle)])
        hears["tab"] = tabs.choose
        looks.param.watch(lambda event: work.piecewise(tabs.beside(middle)), "wide")
        yield
        right.append(tabs.tabs)
        yield
        yield from tabs.filling(looks.tab)
        yield from tabs.beside(middle)
        state.read_ahead()

    pn.state.onload(partial(work.piecewise, parts()))
    whole.param.watch(lambda event: looks.param.update(dark=event.new), "dark_theme")
    _poll_while_running(work, document)
    document.add_periodic_callback(partial(send_what_waits, document), WAITING_MS)
    _at_end(work.close)
    return whole


def _at_end(close: Callable[[], object]) -> None:
    """Count the page as open, and call this when it is closed."""
    closed = gc_pauses.opened()

    def end(context: object) -> None:
        close()
        closed()

    pn.state.on_session_destroyed(end)


def _turns(document: Document) -> Callable[[Callable[[], object]], None]:
    """wake(function): call it on the page's thread, soon, when what it changes will be seen."""
    waiting: list[Callable[[], object]] = []
    loop = IOLoop.current()

    def run(function: Callable[[], object]) -> None:
        if _in_transit(document):
            waiting.append(function)
        else:
            together(function)

    def come(function: Callable[[], object]) -> None:
        if document.session_context is not None:  # else the page has ended
            document.add_next_tick_callback(partial(run, function))

    def wake(function: Callable[[], object]) -> None:
        # From any thread; the page can end at any moment but within a turn of the loop.
        loop.add_callback(come, function)

    def arrived() -> None:
        while waiting:
            wake(waiting.pop(0))

    pn.state.onload(arrived)
    return wake


def _visitor(document: Document) -> Visitor | None:
    """Who opened a page: from where, and which page it is."""
    context: Any = document.session_context
    if context is None:
        return None
    # Behind a proxy it is the proxy's, unless panel serve is told --use-xheaders.
    return Visitor(getattr(context.request, "remote_ip", None) or "", context.id)


def _in_transit(document: Document) -> bool:
    """Whether the browser has connected but not yet said that it has the page.

    Panel forgets what changes before that, as if the browser were still to fetch the page: changes
    after it was fetched would be lost.
    """
    context: Any = document.session_context
    session = None if context is None else context.session
    return not pn.state.loaded and session is not None and session.connection_count > 0


def _open_library() -> Library:
    """The stores, once for all visitors."""
    gc_pauses.settle()
    return Library()


def in_title(state: AppState, query: str) -> list[Any]:
    """What stands in the title bar, where it covers nothing: what is computed, and the tour."""
    knowledge, work = state.knowledge, state.work
    tasks = work.computation, work.loading, work.measuring, state.besides.task
    tasks += knowledge.task, knowledge.ranking
    return [Progress(*tasks, titled=True), Tour(state, query)]


class Tabs:
    """Views beside the packing; each is made when it is first seen, and told when it is hidden."""

    def __init__(self, state: AppState) -> None:
        self.state, self.looks = state, state.looks
        self.names = list(TABS)
        self._begun: set[str] = set()
        self._space: Any = None  # the view of force space, wherever it is
        self.pages = {
            name: pn.Column(sizing_mode="stretch_width", css_classes=[f"in-{name}"])
            for name in self.names
        }
        if self.looks.tab not in self.names:
            self.looks.tab = self.names[0]
        self.tabs = pmui.Tabs(
            *((TABS[name][0], self.pages[name]) for name in self.names),
            active=self.names.index(self.looks.tab),
            sx=TAB,
            sizing_mode="stretch_width",
        )
        self.tabs.param.watch(lambda event: state.work.piecewise(self._showing()), "active")
        self.looks.param.watch(lambda event: self.choose(self.names.index(event.new) + 1), "tab")

    def choose(self, number: int) -> None:
        """Show tab 1, 2, …; other numbers do nothing, and what is on screen anyway stays there."""
        if 1 <= number <= len(self.names) and not self._has_place(self.names[number - 1]):
            self.tabs.active = number - 1

    def _showing(self) -> Iterator[None]:
        name = self.names[self.tabs.active]
        yield from self.filling(name)  # first, so that those who follow the state find it there
        if name == self.names[self.tabs.active]:
            self.looks.tab = name

    def beside(self, place: Any) -> Iterator[None]:
        """Put force space into a place of its own on a wide screen, else back into its tab."""
        wide, page = self.looks.wide, self.pages["plane"]
        self.tabs.sx = TAB_LESS if wide else TAB
        if wide == place.visible:
            return
        place.visible = wide  # at once: nobody else need begin with it
        if wide:
            if self.looks.tab == "plane":
                self.tabs.active = self.names.index("intervals")
            self._begun.add("plane")
            self._leave(page)
            yield  # two plots of one name must not be in one message
            view = self._space = TABS["plane"][1](self.state)
            yield
            place[:] = [
                pmui.Typography(TABS["plane"][0], variant="h6", margin=(8, 10, 0, 10)),
                view.panel(),
            ]
        else:
            self._leave(place)
            self._begun.discard("plane")
        yield

    def _leave(self, place: Any) -> None:
        """Take force space away from a place; it is made anew for another."""
        place[:] = []
        if self._space is not None:
            self._space.left = True

    def filling(self, name: str) -> Iterator[None]:
        """Make the view of a tab, once; a generator of pieces."""
        if name not in self._begun and not self._has_place(name):
            self._begun.add(name)
            yield
            view = TABS[name][1](self.state)
            if name == "plane":
                self._space = view
            yield
            pieces = list(view.panel())
            # Choices, then two at a time: not one by one, since each time Bokeh goes through all.
            for k in range(-1, len(pieces), 2):
                if self._has_place(name):
                    return
                self.pages[name].extend(pieces[max(k, 0) : k + 2])
                yield
            self.looks.views += 1

    def _has_place(self, name: str) -> bool:
        """Whether a tab's view is beside the packing instead, where there may be but one of it."""
        return self.looks.wide and name == "plane"


def _pale_when_old(parts: Iterable[tuple[str, Any]]) -> None:
    """Have parts (name, view) of other states than those asked for be pale; see player.js."""
    for name, part in parts:
        old = "growing" if name in GROWING else "still"
        part.styles = part.styles | {
            "opacity": f"var(--{old}, 1)",
            "filter": f"var(--{old}-colours, none)",
        }


def _poll_while_running(work: Work, document: Document) -> None:
    """Take over the progress of tasks while there are any; end them where nobody looks any more."""
    polling: list[Any] = []
    loaded: list[bool] = []

    def poll() -> None:
        if loaded and _left_alone(document.session_context):
            work.cancel()
        if not _in_transit(document):
            work.poll()

    def switch(*events: Any) -> None:
        if work.busy and not polling:
            polling.append(document.add_periodic_callback(partial(together, poll), POLL_MS))
        elif polling and not work.busy:
            document.remove_periodic_callback(polling.pop())

    pn.state.onload(lambda: loaded.append(True))
    work.param.watch(switch, "busy")
    switch()


def _left_alone(context: Any) -> bool:
    """Whether the browser has been gone for so long that it will hardly come back."""
    session = None if context is None else context.session
    if session is None or session.connection_count:
        return False
    return session.milliseconds_since_last_unsubscribe > GONE_MS
