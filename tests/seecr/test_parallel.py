"""Rows in threads, and tasks on executors."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ThreadPoolExecutor,
)
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import seecr
from seecr import parallel


def test_a_process_confined_to_some_processors_counts_those_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A container that may use 2 of 64 processors is not to start 64 threads."""
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _pid: {3, 7}, raising=False)
    assert parallel.processors() == 2


def test_where_nobody_says_all_processors_count(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 5)
    assert parallel.processors() == 5


@pytest.mark.parametrize(
    "n, most, parts", [(1, 8, 1), (255, 8, 1), (256, 8, 2), (1000, 3, 3), (1000, 1, 1)]
)
def test_every_row_is_done_once_in_as_many_parts_as_pay(n: int, most: int, parts: int) -> None:
    done, seen = np.zeros(n, dtype=int), []

    def run(part: slice) -> None:
        done[part] += 1
        seen.append(part)

    parallel.in_parts(run, n, most)
    assert np.all(done == 1) and len(seen) == parts
    assert all(part.start % parallel.BLOCK == 0 for part in seen)


def test_an_error_in_another_thread_is_the_callers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "processors", lambda: 2)
    both = threading.Barrier(2, timeout=60.0)

    def run(part: slice) -> None:
        both.wait()
        if threading.current_thread() is not threading.main_thread():
            raise ValueError("lost")

    with pytest.raises(ValueError, match="lost"):
        parallel.run_parts(run, [slice(0, 1), slice(1, 2)])


def test_no_part_is_begun_after_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    begun, lost = list[int](), threading.Event()

    def run(part: slice) -> None:
        begun.append(part.start)
        if part.start == 1:
            lost.set()
            raise ValueError("lost")
        lost.wait(60.0)
        time.sleep(0.2)  # the caller hears of it

    monkeypatch.setattr(parallel, "processors", lambda: 2)
    with pytest.raises(ValueError, match="lost"):
        parallel.run_parts(run, [slice(k, k + 1) for k in range(20)])
    assert 2 <= len(begun) <= 4


def test_a_part_that_takes_long_holds_up_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "processors", lambda: 2)
    others = threading.Semaphore(0)

    def run(part: slice) -> None:
        if part.start > 0:
            others.release()
        elif not all(others.acquire(timeout=60.0) for _ in range(4)):
            raise TimeoutError("the other parts waited for this one")

    parallel.run_parts(run, [slice(k, k + 1) for k in range(5)])


def test_no_more_threads_work_than_there_are_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "processors", lambda: 2)
    both, seen = threading.Barrier(2, timeout=60.0), set[int]()

    def run(part: slice) -> None:
        if part.start < 2:
            both.wait()
        seen.add(threading.get_ident())

    parallel.run_parts(run, [slice(k, k + 1) for k in range(40)])
    assert len(seen) == 2


