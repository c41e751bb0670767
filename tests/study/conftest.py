"""Packings that a scheduler works on: its cluster."""

import pytest


@pytest.fixture(scope="module")
def cluster():
    """Two dask workers, each a process of its own."""
    distributed = pytest.importorskip("dask.distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs="CRITICAL"
    ) as cluster:
        yield cluster
