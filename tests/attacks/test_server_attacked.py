"""A served page under attack: many clients at once, garbage, limits passed by any way, a signal.

No browser: clients speak the protocol themselves, so that they can break it. Whatever they do, the
next visitor's states are computed, no thread of the server has died, and the store is whole.
"""

import asyncio
import contextlib
import json
import os
import re
import signal
import socket
import time
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from bokeh.client.websocket import WebSocketClientConnectionWrapper
from bokeh.protocol import Protocol
from bokeh.protocol.receiver import Receiver
from heeding import computed, until_it_left
from serving import CLOSED, serve
from small_store import ROOT, cell_parameters
from tornado.httpclient import AsyncHTTPClient, HTTPRequest
from tornado.websocket import WebSocketClosedError, websocket_connect

from app.state.view_settings import TABS
from granforce.study import cells as study
from granforce.study import kinds
from granforce.study.store import open_store

# Minutes, unless it is ended.
LONG = "?mu=0.2&n=60&states=20000&seed={}&relax=gauss_seidel_only"
LIMITS = "n=60,states=20000,upload=1"
HELD = "?mu=0.1&n=30&seed=1&states=30&relax=nearest_piqp"  # as the small store has it
PATIENCE = 300  # s, on a busy machine
# Session after session the server may keep this much, in bytes; it was found to keep 4 kB.
KEPT = 100_000
LARGEST = "9" * 300
ALIVE = Path(__file__).with_name("alive.py")
HEADER = '{"msgid": "1", "msgtype": "PATCH-DOC"}'
# What stands in the log where a thread has died, or code of the page's own has failed.
TROUBLE = ("Exception in thread", "a job failed outside", "could not be", f"{ROOT}/app/")
TROUBLE += ("NameError", "failed with following error")


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """Address and process of the app, and its folder; at the end all its threads are there."""
    folder = tmp_path_factory.mktemp("served")
    yield from serving(folder, "--setup", str(ALIVE), ALIVE=str(folder / "alive"))


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    """The same with limits, for others than its owner."""
    yield from serving(tmp_path_factory.mktemp("shared"), GRANFORCE_LIMITS=LIMITS)


def serving(folder, *options, **variables):
    shipped = folder / "start.zarr"
    study.get(open_store(shipped), kinds.WALK, cell_parameters(0.1), dtypes={"states": "float32"})
    with serve(folder, *CLOSED, *options, GRANFORCE_DATA=str(shipped), **variables) as (
        url,
        server,
    ):
        yield url, server, folder
    log = (folder / "log").read_text()
    for word in TROUBLE:
        before, found, after = log.partition(word)
        assert not found, before[-1000:] + found + after[:3000]


