"""Servers that cannot serve are refused at their start; one that can says that it is alive."""

import json
import runpy
import subprocess
import sys
import urllib.request

import pytest
from panel import config
from serving import free_port, serve, wait_until_served
from small_store import ROOT


@pytest.mark.parametrize(
    "option, given",
    [
        ("--num-procs", {}),
        ("--autoreload", {"autoreload": True}),
        ("--num-threads", {"nthreads": 2}),
    ],
)
def test_a_server_that_could_not_serve_is_refused_at_its_start(option, given, monkeypatch, capsys):
    monkeypatch.setattr(sys, "orig_argv", ["panel", "serve", f"{option}=2"])
    with config.set(**given), pytest.raises(SystemExit) as stop:
        runpy.run_module("app.server_lifecycle")["on_server_loaded"](None)
    assert stop.value.code == 2 and f"cannot run with {option}" in capsys.readouterr().err


def test_a_server_says_that_it_is_alive(tmp_path):
    """As `granforce app` serves it, warmed up: a page is made and ended before its work."""
    port = free_port()
    words = [sys.executable, "-m", "granforce.cli", "app", "--warm", "--no-show"]
    words += ["--port", str(port)]
    with open(tmp_path / "log", "w") as log:
        server = subprocess.Popen(words, cwd=ROOT, stdout=log, stderr=log)
    try:
        wait_until_served(f"http://localhost:{port}/health", server, tmp_path / "log")
        with urllib.request.urlopen(f"http://localhost:{port}/health") as answer:
            assert answer.status == 200 and json.load(answer) == {"alive": True}
    finally:
        server.terminate()
        server.wait(60)
    log = (tmp_path / "log").read_text()
    assert "Exception in thread" not in log, log


def test_limits_that_cannot_be_read_keep_the_server_from_starting(tmp_path):
    with pytest.raises(RuntimeError, match="the server ended"):
        with serve(tmp_path, "--warm", GRANFORCE_LIMITS="disks=4") as _:
            pass
    (line,) = (tmp_path / "log").read_text().splitlines()
    assert line.startswith("GRANFORCE_LIMITS: 'disks=4' is not one of n, states, upload")
