"""The paper's section III-B typed out in NumPy, step by step: a truth that shares no code.

Forces and moments are in newtons and newton-metres, unscaled, and angles are a rotation vector
applied from the left, as the paper's fsolve would see them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from seecr.compiled.columns import GAP
from seecr.description.robot import Robot
from seecr.statics.solution import Solution


@dataclass
class Plain:
    """What SciPy's fsolve made of one pose."""

    deviation: np.ndarray  # (6,)
    ok: bool  # ier == 1
    calls: int


def wrench(robot: Robot, pose: np.ndarray, deviation: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """W tau + w_e at the platform origin (eqs 3, 4, 7 to 11), (6,) [N, N m]."""
    turn = Rotation.from_rotvec(deviation[3:]).as_matrix()
    turn = turn @ Rotation.from_quat(pose[[4, 5, 6, 3]]).as_matrix()
    arms = robot.anchor_points @ turn.T
    cables = robot.exit_points - (pose[:3] + deviation[:3] + arms)
    lengths = np.linalg.norm(cables, axis=1)
    tension = np.maximum(robot.ea * (lengths - rest) / rest, 0.0)
    pulls = tension[:, None] * cables / lengths[:, None]
    weight = robot.mass * robot.gravity
    moment = np.cross(arms, pulls).sum(axis=0) + np.cross(turn @ robot.centre_of_mass, weight)
    return np.concatenate([pulls.sum(axis=0) + weight, moment])


def rest_lengths(robot: Robot, pose: np.ndarray) -> np.ndarray:
    """Eqs 1 and 2, (m,) [m]."""
    turn = Rotation.from_quat(pose[[4, 5, 6, 3]]).as_matrix()
    return np.linalg.norm(robot.exit_points - (robot.anchor_points @ turn.T + pose[:3]), axis=1)


def plain_fsolve(robot: Robot, pose: np.ndarray, start: np.ndarray | None = None) -> Plain:
    """Steps 1 to 10 with fsolve, from the paper's first guess or from a deviation (6,)."""
    rest = rest_lengths(robot, pose)
    if start is None:
        height = np.mean(robot.exit_points[:, 2] - robot.anchor_points[:, 2] - pose[2])
        fall = robot.mass * 9.81 * height / robot.ea[0]
        start = np.array([0.0, 0.0, -fall, 0.0, 0.0, 0.0])
    found, info, flag, _ = fsolve(lambda d: wrench(robot, pose, d, rest), start, full_output=True)
    return Plain(found, flag == 1, info["nfev"])


def exact_residual(answer: Solution, i: int, extra: np.ndarray | float = 0.0) -> float:
    """Unbalanced load at answer i, relative to the weight, torques over the robot's length.

    From command, deviation and rest lengths alone, in extended precision, so that neither
    rounding nor the solver's own bookkeeping hides anything. A platform on joints has only
    their work balanced: what they carry themselves is projected out. ``extra`` is an external
    moment (3,) [N m].
    """
    wide = np.longdouble
    robot, pose, deviation = answer.robot, answer.command[i], answer.deviation[i]
    command = _matrix(pose[3:].astype(wide))
    turn = _from_rotvec(deviation[3:].astype(wide)) @ command
    before = robot.anchor_points.astype(wide) @ command.T + pose[:3].astype(wide)
    arms = robot.anchor_points.astype(wide) @ turn.T
    place = pose[:3].astype(wide) + deviation[:3].astype(wide)
    # a rest length is known to more digits by what it lacks to the straight length
    gap = answer.tables.cables[i, :, GAP]
    rest = _norms(robot.exit_points - before) - gap
    assert np.max(np.abs(rest - answer.rest_lengths[i])) < 1e-14 * np.max(rest)
    cables = robot.exit_points - (place + arms)
    lengths = _norms(cables)
    tension = np.maximum(robot.ea * (lengths - rest) / rest, 0)
    pulls = tension[:, None] * cables / lengths[:, None]
    weight = (robot.mass * robot.gravity).astype(wide)
    moment = _cross(arms, pulls).sum(axis=0) + _cross(turn @ robot.centre_of_mass, weight)
    moment = moment + extra
    force = pulls.sum(axis=0) + weight
    if robot.joints:
        return _on_joints(robot, pose, deviation, force.astype(float), moment.astype(float))
    torque = float(np.sqrt(np.sum(moment**2))) / robot.length
    return max(float(np.sqrt(np.sum(force**2))), torque) / robot.weight


def _on_joints(
    robot: Robot, pose: np.ndarray, deviation: np.ndarray, force: np.ndarray, moment: np.ndarray
) -> float:
    from seecr.description.joints import values_of_pose
    from seecr.pose import pose_add

    now = pose_add(pose, deviation)
    _, screws = values_of_pose(robot, now[None])
    work = []
    for kind, *numbers in screws[0]:
        axis, point = np.array(numbers[:3]), np.array(numbers[3:])
        if kind == 0.0:
            work.append(axis @ force)
        else:
            work.append(axis @ (moment + np.cross(now[:3] - point, force)) / robot.length)
    return float(np.linalg.norm(work)) / robot.weight


def _norms(rows: np.ndarray) -> np.ndarray:
    return np.sqrt(np.sum(rows**2, axis=-1))


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def _matrix(quat_wxyz: np.ndarray) -> np.ndarray:
    w, x, y, z = quat_wxyz / np.sqrt(np.sum(quat_wxyz**2))
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def _from_rotvec(rotvec: np.ndarray) -> np.ndarray:
    """Rodrigues' formula."""
    angle = np.sqrt(np.sum(rotvec**2))
    if angle == 0:
        return np.eye(3, dtype=rotvec.dtype)
    x, y, z = rotvec / angle
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    # 1 - cos without cancellation
    return np.eye(3) + np.sin(angle) * across + 2 * np.sin(angle / 2) ** 2 * (across @ across)
