"""Where a model may be written: over a model, and over nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from crosscheck.model.write import check_place
from seecr.errors import InputFileError
from seecr.prediction.model import new_model


def test_a_new_file_and_an_older_model_may_be_written(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    check_place(path)
    assert not path.exists()
    path.write_text(new_model("demobot_cogiro").document.as_string())
    check_place(path)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("robot.xml", "<mujoco/>", "is not TOML: .* expected the name of a new file, or a model"),
        ("measured.csv", "run,cmd_x_m\na,0\n", "is not TOML: .* expected the name of a new file"),
        ("measured.toml", "[sigma]\nposition_m = 1e-4\n", "is not a model, it has sigma; expected"),
        ("empty.toml", "", "is empty; expected the name of a new file, or a model to be replaced"),
    ],
)
def test_other_files_are_refused_and_stay(tmp_path: Path, name: str, text: str, words: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputFileError, match=f"{name}: (line 1: )?{words}"):
        check_place(path)
    assert path.read_text() == text


def test_a_folder_and_a_file_inside_of_a_file_are_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for path, words in ((tmp_path, "is a folder"), (tmp_path / "file" / "m.toml", "not a folder")):
        with pytest.raises(InputFileError, match=f"cannot be written: .*{words}"):
            check_place(path)
