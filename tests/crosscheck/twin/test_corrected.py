"""Corrected commands in MuJoCo: a robot with the effects comes to the poses wanted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crosscheck.settle.settler import Settler
from crosscheck.suite.cases import demobot_sweep
from crosscheck.twin.measure import measure
from seecr.commands import Commands
from seecr.description.mjcf import CABLES, load_robot, model_path
from seecr.effects import Term
from seecr.inverse.correction import correct
from seecr.pose import pose_difference
from seecr.workspace.margins import feasible


@pytest.mark.parametrize("cable", CABLES)
def test_the_papers_sweep_is_level_and_straight(cable: str) -> None:
    path = model_path("demobot_cogiro")
    settler = Settler(path, ea=CABLES[cable])
    robot = load_robot(path)
    robot = replace(robot, ea=np.full(robot.n_cables, CABLES[cable]))
    found = correct(robot, demobot_sweep(0.1, 5))
    assert found.reached.all()
    for want, rest in zip(found.wanted, found.solution.rest_lengths, strict=True):
        settling = settler.settle(want, rest_lengths=rest)
        assert settling.settled
        assert np.abs(pose_difference(settling.pose, want)).max() < 1e-9


def test_told_lengths_lead_a_robot_with_effects_to_the_poses() -> None:
    robot = load_robot(model_path("demobot_parallel"))
    effects = [
        Term.of(robot, "drum_gain", **{f"gain_{i}": 0.002 * i for i in range(1, 9)}),
        Term.of(robot, "pulley_radius", radius_m=0.008),
        Term.of(robot, "stiffness", factor=0.4),
    ]
    poses = demobot_sweep(0.2, 24)
    poses = poses[feasible(robot, poses)]
    assert len(poses) > 8
    plain = measure(robot, Commands(poses), [term.effect() for term in effects])
    found = correct(robot, poses[1:-1], effects=effects)
    assert found.reached.all()
    truth = measure(robot, found.commands, [term.effect() for term in effects])
    assert truth.at_rest.all()
    assert np.abs(pose_difference(plain.pose, poses)[:, :3]).max() > 1e-4
    assert np.abs(pose_difference(truth.pose, found.wanted)).max() < 1e-9


@pytest.mark.slow
def test_with_a_memory_a_micrometre_is_left() -> None:
    robot = load_robot(model_path("demobot_cogiro"))
    effects = [
        Term.of(robot, "backlash", gap_m=1e-3),
        Term.of(robot, "hysteresis", amplitude_N=0.05, stretch_m=3e-4),
    ]
    there = demobot_sweep(0.15, 5)
    found = correct(robot, Commands(np.concatenate([there, there[::-1]])), effects=effects)
    truth = measure(robot, found.commands, [term.effect() for term in effects])
    assert truth.at_rest.all()
    assert np.abs(pose_difference(truth.pose, found.wanted)[:, :3]).max() < 1e-6
