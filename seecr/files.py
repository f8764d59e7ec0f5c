"""Users' files: errors name the place of a mistake, and files are written completely or not at all.

Text, TOML and JSON of both packages are read and written here, so that a missing, unsuitable or
unwritable file is reported in the same words everywhere.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import itertools
import json
import math
import os
import re
import secrets
import stat
import tempfile
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from datetime import date
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from seecr.errors import InputError, InputFileError
from seecr.version import full_version

UNFINISHED = ".unfinished-"
"""How names of folders begin whose files are not complete, see :func:`seecr.folders.staged`."""
# Bytes of a file that is read at once: ten million rows of measurements.
_LARGEST, _PART = 10**9, 10**7
_BEGINNINGS = (
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"PK\x03\x04", "a zip archive or an Excel workbook"),
    (b"\xd0\xcf\x11\xe0", "an Excel workbook"),
    (b"%PDF", "a PDF"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"\x89HDF", "an HDF5 file"),
    (b"RRF", "a Rerun recording"),
    (b"MATLAB", "a MATLAB file"),
    (b"\xff\xfe", "UTF-16 text"),
    (b"\xfe\xff", "UTF-16 text"),
)


def no_text(data: bytes) -> str:
    """What bytes are if not UTF-8 text, such as ``"a PNG picture"``; empty if perhaps text."""
    known = next((kind for beginning, kind in _BEGINNINGS if data.startswith(beginning)), "")
    return known or ("a binary file" if b"\0" in data else "")


def of_sheet(path: Path) -> tuple[Path, str | None]:
    """The file of ``book.xlsx:sheet`` and its sheet; None for the first one."""
    name, colon, sheet = str(path).rpartition(":")
    if colon and name.lower().endswith((".xlsx", ".xlsm")) and not path.exists():
        return Path(name), sheet
    return path, None


def toml_path(path: Path) -> Path:
    """The TOML beside a file of rows; that of a workbook is beside all of its sheets."""
    file = of_sheet(path)[0]
    return file.with_suffix(".toml") if file.name else Path(f"{file}.toml")  # "." has no name


def read_bytes(path: Path, expected: str) -> bytes:
    """The bytes of a file; an error says what was expected.

    Raises:
        InputFileError: the file is missing, unreadable, a device, or larger than 1 GB.
    """
    try:
        with path.open("rb") as file:
            if stat.S_ISCHR(os.fstat(file.fileno()).st_mode) and not file.isatty():
                raise InputFileError.at(path, f"is a device; {expected}")
            if os.fstat(file.fileno()).st_size <= _LARGEST:
                parts: list[bytes] = []
                while more := file.read(_PART):  # a pipe does not know its size
                    parts.append(more)
                    if sum(map(len, parts)) > _LARGEST:
                        break
                else:
                    return b"".join(parts)
        raise InputFileError.at(path, f"is larger than 1 GB; {expected}")
    except FileNotFoundError:
        raise InputFileError.at(path, f"no such file; {expected}") from None
    except OSError as error:
        raise InputFileError.at(path, f"cannot be read: {reason_of(error)}; {expected}") from None


def read_text(path: Path, expected: str) -> str:
    """The text of a UTF-8 file, with or without a byte order mark; every line ends in ``\\n``.

    Raises:
        InputFileError: the file is missing, unreadable or not UTF-8.
    """
    data = read_bytes(path, expected)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        found = f"is not UTF-8 (byte number {error.start + 1}); {expected}"
        raise InputFileError.at(path, found) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def reason_of(error: OSError) -> str:
    return error.strerror or str(error)


@dataclass(frozen=True, eq=False)
class Toml:
    """A user's TOML file: its content, and the line of each key.

    Attributes:
        path: the file. text: all of it. content: its tables and values.
    """

    path: Path
    text: str
    content: dict[str, Any]

    def error(self, text: str, key: str = "") -> InputFileError:
        """An error, at the line of a key or table if one is named."""
        return InputFileError.at(self.path, text, line=self.line_of(key) if key else None)

    def line_of(self, key: str) -> int | None:
        """The first line, from 1, that sets a key or opens the table of that name."""
        name = re.escape(key)
        pattern = re.compile(rf"^[^#]*(?:\b{name}\b[\"']?\s*=|\[\s*{name}\s*\])")
        lines = enumerate(self.text.splitlines(), start=1)
        return next((number for number, line in lines if pattern.match(line)), None)


def path_of(given: object, what: str) -> Path:
    """A path; ``what`` is the expected file, for the error.

    Raises:
        InputError: not a path.
    """
    if isinstance(given, str | Path):
        return Path(given)
    raise InputError(f"expected the path of {what}, got {type(given).__name__}")


def read_toml(path: Path, expected: str) -> Toml:
    """A TOML file.

    Raises:
        InputFileError: the file is missing, unreadable, not UTF-8 or not TOML.
    """
    text = read_text(path, expected)
    try:
        return Toml(path, text, tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        # tomllib's message ends with line and column
        raise InputFileError.at(path, f"is not TOML: {error}; {expected}") from None
    except RecursionError:
        raise InputFileError.at(path, f"nests too deeply; {expected}") from None
    except ValueError:
        text = f"has a whole number of thousands of digits; {expected}"
        raise InputFileError.at(path, text) from None


@contextmanager
def written(*paths: Path, failure: str = "cannot be written") -> Iterator[tuple[Path, ...]]:
    """Temporary files that replace others, all together, if the block ends without an error.

    Errors begin with ``failure`` and name the last file.

    Raises:
        InputFileError: one of them cannot be written; all are then as they were.
    """
    temporary = tuple(path.with_name(f".{path.name}.{secrets.token_hex(4)}.part") for path in paths)
    try:
        for path in paths:
            if path.is_dir():  # else it would only show after others have been renamed
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        yield temporary
        for part, path in zip(temporary, paths, strict=True):
            if part.exists():  # else the block has put it in its place itself
                part.replace(path)
    except OSError as error:
        raise InputFileError.at(_meant(paths[-1]), f"{failure}: {reason_of(error)}") from None
    finally:
        for part in temporary:
            with contextlib.suppress(OSError):
                part.unlink()


def _meant(path: Path) -> Path:
    """Where a file is to be in the end, if it is written in a folder of an unfinished result."""
    above = path.parent
    return above.parent / path.name if above.name.startswith(UNFINISHED) else path


def write_texts(
    contents: Mapping[Path, str | Iterable[str]], failure: str = "cannot be written"
) -> None:
    """Write files in UTF-8 together: all of them, in this order, or none.

    A content may come in pieces, so that a large one is never there as a whole.
    """
    with written(*contents, failure=failure) as parts:
        for part, text in zip(parts, contents.values(), strict=True):
            with part.open("w", encoding="utf-8", newline="\n") as file:
                file.writelines([text] if isinstance(text, str) else text)


def write_text(path: Path, text: str | Iterable[str], failure: str = "cannot be written") -> None:
    """Write one file in UTF-8, or keep the old one on failure."""
    write_texts({path: text}, failure)


def check_writable(path: Path) -> None:
    """Check that a file can be written there, before the work that it is for.

    Raises:
        InputFileError: it is a folder, or the folder above it does not exist or is not writable.
    """
    above = next(folder for folder in path.absolute().parents if folder.exists())
    what = "is a folder" if path.is_dir() else ""
    try:
        with tempfile.TemporaryFile(dir=above):  # permission bits do not tell all
            pass
    except OSError as error:
        what = f"{above} is not a folder that can be written to: {reason_of(error)}"
    if what:
        raise InputFileError.at(path, f"cannot be written: {what}; expected the name of a file")


def with_toml(path: Path | None) -> list[Path]:
    """A file of commands and the TOML beside it, which is read with it; empty without a file."""
    return [] if path is None else [of_sheet(path)[0], toml_path(path)]


def json_text(document: Any, indent: int | None = 1) -> str:
    """A document, or a value of one, as JSON, without a newline at the end."""
    return json.dumps(plain(document), indent=indent, allow_nan=False, ensure_ascii=False)


def json_pieces(document: Mapping[str, Any]) -> Iterator[str]:
    """The same in pieces, with a newline at the end, so that long arrays are never one text.

    An iterator's items are written one by one, and so many rows of an array at a time.
    """
    yield from _pieces(document, 0)
    yield "\n"


# Rows of an array that are made to text at once.
_ROWS = 10_000


def _pieces(value: Any, depth: int) -> Iterator[str]:
    """A value's JSON as it stands within others."""
    start, brackets = "\n" + " " * (depth + 1), "[]"
    if isinstance(value, Mapping):
        brackets, parts = "{}", _members(value, depth + 1)
    elif isinstance(value, Iterator):
        parts = (_pieces(item, depth + 1) for item in value)
    elif isinstance(value, np.ndarray) and value.ndim and len(value) > _ROWS:
        some = (value[k : k + _ROWS] for k in range(0, len(value), _ROWS))
        # without the brackets of these rows
        parts = (iter([_indented(rows, depth)[1:].strip()[:-1].rstrip()]) for rows in some)
    else:
        yield _indented(value, depth)
        return
    opening = brackets[0]
    for part in parts:
        yield opening + start
        yield from part
        opening = ","
    yield brackets if opening == brackets[0] else start[:-1] + brackets[1]


