"""The pictures in docs show the numbers that the programs give today."""

from __future__ import annotations

from pathlib import Path

import pytest
import render_pictures as made

from crosscheck.suite.cases import select, shipped_cases

AGAIN = "run: scripts/render_pictures.py"
REL = 1e-3


@pytest.mark.parametrize("picture", made.PICTURES, ids=lambda picture: str(picture.name))
def test_recordings_show_what_is_computed_today(picture: made.Picture) -> None:
    (case,) = select(shipped_cases(), [picture.case])
    numbers = made.numbers_in(made.FOLDER / f"{picture.name}.png")
    assert numbers == pytest.approx(made.numbers_of_case(case), rel=REL), AGAIN


def test_the_map_shows_what_can_be_held_today() -> None:
    numbers = made.numbers_in(made.FOLDER / f"{made.MAP}.png")
    assert numbers == pytest.approx(made.numbers_of_map(made.workspace(elastic=False)), rel=REL)


def test_page_and_recording_of_the_diagnosis_are_of_the_same_one() -> None:
    page, recording = (
        made.numbers_in(made.FOLDER / f"{name}.png") for name in (made.REPORT, made.DIAGNOSIS.name)
    )
    assert page == recording and len(page) > 3


def test_a_picture_keeps_its_numbers(tmp_path: Path) -> None:
    from PIL import Image

    made.keep(Image.new("RGB", (4, 4)), tmp_path / "a.png", {"x": 1.23456789}, few=True)
    assert made.numbers_in(tmp_path / "a.png") == {"x": 1.23457}
