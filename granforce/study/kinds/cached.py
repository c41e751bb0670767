"""Results of functions, loaded from a store or saved there, under the keys of the command line."""

import inspect
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from granforce.experiment.informative import Informative, informative
from granforce.explore.intervals import LimitLoads, intervals, limit_load_bounds
from granforce.explore.random_walk import walk
from granforce.explore.stress_outline import StressOutline, stress_outline
from granforce.explore.uniform import sample_uniform
from granforce.explore.volume import Volume, volume
from granforce.forces.build import ensemble
from granforce.packing.compaction import pack
from granforce.records import InputError
from granforce.study import kinds
from granforce.study.bounds import intervals_of, result_of
from granforce.study.cells import Kind, get, load
from granforce.study.keys import Parameters
from granforce.study.samples import uniform_of, walk_of
from granforce.study.schema import dataset_packing
from granforce.study.store import Store, open_store
from granforce.system.cancelling import answering, called


def cached(path: str | Path | None = None) -> AbstractContextManager[Store]:
    """A context in which results are loaded from a store, or computed and saved there.

    The command line and this context find what the other saved. `pack`, `walk`, `sample_uniform`,
    `intervals`, `limit_loads`, `limit_load_bounds`, `volume`, `stress_outline` and `informative`
    return what the store has of a result: a UniformSample cannot be continued, and bounds that
    could not be certified are an error. Calls that the command line cannot make are computed as
    usual: of other functions, with functions or states as arguments, with contacts out of order, in
    ensembles with frozen forces. The context is that of one thread; others enter their own.

    Parameters
    ----------
    path : path, optional
        Folder of the store, by default that of the command line.

    Returns
    -------
    context manager
        Its value is the Store.

    Raises
    ------
    InputError
        As `open_store`, and if the folder cannot be written.
    """
    store = open_store(path)
    store.make()
    return _answering(partial(_answer, store), store)


@contextmanager
def _answering(answer: Callable[..., Any], store: Store) -> Iterator[Store]:
    token = answering.set(answer)
    try:
        yield store
    finally:
        answering.reset(token)


class _Answer(NamedTuple):
    """What the store has of a function's results."""

    kind: Kind
    result: Callable[..., Any]  # (S, dataset) → what the function returns
    unnamed: tuple[str, ...] = ()  # options that do not change it


def _limit_loads(S: Any, dataset: xr.Dataset) -> LimitLoads:
    certified = ~np.isnan(dataset["limit_load"].values)
    return result_of(LimitLoads, dataset, converged=bool(certified.all()))


def _volume(S: Any, dataset: xr.Dataset) -> Volume:
    return result_of(Volume, dataset, reached=bool(dataset["reached"]))


def _stress_outline(S: Any, dataset: xr.Dataset) -> StressOutline:
    return result_of(StressOutline, dataset, converged=True)


def _informative(S: Any, dataset: xr.Dataset) -> Informative:
    twins = json.loads(dataset.attrs["twins"])
    return result_of(Informative, dataset, twins=tuple(map(tuple, twins)))


_ANSWERS = (
    (pack, _Answer(kinds.PACKING, lambda S, found: dataset_packing(found), ("max_steps", "watch"))),
    (walk, _Answer(kinds.WALK, lambda S, found: walk_of(found), ("watch",))),
    (sample_uniform, _Answer(kinds.UNIFORM, lambda S, found: uniform_of(found))),
    (intervals, _Answer(kinds.INTERVALS, intervals_of, ("widths", "watch"))),
    (limit_load_bounds, _Answer(kinds.LIMIT_LOADS, _limit_loads)),
    (volume, _Answer(kinds.VOLUME, _volume)),
    (stress_outline, _Answer(kinds.STRESS, _stress_outline)),
    (informative, _Answer(kinds.INFORMATIVE, _informative, ("watch",))),
)
# By functions without their decorators.
_BY_FUNCTION = {inspect.unwrap(function): answer for function, answer in _ANSWERS}
# Arguments of `ensemble`; a kind of result takes those that are parameters of its command.
_USUAL = {name: one.default for name, one in inspect.signature(ensemble).parameters.items()}


def _answer(store: Store, function: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """The result of a call; without a key it is computed."""
    answer = _BY_FUNCTION.get(function)
    named = None if answer is None else _parameters(store, answer, function, arguments, options)
    if answer is None or named is None:
        return function(*arguments, **options)
    dataset = load(store, answer.kind, named)
    S = options.get("ensemble", *arguments[:1]) if "packing" in named else None
    if dataset is None:
        passed = ("workers", "progress", *answer.unnamed)
        with _answering(called, store):  # what it calls has keys of other ensembles
            if S is not None:
                kinds.keep_packing(store, named["packing"], S.packing)
                kinds.remember(store, named, S)
            chosen = {name: options[name] for name in passed if name in options}
            dataset, _ = get(store, answer.kind, named, **chosen)
    return answer.result(S, dataset)


def _parameters(
    store: Store,
    answer: _Answer,
    function: Callable[..., Any],
    arguments: Sequence[Any],
    options: Mapping[str, Any],
) -> Parameters | None:
    """The parameters of a call in the store; None if it has no key there, or is wrong."""
    signature = inspect.signature(function)
    usual = {name: one.default for name, one in signature.parameters.items()}
    own = inspect.signature(answer.kind.parameters).parameters.keys() & usual.keys()
    try:
        given = signature.bind(*arguments, **options).arguments
        named = {name: given.get(name, usual[name]) for name in own}
        S = given.pop("ensemble", None)
        others = given.keys() - own - {"workers", "progress", *answer.unnamed}
        if any(_differ(given[name], usual[name]) for name in others):
            return None
        if S is not None:
            if S.conditions is None:
                return None
            named |= {name: v for name, v in S.conditions.items() if _differ(v, _USUAL[name])}
            named["packing"] = kinds.parameters_of(store, S.packing)
        parameters = answer.kind.parameters(**named)
    except (InputError, TypeError):
        return None
    contacts = named.get("contacts")
    in_order = contacts is None or parameters["contacts"] == list(contacts)
    return parameters if in_order else None


def _differ(value: Any, usual: Any) -> bool:
    return bool(value != usual) if isinstance(value, str) else value is not usual
