"""The results of commands: parameters and conditions from options, and their datasets."""

import argparse
import json
import threading
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from granforce import measures
from granforce.cli.input_tables import read_known
from granforce.cli.report_lines import WORK, line
from granforce.explore.uniform import unreliable
from granforce.forces.knowledge import Known, refuse_others
from granforce.labelled import column_name
from granforce.packing import importers
from granforce.quantities import FORCE
from granforce.records import InputError, Packing, ResultWarning, worker_count
from granforce.study import cells as study
from granforce.study import kinds
from granforce.study.cells import Kind
from granforce.study.keys import Parameters
from granforce.study.series import check_folder
from granforce.study.store import Store, open_store
from granforce.system.files import check_file, content_of
from granforce.system.terminal import Bar
from granforce.system.wording import number


def radii(text: str, n: int) -> str | list[float]:
    if ":" in text:
        return text
    try:
        radii = [number(line) for line in content_of(text).decode().split()]
    except ValueError as error:
        raise InputError(f"radii file {text}: {error}") from None
    if len(radii) != n:
        raise InputError(f"radii file {text} has {len(radii)} radii for {n} disks (-n)")
    return radii


def numbers(
    option: str, text: str | None, cast: Callable[[str], Any], words: str = ""
) -> list[Any] | None:
    """The numbers of an option, separated by commas; None if it was not given.

    words: other values, for the error message.
    """
    if text is None:
        return None
    try:
        return [cast(part) for part in text.split(",")]
    except ValueError:
        raise InputError(
            f"{option} {text[:40]!r}: give {words}numbers separated by commas"
        ) from None


def distinct(
    option: str, text: str | None, cast: Callable[[str], Any], words: str = ""
) -> list[Any] | None:
    """The numbers of an option for a list of cases; InputError for one that is given twice."""
    found = numbers(option, text, cast, words)
    if repeated := [one for k, one in enumerate(found or []) if one in (found or [])[:k]]:
        raise InputError(f"{option} {repeated[0]} is given twice; give it once")
    return found


def check_outputs(*paths: str | None) -> None:
    """InputError for files that cannot be written, before anything is computed."""
    for path in paths:
        if path is not None and path.endswith(".zarr"):
            check_folder(path)
        elif path is not None:
            check_file(path)


def packing_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """The options of a packing, as arguments of `pack`."""
    return {
        "radii": radii(arguments.radii, arguments.n),
        "pressure": arguments.pressure,
        "dt": arguments.dt,
        "box_mass": arguments.box_mass,
        "sweeps": arguments.sweeps,
        "accuracy": arguments.step_accuracy,
        "drag_below": arguments.drag_below,
        "box": arguments.box,
    }


def packing_parameters(arguments: argparse.Namespace, mu: float, seed: int) -> Parameters:
    return kinds.PACKING.parameters(arguments.n, mu, seed, **packing_options(arguments))


def required_mu(arguments: argparse.Namespace) -> float:
    if arguments.mu is None:
        raise InputError("give the friction coefficient: --mu 0.1")
    return arguments.mu


def store_of(arguments: argparse.Namespace) -> Store:
    """The store of a command; it is remembered, to report results that could not be stored."""
    arguments.store = open_store(arguments.cache)
    arguments.store.make()  # before any computation
    return arguments.store


def open_with_packing(
    arguments: argparse.Namespace,
    kind: Kind,
    name: Callable[[Parameters], Parameters],
    *outputs: str | None,
    known: Known | None = None,
) -> tuple[Store, Parameters]:
    """The store, containing the packing, and the parameters name(its parameters).

    known: forces to be checked against the packing. All errors that the command line alone can show
    are raised before a packing is made.
    """
    worker_count(arguments.workers, "--workers")
    if arguments.packing is None:
        packing = None
        named = packing_parameters(arguments, required_mu(arguments), arguments.seed)
    else:
        packing = importers.load_packing(arguments.packing)
        if np.isnan(packing.pressure) and getattr(arguments, "prescribe", None) == "pressure":
            raise InputError(
                "--prescribe pressure needs a periodic box with a pressure: leave it out"
            )
        _refuse_others(known, packing)
        named = kinds.parameters_of(open_store(arguments.cache), packing)
    parameters = name(named)
    check_outputs(*outputs)
    store = store_of(arguments)
    store.refuse_file(study.entry_name(store, kind, parameters))
    if packing is None:
        packing, _ = get_packing(store, named)
        _refuse_others(known, packing)
    else:
        kinds.keep_packing(store, named, packing, in_memory=True)
    return store, parameters


def _refuse_others(known: Known | None, packing: Packing) -> None:
    if known is not None:
        refuse_others(known, packing.contacts)


def get_packing(store: Store, parameters: Parameters, **options: Any) -> tuple[Packing, bool]:
    """The packing of these parameters, made or loaded, and whether it was loaded."""
    with Bar(kinds.PACKING.title, kinds.PACKING.unit) as progress:

        def watch(glimpse: Any) -> None:
            progress.note(glimpse.state)

        return kinds.get_packing(store, parameters, progress=progress, watch=watch, **options)


