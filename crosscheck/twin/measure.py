"""Settle a true robot row by row, and read its sensors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crosscheck.errors import CrosscheckError
from crosscheck.settle.relaxation import SettleStatus, come_to_rest
from crosscheck.twin.cable import Cable, Springs
from crosscheck.twin.robot import TrueRobot, true_robot
from crosscheck.twin.world import Descent, World, descend
from seecr.commands import Commands, Loads
from seecr.description.robot import Robot
from seecr.effects import Effect
from seecr.pose import Array, pose_add, pose_difference, transform_points

# The lengths that the winches really pay out, command by command.

# Number of points on the way to the first row of a run, and from row to row. The laws of cables
# with history take each step between two points as one in which the stretch does not turn round.
_APPROACH, _BETWEEN = 12, 8
# Parts of the way between two points in which winches are checked for reversals.
_WATCHED = 64


@dataclass(frozen=True, eq=False)
class Waypoints:
    """The commands with all points on the path, N in all.

    Attributes:
        pose: (N, 7) commanded; lengths: (N, m) [m] commanded, or None. told: whether these are told
            lengths, relative to the reference pose's rest lengths.
        row: (N,) the row that a point belongs to; is_row: (N,) whether it is that row.
        fresh: (N,) whether a run starts here, at rest: at the reference pose or its first row.
        elapsed: (N,) [s] since the point before.
    """

    pose: Array
    lengths: Array | None
    told: bool
    row: NDArray[np.int64]
    is_row: NDArray[np.bool_]
    fresh: NDArray[np.bool_]
    elapsed: Array


def waypoints_of(
    true: TrueRobot, commands: Commands, steps: NDArray[np.integer] | None = None
) -> Waypoints:
    """Every run from the reference pose straight to its first row, then from row to row.

    A run that starts at its first row has no way to it; a load changes before the motion.

    Args:
        true: the robot.
        commands: n rows.
        steps: (n,) numbers of points on the way to each row; by default twelve to the first row of
            a run, and eight from row to row.
    """
    robot, n = true.robot, len(commands)
    every = np.where(commands.starts, _APPROACH, _BETWEEN) if steps is None else steps
    clock = np.zeros(n) if commands.time is None else commands.time
    points: list[tuple[Array, Array, int, bool, bool, float]] = []
    none = np.zeros(0)
    guide = _guide(true)
    for k, starts, here in zip(range(n), commands.starts, commands.starts_here, strict=True):
        passed = max(float(clock[k] - clock[k - 1]), 0.0) if k else 0.0
        before = robot.reference_pose if starts else commands.pose[k - 1]
        paid, told = none, none
        if commands.lengths is not None:
            told = commands.lengths[k]
            paid = robot.rest_lengths if starts else commands.lengths[k - 1]
        if here:
            points.append((commands.pose[k], told, k, True, True, passed))
            continue
        if starts:
            points.append((robot.reference_pose, paid, k, False, True, passed))
            passed = 0.0
        elif _reloaded(commands, k):
            points.append((before, paid, k, False, False, 0.0))
        parts = np.arange(1, every[k] + 1) / every[k]
        poses = [*_straight_way(guide, before, commands.pose[k], parts[:-1]), commands.pose[k]]
        for pose, part in zip(poses, parts, strict=True):
            length = paid + part * (told - paid)
            points.append((pose, length, k, part == 1.0, False, passed / every[k]))
    path, lengths, *others = (np.array(part) for part in zip(*points, strict=True))
    return Waypoints(path, None if commands.lengths is None else lengths, commands.told, *others)


def _reloaded(commands: Commands, k: int) -> bool:
    """Whether a row has another load than the row before."""
    loads = commands.loads
    if loads is None:
        return False
    return any(
        not np.array_equal(values[k], values[k - 1], equal_nan=True)
        for values in (loads.mass, loads.centre, loads.wrench)
    )


def _guide(true: TrueRobot) -> World | None:
    """The robot as described, to be moved along its joints; None for a free platform."""
    if not true.robot.joints:
        return None
    return World(replace(_bare(true), pulley_radius=0.0))


def _straight_way(guide: World | None, before: Array, after: Array, parts: Array) -> Array:
    """Poses (k, 7) at fractions (k,) of a path, straight in pose or in joint values."""
    if guide is None:
        return pose_add(before, parts[:, None] * pose_difference(after, before))
    n = guide.places.n_platform
    ends = []
    for pose in (before, after):
        guide.place(pose)
        ends.append(guide.data.qpos[:n].copy())
    poses = np.empty((len(parts), 7))
    for k, part in enumerate(parts):
        guide.data.qpos[:n] = ends[0] + part * (ends[1] - ends[0])
        guide.update()
        poses[k] = guide.pose()
    return poses


def paid_out(true: TrueRobot, path: Waypoints, temperature: Array | None) -> Array:
    """Rest lengths (N, m) [m] at the points of a path.

    Args:
        true: the robot.
        path: its commands.
        temperature: (n,) [deg C] of the rows, or None.
    """
    absolute = path.lengths is not None and not path.told
    if path.lengths is None:
        told = _straight(true, path.pose) - _straight(true, true.robot.reference_pose[None])
    else:
        told = path.lengths - (0.0 if absolute else true.robot.rest_lengths)
    turned = told
    if true.backlash > 0.0:
        # lengths are commanded evenly: nothing reverses between two points
        watched = _watched(true, path) if path.lengths is None else [told[:0]] * len(told)
        turned = _with_play(told, watched, path.fresh, 0.5 * true.backlash)
    paid = (1.0 + true.gain) * turned + true.offset
    zero = 0.0 if absolute else 1.0
    for sine, cosine, radius in true.run_out:
        angle = told / radius
        paid = paid + sine * np.sin(angle) + cosine * (np.cos(angle) - zero)
    if not absolute:
        paid = paid + _zero(true)
    if temperature is not None and true.expansion != 0.0:
        warmer = temperature[path.row] - true.zero_temperature
        paid = paid * (1.0 + true.expansion * warmer)[:, None]
    return np.asarray(paid)


def _straight(true: TrueRobot, poses: Array) -> Array:
    """Straight lengths (N, m) [m] of the described robot."""
    robot = true.robot
    anchors = transform_points(poses, robot.anchor_points)
    return np.asarray(np.linalg.norm(anchors - robot.exit_points, axis=-1))


def _watched(true: TrueRobot, path: Waypoints) -> list[Array]:
    """Lengths (k, m) [m] commanded on the way to each of N points, in order.

    The squared length is taken at even steps. At a reversal it is replaced by the vertex of the
    parabola through a step and its neighbours, which is exact for a translation.
    """
    guide, home = _guide(true), _straight(true, true.robot.reference_pose[None])[0]
    # one step more at either end, to see reversals there too
    parts = np.arange(-1, _WATCHED + 2) / _WATCHED
    watched = []
    for k, pose in enumerate(path.pose):
        before = pose if path.fresh[k] else path.pose[k - 1]
        square = _straight(true, _straight_way(guide, before, pose, parts)) ** 2
        watched.append(np.sqrt(_with_vertices(square, parts[1:-1])) - home)
    return watched


def _with_vertices(value: Array, parts: Array) -> Array:
    """Values (k + 2, m) without the outer ones, at fractions (k,) of a path, with exact extrema."""
    earlier, now, later = value[:-2], value[1:-1], value[2:]
    rise, bend = 0.5 * (later - earlier), later - 2.0 * now + earlier
    near = (np.abs(rise) <= 0.5 * np.abs(bend)) & (bend != 0.0)
    steps = np.where(near, -rise / np.where(near, bend, 1.0), 0.0)
    at = parts[:, None] + steps * (parts[1] - parts[0])
    inside = near & (at > 0.0) & (at < 1.0)
    return np.where(inside, np.maximum(now + 0.5 * rise * steps, 0.0), now)


def _with_play(told: Array, watched: list[Array], fresh: NDArray[np.bool_], half: float) -> Array:
    """The drum stands still until the motor has taken up the play; it is centred at first."""
    drum = told.copy()
    for k in range(1, len(told)):
        if not fresh[k]:
            drum[k] = drum[k - 1]
            for motor in (*watched[k], told[k]):
                drum[k] = np.minimum(np.maximum(drum[k], motor - half), motor + half)
    return drum


def _zero(true: TrueRobot) -> Array:
    """Lengths (m,) [m] when the winches were zeroed, over the true geometry, as MuJoCo has it."""
    robot = true.robot
    bare = _bare(true)
    world = World(bare)
    if true.robot.joints and not np.array_equal(true.zero_pose, robot.reference_pose):
        # misplaced by hand, and so off its joints: placed as a free body
        world = World(replace(bare, robot=replace(robot, joints=())))
    world.place(true.zero_pose)
    if not world.wraps:
        raise CrosscheckError(
            f"robot {robot.name}: pulley_radius {true.pulley_radius:g} m leaves a cable no path "
            "over its sheave at the reference pose; expected anchor points aside of exit points"
        )
    pretension = robot.rest_lengths - _straight(true, robot.reference_pose[None])[0]
    return np.asarray(world.cable_lengths() + pretension)


def _bare(true: TrueRobot) -> TrueRobot:
    """The robot with no moving parts but the platform and its sheaves."""
    rigid = replace(true, compliance=0.0, compliance_up=0.0, winch_side=0.0)
    return replace(rigid, cable_weight=0.0, friction=0.0)


SEGMENTS = (8, 16)
"""Segments N of a cable with weight. The error of a chain is of order 1/N^2; with two values of N
that order is eliminated (Richardson).
"""

# For MuJoCo's dynamics, before the last digits are polished.
_AT_REST, _MAX_STEPS = 1e-6, 40_000
# Agreement of a law with history and MuJoCo [load], and most tangents until then.
_AGREED, _TANGENTS = 1e-9, 60
# One step per tangent is too slow if it leaves more than this part of the residual.
_CRAWLS = 0.5
# Most steps downhill.
_LIMIT = 300
# Agreement of the parts of a cable on and off its sheave, and most rounds until then.
_SHARE, _SHARES = 1e-10, 20

Progress = Callable[[int], None]
_NOWHERE = Descent(False, False, np.nan)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Where n rows ended.

    Attributes:
        pose: (n, 7) equilibria; tensions: (n, m) [N] where cables leave, passive lines' last.
        at_rest: (n,) bool, a stable equilibrium was found.
        free: (n,) bool, in equilibrium, but free to move along some direction.
        residual: (n,) residual force relative to the load.
    """

    pose: Array
    tensions: Array
    at_rest: NDArray[np.bool_]
    free: NDArray[np.bool_]
    residual: Array

    @classmethod
    def empty(cls, n: int, m: int) -> _Rows:
        no, nan = np.zeros(n, dtype=bool), np.full(n, np.nan)
        return cls(np.full((n, 7), np.nan), np.full((n, m), np.nan), no, no.copy(), nan)


