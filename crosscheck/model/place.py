"""Where a model may be written."""

from __future__ import annotations

from pathlib import Path

from seecr.files import check_writable
from seecr.prediction.model import read_document

__all__ = ["check_place"]

_EXPECTED = "expected the name of a new file, or a model to be replaced"


def check_place(path: Path) -> None:
    """Check that a model can be written there, before the work that it is for.

    Raises:
        InputFileError: nothing can be written there, or the file there is not a model: a robot or
            measurements named by mistake may be the only copies.
    """
    check_writable(path)
    if path.exists():
        read_document(path, _EXPECTED)
