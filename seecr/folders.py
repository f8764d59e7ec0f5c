"""Folders of results: the files of one result replace those of an older one, together.

A list in the folder, ``.seecr-manifest.json``, names each file that a command wrote there, with the
first digits of its SHA-256 and the identifier of its result. Only such files are ever replaced or
removed, and only as long as nobody has changed them.

A result is made in a folder of its own, ``.unfinished-…``, inside the folder of results. When it is
complete, a list of its moves is written there, and the files are moved; moving is renaming. A
command that is killed before that list is written has changed nothing. If it is killed after, the
next command that reads or writes in the folder makes the remaining moves.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import secrets
import shutil
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from seecr.errors import InputError, InputFileError
from seecr.files import UNFINISHED, Made, digits_of, reason_of

if sys.platform != "win32":
    import fcntl

MANIFEST = ".seecr-manifest.json"
_MOVES = "moves.json"


@contextmanager
def folder_lock(folder: Path, wait: bool = True) -> Iterator[bool]:
    """Keep a folder for this process alone; the system frees it when the process ends.

    Windows cannot lock a folder: commands at the same time in one folder are not kept apart there.

    Yields:
        whether it is kept: without ``wait``, not if another process has it.
    """
    if sys.platform == "win32":
        yield True
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        kept = True
    except OSError as error:
        # some network file systems have no locks: as on Windows
        kept = error.errno not in (errno.EWOULDBLOCK, errno.EACCES)
    try:
        yield kept
    finally:
        os.close(handle)


def _manifest(folder: Path, table: str) -> dict[str, Any]:
    """What a folder's manifest says of each of its "files" or "results"; empty without one."""
    try:
        listed = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))[table]
    except (OSError, ValueError, KeyError, TypeError):
        return {}  # then no file counts as ours
    entries = listed.items() if isinstance(listed, dict) else ()
    return {name: entry for name, entry in entries if isinstance(entry, dict)}


def _is_ours(folder: Path, name: str, listed: Mapping[str, Any]) -> bool:
    """Whether a file that exists is as a command wrote it."""
    path = folder / name
    return name in listed and path.is_file() and listed[name].get("sha256") == digits_of(path)


def check_ours(folder: Path, names: Iterable[str], option: str = "--out") -> None:
    """Check that files of these names, where they exist, are as a command wrote them.

    Measurements, and poses that somebody wrote by hand, cannot be made again.

    Raises:
        InputFileError: there are others.
    """
    listed = _manifest(folder, "files")
    there = sorted(name for name in names if os.path.lexists(folder / name))
    others = [name for name in there if not _is_ours(folder, name, listed)]
    if not others:
        return
    changed = all(name in listed for name in others)
    what = "was changed after a command wrote it" if changed else "no command wrote it"
    also = f" (also {', '.join(others[1:])})" if others[1:] else ""
    raise InputFileError.at(
        folder / others[0],
        f"would be overwritten, but {what}{also}; move it away, or name another folder "
        f"with {option}",
    )


def check_not_read(path: Path, read: Iterable[Path | None], option: str) -> None:
    """Check that a file to be written or removed is none of those that were read."""
    there = [one for one in read if one is not None and one.exists()]
    if path.exists() and any(path.samefile(one) for one in there):
        raise InputFileError.at(
            path,
            f"would be overwritten, but was read; expected another folder; name one with {option}",
        )


@contextmanager
def staged(
    out: str | Path, option: str = "--out", names: Iterable[str] = (),
    sometimes: Iterable[str] = (), read: Iterable[Path | None] = (), made: Made | None = None,
) -> Iterator[Path]:  # fmt: skip
    """A temporary folder whose files move into ``out`` if the block ends without an error.

    It lies inside ``out``; if the block fails, ``out`` is as it was.

    Args:
        out: the folder of results, made if need be.
        option: the option that named it, for the error.
        names: of files that will be written. sometimes: of files that only some results have; if
            they are not written now, those of an older result are removed.
        read: files that the results are made from; they are neither overwritten nor removed.
        made: how the result is made; its identifier goes into the manifest.

    Raises:
        InputError: the folder cannot be made or written to; this comes before any work is done.
        InputFileError: a file would be overwritten that was read, or that no command wrote; for
            ``names`` this comes before any work is done. Or the files cannot be moved.
    """
    out, names, sometimes, read = Path(out), {*names}, {*sometimes}, [*read]
    for name in sorted(names | sometimes):
        check_not_read(out / name, read, option)
    above, folder, done = _missing(out), out / f"{UNFINISHED}{secrets.token_hex(4)}", False
    try:  # from before the folder is made: whoever ends the program then leaves nothing either
        with contextlib.ExitStack() as kept:
            try:
                out.mkdir(parents=True, exist_ok=True)
                finish_moves(out)
                with folder_lock(out):  # others may be about to move files, or look for dead ones
                    check_ours(out, names, option)
                    folder.mkdir(mode=0o700)
                    kept.enter_context(folder_lock(folder))
            except OSError as error:
                raise InputError(
                    f"{option} {out}: cannot write there: {reason_of(error)}; expected a folder "
                    "that can be made or written to"
                ) from None
            yield folder
            with folder_lock(out):
                _check_replaced(out, folder, read, option)
                try:
                    _plan_moves(out, folder, sometimes, made)
                except OSError as error:
                    what = f"the result cannot be written there: {reason_of(error)}"
                    raise InputFileError.at(out, what) from None
                done = True  # from here on, whoever looks next can finish
                _move(out, folder)
    finally:
        if not done:
            shutil.rmtree(folder, ignore_errors=True)
            for one in above:
                if one.is_dir() and not any(one.iterdir()):
                    one.rmdir()


