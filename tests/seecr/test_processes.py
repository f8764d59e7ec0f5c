"""Jobs in several processes."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from seecr import processes, threads
from seecr.errors import InputError
from seecr.pose import Array
from seecr.processes import MOST, Job, Shared, shared_out

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux")


FORKED: list[int] = []


@pytest.fixture(autouse=True)
def three(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of three processors, and which processes were forked for the test."""
    monkeypatch.setenv(MOST, "3")
    FORKED.clear()
    fork = processes._forked

    def forked(job: Callable[[], bytes]) -> tuple[int, int]:
        process, file = fork(job)
        FORKED.append(process)
        return process, file

    monkeypatch.setattr(processes, "_forked", forked)


@dataclass(eq=False)
class Machine:
    name: str
    points: Array


@dataclass(eq=False)
class Fit:
    robot: Machine
    value: float
    process: int


ROBOT = Machine("one", np.arange(3.0))


def fit_of(value: float) -> Fit:
    time.sleep(0.01)
    return Fit(ROBOT, value**2, os.getpid())


def shared() -> Shared:
    return Shared(ROBOT)


def is_alone() -> bool:
    """Whether some processes were forked, and none is left, running or ended."""
    return len(FORKED) > 0 and not Job.running and not any(map(is_left, FORKED))


def is_left(process: int) -> bool:
    try:
        os.waitpid(process, os.WNOHANG)
    except ChildProcessError:
        return False
    return True


def test_results_come_in_the_order_of_the_items_whoever_computes_them() -> None:
    begun: list[int] = []
    found = shared_out(fit_of, range(40), shared, begun.append)
    assert [fit.value for fit in found] == [float(k**2) for k in range(40)]
    assert sorted(begun) == list(range(40))
    assert len({fit.process for fit in found}) == 3
    assert is_alone()


def test_what_both_have_is_not_copied() -> None:
    found = shared_out(fit_of, range(40), shared)
    assert all(fit.robot is ROBOT for fit in found)
    deep = Shared({"all": [ROBOT]})
    assert Job(lambda: ROBOT.points, deep).result() is ROBOT.points


def test_a_thing_made_there_is_sent_with_what_it_has_of_its_own() -> None:
    with Job(lambda: Fit(Machine("two", ROBOT.points), 1.0, os.getpid()), shared()) as job:
        assert job.is_running
        found = job.result()
    assert found.process != os.getpid()
    assert found.robot.name == "two" and found.robot.points is ROBOT.points


@pytest.mark.parametrize("most", ["0", "-1", "two", "1.5"])
def test_a_wrong_number_of_processes_is_refused(most: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(MOST, most)
    with pytest.raises(InputError) as refused:
        shared_out(fit_of, range(3), shared)
    assert str(refused.value) == (
        f"SEECR_PROCESSES: expected a whole number of processes from 1 on, got {most!r}"
    )


def test_one_process_does_all_where_no_more_are_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(MOST, "1")
    begun: list[int] = []
    found = shared_out(fit_of, range(3), shared, begun.append)
    assert {fit.process for fit in found} == {os.getpid()} and begun == [0, 1, 2]
    with Job(lambda: fit_of(2.0), shared()) as job:
        assert not job.is_running and job.sent() == []
        assert job.result().process == os.getpid()


def test_there_are_no_more_processes_than_processors_whatever_runs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of three, one that is busy leaves one to share with; a process that shares begins none."""
    with Job(lambda: time.sleep(60.0), shared()):
        found = shared_out(fit_of, range(40), shared)
        assert len({fit.process for fit in found}) == 2
    nested = shared_out(lambda _k: (os.getpid(), processes._free()), range(40), shared)
    assert all(free == 0 for process, free in nested if process != os.getpid())
    monkeypatch.delenv(MOST)
    for own, free in ((1, 0), (4, 3), (64, 7)):
        monkeypatch.setattr(processes, "processors", lambda own=own: own)
        assert processes._free() == free


def test_one_that_is_done_makes_room_for_others() -> None:
    with Job(lambda: 1, shared()) as job:
        while job.is_running:
            time.sleep(1e-3)
        found = shared_out(fit_of, range(40), shared)
        assert len({fit.process for fit in found}) == 3
        assert job.result() == 1


def test_where_processes_cannot_be_forked_safely_none_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "memfd_create")
    found = shared_out(fit_of, range(3), shared)
    assert {fit.process for fit in found} == {os.getpid()}


def raise_elsewhere(me: int) -> Callable[[float], Fit]:
    def run(value: float) -> Fit:
        if os.getpid() != me:
            raise ValueError("not here")
        return fit_of(value)

    return run


def be_killed_elsewhere(me: int) -> Callable[[float], Fit]:
    def run(value: float) -> Fit:
        if os.getpid() != me:
            os.kill(os.getpid(), signal.SIGKILL)
        return fit_of(value)

    return run


def send_nothing_that_can_be_sent(me: int) -> Callable[[float], Fit]:
    def run(value: float) -> Fit:
        if os.getpid() != me:
            return Fit(Machine("three", (lambda: 1)), value, 0)  # type: ignore[arg-type]
        return fit_of(value)

    return run


def test_the_last_item_may_use_the_processors_that_have_nothing_left_to_do(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The one fit that took half of the time was done on one processor, beside one at rest."""
    monkeypatch.setattr(threads, "processors", lambda: 3)

    def parts(k: int) -> tuple[int, int]:
        before: list[slice] = []
        threads.in_parts(before.append, 1000)
        time.sleep(1.0 if k == 0 else 0.02)  # the first ends when all others are done
        after: list[slice] = []
        threads.in_parts(after.append, 1000)
        return len(before), len(after)

    found = shared_out(parts, range(20), shared)
    assert found[0] == (1, 3)
    assert found[5] == (1, 1)
    with Job(lambda: parts(1), shared()) as job:
        assert job.is_running and job.result() == (1, 1)  # this process is at work


FAILURES = [raise_elsewhere, be_killed_elsewhere, send_nothing_that_can_be_sent]


@pytest.mark.parametrize("failing", FAILURES)
def test_what_another_process_fails_to_do_is_done_here(
    failing: Callable[[int], Callable[[float], Fit]], capfd: pytest.CaptureFixture[str]
) -> None:
    run, begun = failing(os.getpid()), list[int]()
    found = shared_out(run, range(10), shared, begun.append)
    assert [fit.value for fit in found] == [float(k**2) for k in range(10)]
    assert {fit.process for fit in found} == {os.getpid()}
    assert sorted(begun) == list(range(10))
    assert Job(lambda: run(3.0), shared()).result().value == 9.0
    assert is_alone()
    assert capfd.readouterr() == ("", "")  # nobody is told of what was mended


def test_an_error_that_is_one_here_too_is_raised() -> None:
    def fail(value: float) -> Fit:
        raise ValueError(f"no {value}")

    with pytest.raises(ValueError, match="no "):
        shared_out(fail, range(10), shared)
    assert is_alone()
    with pytest.raises(ValueError, match=r"no 2\.0"), Job(lambda: fail(2.0), shared()) as job:
        job.result()
    assert is_alone()


def test_one_that_hangs_is_ended_and_its_job_done_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "_SECONDS", 0.1)
    monkeypatch.setattr(processes, "_TIMES", 0.0)
    me = os.getpid()
    job = Job(lambda: "here" if os.getpid() == me else time.sleep(60.0), shared())
    assert job.result() == "here"
    assert is_alone()


