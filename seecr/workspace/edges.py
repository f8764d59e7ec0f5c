"""The boundary of the workspace, and the probability that poses near it can be held."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.description.mjcf import GivenRobot, robot_of
from seecr.description.robot import Robot
from seecr.effects.terms import Terms
from seecr.errors import InputError
from seecr.inverse.correction import margins_in_place
from seecr.pose import Array
from seecr.prediction.experiment import Experiment, effects_of
from seecr.prediction.model import GivenEffects, Model, model_given
from seecr.prediction.sensitivity import sensitivities
from seecr.prediction.uncertainty import moving_covariance
from seecr.statics.starts import Commanded, commanded_poses, commands_from
from seecr.tensions.distribution import tension_limits
from seecr.workspace.margins import is_held, load_scale, tension_margin


def margins_at(
    robot: Robot, poses: Array, lowest: ArrayLike, highest: ArrayLike,
    wrenches: ArrayLike | None, effects: GivenEffects, thorough: bool = True,
) -> Array:  # fmt: skip
    """Margins (n,) [N]; robots with too few cables are solved for the orientation.

    Theirs are those of the best orientation found, and minus infinity if there is none, after a
    search that is ``thorough`` or not.
    """
    acting = effects_of(effects, robot)
    if robot.n_driven >= robot.n_dof:
        return tension_margin(
            robot, poses, lowest=lowest, highest=highest, wrenches=wrenches, effects=acting
        )
    if wrenches is not None:
        raise InputError(
            f"{robot.name} has fewer cables than degrees of freedom, so it holds no set of "
            "wrenches; expected none"
        )
    return margins_in_place(robot, poses, acting, lowest, highest, thorough)


def read_once(effects: GivenEffects, robot: Robot) -> GivenEffects:
    """The same effects, but a model's file is read: every part of a map needs it."""
    return model_given(effects, robot) if isinstance(effects, str | Path) else effects


# Probabilities that poses are held and tensions stay within limits, from a model's covariance.

# Number of draws of the parameters for tensions, which are linear in them.
_LINEAR = 4096
# Number of draws for poses, stage by stage. If the draws so far all agree, and their mean lies this
# many of their standard deviations from the limit, the rest is left out: few draws may happen to
# lie near each other.
_STAGES = ((4, 15.0), (16, 6.0), (64, 4.0), (256, 0.0))
# Rows per batch.
_PART = 64
_NO_COVARIANCE = (
    "probabilities need a model with its covariance; expected a table [calibration] or [fit], "
    "which crosscheck calibrate always writes, and add and diagnose if the data determine every "
    "value"
)


def kept_chance(
    robot: GivenRobot,
    commands: Commanded,
    model: Model | str | Path,
    *,
    lowest: ArrayLike = 0.0,
    highest: ArrayLike = np.inf,
) -> Array | None:
    """The probability that all tensions stay within limits, given the uncertainty of the model.

    Tensions are to first order in the parameters. A taut cable that would go slack violates a limit
    of zero; a slack cable stays slack.

    Args:
        robot: as described, or its MJCF.
        commands: n rows as in :func:`seecr.predict`, such as those of a correction; NaN lengths
            mark rows without any.
        model: as ``crosscheck calibrate`` writes it, or its file.
        lowest, highest: (m,) or one [N].

    Returns:
        (n,), NaN for a row without equilibrium; None if the model keeps no covariance.

    Raises:
        InputError: wrong shapes, or limits that contradict each other.
        InputFileError: no such file, or no model of this robot in it.

    Example:
        ``seecr.kept_chance(robot, poses, "model.toml", highest=50.0)``
    """
    robot = robot_of(robot)
    known = moving_covariance(model_given(model, robot))
    if known is None:
        return None
    terms, covariance = known
    commands = commands_from(commands, robot)
    low, high = tension_limits(robot, lowest, highest)
    lost: NDArray[np.bool_] = np.zeros(len(commands), dtype=bool)
    if commands.lengths is not None:
        lost |= np.isnan(commands.lengths).any(axis=1)
        plain = robot.commanded_lengths(commands.pose)
        lengths = np.where(lost[:, None], plain, commands.lengths)
        commands = replace(commands, lengths=lengths)
    experiment = Experiment(robot, commands)
    at = experiment.predict(terms.effects)
    drawn = _drawn(terms, covariance, _LINEAR) - terms.vector
    out = np.ones(len(commands))
    room = 1e-9 * load_scale(robot)
    slopes = np.zeros((len(out), robot.n_cables, 0))
    if len(terms):
        slopes = sensitivities(experiment, terms, at)[:, 6:]
    for first in range(0, len(out), _PART):
        rows = slice(first, first + _PART)
        tensions = at.tensions[rows, None] + np.einsum("nmp,kp->nkm", slopes[rows], drawn)
        lines, falls = tensions[..., robot.driven], robot.falls[robot.driven]
        kept = (lines >= low / falls - room) & (lines <= high / falls + room)
        out[rows] = kept.all(axis=2).mean(axis=1)
    out[lost | ~at.solved] = np.nan
    return out