class Client:
    """One visitor without a browser."""

    def __init__(self, socket, document):
        self.socket, self.document = socket, document

    @classmethod
    async def opened(cls, url, query=""):
        """A visitor who has fetched the page, has connected and has pulled its document."""
        options = {"connect_timeout": PATIENCE, "request_timeout": PATIENCE}
        page = await AsyncHTTPClient().fetch(url + query, **options)
        token = re.search(r'"token":"([^"]+)"', page.body.decode())[1]
        address = url.replace("http:", "ws:") + "/ws"
        plain = await websocket_connect(
            HTTPRequest(address, connect_timeout=PATIENCE),
            subprotocols=["bokeh", token],
            max_message_size=1 << 30,
        )
        client = cls(WebSocketClientConnectionWrapper(plain), None)
        await client.answer("ACK")
        client.document = await client.pulled()
        return client

    async def answer(self, kind):
        """The next message of a kind."""
        receiver = Receiver(Protocol())
        while True:
            fragment = await asyncio.wait_for(self.socket.read_message(), PATIENCE)
            assert fragment is not None, f"the server closed the connection before {kind}"
            message = await receiver.consume(fragment)
            if message is not None and message.msgtype == kind:
                return message

    async def ready(self):
        """Say that the page is there, which has the server send the rest of it."""
        await self.patch([_event("document_ready")])

    async def tell(self, bundle, data):
        """Send what the script of a component sends to its model."""
        model = {"id": next(_models(self.document, bundle))["id"]}
        await self.patch([_event("data_event", [["model", model], ["data", data]])])

    async def patch(self, events):
        """Send events, whatever they are, as a patch of the document."""
        await self.raw(
            '{"msgid": "1", "msgtype": "PATCH-DOC"}', "{}", json.dumps({"events": events})
        )

    async def raw(self, *fragments):
        """Send fragments of a message as they are."""
        for fragment in fragments:
            await self.socket.write_message(fragment, binary=isinstance(fragment, bytes))

    async def pulled(self):
        """The document as the server has it now."""
        await Protocol().create("PULL-DOC-REQ").send(self.socket)
        return (await self.answer("PULL-DOC-REPLY")).content["doc"]

    async def told(self, words):
        """Wait until the page tells this; its document."""
        end = time.monotonic() + PATIENCE
        while words not in json.dumps(document := await self.pulled(), ensure_ascii=False):
            assert time.monotonic() < end
            await asyncio.sleep(0.1)
        return document

    async def press(self, label):
        """Press the button whose label begins so."""
        pressed = ["model", {"id": _button(await self.pulled(), label)}]
        data = {"type": "map", "entries": []}
        await self.patch([_event("dom_event", [pressed, ["node", "click"], ["data", data]])])

    def close(self):
        self.socket.close()


def _event(name, entries=()):
    data = {"type": "event", "name": name, "values": {"type": "map", "entries": list(entries)}}
    return {"kind": "MessageSent", "msg_type": "bokeh_event", "msg_data": data}


def _models(part, bundle):
    """The components of this name in a document."""
    if isinstance(part, dict):
        if part.get("attributes", {}).get("bundle") == bundle:
            yield part
        part = list(part.values())
    for inner in part if isinstance(part, list) else ():
        yield from _models(inner, bundle)


def _computing(document):
    """What the line at the bottom tells of a computation; empty where none is under way."""
    (line,) = _models(document, "StatusLine")
    return line["attributes"]["data"]["attributes"].get("progress", {}).get("entries")


def _button(part, label):
    """The id of the button whose label begins so, in a document; None without one."""
    if isinstance(part, dict):
        data = part.get("attributes", {}).get("data")
        told = data.get("attributes", {}) if isinstance(data, dict) else {}
        if str(told.get("label", "")).startswith(label) and told.get("visible", True):
            return part["id"]
        part = list(part.values())
    found = (_button(inner, label) for inner in part) if isinstance(part, list) else ()
    return next((one for one in found if one), None)


def visits(work):
    """Run a coroutine to its end."""
    return asyncio.run(asyncio.wait_for(work, 2 * PATIENCE))


def computes(served, seed):
    """Another visitor asks for states, and they are computed and kept."""
    url, server, folder = served
    parameters = f"mu=0.2&n=30&states=5&seed={seed}&relax=nearest_piqp"

    async def visit():
        client = await Client.opened(url, f"?{parameters}")
        await client.ready()
        end = time.monotonic() + PATIENCE
        while not any(_seed(entry) == seed for entry in kept(folder)):
            assert time.monotonic() < end and server.poll() is None
            await asyncio.sleep(0.1)
        client.close()

    visits(visit())


def kept(folder):
    """What walks visitors' computations have left in the store."""
    path = folder / "cache"
    entries = open_store(path, readonly=True).entries() if path.exists() else []
    return [entry for entry in entries if entry.kind == "walk"]


def _seed(entry):
    return entry.params["packing"].get("seed")


async def _crowd(url, count):
    """So many visitors at once, half of whom ask for what takes long; they never read on."""
    asked = [LONG.format(k % 5) if k % 2 else HELD for k in range(count)]
    clients = await asyncio.gather(*(Client.opened(url, query) for query in asked))
    await asyncio.gather(*(client.ready() for client in clients))
    assert all(next(_models(client.document, "Player"), None) for client in clients)
    for client in clients:
        client.close()


