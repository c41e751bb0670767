"""Cancelling: one flag for all running work, which kernels read in their own loops.

A thread calls cancel() ten times a second and sets the flag. So does Ctrl-C in the main thread,
where Python's signal handlers cannot run before a kernel ends.
"""

import atexit
import contextvars
import functools
import select
import signal
import socket
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple, ParamSpec, TypeVar, cast

import numpy as np

from granforce.records import Cancelled, InputError, ResultWarning, worker_count
from granforce.system.compiled import tell_when_compiling
from granforce.system.interrupts import interrupted
from granforce.types import Cancel, Mask

P = ParamSpec("P")
T = TypeVar("T")

# Seconds between two calls of cancel().
_ASK_EVERY = 0.1
# Seconds that a call of another library gets to end before it is abandoned.
_GRACE = 0.3


class _Scope(NamedTuple):
    flag: Mask  # (1,)
    cancel: Cancel | None


# Set when the process is about to end.
_ending = threading.Event()
_NEVER = _Scope(np.zeros(1, dtype=bool), None)
_scope = contextvars.ContextVar("scope", default=_NEVER)
_APART = "granforce-apart"  # threads with a call that cannot read the flag


# What answers calls of cancellable functions instead of themselves: a store. While it computes an
# answer, which will be warned about, it is `called`.
answering: contextvars.ContextVar[Callable[..., Any] | None] = contextvars.ContextVar(
    "answering", default=None
)


