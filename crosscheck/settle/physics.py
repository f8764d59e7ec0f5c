"""One cable robot in MuJoCo: cables, load and pose in; forces, energy and tensions out.

Nothing here comes from seecr's statics: the file is compiled by MuJoCo itself, and every force is
MuJoCo's. What would hide or shift the equilibrium that statics predicts is switched off: contacts,
joint and tendon limits, dry friction (with it a platform rests anywhere in a band), and damping
(which shifts no equilibrium, but delays it).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from crosscheck.errors import CrosscheckError
from seecr.description.mjcf import Reading, quiet_mujoco, read_file, unsupported_features
from seecr.description.robot import Robot
from seecr.errors import InputFileError
from seecr.pose import Array, pose_difference

# MuJoCo's implicit step treats generalised forces below about 1e-8 (in its own units) as zero, so
# that a light platform would stop moving before its forces balance. The unit of mass is arbitrary
# in mechanics: it is chosen to give the platform about this mass, as a power of two, so that no
# digit changes.
_MASS_IN_MUJOCO = 1e6
# Products of motions this close to those of independent unit motions are these; and what is added
# to them, relative to the largest, where joints can be moved without the platform.
_ALONE, _IDLE = 1e-12, 1e-14
Index = NDArray[np.int64]
Together = tuple[Index, Index, Index]
"""Coordinates, and the (rows, columns) of the stiffness that shifting all of them together yields.
"""
_FREE = int(mujoco.mjtJoint.mjJNT_FREE)
_BALL = int(mujoco.mjtJoint.mjJNT_BALL)
_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)


@dataclass(frozen=True, eq=False)
class Parts:
    """Indices of a robot's parts in MuJoCo's model.

    Attributes:
        platform: index of its body.
        exits, anchors: (m,) indices of the sites.
        pushes: indices of tendons that push, too.
        pulled: of each tendon with a constant tension its index, those of its sites, and that [N].
        passive: indices of the cables that no winch drives.
    """

    platform: int
    exits: Index
    anchors: Index
    pushes: tuple[int, ...] = ()
    pulled: tuple[tuple[int, int, int, float], ...] = ()
    passive: tuple[int, ...] = ()

    @classmethod
    def of(cls, model: mujoco.MjModel, robot: Robot) -> Parts:
        """Those of a robot whose tendons are its cables, as they are in its file."""
        platform = int(np.flatnonzero(model.body_jntnum > 0)[0])
        sites = model.wrap_objid[: 2 * model.ntendon]
        on_platform = model.body_weldid[model.site_bodyid[sites]] == platform
        exits, anchors = sites[~on_platform], sites[on_platform]
        force = robot.constant_tension_N
        pulled = tuple(
            (int(i), int(exits[i]), int(anchors[i]), float(force[i])) for i in np.flatnonzero(force)
        )
        pushes, passive = (
            tuple(np.flatnonzero(one).tolist()) for one in (robot.pushes, ~robot.driven)
        )
        return cls(platform, exits, anchors, pushes, pulled, passive)


class Physics:
    """MuJoCo's model and state of one platform on cables.

    Arguments and results of the methods are in SI units. ``model`` and ``data`` have masses in
    ``mass_unit``, so forces and energies read from them must be multiplied by it.

    Attributes:
        model: MuJoCo's model; its springs and load may be changed.
        data: MuJoCo's state.
        mass_unit: MuJoCo's unit of mass here [kg].
        parts: indices of the platform and its sites in the model.
        body: index of the platform's body.
        is_free: whether it has a free joint (else slide and hinge joints).
        mass: of the platform [kg].
        length: the robot's characteristic length [m], which makes torques comparable with forces:
            half the largest distance of two anchor points, at least a hundredth of the largest
            distance from the reference position to an exit point.
        rotations: (d,) whether each coordinate is an angle.
        metre: (d,) [m] value of one unit of each coordinate: 1, or the length for angles.
        force_scale: [N] unit of relative residuals: weight, plus force, and torque over length, of
            the wrench; without any load, the cables' own forces.
        coupling: groups of coordinates that may be shifted together in finite differences.
        wrench: (6,) [N, N m] as set.
        ignored: features of the MJCF that are switched off here, such as "contacts".
    """

    @quiet_mujoco()
    def __init__(self, model: mujoco.MjModel, parts: Parts, length: float | None = None) -> None:
        """Take over a model, which is changed from now on.

        Args:
            model: compiled; not used by anybody else.
            parts: indices of the platform and its sites in it.
            length: the robot's characteristic length [m]; None computes it from the sites.
        """
        self.model, self.parts, self.body = model, parts, parts.platform
        self.is_free = int(model.jnt_type[model.body_jntadr[parts.platform]]) == _FREE
        self.ignored = _ignored_in(model, parts.platform)
        _springs_alone(model)
        # tendons are springs that only pull, springs that push, or no springs at all
        self.pushes = np.zeros(model.ntendon, dtype=bool)
        self.pushes[list(parts.pushes)] = True
        self.constant = np.zeros(model.ntendon)
        for tendon, _exit, _anchor, force in parts.pulled:
            self.constant[tendon] = force
            model.tendon_stiffness[tendon] = 0.0
        own = float(model.body_mass[parts.platform])
        self.mass = own or float(model.body_subtreemass[parts.platform])
        self.mass_unit = 2.0 ** round(float(np.log2(self.mass / _MASS_IN_MUJOCO)))
        _change_mass_unit(model, self.mass_unit)
        self.data = mujoco.MjData(model)
        self.reference_qpos = model.qpos0.copy()
        self.reference_gravity = model.opt.gravity.copy()
        self.wrench = np.zeros(6)
        mujoco.mj_forward(model, self.data)
        self.length = self._characteristic_length() if length is None else length
        # With a length for rotations all coordinates are metres: residuals and eigenvalues compare.
        kind = model.jnt_type[model.dof_jntid]
        self.rotations = (kind == _HINGE) | (kind == _BALL)
        if self.is_free:
            self.rotations[3:6] = True  # the platform's own come first
        self.metre = np.where(self.rotations, self.length, 1.0)
        every = np.arange(self.n_dof)
        self.coupling: list[Together] = [(every[k : k + 1], every, 0 * every + k) for k in every]
        self.force_scale = self._load = 1.0
        self.set_load()

    @classmethod
    def of(cls, path: str | Path, passive: Sequence[str] = ()) -> Physics:
        """Compile an MJCF file.

        Args:
            path: the file, or the name of a shipped robot.
            passive: names of lines that no winch drives, besides those that the file names.

        Raises:
            InputError, RobotError: there is no such file, it is not MJCF, or no cable robot.
            InputFileError: a block and tackle, of which MuJoCo's side has none.
        """
        found = read_file(path, passive)
        robot, model = found.robot(), _without_loose(found)
        for i in np.flatnonzero(model.tendon_num != 2):
            raise InputFileError(
                f"{path}: tendon {robot.cable_names[i]}: expected exactly two sites; MuJoCo's side "
                "takes no block and tackle: write one cable of n^2 times its stiffness and l0/n"
            )
        return cls(model, Parts.of(model, robot))

    @property
    def n_cables(self) -> int:
        """Number of cables m."""
        return int(self.model.ntendon)

    @property
    def n_dof(self) -> int:
        """Degrees of freedom d of the platform."""
        return int(self.model.nv)

    @property
    def n_platform(self) -> int:
        """Number of the platform's own coordinates, which are the first ones."""
        return self.n_dof

    @property
    def stiffness(self) -> Array:
        """Stiffness of the cables, (m,) [N/m]."""
        return np.asarray(self.model.tendon_stiffness * self.mass_unit)

    @property
    def rest_lengths(self) -> Array:
        """Rest lengths of the cables, (m,) [m]."""
        return np.asarray(self.model.tendon_lengthspring[:, 1])

    @property
    def inertia(self) -> Array:
        """Inertia of each coordinate at the reference, (d,) [kg or kg m^2]."""
        return np.asarray(self.model.dof_M0 * self.mass_unit)

    @property
    def kinetic_energy(self) -> float:
        """Kinetic energy [J] at the beginning of the last step."""
        return float(self.data.energy[1]) * self.mass_unit

    @property
    def steers(self) -> bool:
        """Whether something has to be done at every step: here, a wrench to be applied."""
        return bool(np.count_nonzero(self.wrench)) or bool(self.parts.pulled)

    @property
    def driven(self) -> NDArray[np.bool_]:
        """(m,) cables on winches."""
        out = np.ones(self.n_cables, dtype=bool)
        out[list(self.parts.passive)] = False
        return out

    def set_cables(self, rest_lengths: Array, ea: Array) -> None:
        """Make each cable a spring that only pulls, of stiffness EA/l0 (paper, step 8).

        Those that push stay such, and those of constant tension no springs.

        Args:
            rest_lengths: (m,) [m].
            ea: k_c = E S of each cable, (m,) [N].
        """
        rest = self._per_cable("rest_lengths", rest_lengths, "m")
        stiff = self._per_cable("ea", ea, "N")
        springs = self.constant == 0.0
        self.model.tendon_lengthspring[:, 0] = np.where(self.pushes, rest, 0.0)
        self.model.tendon_lengthspring[:, 1] = rest
        self.model.tendon_stiffness[springs] = (stiff / rest)[springs] / self.mass_unit

    def set_load(self, wrench: Array | None = None, gravity: Array | None = None) -> None:
        """Set the constant wrench and gravity, and with them the scale of forces.

        Args:
            wrench: (6,) [N, N m] at the platform's origin, in the base frame.
            gravity: (3,) [m/s^2] in the base frame; None takes the MJCF's.
        """
        self.wrench = _finite("wrench", np.zeros(6) if wrench is None else wrench, (6,))
        gravity = self.reference_gravity if gravity is None else gravity
        self.model.opt.gravity[:] = _finite("gravity", gravity, (3,))
        weight = self.mass * float(np.linalg.norm(self.model.opt.gravity))
        force, torque = np.linalg.norm(self.wrench[:3]), np.linalg.norm(self.wrench[3:])
        self._load = weight + float(force) + float(torque) / self.length
        self.force_scale = self._load or self._own_forces()

    def place(self, pose: Array) -> None:
        """Put the platform at a pose (7,), or as near to it as its joints allow, at rest."""
        pose = _finite("pose", pose, (7,))
        norm = float(np.linalg.norm(pose[3:]))
        if abs(norm - 1.0) > 1e-3:
            raise CrosscheckError(f"pose: expected a quaternion of norm 1, got norm {norm:g}")
        self.data.qvel[:] = 0.0
        self.data.time = 0.0
        self.data.qpos[:] = self.reference_qpos
        if self.is_free:
            self.data.qpos[:3], self.data.qpos[3:7] = pose[:3], pose[3:] / norm
        else:
            self._joints_towards(pose)
        self.update()
        self.force_scale = self._load or self._own_forces()

    def _own_forces(self) -> float:
        """Scale [N] of the forces of the cables among themselves, used without a load."""
        pull = self.stiffness * self.rest_lengths
        return float(max(np.sum(np.abs(self.tensions())), 1e-6 * np.max(pull)))

    def pose(self) -> Array:
        """Pose (7,) of the platform's body as of the last update."""
        quat = self.data.xquat[self.body]
        return np.concatenate([self.data.xpos[self.body], quat * np.copysign(1.0, quat[0])])

    def update(self) -> None:
        """Update body poses and cable lengths to the present qpos."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_tendon(self.model, self.data)

    def residual(self) -> Array:
        """Residual generalised force (d,) [N, N m] at the present qpos, without velocity.

        MuJoCo's inverse dynamics at zero velocity and acceleration gives the force that would hold
        the platform there; the part that the external wrench does not supply is the residual.
        """
        data = self.data
        data.qvel[:] = 0.0
        data.qacc[:] = 0.0
        mujoco.mj_inverse(self.model, data)
        self.push()
        return np.asarray(self.mass_unit * (data.qfrc_applied - data.qfrc_inverse))

    def push(self) -> None:
        """Apply the constant wrench at the present pose, as MuJoCo's generalised force.

        And the pull of lines of constant tension, along each from its anchor to its exit point.
        """
        # Not by xfrc_applied, which acts at the centre of mass, so that its torque would have to
        # follow the offset as the platform rotates; nor by a constant qfrc_applied, since the free
        # joint's torque is in body axes.
        model, data, body, total = self.model, self.data, self.body, self.data.qfrc_applied
        total[:] = 0.0
        # a third of the time of any(), once for every step and every difference
        if np.count_nonzero(self.wrench):
            force, torque = self.wrench[:3] / self.mass_unit, self.wrench[3:] / self.mass_unit
            mujoco.mj_applyFT(model, data, force, torque, data.xpos[body], body, total)
        for _tendon, exit_site, anchor_site, tension in self.parts.pulled:
            there = data.site_xpos[anchor_site]
            way = data.site_xpos[exit_site] - there
            pull = tension / self.mass_unit / np.linalg.norm(way) * way
            mujoco.mj_applyFT(model, data, pull, np.zeros(3), there, body, total)

    def relative(self, force: Array) -> float:
        """Norm of a generalised force (d,) relative to the load, with torques over the length."""
        return float(np.linalg.norm(force / self.metre)) / self.force_scale

    def rounding(self) -> float:
        """Relative residual due to rounding alone: stiffness times the spacing of floats."""
        size = np.maximum(self.rest_lengths, np.max(np.abs(self.exit_points())))
        pull = float(np.linalg.norm(self.stiffness * size))
        return float(np.finfo(float).eps) * pull / self.force_scale

    def tensions(self) -> Array:
        """Tensions (m,) [N] as of the last update; exactly 0 if the cable is slack."""
        return np.asarray(self.stiffness * self.stretches() + self.constant)

    def stretches(self) -> Array:
        """Stretches of the tendons [m] as of the last update; exactly 0 if slack."""
        stretch = self.data.ten_length - self.rest_lengths
        return np.asarray(np.where(self.pushes, stretch, np.maximum(stretch, 0.0)))

    def exit_points(self) -> Array:
        """Exit points A_i (m, 3) [m] in the base frame."""
        return np.asarray(self.data.site_xpos[self.parts.exits])

    def energy(self) -> float:
        """Potential energy [J] at the present qpos: MuJoCo's springs and gravity.

        Gravity counts from the base frame's origin. The external force's potential -F.t is
        included, and T l of lines of constant tension; a constant torque has none.
        """
        self.update()
        mujoco.mj_energyPos(self.model, self.data)
        stored = float(self.data.energy[0]) * self.mass_unit
        pulled = float(self.constant @ self.data.ten_length)
        return stored + pulled - float(self.wrench[:3] @ self.data.xpos[self.body])

    def move(self, change: Array) -> None:
        """Move by a generalised displacement (d,), with rotations of a free joint in body axes."""
        mujoco.mj_integratePos(self.model, self.data.qpos, change, 1.0)

    def motion_products(self) -> Array | None:
        """Products (d, d) of what the coordinates do to the platform; None if they are its motions.

        They are of translations of its origin and of rotations times the robot's length, per metre
        of each coordinate. Those of bodies other than the platform count as they are.
        """
        if self.is_free:
            return None
        moves, turns = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        mujoco.mj_jacBody(self.model, self.data, moves, turns, self.body)
        own = slice(0, self.n_platform)
        columns = np.concatenate([moves, self.length * turns])[:, own] / self.metre[own]
        out = np.eye(self.n_dof)
        out[own, own] = columns.T @ columns
        if np.allclose(out, np.eye(self.n_dof), rtol=0.0, atol=_ALONE):
            return None
        out[own, own] += _IDLE * np.max(np.diag(out)) * np.eye(self.n_platform)
        return out

    def solve(self, stiffness: Array, force: Array, damping: float, neutral: float) -> Array | None:
        """Displacement (d,) [m] that balances a force (d,) [N], rotations times the robot's length.

        There is no motion in directions whose stiffness is at most ``neutral``.

        Args:
            stiffness: (d, d) [N/m]; force: in the same coordinates.
            damping: [N/m] added to the stiffness of all other directions.
            neutral: [N/m].

        Returns:
            None if the damped stiffness is not positive definite, so that no step leads downhill.
        """
        values, vectors = np.linalg.eigh(stiffness)
        stiff = np.abs(values) > neutral
        damped = values[stiff] + damping
        if np.any(damped <= 0.0):
            return None
        return np.asarray(vectors[:, stiff] @ ((vectors[:, stiff].T @ force) / damped))

    @contextmanager
    def frozen_slack(self, taut: NDArray[np.bool_]) -> Iterator[None]:
        """Let some cables (m,) pull and push and remove the others: smooth, for Newton's method.

        Those that push always do.
        """
        spring, stiffness = self.model.tendon_lengthspring, self.model.tendon_stiffness
        kept = stiffness.copy()
        stiffness[~(taut | self.pushes)] = 0.0
        spring[:, 0] = spring[:, 1]
        try:
            yield
        finally:
            spring[:, 0] = np.where(self.pushes, spring[:, 1], 0.0)
            stiffness[:] = kept

    def _per_cable(self, name: str, values: Array, unit: str) -> Array:
        array = _finite(name, values, (self.n_cables,))
        if not np.all((array > 0.0) | (self.constant > 0.0)):
            i = int(np.argmin(np.where(self.constant > 0.0, np.inf, array)))
            raise CrosscheckError(
                f"{name}: expected positive numbers [{unit}], got {array[i]:g} for cable {i + 1}"
            )
        return array

    def _joints_towards(self, pose: Array) -> None:
        """Gauss-Newton on the platform's joints, until it is as near to the pose as they permit."""
        n = self.n_platform
        weigh = np.array([1.0, 1.0, 1.0] + 3 * [self.length])
        jacobian = np.zeros((6, self.n_dof))
        for _ in range(50):
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            gap = weigh * pose_difference(pose, self.pose())
            mujoco.mj_jacBody(self.model, self.data, jacobian[:3], jacobian[3:], self.body)
            step = np.linalg.lstsq(weigh[:, None] * jacobian[:, :n], gap, rcond=None)[0]
            self.move(np.append(step, np.zeros(self.n_dof - n)))
            if np.linalg.norm(step * self.metre[:n]) < 1e-15 * self.length:
                break

    def _characteristic_length(self) -> float:
        anchors = self.data.site_xpos[self.parts.anchors]
        reach = np.max(np.linalg.norm(anchors[:, None] - anchors[None], axis=-1)) / 2.0
        exits = self.exit_points() - self.data.xpos[self.body]
        return float(max(reach, 0.01 * np.max(np.linalg.norm(exits, axis=-1))))


