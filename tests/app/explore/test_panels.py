"""What the tabs beside the packing show, without a browser."""

import gzip
import io
import json
import re
import threading
import warnings
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
import zarr
from bokeh.document import Document
from bokeh.io.doc import patch_curdoc
from bokeh.models import CustomJS
from packings import REFERENCE, packed, skewed
from panel import Column
from panel.pane import HTML, Bokeh
from param.parameterized import discard_events
from small_store import DISKS, KEPT, ROOT, STATES
from visitor import drop, press, wait_for

import granforce as gf
from app.background.jobs import WAITING, Job
from app.background.limits import Limits
from app.browser.messages import fits
from app.explore import results_line
from app.explore.controls import Controls
from app.explore.explanation import summary_html
from app.explore.result_values import between
from app.explore.results_line import Results
from app.explore.tabs.export import export as export_view
from app.explore.tabs.export import files, standalone
from app.explore.tabs.force_space import force_space as plane_view
from app.explore.tabs.friction import friction as statistics_view
from app.explore.tabs.friction.claims import SAMPLERS
from app.explore.tabs.friction.study_figures import BELOW
from app.explore.tabs.intervals import intervals as intervals_view
from app.explore.tabs.intervals.growth_figure import GrowthFigure
from app.explore.tabs.intervals.known_forces import Known
from app.explore.tabs.push import push as perturb_view
from app.explore.tabs.push.over_packings import responses
from app.explore.tabs.tabs import Tabs
from app.explore.tabs.your_packing import samples
from app.explore.tabs.your_packing import upload as upload_view
from app.packing.player import Player, frames
from app.results import (
    distributions,
    durations,
    photoelastic_frames,
    planes,
    study_data,
    uploads,
)
from app.results.library import Library
from app.results.replays import first_replay
from app.results.saved_file import csv
from app.state import app_state, perturbations
from app.state.app_state import AppState
from app.state.links import link, read_link
from app.state.scene_links import request_of
from app.widgets import label_places
from app.widgets.file_drop import Dropper
from app.widgets.plot_style import lines
from granforce import measures
from granforce.labelled import CONTACT_LABELS
from granforce.measures import statistics
from granforce.packing.neighbours import find_pairs
from granforce.packing.scenes import scene
from granforce.paper.claims.table import TOPICS
from granforce.paper.claims.verdicts import SYMBOLS
from granforce.records import InputError
from granforce.study import cells as study
from granforce.study import kinds
from granforce.tolerances import LISTED_TOUCHING

LAMMPS = REFERENCE.parent / "lammps"


def npz(packing):
    file = io.BytesIO()
    gf.save_packing(packing, file)
    return file.getvalue()


def table(packing, contacts=False):
    """CSV of grains or contacts with forces, as others would write them."""
    if contacts:
        c = packing.contacts
        names, columns = "i,j,nx,ny,length,fn,ft", (c.i, c.j, c.normal, c.length, packing.forces)
    else:
        names, columns = "x,y,r", (packing.x, packing.r)
    file = io.StringIO()
    np.savetxt(file, np.column_stack(columns), "%.17g", ",", header=names, comments="")
    return file.getvalue().encode()


def dumps():
    return {
        part: (f"{part}.dump", (LAMMPS / f"lammps_n400_mu0.3.{part}.dump").read_bytes())
        for part in ("particles", "contacts")
    }


# Force space


def test_the_path_is_where_the_states_lie_in_the_plane(state):
    replay = state.replay
    plane = planes.components(replay, (3, 0), (5, 1))
    np.testing.assert_array_equal(plane.path[:, 0], replay.normal[:, 3])
    np.testing.assert_array_equal(plane.path[:, 1], replay.tangential[:, 5])
    plane = planes.principal(replay)
    assert plane.path.shape == (KEPT + 1, 2)
    np.testing.assert_allclose(plane.path[1:].mean(axis=0), 0, atol=1e-5)
    variance = plane.path[1:].var(axis=0)
    frames = np.stack([replay.normal, replay.tangential], axis=2)[1:]
    np.testing.assert_allclose(variance / frames.var(axis=0).sum(), plane.share, rtol=1e-4)


def test_the_outline_holds_the_path_and_is_kept(state):
    state.looks.axes = "principal"
    view = plane_view.View(state)
    assert not view.drawing.path.data["x"] and not view.task.running  # hidden: nothing is computed
    state.looks.tab = view.name
    assert view.placing.running
    wait_for(state)
    assert len(view.drawing.path.data["x"]) == KEPT + 1
    corners = np.stack([view.drawing.outer.data["x"], view.drawing.outer.data["y"]], axis=1)
    path = np.stack([view.drawing.path.data["x"], view.drawing.path.data["y"]], axis=1)
    merged = np.concatenate([corners, path])
    assert planes.area(merged) == pytest.approx(planes.area(corners), rel=1e-6)
    assert "linear programs" in view.details.object
    assert len(state.library.cache.find("outline")) == 1


def test_one_contact_is_seen_in_its_cone(state):
    state.looks.contact = 4
    view = plane_view.View(state)
    view.planes.value = "contact"
    state.looks.tab = view.name
    wait_for(state)
    normal, tangential = (
        np.array(view.drawing.outer.data["x"]),
        np.array(view.drawing.outer.data["y"]),
    )
    assert np.all(np.abs(tangential) <= state.replay.summary["mu"] * normal + 1e-3)
    assert str(state.replay.backbone[4]) in view.drawing.figure.xaxis.axis_label
    assert len(view.drawing.cone.data["x"]) == 3
    before = normal
    state.looks.contact = 7
    wait_for(state)
    assert not np.array_equal(before, view.drawing.outer.data["x"])


def test_a_point_has_no_outline(state):
    state.choose(mu=0)
    wait_for(state, lambda: state.cell.mu == 0)
    state.looks.tab = "plane"
    view = plane_view.View(state)
    wait_for(state)
    assert "one point" in view.details.object and not len(view.drawing.outer.data["x"])


def test_planes_of_unknown_contacts_are_refused(state):
    replay = state.replay
    with pytest.raises(InputError, match="counted from 0"):
        planes.components(replay, (10**6, 0), (0, 0))
    with pytest.raises(InputError, match="different"):
        planes.components(replay, (1, 0), (1, 0))


def test_areas():
    square = np.array([[0, 0], [2, 0], [2, 2], [0, 2], [1, 1]], float)
    assert planes.area(square) == 4
    line = np.array([[0, 0], [1, 1], [2, 2]], float)
    assert planes.area(line) == 0


# Bring your own


@pytest.mark.parametrize("kind", ["npz", "lammps", "table", "table with contacts"])
def test_files_are_known_by_their_content(kind):
    packing = packed(30, 0.3)
    given = {
        "npz": {"npz": ("a", npz(packing))},
        "lammps": dumps(),
        "table": {"grains": ("g.txt", table(packing))},
        "table with contacts": {
            "grains": ("g.txt", table(packing)),
            "joined": ("c.txt", table(packing, contacts=True)),
        },
    }[kind]
    files = uploads.added({}, list(given.values()))
    assert files == given and uploads.missing(files) == []
    options = {} if kind == "npz" else {"mu": 0.3}
    if "table" in kind:
        options["box"] = packing.box
    read = uploads.read(files, **options)
    if kind == "npz":
        np.testing.assert_array_equal(read.forces, packing.forces)
    elif kind == "lammps":
        assert len(read.r) == 400
    elif kind == "table with contacts":
        np.testing.assert_allclose(read.forces, packing.forces, rtol=1e-9)
    else:
        touching = find_pairs(packing.x, packing.r, packing.cell, LISTED_TOUCHING)[0]
        assert len(read.contacts.i) == len(touching) >= len(packing.contacts.i)


