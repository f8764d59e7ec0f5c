"""numba's cached functions of older sources, deleted before the tests.

numba notices an edit of a function's own file alone: not of the files whose functions it calls.
"""

from __future__ import annotations

from pathlib import Path


def forget_stale(package: Path) -> list[Path]:
    """Delete a package's compiled functions if one is older than a source; says which."""
    kept = [p for ending in ("nbi", "nbc") for p in package.rglob(f"__pycache__/*.{ending}")]
    newest = max((p.stat().st_mtime for p in package.rglob("compiled/*.py")), default=0.0)
    if all(p.stat().st_mtime >= newest for p in kept):
        return []
    for path in kept:
        path.unlink(missing_ok=True)
    return kept
