"""Scripts of the page's own components."""

from pathlib import Path

FOLDER = Path(__file__).parent


def joined(*names):
    """One module from these scripts: a component has no address to import others from."""
    return "\n".join((FOLDER / f"{name}.js").read_text() for name in names)
