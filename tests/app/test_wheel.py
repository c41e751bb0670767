"""The wheel brings the page and its precomputed results; `granforce app` opens it."""

import os
import re
import shutil
import subprocess
import sys
import urllib.request
import zipfile
from pathlib import Path

import pytest
from serving import CHROMIUM, FLAGS, MANY, PATIENCE, free_port, painted, wait_until_served
from small_store import ROOT

SOURCES = ("app", "data", "granforce", "LICENSE", "README.md", "pyproject.toml")


PIP = [sys.executable, "-m", "pip", "-q", "--disable-pip-version-check"]


def environment(folder):
    """Python of a fresh environment with this one's libraries, but without granforce."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    libraries = [path for path in sys.path if path.endswith("site-packages")]
    (packages / "libraries.pth").write_text("\n".join(libraries))
    return folder / "bin" / "python"


def pip(*words):
    """Run pip; skip where the build back-end cannot be downloaded."""
    run = subprocess.run([*PIP, *map(str, words)], capture_output=True, text=True)
    if "No matching distribution found for hatchling" in run.stderr:
        pytest.skip("hatchling, which builds wheels, can be had from no index here")
    assert run.returncode == 0, run.stderr


@pytest.fixture(scope="module")
def clone(tmp_path_factory):
    """A copy of the sources in a folder called granforce, as git clones it."""
    source = tmp_path_factory.mktemp("parent") / "granforce"
    source.mkdir()
    for name in SOURCES:  # what building leaves behind stays out of the checkout
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, source / name)
    return source


@pytest.fixture(scope="module")
def wheel(tmp_path_factory, clone):
    folder = tmp_path_factory.mktemp("wheel")
    pip("wheel", "--no-deps", "-w", folder, clone)
    (wheel,) = folder.glob("*.whl")
    return wheel


@pytest.fixture(scope="module")
def installed(wheel):
    """Folder of the programs of a fresh environment with the wheel."""
    python = environment(wheel.parent / "env")
    pip("--python", python, "install", "--no-deps", wheel)
    return python.parent


@pytest.mark.slow
def test_every_module_is_in_the_wheel_and_no_picture_of_a_readme(wheel):
    """Those of the app are mapped into granforce; the documentation shows those of data."""
    found = [
        path.relative_to(ROOT) for room in ("app", "granforce") for path in (ROOT / room).rglob("*")
    ]
    python = {path.as_posix() for path in found if path.suffix in (".py", ".pyi", ".js", ".css")}
    expected = {name if name.startswith("granforce") else f"granforce/{name}" for name in python}
    held = set(zipfile.ZipFile(wheel).namelist())
    assert expected - held == set()
    pictures = {name for name in held if name.endswith((".png", ".webp"))}
    shown = {path.name for path in (ROOT / "data" / "figures").glob("*.png")} | {"bench.png"}
    assert pictures == {name for name in pictures if name.startswith("granforce/data/")}
    assert {Path(name).name for name in pictures} == shown
    assert not [name for name in held if name.endswith("README.md")]
    (metadata,) = (name for name in held if name.endswith("METADATA"))
    described = zipfile.ZipFile(wheel).read(metadata).decode()
    assert "granforce docs" in described
    assert all(link.startswith("https://") for link in re.findall(r"\]\(([^)]+)\)", described))


@pytest.mark.slow
def test_an_editable_install_works_beside_the_clone_and_elsewhere(clone, tmp_path):
    """Its parent holds a folder granforce, which is no package; type checkers find the library."""
    python = environment(tmp_path / "env")
    pip("--python", python, "install", "--no-deps", "-e", clone)
    script = "import granforce as gf\nprint(gf.Packing.__name__)\nx: str = gf.pack(30, 1.0).mu\n"
    for folder in (clone.parent, tmp_path):
        (folder / "own.py").write_text(script.replace("x: str = ", ""))
        run = subprocess.run([python, "own.py"], cwd=folder, capture_output=True, text=True)
        assert run.stdout == "Packing\n", run.stderr
        (folder / "own.py").write_text(script)
        mypy = [sys.executable, "-m", "mypy", "--python-executable", str(python), "own.py"]
        told = subprocess.run(mypy, cwd=folder, capture_output=True, text=True).stdout
        assert 'expression has type "float", variable has type "str"' in told, told


@pytest.mark.slow
def test_the_wheel_holds_the_finished_results(installed, tmp_path):
    code = (
        "import granforce, granforce.app.results.library as data\n"
        f"found = data.Library(cache={str(tmp_path / 'cache')!r})\n"
        "print(granforce.__file__, found.notes, [cell.mu for cell in found.cells()])\n"
    )
    run = subprocess.run(
        [installed / "python", "-c", code], capture_output=True, text=True, cwd=tmp_path
    )
    assert run.stdout.startswith(str(installed.parent)), run.stderr
    assert run.stdout.endswith("[] [0.0, 0.001, 0.01, 0.1, 0.2, 1.0, 10.0]\n")


@pytest.mark.slow
def test_granforce_app_opens_the_page(installed, tmp_path):
    port = free_port()
    command = [installed / "granforce", "app", "--port", str(port), "--no-show"]
    env = os.environ | {"GRANFORCE_CACHE": str(tmp_path / "cache")}
    log = tmp_path / "log"
    with open(log, "w") as file:
        server = subprocess.Popen(command, cwd=tmp_path, env=env, stdout=file, stderr=file)
    try:
        wait_until_served(f"http://localhost:{port}/static/js/bokeh.min.js", server, log)
        with urllib.request.urlopen(f"http://localhost:{port}/app", timeout=60) as answer:
            assert re.search(r"<title>.*granforce.*</title>", answer.read().decode())
        taken = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=env)
        if CHROMIUM.exists():
            _look(f"http://localhost:{port}/app")
    finally:
        server.terminate()
        server.wait(20)
    assert taken.returncode == 2
    assert taken.stderr.count("\n") == 1
    assert "choose another with --address and --port" in taken.stderr
    assert "Traceback" not in log.read_text()


def _look(address):
    """The packing of the precomputed results is painted."""
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as context:
        browser = context.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        page = browser.new_page()
        page.set_default_timeout(2 * PATIENCE)
        page.goto(address + MANY)
        assert painted(page) > 0
        browser.close()
