"""MuJoCo's model of a robot that really has its effects.

A cable starts behind its exit point A and ends on the platform:

    winch site - (wrapped sheave | exit site) - chain of point masses - anchor site

Each part is only there if an effect needs it:

- sheave: a cylinder on a mocap body at A that is turned to face the cable. It is turned from
  outside, since MuJoCo wraps geodesics of the cylinder, and a free swivel would turn away from its
  cable, as nothing keeps the cable in its groove.
- winch site: on a slider below A whose spring is the elastic cable behind the exit point.
- exit site: on slides whose springs are the frame's compliance, sideways and upwards. With a
  sheave, whose own load is not along the cable, the compliance is in the winch's slider instead,
  where it acts along the cable as the effect specifies; there it has to be isotropic.
- point masses: one between two segments, half a one on the platform.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from crosscheck.settle.physics import Index, Parts
from crosscheck.twin.robot import TrueRobot
from seecr.pose import Array, quat_conjugate, quat_rotate

# Mass of the bodies that carry exit points and winches [platform's mass]. It shifts no equilibrium,
# since the springs' rest positions compensate for the weight.
_SMALL_MASS = 0.1
_NODE = "n{}_{}"
# Turns a cylinder's axis from z to y, normal to the sheave's plane.
_ACROSS = np.array([1.0, -1.0, 0.0, 0.0]) / np.sqrt(2.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class Places(Parts):
    """Indices of parts in the compiled model, per cable.

    Attributes:
        payload: a body on the platform. n_platform: number of its coordinates, which come first.
        exit_dofs: (m, 3) or (m, 0); slider_dofs: (m, 1) or (m, 0).
        node_dofs: (m, N - 1, 3).
        tendons: (m, N), the first is the one at the exit point.
        node_bodies: (m, N - 1); end_bodies: (m,) point masses on the platform, or (m, 0).
        top_next: (m,) sites next to the exit points along the cables.
        tail: [m] of tendon behind the exit point when the winch's spring is at rest.
    """

    payload: int
    n_platform: int
    exit_dofs: Index
    slider_dofs: Index
    node_dofs: Index
    tendons: Index
    node_bodies: Index
    end_bodies: Index
    top_next: Index
    tail: float


def build(true: TrueRobot, segments: int = 1) -> tuple[mujoco.MjModel, Places]:
    """Compile the model; springs, masses of chains and load are set later.

    Args:
        true: the robot.
        segments: N of each cable; 1 without weight.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.gravity = true.gravity
    add_platform(spec, true, segments)
    for i in range(true.n_cables):
        _add_exit(spec, true, i)
        _add_chain(spec, true, i, segments)
        _add_tendons(spec, true, i, segments)
    _add_passive(spec, true)
    model = spec.compile()
    _hang_springs(model, true)
    return model, _places(model, true, segments)


def tail_of(true: TrueRobot) -> float:
    """Length [m] of tendon behind the exit point; any that exceeds the winch's motion."""
    if not (true.pulley_radius or _slides(true)):
        return 0.0
    reference = true.robot.reference_pose[None]
    return float(np.mean(true.robot.nominal_lengths(reference)))


def _slides(true: TrueRobot) -> bool:
    """Whether the winch is on a spring; with friction the cable's law includes it instead."""
    behind = true.winch_side > 0 and true.friction == 0
    return behind or (true.compliance > 0 and true.pulley_radius > 0)


def add_platform(spec: mujoco.MjSpec, true: TrueRobot, segments: int) -> None:
    """The platform on its joints, with its mass, centre and anchor points b0, b1, ...

    Its inertia is that of a ball of the robot's length: it shifts no equilibrium.
    """
    robot = true.robot
    position, quat = robot.reference_pose[:3], robot.reference_pose[3:]
    body = spec.worldbody.add_body(name="platform", pos=position, quat=quat)
    body.explicitinertial = True
    body.mass, body.ipos = true.mass, true.centre_of_mass
    body.inertia = np.full(3, true.mass * robot.length**2)
    if not robot.joints:
        body.add_freejoint()
    back = quat_conjugate(quat)
    for joint in robot.joints:
        slide = joint.kind == "slide"
        body.add_joint(
            name=joint.name,
            type=mujoco.mjtJoint.mjJNT_SLIDE if slide else mujoco.mjtJoint.mjJNT_HINGE,
            axis=quat_rotate(back, joint.axis),
            pos=quat_rotate(back, joint.point - position),
        )
    for i, line in enumerate(true.passive):
        body.add_site(name=f"qb{i}", pos=line.anchor_point)
    hook = body.add_body(name="payload")
    hook.explicitinertial = True
    for i, anchor in enumerate(true.anchor_points):
        body.add_site(name=f"b{i}", pos=anchor)
        if segments > 1:
            end = body.add_body(name=f"e{i}", pos=anchor)
            _give_mass(end, 1e-6 * true.mass, robot.length)