def test_where_no_process_can_be_begun_all_is_done_here(monkeypatch: pytest.MonkeyPatch) -> None:
    def fork() -> int:
        raise OSError("no memory")

    before = len(os.listdir("/proc/self/fd"))
    monkeypatch.setattr(os, "fork", fork)
    assert {fit.process for fit in shared_out(fit_of, range(3), shared)} == {os.getpid()}
    assert len(os.listdir("/proc/self/fd")) == before


def test_one_that_others_have_waited_for_counts_as_failed() -> None:
    """Some programs wait for every process that ends."""
    with Job(lambda: os.getpid(), shared()) as job:
        os.waitpid(FORKED[-1], 0)
        assert not job.is_running
        assert job.result() == os.getpid()


def test_one_that_is_not_wanted_any_more_is_ended() -> None:
    began = time.monotonic()
    with Job(lambda: time.sleep(60.0), shared()) as job:
        assert job.is_running
    assert not job.is_running and time.monotonic() - began < 30.0
    assert is_alone()


@pytest.mark.parametrize("own", [signal.SIG_IGN, signal.default_int_handler])
def test_an_interrupt_ends_it_in_silence_unless_interrupts_are_ignored(own: Any) -> None:
    before = signal.signal(signal.SIGINT, own)
    try:
        there = Job(lambda: signal.getsignal(signal.SIGINT), shared()).result()
    finally:
        signal.signal(signal.SIGINT, before)
    assert there is (own if own is signal.SIG_IGN else signal.SIG_DFL)


def test_an_interrupt_here_leaves_no_process() -> None:
    me = os.getpid()

    def run(value: float) -> Fit:
        if os.getpid() == me:
            raise KeyboardInterrupt
        return fit_of(value)

    with pytest.raises(KeyboardInterrupt):
        shared_out(run, range(400), shared)
    assert is_alone()


def test_what_is_changed_elsewhere_stays_there(tmp_path: Path) -> None:
    """Nor is anything written twice that was waiting to be written."""
    path = tmp_path / "file"
    with path.open("w") as stream:
        stream.write("once")
        changed: list[float] = []
        Job(lambda: changed.append(1.0), shared()).result()
    assert changed == [] and path.read_text() == "once"


def test_no_file_is_left_open() -> None:
    def count() -> int:
        return len(os.listdir("/proc/self/fd"))

    before = count()
    for _ in range(3):
        shared_out(fit_of, range(6), shared)
        with Job(lambda: 1, shared()) as job:
            job.result()
        with Job(lambda: time.sleep(60.0), shared()):
            pass
    assert count() == before