def called(function: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """The function's own result."""
    return function(*arguments, **options)


@contextmanager
def scope(cancel: Cancel | None = None) -> Iterator[None]:
    """A context whose work ends soon after cancel() → True, or after Ctrl-C in the main thread.

    Kernels return early and `check` raises Cancelled. Scopes nest: the outer ones also apply. A
    thread asks cancel(), and reads from a socket the signals that arrive and the end of the scope.
    """
    outer = _scope.get()
    main = threading.current_thread() is threading.main_thread()
    if cancel is None and (outer.cancel is not None or not main):
        yield
        return
    request = _either(outer, cancel)
    inner = _Scope(np.array([_ending.is_set() or interrupted()]), request)
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    installed = main and _wake_by_signals(writer)
    thread = threading.Thread(
        target=_watch,
        args=(inner, reader, cancel is not None),
        name="granforce-cancel",
        daemon=True,
    )
    thread.start()
    token = _scope.set(inner)
    try:
        yield
    finally:
        _scope.reset(token)
        if installed:
            signal.set_wakeup_fd(-1)
        with suppress(BlockingIOError):
            writer.send(b"\0")
        thread.join()
        reader.close()
        writer.close()


def cancellable(function: Callable[P, T]) -> Callable[P, T]:
    """Run the function inside `scope`, with its own keyword argument `cancel`.

    A ResultWarning says if its result, or one of a list, has a `shortfall` without being cancelled.
    """

    @functools.wraps(function)
    def inside(*arguments: P.args, **options: P.kwargs) -> T:
        cancel = cast("Cancel | None", options.pop("cancel", None))
        with _shown(function.__name__, options), scope(cancel):
            answer = answering.get()
            result = (answer or called)(function, *arguments, **options)
            for one in result if isinstance(result, list) else [result]:
                reason = "" if answer is called else getattr(one, "shortfall", "")
                if reason and not cancelled():
                    warnings.warn(reason, ResultWarning, stacklevel=3)
            return result

    return inside


def shown(function: Callable[P, T]) -> Callable[P, T]:
    """A decorator of functions that processes work for: progress=True draws a bar."""

    @functools.wraps(function)
    def inside(*arguments: P.args, **options: P.kwargs) -> T:
        with _shown(function.__name__, options):
            return function(*arguments, **options)

    return inside


@contextmanager
def _shown(name: str, options: dict[str, Any]) -> Iterator[None]:
    """Replace progress=True in options by a tqdm bar; InputError for what cannot be called."""
    progress = options.get("progress")
    if progress is False:
        options["progress"] = None
    elif progress is not None and progress is not True and not callable(progress):
        words = f"must be True, or a function progress(done, total), got {progress!r:.40}"
        raise InputError.of("progress", progress, words)
    if progress is not True:
        yield
        return
    from tqdm.auto import tqdm  # slow to import

    with tqdm(desc=name, leave=False) as bar:

        def show(done: float, total: float | None) -> None:
            bar.set_description_str(name, refresh=False)
            bar.total = total
            bar.update(done - bar.n)

        options["progress"] = show
        end = tell_when_compiling(
            lambda: bar.set_description_str(f"{name}, compiling once per machine")
        )
        try:
            yield
        finally:
            end()


def _either(outer: _Scope, cancel: Cancel | None) -> Cancel:
    requests = [one for one in (outer.cancel, cancel) if one is not None]
    return lambda: (
        bool(outer.flag[0]) or _ending.is_set() or interrupted() or any(ask() for ask in requests)
    )


def end_everything() -> None:
    """End all cancellable work, now and later, in a process that is about to end."""
    _ending.set()


def _wake_by_signals(writer: socket.socket) -> bool:
    """Make signals write their number to the socket, unless an event loop already does so."""
    before = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    if before != -1:
        signal.set_wakeup_fd(before)
    return before == -1


def _watch(inner: _Scope, reader: socket.socket, asks: bool) -> None:
    while not inner.flag[0]:
        readable, _, _ = select.select([reader], [], [], _ASK_EVERY if asks else None)
        numbers = reader.recv(64) if readable else b""
        if signal.SIGINT in numbers:
            inner.flag[0] = True
        if 0 in numbers:
            return
        try:
            cancelled_now = inner.cancel is not None and inner.cancel()
        except Exception:
            return  # the working thread, which also calls it, gets the same error
        if cancelled_now:
            inner.flag[0] = True


def flag() -> Mask:
    """The flag (1,) of the running work, for kernels: they return early once it is True."""
    return _scope.get().flag


def cancelled() -> bool:
    """Whether the running work was cancelled."""
    current = _scope.get()
    if not current.flag[0] and current.cancel is not None and current.cancel():
        current.flag[0] = True
    return bool(current.flag[0])


def check(what: str = "work") -> None:
    """Raise Cancelled if the running work was cancelled."""
    if cancelled():
        raise Cancelled(f"{what} cancelled")


def threads(workers: int) -> ThreadPoolExecutor:
    """A ThreadPoolExecutor whose work is cancelled with the caller's.

    Raises InputError for an invalid number of workers.
    """
    workers = worker_count(workers)
    return ThreadPoolExecutor(workers, initializer=_scope.set, initargs=(_scope.get(),))


def on_threads(work: Callable[[], object], workers: int) -> None:
    """Call work() once in each of so many threads, in the calling one if it is enough."""
    if workers == 1:
        work()
        return
    with threads(workers) as pool:
        for task in [pool.submit(work) for _ in range(workers)]:
            task.result()


def apart(
    call: Callable[..., T], *arguments: Any, interrupt: Callable[[], object] | None = None
) -> T:
    """call(*arguments), which cannot read the flag, in a thread that is abandoned if necessary.

    interrupt(): requests its end, if that is possible. The call must return numbers: memory
    allocated by SuperLU in one thread is lost if another frees it.
    """
    if _scope.get().cancel is None:
        return call(*arguments)
    result: Future[T] = Future()
    context = contextvars.copy_context()

    def work() -> None:
        try:
            result.set_result(context.run(call, *arguments))
        except BaseException as error:
            result.set_exception(error)

    check()
    threading.Thread(target=work, daemon=True, name=_APART).start()
    try:
        while True:
            with suppress(TimeoutError):
                return result.result(_ASK_EVERY)
            check()
    except (Cancelled, KeyboardInterrupt):
        if interrupt is not None:
            interrupt()
        with suppress(TimeoutError, KeyboardInterrupt):
            result.exception(_GRACE)
        raise


def left_behind() -> list[threading.Thread]:
    """Abandoned threads whose call is still running, at the end of the work."""
    return [thread for thread in threading.enumerate() if thread.name == _APART]


@atexit.register
def _wait_for_left() -> None:
    # If C++ returns to an interpreter that has ended, the process aborts.
    for thread in left_behind():
        thread.join()
