"""Pictures of packings, and Figure 1 of a scan."""

import argparse
from pathlib import Path
from typing import Any

from granforce.cli.input_tables import read_states
from granforce.cli.results import check_outputs
from granforce.packing import importers
from granforce.records import InputError, whole
from granforce.study.store import open_store


def figures(arguments: argparse.Namespace) -> None:
    """Draw Figure 1 from the store of a scan."""
    from granforce.figures import indeterminacy, save

    if arguments.scan is not None and arguments.scan.endswith(".csv"):
        raise InputError(
            f"{arguments.scan} is a table; Figure 1 is drawn from the store of results: give the "
            "folder of granforce scan --cache, or leave it out for the default store"
        )
    store = open_store(arguments.scan, readonly=True)
    save(indeterminacy(store, backend=_backend(arguments.out)), arguments.out)


def plot(arguments: argparse.Namespace) -> None:
    """Draw a packing with its own network, or with networks from a file."""
    from granforce.figures import picture, save

    check_outputs(arguments.out)
    if Path(arguments.packing).is_dir():
        raise InputError(
            f"{arguments.packing} is a folder; plot draws the file of a packing (.npz), figures "
            "the store of a scan: granforce figures FOLDER --out …"
        )
    packing = importers.load_packing(arguments.packing)
    networks: dict[str, Any] = {}
    if arguments.states is not None:
        contacts, states = read_states(arguments.states, packing)
        if arguments.state is not None:
            states = states[[whole(arguments.state, "--state", 0, len(states) - 1)]]
        networks = {"states": states, "contacts": contacts}
    if arguments.colour == "spread" and len(networks.get("states", "1")) < 2:
        raise InputError("--colour spread needs several networks: give --states without --state")
    drawn = picture.plot(
        packing,
        colour=arguments.colour,
        numbers=arguments.numbers,
        backend=_backend(arguments.out),
        **networks,
    )
    save(drawn, arguments.out)


def _backend(out: str) -> str:
    return "bokeh" if out.endswith(".html") else "matplotlib"
