"""Processes that run cases several at a time."""

from __future__ import annotations

import signal
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from types import TracebackType
from typing import TypeVar

from crosscheck.errors import CrosscheckError

T = TypeVar("T")
R = TypeVar("R")


class Pool:
    """A number of processes, or only this one; a context manager that ends them.

    Processes are used, not threads: a settling consists of thousands of calls of a few
    microseconds, between which Python runs one thread at a time; two threads took longer than one.
    """

    def __init__(self, jobs: int) -> None:
        """Start nothing yet: the first round does.

        Args:
            jobs: how many at a time; 1 is this process.
        """
        self.jobs = jobs
        self._executor: ProcessPoolExecutor | None = None

    def __enter__(self) -> Pool:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._executor is not None:
            self._executor.shutdown(cancel_futures=True)

    def run(
        self,
        function: Callable[[T], R],
        items: Sequence[T],
        order: Sequence[int],
        tell: Callable[[R], None],
    ) -> list[R]:
        """Call a function with each item.

        Args:
            function: of a module, or a ``partial`` of one, so that it can be sent to a process.
            items: its arguments.
            order: order of starting, the longest first so that none is left over at the end.
            tell: called with each result as it comes.

        Returns:
            the results in the order of the items.
        """
        if self.jobs <= 1:
            return [_told(function(item), tell) for item in items]
        executor = self._started()
        try:
            futures = {executor.submit(function, items[i]): i for i in order}
            found = {futures[f]: _told(f.result(), tell) for f in as_completed(futures)}
        except BrokenProcessPool:
            raise CrosscheckError(
                f"one of {self.jobs} processes was killed, perhaps for lack of memory; try --jobs 1"
            ) from None
        return [found[i] for i in range(len(items))]

    def _started(self) -> ProcessPoolExecutor:
        if self._executor is None:
            spawn = get_context("spawn")
            self._executor = ProcessPoolExecutor(self.jobs, spawn, initializer=_leave_interrupts)
        return self._executor


def _told(result: R, tell: Callable[[R], None]) -> R:
    tell(result)
    return result


def _leave_interrupts() -> None:
    """Let the calling process handle Ctrl-C, and tell the others to stop."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
