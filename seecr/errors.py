"""Exceptions: each message is one line for each mistake, for the person who can remedy it."""

from __future__ import annotations

import unicodedata
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

# Most mistakes in files that are told at once: more fill a screen, and often have one cause.
_MOST_TOLD = 20


def printable(text: str, most: int | None = None) -> str:
    """Text without control characters, which would steer a terminal or break a file of XML.

    Args:
        text: such as a name in a user's file. most: characters to show; a longer text is cut.
    """
    shown = "".join("\ufffd" if _is_control(letter) else letter for letter in text)
    return shown if most is None or len(shown) <= most else f"{shown[: most - 1]}…"


def _is_control(letter: str) -> bool:
    """Whether a character is none that people see: control, surrogate, or not a character."""
    return unicodedata.category(letter) in ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")


class SeecrError(ValueError):
    """Base of every error raised on purpose, by seecr and by crosscheck.

    Attributes:
        exit_status: of a command that ends with this error (2: bad input or usage).
    """

    exit_status = 2

    def __init__(self, text: str = "") -> None:
        """Make an error; its lines show no character that would steer a terminal."""
        super().__init__("\n".join(map(printable, str(text).split("\n"))))


class RobotError(SeecrError):
    """A robot description (MJCF or numbers) that does not describe a cable robot."""


class InputError(SeecrError):
    """Arguments of a wrong shape, unit or value."""


class NoRestError(SeecrError):
    """A command without an equilibrium, where one is needed."""

    exit_status = 3


class MissingPackageError(SeecrError):
    """A request that needs a package which is not installed."""


class ExecutorError(SeecrError):
    """An executor that ended before its work."""

    exit_status = 3


class InputFileError(SeecrError):
    """A user's file that is missing, of another kind, or wrong at some place."""

    _every: list[str]

    @classmethod
    def at(
        cls,
        path: str | Path,
        text: str,
        *,
        line: int | None = None,
        column: str | None = None,
        line_word: str = "line",
    ) -> InputFileError:
        """An error whose message starts with the place: ``FILE: line 3, column t_s: text``.

        Args:
            path: the file.
            text: what was expected, what was found, what to do.
            line: counted from 1.
            column: name of the column.
            line_word: ``"row"`` for files that have no lines.
        """
        place = []
        if line is not None:
            place.append(f"{line_word} {line}")
        if column is not None:
            place.append(f"column {column}")
        start = f"{path}: {', '.join(place)}: " if place else f"{path}: "
        return cls(" ".join((start + text).split()))

    @classmethod
    def together(cls, errors: Iterable[InputFileError]) -> InputFileError:
        """One error with the lines of several, each once, and how many more there are."""
        found = (line for one in errors for line in getattr(one, "_every", [str(one)]))
        every = list(dict.fromkeys(found))
        more = len(every) - _MOST_TOLD
        told = [*every[:_MOST_TOLD], *([f"and {more} more"] if more > 0 else [])]
        error = cls("\n".join(told))
        error._every = every
        return error


class Faults:
    """Mistakes in users' files, collected so that all of them are told at once."""

    def __init__(self) -> None:
        self._found: list[InputFileError] = []

    def add(self, error: InputFileError) -> None:
        """Note a mistake."""
        self._found.append(error)

    def of(self, call: Callable[..., Any], *given: Any) -> Any:
        """What a call returns; None, with the mistake noted, if it found one."""
        try:
            return call(*given)
        except InputFileError as error:
            self.add(error)
            return None

    def check(self) -> None:
        """Raise what was found, if anything.

        Raises:
            InputFileError: with a line for each mistake.
        """
        if self._found:
            raise InputFileError.together(self._found)
