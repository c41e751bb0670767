"""The study, the app, the documentation, the benchmark and the store."""

import argparse
import glob
import http.server
import importlib.util
import json
import os
import re
import runpy
import shutil
import subprocess
import sys
import webbrowser
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import platformdirs

from granforce.cli.parser import LONGEST, make_parser
from granforce.cli.path_roles import ROLES, Input, Output
from granforce.records import InputError, whole
from granforce.study import kinds
from granforce.study.keys import Parameters
from granforce.study.series import FRAME
from granforce.study.store import Entry, Store, open_store, refuse_newer
from granforce.system.compiled import kernels
from granforce.system.files import make_folder
from granforce.system.terminal import print_list, print_notes, print_report
from granforce.system.wording import counted, json_text, spaced


def study_(arguments: argparse.Namespace) -> int:
    """Run the paper's study. Returns 1 if a cell failed."""
    from granforce.paper.main import main

    return main(arguments)


def app(arguments: argparse.Namespace) -> None:
    """Serve the app by `panel serve` in this process until interrupted."""
    from granforce.cli import viewer

    port = whole(arguments.port, "--port", 0, 65_535)
    for origin in arguments.allow_websocket_origin:
        if not re.fullmatch(r"[^\s:/,]+(:\d{1,5})?", origin):
            raise InputError(
                f"--allow-websocket-origin {origin[:40]!r}: give a name and a port, such as "
                "lab.example.org:5006"
            )
    port = viewer.checked_port(arguments.address, port)
    words = ["panel", "serve", str(_page()), "--port", str(port), "--address", arguments.address]
    for origin in arguments.allow_websocket_origin:
        words += ["--allow-websocket-origin", origin]
    if arguments.basic_auth:
        secret = arguments.cookie_secret or os.environ.get("PANEL_COOKIE_SECRET")
        if not secret:
            raise InputError(
                "--basic-auth needs a secret that signs the cookies: --cookie-secret, or "
                "PANEL_COOKIE_SECRET in the environment"
            )
        words += ["--basic-auth", arguments.basic_auth, "--cookie-secret", secret]
    words += ["--warm"] if arguments.warm else []
    words += ["--use-xheaders"] if arguments.use_xheaders else []
    words += ["--plugins", "granforce.cli.health"]
    page = viewer.page_at(arguments.address, port) + viewer.query_of_file(arguments.packing)
    if not arguments.no_show:
        viewer.open_when_ready(page)
    elif arguments.packing:
        print(page, flush=True)
    sys.argv = words
    runpy.run_module("panel", run_name="__main__", alter_sys=True)


def _page() -> Path:
    """The app's folder: inside the installed package, or next to it in a clone."""
    package = Path(__file__).resolve().parents[2]
    for folder in (package / "app", package.parent / "app"):
        if (folder / "main.py").is_file():
            return folder
    raise InputError(f"the app is not installed: {package} has no folder app; install the wheel")


