"""Passive lines in both physics: SEECR against MuJoCo, twins, a diagnosis, and planted faults."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from called import as_json, ran
from passive_files import FOLDER, KINDS, LINE
from planted import COMPILED, plant, run_in_python

import crosscheck
import seecr
from crosscheck.suite.agreement import load_thresholds
from crosscheck.suite.cases import Case, shipped_cases
from crosscheck.suite.effects import EffectCase
from crosscheck.suite.run import run_suite
from crosscheck.suite.verdicts import Outcome
from crosscheck.twin.measure import measure
from seecr.prediction.experiment import Experiment


@cache
def cases() -> dict[str, Case]:
    every = [case for case in shipped_cases() if case.name.startswith("passive-")]
    return {case.name.removeprefix("passive-"): case for case in every}


def test_the_suite_has_a_case_of_each_kind() -> None:
    assert tuple(cases()) == KINDS
    run = run_suite(list(cases().values()), load_thresholds())
    assert run.outcome is Outcome.AGREE, str(run)
    for result in run.results:
        found = result.solution
        passive = found.robot.cable_names.index(LINE[result.case.name.removeprefix("passive-")])
        assert (found.rest_lengths[:, passive] == found.robot.rest_lengths[passive]).all()


def agrees(kind: str) -> None:
    """Both sides at the ends of a sweep."""
    case = cases()[kind]
    some = replace(case, poses=case.poses[[0, 4, -1]])
    run = run_suite([some], load_thresholds())
    assert run.outcome is Outcome.AGREE, str(run)


def told(kind: str) -> None:
    """With an effect of winches, MuJoCo's robot is where SEECR's is."""
    twin_agrees(kind, "drum_gain")


def told_all(kind: str) -> None:
    """The same of a number that all winches have in common."""
    twin_agrees(kind, "length_scale")
    twin_agrees(kind, "winch_side_length")


def moved(kind: str) -> None:
    """With points that are elsewhere."""
    twin_agrees(kind, "exit_point_error")


def corrected(kind: str) -> None:
    """Where the corrected commands lead is where they were to lead."""
    robot = seecr.load_robot(FOLDER / f"{kind}.xml")
    poses = np.tile(robot.reference_pose, (2, 1))
    poses[1, :3] += [0.1, 0.0, 0.1]
    found = seecr.correct(robot, poses)
    assert found.reached.all()
    # by the statics, not by the search
    again = seecr.solve(robot, found.commands)
    np.testing.assert_allclose(again.pose, poses, atol=1e-7)
    expected = seecr.predict(robot, found.commands)
    np.testing.assert_allclose(expected.pose, poses, atol=1e-7)


def twin_agrees(kind: str, name: str) -> None:
    """An effect as a robot in MuJoCo with passive lines has it."""
    case = EffectCase(FOLDER / f"{kind}.xml", name)
    asked = replace(case.commands, loads=case.loads)
    experiment = Experiment(case.robot, asked)
    found = experiment.predict(case.effects)
    truth = measure(case.robot, asked, case.effects, segments=(16, 32), steps=experiment.path.steps)
    assert found.solved.all() and truth.at_rest.all()
    np.testing.assert_allclose(found.readings.position, truth.position, atol=1e-8)
    np.testing.assert_allclose(found.readings.tensions, truth.tension_readings, atol=1e-6)
    np.testing.assert_allclose(found.solution().rest_lengths, truth.rest_lengths, atol=1e-12)


NAMES = (
    "drum_gain", "cable_stiffness", "stiffness", "exit_point_error", "anchor_point_error",
    "pulley_radius", "winch_side_length", "initial_pose_error", "thermal_expansion",
    "frame_compliance", "hysteresis", "backlash", "creep", "cable_weight", "tension_scale",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_twins_have_passive_lines(name: str) -> None:
    twin_agrees("spring", name)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["band", "counterweight"])
@pytest.mark.parametrize("name", NAMES)
def test_twins_of_the_other_kinds(kind: str, name: str) -> None:
    twin_agrees(kind, name)


Check = Callable[[str], None]
FAULTS: list[tuple[str, str, str, Check, str]] = [
    ("seecr.compiled.platform", "or cables[i, PUSHES] == 1.0", "or False", agrees, "spring"),
    ("seecr.compiled.platform", "tension = pull + elastic", "tension = 0.5 * pull + elastic",
     agrees, "counterweight"),
    ("seecr.compiled.platform", "0.5 * (tension + pull) * elastic", "0.5 * tension * elastic",
     agrees, "counterweight"),
    ("seecr.compiled.cable_law", "tension = row[PULL] + row[EA]", "tension = row[EA]",
     corrected, "counterweight"),
    ("seecr.compiled.cable_law", "elastic < 0.0 and row[PUSHES] == 0.0", "elastic < 0.0",
     corrected, "spring"),
    ("seecr.effects.setup", "np.where(robot.driven, lengths, robot.rest_lengths)",
     "np.where(robot.driven, lengths, lengths)", moved, "band"),
    ("seecr.effects.setup", "setattr(self, name, np.where(driven, value, plain[name]))", "pass",
     told_all, "spring"),
    ("seecr.tensions.balance", "+= force.sum(axis=1)", "+= 0.0 * force.sum(axis=1)",
     corrected, "spring"),
    ("seecr.tensions.balance", "+= cross(arm, force).sum(axis=1)",
     "-= cross(arm, force).sum(axis=1)", corrected, "spring"),
    ("crosscheck.settle.physics", "np.where(self.pushes, rest, 0.0)",
     "np.where(self.pushes, 0.0, 0.0)", agrees, "spring"),
    ("crosscheck.settle.physics", "pull = tension / self.mass_unit",
     "pull = 0.9 * tension / self.mass_unit", agrees, "counterweight"),
    ("crosscheck.settle.settler", "physics.driven, lengths + self.pretension, self.home",
     "True, lengths + self.pretension, self.home", agrees, "band"),
    ("crosscheck.twin.robot", "float(robot.rest_lengths[i])", "1.01 * float(robot.rest_lengths[i])",
     told, "spring"),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS, ids=[f"{one[0]}: {one[2]}" for one in FAULTS])
def test_a_planted_fault_is_seen(
    fault: tuple[str, str, str, Check, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    module, old, new, check, kind = fault
    check(kind)
    if module.startswith(COMPILED):
        run_in_python(monkeypatch)
    plant(monkeypatch, module, old, new)
    with pytest.raises((AssertionError, seecr.SeecrError)):
        check(kind)


def test_a_hidden_gain_is_found_on_the_driven_cables(tmp_path: Path) -> None:
    """Also where the user names the band, whose robot then says so in the case's folder."""
    text = (FOLDER / "band.xml").read_text()
    bare, case = tmp_path / "bare.xml", tmp_path / "case"
    bare.write_text(text.replace('<text name="passive" data="band"/>', ""))
    ran(f"crosscheck twin {bare} --passive band --hide 3 --effect drum_gain --out {case}", 0)
    robot = seecr.load_robot(case / "robot.xml")
    assert robot.passive_names == ("band",)
    opened = as_json(f"crosscheck twin --open {case}")
    hidden = opened["values"]["drum_gain"]
    assert set(hidden) == {"gain_1", "gain_2"}
    found = crosscheck.diagnose(robot, case / "measured.csv")
    assert found.verdict is crosscheck.DiagnosisVerdict.EFFECTS_FOUND
    (one,) = found.missing
    assert one.term.name == "drum_gain" and one.term.layout.names == ("gain_1", "gain_2")
    error = np.abs(one.term.vector - [hidden["gain_1"], hidden["gain_2"]]) / one.stderr
    assert error.max() < 4.0