def _give_mass(body: mujoco.MjsBody, mass: float, length: float) -> None:
    body.explicitinertial = True
    body.mass, body.ipos = mass, np.zeros(3)
    body.inertia = np.full(3, 1e-3 * mass * length**2)


def _add_exit(spec: mujoco.MjSpec, true: TrueRobot, i: int) -> None:
    """Parts at and behind an exit point: its site, a sheave, a winch, each if needed."""
    carrier, origin = spec.worldbody, true.exit_points[i]
    # directions in which the exit point yields, with their compliance [m/N]
    across = np.linalg.svd(true.up[None])[2][1:]
    every = [*((axis, true.compliance) for axis in across), (true.up, true.compliance_up)]
    soft = [] if true.pulley_radius else [(axis, by) for axis, by in every if by > 0.0]
    if soft:
        carrier = spec.worldbody.add_body(name=f"x{i}", pos=origin)
        origin = np.zeros(3)
        _give_mass(carrier, _SMALL_MASS * true.mass, true.robot.length)
        for axis, by in soft:
            joint = carrier.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
            joint.stiffness = [1.0 / by, 0.0, 0.0]
    carrier.add_site(name=f"a{i}", pos=origin)
    winch = origin - tail_of(true) * true.up
    if _slides(true):
        _add_winch(carrier, true, i, winch)
    elif true.pulley_radius:
        carrier.add_site(name=f"p{i}", pos=winch)
    if true.pulley_radius:
        _add_sheave(spec, true, i)


def _add_winch(carrier: mujoco.MjsBody, true: TrueRobot, i: int, place: Array) -> None:
    """A winch that the cable pulls up against a spring: all elasticity behind the exit point."""
    winch = carrier.add_body(name=f"p{i}", pos=place)
    _give_mass(winch, _SMALL_MASS * true.mass, true.robot.length)
    series = true.winch_side / true.ea[i] if true.friction == 0 else 0.0
    series += true.compliance if true.pulley_radius else 0.0
    joint = winch.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=true.up)
    joint.stiffness = [1.0 / series, 0.0, 0.0]
    winch.add_site(name=f"p{i}")


def _add_sheave(spec: mujoco.MjSpec, true: TrueRobot, i: int) -> None:
    r = true.pulley_radius
    wheel = spec.worldbody.add_body(name=f"s{i}", pos=true.exit_points[i], mocap=True)
    wheel.add_geom(
        name=f"w{i}",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[r, 0.2 * r, 0.0],
        pos=[r, 0.0, 0.0],
        quat=_ACROSS,
        contype=0,
        conaffinity=0,
    )
    # MuJoCo wraps over the top as long as this site, seen from the centre, is between the normals
    # to the tangent from the winch and to the straight line to the anchor point. It is just inside
    # the first of them, which leaves most room to the second
    lean = 0.9 * np.arctan2(r, tail_of(true))
    side = [r + 2.0 * r * np.sin(lean), 0.0, 2.0 * r * np.cos(lean)]
    wheel.add_site(name=f"o{i}", pos=side)


def _add_chain(spec: mujoco.MjSpec, true: TrueRobot, i: int, segments: int) -> None:
    for j in range(1, segments):
        node = spec.worldbody.add_body(name=_NODE.format(i, j))
        _give_mass(node, 1e-6 * true.mass, true.robot.length)
        for axis in np.eye(3):
            node.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        node.add_site(name=_NODE.format(i, j))


