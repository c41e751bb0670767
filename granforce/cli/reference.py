"""The reference of the public names, as one page of HTML.

All of it is read from the sources and nothing is imported, so that it is there at once: signatures
as they are written, docstrings, the shapes and units that stand beside the fields of records,
examples from `examples.md` (which the tests run), and the source itself.
"""

from __future__ import annotations

import ast
import html
import re
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import granforce

HOUSE = Path(granforce.__file__).parent
EXAMPLES = Path(__file__).with_name("examples.md")

# Arguments that mean the same wherever they are taken.
COMMON = {
    "ensemble": "the Ensemble S of a packing, see `ensemble`",
    "packing": "a Packing",
    "states": "networks (…, N_c, 2), force",
    "mu": "friction coefficient μ, a finite number ≥ 0",
    "seed": "of the random numbers, a whole number ≥ 0: the same one gives the same result",
    "workers": "threads or processes; their number changes no result",
    "progress": "a function progress(done, total), called as the work goes on",
    "cancel": "a function that is asked whether to end; where it says True, Cancelled is raised or "
    "what there is is returned",
    "most_grains": "how many grains are taken from a file; more are refused",
    "backend": '"bokeh" or "matplotlib"',
    "options": "by name, handed on to the function that is named",
}

Definition = ast.FunctionDef | ast.ClassDef


class Entry(NamedTuple):
    """A public name, and where it is defined."""

    name: str  # as one calls it: gf.name
    room: str  # module that says what this and what stands beside it is about
    path: Path
    node: Definition

    @property
    def docstring(self) -> str:
        return ast.get_docstring(self.node) or ""


@cache
def entries() -> list[Entry]:
    """Every public name, in the order of `granforce.__all__`; those of a module as module.name."""
    found = []
    for name, home in granforce._HOME.items():
        if home:
            found.append(_entry(name, home, name))
        else:
            found += [_entry(f"{name}.{one}", name, one) for one in _listed(name)]
    return found


def _entry(name: str, home: str, sought: str) -> Entry:
    path, node = _definition(home, sought)
    inside = _file(home)
    room = home if inside.name == "__init__.py" else home.rpartition(".")[0] or home
    return Entry(name, room, path, node)


def _file(module: str) -> Path:
    stem = HOUSE.joinpath(*module.split("."))
    return stem / "__init__.py" if stem.is_dir() else stem.with_suffix(".py")


@cache
def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _definition(module: str, name: str) -> tuple[Path, Definition]:
    """The file and the definition of a name, which a room may have from one of its modules."""
    path = _file(module)
    for node in _tree(path).body:
        if isinstance(node, Definition) and node.name == name:
            return path, node
        if isinstance(node, ast.ImportFrom) and name in {alias.name for alias in node.names}:
            return _definition(str(node.module).removeprefix("granforce."), name)
    raise LookupError(f"{path} does not define {name}")


def _listed(module: str) -> Iterator[str]:
    """Functions and classes in `__all__` of a room; of what is itself a module, nothing."""
    for node in _tree(_file(module)).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            names = ast.literal_eval(node.value)
            yield from (one for one in names if not _file(f"{module}.{one}").exists())


def examples() -> dict[str, str]:
    """The example of each name that has one, as it stands in `examples.md`."""
    found = re.findall(
        r"^## (\S+)\n.*?^```python\n(.*?)^```$", EXAMPLES.read_text("utf-8"), re.M | re.S
    )
    return {name.removeprefix("gf."): code for name, code in found}


def page() -> str:
    """The reference, as HTML that needs nothing else."""
    rooms: dict[str, list[Entry]] = {}
    for entry in entries():
        rooms.setdefault(entry.room, []).append(entry)
    shown = examples()
    common = "".join(
        f"<tr><td><code>{name}</code></td><td>{_inline(text)}</td></tr>"
        for name, text in COMMON.items()
    )
    aside = "".join(
        f"<h2>{html.escape(room)}</h2>"
        + "".join(f'<a href="#{e.name}">{e.name.rpartition(".")[2]}</a>' for e in inside)
        for room, inside in rooms.items()
    )
    main = "".join(
        f"<h2>granforce.{room}</h2>{_prose(ast.get_docstring(_tree(_file(room))) or '')}"
        + "".join(_article(entry, shown.get(entry.name, "")) for entry in inside)
        for room, inside in rooms.items()
    )
    first = (
        "<h1>granforce</h1><p>All public names: <code>import granforce as gf</code>. N disks, M of "
        "them in the backbone, N_c contacts that carry; forces are (f_n, f_t) for each contact in "
        "the packing's units, ⟨f_n⟩ is their mean. Arguments that mean the same everywhere:</p>"
        f"<table>{common}</table>"
    )
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>granforce: reference</title><style>{_STYLE}</style>"
        f"<nav>{aside}</nav><main>{first}{main}</main></html>"
    )


def _article(entry: Entry, example: str) -> str:
    node, place = entry.node, entry.path.relative_to(HOUSE.parent)
    text = entry.path.read_text("utf-8")
    source = "\n".join(text.splitlines()[_first_line(node) - 1 : node.end_lineno])
    if isinstance(node, ast.ClassDef):
        bases = ", ".join(ast.unparse(base) for base in node.bases)
        head, inside = f"{entry.name}({bases})" if bases else entry.name, _members(node, text)
    else:
        head, inside = _signature(node, entry.name), ""
    arguments = [one.arg for one in ast.walk(node) if isinstance(one, ast.arg)]
    shown = f"<h4>Example</h4><pre>{html.escape(example)}</pre>" if example else ""
    return (
        f'<article id="{entry.name}"><h3>{entry.name}</h3>'
        f"<pre>{html.escape(head)}</pre>{_prose(entry.docstring, arguments)}{inside}{shown}"
        f"<details><summary>{place}:{node.lineno}</summary>"
        f"<pre>{html.escape(source)}</pre></details></article>"
    )


