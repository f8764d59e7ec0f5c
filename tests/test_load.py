"""Commands at once in one folder leave a result and nothing else: scripts/load.py, smaller."""

from __future__ import annotations

from pathlib import Path

import pytest
from load import RESULTS, run

from seecr.folders import MANIFEST


@pytest.mark.slow
def test_commands_at_once_leave_one_result_and_nothing_over(tmp_path: Path) -> None:
    ends, left, results = run(8, 4, tmp_path)
    assert ends == ["0"] * 8, ends
    assert left == set()
    assert results == {f"out/{name}" for name in (*RESULTS, MANIFEST)}