def held_chance(
    robot: GivenRobot,
    poses: ArrayLike,
    model: Model | str | Path,
    *,
    lowest: ArrayLike = 0.0,
    highest: ArrayLike = np.inf,
    wrenches: ArrayLike | None = None,
) -> Array | None:
    """The probability that poses can be held within limits, given the uncertainty of the model.

    It is the part of 256 models, drawn from the covariance, that can hold the pose; of fewer, from
    four on, if these are all far on one side. Values are clipped to their bounds. A model with
    which a cable's equations have no solution holds nothing.

    Args:
        robot: as described, or its MJCF.
        poses: (n, 7).
        model: as ``crosscheck calibrate`` writes it, or its file.
        lowest, highest, wrenches: as in :func:`seecr.tension_margin`.

    Returns:
        (n,); None if the model keeps no covariance. For robots with fewer cables than degrees of
        freedom, the probability that the position can be held in some orientation.

    Raises:
        InputError: wrong shapes, quaternions that are no rotations, or limits that contradict each
            other.
        InputFileError: no such file, or no model of this robot in it.

    Example:
        ``seecr.held_chance(robot, poses, "model.toml", lowest=0.5)``
    """
    robot = robot_of(robot)
    known = moving_covariance(model_given(model, robot))
    if known is None:
        return None
    terms, covariance = known
    places, limits = commanded_poses(poses, robot=robot), (lowest, highest, wrenches)
    vectors = _drawn(terms, covariance, _STAGES[-1][0])
    solved = robot.n_driven < robot.n_dof
    out, rows = np.zeros(len(places)), np.arange(len(places))
    seen = np.zeros((0, len(places)))
    for count, sure in _STAGES:
        drawn = [terms.with_vector(one).effects for one in vectors[len(seen) : count]]
        # where full searches find no orientation for the first few, none is found for the others
        # either, unless that of a neighbour is nearly one
        hopeful = np.ones(len(rows), dtype=bool)
        if len(seen):
            hopeful &= np.isfinite(seen).any(axis=0)
        more = [_margins(robot, places[rows], limits, one, hopeful) for one in drawn]
        seen = np.concatenate([seen, more])
        out[rows] = is_held(robot, seen).mean(axis=0)
        near = ~(np.isin(out[rows], (0.0, 1.0)) & _far(seen, sure, solved))
        rows, seen = rows[near], seen[:, near]
        if len(rows) == 0:
            break
    return out


def _margins(
    robot: Robot, places: Array, limits: tuple[ArrayLike, ArrayLike, ArrayLike | None],
    effects: GivenEffects, hopeful: NDArray[np.bool_],
) -> Array:  # fmt: skip
    """Margins (n,) at places; full searches are only made at those that are ``hopeful`` (n,)."""
    out = margins_at(robot, places, *limits, effects, thorough=False)
    again = np.flatnonzero(hopeful & np.isneginf(out))
    if len(again) and robot.n_driven < robot.n_dof:
        out[again] = margins_at(robot, places[again], *limits, effects)
    return out


def _far(margins: Array, sure: float, solved: bool) -> NDArray[np.bool_]:
    """Whether the mean of margins (draws, n) is so many standard deviations from zero.

    Infinite limits, or poses out of reach, are far from any edge. But if the orientation has to be
    solved for, minus infinity says nothing about how near one is that can be held.
    """
    infinite: NDArray[np.bool_] = np.asarray(~np.isfinite(margins).all(axis=0))
    far = np.full(len(infinite), not solved)
    some = margins[:, ~infinite]
    far[~infinite] = np.abs(some.mean(axis=0)) > sure * some.std(axis=0)
    return far


