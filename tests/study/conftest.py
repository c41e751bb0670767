"""A dask scheduler with its workers, for scans and series."""

import pytest


@pytest.fixture(scope="session")
def cluster():
    """Two dask workers, each a process of its own."""
    distributed = pytest.importorskip("dask.distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs="CRITICAL"
    ) as cluster:
        yield cluster