def test_the_worst_pose_is_one_of_the_robot_with_its_lines(tmp_path: Path) -> None:
    import mujoco

    for kind in KINDS[1:]:
        ran(f"crosscheck run --case passive-{kind} --no-recordings --out {tmp_path / kind}", 0)
        model = mujoco.MjModel.from_xml_path(str(tmp_path / kind / "worst_pose.xml"))
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.qacc, 0.0, atol=1e-5)


def test_the_published_band(shared_data: Path, tmp_path: Path) -> None:
    """0.2 mm of noise with a band whose length stays; 31 mm where a winch is taken for it."""
    folder = shared_data / "public" / "11-passive-springs"
    words = f"crosscheck compare {folder / 'band.xml'} {folder / 'band_poses.csv'} --json"
    words += f" --no-recording --out {tmp_path / 'out'}"
    rms = {}
    for option in ("", "--passive band"):
        rms[option] = json.loads(ran(f"{words} {option}").stdout)["rms"]["position_rms_m"]
    assert rms["--passive band"] < 2.2e-4 and rms[""] > 1e-2
    robot = seecr.load_robot(folder / "band.xml", passive=["band"])
    there = seecr.solve(robot, [0.6, 0.0, 1.5, 1.0, 0.0, 0.0, 0.0])
    assert there.tensions[0, 2] == pytest.approx(150.4, abs=0.1)
    assert np.linalg.norm(there.deviation[0, :3]) == pytest.approx(14.7e-3, abs=1e-4)
    lengths = as_json(
        f"crosscheck compare {folder / 'band.xml'} {folder / 'band_lengths.csv'} --no-recording "
        f"--out {tmp_path / 'lengths'}"
    )
    assert lengths["exit_status"] == 0
    found = folder / "two_way_spring.xml"
    (note,) = seecr.load_robot(found).notes
    assert "tendon spring has one springlength (1.2 m), with which it would push" in note
    two_way = tmp_path / "two_way.xml"
    two_way.write_text(found.read_text().replace('"1.2"', '"1.2 1.2"'))
    spring = seecr.load_robot(two_way)
    assert spring.pushes.tolist() == [False] * 4 + [True]
    assert LINE["spring"] == spring.cable_names[4]


def test_a_plan_does_not_take_springs_for_cables_about_to_go_slack() -> None:
    """The spring is stretched by centimetres, which says nothing about the cables' micrometres."""
    robot = seecr.load_robot(FOLDER / "spring.xml")
    poses = np.tile(robot.reference_pose, (24, 1))
    poses[:, :3] += np.random.default_rng(3).uniform(-0.1, 0.1, (24, 3))
    poses[:, 2] += 0.2
    found = crosscheck.make_plan(robot, poses)
    assert (seecr.solve(robot, poses).tensions[:, 6] > 1.0).any()
    assert len(found.slack) < 6 and "spring" not in {cable for _line, cable in found.slack}
    gains = next(one for one in found.effects if one.name == "drum_gain")
    assert "gain_7" not in str(vars(gains))
