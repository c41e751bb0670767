"""The environment of a benchmark, and its rows as tables on stdout."""

import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

from granforce import __version__
from granforce.types import Rows

LIBRARIES = ("granforce", "numpy", "scipy", "numba", "highspy", "piqp", "siconos")


def environment() -> dict[str, Any]:
    """The environment of the measurement: processor, cores, Python and library versions."""
    return {
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "libraries": {name: _version(name) for name in LIBRARIES},
    }


def _cpu() -> str:
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _version(name: str) -> str | None:
    if name == "granforce":  # installed metadata of a clone can be of an older version
        return __version__
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def table(title: str, rows: Rows) -> str:
    """Rows (dicts) as an aligned text table, without empty columns."""
    names = [name for name in dict.fromkeys(k for row in rows for k in row)]
    names = [name for name in names if any(row.get(name) not in (None, "") for row in rows)]
    cells = [names, *([_cell(row.get(name)) for name in names] for row in rows)]
    widths = [max(len(line[k]) for line in cells) for k in range(len(names))]
    lines = [
        "  ".join(text.ljust(width) for text, width in zip(line, widths, strict=True)).rstrip()
        for line in cells
    ]
    return "\n".join([title, "-" * len(title), *lines, ""])


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else ""
    return f"{value:.3g}" if isinstance(value, float) else str(value)
