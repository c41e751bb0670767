"""Every message between a component and its script is stated at the component."""

import inspect
import re
from pathlib import Path

import numpy as np
import pytest

import app.page  # noqa: F401  # defines all components
from app.browser.bundle import Scripted, module
from app.browser.messages import Array, fits
from app.widgets.number import NumberField

pytestmark = pytest.mark.fast

COMPONENTS = {kind.__name__: kind for kind in Scripted.__subclasses__()}
# A call that tells the server something, up to the literal that it begins with.
TELLING = re.compile(r"(?:\bask\(model, view, |\btell\(|\bsend_msg\()(?=\{|\w+ \? \{)")


def script_of(kind):
    """The script of a component, with all that it imports."""
    return module(Path(inspect.getfile(kind)).with_suffix(".js"))


def fields(shape):
    """Names of a message's fields, and of those inside them."""
    for name, part in shape.items():
        yield name
        yield from fields(part) if isinstance(part, dict) else ()


def literals(text):
    """The outermost {…} of a script up to the parenthesis that closes the call, without braces."""
    depth = begin = 0
    for at, letter in enumerate(text):
        if letter in "([{":
            begin = at + 1 if letter == "{" and depth == 0 else begin
            depth += 1
        elif letter in ")]}":
            depth -= 1
            if depth < 0:
                return
            if letter == "}" and depth == 0:
                yield text[begin:at]


def names(literal):
    """Names of the fields of an object literal."""
    while "[" in literal:
        literal = re.sub(r"\[[^][]*\]", "0", literal)
    return frozenset(field.strip().partition(":")[0] for field in literal.split(","))


def sent(text):
    """Messages that a script sends, as names of their fields."""
    calls = [text[call.end() :] for call in TELLING.finditer(text)]
    return {names(literal) for call in calls for literal in literals(call)}


@pytest.mark.parametrize("name", COMPONENTS)
def test_a_script_sends_what_its_component_handles_and_reads_what_it_is_sent(name):
    kind = COMPONENTS[name]
    script = script_of(kind)
    assert sent(script) == {frozenset(shape) for shape, _ in kind._handlers}
    told = {field for shape in kind.to_browser for field in fields(shape)}
    for field in told - {"settled"}:  # which says no more than that it came
        assert re.search(rf"\b{field}\b", script), field


def test_components_that_send_and_hear_are_known():
    handled = {name for name, kind in COMPONENTS.items() if kind._handlers}
    assert len(handled) == 14 and {"Player", "Workbench", "Lesson"} <= handled


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


def test_what_is_not_stated_is_neither_heard_nor_sent():
    field = NumberField(on_wrong=pytest.fail)
    for message in (None, 7, "typed", [], {"typed": 7}, {"typed": "x", "more": 1}, {"other": "x"}):
        field.hear(message)
    with pytest.raises(ValueError, match="no message of NumberField: rest"):
        field.tell({"rest": True})