@pytest.mark.parametrize("count", [3, pytest.param(50, marks=pytest.mark.stress)])
def test_many_clients_at_once_are_served(served, count):
    visits(_crowd(served[0], count))
    computes(served, 100 + count)


# What is no HTTP request, or none that the page has an answer to.
REQUESTS = [
    b"\x00" * 4096, b"\xff\xfe" * 100, b"GET\r\n\r\n", b"GET /app HTTP/9.9\r\n\r\n",
    b"POST /app HTTP/1.1\r\nHost: localhost\r\nContent-Length: -1\r\n\r\n",
    b"POST /app HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999\r\n\r\nx",
    b"GET /app?" + b"a" * 100_000 + b" HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"GET /app HTTP/1.1\r\nHost: localhost\r\nX: " + b"y" * 100_000 + b"\r\n\r\n",
    b"GET /app?%ff%fe=%00&mu=%00 HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"GET /../../../../etc/passwd HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"GET /app/ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: x\r\nSec-WebSocket-Version: 13\r\n\r\n\xff\xff\xff\xff",
    b"GET /app/ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Protocol: bokeh, no.token\r\n"
    b"Sec-WebSocket-Key: eA==\r\nSec-WebSocket-Version: 13\r\n\r\n",
]  # fmt: skip
# What is no message, or none that a document has an answer to.
FRAMES = [
    ("",), ("null",), ("[]", "{}", "{}"), ("{}", "{}", "{}"), ("\0" * 1000,), (b"\xff" * 1000,),
    ('{"msgid": "1", "msgtype": "NONE"}', "{}", "{}"), ("[" * 100_000,), (HEADER, "[]", "[]"),
    (HEADER, "{}", "null"), (HEADER, "{}", '{"events": null}'), (HEADER, "{}", '{"events": [1]}'),
    (HEADER, "{}", '{"events": [{"kind": "ModelChanged", "model": {"id": "none"}, "attr": "x",'
     ' "new": 1}]}'),
    (HEADER, "{}", '{"events": [{"kind": "RootRemoved", "model": {"id": "p1"}}]}'),
    (HEADER, "{}", '{"events": [{"kind": "TitleChanged", "title": 5}]}'),
    (HEADER, "{}", '{"events": ' + "[" * 5000 + "]" * 5000 + "}"),
    ('{"msgid": "1", "msgtype": "PATCH-DOC", "num_buffers": 1000000}', "{}", "{}"),
    ('{"msgid": "1", "msgtype": "PUSH-DOC"}', "{}", '{"doc": {"roots": []}}'),
]  # fmt: skip


def test_garbage_ends_nothing_but_itself(served):
    place = urlsplit(served[0])
    for request in REQUESTS:
        with socket.create_connection((place.hostname, place.port), PATIENCE) as sender:
            sender.sendall(request)
            sender.settimeout(0.5)
            with contextlib.suppress(OSError):
                sender.recv(1 << 16)

    async def visit():
        for frame in FRAMES:
            client = await Client.opened(served[0], HELD)
            with contextlib.suppress(WebSocketClosedError):
                await client.raw(*frame)
                await client.raw(*frame)
            client.close()

    visits(visit())
    computes(served, 200)


HUGE, NAN = 10**400, {"type": "number", "value": "nan"}
# What an altered page may say of the hand, of what is known and of its tab.
SAID = [
    {"hold": [0, HUGE, 0]}, {"hold": [0, 1.0, HUGE]}, {"hold": [HUGE, 1.0, 0]},
    {"hold": [-1, 1.0, 0]}, {"hold": [0, -1.0, 0]}, {"hold": [0, NAN, 0]}, {"hold": []},
    {"hold": "all"}, {"release": HUGE}, {"grab": HUGE}, {"grab": True}, {"pull": [0, HUGE]},
    {"pull": [0, -HUGE]}, {"pull": [0, NAN]}, {"pull_point": [HUGE, 1]}, {"undo": True},
    {"tab": HUGE}, {"tab": -1}, {"painted": HUGE}, {"wide": True}, {}, [], "all", None,
]  # fmt: skip


