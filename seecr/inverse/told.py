"""Lengths to command so that the winches pay out given lengths: the winch laws, inverted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from seecr.commands import Commands
from seecr.description.robot import Robot
from seecr.effects.base import Effect
from seecr.inverse.aitken import to_their_limit
from seecr.pose import Array
from seecr.prediction.experiment import Experiment

# Most iterations; eccentric drums need several, gains and offsets one. Every so-many-th ends at the
# limit of the last changes: where the run-out is nearly a drum's radius, few angles pay out much.
_ROUNDS, _EVERY = 60, 3


def told_lengths(robot: Robot, commands: Commands, effects: Sequence[Effect], paid: Array) -> Array:
    """Lengths to command so that the winches pay out given rest lengths.

    Args:
        robot: as described.
        commands: of n rows, for their runs, times and temperatures; their lengths are ignored.
        effects: of the winches, among others.
        paid: (n, m) [m] rest lengths wanted.

    Returns:
        (n, m) [m] told lengths (``Commands.told``): at the reference pose, those of the plain
        robot.
    """
    told, last, before = paid.copy(), np.inf, np.zeros_like(paid)
    for number in range(1, _ROUNDS + 1):
        trial = replace(commands, lengths=told, told=True, passed=None)
        setup = Experiment(robot, trial).setup(effects)
        # the length without any turn of the winch, then what its turning adds
        pretension = robot.rest_lengths - robot.reference_lengths
        zero = setup.geometric_lengths(setup.zero_pose[None]) + pretension
        turned = paid / setup.length_factor - zero - setup.extra_length
        turned = turned / (1.0 + setup.length_gain)
        if np.any(setup.backlash):
            turned = unplay(turned, commands.starts, 0.5 * setup.backlash)
        step = robot.rest_lengths + turned - told
        change = float(np.max(np.abs(step), initial=0.0))
        told = told + (step if number % _EVERY else to_their_limit(step, before))
        before = step
        if change <= 1e-15 * float(np.max(np.abs(told), initial=0.0)) or change >= last:
            break
        last = change if change < 1e-9 else np.inf
    return told


def unplay(wanted: Array, starts: NDArray[np.bool_], half_width: Array) -> Array:
    """Inputs (n, m) of the play operator whose outputs are the given (n, m).

    The inverse of play is a jump at each reversal (Krejci and Kuhnen, IEE Proceedings 148, 2001).
    While an output is constant, so is its input.

    Args:
        starts: (n,) rows before which input and output were zero.
        half_width: (m,).
    """
    out, side = np.empty_like(wanted), np.zeros(wanted.shape[1])
    before = np.zeros(wanted.shape[1])
    for k in range(len(wanted)):
        if starts[k]:
            side[:], before = 0.0, np.zeros_like(before)
        moved = np.sign(wanted[k] - before)
        side = np.where(moved == 0.0, side, moved)
        out[k], before = wanted[k] + side * half_width, wanted[k]
    return out
