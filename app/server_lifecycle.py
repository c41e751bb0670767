"""Run when the server starts and when it ends.

At the start kernels are compiled, and the server ends at once if it could not serve.
"""

import argparse
import importlib
import sys
import warnings
from contextlib import suppress

from panel import config

from granforce.records import InputError, InputWarning, ResultWarning
from granforce.study.scan import warm_up
from granforce.system.cancelling import end_everything
from granforce.system.compiled import compile_ahead


def _processes() -> int:
    """The number of processes given to `panel serve`, which reports it only after forking."""
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--num-procs", type=int, default=1)
    # Panel hides the command line from what it serves, but not this copy.
    return int(parser.parse_known_args(sys.orig_argv)[0].num_procs)


def _end(line: object) -> None:
    print(line, file=sys.stderr)
    sys.exit(2)


# Before any fork and any request.
if _processes() != 1:
    _end(
        "the app computes in threads of its own, which forked processes lack, and cannot run with "
        "--num-procs: start panel serve without"
    )
if config.autoreload:  # Panel then runs main.py, but not as part of its package
    _end(
        "the app is a package, which Panel cannot reload, and cannot run with --autoreload or "
        "--dev: start panel serve without"
    )
try:
    from .background.jobs import Job  # which reads the limits
except InputError as error:
    _end(error)


def on_server_loaded(server_context: object) -> None:
    """Import, load or compile what visitors will need; they may arrive meanwhile."""
    if config.nthreads is not None:  # a page runs on one thread, the server's own
        _end(
            "the app computes in threads of its own, and cannot run with --num-threads or "
            "PANEL_NUM_THREADS: start panel serve without"
        )
    for kind in (InputWarning, ResultWarning):  # the page says what they say
        warnings.simplefilter("ignore", kind)
    # xarray imports dask, if installed, with the first array it examines, which fails if two
    # threads do so at once.
    with suppress(ImportError):
        importlib.import_module("dask.base")
    importlib.import_module(".page", __package__)
    if compile_ahead("from granforce.study.scan import warm_up; warm_up()", "flow.until_one_ends"):
        Job(lambda job: warm_up())


def on_server_unloaded(server_context: object) -> None:
    """End all computations; otherwise the process would wait for their threads."""
    end_everything()
