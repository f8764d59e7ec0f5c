"""One case of a study, done by whoever is to do it: its rows, and what the table says of it."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.errors import CrosscheckError
from crosscheck.studies.cases import StudyCase
from crosscheck.twin.make import make_twin
from seecr.equilibrium.solving import solve
from seecr.errors import SeecrError
from seecr.files import plain
from seecr.result import Record
from seecr.version import full_version
from seecr.workspace.maps import default_axes, workspace_map

FAILED = "failed"
"""Key of the sentence of a case without a result."""


def run_study_case(data: Mapping[str, Any], version: str, case: StudyCase) -> tuple[Any, Record]:
    """The rows of a case, as a table of pyarrow, and its summary; no rows where it failed.

    Args:
        data: of all cases, by their names. version: of who asks. case: what to do.
    """
    try:
        if full_version() != version:
            raise CrosscheckError(
                f"a worker has seecr {full_version()}, and this is {version}; expected one version"
            )
        rows, summary = _DO[case.do](case, data.get(case.data))
    except Exception as error:  # one of many cases: the others are to be done all the same
        kind = "" if isinstance(error, SeecrError) else f"a defect, {type(error).__name__}: "
        return None, {FAILED: f"{kind}{' '.join(str(error).split())}"}
    return rows, plain(summary)


def _map(case: StudyCase, _data: None) -> tuple[Any, Record]:
    import pyarrow

    given = dict(case.options)
    axes = given.get("axes") or default_axes(case.robot)
    found = workspace_map(
        case.robot, *axes, effects=case.effects, lowest=given.get("lowest_N", 0.0),
        highest=given.get("highest_N", np.inf),
    )  # fmt: skip
    held = {"poses": found.margin.size, "held": int(found.feasible.sum())}
    moved = np.concatenate([found.deviation, found.rotation], axis=-1).reshape(-1, 6)
    rows = pyarrow.table(found.columns())
    return rows, held | _moved(moved[found.rests.ravel()])


def _sweep(case: StudyCase, commands: Any) -> tuple[Any, Record]:
    found = solve(case.robot, commands, effects=case.effects)
    return found.to_frame(), {"poses": len(found.status)} | _moved(found.deviation[found.converged])


def _moved(moved: NDArray[Any]) -> Record:
    """How far the platform comes to rest from where it was sent, at most."""
    sizes = np.linalg.norm(np.asarray(moved, float).reshape(-1, 2, 3), axis=-1)
    most = sizes.max(axis=0) if len(sizes) else [None, None]
    return {"at_rest": len(sizes), "deviation_max_m": most[0], "rotation_max_rad": most[1]}


def _diagnose(case: StudyCase, data: Any) -> tuple[Any, Record]:
    found = diagnose(case.robot, data, case.effects)
    return found.to_frame(), _said(found)


def _said(found: Diagnosis) -> Record:
    return {
        "verdict": found.verdict,
        "missing": " ".join(one.effect for one in found.missing),
        **{f"before_{key}": value for key, value in found.before.items()},
        **{f"after_{key}": value for key, value in found.after.items()},
    }


def _twin(case: StudyCase, commands: Any) -> tuple[Any, Record]:
    """A twin of the robot as it is described, and its diagnosis."""
    given = dict(case.options)
    hidden: Any = case.effects
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.xml"
        case.robot.save(file)
        more = {"points": given["points"]} if "points" in given else {}
        twin = make_twin(file, given["seed"], effects=list(hidden) or None, poses=commands, **more)
        found = diagnose(file, twin.measured)
    named = {name for one in found.missing for name in (one.effect, *one.indistinguishable)}
    names = [term.name for term in twin.hidden]
    return found.to_frame(), {"hidden": " ".join(names), "found": named >= {*names}} | _said(found)


_DO: dict[str, Callable[[StudyCase, Any], tuple[Any, Record]]] = {
    "map": _map, "sweep": _sweep, "diagnose": _diagnose, "twin": _twin,
}  # fmt: skip
