"""Scans over processes and over dask workers: the same results, and what a kill costs."""

import contextlib
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path

import pytest
from heeding import until_it_left
from test_cells import cell

from granforce.records import InputError
from granforce.study import cluster as dask_cluster
from granforce.study import kinds, scan
from granforce.study.cells import StudyCell, load
from granforce.study.evolution import evolution
from granforce.study.series import infer_series
from granforce.study.store import open_store


def test_progress_true_draws_a_bar(tmp_path, capsys):
    _, failed = scan.scan(tmp_path / "s", 0.3, 1, 12, 3, workers=1, progress=True)
    assert not failed and "scan: " in capsys.readouterr().err
    calls = (
        lambda **options: scan.scan(tmp_path / "s", 0.3, 1, 12, 3, **options),
        lambda **options: evolution(tmp_path / "s", None, **options),
        lambda **options: infer_series(tmp_path / "s", [], mu=0.3, **options),
    )
    for call in calls:
        with pytest.raises(InputError, match="progress must be True, or a function"):
            call(progress=3)


def test_one_worker_needs_no_script_that_is_a_file(tmp_path):
    code = f"import granforce as gf; gf.scan({str(tmp_path / 's')!r}, 0.3, 1, 12, 3, workers=1)"
    command = [sys.executable, "-"]
    ran = subprocess.run(command, input=code, capture_output=True, text=True, check=True)
    assert "Traceback" not in ran.stderr
    assert len(open_store(tmp_path / "s")) == 2


# Run first by every Python: in a worker it is a Ctrl-C, before the worker's imports.
INTERRUPTING = """import os, signal, sys
if any("spawn_main" in word for word in sys.orig_argv):
    os.kill(os.getpid(), signal.SIGINT)
"""


def test_an_interrupt_does_not_reach_workers_that_still_import(tmp_path, monkeypatch):
    (tmp_path / "sitecustomize.py").write_text(INTERRUPTING)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    words = ["scan", "--mu", "0.3", "--seeds", "2", "-n", "12", "--states", "3", "--workers", "2"]
    command = [sys.executable, "-m", "granforce", *words, "--out", str(tmp_path / "s.zarr")]
    ran = subprocess.run(command, capture_output=True, text=True)
    assert (ran.returncode, "Traceback" in ran.stderr) == (0, False), ran.stderr


@pytest.mark.parametrize(
    "options, words",
    [
        ({"mu": [0.3, 0.1 + 0.2]}, "0.3 is given twice"),
        ({"dtypes": {"states": "int8"}}, "dtypes may be"),
        ({"dtypes": {"state": "float32"}}, "dtypes may be"),
        ({"dtypes": "float32"}, "dtypes may be"),
    ],
)
def test_what_no_scan_could_store_is_refused_before_it_begins(tmp_path, options, words):
    with pytest.raises(InputError, match=words):
        scan.scan(tmp_path / "s", **({"mu": 0.3, "n": 12, "states": 2, "workers": 1} | options))
    assert not (tmp_path / "s").exists()


def test_a_failed_cell_leaves_the_others(tmp_path):
    # Three disks do not always jam: whatever happens to them, the other cell is there.
    hopeless = cell()
    hopeless["packing"] = {**hopeless["packing"], "radii": [1.0] * 3}
    rows, failed = scan.walks(tmp_path / "s", [hopeless, cell()], workers=1)
    assert len(rows) == 1
    assert "radii" in failed[0][1]


def with_a_hopeless_one(cells):
    """Cells, and at the ends a walk and its packing, which cannot be made."""
    hopeless = cell(0.3, 2)
    hopeless["packing"] = {**hopeless["packing"], "radii": [1.0] * 3}
    made = StudyCell(kinds.PACKING, hopeless["packing"])
    return [StudyCell(kinds.WALK, hopeless), *cells, made]


def test_cells_wait_for_their_packing_and_are_left_out_where_it_fails(tmp_path):
    good, done = cell(0.3), []
    # Walks come first: each waits for its packing all the same, which is made once.
    cells = StudyCell(kinds.WALK, good), StudyCell(kinds.PACKING, good["packing"])
    cells, told = with_a_hopeless_one(cells), lambda k, cached: done.append((k, cached))
    (failed,) = scan.run(tmp_path / "s", cells, workers=1, on_done=told)
    assert failed[0] == cells[-1]
    assert done == [(2, False), (1, False)]


