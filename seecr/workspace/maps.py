"""Workspaces on grids: where a platform can be held, and where an elastic robot really comes to.

Grids are gone through in parts, so that a million poses need no more memory than their answers.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.arguments import finite
from seecr.commands.data import Commands
from seecr.counted import counted
from seecr.description.given import GivenRobot, robot_of
from seecr.description.robot import Robot
from seecr.equilibrium.solving import solve
from seecr.errors import InputError
from seecr.inverse.correction import held_in_place
from seecr.pose import Array
from seecr.prediction.experiment import Experiment, effects_of
from seecr.prediction.model import GivenEffects, model_given
from seecr.result import Record, Result
from seecr.statics.starts import commanded_poses
from seecr.threads import run_parts
from seecr.workspace.chances import asked_chance, check_chance, margins_with
from seecr.workspace.zones import load_scale, tension_margin

Progress = Callable[[int], None]
"""Called with the number of poses done since the last call."""

__all__ = ["Workspace", "boundary", "default_axes", "workspace_map"]

# Poses at a time.
_PART = 5_000
# Default grid: values along an axis on which something can change.
_VALUES, _FEW = 33, 13
_NEVER = -1
_FREEDOMS = ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")


@dataclass(frozen=True, eq=False, repr=False)
class Workspace(Result):
    """What holds at the poses of a grid, (nx, ny, nz) each, of one orientation.

    Attributes:
        robot: as described.
        axes: the grid's x, y and z [m].
        orientation: (4,) quaternion of all poses.
        margin: [N] how far inside their limits all tensions can stay; below zero where the pose
            cannot be held. For robots with fewer cables than freedoms zero where the position
            can be held in some orientation, and minus infinity where not.
        deviation: (..., 3) [m] from the command to where the elastic robot rests; NaN where it
            does not; float32.
        rotation: (..., 3) [rad] likewise.
        slack: number of slack cables; -1 where it does not rest.
        stiffness: [N/m] smallest eigenvalue, rotations by the robot's length.
        softest: (..., d) [m, rad] the direction of it, :attr:`Solution.softest_direction`; float32.
        chance: the probability that the pose can be held, by what the model does not know; float32;
            None where the model keeps no covariance, or there is none.
        elastic: whether it was asked where the elastic robot comes to rest.
    """

    robot: Robot
    axes: tuple[Array, Array, Array]
    orientation: Array
    margin: Array
    deviation: NDArray[np.float32]
    rotation: NDArray[np.float32]
    slack: NDArray[np.int8]
    stiffness: NDArray[np.float32]
    softest: NDArray[np.float32]
    chance: NDArray[np.float32] | None = None
    elastic: bool = True

    def likely(self, at_least: float) -> NDArray[np.bool_]:
        """Where the pose can be held with a probability of at least that.

        Raises:
            InputError: a map without probabilities, or a number that is none.
        """
        if not 0.0 < at_least <= 1.0:
            raise InputError(f"a probability must be above 0 and at most 1, got {at_least:g}")
        if self.chance is None:
            raise InputError("this map has no probabilities; expected one made with chance=True")
        return np.asarray(self.chance >= at_least)

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Where the pose can be held by tensions within the limits."""
        return _holds(self.robot, self.margin)

    def crossings(self, poses: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Neighbours along the grid of which one is among some poses and the other is not.

        Args:
            poses: (nx, ny, nz) bool, such as ``feasible`` or ``likely(0.95)``.

        Returns:
            (k, 7) those that are, and (k, 7) those that are not: what :func:`boundary` takes.
        """
        number, inside = np.arange(poses.size).reshape(poses.shape), poses.ravel()
        pairs = np.concatenate([
            np.stack([np.delete(number, -1, k).ravel(), np.delete(number, 0, k).ravel()], axis=1)
            for k in range(3)
        ])  # fmt: skip
        pairs = pairs[inside[pairs[:, 0]] != inside[pairs[:, 1]]]
        pairs = np.where(inside[pairs[:, :1]], pairs, pairs[:, ::-1])
        index = np.unravel_index(pairs, poses.shape)
        places = np.stack([axis[k] for axis, k in zip(self.axes, index, strict=True)], axis=-1)
        turned = np.broadcast_to(self.orientation, (*pairs.shape, 4))
        both = np.concatenate([places, turned], axis=-1)
        return both[:, 0], both[:, 1]

    @property
    def rests(self) -> NDArray[np.bool_]:
        """Where the elastic robot comes to rest, if the elastic map was asked for."""
        return np.asarray(self.slack != _NEVER)

    @property
    def cell(self) -> float:
        """Size of a cell of the grid: [m^3], or [m^2] or [m] where an axis has one value."""
        steps = [np.ptp(axis) / (len(axis) - 1) for axis in self.axes if len(axis) > 1]
        return float(np.prod(steps))

    @property
    def shares(self) -> Array:
        """(nx, ny, nz) size of the grid's box that each pose stands for, [m^3], [m^2] or [m].

        Half a cell at the ends of an axis: all of them together are the box between the ends.
        """
        along = []
        for axis in self.axes:
            step = np.abs(np.diff(axis))
            along.append(0.5 * (np.r_[step, 0.0] + np.r_[0.0, step]) if len(step) else np.ones(1))
        return np.asarray(np.einsum("i,j,k->ijk", *along))

    def size(self, poses: NDArray[np.bool_]) -> float:
        """Size of the part of the grid's box that some poses (nx, ny, nz) stand for."""
        return float(self.shares[poses].sum())

    @property
    def softest_at(self) -> tuple[int, ...] | None:
        """Where of the grid the elastic robot is softest of all poses that can be held."""
        stiffness = np.where(self.feasible & self.rests, self.stiffness, np.nan)
        if not np.isfinite(stiffness).any():
            return None
        return tuple(map(int, np.unravel_index(np.nanargmin(stiffness), stiffness.shape)))

    def size_words(self, poses: NDArray[np.bool_]) -> str:
        """The size of some poses (nx, ny, nz) of the grid, for people."""
        along = sum(len(axis) > 1 for axis in self.axes)
        unit = {1: " m", 2: " m^2", 3: " m^3"}.get(along)
        return "" if unit is None else f", {self.size(poses):.4g}{unit}"

    def lines(self) -> list[str]:
        """How much of the grid can be held, and how far off the elastic robot is there."""
        n, held = self.margin.size, int(self.feasible.sum())
        size = self.size_words(self.feasible)
        out = [f"{self.robot.name}: {held} of {counted(n, 'pose')} can be held{size}"]
        half = float(np.median(self.margin[self.feasible])) if held else 0.0
        if half == np.inf:
            out.append("at half of them or more all cables can be tightened without end")
        elif half > 0.0:
            out.append(
                f"at half of them tensions can stay {half:.3g} N or more inside their limits"
            )
        rests = self.rests
        if self.elastic:
            counts = self.slack[rests]
            parts = [f"{k} at {int(np.sum(counts == k))}" for k in np.unique(counts)]
            slack = f"; slack cables: {', '.join(parts)}" if parts else ""
            out.append(f"elastic: at rest at {int(rests.sum())} of {counted(n, 'command')}{slack}")
            where = rests & self.feasible
            if np.any(where):
                away = 1e3 * np.linalg.norm(self.deviation[where], axis=-1).max()
                turn = np.degrees(np.linalg.norm(self.rotation[where], axis=-1).max())
                out.append(f"where poses can be held, up to {away:.4g} mm and {turn:.4g} deg off")
        return out

    def records(self) -> list[Record]:
        """One row per pose of the grid."""
        places = np.stack(np.meshgrid(*self.axes, indexing="ij"), axis=-1).reshape(-1, 3)
        columns = {
            **{f"{axis}_m": places[:, k] for k, axis in enumerate("xyz")},
            "margin_N": self.margin.ravel(),
            "feasible": self.feasible.ravel(),
            **({} if self.chance is None else {"probability": self.chance.ravel()}),
            "slack": self.slack.ravel(),
            **{f"d{a}_m": self.deviation[..., k].ravel() for k, a in enumerate("xyz")},
            **{f"r{a}_rad": self.rotation[..., k].ravel() for k, a in enumerate("xyz")},
            "smallest_eigenvalue_N_per_m": self.stiffness.ravel(),
            **{
                f"softest_{name}": self.softest[..., k].ravel()
                for k, name in enumerate([j.name for j in self.robot.joints] or _FREEDOMS)
            },
        }
        listed = {name: values.tolist() for name, values in columns.items()}
        return [dict(zip(listed, row, strict=True)) for row in zip(*listed.values(), strict=True)]

    def as_json(self, at_least: float | None = None) -> Record:
        """``map.json``: how much of the grid can be held, and the worst of the elastic robot there.

        Args:
            at_least: a probability with which poses are to be held, of a map that has them.
        """
        likely = None
        if at_least is not None:
            some = self.likely(at_least)
            likely = {"at_least": at_least, "poses": int(some.sum()), "size": self.size(some)}
        where = self.rests & self.feasible
        worst = {
            "deviation_m": np.linalg.norm(self.deviation[where], axis=-1),
            "rotation_rad": np.linalg.norm(self.rotation[where], axis=-1),
        }
        counts, at = self.slack[self.rests], self.softest_at
        return {
            "robot": self.robot.name,
            "shape": self.margin.shape,
            "orientation": self.orientation,
            "poses": self.margin.size,
            "feasible": int(self.feasible.sum()),
            "cell": self.cell,
            "size_feasible": self.size(self.feasible),
            "likely": likely,
            "rests": int(self.rests.sum()),
            "slack": {k: int(np.sum(counts == k)) for k in np.unique(counts)},
            "worst_where_feasible": {
                name: float(values.max()) if len(values) else None for name, values in worst.items()
            },
            "softest_where_feasible": at
            and {
                "pose_m": [axis[k] for axis, k in zip(self.axes, at, strict=True)],
                "smallest_eigenvalue_N_per_m": self.stiffness[at],
                "direction": self.softest[at],
            },
        }


def default_axes(robot: GivenRobot, values: int | None = None) -> tuple[Array, Array, Array]:
    """A grid between the exit points, as far below the reference pose as they are above it."""
    robot = robot_of(robot)
    if values is None:
        # robots with too few cables are solved for their orientation, which takes a while
        values = _VALUES if robot.n_cables >= robot.n_dof else _FEW
    points = np.concatenate([robot.exit_points, robot.reference_pose[None, :3]])
    low, high = points.min(axis=0), points.max(axis=0)
    mirrored = 2.0 * robot.reference_pose[:3] - high
    down = np.abs(robot.up) > 0.5
    low = np.where(down, np.minimum(low, mirrored), low)
    return tuple(
        np.linspace(a, b, values) if b - a > 1e-9 * robot.length else np.array([a])
        for a, b in zip(low, high, strict=True)
    )  # type: ignore[return-value]


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
    progress: Progress | None = None,
) -> Workspace:
    """The static-feasible and the elastic workspace on a grid of positions.

    Args:
        robot: as described, or its MJCF.
        x, y, z: (nx,), (ny,), (nz,) or numbers [m].
        orientation: (4,) quaternion of all poses; that of the reference pose by default.
        lowest, highest: (m,) or one [N], limits of the tensions for what can be held.
        wrenches: (k, 6) set of external wrenches that it must be held under, each of them.
        effects: of the robot, besides; where the elastic robot is solved none may have a memory of
            rows before, since poses of a grid are in no order. With a model that
            keeps its covariance, and as many cables as freedoms, each pose has its ``chance`` too,
            if asked for.
        elastic: whether to solve where the elastic robot comes to rest.
        chance: whether to find how likely each pose can be held; takes a millisecond or so per
            pose near the edge.
        progress: called as poses are done.

    Raises:
        InputError: an axis without values, an orientation that the joints do not allow; effects
            with a memory; a chance asked of something without a covariance.
    """
    robot = robot_of(robot)
    effects = _read_once(effects, robot)
    axes = (_axis("x", x), _axis("y", y), _axis("z", z))
    if chance:
        check_chance(robot, effects)
    if elastic or robot.n_cables < robot.n_dof:
        _refuse_memory(robot, effects)
    turned = robot.reference_pose[3:] if orientation is None else finite(orientation, "orientation")
    shape = (len(axes[0]), len(axes[1]), len(axes[2]))
    n = int(np.prod(shape))
    margin, slack = np.empty(n), np.full(n, _NEVER, dtype=np.int8)
    likely = np.empty(n, np.float32) if chance else None
    moved, stiffness = np.full((n, 6), np.nan, np.float32), np.full(n, np.nan, np.float32)
    softest = np.full((n, robot.n_dof), np.nan, np.float32)

    def fill(part: slice) -> None:
        rows = np.arange(part.start, part.stop)
        index = np.unravel_index(rows, shape)
        places = np.column_stack([axis[k] for axis, k in zip(axes, index, strict=True)])
        poses = commanded_poses(np.column_stack([places, np.tile(turned, (len(rows), 1))]))
        margin[rows] = _margins(robot, poses, lowest, highest, wrenches, effects)
        if likely is not None:
            likely[rows] = asked_chance(robot, poses, effects, lowest, highest, wrenches)
        if elastic:
            found = solve(robot, poses, effects=effects)
            there = found.converged
            moved[rows[there]] = found.deviation[there]
            slack[rows[there]] = found.slack[there].sum(axis=1)
            stiffness[rows] = np.where(there, found.smallest_eigenvalue, np.nan)
            softest[rows[there]] = found.softest_direction[there]

    _run_telling(fill, [slice(k, min(k + _PART, n)) for k in range(0, n, _PART)], progress)
    return Workspace(
        robot, axes, np.asarray(turned), margin.reshape(shape),
        moved[:, :3].reshape(*shape, 3), moved[:, 3:].reshape(*shape, 3),
        slack.reshape(shape), stiffness.reshape(shape), softest.reshape(*shape, -1),
        None if likely is None else likely.reshape(shape), elastic,
    )  # fmt: skip


