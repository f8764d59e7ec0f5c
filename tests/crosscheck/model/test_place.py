"""Where a model may be written, and what it keeps of values that each file has of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import seecr
from crosscheck.model.fitted import Fitted
from crosscheck.model.write import check_place, kept, without_parts
from seecr.effects import Knowledge, Own, Term, Values, apart
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


BASE = seecr.layout_of("pulley_radius", "demobot_cogiro")


def fitted(parts: dict[str, float], stderr: float, before: Own | None = None) -> Fitted:
    layout = apart(BASE, "file", tuple(parts), BASE.null)
    vector = np.array(list(parts.values()))
    term = Term(layout, vector, Knowledge.nothing(len(vector)), before)
    return Fitted(term, np.full(len(vector), stderr), np.zeros(len(vector), dtype=bool))


def test_another_file_may_differ_by_their_spread_and_their_errors() -> None:
    """4 and 10 mm: mean 7 mm, standard deviation 4.243 mm, beside errors of 3 mm."""
    found = kept(fitted({"monday": 0.004, "tuesday": 0.010}, 0.003), None)
    assert found.usual.term.vector == pytest.approx([0.007])
    assert found.usual.stderr == pytest.approx([np.hypot(0.006 / 2**0.5, 0.003)])
    assert list(found.parts) == ["monday", "tuesday"]
    assert found.parts["tuesday"].term.vector == [0.010]
    assert found.usual.term.own is not None and list(found.usual.term.own.values) == list(
        found.parts
    )


def test_of_one_file_another_may_differ_by_a_plausible_size() -> None:
    found = kept(fitted({"monday": 0.004}, 0.003), None)
    assert found.usual.term.vector == pytest.approx([0.004])
    assert found.usual.stderr == pytest.approx(BASE.scale)


def test_a_file_that_the_model_knows_without_its_folder_is_the_same_file() -> None:
    known = Values(np.array([0.002]), np.array([0.001]), Knowledge.nothing(1))
    found = kept(fitted({"days/monday": 0.004}, 0.003, Own("file", {"monday": known})), None)
    assert found.usual.term.own is not None
    assert list(found.usual.term.own.values) == ["monday"]
    assert found.usual.term.vector == pytest.approx([0.004])


def test_a_fixed_value_is_what_is_usual_whatever_the_files_have() -> None:
    fixed = Term(BASE, np.array([0.02])).fixed()
    found = kept(fitted({"monday": 0.004, "tuesday": 0.010}, 0.003), fixed)
    assert found.usual.term.vector == pytest.approx(BASE.null)


def test_an_effect_that_is_the_same_everywhere_stays_as_it_was_fitted() -> None:
    one = Fitted(Term(BASE, np.array([0.01])), np.array([0.001]), np.array([False]))
    assert kept(one, None).usual is one and kept(one, None).parts == {}
    both = [one, fitted({"monday": 0.004, "tuesday": 0.010}, 0.003)]
    same, covariance = without_parts(both, np.diag([1.0, 2.0, 3.0]))
    assert same == [one] and covariance.tolist() == [[1.0]]
