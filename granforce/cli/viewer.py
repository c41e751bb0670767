"""The app opened on one packing, from Python or by `granforce app FILE`."""

import atexit
import json
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
import warnings
import webbrowser
from html import escape
from pathlib import Path
from typing import Any
from urllib.error import URLError
from urllib.parse import urlencode, urljoin

import numpy as np

from granforce.explore.intervals import Intervals
from granforce.explore.random_walk import Walk, walk
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.forces.knowledge import Known
from granforce.forces.nearest import starting_network
from granforce.packing.importers import load_packing
from granforce.records import InputError, InputWarning, Packing
from granforce.study import kinds
from granforce.study.bounds import intervals_dataset
from granforce.study.cells import save
from granforce.study.keys import Parameters
from granforce.study.kinds.packings import check_complete
from granforce.study.samples import walk_dataset
from granforce.study.store import open_store
from granforce.tolerances import INTERVAL_GAP

# The folder into which the app's server writes the forces held on its pages; see `View.known`.
HELD_VARIABLE = "GRANFORCE_HELD"
PATIENCE = 60.0  # s until the server must respond
PAUSE = 0.1  # s between attempts
# The "bad ports" of the Fetch standard.
BLOCKED = {
    1, 7, 9, 11, 13, 15, 17, 19, 20, 21, 22, 23, 25, 37, 42, 43, 53, 69, 77, 79, 87, 95, 101, 102,
    103, 104, 109, 110, 111, 113, 115, 117, 119, 123, 135, 137, 139, 143, 161, 179, 389, 427, 465,
    512, 513, 514, 515, 526, 530, 531, 532, 540, 548, 554, 556, 563, 587, 601, 636, 989, 990, 993,
    995, 1719, 1720, 1723, 2049, 3659, 4045, 4190, 5060, 5061, 6000, 6566, 6665, 6666, 6667, 6668,
    6669, 6679, 6697, 10080,
}  # fmt: skip
_RESULTS = Intervals | Walk  # of an Ensemble, which `show` takes
ENDED = "the server of this page has ended: gf.show opens a new page"


class View:
    """A page of the app on one packing; in a notebook it is shown below its cell.

    Attributes
    ----------
    address : str
        Address of the page.
    """

    def __init__(self, address: str, held: Path, server: subprocess.Popen[bytes]) -> None:
        self.address, self._held, self._server = address, held, server

    @property
    def known(self) -> Known | None:
        """The forces that are held on the page now, for `gf.ensemble`; None if there are none.

        In the packing's own unit, not in mean forces as on the page. With a warning if the page's
        server has ended: they are then the last ones.
        """
        if self._server.poll() is not None:
            warnings.warn(f"{ENDED}; these are the last held forces", InputWarning, stacklevel=2)
        try:
            rows = json.loads(self._held.read_text())
        except FileNotFoundError:
            return None
        if not rows:
            return None
        contacts, low, high = zip(*rows, strict=True)
        return Known(np.array(contacts), np.array(low), np.array(high))

    def __repr__(self) -> str:
        return f"View({self.address!r})"

    def _repr_html_(self) -> str:
        if not wait_for_server(self.address, self._server):
            return f"<p>{ENDED}</p>"
        return f'<iframe src="{escape(self.address)}" width="100%" height="900"></iframe>'


def show(
    packing: Packing | Ensemble,
    *results: Intervals | Walk,
    seed: int | None = None,
    browser: bool | None = None,
) -> View:
    """Open the app on a packing, or on results of its ensemble; returns at once.

    The page opens some seconds later, when its server answers. Packing and results are saved in
    the default store: the page does not compute them again. The server ends with this Python
    process.

    Parameters
    ----------
    packing : Packing or Ensemble
        The packing, or its ensemble with no conditions but the friction.
    *results : Intervals or Walk
        Of this ensemble: bounds of all contacts, or a walk of one chain with default options.
    seed : int, optional
        Of the walk; by default 0.
    browser : bool, optional
        Whether to open a browser; by default unless in a notebook, which shows the View itself.

    Returns
    -------
    View
        The page: `known` are the forces that are held on it, `address` is its link.

    Raises
    ------
    InputError
        For anything else, for results of another ensemble, and if the store cannot be written.

    Examples
    --------
    >>> S = gf.ensemble(packing)  # doctest: +SKIP
    >>> gf.show(S, gf.intervals(S), gf.walk(S, 500))  # doctest: +SKIP
    """
    whole = Ensemble if results else Packing | Ensemble
    if not (isinstance(packing, whole) and all(isinstance(one, _RESULTS) for one in results)):
        given = " and ".join(type(one).__name__ for one in (packing, *results))
        raise InputError(
            "show takes a Packing, or an Ensemble and its Intervals or Walk, as in show(S, "
            f"intervals), not {given}"
        )
    if seed is not None and not any(isinstance(one, Walk) for one in results):
        raise InputError("a seed is that of a walk, and there is none to show")
    shown = packing if isinstance(packing, Packing) else packing.packing
    parameters = _stored(shown)
    link: Parameters = {}
    if isinstance(packing, Ensemble):
        link["mu"] = f"{packing.mu:.9g}"
        for one in results:
            link |= _kept(packing, parameters, one, seed or 0)
    root, folder, server = _server()
    address = f"{root}?{_query(parameters, **link)}"
    if browser or (browser is None and "ipykernel" not in sys.modules):
        open_when_ready(address)
    return View(address, folder / f"{parameters['imported']}.json", server)


