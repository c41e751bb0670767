"""Compiled kernels: the location of numba's cache, messages, and compilation ahead of time.

The location must be set before numba is imported.
"""

import atexit
import functools
import hashlib
import os
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from granforce.system.streams import tell


def find_a_place() -> None:
    """Set a temporary cache folder for numba if it can write neither here nor in the user's cache.

    Without one numba refuses to compile cached kernels, and so every module with kernels fails.
    """
    if os.environ.get("NUMBA_CACHE_DIR") or any(map(_writable, _usual_places())):
        return
    place = temporary_place()
    os.environ["NUMBA_CACHE_DIR"] = place  # inherited by workers
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = place
    tell(
        f"granforce: compiled kernels are saved in {place}, since neither the installation nor "
        "the home folder can be written; set NUMBA_CACHE_DIR to save them elsewhere"
    )


def tell_when_compiling(
    say: Callable[[], object], compiled: Callable[[], object] = lambda: None
) -> Callable[[], None]:
    """Call say() once, as soon as a kernel is compiled that is not in the cache.

    compiled() is called after each compilation. Returns a function that ends this.
    """
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]  # numba has no type hints
        announced = False

        def on_start(self, happening: Any) -> None:
            if not self.announced:
                self.announced = True
                say()

        def on_end(self, happening: Any) -> None:
            compiled()

    listener = Listener()
    event.register("numba:compile", listener)
    return lambda: event.unregister("numba:compile", listener)


def are_cached(last: str) -> bool:
    """Whether kernels are in the cache; last: the "module.kernel" that is compiled last."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    places = [Path(chosen)] if chosen else [Path(__file__).parents[1], *_usual_places()]
    return any(next(place.rglob(f"{last}-*.nbi"), None) for place in places)


def kernels() -> list[Path]:
    """The files of this package's compiled kernels, wherever numba keeps them."""
    from numba.core.caching import _CacheLocator

    chosen = os.environ.get("NUMBA_CACHE_DIR")
    places = [*map(Path, [chosen] if chosen else []), *list(_usual_places())[1:]]
    found: list[Path] = []
    for source in Path(__file__).parents[1].rglob("__init__.py"):
        name = _CacheLocator.get_suitable_cache_subpath(str(source))
        for place in (source.parent / "__pycache__", *(place / name for place in places)):
            found += place.glob("*.nb[ci]")
    return found


_ahead: list[subprocess.Popen[bytes]] = []  # processes that compile for this one


def compile_ahead(statement: str, last: str) -> bool:
    """Run a statement that compiles kernels in a separate process if none are cached yet.

    last: as for `are_cached`. The process ends with this one at the latest. Returns whether there
    was nothing to do.
    """
    if are_cached(last):
        return True
    called = [sys.executable, "-c", f"import os; getattr(os, 'nice', int)(10); {statement}"]
    nowhere = subprocess.DEVNULL  # an error is met again by the process that needs the kernel
    process = subprocess.Popen(called, stdin=nowhere, stdout=nowhere, stderr=nowhere)
    atexit.register(process.terminate)
    _ahead.append(process)
    return False


def wait_for_kernels(check: Callable[[], object]) -> None:
    """Wait for what `compile_ahead` has begun, to compile nothing twice; check() may raise."""
    for process in _ahead:
        while process.poll() is None:
            check()
            time.sleep(0.1)


def skip_unreadable_indices() -> None:
    """Make numba recompile kernels whose cached index refers to a class that no longer exists.

    It unpickles the index before it compares dates, and would raise after an upgrade of granforce.
    """
    from numba.core.caching import IndexDataCacheFile

    read = IndexDataCacheFile._load_index

    def read_or_none(self: Any) -> Any:
        try:
            return read(self)
        except (AttributeError, ImportError):
            return {}

    IndexDataCacheFile._load_index = read_or_none


def recompile_after_any_change() -> None:
    """Make numba recompile all kernels after a change in any file with kernels.

    It compares only the date of the file that a kernel is in, but a kernel contains those that it
    calls, also from other files.
    """
    from numba.core.caching import IndexDataCacheFile

    begin = IndexDataCacheFile.__init__

    def begin_with_all(self: Any, cache_path: str, filename_base: str, source_stamp: Any) -> None:
        begin(self, cache_path, filename_base, (source_stamp, _digest_of_kernels()))

    IndexDataCacheFile.__init__ = begin_with_all


@functools.cache
def _digest_of_kernels() -> str:
    """A digest of all files with kernels."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        content = path.read_bytes()
        if b"numerics.lanes" in content or path.name == "lanes.py":
            digest.update(content)
    return digest.hexdigest()


def _usual_places() -> Iterator[Path]:
    """Where numba looks first: next to the sources, then in the user's cache folder."""
    yield Path(__file__).parent / "__pycache__"
    if os.name == "nt":
        yield Path(os.environ.get("LOCALAPPDATA", "~")).expanduser()
    elif sys.platform == "darwin":
        yield Path("~/Library/Caches/numba").expanduser()
    else:
        yield Path(os.environ.get("XDG_CACHE_HOME", "~/.cache")).expanduser() / "numba"


def _writable(folder: Path) -> bool:
    """Whether files can be created in a folder, or in its first existing parent."""
    while not folder.exists():
        if folder == folder.parent:
            return False
        folder = folder.parent
    return folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)


def temporary_place(folder: str | None = None) -> str:
    """A folder for kernels: always the same one, or a new one if that belongs to someone else.

    folder: its parent, by default that of temporary files.
    """
    if not hasattr(os, "getuid"):
        return tempfile.mkdtemp(prefix="granforce-", dir=folder)
    place = Path(folder or tempfile.gettempdir()) / f"granforce-kernels-{os.getuid()}"
    try:
        place.mkdir(mode=0o700, exist_ok=True)
        status = place.lstat()
        usable = stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid()
        if usable and not status.st_mode & 0o077:
            return str(place)
    except OSError:
        pass
    return tempfile.mkdtemp(prefix="granforce-kernels-", dir=folder)
