"""Plant one fault at a time in a function, and see whether a test that runs it fails.

    python scripts/mutate.py seecr/statics crosscheck/comparison --each 30 --seed 1
    python scripts/mutate.py seecr/compiled --python --tests tests/seecr --each 30 --seed 1

Each fault (a mutant) changes a comparison, the sign of an operation, a constant, a condition or a
returned value. One process imports all and collects the quick tests. Each file of tests runs in a
fork of it: once without a fault, which says how long it takes, which of its tests pass, and which
functions it runs; and for each mutant in one of these until a test fails or takes far longer, those
of the mirrored folder first, then the quickest. So no test sees what another file left behind.

A mutant that survives is equivalent to the source, or shows what no test holds, or is held by slow
tests or by commands in processes of their own, which do not see it. With ``--python`` compiled
functions run as the Python that they are written in.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import select
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from mutants import ROOT, Mutant, mutants, note_calls

# A test without a fault takes less [s] of the processor, and all of a file less of the clock.
LIMIT, WAIT = 10.0, 240.0


class OutOfTime(BaseException):
    """A test took too long; not an Exception, which the program might catch."""


@dataclass
class Known:
    """What this process and its forks know.

    Attributes:
        args: of the command. files: the tests by their file. failed: tests that did.
        reach: by file its time [s], the tests that pass, and the functions that they run.
    """

    args: argparse.Namespace
    files: dict[str, list[pytest.Item]] = field(default_factory=dict)
    failed: set[str] = field(default_factory=set)
    reach: dict[str, dict[str, Any]] = field(default_factory=dict)


KNOWN = Known(argparse.Namespace())


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.failed:
        KNOWN.failed.add(report.nodeid)


def pytest_runtestloop(session: pytest.Session) -> bool:
    """Takes the place of pytest's loop over the tests."""
    args, files = KNOWN.args, KNOWN.files
    if not args.python:
        _load_compiled()
    for item in session.items:
        files.setdefault(item.nodeid.partition("::")[0], []).append(item)
    kept = Path(args.map) if args.map else None
    if kept and kept.exists():
        KNOWN.reach = json.loads(kept.read_text())
    new = [file for file in files if file not in KNOWN.reach]
    KNOWN.reach |= zip(new, _shared(_reach, new), strict=True)
    if kept:
        kept.write_text(json.dumps(KNOWN.reach))
    passed = sum(len(one["passed"]) for one in KNOWN.reach.values())
    print(f"{passed} of {len(session.items)} tests pass without a fault, in their time", flush=True)
    for name in args.folders:
        every = [mutant for path in _sources(name) for mutant in mutants(path)]
        drawn = random.Random(args.seed).sample(every, min(args.each, len(every)))
        ends = [end for end in _shared(_end, drawn) if end != "unplanted"]
        killed = sum(end.startswith("killed") for end in ends)
        print(f"{name}: {killed} of {len(ends)} killed, seed {args.seed}", flush=True)
    return True


def _sources(name: str) -> list[Path]:
    """The files of a folder, or the file of that name."""
    place = (ROOT / name).resolve()
    return sorted(place.glob("*.py")) if place.is_dir() else [place]


def _load_compiled() -> None:
    """Load all that is compiled, once, and forget what functions remember of that."""
    from warm import compile_all

    compile_all()
    for module in list(sys.modules.values()):
        if (getattr(module, "__file__", None) or "").startswith(str(ROOT)):
            for value in vars(module).values():
                if hasattr(value, "cache_clear"):
                    value.cache_clear()


def _shared(work: Callable[[Any], Any], tasks: list[Any]) -> list[Any]:
    """Results of work on each task, in forks that know what this process knows."""
    with ProcessPoolExecutor(KNOWN.args.processes, get_context("fork")) as pool:
        return list(pool.map(work, tasks))


def _run(items: list[pytest.Item], limit: float) -> Iterator[tuple[pytest.Item, bool]]:
    """Run tests one by one, none longer than the limit [s]; says which of them pass.

    All times are those of the processor: what else the machine does is not to matter.
    """

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise OutOfTime

    signal.signal(signal.SIGPROF, stop)
    for item, after in zip(items, [*items[1:], None], strict=True):
        signal.setitimer(signal.ITIMER_PROF, limit)
        item.ihook.pytest_runtest_protocol(item=item, nextitem=after)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        yield item, item.nodeid not in KNOWN.failed


