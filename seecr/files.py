"""Files of the user's, read with one line about what is wrong where one cannot be."""

from __future__ import annotations

from pathlib import Path

from seecr.errors import InputFileError


def read_bytes(path: Path, expected: str) -> bytes:
    """The bytes of a file.

    Args:
        path: the file.
        expected: what it should be, for the error.

    Raises:
        InputFileError: the file is missing or unreadable.
    """
    try:
        return path.read_bytes()
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