def _finite(name: str, values: Array, shape: tuple[int, ...]) -> Array:
    array = np.asarray(values, dtype=float)
    if array.shape != shape:
        raise CrosscheckError(f"{name}: expected shape {shape}, got {array.shape}")
    if not np.all(np.isfinite(array)):
        raise CrosscheckError(f"{name}: expected finite numbers, got {array}")
    return array


# A user's MJCF, reduced to springs and gravity.

_DISABLE = (
    mujoco.mjtDisableBit.mjDSBL_AUTORESET,  # else a diverging run restarts silently
    mujoco.mjtDisableBit.mjDSBL_CONSTRAINT,  # contacts, limits, dry friction
    mujoco.mjtDisableBit.mjDSBL_CONTACT,  # skips the search for contacts
    mujoco.mjtDisableBit.mjDSBL_DAMPER,
    mujoco.mjtDisableBit.mjDSBL_SENSOR,
    mujoco.mjtDisableBit.mjDSBL_ACTUATION,
)


def _without_loose(found: Reading) -> mujoco.MjModel:
    """The model of a file without moving bodies that no cable touches, and what is about them."""
    if not found.platform.loose:
        return found.model
    spec = mujoco.MjSpec.from_file(str(found.path))
    beside = (spec.keys, spec.sensors, spec.equalities, spec.excludes, spec.pairs, spec.actuators)
    gone = [spec.bodies[body] for body in found.platform.loose]
    for one in [each for some in beside for each in some] + gone:
        spec.delete(one)
    return spec.compile()


