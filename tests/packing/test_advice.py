"""Messages name the likely cause, and their advice leads to the right result."""

import io
import json
import re

import numpy as np
import pandas as pd
import pytest

import granforce as gf
from granforce.records import InputError, NotJammedError

GROUND = [[-3.0, -1.0], [5.0, -1.0], [5.0, 0.0], [-3.0, 0.0]]
L = [[0, 0], [1, 0], [1, 2], [2, 2], [2, 3], [0, 3]]
PARTS = [[[0, 0], [1, 0], [1, 3], [0, 3]], [[1, 2], [2, 2], [2, 3], [1, 3]]]


def square(x, y, size=1.0):
    return [[x, y], [x + size, y], [x + size, y + size], [x, y + size]]


def on_ground(*bodies, **options):
    return gf.blocks([*bodies, GROUND], 0.6, fixed=[len(bodies)], **options)


def test_a_body_of_two_parts_is_no_pair_of_bodies():
    """The L stands on its foot, with 1 and 3 at its corners; its two parts do not."""
    with pytest.raises(
        InputError, match=r"not convex: divide it into convex parts, and give the body as the list"
    ):
        on_ground(L)
    with pytest.raises(NotJammedError):
        on_ground(*PARTS)
    x = [[0.75, 1.75], [1.0, -0.5]]
    contacts = gf.make_contacts_at([0, 0], [1, 1], [[0, 0], [1, 0]], [[0, -1]] * 2, x)
    load = [[0, -4, 0], [np.nan] * 3]
    packing = gf.make_packing(
        x, [1, 1], [np.inf] * 2, contacts, np.zeros((2, 2)), 0.6, load=load, info={}
    )
    bounds = gf.intervals(gf.ensemble(packing))
    assert bounds.low[:, 0] == pytest.approx([1, 3]) == bounds.high[:, 0]


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("gap", [1.04e-3, 3e-7, -1.04e-3])
def test_the_named_tolerance_makes_a_contact(gap, unit):
    body, ground = unit * np.array(square(0, gap)), unit * np.array(GROUND)
    with pytest.raises(InputError) as raised:
        gf.blocks([body, ground], 0.6, fixed=[1])
    named = float(re.search(r"(?:--tolerance|gaps from) (\S+?),? ", str(raised.value)).group(1))
    packing = gf.blocks([body, ground], 0.6, fixed=[1], tolerance=named)
    assert packing.forces[:, 0] == pytest.approx(0.5 * unit**2)


def test_a_deep_overlap_is_no_matter_of_the_tolerance():
    with pytest.raises(InputError, match=r"overlap by 0\.5, .* move one, or correct its corners$"):
        on_ground(square(0, -0.5))


def test_bodies_that_touch_nothing_or_corner_on_corner_are_named():
    with pytest.raises(NotJammedError, match=r"body 0 touches no other: the nearest, body 1, is 0"):
        on_ground(square(0, 0.1))
    with pytest.raises(
        NotJammedError, match=r"bodies 0 and 1 meet corner on corner.*meets an edge"
    ):
        on_ground(square(1, 1), square(0, 0))
    assert len(on_ground(square(0.4, 1), square(0, 0)).forces) == 4


def test_bodies_unbalanced_by_rounding_are_not_named():
    with pytest.raises(NotJammedError, match=r"unbalanced load: 0 \(\S+ ⟨f_n⟩\)(;|$)"):
        on_ground(square(1, 1), square(0, 0), square(2.5, 0), square(4, 0))


GRAINS = pd.DataFrame({"x": [1.0, 3, 1, 3], "y": [1.0, 1, 3, 3], "r": [1.0] * 4})
PAIRS = pd.DataFrame({"i": [0, 0, 1, 2], "j": [1, 2, 3, 3]})
HELD = {"mu": 0.3, "walls": "box", "gravity": 1.0}


def test_contacts_that_count_from_1_are_recognised():
    """Also if the last grain has no contact; with the advised ids, the result is the same."""
    right = gf.read_table(GRAINS, PAIRS, **HELD)
    with pytest.raises(InputError, match=r"from 1: .* give it a column id with 1 … 4"):
        gf.read_table(GRAINS, PAIRS + 1, **HELD)
    with pytest.raises(InputError, match="from 1"):
        gf.read_table(GRAINS, PAIRS[:2] + 1, **HELD)
    found = gf.read_table(GRAINS.assign(id=[1, 2, 3, 4]), PAIRS + 1, **HELD)
    assert np.array_equal(found.forces, right.forces)


