"""Documentation pages generated from code: library, command line, symbols, and the gallery."""

import argparse
import contextlib
import importlib
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import granforce
from granforce import glossary
from granforce.cli.parser import make_parser
from granforce.fields import fields
from granforce.quantities import Field
from granforce.system.markdown import table

HERE = Path(__file__).parent
EXAMPLES = HERE / "examples.md"
GALLERY = HERE / "pages" / "gallery.md"
DATA = next(  # inside an installed wheel, next to the package in a clone
    folder for folder in (HERE.parent / "data", HERE.parents[1] / "data") if folder.is_dir()
)
DRAWN = re.compile(r"\((?:\.\./)+data/(?:figures/|tables/)?(\w+\.(?:png|csv))\)")  # in the sources
FORMULA = re.compile(r"\$\$(.+?)\$\$", re.S)  # LaTeX, shown as MathML
SHOWN = re.compile(r"^## ([^\n]+)\n(.*?)(^```python\n(.*?)^```\n)", re.M | re.S)

# The theme reserves five words for every column of a table, however narrow its content; Chromium
# ignores the columnalign of MathML.
STYLE = """.md-typeset table:not([class]) th { min-width: 0 }
mtd[columnalign="left"] { text-align: left }
mtd[columnalign="right"] { text-align: right }
"""

# Pages whose sections the search lists before others: definitions, and how to install.
FOUND_FIRST = {"reference/symbols.md": 10, "index.md": 3}

FIRST = ("pack", "ensemble", "intervals", "walk", "sample_uniform", "plot")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add generated pages, and the figures and tables of the study."""
    for name, text in (
        ("reference/library.md", library()),
        ("reference/cli.md", command_line()),
        ("reference/symbols.md", symbols()),
        ("style.css", STYLE),
    ):
        files.append(File.generated(config, name, content=text))
    for path in (
        *sorted((DATA / "figures").glob("*.png")),
        *sorted((DATA / "tables").glob("*.csv")),
        DATA / "bench.png",
    ):
        files.append(File.generated(config, f"figures/{path.name}", abs_src_path=str(path)))
    for name, picture in gallery():
        files.append(File.generated(config, f"figures/{name}.png", content=picture))
    return Files(list(files))


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Link figures to their place on the site, and show those of the gallery."""
    if page.file.src_uri in FOUND_FIRST:
        page.meta["search"] = {"boost": FOUND_FIRST[page.file.src_uri]}
    up = "../" * page.url.count("/")
    markdown = DRAWN.sub(rf"({up}figures/\1)", markdown)
    markdown = FORMULA.sub(formula, markdown)
    if page.file.src_uri == GALLERY.name:
        markdown = SHOWN.sub(pictured, markdown)
    return markdown


def formula(found: re.Match[str]) -> str:
    return f'<div style="overflow-x: auto">{convert(found[1], display="block")}</div>'


def gallery() -> Iterator[tuple[str, bytes]]:
    """Name and PNG of every picture of the gallery, drawn by the code shown with it."""
    with contextlib.chdir(DATA.parent), tempfile.TemporaryDirectory() as folder:
        for heading, _, _, code in SHOWN.findall(GALLERY.read_text()):
            names: dict[str, Any] = {}
            exec(code, names)
            path = Path(folder) / f"{picture_name(heading)}.png"
            granforce.figures.save(names["figure"], path)
            yield path.stem, path.read_bytes()


def picture_name(heading: str) -> str:
    return "gallery_" + "_".join(re.findall(r"\w+", heading.lower()))


def pictured(match: re.Match[str]) -> str:
    """A section of the gallery with its picture above the code."""
    heading, text, block, _ = match.groups()
    picture = f"![{heading}](figures/{picture_name(heading)}.png)"
    return f"## {heading}\n{text}{picture}\n\n{block}"


def library() -> str:
    """Every public name by the question it answers, with its example."""
    shown = examples()
    first = ", ".join(f"[`{name}`][granforce.{granforce._HOME[name]}.{name}]" for name in FIRST)
    text = (
        "# Library\n\nAll public names, as `import granforce as gf` gives them.\n\n"
        f"Start with {first} and [`measures`](#measures-of-states).\n"
    )
    for question, names in granforce._BY_QUESTION.items():
        entries = (entry(*one, shown) for name in names for one in entry_names(name))
        text += f"\n## {question}\n\n" + "\n".join(entries)
    rest = "".join(f"\n### {name}\n{example}" for name, example in shown.items())
    return text + (f"\n## More examples\n{rest}" if rest else "")


def entry_names(name: str) -> list[tuple[str, str]]:
    """Path and name of each entry of a public name: one, or those of a module."""
    if home := granforce._HOME[name]:
        return [(f"{home}.{name}", name)]
    names = importlib.import_module(f"granforce.{name}").__all__
    return [(f"{name}.{one}", f"{name}.{one}") for one in names]


def entry(path: str, name: str, shown: dict[str, str]) -> str:
    """The entry of a public name, with the fields of a record, and its example."""
    heading = f"::: granforce.{path}\n    options:\n      heading_level: 3\n"
    return heading + field_table(getattr(granforce, name, None)) + shown.pop(f"gf.{name}", "")


def field_table(record: Any) -> str:
    """The declared fields of a record as a table; empty for other objects."""
    declared = fields(record) if isinstance(record, type) else {}
    rows = [[f"`{name}`", *described(field)] for name, field in declared.items()]
    heads = ["field", "dimensions", "unit", "meaning"]
    return f"\n{table(heads, rows)}\n" if rows else ""


def described(field: Field) -> list[str]:
    """Dimensions, unit and meaning of a field, for a table."""
    meaning = "; ".join(part for part in (field.meaning, field.note) if part)
    return [", ".join(field.dims.split()), field.unit, meaning]


def examples() -> dict[str, str]:
    """{name: Markdown} of the tested examples."""
    parts = re.split(r"^## (gf\.[\w.]+)\n", EXAMPLES.read_text(), flags=re.M)[1:]
    return dict(zip(parts[::2], parts[1::2], strict=True))


def command_line() -> str:
    """The help of every command."""
    text = "# Command line\n\nThe help of every command, as `granforce COMMAND --help` prints it.\n"
    for action in make_parser().every_action():
        if isinstance(action, argparse._SubParsersAction):
            for parser in dict.fromkeys(action.choices.values()):
                text += f"\n## {parser.prog}\n\n```text\n{parser.format_help()}```\n"
    return text


def symbols() -> str:
    """The glossary: a heading for each term, which the search finds first."""
    terms = sorted(glossary.TERMS.values(), key=lambda term: not term.symbol)
    heads = [f"{term.word}, {term.symbol}" if term.symbol else term.word for term in terms]
    parts = [f"## {head}\n\n{term.sentence}\n" for head, term in zip(heads, terms, strict=True)]
    return "\n".join(["# Symbols and terms\n", *parts])
