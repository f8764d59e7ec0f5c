"""The page of published robots: its head says what its table holds."""

from __future__ import annotations

import re
from pathlib import Path

PAGE = (Path(__file__).parents[1] / "docs" / "robots.md").read_text(encoding="utf-8")
ROWS = [line for line in PAGE.splitlines() if line.startswith("| ") and " | from | " not in line]


def test_the_head_counts_the_rows() -> None:
    total, read, rest = map(int, re.findall(r"(?:the|:|and) (\d+) (?:robots|are|of)", PAGE)[:3])
    refused = [row for row in ROWS if "| refused |" in row]
    resting = [row for row in ROWS if "| rests, " in row]
    assert (total, read, rest) == (len(ROWS), len(ROWS) - len(refused), len(resting))
    assert (total, rest) >= (79, 45)


def test_whoever_does_not_rest_has_a_reason_and_the_others_agree_with_mujoco() -> None:
    """Two equilibria, which both physics confirm, are no disagreement."""
    for row in ROWS:
        *_cells, home, agreement, remark = (cell.strip() for cell in row.strip("|").split("|"))
        if home.startswith("rests"):
            agree, _of, poses = agreement.partition(";")[0].split()
            both = re.search(r"(\d+) two stable equilibria", agreement)
            assert int(agree) + (int(both[1]) if both else 0) == int(poses), row
        else:
            assert len(remark) > 20, row