def check_chance(model: GivenEffects) -> None:
    """Check that poses can have probabilities, before hours are spent on them.

    Raises:
        InputError: not a model with a covariance.
    """
    if not isinstance(model, Model) or moving_covariance(model) is None:
        raise InputError(_NO_COVARIANCE)


def asked_chance(
    robot: Robot, poses: Array, model: GivenEffects, lowest: ArrayLike, highest: ArrayLike,
    wrenches: ArrayLike | None,
) -> Array:  # fmt: skip
    """Like :func:`held_chance`, but a model with a covariance is required.

    Raises:
        InputError: it is not one.
    """
    found = None
    if isinstance(model, Model):
        found = held_chance(robot, poses, model, lowest=lowest, highest=highest, wrenches=wrenches)
    if found is None:
        raise InputError(_NO_COVARIANCE)
    return found


def _drawn(terms: Terms, covariance: Array, count: int) -> Array:
    """Evenly spread draws (count, p) of a normal distribution about the terms' values, in bounds.

    A value beyond its bound is set to the bound, as a fit to such data would do. Rejecting it is no
    alternative: many effects are absent at a bound, and hardly any draw is within all bounds.
    """
    own = terms.vector
    if len(own) == 0:
        return np.zeros((count, 0))
    # scaled to unit variances: a coefficient of the cubic stretch is off by 10^5 and a point by
    # 10^-4 m, and rounding would leave nothing of the point's part
    error = np.sqrt(np.diag(covariance))
    unit = np.where(error > 0.0, error, 1.0)
    values, vectors = np.linalg.eigh(covariance / unit / unit[:, None])
    from scipy.special import ndtri  # both take a second to import
    from scipy.stats import qmc

    evenly = qmc.Sobol(len(covariance), seed=0).random(count)
    drawn = ndtri(np.clip(evenly, 1e-9, 1.0 - 1e-9))
    drawn = own + unit * (drawn * np.sqrt(np.maximum(values, 0.0)) @ vectors.T)
    lower, upper = np.minimum(terms.lower, own), np.maximum(terms.upper, own)
    return np.asarray(np.clip(drawn, lower, upper))


# The edge of a workspace, along straight lines that lead out of it.


def boundary(
    robot: GivenRobot,
    inside: ArrayLike,
    outside: ArrayLike,
    *,
    tolerance: float = 1e-4,
    lowest: ArrayLike = 0.0,
    highest: ArrayLike = np.inf,
    wrenches: ArrayLike | None = None,
    effects: GivenEffects = (),
    at_least: float | None = None,
) -> Array:
    """Points on the workspace's edge, between poses that can be held and poses that cannot.

    They are found by bisection along the straight line between the two positions.

    Args:
        robot: as described, or its MJCF.
        inside, outside: (n, 7) poses, with the same orientation in each row.
        tolerance: [m] within which the edge is found.
        lowest, highest, wrenches: as in :func:`seecr.tension_margin`.
        effects: effects of the robot: a model, its file, or effects with values.
        at_least: count poses as held if their probability is at least this, given the uncertainty
            of a model with a covariance; by default, those that the model's own values hold.

    Returns:
        (n, 7) the last poses found that can be held.

    Raises:
        InputError: a pose is on the wrong side, the tolerance is not positive, or a probability is
            asked for without a covariance.

    Example:
        ``seecr.boundary(robot, held, not_held, lowest=0.5)``
    """
    robot = robot_of(robot)
    if not 0.0 < tolerance < np.inf:
        raise InputError(f"an edge's tolerance [m] must be above 0 and finite, got {tolerance:g}")
    effects = read_once(effects, robot)
    near = commanded_poses(inside, "inside", robot)
    far = commanded_poses(outside, "outside", robot)

    def held(poses: Array) -> NDArray[np.bool_]:
        if at_least is not None:
            chance = asked_chance(robot, poses, effects, lowest, highest, wrenches)
            return np.asarray(chance >= at_least)
        return is_held(robot, margins_at(robot, poses, lowest, highest, wrenches, effects))

    if not held(near).all() or held(far).any():
        raise InputError("boundary needs poses inside that can be held, and outside that cannot")
    for _ in range(200):
        if np.all(np.linalg.norm(far[:, :3] - near[:, :3], axis=1) <= tolerance):
            break
        middle = near.copy()
        middle[:, :3] = 0.5 * (near[:, :3] + far[:, :3])
        there = held(middle)[:, None]
        near, far = np.where(there, middle, near), np.where(there, far, middle)
    return near