def _members(table: Mapping[str, Any], depth: int) -> Iterator[Iterator[str]]:
    for key, value in table.items():
        yield itertools.chain(
            [f"{json.dumps(str(key), ensure_ascii=False)}: "], _pieces(value, depth)
        )


def _indented(value: Any, depth: int) -> str:
    """A value's JSON as it stands within others; no newline of its is one of a text's own."""
    return json_text(value).replace("\n", "\n" + " " * depth)


def plain(value: Any) -> Any:
    """A value in JSON's types: null for numbers that are not finite, an enum's name in lower case.

    Objects with a method ``as_json`` are replaced by its result, other dataclasses by their fields.
    """
    if type(value) is float:  # as most are
        return value if math.isfinite(value) else None
    if hasattr(value, "as_json"):
        return plain(value.as_json())
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


# Provenance of a result: version, command, day, and hashes of the files read.

# Digits of a SHA-256: enough to tell files apart.
_DIGITS = 16


def digits_of(file: Path) -> str:
    """The first digits of a file's SHA-256."""
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()[:_DIGITS]


@dataclass(frozen=True)
class Made:
    """The provenance of a result.

    Attributes:
        version: of the software. command: as it was typed. date: the day.
        files: by name, the first digits of the SHA-256 of each file that was read.
    """

    version: str
    command: str
    date: str
    files: Mapping[str, str]

    @classmethod
    def now(cls, command: str, files: Iterable[Path | None]) -> Made:
        """Today's provenance, with files and the TOML beside each; missing ones are left out."""
        given = [of_sheet(file)[0] for file in files if file is not None]
        beside = [file.with_suffix(".toml") for file in given]
        read = [file for file in dict.fromkeys([*given, *beside]) if file.is_file()]
        names = [file.name for file in read]
        hashes = {
            # files with the same name are named with their folders
            str(file) if names.count(file.name) > 1 else file.name: digits_of(file)
            for file in read
        }
        return cls(full_version(), command, date.today().isoformat(), hashes)

    @property
    def result(self) -> str:
        """The identifier of the result: of the version, the command and the files read."""
        what = json.dumps([self.version, self.command, dict(self.files)], sort_keys=True)
        return hashlib.sha256(what.encode()).hexdigest()[:_DIGITS]

    @property
    def words(self) -> str:
        """Command, date, files and the result's identifier in one line."""
        files = ", ".join(f"{name} {digits}" for name, digits in self.files.items())
        own = f"result {self.result}"
        return " · ".join(part for part in (self.command, self.date, files, own) if part)

    def as_json(self) -> dict[str, Any]:
        """``made`` in every result."""
        return {
            "result": self.result, "version": self.version, "command": self.command,
            "date": self.date, "sha256": dict(self.files),
        }  # fmt: skip