def test_disks_without_a_box_ask_for_it(state):
    """A table of disks alone is no error: what holds them is still to be said."""
    packing = state.library.packing(state.cell.params["packing"])
    view = upload_view.View(state)
    view.mu.value = "0.1"
    view._dropped([("disks.csv", table(packing))])
    assert view.waiting.visible and "Enter the sides" in view.waiting.title
    assert view.box.visible and view.read.visible and not view.box.error_state
    assert not view.error.visible and not view.task.running
    view.box.value = ", ".join(map(repr, map(float, packing.box)))
    press(view.read)
    wait_for(state, lambda: "disks.csv" in view.report.object)
    assert not view.waiting.visible


def test_disks_on_a_floor_need_walls_and_gravity(state):
    """Each option without use is refused, in words of the page; exact bounds follow."""
    view = upload_view.View(state)
    heap = b"x,y,r\n0.5,0.5,0.5\n1.5,0.5,0.5\n1,1.3660254037844386,0.5\n"
    view._dropped([("heap.csv", heap)])
    assert view.around.visible and view.gravity.visible
    view.around.value = "floor"
    press(view.read)
    assert "Gravity" in view.waiting.title and not view.task.running
    view.gravity.value, view.pressure.value = "1", "2"
    press(view.read)
    assert "leave it empty" in view.error.title and not view.task.running
    view.pressure.value, view.box.value = "", "2, 3"
    press(view.read)
    wait_for(state, lambda: view.error.visible)
    assert "leave out the box" in view.error.title
    view.box.value, view.around.value = "", ""
    press(view.read)
    wait_for(state, lambda: view.error.visible)
    assert "if walls hold the grains, give them" in view.error.title
    assert "--" not in view.error.title and "walls=" not in view.error.title
    view.around.value = "floor"
    press(view.read)
    wait_for(state, lambda: state.cell.selection.imported and state.exact is not None)
    assert state.replay.summary["contacts"] == 5


def test_rounded_places_need_a_tolerance(state):
    """It is a field of the page, which its message names."""
    view = upload_view.View(state)
    view._dropped([("heap.csv", b"x,y,r\n0,1,1\n2,1,1\n1,2.73206,1\n")])
    view.around.value, view.gravity.value = "floor", "1"
    press(view.read)
    wait_for(state, lambda: view.error.visible)
    assert "a larger tolerance makes" in view.error.title and view.tolerance.visible
    view.tolerance.value = "1e-4"
    press(view.read)
    wait_for(state, lambda: state.cell.selection.imported)
    assert state.replay.summary["contacts"] == 5


def test_a_push_says_how_far_it_got(state, monkeypatch):
    """Its limit load, and loads at rest, of which the last is F_crit; and how long it can take."""
    told = []

    class Told(Job):
        def __setattr__(self, name, value):
            super().__setattr__(name, value)
            if name == "stage" and "_wants" in vars(self):
                told.append(self.words)

    monkeypatch.setitem(durations._seconds, "perturbation", 1e6)  # however busy the machine
    job = Told(lambda job: None)
    assert job.wait(60)
    pushed = perturbations.push(state.library, state.cell, state.replay, 4)(job)
    words = f"at rest under {pushed.low:.3f} ⟨fₙ⟩, limit load {pushed.limit:.3f} ⟨fₙ⟩"
    assert any(words in line for line in told) and len(set(told)) > 5
    computing = [line for line in told if "at rest under" in line]
    assert all(" — up to " in line for line in computing)


def test_a_small_computation_does_not_change_what_a_large_one_is_said_to_take():
    few, many = ({"packing": {"n": n}, "states": n} for n in (30, 400))
    before = durations.seconds("walk", many)
    with durations.expected(SimpleNamespace(begin=lambda *stage, **options: None), "", "walk", few):
        pass
    assert durations.seconds("walk", many) == before


def test_the_sampler_is_chosen_beside_the_networks(state):
    known = Known(state)
    assert known.sampler == state.cell.kind == "walk"
    known.hear({"sampler": "uniform"})
    wait_for(state)
    assert known.sampler == state.cell.kind == "uniform" and state.cell.mu == 0.1


def test_a_packing_without_stress_in_one_direction_has_a_warning(state):
    """A row of disks that touches its images, in a box with room above."""
    view, results = upload_view.View(state), Results(state)
    assert "bears no" not in results.html
    view._dropped([("row.csv", b"x,y,r\n0.5,0.5,0.5\n1.5,0.5,0.5\n2.5,0.5,0.5\n")])
    view.box.value = "3, 30"
    press(view.read)
    wait_for(state, lambda: state.cell.selection.imported)
    assert "bears no vertical stress" in results.html


def test_a_packing_without_forces_follows_the_friction(state):
    """Six disks of which three carry at μ = 0.3, and all at μ = 1; nothing is said of packing."""
    high = 3**0.5
    places = [(0.5, 0.5), (1.5, 0.5), (2.5, 0.5), (1, 0.5 + high / 2), (2, 0.5 + high / 2)]
    places.append((1.5, 0.5 + high))
    rows = "".join(f"{x!r},{y!r},0.5\n" for x, y in places)
    view, results, controls = upload_view.View(state), Results(state), Controls(state)
    bars = intervals_view.View(state)
    assert "as packed" in bars.lead.object and controls.scene.shown == "many"
    view._dropped([("six.csv", b"x,y,r\n" + rows.encode())])
    view.box.value = f"3, {1 + high!r}"
    press(view.read)
    wait_for(state, lambda: state.cell.selection.imported)
    assert "bears no vertical stress" in results.html and "<b>0.3</b>" in view.report.object
    assert controls.scene.shown == "imported"
    controls.mu.mu = 1.0
    wait_for(state, lambda: state.cell.mu == 1.0)
    assert state.replay.summary["dimension"] == 2 and "bears no" not in results.html
    report = dict(re.findall("<td[^>]*>([^<]*)</td><td><b>([^<]*)", view.report.object))
    assert [report[name] for name in ("friction μ", "dimension h of S")] == ["1", "2"]
    assert report["loose disks"] == "0"
    assert "as packed" not in bars.lead.object + bars.drawing.figure.xaxis[0].axis_label
    assert bars.drawing.packed.glyph.size == 0
    assert "force at the start" in bars.sorts.options


