"""Robots nobody has seen before, and their MJCF: 3 to 12 cables, free, planar or on joints."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from seecr.description.robot import Joint, Robot
from seecr.pose import quat_from_rotvec, quat_rotate

KINDS = ("free", "planar", "jointed")


def random_robot(rng: np.random.Generator, kind: str = "free", cables: int | None = None) -> Robot:
    """A suspended robot: exit points above, a platform of any size, mass and stiffness below."""
    m = int(rng.integers(3, 13)) if cables is None else cables
    size = 10 ** rng.uniform(-0.3, 1.0)
    exits = size * np.column_stack([rng.uniform(-1, 1, (m, 2)), rng.uniform(0.5, 1.2, m)])
    # the first three stand around the middle, so that the platform hangs between them
    around = 2 * np.pi * (np.arange(3) / 3 + rng.uniform(0, 0.2, 3))
    exits[:3, :2] = size * 0.8 * np.column_stack([np.cos(around), np.sin(around)])
    anchors = 0.12 * size * rng.uniform(-1, 1, (m, 3))
    anchors[:3, :2] = 0.15 * exits[:3, :2]
    centre = 0.02 * size * rng.uniform(-1, 1, 3)
    reference = np.concatenate([0.1 * size * rng.uniform(-1, 1, 3),
                                quat_from_rotvec(rng.uniform(-0.3, 0.3, 3))])  # fmt: skip
    joints: tuple[Joint, ...] = ()
    if kind == "planar":
        exits[:, 1] = anchors[:, 1] = centre[1] = reference[1] = 0.0
        exits[:2, 0] = size * np.array([-0.8, 0.8])
        reference[3:] = [1.0, 0.0, 0.0, 0.0]
        joints = _planar_joints(reference[:3])
    elif kind == "jointed":
        joints = _random_joints(rng, reference[:3], size)
    mass = 10 ** rng.uniform(-1, 2)
    robot = Robot(
        name=f"random_{kind}", exit_points=exits, anchor_points=anchors,
        ea=mass * 9.81 * 10 ** rng.uniform(1.5, 4.0) * rng.uniform(0.5, 2.0, m),
        rest_lengths=np.ones(m), mass=mass, centre_of_mass=centre, reference_pose=reference,
        joints=joints,
    )  # fmt: skip
    lengths = robot.nominal_lengths(reference[None])[0]
    return with_rest_lengths(robot, lengths)


def with_rest_lengths(robot: Robot, lengths: np.ndarray) -> Robot:
    from dataclasses import replace

    return replace(robot, rest_lengths=lengths)


def _planar_joints(point: np.ndarray) -> tuple[Joint, ...]:
    return (
        Joint("slide", "x", np.array([1.0, 0.0, 0.0]), point),
        Joint("slide", "z", np.array([0.0, 0.0, 1.0]), point),
        Joint("hinge", "tilt", np.array([0.0, 1.0, 0.0]), point),
    )


def _random_joints(rng: np.random.Generator, point: np.ndarray, size: float) -> tuple[Joint, ...]:
    """Two to five joints in any order, hinges with axes and points of any direction."""
    slides = list(np.eye(3)[rng.permutation(3)[: int(rng.integers(1, 4))]])
    joints = [Joint("slide", f"s{i}", axis, point) for i, axis in enumerate(slides)]
    for i in range(int(rng.integers(1, 3))):
        axis = rng.normal(size=3)
        place = point + 0.1 * size * rng.uniform(-1, 1, 3)
        joints.append(Joint("hinge", f"h{i}", axis / np.linalg.norm(axis), place))
    return tuple(joints[i] for i in rng.permutation(len(joints)))


def random_poses(rng: np.random.Generator, robot: Robot, count: int) -> np.ndarray:
    """Poses (count, 7) near the reference, on the joints where there are any."""
    reach = 0.15 * float(np.ptp(robot.exit_points[:, 0]))
    if robot.joints:
        from seecr.description.joints import pose_of_values

        spans = [reach if j.kind == "slide" else 0.3 for j in robot.joints]
        values = rng.uniform(-1, 1, (count, len(spans))) * spans
        return pose_of_values(robot, values)[0]
    from seecr.pose import pose_add

    change = np.column_stack([reach * rng.uniform(-1, 1, (count, 3)),
                              0.2 * rng.uniform(-1, 1, (count, 3))])  # fmt: skip
    return pose_add(np.tile(robot.reference_pose, (count, 1)), change)


def write_mjcf(robot: Robot, path: Path) -> Path:
    """The robot as MJCF with every digit."""
    to_body = robot.reference_pose[3:] * [1, -1, -1, -1]
    origin = robot.reference_pose[:3]
    joints = "".join(
        f'<joint name="{j.name}" type="{j.kind}" axis="{_row(quat_rotate(to_body, j.axis))}" '
        f'pos="{_row(quat_rotate(to_body, j.point - origin))}"/>'
        for j in robot.joints
    )
    inertia = _row(np.full(3, robot.mass * robot.length**2))
    exits = "".join(f'<site name="A{i}" pos="{_row(p)}"/>' for i, p in enumerate(robot.exit_points))
    anchors = "".join(
        f'<site name="B{i}" pos="{_row(p)}"/>' for i, p in enumerate(robot.anchor_points)
    )
    tendons = "".join(
        f'<spatial name="{name}" stiffness="{ea / rest!r}" springlength="0 {rest!r}">'
        f'<site site="A{i}"/><site site="B{i}"/></spatial>'
        for i, (name, ea, rest) in enumerate(
            zip(robot.cable_names, robot.ea.tolist(), robot.rest_lengths.tolist(), strict=True)
        )
    )
    path.write_text(
        f'<mujoco model="{robot.name}"><option gravity="{_row(robot.gravity)}"/>'
        f'<worldbody>{exits}<body name="platform" pos="{_row(origin)}" '
        f'quat="{_row(robot.reference_pose[3:])}">{joints or "<freejoint/>"}'
        f'<inertial pos="{_row(robot.centre_of_mass)}" mass="{robot.mass!r}" '
        f'diaginertia="{inertia}"/>{anchors}</body></worldbody>'
        f"<tendon>{tendons}</tendon></mujoco>",
        encoding="utf-8",
    )
    return path


def _row(values: np.ndarray) -> str:
    return " ".join(repr(float(v)) for v in values)
