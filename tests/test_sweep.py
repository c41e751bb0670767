"""Sweeps over processes and over dask workers: the same results, and what a kill costs."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time

import pytest
from test_study import cell

from granforce import study, sweep
from granforce.records import InputError
from granforce.store import open_store


def test_a_sweep_gives_the_same_for_any_number_of_workers(tmp_path):
    cells = [cell(mu, seed) for mu in (0, 0.3) for seed in (1, 2)]
    seen = []
    one, failed = sweep.sweep(tmp_path / "one", cells, workers=1, on_row=seen.append)
    two, _ = sweep.sweep(tmp_path / "two", cells, workers=2)
    assert not failed
    assert one == two
    assert sorted(map(str, seen)) == sorted(map(str, one))
    stores = [open_store(tmp_path / name) for name in ("one", "two")]
    for name in stores[0]:
        a, b = (store[name].drop_vars("seconds", errors="ignore") for store in stores)
        assert a.equals(b)
    found, _ = sweep.sweep(tmp_path / "one", cells, workers=2)
    assert [line["cached"] for line in found] == [True] * 4


def test_a_failed_cell_leaves_the_others(tmp_path):
    # Three disks do not always jam: whatever happens to them, the other cell is there.
    hopeless = cell()
    hopeless["packing"] = {**hopeless["packing"], "radii": [1.0] * 3}
    rows, failed = sweep.sweep(tmp_path / "s", [hopeless, cell()], workers=2)
    assert len(rows) == 1
    assert "radii" in failed[0][1]


def test_a_killed_sweep_loses_only_the_cells_under_way(tmp_path):
    path = tmp_path / "s"
    cells = [cell(seed=seed, states=60) for seed in range(1, 9)]
    code = (
        "from granforce import sweep\n"
        "if __name__ == '__main__':\n"
        f"    sweep.sweep({str(path)!r}, {cells!r}, workers=2)\n"
    )
    script = tmp_path / "run.py"
    script.write_text(code)
    running = subprocess.Popen([sys.executable, str(script)], start_new_session=True)
    deadline = time.time() + 120
    while len(list(path.glob("walk-*"))) < 2 and time.time() < deadline:
        time.sleep(0.02)
    os.killpg(running.pid, signal.SIGKILL)
    running.wait()
    store = open_store(path)
    done = len(store.find("walk"))
    assert 2 <= done
    assert all(verdict.ok for verdict in store.verify())
    rows, failed = sweep.sweep(path, cells, workers=2)
    assert not failed
    assert sum(line["cached"] for line in rows) == done
    assert not list(path.glob(".tmp-*"))


def small_cells(seeds=(1, 2)):
    cells = []
    for seed in seeds:
        packing = cell(seed=seed)["packing"]
        cells += [
            sweep.Cell("walk", cell(seed=seed, states=40)),
            sweep.Cell("intervals", study.exact_parameters(packing)),
            sweep.Cell("limit_loads", study.exact_parameters(packing, mu=0.5)),
        ]
    return cells


def assert_same(one, two):
    """Two stores hold the same entries, bit by bit but for the run times."""
    one, two = open_store(one), open_store(two)
    assert list(one) == list(two)
    for name in one:
        a, b = (store[name].drop_vars("seconds", errors="ignore") for store in (one, two))
        assert a.identical(b.assign_attrs(created=a.attrs["created"], checksum=a.attrs["checksum"]))


def test_cells_of_every_kind_are_counted_and_kept(tmp_path):
    seen, done = [], []
    failed = sweep.run(
        tmp_path / "s",
        small_cells(),
        workers=2,
        dtypes={"states": "float32"},
        progress=lambda *counts: seen.append(counts),
        on_done=lambda k, cached: done.append((k, cached)),
    )
    assert not failed
    assert sorted(done) == [(k, False) for k in range(6)]
    assert seen[-1] == (6, 6)
    assert seen == sorted(seen)
    store = open_store(tmp_path / "s")
    for one in small_cells():
        assert sweep.load(store, one) is not None
    assert sweep.load(store, small_cells()[0])["states"].dtype == "float32"
    assert sweep.load(store, small_cells()[2])["limit_load"].dtype == "float64"


@pytest.fixture(scope="module")
def cluster():
    """Two dask workers, each a process of its own."""
    distributed = pytest.importorskip("dask.distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs="CRITICAL"
    ) as cluster:
        yield cluster


def test_dask_workers_give_the_same_as_processes(tmp_path, cluster):
    cells = small_cells()
    assert not sweep.run(tmp_path / "one", cells, workers=2)
    done = []
    failed = sweep.run(
        tmp_path / "two",
        [*cells, sweep.Cell("walk", {**cells[0].parameters, "packing": {"imported": "0"}})],
        scheduler=cluster.scheduler_address,
        on_done=lambda k, cached: done.append(cached),
    )
    assert [text for _, text in failed] == [
        "the imported packing is not in this store: import it again"
    ]
    assert done == [False] * 6
    assert_same(tmp_path / "one", tmp_path / "two")


def kill_one(processes):
    """SIGKILL a worker process once the first cell is done, in the midst of its next."""
    victim = processes()[0]
    os.kill(victim, signal.SIGKILL)
    return victim


@pytest.mark.slow
def test_a_killed_dask_worker_costs_nothing_but_time(tmp_path, cluster):
    cells = [sweep.Cell("walk", cell(seed=seed, states=60)) for seed in range(1, 7)]
    killed = []

    def kill(k, cached):
        if not killed:
            killed.append(kill_one(lambda: [w.pid for w in cluster.workers.values()]))

    assert not sweep.run(tmp_path / "one", cells, scheduler=cluster.scheduler_address, on_done=kill)
    assert killed
    assert not sweep.run(tmp_path / "two", cells)
    assert_same(tmp_path / "one", tmp_path / "two")


@pytest.mark.slow
def test_a_killed_worker_process_costs_nothing_but_time(tmp_path):
    cells = [sweep.Cell("walk", cell(seed=seed, states=60)) for seed in range(1, 7)]
    killed = []

    def kill(k, cached):
        if not killed:
            children = multiprocessing.active_children
            killed.append(kill_one(lambda: [child.pid for child in children()]))

    assert not sweep.run(tmp_path / "one", cells, on_done=kill)
    assert killed
    assert not sweep.run(tmp_path / "two", cells)
    assert_same(tmp_path / "one", tmp_path / "two")


def die(*task):
    os._exit(1)


@pytest.mark.slow
def test_a_cell_that_kills_its_worker_is_given_up(tmp_path, monkeypatch):
    monkeypatch.setattr(sweep, "run_cell", die)
    monkeypatch.setattr(sweep, "warm_up", lambda: None)
    failed = sweep.run(tmp_path / "s", small_cells()[:1])
    assert "died 3 times" in failed[0][1]


def test_a_worker_that_does_not_see_the_store_says_so(tmp_path):
    with pytest.raises(InputError, match="must be shared"):
        sweep.run_cell(tmp_path / "elsewhere", small_cells()[0])
    assert not (tmp_path / "elsewhere").exists()


def test_no_scheduler_is_one_line(tmp_path):
    pytest.importorskip("dask.distributed")
    with pytest.raises(InputError, match="no dask scheduler at"):
        sweep.run(tmp_path / "s", small_cells()[:1], scheduler="tcp://127.0.0.1:9")