def _add_tendons(spec: mujoco.MjSpec, true: TrueRobot, i: int, segments: int) -> None:
    points = [_NODE.format(i, j) for j in range(1, segments)] + [f"b{i}"]
    for j, end in enumerate(points):
        tendon = spec.add_tendon(name=f"cable{i}_{j}")
        if j > 0:
            tendon.wrap_site(points[j - 1])
        elif true.pulley_radius:
            tendon.wrap_site(f"p{i}")
            tendon.wrap_geom(f"w{i}", f"o{i}")
        else:
            if _slides(true):
                tendon.wrap_site(f"p{i}")
            tendon.wrap_site(f"a{i}")
        tendon.wrap_site(end)
        tendon.stiffness, tendon.springlength = [1.0, 0.0, 0.0], [0.0, 1.0]


def _add_passive(spec: mujoco.MjSpec, true: TrueRobot) -> None:
    """Lines without a winch, after all others: plain springs, or none where a force pulls."""
    for i, line in enumerate(true.passive):
        spec.worldbody.add_site(name=f"qa{i}", pos=line.exit_point)
        tendon = spec.add_tendon(name=f"passive{i}")
        tendon.wrap_site(f"qa{i}")
        tendon.wrap_site(f"qb{i}")
        stiffness = line.ea / line.rest if line.force == 0.0 else 0.0
        tendon.stiffness = [stiffness, 0.0, 0.0]
        tendon.springlength = [line.rest if line.pushes else 0.0, line.rest]


def _hang_springs(model: mujoco.MjModel, true: TrueRobot) -> None:
    """Preload the springs of exit points and winches with their own weight: they rest at zero."""
    for joint in np.flatnonzero(model.jnt_stiffness > 0):
        body = model.jnt_bodyid[joint]
        # bodies on a carrier add to its weight
        carried = np.flatnonzero(model.body_parentid == body)
        mass = model.body_mass[body] + np.sum(model.body_mass[carried])
        weight = mass * float(model.jnt_axis[joint] @ true.gravity)
        model.qpos_spring[model.jnt_qposadr[joint]] = -weight / model.jnt_stiffness[joint]


def _places(model: mujoco.MjModel, true: TrueRobot, segments: int) -> Places:
    m = true.n_cables

    def number(kind: mujoco.mjtObj, name: str) -> int:
        return int(mujoco.mj_name2id(model, kind, name))

    def dofs(name: str) -> list[int]:
        at = number(body, name)
        first = model.body_dofadr[at]
        return [] if at < 0 else list(range(first, first + model.body_dofnum[at]))

    site, body = mujoco.mjtObj.mjOBJ_SITE, mujoco.mjtObj.mjOBJ_BODY
    nodes = [[_NODE.format(i, j) for j in range(1, segments)] for i in range(m)]
    ends = [number(body, f"e{i}") for i in range(m)] if segments > 1 else []
    return Places(
        platform=number(body, "platform"),
        payload=number(body, "payload"),
        n_platform=len(dofs("platform")),
        exit_dofs=np.array([dofs(f"x{i}") for i in range(m)], dtype=int),
        slider_dofs=np.array([dofs(f"p{i}") for i in range(m)], dtype=int),
        node_dofs=np.array([[dofs(n) for n in row] for row in nodes], dtype=int).reshape(m, -1, 3),
        tendons=np.arange(m * segments).reshape(m, segments),
        exits=np.array([number(site, f"a{i}") for i in range(m)]),
        anchors=np.array([number(site, f"b{i}") for i in range(m)]),
        node_bodies=np.array([[number(body, n) for n in row] for row in nodes], dtype=int),
        end_bodies=np.array(ends, dtype=int),
        top_next=np.array([number(site, ([*row, f"b{i}"])[0]) for i, row in enumerate(nodes)]),
        tail=tail_of(true),
        pushes=tuple(m * segments + i for i, line in enumerate(true.passive) if line.pushes),
        pulled=tuple(
            (m * segments + i, number(site, f"qa{i}"), number(site, f"qb{i}"), line.force)
            for i, line in enumerate(true.passive)
            if line.force > 0.0
        ),
    )
