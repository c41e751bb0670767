"""Visitors who reload, leave, ask for too much, or are there when the server is killed.

Whatever they do, the next visitor's computation begins and ends, and no thread of the server dies.
"""

import json
import re
import subprocess
import sys
import urllib.request

import pytest
from serving import CLOSED, expect, free_port, painted, serve, wait_until_served
from small_store import ROOT

LONG = "?mu=0.2&n=60&states=20000&seed={}&relax=gauss_seidel_only"  # minutes, unless it is ended
LARGEST = "9" * 300


@pytest.fixture(scope="module")
def address(shipped, tmp_path_factory):
    """Address of the app, which soon gives closed pages up; at the end all its threads are there.

    Warmed up: there, too, a page is made and ended before its work.
    """
    folder = tmp_path_factory.mktemp("served")
    with serve(folder, "--warm", *CLOSED, GRANFORCE_DATA=str(shipped)) as (url, _):
        yield url
    log = (folder / "log").read_text()
    for word in ("Exception in thread", "NameError", "failed with following error", "could not be"):
        assert word not in log, log


@pytest.fixture
def page(context):
    """An empty page."""
    page = context().new_page()
    yield page
    page.close()


def computing(page):
    """Wait until states are being computed for the page, or for another one that it waits for."""
    page.get_by_text("of 20000 networks").or_(
        page.get_by_text("already under way")
    ).first.wait_for()


def computes(page, address, seed):
    """Another computation is asked for, and succeeds."""
    page.goto(f"{address}?mu=0.2&n=30&states=5&seed={seed}")
    there = re.compile(f"^N = 30, seed {seed}, 5 networks")  # among the finished results
    page.locator("option", has_text=there).first.wait_for(state="attached")


def test_after_three_reloads_while_computing_another_computation_succeeds(page, address):
    page.goto(address + LONG.format(1))
    computing(page)
    for _ in range(3):
        page.reload()
        computing(page)
    computes(page, address, 11)


def test_pages_that_are_asked_for_and_never_shown_hold_no_thread(page, address):
    """Their work is ended when the server gives the pages up."""
    for seed in range(2, 6):
        urllib.request.urlopen(address + LONG.format(seed), timeout=60).close()
    computes(page, address, 12)


def test_many_pages_opened_and_closed_while_computing(page, address):
    # By a page, as a visitor's browser does: Playwright's own close may wait for ever.
    page.goto(address)
    for number in range(8):
        with page.expect_popup() as opened:
            asked = address + LONG.format(20 + number % 3)
            page.evaluate("url => { window.opened = window.open(url) }", asked)
        if number % 4 == 0:
            computing(opened.value)
        page.evaluate("opened.close()")
    computes(page, address, 13)


SELECTION = (
    "mu", "packed", "n", "seed", "states", "walkseed", "sweeps", "dt", "box_mass", "pressure",
    "radii", "source", "relax", "packing",
)  # fmt: skip
VIEW = (
    "tab", "contact", "frame", "reference", "between", "colour", "thickness", "sort",
    "scale",
)  # fmt: skip


@pytest.mark.parametrize(
    "names, given, told",
    [
        (SELECTION, "", "this link cannot be read: source must be walk or uniform"),
        (VIEW, "mu=0.1&n=30&states=30&relax=nearest_piqp&", "seen in all 30 networks"),
    ],
    ids=["every parameter", "every choice of the view"],
)
def test_a_link_with_the_largest_numbers_computes_nothing(page, address, names, given, told):
    """One line says what is too large, and the usual states are seen; each alone: test_app.py."""
    page.goto(f"{address}?{given}{'&'.join(f'{name}={LARGEST}' for name in names)}")
    painted(page)
    page.get_by_text(told).filter(visible=True).first.wait_for()
    expect(page.get_by_role("button", name=re.compile("Cancel|Discard"))).to_have_count(0)


def test_the_largest_allowed_of_everything_can_be_cancelled(page, address):
    # But of μ: at 1000 a packing may have one network only, whose walk ends before it is seen.
    largest = {
        "n": 60, "states": 20_000, "mu": 0.2, "relax": "gauss_seidel_only",
        "seed": 2**53 - 1, "walkseed": 2**53 - 1,
        "sweeps": 1000, "dt": 0.1, "box_mass": 10_000, "pressure": 1e6, "radii": "uniform:1,20",
    }  # fmt: skip
    page.goto(f"{address}?{'&'.join(f'{key}={value}' for key, value in largest.items())}")
    # Discard once there are states to keep.
    cancel = page.get_by_role("button", name=re.compile("Cancel|Discard"))
    cancel.first.click()
    cancel.first.wait_for(state="hidden")
    computes(page, address, 15)


@pytest.mark.parametrize(
    "option, words",
    [
        ("--num-threads=2", "cannot run with --num-threads"),
        ("--num-procs=2", "cannot run with --num-procs"),
        ("--autoreload", "cannot run with --autoreload"),
    ],
)
def test_a_server_that_could_not_serve_is_refused_at_its_start(tmp_path, option, words):
    with serve(tmp_path, option, wait=False) as (_, server):
        assert server.wait(300) == 2
    lines = (tmp_path / "log").read_text().splitlines()
    assert words in lines[-1] and "Traceback" not in "".join(lines)


def test_a_server_says_that_it_is_alive(tmp_path):
    """As `granforce app` serves it."""
    port = free_port()
    words = [sys.executable, "-m", "granforce.cli", "app", "--no-show", "--port", str(port)]
    with open(tmp_path / "log", "w") as log:
        server = subprocess.Popen(words, cwd=ROOT, stdout=log, stderr=log)
    try:
        wait_until_served(f"http://localhost:{port}/health", server, tmp_path / "log")
        with urllib.request.urlopen(f"http://localhost:{port}/health") as answer:
            assert answer.status == 200 and json.load(answer) == {"alive": True}
    finally:
        server.terminate()
        server.wait(20)


def test_limits_that_cannot_be_read_keep_the_server_from_starting(tmp_path):
    with pytest.raises(RuntimeError, match="the server ended"):
        with serve(tmp_path, "--warm", GRANFORCE_LIMITS="disks=4") as _:
            pass
    (line,) = (tmp_path / "log").read_text().splitlines()
    assert line.startswith("GRANFORCE_LIMITS: 'disks=4' is not one of n, states, upload")
