"""The page's scripts as ES modules: what they import and export, and their arithmetic.

Names that nobody declared, imports that nobody exports and circles are oxlint's (.oxlintrc.json).
"""

import re
import subprocess
import sys

from app.views.scripts import EXPORT, FOLDER, IMPORT

# Names of the modules of all components, as far as the page has imported them before it is shown.
IMPORTED = """
import app.page
from app.views.scripts import Scripted
print(*(one.__module__.rpartition(".")[2] for one in Scripted.__subclasses__()))
"""
SCRIPTS = {path.stem: path.read_text() for path in FOLDER.glob("*.js")}
ENTRIES = {"render", "begin"}  # called by Panel, and by a page that was saved


def test_imports_and_exports_are_of_the_one_form_that_makes_a_module():
    for name, text in SCRIPTS.items():
        said = re.findall(r"^(?:import|export)\b.*", text, re.M)
        assert len(said) == len(IMPORT.findall(text)) + len(EXPORT.findall(text)), name


def test_what_a_script_exports_another_one_imports():
    imported = {
        (other, name)
        for text in SCRIPTS.values()
        for names, other in IMPORT.findall(text)
        for name in names.split(", ")
    }
    exported = {(script, name) for script, text in SCRIPTS.items() for name in EXPORT.findall(text)}
    assert imported <= exported
    assert {name for _, name in exported - imported} == ENTRIES


def test_the_table_of_who_calls_whom_has_every_script():
    text = (FOLDER.parent / "README.md").read_text()
    rows = [row for row in text[text.index("## Scripts") :].splitlines() if row.startswith("|")]
    told = set(re.findall(r"`(\w+)\.js`", "\n".join(rows)))
    assert told == set(SCRIPTS)


def test_every_component_is_known_before_a_page_is():
    """Those that are defined while pages are open, only the first of these would learn of."""
    given = {"capture_output": True, "text": True, "check": True}
    told = subprocess.run([sys.executable, "-c", IMPORTED], cwd=FOLDER.parent.parent, **given)
    files = {path.stem for path in FOLDER.glob("*.py") if "(Scripted" in path.read_text()}
    assert set(told.stdout.split()) == files and len(files) > 15
