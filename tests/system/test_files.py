"""Files for the user: whole or not at all, with the umask's mode, and devices left where they are.

Faults tried: a device, a pipe, standard output, a link, a link to nothing, a link to itself, a full
disk, a folder, a missing one, a file in place of a folder, a name too long, one with a null
character, no rights to the file or to its folder. Nothing else than a file was replaced, and no
part of one was left behind.
"""

import os
import stat
import subprocess
import sys
import tempfile
import threading
from functools import partial
from pathlib import Path

import pytest

from granforce.cli.entry_point import main
from granforce.cli.results import radii
from granforce.experiment.pegs import read_pegs
from granforce.packing.importers import load_packing
from granforce.packing.importers.text import read_text
from granforce.records import InputError
from granforce.system.files import MOST_STREAMED, check_file, content_of, make_folder, written

PACKING = Path(__file__).parents[1] / "reference" / "n100_mu0.1_s11.npz"


def write(path, content=b"new"):
    with written(path) as file:
        file.write(content)


def mode(path):
    return stat.S_IMODE(os.stat(path).st_mode)


def test_devices_without_end_are_not_read_for_ever(tmp_path, monkeypatch):
    (tmp_path / "file").write_bytes(b"whole" * 100)
    monkeypatch.setattr("granforce.system.files.MOST_STREAMED", 64)
    assert MOST_STREAMED > 64 and content_of(tmp_path / "file") == b"whole" * 100
    assert content_of("/dev/null") == b""
    for call in (read_text, partial(read_pegs, mu=0.3), partial(radii, n=8)):
        with pytest.raises(InputError, match="/dev/zero: more than"):
            call("/dev/zero")


@pytest.fixture
def umask():
    """Sets the umask of this process, and back."""
    before = os.umask(0o022)
    yield os.umask
    os.umask(before)


@pytest.mark.parametrize("mask, left", [(0o022, 0o644), (0o027, 0o640), (0o077, 0o600)])
def test_a_new_file_has_the_mode_that_the_umask_leaves(tmp_path, umask, mask, left):
    umask(mask)
    write(tmp_path / "file")
    assert mode(tmp_path / "file") == left


def test_a_file_is_replaced_and_keeps_its_mode(tmp_path):
    file = tmp_path / "file"
    file.write_text("older and longer")
    file.chmod(0o640)
    write(file)
    assert file.read_bytes() == b"new" and mode(file) == 0o640
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("there", [True, False])
def test_a_link_leads_to_its_file(tmp_path, there):
    (tmp_path / "folder").mkdir()
    target, link = tmp_path / "folder" / "file", tmp_path / "link"
    if there:
        target.write_text("older")
    link.symlink_to(Path("folder") / "file")
    write(link)
    assert link.is_symlink() and target.read_bytes() == b"new"
    assert [path.name for path in target.parent.iterdir()] == ["file"]


def test_a_device_stays_a_device():
    before = os.stat("/dev/null")
    write("/dev/null")
    check_file("/dev/null")
    after = os.stat("/dev/null")
    assert stat.S_ISCHR(after.st_mode) and after.st_ino == before.st_ino


def test_a_pipe_is_written_to(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    check_file(pipe)  # does not wait for a reader
    got = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()), daemon=True)
    reader.start()
    write(pipe)
    reader.join(20)
    assert got == [b"new"] and stat.S_ISFIFO(os.stat(pipe).st_mode)


def test_what_fails_leaves_the_old_file(tmp_path):
    file = tmp_path / "file"
    file.write_text("older")
    with pytest.raises(KeyError), written(file) as out:
        out.write(b"half")
        raise KeyError
    with pytest.raises(InputError, match="No space left"), written(file) as out:
        out.write(b"half")
        raise OSError(28, "No space left on device")
    assert file.read_text() == "older" and list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("name", ["none/x", "folder", "file/x", "loop", "x" * 300, "a\0b", ""])
