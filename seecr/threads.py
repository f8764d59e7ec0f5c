"""Batches in several threads: compiled functions run without Python's global lock."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import lru_cache
from itertools import pairwise

__all__ = [
    "in_parts",
    "processors",
    "run_parts",
]

# Fewer poses than this are not worth a second thread.
_CHUNK = 128
# Per thread, whether it works on a part of a batch; such a part is not divided again.
_at = threading.local()


def processors() -> int:
    """Processors available to this process: in a container often fewer than the machine has."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_parts(run: Callable[[slice], None], n: int, threads: int | None = None) -> None:
    """Run a job on n rows, in as many parts as there are threads, if these have enough rows.

    Within a part of another job it is not divided: the other threads are busy.
    """
    count = max(1, n // _CHUNK)
    if count > 1:  # asking the system takes longer than a few rows
        most = 1 if getattr(_at, "part", False) else threads
        count = min(count, processors() if most is None else most)
    edges = [n * k // count for k in range(count + 1)]
    run_parts(run, [slice(a, b) for a, b in pairwise(edges)])


def run_parts(run: Callable[[slice], None], parts: list[slice]) -> None:
    """Run a job on every part of a batch, in this thread and others, one per processor.

    Each thread takes the next part that is left, so that none waits for another before the end.
    After an error no further part is begun.
    """
    if getattr(_at, "part", False) or len(parts) == 1:
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
