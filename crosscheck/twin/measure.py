"""Settle a true robot row by row, and read its sensors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crosscheck.settle.settler import SettleStatus, come_to_rest
from crosscheck.twin.descent import Descent, descend
from crosscheck.twin.lengths import Waypoints, paid_out, waypoints_of
from crosscheck.twin.robot import true_robot
from crosscheck.twin.springs import Cable, Springs
from crosscheck.twin.world import World
from seecr.commands import Commands, Loads
from seecr.description.robot import Robot
from seecr.effects import Effect
from seecr.pose import Array, pose_add, pose_difference

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
        pose: (n, 7) equilibria; tensions: (n, m) [N] where cables leave.
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
            :func:`crosscheck.twin.lengths.waypoints_of` has them by default.
        progress: called with the number of rows done since the last call.
    """
    true = true_robot(robot, effects)
    path = waypoints_of(true, commands, steps)
    rest, loads = paid_out(true, path, commands.temperature), commands.loads
    if length_errors is not None:
        rest = rest + length_errors[path.row]
    tell = progress or (lambda rows: None)
    settle = _walk if true.has_history else _each
    fine = World(true, segments[-1] if true.cable_weight > 0 else 1)
    rows = settle(fine, path, rest, loads, tell)
    if true.cable_weight > 0 and len(segments) > 1:
        coarse = settle(World(true, segments[0]), path, rest, loads, lambda rows: None)
        rows = _extrapolated(coarse, rows, (segments[-1] / segments[0]) ** 2)
    reading = (rows.pose[:, :3], rows.pose[:, 3:], rows.tensions)
    for sensor in true.sensors:
        reading = sensor(reading)
    position, quat, tensions = reading
    return Truth(
        **vars(rows), position=position, quat_wxyz=quat, tension_readings=tensions,
        rest_lengths=rest[path.is_row],
    )  # fmt: skip


def _extrapolated(coarse: _Rows, fine: _Rows, ratio: float) -> _Rows:
    """Rows without the leading error, which is ``ratio`` times as large in the coarse ones."""
    part = 1.0 / (ratio - 1.0)
    both = np.isfinite(fine.pose[:, 0]) & np.isfinite(coarse.pose[:, 0])
    pose = np.full_like(fine.pose, np.nan)
    change = part * pose_difference(fine.pose[both], coarse.pose[both])
    pose[both] = pose_add(fine.pose[both], change)
    tensions = np.maximum(fine.tensions + part * (fine.tensions - coarse.tensions), 0.0)
    at_rest, free = fine.at_rest & coarse.at_rest, fine.free | coarse.free
    return _Rows(pose, tensions, at_rest, free, fine.residual)


def _each(world: World, path: Waypoints, rest: Array, loads: Loads | None, tell: Progress) -> _Rows:
    """Every row by itself, from its commanded pose."""
    poses, lengths = path.pose[path.is_row], rest[path.is_row]
    out = _Rows.empty(len(poses), world.n_cables)
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
    if not _moves_to_rest(bare):
        return False
    if bare is not world:
        if world.true.pulley_radius:
            world.free_share = bare.measure_free_share()
        world.set_springs(springs)
        world.place(bare.pose())
    return True


def _settle(world: World, springs: Springs, judge: bool = True, limit: int = _LIMIT) -> Descent:
    """Polish, or go downhill; chains over sheaves repeat that until their free parts are right."""
    found = _NOWHERE
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


def _moves_to_rest(world: World) -> bool:
    """MuJoCo's own dynamics, damped, from where the platform is placed."""
    tolerance = max(_AT_REST, 10.0 * world.rounding())
    return come_to_rest(world, tolerance, _MAX_STEPS).status is SettleStatus.SETTLED


def _note(world: World, out: _Rows, k: int, found: Descent) -> None:
    out.at_rest[k], out.free[k], out.residual[k] = found.at_rest, found.free, found.residual
    if found.balanced:
        out.tensions[k] = world.cable_tensions()
        out.pose[k] = world.pose()


def _walk(world: World, path: Waypoints, rest: Array, loads: Loads | None, tell: Progress) -> _Rows:
    """All points of the way in order, each from the equilibrium of the last one."""
    true = world.true
    out = _Rows.empty(int(path.is_row.sum()), world.n_cables)
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
