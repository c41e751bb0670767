"""Files that are numbered parts of one: PATH.0, PATH.1, … or PATH.0000, PATH.0001, …"""

import glob
import os


def numbered_files(path: str) -> list[str]:
    """The numbered files of a path that does not exist, in order; without any, the path alone."""
    full = os.path.expanduser(path)
    if "\0" in full or os.path.lexists(full):
        return [path]
    found = glob.glob(glob.escape(full) + ".[0-9]*")
    numbers = {name: name[len(full) + 1 :] for name in found}
    parts = [name for name, end in numbers.items() if end.isdecimal()]
    return sorted(parts, key=lambda name: int(numbers[name])) or [path]