def _ignored_in(model: mujoco.MjModel, platform: int) -> tuple[str, ...]:
    """Names of features present that would hide, shift or delay the equilibrium."""
    damped = model.dof_damping.any() or model.tendon_damping.any()
    return (*unsupported_features(model, platform), *(("damping",) if damped else ()))


def _springs_alone(model: mujoco.MjModel) -> None:
    """Leave springs, gravity and inertia only."""
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    model.opt.disableflags |= sum(int(flag) for flag in _DISABLE)
    model.opt.tolerance = 1e-8  # relative, of the solve for the implicit step
    model.opt.iterations = 100
    model.opt.enableflags = int(mujoco.mjtEnableBit.mjENBL_ENERGY)


def ignored_note(name: str | Path, ignored: Sequence[str]) -> str:
    """A sentence about what is :func:`_ignored_in` a file."""
    return (
        f"{name}: switched off here: {', '.join(ignored)}; only springs and gravity act on the "
        "platform, as in the statics"
    )


def _change_mass_unit(model: mujoco.MjModel, mass_unit: float) -> None:
    """Change the unit of mass [kg] of everything with mass, and of what MuJoCo derives from it."""
    masses = (model.body_mass, model.body_inertia, model.dof_armature, model.tendon_armature)
    for array in (*masses, model.tendon_stiffness, model.jnt_stiffness):
        array /= mass_unit
    model.opt.density /= mass_unit
    model.opt.viscosity /= mass_unit
    mujoco.mj_setConst(model, mujoco.MjData(model))
