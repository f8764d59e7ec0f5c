"""Batches in several threads."""

from __future__ import annotations

import os
import threading

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


def test_an_error_in_another_thread_is_the_callers() -> None:
    def run(part: slice) -> None:
        if threading.current_thread() is not threading.main_thread():
            raise ValueError("lost")

    with pytest.raises(ValueError, match="lost"):
        threads.run_parts(run, [slice(0, 1), slice(1, 2)])
