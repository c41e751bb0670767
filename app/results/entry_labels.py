"""Names that a visitor gave to entries of the cache, and those of uploaded files.

They are stored in a hidden file of the store's folder: {entry, or digest of an upload: name}.
"""

import json
import threading
from contextlib import suppress

from granforce.study.store import Store
from granforce.system.files import written

NAMES = ".names.json"
LONGEST = 80  # characters per name

_lock = threading.Lock()


def names(store: Store) -> dict[str, str]:
    """All names; empty if the file is missing or damaged."""
    with suppress(OSError, ValueError):
        labels = json.loads((store.path / NAMES).read_text())
        if isinstance(labels, dict):
            return {str(key): str(value) for key, value in labels.items()}
    return {}


def call(store: Store, key: str, name: str) -> None:
    """Give an entry, or the digest of an upload, a name; an empty name removes it.

    InputError if it cannot be stored.
    """
    name = " ".join(name.split())[:LONGEST]
    with _lock:
        known = names(store)
        known.pop(key, None)
        if name:
            known[key] = name
        with written(store.path / NAMES) as file:
            file.write(json.dumps(known, ensure_ascii=False).encode())
