"""What is strange about robots and their rests, in sentences, with the likely cause."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from seecr.commands import Commands
from seecr.compiled.columns import FRICTION, HYSTERESIS
from seecr.counted import some
from seecr.description.robot import Robot
from seecr.effects.base import Effect
from seecr.equilibrium.solving import solve
from seecr.pose import Array
from seecr.prediction.experiment import Experiment
from seecr.statics.solution import Solution
from seecr.statics.starts import poses_from_lengths
from seecr.statics.tables import shared_cables
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


# Cables that are strained very much: most likely a mistake in units, of a robot or a command.

# Twice the strain up to which ``correct`` seeks poses where no highest tension is given.
_ODD = 0.1
_MOST_NAMES = 2


def strained(robot: Robot) -> tuple[str, ...]:
    """A sentence about cables that are strained by a tenth or more, if any are."""
    strains = _strains(robot)
    odd = np.flatnonzero(strains >= _ODD)
    if len(odd) == 0:
        return ()
    return (
        f"{_who(robot, odd)}{_by(strains.max())} at the reference pose, which is much for a rope: "
        "is springlength about the distance of the sites [m], are stiffness in N/m and mass in kg?",
    )


def strained_rows(solution: Solution) -> tuple[str, ...]:
    """The same about the row with the largest strain, where the robot itself has no such note.

    Rows that do not rest do not count.
    """
    known = np.isfinite(solution.tensions).all(axis=1)
    robot, rests = solution.robot, np.flatnonzero(solution.converged & known)
    strains = solution.evaluation.strain[rests] * robot.driven
    if not np.any(strains >= _ODD) or strained(robot):
        return ()
    at = int(np.argmax(strains.max(axis=1)))
    alone = len(solution) == 1 and solution.line is None
    where = "where the platform rests" if alone else f"at {solution.place(rests[at])}"
    return (
        f"{_who(robot, np.flatnonzero(strains[at] >= _ODD))}{_by(strains[at].max())} {where}, "
        "which is much for a rope: are commands in m, and loads in N?",
    )


def _who(robot: Robot, odd: NDArray[np.intp]) -> str:
    """The start of a sentence about cables with large strains."""
    names = some([robot.cable_names[k] for k in odd], _MOST_NAMES)
    verb, upto = ("is", "") if len(odd) == 1 else ("are", "up to ")
    return f"{robot.source or robot.name}: {names} {verb} strained by {upto}"


def _by(strain: float) -> str:
    return f"{100.0 * strain:.3g} %"


def _strains(robot: Robot) -> Array:
    """Strains (m,) at the reference pose as it is drawn, or where the platform rests if larger.

    A hanging platform that is drawn too low rises until its cables are not strained.
    """
    driven = robot.driven  # bands and springs may stretch
    drawn = np.where(driven, robot.reference_lengths / robot.rest_lengths - 1.0, 0.0)
    home = solve(robot, robot.reference_pose)
    if not home.converged[0]:
        return np.asarray(drawn)
    pulls = home.tensions[0] * robot.falls
    strain = np.divide(pulls, robot.ea, out=np.zeros_like(robot.ea), where=driven)
    return np.asarray(np.maximum(drawn, strain))


# Rests that are less exact than they look.


def walked_in_steps(
    solution: Solution, commands: Commands, effects: Sequence[Effect]
) -> tuple[str, ...]:
    """How far rests with hysteresis or friction may be off where cables are slack, in a sentence.

    Nothing is said where no cable is slack, or where no effect rubs.
    """
    rubs = np.any(shared_cables(solution.tables)[..., [HYSTERESIS, FRICTION]])
    if not rubs or not solution.slack.any():
        return ()
    experiment = Experiment(solution.robot, commands)
    errors = experiment.error_of_steps(effects, solution)
    if not np.isfinite(errors).any():
        return ()
    far, turned = np.nanmax(errors, axis=0)
    return (
        "Hysteresis and friction turn round where the way to a row ends a step, not where a cable "
        f"goes slack between: rests may be off by {millimetres(far, 2)} and "
        f"{np.degrees(turned):.2g} deg, by what half the steps change.",
    )
