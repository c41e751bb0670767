"""The reference shows every public name, and its examples are what one gets."""

import ast
import doctest
import re

import pytest

import granforce
from granforce.cli import reference
from granforce.cli.parser import main

ENTRIES = {entry.name: entry for entry in reference.entries()}


def test_examples_give_what_they_say():
    """All of them in one session, as they stand."""
    session, runner = {}, doctest.DocTestRunner(verbose=False)
    shown = reference.examples()
    assert len(shown) >= 25
    assert set(shown) <= set(ENTRIES)
    for name, code in shown.items():
        test = doctest.DocTestParser().get_doctest(code, session, name, "examples.md", 0)
        assert test.examples
        told = []
        runner.run(test, out=told.append, clear_globs=False)
        assert not told, "".join(told)
        session = test.globs


def told(entry, seen=()):
    """The docstring of an entry, and those of the public names that it refers to."""
    named = set(re.findall(r"`(\w+)`", entry.docstring)) & set(ENTRIES) - {*seen, entry.name}
    others = [told(ENTRIES[name], (*seen, entry.name)) for name in named]
    return " ".join([entry.docstring, *others])


@pytest.mark.parametrize("name", ENTRIES)
def test_every_public_name_says_what_it_is(name):
    """In a sentence; of a function every argument, of a record every field."""
    entry = ENTRIES[name]
    assert re.match(r"\S.*[.:;]", entry.docstring.partition("\n")[0] + "."), name
    if isinstance(entry.node, ast.FunctionDef):
        a = entry.node.args
        taken = [one.arg for one in [*a.posonlyargs, *a.args, *a.kwonlyargs, a.kwarg] if one]
        words = set(re.findall(r"\w+", told(entry)))
        assert [one for one in taken if one not in words | set(reference.COMMON)] == []


def test_what_a_public_function_returns_is_public():
    """Records that annotations name are found beside the functions that return them."""
    records = {
        node.name
        for path in reference.HOUSE.rglob("*.py")
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    }
    for name, entry in ENTRIES.items():
        if isinstance(entry.node, ast.FunctionDef) and entry.node.returns and "." not in name:
            returned = set(re.findall(r"\w+", ast.unparse(entry.node.returns))) & records
            assert returned <= set(granforce.__all__), name


def test_the_page_shows_signatures_fields_and_sources_and_its_links_lead_somewhere():
    page = reference.page()
    places = set(re.findall(r'id="([\w.]+)"', page))
    assert places == set(ENTRIES)
    assert set(re.findall(r'href="#([\w.]+)"', page)) <= places
    assert "nearest_of_many(" in page and "starts: Sequence[Floats]" in page
    assert "(S, N_c, 2) admissible networks, force" in page  # beside a field of Walk
    assert "granforce/explore/random_walk.py:" in page
    assert not re.search(r"<(script|link|img)\b", page)  # nothing to be fetched


def test_the_command_writes_the_page_and_refuses_where_it_cannot(tmp_path, capsys):
    assert main(["docs", "--out", str(tmp_path / "reference.html")]) == 0
    assert (tmp_path / "reference.html").read_text() == reference.page()
    assert main(["docs", "--out", str(tmp_path / "missing" / "reference.html")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