def docs(arguments: argparse.Namespace) -> None:
    """Build the documentation; without a target folder, serve it until interrupted."""
    if importlib.util.find_spec("mkdocs") is None:
        raise InputError("the documentation needs more packages: pip install 'granforce[docs]'")
    if arguments.out:
        folder = Path(arguments.out).absolute()
        if not folder.parent.is_dir():
            raise InputError(f"--out: the folder {folder.parent} does not exist")
        _build_docs(folder)
        print(folder / "index.html")
        return
    # Not in the folder of the default store, which would be refused with foreign contents.
    folder = make_folder(_docs_folder()) / "site"
    _build_docs(folder)
    # Over HTTP, because browsers do not run the search in pages opened from files.
    handler = partial(_QuietHandler, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        address = f"http://127.0.0.1:{server.server_address[1]}/index.html"
        print(address, flush=True)
        webbrowser.open(address)
        server.serve_forever()


def _docs_folder() -> Path:
    return platformdirs.user_cache_path("granforce-docs")


def _build_docs(folder: Path) -> None:
    print_notes(["building the documentation, which takes up to two minutes …"])
    settings = Path(__file__).parents[2] / "docs" / "mkdocs.yml"
    build = (sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict")
    done = subprocess.run(
        [*build, "--config-file", settings, "--site-dir", folder],
        stdout=sys.stderr,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
    )
    if done.returncode:
        raise InputError("the documentation could not be built: see above")


class _QuietHandler(http.server.SimpleHTTPRequestHandler):
    def log_message(self, format: str, *arguments: Any) -> None:
        pass


def completion(arguments: argparse.Namespace) -> None:
    """Print the script for completion in a shell."""
    import shtab

    parser = make_parser()
    for action in parser.every_action():
        if action.type in (Input, Output):
            action.complete = shtab.FILE  # type: ignore[attr-defined]
        elif action.type in ROLES:
            action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
    print(shtab.complete(parser, arguments.shell))


def bench(arguments: argparse.Namespace) -> None:
    """Measure and print a report, or read one; write its figures, and its tables into documents."""
    from granforce.bench import documents, draw, main
    from granforce.system import markdown

    renewed = markdown.marked_files(arguments.documents, documents.KIND)
    if arguments.table is None:
        results = main(arguments.out, arguments.quick, arguments.json)
    else:
        results = documents.load(arguments.table)
        if arguments.out is not None and not draw(make_folder(arguments.out), results):
            raise InputError(f"{arguments.table}: none of its parts has a figure; omit --out")
    if renewed:
        documents.renew(renewed, results)


def cache(arguments: argparse.Namespace) -> int:
    """List, measure, clear or verify a store. Returns 1 if an entry is damaged."""
    if arguments.action == "path":
        path = str(open_store(arguments.cache).path)
        print(json_text({"path": path}) if arguments.json else path)
        return 0
    if arguments.kind in _OTHERS and arguments.action in ("size", "clear"):
        return _others(arguments)
    store = open_store(arguments.cache, readonly=True)  # readonly: does not create a missing store
    refuse_newer(store.path)
    if arguments.kind is not None:
        _check_kind(store, arguments.kind)
    if arguments.action == "clear":
        entries = store.find(arguments.kind)
        size = sum(entry.bytes for entry in entries)
        if not _confirmed(arguments, counted(len(entries), "result", "results"), size, store.path):
            return 0
        store = open_store(store.path)
        lines = {"removed": store.clear(arguments.kind), "temporaries": store.clean()}
        print_report(lines, arguments.json)
    elif arguments.action == "size":
        entries = store.find(arguments.kind)
        size = sum(entry.bytes for entry in entries)
        lines = {"path": str(store.path), "entries": len(entries), "bytes": size}
        if arguments.cache is None and arguments.kind is None:
            for name, files_of in _OTHERS.items():
                lines[f"{name}_bytes"] = sum(file.stat().st_size for file in files_of())
        print_report(lines, arguments.json)
    elif arguments.action == "verify":
        verdicts = [verdict._asdict() for verdict in store.verify(arguments.kind)]
        print_list(verdicts, ("name", "ok", "reason"), arguments.json)
        return 0 if all(verdict["ok"] for verdict in verdicts) else 1
    else:
        entries = store.find(arguments.kind)
        if arguments.json:
            params = [{"params": json.dumps(entry.params)} for entry in entries]
            print(json_text([e._asdict() | more for e, more in zip(entries, params, strict=True)]))
        else:
            _print_entries(entries)
    return 0


def _documentation() -> list[Path]:
    """The files of the documentation that `granforce docs` has built."""
    return [file for file in _docs_folder().rglob("*") if file.is_file()]


# Files that are no results, by the names of --kind.
_OTHERS = {"documentation": _documentation, "kernels": kernels}


def _others(arguments: argparse.Namespace) -> int:
    """Measure or remove the built documentation or the compiled kernels."""
    files = _OTHERS[arguments.kind]()
    size = sum(file.stat().st_size for file in files)
    if arguments.action == "size":
        print_report({"files": len(files), "bytes": size}, arguments.json)
    elif _confirmed(arguments, f"{len(files)} files of {arguments.kind}", size, *files[:1]):
        for file in files:
            file.unlink(missing_ok=True)
        print_report({"removed": len(files)}, arguments.json)
    return 0


def _confirmed(arguments: argparse.Namespace, what: str, size: int, *place: Path) -> bool:
    """Whether to remove something: with --yes, or after a question in a terminal."""
    if arguments.yes:
        return True
    if not sys.stdin.isatty():
        raise InputError(f"clear would remove {what}: add --yes, as no terminal can be asked")
    where = f" in {place[0]}" if place else ""
    print(
        f"Remove {what} ({size / 1e6:.3g} MB){where}? [y/N] ", end="", file=sys.stderr, flush=True
    )
    if sys.stdin.readline().strip().lower() in ("y", "yes"):
        return True
    print_notes(["nothing was removed"])
    return False


def _print_entries(entries: Sequence[Entry]) -> None:
    """A line for each entry, at most as long as the terminal is wide."""
    width, _ = shutil.get_terminal_size((LONGEST, 0))
    size = max((len(str(entry.bytes)) for entry in entries), default=0)
    size = max(size, len("bytes"))
    print(f"{'name':<28}  {'bytes':>{size}}  {'created':<10}  contents")
    for entry in entries:
        line = f"{entry.name:<28}  {entry.bytes:>{size}}  {entry.created[:10]}  "
        line += _contents(entry.params)
        print(line if len(line) <= width else f"{line[: width - 1]}…")


def _contents(parameters: Parameters) -> str:
    """The packing of an entry and its other parameters, in words."""
    packing = parameters.get("packing", parameters)
    mu = f"μ = {packing['mu']:g}" if "mu" in packing else ""
    if "imported" in packing:
        words = [f"imported {packing['imported'][:8]}", mu]
    elif "scene" in packing:
        words = [f"scene {packing['scene']}", mu]
    else:
        words = [f"{packing['n']} disks", mu, f"seed {packing['seed']}"] if "n" in packing else [mu]
    others = parameters if packing is not parameters else {}
    words += [
        f"{spaced(name)} {value}"
        for name, value in others.items()
        if isinstance(value, (int, float, str)) and name not in ("version", "mu")
    ]
    return ", ".join(word for word in words if word)


def _check_kind(store: Store, kind: str) -> None:
    """InputError for a name that is neither a kind of result nor the beginning of other entries."""
    known = [*kinds.KINDS, FRAME.name]
    if kind not in known and not any(store.path.glob(f"{glob.escape(kind)}-*")):
        raise InputError(f"unknown kind of result {kind[:40]!r}; choose one of {', '.join(known)}")
