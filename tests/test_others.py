"""Names of other libraries that are not meant for us: each in one file, and known by a test.

Where one of these tests fails after an update, it says what no longer works, and where to mend it.
"""

import ast
import importlib
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import pytest

HOUSE = Path(__file__).parents[1] / "granforce"
# Where it is used, what, and what it is for.
NAMES = {
    "study/processes.py": ("_processes", "workers are ended where the work is interrupted"),
    "study/entries.py": ("zarr.core.metadata", "metadata of an array is written as Zarr does"),
    "numerics/lanes.py": ("numba.core", "LLVM's own functions are called for all lanes at once"),
    "system/compiled.py": ("numba.core", "a listener tells that kernels are compiled"),
}
# Of kernels as numba compiles and stores them, with the classes whose methods these are.
KERNELS = {
    ("system/compiled.py", "numba.core.caching"),
    ("system/compiled.py", "_load_index"),
    ("system/part_compiler.py", "numba.core.codegen"),
    ("system/part_compiler.py", "numba.core.compiler"),
    ("system/part_compiler.py", "numba.core.dispatcher"),
    ("system/part_compiler.py", "numba.core.types.misc"),
    ("system/part_compiler.py", "_engine"),
    ("system/part_compiler.py", "_add_module"),
    ("system/part_compiler.py", "_final_module"),
    ("system/part_compiler.py", "_unserialize"),
}
# documented, in spite of their names
_OURS = {"_asdict", "_fields", "_make", "_replace", "_exit", "_repr_mimebundle_"}
_TYPES = {
    "_ActionsContainer",
    "_ArgumentGroup",
    "_SubParsersAction",
    "_actions",
}  # argparse's


def used(path):
    """Names of others in a file: attributes and modules that begin with _, and its cores."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr.startswith("_"):
            is_own = isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")
            if not (node.attr.startswith("__") or is_own):
                yield node.attr
        elif isinstance(node, ast.ImportFrom) and not (node.module or "").startswith("granforce"):
            parts = (node.module or "").split(".")
            if "core" in parts or any(p.startswith("_") and p[1:2] != "_" for p in parts):
                yield node.module


def test_names_of_others_are_used_where_they_are_known():
    files = sorted(HOUSE.rglob("*.py"))
    text = "\n".join(path.read_text() for path in files)
    found = {
        (str(path.relative_to(HOUSE)), name)
        for path in files
        for name in used(path)
        if name not in _OURS | _TYPES and f"def {name}(" not in text and f"{name} = {{" not in text
    }
    assert found == {(file, name) for file, (name, _) in NAMES.items()} | KERNELS


def test_stored_kernels_can_be_read_or_compiled_anew():
    caching = importlib.import_module("numba.core.caching")
    assert hasattr(caching.IndexDataCacheFile, "_load_index")


def told(file):
    name, purpose = NAMES[file]
    return f"granforce/{file} needs {name}, so that {purpose}"


def test_a_pool_of_processes_knows_its_workers():
    with ProcessPoolExecutor(1) as pool:
        pool.submit(int).result()
        alive = [process.is_alive() for process in pool._processes.values()]
        assert alive == [True], told("study/processes.py")


@pytest.mark.parametrize(
    ("file", "module", "name"),
    [
        ("study/entries.py", "zarr.core.metadata", "ArrayV3Metadata"),
        ("numerics/lanes.py", "numba.core.cgutils", "get_or_insert_function"),
        ("system/compiled.py", "numba.core.event", "Listener"),
    ],
)
def test_what_is_imported_is_there(file, module, name):
    assert hasattr(importlib.import_module(module), name), told(file)