@dataclass(frozen=True, eq=False, kw_only=True)
class Truth(_Rows):
    """MuJoCo's answers for n rows, and what sensors read there.

    Attributes:
        position: (n, 3) [m]; quat_wxyz: (n, 4); tension_readings: (n, m) [N], as read, without
            noise.
        rest_lengths: (n, m) [m] actually paid out.
    """

    position: Array
    quat_wxyz: Array
    tension_readings: Array
    rest_lengths: Array


def measure(
    robot: Robot,
    commands: Commands,
    effects: Sequence[Effect] = (),
    *,
    length_errors: Array | None = None,
    segments: tuple[int, ...] = SEGMENTS,
    steps: NDArray[np.integer] | None = None,
    progress: Progress | None = None,
) -> Truth:
    """Let MuJoCo bring a robot with effects to rest at each command, and read its sensors.

    Args:
        robot: as described.
        commands: n rows.
        effects: its effects, in the order in which they act.
        length_errors: (n, m) [m] additional length in each row: noise of the winches, not an
            effect.
        segments: N of each cable, if cables have weight; with two, the poses are extrapolated.
        steps: (n,) numbers of waypoints on the way to each row, for effects with history; as
            :func:`crosscheck.twin.measure.waypoints_of` has them by default.
        progress: called with the number of rows done since the last call.
    """
    true, driven = true_robot(robot, effects), robot.driven
    if commands.lengths is not None:
        commands = replace(commands, lengths=commands.lengths[:, driven])
    path = waypoints_of(true, commands, steps)
    rest, loads = paid_out(true, path, commands.temperature), commands.loads
    if length_errors is not None:
        rest = rest + length_errors[path.row][:, driven]
    tell = progress or (lambda rows: None)
    settle = _walk if true.has_history else _each
    fine = World(true, segments[-1] if true.cable_weight > 0 else 1)
    rows = settle(fine, path, rest, loads, tell)
    if true.cable_weight > 0 and len(segments) > 1:
        coarse = settle(World(true, segments[0]), path, rest, loads, lambda rows: None)
        rows = _extrapolated(coarse, rows, (segments[-1] / segments[0]) ** 2)
    lengths = np.tile(robot.rest_lengths, (len(rows.pose), 1))
    lengths[:, driven] = rest[path.is_row]
    order = np.concatenate([np.flatnonzero(driven), np.flatnonzero(~driven)])
    rows.tensions[:, order] = rows.tensions.copy()
    reading = (rows.pose[:, :3], rows.pose[:, 3:], rows.tensions / robot.falls)
    for sensor in true.sensors:
        reading = sensor(reading)
    position, quat, tensions = reading
    return Truth(
        **vars(rows), position=position, quat_wxyz=quat, tension_readings=tensions,
        rest_lengths=lengths,
    )  # fmt: skip