def test_an_unbounded_set_says_why_values_are_missing_and_what_the_page_has_for_it(state):
    """Twelve disks on a floor between two walls, five of them wedged between these."""
    places = [
        (k + 0.5 + row / 2, 0.5 + row * 0.75**0.5) for row in range(3) for k in range(5 - row)
    ]
    rows = "".join(f"{x!r},{y!r},0.5\n" for x, y in places)
    view, results = upload_view.View(state), Results(state)
    view._dropped([("heap.csv", b"x,y,r\n" + rows.encode())])
    view.around.value, view.gravity.value, view.mu.value = "box", "1", "0.5"
    assert not view.box.error_state and Controls(state).n.value == DISKS
    press(view.read)
    wait_for(state, lambda: state.cell.selection.imported)
    assert Controls(state).n.value == 12 and "These 12 disks" in summary_html(state.replay)
    told = re.sub("<[^>]*>", "", results.html)
    assert "S is unbounded" in told and "∞" in told and "measure" not in told
    assert "not mixed" in told and "more networks" not in told
    assert "– (open box)" in told and "φ –" not in told.replace("packing fraction", "")
    state.knowledge.rank()
    wait_for(state)
    assert "wedged" in state.work.message and "--" not in state.work.message
    assert "press H" in state.work.message


@pytest.mark.parametrize("contacts", [False, True])
def test_tables_of_tilted_boxes_are_read(state, contacts):
    """Sides and tilt are typed in one field."""
    packing = skewed(packed(30, 0.3))[0]
    view = upload_view.View(state)
    view.files = {"grains": ("g.txt", table(packing))}
    if contacts:
        view.files["joined"] = ("c.txt", table(packing, contacts=True))
    view.box.value = ", ".join(map(repr, [*packing.box.tolist(), packing.tilt]))
    press(view.read)
    wait_for(state, lambda: state.selection.imported or view.error.visible)
    read = state.library.packing(state.selection.packing)
    assert read.tilt == packing.tilt and len(read.contacts.i) >= len(packing.contacts.i)
    for wrong, message in (
        ("30", "two sides"),
        ("30 30 far", "number"),
        ("30 30 1 2", "two sides"),
    ):
        view.box.value = wrong
        press(view.read)
        assert message in view.error.title and not view.task.running


def test_a_file_of_another_family_replaces_what_was_there():
    both = dumps()
    files = uploads.added({}, [both["particles"]])
    assert uploads.missing(files) == ["contacts"]
    files = uploads.added(files, [("p.npz", npz(packed(30, 0.3)))])
    assert list(files) == ["npz"]


@pytest.mark.parametrize(
    "content, line",
    [
        (b"", "neither an NPZ"),
        (b"\x89PNG\r\n\x1a\n" + bytes(200), "neither an NPZ"),
        (b"a,b,c\n1,2,3\n", "columns x, y, r"),
        (b"ITEM: TIMESTEP\n0\n", "without ATOMS or ENTRIES"),
        (gzip.compress(b"ITEM: TIMESTEP\n0\n", mtime=0), "compressed; unpack it first"),
    ],
)
def test_what_is_no_packing_is_refused(content, line):
    with pytest.raises(InputError, match=line):
        uploads.added({}, [("file", content)])


def test_notes_of_a_packing_are_told(state):
    packing = packed(30, 0.3)
    noted = packing._replace(info=packing.info | {"notes": ["what was seen"]})
    job = SimpleNamespace(begin=lambda stage: None)
    brought = uploads.keep(state.library, noted, "a file")(job)
    assert uploads.report_rows(brought.report)[-1] == ("note", "what was seen")


