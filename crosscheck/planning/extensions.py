"""What could be measured in addition: sensors, a payload, the way back, more poses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from crosscheck.fit.least_squares.state import evaluate
from crosscheck.measurements.data import Measurements
from crosscheck.planning.adding import NO_LIMITS, Adding, Extension, Limits, like
from crosscheck.planning.places import more_poses
from crosscheck.planning.planned import (
    Planned,
    Reads,
    expected_sigma,
    usual_cell,
)
from seecr.commands import Loads
from seecr.description.robot import Robot
from seecr.pose import Array
from seecr.units import short

# A known payload, relative to the platform's mass.
PAYLOAD = 0.25

_AN_HOUR = 3600.0


def extensions(
    plan: Planned, limits: Limits = NO_LIMITS, box: Array | None = None
) -> Iterator[Extension]:
    """All that can be added to measurements that were made or planned, one after the other.

    Args:
        plan: what is read so far, with the model that predicts it.
        limits: lowest and highest tension [N] of added poses.
        box: (2, 3) [m] lowest and highest position of added poses.
    """
    ways = ~plan.problem.data.read & ~plan.unsolved
    data = plan.problem.data.rows(plan.problem.use | ways)
    for make in (_sensors, _payload, _way_back, _later):
        yield from make(plan, data)
    found = more_poses(plan, limits, box)
    if found is not None:
        yield found


def _sensors(plan: Planned, data: Measurements) -> Iterator[Extension]:
    problem, m = plan.problem, plan.problem.robot.n_cables
    if not plan.reads.tensions.any():
        mean = float(np.mean(plan.base.prediction.tensions[problem.use]))
        noise = problem.sigma.tension_N or usual_cell(mean)
        yield Extension(
            Adding.TENSIONS,
            f"record the cable tensions (to {noise:g} N)",
            like(
                plan, data, reads=Reads.whole(m, pose=False, tensions=True),
                sigma=replace(problem.sigma, tension_N=noise),
            ),
        )  # fmt: skip
    if not plan.reads.whole_pose:
        sigma, _assumed = expected_sigma(problem.robot, problem.sigma)
        yield Extension(
            Adding.POSE,
            "record the whole pose of the platform",
            like(plan, data, reads=Reads.whole(m), sigma=sigma),
        )


def _payload(plan: Planned, data: Measurements) -> Iterator[Extension]:
    robot = plan.problem.robot
    if robot.mass > 0:
        yield Extension(
            Adding.PAYLOAD,
            f"repeat the poses with a known extra {short(PAYLOAD * robot.mass, 2)} kg at the "
            "centre of mass (payload_kg)",
            like(plan, replace(data, loads=_heavier(data, robot, PAYLOAD * robot.mass))),
        )


def _heavier(data: Measurements, robot: Robot, mass: float) -> Loads:
    """The rows' loads plus a payload [kg] at the platform's centre of mass."""
    here = data.loads or Loads.of(data.n_rows)
    total, centre = here.mass + mass, here.centre
    share = np.divide(here.mass, total, out=np.zeros_like(total), where=total != 0.0)[:, None]
    both = robot.centre_of_mass + share * (centre - robot.centre_of_mass)
    return Loads(total, np.where(here.mass[:, None] == 0.0, np.nan, both), here.wrench)


def _way_back(plan: Planned, data: Measurements) -> Iterator[Extension]:
    yield Extension(
        Adding.WAY_BACK,
        "repeat each run in the opposite order, so that poses are reached from the other side",
        like(plan, _backwards(data)),
    )


def _later(plan: Planned, data: Measurements) -> Iterator[Extension]:
    """All rows again an hour later, on the clock of each file, as creep depends on the time."""
    if data.t_s is None:
        return
    n = data.n_rows
    order = np.argsort(np.tile(data.file, 2), kind="stable")
    later, both = order >= n, data.rows(order % n)
    shift = float(np.ptp(data.t_s)) + _AN_HOUR
    names = np.where(later, named_again(both), both.run)
    both = replace(both, run=names, t_s=data.t_s[order % n] + later * shift)
    whole = like(plan, both)
    rest = whole.problem.only(later)
    base = evaluate(rest, plan.base.terms, whole.factor)
    again = replace(whole, problem=rest, base=base)
    yield Extension(Adding.LATER, "repeat the poses an hour later", again)


def named_again(data: Measurements) -> np.ndarray:
    return np.array([f"{name} again" for name in data.run.tolist()], dtype=np.str_)


def _backwards(data: Measurements) -> Measurements:
    """Each run from its last row to its first, with the same times."""
    order = np.concatenate([np.flatnonzero(data.run == name)[::-1] for name in data.runs])
    turned = data.rows(order)
    return replace(turned, run=named_again(turned), t_s=data.t_s)