def _first_line(node: Definition) -> int:
    return min([node.lineno, *(one.lineno for one in node.decorator_list)])


def _signature(node: ast.FunctionDef, name: str) -> str:
    """name(argument: type = default, …) -> type, as it is written; self is left out."""
    a = node.args
    plain = [*a.posonlyargs, *a.args]
    defaults = [None] * (len(plain) - len(a.defaults)) + a.defaults
    words = [
        _argument(*pair) for pair in zip(plain, defaults, strict=True) if pair[0].arg != "self"
    ]
    if a.vararg:
        words.append(f"*{_argument(a.vararg)}")
    elif a.kwonlyargs:
        words.append("*")
    words += [_argument(*pair) for pair in zip(a.kwonlyargs, a.kw_defaults, strict=True)]
    if a.kwarg:
        words.append(f"**{_argument(a.kwarg)}")
    result = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    line = f"{name}({', '.join(words)}){result}"
    if len(line) <= 88:
        return line
    return f"{name}(\n" + "".join(f"    {word},\n" for word in words) + f"){result}"


def _argument(argument: ast.arg, default: ast.expr | None = None) -> str:
    word = argument.arg
    if argument.annotation:
        word += f": {ast.unparse(argument.annotation)}"
    return word if default is None else f"{word} = {ast.unparse(default)}"


def _members(node: ast.ClassDef, text: str) -> str:
    """Fields with what stands beside them, then what the class can be asked."""
    lines = text.splitlines()
    fields = "".join(
        f"<tr><td><code>{ast.unparse(one.target)}</code></td>"
        f"<td><code>{html.escape(ast.unparse(one.annotation))}</code></td>"
        f"<td>{_inline(_beside(one, lines))}</td></tr>"
        for one in node.body
        if isinstance(one, ast.AnnAssign)
    )
    asked = "".join(
        f"<dt><code>{html.escape(_called(one))}</code></dt>"
        f"<dd>{_prose(ast.get_docstring(one) or '')}</dd>"
        for one in node.body
        if isinstance(one, ast.FunctionDef) and not one.name.startswith("_")
    )
    return (f"<table>{fields}</table>" if fields else "") + (f"<dl>{asked}</dl>" if asked else "")


def _beside(field: ast.AnnAssign, lines: list[str]) -> str:
    """The comment that ends the lines of a field."""
    last = lines[(field.end_lineno or field.lineno) - 1]
    return last.encode()[field.end_col_offset :].decode().partition("#")[2].strip()


def _called(node: ast.FunctionDef) -> str:
    """A method with its arguments, a property as a name."""
    signature = _signature(node, node.name)
    is_property = any("property" in ast.unparse(one) for one in node.decorator_list)
    return signature.replace("()", "", 1) if is_property else signature


def _prose(text: str, arguments: Sequence[str] = ()) -> str:
    """Paragraphs of a docstring; what is set in is shown as it is."""
    return "".join(
        f"<pre>{html.escape(part)}</pre>"
        if part.startswith(" ")
        else f"<p>{_inline(' '.join(part.splitlines()), arguments)}</p>"
        for part in re.split(r"\n\s*\n", text)
        if part.strip()
    )


def _inline(text: str, arguments: Sequence[str] = ()) -> str:
    """Text with `names`, and arguments where they are told, as code; public names are links."""
    public = {entry.name for entry in entries()}
    records = "|".join(name for name in public if name[0].isupper())
    told = "|".join(arguments) or "(?!)"
    names = rf"`+([^`]+)`+|\*\*(\w)\*\*|\b({records})\b|\b({told})(?=:| \([^)]*\):|\()"

    def shown(match: re.Match[str]) -> str:
        quoted, vector, record, argument = match.groups()
        if vector:
            return f"<b>{vector}</b>"
        word = (quoted or record or argument).removeprefix("gf.")
        if word in public and not argument:
            return f'<a href="#{word}"><code>{word}</code></a>'
        return f"<code>{word}</code>"

    return re.sub(names, shown, html.escape(text, quote=False))


_STYLE = """
:root { color-scheme: light dark; font: 16px/1.5 system-ui, sans-serif }
body { margin: 0; display: flex }
nav { position: sticky; top: 0; height: 100vh; overflow: auto; padding: 0 1rem; min-width: 11rem;
      box-sizing: border-box; border-right: 1px solid #8884 }
nav h2 { font-size: .8rem; margin: 1rem 0 .2rem; opacity: .7 }
nav a { display: block; text-decoration: none }
main { padding: 0 1.5rem 4rem; max-width: 54rem; min-width: 0 }
article { border-top: 1px solid #8884; scroll-margin-top: 0 }
pre { overflow: auto; background: #8882; padding: .6rem; border-radius: 4px; font-size: .85rem }
code { font-size: .9em } td { vertical-align: top; padding: .15rem .8rem .15rem 0 }
summary { cursor: pointer; opacity: .75; font-size: .85rem } dd p { margin: .2rem 0 .6rem }
@media (max-width: 50rem) { nav { display: none } }
"""
