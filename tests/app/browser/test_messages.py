"""Every message between scripts and the server is in one list, which holds on both sides."""

import inspect
import re
from pathlib import Path

import numpy as np
import pytest

from app.browser.bundle import APP, Scripted, module
from app.browser.messages import FROM_BROWSER, TO_BROWSER, Array, fits, listed
from app.explore import explore_page, friction_slider, page_address, results_line, status_line
from app.explore.tabs.intervals import known_forces
from app.explore.tabs.push import load_slider
from app.explore.tabs.your_packing import my_computations
from app.learn import lesson
from app.learn.workbench import workbench
from app.packing import player
from app.packing.replay import stream
from app.state.known import Knowledge
from app.state.pulls import Hand
from app.widgets import file_buttons, file_drop, number

pytestmark = pytest.mark.fast

COMPONENTS = {
    kind.__name__: kind
    for kind in (
        page_address.Address, file_drop.Dropper, friction_slider.FrictionSlider,
        file_buttons.Handover, known_forces.Known, lesson.Lesson, load_slider.LoadSlider,
        my_computations.Mine, number.NumberField, player.Player,
        results_line.Results, status_line.StatusLine, workbench.Workbench,
    )
}  # fmt: skip
# What a player's message is handed on to.
PARTS = {"hand": Hand.heard, "known": Knowledge.heard, "live": stream.Stream.heard}
# A call that tells the server something, up to the literal that it begins with.
TELLING = re.compile(r"(?:\bask\(model, view, |\btell\(|\bsend_msg\()(?=\{|\w+ \? \{)")


def script_of(kind):
    """The path of a component's script."""
    return Path(inspect.getfile(kind)).with_suffix(".js")


def names(shape):
    """A message's fields by name, those inside a field beside it: {"hand": {"undo": True}}."""
    return frozenset(
        (name, names(part) if isinstance(part, dict) else None) for name, part in shape.items()
    )


def fields(shape):
    """Names of a message's fields, and of those inside them."""
    for name, part in shape.items():
        yield name
        yield from fields(part) if isinstance(part, dict) else ()


def literals(text):
    """The outermost {…} of a script up to the parenthesis that closes the call, without braces."""
    found, depth, begin = [], 0, 0
    for at, letter in enumerate(text):
        if letter in "([{":
            begin = at + 1 if letter == "{" and depth == 0 else begin
            depth += 1
        elif letter in ")]}":
            depth -= 1
            if depth < 0:
                break
            if letter == "}" and depth == 0:
                found.append(text[begin:at])
    return found


def said(literal):
    """Messages that an object literal may be, as `names`."""
    found, rest = [], literal
    while "[" in rest:
        rest = re.sub(r"\[[^][]*\]", "0", rest)
    inner = literals(rest)
    for part in inner:
        rest = rest.replace(part, "")
    for field in rest.split(","):
        name, _, value = field.strip().partition(":")
        found.append((name, "{" in value))
    if not inner:
        return {frozenset((name, None) for name, _ in found)}
    ((outer, _),) = [field for field in found if field[1]]
    return {frozenset({(outer, one)}) for part in inner for one in said(part)}


def sent(text):
    """Messages that a script sends, as `names`."""
    calls = [text[call.end() :] for call in TELLING.finditer(text)]
    return {one for call in calls for literal in literals(call) for one in said(literal)}


@pytest.mark.parametrize("name", COMPONENTS)
def test_a_script_sends_what_is_listed_and_nothing_else(name):
    script = script_of(COMPONENTS[name])
    expected = {names(shape) for shape in FROM_BROWSER[name]}
    if name != "Player":
        assert sent(module(script)) == expected
        return
    # Its hand and its live view tell the player, which says who it was.
    parts = {"hand", "live"}
    whole = {one for one in expected if parts.isdisjoint(name for name, _ in one)}
    inside = {part for one in expected - whole for _, part in one}
    handed = {frozenset({(name, None)}) for name in parts}
    assert sent(module(APP / "packing/player.js")) == whole | inside | handed


@pytest.mark.parametrize("name", COMPONENTS)
def test_what_is_listed_is_handled(name):
    """By name: on the server where it is heard, in the browser in the component's script."""
    heard = inspect.getsource(COMPONENTS[name]._heard)
    if name == "Player":  # which hands on what others hear
        heard = inspect.getsource(explore_page) + inspect.getsource(stream)
    for shape in FROM_BROWSER[name]:
        for field, part in shape.items():
            handed = (f'hears["{field}"]', f'"{field}": state.')
            ways = handed if name == "Player" else (f'"{field}"',)
            assert any(way in heard for way in ways) or len(FROM_BROWSER[name]) == 1, field
            if name == "Player" and isinstance(part, dict):
                (first, *_) = part
                assert f'"{first}"' in inspect.getsource(PARTS[field]), first
    script = module(script_of(COMPONENTS[name]))
    told = {field for shape in TO_BROWSER.get(name, ()) for field in fields(shape)}
    for field in told - {"settled"}:  # which says no more than that it came
        assert re.search(rf"\b{field}\b", script), field


def test_every_component_that_sends_or_hears_is_listed():
    mine = {kind.__name__ for kind in Scripted.__subclasses__() if "_heard" in vars(kind)}
    assert mine == set(FROM_BROWSER) == set(COMPONENTS)
    assert set(TO_BROWSER) <= set(COMPONENTS)


@pytest.mark.parametrize(
    "shape, good, bad",
    [
        (int, [0, -3, 2**53], [True, 1.0, 2**53 + 1, "1", None]),
        (float, [0, 1.5, np.float64(2)], [False, 10**300, "1.5", None]),
        (True, [True], [1, False, "yes"]),
        ([int, float], [[1, 2.0], (1, 2)], [[1], [1.0, 2.0], 3, "ab"]),
        ([float, ...], [[], [1, 2.5]], [[None], (1,), "12", {}]),
        ({"a": int, "b": None}, [{"a": 1, "b": None}], [{"a": 1}, {"a": 1, "b": 0}, [], None]),
        (Array, [np.zeros(3)], [[0.0], None]),
    ],
)
def test_a_field_fits_its_shape_only(shape, good, bad):
    assert all(fits(value, shape) for value in good)
    assert not any(fits(value, shape) for value in bad)


def test_what_no_list_has_is_neither_heard_nor_sent():
    field = number.NumberField(on_wrong=pytest.fail)
    for message in (None, 7, "typed", [], {"typed": 7}, {"typed": "x", "more": 1}, {"other": "x"}):
        field.hear(message)
    assert not listed(FROM_BROWSER, "Nobody", {"typed": "x"})
    with pytest.raises(ValueError, match="no message of NumberField: rest"):
        field.tell({"rest": True})
