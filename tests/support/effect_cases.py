"""Robots, commands and effects with random values, and derivatives by solving everything twice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from random_robots import random_poses, random_robot

from seecr.commands import Commands
from seecr.compiled.columns import GAP, REST
from seecr.description.mjcf import load_robot, model_path
from seecr.description.robot import Robot
from seecr.effects import Effect, Term, Terms, effect_named, layout_of
from seecr.prediction.experiment import Experiment, Prediction
from seecr.prediction.sensitivity import readings_difference
from seecr.statics.tables import Tables

# The last is commanded in lengths.
KINDS = ("demobot_cogiro", "demobot_parallel", "planar_vertical", "lengths")
SHIPPED = KINDS[:3]


def robot_of(kind: str, seed: int = 0) -> Robot:
    if kind in SHIPPED:
        return load_robot(model_path(kind))
    if kind == "lengths":
        return load_robot(model_path("demobot_cogiro"))
    return random_robot(np.random.default_rng(seed), kind)


def experiment_of(kind: str, seed: int = 0, rows: int = 6, reach: float = 1.0) -> Experiment:
    """Two runs with a clock and a thermometer, somewhere near the reference pose."""
    rng = np.random.default_rng(1000 + seed)
    robot = robot_of(kind, seed)
    poses = random_poses(rng, robot, rows)
    if reach != 1.0:
        poses[:, :3] = robot.reference_pose[:3] + reach * (poses[:, :3] - robot.reference_pose[:3])
    return Experiment(robot, Commands(
        poses,
        lengths=robot.commanded_lengths(poses) if kind == "lengths" else None,
        run=np.repeat([0, 1], [rows // 2, rows - rows // 2]),
        time=np.cumsum(rng.uniform(1, 20, rows)),
        temperature=20 + rng.uniform(-5, 5, rows),
    ))  # fmt: skip


def lengthened(tables: Tables, by: float) -> Tables:
    """The same tables with every cable longer by a length [m]."""
    cables = tables.cables.copy()
    cables[..., REST] += by
    cables[..., GAP] -= by
    return replace(tables, cables=cables)


def random_term(
    rng: np.random.Generator, experiment: Experiment, name: str, part: float = 0.3
) -> Term:
    """An effect of about ``part`` of its expected size, shapes where a search would start."""
    layout = layout_of(effect_named(name), experiment.robot)
    sign = np.where(layout.lower >= layout.null, 1.0, rng.choice([-1.0, 1.0], len(layout)))
    if name == "nonlinear_elasticity":
        sign = np.ones(len(layout))  # a cable that softens this much would not hold the platform
    vector = layout.null + part * layout.scale * rng.uniform(0.3, 1.0, len(layout)) * sign
    shapes = layout.effect.shapes(experiment.setup([]))
    started = layout.start(shapes[len(shapes) // 2] if shapes else {})
    vector = np.where(layout.shape, started, vector)
    return Term(layout, np.clip(vector, layout.lower, layout.upper))


def random_effect(experiment: Experiment, name: str, seed: int = 0, part: float = 0.3) -> Effect:
    return random_term(np.random.default_rng(seed), experiment, name, part).effect()


def moved(experiment: Experiment, effects: Sequence[Effect]) -> np.ndarray:
    """How the readings differ from the plain robot's, (n, 6 + m) [m, rad, N]."""
    there, plain = experiment.predict(effects), experiment.predict()
    assert np.all(there.solved) and np.all(plain.solved)
    return readings_difference(there.readings, plain.readings)


def full_difference(
    experiment: Experiment, terms: Terms, term: Term, k: int, step: float
) -> np.ndarray:
    """Derivative of the readings (n, 6 + m) by a parameter, everything solved again at +-step."""

    def at(value: float) -> Prediction:
        vector = term.vector.copy()
        vector[k] = value
        shifted = terms.with_term(Term(term.layout, vector))
        found = experiment.predict(shifted.effects)
        assert np.all(found.solved)
        return found

    value = float(term.vector[k])
    ahead, behind = at(value + step), at(value - step)
    return readings_difference(ahead.readings, behind.readings) / (2 * step)


def worst_mismatch(experiment: Experiment, terms: Terms, found: np.ndarray) -> tuple[float, str]:
    """Largest error of sensitivities (n, 6 + m, p) against full differences, and whose it is.

    In parts of the largest change of that kind of reading when the parameter changes by its
    expected size; changes below a millionth of the robot's length, a microradian or a millionth
    of its weight are nobody's.
    """
    robot = experiment.robot
    kinds = ((slice(0, 3), robot.length), (slice(3, 6), 1.0), (slice(6, None), robot.weight))
    worst, whose, column = 0.0, "", 0
    for term in terms:
        layout = term.layout
        for k in range(len(layout)):
            relative = bool(layout.shape[k]) and layout.lower[k] > 0
            size = float(term.vector[k] if relative else layout.scale[k])
            # of another size than the differences found rest on; below, rounding of the solved
            # rows (1e-13 of the load) shows in steps of readings that barely change
            full = full_difference(experiment, terms, term, k, 5e-5 * size if relative else
                                   1e-4 * size)  # fmt: skip
            for part, unit in kinds:
                largest = max(np.abs(full[:, part]).max() * size, 1e-6 * unit)
                error = np.abs(found[:, part, column] - full[:, part]).max() * size / largest
                if error > worst:
                    worst, whose = error, f"{layout.name} {layout.names[k]} readings {part}"
            column += 1
    return worst, whose