def _check_replaced(out: Path, folder: Path, read: list[Path | None], option: str) -> None:
    """Check what the files of a complete result would replace; what is there already is left out.

    The robot beside measurements, for example, may be the file that it is a copy of.
    """
    for file in sorted(folder.iterdir()):
        old = out / file.name
        check_not_read(old, read, option)
        if old.is_file() and digits_of(old) == digits_of(file):
            if file.name not in _manifest(out, "files"):
                file.unlink()
        else:
            check_ours(out, [file.name], option)


def _plan_moves(out: Path, folder: Path, sometimes: Iterable[str], made: Made | None) -> None:
    """Write down what is to be moved and removed, and the manifest as it is to be."""
    new = sorted(file.name for file in folder.iterdir())
    before = _manifest(out, "files")
    gone = sorted(name for name in {*sometimes} - {*new} if _is_ours(out, name, before))
    listed = {
        name: entry
        for name, entry in before.items()
        if name not in gone and os.path.lexists(out / name)
    }
    result = {"id": secrets.token_hex(8)} if made is None else {"id": made.result, **made.as_json()}
    listed |= {name: {"sha256": digits_of(folder / name), "result": result["id"]} for name in new}
    results = _manifest(out, "results") | {result["id"]: result}
    used = {str(entry.get("result")) for entry in listed.values()}
    kept = {name: one for name, one in results.items() if name in used}
    manifest = json.dumps({"results": kept, "files": listed}, indent=1)
    moves = json.dumps({"move": new, "remove": gone, "manifest": manifest})
    part = folder / f"{_MOVES}.part"
    with part.open("w", encoding="utf-8") as file:
        file.write(moves)
        file.flush()
        os.fsync(file.fileno())
    part.replace(folder / _MOVES)


def _move(out: Path, folder: Path) -> None:
    """Make the moves that are written down, those that are still to be made."""
    moves = json.loads((folder / _MOVES).read_text(encoding="utf-8"))
    try:
        for name in moves["move"]:
            if (folder / name).exists():
                (folder / name).replace(out / name)
        for name in moves["remove"]:
            (out / name).unlink(missing_ok=True)
        part = folder / MANIFEST
        part.write_text(moves["manifest"], encoding="utf-8")
        part.replace(out / MANIFEST)
    except OSError as error:
        raise InputFileError.at(
            out,
            f"not all files of the result could be moved there: {reason_of(error)}; the next "
            "command that reads or writes in this folder moves the others",
        ) from None
    shutil.rmtree(folder, ignore_errors=True)


def finish_moves(out: Path) -> None:
    """Finish what commands that were killed left in a folder, and remove what they did not finish.

    A folder that another process is still writing to is left alone.
    """
    if not any(out.glob(f"{UNFINISHED}*")):
        return
    with folder_lock(out):
        for folder in sorted(out.glob(f"{UNFINISHED}*")):
            with contextlib.suppress(FileNotFoundError), folder_lock(folder, wait=False) as dead:
                if not dead or not folder.is_dir():
                    continue
                if (folder / _MOVES).exists():
                    _move(out, folder)
                else:
                    shutil.rmtree(folder, ignore_errors=True)


def check_together(*paths: Path) -> None:
    """Check that files which are read together were written together, if commands wrote them.

    Raises:
        InputFileError: they belong to two results, or the moves of one could not be finished.
    """
    there = [path for path in paths if path.is_file()]
    for folder in {path.parent for path in there}:
        with contextlib.suppress(PermissionError):
            finish_moves(folder)
    if len({path.parent for path in there}) != 1:
        return
    listed = _manifest(there[0].parent, "files")
    if not all(_is_ours(path.parent, path.name, listed) for path in there):
        return  # somebody's own files
    results = {str(listed[path.name].get("result")) for path in there}
    if len(results) > 1:
        names = " and ".join(path.name for path in there)
        raise InputFileError.at(
            there[0], f"{names} belong to two results; make the result again with its command"
        )


def _missing(path: Path) -> list[Path]:
    """The folders that do not exist yet, innermost first."""
    return [folder for folder in (path, *path.parents) if not folder.exists()]
