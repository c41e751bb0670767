"""The house: few files in each room, every room with its purpose, every kernel under a rule."""

import ast
import tomllib
from pathlib import Path

import pytest

import granforce

pytestmark = pytest.mark.fast

ROOT = Path(__file__).resolve().parents[1]
HOUSE = ROOT / "granforce"
MOST_FILES = 16  # in one room


def rooms():
    """Folders of modules; `docs` has the script of another program's."""
    folders = [path for path in HOUSE.rglob("*") if path.is_dir() and any(path.glob("*.py"))]
    return [path for path in folders if path.name != "docs"]


def imports(path):
    """Names of the modules that a file imports at its top."""
    found = set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(node.module)
    return found


def folders():
    """Folders of code: of the package, the app and the tests."""
    for top in ("granforce", "app", "tests"):
        yield from {path.parent for path in (ROOT / top).rglob("*.py")}


def test_no_room_has_many_files():
    """A module with its script and its style counts as one."""
    assert len(list(folders())) > 40
    for room in folders():
        files = {path.stem for path in room.iterdir() if path.is_file()}
        assert len(files) <= MOST_FILES, room


def test_files_of_tests_have_names_of_their_own():
    """Folders of tests are no packages: two files of one name could not be collected together."""
    names = [path.name for path in (ROOT / "tests").rglob("test_*.py")]
    assert sorted(names) == sorted(set(names))


def test_every_room_says_what_it_is_for():
    assert len(rooms()) > 8
    for room in rooms():
        assert ast.get_docstring(ast.parse((room / "__init__.py").read_text())), room


def test_every_kernel_is_under_a_rule():
    """Each file that compiles something is named by a contract on kernels, or its room is."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    ruled = [
        module
        for contract in contracts["contracts"]
        if contract["name"].startswith("kernels")
        for module in contract["source_modules"]
    ]
    compiled = [
        path
        for path in HOUSE.rglob("*.py")
        if "numba" in imports(path) or "\n@compiled\n" in path.read_text()
    ]
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in compiled]
    assert len(names) > 8
    unruled = [name for name in names if not any(f"{name}.".startswith(f"{m}.") for m in ruled)]
    assert unruled == []
    for module in ruled:
        path = ROOT / module.replace(".", "/")
        assert path.is_dir() or path.with_suffix(".py").exists(), f"{module} has gone"


def test_type_checkers_are_told_the_public_names():
    told = {
        alias.name: node.module.removeprefix("granforce").strip(".")
        for node in ast.parse((HOUSE / "__init__.pyi").read_text()).body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert told == granforce._HOME
