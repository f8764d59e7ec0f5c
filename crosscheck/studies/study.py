"""A study: its cases done by whoever is to do them, each by itself, and its table."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.diagnosis.result import Diagnosis, Tolerance
from crosscheck.errors import CrosscheckError
from crosscheck.studies.cases import GivenCases, StudyCase, read_cases
from crosscheck.twin.make import make_twin
from seecr.arguments import check_kind, silent
from seecr.counted import counted
from seecr.equilibrium.solving import solve
from seecr.errors import SeecrError
from seecr.files import path_of, plain
from seecr.parts import parts_in
from seecr.result import Record, Result
from seecr.version import full_version
from seecr.workspace.maps import default_axes, workspace_map

MARK = "crosscheck.study"
"""Key of what is said of a case, in its part."""
FILES = ("study.csv", "study.json", "study.png", "study.svg")
"""What the command writes beside the folder of parts."""
FAILED = "failed"
"""Key of the sentence of a case without a result."""
# Most cases that are named where it is told which of them are within limits.
_MOST = 12


@dataclass(frozen=True, eq=False, repr=False)
class Study(Result):
    """The table of a study, one row a case.

    Attributes:
        cases: as read. rows: what was found of each.
        computed: how many were computed now; the others were there.
        limits: what :attr:`within` asks for; None if nothing.
    """

    cases: Sequence[StudyCase]
    rows: Sequence[Record]
    computed: int
    limits: Tolerance | None = None

    @property
    def failed(self) -> list[tuple[str, str]]:
        """Names of cases without a result, and why."""
        pairs = zip(self.cases, self.rows, strict=True)
        return [(case.name, row[FAILED]) for case, row in pairs if FAILED in row]

    @property
    def within(self) -> list[bool | None]:
        """Whether each robot comes to rest within the limits at all poses; None without poses."""
        return [self._is_within(row) for row in self.rows]

    def _is_within(self, row: Record) -> bool | None:
        if self.limits is None or "at_rest" not in row:
            return None
        pairs = (
            (row["deviation_max_m"], self.limits.position_m),
            (row["rotation_max_rad"], self.limits.orientation_rad),
        )
        small = all(most is None or (size is not None and size <= most) for size, most in pairs)
        return small and row["at_rest"] == row["poses"]

    def lines(self) -> list[str]:
        """How many cases were done, which are within the limits, and which failed."""
        there = len(self.rows) - self.computed - len(self.failed)
        head = f"study of {counted(len(self.rows), 'case')}: {self.computed} computed"
        out = [f"{head}, {there} there already" if there else head]
        if self.limits is not None:
            good = [c.name for c, fine in zip(self.cases, self.within, strict=True) if fine]
            asked = sum(fine is not None for fine in self.within)
            names = ", ".join([*good[:_MOST], *(["…"] if len(good) > _MOST else [])])
            out.append(f"within the limits: {len(good)} of {asked}{': ' if good else ''}{names}")
        return out + [f"{name}: no result: {why}" for name, why in self.failed]

    def records(self) -> list[Record]:
        """One row per case: its cells as given, and what was found; all with the same keys."""
        keys = dict.fromkeys(key for row in self.rows for key in row)
        cells = dict.fromkeys(key for case in self.cases for key in case.given)
        limits = {} if self.limits is None else {"within": self.within}
        return [
            {
                "case": case.name,
                **{key: case.given.get(key) for key in cells if key != "case"},
                **{key: row.get(key) for key in keys},
                **{key: values[i] for key, values in limits.items()},
            }
            for i, (case, row) in enumerate(zip(self.cases, self.rows, strict=True))
        ]


def study(
    cases: GivenCases,
    executor: Executor | None = None,
    *,
    out: str | Path | None = None,
    within: Tolerance | None = None,
    progress: Callable[[int, str], None] = silent,
) -> Study:
    """Do many cases: maps, sweeps, diagnoses or twins of many robots, geometries or seeds.

    Args:
        cases: a table, or its file: one row a case, with columns ``robot`` and ``do``, and others
            that docs/formats.md lists.
        executor: does the cases, each in one process and thread: any
            ``concurrent.futures.Executor``, such as ``client.get_executor(retries=2, pure=False)``
            of dask.distributed. By default this process does, with the same results.
        out: folder for the rows of each case, as Parquet in ``parts``. What is there already is not
            computed again, as long as nothing that it depends on has changed. None keeps nothing.
        within: limits of position and orientation, for the column ``within``.
        progress: called with the number of cases done since the last call, and the last one's name.

    Returns:
        the table. A case that fails has its reason there, and no part.

    Raises:
        InputFileError: mistakes in the table or in its files; a part that is damaged or of another
            study; a folder with files of something else.
        InputError: something else than a table.
        ExecutorError: the executor ended before its work; the parts that are done stay.

    Example:
        ``crosscheck.study([{"robot": "planar_vertical", "do": "map", "grid": 3}]).rows``
    """
    if within is not None:
        check_kind(within, Tolerance, "within", "such as crosscheck.Tolerance(position_m=1e-3)")
    folder = None if out is None else path_of(out, "a folder")
    return studied(*read_cases(cases), executor, folder, within, progress)


def studied(
    every: Sequence[StudyCase], data: Mapping[str, Any], executor: Executor | None,
    folder: Path | None, within: Tolerance | None, progress: Callable[[int, str], None],
) -> Study:  # fmt: skip
    """The same of cases that are read, with their data."""
    with parts_in(folder, MARK, FILES) as parts:
        found: dict[str, Any] = {case.key: parts.read(case.key) for case in every}
        missing = {case.key: case for case in every if found[case.key] is None}
        if len(missing) < len(every):
            progress(len(every) - len(missing), "")
        one = partial(run_study_case, data, full_version())
        found |= parts.complete(
            missing, one, executor, lambda key, _said: progress(1, missing[key].name), "case"
        )
    rows = [found[case.key] for case in every]
    return Study(every, rows, sum(FAILED not in found[key] for key in missing), within)


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
