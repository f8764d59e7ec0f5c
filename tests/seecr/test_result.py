"""Results in print, in a notebook and as data frames."""

from __future__ import annotations

import builtins
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pytest

import seecr
from crosscheck.model.fitted import Fitted
from seecr.result import Result

HOME = [0.4, 0.25, 0.1, 1, 0, 0, 0]


@pytest.fixture(scope="module")
def solution() -> seecr.Solution:
    robot = seecr.load_robot("demobot_cogiro")
    return seecr.solve(robot, [HOME, [0.4, 0.25, 0.1, 1, 0, 0, 0], [0.5, 0.3, 0.1, 1, 0, 0, 0]])


@pytest.fixture(scope="module")
def fallen() -> seecr.Solution:
    robot = seecr.load_robot("demobot_cogiro")
    return seecr.solve(robot, [HOME] * 11, wrench=[0, 0, -1e9, 0, 0, 0])


def test_a_solution_prints_as_a_few_lines(solution: seecr.Solution) -> None:
    lines = str(solution).splitlines()
    assert repr(solution) == str(solution) and len(lines) == 4
    assert lines[0] == "demobot_cogiro: 3 of 3 poses at rest"
    worst = int(np.argmax(np.linalg.norm(solution.deviation[:, :3], axis=1)))
    assert lines[1].startswith(f"largest deviation from the command: pose {worst}, ")
    size = 1e3 * np.linalg.norm(solution.deviation[worst, :3])
    assert float(lines[1].split(f"pose {worst}, ")[1].split()[0]) == pytest.approx(size, rel=1e-3)
    assert f"{solution.tensions.max():.4g} N" in lines[2]
    assert f"{solution.slack.sum(axis=1).max()} of 8" in lines[2]


def test_what_did_not_come_to_rest_is_said_with_its_poses(fallen: seecr.Solution) -> None:
    lines = str(fallen).splitlines()
    assert lines[0] == "demobot_cogiro: 0 of 11 poses at rest"
    assert lines[1].startswith("poses 0, 1, 2, 3, 4, 5, 6, 7 and 3 more: ")
    assert fallen.status[0].value in lines[1]


def test_a_frame_has_one_row_per_pose_in_the_numbers_of_the_solution(
    solution: seecr.Solution,
) -> None:
    frame = solution.to_frame()
    assert isinstance(frame, pyarrow.Table) and frame.num_rows == 3
    table = frame.to_pydict()
    assert table["status"] == ["CONVERGED"] * 3
    assert np.array_equal(table["z_m"], solution.pose[:, 2])
    assert np.array_equal(table["command_qw"], solution.command[:, 3])
    name = solution.robot.cable_names[4]
    assert np.array_equal(table[f"tension_{name}_N"], solution.tensions[:, 4])
    assert np.array_equal(table[f"slack_{name}"], solution.slack[:, 4])


def without(monkeypatch: pytest.MonkeyPatch, *packages: str, lacking: str = "") -> None:
    """Packages that are absent, or that lack one of their own imports."""
    real = builtins.__import__

    def refuse(name: str, *args: Any, **more: Any) -> Any:
        if name.split(".")[0] in packages:
            raise ModuleNotFoundError(f"No module named {lacking or name!r}", name=lacking or name)
        return real(name, *args, **more)

    monkeypatch.setattr(builtins, "__import__", refuse)


