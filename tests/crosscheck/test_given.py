"""What a case folder is given: a robot that stands alone in it."""

from __future__ import annotations

from pathlib import Path

import pytest

from crosscheck import given
from crosscheck.errors import CrosscheckError
from seecr.shipped import model_path


def test_a_robot_that_needs_files_beside_it_is_refused(tmp_path: Path) -> None:
    text = model_path("planar_vertical").read_text(encoding="utf-8")
    (tmp_path / "beside.xml").write_text("<mujoco/>", encoding="utf-8")
    robot = tmp_path / "robot.xml"
    robot.write_text(text.replace("<worldbody>", '<include file="beside.xml"/><worldbody>', 1))
    folder = tmp_path / "case"
    folder.mkdir()
    with pytest.raises(CrosscheckError, match=r"robot\.xml: needs files beside it"):
        given.copy_robot(robot, folder / "robot.xml")


def test_another_failure_is_not_called_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_path: Path) -> None:
        raise MemoryError("none is left")

    monkeypatch.setattr(given, "load_robot", fail)
    with pytest.raises(MemoryError, match="none is left"):
        given.copy_robot(model_path("planar_vertical"), tmp_path / "robot.xml")
