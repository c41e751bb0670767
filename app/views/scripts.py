"""The page's own components, and their scripts."""

from pathlib import Path

from panel.custom import JSComponent

FOLDER = Path(__file__).parent


def joined(*names):
    """One module from these scripts: a component has no address to import others from."""
    return "\n".join((FOLDER / f"{name}.js").read_text() for name in names)


def said(message):
    """The message of a script, a dict; an empty one for what no script can have sent."""
    return message if isinstance(message, dict) and _from_browser(message) else {}


def _from_browser(part):
    """Whether all whole numbers are such as browsers have: larger ones are no floats either."""
    if isinstance(part, dict | list):
        return all(map(_from_browser, part.values() if isinstance(part, dict) else part))
    return not isinstance(part, int) or abs(part) <= 2**53


class Scripted(JSComponent):
    """A component whose script the browser runs as it is written.

    Panel takes it for TypeScript and has each page translate it, unless it has been bundled: that
    took 0.2 s of the time until a page was complete, half of it before its first picture.
    """

    def _get_properties(self, doc):
        properties = super()._get_properties(doc)
        if not properties["dev"]:  # where scripts may change under the same name
            properties["bundle"] = type(self).__name__
        return properties
