"""Tables that are written are read again as they were."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from seecr.columns.csv import read_table, table_text

ODD = ("#a", " #b", "a#b", "b, c", 'said "d"', "two\nlines", "two\r\nlines", "1;5", "'", "µ")


@pytest.mark.parametrize("last", ["#", "e"])
def test_odd_names_come_back(tmp_path: Path, last: str) -> None:
    names = [*ODD, last]
    path = tmp_path / "rows.csv"
    text = table_text({"run": names, "x_m": np.arange(len(names)), "note": names[::-1]})
    path.write_bytes(text.encode())
    table = read_table(path)
    assert list(table.cells[0]) == [name.strip() for name in names]
    assert list(table.cells[2]) == [name.strip() for name in names[::-1]]
    assert list(table.cells[1]) == [str(k) for k in range(len(names))]


def test_numbers_have_all_digits_or_those_asked_for() -> None:
    values = [0.1 + 0.2, -0.0, math.nan, math.inf, np.float64(1e-9), None, 3, "a"]
    cells = ["0.30000000000000004", "0.0", "", "", "1e-09", "", "3", "a"]
    assert table_text({"x": values}).splitlines() == ["x", *cells]
    assert table_text({"x": values, "y": values}, 4).splitlines()[1:3] == ["0.3,0.3", "0,0"]