def _reach(file: str) -> dict[str, Any]:
    """A file of tests: its time [s], the tests that pass, and the functions that they run."""

    def work(tell: Callable[[str], None]) -> None:
        calls: set[str] = set()
        for name in KNOWN.args.folders:
            for path in _sources(name):
                note_calls(path, calls)
        began = time.process_time()
        for item, good in _run(KNOWN.files[file], LIMIT):
            tell(json.dumps([item.nodeid, good, time.process_time() - began, [*calls]]) + "\n")
            calls.clear()

    lines = _forked(work).splitlines()
    told = [json.loads(line) for line in lines if line.endswith("]]")]  # the last may be cut
    return {
        "seconds": max((seconds for _, _, seconds, _ in told), default=0.0),
        "passed": [test for test, good, _, _ in told if good],
        "functions": sorted({key for _, _, _, keys in told for key in keys}),
    }


def _end(mutant: Mutant) -> str:
    """Run the files that run the mutant's function until a test fails, and say how it ended."""
    own = f"tests/{mutant.path.parent.relative_to(ROOT)}/"
    every = [(not file.startswith(own), one["seconds"], file)
             for file, one in KNOWN.reach.items()
             if mutant.key in one["functions"] and file in KNOWN.files]  # fmt: skip
    end, left = "SURVIVED" if every else "SURVIVED, no test runs it,", KNOWN.args.budget
    for _, seconds, file in sorted(every):
        if (left := left - seconds) < 0.0:
            end = f"SURVIVED the first {KNOWN.args.budget:g} s of tests,"
            break
        if red := _red(mutant, file, seconds):
            end = red
            break
    print(end, mutant, flush=True)
    return end


def _red(mutant: Mutant, file: str, seconds: float) -> str:
    """Which test of a file fails, or "" if none does."""
    passed = set(KNOWN.reach[file]["passed"])
    items = [item for item in KNOWN.files[file] if item.nodeid in passed]

    def work(tell: Callable[[str], None]) -> None:
        if not mutant.plant():
            return tell("unplanted")
        for item, good in _run(items, LIMIT + 5.0 * seconds):
            if not good:
                return tell(f"killed by {item.nodeid}")
        return tell("green")

    said = _forked(work)
    return "" if said == "green" else said or f"killed by an end of {file}"


def _forked(work: Callable[[Callable[[str], None]], None]) -> str:
    """What work tells in a fork of this process, which is ended if it does so for too long."""
    reading, writing = os.pipe()
    sys.stdout.flush()
    child = os.fork()
    if not child:
        os.setpgid(0, 0)
        nowhere, errors = os.open(os.devnull, os.O_RDWR), os.dup(2)
        for stream in (0, 1, 2):
            os.dup2(nowhere, stream)
        try:
            with os.fdopen(writing, "w") as pipe:
                work(lambda text: print(text, end="", file=pipe, flush=True))
        except BaseException:  # a defect of this script, or a test that ends its process
            os.write(errors, traceback.format_exc().encode())
        finally:
            os._exit(0)
    os.close(writing)
    told, end = b"", time.monotonic() + WAIT
    while (left := end - time.monotonic()) > 0.0 and select.select([reading], [], [], left)[0]:
        if not (piece := os.read(reading, 1 << 16)):
            break
        told += piece
    os.close(reading)
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)  # and what it started
    os.waitpid(child, 0)
    return told.decode()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", help="folders or files of sources")
    parser.add_argument("--each", type=int, default=30, help="mutants of each, drawn at random")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--tests", nargs="+", default=["tests"], help="files or folders of tests")
    parser.add_argument("--python", action="store_true", help="compile nothing")
    parser.add_argument("--map", help="a file that keeps which tests run which functions")
    parser.add_argument("--budget", type=float, default=60.0, help="of tests, for a mutant [s]")
    parser.add_argument("--processes", type=int, default=2)
    KNOWN.args = args = parser.parse_args()
    if args.python:
        os.environ["NUMBA_DISABLE_JIT"] = "1"  # before anything imports numba
    os.chdir(ROOT)
    how = ["-n", "0", "-q", "-s", "-p", "no:cacheprovider"]
    marks = "not slow and not benchmark and not sweep"
    sys.exit(pytest.main([*args.tests, *how, "-m", marks], plugins=[sys.modules[__name__]]))


if __name__ == "__main__":
    main()
