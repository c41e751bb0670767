"""Functions that only kernels call are compiled within these, and their code is kept."""

import os
import subprocess
import sys

PARTS = """
from granforce.numerics.lanes import within

@within
def doubled(x, k):
    return 2.0 * x + k
"""
KERNEL = """
from granforce.numerics.lanes import compiled
from parts import doubled

@compiled
def kernel(x):
    return doubled(doubled(x, 1), 2)
"""
RUN = """
import sys
from numba.core.codegen import JITCodeLibrary
made = []
emit = JITCodeLibrary._finalize_specific
JITCodeLibrary._finalize_specific = lambda self: (made.append(self.name), emit(self))[1]
import importlib, parts
print(importlib.import_module(sys.argv[1]).kernel(3.0), sum("doubled" in name for name in made))
print(sum(parts.doubled.stats.cache_hits.values()), len(parts.doubled.overloads))
"""


def test_parts_are_made_machine_code_in_kernels_only_and_kept(tmp_path):
    for name, text in {"parts": PARTS, "first": KERNEL, "second": KERNEL}.items():
        (tmp_path / f"{name}.py").write_text(text)
    paths = os.pathsep.join([str(tmp_path), os.getcwd()])
    places = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": paths}

    def run(module):
        run = [sys.executable, "-c", RUN, module]
        said = subprocess.run(run, capture_output=True, text=True, env=os.environ | places)
        return said.stdout.split() or said.stderr

    assert run("first") == ["16.0", "0", "0", "1"]  # compiled once for both constants
    assert run("second") == ["16.0", "0", "1", "1"]  # a kernel of another file finds the part
    assert run("second") == [
        "16.0",
        "0",
        "0",
        "0",
    ]  # and it is not looked for once the kernel is kept
