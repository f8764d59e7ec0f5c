"""Lines that no winch drives, as files, commands and callers declare them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from called import ran
from passive_files import FOLDER

import seecr
from crosscheck.settle.physics import Physics
from seecr.cli.arguments import robot_at

FILE = """<mujoco model="three">
  <custom>{texts}</custom>
  <worldbody>
    <site name="A1" pos="-1 0 2"/><site name="A2" pos="1 0 2"/><site name="A3" pos="0 0 0"/>
    <body name="platform" pos="0 0 1">
      <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="1.5" diaginertia="0.1 0.1 0.1"/>
      <site name="B1"/><site name="B2"/><site name="B3"/>
    </body>
  </worldbody>
  <tendon>
    <spatial name="left" springlength="0 1.4" stiffness="800">
      <site site="A1"/><site site="B1"/></spatial>
    <spatial name="right" springlength="0 1.4" stiffness="800">
      <site site="A2"/><site site="B2"/></spatial>
    <spatial name="down" {down}><site site="A3"/><site site="B3"/></spatial>
  </tendon>
</mujoco>
"""
BAND = 'springlength="0 0.35" stiffness="120"'


def written(folder: Path, texts: str = "", down: str = BAND) -> Path:
    path = folder / "robot.xml"
    path.write_text(FILE.format(texts=texts, down=down))
    return path


def text(name: str, data: str) -> str:
    return f'<text name="{name}" data="{data}"/>'


@pytest.mark.parametrize("data", ["down", " down ", "down,"])
def test_a_band_is_declared(data: str, tmp_path: Path) -> None:
    robot = seecr.load_robot(written(tmp_path, text("passive", data)))
    assert robot.driven.tolist() == [True, True, False]
    assert not robot.pushes.any() and not robot.constant_tension_N.any()
    assert robot.passive_names == ("down",) and robot.n_driven == 2
    assert "no winch drives down (pulls, rest length 0.35 m throughout)" in robot.notes[-1]
    assert "no winch drives down" in str(robot)
    poses = np.array([[0.3, 0.0, 1.2, 1.0, 0.0, 0.0, 0.0]])
    assert robot.commanded_lengths(poses)[0, 2] == 0.35
    assert seecr.Commands(poses).change(robot)[0, 2] == 0.0


def test_further_lines_are_passive_where_the_caller_says_so(tmp_path: Path) -> None:
    path = written(tmp_path)
    assert seecr.load_robot(path).all_driven
    for given in (["down"], ("down",), "down"):
        assert seecr.load_robot(path, passive=given).passive_names == ("down",)
    path = written(tmp_path, text("passive", "down"))
    both = seecr.load_robot(path, passive=["left", "down"])
    assert both.passive_names == ("left", "down"), "named twice in two places is no fault"
    with pytest.raises(seecr.RobotError, match="passive: no tendon dwon; expected one of down"):
        seecr.load_robot(path, passive=["dwon"])
    shipped = seecr.load_robot("demobot_cogiro", passive=["cable3"])
    assert shipped.n_driven == 7 and seecr.load_robot("demobot_cogiro").all_driven
    with pytest.raises(seecr.InputError, match="expected names of lines"):
        seecr.load_robot(path, passive=[1])  # type: ignore[list-item]


def test_a_spring_that_pushes_is_passive(tmp_path: Path) -> None:
    robot = seecr.load_robot(written(tmp_path, down='springlength="0.35 0.35" stiffness="120"'))
    assert robot.pushes.tolist() == [False, False, True]
    assert robot.driven.tolist() == [True, True, False]
    assert "down (pulls and pushes, rest length 0.35 m throughout)" in robot.notes[-1]


@pytest.mark.parametrize(
    ("down", "rest", "said"),
    [
        ('springlength="0.35" stiffness="120"', 0.35, "has one springlength (0.35 m), with which"),
        ('stiffness="120"', 1.0, "has no springlength: its length at the reference pose is taken"),
    ],
)
@pytest.mark.parametrize("data", ["", "down"])
def test_one_length_or_none_is_of_a_line_that_never_pushes(
    data: str, down: str, rest: float, said: str, tmp_path: Path
) -> None:
    """Two equal numbers are of a spring that pushes; MuJoCo's numbers are the same for all."""
    path = written(tmp_path, text("passive", data) if data else "", down)
    robot = seecr.load_robot(path)
    assert not robot.pushes.any() and robot.rest_lengths[2] == rest
    assert robot.passive_names == ((data,) if data else ())
    assert f"tendon down {said}" in robot.notes[0]
    assert not Physics.of(path).parts.pushes


def test_mending_leaves_lines_without_a_winch_as_they_are(tmp_path: Path) -> None:
    texts = text("passive", "right") + text("constant_tension", "left=40N")
    path = written(tmp_path, texts, 'springlength="0.35 0.35" stiffness="120"')
    assert "nothing to mend" in ran(f"seecr pose {path} --fix {tmp_path / 'out.xml'}", 0).stdout
    guided = 'springlength="3.3 3.3" stiffness="120"><site site="A2"/'
    path = written(tmp_path, texts, guided)
    said = ran(f"seecr pose {path} --fix {tmp_path / 'out.xml'}", 0).stdout
    assert "tendon down runs straight" in said and "springlength" not in said
    mended = seecr.load_robot(tmp_path / "out.xml")
    assert mended.pushes.tolist() == [False, False, True]
    assert mended.constant_tension_N.tolist() == [40.0, 0.0, 0.0] and mended.n_driven == 0


