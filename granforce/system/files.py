"""Files for the user: written completely or not at all, and replacing only regular files."""

import errno
import os
import re
import secrets
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from granforce.records import InputError, brief

# Files that are already open, by any of their names.
_OPEN_FILE = re.compile(r"/dev/(stdin|stdout|stderr|fd/.*)|/proc/[^/]+/fd/.*")


MOST_STREAMED = 2**30  # bytes read from a device or a pipe, which may never end

ASIDE = ".granforce-{}.part"  # a file being written


def sibling(path: Path) -> Path:
    """A separate path for a file that will be moved to `path`, short enough for any name."""
    return path.with_name(ASIDE.format(secrets.token_hex(8)))


@contextmanager
def written(path: str | Path) -> Iterator[IO[bytes]]:
    """An open binary file whose contents appear at path when the block ends without error.

    A new file gets the mode given by the umask, an existing one keeps its mode; links are followed.
    Devices, pipes and open files (/dev/stdout) cannot be replaced: they are written to directly.
    Raises InputError if that is not possible.
    """
    path = expanded(path)
    with _refusing(path):
        regular = _regular(path)
        if regular is None:
            with open(path, "wb") as file:
                yield file
            return
        target, mode = regular
        aside = sibling(target)
        try:
            with open(os.open(aside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666), "wb") as file:
                yield file
            if mode is not None:
                os.chmod(aside, mode)
            os.replace(aside, target)
        except BaseException:
            with suppress(OSError):
                os.unlink(aside)
            raise


def content_of(path: str | os.PathLike[str], most: int | None = None) -> bytes:
    """The bytes of a file, a device or a pipe.

    most: largest number of bytes; by default unlimited for a file, otherwise MOST_STREAMED. Raises
    InputError if there are more, or the file cannot be read.
    """
    path = path_text(path)
    try:
        with open(path, "rb") as file:
            if most is None and not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                most = MOST_STREAMED
            content = file.read(-1 if most is None else most + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read ({reason}); check the path") from None
    if most is not None and len(content) > most:
        raise InputError(f"{path}: more than {most / 1e6:g} MB; give a smaller file")
    return content


def check_file(path: str | Path) -> None:
    """InputError unless a file can be written at path; nothing there is created or changed.

    Permissions are not sufficient: a new file is created next to it and removed.
    """
    path = expanded(path)
    with _refusing(path):
        regular = _regular(path)
        if regular is not None and not _may_write(regular[0].parent):
            raise PermissionError(errno.EACCES, f"the folder {regular[0].parent} is not writable")
        if regular is not None:
            aside = sibling(regular[0])
            os.close(os.open(aside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
            os.unlink(aside)


# Paths, each with its name, such as an option.
Named = Sequence[tuple[str, str | Path]]


def check_apart(
    *, replaced: Named = (), folders: Named = (), stores: Named = (), read: Named = ()
) -> None:
    """InputError if writing would destroy files that are read or written elsewhere; follows links.

    replaced: files, or whole folders, that will be replaced; folders: those to which files are
    added; stores: those to which entries are added; read: files and folders that are read.
    """
    for label, path in (*replaced, *folders):
        if not str(path):
            raise InputError(f"{label}: the name is empty; give one")
    every = [(label, path, _places(path)) for label, path in (*replaced, *folders, *stores, *read)]
    first_store, first_read = len(replaced) + len(folders), len(every) - len(read)
    for k, (label, path, places) in enumerate(every[:first_store]):
        for j, (other, its_path, its_places) in enumerate(every):
            if j == k or not places or not its_places:
                continue
            within = k < len(replaced) and places[0] in its_places
            stored = first_store <= j < first_read and its_places[0] in places
            if places[0] == its_places[0] or within or stored:
                raise InputError(
                    f"{label} {path} would overwrite {other} {its_path}; choose another name"
                )


def _places(path: str | Path) -> list[object]:
    """The identity of a file or folder, then those of the folders that contain it.

    Empty for things that cannot be replaced, such as a device or a pipe.
    """
    target = Path(os.path.realpath(expanded(path)))
    try:
        mode = target.stat().st_mode
        if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
            return []
    except FileNotFoundError:
        pass
    except OSError:  # reported when it is opened
        return []
    return [_place(one) for one in (target, *target.parents)]


def _place(path: Path) -> object:
    try:
        status = path.stat()
    except OSError:
        return str(path)
    return status.st_dev, status.st_ino


def make_folder(path: str | Path) -> Path:
    """The folder at path, created with its parents if missing; InputError unless writable."""
    path = expanded(path)
    with _refusing(path):
        path.mkdir(parents=True, exist_ok=True)
        if not _may_write(path):
            raise PermissionError(errno.EACCES, "Permission denied")
    return path


def path_text(path: Any) -> str:
    """A path as text; InputError for anything else, such as a number, which opens a descriptor."""
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(f"a path must be text or a pathlib.Path, got {brief(path)}")
    return os.fspath(path)


def expanded(path: str | Path) -> Path:
    """The path with ~ and ~user expanded; InputError for an invalid path."""
    try:
        full = Path(path_text(path)).expanduser()
    except RuntimeError:
        raise InputError(f"{path}: there is no such user, or none with a home folder") from None
    if "\0" in str(full):
        raise InputError(f"{str(full)!r} cannot be a path: it holds a null character")
    if not full.is_absolute():
        try:
            os.getcwd()
        except FileNotFoundError:
            raise InputError(
                f"{path}: the working folder was removed; change to another one"
            ) from None
    return full


def _regular(path: str | Path) -> tuple[Path, int | None] | None:
    """(file to which path leads, its mode or None if missing), or None if not a regular file."""
    path = os.path.abspath(path)
    if _OPEN_FILE.fullmatch(path):
        return None  # even if it leads to a file: another program has it open
    target = Path(os.path.realpath(path))
    try:
        status = target.stat()
    except FileNotFoundError:
        target.parent.stat()  # reveals a missing folder
        return target, None
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, "it is a folder")
    if not stat.S_ISREG(status.st_mode):
        return None
    if not _may_write(target):
        raise PermissionError(errno.EACCES, "Permission denied")
    return target, stat.S_IMODE(status.st_mode)


def _may_write(path: Path) -> bool:
    return os.access(path, os.W_OK, effective_ids=os.access in os.supports_effective_ids)


@contextmanager
def _refusing(path: Path) -> Iterator[None]:
    """Convert errors of the operating system to one line; a closed reader is not an error."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror or error}") from None
