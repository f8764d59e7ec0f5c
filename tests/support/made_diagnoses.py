"""Diagnoses made for tests: one of each verdict, on a planar robot that is quick to solve."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from made_data import measured, term

from crosscheck.diagnosis.diagnose import diagnose as diagnose_with
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.measurements.data import Measurements, Sigma
from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot

SIGMA = Sigma(position_m=3e-5, orientation_rad=3.5e-4, tension_N=0.03)
POINTS = 6
# What takes most of the time of a diagnosis: what is told of one does not depend on them.
SLOW = ("backlash", "creep", "exit_friction", "hysteresis", "cable_weight", "drum_eccentricity")


def diagnose(robot: Robot, data: Measurements) -> Diagnosis:
    """A diagnosis without the effects that take long to try."""
    return diagnose_with(robot, data, exclude=SLOW)


@cache
def robot() -> Robot:
    """Four cables in a vertical plane."""
    return load_robot(model_path("planar_vertical"))


def readings(**radius: float) -> Measurements:
    """Poses and tensions of the robot, with pulleys of ``radius_m`` if given."""
    terms = [term(robot(), "pulley_radius", **radius)] if radius else []
    return measured(robot(), terms, points=POINTS, sigma=SIGMA, tensions=True)


@cache
def pulleys() -> Diagnosis:
    """effects_found: pulley_radius."""
    return diagnose(robot(), readings(radius_m=0.01))


@cache
def nothing() -> Diagnosis:
    """no_effect_missing."""
    return diagnose(robot(), readings())


@cache
def unknown() -> Diagnosis:
    """unknown_effect: a wave along x that no effect makes."""
    data = readings()
    assert data.position is not None and data.command_pose is not None
    wave = 1e-3 * np.sin(60.0 * data.command_pose[:, 0])
    return diagnose(robot(), replace(data, position=data.position + wave[:, None] * [0, 0, 1.0]))


@cache
def none() -> Diagnosis:
    """no_verdict: every command is the same."""
    data = readings()
    assert data.command_pose is not None
    still = np.tile(data.command_pose[:1], (data.n_rows, 1))
    return diagnose(robot(), replace(data, command_pose=still))


@cache
def position_only() -> Diagnosis:
    """Positions and nothing else."""
    data = readings(radius_m=0.01)
    blank = np.full_like(data.tensions, np.nan)
    return diagnose(robot(), replace(
        data, quat_wxyz=None, tensions=blank))  # fmt: skip


@cache
def tensions_only() -> Diagnosis:
    """Tensions and nothing else."""
    data = readings(radius_m=0.01)
    blank = np.full_like(data.position, np.nan)
    return diagnose(robot(), replace(
        data, quat_wxyz=None, position=blank))  # fmt: skip


@cache
def one_angle() -> Diagnosis:
    """The angle in the plane and nothing else."""
    data = readings()
    rng = np.random.default_rng(4)
    angles = np.full((data.n_rows, 3), np.nan)
    angles[:, 1] = SIGMA.orientation_rad * rng.standard_normal(data.n_rows)
    from seecr.commands import Commands
    from seecr.pose import rxyz_from_quat
    from seecr.prediction.experiment import Experiment

    exact = Experiment(robot(), Commands(data.command_pose)).predict().readings
    angles[:, 1] += rxyz_from_quat(exact.quat_wxyz)[:, 1]
    return diagnose(robot(), replace(
        data, quat_wxyz=None, position=np.full_like(data.position, np.nan),
        angles_rad=angles, tensions=np.full_like(data.tensions, np.nan)))  # fmt: skip
