"""The app's own components, and their scripts."""

import re
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import panel as pn
from bokeh.document import Document
from panel.custom import JSComponent

from .messages import Message, fits
from .panel_patches import once_loaded

APP = Path(__file__).resolve().parents[1]
SHARED = Path(__file__).with_name("shared.css").read_text()  # shared by all styles

# An import of a script, on a line of its own.
IMPORT = re.compile(r'^import \{ ([\w, ]+) \} from "(\.[\w./]+\.js)"$', re.M)
EXPORT = re.compile(r"^export (?=(?:async )?(?:class|function|const) (\w+))", re.M)


def module(path: Path) -> str:
    """One ES module, as text, of a script and everything it imports.

    A saved page has no server to import from. Importing each script separately takes 77 requests
    before the first picture instead of 28, and a browser that cached some of them would mix old and
    new scripts. Each script keeps its names to itself: it becomes a function that returns its
    exports, placed after the scripts that it imports.
    """
    parts: dict[Path, str] = {}
    _gather(path.resolve(), parts, ())
    text = _bound(path.resolve(), parts.pop(path.resolve()))
    return "\n".join([*(_inside(*part) for part in parts.items()), text])


def _gather(path: Path, parts: dict[Path, str], way: tuple[Path, ...]) -> None:
    """Fill parts {path: text} in an order in which each follows the scripts that it imports."""
    if path in way:
        names = " → ".join(one.stem for one in (*way, path))
        raise ValueError(f"scripts import each other: {names}")
    if path in parts:
        return
    text = path.read_text()
    for _, other in IMPORT.findall(text):
        _gather((path.parent / other).resolve(), parts, (*way, path))
    parts[path] = text


def _inside(path: Path, text: str) -> str:
    exported = ", ".join(EXPORT.findall(text))
    plain = EXPORT.sub("", _bound(path, text))
    return f"const {_name(path)} = (() => {{\n{plain}\nreturn {{ {exported} }}\n}})()"


def _bound(path: Path, text: str) -> str:
    """The script with its imports taken from variables."""

    def bound(found: re.Match[str]) -> str:
        return f"const {{ {found[1]} }} = {_name((path.parent / found[2]).resolve())}"

    return IMPORT.sub(bound, text)


def _name(path: Path) -> str:
    """The variable that holds the exports of a script."""
    return "$" + "_".join(path.relative_to(APP).with_suffix("").parts)


class Scripted(JSComponent):
    """A component in its own file, with a script and a style of the same name next to it.

    The browser runs the script as written. Panel treats it as TypeScript and makes each page
    translate it, unless it is bundled: this took 0.2 s of the time to a complete page, half of it
    before its first picture.
    """

    to_browser: ClassVar[tuple[Message, ...]] = ()  # shapes of the messages to the script
    _handlers: ClassVar[list[tuple[Message, Callable[..., object]]]] = []

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        path = Path(str(sys.modules[cls.__module__].__file__)).with_suffix(".js")
        cls._esm = module(path)
        cls._stylesheets = [SHARED, path.with_suffix(".css").read_text()]
        cls._handlers = [
            (shape, method)
            for method in vars(cls).values()
            for shape in getattr(method, "from_browser", ())
        ]

    def __init__(self, **params: Any) -> None:
        super().__init__(**params)  # type: ignore[no-untyped-call]  # param has no type hints

    def _get_properties(self, doc: Document | None) -> dict[str, Any]:
        properties = super()._get_properties(doc)
        if not properties["dev"]:  # in dev mode scripts may change under the same name
            properties["bundle"] = type(self).__name__
        return properties

    def tell(self, message: Message) -> None:
        """Send a message to the script; ValueError if it is not in `to_browser`."""
        if not any(fits(message, shape) for shape in self.to_browser):
            raise ValueError(f"no message of {type(self).__name__}: {', '.join(message)}")
        self._send_msg(message)

    def hear(self, message: Any) -> None:
        """Handle a message from the script, unless it has no handler: a page may be altered."""
        for shape, handle in self._handlers:
            if fits(message, shape):
                handle(self, **{name: message[name] for name in shape if shape[name] is not True})

    def _handle_msg(self, data: Any) -> None:
        # The answer may change parameters, and those changes are lost while the page is in transit.
        once_loaded(pn.state.curdoc, partial(self.hear, data))
