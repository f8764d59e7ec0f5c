"""Work on several processors: rows of a batch in threads, tasks in processes.

Compiled functions run without Python's global lock, so that batches are divided among threads.
Tasks that are mostly Python, each of half a second or more, run on an executor: the processes of
:func:`processes`, or any other ``concurrent.futures.Executor``, such as that of a cluster. Without
one they run in this process, with the same results.
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import (
    FIRST_EXCEPTION,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ThreadPoolExecutor,
    as_completed,
    wait,
)
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar

from seecr.errors import ExecutorError, InputError, MissingPackageError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

T = TypeVar("T")
R = TypeVar("R")

BLOCK = 64
"""Rows of a batch that may depend on one another, in their last digit: they stay together."""
# Fewer poses than this are not worth a second thread.
_CHUNK = 128
# A scheduler that is there answers within a second; over a slow network it may take a few.
_SECONDS = 10
# Held by a process of an executor while it is not at a task: half a result that it sends would keep
# the process that reads it waiting for ever.
_between = threading.Lock()
# Per thread: ``whole``, whether the other processors are busy, so that batches are not divided.
_at = threading.local()


def processors() -> int:
    """Processors available to this process: in a container often fewer than the machine has."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


# --- rows in threads ------------------------------------------------------------------------------


def in_parts(run: Callable[[slice], None], n: int, threads: int | None = None) -> None:
    """Run a job on n rows, in as many parts as there are threads, if these have enough rows.

    Within a part of another job it is not divided: the other threads are busy. Parts begin at
    multiples of :data:`BLOCK`.
    """
    count = max(1, n // _CHUNK)
    if count > 1:  # asking the system takes longer than a few rows
        most = 1 if _is_whole() else threads
        count = min(count, processors() if most is None else most)
    edges = [n * k // count // BLOCK * BLOCK for k in range(count)] + [n]
    run_parts(run, [slice(a, b) for a, b in pairwise(edges)])


@contextmanager
def undivided() -> Iterator[None]:
    """Batches of this thread stay whole: the other processors are busy."""
    before = _is_whole()
    _stay_whole(True)
    try:
        yield
    finally:
        _stay_whole(before)


def _is_whole() -> bool:
    return getattr(_at, "whole", False)


def _stay_whole(whole: bool) -> None:
    _at.whole = whole


def run_parts(run: Callable[[slice], None], parts: list[slice]) -> None:
    """Run a job on every part of a batch, in one thread per processor.

    Each thread takes the next part that is left, so that none waits for another before the end.
    After an error no further part is begun.
    """
    executor = threads() if len(parts) > 1 else None
    if executor is None:
        for part in parts:
            run(part)
        return
    futures = [executor.submit(run, part) for part in parts]
    try:
        wait(futures, return_when=FIRST_EXCEPTION)
    finally:
        begun = [future for future in futures if not future.cancel()]
        wait(begun)
    for future in begun:
        future.result()


def threads() -> Executor | None:
    """The threads of this process, one per processor, as an executor; None where they are busy."""
    return None if _is_whole() or processors() == 1 else _pool()


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(processors(), initializer=_stay_whole, initargs=(True,))


if hasattr(os, "register_at_fork"):
    # a forked process has the pool, but none of its threads
    os.register_at_fork(after_in_child=_pool.cache_clear)


# --- tasks on an executor -------------------------------------------------------------------------


def as_done(
    function: Callable[[T], R], items: Sequence[T], executor: Executor | None = None,
    order: Sequence[int] | None = None,
) -> Generator[tuple[int, R], None, None]:  # fmt: skip
    """Call a function with each item, in this process or by an executor.

    The executor gets them in ``order``, the longest first so that none is left over at the end. The
    function must be of a module so that it can be sent to a process, or a ``partial`` of such a
    one: what it holds is packed once, and unpacked once in each process. Work that is not begun is
    given up where the iterator is closed.

    Yields:
        each result as it comes, with the number of its item. An executor's results are not kept.
        All that are there when it ends, or when a task fails, come before the error.

    Raises:
        ExecutorError: the executor ended before its work.
    """
    if executor is None:
        yield from ((i, function(item)) for i, item in enumerate(items))
        return
    futures: dict[Future[R], int] = {}
    try:
        sent = _sent(function, executor)
        for i in range(len(items)) if order is None else order:
            futures[executor.submit(_whole, sent, items[i])] = i
        for future in as_completed(futures):
            yield futures.pop(future), future.result()
    except Exception as error:
        for future, i in futures.items():
            if future.done() and not future.cancelled() and future.exception() is None:
                yield i, future.result()
        if not _is_end(error):
            raise
        raise ExecutorError(
            f"the executor ended before its work ({type(error).__name__}): a worker was killed, "
            "perhaps for lack of memory, or the scheduler was; expected one that stays"
        ) from None
    finally:
        for future in futures:
            future.cancel()


def run_tasks(
    function: Callable[[T], R], items: Sequence[T], executor: Executor | None = None,
    order: Sequence[int] | None = None, tell: Callable[[R], None] = lambda _result: None,
) -> list[R]:  # fmt: skip
    """The results of :func:`as_done` in the order of the items, each told here as it comes.

    Raises:
        ExecutorError: the executor ended before its work.
    """
    found: dict[int, R] = {}
    with closing(as_done(function, items, executor, order)) as results:
        for i, result in results:
            tell(result)
            found[i] = result
    return [found[i] for i in range(len(items))]


@contextmanager
def cluster(address: str, tell: Callable[[str], None]) -> Iterator[Executor]:
    """The workers of a scheduler of dask.distributed, as an executor.

    A task whose worker is lost is done again by another one, twice at most.

    Args:
        address: of the scheduler. tell: told if it has no workers yet.

    Raises:
        MissingPackageError: distributed is not installed.
        InputError: there is no scheduler.
    """
    import asyncio  # takes a while, and only this needs it

    try:
        from distributed import Client, rpc
    except ModuleNotFoundError as error:
        if error.name != "distributed":  # installed, but one of its own imports is missing
            raise
        raise MissingPackageError(
            "a scheduler needs the package distributed, which is not installed; "
            "pip install 'seecr[cluster]'"
        ) from None
    # it would tell what the error tells, and more
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)

    async def identity() -> Any:
        async with rpc(address) as asked:
            return await asked.identity()

    async def asked_in_time() -> Any:
        return await asyncio.wait_for(identity(), _SECONDS)

    try:  # before there is a client, which waits for ever for what listens and does not answer
        found = asyncio.run(asked_in_time())
        if found["type"] != "Scheduler":
            raise TypeError
    except Exception as error:  # of many kinds: what answers may be anything
        raise InputError(
            f"--scheduler {address}: no scheduler answers there ({type(error).__name__}); expected "
            "the address that dask-scheduler prints, such as tcp://10.0.0.1:8786"
        ) from None
    if not found["workers"]:
        tell(f"the scheduler {address} has no workers yet: the work begins when one comes")
    with Client(address, set_as_default=False) as client:
        executor = client.get_executor(retries=2, pure=False)
        try:
            yield executor
        finally:
            executor.shutdown(wait=False)  # else it waits for work that nobody wants any more


@contextmanager
def processes(count: int) -> Iterator[Executor | None]:
    """An executor of so many processes, which end with the block; None for one, which is this.

    Processes are used, not threads: such a task consists of thousands of calls of a few
    microseconds, between which Python runs one thread at a time; two threads took longer than one.
    They are spawned, not forked: this works everywhere, also beside threads.
    """
    if count <= 1:
        yield None
        return
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    spawn = get_context("spawn")
    there, here = spawn.Pipe(duplex=False)
    with there, here:
        executor = ProcessPoolExecutor(count, spawn, _begin, (there,))
        try:
            yield executor
        except BaseException:
            here.close()  # ends tasks that are at work, too
            raise
        finally:
            executor.shutdown(cancel_futures=True)


@dataclass(frozen=True)
class _Parcel:
    """A function with all that it holds, packed; equal ones have the same digest."""

    digest: str
    data: bytes = field(compare=False, repr=False)


def _sent(function: Any, executor: Executor) -> Any:
    """What tasks are given of their function: a client of dask sends it to each worker once."""
    if isinstance(executor, ThreadPoolExecutor):
        return function
    data = pickle.dumps(function)
    parcel = _Parcel(hashlib.sha256(data).hexdigest(), data)
    client = getattr(executor, "_client", None)
    # not by scatter, of which nothing is left when its worker is lost
    return parcel if client is None else client.submit(_same, parcel, pure=False)


def _same(parcel: _Parcel) -> _Parcel:
    return parcel


@lru_cache(maxsize=2)
def _unpacked(parcel: _Parcel) -> Any:
    return pickle.loads(parcel.data)


def _whole(sent: Any, item: Any) -> Any:
    """One task, in one thread."""
    is_own = _between.locked()  # a process that _begin began
    if is_own:
        _between.release()
    try:
        with undivided():
            return (_unpacked(sent) if isinstance(sent, _Parcel) else sent)(item)
    finally:
        if is_own:
            _between.acquire()


def _is_end(error: Exception) -> bool:
    """Whether an error is that of an executor, not of its tasks."""
    kinds = (BrokenExecutor, CancelledError, ConnectionError)
    late = type(error) is RuntimeError and "shutdown" in str(error)  # of submit, without a class
    return isinstance(error, kinds) or late or type(error).__module__.startswith("distributed.")


def _begin(pipe: Connection) -> None:
    """Leave Ctrl-C to the process that began this one, and end with it, whatever ends it."""
    _between.acquire()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(pipe,), daemon=True).start()


def _end_with(pipe: Connection) -> None:
    try:
        pipe.recv_bytes()
    except (EOFError, OSError):
        from multiprocessing import parent_process

        parent = parent_process()
        # where it lives, it reads what is being sent, and ends this process if there is no task
        while not _between.acquire(timeout=0.1) and parent is not None and parent.is_alive():
            pass
        os._exit(1)
