"""Poses chosen from nothing but a robot, set-ups that read a part, and what else can be done."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_data import SIGMA, measured, soft_cogiro, term
from robots import THREE

import crosscheck
from crosscheck.errors import CrosscheckError
from crosscheck.fit.state import evaluate
from crosscheck.measurements.data import Sigma
from crosscheck.measurements.read import load_commands
from crosscheck.measurements.write import write_measurements
from crosscheck.planning.design import choose_poses, make_plan
from crosscheck.planning.places import detours
from crosscheck.planning.planned import Adding, Reads, planned
from crosscheck.planning.result import sight_of
from crosscheck.planning.room import Room
from crosscheck.planning.write import remark_of
from crosscheck.preparation.prepare import prepare
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import Terms
from seecr.equilibrium.solving import solve
from seecr.workspace.margins import feasible

pytestmark = pytest.mark.slow

PLANAR = load_robot(model_path("planar_vertical"))


@pytest.fixture(scope="module")
def cogiro():
    return soft_cogiro()


def power_of(plan):
    return {v.name: v.signal.power for v in plan.effects}


@pytest.fixture(scope="module")
def chosen():
    return choose_poses(PLANAR, 12)


def test_chosen_poses_are_held_in_runs(chosen):
    pose = chosen.command_pose
    assert chosen.n_rows == 12 and len(chosen.runs) == 3
    assert len(np.unique(pose.round(9), axis=0)) == 12
    assert feasible(PLANAR, pose).all() and solve(PLANAR, pose).converged.all()


def test_chosen_poses_show_more_than_as_many_along_a_sweep(chosen):
    line = np.tile(PLANAR.reference_pose, (12, 1))
    line[:, 0] += np.linspace(-0.1, 0.1, 12)
    taut = line + np.array([0.0, 0.0, 0.15, 0.0, 0.0, 0.0, 0.0])
    asked = choose_poses(PLANAR, 12, limits=(0.0, np.inf))

    def named(poses):
        plan = make_plan(PLANAR, replace(chosen, command_pose=poses))
        return sum(v.named for v in plan.effects)

    assert solve(PLANAR, line).slack.any() and not solve(PLANAR, taut).slack.any()
    assert named(chosen.command_pose) > named(taut)
    # slack cables, which are not chosen unasked, tell more effects apart
    assert named(asked.command_pose) > max(named(line), named(chosen.command_pose))


def test_tensions_stay_within_limits():
    low, high = 2.0, 6.0
    poses = choose_poses(PLANAR, 6, limits=(low, high)).command_pose
    tensions = solve(PLANAR, poses).tensions
    assert tensions.min() >= low and tensions.max() <= high
    wide = solve(PLANAR, choose_poses(PLANAR, 6).command_pose).tensions
    assert wide.min() < low or wide.max() > high  # without limits they do not


def test_a_set_up_sees_what_it_reads(cogiro):
    data = measured(cogiro, points=2)
    by = {
        kind: power_of(make_plan(cogiro, data, reads=[kind]))
        for kind in ("position", "orientation", "tension")
    }
    assert by["position"]["tracker_scale"] > 100.0
    assert "tracker_scale" not in by["orientation"] or by["orientation"]["tracker_scale"] == 0.0
    assert by["tension"]["platform_mass"] > 100.0 and by["tension"]["tracker_frame"] == 0.0
    whole = make_plan(cogiro, data, reads=["position", "orientation"])
    assert power_of(whole)["stiffness"] == pytest.approx(
        by["position"]["stiffness"] + by["orientation"]["stiffness"], rel=1e-6
    )
    assert any(
        s.kind is Adding.POSE for s in make_plan(cogiro, data, reads=["tension"]).suggestions
    )


def test_way_points_and_payloads_aside_are_proposed(cogiro, tmp_path):
    data = measured(cogiro, points=3)
    plan = planned(cogiro, data, SIGMA, Reads.of_kinds(cogiro.n_cables))
    found = {one.kind: one.plan.problem.data for one in detours(plan)}
    over = found[Adding.WAY_POINTS]
    assert np.array_equal(over.read, np.tile([False, True], data.n_rows))
    assert np.array_equal(over.command_pose[1::2], data.command_pose)
    assert feasible(cogiro, over.command_pose[::2][:6]).all()
    assert np.all(np.diff(over.t_s)[over.run[1:] == over.run[:-1]] > 0.0)
    assert np.array_equal(over.t_s[1::2], data.t_s)
    remark = remark_of(over)
    write_measurements(tmp_path / "add.csv", over, remark)
    line = load_commands(tmp_path / "add.csv", cogiro).line[~over.read]
    assert remark.endswith(f"without a reading: lines {', '.join(map(str, line))}")
    moved = np.linalg.norm(over.command_pose[::2, :3] - data.command_pose[:, :3], axis=1)
    assert moved.max() > 0.05
    aside = found[Adding.PAYLOAD_ASIDE].loads
    assert np.all(aside.mass > 0) and np.ptp(aside.centre[0] - cogiro.centre_of_mass) > 0.01


def test_a_run_that_starts_at_its_first_row_has_nothing_beyond_that(cogiro):
    """Its way point lay beyond the way from the reference pose, on which the run never was."""
    data = measured(cogiro, points=3)
    standing = replace(data, stands=np.ones(data.n_rows, dtype=bool))
    starts = data.as_commands(cogiro).starts
    anywhere = Room.of(cogiro, limits=(0.0, np.inf), box=[[-9.0] * 3, [9.0] * 3])

    def moved(one):
        plan = planned(cogiro, one, SIGMA, Reads.of_kinds(cogiro.n_cables))
        found = {item.kind: item.plan.problem.data for item in detours(plan, anywhere)}
        return found[Adding.WAY_POINTS].command_pose[::2, :3] - one.command_pose[:, :3]

    assert np.all(moved(standing)[starts] == 0.0) and np.any(moved(data)[starts] != 0.0)
    assert np.array_equal(moved(standing)[~starts], moved(data)[~starts])


def sight(robot, data):
    ready = prepare(robot, data, Terms())
    factor = ready.problem.noise(ready.problem.experiment.predict(ready.terms.effects))
    return sight_of(ready.problem, evaluate(ready.problem, ready.terms, factor), factor)


def test_what_data_can_show_is_known_before_any_verdict(cogiro):
    data = measured(cogiro, points=3)
    seen = sight(cogiro, data)
    words = " ".join(seen.lines())
    assert "thermal_expansion (needs the temperature, column temperature_C)" in words
    assert "platform_mass" in seen.alike["stiffness"]
    blurred = sight(cogiro, replace(data, sigma=Sigma(position_m=0.05, orientation_rad=0.5)))
    assert (
        "stiffness" in blurred.hidden and "too small compared with the noise" in blurred.lines()[1]
    )


def test_what_is_free_is_no_candidate_and_hides_what_it_imitates(cogiro):
    data = measured(cogiro, points=3)
    here = sight(cogiro, data)
    beside = sight(cogiro, replace(data, free=("tracker_frame",)))
    power = [{v.name: v.signal.power for v in one.effects} for one in (here, beside)]
    assert "tracker_frame" not in power[1]
    assert power[1]["initial_pose_error"] < 0.9 * power[0]["initial_pose_error"]


def test_a_diagnosis_begins_with_it(cogiro):
    found = crosscheck.diagnose(
        cogiro, measured(cogiro, [term(cogiro, "pulley_radius", radius_m=0.01)], points=3),
        only=["pulley_radius", "stiffness", "platform_mass"],
    )  # fmt: skip
    assert found.lines()[0].startswith("In these data 3 of 3 effects would be visible")
    assert "stiffness" in found.as_json()["can_show"]["cannot_be_told_from"]


def test_a_robot_that_holds_nowhere_is_told_and_a_box_keeps_poses_in(cogiro):
    with pytest.raises(crosscheck.CrosscheckError, match="can be held at 0 of 462 poses"):
        choose_poses(cogiro, 10, limits=(0.0, 1e-6))
    box = np.array([[0.3, 0.0, 0.1], [0.5, 0.0, 0.2]])
    pose = choose_poses(PLANAR, 6, box=box).command_pose
    assert np.all(pose[:, :3] >= box[0] - 1e-9) and np.all(pose[:, :3] <= box[1] + 1e-9)


def test_a_robot_that_holds_few_poses_is_planned_where_it_rests():
    """With no more cables than freedoms it comes near the others: they were refused once."""
    assert feasible(THREE, choose_poses(THREE, 18).command_pose).sum() < 18


def test_a_point_mass_on_a_free_joint_is_told_its_cure() -> None:
    """Neither fewer rows nor another box would help."""
    loose = replace(load_robot("camera"), joints=())
    with pytest.raises(
        CrosscheckError, match="expected 10 or more; all cables are anchored at one"
    ):
        choose_poses(loose, 10)
