"""The parts of a study: a Parquet file for each case.

Its name is the hash of all that its case depends on, and that of its own bytes, which shows damage.
A part is written under another name and renamed, so that whatever ends a study leaves whole parts.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from crosscheck.studies.cases import StudyCase
from seecr.errors import InputError, InputFileError
from seecr.files import digits_of, reason_of, written
from seecr.folders import MANIFEST, folder_lock
from seecr.result import Record

FOLDER = "parts"
FILES = ("study.csv", "study.json", "study.png", "study.svg")
"""What the command writes beside the folder of parts."""
_KEY = b"crosscheck.study"
_AGAIN = "remove it, and the next call computes it again"


class StudyParts:
    """The parts in a folder, or none where there is no folder."""

    def __init__(self, out: Path | None) -> None:
        self._folder = None if out is None else out / FOLDER

    def read(self, case: StudyCase) -> Record | None:
        """What the table says of a case, from its part; None without one.

        Raises:
            InputFileError: the part is damaged, or of another case.
        """
        if self._folder is None:
            return None
        path = next(iter(sorted(self._folder.glob(f"{case.key}-*.parquet"))), None)
        if path is None:
            return None
        import pyarrow
        from pyarrow import parquet

        try:
            if digits_of(path) != path.stem.partition("-")[2]:
                raise ValueError
            said = json.loads(parquet.read_schema(path).metadata[_KEY])
        except (pyarrow.ArrowException, OSError, ValueError, KeyError, TypeError):
            raise InputFileError.at(path, f"is a damaged part of a study; {_AGAIN}") from None
        if said["key"] != case.key:
            raise InputFileError.at(path, f"is a part of another study or case; {_AGAIN}")
        return dict(said["summary"])

    def keep(self, case: StudyCase, rows: Any, summary: Record) -> None:
        """Write the part of a case.

        Raises:
            InputFileError: it cannot be written.
        """
        if self._folder is None:
            return
        from pyarrow import parquet

        kept = rows.replace_schema_metadata(
            {_KEY: json.dumps({"key": case.key, "summary": summary})}
        )
        with written(self._folder / f"{case.key}.parquet") as (part,):
            parquet.write_table(kept, part)
            part.replace(self._folder / f"{case.key}-{digits_of(part)}.parquet")


@contextmanager
def parts_in(out: Path | None) -> Iterator[StudyParts]:
    """The parts in a folder of results, which is made, and kept for this study alone.

    Raises:
        InputError: it cannot be made. InputFileError: it has files of something else, or another
            study is at work there.
    """
    if out is None:
        yield StudyParts(None)
        return
    folder = out / FOLDER
    try:
        folder.mkdir(parents=True, exist_ok=True) if _is_ours(out) else None
    except OSError as error:
        raise InputError(
            f"--out {out}: cannot write there: {reason_of(error)}; expected a folder that can be "
            "made or written to"
        ) from None
    with folder_lock(folder, wait=False) as kept:
        if not kept:
            raise InputFileError.at(out, "another study is at work there; wait, or name another")
        for left in folder.glob(".*.part"):  # of a study that was killed
            left.unlink(missing_ok=True)
        yield StudyParts(out)


def _is_ours(out: Path) -> bool:
    """Whether a folder has nothing but what studies write there.

    Raises:
        InputFileError: it has something else.
    """
    inside = sorted(out.iterdir()) if out.is_dir() else []
    parts = sorted((out / FOLDER).iterdir()) if (out / FOLDER).is_dir() else []
    others = [one for one in inside if one.name not in (FOLDER, *FILES, MANIFEST)]
    others += [one for one in parts if one.suffix not in (".parquet", ".part")]
    others = [one for one in others if not one.name.startswith(".unfinished-")]
    if others:
        raise InputFileError.at(
            others[0],
            "is not of a study; expected an empty folder or that of an earlier study; name "
            "another with --out",
        )
    return True
