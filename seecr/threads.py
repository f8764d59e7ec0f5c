"""Batches in several threads: compiled functions run without Python's global lock."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from functools import lru_cache
from itertools import pairwise

__all__ = [
    "in_parts",
    "is_divided",
    "processors",
    "run_parts",
    "undivided",
]

# Fewer poses than this are not worth a second thread.
_CHUNK = 128
# Per thread: ``part``, whether it works on a part of a batch, which is not divided again, and
# ``busy``, which says whether the other processors are.
_at = threading.local()


def processors() -> int:
    """Processors available to this process: in a container often fewer than the machine has."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def is_divided(n: int) -> bool:
    """Whether :func:`in_parts` runs a job on n rows in several threads."""
    return n >= 2 * _CHUNK and processors() > 1


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
def undivided(busy: Callable[[], bool] = lambda: True) -> Iterator[None]:
    """Batches of this thread stay whole, as long as the other processors are busy."""
    before, _at.busy = getattr(_at, "busy", None), busy
    try:
        yield
    finally:
        _at.busy = before


def _is_whole() -> bool:
    busy = getattr(_at, "busy", None)
    return getattr(_at, "part", False) or (busy is not None and busy())


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
        _at.part = True
        try:
            while True:
                try:
                    part = left.popleft()
                except IndexError:
                    return
                run(part)
        except BaseException:
            left.clear()
            raise
        finally:
            _at.part = False

    others = [_pool().submit(work) for _ in range(min(processors(), len(parts)) - 1)]
    try:
        work()
    finally:
        wait(others)
    for other in others:
        other.result()


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max_workers=processors())


if hasattr(os, "register_at_fork"):
    # a forked process has the pool, but none of its threads
    os.register_at_fork(after_in_child=_pool.cache_clear)