def test_damaged_and_hostile_files_are_one_clear_line(state):
    whole = npz(packed(30, 0.3))
    hostile = {
        "cut.npz": whole[: len(whole) // 2],
        "zip.npz": b"PK\x03\x04" + bytes(300),
        "../../etc/passwd": whole[:-50],
    }
    for name, content in hostile.items():
        with pytest.raises(InputError, match="NPZ archive") as told:
            uploads.read({"npz": (name, content)})
        assert "\n" not in str(told.value)


def test_sizes_are_limited():
    packing = packed(30, 0.3)
    limits = Limits(n=20, upload=1)
    with pytest.raises(InputError, match="30 grains; at most 20 are supported"):
        uploads.read({"npz": ("p.npz", npz(packing))}, limits=limits)
    with pytest.raises(InputError, match="at most 1 MB"):
        uploads.added({}, [("g.csv", b"x,y,r\n" + b"1,1,1\n" * 200_000)], limits)
    # Zeros pack a thousandfold: what counts is what they unpack to.
    large = io.BytesIO()
    np.savez_compressed(large, x=np.zeros((10**6, 2)))
    with pytest.raises(InputError, match="MB unpacked"):
        uploads.read({"npz": ("zeros.npz", large.getvalue())}, limits=limits)


def test_bodies_of_a_file_are_drawn_as_they_are():
    """Their outlines about their centres, all within the view, and lines through their contacts."""
    wall = scene("wall")
    replay = first_replay(gf.ensemble(uploads.read({"npz": ("wall.npz", npz(wall))})), 1)
    drawn = frames(replay)
    outlines = [np.reshape(flat, (-1, 2)) for flat in drawn["outlines"]]
    corners = np.concatenate([a + b for a, b in zip(outlines, wall.x, strict=True)])
    assert np.allclose(corners, wall.shapes.corners)
    (left, right, bottom, top), unit = drawn["window"], drawn["unit"]
    assert np.all((corners > [left, bottom]) & (corners < [right, top]))
    assert right - left < 1.2 * np.ptp(corners[:, 0]) and unit < 0.1 * wall.r[-1]
    middles = np.reshape(drawn["starts"] + drawn["reach"] / 2, (-1, 2))
    assert np.allclose(middles, wall.contact_points[replay.backbone])


def test_walls_of_disks_are_lines_and_chains_end_at_them():
    """A floor and two sides at the extent of the disks; what stands behind them is no disk."""
    heap = gf.from_disks([[1, 1], [3, 1], [2, 1 + 3**0.5]], np.ones(3), 0.3, walls="box", gravity=1)
    drawn = frames(first_replay(gf.ensemble(heap), 1))
    assert len(drawn["centres"]) == 2 * 3
    sides = np.reshape(drawn["walls"], (3, 4))
    assert np.allclose(sides[0], [0, 0, 4, 0]) and np.allclose(sides[1:, 0], [0, 4])
    at_wall = drawn["j"] >= 3
    ends = np.reshape(drawn["starts"] + drawn["reach"], (-1, 2)).T[:, at_wall]
    assert at_wall.sum() == 4 and np.all(np.isclose(ends[1], 0) | np.isclose(ends[0] % 4, 0))


@pytest.mark.parametrize(
    "name, content",
    [
        ("a.csv", samples.sample("bodies")[0].content),
        (
            "a.json",
            b'{"bodies": [{"disk": [0, 1, 1]}, {"corners": [[-1, -1], [2, 0], [-1, 0]], '
            b'"fixed": true}]}',
        ),
    ],
)
def test_a_file_of_bodies_is_read(name, content):
    files = uploads.added({}, [(name, content)])
    assert not uploads.missing(files) and not uploads.loose(files)
    assert len(uploads.read(files, mu=0.5).shapes.sides) == 2


@pytest.mark.parametrize("name", upload_view.SAMPLES)
def test_a_sample_is_handed_over_and_read(state, name):
    """That of disks needs what its button says."""
    view, handed = upload_view.View(state), []
    view.samples.tell = handed.append
    view.samples.hear({"key": name})
    wait_for(state)
    files = uploads.added({}, [(file["name"], file["content"]) for file in handed])
    assert not uploads.missing(files) and uploads.loose(files) == (name == "disks")
    if name == "photoelastic":
        found = photoelastic_frames.infer(files, mu=0.3, walls=None, reverse=False)
        assert len(found(Job(lambda job: None)).packing.r) == 12
    else:
        held = {"walls": "floor", "gravity": 1.0} if name == "disks" else {}
        S = gf.ensemble(uploads.read(files, mu=float(view.mu.value), **held))
        assert S.dimension > 0 and np.isfinite(gf.intervals(S).high).all()


def test_a_scene_of_bodies_has_a_link_and_is_made_where_it_is_opened(tmp_path):
    found, _ = read_link("?scene=arch")
    assert found.mu == 0.6 and read_link(link(found, {}))[0] == found
    assert request_of("?scene=arch&mu=0.5").query == "?scene=arch&mu=0.5"
    made, _ = kinds.get_packing(Library(tmp_path, tmp_path / "cache").cache, found.packing)
    assert np.array_equal(made.x, scene("arch").x)


def test_an_upload_is_kept_reported_and_shown(state, monkeypatch):
    monkeypatch.setattr(upload_view, "STATES", 5)
    monkeypatch.setattr(app_state, "EXACT_FOLLOW", 0)
    view = upload_view.View(state)
    both = dumps()
    drop(view.dropper, [("a", both["particles"][1])])
    assert view.waiting.visible and "dump of the contacts" in view.waiting.title
    middle = len(both["contacts"][1]) // 2
    pieces = both["contacts"][1][:middle], both["contacts"][1][middle:]
    drop(view.dropper, [("<b>c", piece) for piece in pieces])
    assert view.task.running and not view.waiting.visible
    wait_for(state, lambda: state.cell is not None and state.cell.selection.imported)
    assert "604" in view.report.object and "&lt;b&gt;c" in view.report.object
    assert state.replay.summary["contacts"] == 604 and state.work.message == ""


def test_a_refused_upload_changes_nothing(state):
    before = state.replay
    view = upload_view.View(state)
    drop(view.dropper, [("p.npz", npz(packed(30, 0.3))[:-80])])
    wait_for(state)
    assert view.error.visible and "NPZ archive" in view.error.title
    assert state.replay is before and not state.library.cache.exists


def test_more_than_allowed_is_not_collected(state):
    view = upload_view.View(state)
    view.dropper.most = 1000
    view.dropper.hear({"begin": True})
    for _ in range(50):
        view.dropper.hear({"name": "x", "data": bytes(100)})
    assert not view.dropper._files
    view.dropper.hear({"end": True})
    assert "nothing was read" in view.error.title and not view.files


@pytest.mark.parametrize(
    "pieces, word",
    [
        ([{"name": f"{k}", "data": b""} for k in range(1000)], "16 files"),
        ([{"name": "a", "data": 7}, {"name": "b", "data": b"x,y,r"}], "not a file"),
        ([{"name": "a", "data": {"deep": [1]}}], "not a file"),
    ],
)
def test_a_drop_of_nothing_but_names_is_not_collected(state, pieces, word):
    view = upload_view.View(state)
    view.dropper.hear({"begin": True})
    for piece in pieces:
        view.dropper.hear(piece)
    assert not view.dropper._files
    view.dropper.hear({"end": True})
    assert word in view.error.title and "nothing was read" in view.error.title and not view.files


def test_empty_pieces_take_no_memory():
    taken = []
    drop(Dropper(taken.append, pytest.fail, most=1000), [("a" * 10_000, b"")] * 1000)
    assert taken == [[("a" * 120, b"")]]


# Statistics


def test_rows_are_those_of_the_study_and_unlike_cells_stay_out(state):
    cells = distributions.alike(state.catalogue, state.cell)
    assert [cell.mu for cell in cells] == [0, 0.1, 1]
    found = distributions.rows(cells)
    for cell, row in zip(cells, found, strict=True):
        dataset, _ = study.get(cell.store, kinds.WALK, cell.params)
        assert row["eta2"] == dataset["eta2"].item() and row["mu"] == cell.mu
        extent = measures.normal_extent(dataset["low"].values, dataset["high"].values)
        np.testing.assert_allclose(
            row["extent"] * dataset["force_scale"].item(), extent, rtol=1e-14
        )
    other = cells[1]._replace(selection=cells[1].selection._replace(states=7))
    assert distributions.alike([*cells, other], cells[0]) == cells
    seed = cells[1].selection._replace(packing=cells[1].selection.packing | {"seed": 99})
    assert len(distributions.alike([*cells, cells[1]._replace(selection=seed)], cells[0])) == 4


def test_groups_spread_over_mu_and_hold_the_one_on_screen():
    found = [{"mu": mu, "extent": np.full(3, mu)} for mu in (0, 0.1, 0.2, 0.3, 0.5, 1, 2, 5, 10)]
    chosen = distributions.groups(found, 0.3)
    assert 0.3 in chosen and 0 not in chosen and len(chosen) == distributions.MOST_CURVES
    assert min(chosen) == 0.1 and max(chosen) == 10


def friction_tab(state):
    """The tab Friction, drawn."""
    state.looks.tab = "statistics"
    view = statistics_view.View(state)
    wait_for(state, lambda: view.scatter is not None)
    return view


def drawn_points(column):
    """Every number that the figures of a column hold."""
    found = [r.data_source.data for pane in column.select(Bokeh) for r in pane.object.renderers]
    numbers = [np.ravel(v) for c in found for v in c.values() if np.ravel(v).dtype.kind != "U"]
    return np.concatenate(numbers).astype(float)


def test_nothing_of_friction_is_computed_before_it_is_seen(state):
    view = statistics_view.View(state)
    assert not view.task.running and not view.figures[0].objects


def test_figures_of_the_paper_are_there_at_once_with_the_packing_on_screen(state):
    view = friction_tab(state)
    row = distributions.rows([state.cell])[0]
    wanted = {0: row["eta2"], 2: row["correlation"]}
    for k, column in enumerate(view.figures):
        points = drawn_points(column)
        assert len(points) > 5 and (k not in wanted or np.isclose(points, wanted[k]).any())
    here = view.indeterminacy.etas.marks.data
    assert list(here["x"]) == [0.1] * 3
    np.testing.assert_allclose(here["y"], [row["eta1"], row["eta2"], 0.15 * row["eta3"]])
    assert list(view.indeterminacy.z.marks.data["y"]) == [row["coordination"]]


def test_friction_is_drawn_although_the_catalogue_lacks_the_cell_on_screen(state):
    state.catalogue = [cell for cell in state.catalogue if cell.mu != state.cell.mu]
    view = friction_tab(state)
    assert state.work.message == "" and state.cell.mu in view.indeterminacy.etas.marks.data["x"]


def test_figure_1_is_drawn_from_the_networks_chosen(state):
    view = friction_tab(state)
    for sampler, words in (("sweeps_1e-3", "the paper’s walk"), ("walk", "nearest-network walk")):
        state.looks.sampler = sampler
        wait_for(state, lambda name=sampler: view.indeterminacy.sampler == name)
        points = statistics.means(study_data.in_force_space(sampler), "eta2")
        drawn = drawn_points(view.figures[0])
        assert all(np.isclose(drawn, value).any() for mu, value, _ in points if mu > 0)
        assert words in view.first.object
        assert ("sampler=walk" in state.link()) == (sampler == "walk")
    top = view.indeterminacy.etas.figure.y_range.end
    assert all(value < BELOW * top for mu, value, _ in points if 0 < mu < 1e-3)  # under the inset


def test_what_is_said_of_friction_is_made_from_the_study(state):
    view = friction_tab(state)
    for name, words in (("eta1", "η₁"), ("eta2", "η₂"), ("eta3", "0.15 η₃ seen")):
        walks = study_data.in_force_space("sweeps_1e-3")
        points = statistics.means(walks, name, factor=0.15 ** (name == "eta3"))
        mu, *largest = max(points, key=lambda point: point[1])
        shown = re.search(rf"{words} ([\d.]+) ± ([\d.]+)", view.first.object)
        assert [float(number) for number in shown.groups()] == pytest.approx(largest, abs=6e-5)
        assert f"at μ = {mu:g}" in view.first.object
    told = view.details.object
    assert "geometric mean of the ratio" in told and "✓ if " in told
    assert all(f"{mark} {words}" in told for words, mark in list(SYMBOLS.items())[:4])
    assert "η<sub>1</sub>" in told and "F<sub>n</sub>" in told and "F_n" not in told
    every = json.loads((ROOT / "data" / "claims.json").read_text())["claims"]
    shown = [claim["id"] for figure in TOPICS for claim in study_data.claims(figure)]
    assert sorted(shown) == sorted(claim["id"] for claim in every)  # each once
    ((most, _),) = Counter(claim["sampler"] for claim in every).most_common(1)
    judged = f"judged by what is named below each, mostly {SAMPLERS[most]}."
    assert judged in told and "show nearest-network walks" in told
    pushed = len(study_data.claims(2))
    assert told.count("<tr><td>") == len(every) - pushed > 20


def test_a_tap_on_a_point_opens_such_a_packing_or_computes_it(state):
    view = friction_tab(state)
    points = view.indeterminacy.etas.points[0].data_source
    rings = []
    state.param.watch(lambda event: rings.extend(view.indeterminacy.etas.marks.data["x"]), "replay")
    points.selected.indices = [list(points.data["x"]).index(1)]
    wait_for(state, lambda: list(view.indeterminacy.etas.marks.data["x"]) == [1, 1, 1])
    assert state.cell.mu == 1 and not state.missing  # the store has it
    assert not rings  # the old ring was removed as the new packing appeared
    points.selected.indices = [list(points.data["x"]).index(0.3)]
    assert state.selection.mu == 0.3 and state.work.computation.running
    state.work.cancel()


def test_a_tap_on_a_dot_selects_its_contact(state):
    view = friction_tab(state)
    view.scatter.figure.renderers[0].data_source.selected.indices = [5]
    assert state.looks.contact == 5
    assert list(view.scatter.chosen.data["x"]) == [state.replay.normal[0, 5]]


# Export


def test_the_table_of_contacts_holds_what_is_on_screen(state):
    replay = state.replay
    state.compute_exact()
    wait_for(state, lambda: state.exact is not None)
    table = csv(files.contacts(replay, state.exact, 3)).decode().splitlines()
    names = table[0].split(",")
    rows = np.array([line.split(",") for line in table[1:]], dtype=float)
    column = dict(zip(names, rows.T, strict=True))
    assert len(rows) == replay.summary["contacts"] and "." not in table[1].split(",")[0]
    np.testing.assert_allclose(column["f_n [mean]"], replay.normal[3], rtol=1e-6)
    assert np.all(column["f_n_low [mean]"] <= column["f_n_seen_low [mean]"] + 1e-6)
    assert np.all(column["f_n_seen_high [mean]"] <= column["f_n_high [mean]"] + 1e-6)
    gap = state.exact["interval_gap"].values[:, 0, 0]
    zero = np.abs(state.exact["low"].values[:, 0] / replay.force_scale) <= gap
    assert zero.any() and not column["f_n_low [mean]"][zero].any()
    assert "-0" not in {cell for line in table[1:] for cell in line.split(",")}
    packing = state.library.packing(state.cell.params["packing"])
    place = column["contact"].astype(int)
    np.testing.assert_array_equal(column["i"], packing.contacts.i[place])
    np.testing.assert_array_equal(column["j"], packing.contacts.j[place])
    for name, values in (("n", packing.contacts.normal), ("", packing.contact_points)):
        for k, axis in enumerate("xy"):
            written = column[f"{name}_{axis}" if name else axis]
            np.testing.assert_allclose(written, values[place, k], rtol=1e-8, atol=1e-8)
    assert not column["wall"].any()


@pytest.mark.parametrize("name", ["box", "arch"])
def test_the_table_of_contacts_says_which_are_with_walls_like_the_library(name):
    packing = gf.scene(name)
    S = gf.ensemble(packing)
    columns = files.contacts(first_replay(S, 1), None, 0)
    table = gf.to_dataframe(gf.intervals(S), S)
    for column in CONTACT_LABELS:
        np.testing.assert_allclose(columns[column], table[column])
    fixed = packing.are_walls
    ends = fixed[packing.contacts.i] | fixed[packing.contacts.j]
    np.testing.assert_array_equal(columns["wall"], ends[S.index])
    assert columns["wall"].any()


@pytest.mark.parametrize("kind", ["netcdf", "zarr"])
def test_datasets_come_back_with_packing_states_and_units(state, tmp_path, kind):
    states = state.library.dataset(state.cell)
    packing = state.library.packing(state.cell.params["packing"])
    whole = files.dataset(packing, states)
    if kind == "netcdf":
        again = xr.open_dataset(io.BytesIO(files.netcdf(whole)), engine="scipy", decode_cf=False)
    else:
        path = tmp_path / "states.zarr.zip"
        path.write_bytes(files.zarr_zip(whole))
        store = zarr.storage.ZipStore(path, mode="r")
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            again = xr.open_zarr(store, decode_cf=False)
    np.testing.assert_array_equal(again["states"].values, states["states"].values)
    np.testing.assert_array_equal(again["normal"].values, packing.contacts.normal)
    assert again["states"].attrs["units"] == "force" and again["eta2"] == states["eta2"]
    assert again.attrs["parameters"] == states.attrs["parameters"]


def test_the_packing_comes_back_to_the_last_bit(state):
    packing = state.library.packing(state.cell.params["packing"])
    again = gf.load_packing(io.BytesIO(files.npz(packing)))
    np.testing.assert_array_equal(again.x, packing.x)
    np.testing.assert_array_equal(again.forces, packing.forces)


def test_parameters_name_what_is_on_screen(state):
    told = json.loads(files.parameters(state.cell, state.link(), {"frame": 0}))
    assert told["kind"] == "walk" and told["command"].startswith("granforce walk -n 30")
    found = state.library.find("walk", told["parameters"])
    assert found.name == state.cell.name == told["entry"]


def test_every_button_hands_a_file_over(state):
    view = export_view.View(state)
    keys = [key for group in view.buttons.files.values() for key in group]
    keys.remove("motion")  # of a push
    for key in keys:
        handed = []
        view.buttons.tell = handed.append
        view.buttons.hear({"key": key})
        wait_for(state)
        shapes = view.buttons.to_browser
        assert all(any(fits(given, shape) for shape in shapes) for given in handed), key
        (file,) = (given for given in handed if "name" in given)
        assert "/" not in file["name"], key
        assert ("_network0." in file["name"]) == (key in ("svg", "png", "csv", "html")), key
        drawn = key in ("svg", "png", "webm")  # by the browser
        assert file["caption"]["lines"] if drawn else file["content"][300:]
        lines = file.get("caption", {}).get("lines", [])
        assert ("Network as packed." in lines) == (key in ("svg", "png"))
    assert len(keys) == 9


def test_the_motion_of_a_push_is_saved_once_there_is_one(state):
    view, handed = export_view.View(state), []
    view.buttons.tell = handed.append
    view.buttons.hear({"key": "motion"})
    wait_for(state, lambda: "push two disks apart" in state.work.message)
    work = perturbations.push(state.library, state.cell, state.replay, 4)
    state.looks.contact, state.pushed = 4, work(Job(lambda job: None))
    view.buttons.hear({"key": "motion"})
    wait_for(state, lambda: handed)
    head, table = handed[0]["content"].decode().split("grain,")
    assert f"contact {state.replay.backbone[4]}" in head
    motion = np.array([row.split(",") for row in table.splitlines()[1:]], dtype=float)[:, -2:]
    np.testing.assert_allclose(motion, state.pushed.displacement, rtol=1e-6)


def test_the_table_has_the_bounds_under_what_is_held_and_says_so(state):
    state.compute_exact()
    wait_for(state, lambda: state.exact is not None)
    view = export_view.View(state)

    def table():
        handed = []
        view.buttons.tell = handed.append
        view.buttons.hear({"key": "csv"})
        wait_for(state, lambda: handed)
        lines = handed[0]["content"].decode().splitlines()
        head = [line for line in lines if line.startswith("#")]
        names, *rows = (line.split(",") for line in lines[len(head) :])
        return "\n".join(head), dict(zip(names, np.array(rows, dtype=float).T, strict=True))

    head, free = table()
    assert "held" not in head and "known" not in free and "Forces are in the mean" in head
    assert "weighted by the distance" in head and "signed for f_t" in head
    state.knowledge.hold(4, float(state.replay.normal[0, 4]))
    head, early = table()  # before the bounds under it are there
    assert "still being computed" in head and "f_n_low [mean]" not in early
    wait_for(state)
    head, held = table()
    number, after = state.replay.backbone[4], state.knowledge.narrowed.after
    assert f"Held: contact {number}: fₙ = " in head and "exact given these held forces" in head
    assert list(np.flatnonzero(held["known"])) == [4] and f"hold={number}%3A" in head
    scale = state.replay.force_scale
    for name in ("low", "high"):
        found = held[f"f_n_{name} [mean]"]
        np.testing.assert_allclose(found, after[name].values[:, 0] / scale, atol=1e-6)
        unheld = held[f"f_n_{name}_without_known [mean]"]
        np.testing.assert_allclose(unheld, free[f"f_n_{name} [mean]"], atol=1e-6)
    assert np.ptp([held["f_n_low [mean]"][4], held["f_n_high [mean]"][4]]) < 1e-3
    away = np.abs(state.replay.normal[:, 4] - state.replay.normal[0, 4])
    state.looks.frame = int(np.argmax(away))
    head, played = table()  # of another network, which ignores the held force as on screen
    assert f"of {STATES}, which ignores the held forces" in head
    shown = state.replay.normal[state.looks.frame]
    np.testing.assert_allclose(played["f_n [mean]"], shown, rtol=1e-6)
    assert abs(shown[4] - played["f_n_low [mean]"][4]) > 0.01


def test_unknown_keys_are_ignored(state):
    view = export_view.View(state)
    view.buttons.hear({"key": "../secret"})
    assert not view.task.running


# Perturb


def test_a_pushed_contact_gives_way_between_its_bounds(state):
    state.looks.tab = "perturb"
    view = perturb_view.View(state)
    assert view.load.contact == state.replay.inviting
    state.looks.contact = 5
    number = state.replay.backbone[5]
    assert "begins with the network as packed" in view.lead.object  # whichever is on screen
    assert view.load.contact == 5 and not view.load.path and f"contact {number}" in view.lead.object
    view.load.hear({"push": True})
    wait_for(state, lambda: view.pushed is not None)
    pushed = view.pushed
    assert 0 < pushed.low <= pushed.high <= pushed.limit + 0.02
    numbers = view.numbers.object
    assert "F<sub>crit</sub>" in numbers and between(pushed.low, pushed.high) in numbers
    assert view.load.limit == pushed.limit
    apart = 100 * (1 - pushed.high / pushed.limit)
    assert ("up to the limit load" if apart >= 1 else "only at the limit load") in numbers
    assert f"{pushed.limit:.4g}" in numbers and len(view.plots.objects) == 1
    assert f"{pushed.opened} contacts open" in view.lead.object
    assert state.motion is None  # before the slider is at its end
    view.load.hear({"reached": True})
    assert len(pushed.size) == len(np.unique([state.replay.i, state.replay.j]))
    assert np.sqrt(np.mean(pushed.size**2)) == pytest.approx(1)
    contacts = state.replay.summary["contacts"]
    assert pushed.opened + pushed.slid + pushed.kept == contacts
    motion = state.motion
    assert motion.field is pushed.displacement and not motion.animated
    assert (np.sum(motion.contacts == 2), np.sum(motion.contacts == 1)) == (
        pushed.opened,
        pushed.slid,
    )


@pytest.mark.parametrize("name", ["intervals", "perturb", "export"])
def test_a_tab_that_opens_has_a_sentence_at_every_step(state, name):
    tabs = Tabs(state, Column())
    with discard_events(tabs.tabs):
        tabs.tabs.active = tabs.names.index(name)
    for _ in tabs._showing():
        assert any(one.object for one in tabs.pages[name] if isinstance(one, HTML))


def test_a_push_is_never_without_a_sentence_and_says_what_it_waits_for(state, library):
    nothing = AppState(library, query=None)
    nothing.looks.tab = state.looks.tab = "perturb"
    assert perturb_view.View(nothing).lead.object == nothing.nothing
    view = perturb_view.View(state)
    view.load.hear({"push": True})
    assert "In progress" in view.doing.object
    wait_for(state)
    assert not view.doing.object
    view.what.value = "store"
    assert view.lead.object and "In progress" in view.doing.object


def test_what_is_held_is_said_not_to_be_respected_by_a_push(state):
    state.looks.tab, state.looks.contact = "perturb", 5
    view = perturb_view.View(state)
    assert "respected" not in view.lead.object
    state.knowledge.hold(3, float(state.replay.normal[0, 3]))
    wait_for(state)
    assert "Held forces are ignored here" in view.lead.object
    view.what.value = "all"
    assert "ignored" in view.lead.object


def test_the_slider_of_a_push_has_networks_in_balance_from_none_to_the_critical_force(state):
    view = pushed(state)
    path, replay, low = view.load.path, state.replay, view.pushed.low
    count = len(path["values"])
    assert path["values"][0] == 0 and path["values"][-1] == pytest.approx(low)
    normal = path["normal"].reshape(count, -1)
    assert np.allclose(normal[0], replay.normal[0], atol=1e-6)
    tangential = path["tangential"].reshape(count, -1)
    assert np.all(abs(tangential) <= replay.summary["mu"] * normal + 1e-6)
    assert np.all(path["residual"] <= 1e-10)


def pushed(state):
    """The view of a push on a contact that has come to where disks move."""
    state.looks.contact, state.looks.tab = 3, "perturb"
    view = perturb_view.View(state)
    view.load.hear({"push": True})
    wait_for(state, lambda: view.pushed is not None)
    view.load.hear({"reached": True})
    return view


def test_the_field_moves_only_while_its_tab_is_seen(state):
    view = pushed(state)
    motion = state.motion
    assert motion is not None
    state.looks.tab = "intervals"
    assert state.motion is None
    state.looks.tab = "perturb"
    assert state.motion == motion
    view.animate.value = True
    assert state.motion.animated
    state.looks.contact = 4
    assert view.pushed is None and state.motion is None


def test_a_link_brings_a_push_back(state, visited, monkeypatch):
    view, number = pushed(state), state.replay.backbone
    link = state.link()
    assert f"push={number[3]}" in link and "tab=perturb" in link
    again = visited(f"?{link.replace('&tab=perturb', '').replace('select=', 'other=')}")
    assert again.looks.tab == "perturb" and again.looks.contact == 3
    shown = perturb_view.View(again)
    wait_for(again, lambda: shown.pushed is not None)
    assert (shown.pushed.low, shown.pushed.high) == (view.pushed.low, view.pushed.high)
    again.looks.contact = 4
    assert "push=" not in again.link() and shown.pushed is None
    monkeypatch.setattr(perturbations, "LIMITS", SimpleNamespace(shared=True))
    for contact, started in ((3, True), (5, False)):  # this one is in no store
        again.open(f"?{link.replace(f'push={number[3]}', f'push={number[contact]}')}")
        wait_for(again)
        assert (shown.pushed is not None) == started
        assert ("press Find" in again.work.message) == (again.looks.pushed is None) == (not started)


def test_limit_loads_of_all_contacts_bound_the_one_pushed(state):
    view = pushed(state)
    view.what.value = "all"
    assert not view.plots.objects
    press(view.every)
    wait_for(state, lambda: view.loads is not None)
    loads, drawn = view.loads
    assert loads.load[3] == pytest.approx(view.pushed.limit, abs=1e-6)
    view.plots.objects[0].object.renderers[0].data_source.selected.indices = [8]
    assert state.looks.contact == 8
    assert list(drawn.chosen.data["y"]) == [loads.load[8]]


def test_nothing_is_pushed_without_friction(state):
    state.choose(mu=0)
    wait_for(state, lambda: state.cell.mu == 0)
    state.looks.contact, state.looks.tab = 3, "perturb"
    view = perturb_view.View(state)
    assert not view.load.visible and "isostatic" in view.lead.object


def test_figure_2_takes_what_the_stores_hold(state):
    library, cells = state.library, list(state.catalogue)
    assert perturbations.over_store(library, cells, state.cell) == []
    for cell in cells[1:]:
        library.lend_packing(cell.selection.packing)
        params = kinds.PERTURBATION.parameters(
            cell.selection.packing, random=perturbations.ENOUGH_CONTACTS
        )
        study.get(library.cache, kinds.PERTURBATION, params)
    few = kinds.PERTURBATION.parameters(cells[1].selection.packing, contacts=[5])
    study.get(library.cache, kinds.PERTURBATION, few)
    found = perturbations.over_store(library, cells, state.cell)
    assert sorted(row["mu"] for row in found) == [0.1, 1]
    assert all(0 < row["critical_force"] <= row["limit_load"] for row in found)
    assert {row["eta2"] for row in found} == {row["eta2"] for row in distributions.rows(cells[1:])}
    state.looks.tab = "perturb"
    view = perturb_view.View(state)
    view.what.value = "store"
    wait_for(state)
    assert "open symbols: 2 packings" in view.details.object and len(view.plots.objects) == 2
    force = view.plots.objects[0].object
    drawn = [r.data_source.data for r in force.renderers]
    rings = [np.asarray(d["x"]) for d in drawn if "x" in d and len(d["x"]) == 2]
    assert any(np.allclose(sorted(x), sorted(row["eta2"] for row in found)) for x in rings)
    lines = [d for d in drawn if "x" in d and len(d["x"]) > 10]
    assert lines  # the finished study, all its μ


def test_states_just_computed_stay_on_screen_though_the_catalogue_does_not_list_them_yet(state):
    catalogue, cell = state.catalogue, state.cell
    assert len({cell.series for cell in catalogue}) == 1
    newer = cell._replace(series="N = 9, just computed")
    state.cell = newer
    controls = Controls(state)
    controls.series.get_root()  # as the browser is sent it
    assert state.cell is newer
    assert controls.series.value == newer.series


def test_finished_results_say_where_they_have_states_and_where_there_are_none(state):
    controls = Controls(state)
    (words,) = controls.series.options
    assert words.endswith("— 3 μ from 0 to 1") and controls.series.value == state.cell.series
    state.choose(mu=0.3)  # none there
    assert next(iter(controls.series.options)) == "none with μ = 0.3"
    assert controls.series.value == ""
    controls.series.value = state.cell.series  # back to what there is
    assert not state.missing and controls.series.value == state.cell.series
    assert "none with μ = 0.3" not in controls.series.options


def test_colours_and_widths_are_offered_once_there_is_what_they_show(state):
    player = Player(state)

    def offered(*names):
        return [f'<option value="{name}"' in player.legend for name in names]

    assert not any(offered("known"))
    state.knowledge.hold(3, float(state.replay.normal[0, 3]), 0.1)
    assert all(offered("known"))
    state.looks.thickness = "extent"  # its name stays; the scale says which intervals
    assert "⟨fₙ⟩ (seen)" in player.legend
    wait_for(state)
    assert "⟨fₙ⟩ (exact)" in player.legend
    state.knowledge.release(3)
    assert "⟨fₙ⟩ (exact)" in player.legend and ">interval ΔFₙ</option>" in player.legend
    player.colour = "known"  # chosen in the legend
    assert state.looks.colour == "known"
    state.knowledge.release(3)
    wait_for(state)
    assert '<option value="known" selected' in player.legend  # what was chosen stays


@pytest.mark.parametrize("span", [(1.0, 1.0), (4.0, 0.5)])
def test_labels_beside_points_collide_neither_with_each_other_nor_with_points(span):
    rng, count = np.random.default_rng(3), 30
    x, y = rng.uniform(0, span[0], count), rng.uniform(0, span[1], count)
    words = [f"{value:.{k % 4}g}" for k, value in enumerate(10 ** rng.uniform(-3, 1, count))]
    found = label_places.labels(x, y, words, span)
    (wide, high), side = label_places.LETTER, label_places.POINT
    room = 0.9 * np.array(label_places.SMALLEST) / span  # pixels for each unit

    def box(k):
        left, top = room[0] * found["x"][k] + found["right"][k], -room[1] * found["y"][k]
        top += found["down"][k] - (high if found["baseline"][k] == "bottom" else 0)
        width = wide * len(found["text"][k])
        left -= width if found["align"][k] == "right" else 0
        return left, top, left + width, top + high

    points = [(px - side, py - side, px + side, py + side)
              for px, py in zip(room[0] * x, -room[1] * y, strict=True)]  # fmt: skip
    boxes = [box(k) for k in range(len(found["text"]))]
    for k, a in enumerate(boxes):
        for b in [*boxes[:k], *points]:
            assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]
    assert count / 2 < len(boxes) <= count
    assert set(found["text"]) <= set(words)


