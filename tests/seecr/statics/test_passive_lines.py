"""Lines that no winch drives, where the platform rests: against energy minima by SciPy."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from passive_files import FOLDER, KINDS, LINE, Energy

import seecr
from seecr.effects import Terms
from seecr.pose import quat_rotate, rotvec_from_quat
from seecr.prediction.experiment import Experiment
from seecr.prediction.sensitivity import readings_difference
from seecr.statics import batch
from seecr.statics.tables import assemble

PLANAR = [[0.0, 0.0, 0.0], [0.3, 0.2, 0.0], [-0.4, -0.1, 0.0]]
FREE = [[0.0] * 6, [0.2, -0.1, 0.1, 0.0, 0.0, 0.0], [-0.25, 0.1, 0.25, 0.05, -0.04, 0.1]]


def commands_of(kind: str) -> np.ndarray:
    return np.array(PLANAR if kind == "band" else FREE)


def robot_of(kind: str) -> seecr.Robot:
    return seecr.load_robot(FOLDER / f"{kind}.xml")


def commanded(kind: str) -> np.ndarray:
    energy = Energy(FOLDER / f"{kind}.xml")
    return np.stack([energy.pose(x) for x in commands_of(kind)])


@pytest.mark.parametrize("kind", KINDS)
def test_rests_are_minima_of_the_energy(kind: str) -> None:
    energy, robot = Energy(FOLDER / f"{kind}.xml"), robot_of(kind)
    found = seecr.solve(robot, commanded(kind))
    assert found.converged.all()
    for k, command in enumerate(commands_of(kind)):
        place, turn, tensions = energy.rest(command)
        np.testing.assert_allclose(found.pose[k, :3], place, atol=1e-8)
        np.testing.assert_allclose(rotvec_from_quat(found.pose[k, 3:]), turn, atol=1e-7)
        np.testing.assert_allclose(found.tensions[k], tensions, atol=1e-4)
    passive = robot.cable_names.index(LINE[kind])
    assert not found.slack[:, passive].any()
    if kind == "spring":
        assert found.tensions[0, passive] < -9.0, "it is compressed at one pose"
        assert found.tensions[2, passive] > 1.0, "and stretched at another"


@pytest.mark.parametrize("kind", KINDS)
def test_many_rests_are_those_of_each(kind: str) -> None:
    """Batches of many rows are written and descended in another way, which had no such lines."""
    robot, few = robot_of(kind), commanded(kind)
    many, alone = seecr.solve(robot, np.tile(few, (40, 1))), seecr.solve(robot, few)
    assert many.converged.all()
    np.testing.assert_allclose(many.tensions, np.tile(alone.tensions, (40, 1)), atol=1e-6)
    np.testing.assert_allclose(many.pose, np.tile(alone.pose, (40, 1)), atol=1e-9)


def test_a_constant_tension_with_slack_cables(tmp_path: Path) -> None:
    text = (FOLDER / "counterweight.xml").read_text().replace("weight=25N", "weight=0.055kN")
    (tmp_path / "robot.xml").write_text(text)
    robot = seecr.load_robot(tmp_path / "robot.xml")
    (tmp_path / "same.xml").write_text(text.replace("0.055kN", "55N"))
    command = np.array([0.4, 0.3, 0.2, 0.0, 0.0, 0.0])
    energy = Energy(tmp_path / "same.xml")
    found = seecr.solve(robot, energy.pose(command))
    place, turn, tensions = energy.rest(command)
    assert found.converged[0] and found.slack[0, :8].any() and not found.slack[0, 8]
    np.testing.assert_allclose(found.pose[0, :3], place, atol=1e-8)
    np.testing.assert_allclose(rotvec_from_quat(found.pose[0, 3:]), turn, atol=1e-7)
    np.testing.assert_allclose(found.tensions[0], tensions, atol=1e-4)
    assert found.tensions[0, 8] == 55.0


@pytest.mark.parametrize("kind", KINDS[1:])
def test_stiffness_and_energy_belong_to_the_forces(kind: str) -> None:
    """The gradient is the slope of the energy, and the stiffness that of the gradient."""
    robot = robot_of(kind)
    tables = assemble(Experiment(robot, seecr.Commands(commanded(kind)[1:2])).setup(()))
    at, step = batch.descend(tables), 1e-6
    base = batch.evaluate(tables, at)

    def beside(k: int, step: float) -> batch.Evaluation:
        moved = at.there()
        moved.deviation[0, k] += step
        return batch.evaluate(tables, moved)

    for k in range(3):
        ahead, behind = beside(k, step), beside(k, -step)
        slope = (ahead.energy[0] - behind.energy[0]) / (2 * step)
        bend = (ahead.gradient[0] - behind.gradient[0])[:3] / (2 * step)
        assert slope == pytest.approx(base.gradient[0, k], abs=1e-6)
        np.testing.assert_allclose(bend, base.hessian[0, k, :3], rtol=1e-5, atol=1e-3)


WINCHES = {
    "cable_length_offset": "offset", "drum_gain": "gain", "length_scale": "factor",
    "drum_eccentricity": "sine", "backlash": "gap", "winch_side_length": "length",
    "pulley_radius": "radius", "nonlinear_elasticity": "cubic", "cable_weight": "weight",
    "hysteresis": "amplitude", "creep": "amount", "frame_compliance": "sideways",
    "stiffness": "factor", "exit_friction": "length", "thermal_expansion": "expansion",
    "initial_pose_error": "position",
}  # fmt: skip


@pytest.mark.parametrize("name", WINCHES)
def test_effects_of_winches_and_their_ropes_leave_passive_lines_alone(name: str) -> None:
    """They do something, and what the passive line pulls with is what its length says."""
    robot = robot_of("band")
    n = 3
    commands = seecr.Commands(
        commanded("band"), run=np.zeros(n, dtype=np.int64), time=np.arange(n) * 100.0,
        temperature=np.array([10.0, 25.0, 40.0]),
    )  # fmt: skip
    layout = seecr.layout_of(name, robot)
    vector = np.where(layout.shape, layout.null, layout.null + 0.5 * layout.scale)
    term = seecr.Term(layout, vector)
    plain, found = seecr.predict(robot, commands), seecr.predict(robot, commands, [term])
    assert found.solved.all()
    assert np.abs(found.pose - plain.pose).max() > 1e-8, "it does something"
    energy = Energy(FOLDER / "band.xml")
    k, l0 = energy.lines[2][4][0], energy.lines[2][3][-1]
    for row in range(n):
        place, quat = found.pose[row, :3], found.pose[row, 3:]
        anchor = place + quat_rotate(quat, energy.lines[2][2])
        pull = k * (np.linalg.norm(anchor - energy.lines[2][1]) - l0)
        assert found.tensions[row, 2] == pytest.approx(pull, abs=1e-9)


def test_points_and_stiffness_of_passive_lines_can_be_wrong() -> None:
    robot, poses = robot_of("spring"), commanded("spring")
    terms = [
        seecr.Term.of(robot, "exit_point_error", error_7_z_m=0.02, error_1_x_m=0.001),
        seecr.Term.of(robot, "cable_stiffness", factor_7=0.5),
    ]
    found = seecr.predict(robot, poses, terms)
    moved = robot.exit_points.copy()
    moved[6, 2] += 0.02
    moved[0, 0] += 0.001
    ea = robot.ea * np.array([1.0] * 6 + [0.5])
    # told lengths keep to the cables as they really ran at the reference pose
    other = replace(robot, exit_points=moved, ea=ea)
    lengths = robot.commanded_lengths(poses)
    lengths[:, :6] += (other.reference_lengths - robot.reference_lengths)[:6]
    np.testing.assert_allclose(found.pose, seecr.solve(other, rest_lengths=lengths).pose, atol=1e-9)


@pytest.mark.parametrize(("name", "driven"), [("drum_gain", 6), ("drum_eccentricity", 12)])
def test_passive_lines_have_no_parameters_of_winches(name: str, driven: int) -> None:
    layout = seecr.layout_of(name, robot_of("spring"))
    own = [key for key in layout.names if key[-1].isdigit() or key.split("_")[1].isdigit()]
    assert len(own) == driven and not [key for key in own if "_7" in key]
    with pytest.raises(seecr.InputError, match="gain_7"):
        seecr.Term.of(robot_of("spring"), "drum_gain", gain_7=0.01)
    stiffness = seecr.layout_of("cable_stiffness", robot_of("counterweight"))
    assert len(stiffness.names) == 8, "a constant tension has no stiffness"
    assert len(seecr.layout_of("cable_stiffness", robot_of("spring")).names) == 7


@pytest.mark.parametrize("kind", KINDS)
def test_sensitivities_are_differences_of_predictions(kind: str) -> None:
    robot, poses = robot_of(kind), commanded(kind)
    names = ("drum_gain", "cable_stiffness", "anchor_point_error", "exit_point_error")
    terms = Terms([seecr.Term.of(robot, name) for name in names])
    experiment = Experiment(robot, seecr.Commands(poses))
    found = seecr.sensitivities(experiment, terms, experiment.predict(terms.effects))
    for k, scale in enumerate(np.concatenate([term.layout.scale for term in terms])):
        step = 1e-3 * scale * np.eye(len(terms))[k]
        ahead, behind = (
            experiment.predict(terms.with_vector(terms.vector + sign * step).effects).readings
            for sign in (0.5, -0.5)
        )
        apart = readings_difference(ahead, behind) / (1e-3 * scale)
        for part in (slice(0, 6), slice(6, None)):
            most = 2e-3 * np.abs(apart[:, part]).max() + 1e-7
            np.testing.assert_allclose(found[:, part, k], apart[:, part], atol=most)


def test_lengths_are_those_of_the_driven_cables() -> None:
    robot, poses = robot_of("spring"), commanded("spring")
    found = seecr.solve(robot, poses)
    again = seecr.solve(robot, poses, rest_lengths=found.rest_lengths)
    few = seecr.solve(robot, poses, rest_lengths=found.rest_lengths[:, :6])
    blind = seecr.solve(robot, rest_lengths=found.rest_lengths[:, :6])
    for other in (again, few, blind):
        np.testing.assert_allclose(other.pose, found.pose, atol=1e-9)
    wrong = found.rest_lengths.copy()
    wrong[:, 6] += 0.1
    with pytest.raises(seecr.InputError, match="no winch drives spring"):
        seecr.solve(robot, rest_lengths=wrong)


def test_a_hung_object_is_not_moved_by_commands() -> None:
    robot = replace(robot_of("band"), driven=np.zeros(3, dtype=bool))
    assert robot.notes[-1].endswith("; commands move nothing")
    found = seecr.solve(robot, commanded("band"), start=np.tile(robot.reference_pose, (3, 1)))
    assert found.converged.all()
    np.testing.assert_allclose(found.pose, np.tile(found.pose[0], (3, 1)), atol=1e-9)
    with pytest.raises(seecr.InputError, match="no winch drives any of its lines"):
        seecr.correct(robot, commanded("band"))
    with pytest.raises(seecr.InputError, match="no winch drives any of its lines"):
        seecr.feasible(robot, commanded("band"))
