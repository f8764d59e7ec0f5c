"""How a twin is measured: its commands, MuJoCo's equilibria, and the noise."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.errors import CrosscheckError
from crosscheck.measurements.data import Measurements, Names, Sigma
from crosscheck.twin.hidden import Moves, times
from crosscheck.twin.measure import Truth, measure
from crosscheck.twin.robot import TRUE_EFFECTS
from seecr.commands import Commands, Loads
from seecr.description.joints import locked, motion_columns, pose_of_values
from seecr.description.robot import Robot
from seecr.effects import Effect, Term
from seecr.pose import (
    Array,
    pose_add,
    pose_difference,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
    rxyz_from_quat,
)
from seecr.prediction.experiment import predict

# Commands as a person would measure: sweeps to and fro, and a tilted loop, scaled to a robot.

# Parts of the distance from the reference pose to the outermost exit points, in each direction.
_ALONG, _ACROSS, _HEIGHT, _LOOP = 0.64, 0.56, 0.15, 0.5
# Tilt of the loop about the three directions [rad].
_TILT = np.deg2rad([4.0, 4.0, 6.0])
_BETWEEN_ROWS_S, _BETWEEN_RUNS_S = 2.0, 60.0


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Commanded poses (n, 7), names of runs (n,) and times (n,) [s]."""

    pose: Array
    run: Names
    t_s: Array


def trajectory(robot: Robot, points: int = 18, extent: float = 1.0) -> Trajectory:
    """Sweeps along the robot at two heights and across it, to and fro, and a tilted loop.

    Args:
        robot: any; platforms on joints go as near to the poses as their joints allow.
        points: of each sweep; the loop has twice as many.
        extent: 1 for the usual size.
    """
    frame, reach = _frame(robot)
    along, across = (
        np.linspace(part * side[0], part * side[1], points)
        for part, side in ((_ALONG, reach[0]), (_ACROSS, reach[1]))
    )
    lines: dict[str, tuple[Any, Any, Any]] = {
        "along_low": (along, 0.0, -_HEIGHT), "along_high": (along, 0.0, _HEIGHT),
        "across": (0.0, across, _HEIGHT),
    }  # fmt: skip
    if np.ptp(across) < 0.05 * np.ptp(reach[0]):  # without a width, up and down
        lines["across"] = 0.0, 0.0, np.linspace(-_HEIGHT, 1.5 * _HEIGHT, points)
    runs: dict[str, Array] = {}
    for name, (x, y, height) in lines.items():
        change = np.zeros((points, 6))
        change[:, :3] = np.stack(np.broadcast_arrays(x, y, height * reach[2, 1], along)[:3], 1)
        change[:, :3] = change[:, :3] @ frame
        runs[f"{name}_fwd"], runs[f"{name}_back"] = change, change[::-1]
    runs["loop"] = _loop(frame, reach, 2 * points)
    change = extent * np.concatenate([*runs.values()])
    poses = onto_joints(robot, pose_add(np.tile(robot.reference_pose, (len(change), 1)), change))
    times, now = [], 0.0
    for one in runs.values():
        times.append(now + _BETWEEN_ROWS_S * np.arange(len(one)))
        now = times[-1][-1] + _BETWEEN_RUNS_S
    names = np.repeat(np.array(list(runs)), [len(one) for one in runs.values()])
    return Trajectory(poses, names, np.concatenate(times))


def _frame(robot: Robot) -> tuple[Array, Array]:
    """Directions along, across and up as rows (3, 3), and the reach (3, 2) [m] on either side."""
    up = robot.up
    exits = robot.exit_points - robot.reference_pose[:3]
    level = exits - np.outer(exits @ up, up)
    along = np.linalg.svd(level - level.mean(axis=0))[2][0]
    along = along - (along @ up) * up
    along *= np.sign(along[np.argmax(np.abs(along))]) / np.linalg.norm(along)
    frame = np.stack([along, np.cross(up, along), up])
    room = exits @ frame.T
    reach = np.stack([np.minimum(room.min(axis=0), 0.0), np.maximum(room.max(axis=0), 0.0)], 1)
    reach[2] = max(abs(reach[2, 0]), reach[2, 1])
    return frame, reach


