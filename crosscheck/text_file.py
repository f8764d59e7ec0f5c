"""Text files of the user's, read with errors that say what was expected."""

from __future__ import annotations

from pathlib import Path

from crosscheck.errors import InputFileError


def read_text(path: Path, expected: str) -> str:
    """The text of a UTF-8 file, with or without a byte order mark.

    Args:
        path: the file.
        expected: what it should be, for the error.

    Raises:
        InputFileError: the file is missing, unreadable or not UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputFileError.at(path, f"no such file; {expected}") from None
    except UnicodeDecodeError as error:
        text = f"is not UTF-8 (byte number {error.start + 1}); {expected}"
        raise InputFileError.at(path, text) from None
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputFileError.at(path, f"cannot be read: {reason}; {expected}") from None
