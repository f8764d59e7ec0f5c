"""Batches in several threads."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections import deque

import numpy as np
import pytest

from seecr import threads


def test_a_process_confined_to_some_processors_counts_those_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A container that may use 2 of 64 processors is not to start 64 threads."""
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _pid: {3, 7}, raising=False)
    assert threads.processors() == 2


def test_where_nobody_says_all_processors_count(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 5)
    assert threads.processors() == 5


@pytest.mark.parametrize(
    "n, most, parts", [(1, 8, 1), (255, 8, 1), (256, 8, 2), (1000, 3, 3), (1000, 1, 1)]
)
def test_every_row_is_done_once_in_as_many_parts_as_pay(n: int, most: int, parts: int) -> None:
    done, seen = np.zeros(n, dtype=int), []

    def run(part: slice) -> None:
        done[part] += 1
        seen.append(part)

    threads.in_parts(run, n, most)
    assert np.all(done == 1) and len(seen) == parts


def test_an_error_in_another_thread_is_the_callers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads, "processors", lambda: 2)
    both = threading.Barrier(2, timeout=60.0)

    def run(part: slice) -> None:
        both.wait()
        if threading.current_thread() is not threading.main_thread():
            raise ValueError("lost")

    with pytest.raises(ValueError, match="lost"):
        threads.run_parts(run, [slice(0, 1), slice(1, 2)])


def test_no_part_is_begun_after_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    both, ended, begun = threading.Barrier(2, timeout=60.0), threading.Event(), list[slice]()

    class Parts(deque[slice]):
        def clear(self) -> None:
            super().clear()
            ended.set()

    def run(part: slice) -> None:
        begun.append(part)
        if part.start > 1:
            return
        both.wait()
        if threading.current_thread() is threading.main_thread():
            raise ValueError("lost")
        ended.wait(10.0)

    monkeypatch.setattr(threads, "processors", lambda: 2)
    monkeypatch.setattr(threads, "deque", Parts)
    with pytest.raises(ValueError, match="lost"):
        threads.run_parts(run, [slice(k, k + 1) for k in range(20)])
    assert sorted(part.start for part in begun) == [0, 1]


def test_no_more_threads_work_than_there_are_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads, "processors", lambda: 2)
    both, seen = threading.Barrier(2, timeout=60.0), set[int]()

    def run(part: slice) -> None:
        if part.start < 2:
            both.wait()
        seen.add(threading.get_ident())

    threads.run_parts(run, [slice(k, k + 1) for k in range(40)])
    assert len(seen) == 2


def test_within_a_part_there_is_one_part_in_the_same_thread(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Else parts that wait for parts of their own could take all threads there are."""
    monkeypatch.setattr(threads, "processors", lambda: 4)
    done = np.zeros((2, 1000), dtype=int)
    seen: list[tuple[int, slice]] = []
    both = threading.Barrier(2, timeout=60.0)

    def outer(part: slice) -> None:
        both.wait()

        def inner(own: slice) -> None:
            done[part, own] += 1
            seen.append((threading.get_ident(), own))

        here = threading.get_ident()
        threads.in_parts(inner, 1000)
        assert all(own == slice(0, 1000) for _thread, own in seen)
        assert here in {thread for thread, _own in seen}

    threads.run_parts(outer, [slice(0, 1), slice(1, 2)])
    assert np.all(done == 1) and len({thread for thread, _own in seen}) == 2
    # and afterwards as before
    parts: list[slice] = []
    threads.in_parts(parts.append, 1000)
    assert len(parts) == 4


def test_a_part_that_fails_leaves_the_thread_as_it_was() -> None:
    def fails(_part: slice) -> None:
        raise ValueError("as it should")

    with pytest.raises(ValueError, match="as it should"):
        threads.run_parts(fails, [slice(0, 1), slice(1, 2)])
    parts: list[slice] = []
    threads.in_parts(parts.append, 1000, 2)
    assert len(parts) == 2


def counted_parts(n: int = 1000) -> int:
    parts: list[slice] = []
    threads.in_parts(parts.append, n)
    return len(parts)


def test_batches_stay_whole_while_the_other_processors_are_busy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(threads, "processors", lambda: 4)
    busy = True
    with threads.undivided(lambda: busy):
        assert counted_parts() == 1
        with threads.undivided(lambda: False):
            assert counted_parts() == 4
        assert counted_parts() == 1
        busy = False
        assert counted_parts() == 4
    with threads.undivided():
        assert counted_parts() == 1
    assert counted_parts() == 4


@pytest.mark.parametrize(
    "n, processors, divided", [(255, 4, False), (256, 4, True), (999, 1, False)]
)
def test_whether_a_batch_is_divided_can_be_asked_before(
    n: int, processors: int, divided: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(threads, "processors", lambda: processors)
    assert threads.is_divided(n) is divided
    assert (counted_parts(n) > 1) is divided


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forked processes here")
@pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """It waited for ever for those of the process that forked it."""
    monkeypatch.setattr(threads, "processors", lambda: 2)
    both = threading.Barrier(2, timeout=10.0)

    def meet(_part: slice) -> None:
        both.wait()

    threads.run_parts(meet, [slice(0, 1), slice(1, 2)])  # the pool has its threads
    process = os.fork()
    if process == 0:
        status = 1
        try:
            threads.run_parts(meet, [slice(0, 1), slice(1, 2)])
            status = 0
        finally:
            os._exit(status)
    ends = time.monotonic() + 20.0
    ended, status = os.waitpid(process, os.WNOHANG)
    while not ended and time.monotonic() < ends:
        time.sleep(0.01)
        ended, status = os.waitpid(process, os.WNOHANG)
    if not ended:
        os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)
    assert ended and status == 0
