"""`make reproduce` holds each number against an interval, and fails where one is outside."""

from __future__ import annotations

import copy
import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import reproduce

DOCS = Path(__file__).resolve().parents[1] / "docs"
FIGURES = json.loads((DOCS / "figures.json").read_text(encoding="utf-8")) | {
    "suite": {"exit_status": 0}
}
NAMES = FIGURES["diagnosis"]["names"]


def test_what_is_kept_is_inside_its_own_intervals() -> None:
    assert list(reproduce.faults_of(FIGURES, FIGURES)) == []
    assert len(reproduce.counts(FIGURES["diagnosis"])) == 11
    assert len(reproduce.ratios(FIGURES["speed"])) == 22


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ("suite exit_status", 1, "suite: a threshold is exceeded"),
        (
            "diagnosis false_names",
            NAMES // 2,
            f"names that are true: {NAMES - NAMES // 2} of {NAMES}",
        ),
        ("diagnosis several named", 30, "named of several: 30 of "),
        ("diagnosis named_by_size more 8", [0, 80], "named of 8 sigma: "),
        ("diagnosis nulls white", {"effects_found": 8}, "nulls seen: 48 of 56, expected "),
        ("diagnosis intervals share", 0.5, "intervals with the truth: "),
        (
            "speed ratios demobot_cogiro mujoco",
            100.0,
            "demobot_cogiro, mujoco: ",
        ),
        ("speed robots 0 9", "3.0", "demobot_cogiro, E S 300 N, alone: 3 times, expected "),
    ],
)
def test_a_number_outside_is_told_with_what_was_expected(path: str, value: Any, said: str) -> None:
    found = copy.deepcopy(FIGURES)
    *way, last = path.split()
    place: Any = found
    for key in way:
        place = place[int(key) if isinstance(place, list) else key]
    place[int(last) if isinstance(place, list) else last] = value
    (line,) = reproduce.faults_of(FIGURES, found)
    assert line.startswith(said)
    assert ", expected " in line or "threshold" in line


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., tuple[int, str]]:
    """Runs it with figures and words of the paper's page that would be found, without the work."""
    monkeypatch.setattr("sys.argv", ["reproduce.py", "--short"])
    monkeypatch.setattr(subprocess, "check_output", lambda *_, **__: "")
    monkeypatch.setattr(reproduce, "FOUND", tmp_path / "found.json")
    monkeypatch.setattr(reproduce, "PAGE", tmp_path / "paper.md")

    def call(found: Any, old: str, new: str) -> tuple[int, str]:
        reproduce.PAGE.write_text("a tilt of 26.43 deg\nand more\n")

        def run_all(_short: bool, _kept: Any) -> Any:
            reproduce.PAGE.write_text(reproduce.PAGE.read_text().replace(old, new))
            return found | {"commit": "3e43d88e"}

        monkeypatch.setattr(reproduce, "run_all", run_all)
        return reproduce.main(), reproduce.PAGE.read_text()

    return call


def test_only_a_run_with_all_numbers_inside_ends_well(
    run: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    outside = FIGURES | {"suite": {"exit_status": 1}}
    for found, new, status in ((FIGURES, "26.43", 0), (FIGURES, "26.5", 1), (outside, "26.43", 1)):
        ended, page = run(found, "26.43", new)
        assert ended == status and page == "a tilt of 26.43 deg\nand more\n"  # a short run
        assert json.loads(reproduce.FOUND.read_text())["suite"] == found["suite"]
        said = capsys.readouterr().out
        assert ("all numbers of commit 3e43d88e are inside" in said) is (status == 0)
        assert ("-a tilt of 26.43 deg\n+a tilt of 26.5 deg" in said) is (new == "26.5")
        assert ("suite: a threshold is exceeded" in said) is (found is outside)


def test_a_changed_tree_is_of_no_commit(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subprocess, "check_output", lambda *_, **__: " M seecr/pose.py\n")
    with pytest.raises(SystemExit, match=r"nothing changed since, got:\nM seecr/pose\.py"):
        run(FIGURES, "", "")


def test_a_script_that_fails_is_no_answer() -> None:
    with pytest.raises(SystemExit, match=r"scripts/none\.py ended with status 2"):
        reproduce.run("scripts/none.py")


def test_a_page_may_move_by_how_its_numbers_are_rounded() -> None:
    page = "# Seven\n\n| 7 | `wrench` | 0.21 mm | ± 0.0046 mm | 1.2e-05 |\n"
    for new, same in (
        (page.replace("0.0046", "0.0047"), True),
        (page.replace("0.0046", "0.0048"), False),
        (page.replace("1.2e-05", "1.1e-05"), True),
        (page.replace("1.2e-05", "1.2e-04"), False),
        (page.replace("| 7 |", "| 8 |"), False),  # counts are not rounded
        (page.replace("wrench", "spring"), False),
        (page + "\n", False),
    ):
        assert (reproduce.moved(page, new) == []) is same, new
    assert reproduce.moved("a 0.0099 b", "a 0.010 b") == []
    assert len(reproduce.moved("a 0.0096 b", "a 0.010 b")) > 0
