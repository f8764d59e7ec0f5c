"""Measurements made for tests: the statics' own prediction with known effects, plus noise."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.write import write_measurements
from crosscheck.twin.lab import trajectory
from seecr.commands import Commands, Loads
from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot
from seecr.effects import Term, Terms, effect_named, layout_of
from seecr.pose import quat_from_rotvec, quat_multiply
from seecr.prediction.experiment import Experiment

COGIRO = model_path("demobot_cogiro")
SIGMA = Sigma(position_m=3e-5, orientation_rad=3.5e-4)


def soft_xml() -> str:
    """The Cogiro DemoBot on fishing line: a tenth of the stiffness."""

    def softer(match: re.Match[str]) -> str:
        return f'stiffness="{0.1 * float(match.group(1))!r}"'

    return re.sub(r'stiffness="([0-9.e+-]+)"', softer, COGIRO.read_text(encoding="utf-8"))


def soft_cogiro() -> Robot:
    """The same as a robot."""
    robot = load_robot(COGIRO)
    return replace(robot, ea=0.1 * robot.ea)


def term(robot: Robot, name: str, **values: float) -> Term:
    """An effect with some parameters, the others at null."""
    layout = layout_of(effect_named(name), robot)
    vector = layout.null.copy()
    for key, value in values.items():
        vector[layout.names.index(key)] = value
    return Term(layout, vector)


def measured(
    robot: Robot,
    terms: Sequence[Term] = (),
    *,
    points: int = 8,
    sigma: Sigma = SIGMA,
    seed: int = 0,
    tensions: bool = False,
    loads: Loads | None = None,
) -> Measurements:
    """What a tracker with noise would read of a robot with these effects, and loads unknown."""
    way = trajectory(robot, points)
    run = np.unique(way.run, return_inverse=True)[1]
    experiment = Experiment(robot, Commands(way.pose, run=run, time=way.t_s, loads=loads))
    found = experiment.predict(Terms(terms).effects)
    assert np.all(found.solved)
    rng = np.random.default_rng(seed)
    n = len(way.pose)
    turn = quat_from_rotvec(sigma.orientation_rad * rng.standard_normal((n, 3)))
    pull = None
    if tensions:
        pull = found.readings.tensions + sigma.tension_N * rng.standard_normal(
            found.readings.tensions.shape
        )
    return Measurements(
        path=Path("measured.csv"),
        n_cables=robot.n_cables,
        run=way.run,
        command_pose=way.pose,
        t_s=way.t_s,
        position=found.readings.position + sigma.position_m * rng.standard_normal((n, 3)),
        quat_wxyz=quat_multiply(turn, found.readings.quat_wxyz),
        tensions=pull,
        sigma=sigma,
    )


def case(
    folder: Path, effects: Mapping[str, Mapping[str, float]] | None = None, **options: object
) -> tuple[Path, Path]:
    """A robot's MJCF and its measurements with these effects, as files."""
    xml = folder / "robot.xml"
    xml.write_text(soft_xml(), encoding="utf-8")
    robot = load_robot(xml)
    terms = [term(robot, name, **values) for name, values in (effects or {}).items()]
    data = folder / "measured.csv"
    write_measurements(data, measured(robot, terms, **options))  # type: ignore[arg-type]
    return xml, data
