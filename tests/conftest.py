"""Fixtures that several test files share."""

from __future__ import annotations

import gc
import importlib.util
import os
import threading
from pathlib import Path

# BLAS on several threads, in several workers, takes longer; set before NumPy is imported
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from stale import forget_stale

# tests, figures and parsed sources are many objects: to collect them took a quarter of the time of
# what makes them
gc.set_threshold(100_000, 50, 100)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Forget what was compiled from older sources, before any worker starts to use it.

    And compile all where there are workers: each would do so for itself. Continuous integration
    has it done before, and saves the time that this process alone would take to load it.
    """
    if hasattr(session.config, "workerinput"):
        return
    spec = importlib.util.find_spec("seecr")
    assert spec is not None and spec.origin is not None
    forget_stale(Path(spec.origin).parent)
    if getattr(session.config.option, "numprocesses", None) and "SEECR_COMPILED" not in os.environ:
        from warm import compile_all

        compile_all()


def pytest_collection_finish(session: pytest.Session) -> None:
    """Six thousand tests and all modules stay: the garbage collector need not go through them."""
    gc.freeze()


def pytest_itemcollected(item: pytest.Item) -> None:
    """Sweeps and benchmarks are slow as well: `-m 'not slow'` replaces what leaves them out."""
    if item.get_closest_marker("sweep") or item.get_closest_marker("benchmark"):
        item.add_marker(pytest.mark.slow)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What takes long comes first: no worker is to begin it when the others are done.

    Every other file, since two workers begin with a half each and keep what a file made.
    """
    slow = [item for item in items if item.get_closest_marker("slow")]
    rest = [item for item in items if not item.get_closest_marker("slow")]
    files = list(dict.fromkeys(item.path for item in slow))
    first = [item for item in slow if files.index(item.path) % 2 == 0]
    second = [item for item in slow if files.index(item.path) % 2 == 1]
    middle = max(0, (len(items) + 1) // 2 - len(first))
    items[:] = [*first, *rest[:middle], *second, *rest[middle:]]


@pytest.fixture(scope="session", autouse=True)
def no_lines_of_progress() -> None:
    """A busy machine adds none to what commands print: tests of other words read all of it."""
    from seecr.cli import progress
    from seecr.compiled.compile_notice import watch

    progress.SECONDS_BETWEEN_LINES = watch.patience = threading.TIMEOUT_MAX


@pytest.fixture
def unpaged(monkeypatch: pytest.MonkeyPatch) -> None:
    """No page is drawn, which takes most of the time of a command, where nobody looks at it."""
    monkeypatch.setattr("crosscheck.show.pictures.write_page", lambda _found, _path, _made: None)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder with trial data beside the repository, which not every checkout has."""
    beside = Path(__file__).resolve().parents[2] / "shared"
    folder = Path(os.environ.get("CROSSCHECK_SHARED", beside)) / "data"
    if not folder.is_dir():
        pytest.skip(f"no trial data: {folder} is absent (CROSSCHECK_SHARED names its parent)")
    return folder
