"""The documentation builds without a warning, and its examples give what they say."""

import ast
import doctest
import importlib
import inspect
import json
import operator
import re
import subprocess
import sys
from pathlib import Path

import pytest

import granforce
from granforce import measures
from granforce.cli.commands import service
from granforce.cli.entry_point import main
from granforce.study.store import open_store

HOUSE = granforce.__path__[0]
EXAMPLES = f"{HOUSE}/docs/examples.md"
PAGES = f"{HOUSE}/docs/pages"
# Functions without an example: they need files of data, or a browser.
WITHOUT = {"show", "read_mercury", "open_mercury", "frames_of", "infer_series"}
PUBLIC = {name: home for name, home in granforce._HOME.items() if home}


def examples():
    """{name: session} of the examples."""
    form = r"^## gf\.(\S+)\n.*?^```python\n(.*?)^```$"
    return dict(re.findall(form, open(EXAMPLES).read(), re.M | re.S))


def test_examples_give_what_they_say():
    """All of them in one session, as they stand."""
    session, runner = {}, doctest.DocTestRunner(verbose=False)
    shown = examples()
    assert {name.partition(".")[0] for name in shown} <= set(granforce.__all__)
    functions = {name for name in PUBLIC if inspect.isfunction(getattr(granforce, name))}
    assert functions - shown.keys() == WITHOUT
    assert {"Ensemble", "Known", "Packing", "Store"} < shown.keys()
    measured = {name for name in measures.__all__ if callable(getattr(measures, name))}
    assert {f"measures.{name}" for name in measured} - shown.keys() == {
        "measures.Sampling",
        "measures.correlation_range",
    }
    for name, code in shown.items():
        test = doctest.DocTestParser().get_doctest(code, session, name, "examples.md", 0)
        assert test.examples
        failures = []
        runner.run(test, out=failures.append, clear_globs=False)
        assert not failures, "".join(failures)
        session = test.globs


def public(name):
    return operator.attrgetter(name)(granforce)


def documented(name):
    return inspect.getdoc(public(name)) or ""


def explained(text):
    """The arguments that the section of parameters explains."""
    section = re.search(r"^Parameters\n-+\n(.*?)(?=\n\n|\Z)", text, re.M | re.S)
    heads = re.findall(r"^\*{0,2}(\w[\w, ]*?)(?: : .*)?$", section[1], re.M)
    return [name for head in heads for name in head.split(", ")]


METHODS = {
    "Ensemble": ("admits", "expand", "positions", "residual", "violation"),
    "Store": ("find", "load", "save"),
    "measures": [name for name in measures.__all__ if inspect.isfunction(getattr(measures, name))],
}
NAMES = [*PUBLIC, *(f"{home}.{name}" for home, names in METHODS.items() for name in names)]


@pytest.mark.parametrize("name", NAMES)
def test_every_public_name_says_what_it_is(name):
    """In a sentence, and of a function every argument, and the result."""
    text, one = documented(name), public(name)
    assert re.match(r"\S.*[.:;]", text.partition("\n")[0] + "."), name
    if inspect.isfunction(one):
        signature = inspect.signature(one)
        assert sorted(explained(text)) == sorted(signature.parameters.keys() - {"self"})
        assert ("\nReturns\n---" in text) == (signature.return_annotation != "None")


def test_what_a_public_function_returns_is_public():
    """Records that annotations name are found beside the functions that return them."""
    for name, home in PUBLIC.items():
        module = importlib.import_module(f"granforce.{home}")
        for node in ast.parse(inspect.getsource(module)).body:
            if isinstance(node, ast.FunctionDef) and node.name == name and node.returns:
                named = set(re.findall(r"\w+", ast.unparse(node.returns)))
                records = {one for one in named if hasattr(getattr(module, one, None), "_fields")}
                assert records <= set(granforce.__all__), name


def test_the_site_builds_without_a_warning(tmp_path):
    site = tmp_path / "site"
    command = (sys.executable, "-m", "granforce.cli", "docs", "--out", str(site))
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr.splitlines() == [
        "granforce: building the documentation, which takes up to two minutes …"
    ]
    assert done.stdout.split() == [str(site / "index.html")]
    library = (site / "reference" / "library.html").read_text()
    at = [library.index(f'id="granforce.{home}.{name}"') for name, home in PUBLIC.items()]
    assert at == sorted(at)
    questions = re.findall(r'<h2 id="[\w-]+">(.*?)<', library)
    assert questions == list(granforce._BY_QUESTION)
    for name in ("measures.eta3", "figures.save"):
        assert f'id="granforce.{name}"' in library
    assert "granforce intervals" in (site / "reference" / "cli.html").read_text()
    gallery = (site / "gallery.html").read_text()
    pictures = re.findall(r'src="(figures/gallery_\w+\.png)"', gallery)
    source = Path(PAGES, "gallery.md").read_text()
    sections = re.findall("^```python\n(.*?)^```", source, re.M | re.S)
    assert 6 <= len(pictures) == len(set(pictures)) == len(sections)
    assert all((site / picture).read_bytes().startswith(b"\x89PNG") for picture in pictures)
    for code in sections:
        assert len([line for line in code.splitlines() if line]) <= 10, code
    assert (site / "accuracy.html").read_text().count("<table>") >= 4
    # A search for these words leads to the sections that define them.
    found = json.loads((site / "search" / "search_index.json").read_text())
    boosts = {page["title"]: page.get("boost", 1) for page in found["docs"]}
    assert "stemmer" not in found["config"]["pipeline"] and boosts["Install"] > 1
    for word in ("critical force, F_crit", "indeterminacy by intervals, η3"):
        assert boosts[word] == max(boosts.values())


def test_a_folder_that_is_not_there_is_refused(tmp_path, capsys):
    assert main(["docs", "--out", str(tmp_path / "missing" / "site")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_built_pages_leave_the_default_store_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("GRANFORCE_CACHE", raising=False)
    monkeypatch.setattr(service, "_build_docs", lambda folder: folder.mkdir())
    monkeypatch.setattr("webbrowser.open", lambda address: None)
    monkeypatch.setattr("http.server.ThreadingHTTPServer.serve_forever", lambda server: None)
    assert main(["docs"]) == 0
    open_store().make()