def test_tables_are_read_from_data_frames():
    """As from their files, with an index or without; messages name the row."""
    tables = GRAINS, PAIRS
    read = [gf.read_table(*tables, **HELD), gf.read_table(GRAINS, **HELD)]
    texts = [io.StringIO(table.to_csv(index=False)) for table in tables]
    assert np.array_equal(gf.read_table(*texts, **HELD).forces, read[0].forces)
    assert gf.ensemble(read[1]).dimension == gf.ensemble(read[0]).dimension
    indexed = GRAINS.assign(id=[4, 3, 2, 1]).set_index("id")
    found = gf.read_table(indexed, 4 - PAIRS, **HELD)
    assert np.array_equal(found.forces, read[0].forces)
    with pytest.raises(InputError, match="the DataFrame of grains, row 2: r is ''"):
        gf.read_table(GRAINS.assign(r=[1, 1, np.nan, 1]), **HELD)
    with pytest.raises(InputError, match="the DataFrame of grains is empty"):
        gf.read_table(GRAINS[:0], **HELD)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_radii_in_another_unit_are_named(scale):
    box = {} if scale < 1 else {"box": (4.0, 4.0)}
    with pytest.raises(InputError, match="the same unit of length"):
        gf.read_table(GRAINS.assign(r=scale), PAIRS, mu=0.3, **box)


FLOOR = {"corners": GROUND, "fixed": True, "material": "s"}


def read_blocks(text):
    return gf.read_blocks(io.StringIO(text), mu=0.5)


def test_contradictions_are_refused():
    disk = {"disk": [0, 1, 1], "material": "a"}
    for pair, words in ((["s", "a"], "0.1 and 0.9"), (["a", "s"], "0.1 and 0.9")):
        text = json.dumps({"bodies": [disk, FLOOR], "friction": [["s", "a", 0.1], [*pair, 0.9]]})
        with pytest.raises(InputError, match=words):
            read_blocks(text)
        assert read_blocks(text.replace("0.9", "0.1")).mu == 0.1
    for text in (
        '{"bodies": [{"disk": [0, 1, 1], "disk": [5, 1, 1]}]}',
        '{"bodies": [], "bodies": [{"disk": [5, 1, 1]}]}',
    ):
        with pytest.raises(InputError, match="is given twice in one object"):
            read_blocks(text)
    with pytest.raises(InputError, match=r"given twice for .*, with two values"):
        gf.blocks(
            [[0, 1, 1], GROUND],
            0.5,
            fixed=[1],
            materials=["a", "s"],
            friction={("a", "s"): 0.1, ("s", "a"): 0.9},
        )


@pytest.mark.parametrize("text", ["1_5", "_15", "1_0e3"])
def test_numbers_have_no_underscores(text):
    with pytest.raises(InputError, match="not a finite number"):
        gf.read_known(io.StringIO(f"contact,f_n\n2,{text}\n"))
    with pytest.raises(InputError, match="not a finite number"):
        gf.read_measurement(io.StringIO(f"contact,f_n,f_t,sigma_n,sigma_t\n2,{text},,1,\n"))
    with pytest.raises(InputError, match="not a finite number"):
        gf.read_table(io.StringIO(f"x,y,r\n0,1,{text}\n"), **HELD)
    with pytest.raises(InputError):
        gf.read_table(GRAINS, io.StringIO(f"i,j\n0,{text}\n"), **HELD)


def test_a_conflict_names_friction_only_where_it_is_0():
    packing = gf.scene("groove", 0.5)
    known = gf.Known([0, 1], [[-np.inf, 0.0], [-np.inf, 0.0]], [[0.2, 0.0], [0.2, 0.0]])
    with pytest.raises(NotJammedError) as raised:
        gf.ensemble(packing, known=known)
    assert "conflict" in str(raised.value) and "where μ is 0" not in str(raised.value)
