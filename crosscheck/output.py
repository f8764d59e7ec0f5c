"""A folder of results that is complete or untouched."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from crosscheck.errors import CrosscheckError


@contextmanager
def staged(out: str | Path) -> Iterator[Path]:
    """A temporary folder whose files move into ``out`` when the block ends well.

    It lies inside ``out``, so that moving is renaming; if the block fails, ``out`` is as it was.

    Args:
        out: the folder of results, made if need be.

    Raises:
        CrosscheckError: it cannot be made or written to; said before any work is done.
    """
    out = Path(out)
    made = _missing(out)
    try:
        out.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix=".unfinished-", dir=out))
    except OSError as error:
        _remove_empty(made)
        raise CrosscheckError(
            f"--out {out}: cannot write there: {error.strerror or error}; expected a folder that "
            "can be made or written to"
        ) from None
    done = False
    try:
        yield folder
        for file in sorted(folder.iterdir()):
            file.replace(out / file.name)
        done = True
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if not done:
            _remove_empty(made)


def _missing(path: Path) -> list[Path]:
    """The folders that have to be made, innermost first."""
    return [folder for folder in (path, *path.parents) if not folder.exists()]


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
