"""Robots that are hardly meant as they are written: what is strange, and the likely cause."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from seecr.commands import Commands
from seecr.description.robot import Robot
from seecr.equilibrium.solving import solve, strained
from seecr.statics.starts import poses_from_lengths
from seecr.units import millimetres

# The widest cable robot there is carries the receiver of the FAST telescope, between towers that
# stand 600 m apart. Frames beyond this [m] are in millimetres.
_WIDEST = 1000.0
# Ropes of steel, aramid, Vectran and HMPE break at strains of 1 to 4 %. So rest lengths that differ
# from the distances by more than this part are not those of the reference pose.
_BREAKS = 0.05
# Rest lengths fit another pose if moving there takes away more than this part of their misfit.
# Pretension and stretch, which differ by cable as they like, mostly stay.
_EXPLAINED = 0.5


@lru_cache(maxsize=16)
def strange(robot: Robot) -> tuple[str, ...]:
    """Sentences about what no robot has, each with its likely cause; mostly there are none.

    They are about gravity that points up, a frame in millimetres, rest lengths of another reference
    pose, and cables that are strained very much.
    """
    who = robot.source or robot.name
    found = [*_upwards(robot), *_wide(robot)]
    placed = _elsewhere(robot)
    return (*(f"{who}: {text}" for text in (*found, *placed)), *(() if placed else strained(robot)))


def _upwards(robot: Robot) -> tuple[str, ...]:
    """Gravity that is nearer to +z, which is up in MJCF, than to level."""
    if not robot.gravity[2] > 0.5 * float(np.linalg.norm(robot.gravity)):
        return ()
    g = " ".join(f"{part:g}" for part in robot.gravity)
    return (
        f"gravity points up ({g} m/s^2, and z is up in MJCF): is a minus sign missing, as in "
        'gravity="0 0 -9.81"?',
    )


def _wide(robot: Robot) -> tuple[str, ...]:
    if robot.reach <= _WIDEST:
        return ()
    return (
        f"the frame is {1e-3 * robot.reach:.3g} km wide: is it in millimetres? Expected metres, "
        "for sites, bodies and springlength, with stiffness in N/m",
    )


def _elsewhere(robot: Robot) -> tuple[str, ...]:
    """Rest lengths that are those of another pose than the reference."""
    # bands and springs may stretch
    apart = np.where(robot.driven, robot.reference_lengths - robot.rest_lengths, 0.0)
    if float(np.max(np.abs(apart) / robot.rest_lengths)) <= _BREAKS:
        return ()
    home = robot.reference_pose[None]
    fitting = poses_from_lengths(robot, Commands(home, lengths=robot.rest_lengths[None]))
    assert fitting is not None
    left = (robot.nominal_lengths(fitting)[0] - robot.rest_lengths)[robot.driven]
    if np.linalg.norm(left) > _EXPLAINED * np.linalg.norm(apart):
        return ()
    there, place = fitting[0, :3], robot.reference_pose[:3]
    away = float(np.linalg.norm(there - place))
    rest = solve(robot, home)
    # cables that stretch much, as rubber does, may hold it at the reference pose all the same
    moved = float(np.linalg.norm(rest.pose[0, :3] - place))
    if (rest.converged[0] and moved < _EXPLAINED * away) or away <= _BREAKS * robot.length:
        return ()
    at = " ".join(f"{part:.4g}" for part in there)
    text = (
        f"rest lengths are not those of the reference pose (springlength is off by up to "
        f"{millimetres(float(np.max(np.abs(apart))), 3)}): they fit the platform "
        f"{millimetres(away, 3)} away, at {at} m, and commands count from the reference pose"
    )
    if not np.any(place):
        return (f"{text}: is the pos of the platform's body missing?",)
    return (f"{text}: is springlength that of another pose?",)