def _kept(S: Ensemble, packing: Parameters, result: Intervals | Walk, seed: int) -> Parameters:
    """Save a result where the page looks for it; what a link says of it.

    A walk is continued by no state, which verifies its last one: a wrong one would stay in the
    store.
    """
    plain, store, mu = ensemble(S.packing, S.mu), open_store(), S.mu
    alike = S.known is None and np.array_equal(S.index, plain.index) and not (S.A != plain.A).nnz
    if not alike or not np.array_equal(S.b, plain.b) or (S.friction != plain.friction).any():
        raise InputError("the page has no conditions but the friction: show(gf.ensemble(packing))")
    if isinstance(result, Walk):
        done = walk(S, max(1, len(result.states)), seed, begun=result)
        parameters = kinds.WALK.parameters(packing, len(done.states), seed, mu=mu)
        save(store, kinds.WALK, parameters, walk_dataset(S, done))
        return {"source": "walk", "states": len(done.states), "walkseed": seed}
    some, rounding = starting_network(S), INTERVAL_GAP * S.force_scale
    if (
        not np.array_equal(result.contacts, S.index)
        or ((some < result.low - rounding) | (some > result.high + rounding)).any()
    ):
        raise InputError("these intervals are not those of all contacts of this ensemble")
    check_complete(S, result, "exact bounds")
    save(
        store,
        kinds.INTERVALS,
        kinds.INTERVALS.parameters(packing, mu=mu),
        intervals_dataset(S, result),
    )
    return {"tab": "intervals"}


def query_of_file(path: str | None) -> str:
    """The query of a link to the packing in an NPZ file; empty without a file."""
    return "" if path is None else f"?{_query(_stored(load_packing(path)))}"


def _stored(packing: Packing) -> Parameters:
    """Save a packing in the default store; the parameters under which a link finds it."""
    parameters = kinds.imported_parameters(packing)
    kinds.keep_packing(open_store(), parameters, packing)
    return parameters


def _query(parameters: Parameters, **more: Any) -> str:
    given = {"packing": parameters["imported"], "mu": f"{parameters['mu']:.9g}"}
    return urlencode(given | more)


def checked_port(address: str, port: int) -> int:
    """The port, a free one for 0; InputError if the address cannot be used, or is in use."""
    if not address.strip():
        raise InputError("--address is empty; give a host name or an IP address, such as localhost")
    if port in BLOCKED:
        raise InputError(f"browsers open no page at port {port}; choose another with --port")
    try:
        family, kind, _, _, place = socket.getaddrinfo(address, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(place)
            return int(probe.getsockname()[1])
    except (OSError, ValueError) as error:  # ValueError: not a valid name
        reason = getattr(error, "strerror", None) or "no such name"
        raise InputError(
            f"cannot listen at {address[:40]!r}, port {port}: {reason}; choose another with "
            "--address and --port"
        ) from None


def page_at(address: str, port: int) -> str:
    """The address of the page, for a browser on this machine."""
    host = "localhost" if address in ("0.0.0.0", "::") else address
    return f"http://[{host}]:{port}/app" if ":" in host else f"http://{host}:{port}/app"


def open_when_ready(address: str) -> None:
    """Open an address in a browser once its server responds, from a thread."""

    def wait() -> None:
        if wait_for_server(address):
            webbrowser.open(address)

    threading.Thread(target=wait, daemon=True).start()


def wait_for_server(address: str, server: subprocess.Popen[bytes] | None = None) -> bool:
    """Whether the server of an address responds within PATIENCE, and its process has not ended."""
    health = urljoin(address, "/health")
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until and (server is None or server.poll() is None):
        try:
            with urllib.request.urlopen(health, timeout=PATIENCE):
                return True
        except (URLError, OSError):
            time.sleep(PAUSE)
    return False


# The server of this process: its process, page, and folder of held forces, removed at the end.
_started: list[tuple[subprocess.Popen[bytes], str, tempfile.TemporaryDirectory[str]]] = []


def _server() -> tuple[str, Path, subprocess.Popen[bytes]]:
    """The page of this process's server, the folder of held forces and the server; starts it."""
    if not _started or _started[-1][0].poll() is not None:
        port = checked_port("localhost", 0)
        folder = tempfile.TemporaryDirectory(prefix="granforce-held-")
        process = subprocess.Popen(
            [sys.executable, "-m", "granforce", "app", "--no-show", "--port", str(port)],
            env=os.environ | {HELD_VARIABLE: folder.name},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        atexit.register(process.terminate)
        _started[:] = [(process, page_at("localhost", port), folder)]
    process, page, folder = _started[-1]
    return page, Path(folder.name), process
