"""The content of a case's recording, taken from the case's result before anything is drawn."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from crosscheck.settle.physics import Physics
from crosscheck.settle.settler import Settler, Settling
from crosscheck.suite.agreement import Differences
from crosscheck.suite.verdicts import Verdict
from seecr.description.robot import Robot
from seecr.pose import Array, pose_difference
from seecr.recording import colours
from seecr.recording.shapes import States
from seecr.recording.stream import sweep_index
from seecr.statics.solution import Status

if TYPE_CHECKING:
    from crosscheck.suite.results import CaseResult

_EQUILIBRIA = (Status.CONVERGED, Status.SINGULAR)
_FRAMES = 240
# Duration of the settling when played [s].
_WATCH_S = 12.0


@dataclass(frozen=True, eq=False)
class Motion:
    """A platform on its way to rest.

    Attributes:
        t_s: (k,) simulated time [s], increasing; the first is 0, at the start pose.
        pose: (k, 7).
        kinetic_energy: (k,) [J].
        tensions: (k, m) [N].
        settling: its result; the motion is stage 1, without the polish.
    """

    t_s: Array
    pose: Array
    kinetic_energy: Array
    tensions: Array
    settling: Settling


@dataclass(frozen=True, eq=False)
class Material:
    """A case and what its recording shows.

    Attributes:
        result: the case's.
        watched: the pose, counted from 0, whose settling is shown.
        motion: that settling; None if MuJoCo did not come to rest at any pose.
    """

    result: CaseResult
    watched: int
    motion: Motion | None

    @property
    def name(self) -> str:
        """The case's name."""
        return self.result.case.name

    @property
    def robot(self) -> Robot:
        """The case's robot."""
        return self.result.robot

    @property
    def command(self) -> Array:
        """Commanded poses (n, 7)."""
        return self.result.case.poses

    @property
    def count(self) -> int:
        """Number of poses n."""
        return len(self.command)

    @cached_property
    def index(self) -> list[rr.TimeColumn]:
        """The timelines over the poses."""
        return sweep_index(self.command)

    @property
    def is_sweep(self) -> bool:
        """Whether the poses follow each other along a line."""
        return self.result.case.kind == "sweep"

    @cached_property
    def seecr(self) -> States:
        """SEECR's answers; NaN at poses that are no equilibria to it."""
        found = self.result.solution
        known = np.array([status in _EQUILIBRIA for status in found.status])
        pose = np.where(known[:, None], found.pose, np.nan)
        return States(pose, found.tensions, found.rest_lengths, found.slack)

    @cached_property
    def mujoco(self) -> States:
        """MuJoCo's answers, after the polish."""
        found = self.result.settling
        return States(found.pose, found.tensions, self.result.mujoco_rest_lengths, found.slack)

    @cached_property
    def settling(self) -> States:
        """MuJoCo's platform on its way to rest."""
        assert self.motion is not None
        moving = self.motion
        lengths = np.tile(self.mujoco.rest_lengths[self.watched], (len(moving.t_s), 1))
        return States(moving.pose, moving.tensions, lengths, moving.tensions == 0.0)

    @property
    def slack_differs(self) -> NDArray[np.bool_]:
        """Cables slack for one physics and taut for the other by more than is allowed, (n, m)."""
        apart = self.gap.cable_tension_N
        allowed = self.result.allowance.tension_N[:, None]
        return np.asarray((self.seecr.slack != self.mujoco.slack) & (apart > allowed))

    @property
    def gap(self) -> Differences:
        """Differences between MuJoCo and SEECR."""
        return self.result.difference

    @property
    def playback_speed(self) -> float:
        """Simulated seconds per second, so that the settling takes a while to watch."""
        if self.motion is None:
            return 1.0
        speed = float(self.motion.t_s[-1]) / _WATCH_S
        return colours.round_up(speed) if speed > 0.0 else 1.0

    @property
    def seen(self) -> Array:
        """Every pose (k, 7) that the 3D view has to contain."""
        return np.concatenate([self.command, self.seecr.pose, self.mujoco.pose])

    @cached_property
    def top(self) -> float:
        """Tension [N] at the end of the colour scale, a round number."""
        tensions = np.concatenate([self.seecr.tensions, self.mujoco.tensions])
        return colours.round_up(float(np.nanmax(tensions, initial=0.0)))


def gather(result: CaseResult) -> Material:
    """Choose the most interesting settling, and let MuJoCo repeat it."""
    watched = _worth_watching(result)
    if watched is None:
        return Material(result, 0, None)
    lengths = result.mujoco_rest_lengths[watched]
    settler = result.mujoco_robot().settler
    motion = record_motion(settler, result.case.begins[watched], lengths)
    return Material(result, watched, motion)


def _worth_watching(result: CaseResult) -> int | None:
    """The pose at which MuJoCo moves the platform most, among those that differ if any do."""
    settled = result.settling.settled
    if not settled.any():
        return None
    for verdict in (Verdict.DIFFERS, Verdict.BRANCH):
        if np.any(chosen := settled & (result.verdict == verdict)):
            settled = chosen
            break
    change = pose_difference(result.settling.pose, result.case.begins)
    change[:, 3:] *= result.robot.length
    return int(np.argmax(np.where(settled, np.linalg.norm(change, axis=1), -1.0)))


def record_motion(
    settler: Settler, pose: Array, rest_lengths: Array, *, max_frames: int = _FRAMES
) -> Motion:
    """Settle from a pose (7,) and keep the motion, including the last state.

    Args:
        settler: the robot.
        pose: (7,) start pose.
        rest_lengths: (m,) [m].
        max_frames: frames kept, spread evenly over the steps.
    """
    frames: list[tuple[float, Array, float, Array]] = []
    clock = 0.0

    def observe(physics: Physics) -> None:
        # After a MuJoCo step, pose, kinetic energy and tensions are still those before it.
        nonlocal clock
        frames.append((clock, physics.pose(), physics.kinetic_energy, physics.tensions()))
        clock += float(physics.model.opt.timestep)

    settling = settler.settle(pose, rest_lengths, observe=observe)
    kept = np.unique(np.linspace(0, len(frames) - 1, max_frames).round().astype(int))
    times, poses, kinetic, tensions = zip(*(frames[i] for i in kept), strict=True)
    return Motion(np.array(times), np.array(poses), np.array(kinetic), np.array(tensions), settling)