def test_a_cell_that_others_removed_is_computed_anew(tmp_path, monkeypatch):
    wanted = scan.walks(tmp_path / "one", [cell()], workers=1)[0]

    def run(path, cells, *, on_done):
        on_done(0, False)  # but when it is looked up, others have cleared the store
        return []

    monkeypatch.setattr(scan, "run", run)
    assert scan.walks(tmp_path / "two", [cell()])[0] == wanted


def workers_of(parent):
    """Process numbers of the worker processes of a scan (Linux)."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            told, words = (folder / "stat").read_text(), (folder / "cmdline").read_bytes()
        except OSError:
            continue  # it has ended meanwhile
        state, above = told.rpartition(")")[2].split()[:2]
        if int(above) == parent and state != "Z" and b"spawn_main" in words:
            found.append(int(folder.name))
    return found


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def kill_parent_alone(path, seeds):
    """A scan whose parent is killed once a cell is kept: workers end, and what is kept stays."""
    cells = [cell(seed=seed, states=400) for seed in seeds]
    script = path.with_suffix(".py")
    script.write_text(
        "from granforce.study import scan\n"
        "if __name__ == '__main__':\n"
        f"    scan.walks({str(path)!r}, {cells!r}, workers=2)\n"
    )
    parent = subprocess.Popen([sys.executable, str(script)], start_new_session=True)
    until_it_left(path, "packing-*", 1, parent)
    workers = workers_of(parent.pid)
    assert len(workers) == 2
    until_it_left(path, "walk-*", 1, parent)
    os.kill(parent.pid, signal.SIGKILL)
    parent.wait()
    begin = time.monotonic()
    while any(map(is_running, workers)) and time.monotonic() < begin + 60:
        time.sleep(0.02)
    assert not any(map(is_running, workers))
    store = open_store(path)
    assert all(verdict.ok for verdict in store.verify())
    assert not list(path.glob(".tmp-*"))
    kept = len(store.find("walk"))
    rows, failed = scan.walks(path, cells, workers=1)
    assert not failed and sum(row["cached"] for row in rows) == kept >= 1


@pytest.mark.skipif(sys.platform != "linux", reason="/proc")
def test_workers_end_when_their_parent_alone_is_killed(tmp_path):
    """A busy machine may take its time; left alone, they would compute for minutes."""
    kill_parent_alone(tmp_path / "s", range(1, 5))


@pytest.mark.stress
@pytest.mark.skipif(sys.platform != "linux", reason="/proc")
@pytest.mark.parametrize("first", range(1, 80, 4))
def test_twenty_parents_are_killed_alone(tmp_path, first):
    """20 faults tried."""
    kill_parent_alone(tmp_path / "s", range(first, first + 4))


def test_progress_of_cells_never_goes_back():
    """However late the end of a cell is seen, and however often cells are begun anew."""
    told = []
    tell = scan.forwards(lambda done, total: told.append((done, total)), 6)
    # One has ended, another is under way; its worker dies, and it is counted twice.
    for parts in (1.26, 1, 1.9, 2.26, 2, 2.9, 7, 3, 4, 5, 6):
        tell(parts)
    assert told == sorted(told) and told[0] == (1.25, 6) and told[-1] == (6, 6)
    assert {done % 0.25 for done, _ in told} == {0}


def small_cells(seeds=(1, 2)):
    cells = []
    for seed in seeds:
        packing = cell(seed=seed)["packing"]
        cells += [
            StudyCell(kinds.WALK, cell(seed=seed, states=40)),
            StudyCell(kinds.INTERVALS, kinds.INTERVALS.parameters(packing)),
            StudyCell(kinds.LIMIT_LOADS, kinds.LIMIT_LOADS.parameters(packing, mu=0.5)),
        ]
    return cells


def assert_same(one, two):
    """Two stores hold the same entries, bit by bit but for the run times."""
    one, two = open_store(one), open_store(two)
    assert list(one) == list(two)
    for name in one:
        a, b = (store[name].drop_vars("seconds", errors="ignore") for store in (one, two))
        own = ("created", "checksum", "metadata_checksum")
        assert a.identical(b.assign_attrs({key: a.attrs[key] for key in own}))


@pytest.fixture(scope="module")
def by_processes(tmp_path_factory):
    """The store of small cells of several kinds by two processes, and what was told meanwhile."""
    path, seen, done = tmp_path_factory.mktemp("scan") / "s", [], []
    cells = with_a_hopeless_one(small_cells())
    failed = scan.run(
        path,
        cells,
        workers=2,
        dtypes={"states": "float32"},
        progress=lambda *counts: seen.append(counts),
        on_done=lambda k, cached: done.append((k, cached)),
    )
    assert [lost for lost, _ in failed] == cells[-1:]
    return path, seen, done


def test_cells_of_every_kind_are_counted_and_kept(by_processes):
    path, seen, done = by_processes
    assert sorted(done) == [(k, False) for k in range(1, 7)]
    assert seen[-1][1] == 8 and seen == sorted(seen)
    store = open_store(path)
    for one in small_cells():
        assert load(store, *one) is not None
    assert load(store, *small_cells()[0])["states"].dtype == "float32"
    assert load(store, *small_cells()[2])["limit_load"].dtype == "float64"


def test_a_scan_gives_the_same_for_any_number_of_workers(tmp_path, by_processes):
    one = tmp_path / "one"
    assert not scan.run(one, small_cells(), workers=1, dtypes={"states": "float32"})
    assert_same(by_processes[0], one)
    walks = [cell.parameters for cell in small_cells() if cell.kind is kinds.WALK]
    rows, _ = scan.walks(one, walks, workers=2)
    assert [row["cached"] for row in rows] == [True] * 2
    assert rows == scan.walks(by_processes[0], walks, workers=2)[0]


def test_dask_workers_give_the_same_as_processes(tmp_path, by_processes, cluster):
    cells, done = small_cells(), []
    failed = scan.run(
        tmp_path / "two",
        [*cells, StudyCell(kinds.WALK, {**cells[0].parameters, "packing": {"imported": "0"}})],
        scheduler=cluster.scheduler_address,
        dtypes={"states": "float32"},
        on_done=lambda k, cached: done.append(cached),
    )
    assert [text for _, text in failed] == [
        "the imported packing is not in this store: import it again"
    ]
    assert done == [False] * 6
    assert_same(by_processes[0], tmp_path / "two")


def kill_one(processes):
    """SIGKILL a worker process once the first cell is done, in the midst of its next."""
    victim = processes()[0]
    os.kill(victim, signal.SIGKILL)
    return victim


@pytest.mark.slow
def test_a_killed_dask_worker_costs_nothing_but_time(tmp_path, cluster):
    cells = [StudyCell(kinds.WALK, cell(seed=seed, states=60)) for seed in range(1, 7)]
    killed = []

    def kill(k, cached):
        if not killed:
            killed.append(kill_one(lambda: [w.pid for w in cluster.workers.values()]))

    assert not scan.run(tmp_path / "one", cells, scheduler=cluster.scheduler_address, on_done=kill)
    assert killed
    assert not scan.run(tmp_path / "two", cells)
    assert_same(tmp_path / "one", tmp_path / "two")


@pytest.mark.slow
def test_a_killed_worker_process_costs_nothing_but_time(tmp_path):
    cells = [StudyCell(kinds.WALK, cell(seed=seed, states=60)) for seed in range(1, 7)]
    killed, told = [], []

    def kill(k, cached):
        if not killed:
            children = multiprocessing.active_children
            killed.append(kill_one(lambda: [child.pid for child in children()]))

    progress = lambda *counts: told.append(counts)  # noqa: E731
    assert not scan.run(tmp_path / "one", cells, on_done=kill, progress=progress)
    assert told == sorted(told) and told[-1] == (6, 6)
    assert killed
    assert not scan.run(tmp_path / "two", cells)
    assert_same(tmp_path / "one", tmp_path / "two")


def die(*asked, **options):
    os._exit(1)


@pytest.mark.slow
def test_a_cell_that_kills_its_worker_is_given_up(tmp_path):
    deadly = StudyCell(kinds.WALK._replace(name="deadly", compute=die), cell())
    failed = scan.run(tmp_path / "s", [deadly])
    assert "died 3 times" in failed[0][1]


def test_a_worker_that_does_not_see_the_store_says_so(tmp_path):
    with pytest.raises(InputError, match="must be shared"):
        scan.run_cell(tmp_path / "elsewhere", small_cells()[0])
    assert not (tmp_path / "elsewhere").exists()


def test_no_scheduler_is_one_line(tmp_path):
    pytest.importorskip("dask.distributed")
    with pytest.raises(InputError, match="no dask scheduler at"):
        scan.run(tmp_path / "s", small_cells()[:1], scheduler="tcp://127.0.0.1:9")
    assert not list(tmp_path.iterdir())


@pytest.fixture
def empty_cluster():
    """A scheduler to which no worker has come yet."""
    distributed = pytest.importorskip("dask.distributed")
    with distributed.LocalCluster(
        n_workers=0, processes=False, dashboard_address=":0", protocol="tcp://",
        silence_logs="CRITICAL",
    ) as cluster:  # fmt: skip
        yield cluster


def when_it_waits(monkeypatch, then):
    """Call then() once it is said that no worker is there; what was said."""
    said = []

    def warn(message, **options):
        said.append(message)
        then()

    monkeypatch.setattr(dask_cluster, "WORKERLESS", 0)
    monkeypatch.setattr(dask_cluster.warnings, "warn", warn)
    return said


def test_a_scheduler_without_workers_says_so_and_goes_on_once_one_comes(
    tmp_path, monkeypatch, empty_cluster
):
    said = when_it_waits(monkeypatch, lambda: empty_cluster.scale(1))
    cells = [StudyCell(kinds.WALK, cell())]
    assert not scan.run(tmp_path / "s", cells, scheduler=empty_cluster.scheduler_address)
    assert len(said) == 1 and "no worker at the dask scheduler tcp://" in said[0]
    assert load(open_store(tmp_path / "s"), *cells[0]) is not None


def test_a_scheduler_that_goes_is_one_line(tmp_path, monkeypatch, empty_cluster):
    when_it_waits(monkeypatch, empty_cluster.close)
    with pytest.raises(InputError, match=r"scheduler at .* was lost"):
        scan.run(tmp_path / "s", small_cells()[:1], scheduler=empty_cluster.scheduler_address)


def test_each_time_without_workers_is_told_once(monkeypatch):
    workers = dask_cluster._Workers("tcp://there")
    monkeypatch.setattr(dask_cluster, "WORKERLESS", 0)
    for count, told in ([(), 1], [(), 0], ["a", 0], [(), 1], [(), 0]):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            workers.count(count)
        assert len(said) == told
    monkeypatch.setattr(dask_cluster, "WORKERLESS", 60)
    workers.count("a")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        workers.count(())


def test_a_scheduler_that_stays_without_workers_is_given_up(tmp_path, monkeypatch, empty_cluster):
    monkeypatch.setattr(dask_cluster, "GIVEN_UP", 0)
    with pytest.raises(InputError, match=r"had no worker for .*start one with dask worker tcp:"):
        scan.run(tmp_path / "s", small_cells()[:1], scheduler=empty_cluster.scheduler_address)


def test_what_is_no_scheduler_is_one_line(tmp_path):
    """What an HTTP server answers, dask takes for the size of a message that no memory holds."""
    pytest.importorskip("dask.distributed")
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]

        def answer():
            with contextlib.suppress(OSError):
                while True:
                    server.accept()[0].sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")

        threading.Thread(target=answer, daemon=True).start()
        with pytest.raises(InputError, match="no dask scheduler at") as told:
            scan.run(tmp_path / "s", small_cells()[:1], scheduler=f"tcp://127.0.0.1:{port}")
        assert "\n" not in str(told.value)


def test_a_script_without_a_guard_is_told_of_it(tmp_path):
    """Workers import the script, which begins the scan again."""
    script = tmp_path / "script.py"
    script.write_text(
        f"import granforce as gf\ngf.scan({str(tmp_path / 'store')!r}, 0.3, n=12, states=2)\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True)
    last = done.stderr.rstrip().splitlines()[-1]
    assert done.returncode == 1 and last.endswith('under if __name__ == "__main__":')
