"""A twin's answer, sealed: a file of its own that nobody reads by accident.

It is packed, not encrypted: the point is that neither a person who looks into the folder nor a
command that goes through it learns what was hidden before they mean to.
"""

from __future__ import annotations

import base64
import binascii
import json
import textwrap
import zlib
from pathlib import Path
from typing import Any

from seecr.errors import InputFileError

NAME = "answer.sealed"
_FIRST_LINE = "# What this twin hides. To see it: crosscheck twin --open"


def seal(answer: dict[str, Any]) -> str:
    """The text of a sealed file."""
    packed = zlib.compress(json.dumps(answer).encode("utf-8"), 9)
    lines = textwrap.wrap(base64.b64encode(packed).decode("ascii"), 76)
    return "\n".join([_FIRST_LINE, *lines]) + "\n"


def unseal(path: str | Path) -> dict[str, Any]:
    """The answer in a sealed file, or in the case folder that holds one.

    Raises:
        InputFileError: no such file, or not a sealed answer.
    """
    path = Path(path)
    file = path / NAME if path.is_dir() else path
    expected = f"expected a file {NAME} of crosscheck twin"
    try:
        text = file.read_text(encoding="ascii")
    except OSError as error:
        raise InputFileError.at(
            file, f"cannot be read: {error.strerror or error}; {expected}"
        ) from None
    except UnicodeDecodeError:
        raise InputFileError.at(file, f"is no sealed answer; {expected}") from None
    try:
        first, _, body = text.partition("\n")
        if first != _FIRST_LINE:
            raise ValueError
        answer = json.loads(zlib.decompress(base64.b64decode(body)))
    except (ValueError, zlib.error, binascii.Error):
        raise InputFileError.at(file, f"is no sealed answer; {expected}") from None
    if not isinstance(answer, dict):
        raise InputFileError.at(file, f"is no sealed answer; {expected}")
    return answer
