"""The verdict on each pose: agreement, a finding, a difference, or no answer to compare."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crosscheck.settle.relaxation import SettleStatus
from crosscheck.settle.settler import Settler, SettlingBatch
from crosscheck.suite.agreement import Allowance, Differences, FindingLimits, gap, within
from crosscheck.suite.cases import Case
from seecr.equilibrium.solving import solve as seecr_solve
from seecr.pose import Array
from seecr.statics.solution import Solution, Status

# Residual force, relative to the load, below which a platform counts as free to move: as much as an
# answer itself may have.
_BALANCED = 1e-9


class Verdict(Enum):
    """The joint verdict of the two physics on one pose; the value is the sentence."""

    AGREES = "both rest at the same pose"
    NEUTRAL = "both agree, and the platform is free to move from one answer to the other"
    BRANCH = "two stable equilibria: both physics confirm both"
    DIFFERS = "the answers are further apart than allowed"
    SEECR_UNSOLVED = "SEECR has no stable equilibrium to compare"
    MUJOCO_UNSOLVED = "MuJoCo has no settled pose to compare"


FINDINGS = (Verdict.NEUTRAL, Verdict.BRANCH)
"""More than one answer is right: counted, listed, and checked against the limits of a run."""

UNSOLVED = (Verdict.SEECR_UNSOLVED, Verdict.MUJOCO_UNSOLVED)
"""There is nothing to compare: the run ends with status 3."""


@dataclass(frozen=True)
class PoseFinding:
    """Details of a pose at which the two do not simply agree.

    Attributes:
        pose: its number in the case, from 0.
        verdict: its verdict.
        text: one sentence with numbers.
        energy_seecr_J: MuJoCo's potential energy at SEECR's answer; NaN if not compared.
        energy_mujoco_J: the same at MuJoCo's own answer.
        mujoco_stays: whether MuJoCo, started from SEECR's answer, comes to rest there.
        seecr_stays: whether SEECR, started from MuJoCo's answer, comes to rest there; if the
            platform is free to move, whether its forces balance there.
        position_m: distance of the answers [m].
        orientation_rad: angle between them [rad].
        tension_N: largest difference of a tension [N].
        beyond_limits: whether it is a finding that the run's limits do not allow.
    """

    pose: int
    verdict: Verdict
    text: str
    energy_seecr_J: float = np.nan
    energy_mujoco_J: float = np.nan
    mujoco_stays: bool | None = None
    seecr_stays: bool | None = None
    position_m: float = np.nan
    orientation_rad: float = np.nan
    tension_N: float = np.nan
    beyond_limits: bool = False

    @property
    def fails(self) -> bool:
        """Whether the case fails because of it."""
        return self.beyond_limits or self.verdict not in FINDINGS


class Answers(NamedTuple):
    """Everything that a verdict is based on; lengths (n, m) [m] are those that MuJoCo was told."""

    mujoco: Settler
    told: Array
    solution: Solution
    settling: SettlingBatch
    difference: Differences
    allowance: Allowance


def judge_poses(answers: Answers) -> tuple[NDArray[np.object_], tuple[PoseFinding, ...]]:
    """Verdicts (n,) of all poses, and a finding for each that does not simply agree."""
    n = len(answers.solution)
    verdicts = np.full(n, Verdict.AGREES, dtype=object)
    close = within(answers.difference, answers.allowance)
    free = answers.settling.free_to_move
    findings = []
    for i in range(n):
        plain = answers.solution.status[i] is Status.CONVERGED and answers.settling[i].settled
        if plain and close[i] and not free[i]:
            continue
        finding = _look_closer(answers, i, bool(close[i]))
        if finding is not None:
            verdicts[i] = finding.verdict
            findings.append(finding)
    return verdicts, tuple(findings)


def _look_closer(answers: Answers, i: int, close: bool) -> PoseFinding | None:
    """What each physics makes of the other's answer at a pose."""
    solution, settling, told = answers.solution, answers.settling[i], answers.told[i]
    status, robot = solution.status[i], answers.mujoco
    sentence = f"SEECR: {solution.sentence(i)}; MuJoCo: {settling.status.value}"
    if status not in (Status.CONVERGED, Status.SINGULAR):
        return PoseFinding(i, Verdict.SEECR_UNSOLVED, sentence)
    if settling.status is not SettleStatus.SETTLED:
        return PoseFinding(i, Verdict.MUJOCO_UNSOLVED, sentence)
    ours, theirs = solution.pose[i], settling.pose
    again = robot.settle(ours, told)
    free = settling.free_to_move or again.free_to_move
    mujoco_stays = again.settled and _near(answers, i, again.pose, ours)
    seecr_stays = _seecr_stays(answers, i, theirs, free)
    confirmed = mujoco_stays and seecr_stays
    energies = robot.energy(ours, told), robot.energy(theirs, told)
    if free and confirmed and _joined_by_a_free_motion(answers, i, *energies):
        verdict = Verdict.NEUTRAL
    elif close and status is Status.SINGULAR:
        return PoseFinding(i, Verdict.SEECR_UNSOLVED, f"{sentence}, held in every direction")
    elif close:
        return None
    else:
        two = confirmed and not _near(answers, i, theirs, ours)
        verdict = Verdict.BRANCH if two else Verdict.DIFFERS
    gaps = answers.difference
    apart = float(gaps.position_m[i]), float(gaps.orientation_rad[i]), float(gaps.tension_N[i])
    text = (
        f"{verdict.value}: {apart[0]:.2e} m, {apart[1]:.2e} rad and {apart[2]:.2e} N apart"
        f"{'' if gaps.slack_same[i] else ', other cables slack'}; MuJoCo's energy is "
        f"{energies[0]:.9g} J at SEECR's answer and {energies[1]:.9g} J at its own; from SEECR's "
        f"answer MuJoCo {_stays(mujoco_stays)}, from MuJoCo's SEECR {_stays(seecr_stays)}"
    )
    return PoseFinding(i, verdict, text, *energies, mujoco_stays, seecr_stays, *apart)


