"""The parts of a study: a Parquet file for each case, named by the hash of what it depends on.

A part is written under another name and renamed, so that whatever ends a study leaves whole parts.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from crosscheck.studies.cases import StudyCase
from seecr.errors import InputError, InputFileError
from seecr.files import reason_of, written
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
        if self._folder is None or not (path := self._folder / _name(case)).exists():
            return None
        import pyarrow
        from pyarrow import parquet

        try:
            # all of it: sums of each page show what is damaged
            rows = parquet.read_table(path, page_checksum_verification=True)
            said = json.loads(rows.schema.metadata[_KEY])
            summary, key, digest = said["summary"], said["key"], said["digest"]
            if digest != _digest(key, summary):
                raise ValueError
        except (pyarrow.ArrowException, OSError, ValueError, KeyError, TypeError):
            raise InputFileError.at(path, f"is a damaged part of a study; {_AGAIN}") from None
        if key != case.key:
            raise InputFileError.at(path, f"is a part of another study or case; {_AGAIN}")
        return dict(summary)

    def keep(self, case: StudyCase, rows: Any, summary: Record) -> None:
        """Write the part of a case.

        Raises:
            InputFileError: it cannot be written.
        """
        if self._folder is None:
            return
        from pyarrow import parquet

        said = {"key": case.key, "summary": summary, "digest": _digest(case.key, summary)}
        kept = rows.replace_schema_metadata({_KEY: json.dumps(said)})
        with written(self._folder / _name(case)) as (part,):
            parquet.write_table(kept, part, write_page_checksum=True)


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


def _name(case: StudyCase) -> str:
    return f"{case.key}.parquet"


def _digest(key: str, summary: Record) -> str:
    return hashlib.sha256(json.dumps([key, summary], sort_keys=True).encode()).hexdigest()[:16]
