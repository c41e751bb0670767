"""Scripts of the page's own components."""

from pathlib import Path


def joined(*names):
    """One module from these scripts: a component has no address to import others from."""
    return "\n".join(Path(__file__).with_name(f"{name}.js").read_text() for name in names)