def _loop(frame: Array, reach: Array, points: int) -> Array:
    """Change (points, 6) along a closed curve of position and tilt."""
    angle = np.linspace(0.0, 2.0 * np.pi, points, endpoint=False)
    size = _LOOP * np.min(np.abs(reach[:2]), axis=1)
    local = np.stack(
        [
            size[0] * np.sin(angle),
            0.75 * size[1] * np.cos(angle) + 0.25 * size[1] * np.sin(2.0 * angle),
            0.3 * _HEIGHT * reach[2, 1] * np.cos(2.0 * angle),
        ],
        axis=1,
    )
    tilt = _TILT * np.stack([np.sin(angle), np.sin(2.0 * angle + 0.5), np.cos(angle - 0.4)], axis=1)
    return np.concatenate([local @ frame, tilt @ frame], axis=1)


def onto_joints(robot: Robot, poses: Array) -> Array:
    """The poses (n, 7), or for a robot on joints the nearest that one Gauss-Newton step gives."""
    if not robot.joints:
        return poses
    start, screws = pose_of_values(robot, np.zeros((1, len(robot.joints))))
    columns = motion_columns(screws, start[:, :3])[0]
    values = pose_difference(poses, start) @ np.linalg.pinv(columns).T
    return pose_of_values(robot, values)[0]


def turning(robot: Robot) -> NDArray[np.bool_]:
    """(3,) about which axes of the base frame a platform's orientation is read: where it can turn.

    All three of a platform that turns about another axis, or is turned at home: its angles about
    the base frame's are not those of its joints.
    """
    free = ~locked(robot)[3:]
    turned = bool(np.abs(robot.reference_pose[4:]).max() > 0.0)
    return np.ones(3, dtype=bool) if free.any() and (turned or free.sum() > 1) else free


# Noise of a tracker, relative to the mean cable length (30 micrometres on a DemoBot), and in angle.
_POSITION, _ORIENTATION_RAD = 6e-5, 3.5e-4
# Noise of load cells relative to the mean tension.
_TENSION = 0.02
# An effect that moves no reading by this many times its noise is enlarged by these factors.
_VISIBLE, _ENLARGED = 2.0, (1.0, 2.0, 3.0)
# Extents of the sweeps; smaller ones are tried if MuJoCo finds no rest at some commands.
EXTENTS = (1.0, 0.75, 0.5, 0.35)
# Decimals of commands that distinguish them: a nanometre.
_TOLD = 9
# Part of the rows at which the platform has to rest; the others are left out.
_AT_REST = 0.95

Progress = Callable[[int, str], None]


@dataclass(frozen=True, eq=False)
class Lab:
    """A laboratory that measures twins.

    Attributes:
        robot, seed: of the twin. stated: noise. tensions: whether they are read.
        tell: called with progress. commanded: seeds of the noise besides the twin's.
    """

    robot: Robot
    seed: int
    stated: Sigma
    tensions: bool
    tell: Progress
    commanded: tuple[int, ...] = ()

    def measure(self, case: Measurements, effects: Sequence[Effect], now: str) -> Truth:
        """The truth at commands, with lengths off by the noise of the winches."""
        errors = None
        if self.stated.length_m is not None:
            random = random_of(self.seed, 3, self.commanded)
            errors = self.stated.length_m * random.standard_normal((case.n_rows, case.n_cables))
        commands = case.as_commands(self.robot)
        own = [effect for effect in effects if effect.name not in TRUE_EFFECTS]
        known = [effect for effect in effects if effect not in own]
        truth = measure(
            self.robot, commands, known, length_errors=errors,
            progress=lambda rows: self.tell(rows, now),
        )  # fmt: skip
        return _with_laws(truth, self.robot, commands, known, own) if own else truth


@dataclass(frozen=True, eq=False)
class Measured:
    """MuJoCo's answers: without effects, with all of them, and with each alone."""

    case: Measurements
    plain: Truth
    truth: Truth
    sigma: Sigma
    alone: list[tuple[Term, Truth]]
    at_rest: NDArray[np.bool_]
    turns: NDArray[np.bool_]

    def moves(self, truth: Truth) -> Moves:
        """How the readings of a truth differ from those without effects."""
        return Moves.of(truth, self.plain, self.sigma, self.turns)

    def unseen(self, again: bool) -> set[str]:
        """The effects that move no reading clearly above its noise.

        Along other commands than a lab's own (``again``) all of them, if none moves any above it:
        as long as anything shows, it is the robot that was measured before.
        """
        least = 1.0 if again else _VISIBLE
        hidden = {one.name for one, truth in self.alone if not self.moves(truth).max > least}
        return hidden if not again or len(hidden) == len(self.alone) else set()


def random_of(seed: int, stream: int, commanded: tuple[int, ...] = ()) -> np.random.Generator:
    """Random numbers for one purpose: the noise does not depend on what is hidden."""
    return np.random.default_rng([seed, stream, *commanded])