def test_within_a_part_there_is_one_part_in_the_same_thread(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Else parts that wait for parts of their own could take all threads there are."""
    monkeypatch.setattr(parallel, "processors", lambda: 4)
    done = np.zeros((2, 1000), dtype=int)
    seen: list[tuple[int, slice]] = []
    both = threading.Barrier(2, timeout=60.0)

    def outer(part: slice) -> None:
        both.wait()

        def inner(own: slice) -> None:
            done[part, own] += 1
            seen.append((threading.get_ident(), own))

        here = threading.get_ident()
        parallel.in_parts(inner, 1000)
        assert all(own == slice(0, 1000) for _thread, own in seen)
        assert here in {thread for thread, _own in seen}

    parallel.run_parts(outer, [slice(0, 1), slice(1, 2)])
    assert np.all(done == 1) and len({thread for thread, _own in seen}) == 2
    # and afterwards as before
    parts: list[slice] = []
    parallel.in_parts(parts.append, 1000)
    assert len(parts) == 4


def test_a_part_that_fails_leaves_the_thread_as_it_was() -> None:
    def fails(_part: slice) -> None:
        raise ValueError("as it should")

    with pytest.raises(ValueError, match="as it should"):
        parallel.run_parts(fails, [slice(0, 1), slice(1, 2)])
    parts: list[slice] = []
    parallel.in_parts(parts.append, 1000, 2)
    assert len(parts) == 2


def counted_parts(n: int = 1000) -> int:
    parts: list[slice] = []
    parallel.in_parts(parts.append, n)
    return len(parts)


def test_batches_stay_whole_where_the_other_processors_are_busy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(parallel, "processors", lambda: 4)
    assert counted_parts() == 4
    with parallel.undivided():
        with parallel.undivided():
            assert counted_parts() == 1
        assert counted_parts() == 1
    assert counted_parts() == 4


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forked processes here")
@pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """It waited for ever for those of the process that forked it."""
    monkeypatch.setattr(parallel, "processors", lambda: 2)
    both = threading.Barrier(2, timeout=10.0)

    def meet(_part: slice) -> None:
        both.wait()

    parallel.run_parts(meet, [slice(0, 1), slice(1, 2)])  # the pool has its threads
    process = os.fork()
    if process == 0:
        status = 1
        try:
            parallel.run_parts(meet, [slice(0, 1), slice(1, 2)])
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


# Other processes import functions by name; those of a test's own module they would not find.
DOUBLE = (2).__mul__


@pytest.mark.parametrize("order", [None, [2, 0, 1]])
def test_without_an_executor_tasks_run_here_one_after_the_other(order: list[int] | None) -> None:
    told: list[int] = []
    with parallel.processes(1) as executor:
        assert executor is None
        assert parallel.run_tasks(DOUBLE, [3, 1, 2], executor, order, told.append) == [6, 2, 4]
    assert told == [6, 2, 4]


def test_any_executor_serves_and_its_tasks_are_not_divided(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(parallel, "processors", lambda: 4)
    with ThreadPoolExecutor(2) as executor:
        assert parallel.run_tasks(counted_parts, [1000] * 5, executor) == [1] * 5
        assert executor.submit(counted_parts).result() == 4
    assert parallel.run_tasks(counted_parts, [1000]) == [4]


@pytest.mark.slow
def test_results_of_processes_come_in_the_order_of_the_items() -> None:
    told: list[int] = []
    with parallel.processes(2) as executor:
        assert parallel.run_tasks(DOUBLE, [3, 1, 2], executor, [2, 0, 1], told.append) == [6, 2, 4]
        assert parallel.run_tasks(DOUBLE, range(20), executor) == list(range(0, 40, 2))
        assert parallel.run_tasks(DOUBLE, [], executor) == []
    assert sorted(told) == [2, 4, 6]
    assert active_children() == []


@pytest.mark.slow
def test_an_error_in_a_process_is_the_callers_and_ends_all() -> None:
    with (
        pytest.raises(ValueError, match="must be non-negative"),
        parallel.processes(2) as executor,
    ):
        parallel.run_tasks(time.sleep, [-1.0, 60.0], executor)
    assert active_children() == []


@pytest.mark.slow
def test_a_process_that_is_killed_is_an_error_and_ends_all() -> None:
    began = time.monotonic()
    ended = pytest.raises(seecr.ExecutorError, match="ended before its work")
    with ended, parallel.processes(2) as executor:
        parallel.run_tasks(signal.raise_signal, [signal.SIGTERM] * 2, executor)
    assert active_children() == [] and time.monotonic() - began < 50.0


class Dying(Executor):
    """It does three tasks, and ends as it is given the next: at once, or by its futures."""

    def __init__(self, error: Exception, at_once: bool) -> None:
        self.error, self.at_once, self.given = error, at_once, 0

    def submit(self, function: Any, /, *args: Any, **_named: Any) -> Future[Any]:
        self.given += 1
        future = Future[Any]()
        if self.given <= 3:
            future.set_result(function(*args))
        elif self.at_once:
            raise self.error
        elif isinstance(self.error, CancelledError):
            future.cancel()
            future.set_running_or_notify_cancel()
        else:
            future.set_exception(self.error)
        return future


@pytest.mark.parametrize("at_once", [True, False])
@pytest.mark.parametrize(
    "error, raised",
    [
        (BrokenExecutor("gone"), "ExecutorError"),
        (CancelledError("gone"), "ExecutorError"),
        (ConnectionError("gone"), "ExecutorError"),
        (MemoryError("gone"), "MemoryError"),  # of a task: what others found is kept all the same
    ],
)
def test_what_is_done_when_an_executor_ends_comes_before_the_error(
    error: Exception, raised: str, at_once: bool
) -> None:
    told: list[int] = []
    with pytest.raises((seecr.ExecutorError, MemoryError)) as caught:
        parallel.run_tasks(DOUBLE, range(40), Dying(error, at_once), None, told.append)
    assert type(caught.value).__name__ == raised and sorted(told) == [0, 2, 4]


@pytest.mark.slow
def test_what_processes_did_before_they_are_killed_is_there() -> None:
    """They are killed while tasks are still handed out, and nothing has been fetched yet."""
    told: list[int] = []

    class Tasks(list[int]):
        def __getitem__(self, i: Any) -> Any:
            if i == 4:
                done = [executor.submit(DOUBLE, 0).result() for _ in range(2)]
                assert done == [0, 0]  # they are done in turn, so that the four before are, too
                for one in active_children():
                    one.kill()
                    one.join()
                while not executor._broken:  # type: ignore[attr-defined]
                    time.sleep(0.01)
            return super().__getitem__(i)

    ended = pytest.raises(seecr.ExecutorError, match=r"ended before its work \(BrokenProcessPool\)")
    with ended, parallel.processes(2) as executor:
        parallel.run_tasks(DOUBLE, Tasks(range(9)), executor, None, told.append)
    assert sorted(told) == [0, 2, 4, 6]


@pytest.mark.slow
def test_an_interrupt_ends_tasks_that_are_at_work() -> None:
    def interrupt(_result: None) -> None:
        raise KeyboardInterrupt

    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt), parallel.processes(2) as executor:
        parallel.run_tasks(time.sleep, [0.0, 60.0], executor, None, interrupt)
    assert active_children() == [] and time.monotonic() - began < 50.0


HALF_SENT = """
import threading, time
from multiprocessing.connection import Connection
from seecr.parallel import processes, run_tasks

if __name__ == "__main__":
    recv, reading = Connection._recv, threading.Event()

    def slow(self, size, *more):
        if size > 10**6:
            reading.set()
            time.sleep(0.5)
        return recv(self, size, *more)

    def fail(_result):
        assert reading.wait(60.0)
        raise OSError("the disk is full")

    Connection._recv = slow
    with processes(2) as executor:
        run_tasks(b"x".__mul__, [0, 10**7], executor, None, fail)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="its pipes are read in another way")
def test_an_error_while_a_result_is_half_sent_ends_all(tmp_path: Path) -> None:
    """The worker that sent it ended at once, and for the rest of it the program waited for ever."""
    script = tmp_path / "half_sent.py"
    script.write_text(HALF_SENT)
    done = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, timeout=60.0, check=False
    )
    assert done.returncode == 1 and "the disk is full" in done.stderr


KILLED = """
import os, signal, time
from seecr.parallel import processes, run_tasks

if __name__ == "__main__":
    with processes(2) as executor:
        executor.submit(time.sleep, 60.0)
        print(executor.submit(os.getpid).result(), flush=True)
        executor.submit(time.sleep, 60.0)
        os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="asks POSIX systems for processes")
def test_processes_end_with_the_one_that_began_them(tmp_path: Path) -> None:
    script = tmp_path / "killed.py"
    script.write_text(KILLED)
    # its output ends when all who may write to it have ended
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=50.0)
    assert done.returncode == -signal.SIGKILL and int(done.stdout) > 0
