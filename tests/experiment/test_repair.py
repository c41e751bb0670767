"""Frames with the flaws of real ones: what is mended, what is told, and what is refused."""

import numpy as np
import pytest
from frames import NEWTON, PIXELS, file, frame

from granforce.experiment.listings.text_frames import read_frames
from granforce.experiment.pegs import read_pegs
from granforce.records import InputError

CLEAN = {"mu": 0.3, "reach": 0.1, "error": 0.1 * NEWTON}


def read(grains, rows, **options):
    given = file(grains, "positions.txt"), file(rows, "adjacency.txt")
    return read_pegs(*given, **(CLEAN | options))


def with_false_detection(grains, rows):
    """A small disk inside the first grain that has four contacts, with four contacts of its own."""
    ends = [row[1] for row in rows]
    name = next(row[1] for row in grains if ends.count(row[1]) >= 4 and row[-1] == 0)
    true = next(row for row in grains if row[1] == name)
    false = [1, 9001, true[2] + 0.1 * PIXELS, true[3], 0.31 * PIXELS, 0]
    beside = [row[2] for row in rows if row[1] == name][:4]
    return [*grains, false], [*rows, *([1, 9001, other, 0.0, NEWTON] for other in beside)]


def test_a_false_detection_does_not_stop_the_import():
    grains, rows, _ = frame()
    found = read(*with_false_detection(grains, rows))
    assert found.report["false_detections"] == 1 and found.report["contacts_of_missing_grains"] == 4
    assert len(found.packing.r) == len(grains) and 9001 not in found.ids
    assert found.report["contacts_listed"] == len(rows) // 2
    (one,) = [finding for finding in found.findings if finding.kind == "false_detections"]
    assert "9001" in one.text and "positions.txt, line 151" in one.text
    assert np.isfinite([one.x, one.y]).all()
    # As if it had never been there.
    same = read(grains, rows)
    assert np.array_equal(found.packing.forces, same.packing.forces)


def test_a_contact_that_names_a_missing_grain_is_left_out():
    grains, rows, _ = frame()
    inner = next(k for k, row in enumerate(grains) if row[-1] == 0)
    gone = grains[inner][1]
    found = read(grains[:inner] + grains[inner + 1 :], rows)
    lost = sum(gone in row[1:3] for row in rows)
    assert found.report["contacts_of_missing_grains"] == lost > 0
    assert found.report["contacts_listed"] == len(rows) // 2 - lost // 2
    assert any(str(gone) in line for line in found.report["findings"])


@pytest.mark.parametrize("flag", [True, False])
@pytest.mark.parametrize("separator", [",", " ", "\t", ";", ", "])
@pytest.mark.parametrize("numbered", [True, False])
@pytest.mark.parametrize("header", [True, False])
def test_columns_are_recognised(flag, separator, numbered, header):
    """With or without frame, flag and header, and by whatever fields are separated."""
    grains, rows, _ = frame(60)
    first, last = (0, 6) if numbered else (1, 6)
    cut = [row[first : last if flag else 5] for row in grains]
    links = [row[first:] for row in rows]
    texts = []
    words = (["Frame", "ID", "x (px)", "y [px]", "R"], ["frame", "id1", "id2", "Ft", "Fn"])
    for lines, names in zip((cut, links), words, strict=True):
        lines = [[f"{value:.12g}" for value in line] for line in lines]
        if header:
            names = names[first:] + (["edge"] if len(lines[0]) == 6 - first and lines else [])
            lines = [[name.replace(" ", "_") for name in names[: len(lines[0])]], *lines]
        texts.append("\n".join(separator.join(line) for line in lines))
    found = read_frames(*(made(text) for text in texts)).listing()
    assert np.array_equal(found.ids, [row[1] for row in grains])
    assert np.allclose(found.x, [row[2:4] for row in grains])
    assert np.allclose(found.r, [row[4] for row in grains])
    assert np.array_equal(found.flag != 0, [row[5] != 0 and flag for row in grains])
    assert np.array_equal(found.ends, [row[1:3] for row in rows])
    assert np.allclose(found.forces, [[row[4], row[3]] for row in rows])
    assert "radius" in found.description and "tangential" in found.description


def made(text):
    import io

    given = io.StringIO(text)
    given.name = "given.txt"
    return given


def test_positions_without_ids_are_numbered():
    """The centres of PeGS 2: x, y, r, flag; contacts count them from 1."""
    grains, rows, _ = frame(60)
    number = {row[1]: k + 1 for k, row in enumerate(grains)}
    links = [[1, number[row[1]], number[row[2]], *row[3:]] for row in rows]
    found = read([row[2:] for row in grains], links)
    assert np.array_equal(found.packing.forces, read(grains, rows).packing.forces)


def test_ids_that_do_not_belong_together_are_matched_by_geometry():
    """Contacts count the grains of the frame, positions have the names of a tracking."""
    grains, rows, _ = frame()
    number = {row[1]: k + 1 for k, row in enumerate(grains)}
    names = np.random.default_rng(0).permutation(len(grains)) + 1  # of the same range
    links = [[1, number[row[1]], number[row[2]], *row[3:]] for row in rows]
    found = read([[row[0], name, *row[2:]] for row, name in zip(grains, names, strict=True)], links)
    assert "by their names" in found.report["names"]
    assert np.array_equal(found.packing.forces, read(grains, rows).packing.forces)