def _read_once(effects: GivenEffects, robot: Robot) -> GivenEffects:
    """The same, a model read from its file: the parts of a map all ask for it."""
    return model_given(effects, robot) if isinstance(effects, str | Path) else effects


def _refuse_memory(robot: Robot, effects: GivenEffects) -> None:
    """Refuse what would go along the grid from pose to pose, and come out by the grid's order."""
    home = Commands(robot.reference_pose[None])
    acting = effects_of(effects, robot)
    if Experiment(robot, home).setup(acting).has_history:
        names = [one.name for one in acting if Experiment(robot, home).setup([one]).has_history]
        raise InputError(
            f"a map's poses are in no order, and {', '.join(names)} would go by the rows before; "
            "expected a model without them, or for what can be held alone no elastic map"
        )


def _run_telling(
    fill: Callable[[slice], None], parts: list[slice], progress: Progress | None
) -> None:
    """Fill all parts in several threads; the caller's tells of what is done, in any of them."""
    if progress is None:
        return run_parts(fill, parts)
    here, done = threading.current_thread(), SimpleQueue[int]()

    def tell() -> None:
        progress(sum(done.get() for _ in range(done.qsize())))

    def one(part: slice) -> None:
        fill(part)
        done.put(part.stop - part.start)
        if threading.current_thread() is here:
            tell()

    run_parts(one, parts)
    if not done.empty():
        tell()