def _extrapolated(coarse: _Rows, fine: _Rows, ratio: float) -> _Rows:
    """Rows without the leading error, which is ``ratio`` times as large in the coarse ones."""
    part = 1.0 / (ratio - 1.0)
    both = np.isfinite(fine.pose[:, 0]) & np.isfinite(coarse.pose[:, 0])
    pose = np.full_like(fine.pose, np.nan)
    change = part * pose_difference(fine.pose[both], coarse.pose[both])
    pose[both] = pose_add(fine.pose[both], change)
    tensions = fine.tensions + part * (fine.tensions - coarse.tensions)
    tensions = np.where(fine.tensions < 0.0, tensions, np.maximum(tensions, 0.0))  # some push
    at_rest, free = fine.at_rest & coarse.at_rest, fine.free | coarse.free
    return _Rows(pose, tensions, at_rest, free, fine.residual)


def _each(world: World, path: Waypoints, rest: Array, loads: Loads | None, tell: Progress) -> _Rows:
    """Every row by itself, from its commanded pose."""
    poses, lengths = path.pose[path.is_row], rest[path.is_row]
    out = _Rows.empty(len(poses), world.n_lines)
    bare = _without_weight(world)
    for k, pose in enumerate(poses):
        springs = Springs.plain(lengths[k], world.true)
        _carry((world, bare), loads, k)
        go = _start(world, bare, pose, springs)
        _note(world, out, k, _settle(world, springs) if go else _NOWHERE)
        tell(1)
    return out


