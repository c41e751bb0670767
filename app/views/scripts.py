"""The page's own components, and their scripts."""

from pathlib import Path

from panel.custom import JSComponent

FOLDER = Path(__file__).parent


def joined(*names):
    """One module from these scripts: a component has no address to import others from."""
    return "\n".join((FOLDER / f"{name}.js").read_text() for name in names)


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
