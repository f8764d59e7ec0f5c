"""Workspaces on grids: where a platform can be held, and where the elastic robot comes to rest.

Grids are processed in parts, so that memory for a million poses is that of the results.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.arguments import finite, silent, whole
from seecr.commands import Commands
from seecr.description.mjcf import GivenRobot, robot_of
from seecr.description.robot import Robot
from seecr.equilibrium.solving import solve
from seecr.errors import ExecutorError, InputError
from seecr.parallel import BLOCK, as_done, threads
from seecr.pose import NORM_TOLERANCE, Array
from seecr.prediction.experiment import Experiment, effects_of
from seecr.prediction.model import GivenEffects
from seecr.statics.starts import commanded_poses
from seecr.workspace.edges import asked_chance, check_chance, margins_at, read_once
from seecr.workspace.grid import (
    NEVER,
    Workspace,
    codes_of,
    grid_ends,
    own_directions,
    refuse_other_joints,
    refuse_unreached,
)

Progress = Callable[[int], None]
"""Called with the number of poses done since the last call."""

MOST_POSES = 10_000_000
"""Of a grid or line in memory, where a pose of a map takes a hundred bytes."""
MOST_STORED = 10_000_000_000
"""Of a grid in files: a day of one processor, and a terabyte."""
# Poses that are solved at a time: of all numbers that are kept of a pose, most are not results.
_PART = 78 * BLOCK
# Tasks of an executor that a grid is divided into, so that many workers end at about one time; a
# task of fewer poses is not worth sending, and of more its results fill memory.
_TASKS, _SMALLEST, _LARGEST = 64, 256, 200_000
# Values of the default grid along an axis with an extent; fewer for robots with too few cables.
_VALUES, _FEW = 33, 13


def default_axes(
    robot: GivenRobot, values: int | None = None, orientation: ArrayLike | None = None
) -> tuple[Array, Array, Array]:
    """A grid over the exit points, down to as far below the reference pose as they are above it.

    Below and above are along gravity. The grid ends where the platform's lowest anchor point would
    be on the robot's floor, if it has one. Along an axis on which joints keep the platform in place
    it has one value. Where they keep it in a plane or on a line that is oblique to x, y and z, the
    axes are :attr:`Workspace.directions` instead.

    Args:
        robot: as described, or its MJCF.
        values: on each axis along which the grid extends; by default 33, or 13 for a robot with
            fewer cables than degrees of freedom.
        orientation: (4,) quaternion of all poses; that of the reference pose by default.

    Returns:
        x, y and z of the grid, (nx,), (ny,) and (nz,) [m], or u, v and w.

    Raises:
        InputError: ``values`` is not a whole number from 1 on, ``orientation`` no quaternion, or
            the joints let the platform move in no way without turning it.

    Example:
        ``seecr.workspace_map(robot, *seecr.default_axes(robot, 5))``
    """
    robot = robot_of(robot)
    if values is None:
        # robots with too few cables are solved for their orientation, which is slow
        values = _VALUES if robot.n_driven >= robot.n_dof else _FEW
    values = whole(values, "values", 1)
    turned = robot.reference_pose[3:] if orientation is None else _quaternion(orientation)
    low, high = grid_ends(robot, turned)
    axes = tuple(
        evenly(a, b, values) if b - a > 1e-9 * robot.length else np.array([a])
        for a, b in zip(low.tolist(), high.tolist(), strict=True)
    )
    refuse_other_joints(robot, axes)
    return axes  # type: ignore[return-value]


def _quaternion(values: ArrayLike) -> Array:
    """A checked unit quaternion (4,)."""
    array = finite(values, "orientation")
    if array.shape != (4,):
        raise InputError(f"orientation must be (4,), qw qx qy qz, got {array.shape}")
    norm = float(np.linalg.norm(array))
    if abs(norm - 1.0) > NORM_TOLERANCE:
        raise InputError(
            f"orientation: expected a unit quaternion qw qx qy qz, got one of norm {norm:.4g}"
        )
    return np.asarray(commanded_poses(np.concatenate([np.zeros(3), array]), "orientation")[0, 3:])


def evenly(low: float, high: float, count: int) -> Array:
    """Evenly spread numbers, with a 0 where rounding leaves almost 0."""
    numbers = np.linspace(low, high, count)
    return np.where(np.abs(numbers) < 1e-12 * (high - low), 0.0, numbers)


def axis_of(text: str, name: str) -> Array:
    """One axis of a grid: ``FIRST:LAST:COUNT`` or one number [m]; ``name`` is for the error.

    Raises:
        InputError: it is neither.
    """
    parts = text.split(":")
    try:
        if len(parts) == 1:
            return np.array([float(text)])
        first, last, count = float(parts[0]), float(parts[1]), int(parts[2])
        if len(parts) != 3 or count < 1 or not np.isfinite(last - first):
            raise ValueError
    except (ValueError, IndexError):
        raise InputError(
            f"{name}: expected FIRST:LAST:COUNT with a count above zero, or one number [m], "
            f"got {text!r}"
        ) from None
    return evenly(first, last, min(count, MOST_POSES + 1))


def workspace_map(
    robot: GivenRobot,
    x: ArrayLike,
    y: ArrayLike,
    z: ArrayLike,
    *,
    orientation: ArrayLike | None = None,
    lowest: ArrayLike = 0.0,
    highest: ArrayLike = np.inf,
    wrenches: ArrayLike | None = None,
    effects: GivenEffects = (),
    elastic: bool = True,
    chance: bool = False,
    progress: Progress = silent,
    executor: Executor | None = None,
) -> Workspace:
    """The static-feasible and the elastic workspace on a grid of positions.

    Args:
        robot: as described, or its MJCF.
        x, y, z: (nx,), (ny,), (nz,) or numbers [m]. Of a robot that joints keep in a plane or on a
            line oblique to these, they are u, v and w, along :attr:`Workspace.directions`.
        orientation: (4,) quaternion of all poses; that of the reference pose by default.
        lowest, highest: (m,) or one [N], limits of the tensions for poses that can be held.
        wrenches: (k, 6) external wrenches [N, N m]; a pose must be held under each of them.
        effects: effects of the robot: a model, its file, or effects with values. None may have a
            history if ``elastic`` is set or there are fewer cables than degrees of freedom, since
            the poses of a grid are in no order.
        elastic: whether to solve for the elastic robot's equilibrium at each pose.
        chance: whether to compute the probability that each pose can be held. That needs a model
            with a covariance, and takes a millisecond or so per pose near the edge; a tenth of a
            second where the orientation has to be found.
        progress: called as poses are done.
        executor: solves parts of the grid, as any ``concurrent.futures.Executor``: processes, or
            ``client.get_executor(retries=2, pure=False)`` of dask.distributed. The results are the
            same to the last bit. By default the threads of this process do.

    Returns:
        margins and equilibria at all poses of the grid, and why some have no equilibrium.

    Raises:
        InputError: an axis without values, an orientation that the joints do not allow, effects
            with a history, or probabilities asked for without a covariance.
        ExecutorError: the executor ended before its work; nothing is kept, see
            :func:`seecr.store_map`.

    Example:
        ``seecr.workspace_map(robot, [0.3, 0.4], [0.2, 0.3], [0.15]).margin``
    """
    limits = lowest, highest, wrenches
    job = map_job(robot, (x, y, z), orientation, limits, effects, elastic, chance)
    n, found = job.poses, job.blank()
    size = _PART if executor is None else min(max(-(-n // _TASKS), _SMALLEST), _LARGEST)
    parts = in_pieces(slice(0, n), -(-size // BLOCK) * BLOCK)
    workers = threads() if executor is None and len(parts) > 1 else executor
    try:
        with closing(as_done(job.part, parts, workers)) as results:
            for i, columns in results:
                for name, values in columns.items():
                    found[name][parts[i]] = values
                progress(parts[i].stop - parts[i].start)
    except ExecutorError as error:
        raise ExecutorError(
            f"{error}; of this map nothing is kept: --parts (seecr.store_map) keeps what is done"
        ) from None
    return job.workspace(found)


def in_pieces(part: slice, size: int) -> list[slice]:
    """A range of poses in pieces of at most so many."""
    return [slice(k, min(k + size, part.stop)) for k in range(part.start, part.stop, size)]


def map_job(
    robot: GivenRobot, axes: Sequence[ArrayLike], orientation: ArrayLike | None,
    limits: tuple[ArrayLike, ArrayLike, ArrayLike | None], effects: GivenEffects, elastic: bool,
    chance: bool,
) -> MapJob:  # fmt: skip
    """What :func:`seecr.workspace_map` is asked for, checked; arguments and errors are its own."""
    robot = robot_of(robot)
    effects = read_once(effects, robot)
    x, y, z = (_axis(name, values) for name, values in zip("xyz", axes, strict=True))
    if chance:
        check_chance(effects)
    if elastic or robot.n_driven < robot.n_dof:
        _refuse_memory(robot, effects)
    turned = robot.reference_pose[3:] if orientation is None else _quaternion(orientation)
    directions = own_directions(robot)
    refuse_unreached(robot, (x, y, z), turned, directions)
    return MapJob(robot, (x, y, z), turned, directions, effects, elastic, chance, limits)


@dataclass(frozen=True)
class MapJob:
    """What is computed at the poses of a grid; sent as one to whoever computes a part of it."""

    robot: Robot
    axes: tuple[Array, Array, Array]
    turned: Array
    directions: Array | None
    effects: GivenEffects
    elastic: bool
    chance: bool
    limits: tuple[ArrayLike, ArrayLike, ArrayLike | None]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Values on each axis."""
        x, y, z = self.axes
        return len(x), len(y), len(z)

    @property
    def poses(self) -> int:
        """Poses of the grid."""
        return math.prod(self.shape)

    def blank(self) -> dict[str, NDArray[Any]]:
        """Arrays for the results at all poses, one after the other."""
        n = self.poses
        return {
            "margin": np.empty(n), "slack": np.full(n, NEVER, np.int8),
            "moved": np.full((n, 6), np.nan, np.float32),
            "stiffness": np.full(n, np.nan, np.float32),
            "softest": np.full((n, 6), np.nan, np.float32),
            **({"likely": np.empty(n, np.float32)} if self.chance else {}),
            **({"status": np.empty(n, np.int8)} if self.elastic else {}),
        }  # fmt: skip

    def workspace(self, found: Mapping[str, NDArray[Any]]) -> Workspace:
        """The workspace of which all results are known."""
        grid = {name: values.reshape(*self.shape, *values.shape[1:])
                for name, values in found.items()}  # fmt: skip
        return Workspace(
            robot=self.robot, axes=self.axes, orientation=np.asarray(self.turned),
            margin=grid["margin"], deviation=grid["moved"][..., :3],
            rotation=grid["moved"][..., 3:], slack=grid["slack"], stiffness=grid["stiffness"],
            softest=grid["softest"], chance=grid.get("likely"), elastic=self.elastic,
            status=grid.get("status"), directions=self.directions,
        )  # fmt: skip

    def part(self, part: slice) -> dict[str, NDArray[Any]]:
        """Margins and equilibria of a range of poses, in small pieces for the sake of memory."""
        pieces = [self._piece(piece) for piece in in_pieces(part, _PART)]
        return {name: np.concatenate([one[name] for one in pieces]) for name in pieces[0]}

    def _piece(self, part: slice) -> dict[str, NDArray[Any]]:
        robot, effects, (lowest, highest, wrenches) = self.robot, self.effects, self.limits
        rows = np.arange(part.start, part.stop)
        index = np.unravel_index(rows, self.shape)
        places = np.column_stack([axis[k] for axis, k in zip(self.axes, index, strict=True)])
        places = places if self.directions is None else places @ self.directions
        poses = commanded_poses(np.column_stack([places, np.tile(self.turned, (len(rows), 1))]))
        out: dict[str, NDArray[Any]] = {}
        out["margin"] = margins_at(robot, poses, lowest, highest, wrenches, effects)
        if self.chance:
            out["likely"] = asked_chance(robot, poses, effects, lowest, highest, wrenches)
        if self.elastic:
            found = solve(robot, poses, effects=effects)
            there = found.converged
            out["status"] = codes_of(found.status)
            out["moved"] = np.where(there[:, None], found.deviation, np.nan)
            out["slack"] = np.where(there, found.slack.sum(axis=1), NEVER)
            out["stiffness"] = np.where(there, found.smallest_eigenvalue, np.nan)
            out["softest"] = np.where(there[:, None], found.softest_direction, np.nan)
        return {name: np.asarray(values, _STORED.get(name)) for name, values in out.items()}


