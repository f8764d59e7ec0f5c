"""Batches in several threads: compiled functions run without Python's lock."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from itertools import pairwise

__all__ = [
    "in_parts",
    "processors",
    "run_parts",
]

# Fewer poses than this are not worth a second thread.
_CHUNK = 128


def processors() -> int:
    """Processors that this process may use: in a container often fewer than the machine has."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_parts(run: Callable[[slice], None], n: int, threads: int | None = None) -> None:
    """Run a job on n rows, in as many parts as there are threads and rows enough for them."""
    count = max(1, n // _CHUNK)
    if count > 1:  # asking the system takes longer than a few rows
        count = min(count, processors() if threads is None else threads)
    edges = [n * k // count for k in range(count + 1)]
    run_parts(run, [slice(a, b) for a, b in pairwise(edges)])


def run_parts(run: Callable[[slice], None], parts: list[slice]) -> None:
    """Run a job on every part of a batch, the first in this thread."""
    others = [_pool().submit(run, part) for part in parts[1:]]
    run(parts[0])
    for other in others:
        other.result()


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max_workers=processors())
