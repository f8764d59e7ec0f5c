"""A robot in MuJoCo that moves: winches as actuators, cables that damp, and the platform's inertia.

Each cable is an actuator on its tendon whose force is -(k (L - l) + c (dL/dt - dl/dt)), with the
rest length l that the winch has paid out, k = EA/l and c = b k; it only pulls. Passive lines are
the same with a rest length that never changes; springs may push, and a constant tension is one.
MuJoCo integrates, and nothing here comes from seecr's statics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from crosscheck.errors import CrosscheckError
from crosscheck.twin.build import add_platform
from crosscheck.twin.robot import TrueRobot, true_robot
from seecr.counted import some
from seecr.description.mjcf import quiet_mujoco
from seecr.description.robot import Robot
from seecr.effects import Effect
from seecr.pose import Array, transform_points

# Time steps in the period of the fastest vibration: a frequency is off by (2 pi/N)^2/24, 0.04 %.
_STEPS = 64
# Step of differences of accelerations [robot's length]: small, so that no cable falls slack.
_DIFFERENCE = 1e-6
# A winch this near to what it is told [m] is there: steps can be taken together.
_THERE = 1e-12
# Damping with which the platform comes to rest before it starts, as a part of critical; periods of
# the slowest vibration that this takes: exp(-2 pi 0.5 6) of what was is left.
_STILL, _PERIODS = 0.5, 6.0
# Rest lengths over spans at which all cables are taut, by less than any pull of a load.
_TAUT = 1.0 - 1e-6
# Effects that only the statics and twins at rest have.
_AT_REST = frozenset({
    "pulley_radius", "winch_side_length", "frame_compliance", "cable_weight", "exit_friction",
    "hysteresis", "creep", "backlash", "nonlinear_elasticity", "thermal_expansion",
})  # fmt: skip


@dataclass(frozen=True)
class Winches:
    """How winches follow what they are told, and what damps the robot.

    Attributes:
        bandwidth: [Hz] of the first-order lag between told and paid-out length.
        speed: [m/s] largest, of the rope: a block and tackle moves by as much less as it has falls.
        damping: of the slowest vibration, as a part of critical; proportional to stiffness, so
            that vibrations n times as fast have n times as much.
    """

    bandwidth: float = 5.0
    speed: float = np.inf
    damping: float = 0.05


class Machine:
    """MuJoCo's model and state of a robot with its true effects, at a time.

    Attributes:
        true: the robot, with all its lines. winches: of it.
        told: (m,) [m] what the winches have reached.
        step_s: [s] the longest time step. period: [s] of the slowest vibration, as last tuned.
    """

    @quiet_mujoco()
    def __init__(self, robot: Robot, effects: Sequence[Effect], winches: Winches) -> None:
        """Build the robot; it stands at its reference pose.

        Raises:
            CrosscheckError: an effect that is not simulated with time, or an unknown inertia.
        """
        odd = sorted({effect.name for effect in effects} & _AT_REST)
        if odd:
            raise CrosscheckError(
                f"{some(odd)}: crosscheck control moves straight cables without mass or memory; "
                "expected effects of winches, geometry, stiffness, load or tracker; seecr control "
                "has all effects, at rest"
            )
        if not np.any(robot.inertia):
            raise CrosscheckError(f"robot {robot.name}: its inertia is not known")
        self.true, self.winches = true_robot(robot, effects, apart=False), winches
        self.model = _compiled(self.true)
        self.data = mujoco.MjData(self.model)
        self._pushed = bool(np.any(self.true.wrench))
        self._body = self.model.body("platform").id
        self._zero = self.lengths_at(self.true.zero_pose)
        self._zero += robot.rest_lengths - robot.reference_lengths
        self.told = robot.rest_lengths.copy()
        self._damping, self.step_s, self.period = 0.0, self.model.opt.timestep, np.nan
        self._set(self.paid(), np.zeros(len(self.told)))
        self.forward()

    def tune(self, damping: float | None = None) -> None:
        """Set damping, that of the winches by default, and time step for the present state."""
        rates = self.rates()
        slow = rates[rates > 0.0]
        if len(slow) == 0:
            raise CrosscheckError("no cable holds the platform where it is; it cannot vibrate")
        part = self.winches.damping if damping is None else damping
        self.period = 2.0 * np.pi / float(slow[0])
        self._damping = 2.0 * part / float(slow[0])
        self.step_s = 2.0 * np.pi / float(slow[-1]) / _STEPS

    def settle(self) -> None:
        """Let the platform come to rest from where it is, with much damping, and tune for there.

        What swings and how fast is known at rest alone: until then all cables count as taut.
        """
        spans = self.lengths_at(self.pose)
        self._set(np.minimum(self.paid(), _TAUT * spans), np.zeros(len(spans)))
        self.tune(_STILL)
        for _ in range(2):  # the second time with what swings there
            self.go(self.told, _PERIODS * self.period)
            self.tune(_STILL)
        self.tune()

    def lengths_at(self, pose: Array) -> Array:
        """Straight lengths (m,) [m] over the true geometry at a pose (7,)."""
        ends = transform_points(pose[None], self.true.anchor_points)[0]
        return np.asarray(np.linalg.norm(ends - self.true.exit_points, axis=1))

    def paid(self) -> Array:
        """Rest lengths (m,) [m] that the winches have paid out."""
        true, turned = self.true, self.told - self.true.robot.rest_lengths
        out = self._zero + true.offset + (1.0 + true.gain) * turned
        for sine, cosine, radius in true.run_out:
            angle = turned / radius
            out = out + sine * np.sin(angle) + cosine * (np.cos(angle) - 1.0)
        return np.where(true.robot.driven, out, true.robot.rest_lengths)

    def place(self, pose: Array, told: Array) -> None:
        """Put the platform at a pose (7,) as its joints allow, at rest, with told lengths (m,)."""
        data, model = self.data, self.model
        data.qpos[:] = model.qpos0
        data.qvel[:] = 0.0
        if not self.true.robot.joints:
            data.qpos[:] = pose
        else:
            from seecr.description.joints import values_of_pose

            data.qpos[:] = values_of_pose(self.true.robot, pose)[0][0]
        self.told = told.copy()
        self._set(self.paid(), np.zeros(len(told)))
        self.forward()

    def forward(self) -> None:
        """Update poses, forces and accelerations to the present state."""
        self._push()
        mujoco.mj_forward(self.model, self.data)

    def go(self, told: Array, seconds: float) -> None:
        """Let time pass while the winches are told lengths (m,) [m], in whole steps."""
        count = max(1, int(np.ceil(seconds / self.step_s - 1e-9)))
        step = self.model.opt.timestep = seconds / count
        lag = 1.0 - np.exp(-2.0 * np.pi * self.winches.bandwidth * step)
        most, before = self.winches.speed * step / self.true.robot.falls, self.paid()
        for done in range(count):
            if np.abs(told - self.told).max() < _THERE and not self._pushed:
                self.told = told.copy()
                self._set(self.paid(), np.zeros(len(told)))
                mujoco.mj_step(self.model, self.data, nstep=count - done)
                return
            self.told = self.told + np.clip(lag * (told - self.told), -most, most)
            now = self.paid()
            self._set(now, (now - before) / step)
            before = now
            self._push()
            mujoco.mj_step(self.model, self.data)

    def _set(self, paid: Array, rate: Array) -> None:
        """The cables' law for rest lengths (m,) [m] that change at a rate (m,) [m/s]."""
        model, stiff = self.model, self.true.ea / paid
        model.actuator_gainprm[:, 0] = stiff
        model.actuator_biasprm[:, 1] = -stiff
        model.actuator_biasprm[:, 2] = -self._damping * stiff
        self.data.ctrl[:] = paid + self._damping * rate

    def _push(self) -> None:
        """Apply the true external wrench at the platform's origin."""
        data, wrench = self.data, self.true.wrench
        if self._pushed:
            data.qfrc_applied[:] = 0.0
            given = wrench[:3], wrench[3:], data.xpos[self._body], self._body, data.qfrc_applied
            mujoco.mj_applyFT(self.model, data, *given)

    @property
    def pose(self) -> Array:
        """(7,) of the platform, as sensors of MuJoCo's report it."""
        mujoco.mj_forward(self.model, self.data)
        position, quat = self.data.sensordata[:3], self.data.sensordata[3:7]
        return np.concatenate([position, quat * np.copysign(1.0, quat[0])])

    @property
    def tensions(self) -> Array:
        """(m,) [N] of each line, as sensors of MuJoCo's report them for all its falls together."""
        return np.asarray(-self.data.sensordata[7:] / self.true.robot.falls)

    def read(self) -> tuple[Array, Array]:
        """What the robot's own sensors report: a pose (7,) and tensions (m,) [N]."""
        pose = self.pose
        reading = pose[None, :3], pose[None, 3:], self.tensions[None]
        for sensor in self.true.sensors:
            reading = sensor(reading)
        return np.concatenate([reading[0][0], reading[1][0]]), reading[2][0]

    @property
    def speed(self) -> float:
        """[m/s] of the platform, rotations times the robot's length."""
        size = np.where(self.true.robot.hinges, self.true.robot.length, 1.0)
        return float(np.abs(self.data.qvel * size).max())

    def rates(self) -> Array:
        """Angular frequencies (d,) [rad/s] of small vibrations about the present state, ascending.

        They are roots of the eigenvalues of minus the derivative of MuJoCo's accelerations; zero
        where a motion is not resisted.
        """
        model, data, start = self.model, self.data, self.data.qpos.copy()
        length, d = self.true.robot.length, self.model.nv
        steps = _DIFFERENCE * np.where(self.true.robot.hinges, 1.0, length)
        matrix = np.empty((d, d))
        for k in range(d):
            ends = []
            for sign in (1.0, -1.0):
                data.qpos[:] = start
                data.qvel[:] = 0.0
                mujoco.mj_integratePos(model, data.qpos, sign * steps[k] * np.eye(d)[k], 1.0)
                self.forward()
                ends.append(data.qacc.copy())
            matrix[:, k] = (ends[1] - ends[0]) / (2.0 * steps[k])
        data.qpos[:] = start
        self.forward()
        squares = np.sort(np.linalg.eigvals(matrix).real)
        return np.sqrt(np.maximum(squares, 0.0))


