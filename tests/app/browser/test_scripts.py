"""The page's scripts as ES modules: what they import and export, and their arithmetic.

Names that nobody declared, imports that nobody exports and circles are oxlint's (.oxlintrc.json).
"""

import re
import subprocess
import sys

from app.browser.bundle import APP, EXPORT, IMPORT

# Names of the modules of all components, as far as the page has imported them before it is shown.
IMPORTED = """
import app.page
from app.browser.bundle import Scripted
print(*(one.__module__ for one in Scripted.__subclasses__()))
"""
SCRIPTS = {path: path.read_text() for path in APP.glob("**/*.js")}
ENTRIES = {"render", "begin"}  # called by Panel, and by a page that was saved


def test_imports_and_exports_are_of_the_one_form_that_makes_a_module():
    for name, text in SCRIPTS.items():
        said = re.findall(r"^(?:import|export)\b.*", text, re.M)
        assert len(said) == len(IMPORT.findall(text)) + len(EXPORT.findall(text)), name


def test_one_script_asks_for_reduced_motion():
    assert sum(text.count("prefers-reduced-motion") for text in SCRIPTS.values()) == 1


def test_what_a_script_exports_another_one_imports():
    taken = {
        ((path.parent / other).resolve(), name)
        for path, text in SCRIPTS.items()
        for names, other in IMPORT.findall(text)
        for name in names.split(", ")
    }
    exported = {(script, name) for script, text in SCRIPTS.items() for name in EXPORT.findall(text)}
    assert taken <= exported
    assert {name for _, name in exported - taken} == ENTRIES


def test_every_component_is_known_before_a_page_is():
    """Those that are defined while pages are open, only the first of these would learn of."""
    given = {"capture_output": True, "text": True, "check": True}
    told = subprocess.run([sys.executable, "-c", IMPORTED], cwd=APP.parent, **given)
    files = {
        ".".join(path.relative_to(APP.parent).with_suffix("").parts)
        for path in APP.glob("**/*.py")
        if re.search(r"^class \w+\(Scripted", path.read_text(), re.M)
    }
    assert set(told.stdout.split()) == files and len(files) > 15
