"""The benchmark's tables in documents, between <!-- bench: PART --> and <!-- end -->."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from granforce.paper import filled
from granforce.paper.formatting import markdown_table
from granforce.records import InputError, brief
from granforce.system.files import content_of

KIND = "bench"


def load(path: str) -> dict[str, Any]:
    """The results that `granforce bench --out` wrote; InputError for another file."""
    try:
        results = json.loads(content_of(path))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not JSON ({brief(str(error))})") from None
    if not isinstance(results, dict) or "environment" not in results:
        raise InputError(f"{path}: not a benchmark; granforce bench --out FOLDER writes one")
    return results


def renew(paths: Sequence[Path], results: Mapping[str, Any]) -> None:
    """Write the tables into files with marks."""
    filled.renew(paths, KIND, lambda path, part: _table(results.get(part)))


def _table(rows: Any) -> str:
    """The rows of a part as a table; empty for a part that was not measured."""
    if not rows:
        return ""
    if isinstance(rows, dict):  # the environment
        libraries = {name: version for name, version in rows["libraries"].items() if version}
        values = {name: value for name, value in rows.items() if name != "libraries"} | libraries
        return markdown_table(["", "value"], [[name, str(value)] for name, value in values.items()])
    names = list(dict.fromkeys(name for row in rows for name in row))
    names = [name for name in names if any(row.get(name) not in (None, "") for row in rows)]
    heads = [name.replace("_", " ") for name in names]
    return markdown_table(heads, [[_cell(row.get(name)) for name in names] for row in rows])


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.3g}" if isinstance(value, float) else str(value)