def _margins(
    robot: Robot, poses: Array, lowest: ArrayLike, highest: ArrayLike,
    wrenches: ArrayLike | None, effects: GivenEffects,
) -> Array:  # fmt: skip
    """Margins (n,) [N]; of robots with too few cables by position, the orientation solved."""
    acting = effects_of(effects, robot)
    if robot.n_cables >= robot.n_dof:
        if acting:
            return margins_with(robot, poses, acting, lowest, highest, wrenches)
        return tension_margin(robot, poses, lowest=lowest, highest=highest, wrenches=wrenches)
    if wrenches is not None:
        raise InputError(
            f"{robot.name} has fewer cables than freedoms: it holds no set of wrenches; "
            "expected none"
        )
    return np.where(held_in_place(robot, poses, acting, lowest, highest), 0.0, -np.inf)


def _holds(robot: Robot, margin: Array) -> NDArray[np.bool_]:
    """Whether margins [N] are those of poses that can be held, but for rounding."""
    return np.asarray(margin >= -1e-9 * load_scale(robot))


def _axis(name: str, values: ArrayLike) -> Array:
    axis = np.atleast_1d(finite(values, name))
    if axis.ndim != 1 or len(axis) == 0:
        raise InputError(f"{name} must be one number or (k,) with k above zero, got {axis.shape}")
    return axis


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
    """Where the ways from poses that can be held to poses that cannot leave the workspace.

    By bisection on straight ways of the position.

    Args:
        robot: as described, or its MJCF.
        inside, outside: (n, 7) poses, of the same orientation in each row.
        tolerance: [m] within which the boundary is found.
        lowest, highest, wrenches: as in :func:`seecr.tension_margin`.
        effects: of the robot, besides.
        at_least: take for held what is held with this probability, by what a model that keeps its
            covariance does not know; without it, what is held with the model's own values.

    Returns:
        (n, 7), the last poses found that can be held; of no ways none.

    Raises:
        InputError: a pose that is not on the side it is said to be; a tolerance that is none; a
            probability asked of something without a covariance.
    """
    robot = robot_of(robot)
    if not 0.0 < tolerance < np.inf:
        raise InputError(f"an edge's tolerance [m] must be above 0 and finite, got {tolerance:g}")
    effects = _read_once(effects, robot)
    near, far = commanded_poses(inside, "inside"), commanded_poses(outside, "outside")

    def held(poses: Array) -> NDArray[np.bool_]:
        if at_least is not None:
            chance = asked_chance(robot, poses, effects, lowest, highest, wrenches)
            return np.asarray(chance >= at_least)
        return _holds(robot, _margins(robot, poses, lowest, highest, wrenches, effects))

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
