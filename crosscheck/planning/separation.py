"""What to measure next: which further reading would tell apart what these data cannot.

For an effect and its rival, the part of the effect's signal that the rival and the rest of the
model cannot imitate is |P v|^2 in units of the noise; about fifteen are needed. Each proposal is
tried by computing the sensitivities it would have and adding them to those of the data.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from crosscheck.fit.gauss_newton import Fit
from crosscheck.fit.imitation import basis, left_over
from crosscheck.fit.problem import Problem
from crosscheck.fit.state import State, derivatives, evaluate
from crosscheck.measurements.data import Measurements
from seecr.effects import Term
from seecr.effects.base import Layout, layout_of
from seecr.pose import Array, quat_from_rotvec, quat_multiply
from seecr.robot import Robot

# Squared signal, in units of the noise, that tells two effects apart (diagnosis: about 15).
NEEDED = 15.0
# Load cells are taken to be good to this part of the mean tension.
_LOAD_CELL = 0.01
_PAYLOAD = 0.25
_MORE_POSES = 6


@dataclass(frozen=True, eq=False)
class Proposal:
    """A further measurement and what it would tell apart.

    Attributes:
        words: what to do. now, then: squared signal that separates, before and after.
    """

    words: str
    now: float
    then: float

    @property
    def separates(self) -> bool:
        """Whether it would be enough."""
        return self.then >= NEEDED and self.then > 2.0 * self.now


def proposals(problem: Problem, final: Fit, name: str, layout: Layout) -> list[Proposal]:
    """Measurements that would tell an effect from another layout, the most telling first."""
    here = _split(problem, final, name, layout)
    now = _signal(*here)
    out = []
    for words, other in _options(problem, final):
        plain = other.experiment.predict(final.terms.effects)
        state = evaluate(other, final.terms, other.noise(plain))
        if not state.valid:
            continue
        there = _split(other, replace_state(final, state), name, layout)
        joined = tuple(np.concatenate([a, b]) for a, b in zip(here, there, strict=True))
        out.append(Proposal(words, now, _signal(*joined)))
    return sorted(out, key=lambda p: -p.then)


def replace_state(final: Fit, state: State) -> Fit:
    """A fit that stands at another state of the same terms."""
    return replace(final, state=state)


def _split(problem: Problem, final: Fit, name: str, rival: Layout) -> tuple[Array, Array]:
    """Signal of the effect (N,) and columns of all that could imitate it (N, q)."""
    term = Term(rival, rival.start(_first_shape(rival, final)))
    terms = final.terms.with_term(term)
    state = final.state.of(terms)
    columns = derivatives(problem, state, frozen=True) * terms.scale
    own = terms.own(name)
    return columns[:, own] @ final.terms[name].sizes, columns[:, ~own]


def _first_shape(layout: Layout, final: Fit) -> dict[str, float]:
    shapes = layout.effect.shapes(final.state.prediction.setup)
    return shapes[0] if shapes else {}


def _signal(signal: Array, imitators: Array) -> float:
    return left_over(signal, basis(imitators))


def _options(problem: Problem, final: Fit) -> list[tuple[str, Problem]]:
    options: list[tuple[str, Callable[[], Problem]]] = []
    data = problem.data
    if not data.has_tension:
        options.append(("record the cable tensions", lambda: _with_tensions(problem, final)))
    if not data.has_position or not data.has_orientation:
        options.append(("record the whole pose of the platform", lambda: _with_pose(problem)))
    load = _PAYLOAD * problem.robot.mass
    options.append(
        (
            f"repeat the poses with a known payload of {load:.2g} kg at the centre of mass",
            lambda: _with_payload(problem),
        )
    )
    if data.command_pose is not None:
        options.append(
            (
                f"add {_MORE_POSES} poses tilted by 10 deg, high and low at the corners of the "
                "measured region",
                lambda: _with_poses(problem),
            )
        )
    out = []
    for words, make in options:
        out.append((words, make()))
    return out


def _like(problem: Problem, data: Measurements, robot: Robot | None = None) -> Problem:
    return Problem(robot or problem.robot, data, problem.sigma, np.ones(data.n_rows, dtype=bool))


def _with_tensions(problem: Problem, final: Fit) -> Problem:
    data = problem.data
    tensions = final.state.prediction.tensions
    new = replace(
        data,
        position=np.full_like(data.position, np.nan),
        quat_wxyz=None,
        angles_rad=np.full((data.n_rows, 3), np.nan),
        tensions=tensions.copy(),
        tension_mask=np.ones(data.n_cables, dtype=bool),
    )
    noise = problem.sigma.tension_N or max(_LOAD_CELL * float(np.mean(tensions)), 1e-9)
    return _like(problem, new).with_sigma(replace(problem.sigma, tension_N=noise)).only(problem.use)


def _with_pose(problem: Problem) -> Problem:
    data = problem.data
    sigma = problem.sigma
    position = sigma.position_m or 1e-4 * float(np.mean(problem.robot.rest_lengths))
    turn = sigma.orientation_rad or 1e-3
    new = replace(
        data,
        position=np.zeros((data.n_rows, 3)),
        quat_wxyz=np.tile([1.0, 0.0, 0.0, 0.0], (data.n_rows, 1)),
        tensions=np.full_like(data.tensions, np.nan),
    )
    full = replace(sigma, position_m=position, orientation_rad=turn)
    return _like(problem, new).with_sigma(full).only(problem.use)


def _with_payload(problem: Problem) -> Problem:
    heavier = replace(problem.robot, mass=(1.0 + _PAYLOAD) * problem.robot.mass)
    return _like(problem, problem.data, heavier).only(problem.use)


def _with_poses(problem: Problem) -> Problem:
    data = problem.data
    assert data.command_pose is not None
    place = data.command_pose[:, :3]
    low, high = place.min(axis=0), place.max(axis=0)
    pick = np.array([[0, 0, 1], [1, 1, 1], [0, 1, 0], [1, 0, 0], [0, 1, 1], [1, 0, 1]])
    middle = 0.5 * (low + high)
    position = middle + 0.8 * (np.where(pick == 1, high, low) - middle)
    tilt = np.radians(10.0) * np.array(
        [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [1, 1, 0], [-1, 1, 0]]
    )
    base = problem.robot.reference_pose[3:]
    quat = quat_multiply(quat_from_rotvec(tilt), np.tile(base, (len(pick), 1)))
    poses = np.concatenate([position, quat], axis=1)
    if problem.robot.joints:
        return problem
    new = Measurements(
        path=data.path,
        n_cables=data.n_cables,
        run=np.array([f"new{k}" for k in range(len(pick))]),
        command_pose=poses,
        t_s=_later(data, len(pick)),
        position=np.full((len(pick), 3), 0.0 if data.has_position else np.nan),
        quat_wxyz=np.tile([1.0, 0, 0, 0], (len(pick), 1)) if data.has_orientation else None,
        tensions=np.full((len(pick), data.n_cables), 0.0 if data.has_tension else np.nan),
        temperature_C=None
        if data.temperature_C is None
        else np.full(len(pick), float(np.mean(data.temperature_C))),
    )
    return _like(problem, new)


def _later(data: Measurements, count: int) -> Array | None:
    if data.t_s is None:
        return None
    return np.asarray(float(data.t_s[-1]) + 60.0 * np.arange(1, count + 1), float)


def measured_directly(effect_name: str, robot: Robot) -> str:
    """How to settle an effect without the robot's poses, in a few words."""
    from seecr.effects import effect_named

    layout = layout_of(effect_named(effect_name), robot)
    return layout.effect.advice.split(":")[0]