class StoredResult(NamedTuple):
    """The result that a command reports."""

    entry: str  # its name in the store
    parameters: Parameters
    dataset: xr.Dataset
    cached: bool  # whether it was already in the store

    def report(
        self, names: Sequence[str], arguments: argparse.Namespace, **given: Any
    ) -> dict[str, Any]:
        """The named lines, in this order: given values, else stored ones; others are left out.

        given: forces in the packing's unit; they are reported in that of --unit.
        """
        given = {"entry": self.entry, "cached": self.cached} | given
        report: dict[str, Any] = {}
        for name in names:
            value = given[name] if name in given else self._stored(name)
            if (name in WORK and not arguments.json) or (name not in given and value is None):
                continue
            if line(name).unit == FORCE:
                report |= unit(arguments, self.dataset).reported({name: value})
            else:
                report[name] = value
        return report

    def _stored(self, name: str) -> Any:
        """The value of a line in the dataset, or among its counts; None if it is in neither."""
        source, dataset = line(name), self.dataset
        if source.stored not in dataset:
            return json.loads(dataset.attrs.get("counts", "{}")).get(name)
        if source.nonzero and not dataset[source.nonzero].item():
            return None
        values = dataset[source.stored]
        return (getattr(values, source.reduced)() if source.reduced else values).item()


def stored_result(
    arguments: argparse.Namespace,
    kind: Kind,
    *outputs: str | None,
    watching: Any = None,
    options: Any = None,
    **named: Any,
) -> StoredResult:
    """The result of a kind, computed or loaded; outputs: files that will be written.

    named: its parameters in addition to the packing and the friction of the cones. watching(bar): a
    callback for the kind's compute that shows progress on the bar; options: its other arguments.
    """
    store, parameters = open_with_packing(
        arguments,
        kind,
        lambda packing: kind.parameters(packing, mu=arguments.ensemble_mu, **named),
        *outputs,
        known=named.get("known"),
    )
    with Bar(kind.title, kind.unit) as progress:
        keywords = {"workers": arguments.workers, "progress": progress, **(options or {})}
        keywords |= {} if watching is None else {"watch": watching(progress)}
        with warnings.catch_warnings():
            if kind is not kinds.INFORMATIVE:  # the commands say so themselves, also if cached
                warnings.simplefilter("ignore", ResultWarning)
            dataset, cached = study.get(store, kind, parameters, **keywords)
    return StoredResult(study.entry_name(store, kind, parameters), parameters, dataset, cached)


def eta_shown(bar: Any) -> Callable[[Any], None]:
    """watch(WalkState) of a walk, which shows η1 of all states so far next to the bar."""
    growth, lock = measures.Growth(), threading.Lock()

    def watch(state: Any) -> None:
        with lock:
            bar.note(f"η1 = {growth.add(state.forces)[0]:.4f}")

    return watch


def conditions(arguments: argparse.Namespace) -> dict[str, Any]:
    """The conditions in the options, as parameters of kinds."""
    chosen = {
        "prescribed": arguments.prescribe or "pressure",
        "stress": numbers("--stress", arguments.stress, number),
    }
    return chosen | known_forces(arguments)


def known_forces(arguments: argparse.Namespace) -> dict[str, Any]:
    """The known forces in the options, as parameters of kinds."""
    given = getattr(arguments, "known", None)
    return {} if given is None else {"known": read_known(given)}


class Unit(NamedTuple):
    """The unit in which a command reports and writes forces."""

    word: str  # packing or mean
    scale: float  # this unit in units of the packing's

    def named(self, forces: Mapping[str, Any]) -> dict[str, Any]:
        """Named forces converted from the packing's unit to this one, which is added to names."""
        return {
            column_name(None, name, self.word): values / self.scale
            for name, values in forces.items()
        }

    def reported(self, forces: Mapping[str, Any]) -> dict[str, Any]:
        """Named forces as in `named`, as plain numbers and lists."""
        return {name: np.asarray(values).tolist() for name, values in self.named(forces).items()}


PACKING_UNIT = Unit("packing", 1.0)


# Forces in reports on packings, which have one fixed unit.
_REPORTED = {
    "mean_normal_force": "packing",
    "mean_measured_normal_force": "packing",
    "error": "mean measured",
    "mean_change_of_f_n": "mean measured",
    "mean_change_of_f_t": "mean measured",
}


def with_units(lines: Mapping[str, Any]) -> dict[str, Any]:
    """A report on a packing, with the units of forces in the names."""
    return {
        column_name(None, name, _REPORTED[name]) if name in _REPORTED else name: value
        for name, value in lines.items()
    }


def unit(arguments: argparse.Namespace, dataset: xr.Dataset) -> Unit:
    """The unit of --unit: the packing's own, or the mean normal force of its ensemble."""
    if arguments.unit == "mean":
        return Unit("mean", dataset["force_scale"].item())
    return PACKING_UNIT


def interval_lengths(dataset: xr.Dataset) -> dict[str, float]:
    """Lengths of the finite intervals of f_n, by name, in the packing's unit."""
    extent = (dataset["high"] - dataset["low"]).values[:, 0]
    extent = extent[np.isfinite(extent)]
    return {
        "mean_extent_of_f_n": float(extent.mean()) if len(extent) else np.nan,
        "largest_extent_of_f_n": float(extent.max()) if len(extent) else np.nan,
    }


def walk_result(arguments: argparse.Namespace, output: str | None = None) -> StoredResult:
    """The walk of the options; output: a file that will be written."""
    return stored_result(
        *(arguments, kinds.WALK, output),
        watching=eta_shown,
        states=arguments.states,
        seed=arguments.walk_seed,
        relax=arguments.relax,
        chains=arguments.chains,
        **conditions(arguments),
    )


def sample_notes(dataset: xr.Dataset) -> list[str]:
    """A note if the states of a sample are not to be relied on, and what to do."""
    if not dataset["dimension"].item():
        return []
    sizes = [dataset[name].item() for name in ("least_bulk_size", "least_tail_size")]
    why = unreliable(dataset["worst_r_hat"].item(), min(sizes))
    return [f"the sample is unreliable: {why}; use more --states"] if why else []
