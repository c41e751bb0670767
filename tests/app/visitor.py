"""What a visitor does on a page, for tests without a browser."""

import time


def wait_for(state, done=lambda: True, seconds=240):
    """Poll as the page does until no task runs and it is done; the first compile all kernels."""
    end = time.monotonic() + seconds
    state.work.poll()
    while state.work.busy or not done():
        assert time.monotonic() < end
        time.sleep(0.005)
        state.work.poll()


def press(button):
    """Press a button of panel-material-ui's."""
    button.clicks += 1


def drop(dropper, files):
    """Drop files, in pieces [(name, content), …]; those of one name are one file."""
    dropper.hear({"begin": True})
    for name, content in files:
        dropper.hear({"name": name, "data": content})
    dropper.hear({"end": True})