def test_the_study_names_its_frictions_once(state):
    figures, _, _ = responses([])
    for fig in figures:
        (text,) = fig.select(name="frictions")
        assert len(text.data_source.data["text"]) > 8  # of 14


def test_the_inner_half_of_an_outline_has_a_quarter_of_its_area():
    corners = np.array([[0, 0], [4, 0], [5, 3], [1, 4]], float)
    points = np.random.default_rng(0).uniform(0, 5, (40_000, 2))
    edge, away = np.roll(corners, -1, axis=0) - corners, points[:, None] - corners
    inside = np.all(edge[:, 0] * away[..., 1] >= edge[:, 1] * away[..., 0], axis=1)
    assert planes.inner_share(points[inside], corners) == pytest.approx(0.25, abs=0.01)
    assert planes.inner_share(points[inside], corners[::-1]) == pytest.approx(0.25, abs=0.01)


def test_halfway_is_the_outline_at_half_its_size():
    corners = np.array([[0, 0], [4, 0], [5, 3], [1, 4]], float)
    half = planes.halfway(corners)
    assert planes.area(half) == pytest.approx(planes.area(corners) / 4)
    np.testing.assert_allclose(half, planes.halfway(corners[::-1])[::-1])


def test_axes_of_force_space_have_the_colours_of_their_lines_and_half_is_drawn(state):
    state.looks.tab = "plane"
    drawing = plane_view.View(state).drawing
    wait_for(state)
    across, up = drawing.figure.xaxis[0], drawing.figure.yaxis[0]
    assert "green" in across.axis_label and "violet" in up.axis_label
    assert (across.axis_label_text_color, up.axis_label_text_color) == lines(dark=False)
    assert len(drawing.half.data["x"]) == len(drawing.outer.data["x"]) > 3


