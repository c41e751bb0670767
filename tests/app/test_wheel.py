"""The wheel brings the page and its precomputed results; `granforce app` opens it."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import urllib.request

import pytest
from serving import CHROMIUM, FLAGS, MANY, PATIENCE, free_port, painted, wait_until_served
from small_store import ROOT

SOURCES = ("app", "data", "granforce", "LICENSE", "README.md", "pyproject.toml")


def test_every_package_is_in_the_wheel():
    """Those of the app and the data are mapped into granforce; all others are listed."""
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    found = [init.parent.relative_to(ROOT) for init in ROOT.glob("[ag]*/**/__init__.py")]
    names = [".".join(folder.parts) for folder in found if folder.parts[0] in ("app", "granforce")]
    inside = [name if name.startswith("granforce") else f"granforce.{name}" for name in names]
    assert sorted(listed) == sorted([*inside, "granforce.data"])


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Folder of the programs of a fresh environment with the wheel, and this one's libraries."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    source.mkdir()
    for name in SOURCES:  # what building leaves behind stays out of the checkout
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, source / name)
    pip = [sys.executable, "-m", "pip", "-q", "--disable-pip-version-check"]
    built = subprocess.run(
        [*pip, "wheel", "--no-deps", "-w", str(folder), str(source)], capture_output=True, text=True
    )
    if "No matching distribution found for setuptools" in built.stderr:
        pytest.skip("setuptools, which builds wheels, can be had from no index here")
    assert built.returncode == 0, built.stderr
    (wheel,) = folder.glob("*.whl")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder / "env")], check=True)
    python = folder / "env" / "bin" / "python"
    (packages,) = (folder / "env").glob("lib/python*/site-packages")
    libraries = [path for path in sys.path if path.endswith("site-packages")]
    (packages / "libraries.pth").write_text("\n".join(libraries))
    subprocess.run([*pip, "--python", str(python), "install", "--no-deps", str(wheel)], check=True)
    return python.parent


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
