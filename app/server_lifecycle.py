"""Run once when the server starts: kernels are compiled, and it ends where it could not serve.

And once when it ends.
"""

import argparse
import importlib
import sys
from contextlib import suppress

from panel import config

from granforce.records import InputError
from granforce.study.scan import warm_up
from granforce.system.cancelling import end_everything
from granforce.system.compiled import compile_ahead


def _processes() -> int:
    """The processes that `panel serve` was asked for: it tells nobody until it has forked."""
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--num-procs", type=int, default=1)
    # Panel hides the command line from what it serves, but not this copy of it.
    return int(parser.parse_known_args(sys.orig_argv)[0].num_procs)


def _end(line: object) -> None:
    print(line, file=sys.stderr)
    sys.exit(2)


# Before anything is forked or served.
if _processes() != 1:
    _end(
        "the app computes in threads of its own, which forked processes lack, and cannot run with "
        "--num-procs: start panel serve without"
    )
if config.autoreload:  # Panel runs main.py then, but not as a part of its package
    _end(
        "the app is a package, which Panel cannot reload, and cannot run with --autoreload or "
        "--dev: start panel serve without"
    )
try:
    from .background.jobs import Job  # which reads the limits
except InputError as error:
    _end(error)


def on_server_loaded(server_context: object) -> None:
    """Import and load what visitors will need, or compile it first; they may come meanwhile."""
    if config.nthreads is not None:  # a page takes its turns on one thread, the server's own
        _end(
            "the app computes in threads of its own, and cannot run with --num-threads or "
            "PANEL_NUM_THREADS: start panel serve without"
        )
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
