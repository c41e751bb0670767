"""What a visitor does on a page, for tests without a browser."""


def press(button):
    """Press a button of panel-material-ui's."""
    button.clicks += 1


def drop(dropper, files):
    """Drop files, in pieces [(name, content), …]; those of one name are one file."""
    dropper.hear({"begin": True})
    for name, content in files:
        dropper.hear({"name": name, "data": content})
    dropper.hear({"end": True})
