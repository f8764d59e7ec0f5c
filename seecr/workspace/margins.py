"""Where a robot can hold its platform, and where its cables go slack.

The static-feasible workspace (SFW) is the set of poses at which non-negative tensions balance the
load (paper, eq 3, Figs 10 and 11). The elasticity of the cables does not change it: the SFW is
about the tensions that are possible at a pose, not about whether the platform comes to rest there
when it is commanded to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.arguments import finite, numbers
from seecr.commands import Commands
from seecr.compiled.columns import EXTERNAL_FORCE, EXTERNAL_MOMENT
from seecr.counted import counted
from seecr.description.joints import motion_columns, values_of_pose
from seecr.description.mjcf import GivenRobot, robot_of
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.parallel import in_parts
from seecr.pose import Array, all_finite, quat_rotate, transform_points
from seecr.prediction.experiment import Experiment, effects_of
from seecr.result import Record, Result
from seecr.statics.solution import Solution, check_solution
from seecr.statics.starts import commanded_poses
from seecr.statics.tables import Tables, assemble
from seecr.tensions.balance import balance_of, bends, driven_tables
from seecr.tensions.distribution import tension_limits
from seecr.tensions.max_margin import margins_inside

if TYPE_CHECKING:
    from seecr.prediction.model import GivenEffects

# Part of the load that may stay unbalanced, by rounding of the tensions.
_BALANCED = 1e-9
# Singular values of W below this part of the largest count as zero.
_SINGULAR = 1e-9


@dataclass(frozen=True, repr=False)
class Zone(Result):
    """Consecutive poses of a trajectory with the same number of slack cables.

    Attributes:
        first: index of its first pose.
        last: index of its last pose.
        slack: number of slack cables; None where the solve did not converge.
    """

    first: int
    last: int
    slack: int | None

    def lines(self) -> list[str]:
        """One line: which poses, and how many cables are slack there."""
        one, last = self.first == self.last, self.last
        poses = f"pose {last}" if one else f"poses {self.first} to {last}"
        count = "no answer" if self.slack is None else counted(self.slack, "slack cable")
        return [f"{poses}: {count}"]

    def as_json(self) -> Record:
        """Its only row."""
        return self.records()[0]

    def records(self) -> Sequence[Record]:
        """One row."""
        return [{"first_pose": self.first, "last_pose": self.last, "slack_cables": self.slack}]


def feasible(
    robot: GivenRobot,
    poses: ArrayLike,
    *,
    wrench: ArrayLike | None = None,
    wrenches: ArrayLike | None = None,
    lowest: ArrayLike = 0.0,
    highest: ArrayLike = np.inf,
    effects: GivenEffects = (),
) -> NDArray[np.bool_]:
    """Whether tensions within bounds can balance the load: W tau + w_e = 0 (paper, eq 3).

    Args:
        robot: as described, or its MJCF; its mass, centre of mass and gravity are the load.
        poses: (n, 7) or (7,), actual poses of the platform.
        wrench: (6,) or (n, 6) external force [N] at the platform origin and moment [N m].
        wrenches: (k, 6) a set of wrenches, each in addition to ``wrench``; the load must be
            balanced under each of them.
        lowest: (m,) or one [N], not negative.
        highest: (m,) or one [N]; infinite for none.
        effects: effects of the robot: a model, its file, or effects with values.

    Returns:
        (n,) bool.

    Raises:
        InputError: wrong shapes, numbers that are not finite, quaternions that are no rotations,
            limits that contradict each other, or something other than effects with values.
        InputFileError: there is no such file, or it holds no model of this robot.

    Example:
        ``seecr.feasible(robot, poses, lowest=0.5, highest=50.0)``
    """
    robot = robot_of(robot)
    margin = tension_margin(
        robot, poses, wrench=wrench, wrenches=wrenches, lowest=lowest, highest=highest,
        effects=effects,
    )  # fmt: skip
    return is_held(robot, margin)


def tension_margin(
    robot: GivenRobot,
    poses: ArrayLike,
    *,
    wrench: ArrayLike | None = None,
    wrenches: ArrayLike | None = None,
    lowest: ArrayLike = 0.0,
    highest: ArrayLike = np.inf,
    effects: GivenEffects = (),
) -> Array:
    """How far inside their bounds all tensions that balance the load can stay [N].

    It is exact: the largest t with lowest + t <= tau <= highest - t and W tau + w_e = 0. It is
    negative if tensions within bounds cannot balance the load, and infinite if cables can be
    tightened without limit. A cable with weight pulls at least about what it weighs; if a pose can
    only be held with less, by cables that hang loosely, the margin is zero, and negative ones count
    from what such cables weigh.

    Args:
        robot, poses, wrench, lowest, highest: as for :func:`feasible`.
        wrenches: (k, 6) a set of wrenches, each in addition to ``wrench``; the smallest margin
            counts. All wrenches in their convex hull can then be balanced as well.
        effects: as there. If cables have weight or yield, their balance is not linear in the
            tensions; it is then solved in rounds.

    Returns:
        (n,) [N]; minus infinity if W is singular or there are too few cables, and no tensions
        within bounds balance the load.

    Raises:
        InputError, InputFileError: as for :func:`feasible`.

    Example:
        ``seecr.tension_margin(robot, poses, lowest=0.5, highest=50.0)``
    """
    from seecr.compiled.tensions import margins_at  # takes a while to import

    robot = robot_of(robot)
    places = commanded_poses(poses, robot=robot)
    low, high = tension_limits(robot, lowest, highest)
    if wrench is not None:
        wrench = _wrench(wrench, len(places))
    acting = effects_of(effects, robot)
    if acting or not robot.all_driven:
        return margins_with(robot, places, acting, lowest, highest, wrenches, wrench)
    out, scale = np.full(len(places), np.nan), load_scale(robot)
    by_row = wrench is not None and np.ndim(wrench) == 2
    if not (robot.joints or by_row or robot.n_driven < robot.n_dof):
        some = np.zeros((1, 6)) if wrenches is None else wrenches_of(wrenches)
        some = some if wrench is None else some + wrenches_of(wrench)
        in_parts(
            lambda part: margins_at(
                places[part], robot.exit_points, robot.anchor_points, robot.centre_of_mass,
                robot.mass * robot.gravity, some, low, high, robot.length, scale, out[part],
            ),
            len(places),
        )  # fmt: skip
    left = np.flatnonzero(np.isnan(out))
    if len(left):
        own = np.asarray(wrench)[left] if by_row else wrench
        out[left] = margins_from(*_loads(robot, places[left], own, wrenches), low, high, scale)
    return out


def margins_with(
    robot: Robot, poses: Array, effects: GivenEffects, lowest: ArrayLike = 0.0,
    highest: ArrayLike = np.inf, wrenches: ArrayLike | None = None, wrench: Array | None = None,
) -> Array:  # fmt: skip
    """Margins (n,) [N] of :func:`seecr.tension_margin`, of a robot with effects."""
    low, high = tension_limits(robot, lowest, highest)
    told = Commands(poses, lengths=robot.commanded_lengths(poses), told=True)
    tables = assemble(Experiment(robot, told).setup(effects_of(effects, robot)))
    tables = driven_tables(tables, robot)
    if wrench is not None:
        tables = _pushed(tables, wrench)
    some = np.zeros((1, 6)) if wrenches is None else wrenches_of(wrenches)
    if bends(tables):
        every = [margins_inside(_pushed(tables, one), low, high) for one in some]
        return np.asarray(np.min(every, axis=0))
    matrices, load = balance_of(tables, low)
    # load of -W tau = w: the signs are those of the gradient
    loads = load[:, None]
    if robot.joints and wrenches is not None:
        # of a wrench only that along the joints must be balanced
        loads = np.stack([balance_of(_pushed(tables, one), low)[1] for one in some], axis=1)
    elif wrenches is not None:
        loads = loads + some * np.where(robot.hinges, 1.0 / robot.length, 1.0)
    return margins_from(matrices, np.ascontiguousarray(loads), low, high, load_scale(robot))


def _pushed(tables: Tables, wrench: Array) -> Tables:
    """The same tables with an additional external wrench at the platform's origin.

    Args:
        tables: of n poses. wrench: (6,) or (n, 6) [N, N m].
    """
    load = tables.load.copy()
    load[:, EXTERNAL_FORCE : EXTERNAL_FORCE + 3] += wrench[..., :3]
    load[:, EXTERNAL_MOMENT : EXTERNAL_MOMENT + 3] += wrench[..., 3:]
    return replace(tables, load=load)


def margins_from(matrices: Array, loads: Array, low: Array, high: Array, scale: float) -> Array:
    """Margins (n,) [N] of the balance A tau = load, for matrices (n, d, m) and loads (n, k, d).

    Torques are over the robot's length; the smallest margin of k loads counts. Rounding is measured
    against the load ``scale`` [N].
    """
    from seecr.compiled.tensions import margins_of  # takes a while to import

    matrices, out = np.ascontiguousarray(matrices), np.full(len(matrices), np.nan)
    limits = low[None], high[None], np.array([scale])
    if matrices.shape[2] >= matrices.shape[1]:
        in_parts(
            lambda part: margins_of(matrices[part], loads[part], *limits, out[part]),
            len(out),
        )
    odd = np.flatnonzero(np.isnan(out))
    if len(odd):
        out[odd] = _by_rank(matrices[odd], loads[odd], low, high, scale)
    return out


def is_held(robot: Robot, margin: Array) -> NDArray[np.bool_]:
    """Whether margins [N] mean that a pose can be held, to within rounding."""
    return np.asarray(margin >= -_BALANCED * load_scale(robot))


def load_scale(robot: Robot) -> float:
    """Load [N] that rounding is measured against: the weight, else a thousandth of E S."""
    return robot.weight or 1e-3 * float(np.max(robot.ea))


def _loads(
    robot: Robot, poses: Array, wrench: ArrayLike | None, wrenches: ArrayLike | None
) -> tuple[Array, Array]:
    """Matrix (n, d, m) and loads (n, k, d) of the balance under each of k wrenches."""
    matrix, load = balance_equations(robot, poses, wrench)
    if wrenches is None:
        return np.array(matrix, order="C"), load[:, None]
    every = [balance_equations(robot, poses, one)[1] for one in wrenches_of(wrenches)]
    at_rest = balance_equations(robot, poses)[1]
    return np.array(matrix, order="C"), np.stack(every, axis=1) + (load - at_rest)[:, None]


def _by_rank(matrices: Array, loads: Array, low: Array, high: Array, scale: float) -> Array:
    """Margins (n,) where W is singular: the balance is reduced to the range of W.

    Minus infinity if the load is outside that range, or if numbers are not finite because a cable's
    equations have no solution.
    """
    from seecr.compiled.tensions import margins_of  # takes a while to import

    out = np.full(len(matrices), -np.inf)
    sound = np.isfinite(matrices).all(axis=(1, 2)) & np.isfinite(loads).all(axis=(1, 2))
    rows = np.flatnonzero(sound)
    limits = low[None], high[None], np.array([scale])
    left, sizes, _right = np.linalg.svd(matrices[rows], full_matrices=False)
    rank = np.sum(sizes > _SINGULAR * sizes[:, :1], axis=1)
    for r in np.unique(rank[rank > 0]):
        own, base = rows[rank == r], left[rank == r, :, :r]
        inside = loads[own] @ base
        beyond = np.linalg.norm(loads[own] - inside @ base.swapaxes(1, 2), axis=2)
        size = np.linalg.norm(loads[own], axis=2)
        held = np.flatnonzero((beyond <= _BALANCED * size).all(axis=1))
        reduced = np.ascontiguousarray(base.swapaxes(1, 2) @ matrices[own])[held]
        found = np.full(len(held), np.nan)
        margins_of(reduced, np.ascontiguousarray(inside[held]), *limits, found)
        out[own[held]] = np.where(np.isnan(found), -np.inf, found)
    return out


def _wrench(value: ArrayLike, n: int) -> Array:
    wrench = numbers(value, "wrench")
    if wrench.shape not in ((6,), (n, 6)) or not all_finite(wrench):
        raise InputError(f"wrench must be (6,) or ({n}, 6) finite numbers, got {wrench.shape}")
    return wrench


def wrenches_of(values: ArrayLike) -> Array:
    """A set of wrenches (k, 6) [N, N m].

    Raises:
        InputError: another shape, none, or numbers that are not finite.
    """
    some = np.atleast_2d(finite(values, "wrenches [N, N m]"))
    if some.size == 0:
        raise InputError(f"wrenches: expected one or more, (k, 6) [N, N m], got {np.shape(values)}")
    if some.ndim != 2 or some.shape[1] != 6:
        raise InputError(f"wrenches must be (k, 6) [N, N m], got {np.shape(values)}")
    return some


def slack_zones(solution: Solution) -> list[Zone]:
    """The zones of a trajectory by number of slack cables, in order (paper, Figs 7 and 11).

    Args:
        solution: of the trajectory's poses in their order.

    Returns:
        the zones, each with its rows.

    Raises:
        InputError: not a solution.

    Example:
        ``seecr.slack_zones(solution)``
    """
    check_solution(solution)
    counts = [
        int(row.sum()) if ok else None
        for row, ok in zip(solution.slack, solution.converged, strict=True)
    ]
    edges = [0, *(i for i in range(1, len(counts)) if counts[i] != counts[i - 1]), len(counts)]
    return [
        Zone(first, after - 1, counts[first]) for first, after in pairwise(edges) if after > first
    ]


def wrench_matrix(robot: Robot, poses: ArrayLike) -> Array:
    """W of eq 4 at poses (n, 7): unit vectors over moments at the platform origin, (n, 6, m)."""
    places = commanded_poses(poses, robot=robot)
    anchors = transform_points(places, robot.anchor_points)
    cables = robot.exit_points - anchors
    size = np.linalg.norm(cables, axis=-1, keepdims=True)
    # a cable of zero length has no direction
    unit = cables / np.where(size > 0.0, size, np.inf)
    moment = np.cross(anchors - places[:, None, :3], unit)
    return np.swapaxes(np.concatenate([unit, moment], axis=-1), 1, 2)


def balance_equations(
    robot: Robot, poses: Array, wrench: ArrayLike | None = None
) -> tuple[Array, Array]:
    """The balance W tau = load, (n, d, m) and (n, d), with torques over the robot's length."""
    n = len(poses)
    outer = np.zeros(6) if wrench is None else _wrench(wrench, n)
    weight = robot.mass * robot.gravity
    arm = quat_rotate(poses[:, 3:], robot.centre_of_mass)
    load = outer + np.concatenate([np.tile(weight, (n, 1)), np.cross(arm, weight)], axis=1)
    matrix = wrench_matrix(robot, poses)
    if not robot.joints:
        unit = np.where(robot.hinges, 1.0 / robot.length, 1.0)
        return matrix * unit[:, None], -load * unit
    # joints carry the wrench that does no work along their motions; only the rest must be balanced
    columns = motion_columns(values_of_pose(robot, poses)[1], poses[:, :3])
    columns = columns * np.where(robot.hinges, 1.0 / robot.length, 1.0)
    along = np.swapaxes(columns, 1, 2)
    return along @ matrix, -np.einsum("ndk,nk->nd", along, load)
