"""Results in parts: Parquet files in a folder, each of which is computed once.

The name of a part is the hash of all that it depends on, and that of its own bytes, which shows
damage. A part is written under another name and renamed, so that whatever ends the work leaves
whole parts.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, TypeVar

from seecr.counted import counted
from seecr.errors import ExecutorError, InputError, InputFileError
from seecr.files import digits_of, plain, reason_of, written
from seecr.folders import MANIFEST, folder_lock
from seecr.parallel import as_done
from seecr.result import Record

T = TypeVar("T")

FOLDER = "parts"
_AGAIN = "remove it, and the next call computes it again"


def key_of(what: Any) -> str:
    """The hash of all that a part depends on: numbers, texts, and collections of these."""
    return hashlib.sha256(json.dumps(plain(what), sort_keys=True).encode()).hexdigest()[:16]


class ParquetParts:
    """The parts in a folder, or none where there is no folder.

    Args:
        out: the folder of results; the parts are in a folder of it.
        mark: key of what is said of a part, in the file: ``crosscheck.study`` or ``seecr.map``.
    """

    def __init__(self, out: Path | None, mark: str) -> None:
        self._folder = None if out is None else out / FOLDER
        self._mark, self._of = mark.encode(), mark.rpartition(".")[2]
        there = () if self._folder is None else self._folder.glob("*-*.parquet")
        self.files = {path.stem.partition("-")[0]: path for path in there}
        """The files of all parts by their keys."""

    def read(self, key: str) -> Record | None:
        """What was said of a part; None where there is none.

        Raises:
            InputFileError: the part is damaged, or another one.
        """
        path = self.files.get(key)
        if path is None:
            return None
        import pyarrow
        from pyarrow import parquet

        try:
            if digits_of(path) != path.stem.partition("-")[2]:
                raise ValueError
            said = json.loads(parquet.read_schema(path).metadata[self._mark])
        except (pyarrow.ArrowException, OSError, ValueError, KeyError, TypeError):
            raise InputFileError.at(path, f"is a damaged part of a {self._of}; {_AGAIN}") from None
        if said["key"] != key:
            raise InputFileError.at(path, f"is a part of another {self._of} or case; {_AGAIN}")
        return dict(said["summary"])

    def keep(self, key: str, rows: Any, summary: Record) -> None:
        """Write a part: rows as a table of pyarrow, and what is said of them.

        Raises:
            InputFileError: it cannot be written.
        """
        if self._folder is None:
            return
        from pyarrow import parquet

        said = {self._mark: json.dumps({"key": key, "summary": plain(summary)})}
        with written(self._folder / f"{key}.parquet") as (part,):
            parquet.write_table(rows.replace_schema_metadata(said), part)
            self.files[key] = part.replace(self._folder / f"{key}-{digits_of(part)}.parquet")

    def complete(
        self, tasks: Mapping[str, T], function: Callable[[T], tuple[Any, Record]],
        executor: Executor | None, tell: Callable[[str, Record], None], noun: str,
    ) -> dict[str, Record]:  # fmt: skip
        """Compute the parts that are missing.

        Args:
            tasks: what each part is computed from, by its key.
            function: gives a part's rows, as a table of pyarrow, and what is said of them. A part
                without rows, None, is not kept.
            executor: as for :func:`seecr.parallel.as_done`.
            tell: called with the key of each part that was computed, and what is said of it.
            noun: what a task is called, for the error.

        Returns:
            what is said of the parts computed now, by their keys.

        Raises:
            ExecutorError: the executor ended before its work; the parts that are done stay.
        """
        keys, found = list(tasks), dict[str, Record]()
        try:
            with closing(as_done(function, list(tasks.values()), executor)) as results:
                for i, (rows, said) in results:
                    if rows is not None:
                        self.keep(keys[i], rows, said)
                    found[keys[i]] = said
                    tell(keys[i], said)
        except ExecutorError as error:
            kept = f"; {len(found)} of {counted(len(keys), noun)} done"
            if self._folder is not None:
                kept += f" and kept in {self._folder.parent}: call it again for the others"
            raise ExecutorError(f"{error}{kept}") from None
        return found


@contextmanager
def parts_in(out: Path | None, mark: str, files: Collection[str] = ()) -> Iterator[ParquetParts]:
    """The parts in a folder of results, which is made, and kept for this process alone.

    Args:
        out: the folder; None keeps nothing.
        mark: as for :class:`ParquetParts`. files: names of what else may be in the folder.

    Raises:
        InputError: it cannot be made. InputFileError: it has files of something else, or another
            process is at work there.
    """
    if out is None:
        yield ParquetParts(None, mark)
        return
    of = mark.rpartition(".")[2]
    _refuse_others(out, of, files)
    folder = out / FOLDER
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"--out {out}: cannot write there: {reason_of(error)}; expected a folder that can be "
            "made or written to"
        ) from None
    with folder_lock(folder, wait=False) as kept:
        if not kept:
            raise InputFileError.at(out, f"another {of} is at work there; wait, or name another")
        for left in folder.glob(".*.part"):  # of a process that was killed
            left.unlink(missing_ok=True)
        yield ParquetParts(out, mark)


def _refuse_others(out: Path, of: str, files: Collection[str]) -> None:
    """Refuse a folder with anything but what is written there.

    Raises:
        InputFileError: names the first file of something else.
    """
    inside = sorted(out.iterdir()) if out.is_dir() else []
    parts = sorted((out / FOLDER).iterdir()) if (out / FOLDER).is_dir() else []
    others = [one for one in inside if one.name not in (FOLDER, *files, MANIFEST)]
    others += [one for one in parts if one.suffix not in (".parquet", ".part")]
    others = [one for one in others if not one.name.startswith(".unfinished-")]
    if others:
        raise InputFileError.at(
            others[0],
            f"is not of a {of}; expected an empty folder or that of an earlier {of}; name "
            "another with --out",
        )
