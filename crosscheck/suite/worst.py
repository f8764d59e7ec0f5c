"""The pose of a run that deserves a look in MuJoCo's viewer."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from crosscheck.errors import InputFileError
from crosscheck.suite.run import CaseResult, worst_of
from crosscheck.suite.verdicts import UNSOLVED, Verdict
from crosscheck.suite.worst_pose import write_worst_pose_mjcf

FILE_NAME = "worst_pose.xml"


def worst_pose(results: Sequence[CaseResult]) -> tuple[CaseResult, int]:
    """The case and pose furthest over its thresholds; else unsolved; else nearest to them."""
    worst = worst_of(results)
    if worst is None or worst[1].ratio <= 1.0:
        for verdict in (Verdict.DIFFERS, *UNSOLVED):
            for result in results:
                rows = np.flatnonzero(result.verdict == verdict)
                if len(rows):
                    return result, int(rows[0])
    if worst is None:
        return results[0], 0
    return worst[0], worst[1].pose


def write_worst_pose(results: Sequence[CaseResult], folder: Path) -> str:
    """Write its MJCF into a folder; returns a sentence that says what it shows."""
    result, i = worst_pose(results)
    side, settling = result.side(), result.settling[i]
    if settling.settled:
        qpos, state = settling.qpos, "as MuJoCo found it at rest"
    else:
        qpos, state = side.qpos(result.case.poses[i]), "as commanded, since MuJoCo did not settle"
    lengths = result.mujoco_rest_lengths[i]
    try:
        write_worst_pose_mjcf(
            result.case.mujoco_model, qpos, lengths, side.settler.ea, folder / FILE_NAME
        )
    except InputFileError as error:  # a robot in several files can be run, but not rewritten
        return f"There is no `{FILE_NAME}`: {error}."
    return f"`{FILE_NAME}` opens in MuJoCo's viewer at pose {i} of {result.case.name}, {state}."
