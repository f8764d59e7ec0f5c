"""A study: its cases done by whoever is to do them, and its table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from crosscheck.diagnosis.result import Tolerance
from crosscheck.studies.cases import GivenCases, StudyCase, read_cases
from crosscheck.studies.tasks import FAILED, run_study_case
from seecr.arguments import check_kind, silent
from seecr.counted import counted
from seecr.errors import ExecutorError
from seecr.files import path_of
from seecr.parallel import as_done
from seecr.parts import parts_in
from seecr.result import Record, Result
from seecr.version import full_version

MARK = "crosscheck.study"
"""Key of what is said of a case, in its part."""
FILES = ("study.csv", "study.json", "study.png", "study.svg")
"""What the command writes beside the folder of parts."""
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
        todo = list(missing.values())
        if len(todo) < len(every):
            progress(len(every) - len(todo), "")
        one = partial(run_study_case, data, full_version())
        done = 0
        try:
            with closing(as_done(one, todo, executor)) as results:
                for i, (rows, summary) in results:
                    if rows is not None:
                        parts.keep(todo[i].key, rows, summary)
                    found[todo[i].key] = summary
                    done += 1
                    progress(1, todo[i].name)
        except ExecutorError as error:
            kept = f"; {done} of {counted(len(todo), 'case')} done"
            kept += "" if folder is None else f" and kept in {folder}: call it again for the others"
            raise ExecutorError(f"{error}{kept}") from None
    rows = [found[case.key] for case in every]
    return Study(every, rows, sum(FAILED not in found[key] for key in missing), within)