def test_a_click_on_a_dot_of_force_space_shows_its_network(state):
    state.looks.tab = "plane"
    view = plane_view.View(state)
    wait_for(state)
    assert "Every network, and the one on screen" in view.lead.object
    view.drawing.path.selected.indices = [3]
    assert state.looks.frame == 3


def test_walk_and_uniform_states_are_shown_together(state):
    state.looks.tab = "plane"
    view = plane_view.View(state)
    wait_for(state)
    assert not view.others.switch.value and not len(view.drawing.beside.data["x"])
    assert "halfway" in view.finding.object and "uniform" not in view.finding.object
    view.others.switch.value = True
    wait_for(state)
    wait_for(state)  # the catalogue is read anew
    count = len(view.drawing.beside.data["x"])
    assert view.others.kind == "uniform" and count >= STATES
    assert f"of the {count} uniform ones" in view.finding.object
    # in the store from now on: shown at once, in any plane, and the walk beside them
    view.planes.value = "contact"
    wait_for(state)
    assert len(view.drawing.beside.data["x"]) == count
    other = planes.other_states(state.catalogue, state.cell)
    state.show(other)
    wait_for(state)
    assert state.cell.kind == "uniform" and view.others.kind == "walk"
    assert view.others.switch.value and len(view.drawing.beside.data["x"]) == KEPT
    view.others.switch.value = False
    assert not len(view.drawing.beside.data["x"])