def test_limits_hold_whatever_is_said(shared):
    """By links, by statements of what is known, by pulls and by uploads."""
    url, _, folder = shared
    before = {entry.name for entry in kept(folder)}
    statements = "~".join(f"{c}:1" for c in range(33))
    many = f"{HELD}&known={statements}", f"{HELD}&known=0:{'9' * 400}", f"{HELD}&pulls={statements}"
    links = ["?mu=0.2&n=61&states=5", "?mu=0.2&n=30&states=20001", f"?mu=0.2&n={HUGE}&states=5"]
    links += ["?mu=1e9&n=30&states=5", f"?scene=own&built={'1,1,1;' * 5000}", f"?mu={'9' * 5000}"]
    links += [f"?mu=0.2&n=30&states=5&seed={'9' * 5000}", "?mu=0.2&mu=0.3", "?x=[" + "9" * 5000]

    async def visit():
        for query in (*links, *many):
            client = await Client.opened(url, query)
            await client.ready()
            client.close()
        client = await Client.opened(url, HELD)
        await client.ready()
        for said in SAID:
            await client.tell("Player", said)
        for _ in range(40):
            await client.tell("Player", {"pull": [0, 1.0]})
        document = await client.pulled()
        client.close()
        return json.dumps(document)

    visits(visit())
    computes(shared, 300)
    new = [entry for entry in kept(folder) if entry.name not in before]
    assert [_seed(entry) for entry in new] == [300]


# Hours of work, by bounds that a shared server does not have; and minutes within them.
HOSTILE = (
    "?scene=many&n=60&mu=0.3&seed=777&states=500&sweeps=10000&accuracy=1e-6&dt=0.01&box_mass=10000",
    LONG.format(778),
    LONG.format(779),
)


def test_links_start_nothing_dear_and_who_starts_it_keeps_nobody_waiting(shared):
    """Two open links that ask for hours, press Compute all the same; a third has his states."""
    url, server, folder = shared
    before = {entry.name for entry in kept(folder)}

    def new():
        return [_seed(entry) for entry in kept(folder) if entry.name not in before]

    async def attack():
        clients = [await Client.opened(url, query) for query in HOSTILE]
        for client in clients:
            await client.ready()
        await asyncio.to_thread(computes, shared, 301)
        said = [json.dumps(await client.pulled(), ensure_ascii=False) for client in clients]
        assert "must lie between" in said[0]
        assert all("press Compute" in document for document in said[1:])
        assert new() == [301]
        for client in clients[1:]:
            await client.press("Compute μ")
        begun = computed(server)
        while computed(server) < begun + 2.0:
            await asyncio.sleep(0.05)
        await asyncio.to_thread(computes, shared, 302)
        under_way = [await client.pulled() for client in clients[1:]]
        assert all(map(_computing, under_way))
        for client in clients:
            client.close()

    visits(attack())
    assert sorted(new()) == [301, 302]


def memory(server):
    """Bytes of the server's memory."""
    return (
        int(re.search(r"VmRSS:\s+(\d+)", Path(f"/proc/{server.pid}/status").read_text())[1]) << 10
    )


async def _come_and_go(url, count):
    for _ in range(count):
        client = await Client.opened(url, HELD)
        await client.ready()
        client.close()


@pytest.mark.stress
def test_a_hundred_sessions_leave_nothing(served):
    url, server, _ = served
    sizes = []
    for _ in range(3):
        visits(_come_and_go(url, 50))
        computes(served, 400 + len(sizes))
        time.sleep(15)  # until the server has given them up, and has tidied
        sizes.append(memory(server))
    assert (sizes[2] - sizes[0]) / 100 < KEPT, sizes


def test_pages_that_are_reloaded_or_never_shown_hold_no_thread(served):
    """Their work is ended when the server gives the pages up."""
    url = served[0]

    async def visit():
        for seed in (30, 31):
            await AsyncHTTPClient().fetch(url + LONG.format(seed), request_timeout=PATIENCE)
        for _ in range(3):
            client = await Client.opened(url, LONG.format(34))
            await client.ready()
            await client.told("of 20000 networks")
            client.close()

    visits(visit())
    computes(served, 201)


