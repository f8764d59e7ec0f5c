"""One settling as a motion over simulated time, for whoever wants to watch it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.settle.physics import Physics
from crosscheck.settle.settler import Settler, Settling
from seecr.pose import Array

MAX_FRAMES = 300


@dataclass(frozen=True, eq=False)
class Motion:
    """A platform on its way to rest.

    Attributes:
        t_s: (k,) simulated time [s], increasing; the first is 0, the commanded pose.
        pose: (k, 7).
        kinetic_energy: (k,) [J].
        tensions: (k, m) [N].
        settling: where it ended; the motion is stage 1, without the polish.
    """

    t_s: Array
    pose: Array
    kinetic_energy: Array
    tensions: Array
    settling: Settling


def record_motion(
    settler: Settler,
    pose: Array,
    rest_lengths: Array,
    *,
    max_frames: int = MAX_FRAMES,
    ea: Array | None = None,
    wrench: Array | None = None,
    gravity: Array | None = None,
) -> Motion:
    """Settle from a pose (7,) and keep what happened, the last state always included.

    Args:
        settler: the robot.
        pose: (7,) commanded.
        rest_lengths: (m,) [m].
        max_frames: frames kept, spread evenly over the steps.
        ea: (m,) [N]; None takes the settler's.
        wrench: (6,) [N, N m].
        gravity: (3,) [m/s^2].
    """
    frames: list[tuple[float, Array, float, Array]] = []
    clock = 0.0

    def observe(physics: Physics) -> None:
        # Pose, kinetic energy and tensions after a step of MuJoCo are those before it moved on.
        nonlocal clock
        frames.append((clock, physics.pose(), physics.kinetic_energy, physics.tensions()))
        clock += float(physics.model.opt.timestep)

    settling = settler.settle(
        pose, rest_lengths, ea=ea, wrench=wrench, gravity=gravity, observe=observe
    )
    kept = np.unique(np.linspace(0, len(frames) - 1, max_frames).round().astype(int))
    times, poses, kinetic, tensions = zip(*(frames[i] for i in kept), strict=True)
    return Motion(np.array(times), np.array(poses), np.array(kinetic), np.array(tensions), settling)