def _joined_by_a_free_motion(answers: Answers, i: int, seecr_J: float, mujoco_J: float) -> bool:
    """Whether the platform is balanced all the way from one answer to the other.

    The energies [J] are MuJoCo's at both.
    """
    same = answers.difference.tension_N[i] <= answers.allowance.tension_N[i]
    if not (same and answers.difference.slack_same[i]):
        return False
    solution, settling = answers.solution, answers.settling[i]
    work = float(solution.tables.scale[i]) * solution.robot.length
    if not abs(seecr_J - mujoco_J) <= _BALANCED * work:
        return False
    left = answers.mujoco.imbalance_between(settling.pose, solution.pose[i], answers.told[i])
    return left <= max(_BALANCED, 10.0 * settling.rounding)


def _seecr_stays(answers: Answers, i: int, pose: Array, free: bool) -> bool:
    """Whether SEECR comes to rest where it starts, or is balanced there if it is free to move."""
    given = answers.solution.robot, answers.solution.command[i : i + 1]
    if free:
        # With one evaluation nothing moves: the residual is that of the pose itself. A search could
        # end anywhere on the free motion.
        here = seecr_solve(*given, start=pose[None], max_iterations=1)
        return bool(here.residual[0] <= _BALANCED)
    back = seecr_solve(*given, start=pose[None])
    return back.status[0] is Status.CONVERGED and _near(answers, i, back.pose[0], pose)


def _near(answers: Answers, i: int, pose_a: Array, pose_b: Array) -> bool:
    """Whether two poses of row i are equal to within the polished thresholds."""
    distance, angle = gap(pose_a, pose_b)
    allowed = answers.allowance
    return bool(distance <= allowed.position_m[i] and angle <= allowed.orientation_rad[i])


def _stays(it_does: bool) -> str:
    return "stays there" if it_does else "leaves"


def held_to(
    limits: FindingLimits, case: Case, findings: Sequence[PoseFinding]
) -> tuple[PoseFinding, ...]:
    """The findings of a case, with those marked that exceed the limits.

    Each physics is right at such a pose. But a solver that systematically took another equilibrium,
    or stopped short of one, would be right at every pose. So branches are limited in number, and a
    platform may only be free to move at named poses, or at a share of poses without names.
    """
    branches = [finding for finding in findings if finding.verdict is Verdict.BRANCH]
    free = [finding for finding in findings if finding.verdict is Verdict.NEUTRAL]
    beyond: list[PoseFinding] = []
    if len(branches) > limits.branches:
        beyond += branches
    if case.has_names:
        beyond += [one for one in free if not limits.names(case.name, one.pose)]
    elif len(free) > limits.free_elsewhere * len(case.poses):
        beyond += free
    return tuple(replace(one, beyond_limits=one in beyond) for one in findings)


# How a case, an effect or a whole run ended.


class Outcome(Enum):
    """How a case or a run ended; the value is the word that people read."""

    AGREE = "agree"
    DIFFER = "DIFFER"
    NOT_CONVERGED = "NOT CONVERGED"

    @property
    def exit_status(self) -> int:
        """0 agree (findings within limits), 1 differ by too much, 3 a solve did not converge."""
        return {Outcome.AGREE: 0, Outcome.DIFFER: 1, Outcome.NOT_CONVERGED: 3}[self]

    @classmethod
    def of_all(cls, outcomes: Iterable[Outcome]) -> Outcome:
        """A difference outweighs a solve that did not converge; of none, nothing converged."""
        found = set(outcomes) or {cls.NOT_CONVERGED}
        return next((one for one in (cls.DIFFER, cls.NOT_CONVERGED) if one in found), cls.AGREE)