def key_of(case: Measurements) -> tuple[int, ...]:
    """Numbers that identify a user's own commands: other commands get other noise."""
    told = case.command_lengths if case.command_pose is None else case.command_pose
    carried = () if case.loads is None else _carried(case.loads)
    parts = [np.round(part, _TOLD) + 0.0 for part in (told, *carried) if part is not None]
    digest = hashlib.sha256(b"".join(part.tobytes() for part in parts)).digest()
    return tuple(np.frombuffer(digest[:16], dtype=np.uint32).tolist())


def _carried(loads: Loads) -> Iterator[Array]:
    """What identifies known loads. What is not there has no part in it: cases keep their noise."""
    yield loads.mass
    centre = np.where(loads.mass[:, None] != 0.0, np.nan_to_num(loads.centre), 0.0)
    # each with its number, lest one passes for the other
    for number, part in enumerate((centre, loads.wrench), start=1):
        if part.any():
            yield np.append(part, number)


def lacking_in(case: Measurements) -> dict[str, str]:
    """Data needed by effects that the commands do not have, in words."""
    there = {
        "time": (case.t_s is not None, "the time of each row, column t_s"),
        "temperature": (case.temperature_C is not None, "the temperature, column temperature_C"),
        "poses": (not case.absolute, "commanded poses or told lengths"),
    }
    return {need: words for need, (has, words) in there.items() if not has}


def sized(lab: Lab, points: int, hidden: list[Term]) -> list[Term]:
    """The effects as large as along the lab's own sweeps, for whatever else is commanded.

    So a seed measured along corrected commands is the robot that was measured before. Where the
    platform does not rest along sweeps, sizes are as drawn.
    """
    own = replace(lab, commanded=())
    cases = [sweeps(lab.robot, points, extent, lab.seed) for extent in EXTENTS]
    try:
        return [one for one, _ in rest_of(own, cases, hidden).alone] if hidden else []
    except CrosscheckError:
        return hidden


def rest_of(
    lab: Lab,
    cases: Sequence[Measurements],
    hidden: list[Term],
    enlarged: Sequence[float] = _ENLARGED,
) -> Measured:
    """The first commands at which MuJoCo comes to rest, with sizes of effects that show there.

    Args:
        lab: that measures. cases: commands to try. hidden: effects with the sizes drawn.
        enlarged: factors of the sizes to try until an effect shows.
    """
    for case in cases:
        plain = lab.measure(case, (), "without effects")
        if not _mostly(plain.at_rest):
            continue
        sigma = _sigma(lab, plain)
        alone = [_made_visible(lab, case, one, plain, sigma, enlarged) for one in hidden]
        fine = [one for one in alone if one is not None]
        if len(fine) < len(alone):
            continue
        truth = fine[0][1] if fine else plain
        if len(fine) > 1:
            truth = lab.measure(case, [one.effect() for one, _ in fine], "both effects")
        at_rest = truth.at_rest & plain.at_rest
        if _mostly(at_rest):
            return Measured(case, plain, truth, sigma, fine, at_rest, turning(lab.robot))
    where = "the twin's commands, however close to the reference pose"
    if len(cases) == 1:
        where = f"the commands of {cases[0].path}"
    raise CrosscheckError(
        f"{lab.robot.source}: MuJoCo finds no stable rest along {where}; expected a robot "
        "whose cables hold its platform around there"
    )


def _mostly(at_rest: NDArray[np.bool_]) -> bool:
    """Whether few rows are left out; a platform that does not rest cannot be measured."""
    return float(np.mean(at_rest)) >= _AT_REST


def sweeps(robot: Robot, points: int, extent: float, seed: int) -> Measurements:
    """Sweeps to and fro, and the temperature at which they are commanded."""
    planned = trajectory(robot, points, extent)
    random = random_of(seed, 1)
    # a hall that warms up, with a door that is opened now and then
    t = planned.t_s
    rise, period = random.uniform(3.0, 6.0), random.uniform(200.0, 400.0)
    drift = rise * (1.0 - np.exp(-t / 300.0)) + 0.5 * np.sin(2.0 * np.pi * t / period)
    return Measurements(
        path=Path("measured.csv"), n_cables=robot.n_cables, run=planned.run, t_s=t,
        command_pose=planned.pose, temperature_C=np.round(20.0 + drift, 2),
    )  # fmt: skip


