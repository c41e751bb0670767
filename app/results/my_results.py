"""The contents of the cache: computations by name, time and size, to open or delete."""

from typing import Any

from granforce.records import InputError
from granforce.study.keys import Parameters, canonical
from granforce.study.store import Entry

from .entry_labels import call, names
from .library import SOURCES, Library


def rows(library: Library) -> list[dict[str, Any]]:
    """A dict per computation in the cache, newest first: entry, name, kind, time, MB."""
    store = library.writable_cache
    known, entries = names(store), store.entries() if store.exists else []
    cells = [cell for cell in library.cells() if cell.store is store]
    packings = {entry.name: entry for entry in entries}
    return sorted(
        (
            {
                "entry": cell.name,
                "name": known.get(cell.name, ""),
                "what": f"μ = {cell.mu:g}, {cell.series}",
                "when": packings[cell.name].created,
                "megabytes": sum(e.bytes for e in entries if _belongs(e, packings[cell.name]))
                / 1e6,
            }
            for cell in cells
            if cell.name in packings
        ),
        key=lambda row: row["when"],
        reverse=True,
    )


def delete(library: Library, name: str) -> None:
    """Delete a computation from the cache, and its packing with all results on it alone."""
    store = library.writable_cache
    entry = store.entry(name)
    if entry is None or entry.kind not in SOURCES:
        raise InputError("that computation is no longer in the cache")
    store.remove(name)
    packing, others = canonical(_packing(entry)), store.entries()
    same = [other for other in others if canonical(_packing(other)) == packing]
    if not any(other.kind in SOURCES for other in same):
        store.remove(*(other.name for other in same))
    call(store, name, "")


def _packing(entry: Entry) -> Parameters:
    """The packing of an entry, or the entry itself if it is one."""
    packing: Parameters = entry.params
    return packing if entry.kind == "packing" else packing.get("packing", {})


def _belongs(other: Entry, entry: Entry) -> bool:
    """Whether an entry is this entry of states, or a result derived from it."""
    if other.kind in SOURCES:
        return other.name == entry.name
    same = canonical(_packing(other)) == canonical(_packing(entry))
    return same and (other.kind == "packing" or other.params.get("mu") == entry.params["mu"])
