"""Files and folders on the way to their final name, and the processes that write them."""

import os
import re
import secrets
import shutil
import socket
import time
from pathlib import Path

STALE_SECONDS = 3600.0  # the writer of a temporary untouched for this long is dead


def _host() -> str:
    return re.sub(r"\W", "_", socket.gethostname())


def temporary_name() -> str:
    """A name that says who writes, for `is_stale`."""
    return f".tmp-{_host()}-{os.getpid()}-{secrets.token_hex(4)}"


def is_stale(temporary: Path) -> bool:
    """Whether the writer is dead: known on this host, judged by age elsewhere."""
    try:
        age = time.time() - temporary.stat().st_mtime
    except FileNotFoundError:
        return False  # renamed or removed meanwhile
    host, _, pid = temporary.name.removeprefix(".tmp-").rpartition("-")[0].rpartition("-")
    local = host == _host() and pid.isdigit() and os.name == "posix"
    return age > STALE_SECONDS or (local and not _is_alive(int(pid)))


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        pass  # it exists and belongs to someone else
    return not _is_zombie(pid)


def _is_zombie(pid: int) -> bool:
    """Whether the process has ended but was not yet reaped by its parent (Linux)."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    return status.rpartition(")")[2].split()[:1] == ["Z"]


def remove(path: Path) -> None:
    """Remove a file or a folder, if it exists."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def folder_bytes(path: str | Path) -> int:
    """Bytes of all files in a folder; files that disappear meanwhile count as 0."""
    total = 0
    for parent, _, files in os.walk(path):
        for name in files:
            try:
                total += os.stat(os.path.join(parent, name)).st_size
            except FileNotFoundError:
                continue
    return total