def test_the_switch_says_what_its_networks_wait_for(state):
    view = plane_view.View(state)
    wait_for(state)
    others, label = view.others, view.others.switch.label
    begun, held = threading.Event(), threading.Event()

    def measure(job):
        job.begin("volume of S: 48 paths")
        begun.set()
        held.wait(60)

    state.work.measuring.start(measure)
    assert begun.wait(60)
    others.task.job = SimpleNamespace(stage=WAITING)  # as where no thread is free
    others._tell()
    assert others.switch.label == f"{label} – waits for: volume of S"
    others.task.job = None
    held.set()
    wait_for(state)
    assert others.switch.label == label


def test_a_page_as_a_file_has_nothing_of_pages_that_are_served_meanwhile(state):
    served = Document()
    served.js_on_event("document_ready", CustomJS(code="ofAnotherPage()"))
    view = state.view
    told = {"link": "", "command": "", "source": "", "job": Job(lambda job: None)}
    with patch_curdoc(served):
        page = standalone.html(state.library, state.cell, state.replay, None, view=view, **told)
    assert b"bk-" in page and b"ofAnotherPage" not in page
    assert not re.search(rb"<script[^>]* src=|<link [^>]*href=", page)  # files of the server


def test_a_page_as_a_file_opens_at_the_network_on_screen(state, monkeypatch):
    """Even if networks are left out of it."""
    every = state.replay
    monkeypatch.setattr(standalone, "FRAME_BYTES", every.normal[0].nbytes * 6)
    few = standalone.thinned(every, 2)
    assert 3 <= len(few.number) < len(every.number) and few.number[0] == 0
    assert every.number[2] in few.number
    state.looks.frame = 2
    page = export_view.Snapshot(state).html(Job(lambda job: None)).content.decode()
    assert f'"frame": {few.number.tolist().index(every.number[2])}' in page


