"""The data that commands are timed with, and the table of it."""

from __future__ import annotations

import json
from pathlib import Path

import bench
import bench_rows
import pytest

pytestmark = pytest.mark.slow


def test_every_command_reads_all_rows(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The log has one dwell for each row, and each command ends with status 0."""
    said: dict[str, int] = {}

    def spent_by(words: str, folder: str) -> float:
        seconds = bench.spent_by(words, folder)
        if words.startswith("crosscheck import"):
            found = json.loads((Path(folder) / "imported" / "import.json").read_text())
            said["dwells"] = found["dwells"]
        return seconds

    monkeypatch.setattr(bench_rows, "ROWS", (20,))
    ((rows, *seconds),) = bench_rows.of_rows(spent_by)
    assert (rows, said["dwells"]) == ("20", 20)
    assert len(seconds) == len(bench_rows.ROWS_HEAD.split(", ")) - 1
    assert all(float(each) > 0.1 for each in seconds)
