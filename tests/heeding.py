"""Ctrl-C in tests, also behind a shell that has it ignored (`pytest &`)."""

import signal


def heed():
    """Ctrl-C ends what runs here; for a child of subprocess.Popen, as its preexec_fn."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