def _made_visible(
    lab: Lab,
    case: Measurements,
    hidden: Term,
    plain: Truth,
    sigma: Sigma,
    enlarged: Sequence[float],
) -> tuple[Term, Truth] | None:
    """The effect, enlarged if the noise would hide it; None if MuJoCo does not come to rest.

    What counts is how poses move, also if tensions are read, so that these change nothing; unless
    the effect moves only tensions.
    """
    best, of_poses, turns = None, replace(sigma, tension_N=None), turning(lab.robot)
    for factor in enlarged:
        one = times(hidden, factor)
        truth = lab.measure(case, [one.effect()], "with effects")
        if not _mostly(truth.at_rest & plain.at_rest):
            break
        best = one, truth
        moves = Moves.of(truth, plain, of_poses, turns)
        if (moves if moves.max > 0.0 else Moves.of(truth, plain, sigma, turns)).max > _VISIBLE:
            break
    return best


def _sigma(lab: Lab, plain: Truth) -> Sigma:
    """The stated noise, else that of a good tracker and, if tensions are read, of load cells."""
    robot, stated = lab.robot, lab.stated
    length = float(np.mean(robot.nominal_lengths(robot.reference_pose[None])))
    pull = _one_digit(_TENSION * float(np.nanmean(plain.tensions))) if lab.tensions else None
    return Sigma(
        stated.position_m or _one_digit(_POSITION * length),
        stated.orientation_rad or _ORIENTATION_RAD,
        stated.tension_N or pull,
        stated.length_m,
    )


def _one_digit(value: float) -> float:
    return float(f"{value:.0e}")


def read_of(made: Measured, random: np.random.Generator) -> Measurements:
    """Readings with noise; none at way points and where the platform is not at rest."""
    case, truth, sigma = made.case, made.truth, made.sigma
    assert sigma.position_m is not None and sigma.orientation_rad is not None
    n = len(truth.position)
    noise = random.standard_normal((n, 6))
    turn = quat_from_rotvec(sigma.orientation_rad * noise[:, 3:])
    quat = quat_multiply(turn, truth.quat_wxyz)
    quat *= np.where(quat[:, :1] < 0.0, -1.0, 1.0)
    stops = ((case.read | ~case.read.any()) & made.at_rest)[:, None]
    anew: dict[str, Any] = dict.fromkeys(("angles_rad", "tensions", "line"))
    if not made.turns.all():
        anew["angles_rad"] = np.where(stops & made.turns, rxyz_from_quat(quat), np.nan)
    if sigma.tension_N is not None:
        pulls = truth.tension_readings
        pulls = pulls + sigma.tension_N * random.standard_normal(pulls.shape)
        anew["tensions"] = np.where(stops, pulls, np.nan)
    return replace(
        case,
        path=Path("measured.csv"),
        position=np.where(stops, truth.position + sigma.position_m * noise[:, :3], np.nan),
        quat_wxyz=np.where(stops, quat, np.nan) if made.turns.all() else None,
        sigma=sigma if made.turns.any() else replace(sigma, orientation_rad=None),
        unused_columns=(),
        notes=(),
        **anew,
    )


# Effects of users' own act by their own law: MuJoCo has no means for what nobody foretold.
#
# It brings the robot to rest with all other hidden effects. What an own effect adds is the
# difference that its law makes in SEECR's prediction, with the same other effects on both sides.


def _with_laws(
    truth: Truth, robot: Robot, commands: Commands, known: Sequence[Effect], own: Sequence[Effect]
) -> Truth:
    """MuJoCo's answers with ``known`` effects, and what own ones change in them."""
    before = predict(robot, commands, known)
    after = predict(robot, commands, [*known, *own])
    was, now = before.readings, after.readings
    there = np.hstack([truth.position, truth.quat_wxyz])
    poses = (np.hstack([one.position, one.quat_wxyz]) for one in (was, now))
    read = _moved(there, *poses)
    return replace(
        truth,
        pose=_moved(truth.pose, before.pose, after.pose),
        tensions=truth.tensions + after.tensions - before.tensions,
        at_rest=truth.at_rest & before.solved & after.solved,
        position=read[:, :3],
        quat_wxyz=read[:, 3:],
        tension_readings=truth.tension_readings + now.tensions - was.tensions,
    )


def _moved(poses: Array, before: Array, after: Array) -> Array:
    """Poses (n, 7) shifted and turned in the base frame as others are from before to after."""
    turn = quat_multiply(after[:, 3:], quat_conjugate(before[:, 3:]))
    place = poses[:, :3] + after[:, :3] - before[:, :3]
    return np.hstack([place, quat_multiply(turn, poses[:, 3:])])
