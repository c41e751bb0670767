"""Tables in Markdown, and generated text between <!-- KIND: NAME --> and <!-- end -->."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path

from granforce.records import InputError
from granforce.system.files import written

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def mark(kind: str) -> re.Pattern[str]:
    """The pattern of a part of this kind: its first line, its name, and its last line."""
    return re.compile(rf"(<!-- {kind}: (\w+) -->\n).*?(<!-- end -->)", re.S)


def marked_files(files: str | None, kind: str) -> list[Path]:
    """The paths of files separated by commas, or none; InputError for files without a part."""
    paths = [Path(name) for name in (files or "").split(",") if name]
    for path in paths:
        if not path.is_file() or not mark(kind).search(path.read_text()):
            raise InputError(f"--documents: {path} is not a file that contains <!-- {kind}: … -->")
    return paths


def renew(paths: Sequence[Path], kind: str, text_of: Callable[[Path, str], str]) -> None:
    """Write text_of(path, name) into every part of this kind."""

    def renewed(path: Path) -> str:
        return mark(kind).sub(lambda m: m[1] + text_of(path, m[2]) + m[3], path.read_text())

    for path in paths:
        text = renewed(path)
        with written(path) as file:
            file.write(text.encode())


def typeset(text: str) -> str:
    """Text with true minus signs, and powers of ten instead of 1e-05."""
    text = _POWER.sub(_raised, text)
    return _MINUS.sub("−", text)


_POWER = re.compile(r"(?<![\w.])(\d(?:\.\d+)?)e([+-]\d+)")
_MINUS = re.compile(r"(?<![\w|])-(?=\d)")


def _raised(found: re.Match[str]) -> str:
    digits, power = found[1], f"10{str(int(found[2])).translate(RAISED)}"
    return power if digits == "1" else f"{digits}·{power}"


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown with escaped cells."""
    rows = [[cell.replace("|", "\\|") for cell in row] for row in rows]
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