def test_a_page_as_a_file_says_that_its_bounds_obey_held_forces(state):
    state.knowledge.hold(4, float(state.replay.normal[0, 4]))
    state.looks.colour = "extent"
    wait_for(state)
    page = export_view.Snapshot(state).html(Job(lambda job: None)).content.decode()
    assert "interval, exact given the held forces" in page and "interval, seen" not in page
    assert "⟨fₙ⟩ (scale of the free forces)" in page


def test_a_page_as_a_file_of_bodies_keeps_the_lines_of_thrust(visited):
    state = visited("?scene=arch&states=3")
    wait_for(state)
    page = export_view.Snapshot(state).html(Job(lambda job: None)).content.decode()
    assert '"thrust": {"a": [' in page and "where the resultant of a joint can pass" in page
    assert '"outlines": [[' in page
    state.replay.summary["rattlers"] = 2
    assert ">loose bodies<" in results_line.results(state)


def test_the_exact_eta3_is_a_named_line_beside_its_growth(state):
    drawing = GrowthFigure()
    drawing.show(state.replay, False, None)
    (*_, entry), end = drawing.figure.legend[0].items, state.replay.number[-1]
    assert not entry.visible and drawing.exact.data["eta3"] == []
    drawing.show(state.replay, False, 0.3)
    assert entry.visible and entry.label.value.startswith("0.15 η₃ exact")
    assert drawing.exact.data == {"state": [0, end], "eta3": [0.3, 0.3]}
    assert drawing.figure.y_range.end > 0.3