def test_without_pyarrow_and_pandas_a_frame_is_a_typed_error(
    solution: seecr.Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    without(monkeypatch, "pyarrow", "pandas")
    with pytest.raises(seecr.MissingPackageError, match="needs pyarrow or pandas"):
        solution.to_frame()


def test_a_package_that_is_itself_incomplete_is_not_taken_for_absent(
    solution: seecr.Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    without(monkeypatch, "pyarrow", lacking="cffi")
    with pytest.raises(ModuleNotFoundError, match="cffi"):
        solution.to_frame()


def test_in_a_notebook_it_is_its_lines_and_its_first_rows(fallen: seecr.Solution) -> None:
    page = fallen._repr_html_()
    assert page.count("<tr>") == 12 and "0 of 11 poses at rest" in page
    many = seecr.solve(fallen.robot, [HOME] * 25)._repr_html_()
    assert many.count("<tr>") == 21 and "and 5 more rows: to_frame() has them all" in many


def test_names_of_a_users_robot_are_escaped(solution: seecr.Solution) -> None:
    from dataclasses import replace

    odd = replace(solution, robot=replace(solution.robot, name="<b>bot</b>"))
    assert "<b>bot" not in odd._repr_html_() and "&lt;b&gt;bot" in odd._repr_html_()


def test_a_prediction_shows_what_would_be_read() -> None:
    robot = seecr.load_robot("demobot_cogiro")
    found = seecr.predict(robot, [HOME], [seecr.Term.of(robot, "tracker_scale", factor=2.0)])
    assert str(found).startswith("demobot_cogiro: 1 of 1 pose at rest")
    assert found.to_frame().to_pydict()["x_m"] == pytest.approx([2.0 * found.pose[0, 0]])


def test_a_model_prints_its_effects(tmp_path: Path) -> None:
    robot = seecr.load_robot("demobot_cogiro")
    path = tmp_path / "m.toml"
    path.write_text(
        '[[effect]]\nname = "pulley_radius"\n'
        'parameters.radius_m = { value = 0.0099, stderr = 1e-4, unit = "m" }\n'
        '[[effect]]\nname = "centre_of_mass"\n[effect.parameters]\n'
        'shift_x_m = 0.001\nshift_y_m = 0\nshift_z_m = { value = 0, stderr = "unseen" }\n'
    )
    model = seecr.load_model(path, robot)
    lines = str(model).splitlines()
    assert lines[0] == "model of a robot: plain SEECR and 2 effects"
    assert lines[1] == "pulley_radius: radius = 9.90 ± 0.10 mm"
    assert lines[2] == "centre_of_mass: shift_x = 1 mm, shift_y = 0 mm, shift_z = 0 mm"
    assert lines[3] == model.notes[0]
    table = model.to_frame().to_pydict()
    assert table["parameter"] == ["radius_m", "shift_x_m", "shift_y_m", "shift_z_m"]
    assert table["stderr"] == [1e-4, None, None, None]


def test_models_terms_and_fits_print_alike(tmp_path: Path) -> None:
    robot = seecr.load_robot("demobot_cogiro")
    path = tmp_path / "m.toml"
    path.write_text(
        '[[effect]]\nname = "pulley_radius"\n[effect.parameters]\n'
        "radius_m = { value = 0.0083702, stderr = 1.3e-5 }\n"
        '[[effect]]\nname = "stiffness"\n[effect.parameters]\n'
        "factor = { value = 0.91, fixed = true }\n",
        encoding="utf-8",
    )
    model = seecr.load_model(path, robot)
    text = str(model)
    assert "pulley_radius: radius = 8.370 ± 0.013 mm" in text
    assert "stiffness: factor = 0.91 (fixed)" in text
    term = model.terms["pulley_radius"]
    assert repr(term) == "pulley_radius: radius = 8.37 mm"
    fitted = Fitted(term, np.array([1.3e-5]), np.array([False]))
    assert repr(fitted) == "pulley_radius: radius = 8.370 ± 0.013 mm"
    gains = seecr.Term.of(robot, "drum_gain", gain_2=0.001)
    assert repr(gains) == "drum_gain: gain_1 = 0, gain_2 = 0.001, gain_3 = 0, gain_4 = 0 and 4 more"
    assert repr(gains.layout).startswith("Layout(drum_gain: gain_1, gain_2")


def test_small_results_are_a_line_each_and_a_row_for_each_thing() -> None:
    robot, up = "demobot_cogiro", np.array(HOME, dtype=float)
    off = np.array([[3e-4, 4e-4, 0.0], [np.nan] * 3])
    fall = seecr.Jump(up, up, np.full(7, np.nan), np.nan, certain=True)
    results: dict[str, Result] = {
        "the file for MuJoCo alone also contains pulley_radius": seecr.export(
            robot, [seecr.Term.of(robot, "pulley_radius", radius_m=0.01)]
        ),
        "2 commands, at rest at 1; one standard deviation: up to 0.50 mm and 0.029 deg, "
        "0.00040 N; as read by the tracker: 0.50 mm and 0.029 deg": seecr.Spread(
            off, off, off, np.hstack([off, off])
        ),
        "poses 3 to 5: 2 slack cables": seecr.Zone(3, 5, 2),
        "pose 3: no answer": seecr.Zone(3, 3, None),
        "reachable, 2 J to get there, 1 mJ back": seecr.Barrier(2.0, 1e-3, up, True, False),
        "at command (0.4, 0.25, 0.1) m: its equilibrium ends, and nothing holds it after "
        "that": fall,
        "tilted by 0 deg, tensions of 0.5 and 0.5 times the weight, stable": seecr.BarRest(
            0.0, (0.5, 0.5), True
        ),
    }
    for line, result in results.items():
        assert repr(result).splitlines()[-1] == line
        assert f"<div>{line}</div>" in result._repr_html_()
        rows = 2 if isinstance(result, seecr.Spread) else 1
        assert result.to_frame().num_rows == len(result.records()) == rows


class Two(Result):
    """Two rows, one without a number."""

    def lines(self) -> list[str]:
        return ["two & two"]

    def records(self) -> list[dict[str, Any]]:
        return [{"a_m": 1.23456789, "b": None}, {"a_m": 2.0, "b": "x"}]


def test_a_class_says_its_lines_and_its_records_and_has_the_rest() -> None:
    two = Two()
    assert str(two) == repr(two) == "two & two"
    assert two.to_frame().to_pydict() == {"a_m": [1.23456789, 2.0], "b": [None, "x"]}
    page = two._repr_html_()
    assert "two &amp; two" in page and "<td>1.23457</td><td></td>" in page


def test_rows_as_json_are_those_of_the_data_frame() -> None:
    robot = seecr.load_robot("demobot_cogiro")
    found = seecr.predict(
        robot, [HOME, HOME], [seecr.Term.of(robot, "pulley_radius", radius_m=0.1)]
    )
    rows = json.loads(found.to_json())["rows"]
    assert rows == found.to_frame().to_pylist()


def test_a_number_that_does_not_exist_is_null_in_json() -> None:
    unknown = np.full((1, 3), math.nan)
    spread = seecr.Spread(unknown, unknown, np.zeros((1, 2)), np.ones((1, 6)))
    (row,) = json.loads(spread.to_json())["rows"]
    assert row["stderr_x_m"] is None and row["stderr_tension_2_N"] == 0.0


def test_a_model_as_json_has_its_robot_and_its_values() -> None:
    robot = seecr.load_robot("demobot_cogiro")
    plain = json.loads(seecr.new_model(robot).to_json())
    assert plain == {"robot": "demobot_cogiro", "rows": [], "notes": []}


def test_results_of_one_row_are_that_row_in_json() -> None:
    level = seecr.BarRest(0.0, (0.5, 0.5), True)
    assert level.as_json() == {
        "theta_rad": 0.0, "tension_1": 0.5, "tension_2": 0.5, "stable": True,
    }  # fmt: skip
    zone = seecr.Zone(2, 5, None)
    assert json.loads(zone.to_json()) == {"first_pose": 2, "last_pose": 5, "slack_cables": None}
