"""Where kernels are kept when neither the installation nor the home folder can be written."""

import os
import shutil
import stat
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
from numba.core import event
from numba.core.caching import IndexDataCacheFile

import granforce
from granforce.numerics import lanes
from granforce.records import Cancelled
from granforce.system import cancelling, compiled

PACKAGE = Path(granforce.__file__).parent


@pytest.fixture
def installed(tmp_path):
    """A copy of the package beside which nothing can be written, by root either."""
    shutil.copytree(PACKAGE, tmp_path / "granforce", ignore=shutil.ignore_patterns("__pycache__"))
    for folder in [tmp_path / "granforce", *(tmp_path / "granforce").rglob("*/")]:
        (folder / "__pycache__").write_text("")
    return tmp_path


IMPORT = "import granforce.packing.neighbours\nprint(granforce.__file__)\n"
USE = (
    "import numpy as np\n"
    "x, r = np.array([[0.0, 0.0], [2.0, 0.0]]), np.ones(2)\n"
    "from granforce.records import Cell\n"
    "cell = Cell(np.full(2, np.inf), 0.0)\n"
    "pairs = granforce.packing.neighbours.find_pairs(x, r, cell, 0.1)\n"
    "assert len(pairs[0]) == 1\n"
)


def run(installed, code=IMPORT, **environment):
    """Import kernels from the copy in a process of its own; what it said on stderr."""
    usual = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    done = subprocess.run(
        [sys.executable, "-B", "-c", code],
        env=usual | {"PYTHONPATH": str(installed), "TMPDIR": str(installed)} | environment,
        cwd=installed,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == str(installed / "granforce" / "__init__.py")
    return done.stderr


def test_a_temporary_folder_serves_where_nothing_else_can_be_written(installed):
    """The second time there is nothing left to compile."""
    nowhere = str(installed / "granforce" / "__pycache__" / "home")  # below a file
    kept = installed / f"granforce-kernels-{os.getuid()}"
    made = []
    for _ in range(2):
        said = run(installed, IMPORT + USE, HOME=nowhere)
        assert len(said.splitlines()) == 1
        assert "NUMBA_CACHE_DIR" in said and str(kept) in said
        made.append({path.stat().st_mtime_ns for path in kept.rglob("*.nbc")})
    assert made[0] and made[0] == made[1]
    assert stat.S_IMODE(kept.stat().st_mode) == 0o700


def test_nothing_is_said_where_a_home_or_a_setting_serves(installed):
    home = installed / "home"
    home.mkdir()
    assert run(installed, HOME=str(home)) == ""
    nowhere = str(installed / "granforce" / "__pycache__" / "home")
    assert run(installed, HOME=nowhere, NUMBA_CACHE_DIR=str(home / "own")) == ""
    assert not list(installed.glob("granforce-kernels-*"))


def test_a_folder_of_somebody_else_is_not_taken(tmp_path):
    """Kernels are code: who can write them can run anything."""
    usual = tmp_path / f"granforce-kernels-{os.getuid()}"
    assert compiled.temporary_place(tmp_path) == str(usual)
    usual.chmod(0o777)
    other = compiled.temporary_place(tmp_path)
    assert other != str(usual) and stat.S_IMODE(os.stat(other).st_mode) == 0o700
    usual.rmdir()
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    usual.symlink_to(tmp_path / "elsewhere")
    assert compiled.temporary_place(tmp_path) != str(usual)


def test_kernels_kept_by_another_version_are_compiled_anew(tmp_path, monkeypatch):
    """Their index may name a class that has gone, which unpickling does not survive."""
    kept = IndexDataCacheFile(str(tmp_path), "kernel", 1)
    monkeypatch.setattr(
        lanes, "Gone", type("Gone", (), {"__module__": lanes.__name__}), raising=False
    )
    kept.save(lanes.Gone, "compiled")
    assert kept.load(lanes.Gone) == "compiled"
    key = lanes.Gone
    monkeypatch.undo()
    assert kept.load(key) is None
    kept.save("another", "compiled anew")
    assert kept.load("another") == "compiled anew"


def test_kernels_are_compiled_anew_after_a_change_in_another_file(tmp_path, monkeypatch):
    IndexDataCacheFile(str(tmp_path), "kernel", 1).save("types", "compiled")
    assert IndexDataCacheFile(str(tmp_path), "kernel", 1).load("types") == "compiled"
    monkeypatch.setattr(compiled, "_digest_of_kernels", lambda: "another")
    assert IndexDataCacheFile(str(tmp_path), "kernel", 1).load("types") is None


def test_the_bar_of_a_call_says_that_kernels_are_compiled(capsys):
    @cancelling.cancellable
    def work(*, progress=None, cancel=None):
        with event.trigger_event("numba:compile", data={}):
            pass

    work(progress=True)
    assert "work, compiling once per machine" in capsys.readouterr().err
    listening = len(event._registered["numba:compile"])
    work(progress=True)
    assert len(event._registered["numba:compile"]) == listening


def test_work_waits_for_kernels_that_another_process_compiles(tmp_path, monkeypatch):
    """The process is seen to its end, unless the work is cancelled; then it ends nothing."""
    monkeypatch.setattr(compiled, "are_cached", lambda last: False)
    done = tmp_path / "done"
    assert not compiled.compile_ahead(f"import time; time.sleep(1); open({str(done)!r}, 'w')", "x")
    with pytest.raises(Cancelled):
        compiled.wait_for_kernels(partial(_raise, Cancelled))
    assert not done.exists()
    asked = []
    compiled.wait_for_kernels(lambda: asked.append(1))
    assert done.exists() and asked
    compiled.wait_for_kernels(partial(_raise, Cancelled))  # nothing is left


def _raise(error):
    raise error
