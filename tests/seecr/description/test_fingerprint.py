"""Which robot a model was made for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from seecr.description.fingerprint import check_robot, fingerprint
from seecr.description.mjcf import load_robot, model_path
from seecr.errors import InputFileError

PATH = Path("model.toml")
ROBOT = load_robot(model_path("demobot_cogiro"))


def test_its_own_fingerprint_fits_a_robot_without_a_word() -> None:
    assert check_robot(PATH, fingerprint(ROBOT), ROBOT) == ()
    assert check_robot(PATH, {}, ROBOT) == ()


def test_a_model_that_says_nothing_is_the_users_business() -> None:
    assert check_robot(PATH, None, ROBOT) == (
        "model.toml does not say which robot it was made for",
    )


@pytest.mark.parametrize(
    "change, words",
    [
        (
            {"exit_points": ROBOT.exit_points + np.eye(3)[0] * 2e-3},
            "its exit point of cable1 is 2 mm from that in /",
        ),
        ({"anchor_points": 1.1 * ROBOT.anchor_points}, "its anchor point of cable"),
        ({"reference_pose": [0.4, 0.25, 0.3, 1, 0, 0, 0]}, "its reference pose is"),
    ],
)
def test_points_elsewhere_are_another_robot(change: dict, words: str) -> None:
    with pytest.raises(InputFileError, match=f"robot of the same name, demobot_cogiro: .*{words}"):
        check_robot(PATH, fingerprint(replace(ROBOT, **change)), ROBOT)


def test_other_numbers_than_points_are_noted() -> None:
    heavier = replace(ROBOT, mass=1.25 * ROBOT.mass, ea=2.0 * ROBOT.ea)
    notes = check_robot(PATH, fingerprint(heavier), ROBOT)
    assert [key in note for key, note in zip(("mass_kg", "ea_N"), notes, strict=True)] == [True] * 2
    assert all("its effects may be counted twice" in note for note in notes)


def test_a_table_of_another_kind_is_refused() -> None:
    with pytest.raises(InputFileError, match=r"expected a table \[robot\], got 'cogiro'"):
        check_robot(PATH, "cogiro", ROBOT)
    with pytest.raises(InputFileError, match=r"\[robot\] ea_N: expected numbers of shape \(8,\)"):
        check_robot(PATH, {"ea_N": [3000.0] * 7}, ROBOT)
    with pytest.raises(InputFileError, match="with 4 cables; demobot_cogiro has 8"):
        check_robot(PATH, {"name": "other", "cables": list("abcd")}, ROBOT)
    for wrong in ({"value": 8}, "cable1", list(range(8))):
        with pytest.raises(InputFileError, match=r"\[robot\] cables: expected a list of names"):
            check_robot(PATH, {"cables": wrong}, ROBOT)
    with pytest.raises(InputFileError, match=r"\[robot\] mass_kg: expected a number, got 10000"):
        check_robot(PATH, {"mass_kg": 10**400}, ROBOT)
    with pytest.raises(InputFileError, match=r"\[robot\] name: expected a text, got 3"):
        check_robot(PATH, {"name": 3}, ROBOT)


def test_a_hundredth_of_a_micrometre_is_the_same_robot() -> None:
    moved = replace(ROBOT, exit_points=ROBOT.exit_points + 1e-8 * np.ones((8, 3)))
    assert check_robot(PATH, fingerprint(moved), ROBOT) == ()
