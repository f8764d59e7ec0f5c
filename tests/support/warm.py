"""Everything compiled, or loaded if it was before: a minute, or a second."""

from __future__ import annotations

import numpy as np

import seecr
from seecr.commands import Commands
from seecr.inverse.in_place import turned_in_place
from seecr.pose import changes_between, moved_by, rotated
from seecr.prediction.experiment import Experiment
from seecr.prediction.sensitivity import sensitivities
from seecr.statics.tables import assemble
from seecr.tensions.balance import straight_balance
from seecr.tensions.distribution import can_balance, distribute, innermost
from seecr.workspace.margins import tension_margin

# What a walk, a change of all and a change of each cable are needed for.
EFFECTS = {
    "hysteresis": {"amplitude_N": 0.1, "stretch_m": 1e-3},
    "pulley_radius": {"radius_m": 0.01},
    "cable_length_offset": {},
}


def compile_all() -> None:
    """Each compiled function has one signature."""
    compile_rests()
    compile_margins()
    compile_lengths()


def compile_rests() -> None:
    """Solve, predict and derive a little."""
    robot = seecr.load_robot(seecr.model_path("planar_vertical"))
    poses = np.tile(robot.reference_pose, (2, 1))
    wrench = np.array([0.0, 0.0, 0.0, 0.0, 1e-6, 0.0])
    seecr.solve(robot, poses, wrench=wrench)
    commands = Commands(poses, run=np.zeros(2, dtype=int), time=np.array([0.0, 1.0]))
    experiment = Experiment(robot, commands)
    for name, values in EFFECTS.items():
        terms = seecr.Terms([seecr.Term.of(robot, name, **values)])
        sensitivities(experiment, terms, experiment.predict(terms.effects))
    changes_between(moved_by(poses, np.zeros(6)), poses)
    rotated(poses[:, 3:], poses[:, :3])


def compile_margins() -> None:
    """Margins and distributions of tensions, which need nothing of the rest."""
    # jointed and free platforms have margins by functions of their own
    for name in ("planar_vertical", "demobot_parallel"):
        robot = seecr.load_robot(seecr.model_path(name))
        tension_margin(robot, robot.reference_pose)
    one, few = np.ones((1, 1)), np.ones((1, 2))
    distribute(one[None], one, one, 0.0 * one, 2.0 * one)
    can_balance(few[None], one, 0.0 * few, 2.0 * few, one[0])
    innermost(few[None], one, 0.0 * few, 2.0 * few, one[0])
    compile_turning()


def compile_lengths() -> None:
    """Lengths for poses, one of them out of reach, of cables that hang or stick; a softest way."""
    robot = seecr.load_robot(seecr.model_path("planar_vertical"))
    poses = np.tile(robot.reference_pose, (2, 1))
    poses[1, 2] += 9.0
    heavy = seecr.Term.of(robot, "cable_weight", weight_N_per_m=1e-3)
    sticking = seecr.Term.of(robot, "exit_friction", friction=0.1, length_m=1.0)
    for effects in ([], [heavy], [sticking]):
        seecr.correct(robot, poses, effects=effects)
    free = seecr.load_robot(seecr.model_path("demobot_parallel"))
    _ = seecr.solve(free, free.reference_pose).softest_direction


def compile_turning() -> None:
    """Orientations of a robot with fewer cables than freedoms, and the balance at any pose."""
    robot = seecr.load_robot(seecr.model_path("planar_two_cable"))
    poses = np.tile(robot.reference_pose, (2, 1))
    tables, low = assemble(Experiment(robot, Commands(poses)).setup([])), np.zeros((2, 2))
    turned_in_place(robot, tables, low, low + np.inf)
    straight_balance(tables, np.arange(2), np.zeros((2, robot.n_dof)))