@pytest.mark.parametrize("force", ["40N", "0.04kN", "40 N", "4e1N", "40000mN"])
@pytest.mark.parametrize("down", ["", BAND, 'springlength="0 0"'])
def test_a_counterweight_is_declared(force: str, down: str, tmp_path: Path) -> None:
    robot = seecr.load_robot(written(tmp_path, text("constant_tension", f"down={force}"), down))
    assert robot.constant_tension_N.tolist() == [0.0, 0.0, pytest.approx(40.0)]
    assert robot.ea[2] == 0.0 and not robot.driven[2]
    assert "down (pulls with 40 N at any length)" in robot.notes[-1]
    said = "tendon down has a spring beside its constant tension: it is left out"
    assert any(said in note for note in robot.notes) == (down == BAND)
    found = seecr.solve(robot, robot.reference_pose)
    assert found.converged[0] and found.tensions[0, 2] == pytest.approx(40.0)


DAMAGED = {
    "passive": [
        ("dwon left left", ["no tendon dwon; expected one of down", "left is named 2 times"]),
    ],
    "constant_tension": [
        ("down=40", ["down: 40 has no unit; expected a force such as 40N, in N, mN, kN"]),
        ("down=40lb", ["down: unknown unit 'lb'; expected a force such as 40N"]),
        ("down=-40N", ["down: expected a force such as 40N above zero, since a line cannot push"]),
        ("down=0N", ["down: expected a force such as 40N above zero"]),
        ("down", ["down: expected a force such as 40N after =, got none"]),
        ("down=much", ["down: expected a force such as 40N, got 'much'"]),
        ("down=40N down=30N", ["down is named 2 times; expected it once"]),
        ("wdon=40N left=7 right=-1N",
         ["no tendon wdon; expected one of", "left: 7 has no unit", "right: expected a force"]),
    ],
}  # fmt: skip


@pytest.mark.parametrize(("name", "data", "said"),
                         [(n, *one) for n, some in DAMAGED.items() for one in some])  # fmt: skip
def test_all_faults_of_the_texts_in_one_answer(
    name: str, data: str, said: list[str], tmp_path: Path
) -> None:
    path = written(tmp_path, text(name, data))
    answer = ran(f"seecr pose {path} 0 0 1", 2).stderr
    assert answer.count(f'<text name="{name}">: ') == len(said)
    for one in said:
        assert one in answer
    with pytest.raises(seecr.RobotError):
        seecr.load_robot(path)


def test_faults_of_both_texts_and_of_the_command_together(tmp_path: Path) -> None:
    path = written(tmp_path, text("passive", "dwon") + text("constant_tension", "left=3"))
    answer = ran(f"seecr pose {path} 0 0 1 --passive rihgt,left", 2).stderr
    for one in ("no tendon dwon", "left: 3 has no unit", "passive: no tendon rihgt"):
        assert one in answer


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"pushes": [False, False, True], "driven": [True] * 3}, "down pushes and is driven"),
        ({"constant_tension_N": [0, 0, 40.0]}, "a constant tension and a stiffness x rest length"),
        ({"constant_tension_N": [0, 0, -4.0]}, "a constant tension of -4 N; expected one above"),
        ({"driven": [True, False]}, r"driven must be \(3,\), got \(2,\)"),
        ({"constant_tension_N": [0, 0, 9.0], "driven": [True] * 3, "ea": [9.0, 9.0, 0.0]},
         "down has a constant tension and is driven"),
    ],
)  # fmt: skip
def test_numbers_that_contradict_each_other(changes: dict, said: str, tmp_path: Path) -> None:
    robot = seecr.load_robot(written(tmp_path))
    with pytest.raises((seecr.RobotError, seecr.InputError), match=said):
        replace(robot, **changes)


def test_lines_can_be_replaced_by_fewer(tmp_path: Path) -> None:
    """As before there were passive ones; what is said of some lines is not lost, though."""
    robot = seecr.load_robot(written(tmp_path))
    names = ("exit_points", "anchor_points", "ea", "rest_lengths")
    two = {name: getattr(robot, name)[:2] for name in names}
    assert replace(robot, cable_names=("a", "b"), **two).all_driven
    band = seecr.load_robot(written(tmp_path, text("passive", "down")))
    with pytest.raises(seecr.InputError, match=r"driven must be \(2,\), got \(3,\)"):
        replace(band, cable_names=("a", "b"), **two)


def test_made_by_hand(tmp_path: Path) -> None:
    robot = seecr.load_robot(written(tmp_path))
    hand = replace(robot, pushes=[False, False, True], driven=None)
    assert hand.driven.tolist() == [True, True, False]
    weight = replace(robot, constant_tension_N=[0, 0, 9.0], ea=[9.0, 9.0, 0.0], driven=None)
    assert weight.driven.tolist() == [True, True, False]
    assert not weight.driven.flags.writeable and not weight.pushes.flags.writeable


def test_cables_of_another_stiffness_leave_the_band_alone() -> None:
    robot = robot_at(FOLDER / "band.xml", "fishing")
    np.testing.assert_allclose(robot.ea, [300.0, 300.0, 36.0])
