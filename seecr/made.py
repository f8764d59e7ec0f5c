"""Provenance of a result: version, command, day, and hashes of the files read."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

from seecr import __version__

__all__ = ["Made", "digits_of"]

# Digits of a SHA-256: enough to tell files apart.
_DIGITS = 16


def digits_of(file: Path) -> str:
    """The first digits of a file's SHA-256."""
    return hashlib.sha256(file.read_bytes()).hexdigest()[:_DIGITS]


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
        given = [file for file in files if file is not None]
        beside = [file.with_suffix(".toml") for file in given]
        read = [file for file in dict.fromkeys([*given, *beside]) if file.is_file()]
        names = [file.name for file in read]
        hashes = {
            # files with the same name are named with their folders
            str(file) if names.count(file.name) > 1 else file.name: digits_of(file)
            for file in read
        }
        return cls(__version__, command, date.today().isoformat(), hashes)

    @property
    def words(self) -> str:
        """Command, date and files in one line."""
        files = ", ".join(f"{name} {digits}" for name, digits in self.files.items())
        return " · ".join(part for part in (self.command, self.date, files) if part)

    def as_json(self) -> dict[str, Any]:
        """``made`` in every result."""
        return {
            "version": self.version, "command": self.command, "date": self.date,
            "sha256": dict(self.files),
        }  # fmt: skip