@pytest.mark.parametrize("shared", [True, False])
def test_ids_that_fit_nowhere_are_refused(shared):
    grains, rows, _ = frame()
    names = [row[1] for row in grains]
    mixed = np.random.default_rng(1).permutation(names) + (0 if shared else 50_000)
    other = dict(zip(names, mixed.tolist(), strict=True))
    links = [[1, other[row[1]], other[row[2]], *row[3:]] for row in rows]
    with pytest.raises(InputError, match=r"join neighbours.*one tracking"):
        read(grains, links)
    with pytest.raises(InputError):
        read(grains, links, repair=False)


def test_another_unit_of_the_radii_is_suggested():
    grains, rows, _ = frame()
    small = [[*row[:4], row[4] / 40, row[5]] for row in grains]
    with pytest.raises(InputError, match="distances are 40 times the radii"):
        read(small, rows)


def test_grains_and_lines_given_twice():
    grains, rows, _ = frame()
    inner = [row for row in grains if row[-1] == 0]
    again = [1, 7001, inner[0][2] + 1, inner[0][3], inner[0][4], 0]  # another name, same place
    found = read([*grains, again, inner[1]], rows)
    assert found.report["doubled_grains"] == 2 and len(found.packing.r) == len(grains)
    named = f"id {inner[1][1]} already appears in line {grains.index(inner[1]) + 1}"
    assert any(one.text.endswith(named) for one in found.findings)
    # What was measured on the double belongs to the grain.
    moved = [[1, 7001, *row[2:]] if row[1] == inner[0][1] else row for row in rows]
    both = read([*grains, again], moved)
    assert both.report["contacts_listed"] == len(rows) // 2
    assert both.report["contacts_of_missing_grains"] == 0


def test_damaged_lines_and_forces_that_pull_are_not_measured():
    grains, rows, _ = frame()
    rows = [list(row) for row in rows]
    forward, back = rows[0], rows[1]
    forward[4] = back[4] = -NEWTON
    rows[2][3], rows[5][1] = np.nan, np.inf
    found = read(grains, rows)
    told = found.report
    assert told["negative_normal_forces"] == 2 and told["unreadable_contacts"] == 2
    i, j = sorted(((forward[1] - 3) // 10, (forward[2] - 3) // 10))
    c = np.flatnonzero((found.packing.contacts.i == i) & (found.packing.contacts.j == j))[0]
    assert np.isnan(found.measured[c]).all() and not found.added[c]
    assert np.isfinite(found.packing.forces).all()


@pytest.mark.parametrize("column", [3, 4])
def test_a_force_of_many_digits_too_many_is_not_measured(column):
    """One number beyond all others would leave programs for the forces without an end."""
    grains, rows, _ = frame(40)
    rows = [list(row) for row in rows]
    rows[0][column] = rows[1][column] = 1e33
    found = read(grains, rows)
    assert found.report["unreadable_contacts"] == 2 and found.report["contacts_listed"] > 20
    assert any("1e+33" in line and "usual" in line for line in found.report["findings"])
    assert np.nanmax(np.abs(found.measured)) < 100 * NEWTON
    with pytest.raises(InputError, match="usual"):
        read(grains, rows, repair=False)


def test_a_contact_too_long_to_touch_is_left_out():
    grains, rows, _ = frame()
    x = np.array([row[2:4] for row in grains])
    far = int(np.hypot(*(x - x[0]).T).argmax())
    found = read(grains, [*rows, [1, grains[0][1], grains[far][1], 0.0, NEWTON]])
    assert found.report["contacts_too_long"] == 1
    assert found.report["contacts_listed"] == len(rows) // 2


def test_more_than_a_tenth_is_refused_unless_it_is_allowed():
    grains, rows, _ = frame()
    bad = [[*row[:4], np.nan] if k % 5 == 0 else row for k, row in enumerate(rows)]
    with pytest.raises(InputError, match=r"more than 10%.*the first: adjacency.txt, line 1"):
        read(grains, bad)
    assert read(grains, bad, repair=0.3).report["unreadable_contacts"] == len(rows[::5])
    for wrong in (-0.1, 2, np.nan):
        with pytest.raises(InputError):
            read(grains, rows, repair=wrong)


@pytest.mark.parametrize(
    "spoil, words",
    [
        (with_false_detection, "overlap"),
        (lambda g, c: (g, [*c, [1, 3, 99999, 0.0, 1.0]]), "99999"),
        (lambda g, c: (g, [*c, [1, 3, 13, 0.0, np.nan]]), "finite"),
        (lambda g, c: ([*g, [1, 8001, np.nan, 0.0, 1.0, 0]], c), "finite"),
        (lambda g, c: ([*g, g[0]], c), "already"),
    ],
)
def test_strictly_the_first_flaw_is_an_error(spoil, words):
    grains, rows, _ = frame()
    with pytest.raises(InputError, match=words):
        read(*spoil(grains, rows), repair=False)
    assert read(*spoil(grains, rows)).report["findings"]


def test_a_frame_without_a_flaw_has_nothing_to_tell():
    grains, rows, _ = frame()
    assert read(grains, rows).report["findings"] == [] == read(grains, rows).findings