def test_what_cannot_be_written_is_one_line(away, name):
    (away / "folder").mkdir()
    (away / "file").write_text("older")
    (away / "loop").symlink_to("loop")
    before = sorted(away.iterdir())
    for refused in (write, check_file):
        with pytest.raises(InputError) as told:
            refused(name)
        assert "\n" not in str(told.value)
    assert sorted(away.iterdir()) == before
    assert (away / "file").read_text() == "older"


def test_a_disk_that_is_full_is_one_line():
    with pytest.raises(InputError, match="No space left on device"):
        write("/dev/full", bytes(10**6))


def test_folders_are_made_or_refused(tmp_path):
    (tmp_path / "file").write_text("")
    assert make_folder(tmp_path / "a" / "b").is_dir()
    assert make_folder(tmp_path / "a" / "b").is_dir()
    for name in ("file", "file/x"):
        with pytest.raises(InputError, match="cannot write"):
            make_folder(tmp_path / name)


def test_what_may_not_be_written_is_not_replaced(nobody):
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "file"
        file.write_text("older")
        for item, bits in ((file, 0o444), (Path(folder), 0o555)):
            item.chmod(bits)
            for refused in (write, check_file):
                with pytest.raises(InputError, match=r"Permission denied|not writable"):
                    refused(file)
            item.chmod(0o755)
        assert file.read_text() == "older" and os.listdir(folder) == ["file"]


def test_a_longest_name_is_written(tmp_path):
    write(tmp_path / ("x" * 255))
    assert [len(path.name) for path in tmp_path.iterdir()] == [255]


def grains(folder):
    table = folder / "grains.csv"
    table.write_text("x,y,r,fx\n0,0,1,3\n2,0,1,-3\n")
    return ["import", "table", str(table), "--mu", "0.5"]


def test_commands_follow_links_and_keep_devices(tmp_path, capsys):
    target, link = tmp_path / "target.npz", tmp_path / "link.npz"
    link.symlink_to(target)
    assert main([*grains(tmp_path), "--out", str(link)]) == 0
    assert link.is_symlink() and len(load_packing(target).r) == 2
    assert main([*grains(tmp_path), "--out", "/dev/null"]) == 0
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    assert main([*grains(tmp_path), "--out", "/dev/full"]) == 2
    assert "No space left" in capsys.readouterr().err


def command(folder, *words, **options):
    called = [sys.executable, "-m", "granforce.cli", *words]
    environment = {**os.environ, "GRANFORCE_CACHE": str(folder / "cache")}
    options = {"capture_output": True, "text": True, "timeout": 120} | options
    return subprocess.run(called, cwd=folder, env=environment, check=False, **options)


def test_a_packing_goes_down_a_pipe(tmp_path):
    """--out /dev/stdout into another program; the report follows it."""
    # Compiles what the command needs, which it would say on stderr.
    assert main([*grains(tmp_path), "--out", str(tmp_path / "first.npz")]) == 0
    done = command(tmp_path, *grains(tmp_path), "--out", "/dev/stdout", text=False)
    assert done.returncode == 0 and done.stderr == b""
    assert done.stdout.startswith(b"PK") and b"grains" in done.stdout.rpartition(b"PK")[2]


@pytest.mark.parametrize(
    "words, said",
    [
        (["walk", "--mu", "0.3", "--states", "1" + "0" * 13], "GB of memory"),
        (["study", "--quick", "--out", "/proc/none"], "cannot write /proc/none"),
        *(
            pytest.param(*case, marks=pytest.mark.slow)  # each begins Python anew
            for case in (
                (["pack", "--mu", "0.3", "--seed", "-1"], "seed must be at least 0"),
                (["pack", "--mu", "0.3", "--cache", "~nouser/x"], "no such user"),
                (["intervals", "-n", "8", "--mu", "0.3", "--contacts", ""], "separated by commas"),
            )
        ),
    ],
)
def test_bad_lines_from_a_shell(tmp_path, words, said):
    """What the fuzz sees from within is what a shell sees."""
    done = command(tmp_path, *words)
    assert done.returncode == 2 and done.stdout == ""
    assert len(done.stderr.splitlines()) == 1 and said in done.stderr
    assert list(tmp_path.iterdir()) == []
