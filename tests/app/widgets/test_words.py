"""The glossary: every word of the page and of the README has its sentence, in one place."""

import re
from html import unescape

from app.results.selection import KINDS, SOLVERS
from app.state.view_settings import COLOURS, PLANES, PUSHES, SCALES, SORTS, WIDTHS
from app.widgets import hints
from granforce import notebook
from granforce.glossary import TERMS


def test_every_symbol_and_option_has_its_sentence():
    known = hints.labels()
    assert set(known.values()) <= set(TERMS)
    for options in (KINDS, SOLVERS, COLOURS, WIDTHS, SORTS, SCALES, PLANES, PUSHES):
        for words in options.values():
            assert words in known, words
    for word, sentence, _ in TERMS.values():
        assert re.fullmatch(r"[^.].*\.", sentence) and len(sentence) < 320, word


def test_tables_in_notebooks_explain_their_names():
    table = notebook.table("Walk", {"η1": 0.1, "acceptance": 1.0, "mean coordination z": 3.6})
    table = unescape(table)
    assert TERMS["eta1"].sentence in table and TERMS["z"].sentence in table
    assert "<td" in table and "title=" in table
