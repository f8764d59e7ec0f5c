"""Fixtures that several test files share."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

import pytest

# numba keeps what it compiled, and notices an edit of a function's own file alone: not of the
# files whose functions it calls
COMPILED = ("cable_law", "forces", "kernel", "history", "response")


def pytest_sessionstart() -> None:
    """Forget what was compiled from older sources."""
    spec = importlib.util.find_spec("seecr")
    assert spec is not None and spec.origin is not None
    forget_stale(Path(spec.origin).parent)


def forget_stale(package: Path) -> list[Path]:
    """Delete a package's compiled functions if one is older than a source; says which."""
    kept = [p for ending in ("nbi", "nbc") for p in (package / "__pycache__").glob(f"*.{ending}")]
    sources = [package / f"{name}.py" for name in COMPILED]
    newest = max((p.stat().st_mtime for p in sources if p.exists()), default=0.0)
    if all(p.stat().st_mtime >= newest for p in kept):
        return []
    for path in kept:
        path.unlink(missing_ok=True)
    return kept


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder with trial data beside the repository, which not every checkout has."""
    beside = Path(__file__).resolve().parents[2] / "shared"
    folder = Path(os.environ.get("CROSSCHECK_SHARED", beside)) / "data"
    if not folder.is_dir():
        pytest.skip(f"no trial data: {folder} is absent (CROSSCHECK_SHARED names its parent)")
    return folder