SELECTION = (
    "mu", "packed", "n", "seed", "states", "walkseed", "sweeps", "dt", "box_mass", "pressure",
    "radii", "source", "relax", "packing",
)  # fmt: skip
VIEW = (
    "tab", "contact", "frame", "reference", "between", "colour", "thickness", "sort",
    "scale",
)  # fmt: skip


def test_a_link_with_the_largest_numbers_computes_nothing(served):
    """One line says what is too large, and the usual states are seen; each alone: test_app.py."""

    async def visit(given, names, told):
        query = "&".join([given, *(f"{name}={LARGEST}" for name in names)])
        client = await Client.opened(served[0], query)
        await client.ready()
        assert not _computing(await client.told(told))
        client.close()

    visits(visit("?", SELECTION, "this link cannot be read: source must be walk or uniform"))
    visits(visit(HELD, VIEW, "seen in all 30 networks"))


def test_the_largest_allowed_of_everything_can_be_cancelled(served):
    # But of μ: at 1000 a packing may have one network only, whose walk ends before it is seen.
    largest = LONG.format(2**53 - 1) + "&walkseed=9007199254740991&sweeps=1000&dt=0.1"
    largest += "&box_mass=10000&pressure=1e6&radii=uniform:1,20"

    async def visit():
        client = await Client.opened(served[0], largest)
        await client.ready()
        await client.told("of 20000 networks")
        client.document = await client.pulled()
        await client.tell("StatusLine", {"cancel": True})
        while _computing(await client.pulled()):
            await asyncio.sleep(0.1)
        client.close()

    visits(visit())
    computes(served, 202)


def test_closed_pages_are_forgotten(served):
    """Those of all attacks, and one with each tab."""
    url, server, folder = served
    alive = folder / "alive"

    def held():
        """How many pages the server holds."""
        alive.touch()
        end = time.monotonic() + PATIENCE
        while not (told := alive.read_text()):
            assert time.monotonic() < end and server.poll() is None
            time.sleep(0.05)
        alive.unlink()
        return int(told)

    async def visit():
        clients = [await Client.opened(url, f"{HELD}&tab={tab}") for tab in TABS]
        for client in clients:
            await client.ready()
        assert await asyncio.to_thread(held) >= len(TABS)
        for client in clients:
            client.close()

    visits(visit())
    end = time.monotonic() + PATIENCE
    while held() > 1:  # Panel may keep the last one until the next
        assert time.monotonic() < end
        time.sleep(0.5)


def end_while_it_computes(url, server, folder):
    """A server that is told to end while it computes leaves no process, and the store whole."""
    visits(_begun(url, server, folder / "cache"))
    children = Path(f"/proc/{server.pid}/task/{server.pid}/children").read_text().split()
    os.kill(server.pid, signal.SIGTERM)
    server.wait(PATIENCE)
    assert server.returncode == 0
    store = open_store(folder / "cache")  # which takes parts away that were being written
    assert all(verdict.ok for verdict in store.verify())
    assert not list((folder / "cache").glob(".tmp-*"))
    assert not [child for child in children if Path(f"/proc/{child}").exists()]


async def _begun(url, server, cache):
    made = len(list(cache.glob("packing-*")))
    clients = [await Client.opened(url, LONG.format(k)) for k in range(50, 53)]
    for client in clients:
        await client.ready()
    await asyncio.to_thread(until_it_left, cache, "packing-*", made + 1, server)
    before = computed(server)
    while computed(server) < before + 1.0:
        await asyncio.sleep(0.05)


def test_a_server_can_be_told_to_end_while_it_computes(served):
    """The last test: none has the server after it."""
    end_while_it_computes(*served)


@pytest.mark.stress
def test_five_servers_can_be_told_to_end_while_they_compute(tmp_path):
    for _ in range(5):
        with serve(tmp_path) as (url, server):
            end_while_it_computes(url, server, tmp_path)
