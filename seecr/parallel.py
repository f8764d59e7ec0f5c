"""Work on several processors: rows of a batch in threads, tasks in processes.

Compiled functions run without Python's global lock, so that batches are divided among threads.
Tasks that are mostly Python, each of half a second or more, run on an executor: the processes of
:func:`processes`, or any other ``concurrent.futures.Executor``, such as that of a cluster. Without
one they run in this process, with the same results.
"""

from __future__ import annotations

import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed, wait
from contextlib import contextmanager
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

T = TypeVar("T")
R = TypeVar("R")

# Fewer poses than this are not worth a second thread.
_CHUNK = 128
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

    Within a part of another job it is not divided: the other threads are busy.
    """
    count = max(1, n // _CHUNK)
    if count > 1:  # asking the system takes longer than a few rows
        most = 1 if _is_whole() else threads
        count = min(count, processors() if most is None else most)
    edges = [n * k // count for k in range(count + 1)]
    run_parts(run, [slice(a, b) for a, b in pairwise(edges)])


@contextmanager
def undivided() -> Iterator[None]:
    """Batches of this thread stay whole: the other processors are busy."""
    before, _at.whole = _is_whole(), True
    try:
        yield
    finally:
        _at.whole = before


def _is_whole() -> bool:
    return getattr(_at, "whole", False)


def run_parts(run: Callable[[slice], None], parts: list[slice]) -> None:
    """Run a job on every part of a batch, in this thread and others, one per processor.

    Each thread takes the next part that is left, so that none waits for another before the end.
    After an error no further part is begun.
    """
    if len(parts) == 1 or _is_whole():
        for part in parts:
            run(part)
        return
    left = deque(parts)

    def work() -> None:
        try:
            with undivided():
                while True:
                    try:
                        part = left.popleft()
                    except IndexError:
                        return
                    run(part)
        except BaseException:
            left.clear()
            raise

    others = [_threads().submit(work) for _ in range(min(processors(), len(parts)) - 1)]
    try:
        work()
    finally:
        wait(others)
    for other in others:
        other.result()


@lru_cache(maxsize=1)
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max_workers=processors())


if hasattr(os, "register_at_fork"):
    # a forked process has the pool, but none of its threads
    os.register_at_fork(after_in_child=_threads.cache_clear)


# --- tasks on an executor -------------------------------------------------------------------------


def run_tasks(
    function: Callable[[T], R], items: Sequence[T], executor: Executor | None = None,
    order: Sequence[int] | None = None, tell: Callable[[R], None] = lambda _result: None,
) -> list[R]:  # fmt: skip
    """Call a function with each item, in this process or by an executor.

    The executor gets them in ``order``, the longest first so that none is left over at the end; the
    function must be of a module so that it can be sent to a process. Each result is told here as it
    comes.

    Returns:
        the results in the order of the items.

    Raises:
        concurrent.futures.BrokenExecutor: a process of the executor died.
    """
    if executor is None:
        return [_told(function(item), tell) for item in items]
    order = range(len(items)) if order is None else order
    futures = {executor.submit(_whole, function, items[i]): i for i in order}
    found = {futures[f]: _told(f.result(), tell) for f in as_completed(futures)}
    return [found[i] for i in range(len(items))]


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


def _told(result: R, tell: Callable[[R], None]) -> R:
    tell(result)
    return result


def _whole(function: Callable[[T], R], item: T) -> R:
    with undivided():
        return function(item)


def _begin(pipe: Connection) -> None:
    """Leave Ctrl-C to the process that began this one, and end with it, whatever ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(pipe,), daemon=True).start()


def _end_with(pipe: Connection) -> None:
    try:
        pipe.recv_bytes()
    except (EOFError, OSError):
        os._exit(1)
