"""The page as one file: packing, player, intervals and force space, without server or network."""

import base64
import json
from collections.abc import Mapping
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import xarray as xr
from bokeh.document import Document
from bokeh.embed import components
from bokeh.resources import Resources

from ....background.jobs import Job
from ....browser.bundle import Scripted, module
from ....packing.legend import THRUST, exact_intervals, full_colour, legend
from ....packing.player import Player, frames
from ....results import planes
from ....results.library import Cell, Library
from ....results.replays import Replay, evenly
from ....state.known import Narrowed
from ....state.links import View
from ....widgets.plot_style import palettes
from ... import explanation
from . import still

NOTHING: Mapping[str, Any] = MappingProxyType({})
FRAME_BYTES = 4.5e6  # of forces; if there are more, states are left out evenly

PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ margin: 0; font-family: Helvetica, Arial, sans-serif; color: #18191d; background: #fff; }}
main {{ display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 440px), 1fr));
  gap: 0 18px; align-items: start; max-width: 1700px; margin: 0 auto; padding: 0 8px 24px; }}
h1 {{ font-size: 19px; margin: 12px 16px 4px; }}
footer {{ padding: 10px 16px 30px; font-size: 13px; line-height: 1.5; }}
code {{ overflow-wrap: anywhere; white-space: pre-wrap; }}
p {{ max-width: 68ch; font-size: 14px; line-height: 1.5; }}
</style>
{bokeh}
</head><body>
<h1>{title}</h1>
<main><div><div id="player"></div>{words}</div><div>{plots}</div></main>
<footer>Made with granforce. The same networks in a terminal: <code>{command}</code><br>
This view on a server of granforce: <code>?{link}</code><br>{left_out}</footer>
{script}
<script type="module">
{code}
begin({given}, {style})
</script>
</body></html>
"""


def html(
    library: Library,
    cell: Cell,
    replay: Replay,
    exact: xr.Dataset | None,
    shown: Mapping[str, Any] = NOTHING,
    *,
    view: View,
    link: str,
    command: str,
    source: str,
    job: Job,
    narrowed: Narrowed | None = None,
) -> bytes:
    """The file's bytes. view: parameters of AppState by name; job: computes the outline of S.

    exact: without known forces, narrowed: with them; shown: loads, reduction, measured, pins and
    thrust, as for the player.
    """
    intervals = exact_intervals(exact if narrowed is None else narrowed.after, replay)
    thinned_replay = thinned(replay, view["frame"])
    plane, outlined = planes.principal(thinned_replay), None
    if replay.summary["dimension"] > 0:
        outlined = planes.outline(library, cell, thinned_replay, plane)(job)
    job.begin("making the page")
    figures = still.figures(library, thinned_replay, exact, plane, outlined, view, narrowed)
    # In a separate document: otherwise Bokeh adds the scripts of a page that is being served.
    bare = Document()
    for figure in figures:
        bare.add_root(figure)
    script, plots = components(figures)
    number = replay.number[min(view["frame"], len(replay.number) - 1)]
    frame = int(np.flatnonzero(thinned_replay.number == number)[0])
    same = ("contact", "colour", "thickness", "full", "stretch", "scale", "paused")
    names = set(Player.param) - set(Scripted.param)
    given = {name: Player.param[name].default for name in names}
    given |= {name: view[name] for name in same}
    given |= shown
    rest = still.at_rest(library, replay, exact, view, loads=given["loads"], narrowed=narrowed)
    given |= {
        "walk": frames(thinned_replay),
        "exact": intervals,
        "most": full_colour(rest),
        "palettes": palettes(False),
        "legend": legend(rest) + (THRUST if given["thrust"] else ""),
        "source": source,
        "frame": frame,
        "tab": "intervals",
        "wide": True,  # force space is beside the intervals
    }
    left = len(replay.normal) - len(thinned_replay.normal)
    whole = explanation.of_all(replay, exact)
    text = PAGE.format(
        title=escape(f"Force space: {source}"),
        # Not render(), which also names files of all of Panel's models.
        bokeh="".join(
            f"<script>{text}</script>"
            for text in Resources(mode="inline", components=["bokeh"]).js_raw
        ),
        words=explanation.summary_html(whole) + explanation.more(whole),
        plots="".join(plots),
        script=script,
        command=escape(command),
        link=escape(link),
        left_out=f"{left} networks, evenly spaced, are left out to keep this file small."
        if left
        else "",
        style=_script("".join(Player._stylesheets)),
        given=_script({name: _plain(value) for name, value in given.items()}),
        code=module(Path(__file__).with_suffix(".js")),
    )
    return text.encode()


def thinned(replay: Replay, frame: int) -> Replay:
    """A Replay of at most FRAME_BYTES; frame: one that is kept, as the first is."""
    count, contacts = replay.normal.shape
    pick = evenly(count, contacts, FRAME_BYTES)
    if len(pick) == count:
        return replay
    if 0 < frame < count:
        pick[1 + np.abs(pick[1:] - frame).argmin()] = frame
    rows: dict[str, Any] = {
        name: np.ascontiguousarray(getattr(replay, name)[pick])
        for name in ("normal", "tangential", "number", "residual")
    }
    growth = {name: values[pick] for name, values in replay.growth.items()}
    return replay._replace(**rows, growth=growth)


def _plain(value: Any) -> Any:
    """Arrays as base64 with their type, everything else in JSON types."""
    if isinstance(value, dict):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, np.ndarray):
        whole = np.issubdtype(value.dtype, np.integer) or value.dtype == bool
        packed = np.ascontiguousarray(value, dtype="<i4" if whole else "<f4")
        kind = "Int32Array" if whole else "Float32Array"
        return {"array": kind, "data": base64.b64encode(packed.tobytes()).decode()}
    return value.item() if isinstance(value, np.generic) else value


def _script(value: Any) -> str:
    """JSON that is safe inside a script."""
    return json.dumps(value, ensure_ascii=False).replace("</", "<\\/")
