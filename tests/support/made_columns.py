"""Columns of a file, made of a header and rows without a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from seecr.columns.csv import Table
from seecr.columns.known import Columns, know_columns


def columns_of(header: str, *rows: str, n_cables: int = 6) -> Columns:
    """The columns of ``a.csv`` with these lines, its cells split at commas."""
    cells = [row.split(",") for row in rows]
    names = tuple(header.split(","))
    lines = np.arange(2, 2 + len(rows))
    table = Table(Path("a.csv"), names, lines, 1, list(zip(*cells, strict=True)))
    return know_columns(table, n_cables)
