"""Compiling: what the first results cost on a machine without compiled kernels."""

import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Mapping

from granforce.bench.runner import Row, note

_PACK = "import granforce as gf; p = gf.pack(100, mu=0.1)"
FIRST = {
    "pack": _PACK,
    "pack, intervals": f"{_PACK}; S = gf.ensemble(p); gf.intervals(S, S.index[:8])",
}


def compiling(first: Mapping[str, str] = FIRST) -> list[Row]:
    """Rows: processor seconds of statements in a new process, while kernels compile and afterwards.

    first: {task: statements}, each begun without compiled kernels.
    """
    rows: list[Row] = []
    for task, statements in first.items():
        with tempfile.TemporaryDirectory() as folder:
            note(f"compiling: {task}")
            cold, warm = (_processor_seconds(statements, folder) for _ in range(2))
        rows.append({"task": task, "seconds": cold, "seconds_compiled": warm, "ratio": cold / warm})
    return rows


def _processor_seconds(statements: str, cache: str) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    called = [sys.executable, "-W", "ignore", "-c", statements]
    subprocess.run(called, env=os.environ | {"NUMBA_CACHE_DIR": cache}, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
