"""Commands that change one model at once lose nothing in silence."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

import crosscheck
import seecr
from crosscheck.model.write import save_model, state_of


def test_a_model_that_was_changed_since_it_was_read_is_not_replaced(tmp_path: Path) -> None:
    robot, path = seecr.load_robot("planar_vertical"), tmp_path / "model.toml"
    before = state_of(path)
    assert before == ""
    model = seecr.new_model(robot)
    save_model(path, model, before)
    kept = path.read_text()
    with pytest.raises(seecr.InputFileError, match="was changed by another command since it was"):
        save_model(path, model, before)
    assert path.read_text() == kept and [*tmp_path.iterdir()] == [path]
    save_model(path, model, state_of(path))
    crosscheck.save_model(path, model)  # in Python it is the caller's choice


def test_of_many_at_once_one_is_kept_and_the_others_are_told(tmp_path: Path) -> None:
    robot, path = seecr.load_robot("planar_vertical"), tmp_path / "model.toml"
    model, lost = seecr.new_model(robot), []
    save_model(path, model)
    path.write_text(path.read_text() + "# before\n")
    start, state = threading.Barrier(8), state_of(path)

    def replace() -> None:
        start.wait()
        try:
            save_model(path, model, state)
        except seecr.InputFileError:
            lost.append(1)

    many = [threading.Thread(target=replace) for _ in range(8)]
    for one in many:
        one.start()
    for one in many:
        one.join()
    assert len(lost) == 7
