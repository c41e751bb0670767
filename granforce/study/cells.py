"""Cells of a study: one dataset each, found in the store or computed and kept.

A cell is one result of one kind (`granforce.study.kinds`), named by plain parameters. Cells are
independent and seeded: they may be computed anywhere and in any order (`granforce.study.scan`).
"""

from collections.abc import Callable
from typing import NamedTuple

from granforce.system import cancelling


class Kind(NamedTuple):
    """One kind of result: what it is called, what names one of it, and how one is computed."""

    name: str  # in the store: entries are called <name>-<key>
    version: int  # raised when the algorithm gives other numbers: older entries are not used
    title: str  # in words
    unit: str  # what progress counts: progress(done, total), but of a packing (step, message)
    parameters: Callable[..., Parameters]  # (…) → the plain parameters that name one; InputError for what is wrong
    compute: Callable[..., xr.Dataset]  # (store, parameters, *, workers, progress, …) → its dataset
    holds_states: bool = False


class Cell(NamedTuple):
    """One dataset of a study."""

    kind: Kind
    parameters: Parameters  # that name it in the store


@cancelling.cancellable
def get(store, kind, parameters, *, workers=2, dtypes=None, progress=None, cancel=None, **options):
    """The dataset of a kind and parameters, and whether the store had it; if not, it is kept.

    workers: threads, which change nothing in the result. dtypes: as for Store.save, of states.
    options: as the kind's compute takes them beside. Raises what that raises.
    """
    found = load(store, kind, parameters)
    if found is not None:
        return found, True
    dataset = kind.compute(store, parameters, workers=workers, progress=progress, **options)
    save(store, kind, parameters, dataset, dtypes=dtypes if kind.holds_states else None)
    return dataset, False


def load(store, kind, parameters):
    """The dataset of a kind and parameters, or None where the store has none."""
    return store.load(kind.name, parameters, version=kind.version)


def save(store, kind, parameters, dataset, *, dtypes=None):
    """Keep a dataset under its kind and parameters; returns the entry's name."""
    return store.save(kind.name, parameters, dataset, version=kind.version, dtypes=dtypes)


def entry_name(store, kind, parameters):
    """Name of the entry of a kind and parameters, whether the store has it or not."""
    return store.name(kind.name, parameters, version=kind.version)


def entries(store, kind, **parameters):
    """Entries of a kind with these parameters, of its current version, as Store.find."""
    found = store.find(kind.name, **parameters)
    return [entry for entry in found if is_current(kind, entry)]


def is_current(kind, entry):
    """Whether an entry is of the current version of its kind, and of its packing's."""
    packing = entry.params.get("packing")
    # Packings of version 1 did not name the accuracy of their steps.
    older = isinstance(packing, dict) and "n" in packing and "accuracy" not in packing
    return entry.version == kind.version and not older


ROW = ("packing_fraction", "coordination", "dimension", "eta1", "eta2", "eta3", "acceptance")
ROW_COUNTS = ("accepted", "rejected", "unconverged", "skipped", "rattlers", "unloaded_contacts")


def row(parameters, dataset, cached):
    """One line of a table of walks: plain numbers of one cell."""
    packing = parameters["packing"]
    return {
        "mu": packing["mu"],
        "seed": packing.get("seed"),
        **{name: dataset[name].item() for name in (*ROW, *ROW_COUNTS)},
        "residual": float(dataset["residual"].max()),
        "cached": cached,
    }