def _compiled(true: TrueRobot) -> mujoco.MjModel:
    """MuJoCo's model: a platform with its inertia, tendons, winches, and sensors."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.gravity = true.gravity
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    off = mujoco.mjtDisableBit
    flags = off.mjDSBL_CONSTRAINT, off.mjDSBL_CONTACT, off.mjDSBL_AUTORESET
    spec.option.disableflags = sum(int(flag) for flag in flags)
    add_platform(spec, true, 1)
    inertia = true.robot.inertia
    body = spec.body("platform")
    body.inertia = np.zeros(3)
    body.fullinertia = [*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    for i, place in enumerate(true.exit_points):
        spec.worldbody.add_site(name=f"a{i}", pos=place)
        tendon = spec.add_tendon(name=f"cable{i}")
        tendon.wrap_site(f"a{i}")
        tendon.wrap_site(f"b{i}")
        winch = spec.add_actuator(name=f"winch{i}", target=f"cable{i}")
        winch.trntype = mujoco.mjtTrn.mjTRN_TENDON
        winch.gaintype, winch.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        winch.biasprm[0] = -true.robot.constant_tension_N[i]
        winch.forcelimited, winch.forcerange = not true.robot.pushes[i], [-1e30, 0.0]
    for kind in (mujoco.mjtSensor.mjSENS_FRAMEPOS, mujoco.mjtSensor.mjSENS_FRAMEQUAT):
        spec.add_sensor(type=kind, objtype=mujoco.mjtObj.mjOBJ_XBODY, objname="platform")
    for i in range(true.n_cables):
        kind = mujoco.mjtSensor.mjSENS_ACTUATORFRC
        spec.add_sensor(type=kind, objtype=mujoco.mjtObj.mjOBJ_ACTUATOR, objname=f"winch{i}")
    return spec.compile()
