"""Which files of an older plan a new one removes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from crosscheck.planning.planned import Adding
from crosscheck.planning.proposer import Suggestion
from crosscheck.planning.write import _slack_remark, sometimes_written

OWN = {"poses.csv", "poses.toml"}


def test_files_of_every_addition_may_be_stale(tmp_path: Path) -> None:
    added = {f"add-{kind.value}.{end}" for kind in Adding for end in ("csv", "toml")}
    assert set(sometimes_written(tmp_path, None)) == added


def test_poses_are_removed_only_if_the_older_plan_wrote_them(tmp_path: Path) -> None:
    poses, plan = tmp_path / "poses.csv", tmp_path / "plan.json"
    plan.write_text(json.dumps({"files": ["poses.csv"]}))
    assert set(sometimes_written(tmp_path, tmp_path / "mine.csv")) > OWN
    assert not OWN & set(sometimes_written(tmp_path, tmp_path / ".." / tmp_path.name / poses.name))
    plan.write_text(json.dumps({"files": ["add-payload.csv"]}))
    assert not OWN & set(sometimes_written(tmp_path, None))


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"files": 3}'])
def test_a_file_that_is_no_plan_says_nothing(tmp_path: Path, text: str) -> None:
    (tmp_path / "plan.json").write_text(text)
    assert not OWN & set(sometimes_written(tmp_path, None))


def test_lines_that_leave_cables_slack_are_remarked_in_the_file_itself() -> None:
    """Below the remark and the header, lines count from 3."""
    item = Suggestion(Adding.POSES, "", (), slack=((), ("a", "b"), (), ("c",)))
    assert _slack_remark(item) == "cables are slack at line 4 (a b), line 6 (c)"
    assert _slack_remark(Suggestion(Adding.POSES, "", (), slack=((), ()))) == ""
