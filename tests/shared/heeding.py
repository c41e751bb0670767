"""Ctrl-C in tests, also behind a shell that has it ignored (`pytest &`), sent once it matters."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path


def heed():
    """Ctrl-C ends what runs here."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def heeding(*words, **options):
    """Python begun with these words, which Ctrl-C ends; options: of subprocess.Popen."""
    pipes = dict.fromkeys(("stdout", "stderr"), subprocess.PIPE)
    command = [sys.executable, *words]
    return subprocess.Popen(command, text=True, preexec_fn=heed, **pipes, **options)


def computed(running):
    """Seconds that a process has computed for (Linux)."""
    told = Path(f"/proc/{running.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(told[11]) + int(told[12])) / os.sysconf("SC_CLK_TCK")


def until_it_left(folder, pattern, count, running, patience=300):
    """Wait until a process has left so many entries in a folder."""
    end = time.monotonic() + patience
    while len(list(folder.glob(pattern))) < count:
        assert time.monotonic() < end and running.poll() is None
        time.sleep(0.01)


def interrupted(running):
    """Ctrl-C, as a terminal sends it to workers too: all end quietly, what is finished is kept."""
    os.killpg(running.pid, signal.SIGINT)
    out, err = running.communicate(timeout=300)
    assert running.returncode == 130
    assert out == ""
    assert "Traceback" not in err, err
    assert re.search(
        r"interrupted; saved [1-9]\d* of \d+ cells; run the same command again to continue\n$", err
    )


def until_it_computes(running, seconds=0.3, patience=300):
    """Wait until a process has computed for so many seconds from now on, at whatever load."""
    end, before = time.monotonic() + patience, computed(running)
    while computed(running) < before + seconds:
        assert time.monotonic() < end and running.poll() is None
        time.sleep(0.01)