def _carry(worlds: tuple[World, ...], loads: Loads | None, row: int) -> None:
    """Attach the load of a row to the platform."""
    if loads is not None:
        for world in worlds:
            world.carry(float(loads.mass[row]), loads.centre[row], loads.wrench[row])


def _without_weight(world: World) -> World:
    """A world whose cables have no weight; the world itself if it has none."""
    if world.segments == 1:
        return world
    return World(replace(world.true, cable_weight=0.0))


def _start(world: World, bare: World, pose: Array, springs: Springs) -> bool:
    """Bring the platform to rest from a pose; cables with weight get theirs afterwards."""
    bare.set_springs(springs)
    bare.place(pose)
    # MuJoCo's own dynamics, damped, from there
    tolerance = max(_AT_REST, 10.0 * bare.rounding())
    if come_to_rest(bare, tolerance, _MAX_STEPS).status is not SettleStatus.SETTLED:
        return False
    if bare is not world:
        if world.true.pulley_radius:
            world.free_share = bare.measure_free_share()
        world.set_springs(springs)
        world.place(bare.pose())
    return True


def _settle(world: World, springs: Springs, judge: bool = True, limit: int = _LIMIT) -> Descent:
    """Polish, or go downhill; chains over sheaves repeat that until their free parts are right."""
    for _ in range(_SHARES):
        world.set_springs(springs)
        found = descend(world, judge, limit)
        if world.segments == 1 or not world.true.pulley_radius or not found.balanced:
            break
        share = world.measure_free_share()
        change = float(np.max(np.abs(share - world.free_share)))
        world.free_share = share
        if change < _SHARE:
            break
    return found if world.wraps else _NOWHERE


