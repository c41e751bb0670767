"""Run once when the server starts: kernels are compiled, and it ends where it could not serve.

And once when it ends.
"""

import importlib
import sys
from contextlib import suppress

from panel import config

from granforce.records import InputError
from granforce.study.scan import warm_up
from granforce.system.cancelling import end_everything
from granforce.system.compiled import compile_ahead

try:
    from .jobs import Job  # which reads the limits
except InputError as error:
    print(error, file=sys.stderr)
    sys.exit(2)


def on_server_loaded(server_context: object) -> None:
    """Import and load what visitors will need, or compile it first; they may come meanwhile."""
    if config.nthreads is not None:  # a page takes its turns on one thread, the server's own
        print(
            "the app computes in threads of its own, and cannot run with --num-threads or "
            "PANEL_NUM_THREADS: start panel serve without",
            file=sys.stderr,
        )
        sys.exit(2)
    # xarray imports dask, where it is installed, with the first array it looks at, which fails
    # where two threads do so at once.
    with suppress(ImportError):
        importlib.import_module("dask.base")
    importlib.import_module(".page", __package__)
    if compile_ahead("from granforce.study.scan import warm_up; warm_up()", "flow.until_one_ends"):
        Job(lambda job: warm_up())


def on_server_unloaded(server_context: object) -> None:
    """Whatever is being computed ends, or the process would wait for its threads."""
    end_everything()
