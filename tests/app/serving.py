"""The app served as a visitor gets it, and what is asked of a page in a browser."""

import os
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from contextlib import contextmanager
from pathlib import Path

from small_store import ROOT

CHROMIUM = Path(os.environ.get("CHROMIUM", "/usr/bin/chromium"))
FLAGS = ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"]
# Closed pages are soon given up, but not too soon for a busy machine: a session given
# up before its page has connected comes back without what panel serve knows of it.
CLOSED = ("--unused-session-lifetime", "10000", "--check-unused-sessions", "500")
MODEL = "Bokeh.documents[0].get_model_by_name"


@contextmanager
def serve(folder, *options, **variables):
    """Address and process of the app on a free port; its cache and log are in folder."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    env = os.environ | variables
    env.setdefault("GRANFORCE_CACHE", str(folder / "cache"))
    # The program, not `python -m panel`, which would find modules in the working folder too.
    panel = Path(sys.executable).with_name("panel")
    command = [str(panel), "serve", "app", "--port", str(port), *options]
    with open(folder / "log", "w") as log:
        server = subprocess.Popen(command, cwd=ROOT, env=env, stdout=log, stderr=log)
    try:
        _wait_until_served(
            f"http://localhost:{port}/static/js/bokeh.min.js", server, folder / "log"
        )
        yield f"http://localhost:{port}/app", server
    finally:
        server.terminate()
        server.wait(20)


def _wait_until_served(url, server, log):
    for _ in range(300):
        if server.poll() is not None:
            raise RuntimeError(f"the server ended: {log.read_text()}")
        try:
            urllib.request.urlopen(url, timeout=30).close()
            return
        except (urllib.error.URLError, ConnectionError):
            time.sleep(0.1)
    raise RuntimeError(f"nothing served: {log.read_text()}")


def painted(page, timeout=30_000):
    """Wait until the packing has been painted; how many frames were."""
    page.locator(".scene").wait_for(timeout=timeout)
    scene = page.locator(".scene").element_handle()
    page.wait_for_function("scene => scene.scene.painted > 0", arg=scene, timeout=timeout)
    return page.evaluate("scene => scene.scene.painted", scene)


def column(page, source, name):
    """A column of a plot as the browser holds it."""
    return page.evaluate(f"() => Array.from({MODEL}('{source}').get_column('{name}'))")


def scene(page, expression):
    """An expression of `scene`, the Scene of the packing (app/views/scene.js)."""
    return page.locator(".scene").evaluate(
        f"element => {{ const {{scene}} = element; return {expression} }}"
    )