def _note(world: World, out: _Rows, k: int, found: Descent) -> None:
    out.at_rest[k], out.free[k], out.residual[k] = found.at_rest, found.free, found.residual
    if found.balanced:
        cables = world.cable_tensions()
        out.tensions[k] = [*cables, *world.tensions()[world.places.tendons.size :]]
        out.pose[k] = world.pose()


def _walk(world: World, path: Waypoints, rest: Array, loads: Loads | None, tell: Progress) -> _Rows:
    """All points of the way in order, each from the equilibrium of the last one."""
    true = world.true
    out = _Rows.empty(int(path.is_row.sum()), world.n_lines)
    cables = [Cable(true, float(ea)) for ea in true.ea]
    bare = _without_weight(world)
    found = _NOWHERE
    for k, pose in enumerate(path.pose):
        _carry((world, bare), loads, int(path.row[k]))
        for cable, length in zip(cables, rest[k], strict=True):
            cable.pays_out(float(length), float(path.elapsed[k]), bool(path.fresh[k]))
        go = found.balanced
        if path.fresh[k]:
            go = _start(world, bare, pose, Springs.plain(rest[k], true))
        found = _agree(world, cables) if go else _NOWHERE
        if path.is_row[k]:
            _note(world, out, int(path.row[k]), found)
            tell(1)
    return out


def _agree(world: World, cables: list[Cable]) -> Descent:
    """Tangents of the cables' laws and MuJoCo's settling alternate until both are consistent."""
    world.update()
    springs, before, last, crawls = None, None, np.inf, False
    for turn in range(_TANGENTS):
        tangent = _tangents(world, cables)
        if springs is not None and turn > _TANGENTS // 3:
            # a kink between whose tangents it alternates: take the mean
            tangent = tangent.halfway(springs)
        springs = tangent
        # one step per tangent is Newton's method on both; if that makes no progress, as with cables
        # in segments, the descent is completed for each tangent
        quick = turn < _TANGENTS // 6 and not crawls
        step = _settle(world, springs, judge=False, limit=1 if quick else _LIMIT)
        fine, crawls = step.balanced, crawls or (turn > 1 and step.residual > _CRAWLS * last)
        last = step.residual
        if not (fine or quick):
            return _NOWHERE
        tensions = world.cable_tensions()
        moved = np.inf if before is None else float(np.max(np.abs(tensions - before)))
        if fine and moved < _AGREED * world.force_scale:
            break
        before = tensions
    else:
        return _NOWHERE
    found = _settle(world, springs)
    _tangents(world, cables)
    for cable, tension in zip(cables, world.cable_tensions(), strict=True):
        cable.rests(bool(tension == 0.0))
    return found


def _tangents(world: World, cables: list[Cable]) -> Springs:
    """Springs tangent to the cables' laws at their present lengths."""
    lengths = world.cable_lengths()
    pairs = [cable.tangent(float(at)) for cable, at in zip(cables, lengths, strict=True)]
    rest, stiffness = np.array(pairs).T
    return Springs(rest, stiffness, np.zeros((len(rest), 2)))