# As results are kept, and sent.
_STORED = {
    "likely": np.float32, "moved": np.float32, "stiffness": np.float32, "softest": np.float32,
    "slack": np.int8,
}  # fmt: skip


def _refuse_memory(robot: Robot, effects: GivenEffects) -> None:
    """Refuse effects with history: their results would depend on the order of the grid."""
    names = with_history(robot, effects)
    if names:
        raise InputError(
            f"a map's poses are in no order, and {', '.join(names)} would depend on the rows "
            "before; expected a model without them, or no elastic map (only which poses can "
            "be held: --no-elastic, elastic=False)"
        )


def with_history(robot: GivenRobot, effects: GivenEffects) -> list[str]:
    """Names of the effects by which a row depends on the rows before it.

    Maps know none of them, and what one is asked for with such effects is refused.

    Args:
        robot: as described, or its MJCF. effects: a model, its file, or effects with values.

    Returns:
        their names; none if every row stands alone.

    Raises:
        InputError: something other than a robot, or than effects with values.

    Example:
        ``seecr.with_history(robot, "model.toml")``
    """
    robot = robot_of(robot)
    at_home = Experiment(robot, Commands(robot.reference_pose[None]))
    return [one.name for one in effects_of(effects, robot) if at_home.setup([one]).has_history]


def _axis(name: str, values: ArrayLike) -> Array:
    axis = np.atleast_1d(finite(values, name))
    if axis.ndim != 1 or len(axis) == 0:
        raise InputError(f"{name} must be one number or (k,) with k above zero, got {axis.shape}")
    return axis
